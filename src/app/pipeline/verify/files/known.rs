//! The files that rows of `runs` name, and the judgement of a file under the lake by them.

use std::collections::BTreeSet;

use super::super::selection::Selected;
use crate::io::lake::{Lake, LakeError, LakeFile, STAGES, Stage, Stands, rows_of};

/// The files that the rows of the lake name.
#[derive(Default)]
pub(super) struct Known {
    keys: BTreeSet<String>,
    /// Robots, by the names of their folders, and runs that have rows; also those whose rows cannot be read.
    runs: BTreeSet<(String, String)>,
    unread: BTreeSet<(String, String)>,
    unread_rows: BTreeSet<String>,
}

pub(super) enum Judged {
    OfRun,
    OfUnread,
    Own,
    Temporary,
    NotNamed(String),
    NoRow,
    Foreign,
}

impl Known {
    /// The files named by all rows of the lake.
    pub(super) fn of(lake: &Lake, selected: &Selected) -> Result<Self, LakeError> {
        let mut known = Self::default();
        for run in &selected.register.runs {
            let row = lake.file_key("runs", &run.key)?;
            known.runs.extend(of_row(&row));
            known.keys.insert(row);
            for file in &run.files {
                let key = run.key.of_session(&file.session);
                // A table that this version does not know has no place in a lake.
                known.keys.extend(lake.file_key(&file.table, &key).ok());
            }
        }
        for stage in STAGES {
            known.add(lake, stage)?;
        }
        for key in &selected.unread {
            known.unread.extend(of_row(key));
            known.unread_rows.insert(key.clone());
        }
        Ok(known)
    }

    fn add(&mut self, lake: &Lake, stage: Stage) -> Result<(), LakeError> {
        for (place, row) in lake.rows_of_all(stage.rows)? {
            let Some(key) = row.ok().and_then(|row| row.table.key().cloned()) else { continue };
            if lake.place(stage.rows, &key)? == place {
                for table in stage.tables() {
                    self.keys.insert(lake.file_key(table, &key)?);
                }
            }
        }
        Ok(())
    }

    pub(super) fn judged(&self, file: &LakeFile) -> Judged {
        match &file.stands {
            _ if self.keys.contains(&file.key) => Judged::OfRun,
            Stands::Own => Judged::Own,
            Stands::Temporary => Judged::Temporary,
            Stands::Foreign => Judged::Foreign,
            Stands::OfRun { .. } if self.unread_rows.contains(&file.key) => Judged::OfUnread,
            Stands::OfRun { table, .. } if rows_of(table) == table => Judged::Foreign,
            Stands::OfRun { robot, run, .. } => {
                let name = (robot.clone(), run.clone());
                if self.unread.contains(&name) {
                    Judged::OfUnread
                } else if self.runs.contains(&name) {
                    Judged::NotNamed(run.clone())
                } else {
                    Judged::NoRow
                }
            }
        }
    }
}

/// Robot, by the name of its folder, and run of a row.
fn of_row(key: &str) -> Option<(String, String)> {
    let parts: Vec<&str> = key.split('/').collect();
    let [_, robot, _, name] = parts[..] else { return None };
    let run = name.strip_suffix(".parquet")?;
    Some((robot.to_owned(), run.to_owned()))
}

/// Robots and runs, or sessions as joined, that have rows now.
pub(super) fn rows_now(lake: &Lake) -> Result<BTreeSet<(String, String)>, LakeError> {
    let mut files = lake.files("runs")?;
    for stage in STAGES {
        files.extend(lake.files(stage.rows)?);
    }
    Ok(files.iter().filter_map(|file| of_row(&file.key)).collect())
}

pub(in crate::pipeline::verify) struct Scope {
    all: bool,
    /// ROBOT/SESSION by the names of their folders.
    sessions: BTreeSet<String>,
    names: BTreeSet<String>,
}

impl Scope {
    /// All files, or those of these names.
    pub(super) fn of(
        lake: &Lake,
        selected: &Selected,
        names: &[String],
    ) -> Result<Self, LakeError> {
        let mut sessions = BTreeSet::new();
        for claim in selected.runs.iter().filter_map(|run| run.claim.as_ref().ok()) {
            let own = std::iter::once(&claim.key.session);
            for session in own.chain(claim.files.iter().map(|file| &file.session)) {
                let row = lake.file_key("runs", &claim.key.of_session(session))?;
                let parts: Vec<&str> = row.split('/').skip(1).take(2).collect();
                sessions.insert(parts.join("/"));
            }
        }
        Ok(Self { all: names.is_empty(), sessions, names: names.iter().cloned().collect() })
    }

    pub(super) fn has(&self, file: &LakeFile) -> bool {
        let is_named = || match &file.stands {
            Stands::OfRun { run, .. } => self.names.contains(run),
            _ => false,
        };
        self.has_session(&file.key) || is_named()
    }

    /// Whether the files in the folder of a file's session are counted.
    pub(in crate::pipeline::verify) fn has_session(&self, key: &str) -> bool {
        let parts: Vec<&str> = key.split('/').collect();
        let in_session = match parts[..] {
            [_, robot, session, _, ..] => {
                self.sessions.contains(&format!("{robot}/{session}"))
                    || self.names.contains(session)
            }
            _ => false,
        };
        self.all || in_session
    }
}
