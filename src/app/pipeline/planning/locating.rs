//! `posegrid plan --locate`: the `[plan]` section and an arm that is identified already → the poses that find its new base.
//!
//! Inputs: the pipeline file at a path, table `calibrations` of a past run. Output: [`Located`]; nothing is published, as no figure of
//! a session rests on it.

use std::path::{Path, PathBuf};

use nalgebra::Isometry3;

use super::known::{self, KnownError};
use super::{Result, Stated};
use crate::io::lake::Lake;
use crate::kinematics::Arm;
use crate::manifest::RunKey;
use crate::pipeline::history;
use crate::plan::PlanSettings;
use crate::plan::locate::{Identified, LocatePlan, locate};
use crate::plan::section::{PlanSection, TargetMounted};

/// The poses that find base and target of an arm, and where the arm is from.
#[derive(Debug)]
pub struct Located {
    pub identified_by: RunKey,
    pub plan: LocatePlan,
    pub settings: PlanSettings,
    pub arm: Arm,
    /// The base in the frame of commands, mm.
    pub command_from_base: Isometry3<f64>,
    /// Whether the target was taken off and is found too.
    pub with_target: bool,
}

/// Standard deviation of another target's place from the one before, mm: nothing is known of it.
const OTHER_TARGET_MM: f64 = 300.0;

impl Located {
    /// Chooses `count` poses by the pipeline file at `path`. The arm is that of `[plan.known]`, or without it that of the current run of
    /// the robot's newest session in the lake.
    pub fn make(
        path: &Path,
        robot: Option<&str>,
        lake: Option<&Path>,
        count: usize,
    ) -> Result<Self> {
        let stated = Stated::read(path, robot, lake)?;
        let table = match stated.known_table(path).map_err(Box::new)? {
            Some(table) => table,
            None => newest_table(&stated)?,
        };
        let past = stated.identified(&table).map_err(Box::new)?;
        let Stated { read, section, settings, command_from_base, .. } = stated;
        let target_sd_mm = target_sd_mm(&section, &settings);
        let model = known::full(&table, &past.arm).map_err(Box::new)?;
        let identified = Identified { model, session: past.arm.model.session, target_sd_mm };
        let plan = locate(&read.arm, &identified, count, &settings)?;
        Ok(Self {
            plan: plan.ok_or_else(|| Box::new(KnownError::NotPositive(table)))?,
            identified_by: past.key,
            command_from_base,
            with_target: target_sd_mm.is_some(),
            settings,
            arm: read.arm,
        })
    }
}

/// The table of the current run of the robot's newest session.
fn newest_table(Stated { lake, robot, .. }: &Stated) -> Result<PathBuf> {
    let lake = Lake::at(lake)?;
    let newest = history::newest(&lake, robot).map_err(|source| {
        Box::new(KnownError::NoNewest { robot: robot.to_owned(), source: Box::new(source) })
    })?;
    Ok(known::local(&lake, &newest).map_err(Box::new)?)
}

/// Standard deviation of the target's place from that in the past session, mm; `None` where it was not taken off.
fn target_sd_mm(section: &PlanSection, settings: &PlanSettings) -> Option<f64> {
    let mounted = section.known.as_ref().map(|known| known.target);
    match mounted.unwrap_or_default() {
        TargetMounted::Same => None,
        TargetMounted::Again => Some(settings.population.cell.target_sd_mm),
        TargetMounted::Other => Some(OTHER_TARGET_MM),
    }
}
