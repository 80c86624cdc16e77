//! Observations of the real recordings, full error models of them, and what those leave on other sessions.

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::{FullModel, FullSettings, Purpose, Query};
use posegrid::fit::{self, FitSettings, Freedom, Noise, Observation};
use posegrid::geometry::{align, isometry_from_rpy};
use posegrid::join::{JoinSettings, join};
use posegrid::kinematics::Arm;

use super::position;

/// The full error model of some observations.
pub fn trained(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &FitSettings,
) -> FullModel {
    let start =
        fit::identify(arm, observations, sessions, Freedom::Geometry, settings).expect("a fit");
    FullModel::train(
        arm,
        observations,
        (&start.frames[..], &start.geometry[..]),
        &settings.prior(),
        &FullSettings::default(),
        Purpose::Published,
        Some(Vector3::z_axis()),
    )
    .expect("a positive definite model")
}

/// Predicted target positions for a session that took no part, in the tracker frame of the first training session.
pub fn predictions(model: &FullModel, test: &[Observation]) -> Vec<Point3<f64>> {
    let query = |o: &Observation| {
        let query = Query { session: 0, own: false, ..Query::of(o) };
        model.predict(&query).position
    };
    test.iter().map(query).collect()
}

/// Error norms with the base refitted on all test stations, unweighted.
pub fn base_refitted(predicted: &[Point3<f64>], test: &[Observation]) -> Figures {
    let measured: Vec<Point3<f64>> = test.iter().map(position).collect();
    let base = align(predicted, &measured, &vec![1.0; measured.len()]).expect("stations in space");
    let norms: Vec<f64> =
        measured.iter().zip(predicted).map(|(m, p)| (base * m - p).norm()).collect();
    Figures::of(&norms).expect("stations")
}

/// A recording, joined, as observations with what its commands fell short of.
pub fn observed(name: &str, arm: &Arm, noise: &Noise) -> Option<Vec<Observation>> {
    let read = super::session(name, arm)?;
    let joined = join(&read.input, arm, &JoinSettings::default()).expect(name);
    let frames = CommandFrames {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
    };
    let commanded = commanded(&joined.stations, arm, &frames);
    let mut observations = fit::observations(0, &joined.stations, arm, noise);
    fit::add_commands(&mut observations, &joined.stations, &commanded);
    Some(observations)
}

/// The two sessions of random poses, as [`observed`].
pub fn random_sessions(arm: &Arm, noise: &Noise) -> Option<(Vec<Observation>, Vec<Observation>)> {
    Some((observed("ur10-random-a", arm, noise)?, observed("ur10-random-b", arm, noise)?))
}
