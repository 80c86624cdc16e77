//! Everything one piece of work publishes, before it is made into tables.

use crate::fit::commanded::Commanded;
use crate::fit::full::FullModel;
use crate::fit::scale::SessionScale;
use crate::fit::{Calibration, ErrorBase, ErrorFrame, PoseModel};
use crate::grid::Grids;
use crate::ingest::LogReject;
use crate::join::Joined;
use crate::manifest::RunKey;
use crate::report::driven::{Application, CorrectedTarget, DrivenStation, Matched, Measured};
use crate::report::iso_9283::Iso9283;
use crate::report::verdict::RunVerdict;
use crate::report::{Accuracy, Model, ResidualSet};
use crate::similarity::Semivariogram;

/// One session of a piece of work, read and joined.
#[derive(Debug, Clone)]
pub struct JoinedSession {
    /// Its name.
    pub name: String,
    /// Messages and byte ranges its logs lost.
    pub log_rejects: Vec<LogReject>,
    /// What was read, by kind.
    pub counts: std::collections::BTreeMap<String, u64>,
    /// Its stations and clocks.
    pub joined: Joined,
    /// Its commands.
    pub commanded: Commanded,
    /// The corrected targets that drove it, where its folder has them.
    pub driven_by: Option<DrivenBy>,
    /// The id of the sampling plan it was measured by, where its logs say one.
    pub sampling_plan: Option<String>,
}

/// What drove a session, and which of its stations went where.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivenBy {
    /// The corrected targets.
    pub file: DrivingFile,
    /// For each station its target.
    pub matched: Matched,
}

/// What a session says of the table that drove it.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// The run whose table it was.
    pub key: RunKey,
    /// Which of its tables.
    pub table: String,
    /// Stations that went to a target, in the base frame.
    pub stations: Vec<DrivenStation>,
    /// How the corrections were applied.
    pub application: Application,
    /// Errors before and after; `None` where the stations do not span space.
    pub measured: Option<Measured>,
}

impl Driven {
    /// The errors before and after, where they could be given.
    pub fn sets(&self) -> impl Iterator<Item = &ResidualSet> {
        let measured = self.measured.iter();
        measured.flat_map(|measured| [&measured.before, &measured.after])
    }
}

/// Everything one piece of work found.
#[derive(Debug)]
pub struct Outcome<'a> {
    /// Sessions that trained, in the fit's order.
    pub training: Vec<JoinedSession>,
    /// Sessions that only judge.
    pub test: Vec<JoinedSession>,
    /// The base + target and the geometric calibration.
    pub calibrations: Vec<(Model, Calibration)>,
    /// The full error model, unless it is switched off.
    pub full: Option<FullModel>,
    /// Models made on top of these.
    pub on_top: Vec<(Model, Box<dyn PoseModel>)>,
    /// The model that grids are of.
    pub best: Model,
    /// The scale of each session that trained, in their order.
    pub scales: Vec<SessionScale>,
    /// The base that errors are stated in.
    pub base: ErrorBase,
    /// The error reference frame of the last training session, which table and grids are for.
    pub error_frame: ErrorFrame<'a>,
    /// Residuals by model, split, angles and base.
    pub residuals: Vec<ResidualSet>,
    /// Semivariograms of raw errors and residuals.
    pub semivariograms: Vec<(Model, Vec<Semivariogram>)>,
    /// Steps and table.
    pub grids: Grids,
    /// What the last session says of the table that drove it, if one did.
    pub driven: Option<Driven>,
    /// Whether the tolerance is met: the worst of held-out blocks and of every test session.
    pub verdict: RunVerdict,
    /// Figures with verdicts.
    pub accuracy: Vec<Accuracy>,
    /// The same for the tool tip; none where the pipeline file does not say where it is.
    pub at_tip: Vec<Accuracy>,
    /// Figures of repeated visits.
    pub iso_9283: Vec<Iso9283>,
}

/// What drove a session.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivingFile {
    /// The run whose table corrected the targets.
    pub key: RunKey,
    /// Which of its tables: `compensation` or `calibrations`.
    pub table: String,
    /// Targets with their commands, in the file's order.
    pub targets: Vec<CorrectedTarget>,
    /// Targets without a command.
    pub refused: usize,
}
