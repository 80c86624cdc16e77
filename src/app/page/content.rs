//! The content of a page: rows of a run's published tables, and statements of the run that no table has.

use crate::grid::Tolerance;
use crate::io::tables::accuracy::AccuracyRow;
use crate::io::tables::calibrations::CalibrationRow;
use crate::io::tables::clocks::ClockRow;
use crate::io::tables::grid_steps::StepRow;
use crate::io::tables::joint_errors::JointErrorRow;
use crate::io::tables::parameters::ParameterRow;
use crate::io::tables::rejects::RejectRow;
use crate::io::tables::semivariograms::SemivariogramRow;
use crate::io::tables::stations::{PairingVerdict, Unpaired};
use crate::manifest::{RunKey, StageCount, Work, Written};
use crate::report::compared::Pairs;
use crate::report::frame::StatedFrame;
use crate::report::next::Next;
use crate::report::verdict::RunVerdict;

#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    pub key: RunKey,
    pub tolerance: Tolerance,
    /// Whether it is, by what, and who says so: held-out blocks, and every test session.
    pub verdict: RunVerdict,
    pub frame: StatedFrame,
    pub next: Next,
    /// File name of the robot's page over time; `None` of a name that no lake has.
    pub over_time: Option<String>,
    /// The command that corrects targets by the result, as it is typed beside the folder `lake`; `None` where nothing is corrected.
    pub command: Option<String>,
    /// Least and largest coordinates of the table's nodes, base frame, mm; `None` without a table.
    pub bounds: Option<[[f64; 3]; 2]>,
    pub choice: String,
    pub said: Statements,
    pub steps: Vec<StepRow>,
    pub figures: Vec<AccuracyRow>,
    pub tip: Vec<AccuracyRow>,
    pub semivariograms: Vec<SemivariogramRow>,
    pub joint_errors: Vec<JointErrorRow>,
    pub parameters: Vec<ParameterRow>,
    pub calibrations: Vec<CalibrationRow>,
    pub sessions: Vec<Session>,
    pub counts: Vec<StageCount>,
    pub work: Work,
    pub written: Vec<Written>,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Statements {
    /// Topics of which too much was rejected.
    pub rejected: Vec<String>,
    /// What else has to be known before anything: shown at the head of the page.
    pub warnings: Vec<String>,
    /// Whether one of them is that the logs of a session disagree with the stated set-up.
    pub doubts_set_up: bool,
    pub notes: Vec<String>,
    /// When the sessions were measured, by their logs, in words; `None` where these do not tell.
    pub measured: Option<String>,
    /// What they were measured with: what it is, and its name or uncertainty.
    pub instruments: Vec<(&'static str, String)>,
    pub pairs: Pairs,
    /// Whether the table that drove the session still holds; `None` where no table did.
    pub table_state: Option<String>,
}

impl Statements {
    pub fn all_warnings(&self) -> Vec<String> {
        let rejected = self.rejected.iter();
        let rejected = rejected.map(|topic| format!("Too much rejected: {topic}"));
        rejected.chain(self.warnings.iter().cloned()).collect()
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    pub name: String,
    /// Whether it is a training session; otherwise it is only judged.
    pub trained: bool,
    pub clock: ClockRow,
    /// The number of its dwells for each verdict and reason.
    pub dwells: Vec<(PairingVerdict, Option<Unpaired>, usize)>,
    pub rejects: Vec<RejectRow>,
}
