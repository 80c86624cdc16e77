//! Judgement: joined sessions → [`Outcome`]. It calls, in order: fit, residuals, similarity, grid, accuracy.

mod between_sessions;
mod checks;
mod commands;
mod corrections;
mod estimate;
mod figures;
mod flanges;
pub mod gravity;
mod gridded;
mod iso_9283;
mod judged;
mod lengths;
mod limits;
mod mountings;
mod observed;
mod outcome;
pub mod rounded;
pub mod sizes;
mod stated;
mod suspects;
mod unseen;

use std::collections::BTreeMap;

use nalgebra::{Isometry3, UnitVector3, Vector3};
use thiserror::Error;

use crate::fit::full::{FullSettings, Repair};
use crate::fit::same_arm::NotOneArm;
use crate::fit::saved::SavedError;
use crate::fit::{
    ErrorBase, ErrorFrame, FitError, FitSettings, Frames, Models, Noise, SurveyedBase,
};
use crate::grid::{GridError, GridSettings, GridStation, StepAnswers, Tolerance};
use crate::join::SeveralSources;
use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::report::locate::Locate;
use crate::report::{Angles, Model, Residual, ResidualSet, Split};
use crate::similarity::{self, ErrorSample, SimilaritySettings};
use between_sessions::add_between_session_variation;
use commands::raw_command;
use corrections::Corrections;
use estimate::Trained;
pub use estimate::{Estimate, StoredTrainings, estimate};
use gridded::grid_stations;
use judged::{Judges, TestSession, unseen_sessions};
use observed::Observed;
pub use outcome::{
    Driven, DrivenBy, DrivingFile, JoinedSession, LengthResidual, Outcome, SeveralTargets,
    ShownFlange, Source,
};

#[derive(Debug, Clone)]
pub struct StageSettings {
    pub noise: Noise,
    pub fit: FitSettings,
    pub full: FullSettings,
    /// Direction against gravity in the base frame; `None` where the mounting is not known.
    pub up: Option<UnitVector3<f64>>,
    /// The controller's own tool at the flange, which commands are for; `None`: the fitted target.
    pub flange_from_tool: Option<Isometry3<f64>>,
    /// The frame that commands are stated in, in the base frame.
    pub base_from_command: Isometry3<f64>,
    /// The base frame that errors, table and verdict are stated in, where the pipeline file says so; fitted otherwise.
    pub base: Option<ErrorBase>,
    /// Whether the commanded point is the measured target; `None` without commands.
    pub target_is_tool: Option<bool>,
    pub similarity: SimilaritySettings,
    pub grid: GridSettings,
    pub tolerance: Tolerance,
    /// How base and target of an unseen session are found.
    pub locate: Locate,
    /// Whether each session of a pool is judged by a training on the others.
    pub leave_sessions_out: bool,
    /// Position of the tool tip at the flange, along the flange's axes, mm; `None` where no figures are asked for it.
    pub tool_tip: Option<Vector3<f64>>,
}

impl StageSettings {
    /// The base frame that errors are stated in, in words.
    pub const fn base_in_words(&self) -> &'static str {
        match self.base {
            None => {
                "base as base + target fit it; no errors against the raw command ([tracker] tracker_from_base is not given)"
            }
            Some(ErrorBase::Fitted) => "base as base + target fit it: set the robot's base to it",
            Some(ErrorBase::Surveyed(_)) => "surveyed base",
        }
    }

    /// The surveyed base, where errors are stated in one.
    pub const fn surveyed(&self) -> Option<&SurveyedBase> {
        match &self.base {
            Some(ErrorBase::Surveyed(base)) => Some(base),
            Some(ErrorBase::Fitted) | None => None,
        }
    }
}

#[derive(Debug, Error)]
pub enum StageError {
    #[error("fit: {0}")]
    Fit(#[from] FitError),
    #[error("session {session}: {source}")]
    SeveralIn { session: String, source: SeveralSources },
    #[error(
        "session {session} judges, but its stations have readings of one length alone: positions are judged by an instrument that reads \
         them; let it train, or judge by a session with positions"
    )]
    NoPlaces { session: String },
    #[error(
        "session {session} judges, but {copies} of its {stations} measured stations train under another name: joint angles and readings \
         are those of {of}, at most rounded or moved as one, and what was learnt from cannot show what was learnt; take {session} out of [input] test, or \
         {of} out of the sessions that are learnt from"
    )]
    Copied { session: String, of: String, copies: usize, stations: usize },
    #[error(
        "session {session}: its readings are its commanded positions, at most moved as one, to less than any arm and any instrument leave; give \
         what the instrument measured"
    )]
    Commanded { session: String },
    #[error("fit: {0}")]
    Several(#[from] SeveralSources),
    #[error(
        "session {session}: targets are swapped throughout, by {against}: {swap}; correct the names in the input, or what is stated of them"
    )]
    SwappedTargets { session: String, swap: String, against: String },
    #[error(
        "[report] locate = {{ target = \"own\" }} finds one target of a session's own, but there are {targets} at the flange: leave it out \
         where they stayed in their places"
    )]
    OwnTargets { targets: usize },
    #[error("fit: {0}")]
    NotOneArm(#[from] NotOneArm),
    #[error(
        "session {session} has no date, so it is not known whether it came before a repair that [[fit.full.repaired]] states: its stations \
         have no time, or its clock no epoch; leave the session out, or the repair"
    )]
    Undated { session: String },
    #[error(
        "session {session} judges the arm, but it is from before the repair of joint {} on {} ([[fit.full.repaired]]): let the last session of \
         [input] sessions, and those of [input] test, be after it",
        repair.joint, repair.from.0
    )]
    BeforeRepair { session: String, repair: Repair },
    #[error("fit: what the lake has of it cannot be used: {0}")]
    Stored(#[from] SavedError),
    #[error("grid: {0}")]
    Grid(#[from] GridError),
}

/// The results of an estimate, by stations with one reading each; what steps answer is not found again where it is known.
pub fn results<'a>(
    arm: &'a Arm,
    estimate: Estimate,
    known: Option<Vec<StepAnswers>>,
    progress: &dyn Progress,
) -> Result<Outcome<'a>, StageError> {
    let Estimate { trained, flanges, observed, settings, mut residuals, .. } = estimate;
    let Trained { models, folds, .. } = trained;
    let (training, test, settings) = (flanges.training, flanges.test, &settings);
    let locator = judged::locator(&test, &models, arm, settings);
    let tested = TestSession::all(&test, flanges.seen, &models, &locator);
    let unseen = unseen_sessions(&models, &tested, &locator)?;
    residuals.extend(mountings::of_one_mounting(unseen, &observed));
    let last = training.len() - 1;
    let frames = models.base_target.frames.iter().map(Frames::main);
    let frames = frames.collect::<Result<Vec<_>, _>>()?;
    let error_frame = stated::error_frame(arm, &frames[last], settings);
    residuals.extend(raw_command(&training[last], &error_frame, settings));
    let semivariograms = semivariograms(&training[last], &residuals, &settings.similarity);
    let judges = Judges {
        arm,
        models: &models,
        frames: &frames,
        training: &training,
        observed: &observed,
        test: &tested,
        locator: &locator,
        error_frame: &error_frame,
        stations: &stations(&training, &observed, &models, &error_frame),
        settings,
    };
    let Corrections { grids, driven, scales, accuracy, at_tip, iso_9283, verdict } =
        judges.corrections(judges.grids(&folds, known, progress)?, &residuals, &semivariograms)?;
    residuals.extend(driven.iter().flat_map(Driven::sets).cloned());
    let best = models.best().0;
    let Models { base_target, geometric, full } = models;
    Ok(Outcome {
        best,
        targets: flanges.targets,
        frame: stated::frame(&error_frame, &base_target, last, settings),
        training,
        test,
        calibrations: vec![(Model::BaseTarget, base_target), (Model::Geometric, geometric)],
        full,
        camera_size: estimate.camera_size,
        stated_sizes: estimate.stated_sizes,
        scales,
        sources: estimate.sources,
        length_residuals: estimate.length_residuals,
        error_frame,
        residuals,
        semivariograms,
        grids,
        driven,
        verdict,
        accuracy,
        iso_9283,
        at_tip,
    })
}

/// Stations of the last training session, which the table is for, with their folds and between-session variation.
fn stations(
    training: &[JoinedSession],
    observed: &Observed,
    models: &Models,
    error_frame: &ErrorFrame<'_>,
) -> Vec<GridStation> {
    let last = training.len() - 1;
    let folds: BTreeMap<usize, usize> =
        observed.of_session(last).map(|(own, fold)| (own.station, fold)).collect();
    let fold = |station| folds.get(&station).copied();
    let mut stations = grid_stations(&training[last], error_frame, fold);
    add_between_session_variation(&mut stations, &training[last], last, models, error_frame);
    stations
}

/// Semivariograms of the errors that each model leaves on the session that it was trained on.
fn semivariograms(
    session: &JoinedSession,
    residuals: &[ResidualSet],
    settings: &SimilaritySettings,
) -> Vec<(Model, Vec<similarity::Semivariogram>)> {
    let joints = |number: usize| {
        session
            .joined
            .stations
            .iter()
            .find(|station| station.number == number)
            .map(|station| station.joints.clone())
    };
    let of = |model: Model, angles: Angles| {
        let set = residuals.iter().find(|set| {
            let subject = &set.subject;
            (subject.model, subject.angles, subject.split) == (model, angles, Split::None)
                && subject.of_session == session.name
        })?;
        let sample = |r: &Residual| {
            Some(ErrorSample {
                joints: joints(r.station)?,
                position: r.predicted(),
                error: r.residual,
            })
        };
        let own = set.residuals.iter().filter(|own| own.is_of_main());
        let samples: Vec<_> = own.filter_map(sample).collect();
        Some((model, similarity::semivariograms(&samples, settings)))
    };
    Model::ALL.iter().filter_map(|model| of(*model, *model.about().angles.first()?)).collect()
}
