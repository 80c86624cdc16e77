//! The common interface of all error models.
//!
//! A [`PoseModel`] is evaluated [`At`] joint angles, with their origin ([`Known`]), or at a commanded tool pose. It returns a
//! [`Prediction`] or the reason why it has none ([`Gap`]): a model of the arm needs joint angles, a compensation table needs
//! tool poses of its own orientation inside its box. [`super::registry`] lists the models.

use std::any::Any;
use std::fmt::Debug;

use nalgebra::{DMatrix, Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use super::commanded::SettlingError;
use super::frames::{Channel, Frames};
use super::gap::Gap;
use super::observation::Observation;
use crate::join::{SourceId, TargetId};
use crate::kinematics::Arm;

pub trait PoseModel: Any + Debug + Send + Sync {
    /// The frames of each session that it was identified on, in their order; empty for a model without a tracker frame.
    fn frames(&self) -> &[Frames];

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap>;

    /// The point alone; much faster than [`Self::predict`].
    fn position(&self, at: &At<'_>) -> Result<Point3<f64>, Gap> {
        Ok(self.predict(at)?.position)
    }

    /// [`Self::position`] of many, on all cores.
    fn positions(&self, many: &[At<'_>]) -> Vec<Result<Point3<f64>, Gap>> {
        many.par_iter().map(|at| self.position(at)).collect()
    }

    /// The point with the rotation from the flange's axes to the tracker's, including all parts that turn it.
    fn pose(&self, query: &Query<'_>) -> Result<Isometry3<f64>, Gap> {
        let own = self.predict(&At::Joints(*query))?;
        Ok(Isometry3::from_parts(own.position.into(), own.flange))
    }

    /// Uncertainty, in the frame of a session's source, of a prediction there for a command used in another session.
    fn spread(&self, session: usize, source: SourceId, prediction: &Prediction) -> Spread;

    /// [`Self::spread`] of many predictions, where that is faster together.
    fn spreads(
        &self,
        session: usize,
        source: SourceId,
        predictions: &[&Prediction],
    ) -> Vec<Spread> {
        predictions.iter().map(|own| self.spread(session, source, own)).collect()
    }

    /// Covariance of predictions due to the model's unknowns: three rows of [`Open::rows`] for each, mm².
    fn covariances(&self, rows: &DMatrix<f64>) -> Vec<Matrix3<f64>> {
        vec![Matrix3::zeros(); rows.nrows() / 3]
    }

    /// Noise covariance of one position measured with the base of a session, in addition to the model's own, tracker frame, mm².
    fn noise(&self, observation: &Observation, _session: usize) -> Matrix3<f64> {
        let point = observation.point();
        point.map_or_else(Matrix3::zeros, |point| point.factor * point.factor.transpose())
    }

    /// Covariance of the arm's repeatability at one visit, tracker frame, mm²; zero where [`Self::spread`] has it, as of a model whose
    /// spread is the misfit of its stations.
    fn visit(&self, _query: &Query<'_>) -> Matrix3<f64> {
        Matrix3::zeros()
    }

    /// Standard deviation of a session's own scale, a share; 0 for a model without scales.
    fn scale_sd(&self) -> f64 {
        0.0
    }

    fn parts(&self) -> &'static [&'static str] {
        &[]
    }

    fn optional_parts(&self) -> &[PartEvidence] {
        &[]
    }

    fn parameter_count(&self) -> usize {
        0
    }

    /// Weight of each station of the training, in their order; empty for a model that was read from a file.
    fn weights(&self) -> &[f64] {
        &[]
    }

    /// The model as JSON, which its registry entry reads back ([`super::registry::About::load`]); `names` are the sessions'. It
    /// has version, arm and sessions in the form of [`super::saved::SavedHead`].
    /// `None` for a model that is stored elsewhere: a table is its own file, and a model that was read already has a file.
    fn saved(&self, _arm: &Arm, _names: &[&str]) -> Option<Result<String, serde_json::Error>> {
        None
    }
}

#[derive(Debug, Clone, Copy)]
pub enum At<'q> {
    Joints(Query<'q>),
    /// At a commanded tool pose; the prediction is in the frame of commands.
    Tool {
        position: Point3<f64>,
        orientation: Option<UnitQuaternion<f64>>,
    },
}

/// Joint angles to predict at, with their origin.
#[derive(Debug, Clone, Copy)]
pub struct Query<'q> {
    /// Axis variables, rad.
    pub axes: &'q [f64],
    pub known: Known<'q>,
    /// The vector from the measured target to the predicted point, along the flange's axes, mm.
    pub lever: Vector3<f64>,
    pub session: usize,
    /// The source in whose frame the answer is.
    pub source: SourceId,
    /// The target that the point is predicted by.
    pub target: TargetId,
    /// Whether the session's own parts apply (drift, scale, changes) and the covariance includes its base; otherwise predictions are
    /// those for any session whose base is the fitted one.
    pub own: bool,
    /// The station's number, for drift, warm-up and the session's scale; `None` for a command used in another session.
    pub station: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known<'q> {
    Reported,
    Both(&'q SettlingError),
    Commanded,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Angles {
    Reported,
    /// Between reported and commanded angles, by the model's command–feedback weight.
    Weighted,
    Commanded,
}

#[derive(Debug, Clone)]
pub struct Prediction {
    pub position: Point3<f64>,
    /// The rotation from the flange's axes to the tracker's, by the frames and the chain; for a tool pose, its own orientation.
    pub flange: UnitQuaternion<f64>,
    /// Attained minus commanded position, mm; `None` unless the prediction is at a tool pose.
    pub error: Option<Vector3<f64>>,
    /// The prediction's uncertainty by the model; `None` for a model without a covariance.
    pub open: Option<Open>,
}

/// The uncertainty of a point by the model.
#[derive(Debug, Clone)]
pub struct Open {
    /// The point's motion per unit of each of the model's unknowns, which all its points share: three rows.
    pub rows: DMatrix<f64>,
    /// Covariance that the point does not share with other points, mm².
    pub alone: Matrix3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spread {
    /// Equal along each axis: a variance, mm².
    Isotropic(f64),
    Of(Matrix3<f64>),
}

impl<'q> At<'q> {
    /// The joint angles, which a model of the arm needs; an error at a tool pose.
    pub const fn joints(&self) -> Result<&Query<'q>, Gap> {
        match self {
            Self::Joints(query) => Ok(query),
            Self::Tool { .. } => Err(Gap::NoJoints),
        }
    }
}

impl<'q> Known<'q> {
    pub fn of(observation: &'q Observation) -> Self {
        observation.settling_error.as_ref().map_or(Self::Reported, Self::Both)
    }
}

impl<'q> Query<'q> {
    /// The measured target at a station of a session that the model was trained on, with all that is known of it.
    pub fn of(observation: &'q Observation) -> Self {
        Self {
            axes: &observation.axes,
            known: Known::of(observation),
            lever: Vector3::zeros(),
            session: observation.session,
            source: observation.source,
            target: observation.target,
            own: true,
            station: Some(observation.station),
        }
    }

    /// The only target at these axis variables in a session of the training, at no moment of it.
    pub const fn at(axes: &'q [f64], session: usize, known: Known<'q>) -> Self {
        Self {
            axes,
            known,
            lever: Vector3::new(0.0, 0.0, 0.0),
            session,
            source: SourceId::ONLY,
            target: TargetId::ONLY,
            own: true,
            station: None,
        }
    }

    pub const fn channel(&self) -> Channel {
        Channel { session: self.session, source: self.source, target: self.target }
    }
}

impl Spread {
    pub fn covariance(&self) -> Matrix3<f64> {
        match self {
            Self::Isotropic(variance) => Matrix3::identity() * *variance,
            Self::Of(covariance) => *covariance,
        }
    }

    /// The covariance in a frame whose axes are rotated by `to_from` from the prediction's: `R C Rᵀ`, mm².
    pub fn seen_from(&self, to_from: &UnitQuaternion<f64>) -> Matrix3<f64> {
        match self {
            Self::Isotropic(_) => self.covariance(),
            Self::Of(covariance) => {
                let turn = to_from.to_rotation_matrix();
                turn * covariance * turn.transpose()
            }
        }
    }
}

/// Name of an optional part. A plain reference here would be read as one into the text.
pub type PartName = &'static str;

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartEvidence {
    /// One of `PARTS`.
    #[serde(deserialize_with = "part")]
    pub name: PartName,
    #[serde(rename = "gain_nats")]
    pub gain: f64,
    pub kept: bool,
}

const PARTS: [&str; 9] = [
    "joint_curves",
    "gravity",
    "command_weight",
    "drift",
    "session_scale",
    "gear_lines",
    "ageing",
    "session_changes",
    "backlash",
];

fn part<'de, D: Deserializer<'de>>(text: D) -> Result<PartName, D::Error> {
    let name = String::deserialize(text)?;
    let known = PARTS.into_iter().find(|part| *part == name);
    known.ok_or_else(|| D::Error::unknown_variant(&name, &PARTS))
}
