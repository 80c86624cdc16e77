//! `--undo FOLDER --out OTHER`: the original programs of a folder that corrected ones were written into.
//!
//! All originals are made before the first is written, so that a file which was edited since leaves nothing behind.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::Path;

use super::write::write_new;
use super::{ProgramError, read};
use crate::at::At;
use crate::cli::compensate::error::CompensateCommandError;
use crate::cli::messages::Printable;
use crate::files::input::{self, Bound};
use crate::programs::record::{RECORD, Record, UndoError};

/// For a record, which has some fifty bytes for each number that was replaced.
const BOUND: Bound = Bound {
    bytes: 256 << 20,
    advice: "a record has some fifty bytes a number; is it one of posegrid?",
};

pub(in crate::cli::compensate) fn main(folder: &Path, out: Option<&Path>) -> u8 {
    match run(folder, out) {
        Ok(record) => {
            let Record { files, date, run, robot, session, .. } = record;
            let told = format!(
                "{} original files of the correction of {date} with run {run} of robot {robot}, session {session}",
                files.len()
            );
            tracing::info!("{}", Printable(&told));
            0
        }
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            error.exit_code()
        }
    }
}

fn run(folder: &Path, out: Option<&Path>) -> Result<Record, CompensateCommandError> {
    let out = out.ok_or(ProgramError::NoOut)?;
    if out.exists() {
        return Err(CompensateCommandError::Exists(out.to_owned()));
    }
    let record = record(folder)?;
    let mut originals = BTreeMap::new();
    for changed in &record.files {
        let path = changed.path().map_err(ProgramError::from)?;
        let original = changed.original(&read(&folder.join(path))?).map_err(ProgramError::from)?;
        if originals.insert(out.join(path), original).is_some() {
            let name = changed.name.clone();
            return Err(ProgramError::from(UndoError::Name { name }).into());
        }
    }
    originals.iter().try_for_each(|(path, bytes)| write_new(path, bytes))?;
    Ok(record)
}

fn record(folder: &Path) -> Result<Record, ProgramError> {
    let path = folder.join(RECORD);
    let bytes = input::bytes(&path, BOUND).map_err(|source| match source.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => ProgramError::NoRecord(folder.to_owned()),
        _ => ProgramError::Read(At::new(path.display(), source)),
    })?;
    serde_json::from_slice(&bytes).map_err(|source| ProgramError::Record { path, source })
}
