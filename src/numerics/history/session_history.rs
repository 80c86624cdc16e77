//! The state between sessions: the pool, the references of base and target, and the charts.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::compare::{Comparison, Shift};
use super::control::{Chart, Charted};
use super::estimate::{Column, Estimate};
use super::hypotheses::{Finding, Hypothesis, find, hypotheses};
use super::notice::Noticed;
use super::{Basis, Judged, SET_UP_ANEW, SessionFigures};
use crate::kinematics::Parameter;

/// The state after all sessions so far that the next one needs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct SessionHistory {
    segment: usize,
    basis: Option<Basis>,
    /// The sum of all sessions, of each part since it last moved.
    pool: Option<Estimate>,
    pooled: usize,
    /// The pool before a change that is not confirmed yet, its number of sessions, and the parts that may have moved.
    before: Option<(Estimate, usize, Vec<Hypothesis>)>,
    first: Option<Estimate>,
    set_up: BTreeMap<Hypothesis, Estimate>,
    charts: BTreeMap<String, Chart>,
}

impl SessionHistory {
    pub fn next(&mut self, session: &SessionFigures) -> Judged {
        let began = self.turn_to(&session.basis);
        let own = &session.estimate;
        let mut judged = match self.pool.take() {
            None => {
                self.pool = Some(own.clone());
                self.pooled = 1;
                self.first = Some(own.clone());
                Judged::default()
            }
            Some(pool) => self.held_against(pool, own, session.noticed.as_ref()),
        };
        judged.segment = self.segment;
        judged.began = began;
        judged.least_mm = session.noticed.as_ref().map(|own| own.least_mm);
        judged.charted = self.chart(session);
        judged
    }

    /// Begins a new segment where the basis differs; returns the differences.
    fn turn_to(&mut self, basis: &Basis) -> Vec<String> {
        let began = match &self.basis {
            Some(own) if own == basis => return Vec::new(),
            Some(own) => own.differences(basis),
            None => Vec::new(),
        };
        *self = Self { segment: self.segment + 1, basis: Some(basis.clone()), ..Self::default() };
        began
    }

    fn held_against(
        &mut self,
        pool: Estimate,
        own: &Estimate,
        noticed: Option<&Noticed>,
    ) -> Judged {
        let (pool, against, settles) = self.settled(pool, own, noticed);
        let (known, anew) = without_parts_set_up_anew(&pool, own);
        let judged = tested(&Comparison::new(&known, own), noticed);
        let moved = judged.finding.parts();
        let kept = forgetting(&known, &moved);
        let is_all = moved.contains(&Hypothesis::Anything);
        self.before = (!moved.is_empty()).then(|| (known.clone(), against, moved));
        self.pooled = if is_all { 1 } else { against + 1 };
        self.pool = Some(kept.plus(own));
        self.refer(&anew, own);
        Judged { against, set_up_anew: anew, settles, ..judged }
    }

    /// The pool to compare with, its number of sessions, and whether the change before this session lasts.
    fn settled(
        &mut self,
        pool: Estimate,
        own: &Estimate,
        noticed: Option<&Noticed>,
    ) -> (Estimate, usize, Option<bool>) {
        let Some((before, count, moved)) = self.before.take() else {
            return (pool, self.pooled, None);
        };
        let found = |pool: &Estimate| {
            let (known, _) = without_parts_set_up_anew(pool, own);
            tested(&Comparison::new(&known, own), noticed).finding
        };
        let shows_change = |found: &Finding| {
            let has = |parts: &[Hypothesis], column| parts.iter().any(|part| part.has(column));
            own.columns.iter().any(|column| has(&moved, column) && has(&found.parts(), column))
        };
        // Another change may come in the session in which this one is gone.
        let since = found(&before);
        let is_other = || !shows_change(&since) && shows_change(&found(&pool));
        if since == Finding::Nothing || is_other() {
            (before, count, Some(false))
        } else {
            (pool, self.pooled, Some(true))
        }
    }

    fn chart(&mut self, session: &SessionFigures) -> Vec<Charted> {
        let mut charted = Vec::new();
        let noticed = session.noticed.as_ref();
        for shift in self.since_first(&session.estimate) {
            let name = shift.column.to_string();
            let chart = self.charts.entry(name.clone()).or_default();
            let least = noticed.map_or(0.0, |own| own.least(shift.column));
            charted.push(chart.next(&name, shift.value, Some(shift.sd), least));
        }
        let least_mm = noticed.map_or(0.0, |own| own.least_mm);
        for figure in &session.accuracy {
            let chart = self.charts.entry(figure.name.clone()).or_default();
            charted.push(chart.next(&figure.name, figure.value, None, least_mm));
        }
        charted
    }

    /// Shifts of base, target and joints since the first session, or since base or target was set up anew.
    fn since_first(&self, own: &Estimate) -> Vec<Shift> {
        let is_own = |reference: &Estimate| reference == own;
        let Some(first) = self.first.as_ref().filter(|first| !is_own(first)) else {
            return Vec::new();
        };
        let is_anew = |shift: &Shift| self.set_up.keys().any(|part| part.has(&shift.column));
        let mut since = since(first, own);
        since.retain(|shift| !is_anew(shift));
        for (part, reference) in self.set_up.iter().filter(|(_, reference)| !is_own(reference)) {
            let shifts = self::since(reference, own).into_iter();
            since.extend(shifts.filter(|shift| part.has(&shift.column)));
        }
        since.sort_by_key(|shift| shift.column);
        since
    }

    fn refer(&mut self, anew: &[Hypothesis], own: &Estimate) {
        for part in anew {
            self.set_up.insert(*part, own.clone());
            let prefix = format!("{}_", part.word());
            self.charts.retain(|name, _| !name.starts_with(&prefix));
        }
    }
}

pub fn between(earlier: &Estimate, later: &Estimate) -> Judged {
    SessionHistory::default().held_against(earlier.clone(), later, None)
}

fn without_parts_set_up_anew(pool: &Estimate, own: &Estimate) -> (Estimate, Vec<Hypothesis>) {
    let base = own.base_is_far_from(pool, SET_UP_ANEW).then_some(Hypothesis::Base);
    let target = own.target_is_far_from(pool, SET_UP_ANEW).then_some(Hypothesis::Target);
    let anew: Vec<Hypothesis> = base.into_iter().chain(target).collect();
    (forgetting(pool, &anew), anew)
}

fn forgetting(pool: &Estimate, parts: &[Hypothesis]) -> Estimate {
    if parts.contains(&Hypothesis::Anything) {
        return pool.without(|_| true);
    }
    pool.without(|column| parts.iter().any(|part| part.has(column)))
}

/// The tests of every hypothesis, and what moved: by as much as counts, with its shifts, and by less.
fn tested(comparison: &Comparison, noticed: Option<&Noticed>) -> Judged {
    let (asked, found) = find(comparison, &hypotheses(&comparison.columns));
    let named = found.named();
    let mut shifts = comparison.shifts(|column| named.iter().any(|part| part.has(column)));
    let of = |part: Hypothesis| shifts.iter().filter(move |own| part.has(&own.column));
    let is_small = |part| noticed.is_some_and(|own| own.size_mm(of(part)) < own.least_mm);
    let (finding, small) = found.without(is_small);
    let named = finding.named();
    shifts.retain(|own| {
        named.iter().any(|part| part.has(&own.column)) && !named.contains(&Hypothesis::Anything)
    });
    Judged { asked, finding, small, moved: shifts, ..Judged::default() }
}

/// Shifts of base, target and joint offsets since another session, all estimated together. The first joint's offset acts as
/// a turn of the base and the last joint's as a turn of the target, so those two are charted there.
fn since(first: &Estimate, own: &Estimate) -> Vec<Shift> {
    let (known, _) = without_parts_set_up_anew(first, own);
    let comparison = Comparison::new(&known, own);
    let last = comparison.columns.iter().filter_map(Column::joint).max();
    let charted = |column: &Column| match column {
        Column::Chain(Parameter::Base(_)) => known.base.is_some(),
        Column::Chain(Parameter::Target(_)) => known.target.is_some(),
        _ => column.zero_of().is_some_and(|joint| joint > 1 && Some(joint) != last),
    };
    comparison.shifts(charted)
}
