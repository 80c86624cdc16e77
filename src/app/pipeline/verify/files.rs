//! All files under a lake: of a run, the lake's own, left over, or foreign.
//!
//! A query over the folder of a table reads every file there, so files that do not belong are named. A file belongs if the
//! row of its run, at its own place in `runs`, names it, or the row of its session as joined. Files at a run's place that name that run, without a row of it,
//! are reported by run: the row was deleted, or the run was never committed. A record of corrections belongs if it is
//! unchanged; requests have to follow one another. All other files are foreign.

mod known;

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;

use super::VerifyError;
use super::selection::Selected;
use crate::files::store::Place;
use crate::files::table::{self, Head};
use crate::io::lake::{
    ASKED, Lake, LakeError, LakeFile, PAGES, Stands, is_correction, request_key,
};
use known::{Judged, Known, Scope, rows_now};

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct FilesOfLake {
    /// Number of files that rows of `runs` and `joined_sessions` name, and of those rows.
    pub of_runs: usize,
    /// Number of files of runs whose rows cannot be read.
    pub of_unread: usize,
    pub own: usize,
    /// Temporaries: of a process that writes, or left over by one that was stopped; the next run removes these.
    pub temporaries: Vec<Place>,
    pub without_row: Vec<WithoutRow>,
    pub foreign: Vec<Foreign>,
    /// Faults of the requests that changed current runs, a sentence each.
    pub asked: Vec<String>,
}

/// The files of a run that has no row in `runs`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WithoutRow {
    pub robot: String,
    pub run: String,
    /// Its files, as TABLE/SESSION by the names of their folders.
    pub files: Vec<String>,
}

/// A file, or a folder of files, that is neither of a run nor the lake's own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Foreign {
    pub place: Place,
    /// Number of files: more than one for a folder.
    pub files: usize,
    /// The contents that it states, or their difference from those of its place; `None` where neither is known.
    pub why: Option<String>,
}

impl FilesOfLake {
    /// Whether there is a file that does not belong, or a request is missing or contradicts others.
    pub const fn is_mismatch(&self) -> bool {
        !self.without_row.is_empty() || !self.foreign.is_empty() || !self.asked.is_empty()
    }

    pub fn files(&self) -> usize {
        let without_row = self.without_row.iter().map(|run| run.files.len());
        let foreign = self.foreign.iter().map(|own| own.files);
        let known = self.of_runs + self.of_unread + self.own + self.temporaries.len();
        known + without_row.sum::<usize>() + foreign.sum::<usize>()
    }
}

/// Counts all files of the lake; or, where `names` of runs or sessions are given, those in the folders of their sessions
/// and of their names.
pub fn account(
    lake: &Lake,
    selected: &Selected,
    names: &[String],
) -> Result<FilesOfLake, VerifyError> {
    let known = Known::of(lake, selected)?;
    let scope = Scope::of(lake, selected, names)?;
    let files = FilesOfLake { asked: problems(lake, &scope)?, ..FilesOfLake::default() };
    let mut counted =
        Counted { lake, files, foreign: BTreeMap::new(), without_row: BTreeMap::new() };
    let mut doubtful = Vec::new();
    for file in lake.files("")?.into_iter().filter(|file| scope.has(file)) {
        match known.judged(&file) {
            Judged::NoRow => doubtful.push(file),
            judged => counted.add(&file, judged),
        }
    }
    let rows = if doubtful.is_empty() { BTreeSet::new() } else { rows_now(lake)? };
    for file in &doubtful {
        counted.add_doubtful(file, &rows);
    }
    Ok(counted.files())
}

struct Counted<'a> {
    lake: &'a Lake,
    files: FilesOfLake,
    /// Files under each topmost foreign name, and why the first of them is there.
    foreign: BTreeMap<String, (usize, Option<String>)>,
    /// Files of runs without a row, as table and session, by robot and run.
    without_row: BTreeMap<(String, String), Vec<String>>,
}

impl Counted<'_> {
    fn add(&mut self, file: &LakeFile, judged: Judged) {
        match judged {
            Judged::OfRun => self.files.of_runs += 1,
            Judged::OfUnread => self.files.of_unread += 1,
            Judged::Own if is_correction(&file.key) => match self.lake.correction(&file.key) {
                Ok(_) => self.files.own += 1,
                Err(why) => self.add_foreign(file, Some(why)),
            },
            Judged::Own => self.files.own += 1,
            Judged::Temporary => self.files.temporaries.push(self.lake.place_of(&file.key)),
            Judged::NotNamed(run) => {
                let why = format!("the row of run {run} in runs does not name it");
                self.add_foreign(file, Some(why));
            }
            Judged::Foreign | Judged::NoRow => self.add_foreign(file, said(self.lake, file)),
        }
    }

    fn add_foreign(&mut self, file: &LakeFile, why: Option<String>) {
        self.foreign.entry(topmost(&file.key)).or_insert((0, why)).0 += 1;
    }

    /// Adds a file of a run that had no row, where `rows` are those that are there since.
    fn add_doubtful(&mut self, file: &LakeFile, rows: &BTreeSet<(String, String)>) {
        let Stands::OfRun { table, robot, session, run } = &file.stands else { return };
        let key = (robot.clone(), run.clone());
        if rows.contains(&key) {
            self.files.of_runs += 1;
        } else if let Some(why) = says_otherwise(self.lake, file, table, run) {
            self.add_foreign(file, Some(why));
        } else {
            self.without_row.entry(key).or_default().push(format!("{table}/{session}"));
        }
    }

    fn files(self) -> FilesOfLake {
        let foreign = self.foreign.into_iter();
        let foreign = foreign.map(|(key, (files, why))| Foreign {
            place: self.lake.place_of(&key),
            files,
            why,
        });
        let without_row = self.without_row.into_iter();
        let without_row = without_row.map(|((robot, run), files)| WithoutRow { robot, run, files });
        FilesOfLake { foreign: foreign.collect(), without_row: without_row.collect(), ..self.files }
    }
}

/// The name of a foreign file: itself, or the topmost folder that is not the lake's.
fn topmost(key: &str) -> String {
    let parts: Vec<&str> = key.split('/').collect();
    let is_own = |folder: &str| Lake::folders().any(|own| own == folder);
    let parts = match parts[..] {
        [".index", "alone" | "joined" | "refused", _, ..] => &parts[..3],
        [".history" | ".index", _, ..] => &parts[..2],
        [first, _, ..] if !is_own(first) => &parts[..1],
        [_, _, _, _, _, ..] => &parts[..4],
        _ => &parts[..],
    };
    parts.join("/")
}

/// The contents that a foreign file states; `None` where it states none.
fn said(lake: &Lake, file: &LakeFile) -> Option<String> {
    if topmost(&file.key) != file.key || !file.key.ends_with(".parquet") {
        return None;
    }
    let head = head(lake, &file.key).ok()?;
    let key = head.key?;
    Some(format!(
        "it states that it is {} of run {} of robot {:?} and session {:?}",
        head.table.map_or_else(|| "a table".to_owned(), |name| format!("table {name}")),
        key.run,
        key.robot,
        key.session
    ))
}

fn head(lake: &Lake, key: &str) -> Result<Head, String> {
    let file = lake.open_key(key).map_err(|error| error.to_string())?;
    let place = lake.place_of(key).named();
    table::head_of(&file, &place).map_err(|error| error.to_string())
}

/// Why a file at a run's place is none of that run's; `None` where it is.
fn says_otherwise(lake: &Lake, file: &LakeFile, table: &str, run: &str) -> Option<String> {
    if table == PAGES {
        let is_name = run.len() == 32 && run.bytes().all(|b| b.is_ascii_hexdigit());
        return (!is_name).then(|| format!("{run:?} is no run's name"));
    }
    let head = match head(lake, &file.key) {
        Ok(head) => head,
        Err(reason) => return Some(reason),
    };
    let says = head.key.as_ref().zip(head.table.as_deref());
    let place = says.and_then(|(key, table)| lake.file_key(table, key).ok());
    if place.as_ref() == Some(&file.key) {
        return None;
    }
    Some(said(lake, file).unwrap_or_else(|| "it does not state its run".to_owned()))
}

/// Faults of the requests in scope, a sentence each.
fn problems(lake: &Lake, scope: &Scope) -> Result<Vec<String>, LakeError> {
    let mut files = lake.requests(ASKED)?;
    files.retain(|file| scope.has_session(&file.key));
    let problem = |key: &String| match problem(lake, key) {
        Ok(words) => words.map(|words| format!("{}: {words}", lake.place_of(key))),
        Err(error) => Some(error.to_string()),
    };
    let keys = files.par_iter().map(|file| &file.key);
    Ok(lake.read_with(|| keys.filter_map(problem).collect()))
}

fn problem(lake: &Lake, key: &str) -> Result<Option<String>, LakeError> {
    let (key, row) = lake.request(key)?;
    let number = row.number.saturating_sub(1);
    let before = request_key(&key, number)?;
    let follows = |before| lake.request(before).is_ok_and(|(own, _)| Some(own.run) == row.replaced);
    Ok(if !lake.exists(&key)? {
        Some(format!("its run {} has no row in runs", key.run))
    } else if number == 0 {
        None
    } else if !lake.has_key(&before)? {
        Some(format!("the request before it, number {number}, was removed"))
    } else {
        (!follows(&before)).then(|| format!("it does not replace the run of request {number}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn foreign_files_are_named_by_the_topmost_folder_that_is_no_lakes() {
        let cases = [
            ("README.txt", "README.txt"),
            (".git/objects/ab/cd", ".git"),
            (".history/notes/x", ".history/notes"),
            ("accuracy/x.parquet", "accuracy/x.parquet"),
            ("accuracy/r/s/x.csv", "accuracy/r/s/x.csv"),
            ("accuracy/r/s/copy/x.parquet", "accuracy/r/s/copy"),
            ("accuracy/r/s/copy/more/x.parquet", "accuracy/r/s/copy"),
        ];
        for (key, expected) in cases {
            assert_eq!(topmost(key), expected);
        }
    }
}
