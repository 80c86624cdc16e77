//! The evidence of a training on lengths and on each session's scale, for the test of [`crate::fit::scale`].

use nalgebra::DVector;

use super::FullModel;
use super::columns::unknown_variances;
use super::layout::Block;
use super::train::Settled;
use crate::fit::problem::Problem;
use crate::fit::scale::{FittedScale, PPM, ScaleEvidence, lengths};

impl FullModel {
    /// The scale of a session, by its index in the model; `None` where the model has no scales.
    pub fn fitted_scale(&self, session: usize) -> Option<FittedScale> {
        let column = self.trained.layout.columns(Block::Scale(session))?.start;
        Some(FittedScale {
            ppm: PPM * self.trained.mean[column],
            sd_ppm: PPM * self.posterior.covariance_of(&[column])[(0, 0)].sqrt(),
            kept: self.trained.parts.iter().any(|part| part.name == "session_scale" && part.kept),
        })
    }
}

impl Settled {
    /// The evidence on lengths and scales, all parts still in the model; `None` where the model has no scales.
    pub(super) fn scale_evidence(&self, problem: &Problem<'_>) -> Option<ScaleEvidence> {
        let lengths = lengths(problem);
        let blocks = self.state.layout.blocks();
        let scales = blocks.filter(|(block, _)| matches!(block, Block::Scale(_)));
        let scales: Vec<usize> = scales.map(|(_, columns)| columns.start).collect();
        if scales.is_empty() {
            return None;
        }
        let variances = unknown_variances(problem);
        let unknowns = self.state.offsets.len();
        let mean = self.posterior.mean() + &self.prior_mean;
        let places: Vec<usize> = lengths.iter().chain(&scales).copied().collect();
        let column = |of: &dyn Fn(usize) -> f64| {
            DVector::from_iterator(places.len(), places.iter().map(|&place| of(place)))
        };
        let whole = column(&|place| {
            // An unknown's coefficient is its change from its offset.
            let offset = (place < unknowns).then(|| self.state.offsets[place]);
            offset.unwrap_or(0.0) + mean[place]
        });
        let precisions = column(&|place| {
            let held = || self.posterior.scale[place].powi(-2);
            variances.get(place).map_or_else(held, |v| v.recip())
        });
        let covariance = self.posterior.covariance_of(&places);
        ScaleEvidence::of(lengths.len(), &covariance, &whole, &precisions)
    }
}
