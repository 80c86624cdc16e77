//! The nodes of a table: where they lie, and what each holds.

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use nalgebra::{Matrix3, Point3, Vector3};

use super::{CompensationTableError, TableFile};
use crate::compensation::Known;
use crate::geometry::{Base, Command, Position, Transform};
use crate::grid::{Lattice, Refusal};
use crate::io::table::Stored as _;

/// A node further than this from its place in the lattice is not on it, mm.
const ON_LATTICE_MM: f64 = 1e-6;

const INDICES: [&str; 3] = ["index_x", "index_y", "index_z"];
const STEPS: [&str; 3] = ["step_x_mm", "step_y_mm", "step_z_mm"];
const ERROR: [&str; 3] = ["error_x_mm", "error_y_mm", "error_z_mm"];
const COVARIANCE: [&str; 6] = [
    "error_cov_xx_mm2",
    "error_cov_xy_mm2",
    "error_cov_xz_mm2",
    "error_cov_yy_mm2",
    "error_cov_yz_mm2",
    "error_cov_zz_mm2",
];

impl TableFile<'_> {
    /// The lattice of the nodes in the base frame.
    pub(super) fn lattice(
        &self,
        command_from_base: &Transform<Command, Base>,
    ) -> Result<Lattice, CompensationTableError> {
        let base_from_command = command_from_base.inverse();
        let in_base = |row| *(base_from_command * self.position(row)).point();
        let mut step = [0.0; 3];
        for (step, column) in step.iter_mut().zip(STEPS) {
            *step = self.said().positive(column)?;
        }
        let lattice = Lattice {
            origin: in_base(0),
            step,
            counts: self.counts()?,
        };
        for row in 0..self.table.rows() {
            let off_mm = (in_base(row) - lattice.position(row)).norm();
            if off_mm > ON_LATTICE_MM {
                let problem =
                    format!("it lies {off_mm:.6} mm off the lattice of the table's steps");
                return Err(self.node_error(row, problem));
            }
        }
        Ok(lattice)
    }

    /// Nodes along each axis: every one is there, in its order.
    fn counts(&self) -> Result<[usize; 3], CompensationTableError> {
        let rows = self.table.rows();
        let last = INDICES.map(|column| self.table.i64(column).value(rows - 1));
        let count = |index: i64| {
            usize::try_from(index)
                .ok()?
                .checked_add(1)
                .filter(|&count| count > 1)
        };
        let counts = last.map(count);
        let [Some(nx), Some(ny), Some(nz)] = counts else {
            return Err(self.node_error(
                rows - 1,
                format!("its index {last:?} leaves an axis without a cell"),
            ));
        };
        if nx.checked_mul(ny).and_then(|nodes| nodes.checked_mul(nz)) != Some(rows) {
            return Err(self.node_error(
                rows - 1,
                format!("its index {last:?} says {nx} × {ny} × {nz} nodes, there are {rows}"),
            ));
        }
        for row in 0..rows {
            let expected = [row, row % nx, row / nx % ny, row / (nx * ny)];
            let found = ["node", INDICES[0], INDICES[1], INDICES[2]]
                .map(|column| self.table.i64(column).value(row));
            if expected.map(|index| i64::try_from(index).ok()) != found.map(Some) {
                return Err(self.node_error(
                    row,
                    format!("node and index are {found:?} where {expected:?} has its place"),
                ));
            }
        }
        Ok([nx, ny, nz])
    }

    fn position(&self, row: usize) -> Position<Command> {
        let [x, y, z] = ["x_mm", "y_mm", "z_mm"].map(|column| self.table.f64(column).value(row));
        Position::claim(Point3::new(x, y, z))
    }

    /// The nodes in the lattice's order.
    pub(super) fn nodes(&self) -> Result<Vec<Result<Known, Refusal>>, CompensationTableError> {
        (0..self.table.rows()).map(|row| self.node(row)).collect()
    }

    fn node(&self, row: usize) -> Result<Result<Known, Refusal>, CompensationTableError> {
        let refused = self.table.text("refused");
        if refused.is_valid(row) {
            return Ok(Err(Refusal::at(refused, row)));
        }
        let (Some(error), Some([xx, xy, xz, yy, yz, zz]), Some(joints)) = (
            self.numbers(ERROR, row),
            self.numbers(COVARIANCE, row),
            self.joints(row),
        ) else {
            return Err(self.node_error(
                row,
                "it is not refused and lacks an error, a covariance or joint angles".to_owned(),
            ));
        };
        if xx.min(yy).min(zz) < 0.0 {
            return Err(
                self.node_error(row, format!("a variance is negative: {xx}, {yy}, {zz} mm²"))
            );
        }
        Ok(Ok(Known {
            joints,
            error: Vector3::from(error),
            covariance: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        }))
    }

    fn numbers<const N: usize>(&self, columns: [&str; N], row: usize) -> Option<[f64; N]> {
        let arrays = columns.map(|column| self.table.f64(column));
        arrays
            .iter()
            .all(|array| array.is_valid(row))
            .then(|| arrays.map(|array| array.value(row)))
    }

    fn joints(&self, row: usize) -> Option<Vec<f64>> {
        let lists = self.table.list("joints_rad");
        let angles = lists.is_valid(row).then(|| lists.value(row))?;
        Some(angles.as_primitive::<Float64Type>().values().to_vec())
    }
}
