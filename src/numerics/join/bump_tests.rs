//! Bumps of the instrument that are larger than the gate of the join, on synthetic sessions with known truth: with three references, with
//! one, and without any.

use std::cmp::Ordering;

use nalgebra::{Isometry3, Point3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::moved::Elsewhere;
use super::references::Event;
use super::scene::{Scene, check_conservation, gaussian, join_beside, paired, ur10};
use super::*;
use crate::ingest::{Recording, TargetReadings};

const STATIONS: usize = 60;
/// References on the floor in the instrument's frame, mm.
const FLOOR: [[f64; 3]; 3] =
    [[3000.0, 200.0, -700.0], [2200.0, -2100.0, -720.0], [4100.0, -1300.0, -650.0]];

/// A bump at a moment of controller time: everything is read elsewhere from there on.
#[derive(Clone, Copy)]
struct Bump {
    at_s: f64,
    by: Isometry3<f64>,
}

impl Bump {
    /// Between two stations: a shift along a slant, mm, and a turn about another, degrees.
    fn before(scene: &Scene, station: usize, mm: f64, deg: f64) -> Self {
        let along = Vector3::new(0.6, -0.64, 0.48) * mm;
        let about = Vector3::new(0.48, 0.6, 0.64) * deg.to_radians();
        Self { at_s: scene.starts_s()[station] - 0.4, by: Isometry3::new(along, about) }
    }

    fn put_on(&self, scene: &Scene, readings: &mut TargetReadings) {
        for (at, position) in readings.stamps.iter().zip(&mut readings.positions) {
            if scene.controller_s(at.ns()) >= self.at_s {
                *position = (self.by * Point3::from(*position)).into();
            }
        }
    }
}

/// The first `count` references of [`FLOOR`], each read at the target's moments with 20 µm noise.
fn references(scene: &Scene, recording: &Recording, count: usize) -> Vec<ReferenceReadings> {
    let named = FLOOR.into_iter().take(count).enumerate();
    let read = named.map(|(place, at)| {
        let mut rng = ChaCha8Rng::seed_from_u64(scene.seed ^ (0xf100 + place as u64));
        let stamps = recording.readings.stamps.clone();
        let positions = stamps.iter().map(|_| at.map(|x| x + 0.02 * gaussian(&mut rng)));
        ReferenceReadings {
            name: format!("F{}", place + 1),
            on: StandsOn::Floor,
            readings: Box::new(TargetReadings {
                positions: positions.collect(),
                stamps,
                ..TargetReadings::default()
            }),
        }
    });
    read.collect()
}

/// A session with bumps and references, joined; conservation is checked.
fn joined(scene: &Scene, bumps: &[Bump], count: usize) -> Joined {
    let arm = ur10();
    let mut recording = scene.record(&arm);
    let mut beside = references(scene, &recording, count);
    for bump in bumps {
        bump.put_on(scene, &mut recording.readings);
        for own in &mut beside {
            let mut moved = own.readings.read(0..own.readings.count()).expect("in memory");
            bump.put_on(scene, &mut moved);
            own.readings = Box::new(moved);
        }
    }
    let joined = join_beside(&recording, beside, &arm, &JoinSettings::default());
    let mut joined = joined.unwrap_or_else(|error| panic!("{error}"));
    let of_references = |own: &JoinReject| own.is_of_reference;
    let beside: Vec<JoinReject> = joined.rejects.extract_if(.., |own| of_references(own)).collect();
    check_conservation(&recording, &joined);
    joined.rejects.extend(beside);
    joined
}

/// Distances of the stations' readings from where the instrument saw them before any bump, mm.
fn off_mm(scene: &Scene, joined: &Joined) -> Vec<f64> {
    let (arm, starts_s) = (ur10(), scene.starts_s());
    let measured = joined.stations.iter().filter_map(|own| {
        let position = own.readings.first()?.position()?;
        let middle_ns = i64::midpoint(own.start.ns(), own.end.ns()) - scene.origin_ns;
        let truth = scene.target(&arm, &scene.angles(&starts_s, middle_ns as f64 / NS_PER_S));
        Some((position.coords - truth).norm())
    });
    measured.collect()
}

fn bumps(joined: &Joined) -> Vec<(f64, f64)> {
    let events = joined.references.iter().flat_map(|own| &own.followed.events);
    let bumps = events.filter_map(|event| match event {
        Event::Bump { shift_mm, turn_rad, .. } => Some((*shift_mm, turn_rad.to_degrees())),
        _ => None,
    });
    bumps.collect()
}

fn moved(joined: &Joined) -> usize {
    let stations = joined.stations.iter();
    let moved = Pairing::Unmeasured(Unmeasured::InstrumentMoved);
    stations.filter(|own| own.pairing == moved).count()
}

#[test]
fn three_references_carry_the_readings_across_a_bump_of_any_size() {
    for (seed, at, mm, deg) in [
        (41, 30, 50.0, 0.0),
        (42, 20, 200.0, 1.0),
        (43, 45, 500.0, 3.0),
        (44, 8, 0.0, 5.0),
        (45, 30, 30.0, 0.5),
    ] {
        let scene = Scene::random(STATIONS, seed);
        let joined = joined(&scene, &[Bump::before(&scene, at, mm, deg)], 3);
        let found = bumps(&joined);
        assert_eq!(found.len(), 1, "{mm} mm, {deg} deg: {found:?}");
        assert!((found[0].1 - deg).abs() < 0.01, "{mm} mm, {deg} deg: {found:?}");
        assert!(paired(&joined) >= STATIONS - 1, "{mm} mm, {deg} deg: {}", paired(&joined));
        let worst = off_mm(&scene, &joined).into_iter().fold(0.0, f64::max);
        assert!(worst < 0.1, "{mm} mm, {deg} deg: {worst} mm");
        assert!(joined.elsewhere.is_empty());
    }
}

#[test]
fn two_bumps_are_both_found() {
    let scene = Scene::random(STATIONS, 46);
    let first = Bump::before(&scene, 18, 150.0, 1.0);
    let second = Bump::before(&scene, 40, 300.0, -2.0);
    let joined = joined(&scene, &[first, second], 3);
    assert_eq!(bumps(&joined).len(), 2, "{:?}", bumps(&joined));
    assert!(paired(&joined) >= STATIONS - 2, "{}", paired(&joined));
    let worst = off_mm(&scene, &joined).into_iter().fold(0.0, f64::max);
    assert!(worst < 0.1, "{worst} mm");
}

#[test]
fn one_reference_leaves_the_larger_part() {
    for (seed, at) in [(47, 22), (48, 40)] {
        let scene = Scene::random(STATIONS, seed);
        let joined = joined(&scene, &[Bump::before(&scene, at, 200.0, 1.0)], 1);
        assert_eq!(bumps(&joined).len(), 1);
        let larger = at.max(STATIONS - at);
        assert!((larger - 1..=larger).contains(&paired(&joined)), "{}", paired(&joined));
        assert!(moved(&joined) + paired(&joined) >= STATIONS - 1);
        let reasons = joined.rejects.iter();
        let said = reasons.filter(|own| own.reason.starts_with("instrument_moved"));
        assert_eq!(said.count(), 1);
    }
}

#[test]
fn a_bump_that_no_reference_tells_is_named_and_the_larger_part_is_joined() {
    for (seed, at, mm, deg) in
        [(50, 40, 200.0, 1.0), (51, 15, 80.0, 2.0), (52, 30, 500.0, 3.0), (53, 30, 120.0, 0.0)]
    {
        let scene = Scene::random(STATIONS, seed);
        let joined = joined(&scene, &[Bump::before(&scene, at, mm, deg)], 0);
        let [Elsewhere { stations, turn_rad, .. }] = joined.elsewhere[..] else {
            panic!("{at}, {mm} mm, {deg} deg: {:?}", joined.elsewhere);
        };
        let smaller = match at.cmp(&(STATIONS - at)) {
            Ordering::Greater => [at, STATIONS - 1],
            Ordering::Less => [0, at - 1],
            Ordering::Equal => stations,
        };
        assert_eq!(stations, smaller, "{mm} mm");
        assert!((turn_rad.to_degrees() - deg).abs() < 0.2, "{turn_rad}");
        let larger = at.max(STATIONS - at);
        assert_eq!((paired(&joined), moved(&joined)), (larger, STATIONS - larger));
        let said = joined.elsewhere[0].words();
        assert!(said.contains("three references that are not in line"), "{said}");
    }
}

#[test]
fn readings_of_another_reflector_are_no_bump() {
    // From station 40 on the beam is on a reflector that does not move with the arm.
    let scene = Scene::random(STATIONS, 54);
    let (arm, mut recording) = (ur10(), scene.record(&ur10()));
    let from_s = scene.starts_s()[40] - 0.4;
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let readings = &mut recording.readings;
    for (at, position) in readings.stamps.iter().zip(&mut readings.positions) {
        if scene.controller_s(at.ns()) >= from_s {
            *position = FLOOR[0].map(|x| x + 0.02 * gaussian(&mut rng));
        }
    }
    let joined = join_beside(&recording, Vec::new(), &arm, &JoinSettings::default());
    let joined = joined.unwrap_or_else(|error| panic!("{error}"));
    assert!(joined.elsewhere.is_empty(), "{:?}", joined.elsewhere);
    assert_eq!(moved(&joined), 0);
}
