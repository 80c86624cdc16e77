//! All results of one piece of work, before they are made into tables.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::fit::camera_size::CameraSize;
use crate::fit::commanded::Commanded;
use crate::fit::full::FullModel;
use crate::fit::scale::SessionScale;
use crate::fit::stated_size::FoundSize;
use crate::fit::{Calibration, ErrorFrame, Gauge, SourceSize, StatedSize};
use crate::grid::Grids;
use crate::ingest::LogReject;
use crate::join::{Joined, ReadingKind, SourceId, TargetId, began};
use crate::manifest::RunKey;
use crate::report::driven::{Application, CorrectedTarget, DrivenStation, Matched, Measured};
use crate::report::frame::StatedFrame;
use crate::report::iso_9283::Iso9283;
use crate::report::verdict::RunVerdict;
use crate::report::{Accuracy, Model, ResidualSet};
use crate::setup::Finding;
use crate::similarity::Semivariogram;
use crate::units::WallTime;

/// One session of a piece of work, read and joined.
#[derive(Debug, Clone)]
pub struct JoinedSession {
    pub name: String,
    /// Messages and byte ranges that its logs lost.
    pub log_rejects: Vec<LogReject>,
    /// Number of items read, by kind.
    pub counts: BTreeMap<String, u64>,
    pub joined: Joined,
    pub commanded: Commanded,
    /// The corrected targets that drove it; `None` where its folder has none.
    pub driven_by: Option<DrivenBy>,
    /// The id of the sampling plan it was measured by; `None` where its logs name none.
    pub sampling_plan: Option<String>,
    /// A small disagreement of its logs with the stated set-up; `None` where they agree.
    pub set_up: Option<Finding>,
    /// Size of the covariances its readings state, by source, as [`Noise::stated`](crate::fit::Noise); empty until estimated.
    pub stated_sizes: Vec<StatedSize>,
}

impl JoinedSession {
    /// Start of the session by the clock of its logs that has an epoch ([`began()`]); `None` where neither has one.
    pub fn started(&self) -> Option<WallTime> {
        Some(began(&self.joined.clock.model)?.at)
    }
}

/// The corrected targets that drove a session, and the target of each station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DrivenBy {
    pub file: DrivingFile,
    pub matched: Matched,
}

/// The judgement of a session on the table that drove it.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    pub key: RunKey,
    pub table: String,
    /// Stations that went to a target, in the base frame.
    pub stations: Vec<DrivenStation>,
    pub application: Application,
    /// Errors before and after; `None` where the stations do not span space.
    pub measured: Option<Measured>,
}

impl Driven {
    /// The errors before and after; empty where they could not be found.
    pub fn sets(&self) -> impl Iterator<Item = &ResidualSet> {
        let measured = self.measured.iter();
        measured.flat_map(|measured| [&measured.before, &measured.after])
    }
}

/// Several targets at the flange, and what their readings show of it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SeveralTargets {
    /// Their names, in their order; empty where there is one, or where they have none.
    pub names: Vec<String>,
    /// What the stations of each session with several targets show, training sessions first.
    pub sessions: Vec<ShownFlange>,
}

/// The part of one instrument in one model.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    pub model: Model,
    pub name: String,
    /// Its readings, and its part in the fit; of the full error model that of the identified geometry.
    pub size: SourceSize,
    /// Factor from stated to found standard deviations; `None` where the model has none for it.
    pub factor: Option<f64>,
    /// Whether `size` is of the model itself.
    pub is_fitted: bool,
    /// The instrument as the model has it in the last session that trained; `None` of one that reads places.
    pub gauge: Option<Gauge>,
    pub held_out: usize,
    /// Root mean square of measured minus predicted over them, mm; `None` without any.
    pub held_out_rms_mm: Option<f64>,
}

/// Measured minus predicted length of one reading by one model.
#[derive(Debug, Clone, PartialEq)]
pub struct LengthResidual {
    pub model: Model,
    /// The fold that held the reading out; `None` where it trained.
    pub fold: Option<usize>,
    pub session: String,
    pub station: usize,
    /// Number of the station that names its pose; all visits of one pose share it.
    pub pose: usize,
    pub source: SourceId,
    pub name: String,
    pub kind: ReadingKind,
    /// The target that was read; `None` where the session has one.
    pub target: Option<TargetId>,
    pub measured_mm: f64,
    pub predicted_mm: f64,
    /// Standard deviation of measured minus predicted, mm, of prediction and noise together; `None` of a model without a covariance.
    pub sd_mm: Option<f64>,
    /// Robust weight of the reading in training; `None` where it was held out.
    pub weight: Option<f64>,
}

impl LengthResidual {
    /// Measured minus predicted, mm.
    pub fn residual_mm(&self) -> f64 {
        self.measured_mm - self.predicted_mm
    }
}

/// Stations of a session with several targets, by what stands for their readings ([`crate::fit::flange`]).
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ShownFlange {
    pub session: String,
    /// Stations whose targets show position and orientation.
    pub poses: usize,
    /// Stations with the main target's position alone.
    pub points: usize,
    /// Stations with readings of other targets alone, too few for a pose: they count in the fit, and have no error of the tool point.
    pub neither: usize,
}

#[derive(Debug)]
pub struct Outcome<'a> {
    /// Sessions that trained, in the fit's order.
    pub training: Vec<JoinedSession>,
    pub test: Vec<JoinedSession>,
    /// The base + target and the geometric calibration.
    pub calibrations: Vec<(Model, Calibration)>,
    /// The full error model, unless it is switched off.
    pub full: Option<FullModel>,
    /// The size of a camera's noise; `None` of other instruments.
    pub camera_size: Option<CameraSize>,
    /// The size of the covariances that readings state, of each session that trained and source that determine one.
    pub stated_sizes: Vec<FoundSize>,
    /// The best model that was identified; node values of grids are of it.
    pub best: Model,
    /// The scale of each session that trained, in their order.
    pub scales: Vec<SessionScale>,
    pub sources: Vec<Source>,
    /// Every reading of one length by each model: in training, and held out.
    pub length_residuals: Vec<LengthResidual>,
    /// The sessions' targets, where there are several.
    pub targets: SeveralTargets,
    pub frame: StatedFrame,
    /// The error reference frame of the last training session, which table and grids are for.
    pub error_frame: ErrorFrame<'a>,
    /// Residuals by model, split, angles and base.
    pub residuals: Vec<ResidualSet>,
    pub semivariograms: Vec<(Model, Vec<Semivariogram>)>,
    pub grids: Grids,
    /// The judgement of the last session on the table that drove it; `None` where none did.
    pub driven: Option<Driven>,
    /// Whether the tolerance is met: the worst of held-out blocks and of every test session.
    pub verdict: RunVerdict,
    pub accuracy: Vec<Accuracy>,
    /// Figures of the tool tip, with verdicts; empty where the pipeline file does not state its position.
    pub at_tip: Vec<Accuracy>,
    pub iso_9283: Vec<Iso9283>,
}

impl Outcome<'_> {
    pub fn starts(&self) -> BTreeMap<&str, WallTime> {
        let sessions = self.training.iter().chain(&self.test);
        let started = sessions.map(|session| Some((session.name.as_str(), session.started()?)));
        started.flatten().collect()
    }

    /// Whether neither a tool of the controller is stated nor a command: errors are those of the measured target.
    pub fn tool_is_target(&self) -> bool {
        let mut commanded = self.training.iter().flat_map(|session| &session.commanded.poses);
        !self.error_frame.tool_is_stated && commanded.all(Option::is_none)
    }

    /// Whether the logs of some session disagree with the stated set-up.
    pub fn doubts_set_up(&self) -> bool {
        let mut sessions = self.training.iter().chain(&self.test);
        sessions.any(|session| session.set_up.is_some())
    }
}

/// The commands that drove a session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DrivingFile {
    /// The run whose table corrected the targets.
    pub key: RunKey,
    /// Name of the table: `compensation` or `calibrations`.
    pub table: String,
    /// Targets with their commands, in the file's order.
    pub targets: Vec<CorrectedTarget>,
    pub refused: usize,
}
