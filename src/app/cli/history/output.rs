//! The files of a history: two tables of all robots, a page for each, and of several robots the page of the fleet.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::HistoryCommandError;
use crate::cli::messages::Printable;
use crate::io::lake::Lake;
use crate::io::table::{Row as _, Table, write};
use crate::io::tables::drift::{self, DriftRow};
use crate::io::tables::history::{self, HistoryRow};
use crate::io::tables::past::{Figure, PastSession};
use crate::io::whole_file::replace_whole;
use crate::manifest::RunKey;
use crate::pipeline::history::{
    HistoryError, RobotHistory, figures, figures_of_ends, fleet, trend,
};
use crate::units::WallTime;

/// Name of the page of the fleet: what a browser opens of a folder.
const FLEET: &str = "index.html";

/// Writes the tables and the pages; gives their paths.
pub(super) fn output(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: &Path,
    as_of: Option<WallTime>,
) -> Result<Vec<PathBuf>, HistoryCommandError> {
    make(folder)?;
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
    written.extend(page_of_fleet(lake, robots, folder, as_of)?);
    Ok(written)
}

/// Writes the pages alone; gives their paths.
pub(super) fn pages(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: &Path,
    as_of: Option<WallTime>,
) -> Result<Vec<PathBuf>, HistoryCommandError> {
    make(folder)?;
    let page = |robot: &RobotHistory| {
        let (figures, wrong) = figures_of_ends(lake, &robot.sessions);
        tell(&wrong);
        let name = file_name(lake, &robot.robot)?;
        put(folder, &name, trend(robot, &figures).as_bytes())
    };
    let written = lake.read_with(|| robots.par_iter().map(page).collect::<Result<Vec<_>, _>>());
    let mut written = written?;
    written.extend(page_of_fleet(lake, robots, folder, as_of)?);
    Ok(written)
}

fn page_of_fleet(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: &Path,
    as_of: Option<WallTime>,
) -> Result<Option<PathBuf>, HistoryCommandError> {
    if robots.len() < 2 {
        return Ok(None);
    }
    let names = robots.iter().map(|own| file_name(lake, &own.robot));
    let names = names.collect::<Result<Vec<_>, _>>()?;
    let page = fleet(robots, &names, as_of);
    put(folder, FLEET, page.as_bytes()).map(Some)
}

fn make(folder: &Path) -> Result<(), HistoryCommandError> {
    std::fs::create_dir_all(folder)
        .map_err(|source| HistoryCommandError::Write { path: folder.to_owned(), source })
}

/// The figures of each session; those that cannot be read are logged.
fn read(lake: &Lake, robot: &RobotHistory) -> Vec<Vec<Figure>> {
    let (figures, wrong) = figures(lake, &robot.sessions);
    tell(&wrong);
    figures
}

fn tell(wrong: &[String]) {
    for reason in wrong {
        tracing::warn!("left out of the table history and the page: {}", Printable(reason));
    }
}

fn rows<'h>(
    robots: &'h [RobotHistory],
    all: &'h [Vec<Vec<Figure>>],
) -> Vec<(&'h PastSession, &'h Figure)> {
    let sessions = robots.iter().flat_map(|robot| &robot.sessions);
    let figures = sessions.zip(all.iter().flatten());
    figures.flat_map(|(session, own)| own.iter().map(move |figure| (session, figure))).collect()
}

/// A robot's name may hold any character, so it is encoded as in the lake; of a robot named like the page of the fleet
/// the first letter is too.
fn file_name(lake: &Lake, robot: &str) -> Result<String, HistoryError> {
    let key = RunKey::new("robot", "session", robot);
    let path = lake.page(&key)?.named();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(if name.eq_ignore_ascii_case(FLEET) {
        format!("%{:02X}{}", name.as_bytes()[0], &name[1..])
    } else {
        name.into_owned()
    })
}

fn bytes(table: &Table, folder: &Path) -> Result<Vec<u8>, HistoryCommandError> {
    write(table, Vec::new()).map_err(|error| HistoryCommandError::Write {
        path: folder.to_owned(),
        source: io::Error::other(error),
    })
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, HistoryCommandError> {
    let path = folder.join(name);
    match replace_whole(&path, bytes) {
        Ok(()) => Ok(path),
        Err(source) => Err(HistoryCommandError::Write { path, source }),
    }
}
