//! The lake: a folder of published tables, `TABLE/ROBOT/SESSION/RUN.parquet`, and the page of each run,
//! `report/ROBOT/SESSION/RUN.html`.
//!
//! 1. [`Lake::start`] begins a run, unless the lake has it already.
//! 2. [`OpenRun::publish`] writes a table whole or not at all, [`OpenRun::publish_page`] the run's page; neither is part of
//!    the lake yet. A table whose rows come before the run is known to have a result ([`OpenTable`]) waits for it under a
//!    temporary name ([`OpenRun::keep`]).
//! 3. [`OpenRun::commit`] creates the run's row in `runs`: from then on the run exists. Of several that commit the same
//!    run exactly one does, and nothing of a committed run is ever written again.
//!
//! What a run left that never committed is overwritten by the next that does the same work, or stays unseen: readers
//! join `runs`. [`Lake::clean`] removes temporaries of processes that are gone. [`Lake::lock`] keeps two batches from doing
//! the same work at once.

mod current;
mod error;
mod lock;
mod name;
mod parts;
mod rows;
mod run;
pub(crate) mod temporary;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::schema::{self, TableSchema};
use super::table::{self, Table};
use crate::manifest::RunKey;
use error::folder_error;

pub use error::LakeError;
pub use lock::{Holder, Lock, Locking};
pub use parts::{OpenTable, WholeTable};
pub use rows::RunRow;
pub use run::{Commit, OpenRun};

/// The folder of the pages, beside those of the tables.
const PAGES: &str = "report";

/// A folder of published tables.
#[derive(Debug, Clone)]
pub struct Lake {
    root: PathBuf,
}

impl Lake {
    /// The lake in the folder `root`, which is made when first written to.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// Its folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where a table of a run stands, or would.
    pub fn path(&self, schema: &TableSchema, key: &RunKey) -> Result<PathBuf, LakeError> {
        self.file(&schema.table, key, "parquet")
    }

    /// Where the page of a run stands, or would.
    pub fn page(&self, key: &RunKey) -> Result<PathBuf, LakeError> {
        self.file(PAGES, key, "html")
    }

    fn file(&self, folder: &str, key: &RunKey, ending: &str) -> Result<PathBuf, LakeError> {
        let part = |part, name: &str| {
            name::encode(name).map_err(|length| LakeError::Name {
                part,
                name: name.to_owned(),
                length,
            })
        };
        let folder = self.root.join(folder).join(part("robot", &key.robot)?);
        let file = format!("{}.{ending}", part("run", &key.run)?);
        Ok(folder.join(part("session", &key.session)?).join(file))
    }

    /// Whether the run exists: whether its row in `runs` does.
    pub fn exists(&self, key: &RunKey) -> Result<bool, LakeError> {
        let path = self.path(schema::find("runs")?, key)?;
        path.try_exists().map_err(folder_error("look for", &path))
    }

    /// Begins a run, or `None` when the lake has it.
    pub fn start(&self, key: &RunKey) -> Result<Option<OpenRun<'_>>, LakeError> {
        Ok((!self.exists(key)?).then(|| OpenRun::new(self, key)))
    }

    /// Reads a table of a run.
    pub fn read(&self, table: &str, key: &RunKey) -> Result<Table, LakeError> {
        let schema = schema::find(table)?;
        Ok(table::read(&self.path(schema, key)?, schema)?)
    }

    /// Removes temporaries of processes that are gone; gives their paths.
    pub fn clean(&self) -> Result<Vec<PathBuf>, LakeError> {
        let mut folders: Vec<PathBuf> = schema::all()
            .iter()
            .map(|schema| schema.table.as_str())
            .chain([PAGES])
            .map(|folder| self.root.join(folder))
            .collect();
        for _robot_then_session in 0..2 {
            folders = folders
                .iter()
                .map(|folder| subfolders(folder))
                .collect::<Result<Vec<_>, _>>()?
                .concat();
        }
        let stale = |folder: &PathBuf| {
            temporary::remove_stale(folder).map_err(folder_error("clean", folder))
        };
        Ok(folders
            .iter()
            .map(stale)
            .collect::<Result<Vec<_>, _>>()?
            .concat())
    }
}

fn subfolders(folder: &Path) -> Result<Vec<PathBuf>, LakeError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.and_then(Iterator::collect::<io::Result<Vec<_>>>),
    };
    let entries = entries.map_err(folder_error("list", folder))?;
    let mut folders: Vec<_> = entries
        .iter()
        .map(fs::DirEntry::path)
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    Ok(folders)
}
