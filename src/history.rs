//! History: the sessions of one robot in order → what changed between them, and whether it is within its control limits.
//!
//! Input is one [`SessionFigures`] after another: what the session identified ([`Estimate`]) and its accuracy figures.
//! Output is a [`Judged`] for each. Steps of [`SessionHistory::next`]:
//! 1. Another nominal arm, pipeline file, setting, version or model begins a new segment ([`Basis`]): nothing is compared across.
//! 2. The session is held against all sessions before it, pooled, with the covariances of both (`compare`). What one of
//!    them cannot determine takes no part, so priors and choices of datum cannot show as a change.
//! 3. Each part that may have moved is asked what its change alone explains ([`hypotheses`]). The smallest p-value times the
//!    number of hypotheses, held against [`FALSE_ALARM`], is the alarm; then parts are named, or groups of parts
//!    that cannot be distinguished.
//! 4. What moved is forgotten in the pool. The next session tells whether the change lasts: where that agrees with
//!    the pool as it was, the change was of one session alone.
//! 5. Base, target and joints since the first session, and the accuracy figures, go on control charts ([`control`]) that
//!    learn the ordinary spread between sessions from the sessions themselves. The test of step 3 asks whether something
//!    is not where it was, the charts whether that is more than usual.
//!
//! [`table_state`] asks the same of a session that a table drove: whether the table still holds.

mod bits;
pub mod compare;
pub mod control;
pub mod estimate;
pub mod hypotheses;
mod session_history;
pub mod table_state;
mod words;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use compare::Shift;
use control::Charted;
use estimate::Estimate;
use hypotheses::{Asked, Finding, Hypothesis};
pub use session_history::{SessionHistory, between};

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
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// The segment, from 1.
    pub segment: usize,
    /// What began the segment, in words; empty where it goes on, or is the first.
    pub began: Vec<String>,
    /// Sessions pooled that it was held against; 0 for the first of a segment.
    pub against: usize,
    /// Parts that were set up anew.
    pub set_up_anew: Vec<Hypothesis>,
    /// What each hypothesis explains.
    pub asked: Vec<Asked>,
    /// What moved.
    pub finding: Finding,
    /// How far, of the parts named; of the first of those that cannot be distinguished.
    pub moved: Vec<Shift>,
    /// What this session says of a change that the session before it showed: whether it lasts.
    pub settles: Option<bool>,
    /// What was charted.
    pub charted: Vec<Charted>,
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
