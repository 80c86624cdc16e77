//! Sessions: which sub-folders are one, which of them are learnt from and which judge, and in which pieces of work.

use std::collections::BTreeSet;
use std::io;
use std::path::{Component, Path};

use super::tree::Tree;
use super::{Overrides, PlanError, logs};
use crate::io::log::SessionLogs;
use crate::pipeline::file::{InputSection, Pool};

/// The session of a pooled fit.
pub const POOLED: &str = "pooled";

/// One session's logs.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SessionFiles {
    /// The session's name: its folder's.
    pub name: String,
    /// The files of its two sides.
    pub logs: SessionLogs,
}

/// One piece of work: what one run learns from and is judged on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkPiece {
    /// The session of its tables, or `pooled`.
    pub session: String,
    /// Sessions it learns from, in order; tables are for the last.
    pub training: Vec<SessionFiles>,
    /// Sessions that only judge.
    pub test: Vec<SessionFiles>,
}

/// A sub-folder that is no session, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// The folder's name.
    pub folder: String,
    /// What it lacks.
    pub reason: String,
}

/// The pieces of work, and the sub-folders that are no session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Listed {
    pub pieces: Vec<WorkPiece>,
    pub left_out: Vec<LeftOut>,
}

/// Lists the work: `folder` is `[input] folder`, resolved, in `tree`.
pub(super) fn list(
    path: &Path,
    tree: &Tree,
    folder: &Path,
    input: &InputSection,
    overrides: &Overrides,
) -> Result<Listed, PlanError> {
    let found = Found::look(tree, folder, input).map_err(|source| PlanError::Folder {
        path: path.to_owned(),
        folder: folder.to_owned(),
        source,
    })?;
    let test_names = if overrides.test.is_empty() {
        &input.test
    } else {
        &overrides.test
    };
    let test = found.named(test_names)?;
    let named = if overrides.sessions.is_empty() {
        input.sessions.as_ref()
    } else {
        Some(&overrides.sessions)
    };
    let training = match named {
        Some(names) => {
            named_once(names, test_names)?;
            found.named(names)?
        }
        None => found.all_but(test_names),
    };
    named_once(test_names, &[])?;
    if training.is_empty() {
        return Err(found.nothing());
    }
    // A folder that is no session matters only where every session of the folder is asked for.
    let left_out = named.map_or(found.left_out, |_| Vec::new());
    Ok(Listed {
        pieces: pieces(input.pool, &training, &test),
        left_out,
    })
}

fn pieces(pool: Pool, training: &[SessionFiles], test: &[SessionFiles]) -> Vec<WorkPiece> {
    let piece = |session: &str, training: &[SessionFiles]| WorkPiece {
        session: session.to_owned(),
        training: training.to_vec(),
        test: test.to_vec(),
    };
    let numbered = || training.iter().enumerate();
    match pool {
        Pool::Each => numbered()
            .map(|(i, s)| piece(&s.name, &training[i..=i]))
            .collect(),
        Pool::Until => numbered()
            .map(|(i, s)| piece(&s.name, &training[..=i]))
            .collect(),
        Pool::All => vec![piece(POOLED, training)],
    }
}

fn named_once(names: &[String], test: &[String]) -> Result<(), PlanError> {
    let mut seen = BTreeSet::new();
    for name in names {
        let how = if !seen.insert(name) {
            "twice"
        } else if test.contains(name) {
            "to learn from and under test"
        } else {
            continue;
        };
        return Err(PlanError::NamedTwice {
            session: name.clone(),
            how,
        });
    }
    Ok(())
}

/// What the sessions' folder holds.
struct Found<'a> {
    tree: &'a Tree,
    folder: &'a Path,
    input: &'a InputSection,
    sessions: Vec<SessionFiles>,
    left_out: Vec<LeftOut>,
}

impl<'a> Found<'a> {
    /// Every sub-folder, by name.
    fn look(tree: &'a Tree, folder: &'a Path, input: &'a InputSection) -> io::Result<Self> {
        let mut found = Self {
            tree,
            folder,
            input,
            sessions: Vec::new(),
            left_out: Vec::new(),
        };
        let paths = tree.entries(folder)?.into_iter();
        for path in paths.filter(|path| tree.is_dir(path)) {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            match found.session(&name) {
                Ok(session) => found.sessions.push(session),
                Err(reason) => found.left_out.push(LeftOut {
                    folder: name.into_owned(),
                    reason,
                }),
            }
        }
        Ok(found)
    }

    /// The session of a name, or what it lacks.
    fn session(&self, name: &str) -> Result<SessionFiles, String> {
        let parts: Vec<_> = Path::new(name).components().collect();
        if !matches!(parts[..], [Component::Normal(_)]) {
            return Err("a session is named by its folder's name, not by a path".to_owned());
        }
        if name == POOLED {
            return Err(format!(
                "{POOLED:?} is what pooled fits are named; rename the folder"
            ));
        }
        let own = self.folder.join(name);
        if !self.tree.is_dir(&own) {
            return Err("there is no such folder".to_owned());
        }
        Ok(SessionFiles {
            name: name.to_owned(),
            logs: SessionLogs {
                controller: logs::find(self.tree, &own, &self.input.controller)?,
                tracker: logs::find(self.tree, &own, &self.input.tracker)?,
            },
        })
    }

    fn named(&self, names: &[String]) -> Result<Vec<SessionFiles>, PlanError> {
        let named = |name: &String| {
            self.session(name).map_err(|reason| PlanError::Session {
                session: name.clone(),
                reason,
                folder: self.folder.to_owned(),
                found: self.sessions.iter().map(|s| s.name.clone()).collect(),
            })
        };
        names.iter().map(named).collect()
    }

    fn all_but(&self, test: &[String]) -> Vec<SessionFiles> {
        let training = self.sessions.iter().filter(|s| !test.contains(&s.name));
        training.cloned().collect()
    }

    fn nothing(&self) -> PlanError {
        PlanError::NoSessions {
            folder: self.folder.to_owned(),
            controller: self.input.controller.clone(),
            tracker: self.input.tracker.clone(),
            left_out: self
                .left_out
                .iter()
                .map(|left| format!("{} ({})", left.folder, left.reason))
                .collect(),
        }
    }
}
