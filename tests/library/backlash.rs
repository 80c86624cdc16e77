//! Backlash that no command shows: a session finds it, and targets that are approached from any side lie inside the ellipsoids.

use nalgebra::Matrix3;
use posegrid::fit::full::{FullModel, Query};
use posegrid::fit::model::PartEvidence;
use posegrid::fit::{self, FitSettings, Observation};
use posegrid::kinematics::Arm;
use posegrid::simulate::{Poses, SimulateSettings, simulate};

use crate::common::{NOISE, arm, position, trained::trained};

/// The stations that train and those that are predicted, of an arm that stands exactly at its commands, but for its backlash.
fn session(arm: &Arm, backlash_rad: f64) -> (Vec<Observation>, Vec<Observation>) {
    let degrees = |own: [f64; 6]| own.map(f64::to_radians).to_vec();
    let poses = Poses::Joints {
        count: 500,
        lower: degrees([-60.0, -105.0, 60.0, -90.0, 20.0, -120.0]),
        upper: degrees([60.0, -45.0, 130.0, 90.0, 100.0, 120.0]),
    };
    let home = degrees([0.0, -75.0, 95.0, 0.0, 60.0, 0.0]);
    let mut settings = SimulateSettings::realistic(7, home, poses);
    settings.joints.backlash_rad = backlash_rad;
    settings.joints.stops_short_rad = 0.0;
    settings.cell.base_drift_mm = 0.0;
    let simulated = simulate(arm, &settings).expect("in reach");
    let mut own = fit::observations(0, &simulated.stations(), arm, &NOISE);
    own.retain(|own| own.point().is_some());
    own.into_iter().partition(|own| own.station < 300)
}

fn backlash(model: &FullModel) -> Option<&PartEvidence> {
    model.trained.parts.iter().find(|part| part.name == "backlash")
}

/// Squared normalised errors of predictions for the stations of another session.
fn squares(model: &FullModel, stations: &[Observation]) -> Vec<f64> {
    let square = |own: &Observation| {
        let predicted = model.predict(&Query { station: None, ..Query::of(own) });
        let noise = own.point().expect("a place").instrument;
        let repeatability = Matrix3::identity() * model.trained.repeatability.position;
        let covariance =
            model.covariances(&predicted.rows)[0] + predicted.approach + noise + repeatability;
        let off = position(own) - predicted.position;
        off.dot(&(covariance.try_inverse().expect("positive") * off))
    };
    stations.iter().map(square).collect()
}

#[test]
fn backlash_that_no_command_shows_is_in_the_ellipsoids() {
    let arm = arm("kr210-r2700-extra");
    let settings = FitSettings::default();
    let (training, others) = session(&arm, 150e-6);
    let model = trained(&arm, &training, 1, &settings);
    assert!(backlash(&model).expect("found").gain > 50.0);
    let squares = squares(&model, &others);
    let inside = squares.iter().filter(|own| **own < 7.81).count() as f64 / squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    // A sum of a few offsets to either side has no normal distribution's tails: of a right covariance more than 95 % are inside.
    assert!(inside > 0.92 && (1.5..4.5).contains(&mean), "{inside}, mean square {mean} of 3");

    let sound = trained(&arm, &session(&arm, 0.0).0, 1, &settings);
    assert_eq!(backlash(&sound), None);
}
