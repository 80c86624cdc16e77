//! The seam for error models: what every model of an arm's errors can be asked.
//!
//! A [`PoseModel`] is asked [`At`] joint angles, with what is known of them, or at a commanded tool pose. It answers with a
//! [`Prediction`] or says why it has none ([`Gap`]): a model of the arm needs joint angles, a compensation table knows tool
//! poses of one orientation, and only those inside its box. Which models there are stands in [`super::registry`].

use std::any::Any;
use std::fmt::Debug;

use nalgebra::{DMatrix, Matrix3, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::commanded::SettlingError;
use super::frames::{Channel, Frames};
use super::full::PartEvidence;
use super::gap::Gap;
use super::observation::Observation;
use crate::join::{SourceId, TargetId};
use crate::kinematics::Arm;

/// A model of an arm's errors.
///
/// ```
/// # use std::path::Path;
/// # use posegrid::io::log::{SessionLogs, read_session};
/// # use posegrid::pipeline::configuration::{Configuration, Overrides};
/// # use posegrid::progress::Quiet;
/// # let configuration = Configuration::load(Path::new("pipelines/quickstart.toml"), &Overrides::default())?;
/// # let log = |side: &str| Path::new("tests/recordings/quickstart").join(side);
/// # let logs = SessionLogs::of_two(&log("controller.mcap"), &log("tracker.mcap"));
/// # let read = read_session(&logs, &configuration.mapping, configuration.limits, &configuration.join.arm_rule(), &mut (), &Quiet)?;
/// # let joined = posegrid::join::join(&read.input, &configuration.arm, &configuration.join)?;
/// # let stations = &joined.stations;
/// use posegrid::fit::model::{At, PoseModel, Query};
/// # use posegrid::fit::{FitSettings, Freedom, identify, observations};
/// # let seen = observations(0, stations, &configuration.arm, &configuration.stages.noise);
/// # let (freedom, settings) = (Freedom::Geometry, FitSettings::default());
/// # let model = identify(&configuration.arm, &seen, 1, freedom, &settings)?;
///
/// // Where the geometry has the reflector at the first station, in the tracker's frame, and how far that may be off.
/// let prediction = model.predict(&At::Joints(Query::of(&seen[0])))?;
/// let left = seen[0].point().expect("the tracker reads points").position - prediction.position;
/// let covariance = model.spread(0, seen[0].source, &prediction).covariance();
/// assert!(left.norm() < 1.0 && covariance.trace().sqrt() < 1.0, "mm");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait PoseModel: Any + Debug + Send + Sync {
    /// The frames of each session that it was identified on, in their order; none of a model that knows no tracker.
    fn frames(&self) -> &[Frames];

    /// Where the point is attained, with what the model leaves open of it.
    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap>;

    /// [`Prediction::position`] alone, where that is faster.
    fn position(&self, at: &At<'_>) -> Result<Point3<f64>, Gap> {
        Ok(self.predict(at)?.position)
    }

    /// [`Self::position`] of many, on all cores.
    fn positions(&self, many: &[At<'_>]) -> Vec<Result<Point3<f64>, Gap>> {
        many.par_iter().map(|at| self.position(at)).collect()
    }

    /// From the flange's axes to the tracker's, with everything that turns it.
    fn flange(&self, query: &Query<'_>) -> Result<UnitQuaternion<f64>, Gap> {
        Ok(self.predict(&At::Joints(*query))?.flange)
    }

    /// What a prediction in the frame of a session's source may be wrong by for a command that is given some day; in that frame.
    fn spread(&self, session: usize, source: SourceId, prediction: &Prediction) -> Spread;

    /// Covariance of predictions by the model's unknowns: three rows of [`Open::rows`] for each, mm².
    fn covariances(&self, rows: &DMatrix<f64>) -> Vec<Matrix3<f64>> {
        vec![Matrix3::zeros(); rows.nrows() / 3]
    }

    /// Covariance of one measured position besides what the model leaves open, mm², tracker frame.
    fn noise(&self, observation: &Observation) -> Matrix3<f64> {
        let point = observation.point();
        point.map_or_else(Matrix3::zeros, |point| {
            point.factor * point.factor.transpose()
        })
    }

    /// Variance per axis of what the base moves by in a session that the model never saw, mm²; 0 of a model that knows no drift.
    fn drift_variance(&self) -> f64 {
        0.0
    }

    /// Standard deviation of a session's own scale, a share; 0 of a model that knows no scales.
    fn scale_sd(&self) -> f64 {
        0.0
    }

    /// Parts that it always has, by their names in tables.
    fn parts(&self) -> &'static [&'static str] {
        &[]
    }

    /// Parts that it keeps or drops by their evidence.
    fn optional_parts(&self) -> &[PartEvidence] {
        &[]
    }

    /// How many numbers it identified.
    fn parameter_count(&self) -> usize {
        0
    }

    /// What each station of the training counted for, in their order; none of a model that was read.
    fn weights(&self) -> &[f64] {
        &[]
    }

    /// The model as JSON, which its line of the registry reads back ([`super::registry::About::load`]); `names` are the sessions'. It
    /// says its version, arm and sessions as [`super::saved::SavedHead`] has them.
    /// `None` of a model that is stored otherwise: a table is its own file, and a model that was read is where it was read from.
    fn saved(&self, arm: &Arm, names: &[&str]) -> Option<Result<String, serde_json::Error>>;
}

/// Where a model is asked.
#[derive(Debug, Clone, Copy)]
pub enum At<'q> {
    /// At joint angles; the answer is in the tracker's frame of the query's session.
    Joints(Query<'q>),
    /// At a commanded tool pose; the answer is in its frame, that of commands.
    Tool {
        /// The position, mm.
        position: Point3<f64>,
        /// The orientation, where it is stated.
        orientation: Option<UnitQuaternion<f64>>,
    },
}

/// Joint angles to predict at, with what is known of them.
#[derive(Debug, Clone, Copy)]
pub struct Query<'q> {
    /// Axis variables, rad.
    pub axes: &'q [f64],
    /// What the axis variables are.
    pub known: Known<'q>,
    /// From the target to the predicted point, along the flange's axes, mm.
    pub lever: Vector3<f64>,
    /// The session whose frames are used.
    pub session: usize,
    /// The source in whose frame the answer is.
    pub source: SourceId,
    /// The target that the point is predicted by.
    pub target: TargetId,
    /// Whether the session's own parts apply (base as fitted, drift, scale, changes); otherwise the base is the nominal one and
    /// predictions are those for any session.
    pub own: bool,
    /// The station's number, for drift, warm-up and the session's scale; `None` for a command that is given some day.
    pub station: Option<usize>,
}

/// What the axis variables of a query are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Known<'q> {
    /// Reported angles, the command not known.
    Reported,
    /// Reported angles, with what they fell short of the command.
    Both(&'q SettlingError),
    /// Commanded angles: all an off-line programmer has.
    Commanded,
}

/// The joint angles that a model is held against stations at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Angles {
    /// As the controller reported them.
    Reported,
    /// Between reported and commanded, as the model finds.
    Weighted,
    /// As commanded: all an off-line programmer has.
    Commanded,
}

/// What a model says of one point.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Where it is attained, mm.
    pub position: Point3<f64>,
    /// From the flange's axes to the tracker's, so far as frames are found from it; of a tool pose its own orientation.
    pub flange: UnitQuaternion<f64>,
    /// Attained minus commanded position, mm, where a tool pose was asked for.
    pub error: Option<Vector3<f64>>,
    /// What the model leaves open; `None` of a model without a covariance.
    pub open: Option<Open>,
}

/// What a model leaves open of a point.
#[derive(Debug, Clone)]
pub struct Open {
    /// How the point moves with each of the model's unknowns, which all its points share: three rows.
    pub rows: DMatrix<f64>,
    /// Covariance of what the point has alone, mm².
    pub alone: Matrix3<f64>,
}

/// What a prediction may be wrong by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spread {
    /// As much along each axis: a variance, mm².
    Isotropic(f64),
    /// A covariance, mm².
    Of(Matrix3<f64>),
}

impl<'q> At<'q> {
    /// The joint angles, which a model of the arm needs.
    pub const fn joints(&self) -> Result<&Query<'q>, Gap> {
        match self {
            Self::Joints(query) => Ok(query),
            Self::Tool { .. } => Err(Gap::NoJoints),
        }
    }
}

impl<'q> Known<'q> {
    /// All that is known of a station.
    pub fn of(observation: &'q Observation) -> Self {
        let settling_error = observation.settling_error.as_ref();
        settling_error.map_or(Self::Reported, Self::Both)
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

    /// The source and the target by whose frames the point is predicted.
    pub const fn channel(&self) -> Channel {
        Channel {
            session: self.session,
            source: self.source,
            target: self.target,
        }
    }
}

impl Prediction {
    /// Attained minus commanded position, mm.
    pub fn error_from(&self, command: &Point3<f64>) -> Vector3<f64> {
        self.error.unwrap_or_else(|| self.position - command)
    }
}

impl Spread {
    /// The covariance in the prediction's own frame, mm².
    pub fn covariance(&self) -> Matrix3<f64> {
        match self {
            Self::Isotropic(variance) => Matrix3::identity() * *variance,
            Self::Of(covariance) => *covariance,
        }
    }

    /// The covariance in a frame whose axes are turned by `to_from` against the prediction's: `R C Rᵀ`.
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
