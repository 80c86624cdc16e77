//! Judgement: joined sessions → [`Outcome`]. It calls the stages after the join in order: fit, residuals, similarity, grid,
//! accuracy.

mod between_sessions;
mod cameras;
mod copies;
mod driven;
mod estimate;
mod figures;
mod flanges;
mod gridded;
mod iso_9283;
mod judged;
mod lengths;
mod limits;
mod mountings;
mod observed;
mod outcome;
mod repairs;
pub mod scales;
mod stated;
mod stated_sizes;
mod turns;
mod unseen;
mod wrong_targets;

use nalgebra::{Isometry3, UnitVector3, Vector3};
use thiserror::Error;

use crate::fit::full::{FullSettings, Repair};
use crate::fit::same_arm::NotOneArm;
use crate::fit::saved::SavedError;
use crate::fit::{
    ErrorBase, FitError, FitSettings, FramePair, Frames, Models, Noise, SurveyedBase,
};
use crate::grid::{GridError, GridSettings, StepAnswers, Tolerance};
use crate::join::SeveralSources;
use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::report::locate::Locate;
use crate::report::{Angles, Model, Residual, ResidualSet, Split};
use crate::similarity::{self, ErrorSample, SimilaritySettings};
use between_sessions::add_between_session_variation;
pub use estimate::{Estimate, StoredTrainings, estimate};
use figures::FigureMaker;
use gridded::{grid_stations, grids};
use judged::{TestSession, raw_command, unseen_sessions};
pub use outcome::{
    Driven, DrivenBy, DrivingFile, JoinedSession, LengthResidual, Outcome, SeveralTargets,
    ShownFlange, Source,
};
use unseen::Judges;

/// The settings of the stages.
#[derive(Debug, Clone)]
pub struct StageSettings {
    /// The measurement's uncertainty.
    pub noise: Noise,
    /// The geometric fit.
    pub fit: FitSettings,
    /// The full error model.
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
    /// Semivariograms.
    pub similarity: SimilaritySettings,
    /// Steps and nodes.
    pub grid: GridSettings,
    /// The tolerance: limit, share of positions and confidence.
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

/// The reason why a stage has no result.
#[derive(Debug, Error)]
pub enum StageError {
    /// The fit failed.
    #[error("fit: {0}")]
    Fit(#[from] FitError),
    /// A session with several sources.
    #[error("session {session}: {source}")]
    SeveralIn {
        /// The session's name.
        session: String,
        /// Their number.
        source: SeveralSources,
    },
    /// A session that only judges, without positions.
    #[error(
        "session {session} judges, but its stations have readings of one length alone: positions are judged by an instrument that reads \
         them; let it train, or judge by a session with positions"
    )]
    NoPlaces {
        /// The session's name.
        session: String,
    },
    /// A session that judges with stations that train.
    #[error(
        "session {session} judges, but {copies} of its {stations} measured stations train under another name: joint angles and readings \
         equal those of {of} to the last bit, and what was learnt from cannot show what was learnt; take {session} out of [input] test, or \
         {of} out of the sessions that are learnt from"
    )]
    Copied {
        /// The session's name.
        session: String,
        /// The sessions that train with these stations, by name.
        of: String,
        /// Number of these stations.
        copies: usize,
        /// Number of the session's measured stations.
        stations: usize,
    },
    /// A model with several sources.
    #[error("fit: {0}")]
    Several(#[from] SeveralSources),
    /// Targets under each other's names in a whole session.
    #[error(
        "session {session}: targets are swapped throughout, by {against}: {swap}; correct the names in the input, or what is stated of them"
    )]
    SwappedTargets {
        /// The session's name.
        session: String,
        /// Which, with the misfit as named and swapped.
        swap: String,
        /// What the places were held against.
        against: String,
    },
    /// Several targets of a session's own.
    #[error(
        "[report] locate = {{ target = \"own\" }} finds one target of a session's own, but there are {targets} at the flange: leave it out \
         where they stayed in their places"
    )]
    OwnTargets {
        /// Number of targets.
        targets: usize,
    },
    /// The sessions cannot be pooled.
    #[error("fit: {0}")]
    NotOneArm(#[from] NotOneArm),
    /// A session without a date, where a joint was repaired.
    #[error(
        "session {session} has no date, so it is not known whether it came before a repair that [[fit.full.repaired]] states: its stations \
         have no time, or its clock no epoch; leave the session out, or the repair"
    )]
    Undated {
        /// The session's name.
        session: String,
    },
    /// A session that judges an arm of which a joint was repaired since.
    #[error(
        "session {session} judges the arm, but it is from before the repair of joint {} on {} ([[fit.full.repaired]]): let the last session of \
         [input] sessions, and those of [input] test, be after it",
        repair.joint, repair.from.0
    )]
    BeforeRepair {
        /// The session's name.
        session: String,
        repair: Repair,
    },
    /// Trainings of the lake that do not fit the sessions.
    #[error("fit: what the lake has of it cannot be used: {0}")]
    Stored(#[from] SavedError),
    /// The grids cannot be made.
    #[error("grid: {0}")]
    Grid(#[from] GridError),
}

/// All results that follow from joined sessions.
pub fn run<'a>(
    arm: &'a Arm,
    training: Vec<JoinedSession>,
    test: Vec<JoinedSession>,
    settings: &StageSettings,
    progress: &dyn Progress,
) -> Result<Outcome<'a>, StageError> {
    let estimate = estimate(arm, (training, test), None, settings, progress)?;
    results(arm, estimate, None, progress)
}

/// The results of an estimate, by stations with one reading each; what steps answer is not found again where it is known.
pub fn results<'a>(
    arm: &'a Arm,
    estimate: Estimate,
    known: Option<Vec<StepAnswers>>,
    progress: &dyn Progress,
) -> Result<Outcome<'a>, StageError> {
    let (trained, flanges, settings) = (estimate.trained, estimate.flanges, &estimate.settings);
    let (observed, models, folds) = (estimate.observed, trained.models, trained.folds);
    let (training, test) = (flanges.training, flanges.test);
    let locator = judged::locator(&test, &models, arm, settings);
    let tested = TestSession::all(&test, flanges.seen, &models, &locator);
    let unseen = mountings::of_one_mounting(unseen_sessions(&models, &tested, &locator)?);
    let mut residuals = estimate.residuals;
    residuals.extend(lengths::of_positions(unseen, &observed));
    let (last, best) = (training.len() - 1, models.best().0);
    let frames = main_frames(&models)?;
    let error_frame = stated::error_frame(arm, &frames[last], settings);
    residuals.extend(raw_command(&training[last], &error_frame, settings));
    let semivariograms = semivariograms(&training[last], &residuals, &settings.similarity);
    let folds_of = observed.folds_of(last);
    let fold = |own| folds_of.get(&own).copied();
    let mut stations = grid_stations(&training[last], &error_frame, fold);
    add_between_session_variation(&mut stations, &training[last], last, &models, &error_frame);
    let mut grids = grids(
        &stations,
        &error_frame,
        &models,
        &folds,
        (last, &tested),
        (settings, known),
        progress,
    )?;
    let judges = Judges {
        arm,
        models: &models,
        frames: &frames,
        locator: &locator,
        test: &tested,
        own: (&training[last], last),
        error_frame: &error_frame,
        settings,
    };
    judges.judge_table(&mut grids);
    let driven = driven::judged(&training[last], &error_frame, settings);
    let iso_9283 = iso_9283::Sources {
        arm,
        frames: &frames,
        training: &training,
        test: &tested,
        residuals: &residuals,
        driven: driven.as_ref(),
        settings,
        guard_mm: grids.guard_mm,
    }
    .figures();
    let maker = FigureMaker {
        settings,
        training: &training,
        test: &tested,
        frames: &frames,
        error_frame: &error_frame,
        stations: &stations,
        grids: &grids,
    };
    let mut accuracy = maker.figures(&residuals, driven.as_ref());
    accuracy.extend(unseen::table_figures(&grids, &tested, &settings.locate));
    let mut at_tip = maker.at_tip(&residuals, driven.as_ref());
    let scales = scales::scales(&observed, &models, &training, settings);
    scales::withhold(&scales, &mut grids, accuracy.iter_mut().chain(&mut at_tip));
    let verdict = judges.verdict(&grids, &accuracy, &residuals, (&observed, &semivariograms))?;
    if let Some(driven) = &driven {
        residuals.extend(driven.sets().cloned());
    }
    Ok(Outcome {
        best,
        targets: flanges.targets,
        frame: stated::frame(&error_frame, &models.base_target, last, settings),
        training,
        test,
        calibrations: vec![
            (Model::BaseTarget, models.base_target),
            (Model::Geometric, models.geometric),
        ],
        full: models.full,
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

/// The main frames of each session by base + target.
fn main_frames(models: &Models) -> Result<Vec<FramePair>, SeveralSources> {
    models.base_target.frames.iter().map(Frames::main).collect()
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
    let of_each = |model: &Model| of(*model, *model.about().angles.first()?);
    Model::ALL.iter().filter_map(of_each).collect()
}
