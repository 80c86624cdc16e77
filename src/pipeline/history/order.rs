//! The runs that take part, and their order.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use super::rows::{Fact, Kind, Row};
use super::{Asked, HistoryError, LeftOut, Reason};

/// The row of a current run.
pub(super) struct CurrentRow {
    /// Its file.
    pub(super) place: PathBuf,
    /// BLAKE3 of the file.
    pub(super) digest: String,
    /// Contents of the row.
    pub(super) fact: Fact,
}

/// The current run of each session in order, and the runs left out.
pub(super) fn current(rows: Vec<Row>) -> (Vec<CurrentRow>, Vec<LeftOut>) {
    let (kept, mut left_out) = readable(rows);
    let last = last_of_each(&kept);
    let mut current = Vec::new();
    for row in kept {
        let is_last = last.get(&row.fact.key.session) == Some(&row.fact.key.run);
        let reason = match row.fact.kind {
            Kind::Plan => Reason::Plan,
            Kind::Pooled => Reason::Pooled,
            Kind::Session if is_last && row.fact.measured_at_ns.is_none() => {
                let session = &row.fact.key.session;
                Reason::Unreadable(format!("session {session}: its table clocks is gone"))
            }
            Kind::Session if is_last => {
                current.push(row);
                continue;
            }
            Kind::Session => Reason::Replaced,
        };
        left_out.push(row.left_out(reason));
    }
    current.sort_by(|a, b| {
        let [a, b] = [a, b].map(|row| (row.fact.measured_at_ns, &row.fact.key.session));
        a.cmp(&b)
    });
    (current, left_out)
}

/// The readable rows, and the others as left out.
fn readable(rows: Vec<Row>) -> (Vec<CurrentRow>, Vec<LeftOut>) {
    let (mut kept, mut left_out) = (Vec::new(), Vec::new());
    for Row {
        place,
        digest,
        fact,
        ..
    } in rows
    {
        match fact {
            Ok(fact) => kept.push(CurrentRow {
                place,
                digest,
                fact,
            }),
            Err(reason) => left_out.push(LeftOut {
                place,
                key: None,
                reason: Reason::Unreadable(reason),
            }),
        }
    }
    (kept, left_out)
}

/// The current run of each session. Where two machines wrote at once several runs are replaced by none: the last by name
/// counts.
fn last_of_each(rows: &[CurrentRow]) -> BTreeMap<String, String> {
    let replaced: BTreeSet<(&str, &str)> = rows
        .iter()
        .filter_map(|row| Some((row.fact.key.session.as_str(), row.fact.replaces.as_deref()?)))
        .collect();
    let mut last: BTreeMap<String, String> = BTreeMap::new();
    for key in rows.iter().map(|row| &row.fact.key) {
        if !replaced.contains(&(key.session.as_str(), key.run.as_str())) {
            let own = last.entry(key.session.clone()).or_default();
            *own = std::mem::take(own).max(key.run.clone());
        }
    }
    last
}

impl CurrentRow {
    /// The row as a run that takes no part.
    pub(super) fn left_out(self, reason: Reason) -> LeftOut {
        LeftOut {
            place: self.place,
            key: Some(self.fact.key),
            reason,
        }
    }
}

/// The rows from `since` to `until`; the others are left out.
pub(super) fn within(
    rows: Vec<CurrentRow>,
    asked: &Asked,
    robot: &str,
    left_out: &mut Vec<LeftOut>,
) -> Result<Vec<CurrentRow>, HistoryError> {
    let place = |session: &String| {
        let found = rows.iter().position(|row| row.fact.key.session == *session);
        found.ok_or_else(|| HistoryError::NoSession {
            robot: robot.to_owned(),
            session: session.clone(),
        })
    };
    let first = asked.since.as_ref().map(place).transpose()?.unwrap_or(0);
    let last = asked.until.as_ref().map(place).transpose()?;
    let last = last.unwrap_or(usize::MAX);
    let (mut kept, mut number) = (Vec::new(), 0..);
    for row in rows {
        if number
            .next()
            .is_some_and(|number| (first..=last).contains(&number))
        {
            kept.push(row);
        } else {
            left_out.push(row.left_out(Reason::NotAsked));
        }
    }
    Ok(kept)
}
