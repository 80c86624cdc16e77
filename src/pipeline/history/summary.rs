//! The summary of a robot's history: what was judged before, so that ten thousand sessions need not be read again.
//!
//! A file `.history/ROBOT.jsonl` in the lake's folder, beside the tables and no part of them: a first line with a digest of the
//! rest, a line for each row of `runs`, one for each session judged, and the state that the next session is judged from. It is believed only as
//! far as the digests of the rows of `runs` in it are those of today, and those rows hold the digests of every table
//! that was read. Numbers are kept to the last bit. Damaged, or of another version, it is made again.

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

/// Raised when the lines or what they mean change.
const FORMAT: u32 = 2;

/// What was judged before.
#[derive(Debug, Clone, Default)]
pub(super) struct Summary {
    /// What each row of `runs` says, by the digest of its file.
    pub(super) facts: BTreeMap<String, Fact>,
    /// The sessions judged, in order.
    pub(super) entries: Vec<Entry>,
    /// The state after the last of them.
    pub(super) session_history: SessionHistory,
    /// Whether sessions behind the last row were cut off, so that the state is not that after the last.
    pub(super) is_cut: bool,
}

/// A session judged.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// Digest of its row in `runs`.
    pub(super) digest: String,
    /// What was said of it, or why it could not be read.
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
    /// The summary of the robot whose rows are in `folder`; an empty one where there is none that can be believed.
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

    /// The same where its sessions are the first of `rows`; nothing where they are not, or where one that could not be read
    /// `is_readable` by now.
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
        // The state is that after the last: with fewer rows nothing follows any more, and nothing may be kept.
        self.is_cut = self.entries.len() > rows.len();
        self.entries.truncate(rows.len());
        self
    }

    /// Writes the summary, whole or not at all.
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

/// Named as the robot's folder is, whose name is encoded.
fn place(lake: &Lake, folder: &Path) -> PathBuf {
    let mut name = folder.file_name().unwrap_or(OsStr::new("robot")).to_owned();
    name.push(".jsonl");
    lake.root().named().join(".history").join(name)
}
