//! The rows of a lake as a list that is kept elsewhere, and a lake compared with such a list.
//!
//! A change or removal of a row that a later one replaces is found, since the later one has its digest. Earlier states of
//! the newest rows are known only to someone who kept a list of them. The list is a text with one line per run, in the
//! order of the runs' names, with single spaces between its parts:
//!
//! ```text
//! RUN ROW_DIGEST ROBOT/SESSION
//! ```
//!
//! RUN is the run's name, `ROW_DIGEST` the digest of its row ([`crate::io::tables::runs::row_digest`]), and ROBOT and
//! SESSION are the names of its folders in the lake, percent-encoded. Empty lines, and those that begin with `#`, are
//! skipped when it is read. The same lake gives the same bytes.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::VerifyError;
use super::register::Register;
use crate::io::lake::{Lake, LakeError};

/// Most bytes of a list that are read: some 400,000 runs.
const MOST_BYTES: u64 = 64 << 20;
/// Characters of a digest.
const DIGEST: usize = 64;

/// The rows of a lake by their digests.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RowList {
    rows: Vec<ListedRow>,
}

/// One row of a list.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct ListedRow {
    /// The run.
    pub run: String,
    /// The digest of its row.
    pub digest: String,
    /// ROBOT/SESSION, the names of its folders.
    pub session: String,
}

/// A difference of a lake from a list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unexpected {
    /// The lake has no row of the run.
    Removed(ListedRow),
    /// The row of the run is a different one.
    Changed {
        /// The row in the list.
        expected: ListedRow,
        /// The digest of the present row.
        found: String,
    },
}

/// The reason why a list cannot be used.
#[derive(Debug, Error)]
pub enum ListError {
    /// It cannot be read.
    #[error("cannot read the list {path}: {source}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// It is too large to be a list.
    #[error(
        "the list {path} is larger than {MOST_BYTES} bytes; is it one that `posegrid verify LAKE --list` printed?"
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// A line that is no row of a list.
    #[error(
        "{path}, line {line}: {problem}; a line is RUN ROW_DIGEST ROBOT/SESSION, as `posegrid verify LAKE --list` prints it"
    )]
    Line {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The fault in it.
        problem: String,
    },
}

impl RowList {
    /// The rows of the register, or, where `names` gives runs or sessions, only those.
    pub(super) fn of(
        register: &Register,
        lake: &Lake,
        names: &[String],
    ) -> Result<Self, LakeError> {
        let named = |own: &&super::register::Registered| {
            let is = |name: &String| *name == own.key.run || *name == own.key.session;
            names.is_empty() || names.iter().any(is)
        };
        let row = |own: &super::register::Registered| -> Result<ListedRow, LakeError> {
            let key = lake.file_key("runs", &own.key)?;
            let session = key.split('/').skip(1).take(2);
            Ok(ListedRow {
                run: own.key.run.clone(),
                digest: own.row.found.clone(),
                session: session.collect::<Vec<_>>().join("/"),
            })
        };
        let rows = register.all().filter(named).map(row);
        let mut rows = rows.collect::<Result<Vec<_>, _>>()?;
        rows.sort();
        Ok(Self { rows })
    }

    /// Reads a list from a file.
    pub fn read(path: &Path) -> Result<Self, ListError> {
        let failed = |source| ListError::Read { path: path.to_owned(), source };
        let file = File::open(path).map_err(failed)?;
        if file.metadata().map_err(failed)?.is_dir() {
            return Err(failed(io::Error::new(
                io::ErrorKind::IsADirectory,
                "it is a folder; give the file that `posegrid verify LAKE --list` was printed into",
            )));
        }
        let mut text = String::new();
        let read = file.take(MOST_BYTES + 1).read_to_string(&mut text);
        if read.map_err(failed)? as u64 > MOST_BYTES {
            return Err(ListError::TooLarge { path: path.to_owned() });
        }
        Self::parse(&text).map_err(|(line, problem)| ListError::Line {
            path: path.to_owned(),
            line,
            problem,
        })
    }

    /// A list from its text; or the number of the wrong line, and the fault in it.
    fn parse(text: &str) -> Result<Self, (usize, String)> {
        let mut rows: BTreeMap<String, ListedRow> = BTreeMap::new();
        for (place, line) in text.lines().enumerate() {
            if line.trim().is_empty() || line.starts_with('#') {
                continue;
            }
            let row = ListedRow::parse(line).map_err(|problem| (place + 1, problem))?;
            let run = row.run.clone();
            if rows.insert(run.clone(), row).is_some() {
                return Err((place + 1, format!("run {run} is given twice")));
            }
        }
        Ok(Self { rows: rows.into_values().collect() })
    }

    /// Whether it lists no row.
    pub const fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The differences of the lake's rows from this list, and the number of rows of the lake that it does not list. Where
    /// `names` are given, only that part of the lake is compared.
    pub(super) fn held(&self, found: &Self, names: &[String]) -> (Vec<Unexpected>, usize) {
        let asked = |row: &&ListedRow| {
            let is = |name: &String| {
                let session = row.session.rsplit('/').next();
                row.run == *name || session == Some(name)
            };
            names.is_empty() || names.iter().any(is)
        };
        let there: BTreeMap<&str, &ListedRow> =
            found.rows.iter().map(|row| (&*row.run, row)).collect();
        let mut unexpected = Vec::new();
        for row in self.rows.iter().filter(asked) {
            match there.get(&*row.run) {
                None => unexpected.push(Unexpected::Removed(row.clone())),
                Some(own) if own.digest != row.digest || own.session != row.session => {
                    unexpected.push(Unexpected::Changed {
                        expected: row.clone(),
                        found: own.digest.clone(),
                    });
                }
                Some(_) => {}
            }
        }
        let listed = |own: &&ListedRow| self.rows.iter().any(|row| row.run == own.run);
        let newer = found.rows.iter().filter(|own| !listed(own)).count();
        (unexpected, newer)
    }
}

impl ListedRow {
    fn parse(line: &str) -> Result<Self, String> {
        let parts: Vec<&str> = line.split(' ').collect();
        let [run, digest, session] = parts[..] else {
            return Err(format!("{} parts", parts.len()));
        };
        let is_digest = digest.len() == DIGEST && digest.bytes().all(|b| b.is_ascii_hexdigit());
        if run.is_empty() || !is_digest || session.matches('/').count() != 1 {
            return Err(format!("{line:?} is no row of a list"));
        }
        Ok(Self {
            run: run.to_owned(),
            digest: digest.to_ascii_lowercase(),
            session: session.to_owned(),
        })
    }
}

impl fmt::Display for RowList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for row in &self.rows {
            writeln!(f, "{} {} {}", row.run, row.digest, row.session)?;
        }
        Ok(())
    }
}

impl super::Selected {
    /// The rows of the lake, or of the part that was named.
    pub fn rows(&self, lake: &Lake, names: &[String]) -> Result<RowList, VerifyError> {
        Ok(RowList::of(&self.register, lake, names)?)
    }

    /// The differences of the lake's rows from a list, and the number of rows that the list lacks.
    pub fn held(
        &self,
        expected: &RowList,
        lake: &Lake,
        names: &[String],
    ) -> Result<(Vec<Unexpected>, usize), VerifyError> {
        Ok(expected.held(&self.rows(lake, names)?, names))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(run: &str, letter: &str) -> ListedRow {
        ListedRow {
            run: run.to_owned(),
            digest: letter.repeat(DIGEST),
            session: "kr210/mon".to_owned(),
        }
    }

    #[test]
    fn a_list_comes_back_as_it_was_printed_and_nothing_else_is_one() {
        let list = RowList { rows: vec![row("0a", "1"), row("0b", "2")] };
        let text = list.to_string();
        assert_eq!(RowList::parse(&text), Ok(list.clone()));
        let signed = format!("# kept by the auditor\n\n{text}");
        assert_eq!(RowList::parse(&signed), Ok(list));
        let wrong = |text: &str| RowList::parse(text).unwrap_err();
        assert_eq!(wrong("\nrun digest").0, 2);
        assert_eq!(wrong(&format!("0a {} kr210", "1".repeat(DIGEST))).0, 1);
        assert_eq!(wrong(&format!("0a {} r/s", "x".repeat(DIGEST))).0, 1);
        assert!(wrong(&text.repeat(2)).1.contains("0a is given twice"));
    }

    #[test]
    fn a_row_that_was_removed_or_changed_is_reported_and_a_newer_one_is_not() {
        let kept = RowList { rows: vec![row("0a", "1"), row("0b", "2")] };
        let found = RowList { rows: vec![row("0b", "3"), row("0c", "4")] };
        let (unexpected, newer) = kept.held(&found, &[]);
        let changed = Unexpected::Changed { expected: row("0b", "2"), found: "3".repeat(DIGEST) };
        assert_eq!(unexpected, [Unexpected::Removed(row("0a", "1")), changed]);
        assert_eq!(newer, 1);
        assert_eq!(kept.held(&kept, &[]), (Vec::new(), 0));
        // For a part of the lake: neither another run's row nor another session's counts.
        let of = |name: &str| kept.held(&found, &[name.to_owned()]).0.len();
        assert_eq!((of("0a"), of("mon"), of("tue")), (1, 2, 0));
    }
}
