//! How near the full error model comes on stations and sessions that took no part (mean error norms, mm): the figures that
//! this kind of calibration is judged by. Settings are the defaults; nothing is fitted to the stations that judge but
//! the base, and the target where a session has a mounting of its own.

use crate::common;

use common::trained::{observed, predictions, random_sessions, trained};
use common::{NOISE, position};
use nalgebra::{Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::full::{FullModel, Query};
use posegrid::fit::{FitSettings, KnownTarget, Noise, Observation};
use posegrid::join::ReadingKind;
use posegrid::kinematics::Arm;
use posegrid::report::refit::{Placed, refit};

/// Where the target sits at the flange, roughly: one tool orientation does not show it.
const TARGET: KnownTarget = KnownTarget { xyz_mm: [-0.2, 0.2, 92.8], sd_mm: 1.0 };

fn settings(orientations: bool) -> FitSettings {
    FitSettings { orientations, target: Some(TARGET), ..FitSettings::default() }
}

fn with_orientations() -> Noise {
    let mut noise = NOISE.clone();
    noise.sources[0].reads = ReadingKind::Pose;
    common::state_orientation(&mut noise, 130e-6);
    noise
}

/// Sessions as one pool, numbered in their order.
fn pool(sessions: &[&[Observation]]) -> Vec<Observation> {
    let numbered = |(session, own): (usize, &&[Observation])| {
        let of = move |o: &Observation| Observation { session, ..o.clone() };
        own.iter().map(of).collect::<Vec<_>>()
    };
    sessions.iter().enumerate().flat_map(numbered).collect()
}

fn figures(errors: impl Iterator<Item = Vector3<f64>>) -> Figures {
    Figures::of(&errors.map(|error| error.norm()).collect::<Vec<_>>()).expect("stations")
}

/// What is left on stations of sessions that the model was trained on.
fn own_session(model: &FullModel, test: &[Observation]) -> Figures {
    let left = |o: &Observation| position(o) - model.position(&Query::of(o));
    figures(test.iter().map(left))
}

/// What is left on a session of another mounting, base and target refitted on all its stations.
fn unseen_session(arm: &Arm, model: &FullModel, test: &[Observation]) -> Figures {
    let predicted = predictions(model, test);
    let placed = |(position, o): (Point3<f64>, &Observation)| Placed {
        position,
        flange: model.frames[0].sources()[0].isometry().rotation
            * arm.chain().nominal(&o.axes).rotation,
    };
    let placed: Vec<Placed> = predicted.into_iter().zip(test).map(placed).collect();
    let measured: Vec<Point3<f64>> = test.iter().map(position).collect();
    let found = refit(&measured, &placed, true).expect("stations in space");
    figures(measured.iter().zip(&placed).map(|(measured, placed)| {
        found.base_from_tracker * measured - (placed.position + placed.flange * found.target_shift)
    }))
}

#[test]
fn even_stations_of_two_sessions_predict_odd_ones() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let (even, odd): (Vec<_>, Vec<_>) =
        pool(&[&a, &b]).into_iter().enumerate().partition(|(place, _)| place % 2 == 0);
    let stations = |half: Vec<(usize, Observation)>| half.into_iter().map(|(_, o)| o).collect();
    let (even, odd): (Vec<_>, Vec<_>) = (stations(even), stations(odd));
    let found = own_session(&trained(&arm, &even, 2, &settings(false)), &odd);
    println!("even/odd: {found:?}");
    assert!(found.mean <= 0.050, "{found:?}");
}

/// The reference split of the grid: whether a commanded place, mm, lies in a block that is held out.
fn is_held_out(place: &Point3<f64>) -> bool {
    let odd = |value: f64, origin: f64, width: f64| {
        ((value.round() - origin) / width).floor().rem_euclid(2.0) > 0.5
    };
    odd(place.x, 625.0, 100.0) && odd(place.y, -650.0, 200.0) && !odd(place.z, 350.0, 200.0)
}

#[test]
fn blocks_of_the_grid_that_were_held_out_are_predicted() {
    let arm = common::arm("ur10");
    let (Some(grid), Some(truth)) =
        (observed("ur10-grid", &arm, &with_orientations()), common::truth_stations("ur10-grid"))
    else {
        return;
    };
    let place = |o: &Observation| {
        let station = truth.iter().find(|s| s.number == o.station);
        let command = station.and_then(|s| s.command.as_ref());
        command.expect("every station has a command").position
    };
    let (test, train): (Vec<_>, Vec<_>) = grid.into_iter().partition(|o| is_held_out(&place(o)));
    assert_eq!((train.len(), test.len()), (519, 96));
    let found = own_session(&trained(&arm, &train, 1, &settings(true)), &test);
    println!("grid blocks: {found:?}");
    assert!(found.mean <= 0.052, "{found:?}");
}

#[test]
fn pools_predict_a_session_of_another_month() {
    let arm = common::arm("ur10");
    let session = |name: &str| observed(name, &arm, &NOISE);
    let (Some(a), Some(b), Some(joint), Some(grid)) = (
        session("ur10-random-a"),
        session("ur10-random-b"),
        session("ur10-joint"),
        session("ur10-grid"),
    ) else {
        return;
    };
    let judged = |train: &[&[Observation]], test: &[Observation], limit: f64| {
        let model = trained(&arm, &pool(train), train.len(), &settings(false));
        let found = unseen_session(&arm, &model, test);
        println!("{} sessions pooled: {found:?}", train.len());
        assert!(found.mean <= limit, "{found:?}");
    };
    judged(&[&a, &b, &grid], &joint, 0.19);
    judged(&[&a, &joint], &grid, 0.15);
    judged(&[&a, &joint, &grid], &b, 0.06);
}
