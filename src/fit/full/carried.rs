//! What the sessions so far said, carried over to the next one: a session learns on top of them at its own cost.
//!
//! Rows of all sessions say what they say of the shared columns by sums ([`Sums`]) at stated noise, weights and linearisation. A
//! session's own columns (base, target, drift, scale, changes of its curves) are eliminated from them once (Schur's complement), and
//! what is left is of the size of the shared columns, however many sessions there were:
//!
//! ```text
//! A' = A_cc − A_co (A_oo + V_o⁻¹)⁻¹ A_oc          b' = b_c − A_co (A_oo + V_o⁻¹)⁻¹ b_o
//! ```
//!
//! The next session adds its rows to that and is trained like any other: its noise, weights, new gear lines and frames are its own, the
//! sizes of shared parts follow from all, and those of what belongs to one session from what each session showed of it. Priors are no
//! part of the sums, so none counts twice. This is the recursive form of least squares (Plackett 1950) of the information filter.
//!
//! On the way from one session to the next
//! 1. joints that were repaired lose curve, gear lines and zero (`repairs`);
//! 2. the curves of all others may have changed, the more the longer it is ago (`ageing`): a change `w ~ N(0, a · years ·
//!    profile)` is put in and eliminated. Its size `a` follows from what each session showed of it.
//!
//! Whether a change stays or is one session's own shows in the next session alone. So the changes of the last session's curves are carried
//! over too, and eliminated with the next: their size follows from what both sessions say of them.
//!
//! What earlier sessions said stays as it was summed: their weights, and rows evaluated at the geometry of then. An angle that moved by
//! φ since then bends a metre by `φ²/2` metres. A session's own columns were eliminated at the sizes that were known then; where these
//! have grown since by more than a factor of four, all sessions are to be learnt again with the sizes of now ([`Carried::stale`]).

mod column;
mod leaving;
mod packed;
mod places;

use std::sync::Arc;

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

use super::ageing::years_between;
use super::columns::{day_of, few_harmonics};
use super::components::{Part, Size, change_profile};
use super::layout::{Block, Layout};
use super::regression::Sums;
use super::repairs::{self, Repair};
use super::rows::Around;
use super::settings::FullSettings;
use super::spectrum::Spectra;
use crate::fit::observation::Observation;

use column::Column;
use places::Places;

/// That sessions are learnt one on top of the other, and what those so far said; none did before the first.
#[derive(Debug, Clone, Default)]
pub struct Carrying {
    /// What the sessions so far said.
    pub before: Option<Arc<Carried>>,
    /// The sizes that sessions which are learnt again have of what belongs to one session.
    pub held: Option<Arc<Sizes>>,
}

/// Sizes of parts, with what sessions showed of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Sizes(Vec<(Part, Size)>);

/// Sizes that have grown by more than this factor since sums were made are another model's: the sums promise too much. Of smaller ones they
/// say somewhat less than they could.
const STALE: f64 = 4.0;

impl Sizes {
    /// The size of a part.
    fn of(&self, part: Part) -> Option<Size> {
        let own = self.0.iter().find(|(own, _)| *own == part);
        own.map(|(_, size)| *size)
    }

    /// Those of parts that each session has of its own.
    fn of_one_session(&self) -> Self {
        let own = self.0.iter().filter(|(part, _)| part.is_of_one_session());
        Self(own.copied().collect())
    }

    pub(super) fn all(&self) -> &[(Part, Size)] {
        &self.0
    }
}

/// What some sessions said of the arm that they share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Carried {
    columns: Vec<Column>,
    /// Over `columns`, of values relative to `at`.
    sums: Sums,
    /// Value of each column that the sums are relative to: offsets of the geometry, 0 of all others.
    at: DVector<f64>,
    /// Prior variance of each column in the last session.
    variances: DVector<f64>,
    /// With that of [`Part::Ageing`], which is no part of a single session's model.
    sizes: Sizes,
    /// The sizes of what belongs to one session, with which the first of them was learnt.
    made_with: Sizes,
    /// The period of each sliding joint's curve, mm.
    slide_periods_mm: Vec<Option<f64>>,
    /// Stations over which the warm-up is told.
    span: f64,
    /// Day of the last session, days since 1970; `None` without a date.
    day: Option<f64>,
    sessions: usize,
}

/// What was carried over, as a session sees it.
#[derive(Debug, Clone)]
pub(super) struct Entered {
    /// Before the curves may have changed.
    then: Carried,
    /// Afterwards.
    now: Carried,
    /// The columns of `then` that may have changed, and the variance of the change of each.
    changes: Vec<(usize, f64)>,
}

impl Carried {
    /// Number of sessions.
    pub const fn sessions(&self) -> usize {
        self.sessions
    }

    /// The joints (from 0) that were repaired between the last session and one of this day, days since 1970; none where one has no date.
    pub fn repaired_since(&self, all: &[Repair], day: Option<f64>) -> Vec<usize> {
        repairs::between(all, self.day, day)
    }

    /// Whether sizes of what belongs to one session are much larger now than those that the sums were made with, so that all sessions are to
    /// be learnt again with those of now ([`Self::held`]).
    pub fn stale(&self) -> bool {
        let moved = |(part, before): &(Part, Size)| {
            let now = self.sizes.of(*part).map_or(before.size, |own| own.size);
            now > STALE * before.size
        };
        self.made_with.0.iter().any(moved)
    }

    /// The sizes of now of what belongs to one session.
    pub fn held(&self) -> Arc<Sizes> {
        Arc::new(self.sizes.of_one_session())
    }

    /// Cycles per turn of each gear line, with its joint.
    pub(super) fn lines(&self) -> impl Iterator<Item = (usize, f64)> {
        self.columns.iter().filter_map(|own| match own {
            Column::Of { block: Block::Line { joint, cycles }, place: 0 } => {
                Some((*joint, *cycles))
            }
            _ => None,
        })
    }

    /// Stations over which the warm-up is told.
    pub(super) const fn span(&self) -> f64 {
        self.span
    }

    /// The period of each sliding joint's curve, mm; empty where all turn.
    pub(super) fn slide_periods_mm(&self) -> &[Option<f64>] {
        &self.slide_periods_mm
    }

    /// Columns of a joint's curve.
    pub(super) fn curve(&self, joint: usize) -> usize {
        let own = |own: &&Column| matches!(own, Column::Of { block: Block::Curve(of), .. } if *of == joint);
        self.columns.iter().filter(own).count()
    }

    /// The sizes of parts that the sessions so far showed.
    pub(super) fn sizes(&self) -> &[(Part, Size)] {
        self.sizes.all()
    }

    /// These without some columns, which are eliminated at their prior variances.
    fn without(&self, eliminated: &[usize]) -> Option<Self> {
        let variances = eliminated.iter().map(|&column| self.variances[column]);
        let sums = self.sums.without(eliminated, &variances.collect::<Vec<_>>())?;
        let kept = (0..self.columns.len()).filter(|column| !eliminated.contains(column));
        let kept: Vec<usize> = kept.collect();
        Some(Self {
            columns: kept.iter().map(|&column| self.columns[column]).collect(),
            sums,
            at: self.at.select_rows(&kept),
            variances: self.variances.select_rows(&kept),
            ..self.clone()
        })
    }

    /// These where some columns may have changed by so much since: the sums are of the values of now.
    fn loosened(&self, changes: &[(usize, f64)]) -> Option<Self> {
        let size = self.columns.len();
        let (changed, variances): (Vec<usize>, Vec<f64>) = changes.iter().copied().unzip();
        let twice: Vec<usize> = (0..size).chain(changed).collect();
        let added: Vec<usize> = (size..twice.len()).collect();
        Some(Self { sums: self.sums.selected(&twice).without(&added, &variances)?, ..self.clone() })
    }

    /// What these are to a session: `None` where rounding made a matrix indefinite.
    pub(super) fn entered(
        &self,
        observations: &[Observation],
        layout: &Layout,
        settings: &FullSettings,
    ) -> Option<Entered> {
        let day = day_of(observations);
        let repaired = self.repaired_since(&settings.repaired, day);
        let mut then = self.clone();
        for (column, own) in then.columns.iter().enumerate() {
            if let Column::Constant(joint) = own {
                let slides = layout.slide_period_mm(*joint).is_some();
                then.variances[column] = repairs::zero_variance(slides);
            }
        }
        let gone = then.columns.iter().enumerate();
        let gone =
            gone.filter(|(_, own)| own.joint().is_some_and(|joint| repaired.contains(&joint)));
        let gone: Vec<usize> = gone.map(|(column, _)| column).collect();
        let then = then.without(&gone)?;
        let changes = then.changes(years_between(self.day, day), layout, settings);
        let now = then.loosened(&changes)?;
        Some(Entered { then, now, changes })
    }

    /// The columns of curves and joints' zeros, with the variance of their change over some years.
    fn changes(&self, years: f64, layout: &Layout, settings: &FullSettings) -> Vec<(usize, f64)> {
        let mut spectra = Spectra::default();
        let joints = self.columns.iter().filter_map(|own| match own {
            Column::Constant(joint) => Some(*joint),
            _ => None,
        });
        let size = self.sizes.of(Part::Ageing).map_or(0.0, |own| own.size);
        let mut changes = Vec::new();
        for joint in joints.filter(|_| years > 0.0) {
            let pairs = few_harmonics(settings).min(self.curve(joint) / 2);
            let profile = change_profile(layout, settings, joint, (2 * pairs + 1, &mut spectra));
            let curve =
                (0..2 * pairs).map(|place| Column::Of { block: Block::Curve(joint), place });
            let own = std::iter::once(Column::Constant(joint)).chain(curve);
            for (own, share) in own.zip(profile) {
                let place = self.columns.iter().position(|other| *other == own);
                changes.extend(place.map(|place| (place, size * years * share)));
            }
        }
        changes
    }
}

impl Entered {
    /// What was carried over, for the rows of a session.
    pub(super) const fn now(&self) -> &Carried {
        &self.now
    }

    /// The sums on the columns of a session's model, of values relative to the session's own; `None` where rounding made a matrix
    /// indefinite.
    pub(super) fn sums(&self, around: &Around<'_>, prior_mean: &DVector<f64>) -> Option<Sums> {
        let own = Places::of(around, prior_mean);
        own.laid(&self.now, None, own.layout.size())
    }
}
