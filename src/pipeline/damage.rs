//! Damage of logs and rejected messages, held against what the pipeline file allows.
//!
//! Damage is bytes that cannot be read: of each log more than `max_lost_share` of them leave the session without a result.
//! Rejects are messages that were read and cannot be used: of each topic more than `max_rejected_share` of them leave a
//! result that does not count as good.

use std::collections::BTreeMap;

use serde::Deserialize;
use thiserror::Error;

/// What a session's logs are called in its counts.
const LOGS: [(&str, &str); 3] = [
    ("controller", "the controller's log"),
    ("tracker", "the tracker's log"),
    ("log", "the log"),
];

/// More of a log is lost than the pipeline file allows.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "{log}: {lost} of {bytes} bytes were lost to damage ({:.2} %), more than [input] max_lost_share = {allowed} allows; \
     `posegrid inspect` shows where",
    percent(*lost, *bytes)
)]
pub struct DamageError {
    log: &'static str,
    lost: u64,
    bytes: u64,
    allowed: f64,
}

/// Bytes lost and bytes in all of each of a session's logs.
fn lost(counts: &BTreeMap<String, u64>) -> impl Iterator<Item = (&'static str, u64, u64)> {
    LOGS.into_iter().filter_map(|(role, log)| {
        let bytes = *counts.get(&format!("{role}.bytes"))?;
        let lost = counts.get(&format!("{role}.bytes_lost")).copied();
        Some((log, lost.unwrap_or(0), bytes))
    })
}

/// Refuses a session of which one log lost more than a share of its bytes.
pub fn within(counts: &BTreeMap<String, u64>, allowed: f64) -> Result<(), DamageError> {
    let beyond = |(_, lost, bytes): &(_, u64, u64)| *lost as f64 > allowed * *bytes as f64;
    match self::lost(counts).find(beyond) {
        None => Ok(()),
        Some((log, lost, bytes)) => Err(DamageError {
            log,
            lost,
            bytes,
            allowed,
        }),
    }
}

/// What a session's logs lost, in a line for each that lost something or does not end as it should.
pub fn words(session: &str, counts: &BTreeMap<String, u64>) -> Vec<String> {
    let cut = |(role, log)| {
        let cut = counts
            .get(&format!("{role}.files_cut"))
            .is_some_and(|files| *files > 0);
        cut.then(|| {
            format!(
                "{session}: {log} ends too early: what its recorder did not write cannot be known"
            )
        })
    };
    let damaged = lost(counts).filter(|(_, lost, _)| *lost > 0);
    let damaged = damaged.map(|(log, lost, bytes)| {
        format!(
            "{session}: {log} is damaged: {lost} of {bytes} bytes lost ({:.2} %); the table rejects tells where",
            percent(lost, bytes)
        )
    });
    damaged.chain(LOGS.into_iter().filter_map(cut)).collect()
}

/// One entry of the counts in a row of `runs`.
#[derive(Debug, Deserialize)]
struct Counted {
    stage: String,
    of: String,
    read: u64,
    kept: u64,
}

/// Topics of which more messages were rejected than a share, in words; `counts` as a row of `runs` has them.
pub fn rejected_beyond(counts: &str, allowed: f64) -> Vec<String> {
    let counts: Vec<Counted> = serde_json::from_str(counts).unwrap_or_default();
    let beyond = |counted: &&Counted| {
        let rejected = counted.read.saturating_sub(counted.kept);
        counted.stage == "ingest" && rejected as f64 > allowed * counted.read as f64
    };
    let words = |Counted { of, read, kept, .. }: &Counted| {
        let rejected = read - kept;
        format!(
            "{rejected} of {read} {of} were rejected ({:.2} %), more than [input] max_rejected_share = {allowed} allows; \
             the table rejects tells why",
            percent(rejected, *read)
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
        // A hundredth of the tracker's 1000 bytes, whatever the controller's log is.
        assert_eq!(within(&counts(10), 0.01), Ok(()));
        let error = within(&counts(11), 0.01).unwrap_err().to_string();
        assert!(
            error.contains("tracker") && error.contains("11 of 1000 bytes"),
            "{error}"
        );
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
        let counts = r#"[{"stage": "ingest", "of": "joint messages", "read": 100, "kept": 95, "rejected": {"x": 5}},
            {"stage": "ingest", "of": "reading messages", "read": 100, "kept": 94, "rejected": {"x": 6}},
            {"stage": "join", "of": "readings", "read": 94, "kept": 3, "rejected": {"moving": 91}}]"#;
        let beyond = rejected_beyond(counts, 0.05);
        assert_eq!(beyond.len(), 1, "{beyond:?}");
        assert!(
            beyond[0].starts_with("6 of 100 reading messages"),
            "{beyond:?}"
        );
    }
}
