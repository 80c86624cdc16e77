//! Sessions that were recorded as tables of stations: a table in each sub-folder, one for each name, or rows of one table.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use super::super::growing::growing_table;
use super::{Bound, Found, Lack, Recorded, Session, SessionTable, Tree, Why, logs, name_of};
use crate::io::station_table;
use crate::pipeline::file::{LogNames, SessionsBy};

impl Found<'_> {
    /// Finds the sessions of tables with these names.
    pub(super) fn tables(&mut self, names: &LogNames) -> io::Result<()> {
        match self.input.sessions_by {
            SessionsBy::Folder => self.tables_in_folders(names),
            SessionsBy::FileName | SessionsBy::Metadata => self.tables_by_name(names),
            SessionsBy::Column => self.sessions_in_tables(names),
        }
    }

    fn tables_in_folders(&mut self, names: &LogNames) -> io::Result<()> {
        let tree = self.tree;
        for path in tree
            .entries(self.folder)?
            .into_iter()
            .filter(|path| tree.is_dir(path))
        {
            let table = logs::find(tree, &path, names);
            let corrected = logs::at_most_one(tree, &path, &self.input.corrected_targets);
            self.add_table(name_of(&path), table, corrected);
        }
        Ok(())
    }

    fn tables_by_name(&mut self, names: &LogNames) -> io::Result<()> {
        for (name, table) in logs::find_named(self.tree, self.folder, names)? {
            let corrected = self.corrected_of(&name);
            self.add_table(name, table, corrected);
        }
        Ok(())
    }

    /// The sessions that the rows of tables name in a column.
    fn sessions_in_tables(&mut self, names: &LogNames) -> io::Result<()> {
        if !matches!(self.tree, Tree::Folder) {
            return Err(io::Error::other(
                "sessions_by = \"column\" opens every table, and these are on object storage: use \"folder\" or \"file_name\"",
            ));
        }
        let mut sessions: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
        for path in logs::all(self.tree, self.folder, names)? {
            self.name_rows(&path, &mut sessions);
        }
        for (name, tables) in sessions {
            let corrected = self.corrected_of(&name);
            let session = Some(name.clone());
            let recorded = match &tables[..] {
                [path] => Ok(SessionTable {
                    path: path.clone(),
                    session,
                }),
                several => Err(Lack::Wrong(format!(
                    "{} tables have rows of it; a session stands in one",
                    several.len()
                ))),
            };
            self.add_recorded(name, recorded, corrected);
        }
        Ok(())
    }

    /// Adds the sessions that a table's rows name; leaves out a table that cannot be read, and says how many rows name none.
    fn name_rows(&mut self, path: &Path, sessions: &mut BTreeMap<String, Vec<PathBuf>>) {
        let Some(settings) = self.stations else {
            return;
        };
        match station_table::sessions(path, settings, Bound::of(self.limits)) {
            Err(error) => self.leave_out(name_of(path), error.to_string()),
            Ok((names, nameless)) => {
                if let Some(line) = nameless.first() {
                    let reason = format!(
                        "{} of its rows name no session, the first in line {line}",
                        nameless.len()
                    );
                    self.leave_out(name_of(path), reason);
                }
                for name in names {
                    sessions.entry(name).or_default().push(path.to_owned());
                }
            }
        }
    }

    fn add_table(
        &mut self,
        name: String,
        tables: Result<Vec<PathBuf>, Lack>,
        corrected: Result<Option<PathBuf>, Lack>,
    ) {
        let one = tables.and_then(|tables| match &tables[..] {
            [path] => Ok(SessionTable {
                path: path.clone(),
                session: None,
            }),
            several => Err(Lack::Wrong(format!(
                "it has {} tables of stations; a session has one",
                several.len()
            ))),
        });
        self.add_recorded(name, one, corrected);
    }

    /// Adds a session, or leaves out a folder without a table.
    fn add_recorded(
        &mut self,
        name: String,
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
        self.sessions.push(Session {
            name,
            recorded: table,
            corrected,
        });
    }
}
