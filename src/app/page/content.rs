//! The content of a page: rows of a run's published tables, and statements of the run that no table has.

mod origin;

use crate::grid::Tolerance;
use crate::io::tables::accuracy::AccuracyRow;
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::grid_steps::StepRow;
use crate::io::tables::joint_errors::JointErrorRow;
use crate::io::tables::parameters::ParameterRow;
use crate::io::tables::semivariograms::SemivariogramRow;
use crate::report::compared::Pairs;
use crate::report::frame::StatedFrame;
use crate::report::next::Next;
use crate::report::verdict::RunVerdict;

pub use origin::{Count, Provenance, Session};

#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    pub robot: String,
    pub session: String,
    pub run: String,
    /// The tolerance: limit, share of positions and confidence.
    pub tolerance: Tolerance,
    /// Whether it is, by what, and who says so: held-out blocks, and every test session.
    pub verdict: RunVerdict,
    pub frame: StatedFrame,
    pub next: Next,
    /// The command that corrects targets by the result, as it is typed beside the folder `lake`; `None` where nothing is corrected.
    pub command: Option<String>,
    pub pairs: Pairs,
    /// Least and largest coordinates of the table's nodes, base frame, mm; `None` without a table.
    pub bounds: Option<[[f64; 3]; 2]>,
    /// When the sessions were measured, by their logs, in words; `None` where these do not tell.
    pub measured: Option<String>,
    /// What they were measured with: what it is, and its name or uncertainty.
    pub instruments: Vec<(&'static str, String)>,
    pub choice: String,
    /// Warnings for the operator in addition to the verdict, in sentences, shown before the figures.
    pub warnings: Vec<String>,
    /// Findings of the run as text: damage, parts of the model, stations with little weight.
    pub notes: Vec<String>,
    /// Whether the table that drove the session still holds, as text; `None` where no table did.
    pub table_state: Option<String>,
    pub steps: Vec<StepRow>,
    pub figures: Vec<AccuracyRow>,
    pub tip: Vec<AccuracyRow>,
    pub semivariograms: Vec<SemivariogramRow>,
    pub joint_errors: Vec<JointErrorRow>,
    pub parameters: Vec<ParameterRow>,
    pub calibrations: Vec<CalibrationRow>,
    pub sessions: Vec<Session>,
    pub counts: Vec<Count>,
    pub provenance: Provenance,
}
