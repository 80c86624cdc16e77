//! One piece of work: read, joined, run through the stages, published.
//!
//! Steps: its name follows from the digests of its inputs, its settings and this version; a lake that has it is left
//! alone. Otherwise the logs are read and joined, the stages run, and all tables are written before the row of `runs`
//! that makes the run exist.

use std::fs::File;
use std::path::{Path, PathBuf};

use nalgebra::Isometry3;
use thiserror::Error;

use super::damage::{self, DamageError};
use super::driven;
use super::fetch::{FetchError, Fetched};
use super::outcome::{JoinedSession, Outcome};
use super::plan::{Plan, SessionFiles, WorkPiece};
use super::promise;
use super::stages::{self, StageError};
use super::words::{notes, words};
use crate::fit::commanded::{CommandFrames, commanded};
use crate::geometry::Transform;
use crate::grid::Verdict;
use crate::ingest::Recording;
use crate::io::lake::{Commit, Lake, LakeError, OpenRun};
use crate::io::log::{LogError, SessionRead, read_dwells, read_dwells_beside, read_metadata};
use crate::io::page::Said;
use crate::io::store::Place;
use crate::io::tables::logs::LogTable;
use crate::io::tables::{self, GridBasis, PublishContext, PublishError};
use crate::io::targets::TargetsError;
use crate::join::{JoinError, join_at_rest};
use crate::manifest::{self, Input, RunKey, Work};
use crate::progress::Progress;
use crate::report::{Angles, Model, Split};

/// What a finished piece of work comes to.
#[derive(Debug, Clone)]
pub struct Done {
    /// The session of its tables, or `pooled`.
    pub session: String,
    /// The run's name.
    pub run: String,
    /// Whether the lake had it already.
    pub already_there: bool,
    /// Whether the tolerance is met.
    pub verdict: Verdict,
    /// Topics of which more was rejected than the pipeline file allows, in words.
    pub rejected: Vec<String>,
    /// What came out, line by line.
    pub words: Vec<String>,
    /// Where its tables are.
    pub tables: Place,
    /// Where its page is; runs of versions that wrote none have none.
    pub page: Option<Place>,
}

impl Done {
    /// Whether the tolerance is met, and no more was rejected than allowed.
    pub fn is_good(&self) -> bool {
        self.verdict == Verdict::Meets && self.rejected.is_empty()
    }
}

/// Why a piece of work has no result.
#[derive(Debug, Error)]
pub enum RunError {
    /// An input cannot be digested.
    #[error("cannot read {}: {source}", path.display())]
    Input {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A recording that would count twice.
    #[error("{side}: two of its files hold the same: {}; name each part of a split recording once", files.join(", "))]
    SameTwice {
        /// Session and side.
        side: String,
        /// The side's files.
        files: Vec<String>,
    },
    /// A log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// One session of the work cannot be used; a pool may do without it.
    #[error("{source}")]
    OfSession {
        /// The session.
        session: String,
        /// Why.
        source: Box<RunError>,
    },
    /// Neither the pipeline file nor the logs name the robot.
    #[error(
        "session {session}: neither [robot] name nor a metadata record `session` with a `robot` names the robot; name it in the pipeline file"
    )]
    NoRobotName {
        /// The session.
        session: String,
    },
    /// More of a log was lost than the pipeline file allows.
    #[error("session {session}: {0}", damage)]
    Damaged {
        /// The session.
        session: String,
        /// What was lost.
        damage: DamageError,
    },
    /// The logs cannot be joined.
    #[error("session {session}: join: {source}")]
    Join {
        /// The session.
        session: String,
        /// Why.
        source: Box<JoinError>,
    },
    /// A stage after the join.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// What drove a session cannot be read.
    #[error("session {session}: corrected targets: {source}")]
    Driving {
        /// The session.
        session: String,
        /// Why.
        source: Box<TargetsError>,
    },
    /// The tables cannot be published.
    #[error(transparent)]
    Publish(#[from] PublishError),
    /// The lake cannot be read.
    #[error(transparent)]
    Lake(#[from] LakeError),
    /// The logs cannot be fetched.
    #[error(transparent)]
    Fetch(#[from] FetchError),
    /// Any of these, of logs that were fetched, in words that name what they are copies of.
    #[error("{words}")]
    Copied {
        /// The session whose fault it is, where it is one's.
        session: Option<String>,
        /// What is wrong.
        words: String,
    },
}

impl RunError {
    /// The session whose fault it is, where it is one's.
    pub fn session(&self) -> Option<&str> {
        match self {
            Self::OfSession { session, .. } => Some(session),
            Self::Copied { session, .. } => session.as_deref(),
            _ => None,
        }
    }

    fn of(self, files: &SessionFiles) -> Self {
        Self::OfSession {
            session: files.name.clone(),
            source: Box::new(self),
        }
    }
}

/// Does one piece of work; logs on object storage are fetched for it, and their copies removed afterwards.
pub fn run_piece(
    plan: &Plan,
    piece: &WorkPiece,
    progress: &dyn Progress,
) -> Result<Done, RunError> {
    let fetched = Fetched::of(&plan.tree, piece)?;
    let done = run_local(plan, fetched.piece(), progress);
    done.map_err(|error| {
        if fetched.is_copied() {
            RunError::Copied {
                session: error.session().map(str::to_owned),
                words: fetched.told(&error.to_string()),
            }
        } else {
            error
        }
    })
}

/// Does one piece of work whose logs stand on this machine.
fn run_local(plan: &Plan, piece: &WorkPiece, progress: &dyn Progress) -> Result<Done, RunError> {
    let work = work(plan, piece)?;
    let key = work.key();
    let lake = Lake::at(&plan.lake)?;
    let Some(mut run) = lake.start(&key)? else {
        return already_there(plan, &lake, &key);
    };
    let mut joined = |files: &SessionFiles| {
        let read = read_for(plan, files, &mut run, progress);
        let joined = read.and_then(|read| joined(plan, files, read));
        joined.map_err(|error| error.of(files))
    };
    let training = piece
        .training
        .iter()
        .map(&mut joined)
        .collect::<Result<Vec<_>, _>>()?;
    let test = piece
        .test
        .iter()
        .map(&mut joined)
        .collect::<Result<Vec<_>, _>>()?;
    let outcome = stages::run(&plan.arm, training, test, &plan.stages, progress)?;
    let context = context(plan, &outcome, lake.current(&key)?);
    let promised = promise::held(plan.sampling_plan.as_ref(), &outcome, &lake, &key.robot)?.words();
    let driven = driven::words(&outcome, &plan.arm, &plan.valid_for, &lake)?;
    let remarks: Vec<String> = driven.lines.into_iter().chain(promised).collect();
    let said = said(plan, &outcome, &remarks, driven.state)?;
    let commit = tables::publish(&outcome, &context, run, &work, &said)?;
    Ok(Done {
        session: key.session.clone(),
        run: key.run.clone(),
        already_there: commit == Commit::AlreadyThere,
        verdict: outcome.grids.choice.verdict.clone(),
        rejected: rejected(plan, &lake, &key)?,
        words: words(&outcome, plan.stages.tolerance.mm)
            .into_iter()
            .chain(remarks)
            .collect(),
        tables: plan.lake.clone(),
        page: page(&lake, &key)?,
    })
}

/// What the page says besides the tables.
fn said(
    plan: &Plan,
    outcome: &Outcome<'_>,
    remarks: &[String],
    table_state: Option<String>,
) -> Result<Said, PublishError> {
    let counts = serde_json::to_string(&tables::counts::counts(outcome))?;
    Ok(Said {
        warnings: damage::rejected_beyond(&counts, plan.max_rejected_share),
        notes: notes(outcome)
            .into_iter()
            .chain(remarks.iter().cloned())
            .collect(),
        table_state,
    })
}

/// Where the page of a run is, if it has one.
pub(super) fn page(lake: &Lake, key: &RunKey) -> Result<Option<Place>, RunError> {
    let page = lake.page(key)?;
    Ok(lake.has_page(key)?.then_some(page))
}

/// The work's identity. A log is only looked into here where nothing else names the robot.
pub(super) fn work(plan: &Plan, piece: &WorkPiece) -> Result<Work, RunError> {
    let mut inputs = vec![input(&plan.robot_file, "robot")?];
    for files in piece.training.iter().chain(&piece.test) {
        inputs.extend(session_inputs(files).map_err(|error| error.of(files))?);
    }
    let names = |files: &[SessionFiles]| files.iter().map(|files| files.name.clone()).collect();
    Ok(Work {
        robot: robot_name(plan, piece)?,
        session: piece.session.clone(),
        pipeline: plan.pipeline.clone(),
        sessions: names(&piece.training),
        test_sessions: names(&piece.test),
        inputs,
        settings: plan.settings.clone(),
    })
}

fn session_inputs(files: &SessionFiles) -> Result<Vec<Input>, RunError> {
    let (logs, name) = (&files.logs, &files.name);
    let mut inputs = log_inputs(&logs.controller, &format!("{name}/controller"))?;
    if logs.tracker != logs.controller {
        inputs.extend(log_inputs(&logs.tracker, &format!("{name}/tracker"))?);
    }
    let corrected = files.corrected.iter();
    let corrected = corrected.map(|path| input(path, &format!("{name}/corrected")));
    inputs.extend(corrected.collect::<Result<Vec<_>, _>>()?);
    Ok(inputs)
}

/// The files of one side; those of a split recording are numbered by their digests, so that their names do not matter.
fn log_inputs(paths: &[PathBuf], name: &str) -> Result<Vec<Input>, RunError> {
    let inputs = paths.iter().map(|path| input(path, name));
    let mut inputs = inputs.collect::<Result<Vec<_>, _>>()?;
    if inputs.len() < 2 {
        return Ok(inputs);
    }
    inputs.sort_by(|a, b| a.digest.cmp(&b.digest));
    if inputs
        .windows(2)
        .any(|pair| pair[0].digest == pair[1].digest)
    {
        return Err(RunError::SameTwice {
            side: name.to_owned(),
            files: paths
                .iter()
                .map(|path| path.display().to_string())
                .collect(),
        });
    }
    for (place, input) in inputs.iter_mut().enumerate() {
        input.name = format!("{name}/{}", place + 1);
    }
    Ok(inputs)
}

/// A file as an input of a run.
pub(super) fn input(path: &Path, name: &str) -> Result<Input, RunError> {
    let wrong = |source| RunError::Input {
        path: path.to_owned(),
        source,
    };
    let (digest, bytes) = manifest::digest(File::open(path).map_err(wrong)?).map_err(wrong)?;
    Ok(Input {
        name: name.to_owned(),
        bytes,
        digest,
    })
}

fn robot_name(plan: &Plan, piece: &WorkPiece) -> Result<String, RunError> {
    if let Some(name) = &plan.robot {
        return Ok(name.clone());
    }
    let none = || RunError::NoRobotName {
        session: piece.session.clone(),
    };
    let files = piece.training.first().ok_or_else(none)?;
    let mut metadata = read_metadata(&files.logs, plan.limits)?;
    metadata.remove("session.robot").ok_or_else(none)
}

/// What the lake says of a run that it has.
fn already_there(plan: &Plan, lake: &Lake, key: &RunKey) -> Result<Done, RunError> {
    let row = lake.read("runs", key)?;
    let text = |column: &str| {
        row.text(column)
            .iter()
            .flatten()
            .next()
            .unwrap_or_default()
            .to_owned()
    };
    let verdict = match text("verdict").as_str() {
        "met" => Verdict::Meets,
        "not_met" => Verdict::DoesNotMeet,
        _ => Verdict::NotShown(text("reason")),
    };
    Ok(Done {
        session: key.session.clone(),
        run: key.run.clone(),
        already_there: true,
        verdict,
        rejected: rejected(plan, lake, key)?,
        words: vec![
            "the lake has this run already: same inputs, settings and version; nothing was done"
                .to_owned(),
        ],
        tables: lake.root(),
        page: page(lake, key)?,
    })
}

/// Reads a session, and meanwhile writes its decoded samples, where they are to be published.
fn read_for(
    plan: &Plan,
    files: &SessionFiles,
    run: &mut OpenRun<'_>,
    progress: &dyn Progress,
) -> Result<SessionRead, RunError> {
    if !plan.logs {
        return read(plan, files, progress);
    }
    let (logs, mapping, rule) = (&files.logs, &plan.mapping, plan.join.arm_rule());
    let mut samples = LogTable::new(run, &files.name);
    let read = read_dwells_beside(logs, mapping, plan.limits, &rule, &mut samples, progress)?;
    within(plan, files, &read.recording)?;
    if let Some(table) = samples.finish(&read.recording, &*read.readings)? {
        run.keep(table);
    }
    Ok(read)
}

/// Reads a session.
pub(super) fn read(
    plan: &Plan,
    files: &SessionFiles,
    progress: &dyn Progress,
) -> Result<SessionRead, RunError> {
    let rule = plan.join.arm_rule();
    let read = read_dwells(&files.logs, &plan.mapping, plan.limits, &rule, progress)?;
    within(plan, files, &read.recording)?;
    Ok(read)
}

/// That no more of the logs was lost than the pipeline file allows.
fn within(plan: &Plan, files: &SessionFiles, recording: &Recording) -> Result<(), RunError> {
    damage::within(&recording.counts, plan.max_lost_share).map_err(|damage| RunError::Damaged {
        session: files.name.clone(),
        damage,
    })
}

/// Topics of which more was rejected than the pipeline file allows, by what the run's row in `runs` counts.
fn rejected(plan: &Plan, lake: &Lake, key: &RunKey) -> Result<Vec<String>, RunError> {
    let row = lake.read("runs", key)?;
    let counts = row
        .text("counts")
        .iter()
        .flatten()
        .next()
        .unwrap_or("[]")
        .to_owned();
    Ok(damage::rejected_beyond(&counts, plan.max_rejected_share))
}

/// Joins a session that was read.
pub(super) fn joined(
    plan: &Plan,
    files: &SessionFiles,
    read: SessionRead,
) -> Result<JoinedSession, RunError> {
    let wrong = |source| RunError::Join {
        session: files.name.clone(),
        source: Box::new(source),
    };
    let SessionRead {
        recording,
        joints,
        readings,
    } = read;
    let joined = join_at_rest(&recording, &joints, &*readings, &plan.arm, &plan.join);
    let joined = joined.map_err(wrong)?;
    let no_commands = CommandFrames {
        base_from_command: Isometry3::identity(),
        flange_from_tool: None,
    };
    let commanded = commanded(
        &joined.stations,
        &plan.arm,
        &plan.command_frames.unwrap_or(no_commands),
    );
    Ok(JoinedSession {
        name: files.name.clone(),
        sampling_plan: recording.metadata.get("session.plan").cloned(),
        driven_by: driven::driven_by(files, &joined.stations)?,
        log_rejects: recording.rejects,
        counts: recording.counts,
        joined,
        commanded,
    })
}

fn context<'a>(
    plan: &'a Plan,
    outcome: &Outcome<'_>,
    replaces: Option<String>,
) -> PublishContext<'a> {
    let base_from_command = plan
        .command_frames
        .map_or_else(Isometry3::identity, |frames| frames.base_from_command);
    PublishContext {
        arm: &plan.arm,
        command_from_base: Transform::claim(base_from_command.inverse()),
        fit: &plan.stages.fit,
        full: &plan.stages.full,
        tolerance: plan.stages.tolerance,
        grid: GridBasis {
            model: if outcome.full.is_some() {
                Model::Full
            } else {
                Model::Geometric
            },
            angles: Angles::Commanded,
            split: Split::Blocks,
            guard_mm: outcome.grids.guard_mm,
        },
        noise_mm2: noise_mm2(plan, outcome),
        valid_for: plan.valid_for.clone(),
        replaces,
    }
}

/// Mean variance per axis of measurement and repeatability over the last session's stations, mm².
fn noise_mm2(plan: &Plan, outcome: &Outcome<'_>) -> Option<f64> {
    let stations = &outcome.training.last()?.joined.stations;
    let noise = &plan.stages.noise;
    let variances: Vec<f64> = stations
        .iter()
        .filter_map(|station| station.attained.as_ref())
        .map(|attained| {
            noise.tracker.covariance(&attained.position).trace() / 3.0
                + noise.repeatability_mm.powi(2)
        })
        .collect();
    (!variances.is_empty()).then(|| variances.iter().sum::<f64>() / variances.len() as f64)
}
