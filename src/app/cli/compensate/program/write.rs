//! Corrected programs → their new folder, with the record by which they are undone.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use chrono::DateTime;

use super::ProgramError;
use crate::io::calibrations_table::PublishedArm;
use crate::io::whole_file::write_whole;
use crate::programs::Programs;
use crate::programs::record::{Changed, RECORD, Record, digest};
use crate::programs::write::{Edit, applied, marks};

/// Writes the files that change, each at its name in the folder, and the record of what changed.
pub(super) fn write(
    programs: &Programs,
    all: &[Vec<Edit>],
    out: &Path,
    arm: &PublishedArm,
) -> Result<(), ProgramError> {
    let PublishedArm { key, arm, .. } = arm;
    let date = today();
    let [run, robot, session] = [&key.run, &key.robot, &key.session].map(Clone::clone);
    let mut written = Vec::new();
    let mut files = Vec::new();
    for (file, own) in programs.files.iter().zip(all).filter(|(_, own)| !own.is_empty()) {
        let words = format!(
            "table calibrations, run {run} of robot {robot}, session {session}, {date}; original blake3 {}",
            digest(&file.bytes)
        );
        let mut edits = own.clone();
        edits.extend(marks(file, &words, &arm.table_id));
        let bytes = applied(&file.bytes, &edits);
        files.push(Changed::of(file, &bytes, &edits));
        written.push((out.join(&file.name), bytes));
    }
    if files.is_empty() {
        return Ok(());
    }
    let record = Record { calibration: arm.table_id.clone(), robot, session, run, date, files };
    let path = out.join(RECORD);
    let bytes = serde_json::to_vec(&record)
        .map_err(|source| ProgramError::Write { path: path.clone(), source: source.into() })?;
    write_new(&path, &bytes)?;
    written.iter().try_for_each(|(path, bytes)| write_new(path, bytes))
}

/// Writes a file that is not there yet, and the folders that it is in.
pub(super) fn write_new(path: &Path, bytes: &[u8]) -> Result<(), ProgramError> {
    let wrong = |source| ProgramError::Write { path: path.to_owned(), source };
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder).map_err(wrong)?;
    }
    write_whole(path, |sink| std::io::Write::write_all(sink, bytes)).map_err(wrong)
}

/// The day of the correction, UTC.
fn today() -> String {
    let since = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let seconds = since.ok().and_then(|own| i64::try_from(own.as_secs()).ok());
    let day = seconds.and_then(|seconds| DateTime::from_timestamp(seconds, 0));
    day.map_or_else(|| "no date".to_owned(), |day| day.date_naive().to_string())
}
