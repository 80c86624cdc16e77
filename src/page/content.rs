//! What a page tells: rows of a run's published tables, and what the run says besides.

mod origin;

use crate::grid::Tolerance;
use crate::io::tables::accuracy::AccuracyRow;
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::grid_steps::StepRow;
use crate::io::tables::joint_errors::JointErrorRow;
use crate::io::tables::parameters::ParameterRow;
use crate::io::tables::residuals::ResidualRow;
use crate::io::tables::semivariograms::SemivariogramRow;
use crate::report::Subject;
use crate::report::verdict::RunVerdict;

pub use origin::{Count, Provenance, Session};

/// Everything on the page of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// The robot.
    pub robot: String,
    /// The session, or `pooled`.
    pub session: String,
    /// The run.
    pub run: String,
    /// What has to be met.
    pub tolerance: Tolerance,
    /// Whether it is, by what, and who says so: held-out blocks, and every test session.
    pub verdict: RunVerdict,
    /// The choice of the step in words.
    pub choice: String,
    /// What an operator has to know beside the verdict: topics of which too much was rejected.
    pub warnings: Vec<String>,
    /// What the run found, in words: damage, parts of the model, stations hardly believed.
    pub notes: Vec<String>,
    /// Whether the table that drove the session still holds, where one did.
    pub table_state: Option<String>,
    /// `grid_steps`.
    pub steps: Vec<StepRow>,
    /// `accuracy`, but for the tool tip.
    pub figures: Vec<AccuracyRow>,
    /// `accuracy` of the tool tip.
    pub tip: Vec<AccuracyRow>,
    /// `residuals`, those of one subject together, in the subjects' order.
    pub residuals: Vec<Residuals>,
    /// `semivariograms`.
    pub semivariograms: Vec<SemivariogramRow>,
    /// `joint_errors`.
    pub joint_errors: Vec<JointErrorRow>,
    /// `parameters`.
    pub parameters: Vec<ParameterRow>,
    /// `calibrations`.
    pub calibrations: Vec<CalibrationRow>,
    /// Each session's `clocks`, `stations` and `rejects`, training sessions first.
    pub sessions: Vec<Session>,
    /// What came into each stage and what became of it.
    pub counts: Vec<Count>,
    /// What the run was made from.
    pub provenance: Provenance,
}

/// Measured minus predicted at all stations of a subject.
#[derive(Debug, Clone, PartialEq)]
pub struct Residuals {
    /// What they are of.
    pub subject: Subject,
    /// In the order of the stations.
    pub stations: Vec<ResidualRow>,
}
