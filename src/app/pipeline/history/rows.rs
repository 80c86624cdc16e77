//! Every row of `runs` of a robot: its file's digest, and the facts that the history needs.
//!
//! Files are read whole and digested, in parallel; on object storage those that have another tag than the summary knows. The facts of a row are
//! taken from the summary where that has its digest, and otherwise read from the row and the session's table `clocks`.

use std::io::{Read as _, Seek as _};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::HistoryError;
use super::session::{self, Kept};
use super::summary::Summary;
use crate::files::input::Bound;
use crate::files::store::Listed;
use crate::files::{schema, table};
use crate::io::lake::{Lake, LakeError};
use crate::io::rows::{Row as _, Word as _};
use crate::io::tables::clocks::ClockRow;
use crate::io::tables::runs::RunRow;
use crate::manifest::{RunKey, Written};
use crate::pipeline::verify::Claim;

pub(super) struct RobotRows {
    pub(super) folder: String,
    pub(super) files: Vec<Listed>,
}

pub(super) struct Row {
    pub(super) place: PathBuf,
    /// The file's path below the lake, and its tag where the store has tags.
    pub(super) tagged: Option<(String, String)>,
    /// BLAKE3 of the file, hexadecimal; empty where it cannot be read.
    pub(super) digest: String,
    /// Facts of the row, or why it cannot be read.
    pub(super) fact: Result<Fact, String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Fact {
    pub(super) key: RunKey,
    /// First stamp of its controller log; `None` where its table `clocks` is gone.
    pub(super) measured_at_ns: Option<i64>,
    pub(super) kind: Kind,
    pub(super) pipeline: String,
    pub(super) version: String,
    pub(super) settings: String,
    pub(super) robot_file: String,
    /// Digests of the tables that are read: `calibrations`, `accuracy`.
    pub(super) tables: [String; 2],
    pub(super) result: RunResult,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RunResult {
    /// Start of its session, microseconds since 1970, UTC; `None` where no clock has an epoch.
    pub started_us: Option<i64>,
    pub verdict: String,
    /// The verdict as text; `None` in rows of early versions, as are the numbers.
    pub statement: Option<String>,
    /// Mean error before correction, mm.
    pub mean_before_mm: Option<f64>,
    /// Mean error after correction, mm.
    pub mean_after_mm: Option<f64>,
    pub means_of: Option<String>,
    /// The bound that the verdict rests on, mm.
    pub bound_mm: Option<f64>,
    /// The tolerance that it is compared with, mm; `None` where the settings state none.
    pub tolerance_mm: Option<f64>,
}

impl RunResult {
    /// The mean errors before and after, in words; `None` where the row does not say what they are of.
    pub fn before_and_after(&self) -> Option<String> {
        let (before, after) = (self.mean_before_mm?, self.mean_after_mm?);
        let of = self.means_of.as_ref()?;
        Some(format!("before → after: mean {before:.3} → {after:.3} mm ({of})"))
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Kind {
    Session,
    Pooled,
    Plan,
}

pub(super) fn robots(lake: &Lake) -> Result<Vec<RobotRows>, HistoryError> {
    if lake.folder().is_some_and(|folder| !folder.is_dir()) {
        return Err(HistoryError::NoLake(lake.root()));
    }
    let mut robots: Vec<RobotRows> = Vec::new();
    for file in lake.run_files()? {
        let folder = file.key.split('/').nth(1).unwrap_or_default();
        match robots.last_mut().filter(|last| last.folder == folder) {
            Some(last) => last.files.push(file),
            None => robots.push(RobotRows { folder: folder.to_owned(), files: vec![file] }),
        }
    }
    Ok(robots)
}

impl RobotRows {
    pub(super) fn robot(&self) -> String {
        Lake::name_of(&self.folder)
    }

    /// Every row, in the order of session and run.
    pub(super) fn read(&self, lake: &Lake, summary: &Summary) -> Vec<Row> {
        self.files.par_iter().map(|file| row(lake, file, summary)).collect()
    }
}

fn row(lake: &Lake, file: &Listed, summary: &Summary) -> Row {
    let place = lake.place_of(&file.key).named();
    let known = summary.known(file).map(|(digest, fact)| (digest, Ok(fact)));
    let read = known.map_or_else(|| read(lake, file, &place, summary), Ok);
    let (digest, fact) = read.unwrap_or_else(|reason| {
        let reason = format!("{}: {reason}", place.display());
        (String::new(), Err(reason))
    });
    let tagged = file.tag.clone().map(|tag| (file.key.clone(), tag));
    Row { place, tagged, digest, fact }
}

/// A row that was read: its digest, and its facts or why there are none.
type Read = (String, Result<Fact, String>);

fn read(lake: &Lake, listed: &Listed, place: &Path, summary: &Summary) -> Result<Read, String> {
    let mut file = lake.open_listed(listed).map_err(|error| error.to_string())?;
    let mut bytes = Vec::new();
    let most = Bound::TABLE.bytes;
    (&file).take(most).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    let digest = blake3::hash(&bytes).to_hex().to_string();
    let known = summary.facts.get(&digest);
    if let Some(fact) = known.filter(|fact| fact.measured_at_ns.is_some()) {
        return Ok((digest, Ok(fact.clone())));
    }
    file.rewind().map_err(|error| error.to_string())?;
    Ok((digest, facts(lake, file, place)))
}

fn facts(lake: &Lake, file: std::fs::File, place: &Path) -> Result<Fact, String> {
    let told = |reason: String| format!("{}: {reason}", place.display());
    let schema = schema::find("runs").map_err(|error| error.to_string())?;
    let row = table::read_open(file, place, schema).map_err(|error| error.to_string())?;
    let claim = Claim::of(&row).map_err(told)?;
    let expected = lake.place("runs", &claim.key).map_err(|error| error.to_string())?;
    if expected.named() != place {
        let reason = format!("its content is that of {}", expected.display());
        return Err(told(reason));
    }
    fact(lake, claim)
}

fn result(row: &RunRow) -> RunResult {
    let settings: Option<serde_json::Value> = serde_json::from_str(&row.made.settings).ok();
    let row = &row.ending;
    let tolerance = settings.as_ref().and_then(|own| own.pointer("/tolerance/mm"));
    RunResult {
        started_us: row.session_started.map(crate::units::WallTime::us),
        verdict: row.verdict.word().to_owned(),
        statement: row.statement.clone(),
        mean_before_mm: row.mean_before_mm,
        mean_after_mm: row.mean_after_mm,
        means_of: row.means_of.clone(),
        bound_mm: row.bound_mm,
        tolerance_mm: tolerance.and_then(serde_json::Value::as_f64),
    }
}

fn fact(lake: &Lake, claim: Claim) -> Result<Fact, String> {
    let kind = kind(&claim);
    let digest = |table: &str| {
        let is_own = |file: &&Written| file.table == table && file.session == claim.key.session;
        claim.files.iter().find(is_own).map_or_else(String::new, |file| file.digest.clone())
    };
    let tables = session::OF.map(digest);
    let robot_file = claim.inputs.iter().find(|input| input.name == "robot");
    Ok(Fact {
        measured_at_ns: match kind {
            Kind::Session => first_stamp(lake, &claim.key, &tables)?,
            Kind::Pooled | Kind::Plan => Some(0),
        },
        kind,
        tables,
        result: result(&claim.run),
        robot_file: robot_file.map_or_else(String::new, |input| input.digest.clone()),
        pipeline: claim.run.pipeline,
        version: claim.run.made.version,
        settings: claim.run.made.settings_digest,
        key: claim.key,
    })
}

fn kind(claim: &Claim) -> Kind {
    match claim.run.sessions.as_slice() {
        [] => Kind::Plan,
        [own] if *own == claim.key.session => Kind::Session,
        _ => Kind::Pooled,
    }
}

/// First stamp of the session's controller log. For a run that another replaced, only the row may have been kept.
fn first_stamp(lake: &Lake, key: &RunKey, tables: &[String; 2]) -> Result<Option<i64>, String> {
    let told = |error: LakeError| error.to_string();
    if let Some(kept) = Kept::read(lake, key, tables) {
        return Ok(Some(kept.measured_at_ns));
    }
    if !lake.has("clocks", key).map_err(told)? {
        return Ok(None);
    }
    let clocks = lake.read("clocks", key).map_err(told)?;
    let clock = ClockRow::read(&clocks).into_iter().next();
    clock
        .map(|clock| Some(clock.origin_ns))
        .ok_or_else(|| format!("session {}: its table clocks is empty", key.session))
}
