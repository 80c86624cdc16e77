//! All files under a lake, and the role of each by its place: files of runs, `TABLE/ROBOT/SESSION/RUN.parquet` and
//! `report/ROBOT/SESSION/RUN.html`; its own (lock, history, index, pages over time, [`COMPACT`], corrections, requests); and
//! temporaries. Every other file there is foreign.

use std::fs::File;

use super::compact::{self, COMPACT};
use super::{Lake, OVER_TIME, PAGES, Result, file_key, is_correction, name, request_of};
use crate::manifest::RunKey;
use crate::schema::{self, Role};
use crate::store::Place;
use crate::temporary::Owner;

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct LakeFile {
    /// Its path below the lake, with `/` between the parts.
    pub key: String,
    pub stands: Stands,
}

#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stands {
    OfRun {
        table: String,
        robot: String,
        session: String,
        run: String,
    },
    /// The lake's own: its lock, the summary or a page of a history, the compact form, a record of corrections, or a request.
    Own,
    /// Under a temporary name: being written, or left over by a process that was stopped.
    Temporary,
    Foreign,
}

impl Lake {
    /// All files below a folder of the lake, or of the whole lake where that is empty: hidden ones too, at any depth.
    pub fn files(&self, folder: &str) -> Result<Vec<LakeFile>> {
        let keys = self.store.all(folder)?.into_iter();
        let file = |key: String| LakeFile { stands: Stands::of(&key), key };
        Ok(keys.map(file).collect())
    }

    /// The path, below the lake, of a file of a run: the table of that name, or its page ([`PAGES`]).
    pub fn file_key(&self, table: &str, key: &RunKey) -> Result<String> {
        file_key(table, key)
    }

    pub fn place_of(&self, file_key: &str) -> Place {
        self.store.place(file_key)
    }

    pub fn open_key(&self, file_key: &str) -> Result<File> {
        Ok(self.store.open(file_key)?)
    }

    pub fn name_of(folder: &str) -> String {
        name::decode(folder)
    }

    pub fn folders() -> impl Iterator<Item = &'static str> {
        let tables = schema::all().iter();
        let published = tables.filter(|schema| schema.role == Role::Published);
        published.map(|schema| schema.table.as_str()).chain([PAGES])
    }
}

impl Stands {
    fn of(key: &str) -> Self {
        let parts: Vec<&str> = key.split('/').collect();
        match parts[..] {
            [".lock"] => Self::Own,
            [".history" | ".index" | OVER_TIME, name]
            | [".index", "alone", name]
            | [".history", "figures", _, _, name] => Self::kept(name),
            [COMPACT, ref folder @ .., name] => match compact::is_own(folder, name) {
                None => Self::Temporary,
                Some(true) => Self::Own,
                Some(false) => Self::Foreign,
            },
            _ if is_correction(key) || request_of(key).is_some() => Self::Own,
            [table, robot, session, name] if Lake::folders().any(|own| own == table) => {
                Self::in_session(table, robot, session, name)
            }
            _ => Self::Foreign,
        }
    }

    /// A file of the cache, or a page over time, by its name. Versions up to 0.2.1 did not pack the cache's files, and their temporaries did
    /// not name the process.
    fn kept(name: &str) -> Self {
        let is_hidden = name.starts_with('.');
        let endings = [".json", ".jsonl", ".zst", ".html"];
        if Owner::of_temporary(name).is_some() || (is_hidden && name.contains(".jsonl.tmp-")) {
            Self::Temporary
        } else if !is_hidden && endings.iter().any(|ending| name.ends_with(ending)) {
            Self::Own
        } else {
            Self::Foreign
        }
    }

    fn in_session(table: &str, robot: &str, session: &str, name: &str) -> Self {
        let ending = if table == PAGES { ".html" } else { ".parquet" };
        if Owner::of_temporary(name).is_some() {
            return Self::Temporary;
        }
        match name.strip_suffix(ending) {
            Some(run) if !run.is_empty() && !name.starts_with('.') => Self::OfRun {
                table: table.to_owned(),
                robot: robot.to_owned(),
                session: session.to_owned(),
                run: run.to_owned(),
            },
            _ => Self::Foreign,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_determines_the_role_of_a_file() {
        let of_run = |table: &str| Stands::OfRun {
            table: table.to_owned(),
            robot: "r%20x".to_owned(),
            session: "mon".to_owned(),
            run: "0a".to_owned(),
        };
        let temporary = "accuracy/r/mon/.0a.parquet.tmp-host-12-345-0";
        let cases = [
            ("accuracy/r%20x/mon/0a.parquet", of_run("accuracy")),
            ("runs/r%20x/mon/0a.parquet", of_run("runs")),
            ("report/r%20x/mon/0a.html", of_run(PAGES)),
            (".lock", Stands::Own),
            (".history/r.jsonl", Stands::Own),
            (".history/r.jsonl.zst", Stands::Own),
            (".history/figures/r/mon/0a.json.zst", Stands::Own),
            (".history/figures/r/mon/0a.csv", Stands::Foreign),
            (".history/figures/r/mon/.0a.json.zst.tmp-host-12-345-0", Stands::Temporary),
            ("corrections/r/mon/0123456789abcdef0123456789abcdef.parquet", Stands::Own),
            ("corrections/r/mon/.0123.parquet.tmp-host-12-345-0", Stands::Temporary),
            ("asked/r/mon/00000001.parquet", Stands::Own),
            ("asked/r%20x/mon/0a.parquet", of_run("asked")),
            (".history/.r.jsonl.tmp-12", Stands::Temporary),
            (".index/runs.jsonl", Stands::Own),
            (".index/runs.jsonl.zst", Stands::Own),
            (".index/.runs.jsonl.zst.tmp-host-12-345-0", Stands::Temporary),
            (".index/more.csv", Stands::Foreign),
            (".index/alone/5e.json.zst", Stands::Own),
            (".index/alone/5e.txt", Stands::Foreign),
            ("pages/r%20x.html", Stands::Own),
            ("pages/.r.html.tmp-host-12-345-0", Stands::Temporary),
            ("pages/r.csv", Stands::Foreign),
            ("compact/states/00000001.jsonl", Stands::Own),
            ("compact/runs/2026-11/0a.parquet", Stands::Own),
            ("compact/keys/undated/0a.txt.zst", Stands::Own),
            ("compact/runs/2026-11/.new.parquet.tmp-host-12-345-0", Stands::Temporary),
            ("compact/runs/2026-11/0a.csv", Stands::Foreign),
            ("compact/figures/2026-11/0a.parquet", Stands::Foreign),
            ("compact/0a.parquet", Stands::Foreign),
            (temporary, Stands::Temporary),
            ("README.txt", Stands::Foreign),
            ("accuracy/r/mon/0a.csv", Stands::Foreign),
            ("accuracy/r/mon/.0a.parquet", Stands::Foreign),
            ("accuracy/r/mon/.parquet", Stands::Foreign),
            ("accuracy/r/mon/more/0a.parquet", Stands::Foreign),
            ("accuracy/0a.parquet", Stands::Foreign),
            ("accuracy/r/mon/0a.html", Stands::Foreign),
            // A table that is an input, and one that is unknown.
            ("targets/r/mon/0a.parquet", Stands::Foreign),
            ("figures/r/mon/0a.parquet", Stands::Foreign),
            (".lock/x", Stands::Foreign),
        ];
        for (key, expected) in cases {
            assert_eq!(Stands::of(key), expected, "{key}");
        }
    }
}
