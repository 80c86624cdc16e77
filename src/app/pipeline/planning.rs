//! Planning: the `[plan]` section of a pipeline file → a published plan.
//!
//! Inputs: the pipeline file at a path, no log. Output: [`Planned`]; in the lake, the tables `sampling_plan` and
//! `plan_figures`, the plan's page, and the row of `runs` that makes them exist. The plan's id is that run; the same file
//! gives the same plan.

mod cell;
mod known;
mod locating;
mod so_far;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Isometry3;
use thiserror::Error;

use super::configuration::checks::wrong_unless;
use super::configuration::files::{self, Files, Source};
use super::configuration::{ConfigurationError, ConfigurationErrorKind, placed, usable};
use super::run::{self, RunError, input};
use crate::files::store::Place;
use crate::io::lake::{Commit, Lake, LakeError};
use crate::io::rows::Row as _;
use crate::io::tables::PublishError;
use crate::io::tables::plan_figures::{self, FigureRow};
use crate::io::tables::runs::{self, Ending, RunRow};
use crate::io::tables::sampling_plan::{self, VisitRow};
use crate::io::tables::words::{TableVerdict, VerdictOf};
use crate::kinematics::Arm;
use crate::manifest::{self, ManifestError, Replaced, RunKey, StageCount, Work};
use crate::page::plan::{self as page, Content};
use crate::plan::section::PlanSection;
use crate::plan::session::{LEAST_KNOWN_POSES, LEAST_POSES};
use crate::plan::{self, PlanSettings, SamplingPlan};
use crate::progress::Progress;
use cell::Placed;
pub use known::KnownError;
pub use locating::Located;
pub use so_far::{SoFar, SoFarError};

pub const SESSION: &str = "plan";

/// A checked pipeline file with its `[plan]`.
#[derive(Debug)]
pub struct Planning {
    pub arm: Arm,
    pub settings: PlanSettings,
    pub lake: Place,
    command_from_base: Isometry3<f64>,
    pub(super) work: Work,
}

/// A plan that was made, or was there already.
#[derive(Debug)]
pub struct Planned {
    pub key: RunKey,
    /// The plan; `None` where the lake had it already, and nothing was done.
    pub plan: Option<SamplingPlan>,
    /// Whether it is shown to meet the tolerance.
    pub is_met: bool,
    /// Place of its page; `None` for plans of versions without pages.
    pub page: Option<Place>,
}

type Result<T, E = PlanningError> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum PlanningError {
    #[error(transparent)]
    File(#[from] ConfigurationError),
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    #[error(transparent)]
    Input(#[from] Box<RunError>),
    #[error("plan: {0}")]
    Plan(#[from] plan::PlanError),
    #[error(transparent)]
    Known(#[from] Box<KnownError>),
    #[error(transparent)]
    SoFar(#[from] Box<SoFarError>),
    #[error(transparent)]
    Publish(#[from] PublishError),
    #[error(transparent)]
    Lake(#[from] LakeError),
}

impl Planning {
    /// Names of the robots of the pipeline file at `path`; empty where it is of one.
    pub fn robots(path: &Path) -> Result<Vec<String>> {
        let robots = Source::read(path)?.robots;
        let names = robots.iter().flat_map(|own| own.names().map(str::to_owned));
        Ok(names.collect())
    }

    /// Reads and checks the pipeline file at `path`, of one robot where it has several.
    pub fn load(path: &Path, robot: Option<&str>, lake: Option<&Path>) -> Result<Self> {
        Self::reload(path, robot, lake, None)
    }

    /// Loads a plan that was made before, and that started from the table `known_arm`: its session may have a later run by
    /// now.
    pub(super) fn reload(
        path: &Path,
        robot: Option<&str>,
        lake: Option<&Path>,
        known_arm: Option<&Path>,
    ) -> Result<Self> {
        let mut stated = Stated::read(path, robot, lake)?;
        let mut inputs = vec![input(&stated.read.robot_file, "robot").map_err(Box::new)?];
        let table = match known_arm.filter(|_| stated.section.known.is_some()) {
            Some(table) => Some(table.to_owned()),
            None => stated.known_table(path).map_err(Box::new)?,
        };
        if let Some(table) = table {
            stated.settings.known = Some(stated.known_arm(&table).map_err(Box::new)?);
            inputs.push(input(&table, "calibrations").map_err(Box::new)?);
        }
        let Stated { read, section, settings, lake, robot, command_from_base } = stated;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let work = Work {
            robot,
            session: SESSION.to_owned(),
            pipeline: stem.into_owned(),
            sessions: Vec::new(),
            test_sessions: Vec::new(),
            inputs,
            settings: manifest::canonical(&(&read.file, &section))?,
        };
        Ok(Self { arm: read.arm, settings, lake, command_from_base, work })
    }

    pub fn make(&self, progress: &dyn Progress) -> Result<Planned> {
        let key = self.work.key();
        let lake = Lake::at(&self.lake)?;
        let mut made = None;
        if !lake.exists(&key)? {
            let plan = plan::plan(&self.arm, &self.settings, progress)?;
            self.publish(&plan, &lake, &key)?;
            made = Some(plan);
        }
        lake.ask(&key)?;
        let row = lake.read("runs", &key)?;
        Ok(Planned {
            is_met: RunRow::read(&row).iter().any(|row| row.ending.verdict == TableVerdict::Met),
            page: run::page(&lake, &key).map_err(Box::new)?,
            plan: made,
            key,
        })
    }

    /// Writes the tables of a plan, its page, and then its row of `runs`.
    fn publish(&self, plan: &SamplingPlan, lake: &Lake, key: &RunKey) -> Result<Commit> {
        let replaces = lake.current(key)?;
        let Some(mut run) = lake.start(key)? else { return Ok(Commit::AlreadyThere) };
        let frame = &self.command_from_base;
        let visits = sampling_plan::rows(plan, &self.settings, &self.arm, frame);
        let visits = VisitRow::table(visits, key).map_err(PublishError::from)?;
        let figures = plan_figures::rows(plan, &self.settings);
        let figures = FigureRow::table(figures, key).map_err(PublishError::from)?;
        for table in [&visits.table, &figures.table] {
            run.publish(table)?;
        }
        let counts = counts(plan);
        let html = page::html(&Content {
            robot: key.robot.clone(),
            plan: key.run.clone(),
            figures: figures.rows,
            visits: visits.rows,
            counts: counts.clone(),
            work: self.work.clone(),
            written: run.written().to_vec(),
        });
        run.publish_page(&html)?;
        let row = runs::table(&self.work, &counts, run.written(), &ending(plan, replaces))?;
        Ok(run.commit(&row)?)
    }
}

/// What a pipeline file states of a plan, checked.
struct Stated {
    read: Files,
    section: PlanSection,
    settings: PlanSettings,
    lake: Place,
    robot: String,
    command_from_base: Isometry3<f64>,
}

impl Stated {
    fn read(path: &Path, robot: Option<&str>, lake: Option<&Path>) -> Result<Self> {
        let read = files::read(path, robot)?;
        let file = &read.file;
        let content = "it states what robot to expect and where arm and tracker stand; at least home_deg and tracker_from_base";
        let missing = ConfigurationErrorKind::missing("[plan]", content);
        let section = file.plan.clone().ok_or_else(|| missing.at(path))?;
        check(path, &section, read.arm.joints().len())?;
        let settings = Placed::new(path, file, &section)?.settings(&read.arm, file, &section)?;
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let base_from_command = file.commanded.as_ref().map(|commanded| {
            placed(path, "[commanded] base_from_command", &commanded.base_from_command)
        });
        Ok(Self {
            lake: usable(lake, read.lake.clone())?,
            robot: file.robot.name.clone().unwrap_or_else(|| stem.into_owned()),
            command_from_base: base_from_command.transpose()?.unwrap_or_default().inverse(),
            section,
            settings,
            read,
        })
    }
}

fn counts(plan: &SamplingPlan) -> Vec<StageCount> {
    let drawn = &plan.candidates;
    let rejected: BTreeMap<String, u64> =
        drawn.refused.iter().map(|(reason, count)| ((*reason).to_owned(), *count as u64)).collect();
    vec![StageCount {
        stage: "plan",
        of: "candidate poses",
        read: drawn.poses as u64,
        kept: drawn.poses as u64 - rejected.values().sum::<u64>(),
        rejected,
    }]
}

fn ending(plan: &SamplingPlan, replaces: Option<Replaced>) -> Ending {
    let promise = &plan.promise;
    let (verdict, word) = match promise.bound_mm {
        _ if plan.is_met() => (TableVerdict::Met, "met"),
        Some(_) => (TableVerdict::NotMet, "not met"),
        None => (TableVerdict::NotShown, "not shown to be met"),
    };
    let why = format!(
        "{} of {} simulated robots meet the tolerance: at least {:.3} of all, {:.3} are asked for",
        promise.meet, promise.robots, promise.share_at_least, promise.share_asked
    );
    let ending = Ending {
        verdict,
        verdict_of: Some(VerdictOf::SamplingPlan),
        statement: Some(format!("{word} by the plan: {why}")),
        bound_mm: promise.bound_mm,
        reason: (!plan.is_met()).then_some(why),
        ..Ending::default()
    };
    ending.replacing(replaces)
}

const MOST_POSES: usize = 2000;

/// Finds the first invalid value of the section, for an arm of `joints` joints.
fn check(path: &Path, section: &PlanSection, joints: usize) -> Result<(), ConfigurationError> {
    let angles = section.home_deg.len();
    let home = wrong_unless(
        angles == joints,
        "[plan] home_deg",
        format!("{angles} angles"),
        format!("one angle for each of the arm's {joints} joints, degrees"),
    );
    let least = if section.known.is_some() { LEAST_KNOWN_POSES } else { LEAST_POSES };
    let sizes = least..=MOST_POSES;
    let poses = wrong_unless(
        section.poses.iter().all(|poses| sizes.contains(poses)),
        "[plan] poses",
        format!("{:?}", section.poses),
        format!("numbers of poses, each from {least} to {MOST_POSES}, for example [25, 50, 100]"),
    );
    home.and(poses).map_err(|wrong| wrong.at(path))
}
