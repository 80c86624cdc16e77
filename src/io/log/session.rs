//! The files of a session's two sides. A recorder may split a recording into several files, and write some records only
//! into the first one, so a topic has to be in one file of its side. Each file is read once; rows are put in order by
//! their times, never by the files' names; ids are valid within one file only.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use super::block::Extent;
use super::ordered::SessionStreams;
use super::read_summary::ReadSummary;
use super::record::MessageRecord;
use super::registry::{Channel, Schema};
use super::scan::{Visitor, scan};
use super::streams::{Streams, Wanted};
use super::summary::Ending;
use super::{Limits, LogError, wanted};
use crate::ingest::{LogReject, Mapping};
use crate::progress::{Progress, Quiet};

/// Most topics that an error names, and most letters of each.
const MOST_TOPICS: usize = 100;
const LONGEST_TOPIC: usize = 200;

/// The files of a session's two sides; a file may belong to both.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SessionLogs {
    /// The controller's log, or the parts it was split into.
    pub controller: Vec<PathBuf>,
    /// The tracker's log, or the parts it was split into.
    pub tracker: Vec<PathBuf>,
}

impl SessionLogs {
    pub fn of_two(controller: &Path, tracker: &Path) -> Self {
        Self { controller: vec![controller.to_owned()], tracker: vec![tracker.to_owned()] }
    }

    /// Reads each file once; the rows of all wanted topics go to `streams`.
    pub(super) fn read(
        &self,
        mapping: &Mapping,
        limits: Limits,
        streams: &Mutex<SessionStreams<'_>>,
        progress: &dyn Progress,
    ) -> Result<ReadFiles, LogError> {
        let (of_controller, of_tracker) = wanted(mapping);
        let by_side =
            BTreeMap::from([(Side::Controller, of_controller), (Side::Tracker, of_tracker)]);
        let mut parts = Vec::new();
        for file in self.files() {
            let wanted = file.sides.iter().flat_map(|side| by_side[side].clone());
            let name = file.path.display().to_string();
            let mut of_file = Streams::new(&name, unlike(&name, wanted)?, mapping, streams);
            parts.push(Part {
                role: file.role(),
                read_summary: scan(&file.path, &name, limits, &mut of_file, progress)?,
                sides: file.sides,
                streams: of_file,
            });
        }
        for (side, wanted) in &by_side {
            require(*side, wanted, &parts)?;
        }
        let mut read = ReadFiles::default();
        for part in &mut parts {
            count(part, &mut read.counts);
            remember_all(&mut read.metadata, &mut part.read_summary, part.role);
            read.rejects.append(&mut part.read_summary.rejects);
        }
        Ok(read)
    }

    pub(super) fn names(&self) -> String {
        let files = self.files().into_iter();
        let names = files.map(|file| file.path.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }

    /// Each file once, by its real path.
    fn files(&self) -> Vec<LogFile> {
        let mut files: Vec<LogFile> = Vec::new();
        for (side, paths) in [(Side::Controller, &self.controller), (Side::Tracker, &self.tracker)]
        {
            for path in paths {
                let real = path.canonicalize().unwrap_or_else(|_| path.clone());
                if let Some(file) = files.iter_mut().find(|file| file.real == real) {
                    file.sides.insert(side);
                } else {
                    files.push(LogFile { path: path.clone(), real, sides: BTreeSet::from([side]) });
                }
            }
        }
        files
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    Controller,
    Tracker,
}

struct LogFile {
    path: PathBuf,
    real: PathBuf,
    sides: BTreeSet<Side>,
}

impl LogFile {
    /// The role that its counts and metadata are named by.
    fn role(&self) -> &'static str {
        match (self.sides.contains(&Side::Controller), self.sides.contains(&Side::Tracker)) {
            (true, true) => "log",
            (true, false) => "controller",
            _ => "tracker",
        }
    }
}

struct Part<'m, 's> {
    role: &'static str,
    sides: BTreeSet<Side>,
    read_summary: ReadSummary,
    streams: Streams<'m, 's>,
}

/// Everything that the files of a session hold except samples.
#[derive(Debug, Default)]
pub struct ReadFiles {
    /// Byte ranges that cannot be read, and messages that did not become rows.
    pub rejects: Vec<LogReject>,
    /// Metadata records, as `record.key` → value, controller first.
    pub metadata: BTreeMap<String, String>,
    pub counts: BTreeMap<String, u64>,
}

/// The metadata records of all logs of a session, as `record.key` → value, controller first; no chunk is opened for
/// them.
pub fn read_metadata(
    logs: &SessionLogs,
    limits: Limits,
) -> Result<BTreeMap<String, String>, LogError> {
    // Chunks above this limit are skipped.
    let limits = Limits { chunk_bytes: 0, ..limits };
    let mut metadata = BTreeMap::new();
    for file in logs.files() {
        let name = file.path.display().to_string();
        let mut read_summary = scan(&file.path, &name, limits, &mut Nothing, &Quiet)?;
        remember_all(&mut metadata, &mut read_summary, file.role());
    }
    Ok(metadata)
}

struct Nothing;

impl Visitor for Nothing {
    type Decoder = ();
    type Part = ();
    type Error = LogError;

    fn channel(&mut self, _: &Channel, _: Option<&Arc<Schema>>) -> Result<(), LogError> {
        Ok(())
    }

    fn message(&self, (): &(), _: &MessageRecord<'_>, (): &mut ()) {}

    fn clear(&self, (): &mut ()) {}

    fn merge(&mut self, _: &Extent, (): &mut (), _: &mut Vec<LogReject>) {}
}

/// Checks that no topic of a file is named for two streams.
fn unlike(file: &str, wanted: impl Iterator<Item = Wanted>) -> Result<Vec<Wanted>, LogError> {
    let wanted: Vec<Wanted> = wanted.collect();
    let mut topics = BTreeSet::new();
    if let Some(twice) = wanted.iter().find(|wanted| !topics.insert(&wanted.topic)) {
        return Err(LogError::NamedTwice { file: file.to_owned(), topic: twice.topic.clone() });
    }
    Ok(wanted)
}

/// Checks that each wanted topic is in some file of its side.
fn require(side: Side, wanted: &[Wanted], parts: &[Part<'_, '_>]) -> Result<(), LogError> {
    let of_side = || parts.iter().filter(|part| part.sides.contains(&side));
    let missing = |wanted: &&Wanted| !of_side().any(|part| part.streams.has(&wanted.topic));
    wanted.iter().find(missing).map_or(Ok(()), |missing| {
        Err(unknown_topic(of_side().map(|part| &part.read_summary), &missing.topic))
    })
}

fn unknown_topic<'a>(summaries: impl Iterator<Item = &'a ReadSummary>, topic: &str) -> LogError {
    let (mut seen, mut topics) = (BTreeSet::new(), Vec::new());
    let (mut files, mut places) = (Vec::new(), 0);
    for read_summary in summaries {
        files.push(read_summary.file.clone());
        places += read_summary.rejects.len();
        for channel in &read_summary.channels {
            if seen.insert(&channel.topic) && seen.len() <= MOST_TOPICS {
                let name: String = channel.topic.chars().take(LONGEST_TOPIC).collect();
                topics.push(format!("{name:?}"));
            }
        }
    }
    if seen.len() > MOST_TOPICS {
        topics.push(format!("and {} more", seen.len() - MOST_TOPICS));
    }
    let damage = match places {
        0 => String::new(),
        n => format!(
            " (the log is damaged in {n} places, so topics may be missing; see `posegrid inspect`)"
        ),
    };
    LogError::UnknownTopic {
        file: files.join(", "),
        topic: topic.to_owned(),
        topics: if topics.is_empty() { "none".to_owned() } else { topics.join(", ") },
        damage,
    }
}

/// Moves the metadata records of a file to those of the session.
fn remember_all(
    metadata: &mut BTreeMap<String, String>,
    read_summary: &mut ReadSummary,
    role: &str,
) {
    for (name, key, value) in std::mem::take(&mut read_summary.metadata) {
        remember(metadata, &format!("{name}.{key}"), value, role);
    }
}

/// A key with another value in a later file gets that file's role as a suffix, and a number if needed.
fn remember(metadata: &mut BTreeMap<String, String>, key: &str, value: String, role: &str) {
    let names = std::iter::once(key.to_owned())
        .chain(std::iter::once(format!("{key} ({role})")))
        .chain((2..).map(|number| format!("{key} ({role} {number})")));
    for name in names {
        match metadata.get(&name) {
            Some(known) if *known == value => return,
            Some(_) => {}
            None => {
                metadata.insert(name, value);
                return;
            }
        }
    }
}

fn count(part: &Part<'_, '_>, counts: &mut BTreeMap<String, u64>) {
    let Part { role, read_summary, streams, .. } = part;
    let mut count = |name: String, count: u64| {
        *counts.entry(name).or_default() += count;
    };
    count(format!("{role}.files"), 1);
    count(format!("{role}.bytes"), read_summary.bytes);
    count(format!("{role}.bytes_lost"), read_summary.bytes_lost());
    let cut = read_summary.ending == Ending::Cut;
    count(format!("{role}.files_cut"), u64::from(cut));
    count(format!("{role}.chunks"), read_summary.chunks.values().sum());
    count(format!("{role}.chunks_unchecked"), read_summary.chunks_unchecked);
    count(format!("{role}.messages"), read_summary.messages);
    count(format!("{role}.messages_outside_chunks"), read_summary.messages_outside_chunks);
    count(format!("{role}.messages_lost"), read_summary.messages_lost);
    for wanted in &streams.wanted {
        if let Some(lost) = read_summary.lost_of.get(&wanted.topic) {
            count(format!("{}.messages_lost", wanted.stream.name()), *lost);
        }
    }
    for (stream, messages) in &streams.messages {
        count(format!("{}.messages", stream.name()), *messages);
        let undecoded = streams.undecoded.get(stream).copied().unwrap_or(0);
        count(format!("{}.rejected", stream.name()), undecoded);
    }
    count("joints.not_of_arm".to_owned(), streams.not_of_arm);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_key_in_several_files_keeps_every_value() {
        let mut metadata = BTreeMap::new();
        for (value, role) in [
            ("a", "controller"),
            ("b", "controller"),
            ("c", "controller"),
            ("a", "tracker"),
            ("d", "tracker"),
        ] {
            remember(&mut metadata, "k", value.to_owned(), role);
        }
        let found: Vec<_> = metadata.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
        assert_eq!(
            found,
            [("k", "a"), ("k (controller 2)", "c"), ("k (controller)", "b"), ("k (tracker)", "d")]
        );
    }

    #[test]
    fn a_file_on_both_sides_is_read_once() {
        let path = Path::new("Cargo.toml");
        let other = Path::new("log/../Cargo.toml");
        let files = SessionLogs::of_two(path, other).files();
        assert_eq!(files.len(), 1);
        assert_eq!(files[0].role(), "log");
    }
}
