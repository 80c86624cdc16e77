//! What sessions said to the next ones, beside the tables and no part of them: `.learnt/ROBOT/SESSION/ESTIMATE.bin`.
//!
//! Nothing published follows from it being there: it may be removed, and is then made again from the sessions as joined. The lake keeps
//! that of the last sessions alone, some tens of megabytes each, since each next one has what those before it said.

use std::fs;
use std::io::{self, Read as _};
use std::path::Path;

use super::{Lake, LakeError, session_key};
use crate::io::input::Bound;
use crate::manifest::RunKey;

/// The folder of it.
pub(super) const FOLDER: &str = ".learnt";
/// Ending of a file.
pub(super) const ENDING: &str = ".bin";

impl Lake {
    /// What the sessions of an estimate said, as it was kept; `None` where there is nothing that can be read.
    pub fn learnt(&self, estimate: &RunKey) -> Option<Vec<u8>> {
        let file = self.store.open(&learnt(estimate).ok()?).ok()?;
        let most = Bound::TABLE.bytes;
        let mut bytes = Vec::new();
        file.take(most).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    }

    /// Keeps what the sessions of an estimate said, completely or not at all.
    pub fn put_learnt(&self, estimate: &RunKey, bytes: &[u8]) -> Result<(), LakeError> {
        self.put_whole(&learnt(estimate)?, bytes)
    }

    /// Moves what sessions said from a lake in one folder to that in another; nothing where there is nothing.
    pub fn move_learnt(from: &Path, to: &Path) -> io::Result<()> {
        match fs::rename(from.join(FOLDER), to.join(FOLDER)) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            moved => moved,
        }
    }

    /// Removes what the sessions of an estimate said, where it is there.
    pub fn remove_learnt(&self, estimate: &RunKey) -> Result<(), LakeError> {
        let key = learnt(estimate)?;
        if self.store.exists(&key)? {
            self.store.remove(&key)?;
        }
        Ok(())
    }
}

fn learnt(estimate: &RunKey) -> Result<String, LakeError> {
    let run = super::encoded("run", &estimate.run)?;
    Ok(format!("{}/{run}{ENDING}", session_key(FOLDER, estimate)?))
}
