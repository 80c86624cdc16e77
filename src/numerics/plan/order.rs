//! The order in which poses are visited: short joint travel, and repeated visits that show drift and repeatability.
//!
//! Inputs: joint angles of the poses, the start of the arm, the speed of each joint. Outputs: an order, and from it the
//! list of visits. The time between two poses is that of the joint that takes longest, `max_j |Δq_j| / speed_j`, the others
//! being slowed to arrive with it (a point-to-point move without acceleration).
//!
//! 1. Nearest neighbour from home, or the order given, whichever is shorter.
//! 2. Improved until no move shortens it: stretches reversed (2-opt, Croes 1958) and runs of up to three poses moved
//!    elsewhere (Or 1976), between each pose and its ten nearest only, so that thousands of poses take a second.
//! 3. Poses visited again ([`with_repeats`]).
//!
//! Of equal choices the pose that is first in the input is taken: the same poses give the same order everywhere.

use std::num::NonZeroUsize;

mod shorten;

use shorten::Path;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Visit {
    Pose(usize),
    /// The same pose again after some others, for the repeatability.
    Repeat {
        of: usize,
    },
    /// One of the first poses again, for the drift of the base.
    DriftCheck {
        of: usize,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Revisits {
    /// Number of poses after which the first of them is visited again; `None` for no repeats.
    pub repeat_every: Option<NonZeroUsize>,
    /// Number of poses after which drift checks follow, and at the end; `None` for none.
    pub drift_every: Option<NonZeroUsize>,
    /// Number of the first poses that a drift check visits.
    pub drift_poses: usize,
}

/// The poses, as indices in `joints`, in an order of short travel from `home`; never longer than the given order.
///
/// `joints` are angles (rad; mm for sliding joints), `speeds` the travel of each joint in a second. A joint whose speed is
/// not above zero counts as one that takes no time.
/// Panics when a pose or `home` has fewer joints than `speeds`.
pub(super) fn visiting_order(joints: &[Vec<f64>], home: &[f64], speeds: &[f64]) -> Vec<usize> {
    if joints.is_empty() {
        return Vec::new();
    }
    let path = Path::new(joints, home, speeds);
    let given: Vec<usize> = (0..joints.len()).collect();
    let nearest = path.nearest_neighbour();
    let start = if path.seconds(&nearest) < path.seconds(&given) { nearest } else { given };
    path.shortened(start)
}

/// The visits of a session: every pose of `order` once, and some again by `revisits`.
pub fn with_repeats(order: &[usize], revisits: &Revisits) -> Vec<Visit> {
    let early = &order[..revisits.drift_poses.min(order.len())];
    let checks = || early.iter().map(|&of| Visit::DriftCheck { of });
    let ends = |done: usize, every: Option<NonZeroUsize>| {
        every.filter(|every| done.is_multiple_of(every.get()))
    };
    let mut visits = Vec::with_capacity(order.len());
    for (place, &pose) in order.iter().enumerate() {
        visits.push(Visit::Pose(pose));
        let done = place + 1;
        // A run of one would repeat a pose without leaving it.
        if let Some(run) = ends(done, revisits.repeat_every).filter(|run| run.get() > 1) {
            visits.push(Visit::Repeat { of: order[done - run.get()] });
        }
        let last = done == order.len() && done > early.len() && revisits.drift_every.is_some();
        let due = ends(done, revisits.drift_every).is_some() && done > early.len();
        if due || last {
            visits.extend(checks());
        }
    }
    visits
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds from `home` through the poses in this `order`.
    fn travel_seconds(joints: &[Vec<f64>], home: &[f64], speeds: &[f64], order: &[usize]) -> f64 {
        Path::new(joints, home, speeds).seconds(order)
    }

    const SPEEDS: [f64; 2] = [2.0, 1.0];

    /// Poses without a pattern: an irrational rotation per joint.
    fn scattered(count: usize, axes: usize) -> Vec<Vec<f64>> {
        let angle = |i: usize, axis: usize| {
            let turn = i as f64 * ((axis + 2) as f64).sqrt().fract();
            6.0 * turn.fract() - 3.0
        };
        (0..count).map(|i| (0..axes).map(|axis| angle(i, axis)).collect()).collect()
    }

    fn is_permutation(order: &[usize], count: usize) -> bool {
        let mut sorted = order.to_vec();
        sorted.sort_unstable();
        sorted.into_iter().eq(0..count)
    }

    #[test]
    fn points_on_a_line_are_visited_along_it() {
        // Home at one end: the shortest way passes them in order, 9 rad at 1 rad/s.
        let line: Vec<Vec<f64>> = [7.0, 2.0, 9.0, 1.0, 4.0, 8.0].map(|q| vec![0.0, q]).to_vec();
        let order = visiting_order(&line, &[0.0, 0.0], &SPEEDS);
        assert_eq!(order, [3, 1, 4, 0, 5, 2]);
        assert!((travel_seconds(&line, &[0.0, 0.0], &SPEEDS, &order) - 9.0).abs() < 1e-12);
    }

    #[test]
    fn the_slowest_joint_sets_the_time() {
        // 3 rad at 2 rad/s takes 1.5 s, 2 rad at 1 rad/s takes 2 s.
        let pose = vec![vec![3.0, 2.0]];
        assert!((travel_seconds(&pose, &[0.0, 0.0], &SPEEDS, &[0]) - 2.0).abs() < 1e-15);
    }

    #[test]
    fn home_in_the_middle_of_a_line_costs_the_short_side_twice() {
        // Left end at −2, right end at 5: 2 to the left and 7 back, 9 in all. Nearest neighbour takes 2 + 7 here or
        // 5 + 7 when it starts right; either way no order is below 9.
        let line: Vec<Vec<f64>> = [5.0, 1.0, -2.0, 3.0, -1.5].map(|q| vec![0.0, q]).to_vec();
        let order = visiting_order(&line, &[0.0, 0.0], &SPEEDS);
        assert!((travel_seconds(&line, &[0.0, 0.0], &SPEEDS, &order) - 9.0).abs() < 1e-12);
    }

    #[test]
    fn a_lattice_is_walked_without_a_detour() {
        // 8 × 8 poses one second apart, home one second before a corner: the minimum is 64 moves of a second.
        let lattice: Vec<Vec<f64>> = (0..64)
            .map(|i| {
                let i = (i * 37) % 64;
                vec![2.0 * f64::from(i % 8), f64::from(i / 8)]
            })
            .collect();
        let order = visiting_order(&lattice, &[-2.0, 0.0], &SPEEDS);
        assert!(is_permutation(&order, 64));
        let seconds = travel_seconds(&lattice, &[-2.0, 0.0], &SPEEDS, &order);
        assert!(seconds < 68.0, "{seconds} s");
    }

    #[test]
    fn every_pose_once_never_longer_than_given_and_the_same_again() {
        for (count, axes) in [(1, 6), (2, 6), (3, 1), (40, 2), (300, 6)] {
            let poses = scattered(count, axes);
            let (home, speeds) = (vec![0.0; axes], vec![1.5; axes]);
            let order = visiting_order(&poses, &home, &speeds);
            assert!(is_permutation(&order, count));
            let given: Vec<usize> = (0..count).collect();
            let seconds = |order: &[usize]| travel_seconds(&poses, &home, &speeds, order);
            assert!(seconds(&order) <= seconds(&given));
            assert_eq!(order, visiting_order(&poses, &home, &speeds));
            // An order that is already good stays unchanged, or gets better.
            let ordered: Vec<Vec<f64>> = order.iter().map(|&i| poses[i].clone()).collect();
            let again = visiting_order(&ordered, &home, &speeds);
            let then = travel_seconds(&ordered, &home, &speeds, &again);
            assert!(then <= seconds(&order) + 1e-9);
        }
    }

    #[test]
    fn the_search_beats_the_nearest_neighbour() {
        let poses = scattered(400, 3);
        let path = Path::new(&poses, &[0.0; 3], &[1.0; 3]);
        let nearest = path.seconds(&path.nearest_neighbour());
        let found = path.seconds(&visiting_order(&poses, &[0.0; 3], &[1.0; 3]));
        assert!(found < 0.95 * nearest, "{found} s of {nearest} s");
    }

    #[test]
    fn no_pose_and_equal_poses_have_an_order() {
        assert!(visiting_order(&[], &[0.0], &[1.0]).is_empty());
        let equal = vec![vec![1.0]; 30];
        assert_eq!(visiting_order(&equal, &[0.0], &[1.0]), (0..30).collect::<Vec<_>>());
    }

    #[test]
    fn revisits_stand_where_they_were_asked_for() {
        use Visit::{DriftCheck, Pose, Repeat};
        let revisits = Revisits {
            repeat_every: NonZeroUsize::new(2),
            drift_every: NonZeroUsize::new(4),
            drift_poses: 2,
        };
        let visits = with_repeats(&[7, 3, 5, 1, 9], &revisits);
        let expected = [
            Pose(7),
            Pose(3),
            Repeat { of: 7 },
            Pose(5),
            Pose(1),
            Repeat { of: 5 },
            DriftCheck { of: 7 },
            DriftCheck { of: 3 },
            Pose(9),
            // The session ends with a check.
            DriftCheck { of: 7 },
            DriftCheck { of: 3 },
        ];
        assert_eq!(visits, expected);
    }

    #[test]
    fn without_revisits_every_pose_is_visited_once() {
        let visits = with_repeats(&[2, 0, 1], &Revisits::default());
        assert_eq!(visits, [2, 0, 1].map(Visit::Pose));
        // A drift check needs a pose between it and the poses that it visits again.
        let at_once =
            Revisits { drift_every: NonZeroUsize::new(1), drift_poses: 3, ..Revisits::default() };
        assert_eq!(with_repeats(&[2, 0, 1], &at_once).len(), 3);
    }
}
