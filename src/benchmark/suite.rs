//! A suite: open data with their source and digests, fixed splits of their stations, and published figures.
//!
//! How a table maps, the nominal arm and the instrument stand in the pipeline file that each arm names, so that nothing is described
//! twice. [`Suite::check`] finds what a suite contradicts itself in.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::{BootstrapSettings, FigureName, Numbers};

/// A suite file.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Suite {
    /// Its name.
    pub name: String,
    /// Description of the data, in a sentence.
    pub description: String,
    /// How intervals are drawn.
    #[serde(default)]
    pub bootstrap: BootstrapSettings,
    /// The arms.
    #[serde(rename = "arm")]
    pub arms: Vec<SuiteArm>,
    /// Programs whose predictions stand beside the suite.
    #[serde(default, rename = "program")]
    pub programs: Vec<Program>,
}

/// One arm: its data and the splits of its stations.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteArm {
    /// Its name.
    pub name: String,
    /// The pipeline file that states the nominal arm, the columns or topics, and the instrument; relative to the suite.
    pub pipeline: PathBuf,
    /// The folder of its files in that of the data; absent where they are in it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub folder: Option<PathBuf>,
    /// Where the data are from.
    pub source: DataSource,
    /// The sessions.
    #[serde(rename = "session")]
    pub sessions: Vec<SuiteSession>,
    /// The splits.
    #[serde(rename = "split")]
    pub splits: Vec<SuiteSplit>,
}

/// Where data are from.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DataSource {
    /// The repository's address.
    pub repository: String,
    /// The licence of the data.
    pub licence: String,
    /// The paper or thesis; absent where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub citation: Option<String>,
}

/// A session of an arm.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteSession {
    /// Its name, by the pipeline file.
    pub name: String,
    /// Number of stations that its files have; absent where nobody has counted them yet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stations: Option<usize>,
    /// Its files.
    #[serde(rename = "file")]
    pub files: Vec<SuiteFile>,
}

/// A file of a session.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteFile {
    /// Its path in the arm's folder.
    pub path: PathBuf,
    /// Its path in the repository; absent where it was made from files there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<String>,
    /// BLAKE3 of its content, hexadecimal; absent where nobody has downloaded it yet.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blake3: Option<String>,
}

/// A split of an arm's stations.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SuiteSplit {
    /// Its name.
    pub name: String,
    /// How it divides stations.
    pub kind: SplitKind,
    /// Stations that train, by session.
    pub train: BTreeMap<String, Numbers>,
    /// Stations that test, by session.
    pub test: BTreeMap<String, Numbers>,
    /// The base that predictions are stated in.
    #[serde(default)]
    pub base: SplitBase,
    /// The split of the same arm that shows what this one leaks; needed by rows, and by any split that leaks.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beside: Option<String>,
    /// Figures that others published.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub published: Vec<Published>,
}

/// How a split divides stations.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SplitKind {
    /// Rows of one table by turns or by lot.
    Rows,
    /// A region of the work space or of the joints.
    Region,
    /// Whole sessions.
    Session,
}

/// The base in which predictions are compared with measurements.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(untagged)]
pub enum SplitBase {
    /// By a word.
    Named(NamedBase),
    /// Aligned with these stations of the test sessions, which judge nothing.
    Found(BTreeMap<String, Numbers>),
}

/// Bases that have a word.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NamedBase {
    /// That of the training.
    Training,
    /// Aligned with all test stations: for comparing models only.
    Test,
}

impl Default for SplitBase {
    fn default() -> Self {
        Self::Named(NamedBase::Training)
    }
}

/// A figure that somebody published.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Published {
    /// The model, as its authors call it.
    pub model: String,
    /// The figure.
    pub figure: FigureName,
    /// Its value: mm of a length, otherwise a share.
    pub value: f64,
    /// Where it stands, and what differs from the split if anything does.
    pub source: String,
}

/// A program whose predictions are judged.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Program {
    /// Its name.
    pub name: String,
    /// Its predictions: a folder with ARM/SPLIT.csv, or the file of a suite of one split; relative to the suite.
    pub predictions: PathBuf,
}

/// A contradiction in a suite.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{place}: {fault}")]
pub struct SuiteError {
    /// Where: arm, split, session.
    pub place: String,
    /// The fault, and the way to mend it, as text.
    pub fault: String,
}

/// An error at a place of a suite, without arm and split.
fn fault<T>(place: impl Into<String>, fault: impl Into<String>) -> Result<T, SuiteError> {
    Err(SuiteError { place: place.into(), fault: fault.into() })
}

/// Most draws of the bootstrap.
const MOST_DRAWS: usize = 100_000;

impl Suite {
    /// Checks that names are good file names and there once, that splits do not overlap, and that sessions and splits named exist.
    pub fn check(&self) -> Result<(), SuiteError> {
        let own = &self.bootstrap;
        if !(100..=MOST_DRAWS).contains(&own.draws) {
            let found = own.draws;
            return fault(
                "[bootstrap] draws",
                format!("{found} is not between 100 and {MOST_DRAWS}"),
            );
        }
        if !(own.confidence > 0.0 && own.confidence < 1.0) {
            let found = own.confidence;
            return fault("[bootstrap] confidence", format!("{found} is not between 0 and 1"));
        }
        if self.arms.is_empty() {
            return fault("[[arm]]", "there is none; a suite has one at least");
        }
        names("[[arm]]", self.arms.iter().map(|arm| &*arm.name))?;
        names("[[program]]", self.programs.iter().map(|own| &*own.name))?;
        self.arms.iter().try_for_each(SuiteArm::check)
    }
}

/// Checks that names are there once and are names of files anywhere.
fn names<'n>(place: &str, names: impl Iterator<Item = &'n str>) -> Result<(), SuiteError> {
    let mut seen = BTreeSet::new();
    for name in names {
        let is_plain = |own: u8| own.is_ascii_alphanumeric() || b"-_.".contains(&own);
        if name.is_empty() || name.starts_with('.') || !name.bytes().all(is_plain) {
            return fault(
                format!("{place} {name:?}"),
                "a name is made of letters, digits, -, _ and ., as files are named by it",
            );
        }
        if !seen.insert(name) {
            return fault(format!("{place} {name:?}"), "the name is there twice");
        }
    }
    Ok(())
}

impl SuiteArm {
    fn check(&self) -> Result<(), SuiteError> {
        let at = |error: SuiteError| SuiteError {
            place: format!("arm {:?}, {}", self.name, error.place),
            ..error
        };
        names("[[arm.split]]", self.splits.iter().map(|split| &*split.name)).map_err(at)?;
        self.sessions.iter().try_for_each(SuiteSession::check).map_err(at)?;
        let split = |split: &SuiteSplit| {
            split.check(self).map_err(|error| SuiteError {
                place: format!("split {:?}, {}", split.name, error.place),
                ..error
            })
        };
        self.splits.iter().try_for_each(split).map_err(at)
    }

    /// The session of that name.
    pub fn session(&self, name: &str) -> Option<&SuiteSession> {
        self.sessions.iter().find(|own| own.name == name)
    }

    /// The split of that name.
    pub fn split(&self, name: &str) -> Option<&SuiteSplit> {
        self.splits.iter().find(|own| own.name == name)
    }
}

impl SuiteSession {
    fn check(&self) -> Result<(), SuiteError> {
        for file in &self.files {
            let is_digest =
                |own: &String| own.len() == 64 && own.bytes().all(|b| b.is_ascii_hexdigit());
            if !file.blake3.as_ref().is_none_or(is_digest) {
                return fault(
                    format!("session {:?}, file {}", self.name, file.path.display()),
                    "blake3 has 64 hexadecimal digits, as b3sum prints them",
                );
            }
        }
        Ok(())
    }
}

impl SuiteSplit {
    fn check(&self, arm: &SuiteArm) -> Result<(), SuiteError> {
        if self.train.is_empty() || self.test.is_empty() {
            return fault("train and test", "both name stations of one session at least");
        }
        for (part, lists) in self.lists() {
            for (name, numbers) in lists {
                is_in(arm, part, name, numbers)?;
            }
        }
        self.overlap()?;
        self.of_kind()?;
        self.has_beside(arm)
    }

    /// Its lists of stations, each with its key.
    pub fn lists(&self) -> impl Iterator<Item = (&'static str, &BTreeMap<String, Numbers>)> {
        let found = match &self.base {
            SplitBase::Found(lists) => Some(("base", lists)),
            SplitBase::Named(_) => None,
        };
        [("train", &self.train), ("test", &self.test)].into_iter().chain(found)
    }

    /// No station may have two parts.
    fn overlap(&self) -> Result<(), SuiteError> {
        let mut parts: BTreeMap<(&str, usize), &str> = BTreeMap::new();
        for (part, lists) in self.lists() {
            for (session, numbers) in lists {
                for number in numbers.all() {
                    if let Some(other) = parts.insert((session, *number), part) {
                        return fault(
                            format!("{other} and {part}"),
                            format!(
                                "station {number} of session {session:?} is in both: a station has one part"
                            ),
                        );
                    }
                }
            }
        }
        Ok(())
    }

    fn of_kind(&self) -> Result<(), SuiteError> {
        let mut sessions = self.test.keys();
        let trained = |name: &&String| self.train.contains_key(*name);
        match self.kind {
            SplitKind::Rows | SplitKind::Region => match sessions.find(|own| !trained(own)) {
                None => Ok(()),
                Some(other) => fault(
                    "test",
                    format!(
                        "session {other:?} does not train: a split by rows or region is of sessions that train and test; write kind = \"session\""
                    ),
                ),
            },
            SplitKind::Session => match sessions.find(trained) {
                None => Ok(()),
                Some(own) => fault(
                    "test",
                    format!(
                        "session {own:?} trains too: a split by session keeps whole sessions apart; write kind = \"region\" or \"rows\""
                    ),
                ),
            },
        }
    }

    fn has_beside(&self, arm: &SuiteArm) -> Result<(), SuiteError> {
        let Some(name) = &self.beside else {
            return match self.kind {
                SplitKind::Rows => fault(
                    "beside",
                    "a split by rows may leak: name the split by region or session of this arm that its figures stand beside",
                ),
                SplitKind::Region | SplitKind::Session => Ok(()),
            };
        };
        match arm.split(name) {
            None => fault("beside", format!("there is no split {name:?}")),
            Some(other) if other.kind == SplitKind::Rows => fault(
                "beside",
                format!("{name:?} is by rows itself; name one by region or session"),
            ),
            Some(_) => Ok(()),
        }
    }
}

fn is_in(arm: &SuiteArm, part: &str, name: &str, numbers: &Numbers) -> Result<(), SuiteError> {
    let Some(session) = arm.session(name) else {
        return fault(part, format!("there is no session {name:?} in [[arm.session]]"));
    };
    let last = numbers.all().last().copied();
    match session.stations.zip(last) {
        Some((stations, last)) if last >= stations => fault(
            part,
            format!("station {last} of session {name:?} does not exist: it has {stations}, from 0"),
        ),
        _ => Ok(()),
    }
}
