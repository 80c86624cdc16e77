//! Whether the test stations of a split stand among the training stations: then figures are of interpolation between neighbours, not of
//! the arm elsewhere.
//!
//! The rule: of each test station the [`NEIGHBOURS`] nearest stations in joint space are looked at. A draw by lot gives them the share of
//! training stations that there is in all. A split by rows leaks from a quarter of that: every second row of a grid has a third of its
//! neighbours or more in training at any density. A split by region has neighbours across its borders by nature, so it leaks where it is
//! a region in name only: from nine tenths. Whole sessions do not leak so; poses that were visited in training are counted.

use super::suite::SplitKind;

/// Neighbours of a station that are looked at: two along each axis of space.
pub const NEIGHBOURS: usize = 6;
/// At least this part of the share that a draw by lot would give is a leak by rows.
const LEAK_BY_ROWS: f64 = 0.25;
/// At least this part of the share that a draw by lot would give is a leak by region.
const LEAK_BY_REGION: f64 = 0.9;
/// Joint angles that differ by less than this in every joint are one pose, rad: visits repeat within what a controller reports.
const SAME_POSE: f64 = 1e-3;

/// How the test stations stand to the training stations, in joint space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mixed {
    /// Mean share of training stations among the nearest neighbours of a test station.
    pub share: f64,
    /// Share of training stations in all: what a draw by lot would give.
    pub by_lot: f64,
    /// Median distance of a test station from the nearest training station, as the largest difference of a joint, rad.
    pub nearest_rad: f64,
    /// Number of test stations at a pose that trained.
    pub same_poses: usize,
    /// How the split divides stations.
    pub kind: SplitKind,
}

impl Mixed {
    /// Whether the split leaks.
    pub fn leaks(&self) -> bool {
        match self.kind {
            SplitKind::Rows => self.share >= LEAK_BY_ROWS * self.by_lot,
            SplitKind::Region => self.share >= LEAK_BY_REGION * self.by_lot,
            SplitKind::Session => false,
        }
    }
}

/// How test stations stand to training stations by their axis variables (rad; mm of a slide over 1000); `None` where one side is empty.
pub fn mixed(train: &[Vec<f64>], test: &[Vec<f64>], kind: SplitKind) -> Option<Mixed> {
    if train.is_empty() || test.is_empty() {
        return None;
    }
    let looked: Vec<(f64, f64)> = (0..test.len()).map(|own| look(train, test, own)).collect();
    let nearest: Vec<f64> = looked.iter().map(|(_, nearest)| *nearest).collect();
    Some(Mixed {
        share: looked.iter().map(|(share, _)| share).sum::<f64>() / looked.len() as f64,
        by_lot: train.len() as f64 / (train.len() + test.len()) as f64,
        nearest_rad: crate::figures::median(&nearest)?,
        same_poses: nearest.iter().filter(|&&own| own < SAME_POSE).count(),
        kind,
    })
}

/// Share of training stations among the nearest neighbours of a test station, and its distance from the nearest of them.
fn look(train: &[Vec<f64>], test: &[Vec<f64>], own: usize) -> (f64, f64) {
    let from = |other: &Vec<f64>| distance(&test[own], other);
    let trained = train.iter().map(|other| (from(other), true));
    let others = test.iter().enumerate().filter(|(place, _)| *place != own);
    let tested = others.map(|(_, other)| (from(other), false));
    let mut all: Vec<(f64, bool)> = trained.chain(tested).collect();
    // Of equal distances test stations come first: a tie is no evidence of a leak.
    all.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let nearest = train.iter().map(|other| largest_difference(&test[own], other));
    let count = NEIGHBOURS.min(all.len());
    let training = all[..count].iter().filter(|(_, is_training)| *is_training);
    (training.count() as f64 / count as f64, nearest.fold(f64::INFINITY, f64::min))
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
    squares.sum::<f64>().sqrt()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    let each = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    each.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of 6 × 6 × 6 stations, split by `trains` of the place and the three indices.
    fn grid(kind: SplitKind, trains: impl Fn(usize, [usize; 3]) -> bool) -> Mixed {
        let (mut train, mut test) = (Vec::new(), Vec::new());
        for place in 0..216 {
            let index = [place / 36, place / 6 % 6, place % 6];
            let joints = index.map(|own| 0.1 * own as f64 + 0.001 * (place % 7) as f64);
            if trains(place, index) {
                train.push(joints.to_vec());
            } else {
                test.push(joints.to_vec());
            }
        }
        mixed(&train, &test, kind).unwrap()
    }

    #[test]
    fn rows_by_turns_leak_at_any_share_and_a_region_of_its_own_does_not() {
        use SplitKind::{Region, Rows};
        assert!(grid(Rows, |place, _| place % 2 == 0).leaks());
        assert!(grid(Rows, |place, _| place % 5 != 0).leaks());
        assert!(grid(Rows, |place, _| place % 5 == 0).leaks());
        let halves = grid(Region, |_, [x, ..]| x < 3);
        assert!(!halves.leaks() && halves.nearest_rad > 0.15, "{halves:?}");
        // Halves that are called rows do not leak either, and rows that are called a region do.
        assert!(!grid(Rows, |_, [x, ..]| x < 3).leaks());
        assert!(grid(Region, |place, _| place % 5 != 0).leaks());
        // Every second block of 2 × 2 × 2 is a region.
        assert!(
            !grid(Region, |_, index| index.map(|own| own / 2 % 2).iter().sum::<usize>() < 3)
                .leaks()
        );
    }

    #[test]
    fn poses_that_trained_are_counted_and_another_session_does_not_leak() {
        let poses: Vec<Vec<f64>> = (0..10).map(|own| vec![f64::from(own)]).collect();
        let again = mixed(&poses, &poses, SplitKind::Session).unwrap();
        assert_eq!((again.same_poses, again.leaks()), (10, false));
    }
}
