//! Sessions that were recorded as tables of stations: a table in each sub-folder, one for each name, or rows of one table; those of each
//! robot where rows name it.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::super::growing::growing_table;
use super::{Bound, Found, Lack, Recorded, Session, SessionTable, Tree, Why, logs, name_of};
use crate::ingest::StationsSettings;
use crate::io::station_table::{self, Whose};
use crate::pipeline::file::{LogNames, ToldBy};

impl Found<'_> {
    pub(super) fn tables(&mut self, names: &LogNames) -> io::Result<()> {
        match self.input.sessions_by {
            ToldBy::Folder => self.tables_in_folders(names),
            ToldBy::FileName | ToldBy::Metadata => self.tables_by_name(names),
            ToldBy::Column => self.sessions_in_tables(names),
        }
    }

    fn tables_in_folders(&mut self, names: &LogNames) -> io::Result<()> {
        let tree = self.tree;
        for path in tree.entries(self.folder)?.into_iter().filter(|path| tree.is_dir(path)) {
            let table = logs::find(tree, &path, names);
            let corrected = logs::at_most_one(tree, &path, &self.input.corrected_targets);
            self.add_table(name_of(&path), table, corrected)?;
        }
        Ok(())
    }

    fn tables_by_name(&mut self, names: &LogNames) -> io::Result<()> {
        for (name, table) in logs::find_named(self.tree, self.folder, names)? {
            let corrected = self.corrected_of(&name);
            self.add_table(name, table, corrected)?;
        }
        Ok(())
    }

    /// The sessions that the rows of tables name in a column.
    fn sessions_in_tables(&mut self, names: &LogNames) -> io::Result<()> {
        self.opens("sessions_by")?;
        let mut sessions: BTreeMap<Whose, Vec<PathBuf>> = BTreeMap::new();
        for path in logs::all(self.tree, self.folder, names)? {
            for whose in self.named_in(&path) {
                sessions.entry(whose).or_default().push(path.clone());
            }
        }
        for (whose, tables) in sessions {
            let (name, robot) = (whose.session.clone().unwrap_or_default(), whose.robot.clone());
            let corrected = self.corrected_of(&name);
            let recorded = match &tables[..] {
                [path] => Ok(SessionTable { path: path.clone(), whose }),
                several => Err(Lack::Wrong(format!(
                    "{} tables have rows of it; a session stands in one",
                    several.len()
                ))),
            };
            self.add_recorded(name, robot, recorded, corrected);
        }
        Ok(())
    }

    /// Refuses tables on object storage, where a column that is named by this key has to be read to find sessions.
    fn opens(&self, key: &str) -> io::Result<()> {
        if matches!(self.tree, Tree::Folder) {
            return Ok(());
        }
        Err(io::Error::other(format!(
            "{key} = \"column\" opens every table, and these are on object storage: use \"folder\" or \"file_name\""
        )))
    }

    /// The robots and sessions that a table's rows name, of all robots or of the one that is meant; leaves out a table that cannot be
    /// read, and says how many rows name none.
    fn named_in(&mut self, path: &Path) -> Vec<Whose> {
        let Some(settings) = self.stations else { return Vec::new() };
        match station_table::named(path, settings, Bound::of(self.limits)) {
            Err(error) => {
                self.leave_out(name_of(path), error.to_string());
                Vec::new()
            }
            Ok((names, nameless)) => {
                if let Some(line) = nameless.first() {
                    let (count, what) = (nameless.len(), unnamed(settings));
                    let reason =
                        format!("{count} of its rows name no {what}, the first in line {line}");
                    self.leave_out(name_of(path), reason);
                }
                let is_meant = |own: &Whose| {
                    own.robot.as_deref().zip(self.robot).is_none_or(|(own, meant)| own == meant)
                };
                names.into_iter().filter(is_meant).collect()
            }
        }
    }

    /// Adds the session of a table; that of each robot where its rows name several.
    fn add_table(
        &mut self,
        name: String,
        tables: Result<Vec<PathBuf>, Lack>,
        corrected: Result<Option<PathBuf>, Lack>,
    ) -> io::Result<()> {
        let one = tables.and_then(|tables| match &tables[..] {
            [path] => Ok(path.clone()),
            several => Err(Lack::Wrong(format!(
                "it has {} tables of stations; a session has one",
                several.len()
            ))),
        });
        let of = |path: &PathBuf, whose: Whose| SessionTable { path: path.clone(), whose };
        let path = match one {
            Ok(path) if self.stations.is_some_and(|own| own.robot.is_some()) => path,
            one => {
                let table = one.map(|path| of(&path, Whose::default()));
                self.add_recorded(name, None, table, corrected);
                return Ok(());
            }
        };
        self.opens("robots_by")?;
        for whose in self.named_in(&path) {
            let (robot, corrected) = (whose.robot.clone(), corrected.clone());
            self.add_recorded(name.clone(), robot, Ok(of(&path, whose)), corrected);
        }
        Ok(())
    }

    /// Adds a session, by its name and the robot that its rows name, or leaves out a folder without a table.
    fn add_recorded(
        &mut self,
        name: String,
        robot: Option<String>,
        table: Result<SessionTable, Lack>,
        corrected: Result<Option<PathBuf>, Lack>,
    ) {
        let (table, corrected) = match (table, corrected) {
            (Err(Lack::Absent(reason)), _) => return self.leave_out(name, reason),
            (Err(Lack::Wrong(reason)), _)
            | (_, Err(Lack::Absent(reason) | Lack::Wrong(reason))) => (Err(Why::Bad(reason)), None),
            (Ok(table), Ok(corrected)) => {
                let grows = growing_table(&table.path, self.settle());
                let table =
                    grows.map_or(Ok(Recorded::Table(table)), |grows| Err(Why::Waits(grows)));
                (table, corrected)
            }
        };
        self.sessions.push(Session { name, recorded: table, corrected, robot });
    }
}

/// What a row lacks that names no session of it.
const fn unnamed(settings: &StationsSettings) -> &'static str {
    match (&settings.robot, &settings.session) {
        (Some(_), Some(_)) => "robot or no session",
        (Some(_), None) => "robot",
        (None, _) => "session",
    }
}
