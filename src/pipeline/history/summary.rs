//! The summary of a robot's history: earlier judgements, so that ten thousand sessions need not be read again.
//!
//! A file `.history/ROBOT.jsonl` in the lake's folder, next to the tables and no part of them: a first line with a digest
//! of the other lines, a line for each row of `runs`, one for each judged session, and the state from which the next
//! session is judged. It is used only as far as the digests of the rows of `runs` in it are those of today, and those rows
//! hold the digests of every table that was read. Numbers are kept to the last bit. A damaged summary, or one of another
//! version, is computed again.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::order::CurrentRow;
use super::rows::Fact;
use crate::history::{Judged, SessionHistory};
use crate::io::input::{self, Bound};
use crate::io::lake::Lake;
use crate::io::whole_file::replace_whole;
use crate::manifest::VERSION;

/// Version of the lines and of their meaning; raised by any change.
const FORMAT: u32 = 3;

/// Earlier judgements.
#[derive(Debug, Clone, Default)]
pub(super) struct Summary {
    /// The facts of each row of `runs`, by the digest of its file.
    pub(super) facts: BTreeMap<String, Fact>,
    /// The sessions judged, in order.
    pub(super) entries: Vec<Entry>,
    /// The state after the last of them.
    pub(super) session_history: SessionHistory,
    /// Whether sessions after the last row were cut off: then the state is not the one after the last session.
    pub(super) is_cut: bool,
}

/// A judged session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// Digest of its row in `runs`.
    pub(super) digest: String,
    /// Its judgement, or why it could not be read.
    pub(super) judged: Result<Judged, String>,
}

/// The first line.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Head {
    format: u32,
    version: String,
    digest: String,
}

#[derive(Serialize, Deserialize)]
enum Line {
    Fact(String, Fact),
    Entry(Entry),
    SessionHistory(Box<SessionHistory>),
}

impl Summary {
    /// The summary of the robot whose rows are in `folder`; an empty one where none can be used.
    pub(super) fn read(lake: &Lake, folder: &Path) -> Self {
        let text = input::text(&place(lake, folder), Bound::TABLE).unwrap_or_default();
        Self::parse(&text).unwrap_or_default()
    }

    fn parse(text: &str) -> Option<Self> {
        let (head, rest) = text.split_once('\n')?;
        let head: Head = serde_json::from_str(head).ok()?;
        if head != Head::of(rest) {
            return None;
        }
        let lines: Vec<&str> = rest.lines().collect();
        let lines: Result<Vec<Line>, _> = lines
            .par_iter()
            .map(|line| serde_json::from_str(line))
            .collect();
        let mut summary = Self::default();
        for line in lines.ok()? {
            match line {
                Line::Fact(digest, fact) => {
                    summary.facts.insert(digest, fact);
                }
                Line::Entry(entry) => summary.entries.push(entry),
                Line::SessionHistory(session_history) => summary.session_history = *session_history,
            }
        }
        Some(summary)
    }

    /// The part of the summary whose sessions are the first of `rows`; empty where they are not, or where a session that
    /// could not be read `is_readable` by now.
    pub(super) fn up_to(
        mut self,
        rows: &[CurrentRow],
        is_readable: impl Fn(&CurrentRow) -> bool,
    ) -> Self {
        let same = |(row, entry): (&CurrentRow, &Entry)| {
            row.digest == entry.digest && (entry.judged.is_ok() || !is_readable(row))
        };
        if !rows.iter().zip(&self.entries).all(same) {
            return Self::default();
        }
        // The state is the one after the last session: with fewer rows no session can follow it, and it is not kept.
        self.is_cut = self.entries.len() > rows.len();
        self.entries.truncate(rows.len());
        self
    }

    /// Writes the summary, completely or not at all.
    pub(super) fn write(&self, lake: &Lake, folder: &Path) -> io::Result<()> {
        let path = place(lake, folder);
        let beside = path.parent().expect("a summary stands in a folder");
        fs::create_dir_all(beside)?;
        let mut rest = Vec::new();
        let facts = self.facts.iter();
        let facts = facts.map(|(digest, fact)| Line::Fact(digest.clone(), fact.clone()));
        let entries = self.entries.iter().map(|entry| Line::Entry(entry.clone()));
        let session_history = Line::SessionHistory(Box::new(self.session_history.clone()));
        for line in facts.chain(entries).chain([session_history]) {
            serde_json::to_writer(&mut rest, &line)?;
            rest.push(b'\n');
        }
        let rest = String::from_utf8(rest).map_err(io::Error::other)?;
        let mut bytes = serde_json::to_vec(&Head::of(&rest))?;
        bytes.push(b'\n');
        bytes.extend(rest.as_bytes());
        replace_whole(&path, &bytes)
    }
}

impl Head {
    fn of(rest: &str) -> Self {
        Self {
            format: FORMAT,
            version: VERSION.to_owned(),
            digest: blake3::hash(rest.as_bytes()).to_hex().to_string(),
        }
    }
}

/// The summary's path, named like the robot's folder, whose name is encoded.
fn place(lake: &Lake, folder: &Path) -> PathBuf {
    let mut name = folder.file_name().unwrap_or(OsStr::new("robot")).to_owned();
    name.push(".jsonl");
    lake.root().named().join(".history").join(name)
}
