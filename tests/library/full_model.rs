//! The full error model on stations that took no part in its training.

use crate::common;

use common::NOISE;
use common::trained::{base_refitted, predictions, random_sessions, trained};
use nalgebra::{Point3, Vector3};
use posegrid::fit::full::{FullModel, Query};
use posegrid::fit::{self, FitSettings, Freedom, Observation};

#[test]
fn random_a_predicts_random_b() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    // Stations 0, s, 2s, … of a; the base alone refitted on b.
    for (stride, count, limit) in [(1, 700, 0.048), (3, 200, 0.062), (7, 100, 0.085)] {
        let is_used =
            |o: &&Observation| o.station.is_multiple_of(stride) && o.station < stride * count;
        let train: Vec<_> = a.iter().filter(is_used).cloned().collect();
        let model = trained(&arm, &train, 1, &FitSettings::default());
        let figures = base_refitted(&predictions(&model, &b), &b);
        println!("{count} stations: {figures:?}");
        assert!(figures.mean <= limit, "{count} stations: {figures:?}");
        assert_curves_are_of_their_columns(&model);
    }
}

/// Joint error curves, and their deviations where a joint has no gear lines, by rows over all columns of the model.
fn assert_curves_are_of_their_columns(model: &FullModel) {
    let angles = [-1.0, 0.0, 0.7];
    let curves = model.joint_curves();
    let mut without_lines = 0;
    for joint in 0..6 {
        let rows = model.curve_rows(joint, &angles);
        let (mean, covariance) = (model.means_of_rows(&rows), model.covariance_of_rows(&rows));
        for (place, found) in curves.errors(joint, &angles).iter().enumerate() {
            assert!((found.curve - mean[place]).abs() < 1e-12, "{found:?}");
            let sd = covariance[(place, place)].sqrt();
            if found.gear_lines == 0.0 {
                without_lines += 1;
                assert!((found.sd - sd).abs() < 1e-9 * sd, "{found:?} for {sd:e}");
            }
        }
    }
    assert!(without_lines > 0, "every joint has gear lines");
}

#[test]
fn gross_outliers_hardly_move_the_answer_and_stand_out() {
    let arm = common::arm("ur10");
    let Some((mut a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    // Every twentieth station is 2 mm off, in a direction of its own.
    for observation in a.iter_mut().filter(|o| o.station.is_multiple_of(20)) {
        let turn = f64::from(u32::try_from(observation.station).expect("a small number"));
        let point = observation.measured.point_mut().expect("a position");
        point.position +=
            Vector3::new(turn.sin(), turn.cos(), (1.7 * turn).sin()).normalize() * 2.0;
    }
    let model = trained(&arm, &a, 1, &FitSettings::default());
    let figures = base_refitted(&predictions(&model, &b), &b);
    assert!(figures.mean <= 0.055, "{figures:?}");
    let mut order: Vec<usize> = (0..a.len()).collect();
    order.sort_by(|&i, &j| model.trained.weights[i].total_cmp(&model.trained.weights[j]));
    assert!(
        order[..35].iter().all(|&i| a[i].station.is_multiple_of(20)),
        "the least weights are the outliers'"
    );
}

/// Mean variance per axis that the model states for its predictions on `test`, mm².
fn stated_variance(model: &FullModel, test: &[Observation]) -> f64 {
    let variance = |o: &Observation| {
        let query = Query { station: None, ..Query::of(o) };
        model.covariances(&model.predict(&query).rows)[0].trace() / 3.0
    };
    test.iter().map(variance).sum::<f64>() / test.len() as f64
}

#[test]
fn ten_stations_give_a_sound_answer_that_knows_how_little_it_knows() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let every = |stride: usize| {
        a.iter().filter(|o| o.station.is_multiple_of(stride)).cloned().collect::<Vec<_>>()
    };
    let (few, many) = (
        trained(&arm, &every(70), 1, &FitSettings::default()),
        trained(&arm, &every(7), 1, &FitSettings::default()),
    );
    // The fast way to a mean is the rows' way.
    for o in &b[..20] {
        let query = Query { lever: Vector3::new(1.0, 2.0, 3.0), ..Query::of(o) };
        let apart = (many.position(&query) - many.predict(&query).position).norm();
        assert!(apart < 1e-6, "{apart} mm: a nanometre is what tables of the curves may cost");
    }
    let few_figures = base_refitted(&predictions(&few, &b), &b);
    // The same ten stations with the nominal arm, base and target alone.
    let nominal =
        fit::identify(&arm, &every(70), 1, Freedom::BaseAndTarget, &FitSettings::default())
            .expect("a fit");
    let target = *nominal.frames[0].targets()[0].origin().point();
    let of_nominal: Vec<Point3<f64>> =
        b.iter().map(|o| arm.chain().nominal(&o.axes) * target).collect();
    let nominal = base_refitted(&of_nominal, &b);
    println!("10 stations: {few_figures:?}, nominal arm {nominal:?}");
    assert!(few_figures.mean < 1.1 * nominal.mean, "{few_figures:?}, nominal arm {nominal:?}");
    assert!(stated_variance(&few, &b) > 4.0 * stated_variance(&many, &b));
}

#[test]
fn a_station_that_stands_twice_changes_little() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let once: Vec<_> = a.iter().filter(|o| o.station.is_multiple_of(7)).cloned().collect();
    let mut twice = once.clone();
    twice.extend(once[..5].to_vec());
    let apart = predictions(&trained(&arm, &once, 1, &FitSettings::default()), &b)
        .iter()
        .zip(predictions(&trained(&arm, &twice, 1, &FitSettings::default()), &b))
        .map(|(p, q)| (p - q).norm())
        .sum::<f64>()
        / b.len() as f64;
    assert!(apart < 0.05, "{apart:.4} mm apart on average");
}
