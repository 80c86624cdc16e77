//! What an identified geometry leaves of readings, for [`super::camera_size`] and [`super::stated_size`].

use nalgebra::DVector;

use super::Calibration;
use super::frames::PerChannel;
use super::observation::Observation;
use super::problem::{Freedom, Prior, Problem};
use crate::kinematics::{Arm, HeldChain};

pub(super) struct Residuals {
    chains: PerChannel<HeldChain>,
    /// Number of rows over those that the geometry's parameters leave, at least 1: squares of residuals are too small by it.
    pub(super) counted: f64,
}

impl Residuals {
    /// Those of the geometry that `observations` gave.
    pub(super) fn of(arm: &Arm, observations: &[Observation], calibration: &Calibration) -> Self {
        let (chain, frames, prior) = (arm.chain(), &calibration.frames, Prior::default());
        let problem = Problem::new(observations, chain, frames, Freedom::Geometry, &prior);
        // The frames are the calibration's own; the arm's parameters are the first unknowns, in the order of its chain.
        let mut offsets = DVector::zeros(problem.unknowns.len());
        let geometry = &calibration.geometry;
        offsets.rows_mut(0, geometry.len()).copy_from_slice(geometry);
        let all = problem.row_count() as f64;
        Self {
            chains: problem.held(&offsets),
            counted: (all / (all - calibration.structure.rank as f64).max(1.0)).max(1.0),
        }
    }

    /// Measured minus predicted, mm and rad.
    pub(super) fn residual(&self, own: &Observation) -> DVector<f64> {
        let end = self.chains.of(own.channel()).view(&own.axes).end;
        DVector::from_vec(own.measured.residual(&end, None))
    }
}
