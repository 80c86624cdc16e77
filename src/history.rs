//! History: the sessions of one robot in order → what changed between them, and whether it is within its control limits.
//!
//! Input is one [`SessionFigures`] after another: what the session identified ([`Estimate`]) and its accuracy figures.
//! Output is a [`Judged`] for each. Steps of [`Course::next`]:
//! 1. Another nominal arm, pipeline file, setting, version or model begins a new segment ([`Basis`]): nothing is compared across.
//! 2. The session is held against all sessions before it, pooled, with the covariances of both ([`Comparison`]). What one of
//!    them cannot determine takes no part, so priors and choices of datum cannot show as a change.
//! 3. Each part that may have moved is asked what its change alone explains ([`suspects`]). The smallest p-value times the
//!    number of suspects, held against [`FALSE_ALARM`], is the alarm; then parts are named, or groups of parts
//!    that cannot be told apart.
//! 4. What moved is forgotten in the pool. The next session tells whether the change lasts: where that agrees with
//!    the pool as it was, the change was of one session alone.
//! 5. Base, target and joints since the first session, and the accuracy figures, go on control charts ([`control`]) that
//!    learn the ordinary spread between sessions from the sessions themselves. The test of step 3 asks whether something
//!    is not where it was, the charts whether that is more than usual.

mod bits;
pub mod compare;
pub mod control;
pub mod estimate;
pub mod suspects;
mod words;

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::kinematics::{LinkQuantity, Parameter};
use compare::{Comparison, Shift};
use control::{Chart, Charted};
use estimate::{Column, Estimate};
use suspects::{Asked, Finding, Suspect, find, suspects};

/// Probability that a session without any change is said to have one: one false alarm in 1000 sessions at most.
pub const FALSE_ALARM: f64 = 1e-3;
/// From here on a base or a target is set up anew, mm and mrad: not a change of what stood there before.
pub const SET_UP_ANEW: f64 = 10.0;

/// What makes the figures of two sessions comparable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Basis {
    /// Name of the pipeline file.
    pub pipeline: String,
    /// Version of the program.
    pub version: String,
    /// Digest of the robot file: the nominal arm.
    pub robot_file: String,
    /// Digest of all settings.
    pub settings: String,
    /// The model that identified the arm: `full` or `geometric`.
    pub model: String,
}

/// One accuracy figure.
#[derive(Debug, Clone, PartialEq)]
pub struct AccuracyFigure {
    /// Its name among the charts.
    pub name: String,
    /// Its value.
    pub value: f64,
}

/// What one session says.
#[derive(Debug, Clone, PartialEq)]
pub struct SessionFigures {
    /// What it can be compared with.
    pub basis: Basis,
    /// What it identified.
    pub estimate: Estimate,
    /// Its accuracy figures.
    pub accuracy: Vec<AccuracyFigure>,
}

/// What the history says of one session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// The segment, from 1.
    pub segment: usize,
    /// What began the segment, in words; empty where it goes on, or is the first.
    pub began: Vec<String>,
    /// Sessions pooled that it was held against; 0 for the first of a segment.
    pub against: usize,
    /// Parts that were set up anew.
    pub set_up_anew: Vec<Suspect>,
    /// What each suspect explains.
    pub asked: Vec<Asked>,
    /// What moved.
    pub finding: Finding,
    /// How far, of the parts named; of the first of those that cannot be told apart.
    pub moved: Vec<Shift>,
    /// What this session says of a change that the session before it showed: whether it lasts.
    pub settles: Option<bool>,
    /// What was charted.
    pub charted: Vec<Charted>,
}

/// The sessions so far, as far as the next one needs them.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Course {
    segment: usize,
    basis: Option<Basis>,
    /// All sessions since each part last moved.
    pool: Option<Estimate>,
    pooled: usize,
    /// The pool before a change that is not settled yet.
    before: Option<(Estimate, usize)>,
    /// The first session of the segment.
    first: Option<Estimate>,
    /// The session in which base or target was set up anew last.
    set_up: BTreeMap<Suspect, Estimate>,
    charts: BTreeMap<String, Chart>,
}

impl Course {
    /// Judges the next session.
    pub fn next(&mut self, session: &SessionFigures) -> Judged {
        let began = self.turn_to(&session.basis);
        let own = &session.estimate;
        let mut judged = match self.pool.take() {
            None => {
                self.pool = Some(own.clone());
                self.pooled = 1;
                self.first = Some(own.clone());
                Judged::first()
            }
            Some(pool) => self.held_against(pool, own),
        };
        judged.segment = self.segment;
        judged.began = began;
        judged.charted = self.chart(session);
        judged
    }

    /// Begins a new segment where the basis is another; gives what differs.
    fn turn_to(&mut self, basis: &Basis) -> Vec<String> {
        let began = match &self.basis {
            Some(own) if own == basis => return Vec::new(),
            Some(own) => own.differences(basis),
            None => Vec::new(),
        };
        *self = Self {
            segment: self.segment + 1,
            basis: Some(basis.clone()),
            ..Self::default()
        };
        began
    }

    fn held_against(&mut self, pool: Estimate, own: &Estimate) -> Judged {
        let (pool, against, settles) = self.settled(pool, own);
        let (known, anew) = without_what_is_new(&pool, own);
        let comparison = Comparison::new(&known, own);
        let groups = suspects(comparison.columns());
        let (asked, finding) = find(&comparison, &groups);
        let moved = finding.parts();
        let kept = forgetting(&known, &moved);
        self.before = (!moved.is_empty()).then(|| (known.clone(), against));
        let is_all = moved.contains(&Suspect::Anything);
        self.pooled = if is_all { 1 } else { against + 1 };
        self.pool = Some(kept.plus(own));
        self.refer(&anew, own);
        Judged {
            segment: 0,
            began: Vec::new(),
            against,
            set_up_anew: anew,
            asked,
            moved: moved_by(&comparison, &finding),
            finding,
            settles,
            charted: Vec::new(),
        }
    }

    /// The pool to compare with, once the session has told whether the change before it lasts.
    fn settled(&mut self, pool: Estimate, own: &Estimate) -> (Estimate, usize, Option<bool>) {
        let Some((before, count)) = self.before.take() else {
            return (pool, self.pooled, None);
        };
        let (known, _) = without_what_is_new(&before, own);
        let comparison = Comparison::new(&known, own);
        let (_, finding) = find(&comparison, &suspects(comparison.columns()));
        if finding == Finding::Nothing {
            (before, count, Some(false))
        } else {
            (pool, self.pooled, Some(true))
        }
    }

    fn chart(&mut self, session: &SessionFigures) -> Vec<Charted> {
        let mut charted = Vec::new();
        for Shift { column, value, sd } in self.since_first(&session.estimate) {
            let name = column.to_string();
            let chart = self.charts.entry(name.clone()).or_default();
            charted.push(chart.next(&name, value, Some(sd)));
        }
        for figure in &session.accuracy {
            let chart = self.charts.entry(figure.name.clone()).or_default();
            charted.push(chart.next(&figure.name, figure.value, None));
        }
        charted
    }

    /// How far base, target and joints stand from the first session, or from where base or target were set up anew.
    fn since_first(&self, own: &Estimate) -> Vec<Shift> {
        let is_own = |reference: &Estimate| reference == own;
        let Some(first) = self.first.as_ref().filter(|first| !is_own(first)) else {
            return Vec::new();
        };
        let is_anew = |shift: &Shift| self.set_up.keys().any(|part| part.has(&shift.column));
        let mut since = since(first, own);
        since.retain(|shift| !is_anew(shift));
        for (part, reference) in self
            .set_up
            .iter()
            .filter(|(_, reference)| !is_own(reference))
        {
            let shifts = self::since(reference, own).into_iter();
            since.extend(shifts.filter(|shift| part.has(&shift.column)));
        }
        since.sort_by_key(|shift| shift.column);
        since
    }

    /// Base or target that stand elsewhere are charted anew from here.
    fn refer(&mut self, anew: &[Suspect], own: &Estimate) {
        for part in anew {
            self.set_up.insert(*part, own.clone());
            let prefix = format!("{}_", part.word());
            self.charts.retain(|name, _| !name.starts_with(&prefix));
        }
    }
}

impl Judged {
    /// The figures whose moving average is beyond its limit.
    pub fn out_of_control(&self) -> impl Iterator<Item = &str> {
        let out = self
            .charted
            .iter()
            .filter(|charted| charted.is_out() == Some(true));
        out.map(|charted| charted.name.as_str())
    }

    fn first() -> Self {
        Self {
            segment: 0,
            began: Vec::new(),
            against: 0,
            set_up_anew: Vec::new(),
            asked: Vec::new(),
            finding: Finding::Nothing,
            moved: Vec::new(),
            settles: None,
            charted: Vec::new(),
        }
    }
}

impl Basis {
    /// What differs, in words.
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let named = |what: &str, a: &str, b: &str| (a != b).then(|| format!("{what} {a} → {b}"));
        let digests = |what: &str, a: &str, b: &str| (a != b).then(|| what.to_owned());
        [
            named("pipeline file", &self.pipeline, &other.pipeline),
            named("version", &self.version, &other.version),
            digests("robot file", &self.robot_file, &other.robot_file),
            digests("settings", &self.settings, &other.settings),
            named("model", &self.model, &other.model),
        ]
        .into_iter()
        .flatten()
        .collect()
    }
}

/// The pool without base or target where those stand elsewhere in this session, and which.
fn without_what_is_new(pool: &Estimate, own: &Estimate) -> (Estimate, Vec<Suspect>) {
    let anew: Vec<Suspect> = [Suspect::Base, Suspect::Target]
        .into_iter()
        .filter(|suspect| own.is_far_from(pool, *suspect, SET_UP_ANEW))
        .collect();
    (forgetting(pool, &anew), anew)
}

/// The pool without what it knows of these parts.
fn forgetting(pool: &Estimate, parts: &[Suspect]) -> Estimate {
    if parts.contains(&Suspect::Anything) {
        return pool.without(|_| true);
    }
    pool.without(|column| parts.iter().any(|part| part.has(column)))
}

/// How far the parts named have moved, all at once.
fn moved_by(comparison: &Comparison, finding: &Finding) -> Vec<Shift> {
    let named = finding.named();
    let places = comparison.places(|column| {
        named.iter().any(|part| part.has(column)) && !named.contains(&Suspect::Anything)
    });
    comparison.explained(&places).shifts(comparison, &places)
}

/// Base, target and joint offsets against another session, all free at once. The first joint's offset is the base's turn
/// about its axis, the last joint's the target's: those are charted there.
fn since(first: &Estimate, own: &Estimate) -> Vec<Shift> {
    let (known, _) = without_what_is_new(first, own);
    let comparison = Comparison::new(&known, own);
    let last = comparison.columns().iter().filter_map(Column::joint).max();
    let charted = |column: &Column| match column {
        Column::Chain(Parameter::Base(_)) => known.has_base(),
        Column::Chain(Parameter::Target(_)) => known.has_target(),
        Column::Chain(Parameter::Link { joint, quantity }) => {
            *quantity == LinkQuantity::Theta && *joint > 1 && Some(*joint) != last
        }
        Column::Gravity(_) | Column::Curve { .. } => false,
    };
    let places = comparison.places(charted);
    comparison.explained(&places).shifts(&comparison, &places)
}

/// `A⁺` of a symmetric positive semidefinite matrix over its eigenvalues above `least`, and how many those are.
pub(crate) fn inverse_above(matrix: &DMatrix<f64>, least: f64) -> (DMatrix<f64>, usize) {
    let size = matrix.nrows();
    if size == 0 {
        return (matrix.clone(), 0);
    }
    let eigen = matrix.clone().symmetric_eigen();
    let mut inverse = DMatrix::zeros(size, size);
    let mut rank = 0;
    for (value, vector) in eigen
        .eigenvalues
        .iter()
        .zip(eigen.eigenvectors.column_iter())
    {
        if *value > least {
            inverse.ger(value.recip(), &vector, &vector, 1.0);
            rank += 1;
        }
    }
    (inverse, rank)
}
