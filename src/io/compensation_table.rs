//! A Parquet file of table `compensation` → a [`CompensationTable`], its run and its verdict. What a table says of
//! itself has to be the same in every row. The nodes are a lattice in the base frame, each with an error and its
//! covariance, or the reason why it has none.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Point3, Quaternion, UnitQuaternion, Vector3};
use thiserror::Error;

use super::common::{self, CommonError};
use super::lake::read_given;
use super::tables::compensation::{NodeRow, TableColumns};
pub use super::tables::words::TableVerdict;
use super::tables::words::counted;
use crate::at::At;
use crate::compensation::{CompensationTable, Known, Misfit, Terms};
use crate::geometry::{Base, Command, Flange, Position, Transform, symmetric};
use crate::grid::{Interpolation, Lattice, Refusal};
use crate::ingest::AngleUnit;
use crate::manifest::RunKey;
use crate::report::frame::StatedFrame;
use crate::rows::Row as _;
use crate::table::FileError;
use crate::targets::JointUnits;

/// A node further than this from its place in the lattice is not on it, mm.
const ON_LATTICE_MM: f64 = 1e-6;

const STEPS: [&str; 3] = ["step_x_mm", "step_y_mm", "step_z_mm"];

#[derive(Debug, Clone, PartialEq)]
pub struct PublishedTable {
    pub units: JointUnits,
    pub key: RunKey,
    pub verdict: TableVerdict,
    /// Mean errors before, by it and by the identified arm, in words; `None` where its run does not state them.
    pub table_and_arm: Option<String>,
    pub error_frame: StatedFrame,
    pub table: CompensationTable,
    /// Lowest and highest angle of each joint over the stations used, rad.
    pub measured: Vec<[f64; 2]>,
    pub flange_from_target: Position<Flange>,
}

#[derive(Debug, Error)]
pub enum CompensationTableError {
    #[error(transparent)]
    File(#[from] FileError),
    #[error("{path} holds no node; it is not the table of a run that chose a step")]
    Empty { path: PathBuf },
    #[error(transparent)]
    Common(#[from] CommonError),
    #[error("{0}; run the session again")]
    Node(At<String>),
    #[error("{0}; run the session again")]
    Misfit(At<Misfit>),
}

pub fn read(path: &Path) -> Result<PublishedTable, CompensationTableError> {
    let published = read_given(path, NodeRow::schema())?;
    let rows = NodeRow::read(&published);
    if rows.is_empty() {
        return Err(CompensationTableError::Empty { path: path.to_owned() });
    }
    let every = rows.iter().map(|row| row.of_table.as_ref());
    let own = common::of_every_row(path, &published, every)?.clone();
    let file = TableFile { path, rows, own };
    let (own, valid_for) = (&file.own, &file.own.valid_for);
    let command_from_base =
        common::placement(path, "command_from_base", &valid_for.command_from_base)?;
    let slides =
        valid_for.joint_units.iter().flat_map(|units| units.iter()).map(|unit| unit == "mm");
    let lattice = file.lattice(&command_from_base)?;
    let table = CompensationTable::new(file.terms()?, command_from_base, lattice, file.nodes()?);
    Ok(PublishedTable {
        key: common::key(path, &published)?,
        verdict: own.verdict,
        table_and_arm: own.table_and_arm.clone(),
        error_frame: valid_for.error_frame.stated(),
        units: JointUnits::new(AngleUnit::Deg, slides.collect()),
        measured: common::joint_ranges(path, valid_for, valid_for.joint_names.len())?,
        flange_from_target: Position::claim(own.flange_from_target.into()),
        table: table
            .map_err(|misfit| CompensationTableError::Misfit(At::new(path.display(), misfit)))?,
    })
}

struct TableFile<'a> {
    path: &'a Path,
    rows: Vec<NodeRow>,
    own: TableColumns,
}

impl TableFile<'_> {
    fn terms(&self) -> Result<Terms, CommonError> {
        let (own, valid_for) = (&self.own, &self.own.valid_for);
        let [x, y, z, w] = own.turn;
        let turn = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        Ok(Terms {
            table_id: own.table_id.clone(),
            orientation: common::rotation(self.path, "qw", &turn)?,
            orientation_tolerance_rad: own.orientation_tolerance_deg.to_radians(),
            configuration: own.configuration.clone(),
            interpolation: own.interpolation,
            idw_power: self.idw_power()?,
            interpolation_mm2: self.interpolation_mm2()?,
            validity: valid_for.validity(),
            frame: valid_for.error_frame.stated().uncertainty(),
            counted: counted(valid_for.joint_units.as_deref()),
        })
    }

    /// Zero where the table does not state it.
    fn interpolation_mm2(&self) -> Result<Matrix3<f64>, CommonError> {
        let given = self.own.interpolation_moment_mm2.unwrap_or_default();
        let [xx, _, _, yy, _, zz] = given;
        if xx.min(yy).min(zz) < 0.0 {
            let negative = format!("{xx}, {yy} and {zz} mm² on its diagonal");
            return Err(common::value_error(self.path, "interpolation_moment", negative));
        }
        Ok(symmetric(given))
    }

    fn idw_power(&self) -> Result<f64, CommonError> {
        match (self.own.interpolation, self.own.idw_power) {
            (Interpolation::Trilinear, power) => Ok(power.unwrap_or_default()),
            (Interpolation::Idw, Some(power)) if power > 0.0 => Ok(power),
            (Interpolation::Idw, power) => {
                let problem = format!("{power:?}, and interpolation by idw needs a positive one");
                Err(common::value_error(self.path, "idw_power", problem))
            }
        }
    }

    fn lattice(
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

    fn nodes(&self) -> Result<Vec<Result<Known, Refusal>>, CompensationTableError> {
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

    fn node_error(&self, node: usize, problem: String) -> CompensationTableError {
        let place = format!("{}, node {node}", self.path.display());
        CompensationTableError::Node(At::new(place, problem))
    }
}

const fn index(node: &NodeRow) -> [usize; 3] {
    [node.index_x, node.index_y, node.index_z]
}

fn position(node: &NodeRow) -> Position<Command> {
    Position::claim(Point3::from(node.at))
}
