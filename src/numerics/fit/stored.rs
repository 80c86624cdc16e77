//! The models of one training as the stage that trained them leaves them, and back, equal to the last bit on the same processor features.

use serde::{Deserialize, Serialize};

use super::full::stored::StoredFull;
use super::full::{FullModel, FullSettings};
use super::models::{Models, TrainingSettings, full_prior};
use super::saved::SavedError;
use super::{Calibration, Observation, Prior};
use crate::kinematics::Arm;

/// How a full error model comes back: [`StoredFull::model`], or [`StoredFull::predicting`] for predictions alone.
pub type Restoring =
    fn(StoredFull, &Arm, &[Observation], &Prior, &FullSettings) -> Result<FullModel, SavedError>;

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredModels {
    base_target: Calibration,
    geometric: Calibration,
    full: Option<StoredFull>,
}

impl StoredModels {
    pub fn of(models: &Models) -> Self {
        Self {
            base_target: models.base_target.clone(),
            geometric: models.geometric.clone(),
            full: models.full.as_ref().map(|full| full.trained.clone()),
        }
    }

    /// The models; arm, observations and settings are those of their training.
    pub fn models(
        self,
        arm: &Arm,
        observations: &[Observation],
        settings: &TrainingSettings<'_>,
        full_model: Restoring,
    ) -> Result<Models, SavedError> {
        let prior = full_prior(&self.geometric, settings);
        let full = self.full.map(|full| full_model(full, arm, observations, &prior, settings.full));
        Ok(Models {
            base_target: self.base_target,
            geometric: self.geometric,
            full: full.transpose()?,
        })
    }
}
