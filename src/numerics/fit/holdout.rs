//! Held-out stations: whole blocks of the work space, never single points of a dense set.
//!
//! The work space is cut into blocks; a block's fold is the parity of its indices, so that the eight folds interleave
//! and every station is held out exactly once: neighbours of a held-out point would reveal it ([`crate::method::accuracy`]).

use nalgebra::Point3;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Blocks {
    /// Size of a block along x, y, z of the base frame, mm. Absent: a quarter of the stations' extent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub size_mm: Option<[f64; 3]>,
    /// A corner of a block, mm. Absent: the least coordinates of the stations.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub origin_mm: Option<[f64; 3]>,
}

/// Folds in all: two parities along each of three axes.
pub const FOLDS: usize = 8;

/// Blocks along each axis where the size is not given.
const BLOCKS_PER_AXIS: f64 = 4.0;

impl Blocks {
    /// The fold (0 to 7) of each position: the parities of its block's x, y and z index as bits 0, 1 and 2.
    pub fn folds(&self, positions: &[Point3<f64>]) -> Vec<usize> {
        let parity = |index: f64| usize::from(index.rem_euclid(2.0) >= 1.0);
        let cells = self.cells(positions).into_iter();
        cells.map(|[x, y, z]| parity(x) + 2 * parity(y) + 4 * parity(z)).collect()
    }

    /// The block of each position: its index along x, y and z, a whole number.
    pub fn cells(&self, positions: &[Point3<f64>]) -> Vec<[f64; 3]> {
        let (low, high) = extent(positions);
        let origin = self.origin_mm.unwrap_or(low);
        let quarter = |axis: usize| (high[axis] - low[axis]) / BLOCKS_PER_AXIS;
        let size = self.size_mm.unwrap_or_else(|| std::array::from_fn(quarter));
        let index = |position: &Point3<f64>, axis: usize| {
            // A flat axis has one block.
            if size[axis] > 0.0 {
                ((position[axis] - origin[axis]) / size[axis]).floor()
            } else {
                0.0
            }
        };
        positions.iter().map(|position| std::array::from_fn(|axis| index(position, axis))).collect()
    }
}

/// The least and the largest coordinates of `positions`, mm; zeros for an empty set.
pub fn extent(positions: &[Point3<f64>]) -> ([f64; 3], [f64; 3]) {
    let bound = |axis: usize, pick: fn(f64, f64) -> f64| {
        positions.iter().map(|p| p[axis]).reduce(pick).unwrap_or(0.0)
    };
    (
        std::array::from_fn(|axis| bound(axis, f64::min)),
        std::array::from_fn(|axis| bound(axis, f64::max)),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folds_are_the_parities_of_the_blocks() {
        let blocks = Blocks {
            size_mm: Some([100.0, 200.0, 200.0]),
            origin_mm: Some([625.0, -650.0, 350.0]),
        };
        // x: (730 − 625)/100 = 1.05 odd; y: (−440 + 650)/200 = 1.05 odd; z: (400 − 350)/200 = 0.25 even.
        assert_eq!(blocks.folds(&[Point3::new(730.0, -440.0, 400.0)]), [3]);
        assert_eq!(blocks.folds(&[Point3::new(600.0, -440.0, 400.0)]), [3]); // one block below the origin is odd
    }

    #[test]
    fn a_flat_session_has_folds_in_its_plane_only() {
        let plane: Vec<_> =
            (0..16).map(|i| Point3::new(f64::from(i % 4), f64::from(i / 4), 7.0)).collect();
        let folds = Blocks::default().folds(&plane);
        assert!(folds.iter().all(|&fold| fold < 4));
        assert!((0..4).all(|fold| folds.contains(&fold)));
    }
}
