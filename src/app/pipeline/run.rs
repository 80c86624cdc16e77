//! One piece of work: read, joined, run through the stages, published.
//!
//! Steps: its name follows from the digests of its inputs, its settings and this version; a lake that has the run is left
//! unchanged, but for the request that makes it the current one (`asked`). Otherwise the sessions are joined, or read as joined where the lake has them (`joined`), the stages run, and all
//! tables are written before the row of `runs` that makes the run exist, and the request after it.

mod asked;
mod error;
mod inputs;
mod known;
mod mounting;
mod page;
pub mod publish;
mod results;
mod session;
mod took;

use std::time::Instant;

use super::compared::pairs;
use super::configuration::Configuration;
use super::fetch::Fetched;
use super::fleet::FleetPiece;
use super::summary::{Summary, summary, when};
use super::words::{notes, words};
use super::{damage, driven, promise};
use crate::files::store::Place;
use crate::geometry::{Transform, symmetric};
use crate::grid::Verdict;
use crate::io::lake::{Commit, ESTIMATES, JOINED, Lake, PAGES, Stage};
use crate::io::rows::Row as _;
use crate::io::tables::runs::RunRow;
use crate::io::tables::words::{TableVerdict, VerdictOf};
use crate::io::tables::{self, PublishContext, PublishError, RunRows};
use crate::join::{SourceId, Station};
use crate::judgement::Outcome;
use crate::manifest::{Replaced, RunKey};
use crate::page::{Statements, instrument};
use crate::progress::Progress;
use crate::report::compared::Pairs;

use error::Result;
pub use error::RunError;
pub(super) use inputs::{input, is_of_session, work};
pub use known::Known;
pub(super) use known::files_of;
use publish::publish;
use results::{Found, Results};
pub(super) use session::SessionSource;
pub use took::{Size, Took};

#[derive(Debug, Clone)]
pub struct Done {
    pub key: RunKey,
    pub already_there: bool,
    /// Number of the last request that changed the current run of its session.
    pub asked: u64,
    /// Which run it took the place of, and how the two differ, in words; `None` where it was current, or the first.
    pub took_place: Option<String>,
    pub verdict: Verdict,
    /// The reason why it is not met or not shown to be, with the judges that decide; `None` where it is met.
    pub reason: Option<String>,
    /// What the verdict is of; `None` of a run of a version that did not say.
    pub verdict_of: Option<VerdictOf>,
    /// Topics of which more was rejected than the pipeline file allows, in words.
    pub rejected: Vec<String>,
    /// The result in ten lines; `None` of a run that the lake had already.
    pub summary: Option<Summary>,
    /// The other results as lines of text.
    pub words: Vec<String>,
    /// The place of the table that corrects targets; `None` of a run that the lake had already.
    pub corrects: Option<Place>,
    pub tables: Place,
    /// Place of its page; `None` for runs of versions without pages.
    pub page: Option<Place>,
    /// Time and memory of the work; `None` of a run that the lake had already.
    pub took: Option<Took>,
}

impl Done {
    /// Whether the tolerance is met, and no more was rejected than allowed.
    pub fn is_good(&self) -> bool {
        self.verdict == Verdict::Meets && self.rejected.is_empty()
    }

    /// Whether the tolerance is met; `None` where that is not shown.
    pub(super) const fn met(&self) -> Option<bool> {
        match self.verdict {
            Verdict::Meets => Some(true),
            Verdict::DoesNotMeet => Some(false),
            Verdict::NotShown(_) => None,
        }
    }

    /// A run that the lake had already, as far as its verdict is known.
    fn before(lake: &Lake, key: &RunKey, met: Option<bool>, reason: Option<String>) -> Self {
        Self {
            key: key.clone(),
            already_there: true,
            asked: 0,
            took_place: None,
            verdict: match met {
                Some(true) => Verdict::Meets,
                Some(false) => Verdict::DoesNotMeet,
                None => Verdict::NotShown(reason.clone().unwrap_or_default()),
            },
            reason,
            verdict_of: None,
            rejected: Vec::new(),
            summary: None,
            words: Vec::new(),
            corrects: None,
            tables: lake.root(),
            page: None,
            took: None,
        }
    }
}

/// The result of a stage, for later runs to start from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StageDone {
    pub stage: Stage,
    pub run: String,
    pub already_there: bool,
    pub words: String,
}

/// Does one piece of work; logs on object storage are fetched for it, and their copies removed afterwards.
pub fn run_piece(own: FleetPiece<'_>, progress: &dyn Progress) -> Result<Done> {
    let begun = Instant::now();
    let done = with_files(own, |local| run_local(local, progress))?;
    let took = (!done.already_there).then(|| Took::since(begun, Size::of(own)));
    Ok(Done { took, ..done })
}

/// The result of a stage of a piece of work, for later runs to start from: of its first session, where it is joined. Fetched likewise.
pub fn stage_piece(
    own: FleetPiece<'_>,
    stage: Stage,
    progress: &dyn Progress,
) -> Result<StageDone> {
    with_files(own, |local| {
        let (results, piece) = (Results::of(local, progress)?, local.piece);
        if stage == JOINED {
            let none = || RunError::NoRobotName { session: piece.session.clone() };
            let files = piece.training.first().ok_or_else(none)?;
            let found = results.session(files, None)?;
            let joined = &found.value.joined;
            let (dwells, paired) = (joined.stations.len(), joined.paired());
            return Ok(found.done(stage, format!("{dwells} dwells, {paired} measured")));
        }
        let estimate = results.estimate(results.sessions(piece, None)?)?;
        if stage == ESTIMATES {
            let words = format!(
                "{} readings, misfit of the geometry {:.4} mm rms per axis",
                estimate.value.observations(),
                estimate.value.misfit_mm()
            );
            return Ok(estimate.done(stage, words));
        }
        let found = results.outcome(estimate)?;
        let grids = &found.value.grids;
        let chosen = grids.chosen().map(|row| format!("{} mm is chosen", row.step_mm));
        let chosen = chosen.unwrap_or_else(|| "none gives a table".to_owned());
        Ok(found.done(stage, format!("{} judged steps, {chosen}", grids.answers.len())))
    })
}

/// Work with all files of a piece on this machine.
fn with_files<T>(own: FleetPiece<'_>, work: impl Fn(FleetPiece<'_>) -> Result<T>) -> Result<T> {
    let fetched = Fetched::of(&own.configuration.tree, own.piece)?;
    work(FleetPiece { piece: &fetched.piece, ..own }).map_err(|error| {
        if fetched.copies.is_empty() {
            return error;
        }
        RunError::Copied {
            session: error.session().map(str::to_owned),
            is_fault: error.is_fault(),
            words: fetched.told(&error.to_string()),
        }
    })
}

/// Does one piece of work whose logs are on this machine.
fn run_local(local: FleetPiece<'_>, progress: &dyn Progress) -> Result<Done> {
    let FleetPiece { configuration, piece, .. } = local;
    let results = Results::of(local, progress)?;
    let Results { work, lake, .. } = &results;
    let key = work.key();
    let Some(mut run) = lake.start(&key)? else { return already_there(configuration, lake, &key) };
    let sessions = results.sessions(piece, Some(&mut run))?;
    let made_of = sessions.made_of.clone();
    let estimate = results.estimate(sessions)?;
    let estimated = estimate.key.run.clone();
    let Found { value: outcome, key: grids, .. } = results.outcome(estimate)?;
    let context = PublishContext {
        made_of,
        estimate: estimated,
        grids: grids.run,
        ..context(configuration, &outcome, lake.current(&key)?)
    };
    let promised =
        promise::held(configuration.file.report.plan.as_ref(), &outcome, lake, &key.robot)?;
    let driven =
        driven::words(&outcome, &configuration.arm, &configuration.file.robot.valid_for, lake)?;
    let state = driven.state;
    let remarks: Vec<String> = driven.lines.into_iter().chain(promised.words()).collect();
    let rows = RunRows::of(&outcome, &context, &key)?;
    let parameters = &rows.parameters.rows;
    let summary = summary(&outcome, configuration, parameters, &context.pairs, state.as_deref());
    let said = said(configuration, &outcome, &summary, &remarks, state, context.pairs.clone())?;
    let corrects = lake.place(summary.next.table(), &key)?;
    let commit = publish(&outcome, rows, &context, run, work, &said)?;
    let done = Done {
        already_there: commit == Commit::AlreadyThere,
        verdict: outcome.verdict.verdict(),
        verdict_of: Some(outcome.verdict.applied.into()),
        rejected: said.rejected,
        summary: Some(summary),
        words: words(&outcome).into_iter().chain(remarks).collect(),
        corrects: Some(corrects),
        tables: configuration.lake.clone(),
        page: page(lake, &key)?,
        ..Done::before(lake, &key, None, outcome.verdict.reason())
    };
    Ok(done.asked_for(lake)?)
}

/// The statements of the page that no table has.
fn said(
    configuration: &Configuration,
    outcome: &Outcome<'_>,
    summary: &Summary,
    remarks: &[String],
    table_state: Option<String>,
    pairs: Pairs,
) -> Result<Statements, PublishError> {
    let counts = serde_json::to_string(&tables::counts::counts(outcome))?;
    Ok(Statements {
        rejected: damage::rejected_beyond(&counts, configuration.file.input.max_rejected_share),
        warnings: summary.warnings.clone(),
        doubts_set_up: outcome.doubts_set_up(),
        notes: notes(outcome).into_iter().chain(remarks.iter().cloned()).collect(),
        table_state,
        measured: when(outcome),
        instruments: instruments(configuration),
        pairs,
    })
}

/// What the sessions were measured with, as the pipeline and robot files state it: what it is, and its name or uncertainty.
fn instruments(configuration: &Configuration) -> Vec<(&'static str, String)> {
    let stated = &configuration.file.robot.valid_for;
    let noise = &configuration.stages.noise;
    let of = &noise.source(SourceId::ONLY).uncertainty;
    let of_readings = configuration.reads.of_readings();
    let tracker = format!("{of_readings}: {}", instrument(of, noise.takes_orientations()));
    let stated = [
        ("Arm", Some(configuration.arm.model().to_owned())),
        ("Controller", stated.controller_model.clone()),
        ("Tool", stated.tool.clone()),
        ("Tracker", Some(tracker)),
    ];
    stated.into_iter().filter_map(|(what, words)| Some((what, words?))).collect()
}

/// Place of the page of a run; `None` where it has none, as of a version without pages.
pub(super) fn page(lake: &Lake, key: &RunKey) -> Result<Option<Place>> {
    let page = lake.place(PAGES, key)?;
    Ok(lake.has(PAGES, key)?.then_some(page))
}

/// The result of a run that the lake has already, which becomes the current one.
fn already_there(configuration: &Configuration, lake: &Lake, key: &RunKey) -> Result<Done> {
    let row = RunRow::read(&lake.read(RunRow::TABLE, key)?).pop();
    let row = row.as_ref();
    let met = row.and_then(|row| match row.ending.verdict {
        TableVerdict::Met => Some(true),
        TableVerdict::NotMet => Some(false),
        TableVerdict::NotShown => None,
    });
    let counts = row.map_or("[]", |row| &row.counts);
    let done = Done {
        verdict_of: row.and_then(|row| row.ending.verdict_of),
        rejected: damage::rejected_beyond(counts, configuration.file.input.max_rejected_share),
        page: page(lake, key)?,
        ..Done::before(lake, key, met, row.and_then(|row| row.ending.reason.clone()))
    };
    Ok(done.asked_for(lake)?)
}

fn context<'a>(
    configuration: &'a Configuration,
    outcome: &Outcome<'_>,
    replaces: Option<Replaced>,
) -> PublishContext<'a> {
    PublishContext {
        arm: &configuration.arm,
        command_from_base: Transform::claim(configuration.stages.base_from_command.inverse()),
        fit: &configuration.stages.fit,
        full: &configuration.stages.full,
        tolerance: configuration.stages.tolerance,
        noise_mm2: noise_mm2(configuration, outcome),
        valid_for: configuration.file.robot.valid_for.clone(),
        made_of: Vec::new(),
        estimate: String::new(),
        grids: String::new(),
        replaces,
        pairs: pairs(outcome),
    }
}

/// Mean variance per axis of measurement and repeatability over the last session's stations, mm².
fn noise_mm2(configuration: &Configuration, outcome: &Outcome<'_>) -> Option<f64> {
    let session = outcome.training.last()?;
    let noise = configuration.stages.noise.with_stated(&session.stated_sizes);
    let camera2 = outcome.camera_size.map_or(1.0, |found| found.size.powi(2));
    let readings = session.joined.stations.iter().flat_map(Station::measured);
    let variances = readings.filter_map(|reading| {
        let (position, stated) = (reading.position()?, reading.value.point()?.stated_covariance);
        let source = noise.source(reading.source);
        let size2 = camera2 * noise.stated_size(reading.source).position.powi(2);
        let instrument = match stated {
            Some(stated) => symmetric(stated) * size2,
            None => source.uncertainty.covariance(&position) * camera2,
        };
        Some(instrument.trace() / 3.0 + noise.repeatability_mm.powi(2))
    });
    let variances: Vec<f64> = variances.collect();
    (!variances.is_empty()).then(|| variances.iter().sum::<f64>() / variances.len() as f64)
}
