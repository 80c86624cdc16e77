//! Readings without names on simulated arms: every assignment is the true one, or the error names what is missing.

use super::*;
use crate::geometry::isometry_from_rpy;

const PLACES: [[f64; 3]; 3] = [[60.0, 20.0, 80.0], [-40.0, 70.0, 60.0], [-10.0, -75.0, 120.0]];

/// Numbers that look random, from −1 to 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 30) - 1.0
    }

    fn vector(&mut self, mm: f64) -> Vector3<f64> {
        Vector3::new(self.next(), self.next(), self.next()) * mm
    }

    fn below(&mut self, count: usize) -> usize {
        let share = f64::midpoint(self.next(), 1.0);
        (0..count).rfind(|&n| share >= n as f64 / count as f64).unwrap_or(0)
    }
}

/// A session: stations, and the target of each of their positions.
struct Session {
    stations: Vec<StationPoints>,
    truth: Vec<Vec<usize>>,
}

/// Stations of an arm that is off by up to 3 mm and 3 mrad, with targets in a changing order, each missing at this share.
fn session(places: &[[f64; 3]], missing: f64, seed: u64) -> Session {
    let mut noise = Noise(seed);
    let tracker_from_base = isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]);
    let (mut stations, mut truth) = (Vec::new(), Vec::new());
    for _ in 0..60 {
        let at = noise.vector(800.0) + Vector3::new(900.0, 0.0, 900.0);
        let turn = noise.vector(1.2);
        let flange = isometry_from_rpy(at.into(), turn.into());
        let off = isometry_from_rpy(noise.vector(3.0).into(), noise.vector(3e-3).into());
        let mut order: Vec<usize> = (0..places.len()).collect();
        for last in (1..order.len()).rev() {
            order.swap(last, noise.below(last + 1));
        }
        order.retain(|_| f64::midpoint(noise.next(), 1.0) >= missing);
        let points = order.iter().map(|&target| {
            let own = tracker_from_base * flange * off * Point3::from(places[target]);
            own + noise.vector(0.05)
        });
        stations.push(StationPoints { flange, points: points.collect() });
        truth.push(order);
    }
    Session { stations, truth }
}

fn by_places(places: &[[f64; 3]], off_mm: f64) -> Stated {
    let mut noise = Noise(99);
    Stated {
        names: ["A", "B", "C", "D"].map(str::to_owned)[..places.len()].to_vec(),
        places: places
            .iter()
            .map(|at| Some((Vector3::from(*at) + noise.vector(off_mm), 0.5)))
            .collect(),
        distances: Vec::new(),
    }
}

fn by_distances(places: &[[f64; 3]]) -> Stated {
    let stated = by_places(places, 0.0);
    let pairs = (0..places.len()).flat_map(|a| (a + 1..places.len()).map(move |b| [a, b]));
    let distances = pairs.map(|between| {
        let [a, b] = between.map(|target| Vector3::from(places[target]));
        StatedDistance { between, mm: (a - b).norm(), sd_mm: 0.05 }
    });
    Stated { places: vec![None; places.len()], distances: distances.collect(), ..stated }
}

/// Numbers of right, wrong and undecided readings.
fn tally(session: &Session, found: &[StationAssignment]) -> [usize; 3] {
    let mut counts = [0; 3];
    for (truth, own) in session.truth.iter().zip(found) {
        let StationAssignment::Decided(points, _) = own else {
            counts[2] += truth.len();
            continue;
        };
        for (truth, point) in truth.iter().zip(points) {
            let place = match point {
                PointTarget::Of(target) if target == truth => 0,
                PointTarget::Of(_) => 1,
                PointTarget::OfNone(_) => 2,
            };
            counts[place] += 1;
        }
    }
    counts
}

#[test]
fn every_reading_gets_its_target_with_some_missing_and_places_a_little_off() {
    for missing in [0.0, 0.1, 0.4, 0.6] {
        for seed in 1..6 {
            let session = session(&PLACES, missing, seed);
            for stated in [by_places(&PLACES, 1.0), by_distances(&PLACES)] {
                let found = assign(&session.stations, &stated, 30.0).expect("they differ");
                let all = session.truth.iter().map(Vec::len).sum();
                assert_eq!(tally(&session, &found), [all, 0, 0], "{missing} {seed}");
                let misfits = found.iter().filter_map(|own| match own {
                    StationAssignment::Decided(_, assigned) => *assigned,
                    StationAssignment::Ambiguous(_) => None,
                });
                assert!(misfits.into_iter().all(|own| own.runner_up_mm > 5.0 * own.misfit_mm));
            }
        }
    }
}

#[test]
fn a_reading_of_another_reflector_is_of_none_of_them() {
    let mut session = session(&PLACES, 0.0, 3);
    session.stations[5].points[1] += Vector3::new(250.0, 0.0, 0.0);
    let found = assign(&session.stations, &by_places(&PLACES, 0.0), 30.0).expect("they differ");
    assert_eq!(tally(&session, &found), [179, 0, 1]);
    let StationAssignment::Decided(points, _) = &found[5] else {
        panic!("the others decide");
    };
    assert!(matches!(points[1], PointTarget::OfNone(mm) if mm > 100.0));
}

#[test]
fn targets_that_nothing_distinguishes_are_an_error_and_near_ones_are_ambiguous() {
    // Equilateral, known by distances alone: any order fits; by places it is decided.
    let h = 50.0 * 3.0_f64.sqrt();
    let equal = [[0.0, 0.0, 80.0], [100.0, 0.0, 80.0], [50.0, h, 80.0]];
    let equilateral = session(&equal, 0.0, 1);
    let refused = assign(&equilateral.stations, &by_distances(&equal), 30.0);
    assert!(matches!(refused, Err(AssignError::Alike { .. })), "{refused:?}");
    let found = assign(&equilateral.stations, &by_places(&equal, 0.3), 30.0).expect("by places");
    assert_eq!(tally(&equilateral, &found), [180, 0, 0]);
    // Two 2 mm apart, one of which is often missing: the arm's error is larger.
    let near = [[0.0, 0.0, 80.0], [2.0, 0.0, 80.0]];
    let near_session = session(&near, 0.3, 2);
    let mut stated = by_places(&near, 0.0);
    stated.places.iter_mut().flatten().for_each(|own| own.1 = 0.05);
    match assign(&near_session.stations, &stated, 30.0) {
        Err(AssignError::Alike { .. }) => {}
        Ok(found) => {
            let [_, wrong, undecided] = tally(&near_session, &found);
            assert!(wrong == 0 && undecided > 20, "{wrong} {undecided}");
        }
        Err(other) => panic!("{other}"),
    }
    // Places that are somebody else's.
    let other = [[0.0, 0.0, 300.0], [150.0, 0.0, 80.0], [0.0, 200.0, 0.0]];
    let refused = assign(&session(&PLACES, 0.0, 1).stations, &by_places(&other, 0.0), 30.0);
    assert!(matches!(refused, Err(AssignError::NotAsStated { .. })), "{refused:?}");
}

#[test]
fn two_targets_and_one_orientation_are_enough() {
    let mut session = session(&PLACES[..2], 0.2, 4);
    let stated = by_places(&PLACES[..2], 0.5);
    let found = assign(&session.stations, &stated, 30.0).expect("they differ");
    let all = session.truth.iter().map(Vec::len).sum();
    assert_eq!(tally(&session, &found), [all, 0, 0]);
    session.stations.truncate(5);
    let refused = assign(&session.stations, &stated, 30.0);
    assert_eq!(refused, Err(AssignError::TooFew { found: 5 }));
}
