//! A table of a run that is written in parts: each is encoded and appended, under a temporary name until the end.

use std::io;
use std::path::PathBuf;

use parquet::errors::ParquetError;
use rayon::prelude::*;

use super::error::folder_error;
use super::run::{OpenRun, into_io};
use super::{LakeError, Result};
use crate::manifest::Written;
use crate::table::{Encoder, PartsFile, RowGroups, Table};
use crate::temporary::Temporary;

/// Most parts of a table that are in memory at the same time: each takes some 20 MB.
const PARTS_AT_ONCE: usize = 4;

/// A table of a run, being written part by part. Dropped before its end, it leaves no file.
pub struct OpenTable<'r> {
    run: &'r OpenRun<'r>,
    begun: Option<Begun>,
}

struct Begun {
    key: String,
    path: PathBuf,
    encoder: Encoder,
    file: PartsFile<Temporary>,
    written: Written,
}

/// A complete table under its temporary name. Dropped, it leaves no file.
#[derive(Debug)]
pub struct WholeTable {
    pub(super) key: String,
    pub(super) temporary: Temporary,
    pub(super) written: Written,
}

impl<'r> OpenTable<'r> {
    pub const fn new(run: &'r OpenRun<'r>) -> Self {
        Self { run, begun: None }
    }

    pub fn append(&mut self, part: &Table) -> Result<()> {
        let begun = match &mut self.begun {
            Some(begun) => begun,
            none => none.insert(Begun::with(self.run, part)?),
        };
        let encoded = begun.encoder.encode(part).map_err(|error| begun.wrong(error))?;
        begun.file.digest_here(part);
        begun.file.append(&encoded).map_err(|error| begun.wrong(error))?;
        begun.written.rows += encoded.rows();
        Ok(())
    }

    /// Parts are made (`table`) and encoded on all threads, at most four at a time, while earlier ones are written. The
    /// bytes are the same at any number of threads.
    pub fn append_all<P: Send, E: From<LakeError> + Send>(
        &mut self,
        parts: impl IntoIterator<Item = P>,
        table: impl Fn(P) -> Result<Table, E> + Sync,
    ) -> Result<(), E> {
        let mut parts = parts.into_iter();
        if self.begun.is_none() {
            let Some(first) = parts.next() else { return Ok(()) };
            self.append(&table(first)?)?;
        }
        let begun = self.begun.as_mut().expect("by its first part");
        let mut ready = Vec::new();
        loop {
            let next: Vec<P> = parts.by_ref().take(PARTS_AT_ONCE).collect();
            if next.is_empty() && ready.is_empty() {
                return Ok(());
            }
            let (encoder, path) = (&begun.encoder, &begun.path);
            let wrong = |error| folder_error("write", path)(into_io(error));
            let make = |part| -> Result<_, E> {
                let part = table(part)?;
                Ok((encoder.encode(&part).map_err(wrong)?, part))
            };
            let make_all = || next.into_par_iter().map(make).collect::<Vec<_>>();
            let file = &mut begun.file;
            let append = || ready.iter().try_for_each(|part| file.append(part));
            let (appended, made) = rayon::join(append, make_all);
            appended.map_err(wrong)?;
            begun.written.rows += ready.iter().map(RowGroups::rows).sum::<u64>();
            // If several are wrong, the first one's error is returned.
            let made = made.into_iter().collect::<Result<Vec<_>, E>>()?;
            file.digest(made.iter().map(|(_, part)| part));
            ready = made.into_iter().map(|(encoded, _)| encoded).collect();
        }
    }

    /// Syncs the table to the disk, still under its temporary name; `None` where there was no part.
    pub fn finish(self) -> Result<Option<WholeTable>> {
        self.begun.map(Begun::finish).transpose()
    }
}

impl Begun {
    fn with(run: &OpenRun<'_>, first: &Table) -> Result<Self> {
        let key = run.file_key(first)?;
        let path = run.lake.written_at(&key);
        let wrong = |error: ParquetError| folder_error("write", &path)(into_io(error));
        let encoder = Encoder::of(first).map_err(wrong)?;
        let file = PartsFile::new(&encoder, run.lake.store.temporary(&key)?).map_err(wrong)?;
        Ok(Self {
            written: Written {
                table: first.schema().table.clone(),
                session: first.key().map_or_else(String::new, |key| key.session.clone()),
                rows: 0,
                digest: String::new(),
            },
            key,
            path,
            encoder,
            file,
        })
    }

    fn wrong(&self, error: ParquetError) -> LakeError {
        folder_error("write", &self.path)(into_io(error))
    }

    fn finish(self) -> Result<WholeTable> {
        let Self { key, path, file, mut written, .. } = self;
        let wrong = |error: io::Error| folder_error("write", &path)(error);
        let mut temporary = file.finish().map_err(|error| wrong(into_io(error)))?;
        written.digest = temporary.sync().map_err(wrong)?;
        Ok(WholeTable { key, temporary, written })
    }
}
