//! What tables have in common whose one row makes a result exist: `runs`, `joined_sessions`, `estimates`, `grids`.

use thiserror::Error;

use super::readings::NoStations;
use crate::lake::{Lake, LakeError};
use crate::manifest::{Input, RunKey, VERSION, Work, Written, cpu_features, platform};
use crate::rows::{Row, columns, row};
use crate::table::{Table, TableError};

#[derive(Debug, Error)]
pub enum NotRestored {
    #[error(transparent)]
    Lake(#[from] LakeError),
    #[error("its row cannot be read: {0}; was it written by another build of this version?")]
    Json(#[from] serde_json::Error),
    #[error("its table {table} has {rows} rows; a result has one")]
    Rows { table: &'static str, rows: usize },
    #[error("its table readings is damaged: {0}")]
    Stations(#[from] NoStations),
    #[error("its lists of files read differ in length")]
    Inputs,
    #[error("its table grid_errors has answers of a step of {0} mm that its row does not have")]
    OtherStep(f64),
}

row! {
    /// What the rows of all stages state; read from the table of any of them.
    pub struct ResultRow of "grids" {
        made: MadeColumns,
        table_names: Option<Vec<String>>,
        table_digests: Option<Vec<String>>,
        row_digest: Option<String>,
    }
}

columns! {
    /// The build that made a result, and its settings.
    #[derive(Default)]
    pub struct MadeColumns {
        version: String,
        platform: String,
        cpu_features: Vec<String>,
        settings: String,
        settings_digest: String,
    }
}

columns! {
    /// The files that were read.
    #[derive(Default)]
    pub struct InputColumns {
        names as [input_names]: Vec<String>,
        bytes as [input_bytes]: Vec<u64>,
        digests as [input_digests]: Vec<String>,
    }
}

columns! {
    #[derive(Default)]
    pub struct FileColumns {
        names as [table_names]: Vec<String>,
        rows as [table_rows]: Vec<u64>,
        digests as [table_digests]: Vec<String>,
    }
}

impl From<&Work> for MadeColumns {
    fn from(work: &Work) -> Self {
        Self {
            version: VERSION.to_owned(),
            platform: platform(),
            cpu_features: cpu_features().into_iter().map(str::to_owned).collect(),
            settings: work.settings.clone(),
            settings_digest: work.settings_digest(),
        }
    }
}

impl From<&[Input]> for InputColumns {
    fn from(inputs: &[Input]) -> Self {
        Self {
            names: inputs.iter().map(|input| input.name.clone()).collect(),
            bytes: inputs.iter().map(|input| input.bytes).collect(),
            digests: inputs.iter().map(|input| input.digest.clone()).collect(),
        }
    }
}

impl InputColumns {
    /// The files; `None` where the lists differ in length.
    pub fn inputs(&self) -> Option<Vec<Input>> {
        let files = self.names.iter().zip(&self.bytes).zip(&self.digests);
        let input = |((name, &bytes), digest): ((&String, &u64), &String)| Input {
            name: name.clone(),
            bytes,
            digest: digest.clone(),
        };
        let is_whole = [self.bytes.len(), self.digests.len()] == [self.names.len(); 2];
        is_whole.then(|| files.map(input).collect())
    }
}

impl From<&[Written]> for FileColumns {
    fn from(written: &[Written]) -> Self {
        Self {
            names: written.iter().map(Written::name).collect(),
            rows: written.iter().map(|file| file.rows).collect(),
            digests: written.iter().map(|file| file.digest.clone()).collect(),
        }
    }
}

/// BLAKE3 of the content of such a row, hexadecimal: of all its columns except the one that holds this digest.
pub fn row_digest(row: &Table) -> String {
    row.digest_without(&["row_digest"])
}

/// The table of a row, with the digest that `signed` puts into it.
pub(super) fn signed<R: Row + Clone>(
    key: &RunKey,
    row: R,
    signed: impl Fn(R, Option<String>) -> R,
) -> Result<Table, TableError> {
    let unsigned = R::table(vec![row.clone()], key)?.table;
    Ok(R::table(vec![signed(row, Some(row_digest(&unsigned)))], key)?.table)
}

pub fn row<R: Row>(lake: &Lake, key: &RunKey) -> Result<R, NotRestored> {
    let rows = R::read(&lake.read(R::TABLE, key)?);
    let several = |rows: Vec<R>| NotRestored::Rows { table: R::TABLE, rows: rows.len() };
    let [row] = rows.try_into().map_err(several)?;
    Ok(row)
}
