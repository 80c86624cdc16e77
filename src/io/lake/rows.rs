//! Rows of `runs`, `joined_sessions` and `estimates` in a lake.

use super::{ESTIMATES, JOINED, Lake, LakeError, RUNS};
use crate::io::schema;
use crate::io::store::{Listed, Place};
use crate::io::table::{self, Opened};

/// Number of row files that are read at a time.
const AT_ONCE: usize = 64;

/// The place of a row, and the row or why it cannot be read.
pub type RunRow = (Place, Result<Opened, LakeError>);

impl Lake {
    /// The rows of all runs, in the order of robot, session and run; one that cannot be read does not stop the others.
    pub fn runs(&self) -> Result<Vec<RunRow>, LakeError> {
        self.rows(RUNS, RUNS, 2)
    }

    /// The rows of all sessions as joined, likewise.
    pub fn joined_sessions(&self) -> Result<Vec<RunRow>, LakeError> {
        self.rows(JOINED, JOINED, 2)
    }

    /// The rows of all estimates, likewise.
    pub fn estimates(&self) -> Result<Vec<RunRow>, LakeError> {
        self.rows(ESTIMATES, ESTIMATES, 2)
    }

    /// The rows of a table `levels` folders below a folder.
    pub(super) fn rows(
        &self,
        table: &str,
        folder: &str,
        levels: usize,
    ) -> Result<Vec<RunRow>, LakeError> {
        let schema = schema::find(table)?;
        let listed = self.store.list(folder, levels..=levels)?.into_iter();
        let listed: Vec<Listed> = listed
            .filter(|file| file.key.ends_with(".parquet"))
            .collect();
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
