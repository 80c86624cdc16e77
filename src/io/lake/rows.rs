//! Rows of `runs`, `joined_sessions`, `estimates` and `grids` in a lake.

use std::fs::File;

use rayon::ThreadPoolBuilder;

use super::{Lake, LakeError, RUNS, Result};
use crate::schema::{self, TableSchema};
use crate::store::{Listed, Place};
use crate::table::{self, Opened, Table};

const AT_ONCE: usize = 64;
const WAITING: usize = 16;

/// The place of a row, and the row or why it cannot be read.
pub type RunRow = (Place, Result<Opened>);

impl Lake {
    /// The rows of all runs, in the order of robot, session and run; one that cannot be read does not stop the others.
    pub fn runs(&self) -> Result<Vec<RunRow>> {
        self.rows_of_all(RUNS)
    }

    /// The rows of all results that this table makes exist, likewise.
    pub fn rows_of_all(&self, table: &str) -> Result<Vec<RunRow>> {
        self.rows(table, table, 2)
    }

    /// The files of the rows of all runs, in the order of robot, session and run; nothing is read.
    pub fn run_files(&self) -> Result<Vec<Listed>> {
        let mut listed = self.store.list(RUNS, 2..=2)?;
        listed.retain(|file| file.key.ends_with(".parquet"));
        Ok(listed)
    }

    pub fn open_listed(&self, listed: &Listed) -> Result<File> {
        Ok(self.store.open_listed(listed)?)
    }

    /// Reads a table by its path below the lake, checked by the digest that its file carries.
    pub(super) fn read_key(&self, key: &str, schema: &'static TableSchema) -> Result<Table> {
        let file = self.store.open(key)?;
        Ok(table::read_open(file, &self.store.place(key).named(), schema)?)
    }

    /// Uses as many threads as this lake is read with: one for each processor in a folder, `WAITING` on object storage.
    pub fn read_with<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        let pool = ThreadPoolBuilder::new().num_threads(WAITING);
        match (self.folder(), pool.build()) {
            (None, Ok(pool)) => pool.install(work),
            _ => work(),
        }
    }

    /// The rows of a table `levels` folders below a folder.
    pub(super) fn rows(&self, table: &str, folder: &str, levels: usize) -> Result<Vec<RunRow>> {
        let schema = schema::find(table)?;
        let listed = self.store.list(folder, levels..=levels)?.into_iter();
        let listed: Vec<Listed> = listed.filter(|file| file.key.ends_with(".parquet")).collect();
        let mut rows = Vec::with_capacity(listed.len());
        for listed in listed.chunks(AT_ONCE) {
            for (listed, file) in listed.iter().zip(self.store.open_all(listed)) {
                let place = self.store.place(&listed.key);
                let read = |file| Ok(table::open(file, &place.named(), schema)?);
                let row = file.map_err(LakeError::from).and_then(read);
                rows.push((place, row));
            }
        }
        Ok(rows)
    }
}
