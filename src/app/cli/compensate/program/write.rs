//! Corrected programs → their new folder, with the record by which they are undone.

use std::fs;
use std::path::Path;
use std::time::SystemTime;

use super::ProgramError;
use crate::cli::compensate::CompensateCommandError;
use crate::cli::compensate::record::{Made, Recording, utc};
use crate::compensation::Corrected;
use crate::files::whole_file::write_whole;
use crate::io::calibrations_table::PublishedArm;
use crate::io::rows::Word as _;
use crate::io::tables::words::CorrectedForm;
use crate::manifest::RunKey;
use crate::programs::record::{Changed, RECORD, Record, digest};
use crate::programs::write::{applied, marks};
use crate::programs::{Edit, File, Programs};

/// A file that changes.
pub(super) struct Written {
    /// Its index among the files.
    file: usize,
    bytes: Vec<u8>,
    changed: Changed,
}

/// The files that change, with their marks.
pub(super) fn written(
    programs: &Programs,
    all: &[Vec<Edit>],
    PublishedArm { key, arm, .. }: &PublishedArm,
    date: &str,
) -> Vec<Written> {
    let RunKey { run, robot, session } = key;
    let files = programs.files.iter().zip(all).enumerate().filter(|(_, (_, own))| !own.is_empty());
    let written = files.map(|(place, (file, own))| {
        let words = format!(
            "table calibrations, run {run} of robot {robot}, session {session}, {date}; original blake3 {}",
            digest(&file.bytes)
        );
        let mut edits = own.clone();
        edits.extend(marks(file, &words, &arm.table_id, own));
        let bytes = applied(&file.bytes, &edits);
        let changed = Changed::of(file, &bytes, &edits);
        Written { file: place, bytes, changed }
    });
    written.collect()
}

/// Records each file by `add`; what became of the last record.
pub(super) fn record(
    written: &[Written],
    programs: &Programs,
    corrected: &[Option<Corrected>],
    add: impl Fn(Made<'_>) -> Result<Recording, CompensateCommandError>,
) -> Result<Recording, CompensateCommandError> {
    written.iter().try_fold(Recording::Done, |_, own| {
        let positions = programs.positions.iter().zip(corrected);
        let positions = positions.filter(|(position, _)| position.file == own.file);
        add(Made {
            form: form(&programs.files[own.file]),
            bytes: &own.bytes,
            targets_digest: own.changed.original_blake3.clone(),
            targets: positions.clone().count(),
            corrected: positions.filter_map(|(_, corrected)| corrected.as_ref()).collect(),
        })
    })
}

fn form(file: &File) -> CorrectedForm {
    file.dialect_name().and_then(CorrectedForm::of_word).expect("a dialect is named as its form")
}

/// Writes the files that change, each at its name in the folder, and the record of what changed.
pub(super) fn write(
    written: Vec<Written>,
    out: &Path,
    arm: &PublishedArm,
    date: String,
) -> Result<(), ProgramError> {
    if written.is_empty() {
        return Ok(());
    }
    let RunKey { run, robot, session } = arm.key.clone();
    let (files, bytes): (Vec<Changed>, Vec<Vec<u8>>) =
        written.into_iter().map(|own| (own.changed, own.bytes)).unzip();
    let paths: Vec<_> = files.iter().map(|own| out.join(&own.name)).collect();
    let calibration = arm.arm.table_id.clone();
    let record = Record { calibration, robot, session, run, date, files };
    let path = out.join(RECORD);
    let record = serde_json::to_vec(&record)
        .map_err(|source| ProgramError::Write { path: path.clone(), source: source.into() })?;
    write_new(&path, &record)?;
    paths.iter().zip(&bytes).try_for_each(|(path, bytes)| write_new(path, bytes))
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
pub(super) fn today() -> String {
    utc(SystemTime::now()).map_or_else(|| "no date".to_owned(), |now| now.date_naive().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_names_the_dialect_of_its_file() {
        let of = |name: &str| form(&File { name: name.to_owned(), bytes: Vec::new() });
        assert_eq!(["R1/wing.src", "R1/WING.DAT"].map(of), [CorrectedForm::Krl; 2]);
        assert_eq!(["part.mod", "main.prg"].map(of), [CorrectedForm::Rapid; 2]);
        assert_eq!(of("TP/WING.LS"), CorrectedForm::Fanuc);
        assert_eq!(of("wing.script"), CorrectedForm::UrScript);
    }
}
