//! Variation of the accuracy of a pose: with the approach direction (vAP), and over time (dAP).
//!
//! - `vAP_p`, multi-directional variation: the largest distance between the barycentres of visits by approach. A log shows
//!   an approach only by the pose that the arm was at before; a detour between the two is not known, nor are the three
//!   directions at right angles that the standard asks for.
//! - `dAP_p`, drift: the difference between `AP_p` of the last visits and of the first, in groups of ten as in the
//!   standard. Whether the arm was cold at first is not known.

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::{Characteristic, Figure, VISITS, Visit, Visited, barycentre, positioning_accuracy};

const DIRECTIONS: usize = 3;
/// Fewest visits that make a barycentre of their own.
const GROUP: usize = 2;
/// Number of visits in each of the standard's groups.
const DRIFT_GROUP: usize = 10;

/// `vAP_p` and `dAP_p` of one pose, where its visits allow them.
pub(super) fn of_pose(own: &Visited) -> Vec<Figure> {
    by_approach(own).into_iter().chain(over_time(own)).collect()
}

/// Rows without a value for figures that no pose allows.
pub(super) fn missing(of_poses: &[Figure]) -> Vec<Figure> {
    let reasons = [
        (
            Characteristic::VapP,
            DIRECTIONS * VISITS,
            "no pose was approached from two others, twice each",
        ),
        (Characteristic::DapP, 2 * DRIFT_GROUP, "no pose was visited four times"),
    ];
    let is_missing =
        |characteristic| !of_poses.iter().any(|figure| figure.characteristic == characteristic);
    let missing = reasons.into_iter().filter(|(c, ..)| is_missing(*c));
    missing
        .map(|(characteristic, n_needed, remark)| Figure::missing(characteristic, n_needed, remark))
        .collect()
}

fn by_approach(own: &Visited) -> Option<Figure> {
    let mut approaches: BTreeMap<usize, Vec<Visit>> = BTreeMap::new();
    for visit in &own.visits {
        if let Some(from) = visit.from {
            approaches.entry(from).or_default().push(visit.clone());
        }
    }
    approaches.retain(|_, visits| visits.len() >= GROUP);
    let barycentres: Vec<Point3<f64>> = approaches.values().map(|v| barycentre(v)).collect();
    let apart = (0..barycentres.len()).flat_map(|a| {
        let others = &barycentres[a + 1..];
        let own = barycentres[a];
        others.iter().map(move |other| (other - own).norm())
    });
    Some(Figure {
        characteristic: Characteristic::VapP,
        pose: Some(own.pose),
        value: Some(apart.reduce(f64::max)?),
        n: approaches.values().map(Vec::len).sum(),
        n_needed: DIRECTIONS * VISITS,
        remark: Some(format!(
            "approached from {} other poses, by the dwell before; the standard asks for {DIRECTIONS} directions at right \
             angles, {VISITS} visits each",
            approaches.len()
        )),
    })
}

fn over_time(own: &Visited) -> Option<Figure> {
    let visits = &own.visits;
    let group = DRIFT_GROUP.min(visits.len() / 2);
    if group < GROUP {
        return None;
    }
    let (first, last) = (&visits[..group], &visits[visits.len() - group..]);
    let hours = last[group - 1].start.since_s(first[0].start) / 3600.0;
    Some(Figure {
        characteristic: Characteristic::DapP,
        pose: Some(own.pose),
        value: Some((positioning_accuracy(last) - positioning_accuracy(first)).abs()),
        n: 2 * group,
        n_needed: 2 * DRIFT_GROUP,
        remark: Some(format!(
            "first {group} visits compared with last {group}, {hours:.2} h from the first to the last; the standard starts cold and \
             continues for 8 h"
        )),
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::units::Stamp;

    /// Visits an hour apart: the pose before, and the error along x.
    fn visited(visits: &[(usize, f64)]) -> Visited {
        let visit = |(place, &(from, error)): (usize, &(usize, f64))| Visit {
            station: place,
            start: Stamp::from_ns(3_600_000_000_000 * i64::try_from(place).unwrap()),
            from: Some(from),
            commanded: Point3::origin(),
            attained: Point3::from(Vector3::x() * error),
            orientation: None,
        };
        Visited { pose: 7, visits: visits.iter().enumerate().map(visit).collect() }
    }

    #[test]
    fn barycentres_by_approach_are_compared_and_single_visits_are_none() {
        // From pose 1 at 0.1 and 0.3 (0.2), from pose 2 at −0.1 twice: 0.3 apart. From pose 3 only once, so its error does
        // not count.
        let own = visited(&[(1, 0.1), (2, -0.1), (1, 0.3), (2, -0.1), (3, 9.0)]);
        let figure = by_approach(&own).expect("two approaches");
        assert!((figure.value.unwrap() - 0.3).abs() < 1e-12);
        assert_eq!((figure.n, figure.n_needed), (4, 90));
        assert_eq!(by_approach(&visited(&[(1, 0.1), (1, 0.2), (2, 0.3)])), None);
    }

    #[test]
    fn drift_compares_the_first_visits_with_the_last() {
        // Of five visits two and two: AP_p 0.2 (the mean of 0.1 and 0.3) against 0.5; the middle one is in neither.
        let own = visited(&[(1, 0.1), (1, 0.3), (1, 9.0), (1, -0.6), (1, -0.4)]);
        let figure = over_time(&own).expect("four visits and more");
        assert!((figure.value.unwrap() - 0.3).abs() < 1e-12);
        assert_eq!((figure.n, figure.n_needed), (4, 20));
        assert!(figure.remark.as_ref().is_some_and(|r| r.contains("4.00 h")));
        assert_eq!(over_time(&visited(&[(1, 0.1); 3])), None);
        // Of thirty, ten and ten.
        assert_eq!(over_time(&visited(&[(1, 0.1); 30])).map(|f| f.n), Some(20));
    }

    #[test]
    fn what_no_pose_allows_is_stated() {
        let missing = missing(&[]);
        assert_eq!(missing.len(), 2);
        assert!(missing.iter().all(|figure| figure.value.is_none() && figure.remark.is_some()));
    }
}
