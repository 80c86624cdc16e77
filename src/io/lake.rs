//! The lake: a folder of published tables, `TABLE/ROBOT/SESSION/RUN.parquet`.
//!
//! 1. [`Lake::start`] begins a run, unless the lake has it already.
//! 2. [`OpenRun::publish`] writes a table whole or not at all; it is no part of the lake yet.
//! 3. [`OpenRun::commit`] creates the run's row in `runs`: from then on the run exists. Of several that commit the same
//!    run exactly one does, and nothing of a committed run is ever written again.
//!
//! What a run left that never committed is overwritten by the next that does the same work, or stays unseen: readers
//! join `runs`. [`Lake::clean`] removes temporaries of processes that are gone.

mod name;
mod temporary;

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

use super::schema::{self, SchemaError, TableSchema};
use super::table::{self, FileError, Table};
use crate::manifest::{RunKey, Written, digest};
use temporary::Temporary;

/// A folder of published tables.
#[derive(Debug, Clone)]
pub struct Lake {
    root: PathBuf,
}

/// A run whose tables are being written.
#[derive(Debug)]
pub struct OpenRun<'a> {
    lake: &'a Lake,
    key: RunKey,
    written: Vec<Written>,
}

/// What became of a commit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Commit {
    /// This call made the run exist.
    Done,
    /// Another process finished the same work first; its result stands.
    AlreadyThere,
}

/// Why a lake cannot be used.
#[derive(Debug, Error)]
pub enum LakeError {
    /// The file system refused.
    #[error("cannot {doing} {path}: {source}{}", advice(source))]
    Folder {
        /// What was tried.
        doing: &'static str,
        /// Where.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A name too long for a file system.
    #[error(
        "the name {name:?} takes {length} bytes as a folder's name, more than {longest}: choose a shorter {part} name in \
         the pipeline file",
        longest = name::LONGEST
    )]
    Name {
        /// Robot, session or run.
        part: &'static str,
        /// The name.
        name: String,
        /// Bytes it would take.
        length: usize,
    },
    /// A table of another run, or of none.
    #[error(
        "table {table}: its rows belong to {found}, the run being written is {expected} of robot {robot:?}"
    )]
    OtherRun {
        /// The table.
        table: String,
        /// Whose rows they are.
        found: String,
        /// The run being written.
        expected: String,
        /// Its robot.
        robot: String,
    },
    /// A published table would change.
    #[error(
        "{path} is published, and computing it again gave other bytes: run `posegrid verify` to see the difference \
         (another processor, or a changed program under the same version); nothing published is rewritten"
    )]
    Rewrite {
        /// The file.
        path: PathBuf,
    },
    /// A table changed between writing and committing.
    #[error(
        "{path} changed while its run was being written: digest {found}, written as {written}; run it again"
    )]
    Changed {
        /// The file.
        path: PathBuf,
        /// Digest of what is there.
        found: String,
        /// Digest of what was written.
        written: String,
    },
    /// The file of a table cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// No such table.
    #[error(transparent)]
    Schema(#[from] SchemaError),
}

fn advice(error: &io::Error) -> &'static str {
    match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
            "; make room there, or name another folder under [output] in the pipeline file; run again afterwards"
        }
        io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::PermissionDenied => {
            "; make the folder writable, or name another one under [output] in the pipeline file"
        }
        io::ErrorKind::NotADirectory | io::ErrorKind::AlreadyExists => {
            "; a file stands where a folder is needed: name another folder under [output] in the pipeline file"
        }
        io::ErrorKind::Unsupported => {
            "; a lake needs a file system with hard links, to let exactly one of two equal runs commit"
        }
        _ => "",
    }
}

fn folder_error<'a>(
    doing: &'static str,
    path: &'a Path,
) -> impl Fn(io::Error) -> LakeError + use<'a> {
    move |source| LakeError::Folder {
        doing,
        path: path.to_owned(),
        source,
    }
}

impl Lake {
    /// The lake in the folder `root`, which is made when first written to.
    pub fn new(root: impl Into<PathBuf>) -> Self {
        Self { root: root.into() }
    }

    /// Its folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Where a table of a run stands, or would.
    pub fn path(&self, schema: &TableSchema, key: &RunKey) -> Result<PathBuf, LakeError> {
        let part = |part, name: &str| {
            name::encode(name).map_err(|length| LakeError::Name {
                part,
                name: name.to_owned(),
                length,
            })
        };
        let folder = self
            .root
            .join(&schema.table)
            .join(part("robot", &key.robot)?);
        let file = format!("{}.parquet", part("run", &key.run)?);
        Ok(folder.join(part("session", &key.session)?).join(file))
    }

    /// Whether the run exists: whether its row in `runs` does.
    pub fn exists(&self, key: &RunKey) -> Result<bool, LakeError> {
        let path = self.path(schema::find("runs")?, key)?;
        path.try_exists().map_err(folder_error("look for", &path))
    }

    /// Begins a run, or `None` when the lake has it.
    pub fn start(&self, key: &RunKey) -> Result<Option<OpenRun<'_>>, LakeError> {
        let open = || OpenRun {
            lake: self,
            key: key.clone(),
            written: Vec::new(),
        };
        Ok((!self.exists(key)?).then(open))
    }

    /// Reads a table of a run.
    pub fn read(&self, table: &str, key: &RunKey) -> Result<Table, LakeError> {
        let schema = schema::find(table)?;
        Ok(table::read(&self.path(schema, key)?, schema)?)
    }

    /// Removes temporaries of processes that are gone; gives their paths.
    pub fn clean(&self) -> Result<Vec<PathBuf>, LakeError> {
        let mut folders: Vec<PathBuf> = schema::all()
            .iter()
            .map(|schema| self.root.join(&schema.table))
            .collect();
        for _robot_then_session in 0..2 {
            folders = folders
                .iter()
                .map(|folder| subfolders(folder))
                .collect::<Result<Vec<_>, _>>()?
                .concat();
        }
        let stale = |folder: &PathBuf| {
            temporary::remove_stale(folder).map_err(folder_error("clean", folder))
        };
        Ok(folders
            .iter()
            .map(stale)
            .collect::<Result<Vec<_>, _>>()?
            .concat())
    }

    fn write(&self, table: &Table, path: &Path) -> Result<(Temporary, String), LakeError> {
        let folder = path.parent().expect("a lake's files stand in folders");
        fs::create_dir_all(folder).map_err(folder_error("make the folder", folder))?;
        let write = folder_error("write", path);
        let temporary = Temporary::beside(path).map_err(&write)?;
        let mut temporary =
            table::write(table, temporary).map_err(|error| write(into_io(error)))?;
        let digest = temporary.sync().map_err(&write)?;
        Ok((temporary, digest))
    }
}

impl OpenRun<'_> {
    /// The tables written so far.
    pub fn written(&self) -> &[Written] {
        &self.written
    }

    /// Writes a table of the run; its session may be another that the run read.
    pub fn publish(&mut self, table: &Table) -> Result<(), LakeError> {
        let path = self.path(table)?;
        let (temporary, digest) = self.lake.write(table, &path)?;
        if !self.lake.exists(&self.key)? {
            temporary
                .replace(&path)
                .map_err(folder_error("write", &path))?;
        } else if digest != digest_of(&path)? {
            return Err(LakeError::Rewrite { path });
        }
        self.written.push(Written {
            table: table.schema().table.clone(),
            session: table
                .key()
                .map_or_else(String::new, |key| key.session.clone()),
            rows: table.rows() as u64,
            digest,
        });
        Ok(())
    }

    /// Makes the run exist by creating its row in `runs`, made with [`crate::manifest::Work::runs_table`].
    ///
    /// # Panics
    /// When the table is another one than `runs`.
    pub fn commit(self, runs: &Table) -> Result<Commit, LakeError> {
        assert_eq!(
            runs.schema().table,
            "runs",
            "a run is committed by its row in `runs`"
        );
        let path = self.path(runs)?;
        for written in &self.written {
            self.check_unchanged(written)?;
        }
        let (temporary, _) = self.lake.write(runs, &path)?;
        let created = temporary
            .create(&path)
            .map_err(folder_error("write", &path))?;
        Ok(if created {
            Commit::Done
        } else {
            Commit::AlreadyThere
        })
    }

    fn path(&self, table: &Table) -> Result<PathBuf, LakeError> {
        match table.key() {
            Some(key) if key.run == self.key.run && key.robot == self.key.robot => {
                self.lake.path(table.schema(), key)
            }
            other => Err(LakeError::OtherRun {
                table: table.schema().table.clone(),
                found: other.map_or_else(
                    || "no run".to_owned(),
                    |key| format!("{} of robot {:?}", key.run, key.robot),
                ),
                expected: self.key.run.clone(),
                robot: self.key.robot.clone(),
            }),
        }
    }

    fn check_unchanged(&self, written: &Written) -> Result<(), LakeError> {
        let key = self.key.of_session(&written.session);
        let path = self.lake.path(schema::find(&written.table)?, &key)?;
        let found = digest_of(&path)?;
        if found == written.digest {
            return Ok(());
        }
        Err(LakeError::Changed {
            path,
            found,
            written: written.digest.clone(),
        })
    }
}

fn digest_of(path: &Path) -> Result<String, LakeError> {
    let digest = File::open(path)
        .and_then(digest)
        .map_err(folder_error("read", path))?;
    Ok(digest.0)
}

fn subfolders(folder: &Path) -> Result<Vec<PathBuf>, LakeError> {
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.and_then(Iterator::collect::<io::Result<Vec<_>>>),
    };
    let entries = entries.map_err(folder_error("list", folder))?;
    let mut folders: Vec<_> = entries
        .iter()
        .map(fs::DirEntry::path)
        .filter(|path| path.is_dir())
        .collect();
    folders.sort();
    Ok(folders)
}

/// The system's own error inside a Parquet error, where there is one: a full disk is told as such.
fn into_io(error: parquet::errors::ParquetError) -> io::Error {
    match error {
        parquet::errors::ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(io) => *io,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
