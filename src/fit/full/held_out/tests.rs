use nalgebra::UnitVector3;

use super::*;
use crate::fit::Prior;
use crate::fit::conversion::tests::{FILES, Truth};
use crate::fit::full::FullModel;
use crate::fit::full::leave_one_out::leave_one_out;
use crate::fit::full::regression::{Evidence, Sums};
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

/// Sixty observations of an arm with a curve, and a model of them; with many harmonics their rows are few beside its columns.
fn with_settled(harmonics: usize, check: impl Fn(&Problem<'_>, &Settled)) {
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
        harmonics,
        ..settings()
    };
    let settled = train(&problem, start, &settings, None).expect("a model");
    check(&problem, &settled);
}

#[test]
fn left_out_residuals_are_those_of_a_model_that_never_saw_the_block() {
    with_settled(4, never_saw_the_block);
    with_settled(40, never_saw_the_block);
}

fn never_saw_the_block(problem: &Problem<'_>, settled: &Settled) {
    let rows = rows(problem, &settled.state, None);
    let covariances = covariances(&settled.state, &rows);
    let mean = settled.posterior.mean() + &settled.prior_mean;
    let block: Vec<usize> = (0..rows.len()).filter(|place| place % 5 == 2).collect();
    let left_open = left_open(&settled.posterior, &covariances);
    let found = settled
        .left_out((&rows, &covariances), left_open.as_ref(), &mean, &block)
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

#[test]
fn few_rows_leave_stations_out_as_their_sums_do() {
    with_settled(40, |problem, settled| {
        let Evidence::Rows(few) = &settled.evidence else {
            panic!("180 rows of some 500 columns are few");
        };
        let sums = Sums::new(&few.transposed.transpose(), &few.values, few.ln_noise);
        let scale = settled.posterior.scale.map(|sd| sd * sd);
        let summed = sums.posterior(&scale).expect("positive definite");
        let rows = rows(problem, &settled.state, None);
        let covariances = covariances(&settled.state, &rows);
        let by = |posterior| {
            let prior_mean = &settled.prior_mean;
            leave_one_out(&settled.state, &rows, prior_mean, &covariances, posterior)
        };
        // Places may be off by 300 mm before and 0.02 mm after: of sixteen digits ten are lost in either form.
        for (few, many) in by(&settled.posterior).iter().zip(by(&summed)) {
            let apart = (&few.residual - &many.residual).norm();
            assert!(apart < 1e-4 * (1.0 + many.residual.norm()), "{apart}");
            let apart = (&few.information - &many.information).norm();
            assert!(apart < 1e-4 * many.information.norm(), "{apart}");
            let apart = few.distance_squared - many.distance_squared;
            assert!(
                apart.abs() < 1e-4 * (1.0 + many.distance_squared),
                "{apart}"
            );
        }
    });
}
