//! The runs that take part, and their order.

use std::collections::BTreeMap;
use std::path::PathBuf;

use rayon::prelude::*;

use super::rows::{Fact, Kind, Row};
use super::{Asked, HistoryError, LeftOut, Reason};
use crate::io::lake::Lake;
use crate::manifest::RunKey;

pub(super) struct CurrentRow {
    pub(super) place: PathBuf,
    /// BLAKE3 of the file.
    pub(super) digest: String,
    pub(super) fact: Fact,
}

/// The current run of each session in order, and the runs left out.
pub(super) fn current(lake: &Lake, rows: Vec<Row>) -> (Vec<CurrentRow>, Vec<LeftOut>) {
    let (kept, mut left_out) = readable(rows);
    let of_each = current_of_each(lake, &kept);
    let mut current = Vec::new();
    for row in kept {
        let current_run = &of_each[&row.fact.key.session];
        let is_current = current_run.as_ref() == Ok(&row.fact.key.run);
        let reason = match row.fact.kind {
            _ if let Err(reason) = current_run => Reason::Unreadable(reason.clone()),
            Kind::Plan => Reason::Plan,
            Kind::Pooled => Reason::Pooled,
            Kind::Session if is_current && row.fact.measured_at_ns.is_none() => {
                let session = &row.fact.key.session;
                Reason::Unreadable(format!("session {session}: its table clocks is gone"))
            }
            Kind::Session if is_current => {
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

fn readable(rows: Vec<Row>) -> (Vec<CurrentRow>, Vec<LeftOut>) {
    let (mut kept, mut left_out) = (Vec::new(), Vec::new());
    for Row { place, digest, fact, .. } in rows {
        match fact {
            Ok(fact) => kept.push(CurrentRow { place, digest, fact }),
            Err(reason) => {
                left_out.push(LeftOut { place, key: None, reason: Reason::Unreadable(reason) });
            }
        }
    }
    (kept, left_out)
}

/// The current run of each session, or why it cannot be told. The only run of a session is it, without a look at the lake.
fn current_of_each(lake: &Lake, rows: &[CurrentRow]) -> BTreeMap<String, Result<String, String>> {
    let mut runs: BTreeMap<&str, Vec<&RunKey>> = BTreeMap::new();
    for key in rows.iter().map(|row| &row.fact.key) {
        runs.entry(&key.session).or_default().push(key);
    }
    let current = |(session, runs): (&str, Vec<&RunKey>)| {
        let run = match runs[..] {
            [only] => Ok(only.run.clone()),
            _ => lake.current(runs[0]).map(|own| own.map_or_else(String::new, |own| own.run)),
        };
        (session.to_owned(), run.map_err(|error| error.to_string()))
    };
    runs.into_par_iter().map(current).collect()
}

impl CurrentRow {
    /// The row as a run that takes no part.
    pub(super) fn left_out(self, reason: Reason) -> LeftOut {
        LeftOut { place: self.place, key: Some(self.fact.key), reason }
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
        let (robot, session) = (robot.to_owned(), session.clone());
        found.ok_or(HistoryError::NoSession { robot, session })
    };
    let first = asked.since.as_ref().map(place).transpose()?.unwrap_or(0);
    let last = asked.until.as_ref().map(place).transpose()?.unwrap_or(usize::MAX);
    let is_asked = |(number, _): &(usize, CurrentRow)| (first..=last).contains(number);
    let (kept, others): (Vec<_>, Vec<_>) = rows.into_iter().enumerate().partition(is_asked);
    left_out.extend(others.into_iter().map(|(_, row)| row.left_out(Reason::NotAsked)));
    Ok(kept.into_iter().map(|(_, row)| row).collect())
}
