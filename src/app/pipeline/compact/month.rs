//! A month of the compact form: its earlier generation and its new runs → its files.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::{CompactError, Compacted, Result, TABLES, UNDATED};
use crate::files::schema::{self, TableSchema};
use crate::files::store::Listed;
use crate::files::table::{self, Table, together};
use crate::io::lake::{
    ASKED, AskedRow, CompactFile, CompactState, Lake, LakeError, request_key, request_of,
    runs_among,
};
use crate::io::rows::Row as _;
use crate::io::tables::runs::RunRow;
use crate::manifest::RunKey;
use crate::pipeline::verify::{Claim, is_gone};
use crate::progress::Progress;

/// Number of runs whose tables are read before they become one.
const AT_ONCE: usize = 256;

/// A run or request that the compact form does not have yet.
pub(super) struct NewRun {
    pub(super) file: Listed,
    /// Its row, where it is held.
    pub(super) row: Option<Table>,
}

#[derive(Default)]
pub(super) struct Month {
    /// Paths of the rows that the earlier state has.
    pub(super) keys: BTreeSet<String>,
    /// Those of them that are no longer there.
    pub(super) gone: BTreeSet<String>,
    pub(super) new: Vec<NewRun>,
}

/// Tables of runs, in the order of [`TABLES`].
type RunTables = [Vec<Table>; TABLES.len()];

impl Month {
    /// The files of the month, written anew; `None` where those of the earlier state are damaged.
    pub(super) fn rewritten(
        mut self,
        lake: &Lake,
        state: &CompactState,
        month: &str,
        done: &mut Compacted,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<CompactFile>>> {
        let mut parts = match self.earlier(lake, state, month) {
            Ok(parts) => parts,
            Err(CompactError::Lake(LakeError::Store(error))) if !error.is_missing() => {
                return Err(LakeError::from(error).into());
            }
            Err(error) => {
                tracing::warn!("{error}; the compact form of {month} is made from its runs again");
                return Ok(None);
            }
        };
        done.gone += runs_among(&self.gone);
        self.keys = &self.keys - &self.gone;
        for some in std::mem::take(&mut self.new).chunks_mut(AT_ONCE) {
            let read: Vec<_> = some.par_iter_mut().map(|run| run.tables(lake)).collect();
            self.take(lake, some, read, &mut parts, done)?;
            progress.advance(some.len() as u64);
        }
        done.runs += runs_among(&self.keys);
        let written = self.written(lake, month, &parts)?;
        if !written.is_empty() {
            done.months.push(month.to_owned());
        }
        Ok(Some(written))
    }

    /// The rows of the earlier state, without those of runs that are gone.
    fn earlier(&self, lake: &Lake, state: &CompactState, month: &str) -> Result<RunTables> {
        let mut parts = RunTables::default();
        if self.keys.is_empty() {
            return Ok(parts);
        }
        let is_there = |key: &RunKey, request: Option<&AskedRow>| {
            let file = match request {
                Some(own) => request_key(key, own.number),
                None => lake.file_key("runs", key),
            };
            file.is_ok_and(|file| !self.gone.contains(&file))
        };
        for (parts, name) in parts.iter_mut().zip(TABLES) {
            if let Some(file) = state.file(name, month) {
                let table = lake.read_compact(file)?;
                let requests = (name == ASKED).then(|| AskedRow::read(&table));
                parts.push(if self.gone.is_empty() {
                    table
                } else {
                    table
                        .of_rows(|row, key| is_there(key, requests.as_ref().map(|own| &own[row])))?
                });
            }
        }
        Ok(parts)
    }

    /// Takes the tables of new runs, together as one table each.
    fn take(
        &mut self,
        lake: &Lake,
        runs: &[NewRun],
        read: Vec<Result<RunTables, String>>,
        parts: &mut RunTables,
        done: &mut Compacted,
    ) -> Result<()> {
        let mut new = RunTables::default();
        for (run, tables) in runs.iter().zip(read) {
            match tables {
                Err(reason) => done.leave_out(lake, &run.file, reason),
                Ok(tables) => {
                    done.added += usize::from(request_of(&run.file.key).is_none());
                    self.keys.insert(run.file.key.clone());
                    new.iter_mut().zip(tables).for_each(|(new, own)| new.extend(own));
                }
            }
        }
        for ((parts, new), name) in parts.iter_mut().zip(new).zip(TABLES) {
            if !new.is_empty() {
                parts.push(together(schema(name), &new)?);
            }
        }
        Ok(())
    }

    fn written(&self, lake: &Lake, month: &str, parts: &RunTables) -> Result<Vec<CompactFile>> {
        if self.keys.is_empty() {
            return Ok(Vec::new());
        }
        let mut files = vec![lake.put_compact_keys(&self.keys, month)?];
        for (parts, name) in parts.iter().zip(TABLES) {
            if parts.iter().any(|own| own.rows() > 0) {
                let table = together(schema(name), parts)?;
                // Its rows are in the order of runs.
                let mut runs = table.keys();
                runs.dedup();
                files.push(lake.put_compact(&table, month, runs.len() as u64)?);
            }
        }
        Ok(files)
    }
}

impl NewRun {
    /// The run's rows of each table; or, as text, why they cannot be read.
    fn tables(&mut self, lake: &Lake) -> Result<RunTables, String> {
        let row = self.row.take().map_or_else(|| row(lake, &self.file), Ok)?;
        if request_of(&self.file.key).is_some() {
            return Ok([Vec::new(), Vec::new(), vec![row]]);
        }
        let claim = Claim::of(&row)?;
        let files = claim.files.iter().filter(|file| file.table == "accuracy");
        let read = files.map(|file| {
            let key = claim.key.of_session(&file.session);
            lake.read_written(&file.table, &key, &file.digest).map_err(|error| error.to_string())
        });
        match read.collect::<Result<Vec<Table>, String>>() {
            Ok(accuracy) => Ok([vec![row], accuracy, Vec::new()]),
            // Of a run that another replaced only the row may have been kept.
            Err(_) if claim.files.iter().all(|file| is_gone(&claim.key, file, lake)) => {
                Ok([vec![row], Vec::new(), Vec::new()])
            }
            Err(reason) => Err(reason),
        }
    }
}

/// The row of a run or request, which has to be at the place that it names.
pub(super) fn row(lake: &Lake, file: &Listed) -> Result<Table, String> {
    let text = |error: LakeError| error.to_string();
    if request_of(&file.key).is_some() {
        let (key, row) = lake.request(&file.key).map_err(text)?;
        let row = AskedRow::table(vec![row], &key);
        return Ok(row.map_err(|error| error.to_string())?.table);
    }
    let place = lake.place_of(&file.key);
    let open = lake.open_listed(file).map_err(text)?;
    let row = table::read_open(open, &place.named(), RunRow::schema());
    let row = row.map_err(|error| error.to_string())?;
    let own = row.key().and_then(|key| lake.file_key("runs", key).ok());
    if own.as_ref() == Some(&file.key) && row.rows() == 1 {
        return Ok(row);
    }
    Err(format!("{place}: its content is that of another run"))
}

/// The month of a run's session or of a request, or [`UNDATED`].
pub(super) fn of(row: &Table) -> String {
    let started = if row.schema().table == ASKED {
        AskedRow::read(row).first().map(|row| row.asked_at)
    } else {
        RunRow::read(row).into_iter().find_map(|row| row.ending.session_started)
    };
    // Its text begins with year and month: 2020-11-09 12:34:56.
    started.map_or_else(|| UNDATED.to_owned(), |time| time.to_string().chars().take(7).collect())
}

fn schema(name: &str) -> &'static TableSchema {
    schema::find(name).expect("a published table")
}
