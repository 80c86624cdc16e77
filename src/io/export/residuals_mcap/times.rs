//! When each station was measured: tables `stations` of the run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::{ExportError, ExportErrorKind};
use crate::io::common::Common;
use crate::io::lake::{Lake, read_given};
use crate::io::schema;
use crate::io::table::Table;
use crate::manifest::RunKey;

/// The first moment at rest of each station, ns, by session and number.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Times(BTreeMap<(String, i64), i64>);

impl Times {
    /// Reads the tables of all sessions: from `files`, or without any from the lake that `residuals` stands in.
    pub(super) fn read<'s>(
        residuals: &Path,
        files: &[PathBuf],
        key: &RunKey,
        sessions: impl Iterator<Item = &'s str>,
    ) -> Result<Self, ExportError> {
        let mut times = Self::default();
        for file in files {
            times.add(&of_run(file, key)?);
        }
        if files.is_empty() {
            let lake = lake(residuals)?;
            let sessions: BTreeSet<&str> = sessions.collect();
            for session in sessions {
                let read = lake.read("stations", &key.of_session(session));
                times.add(&read.map_err(|source| ExportError::NoTimes {
                    session: session.to_owned(),
                    source: Box::new(source),
                })?);
            }
        }
        Ok(times)
    }

    fn add(&mut self, stations: &Table) {
        let columns = (
            stations.text("session"),
            stations.i64("station"),
            stations.i64("start_ns"),
        );
        for row in 0..stations.rows() {
            let session = columns.0.value(row).to_owned();
            let station = columns.1.value(row);
            self.0.insert((session, station), columns.2.value(row));
        }
    }

    /// When a station was measured, ns.
    pub(super) fn of(&self, session: &str, station: i64) -> Result<u64, ExportError> {
        let unknown = || ExportError::NoTime {
            session: session.to_owned(),
            station,
        };
        let ns = *self
            .0
            .get(&(session.to_owned(), station))
            .ok_or_else(unknown)?;
        u64::try_from(ns).map_err(|_| ExportError::EarlyTime {
            session: session.to_owned(),
            station,
            ns,
        })
    }
}

/// The lake that a file `TABLE/ROBOT/SESSION/RUN.parquet` stands in.
fn lake(residuals: &Path) -> Result<Lake, ExportError> {
    let root = residuals.ancestors().nth(4);
    let root = root.ok_or_else(|| ExportErrorKind::NoLake.at(residuals))?;
    Ok(Lake::new(if root == Path::new("") {
        Path::new(".")
    } else {
        root
    }))
}

/// A table of stations that the same run wrote.
fn of_run(file: &Path, key: &RunKey) -> Result<Table, ExportError> {
    let table = read_given(file, schema::find("stations")?)?;
    if table.rows() == 0 {
        return Err(ExportErrorKind::Empty.at(file));
    }
    let common = Common {
        path: file,
        table: &table,
    };
    let found = common.key()?;
    if (&found.robot, &found.run) == (&key.robot, &key.run) {
        Ok(table)
    } else {
        let (found, expected) = (found.run, key.run.clone());
        Err(ExportErrorKind::OtherRun { found, expected }.at(file))
    }
}
