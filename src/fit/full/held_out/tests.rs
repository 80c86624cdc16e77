use nalgebra::UnitVector3;

use super::*;
use crate::fit::Prior;
use crate::fit::conversion::tests::{FILES, Truth};
use crate::fit::full::FullModel;
use crate::fit::full::rows::sums;
use crate::fit::{FitSettings, Freedom, Observation, identify_from};

fn truth(beyond: fn(&mut [f64]) -> Vector3<f64>) -> Truth {
    let mut truth = Truth::new(FILES[1], [60.0, -35.0, 110.0]);
    truth.beyond = beyond;
    truth
}

/// Few harmonics: training takes no time.
fn settings() -> FullSettings {
    FullSettings {
        harmonics: 40,
        gear_lines: false,
        drift: false,
        ..FullSettings::default()
    }
}

fn geometry(truth: &Truth, seen: &[Observation]) -> (Vec<crate::fit::Frames>, Vec<f64>, Prior) {
    let fit = FitSettings::default();
    let starts = std::slice::from_ref(&truth.frames);
    let found = identify_from(&truth.arm, seen, starts, Freedom::Geometry, &fit);
    (found.frames, found.geometry, fit.prior())
}

fn curves(truth: &Truth) -> PartEvidence {
    let seen = truth.observed(false);
    let (frames, offsets, prior) = geometry(truth, &seen);
    let up: Option<UnitVector3<f64>> = None;
    let model = FullModel::train(
        &truth.arm,
        &seen,
        &frames,
        &offsets,
        &prior,
        &settings(),
        up,
    );
    model.expect("a model").parts[0].clone()
}

#[test]
fn curves_are_kept_where_errors_are_functions_of_the_joints() {
    // Two joints stand a milliradian beside what they report, in waves.
    let found = curves(&truth(|q| {
        q[0] += 1e-3 * (3.0 * q[0]).sin();
        q[1] += 0.5e-3 * (2.0 * q[1]).cos();
        Vector3::zeros()
    }));
    assert!(found.kept && found.gain > 10.0, "{found:?}");
}

#[test]
fn curves_are_dropped_where_errors_are_functions_of_several_joints_at_once() {
    let found = curves(&truth(|q| {
        Vector3::new(
            (5.0 * q[0] + 7.0 * q[1]).sin(),
            (4.0 * q[1] - 6.0 * q[2]).cos(),
            (3.0 * q[2] * q[3]).sin(),
        ) * 1.5
    }));
    assert!(!found.kept && found.gain < 0.0, "{found:?}");
}

#[test]
fn left_out_residuals_are_those_of_a_model_that_never_saw_the_block() {
    let truth = truth(|q| Vector3::x() * (2.0 * q[1]).cos());
    let seen: Vec<Observation> = truth.observed(false).into_iter().take(60).collect();
    let (frames, offsets, prior) = geometry(&truth, &seen);
    let problem = Problem::with_target_turn(
        &seen,
        truth.arm.chain(),
        &frames,
        Freedom::Geometry,
        &prior,
        false,
    );
    let mut start = DVector::zeros(problem.unknowns().len());
    start.rows_mut(0, offsets.len()).copy_from_slice(&offsets);
    let settings = FullSettings {
        harmonics: 4,
        ..settings()
    };
    let settled = train(&problem, start, &settings, None).expect("a model");
    let rows = rows(&problem, &settled.state, None);
    let (_, covariances) = sums(&problem, &settled.state, &rows, &settled.prior_mean);
    let mean = settled.posterior.mean() + &settled.prior_mean;
    let block: Vec<usize> = (0..rows.len()).filter(|place| place % 5 == 2).collect();
    let found = settled
        .left_out(&rows, &covariances, &mean, &block)
        .expect("left out");
    // The same posterior from all other rows, by its definition.
    let size = settled.state.layout.size();
    let (mut information, mut moment) = (DMatrix::zeros(size, size), DVector::zeros(size));
    for place in (0..rows.len()).filter(|place| place % 5 != 2) {
        let weight = covariances[place]
            .clone()
            .try_inverse()
            .expect("a covariance");
        let value = &rows[place].value - &rows[place].rows * &settled.prior_mean;
        information += rows[place].rows.tr_mul(&(&weight * &rows[place].rows));
        moment += rows[place].rows.tr_mul(&(weight * value));
    }
    let scale = &settled.posterior.scale;
    let matrix = DMatrix::from_fn(size, size, |row, column| {
        let own = if row == column { 1.0 } else { 0.0 };
        own + scale[row] * information[(row, column)] * scale[column]
    });
    let whitened = matrix
        .cholesky()
        .expect("positive definite")
        .solve(&moment.component_mul(scale));
    let without = whitened.component_mul(scale) + &settled.prior_mean;
    let wanted: f64 = block
        .iter()
        .map(|&place| (&rows[place].value - &rows[place].rows * &without).norm())
        .sum();
    assert!((found - wanted).abs() < 1e-6 * wanted, "{found} {wanted}");
}
