//! `[plan.known]` → the arm as a past run identified it, checked against the plan's own.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use thiserror::Error;

use super::Stated;
use crate::compensation::IdentifiedArm;
use crate::files::store::Place;
use crate::fit::full::FullModel;
use crate::fit::full::next::{Mounted, Mounting, Placed};
use crate::fit::{Sees, SourceId, TargetId};
use crate::geometry::{Transform, isometry_from_rpy};
use crate::io::calibrations_table::{self, CalibrationsTableError, PublishedArm};
use crate::io::lake::{Lake, LakeError};
use crate::kinematics::Arm;
use crate::manifest::RunKey;
use crate::pipeline::history::HistoryError;
use crate::plan::section::{BaseMounted, KnownSection, TargetMounted};
use crate::plan::{KnownArm, PlanSettings};

/// Largest change of the target's position at which it counts as the same, mm: weak priors let it trade that much with the
/// last link.
const SAME_PLACE_MM: f64 = 10.0;

/// The reason why a past session cannot replace the prior.
#[derive(Debug, Error)]
pub enum KnownError {
    #[error(
        "{}: [plan.known] names {found}: give either calibrations (the file of a past run) or session (whose current run in the \
         lake is taken)", path.display()
    )]
    Named { path: PathBuf, found: &'static str },
    #[error(
        "[plan.known] session = {session:?}: the lake {lake} has no run of it for robot {robot:?}; run it first, or give \
         calibrations"
    )]
    NoRun { lake: Place, robot: String, session: String },
    #[error("no arm is known of robot {robot:?}: {source}; name its run under [plan.known]")]
    NoNewest { robot: String, source: Box<HistoryError> },
    #[error(
        "[plan.known]: {table} is on object storage; copy it here and name it under calibrations"
    )]
    Remote { table: Place },
    #[error("[plan.known]: {0}")]
    Table(#[from] CalibrationsTableError),
    #[error("[plan.known]: {0}")]
    Lake(#[from] LakeError),
    #[error(
        "[plan.known]: {} is of robot {found:?}, but the plan is for {wanted:?}: name the table of this very arm, or its name in \
         [robot] name", path.display()
    )]
    OtherRobot { path: PathBuf, found: String, wanted: String },
    #[error(
        "[plan.known]: the arm of {} has {found} joints, that of [robot] file has {wanted}: name the table of this very arm",
        path.display()
    )]
    Joints { path: PathBuf, found: usize, wanted: usize },
    #[error(
        "[plan.known]: the nominal arm of {} ({found:?}) is not that of [robot] file ({wanted:?}): {what} differ, so its offsets \
         mean nothing here; plan with the robot file of that run", path.display()
    )]
    OtherNominal { path: PathBuf, found: String, wanted: String, what: &'static str },
    #[error(
        "[plan.known]: {} has no full error model, only geometry: run that session with [fit.full] enabled = true", .0.display()
    )]
    GeometryAlone(PathBuf),
    /// Places of targets are in the flange frame, mm.
    #[error(
        "[plan.known]: the target of {} sat at {found:.1?} mm of the flange, {away_mm:.1} mm from the {wanted:.1?} mm of this \
         plan: say target = \"other\"", path.display()
    )]
    OtherTarget { path: PathBuf, found: [f64; 3], wanted: [f64; 3], away_mm: f64 },
    /// The file states that the base is where it was, and no instrument of the session has a frame.
    #[error(
        "[plan.known]: the instruments of {} read one length each, so the base in a tracker's frame is not known from it: say base = \"new\"",
        .0.display()
    )]
    NoBase(PathBuf),
    /// The covariance cannot be factored because of rounding.
    #[error(
        "[plan.known]: the covariance of {} cannot be factored again; identify that session anew with this version", .0.display()
    )]
    NotPositive(PathBuf),
}

impl Stated {
    /// Place of the table that `[plan.known]` names in the pipeline file at `path`; `None` without that section.
    pub(super) fn known_table(&self, path: &Path) -> Result<Option<PathBuf>, KnownError> {
        let Some(known) = &self.section.known else { return Ok(None) };
        let named = |found| KnownError::Named { path: path.to_owned(), found };
        let table = match (&known.calibrations, &known.session) {
            (Some(file), None) => self.read.base.join(file),
            // When a past run is recomputed into a temporary lake, the known arm's run is in the pipeline file's own lake.
            (None, Some(session)) => match current(&self.lake, &self.robot, session) {
                Err(KnownError::NoRun { .. }) => current(&self.read.lake, &self.robot, session)?,
                found => found?,
            },
            (None, None) => return Err(named("neither")),
            (Some(_), Some(_)) => return Err(named("both")),
        };
        Ok(Some(table))
    }

    /// The arm in the table at `path`, which has to be the one that is planned for.
    pub(super) fn identified(&self, path: &Path) -> Result<PublishedArm, KnownError> {
        let published = calibrations_table::read(path)?;
        if published.key.robot != self.robot {
            let (found, wanted) = (published.key.robot, self.robot.clone());
            return Err(KnownError::OtherRobot { path: path.to_owned(), found, wanted });
        }
        same_nominal(path, &published.arm, &self.read.arm)?;
        Ok(published)
    }

    /// The arm in the table at `path`, in the planned session.
    pub(super) fn known_arm(&self, path: &Path) -> Result<Arc<KnownArm>, KnownError> {
        let Self { section, settings, .. } = self;
        let past = self.identified(path)?.arm;
        let model = full(path, &past)?;
        let known = section.known.clone().unwrap_or_default();
        let mounting = mounting(path, &known, model, past.model.session, settings)?;
        let most = settings.poses.iter().copied().max().unwrap_or(0);
        let stations = 2 * most + settings.verify_poses;
        let (arm, full) = (&self.read.arm, &settings.full);
        let known = KnownArm::new(arm, model, mounting, stations, full, settings.up);
        known.map(Arc::new).ok_or_else(|| KnownError::NotPositive(path.to_owned()))
    }
}

fn current(place: &Place, robot: &str, session: &str) -> Result<PathBuf, KnownError> {
    let lake = Lake::at(place)?;
    let run = lake.current(&RunKey::new(robot, session, ""))?;
    let run = run.ok_or_else(|| KnownError::NoRun {
        lake: place.clone(),
        robot: robot.to_owned(),
        session: session.to_owned(),
    })?;
    local(&lake, &RunKey::new(robot, session, &run.run))
}

/// The file of table `calibrations` of a run.
pub(super) fn local(lake: &Lake, key: &RunKey) -> Result<PathBuf, KnownError> {
    let table = lake.place("calibrations", key)?;
    table.as_path().map(Path::to_owned).ok_or(KnownError::Remote { table })
}

pub(super) fn full<'p>(path: &Path, past: &'p IdentifiedArm) -> Result<&'p FullModel, KnownError> {
    past.model.is::<FullModel>().ok_or_else(|| KnownError::GeometryAlone(path.to_owned()))
}

fn same_nominal(path: &Path, past: &IdentifiedArm, arm: &Arm) -> Result<(), KnownError> {
    let (found, wanted) = (&past.arm, arm);
    if found.joints().len() != wanted.joints().len() {
        let (found, wanted) = (found.joints().len(), wanted.joints().len());
        return Err(KnownError::Joints { path: path.to_owned(), found, wanted });
    }
    let names = |arm: &Arm| arm.joints().iter().map(|j| j.name.clone()).collect::<Vec<_>>();
    let what = if names(found) != names(wanted) {
        "names of joints"
    } else if found.chain() != wanted.chain() {
        "lengths or angles"
    } else if found.axes_from_joints() != wanted.axes_from_joints() {
        "joint maps"
    } else {
        return Ok(());
    };
    let (found, wanted) = (found.model().to_owned(), wanted.model().to_owned());
    Err(KnownError::OtherNominal { path: path.to_owned(), found, wanted, what })
}

fn mounting(
    path: &Path,
    known: &KnownSection,
    model: &FullModel,
    session: usize,
    settings: &PlanSettings,
) -> Result<Mounting, KnownError> {
    let cell = &settings.population.cell;
    let base = isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
    let sd_mm = cell.target_sd_mm;
    let target = match known.target {
        TargetMounted::Same => Mounted::Same,
        TargetMounted::Again => Mounted::Again { sd_mm },
        TargetMounted::Other => Mounted::Other {
            flange_from_target: Transform::claim(settings.flange_from_target),
            sd_mm,
        },
    };
    let past = &model.fitted_frames()[session];
    // The planned session has one tracker and the main target: other instruments and targets of the past one are integrated out.
    if known.base == BaseMounted::Same && past.sees()[SourceId::ONLY.0] != Sees::Places {
        return Err(KnownError::NoBase(path.to_owned()));
    }
    let sat = past.flange_from_target(TargetId::MAIN);
    let (found, wanted) =
        (sat.isometry().translation.vector, settings.flange_from_target.translation.vector);
    let away_mm = (found - wanted).norm();
    if known.target != TargetMounted::Other && away_mm > SAME_PLACE_MM {
        let (found, wanted) = (found.into(), wanted.into());
        return Err(KnownError::OtherTarget { path: path.to_owned(), found, wanted, away_mm });
    }
    Ok(Mounting {
        session,
        sources: vec![match known.base {
            BaseMounted::New => Placed::Moved(Transform::claim(base)),
            BaseMounted::Same => Placed::Same,
        }],
        targets: vec![target],
    })
}
