//! A box divided into equal cells: nodes, cells, and where a point lies in its cell.

use crate::units::whole;
use nalgebra::{Point3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A box in the base frame, mm.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct WorkBox {
    pub low_mm: [f64; 3],
    pub high_mm: [f64; 3],
}

impl WorkBox {
    /// The smallest box around `points`; `None` without any.
    pub fn around(points: &[Point3<f64>]) -> Option<Self> {
        let (low, high) = crate::fit::holdout::extent(points);
        (!points.is_empty()).then_some(Self { low_mm: low, high_mm: high })
    }

    /// Whether a point lies in the box, but for rounding at its rim.
    pub(super) fn has(&self, point: &Point3<f64>) -> bool {
        (0..3).all(|axis| {
            let rim = RIM * self.size(axis);
            (self.low_mm[axis] - rim..=self.high_mm[axis] + rim).contains(&point[axis])
        })
    }

    /// Size along an axis, mm.
    pub fn size(&self, axis: usize) -> f64 {
        self.high_mm[axis] - self.low_mm[axis]
    }
}

/// Nodes on a regular lattice, the same pitch between all neighbours along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Lattice {
    /// The node with the least coordinates, mm.
    pub origin: Point3<f64>,
    /// Pitch along each axis, mm.
    pub step: [f64; 3],
    /// Nodes along each axis.
    pub counts: [usize; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Error)]
pub enum NoLattice {
    #[error(
        "the box is flat along {axis} ({size_mm:.3} mm), and a grid needs a size along each axis: measure poses that differ \
         along {axis} too, or state [grid] box"
    )]
    Flat { axis: char, size_mm: f64 },
    #[error(
        "a step of {step_mm} mm makes {nodes:.0} nodes of the box, more than the {most:.0} that a table may have: choose a \
         larger step",
        most = MOST_NODES
    )]
    TooFine { step_mm: f64, nodes: f64 },
}

/// The cell of a point, and the point's place in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InCell {
    /// Numbers of the eight nodes; vertex v is high along axis k when bit k of v is set.
    pub vertices: [usize; 8],
    /// Place in the cell along each axis, 0 to 1.
    pub fraction: Vector3<f64>,
}

/// A point this close to the rim, in pitches, counts as on it, and a step that fits so nearly as fitting: commands carry rounding.
const RIM: f64 = 1e-6;
/// Coordinates nearer to each other than this are one plane, mm: commands carry rounding, and no grid is this fine.
pub(super) const PLANE_MM: f64 = 1.0;
/// The most nodes of a lattice. A table of more is of no use to a controller.
const MOST_NODES: f64 = 250_000.0;

impl InCell {
    /// Whether the point is at a node, where nothing is interpolated.
    pub(crate) fn is_node(&self) -> bool {
        let is_rim = |f: &f64| *f <= RIM || *f >= 1.0 - RIM;
        self.fraction.iter().all(is_rim)
    }
}

impl Lattice {
    /// The lattice that covers all of `bounds` with cells no larger than `step_mm`: along each axis of size Δ the pitch is
    /// Δ / max(1, ⌈Δ/L − 10⁻⁶⌉), so a step larger than the box makes one cell.
    pub fn new(bounds: &WorkBox, step_mm: f64) -> Result<Self, NoLattice> {
        let cells: [f64; 3] =
            std::array::from_fn(|axis| (bounds.size(axis) / step_mm - RIM).ceil().max(1.0));
        let nodes = cells.iter().map(|cells| cells + 1.0).product::<f64>();
        if nodes > MOST_NODES {
            return Err(NoLattice::TooFine { step_mm, nodes });
        }
        Self::of_cells(bounds, cells.map(whole))
    }

    /// The lattice that divides `bounds` into so many equal cells along each axis, one at least.
    pub fn of_cells(bounds: &WorkBox, cells: [usize; 3]) -> Result<Self, NoLattice> {
        match (0..3).find(|&axis| bounds.size(axis) < PLANE_MM) {
            Some(axis) => {
                Err(NoLattice::Flat { axis: ['x', 'y', 'z'][axis], size_mm: bounds.size(axis) })
            }
            None => Ok(Self {
                origin: Point3::from(bounds.low_mm),
                step: std::array::from_fn(|axis| bounds.size(axis) / cells[axis] as f64),
                counts: cells.map(|cells| cells + 1),
            }),
        }
    }

    pub fn node_count(&self) -> usize {
        self.counts.iter().product()
    }

    pub(super) fn cell_count(&self) -> usize {
        self.counts.iter().map(|count| count - 1).product()
    }

    /// Indices of the least vertices of all cells; x runs fastest.
    pub(super) fn cells(&self) -> impl Iterator<Item = [usize; 3]> {
        let [nx, ny, nz] = self.counts.map(|count| count - 1);
        (0..nz).flat_map(move |z| (0..ny).flat_map(move |y| (0..nx).map(move |x| [x, y, z])))
    }

    /// Volume that the cell whose least vertex has `index` shares with `bounds`, mm³.
    pub(super) fn volume_in(&self, bounds: &WorkBox, index: [usize; 3]) -> f64 {
        let shared = |axis: usize| {
            let low = (index[axis] as f64).mul_add(self.step[axis], self.origin[axis]);
            let high = (low + self.step[axis]).min(bounds.high_mm[axis]);
            (high - low.max(bounds.low_mm[axis])).max(0.0)
        };
        (0..3).map(shared).product()
    }

    /// The number of the node at `index`; x runs fastest.
    pub fn number(&self, index: [usize; 3]) -> usize {
        index[0] + self.counts[0] * (index[1] + self.counts[1] * index[2])
    }

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
            self.number([index[0] + (v & 1), index[1] + (v >> 1 & 1), index[2] + (v >> 2 & 1)])
        })
    }

    /// How much of the interpolation error points can show: `Σ f(1−f)·pitch²` over points and axes, with f a point's place in its cell,
    /// over `n·Σ pitch²/6`. It is 0 at nodes and 1 on average at uniform places; `None` without a point inside.
    pub(super) fn interpolation_shown<'p>(
        &self,
        points: impl Iterator<Item = &'p Point3<f64>>,
    ) -> Option<f64> {
        let pitch = Vector3::from(self.step);
        let shown =
            |cell: InCell| cell.fraction.map(|f| f * (1.0 - f)).dot(&pitch.component_mul(&pitch));
        let shown: Vec<f64> = points.filter_map(|point| self.locate(point)).map(shown).collect();
        let uniform = pitch.norm_squared() / 6.0;
        (!shown.is_empty()).then(|| shown.iter().sum::<f64>() / (shown.len() as f64 * uniform))
    }

    /// The cell a point lies in; `None` outside the lattice.
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
            index[axis] = whole(cell);
            fraction[axis] = (place - cell).clamp(0.0, 1.0);
        }
        Some(InCell { vertices: self.vertices(index), fraction })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_box() -> WorkBox {
        WorkBox { low_mm: [0.0, 0.0, 0.0], high_mm: [1000.0, 500.0, 250.0] }
    }

    #[test]
    fn the_whole_box_is_covered_by_equal_cells_no_larger_than_the_step() {
        let lattice = Lattice::new(&unit_box(), 200.0).expect("a lattice");
        assert_eq!(lattice.counts, [6, 4, 3]); // ⌈1000/200⌉+1, ⌈500/200⌉+1, ⌈250/200⌉+1
        let pitch = Vector3::from(lattice.step);
        assert!((pitch - Vector3::new(200.0, 500.0 / 3.0, 125.0)).norm() < 1e-9);
        assert_eq!(lattice.origin, Point3::origin());
        let last = lattice.position(lattice.node_count() - 1);
        assert!((last - Point3::new(1000.0, 500.0, 250.0)).norm() < 1e-9);
        // A step that fits but for rounding makes no sliver, one larger than the box one cell.
        let rounded = Lattice::new(&unit_box(), 250.0 * (1.0 - 1e-7)).expect("a lattice");
        assert_eq!(rounded.counts, [5, 3, 2]);
        let large = Lattice::new(&unit_box(), 600.0).expect("a lattice");
        assert_eq!(large.counts, [3, 2, 2]);
        let cells: Vec<f64> =
            large.cells().map(|cell| large.volume_in(&unit_box(), cell)).collect();
        assert_eq!(cells, [62.5e6; 2]);
    }

    #[test]
    fn a_flat_box_and_a_step_for_millions_of_nodes_have_no_lattice() {
        let mut flat = unit_box();
        flat.high_mm[2] = 0.01;
        let reason = Lattice::new(&flat, 100.0).expect_err("flat").to_string();
        assert!(reason.contains("flat along z (0.010 mm)"), "{reason}");
        let reason = Lattice::new(&unit_box(), 1e-3).expect_err("too fine");
        assert!(reason.to_string().contains("choose a larger step"));
    }

    #[test]
    fn points_on_nodes_show_nothing_of_interpolation_and_uniform_ones_all() {
        let lattice = Lattice::new(&unit_box(), 250.0).expect("a lattice");
        let shown = |points: &[Point3<f64>]| lattice.interpolation_shown(points.iter());
        assert_eq!(shown(&[Point3::origin(), Point3::new(250.0, 500.0, 0.0)]), Some(0.0));
        // Midway along x, of three equal pitches: ¼ of one where 3 · 1/6 are uniform.
        let midway = shown(&[Point3::new(125.0, 250.0, 0.0)]).expect("inside");
        assert!((midway - 0.5).abs() < 1e-12, "{midway}");
        let even = |k: usize| (k as f64 + 0.5) / 10.0;
        let uniform =
            |k: usize| Point3::new(even(k % 10), even(k / 10 % 10), even(k / 100)) * 250.0;
        let uniform = shown(&(0..1000).map(uniform).collect::<Vec<_>>()).expect("inside");
        assert!((uniform - 1.0).abs() < 0.01, "{uniform}");
        assert_eq!(shown(&[Point3::new(-9.0, 0.0, 0.0)]), None);
    }

    #[test]
    fn points_find_their_cell() {
        let lattice = Lattice::new(&unit_box(), 250.0).expect("a lattice");
        let found =
            lattice.locate(&Point3::new(1000.0, 125.0, 250.0)).expect("on the rim is inside");
        assert!((found.fraction - Vector3::new(1.0, 0.5, 1.0)).norm() < 1e-12);
        assert_eq!(lattice.position(found.vertices[7]), Point3::new(1000.0, 250.0, 250.0));
        assert!(lattice.locate(&Point3::new(1000.1, 0.0, 0.0)).is_none());
    }
}
