//! Results of stages that runs start from, each verified by itself: what all of them have in common.
//!
//! A result is a row in the table of its stage. Its name has to follow from its inputs, settings and version, its digest from its content,
//! and its files have to be as it says. Where its work can be found, it is computed anew into a temporary lake and compared.

use crate::io::lake::{Lake, LakeError, RunRow};
use crate::io::store::Place;
use crate::io::table::Table;
use crate::io::table::compare::compare;
use crate::io::tables::runs::row_digest;
use crate::manifest::{RunKey, Work, digest};

/// Columns that depend on version and machine, or on digests of what does.
pub(super) const OF_THE_MACHINE: [&str; 8] = [
    "estimate",
    "version",
    "platform",
    "cpu_features",
    "session_runs",
    "settings_digest",
    "table_digests",
    "row_digest",
];

/// The findings about the result of a stage.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageVerified {
    /// Place of its row.
    pub place: Place,
    /// Robot, session and result; `None` where the row cannot be read.
    pub key: Option<RunKey>,
    /// Contradictions and changes, as text.
    pub problems: Vec<String>,
    /// Whether it was computed anew; `None` where what that takes is not found, or a run that was recomputed has shown it.
    pub anew: Option<Anew>,
}

/// A result computed anew.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Anew {
    /// It is equal: byte for byte, or in its values where another machine made it.
    Same,
    /// It differs in these tables.
    Differs(Vec<String>),
    /// It could not be computed: why.
    No(String),
}

impl StageVerified {
    /// Whether something was changed, or differs when computed anew.
    pub const fn is_mismatch(&self) -> bool {
        !self.problems.is_empty() || matches!(self.anew, Some(Anew::Differs(_)))
    }
}

/// Verifies the results of these rows that have one of these names, of sessions or results; all of them where there are no names. `one`
/// gives contradictions of a row, and whether its result was computed anew.
pub(super) fn each(
    rows: Vec<RunRow>,
    names: &[String],
    mut one: impl FnMut(&Place, &RunKey, &Table) -> Result<(Vec<String>, Option<Anew>), LakeError>,
) -> Result<Vec<StageVerified>, LakeError> {
    let mut verified = Vec::new();
    for (place, row) in rows {
        let table = row.map_err(|error| error.to_string()).and_then(|row| {
            let believed = row.believed(&place.named());
            believed.map_err(|error| error.to_string())
        });
        let key = table.as_ref().ok().and_then(|table| table.key().cloned());
        let is_named = |key: &RunKey| names.contains(&key.session) || names.contains(&key.run);
        if table.is_ok() && !names.is_empty() && !key.as_ref().is_some_and(is_named) {
            continue;
        }
        let (problems, anew) = match (&table, &key) {
            (Ok(table), Some(key)) if table.rows() == 1 => one(&place, key, table)?,
            (Ok(_), _) => {
                let several = "it has several rows, or states no session";
                (vec![several.to_owned()], None)
            }
            (Err(problem), _) => (vec![problem.clone()], None),
        };
        verified.push(StageVerified { place, key, problems, anew });
    }
    Ok(verified)
}

/// A row of a stage's table, and what it states of itself.
pub(super) struct Stated<'r> {
    /// The name of its table.
    pub(super) rows: &'static str,
    pub(super) place: &'r Place,
    pub(super) key: &'r RunKey,
    pub(super) row: &'r Table,
    /// The work that it names.
    pub(super) work: Work,
    pub(super) version: &'r str,
    pub(super) settings_digest: &'r str,
    pub(super) row_digest: Option<&'r String>,
}

impl Stated<'_> {
    /// Contradictions of the row with itself and its place.
    pub(super) fn contradictions(&self, lake: &Lake) -> Vec<String> {
        let mut problems = Vec::new();
        if lake.place(self.rows, self.key).ok().as_ref() != Some(self.place) {
            problems.push("it is not at the place of its own name".to_owned());
        }
        let found = row_digest(self.row);
        if self.row_digest != Some(&found) {
            problems.push(format!(
                "its content has the digest {found}, and it states another one: it was changed"
            ));
        }
        if self.work.settings_digest() != self.settings_digest {
            problems.push("its settings do not have the digest that it states".to_owned());
        }
        let follows = self.work.key_by_version(self.version).run;
        if follows != self.key.run {
            problems
                .push(format!("from its inputs, settings and version follows the name {follows}"));
        }
        problems
    }
}

/// The only file of a result, of that table, missing or not as its row says.
pub(super) fn of_file(
    lake: &Lake,
    key: &RunKey,
    table: &str,
    (names, digests): (&[String], &[String]),
) -> Option<String> {
    if *names != [format!("{table}/{}", key.session)] {
        return Some(format!("it names the files {}", names.join(", ")));
    }
    let opened = lake.open(table, key);
    let found = opened.map_err(|error| error.to_string()).and_then(|file| {
        let (found, _) = digest(file).map_err(|error| error.to_string())?;
        Ok(found)
    });
    match found {
        Ok(found) if *digests == [found.clone()] => None,
        Ok(found) => Some(format!(
            "{table}: its file has the digest {found}, and was written with another one"
        )),
        Err(reason) => Some(format!("{table}: {reason}")),
    }
}

/// Compares the tables of a result with those computed anew.
pub(super) fn compared(lake: &Lake, again: &Lake, tables: &[&str], key: &RunKey) -> Anew {
    let differs = |table: &str| -> Result<bool, LakeError> {
        let (own, other) = (lake.read(table, key)?, again.read(table, key)?);
        Ok(compare(&own, &other, &OF_THE_MACHINE).same_values().is_none())
    };
    let mut told = Vec::new();
    for table in tables {
        match differs(table) {
            Ok(false) => {}
            Ok(true) => told.push((*table).to_owned()),
            Err(error) => return Anew::No(error.to_string()),
        }
    }
    if told.is_empty() { Anew::Same } else { Anew::Differs(told) }
}
