//! Models to be compared, trained on the same observations.

use nalgebra::UnitVector3;

use super::full::{FullModel, FullSettings, Purpose};
use super::observation::Observation;
use super::{Calibration, FitError, FitSettings, Freedom, Prior, identify_from, start};
use crate::kinematics::Arm;

#[derive(Debug, Clone, Copy)]
pub struct TrainingSettings<'s> {
    pub fit: &'s FitSettings,
    pub full: &'s FullSettings,
    pub up: Option<UnitVector3<f64>>,
    pub purpose: Purpose,
}

#[derive(Debug)]
pub struct Models {
    pub base_target: Calibration,
    pub geometric: Calibration,
    pub full: Option<FullModel>,
}

/// Trains base + target, geometry and the full error model on the observations of `sessions` sessions.
pub fn train(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &TrainingSettings<'_>,
) -> Result<Models, FitError> {
    let starts = start::frames(arm, observations, sessions, settings.fit)?;
    let identified = |freedom| identify_from(arm, observations, &starts, freedom, settings.fit);
    let (base_target, geometric) =
        (identified(Freedom::BaseAndTarget), identified(Freedom::Geometry));
    let train_full = || {
        let (frames, geometry) = (&geometric.frames, &geometric.geometry);
        let prior = full_prior(&geometric, settings);
        FullModel::train_for(
            arm,
            observations,
            (&frames[..], &geometry[..]),
            &prior,
            settings.full,
            settings.purpose,
            settings.up,
        )
    };
    let full = if settings.full.enabled { train_full() } else { None };
    Ok(Models { base_target, geometric, full })
}

/// The prior of the full error model that starts from an identified geometry.
pub(super) fn full_prior(geometric: &Calibration, settings: &TrainingSettings<'_>) -> Prior {
    Prior { geometry: geometric.geometry_prior(), ..settings.fit.prior() }
}

impl Models {
    /// The latest session that trained: another has its base where it finds none, and its targets where they were not taken off since.
    pub const fn latest(&self) -> usize {
        self.base_target.frames.len().saturating_sub(1)
    }
}
