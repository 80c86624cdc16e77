//! `--undo FOLDER --out OTHER`: the original programs of a folder that corrected ones were written into.
//!
//! All originals are made before the first is written, so that a file which was edited since leaves nothing behind.

use std::io::ErrorKind;
use std::path::Path;

use super::{ProgramError, read, write_new};
use crate::at::At;
use crate::cli::compensate::error::CompensateCommandError;
use crate::cli::messages::Printable;
use crate::io::input::{self, Bound};
use crate::programs::record::{RECORD, Record};

/// For a record, which has some fifty bytes for each number that was replaced.
const BOUND: Bound = Bound {
    bytes: 256 << 20,
    advice: "a record has some fifty bytes a number; is it one of posegrid?",
};

pub(in crate::cli::compensate) fn main(folder: &Path, out: &Path) -> u8 {
    match run(folder, out) {
        Ok(record) => {
            let Record { files, date, run, robot, session, .. } = record;
            let told = format!(
                "{}: {} original files of the correction of {date} with run {run} of robot {robot}, session {session}",
                out.display(),
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

fn run(folder: &Path, out: &Path) -> Result<Record, CompensateCommandError> {
    if out.exists() {
        return Err(CompensateCommandError::Exists(out.to_owned()));
    }
    let record = record(folder)?;
    let mut originals = Vec::new();
    for changed in &record.files {
        let path = changed.path().map_err(ProgramError::from)?;
        let original = changed.original(&read(&folder.join(path))?).map_err(ProgramError::from)?;
        originals.push((out.join(path), original));
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
