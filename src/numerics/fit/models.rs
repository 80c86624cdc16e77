//! Models to be compared, trained on the same observations.

use nalgebra::UnitVector3;

use super::full::{FullModel, FullSettings, Purpose};
use super::observation::Observation;
use super::{Calibration, FitError, FitSettings, Freedom, Prior, SourceSize, identify_from, start};
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
    check_lengths(&geometric, settings)?;
    let TrainingSettings { full, up, purpose, .. } = *settings;
    let train_full = || {
        let (frames, geometry) = (&geometric.frames, &geometric.geometry);
        let prior = full_prior(&geometric, settings);
        let start = (&frames[..], &geometry[..]);
        FullModel::train(arm, observations, start, &prior, full, purpose, up)
    };
    let full = if full.enabled { train_full() } else { None };
    Ok(Models { base_target, geometric, full })
}

/// Lengths that the identified geometry leaves by more than this, mm, and by more than this factor of what is stated, are of something else.
const FAR_OFF_MM: f64 = 2.0;
const FAR_OFF: f64 = 10.0;

/// Refuses an instrument of one length whose readings do not follow the arm.
fn check_lengths(geometric: &Calibration, settings: &TrainingSettings<'_>) -> Result<(), FitError> {
    let off_mm = |own: &SourceSize| own.factor * own.stated_mm;
    let is_off = |own: &&SourceSize| {
        own.kind.is_length() && own.factor > FAR_OFF && off_mm(own) > FAR_OFF_MM
    };
    let worst = geometric.sources.iter().filter(is_off);
    worst.max_by(|a, b| a.factor.total_cmp(&b.factor)).map_or(Ok(()), |own| {
        let name = settings.fit.source_name(own.source);
        Err(FitError::OtherLengths { name, off_mm: off_mm(own), factor: own.factor })
    })
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
