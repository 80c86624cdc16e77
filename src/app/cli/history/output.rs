//! The files of a history: two tables of all robots, a page for each, and the page of the fleet.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::HistoryCommandError;
use crate::cli::messages::Printable;
use crate::files::table::{Table, write};
use crate::files::whole_file::replace_whole;
use crate::io::lake::{FLEET, Lake, LakeError, page_over_time};
use crate::io::rows::Row as _;
use crate::io::tables::drift::{self, DriftRow};
use crate::io::tables::history::{self, HistoryRow};
use crate::io::tables::past::{Figure, PastSession};
use crate::pipeline::history::{RobotHistory, figures, figures_of_ends, fleet, trend};
use crate::units::WallTime;

/// The time that the page of the fleet is of, where that is stated; `None` without the page.
type OfAll = Option<Option<WallTime>>;

/// Writes the tables and the pages; gives their paths.
pub(super) fn output(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: &Path,
    of_all: OfAll,
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
        let name = page_over_time(&robot.robot)?;
        written.push(put(folder, &name, trend(robot, figures, None)?.as_bytes())?);
    }
    written.extend(page_of_fleet(lake, robots, Some(folder), of_all)?);
    Ok(written)
}

/// Writes the pages alone, into the lake where no folder is given; gives their paths.
pub(super) fn pages(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: Option<&Path>,
    of_all: OfAll,
) -> Result<Vec<PathBuf>, HistoryCommandError> {
    folder.map_or(Ok(()), make)?;
    let linked = folder.is_none().then_some(lake);
    let page = |robot: &RobotHistory| {
        let (figures, wrong) = figures_of_ends(lake, &robot.sessions);
        tell(&wrong);
        let name = page_over_time(&robot.robot)?;
        put_page(lake, folder, &name, &trend(robot, &figures, linked)?)
    };
    let written = lake.read_with(|| robots.par_iter().map(page).collect::<Result<Vec<_>, _>>());
    let mut written = written?;
    written.extend(page_of_fleet(lake, robots, folder, of_all)?);
    Ok(written)
}

fn page_of_fleet(
    lake: &Lake,
    robots: &[RobotHistory],
    folder: Option<&Path>,
    of_all: OfAll,
) -> Result<Option<PathBuf>, HistoryCommandError> {
    let Some(as_of) = of_all else { return Ok(None) };
    let names = robots.iter().map(|own| page_over_time(&own.robot));
    let names = names.collect::<Result<Vec<_>, LakeError>>()?;
    put_page(lake, folder, FLEET, &fleet(robots, &names, as_of)).map(Some)
}

fn put_page(
    lake: &Lake,
    folder: Option<&Path>,
    name: &str,
    page: &str,
) -> Result<PathBuf, HistoryCommandError> {
    match folder {
        Some(folder) => put(folder, name, page.as_bytes()),
        None => Ok(lake.keep_page(name, page.as_bytes())?.named()),
    }
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
