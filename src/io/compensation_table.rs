//! A Parquet file of table `compensation` → a [`CompensationTable`], its run and its verdict. What a table says of
//! itself has to be the same in every row (`terms`). The nodes are a lattice in the base frame (`nodes`), each with an
//! error and its covariance, or the reason why it has none.

mod nodes;
mod terms;

use std::path::{Path, PathBuf};

use thiserror::Error;

use super::common::{self, CommonError};
use super::lake::read_given;
use super::tables::compensation::{NodeRow, TableColumns};
pub use super::tables::words::TableVerdict;
use crate::at::At;
use crate::compensation::{CompensationTable, Misfit};
use crate::geometry::{Flange, Position};
use crate::ingest::AngleUnit;
use crate::manifest::RunKey;
use crate::report::frame::StatedFrame;
use crate::rows::Row as _;
use crate::table::FileError;
use crate::targets::JointUnits;

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
    fn node_error(&self, node: usize, problem: String) -> CompensationTableError {
        let place = format!("{}, node {node}", self.path.display());
        CompensationTableError::Node(At::new(place, problem))
    }
}
