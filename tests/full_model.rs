//! The whole error model on stations that took no part in its training.

mod common;

use nalgebra::{Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::full::{FullModel, FullSettings, Query};
use posegrid::fit::{self, FitSettings, Freedom, Noise, Observation, TrackerUncertainty};
use posegrid::geometry::align;
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

#[test]
fn random_a_predicts_random_b() {
    let arm = common::arm("ur10");
    let (Some(a), Some(b)) = (
        common::truth_stations("ur10-random-a"),
        common::truth_stations("ur10-random-b"),
    ) else {
        return;
    };
    let test = fit::observations(0, &b, &arm, &NOISE);
    for (stride, count, limit) in [(1, 700, 0.0), (3, 200, 0.0), (7, 100, 0.0)] {
        let train: Vec<_> = a.iter().step_by(stride).take(count).cloned().collect();
        let train = fit::observations(0, &train, &arm, &NOISE);
        let start = std::time::Instant::now();
        let model = trained(&arm, &train, 1);
        let figures = base_refitted(&predictions(&model, &test), &test);
        let _ = limit;
        println!("{count}: {figures:?}");
        println!(
            "  {:?} ev {:.1} {:?} {:?}",
            start.elapsed(),
            model.log_evidence(),
            model.parts,
            model.repeatability
        );
        println!(
            "  columns {} lines {:?}",
            model.layout().size(),
            (0..6).map(|j| model.layout().lines(j)).collect::<Vec<_>>()
        );
    }
}
