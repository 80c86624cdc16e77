//! A Parquet file of table `compensation` → a [`CompensationTable`], its run and its verdict.
//!
//! 1. The file keeps the contract of `schemas/compensation.toml` ([`read_given`]).
//! 2. What a table says of itself stands in every row, and has to be the same in each (`terms`).
//! 3. The nodes are a lattice in the base frame, which may be turned against the frame of commands (`nodes`); every
//!    position is held against it.
//! 4. Each node has an error with its covariance, or the reason why it has none.

mod nodes;
mod terms;

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::common::{self, CommonError};
use super::lake::read_given;
use super::schema::{self, SchemaError};
use super::table::{FileError, Row as _};
use super::tables::compensation::{NodeRow, TableColumns};
use super::tables::validity::ValidFor;
pub use super::tables::words::TableVerdict;
use crate::at::At;
use crate::compensation::{CompensationTable, Misfit};
use crate::geometry::{Flange, Position};
use crate::ingest::AngleUnit;
use crate::manifest::RunKey;
use crate::report::frame::StatedFrame;
use crate::targets::JointUnits;

/// A compensation table as a run published it.
#[derive(Debug, Clone, PartialEq)]
pub struct PublishedTable {
    /// Units of the joints in a text, degrees where they turn.
    pub units: JointUnits,
    /// The run that made it.
    pub key: RunKey,
    /// Whether its step meets the pipeline's tolerance.
    pub verdict: TableVerdict,
    /// Mean errors before, by it and by the identified arm, in words; `None` where its run does not state them.
    pub table_and_arm: Option<String>,
    /// The base that its errors are stated in.
    pub error_frame: StatedFrame,
    pub table: CompensationTable,
    /// Lowest and highest angle of each joint over the stations used, rad.
    pub measured: Vec<[f64; 2]>,
    /// Where the measured target sat at the flange.
    pub flange_from_target: Position<Flange>,
}

/// Why a file cannot be read as a compensation table.
#[derive(Debug, Error)]
pub enum CompensationTableError {
    /// No such table file.
    #[error(transparent)]
    File(#[from] FileError),
    /// The program does not know its own table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
    /// No row.
    #[error("{path} holds no node; it is not the table of a run that chose a step")]
    Empty { path: PathBuf },
    /// It does not say one thing of itself.
    #[error(transparent)]
    Common(#[from] CommonError),
    /// A node that does not fit.
    #[error("{0}; run the session again")]
    Node(At<String>),
    /// Nodes that do not make a table.
    #[error("{0}; run the session again")]
    Misfit(At<Misfit>),
}

/// Reads the compensation table that a run published.
pub fn read(path: &Path) -> Result<PublishedTable, CompensationTableError> {
    let published = read_given(path, schema::find("compensation")?)?;
    let rows = NodeRow::read(&published);
    if rows.is_empty() {
        return Err(CompensationTableError::Empty { path: path.to_owned() });
    }
    let every = rows.iter().map(|row| row.of_table.as_ref());
    let own = common::of_every_row(path, &published, every)?.clone();
    let file = TableFile { path, rows, own };
    let (own, valid_for) = (&file.own, &file.own.valid_for);
    let command_from_base = valid_for.command_from_base(path)?;
    let lattice = file.lattice(&command_from_base)?;
    let table = CompensationTable::new(file.terms()?, command_from_base, lattice, file.nodes()?);
    Ok(PublishedTable {
        key: common::key(path, &published)?,
        verdict: own.verdict,
        table_and_arm: own.table_and_arm.clone(),
        error_frame: valid_for.error_frame.stated(),
        units: joint_units(valid_for),
        measured: common::joint_ranges(path, valid_for, valid_for.joint_names.len())?,
        flange_from_target: Position::claim(own.flange_from_target.into()),
        table: table
            .map_err(|misfit| CompensationTableError::Misfit(At::new(path.display(), misfit)))?,
    })
}

/// Units of the joints in a text, degrees where they turn.
fn joint_units(valid_for: &ValidFor) -> JointUnits {
    let units = valid_for.joint_units.iter().flat_map(|units| units.iter());
    JointUnits::new(AngleUnit::Deg, units.map(|unit| unit == "mm").collect())
}

/// A file that keeps the schema, with at least one row.
struct TableFile<'a> {
    path: &'a Path,
    rows: Vec<NodeRow>,
    own: TableColumns,
}

impl TableFile<'_> {
    /// The error of a node, or of its row where the node's number itself is wrong.
    fn node_error(&self, node: usize, problem: String) -> CompensationTableError {
        let place = format!("{}, node {node}", self.path.display());
        CompensationTableError::Node(At::new(place, problem))
    }
}
