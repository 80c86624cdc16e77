//! The identified geometry, and with it base + target: a chain with identified parameters, in its frames.

use nalgebra::Point3;

use super::{About, Corrects, Loaded};
use crate::fit::gap::Gap;
use crate::fit::model::{Angles, At, PoseModel, Prediction, Query, Spread};
use crate::fit::saved::{SavedCalibration, SavedError, SavedHead, SavedSession};
use crate::fit::{Calibration, Frames, Freedom};
use crate::join::SourceId;
use crate::kinematics::{Arm, Chain};

pub(super) const ABOUT: About = About {
    word: "geometric",
    name: "geometry identified",
    look: 2,
    corrects: Corrects::Predicted,
    angles: &[Angles::Reported],
    serves: true,
    of_training: Some(|models| Some(&models.geometric)),
    load: Some(load),
};

/// A saved identified geometry, without the covariance of its fit.
#[derive(Debug, Clone)]
pub struct IdentifiedGeometry {
    pub chain: Chain,
    pub frames: Vec<Frames>,
    pub misfit_mm: f64,
}

pub(super) fn load(text: &str, misfit_mm: Option<f64>) -> Result<Loaded, SavedError> {
    let saved = SavedCalibration::read(text)?;
    let model = IdentifiedGeometry {
        chain: saved.chain(),
        frames: saved.sessions.iter().map(SavedSession::frames).collect::<Result<_, _>>()?,
        misfit_mm: misfit_mm.ok_or(SavedError::NoMisfit)?,
    };
    let head = SavedHead { arm: saved.arm, sessions: saved.sessions };
    Ok(Loaded { head, model: Box::new(model) })
}

impl PoseModel for Calibration {
    fn frames(&self) -> &[Frames] {
        &self.frames
    }

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap> {
        Ok(predict(&self.chain, &self.frames, at.joints()?))
    }

    fn spread(&self, _: usize, _: SourceId, _: &Prediction) -> Spread {
        unexplained(self.misfit_mm)
    }

    fn parts(&self) -> &'static [&'static str] {
        match self.freedom {
            Freedom::BaseAndTarget | Freedom::Base => &[],
            Freedom::Geometry => &["geometry"],
        }
    }

    fn parameter_count(&self) -> usize {
        self.unknowns.len()
    }

    fn weights(&self) -> &[f64] {
        &self.solution.weights
    }

    fn saved(&self, arm: &Arm, names: &[&str]) -> Option<Result<String, serde_json::Error>> {
        Some(serde_json::to_string(&SavedCalibration::of(self, arm, names)))
    }
}

impl PoseModel for IdentifiedGeometry {
    fn frames(&self) -> &[Frames] {
        &self.frames
    }

    fn predict(&self, at: &At<'_>) -> Result<Prediction, Gap> {
        Ok(predict(&self.chain, &self.frames, at.joints()?))
    }

    fn spread(&self, _: usize, _: SourceId, _: &Prediction) -> Spread {
        unexplained(self.misfit_mm)
    }
}

fn predict(chain: &Chain, frames: &[Frames], query: &Query<'_>) -> Prediction {
    let frames = frames[query.session].pair(query.source, query.target);
    let flange = frames.tracker_from_base.isometry() * chain.nominal(query.axes);
    let target = frames.flange_from_target.isometry().translation.vector;
    Prediction {
        position: flange * Point3::from(target + query.lever),
        flange: flange.rotation,
        error: None,
        open: None,
    }
}

/// The misfit of a geometry is the variance of its error, the same along each axis.
fn unexplained(misfit_mm: f64) -> Spread {
    Spread::Isotropic(misfit_mm.powi(2))
}
