//! A run being written: its tables one by one, then the row with which it begins to exist.

use std::io;

use parquet::errors::ParquetError;

use super::error::folder_error;
use super::parts::WholeTable;
use super::{Lake, LakeError, PAGES, Result, file_key};
use crate::manifest::{RunKey, Written, digest};
use crate::store::Tag;
use crate::table::Table;
use crate::temporary::Temporary;

#[derive(Debug)]
pub struct OpenRun<'a> {
    pub lake: &'a Lake,
    pub key: RunKey,
    rows: &'static str,
    written: Vec<Written>,
    tags: Vec<Tag>,
    /// Tables that wait for the run's result; they are removed if it has none.
    kept: Vec<WholeTable>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Commit {
    Done,
    /// Another process committed the same work first; its result stays.
    AlreadyThere,
}

impl<'a> OpenRun<'a> {
    pub(super) fn new(lake: &'a Lake, key: &RunKey, rows: &'static str) -> Self {
        Self {
            lake,
            key: key.clone(),
            rows,
            written: Vec::new(),
            tags: Vec::new(),
            kept: Vec::new(),
        }
    }

    pub fn written(&self) -> &[Written] {
        &self.written
    }

    /// Writes a table of the run; its session may be any of those that the run read.
    pub fn publish(&mut self, table: &Table) -> Result<()> {
        let key = self.file_key(table)?;
        let (temporary, digest) = self.lake.write(table, &key)?;
        let written = Written {
            table: table.schema().table.clone(),
            session: table.key().map_or_else(String::new, |key| key.session.clone()),
            rows: table.rows() as u64,
            digest,
        };
        self.put_file(&key, temporary, written)
    }

    pub fn publish_page(&mut self, html: &str) -> Result<()> {
        let key = file_key(PAGES, &self.key)?;
        let (temporary, digest) = self.lake.written(&key, html.as_bytes())?;
        let written =
            Written { table: PAGES.to_owned(), session: self.key.session.clone(), rows: 0, digest };
        self.put_file(&key, temporary, written)
    }

    /// Keeps a table that was written before the run is known to have a result, under its temporary name.
    pub fn keep(&mut self, table: WholeTable) {
        self.kept.push(table);
    }

    pub fn publish_kept(&mut self) -> Result<()> {
        for table in std::mem::take(&mut self.kept) {
            self.put_file(&table.key, table.temporary, table.written)?;
        }
        Ok(())
    }

    fn put_file(&mut self, key: &str, temporary: Temporary, written: Written) -> Result<()> {
        let mut tag = None;
        if !self.lake.has(self.rows, &self.key)? {
            tag = self.lake.store.put(key, temporary)?;
        } else if written.digest != self.digest_of(key)? {
            let place = self.lake.store.place(key);
            return Err(LakeError::Rewrite { place });
        }
        self.written.push(written);
        self.tags.push(tag);
        Ok(())
    }

    /// Creates the run's row in `runs`, made with [`crate::tables::runs::table`], or that of a stage's result. Panics
    /// when the table is not that row.
    pub fn commit(self, row: &Table) -> Result<Commit> {
        assert_eq!(
            row.schema().table,
            self.rows,
            "a run is committed by its row in `runs`, the result of a stage by its own"
        );
        assert_eq!(row.key(), Some(&self.key), "the row is the run's own");
        for (written, tag) in self.written.iter().zip(&self.tags) {
            self.check_unchanged(written, tag)?;
        }
        let key = self.file_key(row)?;
        let (temporary, _) = self.lake.write(row, &key)?;
        Ok(if self.lake.store.create(&key, temporary)? {
            Commit::Done
        } else {
            Commit::AlreadyThere
        })
    }

    pub(super) fn file_key(&self, table: &Table) -> Result<String> {
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

    /// Checks that a file is unchanged since it was written: by the store's tag, or by its digest where there is none.
    fn check_unchanged(&self, written: &Written, tag: &Tag) -> Result<()> {
        let key = file_key(&written.table, &self.key.of_session(&written.session))?;
        if tag.is_some() && self.lake.store.tag(&key)? == *tag {
            return Ok(());
        }
        let found = self.digest_of(&key)?;
        if found == written.digest {
            return Ok(());
        }
        let (place, written) = (self.lake.store.place(&key), written.digest.clone());
        Err(LakeError::Changed { place, found, written })
    }

    fn digest_of(&self, key: &str) -> Result<String> {
        let place = self.lake.store.place(key).named();
        let digest = digest(self.lake.store.open(key)?).map_err(folder_error("read", &place))?;
        Ok(digest.0)
    }
}

/// The system's own error inside a Parquet error, where there is one, so that a full disk is reported as such.
pub(super) fn into_io(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(inner) => match inner.downcast::<io::Error>() {
            Ok(io) => *io,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
