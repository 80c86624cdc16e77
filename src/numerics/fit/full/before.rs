//! The full error model before a session: the prior of an arm that has not been measured yet.
//!
//! Every column has its prior variance and nothing has been learned, so predictions are those of the frames and the
//! nominal arm, with the covariance of all possible errors. Planning uses it.

use nalgebra::{DMatrix, DVector, Matrix3, Point3, UnitVector3};

use super::layout::Block;
use super::regression::{Posterior, Root};
use super::rows::State;
use super::stored::StoredFull;
use super::student::Tails;
use super::{FullModel, FullSettings};
use crate::fit::frames::Frames;
use crate::fit::observation::Observation;
use crate::fit::problem::{Freedom, Prior, Problem};
use crate::kinematics::Arm;
use crate::linalg::Cholesky;

impl FullModel {
    /// The model of a session of `stations` stations before any of them is measured.
    ///
    /// `poses` are axis variables (rad) typical of the session: joints that hardly move the target there have fewer columns.
    pub fn expected(
        arm: &Arm,
        frames: &Frames,
        poses: &[Vec<f64>],
        stations: usize,
        prior: &Prior,
        settings: &FullSettings,
        up: Option<UnitVector3<f64>>,
    ) -> Self {
        let unmeasured = |(station, axes): (usize, &Vec<f64>)| {
            Observation::planned(station, axes.clone(), Point3::origin(), Matrix3::identity())
        };
        let observations: Vec<Observation> = poses.iter().enumerate().map(unmeasured).collect();
        let frames = [frames.clone()];
        let (chain, geometry) = (arm.chain(), Freedom::Geometry);
        let problem = Problem::new(&observations, chain, &frames, geometry, prior);
        let offsets = DVector::zeros(problem.unknowns.len());
        let up = up.map(UnitVector3::into_inner);
        let state = State::expected(&problem, offsets, settings, up);
        let span = stations.max(1) as f64;
        let variances = state.components.variances();
        let mean = DVector::zeros(state.layout.size());
        let problem = Problem::new(&[], chain, &frames, geometry, prior);
        let posterior = Posterior::before(variances.map(f64::sqrt));
        let trained = StoredFull {
            starts: problem.starts.clone(),
            turned: false,
            up,
            drift_variance: 0.0,
            warm_up_variance: 0.0,
            middles: state.middles,
            scale_sd: 1e-6 * settings.session_scale_ppm,
            scale_evidence: None,
            approach: None,
            sides: None,
            tails: Tails::Normal,
            layout: state.layout,
            rows_at: state.offsets.clone(),
            offsets: state.offsets,
            mean,
            scale: posterior.scale.clone(),
            whitened: posterior.whitened.clone(),
            span,
            repeatability: state.repeatability,
            weights: Vec::new(),
            parts: Vec::new(),
        };
        Self::of(trained, problem, posterior, Vec::new())
    }

    /// This model with errors of geometry and frames only, nothing learned.
    #[must_use]
    pub fn geometry_alone(mut self) -> Self {
        let unknowns = self.trained.layout.columns(Block::Unknowns).unwrap_or(0..0);
        let mut scale = self.posterior.scale;
        for (column, scale) in scale.iter_mut().enumerate() {
            if !unknowns.contains(&column) {
                *scale = 0.0;
            }
        }
        self.trained.scale.clone_from(&scale);
        self.posterior = Posterior::before(scale);
        self
    }
}

impl Posterior {
    /// Nothing learned: the posterior is the prior.
    fn before(scale: DVector<f64>) -> Self {
        let size = scale.len();
        let identity = DMatrix::identity(size, size);
        Self {
            root: Root::Columns(Cholesky::new(identity).expect("the identity is positive")),
            whitened: DVector::zeros(size),
            log_evidence: 0.0,
            scale,
        }
    }
}
