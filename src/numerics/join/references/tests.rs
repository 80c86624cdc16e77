use nalgebra::{Isometry3, Point3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::*;

/// References that are looked at, and how their instrument moves.
struct Scene {
    places: Vec<Point3<f64>>,
    looks: usize,
    noise_mm: f64,
    rng: ChaCha8Rng,
}

const THREE: [[f64; 3]; 3] = [[2000.0, 0.0, 300.0], [2150.0, 120.0, 300.0], [1950.0, 200.0, 420.0]];

impl Scene {
    fn new(places: &[[f64; 3]], looks: usize, seed: u64) -> Self {
        Self {
            places: places.iter().map(|at| Point3::from(*at)).collect(),
            looks,
            noise_mm: 0.02,
            rng: ChaCha8Rng::seed_from_u64(seed),
        }
    }

    fn gaussian(&mut self) -> f64 {
        let (u, v): (f64, f64) =
            (self.rng.random_range(1e-12..1.0), self.rng.random_range(0.0..1.0));
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    fn noise(&mut self) -> Vector3<f64> {
        let size = self.noise_mm;
        Vector3::from_fn(|_, _| size * self.gaussian())
    }

    /// Looks a minute apart at references that `motion` moves; `seen` says whether a reference is read at a look.
    fn looks(
        &mut self,
        motion: impl Fn(usize) -> Isometry3<f64>,
        seen: impl Fn(usize, usize) -> bool,
    ) -> Vec<Look> {
        let places = self.places.clone();
        (0..self.looks)
            .map(|i| {
                let now = motion(i);
                let all = places.iter().enumerate().filter(|(k, _)| seen(i, *k));
                let seen = all.map(|(k, at)| (ReferenceId(k), now * at + self.noise()));
                Look { at_s: 60.0 * i as f64, seen: seen.collect() }
            })
            .collect()
    }
}

fn turned(shift: [f64; 3], turn: [f64; 3]) -> Isometry3<f64> {
    Isometry3::from_parts(Vector3::from(shift).into(), Rotation3::new(Vector3::from(turn)).into())
}

fn bumps(found: &Followed) -> Vec<&Event> {
    found.events.iter().filter(|event| matches!(event, Event::Bump { .. })).collect()
}

/// How far the motion is off at a place of the target, mm, and the standard deviation that it states there.
fn off(
    motion: &Motion,
    truth: &Isometry3<f64>,
    first: &Isometry3<f64>,
    at: &Point3<f64>,
) -> (f64, f64) {
    let now = truth * first.inverse() * at;
    let back = motion.undone(&now);
    ((back - at).norm(), motion.covariance_at(&now).trace().sqrt())
}

#[test]
fn nothing_moves_so_nothing_is_corrected() {
    let looks = Scene::new(&THREE, 200, 3).looks(|_| Isometry3::identity(), |_, _| true);
    let found = follow(&looks).unwrap();
    assert!(found.events.is_empty(), "{:?}", found.events);
    assert!(found.tells_turns);
    assert!((found.sizes.reading_mm / 0.02 - 1.0).abs() < 0.1, "{:?}", found.sizes);
    // A correction by each look alone would be off by 0.02 mm at the references and far more at the target.
    let at = Point3::new(1500.0, 500.0, 900.0);
    for motion in &found.motions {
        let (off, _) = off(motion, &Isometry3::identity(), &Isometry3::identity(), &at);
        assert!(off < 0.02, "{off}");
    }
}

#[test]
fn a_drift_is_followed_within_what_it_states() {
    let drift = |i: usize| {
        let share = i as f64 / 400.0;
        turned(
            [0.3 * share, -0.1 * share, 0.2 * (3.0 * share).sin()],
            [1e-4 * share, -5e-5 * share, 2e-4 * share],
        )
    };
    let looks = Scene::new(&THREE, 400, 4).looks(drift, |i, k| (i + k) % 5 != 0);
    let found = follow(&looks).unwrap();
    assert!(found.events.is_empty(), "{:?}", found.events);
    let at = Point3::new(1500.0, 500.0, 900.0);
    let mut squares = 0.0;
    for (i, motion) in found.motions.iter().enumerate() {
        // Both are since the first look, whose own error all share.
        let (off, sd) = off(motion, &drift(i), &drift(0), &at);
        squares += (off / sd).powi(2) / found.motions.len() as f64;
        assert!(off < 0.12, "look {i}: {off} mm");
    }
    assert!(squares < 4.0, "errors are {} times their standard deviation", squares.sqrt());
}

#[test]
fn a_bump_is_found_at_its_look_and_bridged() {
    let bump = turned([3.0, -40.0, 1.0], [0.004, 0.01, -0.02]);
    let motion = |i: usize| if i < 130 { Isometry3::identity() } else { bump };
    let looks = Scene::new(&THREE, 300, 5).looks(motion, |_, _| true);
    let found = follow(&looks).unwrap();
    let [Event::Bump { after: 129, before: 130, turn_rad, .. }] = found.events[..] else {
        panic!("{:?}", found.events);
    };
    assert!((turn_rad - bump.rotation.angle()).abs() < 2e-4);
    assert!(found.is_bridged());
    assert_eq!((found.motions[129].part, found.motions[130].part), (0, 1));
    let at = Point3::new(1500.0, 500.0, 900.0);
    let (off, sd) = off(&found.motions[200], &bump, &Isometry3::identity(), &at);
    assert!(off < 4.0 * sd + 0.03 && sd < 0.1, "{off} {sd}");
}

#[test]
fn two_references_tell_a_bump_and_do_not_bridge_it() {
    let bump = turned([3.0, 0.5, 1.0], [0.0, 0.0, 0.001]);
    let motion = |i: usize| if i < 60 { Isometry3::identity() } else { bump };
    let looks = Scene::new(&THREE[..2], 120, 6).looks(motion, |i, _| i % 10 == 0);
    let found = follow(&looks).unwrap();
    assert!(!found.tells_turns);
    // It is known only to be between the two looks that saw the references.
    assert!(
        matches!(bumps(&found)[..], [Event::Bump { after: 50, before: 60, .. }]),
        "{:?}",
        found.events
    );
    assert!(!found.is_bridged());
    let line = [[0.0, 0.0, 0.0], [100.0, 0.0, 0.0], [250.0, 1.0, 0.0]];
    let looks = Scene::new(&line, 40, 6).looks(|_| Isometry3::identity(), |_, _| true);
    assert!(!follow(&looks).unwrap().tells_turns, "three in line");
}

#[test]
fn strays_and_shocks_are_left_out_of_the_drift() {
    let mut scene = Scene::new(&THREE, 250, 7);
    let shock = turned([0.0, 1.2, 0.0], [0.0; 3]);
    let motion = |i: usize| {
        if i == 77 || i == 201 { shock } else { Isometry3::identity() }
    };
    let mut looks = scene.looks(motion, |_, _| true);
    for (look, k) in [(20, 0), (50, 1), (120, 2), (121, 2)] {
        looks[look].seen[k].1.x += 1.5;
    }
    let found = follow(&looks).unwrap();
    let strays: Vec<(usize, usize)> = found
        .events
        .iter()
        .filter_map(|event| match event {
            Event::Stray { look, reference, .. } => Some((*look, reference.0)),
            Event::Bump { .. } | Event::Shock { .. } | Event::Moved { .. } => None,
        })
        .collect();
    assert_eq!(strays, [(20, 0), (50, 1), (120, 2), (121, 2)], "{:?}", found.events);
    let shocks = found.events.iter().filter_map(|event| match event {
        Event::Shock { look, .. } => Some(*look),
        Event::Bump { .. } | Event::Stray { .. } | Event::Moved { .. } => None,
    });
    assert_eq!(shocks.collect::<Vec<_>>(), [77, 201], "{:?}", found.events);
    assert!((found.sizes.reading_mm / 0.02 - 1.0).abs() < 0.1, "{:?}", found.sizes);
    assert!(found.sizes.shock_mm < 0.01, "{:?}", found.sizes);
}

#[test]
fn a_reference_that_was_moved_begins_anew() {
    let four = [THREE[0], THREE[1], THREE[2], [2100.0, -150.0, 350.0]];
    let mut looks = Scene::new(&four, 160, 8).looks(|_| Isometry3::identity(), |_, _| true);
    for look in &mut looks[90..] {
        look.seen[1].1 += Vector3::new(0.4, 0.3, -0.2);
    }
    let found = follow(&looks).unwrap();
    let [Event::Moved { look: 90, reference: ReferenceId(1), by_mm }] = found.events[..] else {
        panic!("{:?}", found.events);
    };
    assert!((by_mm - 0.539).abs() < 0.03, "{by_mm}");
    assert_eq!(found.places.len(), 5);
}

#[test]
fn a_very_long_session_is_followed_by_a_sample_of_its_looks() {
    // 12,000 looks in which everything drifts by some 0.3 mm, and is bumped once: from look to look nothing of the drift shows.
    let motion = |i: usize| {
        let share = i as f64 / 12_000.0;
        let bump = if i < 7000 { 0.0 } else { 0.6 };
        turned(
            [0.3 * share + bump, -0.1 * share, 0.2 * (3.0 * share).sin()],
            [1e-4 * share, -5e-5 * share, 1e-4 * share],
        )
    };
    let looks = Scene::new(&THREE, 12_000, 21).looks(motion, |i, k| (i * 7 + k * 3) % 11 != 0);
    let found = follow(&looks).unwrap();
    assert!(matches!(found.events[..], [Event::Bump { before: 7000, .. }]), "{:?}", found.events);
    assert!((found.sizes.reading_mm / 0.02 - 1.0).abs() < 0.03, "{:?}", found.sizes);
    let at = Point3::new(1500.0, 500.0, 900.0);
    for (i, now) in found.motions.iter().enumerate().step_by(50) {
        let (off, sd) = off(now, &motion(i), &motion(0), &at);
        assert!(off < 4.0 * sd && sd < 0.06, "look {i}: {off} mm, {sd} mm");
    }
}

#[test]
fn false_events_are_rare() {
    let events: usize = (0..40)
        .map(|seed| {
            let drift = |i: usize| turned([0.001 * i as f64, 0.0, 0.0], [0.0; 3]);
            let looks = Scene::new(&THREE, 120, 100 + seed).looks(drift, |i, k| (i + k) % 3 != 0);
            follow(&looks).unwrap().events.len()
        })
        .sum();
    assert!(events <= 2, "{events} false events in 40 sessions");
}

#[test]
fn many_strays_and_shocks_hide_neither_each_other_nor_a_bump() {
    let mut scene = Scene::new(&THREE, 977, 17);
    let motion = |i: usize| {
        let share = i as f64 / 400.0;
        let bump = if i > 500 { 0.7 } else { 0.0 };
        turned(
            [0.1 * share + bump, -0.1 * share, 0.1 * (3.0 * share).sin()],
            [1e-4 * share, -5e-5 * share, 2e-4 * share],
        )
    };
    let mut looks = scene.looks(motion, |i, k| (i * 7 + k * 3) % 11 != 0);
    for look in looks.iter_mut().step_by(19) {
        let own = look.seen.len() / 2;
        look.seen[own].1 += Vector3::new(1.0, -0.7, 0.3);
    }
    for look in looks.iter_mut().skip(5).step_by(61) {
        for (_, at) in &mut look.seen {
            *at += Vector3::new(0.3, -1.7, 0.3);
        }
    }
    let found = follow(&looks).unwrap();
    let count = |is_it: fn(&&Event) -> bool| found.events.iter().filter(is_it).count();
    let strays = count(|event| matches!(event, Event::Stray { .. }));
    let shocks = count(|event| matches!(event, Event::Shock { .. }));
    assert!(
        strays.abs_diff(52) <= 2 && shocks.abs_diff(16) <= 2,
        "{strays} strays, {shocks} shocks"
    );
    assert!(matches!(bumps(&found)[..], [Event::Bump { before: 501, .. }]), "{:?}", bumps(&found));
    assert!((found.sizes.reading_mm / 0.02 - 1.0).abs() < 0.05, "{:?}", found.sizes);
}
