//! Distance accuracy AD and repeatability RD, of two poses that were visited in turn.
//!
//! The standard takes two poses, goes from one to the other and back, and compares each attained distance with the
//! commanded one. Here these are the two poses visited in turn most often, and of those the two furthest apart: a longer
//! distance shows an arm's errors better. Each visit is paired with the visit of the other pose that follows it, each once.

use nalgebra::Vector3;

use super::{Characteristic, Figure, Says, VISITS, Visit, Visited, mean, most_visited};
use crate::figures::Figures;

/// Fewest turns: fewer have no spread.
const TURNS: usize = 2;
/// Smallest distance between two poses, mm: an error e across it adds e²/2D to the length, at 1 mm of error 5 µm here, and
/// the distance of one position in two configurations would consist of errors only.
const LEAST_MM: f64 = 100.0;

/// `AD_p` and its components, and `RD` where positions are attained ones.
pub(super) fn figures(visited: &[Visited], says: Says) -> Vec<Figure> {
    let Some(pair) = furthest(visited) else {
        let remark = format!("no two poses {LEAST_MM} mm apart or more were visited in turn twice");
        let missing = Figure::missing(Characteristic::AdP, VISITS, &remark);
        return if says == Says::Accuracy { Vec::new() } else { vec![missing] };
    };
    let attained: Vec<f64> = pair.turns.iter().map(Turn::attained_mm).collect();
    let characteristics =
        [Characteristic::AdP, Characteristic::AdX, Characteristic::AdY, Characteristic::AdZ];
    let accuracy = characteristics.into_iter().zip(pair.accuracy());
    let accuracy = accuracy.map(|(own, value)| pair.figure(own, value, says));
    let mut figures: Vec<Figure> = accuracy.collect();
    if says != Says::Accuracy {
        let spread = Figures::of(&attained).map(|distances| 3.0 * distances.sd);
        figures.extend(spread.map(|spread| pair.figure(Characteristic::Rd, spread, says)));
    }
    figures
}

/// A visit of the first pose and one of the second, one after the other.
struct Turn<'v>(&'v Visit, &'v Visit);

impl Turn<'_> {
    fn attained(&self) -> Vector3<f64> {
        self.1.attained - self.0.attained
    }

    fn commanded(&self) -> Vector3<f64> {
        self.1.commanded - self.0.commanded
    }

    fn attained_mm(&self) -> f64 {
        self.attained().norm()
    }
}

struct Pair<'v> {
    first: usize,
    second: usize,
    turns: Vec<Turn<'v>>,
}

impl Pair<'_> {
    fn commanded_mm(&self) -> f64 {
        mean(self.turns.iter().map(Turn::commanded)).norm()
    }

    /// Mean attained minus commanded distance: `AD_p`, then along each axis.
    fn accuracy(&self) -> [f64; 4] {
        let n = self.turns.len() as f64;
        let long: f64 = self.turns.iter().map(Turn::attained_mm).sum();
        let along = mean(self.turns.iter().map(|turn| turn.attained().abs()));
        let commanded = mean(self.turns.iter().map(Turn::commanded));
        let [x, y, z]: [f64; 3] = (along - commanded.abs()).into();
        [long / n - commanded.norm(), x, y, z]
    }

    fn figure(&self, characteristic: Characteristic, value: f64, says: Says) -> Figure {
        let n = self.turns.len();
        let few =
            (n < VISITS).then(|| format!("; {n} times in turn, the standard asks for {VISITS}"));
        let known = match says {
            Says::Everything => "commanded",
            Says::Accuracy => "predicted",
            Says::Repeatability => "by their joints",
        };
        let (Self { first, second, .. }, apart_mm) = (self, self.commanded_mm());
        let pair = format!("between poses {first} and {second}, {known} {apart_mm:.3} mm apart");
        let remark = Some(pair + few.as_deref().unwrap_or_default());
        Figure { characteristic, pose: None, value: Some(value), n, n_needed: VISITS, remark }
    }
}

/// The pair with the most turns, then the furthest apart, then the first; among the poses visited most.
fn furthest(visited: &[Visited]) -> Option<Pair<'_>> {
    let told = most_visited(visited);
    let candidates: Vec<&Visited> = visited.iter().filter(|own| told.contains(&own.pose)).collect();
    let mut best: Option<(usize, f64, Pair<'_>)> = None;
    for (place, first) in candidates.iter().enumerate() {
        for second in &candidates[place + 1..] {
            let turns = turns(&first.visits, &second.visits);
            let pair = Pair { first: first.pose, second: second.pose, turns };
            let (count, apart) = (pair.turns.len(), pair.commanded_mm());
            let is_better =
                best.as_ref().is_none_or(|(most, furthest, _)| (count, apart) > (*most, *furthest));
            if count >= TURNS && apart >= LEAST_MM && is_better {
                best = Some((count, apart, pair));
            }
        }
    }
    best.map(|(.., pair)| pair)
}

/// Visits of either pose in time, each with the next visit where that is of the other pose.
fn turns<'v>(first: &'v [Visit], second: &'v [Visit]) -> Vec<Turn<'v>> {
    let mut all: Vec<(bool, &Visit)> = first.iter().map(|visit| (true, visit)).collect();
    all.extend(second.iter().map(|visit| (false, visit)));
    all.sort_by_key(|(_, visit)| visit.station);
    let mut turns = Vec::new();
    let mut waiting: Option<(bool, &Visit)> = None;
    for (is_first, visit) in all {
        waiting = match waiting {
            Some((other_is_first, other)) if other_is_first != is_first => {
                turns.push(if is_first { Turn(visit, other) } else { Turn(other, visit) });
                None
            }
            _ => Some((is_first, visit)),
        };
    }
    turns
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::units::Stamp;

    fn visited(pose: usize, commanded: [f64; 3], visits: &[(usize, [f64; 3])]) -> Visited {
        let visit = |&(station, error): &(usize, [f64; 3])| Visit {
            station,
            start: Stamp::from_ns(0),
            from: None,
            commanded: Point3::from(commanded),
            attained: Point3::from(commanded) + Vector3::from(error),
            orientation: None,
        };
        Visited { pose, visits: visits.iter().map(visit).collect() }
    }

    fn value(figures: &[Figure], characteristic: Characteristic) -> Option<f64> {
        figures.iter().find(|figure| figure.characteristic == characteristic)?.value
    }

    #[test]
    fn distances_are_those_of_a_hand_calculation() {
        // Commanded 500 mm apart, (−300, 400, 0). Attained along (−3, 4, 0)/5: 500.3 and 500.1 mm.
        let a = visited(0, [300.0, 0.0, 0.0], &[(0, [0.0; 3]), (2, [0.0; 3])]);
        let b = visited(1, [0.0, 400.0, 0.0], &[(1, [-0.18, 0.24, 0.0]), (3, [-0.06, 0.08, 0.0])]);
        let figures = figures(&[a, b], Says::Everything);
        let expected = [
            (Characteristic::AdP, 0.2),
            (Characteristic::AdX, 0.12),
            (Characteristic::AdY, 0.16),
            (Characteristic::AdZ, 0.0),
            // S = √(2 · 0.1² / 1).
            (Characteristic::Rd, 3.0 * 0.1 * 2.0_f64.sqrt()),
        ];
        for (characteristic, expected) in expected {
            let found = value(&figures, characteristic).expect("given");
            assert!((found - expected).abs() < 1e-9, "{characteristic:?}: {found}");
        }
        let remark = figures[0].remark.as_deref().expect("two turns are few");
        assert!(
            remark.contains("between poses 0 and 1, commanded 500.000 mm apart; 2 times in turn"),
            "{remark}"
        );
    }

    #[test]
    fn poses_that_were_not_visited_in_turn_have_no_distance() {
        let exact = [0.0; 3];
        let a = visited(0, [300.0, 0.0, 0.0], &[(0, exact), (1, exact)]);
        let b = visited(2, [0.0, 400.0, 0.0], &[(2, exact), (3, exact)]);
        let both = [a, b];
        let everything = figures(&both, Says::Everything);
        assert_eq!((everything.len(), everything[0].value), (1, None));
        assert!(figures(&both, Says::Accuracy).is_empty());
    }

    #[test]
    fn one_position_in_two_configurations_has_no_distance() {
        let a = visited(0, [300.0, 0.0, 0.0], &[(0, [1.0, 0.0, 0.0]), (2, [1.0, 0.0, 0.0])]);
        let b = visited(1, [300.0, 0.0, 0.0], &[(1, [0.0; 3]), (3, [0.0; 3])]);
        let told = figures(&[a, b], Says::Everything);
        assert_eq!((told.len(), told[0].value), (1, None));
        assert!(told[0].remark.as_ref().is_some_and(|r| r.contains("100 mm apart")));
    }

    #[test]
    fn the_pair_visited_in_turn_most_often_and_then_furthest_apart_is_reported() {
        let exact = [0.0; 3];
        let at = |pose: usize, x: f64, stations: &[usize]| {
            let visits: Vec<_> = stations.iter().map(|station| (*station, exact)).collect();
            visited(pose, [x, 0.0, 0.0], &visits)
        };
        // 0, 1 and 2 are visited three times in turn, 3 twice and furthest away.
        let all = [
            at(0, 0.0, &[0, 4, 8]),
            at(1, 100.0, &[1, 5, 9]),
            at(2, -50.0, &[2, 6, 10]),
            at(3, 900.0, &[3, 7]),
        ];
        let pair = furthest(&all).expect("visited in turn");
        assert_eq!((pair.first, pair.second, pair.turns.len()), (1, 2, 3));
        // A model has no spread of its own.
        assert_eq!(value(&figures(&all, Says::Accuracy), Characteristic::Rd), None);
    }
}
