//! History: the sessions of one robot in order → what changed between them, and whether it is within its control limits.
//!
//! Input is one [`SessionFigures`] after another: what the session identified ([`Estimate`]) and its accuracy figures.
//! Output is a [`Judged`] for each. Steps of [`SessionHistory::next`]:
//! 1. Another nominal arm, pipeline file, setting, version or model begins a new segment ([`Basis`]): nothing is compared
//!    across.
//! 2. The session is compared with all sessions before it, pooled, with the covariances of both (`compare`). Columns that
//!    one side cannot determine take no part, so priors and choices of datum cannot appear as a change.
//! 3. For each part that may have moved, a test shows what its change alone explains ([`hypotheses`]). The smallest p-value
//!    times the number of hypotheses, compared with [`FALSE_ALARM`], is the alarm; then parts are named, or groups of parts
//!    that cannot be distinguished. A part whose change does not reach the size that counts is not named, and its sessions stay
//!    pooled, so that many small changes of one direction add up ([`notice`]).
//! 4. The pool forgets the parts that moved. The next session shows whether the change lasts: if it agrees with the pool
//!    before the change, or disagrees with it in other parts alone, the change was of one session alone.
//! 5. Base, target and joints since the first session, and the accuracy figures, go on control charts ([`control`]) that
//!    learn the ordinary spread between sessions from the sessions themselves. The test of step 3 shows whether something
//!    moved, the charts show whether that is more than usual.
//!
//! [`table_state`] decides, by a session that a table drove, whether the table still holds.

mod bits;
pub mod compare;
pub mod control;
pub mod estimate;
pub mod hypotheses;
pub mod notice;
mod session_history;
pub mod table_state;
mod words;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use compare::Shift;
use control::Charted;
use estimate::Estimate;
use hypotheses::{Asked, Finding, Hypothesis};
use notice::Noticed;
pub use session_history::{SessionHistory, between};

/// Probability that a session without any change raises an alarm: one false alarm in 1000 sessions at most.
pub const FALSE_ALARM: f64 = 1e-3;
/// A base or target that moved by this or more, mm or mrad, was set up anew: that is not a change of the earlier set-up.
pub const SET_UP_ANEW: f64 = 10.0;

/// Everything that must be equal for the figures of two sessions to be comparable.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Basis {
    pub pipeline: String,
    pub version: String,
    /// Digest of the robot file: the nominal arm.
    pub robot_file: String,
    pub settings: String,
    pub model: String,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AccuracyFigure {
    pub name: String,
    #[serde(with = "bits::number")]
    pub value: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub struct SessionFigures {
    pub basis: Basis,
    pub estimate: Estimate,
    pub accuracy: Vec<AccuracyFigure>,
    /// The size from which a change counts; `None` where its run states no tolerance: then every significant one does.
    pub noticed: Option<Noticed>,
}

#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// The segment, from 1.
    pub segment: usize,
    /// The differences that began the segment, as text; empty where the segment continues or is the first.
    pub began: Vec<String>,
    /// Number of pooled sessions that it was compared with; 0 for the first of a segment.
    pub against: usize,
    pub set_up_anew: Vec<Hypothesis>,
    pub asked: Vec<Asked>,
    pub finding: Finding,
    /// Parts that moved significantly, by less than counts.
    pub small: Vec<Hypothesis>,
    /// The size from which a change counts, mm; `None` where every significant one does.
    #[serde(with = "bits::optional")]
    pub least_mm: Option<f64>,
    /// Shifts of the parts named; of parts that cannot be distinguished, the first one's.
    pub moved: Vec<Shift>,
    /// Whether a change that the session before showed lasts; `None` when there was none.
    pub settles: Option<bool>,
    pub charted: Vec<Charted>,
}

impl Judged {
    pub fn out_of_control(&self) -> impl Iterator<Item = &str> {
        let out = self.charted.iter().filter(|charted| charted.is_out() == Some(true));
        out.map(|charted| charted.name.as_str())
    }
}

impl Basis {
    /// The differences between two bases, as text; empty when they are equal.
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

/// `A⁺` of a symmetric positive semidefinite matrix over its eigenvalues above `least`, and the number of these.
pub(crate) fn inverse_above(matrix: &DMatrix<f64>, least: f64) -> (DMatrix<f64>, usize) {
    let size = matrix.nrows();
    if size == 0 {
        return (matrix.clone(), 0);
    }
    let eigen = matrix.clone().symmetric_eigen();
    let mut inverse = DMatrix::zeros(size, size);
    let mut rank = 0;
    for (value, vector) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        if *value > least {
            inverse.ger(value.recip(), &vector, &vector, 1.0);
            rank += 1;
        }
    }
    (inverse, rank)
}
