//! The time of each station, from tables `stations` of the run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::{ExportError, ExportErrorKind};
use crate::common;
use crate::lake::{Lake, read_given};
use crate::manifest::RunKey;
use crate::schema;
use crate::table::{Row as _, Table};
use crate::tables::stations::StationRow;

#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Times(BTreeMap<(String, usize), i64>);

impl Times {
    /// Reads the tables of all sessions: from `files`, or without any from the lake that holds `residuals`.
    pub(super) fn read<'s>(
        residuals: &Path,
        files: &[PathBuf],
        key: &RunKey,
        sessions: impl Iterator<Item = &'s str>,
    ) -> Result<Self, ExportError> {
        let mut times = Self::default();
        for file in files {
            let (session, stations) = of_run(file, key)?;
            times.add(&session, &stations);
        }
        if files.is_empty() {
            times.add_from(&lake(residuals)?, key, sessions.collect())?;
        }
        Ok(times)
    }

    fn add_from(
        &mut self,
        lake: &Lake,
        key: &RunKey,
        sessions: BTreeSet<&str>,
    ) -> Result<(), ExportError> {
        for session in sessions {
            let read = lake.read("stations", &key.of_session(session));
            let stations = read.map_err(|source| ExportError::NoTimes {
                session: session.to_owned(),
                source: Box::new(source),
            })?;
            self.add(session, &stations);
        }
        Ok(())
    }

    fn add(&mut self, session: &str, stations: &Table) {
        let stations = StationRow::read(stations).into_iter();
        let times =
            stations.map(|row| ((session.to_owned(), row.dwell.station), row.dwell.start_ns));
        self.0.extend(times);
    }

    /// The time of a station, ns.
    pub(super) fn of(&self, session: &str, station: usize) -> Result<u64, ExportError> {
        let unknown = || ExportError::NoTime { session: session.to_owned(), station };
        let ns = *self.0.get(&(session.to_owned(), station)).ok_or_else(unknown)?;
        u64::try_from(ns).map_err(|_| ExportError::EarlyTime {
            session: session.to_owned(),
            station,
            ns,
        })
    }
}

/// The lake that holds a file `TABLE/ROBOT/SESSION/RUN.parquet`.
fn lake(residuals: &Path) -> Result<Lake, ExportError> {
    let root = residuals.ancestors().nth(4);
    let root = root.ok_or_else(|| ExportErrorKind::NoLake.at(residuals))?;
    Ok(Lake::new(if root == Path::new("") { Path::new(".") } else { root }))
}

fn of_run(file: &Path, key: &RunKey) -> Result<(String, Table), ExportError> {
    let table = read_given(file, schema::find("stations")?)?;
    if table.rows() == 0 {
        return Err(ExportErrorKind::Empty.at(file));
    }
    let found = common::key(file, &table)?;
    if (&found.robot, &found.run) == (&key.robot, &key.run) {
        Ok((found.session, table))
    } else {
        let (found, expected) = (found.run, key.run.clone());
        Err(ExportErrorKind::OtherRun { found, expected }.at(file))
    }
}
