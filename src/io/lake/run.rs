//! A run being written: its tables one by one, then the row that makes it exist.

use std::io::{self, Write as _};
use std::path::PathBuf;

use parquet::errors::ParquetError;
use rayon::prelude::*;

use super::error::folder_error;
use super::temporary::Temporary;
use super::{Lake, LakeError, PAGES, file_key};
use crate::io::store::Tag;
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
    /// What the store calls each of them.
    tags: Vec<Tag>,
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
            tags: Vec::new(),
        }
    }

    /// The tables written so far.
    pub fn written(&self) -> &[Written] {
        &self.written
    }

    /// Writes a table of the run; its session may be another that the run read.
    pub fn publish(&mut self, table: &Table) -> Result<(), LakeError> {
        let key = self.file_key(table)?;
        let (temporary, digest) = self.write(table, &key)?;
        self.put(table, table.rows() as u64, temporary, digest)
    }

    /// Writes the run's page.
    pub fn publish_page(&mut self, html: &str) -> Result<(), LakeError> {
        let key = file_key(PAGES, &self.key)?;
        let mut temporary = self.lake.store.temporary(&key)?;
        let written = temporary.write_all(html.as_bytes());
        let digest = written.and_then(|()| temporary.sync());
        let digest = digest.map_err(folder_error("write", &self.written_at(&key)))?;
        let written = Written {
            table: PAGES.to_owned(),
            session: self.key.session.clone(),
            rows: 0,
            digest,
        };
        self.put_file(&key, temporary, written)
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
        let key = self.file_key(&first)?;
        let path = self.written_at(&key);
        let wrong = |error| folder_error("write", &path)(into_io(error));
        let encoder = Encoder::of(&first).map_err(wrong)?;
        let temporary = self.lake.store.temporary(&key).map_err(LakeError::from)?;
        let mut file = PartsFile::new(&encoder, temporary).map_err(wrong)?;
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
        let key = self.file_key(table)?;
        let written = Written {
            table: table.schema().table.clone(),
            session: table
                .key()
                .map_or_else(String::new, |key| key.session.clone()),
            rows,
            digest,
        };
        self.put_file(&key, temporary, written)
    }

    fn put_file(
        &mut self,
        key: &str,
        temporary: Temporary,
        written: Written,
    ) -> Result<(), LakeError> {
        let mut tag = None;
        if !self.lake.exists(&self.key)? {
            tag = self.lake.store.put(key, temporary)?;
        } else if written.digest != self.digest_of(key)? {
            let place = self.lake.store.place(key);
            return Err(LakeError::Rewrite { place });
        }
        self.written.push(written);
        self.tags.push(tag);
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
        for (written, tag) in self.written.iter().zip(&self.tags) {
            self.check_unchanged(written, tag)?;
        }
        let key = self.file_key(runs)?;
        let (temporary, _) = self.write(runs, &key)?;
        Ok(if self.lake.store.create(&key, temporary)? {
            Commit::Done
        } else {
            Commit::AlreadyThere
        })
    }

    /// The key of a table of this run.
    fn file_key(&self, table: &Table) -> Result<String, LakeError> {
        match table.key() {
            Some(key) if key.run == self.key.run && key.robot == self.key.robot => {
                file_key(&table.schema().table, key)
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

    /// Whether a file is still what was written: by the store's own tag, or by its digest where there is none.
    fn check_unchanged(&self, written: &Written, tag: &Tag) -> Result<(), LakeError> {
        let key = file_key(&written.table, &self.key.of_session(&written.session))?;
        if tag.is_some() && self.lake.store.tag(&key)? == *tag {
            return Ok(());
        }
        let found = self.digest_of(&key)?;
        if found == written.digest {
            return Ok(());
        }
        Err(LakeError::Changed {
            place: self.lake.store.place(&key),
            found,
            written: written.digest.clone(),
        })
    }

    /// Writes a table to a temporary; gives its digest too.
    fn write(&self, table: &Table, key: &str) -> Result<(Temporary, String), LakeError> {
        let path = self.written_at(key);
        let write = folder_error("write", &path);
        let temporary = self.lake.store.temporary(key)?;
        let mut temporary =
            table::write(table, temporary).map_err(|error| write(into_io(error)))?;
        let digest = temporary.sync().map_err(&write)?;
        Ok((temporary, digest))
    }

    /// What errors of writing a temporary name: the file, or the folder of temporaries where the lake is none.
    fn written_at(&self, key: &str) -> PathBuf {
        let folder = self.lake.folder();
        folder.map_or_else(std::env::temp_dir, |root| root.join(key))
    }

    fn digest_of(&self, key: &str) -> Result<String, LakeError> {
        let place = self.lake.store.place(key).named();
        let digest = digest(self.lake.store.open(key)?).map_err(folder_error("read", &place))?;
        Ok(digest.0)
    }
}

/// As many as there are threads to encode them.
fn at_once() -> usize {
    rayon::current_num_threads().min(PARTS_AT_ONCE)
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
