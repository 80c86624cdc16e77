use nalgebra::{Point3, Vector3};

use super::{CompensationTableError, TableFile, common};
use crate::compensation::Known;
use crate::geometry::{Base, Command, Position, Transform, symmetric};
use crate::grid::{Lattice, Refusal};
use crate::tables::compensation::NodeRow;

/// A node further than this from its place in the lattice is not on it, mm.
const ON_LATTICE_MM: f64 = 1e-6;

const STEPS: [&str; 3] = ["step_x_mm", "step_y_mm", "step_z_mm"];

impl TableFile<'_> {
    pub(super) fn lattice(
        &self,
        command_from_base: &Transform<Command, Base>,
    ) -> Result<Lattice, CompensationTableError> {
        let base_from_command = command_from_base.inverse();
        let in_base = |node: &NodeRow| *(base_from_command * position(node)).point();
        let step = self.own.steps_mm;
        if let Some((column, step)) = STEPS.into_iter().zip(step).find(|(_, step)| *step <= 0.0) {
            let problem = format!("{step} is not positive");
            return Err(common::value_error(self.path, column, problem).into());
        }
        let lattice = Lattice { origin: in_base(&self.rows[0]), step, counts: self.counts()? };
        for (row, node) in self.rows.iter().enumerate() {
            let off_mm = (in_base(node) - lattice.position(row)).norm();
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
        let rows = self.rows.len();
        let last = index(&self.rows[rows - 1]);
        let count = |index: usize| index.checked_add(1).filter(|&count| count > 1);
        let [Some(nx), Some(ny), Some(nz)] = last.map(count) else {
            let problem = format!("its index {last:?} leaves an axis without a cell");
            return Err(self.node_error(rows - 1, problem));
        };
        if nx.checked_mul(ny).and_then(|nodes| nodes.checked_mul(nz)) != Some(rows) {
            let problem =
                format!("its index {last:?} says {nx} × {ny} × {nz} nodes, there are {rows}");
            return Err(self.node_error(rows - 1, problem));
        }
        for (row, node) in self.rows.iter().enumerate() {
            let expected = [row, row % nx, row / nx % ny, row / (nx * ny)];
            let [x, y, z] = index(node);
            let found = [node.node, x, y, z];
            if expected != found {
                let problem =
                    format!("node and index are {found:?} where {expected:?} has its place");
                return Err(self.node_error(row, problem));
            }
        }
        Ok([nx, ny, nz])
    }

    pub(super) fn nodes(&self) -> Result<Vec<Result<Known, Refusal>>, CompensationTableError> {
        let nodes = self.rows.iter().enumerate();
        nodes.map(|(row, node)| self.node(row, node)).collect()
    }

    fn node(
        &self,
        row: usize,
        node: &NodeRow,
    ) -> Result<Result<Known, Refusal>, CompensationTableError> {
        if let Some(refusal) = node.refused {
            return Ok(Err(refusal));
        }
        let lacks = "it is not refused and lacks an error, a covariance or joint angles";
        let (Some(error), Some(covariance), Some(joints)) =
            (node.error, node.error_cov_mm2, &node.joints_rad)
        else {
            return Err(self.node_error(row, lacks.to_owned()));
        };
        let [xx, _, _, yy, _, zz] = covariance;
        if xx.min(yy).min(zz) < 0.0 {
            let problem = format!("a variance is negative: {xx}, {yy}, {zz} mm²");
            return Err(self.node_error(row, problem));
        }
        let (error, covariance) = (Vector3::from(error), symmetric(covariance));
        Ok(Ok(Known { joints: joints.clone(), error, covariance }))
    }
}

const fn index(node: &NodeRow) -> [usize; 3] {
    [node.index_x, node.index_y, node.index_z]
}

fn position(node: &NodeRow) -> Position<Command> {
    Position::claim(Point3::from(node.at))
}
