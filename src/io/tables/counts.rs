//! The numbers of items that each stage read, kept and rejected, for the row of `runs`: read = kept + rejected.

use std::collections::BTreeMap;

use super::stations::Unpaired;
use super::validity;
use crate::ingest::covariances::COUNTED;
use crate::join::{Pairing, ReadingCounts};
use crate::judgement::{JoinedSession, Outcome};
use crate::manifest::StageCount;
use crate::report::Model;
use crate::rows::Word as _;

/// The counts of a run, over all its sessions.
pub fn counts(outcome: &Outcome<'_>) -> Vec<StageCount> {
    let sessions: Vec<&JoinedSession> = outcome.training.iter().chain(&outcome.test).collect();
    let mut counts = messages(&sessions);
    counts.extend(stated_covariances(&sessions));
    counts.push(readings(&sessions));
    counts.push(dwells(&sessions));
    counts.extend(fit(outcome));
    counts.extend(grid(outcome));
    counts
}

const STREAMS: [(&str, &str); 7] = [
    ("joints", "joint messages"),
    ("commands", "command messages"),
    ("readings", "reading messages"),
    ("temperatures", "temperature messages"),
    ("lengths", "length messages"),
    ("rows", "table rows"),
    ("references", "readings of references"),
];

/// Messages that are left out though nothing is wrong with the others: of another device on the joints' topic, logged before with equal
/// stamp and content, of a second publisher that always states the same, and of readings stated again until the instrument has the next.
pub const NOT_OF_ARM: &str = "not_of_arm";
pub const REPEATED: &str = "repeated";
pub const SECOND: &str = "second_publisher";
pub const HELD: &str = "held";
/// Readings of a table that are there and cannot be used.
pub const UNUSABLE: &str = "unusable";

/// Messages of each stream that the pipeline file maps, where logs were read.
fn messages(sessions: &[&JoinedSession]) -> Vec<StageCount> {
    let sum = |name: String| -> Option<u64> {
        let found: Vec<u64> =
            sessions.iter().filter_map(|s| s.counts.get(&name).copied()).collect();
        (!found.is_empty()).then(|| found.iter().sum())
    };
    let stream = |(stream, of): (&'static str, &'static str)| {
        Some(StageCount {
            stage: "ingest",
            of,
            read: sum(format!("{stream}.messages"))?,
            kept: sum(format!("{stream}.kept")).unwrap_or(0),
            rejected: nonzero([
                (
                    match stream {
                        "rows" => "not_usable",
                        "references" => "stray",
                        _ => "not_decoded_or_not_finite",
                    },
                    sum(format!("{stream}.rejected")).unwrap_or(0),
                ),
                (NOT_OF_ARM, sum(format!("{stream}.{NOT_OF_ARM}")).unwrap_or(0)),
                (REPEATED, sum(format!("{stream}.{REPEATED}")).unwrap_or(0)),
                (SECOND, sum(format!("{stream}.{SECOND}")).unwrap_or(0)),
                (HELD, sum(format!("{stream}.{HELD}")).unwrap_or(0)),
            ]),
        })
    };
    STREAMS.into_iter().filter_map(stream).collect()
}

/// Covariances that readings state of their positions and of their orientations: of one that is not used the instrument's stated
/// uncertainty takes the place.
fn stated_covariances(sessions: &[&JoinedSession]) -> Vec<StageCount> {
    let sum = |name: &str| -> u64 {
        let name = format!("readings.{name}");
        sessions.iter().filter_map(|own| own.counts.get(&name)).sum()
    };
    let kinds = ["stated position covariances", "stated orientation covariances"];
    let of = |(of, names): (&'static str, [&str; 4])| {
        let [read, zero, minus_one, not_positive] = names.map(sum);
        (read > 0).then(|| StageCount {
            stage: "ingest",
            of,
            read,
            kept: read - zero - minus_one - not_positive,
            rejected: nonzero([
                ("all_zero", zero),
                ("first_entry_minus_one", minus_one),
                ("not_positive_semidefinite", not_positive),
            ]),
        })
    };
    kinds.into_iter().zip(COUNTED).filter_map(of).collect()
}

fn readings(sessions: &[&JoinedSession]) -> StageCount {
    let sum =
        |of: fn(&ReadingCounts) -> u64| sessions.iter().map(|s| of(&s.joined.counts)).sum::<u64>();
    let rejected = [
        ("settling", sum(|c| c.settling)),
        ("outlier", sum(|c| c.outlier)),
        ("moving", sum(|c| c.moving)),
        ("unpaired", sum(|c| c.unpaired)),
        ("missing", sum(|c| c.missing)),
        (UNUSABLE, sum(|c| c.unusable)),
    ];
    let kept = sum(|c| c.kept);
    whole("join", "readings", kept, nonzero(rejected))
}

fn dwells(sessions: &[&JoinedSession]) -> StageCount {
    let all = || sessions.iter().flat_map(|session| &session.joined.stations);
    let mut rejected = BTreeMap::new();
    for reason in all().filter_map(|station| Unpaired::of(&station.pairing)) {
        *rejected.entry(reason.word().to_owned()).or_default() += 1;
    }
    StageCount {
        stage: "join",
        of: "dwells",
        read: all().count() as u64,
        kept: all().filter(|station| station.pairing == Pairing::Paired).count() as u64,
        rejected,
    }
}

/// Stations offered to each geometric fit, and their poses.
fn fit(outcome: &Outcome<'_>) -> Vec<StageCount> {
    // Those with readings of other targets alone count in the fit, and have no error of the tool point.
    let shown = outcome.targets.sessions.iter();
    let trained = |name: &str| outcome.training.iter().any(|session| session.name == name);
    let others: usize = shown.filter(|own| trained(&own.session)).map(|own| own.neither).sum();
    let offered = (validity::learnt_from(outcome).count() + others) as u64;
    let count = |(model, of): (Model, &'static str)| {
        let (_, calibration) = outcome.calibrations.iter().find(|(own, _)| *own == model)?;
        let kept = calibration.stations as u64;
        Some(StageCount {
            stage: "fit",
            of,
            read: offered,
            kept,
            rejected: nonzero([("not_used", offered.saturating_sub(kept))]),
        })
    };
    let models = [
        (Model::BaseTarget, "stations of the base + target model"),
        (Model::Geometric, "stations of the geometric model"),
    ];
    models.into_iter().filter_map(count).collect()
}

/// Held-out stations offered to the chosen step; `None` where no step gives a table.
fn grid(outcome: &Outcome<'_>) -> Option<StageCount> {
    let held_out = &outcome.grids.chosen()?.held_out;
    let mut rejected = nonzero([
        ("outside", held_out.outside as u64),
        ("other_orientation_or_configuration", held_out.unlike as u64),
    ]);
    for (refusal, count) in &held_out.refused {
        rejected.insert(refusal.name().to_owned(), *count as u64);
    }
    let kept = held_out.counted().visits as u64;
    Some(whole("grid", "held-out stations of the chosen step", kept, rejected))
}

/// The count of a stage that states what it kept and rejected.
fn whole(
    stage: &'static str,
    of: &'static str,
    kept: u64,
    rejected: BTreeMap<String, u64>,
) -> StageCount {
    StageCount { stage, of, read: kept + rejected.values().sum::<u64>(), kept, rejected }
}

fn nonzero<const N: usize>(counts: [(&str, u64); N]) -> BTreeMap<String, u64> {
    let some = counts.into_iter().filter(|(_, count)| *count > 0);
    some.map(|(reason, count)| (reason.to_owned(), count)).collect()
}
