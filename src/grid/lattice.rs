//! A box cut into cells of one step: nodes, cells, and where a point lies in its cell.

use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};

/// A box in the base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct WorkBox {
    /// Least coordinates.
    pub low_mm: [f64; 3],
    /// Largest coordinates.
    pub high_mm: [f64; 3],
}

impl WorkBox {
    /// The smallest box around `points`; `None` without any.
    pub fn around(points: &[Point3<f64>]) -> Option<Self> {
        let (low, high) = crate::fit::holdout::extent(points);
        (!points.is_empty()).then_some(Self {
            low_mm: low,
            high_mm: high,
        })
    }

    /// Size along an axis, mm.
    pub fn size(&self, axis: usize) -> f64 {
        self.high_mm[axis] - self.low_mm[axis]
    }
}

/// Nodes on a regular lattice; `N = Π_k (⌊Δ_k/L_k⌋ + 1)`, the box cut to whole steps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lattice {
    /// The node with the least coordinates, mm.
    pub origin: Point3<f64>,
    /// Step along each axis, mm.
    pub step: [f64; 3],
    /// Nodes along each axis.
    pub counts: [usize; 3],
}

/// A point's cell and its place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InCell {
    /// Node numbers of the eight vertices; vertex v is high along axis k when bit k of v is set.
    pub vertices: [usize; 8],
    /// Place in the cell along each axis, 0 to 1.
    pub fraction: Vector3<f64>,
}

/// A point this close to the box's rim, in steps, counts as on it: commands carry rounding.
const RIM: f64 = 1e-6;

impl Lattice {
    /// The lattice of step `step` in `bounds`, centred in what the whole steps leave over; `None` where a step does not
    /// fit into the box along some axis.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a count of steps, at least one"
    )]
    pub fn new(bounds: &WorkBox, step: [f64; 3]) -> Option<Self> {
        let steps: [f64; 3] =
            std::array::from_fn(|axis| (bounds.size(axis) / step[axis] + RIM).floor());
        let fits = (0..3).all(|axis| step[axis] > 0.0 && steps[axis] >= 1.0 && steps[axis] < 1e6);
        let corner = |axis: usize| {
            bounds.low_mm[axis] + (bounds.size(axis) - steps[axis] * step[axis]) / 2.0
        };
        fits.then(|| Self {
            origin: Point3::new(corner(0), corner(1), corner(2)),
            step,
            counts: steps.map(|steps| steps as usize + 1),
        })
    }

    /// Nodes in all.
    pub fn node_count(&self) -> usize {
        self.counts.iter().product()
    }

    /// Cells in all.
    pub(super) fn cell_count(&self) -> usize {
        self.counts.iter().map(|count| count - 1).product()
    }

    /// The number of the node at `index`; x runs fastest.
    pub fn number(&self, index: [usize; 3]) -> usize {
        index[0] + self.counts[0] * (index[1] + self.counts[1] * index[2])
    }

    /// Where node `number` lies.
    pub fn position(&self, number: usize) -> Point3<f64> {
        let [nx, ny, _] = self.counts;
        let index = [number % nx, number / nx % ny, number / (nx * ny)];
        Point3::from(Vector3::from_fn(|axis, _| {
            (index[axis] as f64).mul_add(self.step[axis], self.origin[axis])
        }))
    }

    /// The vertices of the cell whose least vertex has `index`.
    pub fn vertices(&self, index: [usize; 3]) -> [usize; 8] {
        std::array::from_fn(|v| {
            self.number([
                index[0] + (v & 1),
                index[1] + (v >> 1 & 1),
                index[2] + (v >> 2 & 1),
            ])
        })
    }

    /// The cell a point lies in; `None` outside the lattice.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "checked to be within the counts"
    )]
    pub fn locate(&self, point: &Point3<f64>) -> Option<InCell> {
        let mut index = [0; 3];
        let mut fraction = Vector3::zeros();
        for axis in 0..3 {
            let cells = (self.counts[axis] - 1) as f64;
            let place = (point[axis] - self.origin[axis]) / self.step[axis];
            if !(-RIM..=cells + RIM).contains(&place) {
                return None;
            }
            let cell = place.clamp(0.0, cells).floor().min(cells - 1.0);
            index[axis] = cell as usize;
            fraction[axis] = (place - cell).clamp(0.0, 1.0);
        }
        Some(InCell {
            vertices: self.vertices(index),
            fraction,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box() -> WorkBox {
        WorkBox {
            low_mm: [0.0, 0.0, 0.0],
            high_mm: [1000.0, 500.0, 250.0],
        }
    }

    #[test]
    fn the_box_is_cut_to_whole_steps() {
        let lattice = Lattice::new(&unit_box(), [200.0; 3]).expect("the step fits");
        assert_eq!(lattice.counts, [6, 3, 2]); // ⌊1000/200⌋+1, ⌊500/200⌋+1, ⌊250/200⌋+1
        assert_eq!(lattice.origin, Point3::new(0.0, 50.0, 25.0)); // what is left over is shared by both sides
        assert!(Lattice::new(&unit_box(), [300.0; 3]).is_none());
    }

    #[test]
    fn points_find_their_cell() {
        let lattice = Lattice::new(&unit_box(), [250.0; 3]).expect("the step fits");
        let found = lattice
            .locate(&Point3::new(1000.0, 125.0, 250.0))
            .expect("on the rim is inside");
        assert!((found.fraction - Vector3::new(1.0, 0.5, 1.0)).norm() < 1e-12);
        assert_eq!(
            lattice.position(found.vertices[7]),
            Point3::new(1000.0, 250.0, 250.0)
        );
        assert!(lattice.locate(&Point3::new(1000.1, 0.0, 0.0)).is_none());
    }
}
