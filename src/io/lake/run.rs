//! A run being written: its tables one by one, then the row that makes it exist.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use parquet::errors::ParquetError;
use rayon::prelude::*;

use super::error::folder_error;
use super::temporary::Temporary;
use super::{Lake, LakeError, PAGES};
use crate::io::schema;
use crate::io::table::{self, Encoder, PartsFile, Table};
use crate::manifest::{RunKey, Written, digest};

/// Parts of a table that are encoded at the same time, at most: each takes some 20 MB meanwhile.
const PARTS_AT_ONCE: usize = 4;

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

impl<'a> OpenRun<'a> {
    pub(super) fn new(lake: &'a Lake, key: &RunKey) -> Self {
        Self {
            lake,
            key: key.clone(),
            written: Vec::new(),
        }
    }

    /// The tables written so far.
    pub fn written(&self) -> &[Written] {
        &self.written
    }

    /// Writes a table of the run; its session may be another that the run read.
    pub fn publish(&mut self, table: &Table) -> Result<(), LakeError> {
        let path = self.path(table)?;
        let (temporary, digest) = write(table, &path)?;
        self.put(table, table.rows() as u64, temporary, digest)
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

    /// Writes a table of the run that comes in parts, in the order of its rows; nothing where there is no part. Parts are
    /// made (`table`) and encoded on all threads, while those before them are written; at most four of each
    /// are in memory. The bytes are the same at any number of threads.
    pub fn publish_parts<P: Send, E: From<LakeError> + Send>(
        &mut self,
        parts: impl IntoIterator<Item = P>,
        table: impl Fn(P) -> Result<Table, E> + Sync,
    ) -> Result<(), E> {
        let mut parts = parts.into_iter();
        let Some(first) = parts.next().map(&table).transpose()? else {
            return Ok(());
        };
        let path = self.path(&first)?;
        let wrong = |error| folder_error("write", &path)(into_io(error));
        let encoder = Encoder::of(&first).map_err(wrong)?;
        let mut file = PartsFile::new(&encoder, temporary_beside(&path)?).map_err(wrong)?;
        let encode = |part: &Table| -> Result<_, E> {
            Ok((part.rows() as u64, encoder.encode(part).map_err(wrong)?))
        };
        let mut rows = 0;
        let mut ready = vec![encode(&first)?];
        while !ready.is_empty() {
            rows += ready.iter().map(|(rows, _)| rows).sum::<u64>();
            let next: Vec<P> = parts.by_ref().take(at_once()).collect();
            let append = || ready.iter().try_for_each(|(_, part)| file.append(part));
            let make = |part| encode(&table(part)?);
            let make_all = || next.into_par_iter().map(make).collect::<Vec<_>>();
            let (appended, made) = rayon::join(append, make_all);
            appended.map_err(wrong)?;
            // Of several that are wrong the first is told.
            ready = made.into_iter().collect::<Result<_, E>>()?;
        }
        let mut temporary = file.finish().map_err(wrong)?;
        let digest = temporary.sync().map_err(folder_error("write", &path))?;
        Ok(self.put(&first, rows, temporary, digest)?)
    }

    /// Puts what was written in its place.
    fn put(
        &mut self,
        table: &Table,
        rows: u64,
        temporary: Temporary,
        digest: String,
    ) -> Result<(), LakeError> {
        let path = self.path(table)?;
        let written = Written {
            table: table.schema().table.clone(),
            session: table
                .key()
                .map_or_else(String::new, |key| key.session.clone()),
            rows,
            digest,
        };
        self.put_file(path, temporary, written)
    }

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

/// As many as there are threads to encode them.
fn at_once() -> usize {
    rayon::current_num_threads().min(PARTS_AT_ONCE)
}

fn temporary_beside(path: &Path) -> Result<Temporary, LakeError> {
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
fn into_io(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(io) => *io,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
