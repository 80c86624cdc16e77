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

type Result<T, E = HistoryCommandError> = std::result::Result<T, E>;

/// The time that the page of the fleet is of, where that is stated; `None` without the page.
type OfAll = Option<Option<WallTime>>;

pub(super) struct Output<'a> {
    pub(super) lake: &'a Lake,
    pub(super) robots: &'a [RobotHistory],
    pub(super) of_all: OfAll,
}

impl Output<'_> {
    /// Writes the tables and the pages; gives their paths.
    pub(super) fn all(&self, folder: &Path) -> Result<Vec<PathBuf>> {
        make(folder)?;
        let all: Vec<Vec<Vec<Figure>>> = self.robots.iter().map(|own| self.read(own)).collect();
        let drifts = self.robots.iter().flat_map(|robot| drift::rows(&robot.sessions));
        let mut written = Vec::new();
        for table in [
            HistoryRow::table_of_several(history::rows(&rows(self.robots, &all)))?.table,
            DriftRow::table_of_several(drifts.collect())?.table,
        ] {
            let name = format!("{}.parquet", table.schema().table);
            written.push(put(folder, &name, &bytes(&table, folder)?)?);
        }
        for (robot, figures) in self.robots.iter().zip(&all) {
            let name = page_over_time(&robot.robot)?;
            written.push(put(folder, &name, trend(robot, figures, None)?.as_bytes())?);
        }
        written.extend(self.page_of_fleet(Some(folder))?);
        Ok(written)
    }

    /// Writes the pages alone, into the lake where no folder is given; gives their paths.
    pub(super) fn pages(&self, folder: Option<&Path>) -> Result<Vec<PathBuf>> {
        folder.map_or(Ok(()), make)?;
        let linked = folder.is_none().then_some(self.lake);
        let page = |robot: &RobotHistory| {
            let (figures, wrong) = figures_of_ends(self.lake, &robot.sessions);
            tell(&wrong);
            let name = page_over_time(&robot.robot)?;
            self.put_page(folder, &name, &trend(robot, &figures, linked)?)
        };
        let pages = || self.robots.par_iter().map(page).collect::<Result<Vec<_>>>();
        let mut written = self.lake.read_with(pages)?;
        written.extend(self.page_of_fleet(folder)?);
        Ok(written)
    }

    fn page_of_fleet(&self, folder: Option<&Path>) -> Result<Option<PathBuf>> {
        let Some(as_of) = self.of_all else { return Ok(None) };
        let names = self.robots.iter().map(|own| page_over_time(&own.robot));
        let names = names.collect::<Result<Vec<_>, LakeError>>()?;
        self.put_page(folder, FLEET, &fleet(self.robots, &names, as_of)).map(Some)
    }

    fn put_page(&self, folder: Option<&Path>, name: &str, page: &str) -> Result<PathBuf> {
        match folder {
            Some(folder) => put(folder, name, page.as_bytes()),
            None => Ok(self.lake.keep_page(name, page.as_bytes())?.named()),
        }
    }

    /// The figures of each session; those that cannot be read are logged.
    fn read(&self, robot: &RobotHistory) -> Vec<Vec<Figure>> {
        let (figures, wrong) = figures(self.lake, &robot.sessions);
        tell(&wrong);
        figures
    }
}

fn make(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder)
        .map_err(|source| HistoryCommandError::Write { path: folder.to_owned(), source })
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
    let figures = robots.iter().flat_map(|robot| &robot.sessions).zip(all.iter().flatten());
    figures.flat_map(|(session, own)| own.iter().map(move |figure| (session, figure))).collect()
}

fn bytes(table: &Table, folder: &Path) -> Result<Vec<u8>> {
    write(table, Vec::new()).map_err(|error| HistoryCommandError::Write {
        path: folder.to_owned(),
        source: io::Error::other(error),
    })
}

fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf> {
    let path = folder.join(name);
    match replace_whole(&path, bytes) {
        Ok(()) => Ok(path),
        Err(source) => Err(HistoryCommandError::Write { path, source }),
    }
}
