//! The files of a history: two tables of all robots, a page for each.

use std::io;
use std::path::{Path, PathBuf};

use super::HistoryCommandError;
use crate::cli::messages::Printable;
use crate::io::lake::Lake;
use crate::io::table::{Row as _, Table, write};
use crate::io::tables::drift::{self, DriftRow};
use crate::io::tables::history::{self, HistoryRow};
use crate::io::tables::past::{Figure, PastSession};
use crate::io::whole_file::replace_whole;
use crate::manifest::RunKey;
use crate::pipeline::history::{HistoryError, RobotHistory, figures, trend};

/// Writes the tables and the pages; gives their paths.
pub(super) fn output(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: &Path,
) -> Result<Vec<PathBuf>, HistoryCommandError> {
    let wrong = |source| HistoryCommandError::Write {
        path: folder.to_owned(),
        source,
    };
    std::fs::create_dir_all(folder).map_err(wrong)?;
    let all: Vec<Vec<Vec<Figure>>> = robots.iter().map(|robot| read(lake, robot)).collect();
    let drifts = robots.iter().flat_map(|robot| drift::rows(&robot.sessions));
    let mut written = Vec::new();
    for table in [
        HistoryRow::table_of_several(history::rows(&rows(robots, &all)))?.table,
        DriftRow::table_of_several(drifts.collect())?.table,
    ] {
        let name = format!("{}.parquet", table.schema().table);
        written.push(put(folder, &name, &bytes(&table, folder)?)?);
    }
    for (robot, figures) in robots.iter().zip(&all) {
        let name = file_name(lake, &robot.robot)?;
        written.push(put(folder, &name, trend(robot, figures).as_bytes())?);
    }
    Ok(written)
}

/// The figures of each session; those that cannot be read are logged.
fn read(lake: &Lake, robot: &RobotHistory) -> Vec<Vec<Figure>> {
    let (figures, wrong) = figures(lake, &robot.sessions);
    for reason in wrong {
        tracing::warn!("left out of the table history: {}", Printable(&reason));
    }
    figures
}

fn rows<'h>(
    robots: &'h [RobotHistory],
    all: &'h [Vec<Vec<Figure>>],
) -> Vec<(&'h PastSession, &'h Figure)> {
    let sessions = robots.iter().flat_map(|robot| &robot.sessions);
    let figures = sessions.zip(all.iter().flatten());
    let each = figures.flat_map(|(session, own)| own.iter().map(move |figure| (session, figure)));
    each.collect()
}

/// The file name of a robot's page, encoded as in the lake: a robot's name may hold any character.
fn file_name(lake: &Lake, robot: &str) -> Result<String, HistoryError> {
    let key = RunKey::new("robot", "session", robot);
    let path = lake.page(&key)?.named();
    let name = path.file_name().unwrap_or_default();
    Ok(name.to_string_lossy().into_owned())
}

fn bytes(table: &Table, folder: &Path) -> Result<Vec<u8>, HistoryCommandError> {
    write(table, Vec::new()).map_err(|error| HistoryCommandError::Write {
        path: folder.to_owned(),
        source: io::Error::other(error),
    })
}

/// Replaces an earlier file, completely or not at all.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, HistoryCommandError> {
    let path = folder.join(name);
    match replace_whole(&path, bytes) {
        Ok(()) => Ok(path),
        Err(source) => Err(HistoryCommandError::Write { path, source }),
    }
}
