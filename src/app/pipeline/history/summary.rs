//! The summary of a robot's history: earlier judgements, so that ten thousand sessions need not be read again.
//!
//! A file `.history/ROBOT.jsonl.zst` in the lake, next to the tables and no part of them: a line
//! for each row of `runs`, one for each judged session, and the state from which the next session is judged. It is used only as far as
//! the digests of the rows of `runs` in it are those of today, and those rows hold the digests of every table that was read. On object
//! storage a row whose tag is the same is not read again to digest it. Numbers are kept to the last bit.

use std::collections::BTreeMap;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::order::CurrentRow;
use super::rows::Fact;
use crate::files::store::Listed;
use crate::history::{Judged, SessionHistory};
use crate::io::lake::{Lake, LakeError, summary_key};

#[derive(Debug, Clone, Default)]
pub(super) struct Summary {
    /// The facts of each row of `runs`, by the digest of its file.
    pub(super) facts: BTreeMap<String, Fact>,
    /// The digest of each row of `runs`, by its path below the lake and the tag that the store gave it.
    pub(super) tags: BTreeMap<(String, String), String>,
    pub(super) entries: Vec<Entry>,
    /// The state after the last of them.
    pub(super) session_history: SessionHistory,
    /// Whether sessions after the last row were cut off: then the state is not the one after the last session.
    pub(super) is_cut: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    /// Digest of its row in `runs`.
    pub(super) digest: String,
    /// Its judgement, or why it could not be read.
    pub(super) judged: Result<Judged, String>,
}

#[derive(Serialize, Deserialize)]
enum Line {
    Fact(String, Fact),
    Tag(String, String, String),
    Entry(Entry),
    SessionHistory(Box<SessionHistory>),
}

impl Summary {
    /// The summary of the robot whose rows are in `folder`; an empty one where none can be used.
    pub(super) fn read(lake: &Lake, folder: &str) -> Self {
        lake.kept(&summary_key(folder)).and_then(|text| Self::parse(&text)).unwrap_or_default()
    }

    /// The digest and the facts of a row that has the tag it had.
    pub(super) fn known(&self, listed: &Listed) -> Option<(String, Fact)> {
        let digest = self.tags.get(&(listed.key.clone(), listed.tag.clone()?))?;
        Some((digest.clone(), self.facts.get(digest)?.clone()))
    }

    fn parse(rest: &str) -> Option<Self> {
        let lines: Vec<&str> = rest.lines().collect();
        let lines: Result<Vec<Line>, _> =
            lines.par_iter().map(|line| serde_json::from_str(line)).collect();
        let mut summary = Self::default();
        for line in lines.ok()? {
            match line {
                Line::Fact(digest, fact) => {
                    summary.facts.insert(digest, fact);
                }
                Line::Tag(key, tag, digest) => {
                    summary.tags.insert((key, tag), digest);
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

    pub(super) fn write(&self, lake: &Lake, folder: &str) -> Result<(), LakeError> {
        let facts = self.facts.iter();
        let facts = facts.map(|(digest, fact)| Line::Fact(digest.clone(), fact.clone()));
        let tags = self.tags.iter();
        let tags = tags.map(|((key, tag), own)| Line::Tag(key.clone(), tag.clone(), own.clone()));
        let entries = self.entries.iter().map(|entry| Line::Entry(entry.clone()));
        let session_history = Line::SessionHistory(Box::new(self.session_history.clone()));
        let mut rest = String::new();
        for line in facts.chain(tags).chain(entries).chain([session_history]) {
            rest += &serde_json::to_string(&line).expect("texts and numbers");
            rest.push('\n');
        }
        lake.keep(&summary_key(folder), &rest)
    }
}
