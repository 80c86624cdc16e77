//! Damage of logs and rejected messages, compared with the limits of the pipeline file.
//!
//! Damage is bytes that cannot be read, and messages that are known to be lost: with those bytes, or because the log's own
//! summary counts them and they are not there. More than `max_lost_share` of a log's bytes or messages, or of the messages
//! of one topic that the pipeline file names, leave the session without a result. Rejects are messages that were read and
//! cannot be used: more than `max_rejected_share` of a topic's messages give a result that does not count as good.

use std::collections::BTreeMap;

use serde::Deserialize;
use thiserror::Error;

use crate::io::tables::counts::{HELD, NOT_OF_ARM, REPEATED, SECOND, UNUSABLE};
use crate::join::Unmeasured;

/// Names of a session's logs in its counts and in messages.
const LOGS: [(&str, &str); 3] =
    [("controller", "the controller's log"), ("tracker", "the tracker's log"), ("log", "the log")];

/// Names of the topics of the pipeline file, in counts and in messages.
const STREAMS: [(&str, &str); 4] = [
    ("joints", "the joint states"),
    ("commands", "the commanded poses"),
    ("readings", "the tracker's readings"),
    ("temperatures", "the temperatures"),
];

/// More of a log is lost than the pipeline file allows.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "{}, more than [input] max_lost_share = {allowed} allows; `posegrid inspect` shows where", .loss.words()
)]
pub struct DamageError {
    loss: Loss,
    allowed: f64,
}

#[derive(Debug, Clone, PartialEq)]
struct Loss {
    of: &'static str,
    unit: &'static str,
    lost: u64,
    all: u64,
}

impl Loss {
    fn words(&self) -> String {
        let Self { of, unit, lost, all } = self;
        let cause = if *unit == "bytes" { "lost to damage" } else { "lost" };
        format!("{of}: {lost} of {all} {unit} were {cause}{}", share(*lost, *all))
    }

    fn is_beyond(&self, allowed: f64) -> bool {
        self.lost as f64 > allowed * self.all as f64
    }
}

/// Lost bytes and all bytes of each of a session's logs.
fn bytes(counts: &BTreeMap<String, u64>) -> impl Iterator<Item = Loss> {
    LOGS.into_iter().filter_map(|(role, of)| {
        let all = *counts.get(&format!("{role}.bytes"))?;
        let lost = counts.get(&format!("{role}.bytes_lost")).copied();
        Some(Loss { of, unit: "bytes", lost: lost.unwrap_or(0), all })
    })
}

/// Lost messages and all messages of each log and of each topic that is read, as far as they are counted.
fn messages(counts: &BTreeMap<String, u64>) -> impl Iterator<Item = Loss> {
    LOGS.into_iter().chain(STREAMS).filter_map(|(name, of)| {
        let count = |what: &str| counts.get(&format!("{name}.{what}")).copied();
        let lost = count("messages_lost")?;
        let all = lost.saturating_add(count("messages").unwrap_or(0));
        Some(Loss { of, unit: "messages", lost, all })
    })
}

/// Refuses a session in which one log lost more than this share of its bytes or messages, or of those of one topic.
pub fn within(counts: &BTreeMap<String, u64>, allowed: f64) -> Result<(), DamageError> {
    let mut losses = bytes(counts).chain(messages(counts));
    match losses.find(|loss| loss.is_beyond(allowed)) {
        None => Ok(()),
        Some(loss) => Err(DamageError { loss, allowed }),
    }
}

/// The smallest length, mm, and the smallest share, %, that two decimals do not show as 0.00.
pub(super) const NOTHING: f64 = 0.005;

/// The share in brackets; empty where it would be 0.00.
fn share(part: u64, whole: u64) -> String {
    let percent = percent(part, whole);
    if percent < NOTHING { String::new() } else { format!(" ({percent:.2} %)") }
}

/// The losses of a session's logs as text: a line for each log that lost something or whose end is missing.
pub fn words(session: &str, counts: &BTreeMap<String, u64>) -> Vec<String> {
    let cut = |(role, log)| {
        let cut = counts.get(&format!("{role}.files_cut")).is_some_and(|files| *files > 0);
        cut.then(|| {
            format!("{session}: {log} ends too early: what its recorder did not write is not known")
        })
    };
    let damaged = bytes(counts).filter(|loss| loss.lost > 0);
    let damaged = damaged.map(|Loss { of, lost, all, .. }| {
        format!(
            "{session}: {of} is damaged: {lost} of {all} bytes lost{}; see table rejects",
            share(lost, all)
        )
    });
    let missing = messages(counts).filter(|loss| loss.lost > 0);
    let missing = missing.map(|loss| {
        let words = loss.words();
        format!("{session}: {words}; see table rejects")
    });
    damaged.chain(missing).chain(LOGS.into_iter().filter_map(cut)).collect()
}

/// One entry of the counts in a row of `runs`.
#[derive(Debug, Deserialize)]
struct Counted {
    stage: String,
    of: String,
    read: u64,
    kept: u64,
    rejected: BTreeMap<String, u64>,
}

impl Counted {
    /// Messages without those that nothing is wrong with.
    fn wanted(&self) -> u64 {
        let beside =
            [NOT_OF_ARM, REPEATED, SECOND, HELD].map(|name| self.rejected.get(name).copied());
        self.read.saturating_sub(beside.into_iter().flatten().sum())
    }

    /// Those with which something is wrong: of messages all, of a table's readings those that cannot be used, of dwells those whose
    /// readings contradict the arm.
    fn rejected(&self) -> u64 {
        let of_dwells = [Unmeasured::WrongTarget, Unmeasured::TargetMoved].map(Unmeasured::name);
        match (self.stage.as_str(), self.of.as_str()) {
            ("ingest", _) => self.wanted().saturating_sub(self.kept),
            ("join", "readings") => self.rejected.get(UNUSABLE).copied().unwrap_or(0),
            ("join", "dwells") => {
                of_dwells.iter().filter_map(|name| self.rejected.get(*name)).sum()
            }
            _ => 0,
        }
    }
}

/// Topics of which more than this share of messages was rejected, and dwells, as text; `counts` is in the form of a row of `runs`.
pub(super) fn rejected_beyond(counts: &str, allowed: f64) -> Vec<String> {
    let counts: Vec<Counted> = serde_json::from_str(counts).unwrap_or_default();
    let beyond = |counted: &&Counted| counted.rejected() as f64 > allowed * counted.wanted() as f64;
    let words = |counted: &Counted| {
        let (of, rejected, read) = (&counted.of, counted.rejected(), counted.wanted());
        format!(
            "{rejected} of {read} {of} were rejected ({:.2} %), more than [input] max_rejected_share = {allowed} allows; \
             see table rejects",
            percent(rejected, read)
        )
    };
    counts.iter().filter(beyond).map(words).collect()
}

fn percent(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(tracker_lost: u64) -> BTreeMap<String, u64> {
        [
            ("controller.bytes", 100_000),
            ("controller.bytes_lost", 0),
            ("tracker.bytes", 1000),
            ("tracker.bytes_lost", tracker_lost),
        ]
        .map(|(name, count)| (name.to_owned(), count))
        .into()
    }

    #[test]
    fn a_small_log_is_not_lost_among_the_bytes_of_a_large_one() {
        // A hundredth of the tracker's 1000 bytes, whatever the size of the controller's log.
        assert_eq!(within(&counts(10), 0.01), Ok(()));
        let error = within(&counts(11), 0.01).unwrap_err().to_string();
        assert!(error.contains("tracker") && error.contains("11 of 1000 bytes"), "{error}");
        assert_eq!(within(&counts(1000), 1.0), Ok(()));
        assert_eq!(words("mon", &counts(0)), Vec::<String>::new());
        assert!(words("mon", &counts(11))[0].contains("(1.10 %)"));
        let mut cut = counts(0);
        cut.insert("tracker.files_cut".to_owned(), 1);
        assert_eq!(words("mon", &cut).len(), 1);
        assert!(words("mon", &cut)[0].contains("tracker's log ends too early"));
    }

    #[test]
    fn rejected_messages_count_by_topic() {
        let counts = r#"[{"stage": "ingest", "of": "joint messages", "read": 300, "kept": 95, "rejected": {"x": 5, "repeated": 100, "not_of_arm": 100}},
            {"stage": "ingest", "of": "reading messages", "read": 100, "kept": 94, "rejected": {"x": 6}},
            {"stage": "join", "of": "readings", "read": 94, "kept": 3, "rejected": {"moving": 85, "unusable": 6}},
            {"stage": "join", "of": "dwells", "read": 100, "kept": 50, "rejected": {"no_readings": 44, "wrong_target": 6}}]"#;
        let beyond = rejected_beyond(counts, 0.05);
        assert_eq!(beyond.len(), 3, "{beyond:?}");
        assert!(beyond[2].starts_with("6 of 100 dwells were rejected"), "{beyond:?}");
        assert!(beyond[1].starts_with("6 of 94 readings were rejected"), "{beyond:?}");
        assert!(beyond[0].starts_with("6 of 100 reading messages"), "{beyond:?}");
    }
}
