//! A run being written: its tables one by one, then the row that makes it exist.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;

use super::error::folder_error;
use super::parts::{OpenTable, WholeTable};
use super::temporary::Temporary;
use super::{Lake, LakeError, PAGES};
use crate::io::schema;
use crate::io::table::{self, Table};
use crate::manifest::{RunKey, Written, digest};

/// A run whose tables are being written.
#[derive(Debug)]
pub struct OpenRun<'a> {
    lake: &'a Lake,
    key: RunKey,
    written: Vec<Written>,
    /// Tables that wait for the run's result; if there is none they go with it.
    kept: Vec<WholeTable>,
}

/// What became of a commit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Commit {
    /// This call made the run exist.
    Done,
    /// Another process finished the same work first; its result stands.
    AlreadyThere,
}

impl<'a> OpenRun<'a> {
    pub(super) fn new(lake: &'a Lake, key: &RunKey) -> Self {
        Self {
            lake,
            key: key.clone(),
            written: Vec::new(),
            kept: Vec::new(),
        }
    }

    /// The run.
    pub const fn key(&self) -> &RunKey {
        &self.key
    }

    /// The tables written so far.
    pub fn written(&self) -> &[Written] {
        &self.written
    }

    /// Writes a table of the run; its session may be another that the run read.
    pub fn publish(&mut self, table: &Table) -> Result<(), LakeError> {
        let path = self.path(table)?;
        let (temporary, digest) = write(table, &path)?;
        let written = Written {
            table: table.schema().table.clone(),
            session: table
                .key()
                .map_or_else(String::new, |key| key.session.clone()),
            rows: table.rows() as u64,
            digest,
        };
        self.put_file(path, temporary, written)
    }

    /// Writes the run's page.
    pub fn publish_page(&mut self, html: &str) -> Result<(), LakeError> {
        let path = self.lake.page(&self.key)?;
        let mut temporary = temporary_beside(&path)?;
        let written = temporary.write_all(html.as_bytes());
        let digest = written.and_then(|()| temporary.sync());
        let digest = digest.map_err(folder_error("write", &path))?;
        let written = Written {
            table: PAGES.to_owned(),
            session: self.key.session.clone(),
            rows: 0,
            digest,
        };
        self.put_file(path, temporary, written)
    }

    /// Writes a table of the run that comes in parts, in the order of its rows; nothing where there is no part. See
    /// [`OpenTable::append_all`].
    pub fn publish_parts<P: Send, E: From<LakeError> + Send>(
        &mut self,
        parts: impl IntoIterator<Item = P>,
        table: impl Fn(P) -> Result<Table, E> + Sync,
    ) -> Result<(), E> {
        let mut open = OpenTable::new(self);
        open.append_all(parts, table)?;
        if let Some(whole) = open.finish()? {
            self.put_file(whole.path, whole.temporary, whole.written)?;
        }
        Ok(())
    }

    /// Keeps a table that was written before the run is known to have a result, under its temporary name.
    pub fn keep(&mut self, table: WholeTable) {
        self.kept.push(table);
    }

    /// Puts the tables kept so far in their places.
    pub fn publish_kept(&mut self) -> Result<(), LakeError> {
        for table in std::mem::take(&mut self.kept) {
            self.put_file(table.path, table.temporary, table.written)?;
        }
        Ok(())
    }

    /// Puts what was written in its place.
    fn put_file(
        &mut self,
        path: PathBuf,
        temporary: Temporary,
        written: Written,
    ) -> Result<(), LakeError> {
        if !self.lake.exists(&self.key)? {
            temporary
                .replace(&path)
                .map_err(folder_error("write", &path))?;
        } else if written.digest != digest_of(&path)? {
            return Err(LakeError::Rewrite { path });
        }
        self.written.push(written);
        Ok(())
    }

    /// Makes the run exist by creating its row in `runs`, made with [`crate::manifest::Work::runs_table`].
    ///
    /// # Panics
    /// When the table is not the `runs` row of this very run.
    pub fn commit(self, runs: &Table) -> Result<Commit, LakeError> {
        assert_eq!(
            runs.schema().table,
            "runs",
            "a run is committed by its row in `runs`"
        );
        assert_eq!(runs.key(), Some(&self.key), "the row is the run's own");
        let path = self.path(runs)?;
        for written in &self.written {
            self.check_unchanged(written)?;
        }
        let (temporary, _) = write(runs, &path)?;
        let created = temporary
            .create(&path)
            .map_err(folder_error("create by a hard link", &path))?;
        Ok(if created {
            Commit::Done
        } else {
            Commit::AlreadyThere
        })
    }

    pub(super) fn path(&self, table: &Table) -> Result<PathBuf, LakeError> {
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
        let path = match written.table.as_str() {
            PAGES => self.lake.page(&key)?,
            table => self.lake.path(schema::find(table)?, &key)?,
        };
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

/// Writes a table under a temporary name beside `path`; gives its digest too.
fn write(table: &Table, path: &Path) -> Result<(Temporary, String), LakeError> {
    let write = folder_error("write", path);
    let temporary = temporary_beside(path)?;
    let mut temporary = table::write(table, temporary).map_err(|error| write(into_io(error)))?;
    let digest = temporary.sync().map_err(&write)?;
    Ok((temporary, digest))
}

pub(super) fn temporary_beside(path: &Path) -> Result<Temporary, LakeError> {
    let folder = path.parent().expect("a lake's files stand in folders");
    fs::create_dir_all(folder).map_err(folder_error("make the folder", folder))?;
    Temporary::beside(path).map_err(folder_error("write", path))
}

fn digest_of(path: &Path) -> Result<String, LakeError> {
    let digest = File::open(path)
        .and_then(digest)
        .map_err(folder_error("read", path))?;
    Ok(digest.0)
}

/// The system's own error inside a Parquet error, where there is one: a full disk is told as such.
pub(super) fn into_io(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(io) => *io,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
