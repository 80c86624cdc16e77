//! What one session determined by its own stations: the model's posterior, with the prior taken out again.
//!
//! With posterior covariance C, mean m and prior precision P the stations alone say `Λ = C⁻¹ − P` about the columns, with the
//! moment `η = C⁻¹ m` (the prior expects zero offsets). Two sessions of one arm have one truth but independent
//! stations, so Λ and η add up, while posteriors, which share their prior, do not.
//!
//! Kept are the columns that sessions share and that one may want to hold against each other: geometry, base and target, gravity, and
//! the slow part of each joint's curve. Everything else (the fast part of curves, gear lines, drift within the session, the way
//! from reported to commanded angle) is integrated out under its prior in each session by itself: a test gets
//! less sharp by it, never too sharp. Columns are in units of what a change of them can be at most ([`Column::unit`]).

use std::collections::BTreeSet;
use std::fmt;

use nalgebra::{DMatrix, DVector, Isometry3, Vector6};
use serde::{Deserialize, Serialize};

use super::suspects::Suspect;
use super::{bits, inverse_above};
use crate::fit::full::FullModel;
use crate::fit::full::layout::Block;
use crate::fit::saved::{SavedCalibration, SavedError};
use crate::fit::{Frames, Unknown};
use crate::kinematics::{Motion, Parameter};

/// Pairs `cos, sin` of a joint's curve that sessions share: those of at least 90° a period.
const CURVE_PAIRS: usize = 4;
/// What a length can change by, mm, and an angle, mrad: the pipeline's own weak prior.
const UNIT: f64 = 3.0;
/// What a joint's curve or its giving way can change by, rad.
const CURVE_UNIT_RAD: f64 = 3e-4;
/// Information of a forgotten part below which it says nothing.
const NOTHING: f64 = 1e-9;

/// What a column of an estimate is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Column {
    /// A parameter of the measurement chain; base and target by a small motion after their frame.
    Chain(#[serde(with = "by_name")] Parameter),
    /// A joint giving way, by its place among the model's coefficients.
    Gravity(usize),
    /// A coefficient of a joint's error curve.
    Curve {
        /// The joint, from 1.
        joint: usize,
        /// Which, from 0: cos, sin of the first harmonic, and so on.
        coefficient: usize,
    },
}

/// What stations determined of the columns.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    columns: Vec<Column>,
    /// Λ, in the columns' units.
    #[serde(with = "bits::matrix")]
    information: DMatrix<f64>,
    /// η: Λ times the offsets; base and target are offsets from the frames here.
    #[serde(with = "bits::vector")]
    moment: DVector<f64>,
    #[serde(with = "bits::frame")]
    base: Option<Isometry3<f64>>,
    #[serde(with = "bits::frame")]
    target: Option<Isometry3<f64>>,
}

impl Column {
    /// The joint it belongs to, from 1.
    pub const fn joint(&self) -> Option<usize> {
        match self {
            Self::Chain(Parameter::Link { joint, .. }) | Self::Curve { joint, .. } => Some(*joint),
            _ => None,
        }
    }

    /// What a change of it can be at most, mm or rad.
    pub fn unit(&self) -> f64 {
        match self {
            Self::Chain(parameter) if parameter.is_angle() => 1e-3 * UNIT,
            Self::Chain(_) => UNIT,
            Self::Gravity(_) | Self::Curve { .. } => CURVE_UNIT_RAD,
        }
    }

    /// `mm` or `rad`.
    pub const fn unit_name(&self) -> &'static str {
        match self {
            Self::Chain(parameter) => parameter.unit(),
            Self::Gravity(_) | Self::Curve { .. } => "rad",
        }
    }
}

impl fmt::Display for Column {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Chain(parameter) => parameter.fmt(f),
            Self::Gravity(place) => write!(f, "gravity_{}", place + 1),
            Self::Curve { joint, coefficient } => write!(f, "curve_{joint}_{}", coefficient + 1),
        }
    }
}

impl Estimate {
    /// Of a whole error model of one session.
    pub fn of_full(model: &FullModel) -> Option<Self> {
        let frames = model.fitted_frames();
        let (places, columns): (Vec<usize>, Vec<Column>) =
            shared_columns(model).into_iter().unzip();
        let scale = model.prior_sd();
        let precision: Vec<f64> = places.iter().map(|&place| scale[place].powi(-2)).collect();
        let means: Vec<f64> = places
            .iter()
            .map(|&place| model.column_mean(place))
            .collect();
        Self::of_posterior(
            columns,
            &model.covariance_of(&places),
            &means,
            &precision,
            *frames.first()?,
        )
    }

    /// Of a geometric calibration of one session, or of base and target alone.
    pub fn of_geometric(saved: &SavedCalibration) -> Result<Option<Self>, SavedError> {
        let Some(session) = saved.sessions.first() else {
            return Ok(None);
        };
        let frames = session.frames()?;
        let chain = saved.arm.chain()?;
        let named = chain.parameters();
        let known: Vec<Parameter> = named.iter().copied().chain(frame_motions()).collect();
        let offset = |parameter: Parameter| {
            let place = named.iter().position(|own| *own == parameter);
            place
                .and_then(|place| saved.geometry.get(place))
                .copied()
                .unwrap_or(0.0)
        };
        let mut columns = Vec::new();
        for unknown in &saved.unknowns {
            let found = known
                .iter()
                .find(|own| own.to_string() == unknown.parameter);
            let parameter = found.ok_or_else(|| SavedError::Unknown {
                what: "a parameter",
                name: unknown.parameter.clone(),
            })?;
            columns.push(*parameter);
        }
        let size = columns.len();
        let of = |i: usize, j: usize| saved.covariance[i.max(j)][i.min(j)];
        let covariance = DMatrix::from_fn(size, size, of);
        let means: Vec<f64> = columns.iter().map(|parameter| offset(*parameter)).collect();
        let precision: Vec<f64> = saved
            .prior_sd
            .iter()
            .map(|sd| sd.map_or(0.0, |sd| sd.powi(-2)))
            .collect();
        let columns = columns.into_iter().map(Column::Chain).collect();
        Ok(Self::of_posterior(
            columns,
            &covariance,
            &means,
            &precision,
            frames,
        ))
    }

    /// Takes the prior out; `None` where the covariance is none.
    fn of_posterior(
        columns: Vec<Column>,
        covariance: &DMatrix<f64>,
        means: &[f64],
        precision: &[f64],
        frames: Frames,
    ) -> Option<Self> {
        let units: Vec<f64> = columns.iter().map(Column::unit).collect();
        let size = columns.len();
        let scaled = DMatrix::from_fn(size, size, |i, j| {
            covariance[(i, j)] / (units[i] * units[j])
        });
        let posterior = scaled.cholesky()?.inverse();
        // From the frames as they were found, base and target are off by nothing, and their prior by as much as they moved.
        let prior = |i: usize| precision[i] * units[i].powi(2);
        let is_frame = |i: usize| {
            matches!(
                columns[i],
                Column::Chain(Parameter::Base(_) | Parameter::Target(_))
            )
        };
        let offset = |i: usize| means[i] / units[i];
        let own = DVector::from_fn(size, |i, _| if is_frame(i) { 0.0 } else { offset(i) });
        let expected = DVector::from_fn(size, |i, _| {
            if is_frame(i) {
                -offset(i) * prior(i)
            } else {
                0.0
            }
        });
        let moment = &posterior * own - expected;
        let mut information = posterior;
        for i in 0..size {
            information[(i, i)] -= prior(i);
        }
        Some(Self {
            columns,
            information,
            moment,
            base: Some(*frames.tracker_from_base.isometry()),
            target: Some(*frames.flange_from_target.isometry()),
        })
    }

    /// The columns.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Whether it still knows where a base stood.
    pub const fn has_base(&self) -> bool {
        self.base.is_some()
    }

    /// Whether it still knows where a target sat.
    pub const fn has_target(&self) -> bool {
        self.target.is_some()
    }

    /// Whether base or target stands `limit` mm or mrad and more from where the other has it; false where one has none.
    pub fn is_far_from(&self, other: &Self, part: Suspect, limit: f64) -> bool {
        let pair = match part {
            Suspect::Base => (other.base, self.base),
            Suspect::Target => (other.target, self.target),
            _ => (None, None),
        };
        let (Some(from), Some(to)) = pair else {
            return false;
        };
        let motion = motion(&from, &to);
        let turned = part == Suspect::Base || self.turns_target();
        let angle = if turned {
            1e3 * motion.fixed_rows::<3>(3).norm()
        } else {
            0.0
        };
        motion.fixed_rows::<3>(0).norm() > limit || angle > limit
    }

    fn turns_target(&self) -> bool {
        let turns = |column: &Column| {
            matches!(
                column,
                Column::Chain(Parameter::Target(Motion::Rotation(_)))
            )
        };
        self.columns.iter().any(turns)
    }

    /// The same without the columns that `is_forgotten`, which stay free.
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
            columns
                .iter()
                .any(|c| matches!(c, Column::Chain(p) if is(p)))
        };
        Self {
            information: block(&kept, &kept) - &across * block(&gone, &kept),
            moment: moment(&kept) - &across * moment(&gone),
            base: self
                .base
                .filter(|_| has(|p| matches!(p, Parameter::Base(_)))),
            target: self
                .target
                .filter(|_| has(|p| matches!(p, Parameter::Target(_)))),
            columns,
        }
    }

    /// Both together, about the frames of `self`.
    #[must_use]
    pub fn plus(&self, other: &Self) -> Self {
        let all: BTreeSet<Column> = self.columns.iter().chain(&other.columns).copied().collect();
        let columns: Vec<Column> = all.into_iter().collect();
        let (base, target) = (self.base.or(other.base), self.target.or(other.target));
        let own = self.spread(&columns, base.as_ref(), target.as_ref());
        let others = other.spread(&columns, base.as_ref(), target.as_ref());
        Self {
            columns,
            information: own.0 + others.0,
            moment: own.1 + others.1,
            base,
            target,
        }
    }

    /// Λ and η over `columns`, offsets taken from these frames; columns that it has not it knows nothing of.
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
        let at = |i: usize, j: usize| {
            places[i]
                .zip(places[j])
                .map_or(0.0, |own| self.information[own])
        };
        let size = columns.len();
        let moment = DVector::from_fn(size, |i, _| places[i].map_or(0.0, |own| moment[own]));
        (DMatrix::from_fn(size, size, at), moment)
    }

    /// How far a column's own frame stands from the one given, in the column's unit.
    fn moved(
        &self,
        place: usize,
        base: Option<&Isometry3<f64>>,
        target: Option<&Isometry3<f64>>,
    ) -> f64 {
        let column = &self.columns[place];
        let by = |pair: Option<(&Isometry3<f64>, &Isometry3<f64>)>, along: Motion| {
            pair.map_or(0.0, |(from, to)| {
                component(&motion(from, to), along) / column.unit()
            })
        };
        match *column {
            Column::Chain(Parameter::Base(along)) => by(base.zip(self.base.as_ref()), along),
            Column::Chain(Parameter::Target(along)) => by(target.zip(self.target.as_ref()), along),
            _ => 0.0,
        }
    }

    /// What the stations of a session at the same poses would say of an arm whose columns are off by `truth` (mm, rad), base
    /// and target from the same frames: Λ stays, and η is drawn with `normals`, one standard normal number for each column.
    pub fn drawn(&self, truth: &[(Column, f64)], normals: &[f64]) -> Self {
        let offset = |column: &Column| {
            let own = truth.iter().filter(|(own, _)| own == column);
            own.map(|(_, value)| value).sum::<f64>() / column.unit()
        };
        let size = self.columns.len();
        let offsets = DVector::from_fn(size, |i, _| offset(&self.columns[i]));
        let eigen = self.information.clone().symmetric_eigen();
        let noise = DVector::from_fn(size, |i, _| {
            eigen.eigenvalues[i].max(0.0).sqrt() * normals[i]
        });
        Self {
            moment: &self.information * offsets + &eigen.eigenvectors * noise,
            ..self.clone()
        }
    }

    pub(super) const fn frames(&self) -> (Option<&Isometry3<f64>>, Option<&Isometry3<f64>>) {
        (self.base.as_ref(), self.target.as_ref())
    }
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

/// The motions of base and target, as parameters.
fn frame_motions() -> impl Iterator<Item = Parameter> {
    use crate::kinematics::Axis;
    let motions = || {
        let along = |of: fn(Axis) -> Motion| Axis::ALL.into_iter().map(of);
        along(Motion::Translation).chain(along(Motion::Rotation))
    };
    motions()
        .map(Parameter::Base)
        .chain(motions().map(Parameter::Target))
}

/// Columns of the model that sessions share, with their places; parts that were dropped have no scale and say nothing.
fn shared_columns(model: &FullModel) -> Vec<(usize, Column)> {
    let mut shared = Vec::new();
    for (block, own) in model.layout().blocks() {
        let first = own.start;
        match block {
            Block::Unknowns => {
                let parameter = |unknown: &Unknown| Column::Chain(unknown.parameter);
                shared.extend(own.zip(model.unknowns().iter().map(parameter)));
            }
            Block::Gravity => {
                shared.extend(own.map(|place| (place, Column::Gravity(place - first))))
            }
            Block::Curve(joint) => shared.extend(own.take(2 * CURVE_PAIRS).map(|place| {
                let coefficient = place - first;
                (
                    place,
                    Column::Curve {
                        joint: joint + 1,
                        coefficient,
                    },
                )
            })),
            _ => {}
        }
    }
    shared.retain(|(place, _)| model.prior_sd()[*place] > 0.0);
    shared
}

/// Parameters by their names.
mod by_name {
    use serde::{Deserialize as _, Deserializer, Serializer, de::Error as _};

    use crate::kinematics::{LinkQuantity, Parameter};

    pub fn serialize<S: Serializer>(parameter: &Parameter, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(parameter)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Parameter, D::Error> {
        let name = String::deserialize(from)?;
        super::frame_motions()
            .find(|own| own.to_string() == name)
            .or_else(|| link(&name))
            .ok_or_else(|| D::Error::custom(format!("{name:?} is no parameter")))
    }

    fn link(name: &str) -> Option<Parameter> {
        let (quantity, joint) = name.rsplit_once('_')?;
        let quantity = match quantity {
            "theta" => LinkQuantity::Theta,
            "d" => LinkQuantity::D,
            "a" => LinkQuantity::A,
            "alpha" => LinkQuantity::Alpha,
            "beta" => LinkQuantity::Beta,
            _ => return None,
        };
        let joint = joint.parse().ok()?;
        Some(Parameter::Link { joint, quantity })
    }
}
