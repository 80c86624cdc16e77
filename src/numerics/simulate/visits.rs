//! Visits without logs: the station that the join would find for each, for plans that simulate many robots.
//!
//! The errors of arm, controller and instrument are those of [`super::simulate`]; a station's mean of n readings has the noise
//! that all n share, plus the noise of one reading divided by √n.

use nalgebra::Point3;

use super::poses::Commanded;
use super::random::{Ingredient, Stream};
use super::settings::SimulateSettings;
use super::timeline::Timeline;
use super::tracker::{Mean, View};
use super::true_arm::ArmErrors;
use super::truth::TrueStation;
use crate::join::{MeanOrientation, MeanPoint, Reading, SourceId, Station, TargetId, Value};
use crate::kinematics::Arm;
use crate::units::Stamp;

#[derive(Debug, Clone)]
pub struct Visit {
    pub station: Station,
    pub truth: TrueStation,
}

impl Visit {
    /// The station as a perfect instrument would measure it, even where the beam was lost.
    pub fn perfect(&self, settings: &SimulateSettings) -> Station {
        let mean = Mean {
            position: Point3::from(self.truth.tracker_from_target.translation.vector),
            orientation: self.truth.tracker_from_target.rotation,
            scatter: (0.0, 0.0),
            readings: 1,
        };
        let seen = TrueStation { measured: true, ..self.truth.clone() };
        station(&seen, settings, &mean)
    }
}

/// Visits `commanded` in order with the arm of `errors`; `settings.seed` is the session's seed, not the arm's.
pub fn visits(
    arm: &Arm,
    settings: &SimulateSettings,
    errors: &ArmErrors,
    commanded: &[Commanded],
) -> Vec<Visit> {
    let timeline = Timeline::plan(arm, settings, errors, commanded);
    let view = View::new(arm, settings, errors, &timeline);
    let mut noise = Stream::new(settings.seed, Ingredient::Reading);
    let stops = timeline.stops.iter().enumerate();
    stops
        .map(|(number, stop)| {
            let truth = TrueStation::of(number, stop, &view);
            let mean = view.mean(number, &truth.tracker_from_target, &mut noise);
            Visit { station: station(&truth, settings, &mean), truth }
        })
        .collect()
}

fn station(truth: &TrueStation, settings: &SimulateSettings, mean: &Mean) -> Station {
    let point = MeanPoint {
        position: mean.position,
        scatter_mm: [mean.scatter.0; 3],
        stated_covariance: None,
        motion_covariance: None,
    };
    let turn = MeanOrientation {
        orientation: mean.orientation,
        scatter_rad: mean.scatter.1,
        stated_covariance: None,
    };
    let reading = truth.measured.then(|| Reading {
        source: SourceId::ONLY,
        target: TargetId::ONLY,
        value: Value::of(point, settings.cell.six_dof.then_some(turn)),
        kept: mean.readings,
        taken: mean.readings,
        first: Stamp::from_ns(truth.start.ns()),
        last: Stamp::from_ns(truth.end.ns()),
        temperature_c: None,
    });
    truth.station(mean.readings, reading)
}
