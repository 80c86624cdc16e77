//! The lake's record of corrections: no file that the lake knows is corrected twice. Marks can be removed from a file,
//! so targets are compared with all records of the table's lake: the file as a whole by its digest, its targets by
//! their values.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

use chrono::{DateTime, Utc};

use super::error::CorrectedAlready;
use super::source::Source;
use super::{CompensateCommandError, Result};
use crate::at::At;
use crate::compensation::{Corrected, Target};
use crate::files::input::{self, Bound};
use crate::io::lake::{Correction, Lake};
use crate::io::rows::Word as _;
use crate::io::tables::words::CorrectedForm;
use crate::io::targets::CorrectedBy;
use crate::manifest::{self, VERSION};

/// A target this close to a command on each axis is taken for it, mm: controllers keep 32-bit numbers, which at 4 m are
/// 0.24 µm apart.
const SAME_MM: f64 = 0.001_5;
/// The tolerance for each joint angle, rad: 2 µm at 2 m.
const SAME_RAD: f64 = 1e-6;

pub(super) struct Recorded {
    lake: Option<Lake>,
    /// Each record with its path, and the time it was written.
    records: Vec<(PathBuf, Option<SystemTime>, Correction)>,
}

/// A file that will be written.
pub(super) struct Made<'a> {
    pub(super) form: CorrectedForm,
    pub(super) bytes: &'a [u8],
    /// BLAKE3 of the file that it was made from, hexadecimal.
    pub(super) targets_digest: String,
    pub(super) targets: usize,
    pub(super) corrected: Vec<&'a Corrected>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Recording {
    Done,
    NoLake,
    /// The lake cannot take the record, and the caller accepts that (`--no-record`).
    Refused,
}

impl Recording {
    /// A note for the user; `None` where the record was made.
    pub(super) const fn words(self) -> Option<&'static str> {
        match self {
            Self::Done => None,
            Self::NoLake => Some(
                "not recorded: the table is in no lake, so the file written is recognised as corrected by its marks alone",
            ),
            Self::Refused => Some(
                "not recorded: the lake takes no record, so the file written is recognised as corrected by its marks alone",
            ),
        }
    }
}

impl Recorded {
    pub(super) fn around(table: &Path, source: &Source) -> Result<Self> {
        let by = source.by(&[]);
        let lake = Lake::around(table, by.table.word(), by.key);
        let mut records = Vec::new();
        let found = lake.as_ref().map_or(Ok(Vec::new()), Lake::corrections)?;
        for (place, written, record) in found {
            let place = place.named();
            match record {
                Ok(record) => records.push((place, written, record)),
                Err(problem) => {
                    return Err(CompensateCommandError::Unreadable { place, problem });
                }
            }
        }
        Ok(Self { lake, records })
    }

    /// Checks that the file is none that was written as corrected.
    pub(super) fn check_file(&self, targets: &Path) -> Result<()> {
        if self.records.is_empty() { Ok(()) } else { self.check_digest(targets, &digest(targets)?) }
    }

    /// Checks that a file of this digest is none that was written as corrected.
    pub(super) fn check_digest(&self, targets: &Path, digest: &str) -> Result<()> {
        let known = self.records.iter().find(|(_, _, own)| own.file_digest == digest);
        known.map_or(Ok(()), |known| Err(corrected_already(targets, "the file".to_owned(), known)))
    }

    /// Checks that of the targets fewer than `least` are commands that were written.
    pub(super) fn check_targets(
        &self,
        path: &Path,
        targets: &[Target],
        least: usize,
    ) -> Result<()> {
        for known in &self.records {
            let commands = Commands::of(&known.2);
            let same: Vec<&Target> = targets.iter().filter(|own| commands.has(own)).collect();
            if let Some(first) = same.first().filter(|_| same.len() >= least) {
                let (found, all) = (same.len(), targets.len());
                let what = format!("{found} of its {all} targets, {:?} first,", first.name);
                return Err(corrected_already(path, what, known));
            }
        }
        Ok(())
    }

    /// Records what will be written. The record is written before the file: no file exists without its record.
    pub(super) fn add(
        &self,
        made: &Made<'_>,
        by: CorrectedBy<'_>,
        no_record: bool,
    ) -> Result<Recording> {
        let Some(lake) = &self.lake else { return Ok(Recording::NoLake) };
        // A command that equals its target, within the tolerance, is not recorded.
        let is_moved = |done: &&&Corrected| done.correction.amax() > 2.0 * SAME_MM;
        let moved: Vec<&Corrected> = made.corrected.iter().filter(is_moved).copied().collect();
        let joints = moved.iter().map(|done| Some(done.joints.as_ref()?.command.clone()));
        let correction = Correction {
            key: by.key.clone(),
            corrected_by: by.table,
            form: made.form,
            version: VERSION.to_owned(),
            targets_digest: made.targets_digest.clone(),
            file_digest: blake3::hash(made.bytes).to_hex().to_string(),
            targets: count(made.targets),
            corrected: count(made.corrected.len()),
            positions: moved.iter().map(|done| done.command.coords().into()).collect(),
            joints: joints.collect::<Option<_>>().unwrap_or_default(),
        };
        match lake.record(&correction) {
            Ok(_) => Ok(Recording::Done),
            Err(_) if no_record => Ok(Recording::Refused),
            Err(source) => Err(CompensateCommandError::NotRecorded {
                lake: lake.root().named(),
                source: Box::new(source),
            }),
        }
    }
}

fn count(number: usize) -> i64 {
    i64::try_from(number).expect("no more rows than a file holds")
}

pub(super) fn digest(targets: &Path) -> Result<String> {
    let wrong = |source| CompensateCommandError::Digest(At::new(targets.display(), source));
    let bound = Bound { bytes: Bound::TABLE.bytes, ..Bound::TARGETS };
    let file = input::open(targets, bound).map_err(wrong)?;
    Ok(manifest::digest(file).map_err(wrong)?.0)
}

fn corrected_already(
    targets: &Path,
    what: String,
    (place, written, record): &(PathBuf, Option<SystemTime>, Correction),
) -> CompensateCommandError {
    CompensateCommandError::Again(Box::new(CorrectedAlready {
        path: targets.to_owned(),
        what,
        when: written.map_or_else(|| "earlier".to_owned(), day),
        key: record.key.clone(),
        record: place.clone(),
    }))
}

/// A file-system time for a person to read, to the minute.
fn day(time: SystemTime) -> String {
    let written = |time: DateTime<Utc>| format!("on {} UTC", &time.naive_utc().to_string()[..16]);
    utc(time).map_or_else(|| "earlier".to_owned(), written)
}

/// A file-system time to the second; `None` before 1970.
pub(super) fn utc(time: SystemTime) -> Option<DateTime<Utc>> {
    let since = time.duration_since(SystemTime::UNIX_EPOCH).ok()?;
    DateTime::from_timestamp(i64::try_from(since.as_secs()).ok()?, 0)
}

/// The commands of a record, indexed by their values.
struct Commands<'r> {
    positions: Near<'r>,
    joints: Near<'r>,
}

impl<'r> Commands<'r> {
    fn of(record: &'r Correction) -> Self {
        let positions = record.positions.iter().map(<[f64; 3]>::as_slice);
        let joints = record.joints.iter().map(Vec::as_slice);
        Self { positions: Near::of(positions, SAME_MM), joints: Near::of(joints, SAME_RAD) }
    }

    fn has(&self, target: &Target) -> bool {
        match (&target.position, &target.joints) {
            (Some(position), _) => self.positions.has(position.point().coords.as_slice()),
            (None, Some(joints)) => self.joints.has(&joints.angles),
            (None, None) => false,
        }
    }
}

/// Lists of numbers, sorted by their first number, so that those near a value are found without a scan.
struct Near<'r> {
    sorted: Vec<&'r [f64]>,
    apart: f64,
}

impl<'r> Near<'r> {
    fn of(lists: impl Iterator<Item = &'r [f64]>, apart: f64) -> Self {
        let mut sorted: Vec<&[f64]> = lists.filter(|list| !list.is_empty()).collect();
        sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
        Self { sorted, apart }
    }

    fn has(&self, wanted: &[f64]) -> bool {
        let Some(first) = wanted.first() else { return false };
        let from = self.sorted.partition_point(|list| list[0] < first - self.apart);
        let near = self.sorted[from..].iter();
        near.take_while(|list| list[0] <= first + self.apart).any(|list| {
            let mut pairs = list.iter().zip(wanted);
            list.len() == wanted.len() && pairs.all(|(a, b)| (a - b).abs() <= self.apart)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_found_by_what_is_near_it_in_every_number() {
        let lists = [[1.0, 2.0, 3.0], [1.0, -2.0, 3.0], [0.5, 0.0, 0.0]];
        let near = Near::of(lists.iter().map(<[f64; 3]>::as_slice), SAME_MM);
        assert!(near.has(&[1.001, -2.001, 2.999]));
        assert!(!near.has(&[1.002, 2.0, 3.0]) && !near.has(&[1.0, 2.0]) && !near.has(&[]));
    }

    #[test]
    fn a_day_is_reported_to_the_minute() {
        let noon = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(1_795_348_859);
        assert_eq!(day(noon), "on 2026-11-22 12:00 UTC");
    }
}
