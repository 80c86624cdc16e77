//! The whole error model on stations that took no part in its training.

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::{Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::{FullModel, FullSettings, Query};
use posegrid::fit::{self, FitSettings, Freedom, Noise, Observation, TrackerUncertainty};
use posegrid::geometry::{align, isometry_from_rpy};
use posegrid::join::{JoinSettings, join};
use posegrid::kinematics::Arm;

const NOISE: Noise = Noise {
    tracker: TrackerUncertainty {
        range_um: 10.0,
        range_um_per_m: 0.3,
        transverse_um: 15.0,
        transverse_um_per_m: 6.0,
        divisor: 2.0,
        orientation_rad: None,
    },
    repeatability_mm: 0.03,
    orientations: false,
};

fn trained(arm: &Arm, observations: &[Observation], sessions: usize) -> FullModel {
    let settings = FitSettings::default();
    let start =
        fit::identify(arm, observations, sessions, Freedom::Geometry, &settings).expect("a fit");
    FullModel::train(
        arm,
        observations,
        &start.frames,
        &start.geometry,
        settings.prior(),
        &FullSettings::default(),
        Some(Vector3::z_axis()),
    )
    .expect("a positive definite model")
}

/// Predicted target positions for a session that took no part, in the tracker frame of the first training session.
fn predictions(model: &FullModel, test: &[Observation]) -> Vec<Point3<f64>> {
    let query = |o: &Observation| {
        let query = Query {
            axes: &o.axes,
            shortfall: o.shortfall.as_deref(),
            lever: Vector3::zeros(),
            session: 0,
            own: false,
            station: Some(o.station),
        };
        model.predict(&query).position
    };
    test.iter().map(query).collect()
}

/// Error norms with the base refitted on all test stations, unweighted.
fn base_refitted(predicted: &[Point3<f64>], test: &[Observation]) -> Figures {
    let measured: Vec<Point3<f64>> = test.iter().map(|o| o.position).collect();
    let base = align(predicted, &measured, &vec![1.0; measured.len()]).expect("stations in space");
    let norms: Vec<f64> = measured
        .iter()
        .zip(predicted)
        .map(|(m, p)| (base * m - p).norm())
        .collect();
    Figures::of(&norms).expect("stations")
}

/// A recording, joined, as observations with what its commands fell short of.
fn observed(name: &str, arm: &Arm, noise: &Noise) -> Option<Vec<Observation>> {
    let recording = common::session(name, arm)?;
    let joined = join(&recording, arm, &JoinSettings::default()).expect(name);
    let frames = CommandFrames {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
    };
    let commanded = commanded(&joined.stations, arm, &frames);
    println!("{name}: {:?}", commanded.trust);
    let mut observations = fit::observations(0, &joined.stations, arm, noise);
    fit::add_shortfalls(&mut observations, &joined.stations, &commanded);
    Some(observations)
}

#[test]
fn random_a_predicts_random_b() {
    let arm = common::arm("ur10");
    let six = Noise {
        orientations: true,
        tracker: TrackerUncertainty {
            orientation_rad: Some(130e-6),
            ..NOISE.tracker
        },
        ..NOISE
    };
    for noise in [NOISE, six] {
        let (Some(a), Some(b)) = (
            observed("ur10-random-a", &arm, &noise),
            observed("ur10-random-b", &arm, &noise),
        ) else {
            return;
        };
        for (stride, count) in [(1, 700), (3, 200), (7, 100)] {
            let train: Vec<_> = a
                .iter()
                .filter(|o| o.station % stride == 0 && o.station < stride * count)
                .cloned()
                .collect();
            let start = std::time::Instant::now();
            let model = trained(&arm, &train, 1);
            let figures = base_refitted(&predictions(&model, &b), &b);
            println!(
                "{count}: {:?} mean {:.4} rms {:.4} p95 {:.3} max {:.3}",
                start.elapsed(),
                figures.mean,
                figures.rms,
                figures.p95,
                figures.max
            );
            println!("  {:?}", model.parts);
            println!(
                "  columns {} lines {:?}",
                model.layout().size(),
                (0..6).map(|j| model.layout().lines(j)).collect::<Vec<_>>()
            );
        }
    }
}
