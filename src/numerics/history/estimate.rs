//! The information of one session's own stations: the model's posterior with the prior removed.
//!
//! With posterior covariance C, mean m and prior precision P, the stations alone have the information `Λ = C⁻¹ − P` and the
//! moment `η = C⁻¹ m` (the prior expects zero offsets). Two sessions of one arm have one truth but independent
//! stations, so Λ and η add up, while posteriors, which share their prior, do not.
//!
//! Kept are the columns that sessions share and that can be compared: geometry, base and target, gravity, and
//! the slow part of each joint's curve: coefficients of one that turns, values of one that slides. The base is that in the frame of
//! the first source of places, the target the first. Everything else (further targets and sources, anchors and planes of instruments
//! that read one length, the fast part of curves, gear lines, drift within the session, the
//! settling error) is integrated out under its prior in each session by itself: a test gets
//! less sharp by it, never too sharp. Readings of several targets and instruments at one station share the arm's own errors there: a fit
//! that does not know that has them counted as one position together. The unit of a column is the largest change expected of it ([`Column::unit`]).

mod column;
mod posterior;

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector, Isometry3, Vector6};
use serde::{Deserialize, Serialize};

use super::{bits, inverse_above};
use crate::kinematics::{Motion, Parameter};
pub use column::Column;

/// Information below which a forgotten part counts as empty.
const NOTHING: f64 = 1e-9;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    pub columns: Vec<Column>,
    /// Λ, in the columns' units.
    #[serde(with = "bits::matrix")]
    pub information: DMatrix<f64>,
    /// η: Λ times the offsets; those of base and target are offsets from the frames of this estimate.
    #[serde(with = "bits::vector")]
    pub moment: DVector<f64>,
    /// The fitted base in its source's frame, mm; `None` where the estimate has no information on one.
    #[serde(with = "bits::frame")]
    pub(super) base: Option<Isometry3<f64>>,
    /// The fitted main target on the flange, mm; `None` where the estimate has no information on one.
    #[serde(with = "bits::frame")]
    pub(super) target: Option<Isometry3<f64>>,
}

impl Estimate {
    /// Whether the base is more than `limit` mm or mrad from its place in `other`; false when one has none.
    pub(super) fn base_is_far_from(&self, other: &Self, limit: f64) -> bool {
        is_far(other.base.zip(self.base), true, limit)
    }

    /// Whether the target is more than `limit` mm or mrad from its place in `other`; false when one has none.
    pub(super) fn target_is_far_from(&self, other: &Self, limit: f64) -> bool {
        let turns = |column: &Column| {
            matches!(column, Column::Chain(Parameter::Target(Motion::Rotation(_))))
        };
        is_far(other.target.zip(self.target), self.columns.iter().any(turns), limit)
    }

    /// A copy without the information on the columns for which `is_forgotten` is true; these stay free.
    #[must_use]
    pub fn without(&self, is_forgotten: impl Fn(&Column) -> bool) -> Self {
        let (gone, kept): (Vec<usize>, Vec<usize>) =
            (0..self.columns.len()).partition(|&place| is_forgotten(&self.columns[place]));
        if gone.is_empty() {
            return self.clone();
        }
        let block = |rows: &[usize], columns: &[usize]| {
            DMatrix::from_fn(rows.len(), columns.len(), |i, j| {
                self.information[(rows[i], columns[j])]
            })
        };
        let moment =
            |places: &[usize]| DVector::from_fn(places.len(), |i, _| self.moment[places[i]]);
        let (inverse, _) = inverse_above(&block(&gone, &gone), NOTHING);
        let across = block(&kept, &gone) * inverse;
        let columns: Vec<Column> = kept.iter().map(|&place| self.columns[place]).collect();
        let has = |is: fn(&Parameter) -> bool| {
            columns.iter().any(|c| matches!(c, Column::Chain(p) if is(p)))
        };
        Self {
            information: block(&kept, &kept) - &across * block(&gone, &kept),
            moment: moment(&kept) - &across * moment(&gone),
            base: self.base.filter(|_| has(|p| matches!(p, Parameter::Base(_)))),
            target: self.target.filter(|_| has(|p| matches!(p, Parameter::Target(_)))),
            columns,
        }
    }

    /// The sum of both estimates, relative to the frames of `self`.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let all: BTreeSet<Column> = self.columns.iter().chain(&other.columns).copied().collect();
        let columns: Vec<Column> = all.into_iter().collect();
        let (base, target) = (self.base.or(other.base), self.target.or(other.target));
        let own = self.spread(&columns, base.as_ref(), target.as_ref());
        let others = other.spread(&columns, base.as_ref(), target.as_ref());
        Self { columns, information: own.0 + others.0, moment: own.1 + others.1, base, target }
    }

    /// Λ and η over `columns`, with offsets from the given frames; zero for columns that the estimate does not have.
    pub(super) fn spread(
        &self,
        columns: &[Column],
        base: Option<&Isometry3<f64>>,
        target: Option<&Isometry3<f64>>,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let moved = DVector::from_fn(self.columns.len(), |i, _| self.moved(i, base, target));
        let moment = &self.moment + &self.information * moved;
        let places: Vec<Option<usize>> = columns
            .iter()
            .map(|column| self.columns.iter().position(|own| own == column))
            .collect();
        let at =
            |i: usize, j: usize| places[i].zip(places[j]).map_or(0.0, |own| self.information[own]);
        let size = columns.len();
        let moment = DVector::from_fn(size, |i, _| places[i].map_or(0.0, |own| moment[own]));
        (DMatrix::from_fn(size, size, at), moment)
    }

    /// Offset of a column's own frame from the given one, in the column's unit.
    fn moved(
        &self,
        place: usize,
        base: Option<&Isometry3<f64>>,
        target: Option<&Isometry3<f64>>,
    ) -> f64 {
        let column = &self.columns[place];
        let by = |pair: Option<(&Isometry3<f64>, &Isometry3<f64>)>, along: Motion| {
            pair.map_or(0.0, |(from, to)| component(&motion(from, to), along) / column.unit())
        };
        match *column {
            Column::Chain(Parameter::Base(along)) => by(base.zip(self.base.as_ref()), along),
            Column::Chain(Parameter::Target(along)) => by(target.zip(self.target.as_ref()), along),
            _ => 0.0,
        }
    }
}

fn is_far(pair: Option<(Isometry3<f64>, Isometry3<f64>)>, turned: bool, limit: f64) -> bool {
    pair.is_some_and(|(from, to)| {
        let motion = motion(&from, &to);
        let angle = if turned { 1e3 * motion.fixed_rows::<3>(3).norm() } else { 0.0 };
        motion.fixed_rows::<3>(0).norm() > limit || angle > limit
    })
}

/// The motion after `from` that leads to `to`: a translation, mm, and a rotation vector, rad.
fn motion(from: &Isometry3<f64>, to: &Isometry3<f64>) -> Vector6<f64> {
    let between = from.inverse() * to;
    let (t, r) = (between.translation.vector, between.rotation.scaled_axis());
    Vector6::new(t.x, t.y, t.z, r.x, r.y, r.z)
}

fn component(motion: &Vector6<f64>, along: Motion) -> f64 {
    match along {
        Motion::Translation(axis) => motion[axis as usize],
        Motion::Rotation(axis) => motion[3 + axis as usize],
    }
}
