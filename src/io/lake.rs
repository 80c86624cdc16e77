//! The lake: published tables, `TABLE/ROBOT/SESSION/RUN.parquet`, and the page of each run,
//! `report/ROBOT/SESSION/RUN.html`, in a folder or on object storage ([`crate::store`]).
//!
//! 1. [`Lake::start`] begins a run, unless the lake has it already.
//! 2. [`OpenRun::publish`] writes a table whole or not at all; a table that is written before the run has a result
//!    ([`OpenTable`]) waits under a temporary name ([`OpenRun::keep`]).
//! 3. [`OpenRun::commit`] creates the run's row in `runs`: from then on the run exists. Of several processes that
//!    commit the same run exactly one succeeds, and no file of a committed run is ever written again.
//!
//! Results of stages exist likewise by the rows of their [`Stage`] ([`Lake::start_in`]). The lake also holds requests
//! ([`Lake::ask`]) and records of corrected files ([`Correction`]), and beside the tables what histories keep, the
//! index of finished work and the compact form. Files of a run that never committed are overwritten by the next run
//! that does the same work; readers join `runs`.

mod asked;
mod cache;
mod compact;
mod corrections;
mod error;
mod files;
mod lock;
mod name;
mod parts;
mod rows;
mod run;
mod vouch;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::manifest::RunKey;
use crate::schema;
use crate::store::{self, Folder, Place, Store};
use crate::table::{self, Table};
use crate::temporary::{self, Temporary};
use error::{Result, folder_error};
use run::into_io;

pub use asked::{ASKED, Asked, AskedRow, request_key, request_of};
pub use cache::{INDEX, alone_key, figures_key, summary_key};
pub use compact::{COMPACT, CompactFile, CompactState, KEYS, runs_among};
#[cfg(test)]
pub(crate) use corrections::CorrectionRow;
pub use corrections::{CORRECTIONS, Correction, Recorded, is_correction};
pub use error::LakeError;
pub use files::{LakeFile, Stands};
pub use lock::{Holder, Lock, Locking};
pub use parts::{OpenTable, WholeTable};
pub use rows::RunRow;
pub use run::{Commit, OpenRun};
pub use vouch::{VouchedBy, read_given};

/// The folder of the pages, next to those of the tables, and their name among a run's files.
pub const PAGES: &str = "report";

/// The folder of the pages over time: `pages/ROBOT.html`, and [`FLEET`] of all robots. Each history writes them anew, and nothing is
/// verified by them.
pub const OVER_TIME: &str = "pages";
/// Name of the page of the fleet: what a browser opens of a folder.
pub const FLEET: &str = "index.html";

const RUNS: &str = "runs";

/// A stage whose results later runs start from. A result exists by its row, and has one other table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stage {
    /// One of its results and several, in words.
    pub names: [&'static str; 2],
    pub done: &'static str,
    pub rows: &'static str,
    pub table: &'static str,
}

pub const JOINED: Stage = Stage {
    names: ["session as joined", "sessions as joined"],
    done: "joined",
    rows: "joined_sessions",
    table: "readings",
};

pub const ESTIMATES: Stage = Stage {
    names: ["estimate", "estimates"],
    done: "estimated",
    rows: "estimates",
    table: "estimate_residuals",
};

/// What the steps of an estimate answer.
pub const GRIDS: Stage =
    Stage { names: ["grids", "grids"], done: "gridded", rows: "grids", table: "grid_errors" };

pub const STAGES: [Stage; 3] = [JOINED, ESTIMATES, GRIDS];

/// The table whose row makes the files of another table part of the lake.
pub fn rows_of(table: &str) -> &'static str {
    let stage = STAGES.iter().find(|stage| stage.tables().contains(&table));
    stage.map_or(RUNS, |stage| stage.rows)
}

impl Stage {
    pub const fn tables(&self) -> [&'static str; 2] {
        [self.table, self.rows]
    }
}

#[derive(Debug, Clone)]
pub struct Lake {
    store: Arc<dyn Store>,
}

impl Lake {
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { store: Arc::new(Folder::new(root)) }
    }

    /// The lake at a place: a folder, or a prefix on object storage, which has to answer.
    pub fn at(place: &Place) -> Result<Self> {
        let store = store::at(place)?;
        store.check()?;
        Ok(Self { store })
    }

    pub fn root(&self) -> Place {
        self.store.place("")
    }

    /// Folder of the lake; `None` on object storage.
    pub fn folder(&self) -> Option<&Path> {
        self.store.folder()
    }

    /// Place of a file of a run, whether or not it is there: the table of that name, or its page ([`PAGES`]).
    pub fn place(&self, table: &str, key: &RunKey) -> Result<Place> {
        Ok(self.store.place(&file_key(table, key)?))
    }

    /// Whether the run exists, that is, has a row in `runs`.
    pub fn exists(&self, key: &RunKey) -> Result<bool> {
        self.has(RUNS, key)
    }

    pub fn has(&self, table: &str, key: &RunKey) -> Result<bool> {
        Ok(self.store.exists(&file_key(table, key)?)?)
    }

    pub fn start(&self, key: &RunKey) -> Result<Option<OpenRun<'_>>> {
        self.start_in(RUNS, key)
    }

    /// Begins what a row of the table `rows` makes exist; `None` when the lake has it.
    pub fn start_in(&self, rows: &'static str, key: &RunKey) -> Result<Option<OpenRun<'_>>> {
        Ok((!self.has(rows, key)?).then(|| OpenRun::new(self, key, rows)))
    }

    pub fn open(&self, table: &str, key: &RunKey) -> Result<File> {
        Ok(self.store.open(&file_key(table, key)?)?)
    }

    /// Reads a table of a run, checked by its own digest and, where the run has a row, by the digest there.
    pub fn read(&self, table: &str, key: &RunKey) -> Result<Table> {
        Ok(self.read_vouched(table, key)?.0)
    }

    pub fn read_page(&self, key: &RunKey) -> Result<String> {
        let place = self.place(PAGES, key)?.named();
        io::read_to_string(self.open(PAGES, key)?).map_err(folder_error("read", &place))
    }

    pub fn copy_session(&self, tables: &[&str], key: &RunKey, to: &Path) -> Result<()> {
        for table in tables {
            for listed in self.store.list(&session_key(table, key)?, 0..=0)? {
                self.copy(&listed.key, to)?;
            }
        }
        Ok(())
    }

    pub fn copy_run(&self, tables: &[&str], key: &RunKey, to: &Path) -> Result<()> {
        for table in tables {
            if self.has(table, key)? {
                self.copy(&file_key(table, key)?, to)?;
            }
        }
        Ok(())
    }

    fn copy(&self, key: &str, to: &Path) -> Result<()> {
        let copy = to.join(key);
        let folder = copy.parent().expect("keys have names");
        fs::create_dir_all(folder).map_err(folder_error("make the folder", folder))?;
        let mut from = self.store.open(key)?;
        let copied = File::create(&copy).and_then(|mut copy| io::copy(&mut from, &mut copy));
        copied.map(drop).map_err(folder_error("write", &copy))
    }

    /// Writes a table to a temporary; also returns its digest.
    fn write(&self, table: &Table, key: &str) -> Result<(Temporary, String)> {
        let path = self.written_at(key);
        let write = folder_error("write", &path);
        let temporary = self.store.temporary(key)?;
        let mut temporary =
            table::write(table, temporary).map_err(|error| write(into_io(error)))?;
        let digest = temporary.sync().map_err(&write)?;
        Ok((temporary, digest))
    }

    /// The path that errors of writing a temporary name: the file, or the folder of temporaries on object storage.
    fn written_at(&self, key: &str) -> PathBuf {
        let folder = self.folder();
        folder.map_or_else(std::env::temp_dir, |root| root.join(key))
    }

    /// Removes temporaries of processes that are gone; returns their paths. On object storage there are none to see.
    pub fn clean(&self) -> Result<Vec<PathBuf>> {
        let Some(root) = self.folder() else { return Ok(Vec::new()) };
        let tables = schema::all().iter().map(|schema| schema.table.as_str());
        let folders = tables.chain([PAGES, cache::FIGURES]).map(|folder| root.join(folder));
        let mut folders: Vec<PathBuf> = folders.collect();
        for _robot_then_session in 0..2 {
            let below = folders.iter().map(|folder| subfolders(folder));
            folders = below.collect::<Result<Vec<_>>>()?.concat();
        }
        let stale = |folder: &PathBuf| {
            temporary::remove_stale(folder).map_err(folder_error("clean", folder))
        };
        let beside = cache::FOLDERS.into_iter().chain([cache::ALONE]);
        folders.extend(beside.map(|own| root.join(own)).filter(|own| own.is_dir()));
        for table in subfolders(&root.join(COMPACT))? {
            folders.extend(subfolders(&table)?);
            folders.push(table);
        }
        Ok(folders.iter().map(stale).collect::<Result<Vec<_>, _>>()?.concat())
    }
}

/// Checks that a lake can hold a name of a robot or session (`part`): it must not be too long for a folder's name.
pub fn check_name(part: &'static str, name: &str) -> Result<()> {
    encoded(part, name).map(drop)
}

/// File name of a robot's page over time, encoded as in the lake; of a robot named like the page of the fleet the first letter is too.
pub fn page_over_time(robot: &str) -> Result<String> {
    let name = format!("{}.html", encoded("robot", robot)?);
    Ok(if name.eq_ignore_ascii_case(FLEET) {
        format!("%{:02X}{}", name.as_bytes()[0], &name[1..])
    } else {
        name
    })
}

/// The key in the lake's store of a file of a run: the table of that name, or its page.
fn file_key(table: &str, key: &RunKey) -> Result<String> {
    let ending = if table == PAGES {
        "html"
    } else {
        // Only tables and pages have folders in a lake.
        schema::find(table)?;
        "parquet"
    };
    let run = encoded("run", &key.run)?;
    Ok(format!("{}/{run}.{ending}", session_key(table, key)?))
}

fn session_key(table: &str, key: &RunKey) -> Result<String> {
    let (robot, session) = (encoded("robot", &key.robot)?, encoded("session", &key.session)?);
    Ok(format!("{table}/{robot}/{session}"))
}

fn encoded(part: &'static str, name: &str) -> Result<String> {
    name::encode(name).map_err(|length| LakeError::Name { part, name: name.to_owned(), length })
}

fn subfolders(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.and_then(Iterator::collect::<io::Result<Vec<_>>>),
    };
    let entries = entries.map_err(folder_error("list", folder))?;
    let mut folders: Vec<_> =
        entries.iter().map(fs::DirEntry::path).filter(|path| path.is_dir()).collect();
    folders.sort();
    Ok(folders)
}
