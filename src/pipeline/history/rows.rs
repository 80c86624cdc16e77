//! Every row of `runs` of a robot: its file's digest, and the facts that the history needs.
//!
//! Files are read whole and digested, in parallel. The facts of a row are taken from the summary where that has its digest,
//! and otherwise read from the row and the session's table `clocks`. Only this file looks into the lake's folders.

use std::fs;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::HistoryError;
use super::summary::Summary;
use crate::io::input::{self, Bound};
use crate::io::lake::{Lake, LakeError};
use crate::io::schema;
use crate::io::store::StoreError;
use crate::io::table::{self, Row as _};
use crate::io::tables::clocks::ClockRow;
use crate::manifest::{RunKey, Written};
use crate::pipeline::verify::Claim;

/// The folder of a robot's rows.
pub(super) type RobotFolder = PathBuf;

/// A row of `runs`.
pub(super) struct Row {
    /// Its file.
    pub(super) place: PathBuf,
    /// BLAKE3 of the file, hexadecimal; empty where it cannot be read.
    pub(super) digest: String,
    /// Facts of the row, or why it cannot be read.
    pub(super) fact: Result<Fact, String>,
}

/// The facts of a row that the history needs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Fact {
    pub(super) key: RunKey,
    pub(super) replaces: Option<String>,
    /// First stamp of its controller log; `None` where its table `clocks` is gone.
    pub(super) measured_at_ns: Option<i64>,
    pub(super) kind: Kind,
    pub(super) pipeline: String,
    pub(super) version: String,
    pub(super) settings: String,
    pub(super) robot_file: String,
    /// Digests of the tables that are read: `calibrations`, `accuracy`.
    pub(super) tables: [String; 2],
}

/// The kind of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Kind {
    /// One session.
    Session,
    /// Several sessions together.
    Pooled,
    /// No session at all.
    Plan,
}

/// The folders of robots, in order.
pub(super) fn robots(lake: &Lake) -> Result<Vec<RobotFolder>, HistoryError> {
    let folder = lake.root().join("runs").named();
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    entries(&folder).map(|found| found.into_iter().filter(|path| path.is_dir()).collect())
}

/// The name of the robot whose rows these are.
pub(super) fn robot(rows: &[Row], folder: &Path) -> String {
    let named = rows.iter().find_map(|row| row.fact.as_ref().ok());
    named.map_or_else(
        || {
            folder
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned()
        },
        |fact| fact.key.robot.clone(),
    )
}

/// Every row of a robot, in the order of session and run.
pub(super) fn of_robot(
    lake: &Lake,
    folder: &Path,
    summary: &Summary,
) -> Result<Vec<Row>, HistoryError> {
    let sessions = entries(folder)?;
    let files: Result<Vec<Vec<PathBuf>>, _> = sessions
        .par_iter()
        .map(|session| rows_in(session))
        .collect();
    let files = files?.concat();
    Ok(files
        .into_par_iter()
        .map(|place| row(lake, place, summary))
        .collect())
}

fn rows_in(session: &Path) -> Result<Vec<PathBuf>, HistoryError> {
    if !session.is_dir() {
        return Ok(Vec::new());
    }
    let is_row = |path: &PathBuf| {
        let is_hidden = path
            .file_name()
            .is_some_and(|name| name.to_string_lossy().starts_with('.'));
        !is_hidden && path.extension().is_some_and(|ending| ending == "parquet")
    };
    entries(session).map(|found| found.into_iter().filter(is_row).collect())
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, HistoryError> {
    let found =
        fs::read_dir(folder).and_then(|found| found.map(|entry| Ok(entry?.path())).collect());
    let mut found: Vec<PathBuf> = found
        .map_err(StoreError::folder("list", folder))
        .map_err(LakeError::from)?;
    found.sort();
    Ok(found)
}

fn row(lake: &Lake, place: PathBuf, summary: &Summary) -> Row {
    let bytes = match input::bytes(&place, Bound::TABLE) {
        Ok(bytes) => bytes,
        Err(error) => {
            let reason = format!("{}: {error}", place.display());
            return Row {
                place,
                digest: String::new(),
                fact: Err(reason),
            };
        }
    };
    let digest = blake3::hash(&bytes).to_hex().to_string();
    let fact = match summary.facts.get(&digest) {
        Some(fact) if fact.measured_at_ns.is_some() => Ok(fact.clone()),
        _ => read(lake, &place),
    };
    Row {
        place,
        digest,
        fact,
    }
}

fn read(lake: &Lake, place: &Path) -> Result<Fact, String> {
    let told = |reason: String| format!("{}: {reason}", place.display());
    let schema = schema::find("runs").map_err(|error| error.to_string())?;
    let row = table::read(place, schema).map_err(|error| error.to_string())?;
    let claim = Claim::of(&row).map_err(told)?;
    let expected = lake.path(schema, &claim.key);
    let expected = expected.map_err(|error| error.to_string())?;
    if expected.as_path() != Some(place) {
        let reason = format!("its content is that of {}", expected.display());
        return Err(told(reason));
    }
    fact(lake, claim)
}

fn fact(lake: &Lake, claim: Claim) -> Result<Fact, String> {
    let kind = kind(&claim);
    let digest = |table: &str| {
        let is_own = |file: &&Written| file.table == table && file.session == claim.key.session;
        let own = claim.files.iter().find(is_own);
        own.map_or_else(String::new, |file| file.digest.clone())
    };
    let robot_file = claim.inputs.iter().find(|input| input.name == "robot");
    Ok(Fact {
        measured_at_ns: match kind {
            Kind::Session => first_stamp(lake, &claim.key)?,
            Kind::Pooled | Kind::Plan => Some(0),
        },
        replaces: claim.replaces,
        kind,
        tables: ["calibrations", "accuracy"].map(digest),
        robot_file: robot_file.map_or_else(String::new, |input| input.digest.clone()),
        pipeline: claim.pipeline,
        version: claim.version,
        settings: claim.settings_digest,
        key: claim.key,
    })
}

fn kind(claim: &Claim) -> Kind {
    match claim.sessions.as_slice() {
        [] => Kind::Plan,
        [own] if *own == claim.key.session => Kind::Session,
        _ => Kind::Pooled,
    }
}

/// First stamp of the session's controller log. For a run that another replaced, only the row may have been kept.
fn first_stamp(lake: &Lake, key: &RunKey) -> Result<Option<i64>, String> {
    let told = |error: LakeError| error.to_string();
    if !lake.has("clocks", key).map_err(told)? {
        return Ok(None);
    }
    let clocks = lake.read("clocks", key).map_err(told)?;
    let clock = ClockRow::read(&clocks).into_iter().next();
    clock
        .map(|clock| Some(clock.origin_ns))
        .ok_or_else(|| format!("session {}: its table clocks is empty", key.session))
}
