//! Sessions as joined, verified by themselves.
//!
//! For each row of `joined_sessions`: its name has to follow from its inputs, settings and version, its digest from its content, and its
//! files have to be as it says. Where a pipeline file finds the session's files under the same settings of ingest and join, they are joined
//! anew into a temporary lake, and both tables compared: bytes first, then values.

use std::path::PathBuf;

use super::recompute;
use crate::io::lake::{JOINED, Lake, LakeError};
use crate::io::store::Place;
use crate::io::table::compare::compare;
use crate::io::table::{Row as _, Table};
use crate::io::tables::joined_sessions::{JoinedSessionRow, inputs};
use crate::io::tables::readings::ReadingRow;
use crate::io::tables::runs::row_digest;
use crate::manifest::{RunKey, digest};
use crate::pipeline::configuration::{Configuration, Overrides, WorkPiece};
use crate::pipeline::run::{join_session, joined_work};
use crate::progress::Progress;

/// Columns that depend on the machine, or on the digests of what does.
const OF_THE_MACHINE: [&str; 5] = [
    "version",
    "platform",
    "cpu_features",
    "table_digests",
    "row_digest",
];

/// The findings about a session as joined.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JoinedVerified {
    /// Place of its row.
    pub place: Place,
    /// Robot, session and result; `None` where the row cannot be read.
    pub key: Option<RunKey>,
    /// Contradictions and changes, as text.
    pub problems: Vec<String>,
    /// Whether it was joined anew; `None` where no pipeline file finds its files.
    pub anew: Option<Anew>,
}

/// A session joined anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Anew {
    /// The same, byte for byte or, by another machine, in its values.
    Same,
    /// It differs in these tables.
    Differs(Vec<String>),
    /// It could not be joined: why.
    No(String),
}

impl JoinedVerified {
    /// Whether something was changed, or differs when joined anew.
    pub const fn is_mismatch(&self) -> bool {
        !self.problems.is_empty() || matches!(self.anew, Some(Anew::Differs(_)))
    }
}

/// Verifies the sessions as joined of these names, of sessions or results; of all where there are none.
pub fn joined(
    lake: &Lake,
    pipelines: &[PathBuf],
    names: &[String],
    progress: &dyn Progress,
) -> Result<Vec<JoinedVerified>, LakeError> {
    let mut verified = Vec::new();
    for (place, row) in lake.joined_sessions()? {
        let table = row.map_err(|error| error.to_string());
        let table = table.and_then(|row| {
            let believed = row.believed(&place.named());
            believed.map_err(|error| error.to_string())
        });
        let one = match table {
            Err(problem) => JoinedVerified::unread(place, problem),
            Ok(table) => {
                let is_named =
                    |key: &RunKey| names.contains(&key.session) || names.contains(&key.run);
                if !names.is_empty() && !table.key().is_some_and(is_named) {
                    continue;
                }
                one(lake, place, &table, pipelines, progress)
            }
        };
        verified.push(one);
    }
    Ok(verified)
}

impl JoinedVerified {
    fn unread(place: Place, problem: String) -> Self {
        Self {
            place,
            key: None,
            problems: vec![problem],
            anew: None,
        }
    }
}

fn one(
    lake: &Lake,
    place: Place,
    table: &Table,
    pipelines: &[PathBuf],
    progress: &dyn Progress,
) -> JoinedVerified {
    let rows = JoinedSessionRow::read(table);
    let (Some(key), [row]) = (table.key().cloned(), &rows[..]) else {
        let problem = "it has several rows, or states no session".to_owned();
        return JoinedVerified::unread(place, problem);
    };
    let mut problems = of_row(&key, row, table);
    if lake.place(JOINED, &key).ok().as_ref() != Some(&place) {
        problems.push("it is not at the place of its own name".to_owned());
    }
    problems.extend(of_files(lake, &key, row));
    let anew = problems
        .is_empty()
        .then(|| anew(lake, &key, row, pipelines, progress));
    JoinedVerified {
        place,
        key: Some(key),
        problems,
        anew: anew.flatten(),
    }
}

/// Contradictions of a row with itself.
fn of_row(key: &RunKey, row: &JoinedSessionRow, table: &Table) -> Vec<String> {
    let mut problems = Vec::new();
    let found = row_digest(table);
    if row.row_digest.as_ref() != Some(&found) {
        problems.push(format!(
            "its content has the digest {found}, and it states another one: it was changed"
        ));
    }
    let Some(inputs) = inputs(row) else {
        problems.push("its lists of files read differ in length".to_owned());
        return problems;
    };
    let work = joined_work(&key.robot, &key.session, inputs, row.settings.clone());
    if work.settings_digest() != row.settings_digest {
        problems.push("its settings do not have the digest that it states".to_owned());
    }
    let follows = work.key_by_version(&row.version).run;
    if follows != key.run {
        problems.push(format!(
            "from its inputs, settings and version follows the name {follows}"
        ));
    }
    problems
}

/// Files that are missing or not as their row says.
fn of_files(lake: &Lake, key: &RunKey, row: &JoinedSessionRow) -> Vec<String> {
    let expected = format!("{}/{}", ReadingRow::TABLE, key.session);
    if row.table_names != [expected] {
        return vec![format!("it names the files {}", row.table_names.join(", "))];
    }
    let opened = lake.open(ReadingRow::TABLE, key);
    let found = opened.map_err(|error| error.to_string()).and_then(|file| {
        let (found, _) = digest(file).map_err(|error| error.to_string())?;
        Ok(found)
    });
    match found {
        Ok(found) if row.table_digests == [found.clone()] => Vec::new(),
        Ok(found) => vec![format!(
            "readings: its file has the digest {found}, and was written with another one"
        )],
        Err(reason) => vec![format!("readings: {reason}")],
    }
}

/// The session joined anew by the first pipeline file that finds its files under the same settings; `None` where none does.
fn anew(
    lake: &Lake,
    key: &RunKey,
    row: &JoinedSessionRow,
    pipelines: &[PathBuf],
    progress: &dyn Progress,
) -> Option<Anew> {
    let (configuration, piece) = pipelines.iter().find_map(|path| {
        let overrides = Overrides {
            robot: Some(key.robot.clone()),
            sessions: vec![key.session.clone()],
            ..Overrides::default()
        };
        let configuration = Configuration::load(path, &overrides).ok()?;
        let pieces = WorkPiece::each_session(&configuration.pieces);
        let piece = pieces.into_iter().find(|own| own.session == key.session)?;
        (configuration.join_settings == row.settings).then_some((configuration, piece))
    })?;
    let temporary = match recompute::temporary_lake(lake, key) {
        Ok(temporary) => temporary,
        Err(reason) => return Some(Anew::No(reason)),
    };
    let configuration = Configuration {
        robot: Some(key.robot.clone()),
        lake: Place::of(temporary.path()),
        ..configuration
    };
    Some(match join_session(&configuration, &piece, progress) {
        Err(error) => Anew::No(error.to_string()),
        Ok(done) if done.run != key.run => {
            Anew::No("its files, or the version, are not those that it was made with".to_owned())
        }
        Ok(_) => compared(lake, &Lake::new(temporary.path()), key),
    })
}

/// Compares both tables of a session with those joined anew.
fn compared(lake: &Lake, again: &Lake, key: &RunKey) -> Anew {
    let differs = |table: &&str| -> Result<bool, LakeError> {
        let (own, other) = (lake.read(table, key)?, again.read(table, key)?);
        Ok(compare(&own, &other, &OF_THE_MACHINE)
            .same_values()
            .is_none())
    };
    let mut told = Vec::new();
    for table in [ReadingRow::TABLE, JOINED] {
        match differs(&table) {
            Ok(false) => {}
            Ok(true) => told.push(table.to_owned()),
            Err(error) => return Anew::No(error.to_string()),
        }
    }
    if told.is_empty() {
        Anew::Same
    } else {
        Anew::Differs(told)
    }
}
