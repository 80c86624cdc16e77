//! The full error model: geometry, joint curves, gravity, gear lines, drift and command–feedback weight as one Gaussian model.
//!
//! All parts are linear in their unknowns around the geometric fit ([`crate::method::error_model`]): one Bayesian linear
//! regression with a diagonal prior. Curves are Fourier series whose coefficients' variances are those of the kernels
//! ([`spectrum`]), sizes follow from the marginal likelihood ([`components`]), noise and weights from leave-one-out
//! residuals ([`noise`]), gear lines from their periodogram ([`lines`]). The cost is linear in the number of stations.
//!
//! Inputs: observations of one or more sessions of an arm, the frames and offsets of its geometric fit. Output: a
//! [`FullModel`], which predicts with a covariance.

mod ageing;
pub mod approach;
mod before;
mod columns;
pub mod components;
pub mod curves;
pub mod design;
pub mod elsewhere;
mod held_out;
pub mod knocks;
pub mod layout;
mod leave_one_out;
pub mod lines;
mod narrow;
pub mod next;
pub mod noise;
mod partition;
mod parts;
pub mod regression;
mod repairs;
mod rows;
pub mod saved;
mod scales;
pub mod settings;
pub mod shapes;
pub mod sides;
pub mod spectrum;
pub mod stored;
pub mod student;
mod summing;
pub mod tabulated;
pub mod train;
mod whitening;

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Point3, UnitQuaternion, UnitVector3, Vector3,
};
use rayon::prelude::*;

use super::frames::{Channel, Frames, PerChannel};
pub use super::model::{Known, Query};
use super::observation::Observation;
use super::observation::measured::Shown;
use super::problem::{Prior, Problem, Unknown, is_turned};
use crate::join::SourceId;
use crate::kinematics::{Arm, ChainView, HeldChain, Parameter, Twist};
use approach::{Against, ApproachOffsets};
use components::Part;
use design::PoseView;
use layout::Block;
use leave_one_out::{LeftOut, of_observations, of_readings};
use noise::{NoisyReading, StationNoise};
use regression::Posterior;
pub use repairs::{Day, Repair};
use rows::Around;
pub use settings::FullSettings;
use sides::Sides;
use stored::StoredFull;
use tabulated::Tabulated;

/// Stations that a worker takes at once; fixed, so that results do not depend on the number of threads.
const CHUNK: usize = 16;
/// Positions whose covariances are found together: their rows are one right-hand side.
const POSITIONS: usize = 64;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// To be published, with the residual of each station as predicted by all others.
    Published,
    /// To judge stations that it does not see, of which it needs none of its own.
    Judges,
}

#[derive(Debug)]
pub struct FullModel {
    /// Layout, sizes, weights and coefficients that the training found.
    pub trained: StoredFull,
    problem: Problem<'static>,
    /// The frames of each session where rows are evaluated: its base as fitted, its targets before the last step of the training,
    /// which the model's columns of unknowns make.
    pub frames: Vec<Frames>,
    pub posterior: Posterior,
    ready: Ready,
    /// Residual of each observation that it was trained on, as predicted without its station, mm and rad; none of a model that was read
    /// back or only judges.
    pub left_out: Vec<DVector<f64>>,
}

#[derive(Debug)]
struct Ready {
    chains: PerChannel<HeldChain>,
    curves: Tabulated,
}

/// The prediction at a pose: the point in the tracker frame of the query's session, and its rows.
#[derive(Debug, Clone)]
pub struct Predicted {
    pub position: Point3<f64>,
    /// The rotation from the flange's axes to the tracker's.
    pub flange: UnitQuaternion<f64>,
    /// The motion of the point per unit of every column.
    pub rows: DMatrix<f64>,
    /// Covariance due to unknown settling errors, mm²; zero where they are known.
    pub approach: Matrix3<f64>,
}

impl FullModel {
    /// The model of a training; `problem` is the training's, without observations.
    fn of(
        trained: StoredFull,
        problem: Problem<'static>,
        posterior: Posterior,
        left_out: Vec<DVector<f64>>,
    ) -> Self {
        let curves = Tabulated::new(&trained.layout, &trained.mean, trained.starts.len());
        Self {
            frames: problem.frames(&trained.offsets),
            ready: Ready { chains: problem.held(&trained.offsets), curves },
            problem,
            trained,
            posterior,
            left_out,
        }
    }

    /// Trains the model on `observations` from the frames and the offsets of a geometric fit.
    ///
    /// `None` where a factorisation fails, which only rounding can cause.
    pub fn train(
        arm: &Arm,
        observations: &[Observation],
        (frames, geometry): (&[Frames], &[f64]),
        prior: &Prior,
        settings: &FullSettings,
        purpose: Purpose,
        up: Option<UnitVector3<f64>>,
    ) -> Option<Self> {
        let up = up.map(UnitVector3::into_inner);
        let turned = is_turned(observations);
        let problem = Problem::of_geometry(observations, arm, frames, prior, turned);
        let mut start = DVector::zeros(problem.unknowns.len());
        start.rows_mut(0, geometry.len()).copy_from_slice(geometry);
        let settled = train::train(&problem, start.clone(), settings, up)?;
        let (mut settled, curves) = settled.without_curves_that_fail(&problem, start, settings);
        let scale_evidence = settled.scale_evidence(&problem);
        let mut parts: Vec<_> = curves.into_iter().chain(settled.weigh_parts()).collect();
        let empty = Problem::of_geometry(&[], arm, frames, prior, turned);
        let left_out = match purpose {
            Purpose::Published => settled.leave_one_out(&problem),
            Purpose::Judges => Vec::new(),
        };
        let mut own = Self::of_settled(&problem, empty, settled, &left_out, settings);
        parts.extend(own.trained.sides.as_ref().map(Sides::evidence));
        own.trained.scale_evidence = scale_evidence;
        own.trained.parts = parts;
        Some(own)
    }

    fn of_settled(
        problem: &Problem<'_>,
        empty: Problem<'static>,
        settled: train::Settled,
        left_out: &[LeftOut],
        settings: &FullSettings,
    ) -> Self {
        let mean = settled.posterior.mean() + &settled.prior_mean;
        let mut approach = ApproachOffsets::of(problem.observations, &settled.state.layout, &mean);
        let around = Around::new(problem, &settled.state);
        let sides = Sides::of(&around, &settled.prior_mean, &settled.posterior);
        if let Some(sides) = &sides {
            approach = Some(ApproachOffsets::with(approach, &sides.variances));
        }
        let rows_at = settled.state.offsets.clone();
        let train::Settled { mut state, posterior, .. } = settled;
        let mean = at_fitted_bases(&problem.unknowns, &mut state.offsets, mean);
        let weights = of_readings(problem.observations, &state.weights);
        let trained = StoredFull {
            up: state.up,
            starts: problem.starts.clone(),
            turned: is_turned(problem.observations),
            // The basis has variance one half at a random time.
            drift_variance: 0.5 * state.components.size(Part::Drift).unwrap_or(0.0),
            warm_up_variance: 0.5 * state.components.size(Part::WarmUp).unwrap_or(0.0),
            middles: state.middles,
            scale_sd: 1e-6 * settings.session_scale_ppm,
            scale_evidence: None,
            approach,
            sides,
            tails: state.tails,
            layout: state.layout,
            offsets: state.offsets,
            rows_at,
            mean,
            scale: posterior.scale.clone(),
            whitened: posterior.whitened.clone(),
            span: state.span,
            repeatability: state.repeatability,
            weights,
            parts: Vec::new(),
        };
        Self::of(trained, empty, posterior, of_observations(left_out))
    }

    pub fn predict(&self, query: &Query<'_>) -> Predicted {
        let view = self.viewed(query);
        let rows = self.view_of(query, &view).rows(&self.trained.layout, &Shown::Point);
        let moved: DVector<f64> = &rows * &self.trained.mean;
        let (shift, approach) = self.stands(query, &view.joints);
        let moved = Vector3::new(moved[0], moved[1], moved[2]) + shift.linear;
        let position = Point3::from(view.end.translation.vector + moved);
        Predicted {
            position,
            flange: view.end.rotation * self.target_from_flange(query),
            rows,
            approach,
        }
    }

    /// The predicted point (mm) with the rotation from the flange's axes to the tracker's, including the turns from curves, gravity and the
    /// other parts, which [`Predicted::flange`] leaves out; much faster than [`Self::predict`].
    pub fn pose(&self, query: &Query<'_>) -> Isometry3<f64> {
        let view = self.viewed(query);
        let pose = self.view_of(query, &view);
        let (moved, shift) = (self.moved(&pose), self.stands(query, &view.joints).0);
        let turn = UnitQuaternion::from_scaled_axis(moved.angular + shift.angular);
        let flange = turn * view.end.rotation * self.target_from_flange(query);
        let point = pose.end.coords + moved.linear + shift.linear;
        Isometry3::from_parts(point.into(), flange)
    }

    /// The point of [`Self::pose`].
    pub fn position(&self, query: &Query<'_>) -> Point3<f64> {
        Point3::from(self.pose(query).translation.vector)
    }

    /// The motion of a pose's point by the coefficients of the model.
    fn moved(&self, pose: &PoseView<'_>) -> Twist {
        pose.moved(&self.trained.layout, &self.trained.mean, &self.ready.curves)
    }

    /// The point at the offsets where rows are evaluated, and its motion.
    fn viewed(&self, query: &Query<'_>) -> ChainView {
        let lever = self.target_from_flange(query) * query.lever;
        let mut view = self.ready.chains.of(query.channel()).view_of(query.axes, &lever);
        if !query.own {
            let is_base =
                |place: usize| matches!(self.problem.unknowns[place].parameter, Parameter::Base(_));
            view.unknowns.retain(|(place, _)| !is_base(*place));
        }
        view
    }

    /// The rotation from the flange's axes to the target's.
    fn target_from_flange(&self, query: &Query<'_>) -> UnitQuaternion<f64> {
        self.frames[query.session].flange_from_target(query.target).isometry().rotation.inverse()
    }

    fn view_of<'v>(&self, query: &Query<'v>, view: &'v ChainView) -> PoseView<'v> {
        let base = self.frames[query.session].tracker_from_base(query.source).isometry();
        let root = base.rotation;
        PoseView {
            unknowns: &view.unknowns,
            joints: &view.joints,
            axes: &view.axes,
            end: view.end.translation.vector.into(),
            up: self.trained.up.map(|up| root * up),
            base: *root.to_rotation_matrix().matrix(),
            angles: query.axes,
            settling_error: match query.known {
                Known::Both(settling_error) => Some(settling_error),
                Known::Reported | Known::Commanded => None,
            },
            session: query.own.then_some(query.session),
            // Beyond the longest session of the training, the drift keeps its last value.
            time: query.station.map(|station| (station as f64 / self.trained.span).min(1.0)),
            middle: base * self.trained.middles[query.session],
        }
    }

    fn against(&self, query: &Query<'_>) -> Option<&Against> {
        let approach = self.trained.approach.as_ref()?;
        match query.known {
            Known::Commanded => Some(&approach.commanded),
            Known::Reported => Some(&approach.reported),
            Known::Both(_) => None,
        }
    }

    /// Mean of the point's motion by unknown settling errors, and the covariance of its place (mm²); zero where they are known.
    fn stands(&self, query: &Query<'_>, joints: &[Twist]) -> (Twist, Matrix3<f64>) {
        let (mut shift, mut covariance) = (Twist::zero(), Matrix3::zeros());
        let against = self.against(query).into_iter();
        let sizes = against.flat_map(|own| own.mean.iter().zip(&own.variance));
        for (twist, (mean, variance)) in joints.iter().zip(sizes) {
            shift.add(twist, *mean);
            covariance += twist.linear * twist.linear.transpose() * *variance;
        }
        (shift, covariance)
    }

    /// Covariance of predicted positions whose rows are stacked, three each, mm².
    pub fn covariances(&self, rows: &DMatrix<f64>) -> Vec<Matrix3<f64>> {
        let firsts: Vec<usize> = (0..rows.nrows()).step_by(3 * POSITIONS).collect();
        let some = |&first: &usize| {
            let count = (3 * POSITIONS).min(rows.nrows() - first);
            let half = self.posterior.half(&rows.rows(first, count).into_owned());
            let positions = (0..count / 3).map(|place| {
                let own = half.columns(3 * place, 3);
                let covariance = own.tr_mul(&own);
                Matrix3::from_fn(|row, column| covariance[(row, column)])
            });
            positions.collect::<Vec<_>>()
        };
        firsts.par_iter().flat_map_iter(some).collect()
    }

    pub fn unknowns(&self) -> &[Unknown] {
        &self.problem.unknowns
    }

    pub fn offsets(&self) -> DVector<f64> {
        &self.trained.offsets + self.trained.mean.rows(0, self.trained.offsets.len())
    }

    pub fn coefficients(&self, block: Block) -> Option<DVector<f64>> {
        let columns = self.trained.layout.columns(block)?;
        Some(self.trained.mean.rows(columns.start, columns.len()).into_owned())
    }

    pub fn starts(&self) -> &[Frames] {
        &self.problem.starts
    }

    pub fn fitted_frames(&self) -> Vec<Frames> {
        self.problem.frames(&self.offsets())
    }

    /// Noise covariance of one position measured with the base of a session that trained, in addition to the model's own covariance, at
    /// full weight, tracker frame, mm²; zero where none was measured.
    pub fn noise(&self, observation: &Observation, session: usize) -> Matrix3<f64> {
        let channel = Channel { session, ..observation.channel() };
        let view = self.ready.chains.of(channel).view(&observation.axes);
        if observation.point().is_none() {
            return Matrix3::zeros();
        }
        let shown = observation.measured.shown(None, &view.end.translation.vector.into());
        let covariance = self.covariance_of_one(observation, &shown, &view.joints);
        Matrix3::from_fn(|row, column| covariance[(row, column)]) * self.trained.tails.inflation()
    }

    /// Covariance of one reading's noise at weight 1; it shows `shown` of its target's motion by each joint.
    fn covariance_of_one(
        &self,
        observation: &Observation,
        shown: &Shown,
        joints: &[Twist],
    ) -> DMatrix<f64> {
        let base = Matrix3::identity();
        let reading = NoisyReading { observation, shown, joints, base };
        self.trained.repeatability.covariance(&StationNoise::of(&[reading]), 1.0)
    }

    /// Variance of measured minus predicted length of a reading that took no part, mm²: of the prediction with the instrument's place, and
    /// of the noise. `None` of a reading of places.
    pub fn length_variance(&self, observation: &Observation) -> Option<f64> {
        let channel = observation.channel();
        let gauge = self.problem.gauge(channel, &self.trained.offsets)?;
        let query = Query::of(observation);
        let view = self.viewed(&query);
        let end = Point3::from(view.end.translation.vector);
        let shown = observation.measured.shown(Some(&gauge), &end);
        let mut rows = self.view_of(&query, &view).rows(&self.trained.layout, &shown);
        // The unknowns are the first columns; the session's scale is that of the source of places.
        for (unknown, by) in self.problem.by_parts(channel, Some(&gauge), &end) {
            rows[(0, unknown)] = by;
        }
        if let Some(scale) = self.trained.layout.columns(Block::Scale(observation.session)) {
            rows.column_mut(scale.start).fill(0.0);
        }
        let (_, approach) = self.stands(&query, &view.joints);
        let along = gauge.direction(&end);
        let noise = self.covariance_of_one(observation, &shown, &view.joints)[(0, 0)];
        let noise = noise * self.trained.tails.inflation();
        Some(self.posterior.half(&rows).norm_squared() + along.dot(&(approach * along)) + noise)
    }

    /// Covariance of the arm's repeatability at one visit, in addition to the model's own covariance, tracker frame, mm².
    /// It includes structure too fine for the model: only repeated visits of a pose distinguish the two.
    pub fn visit_covariance(&self, query: &Query<'_>) -> Matrix3<f64> {
        let joints = self.viewed(query).joints;
        let sizes = &self.trained.repeatability;
        let arm = Matrix3::identity() * sizes.position;
        let scale = joints.iter().zip(&sizes.joints).fold(arm, |sum, (twist, variance)| {
            sum + twist.linear * twist.linear.transpose() * *variance
        });
        scale * self.trained.tails.inflation()
    }

    /// Standard deviations of the repeatability: of the arm as a whole per axis, mm, and of each joint, rad.
    pub fn visit_deviations(&self) -> (f64, Vec<f64>) {
        let inflation = self.trained.tails.inflation();
        let sizes = &self.trained.repeatability;
        let deviation = |variance: &f64| (variance * inflation).sqrt();
        (deviation(&sizes.position), sizes.joints.iter().map(deviation).collect())
    }

    pub const fn any_time_variance(&self) -> f64 {
        self.trained.drift_variance + self.trained.warm_up_variance
    }

    /// Covariance of a point due to the unknown scale of another session, in the source's frame, mm².
    pub fn any_scale_covariance(
        &self,
        session: usize,
        source: SourceId,
        point: &Point3<f64>,
    ) -> Matrix3<f64> {
        let base = self.frames[session].tracker_from_base(source).isometry();
        let away = (point - base * self.trained.middles[session]) * self.trained.scale_sd;
        away * away.transpose()
    }
}

/// Moves the bases to their posterior means, so that a prediction without the session's own parts has the base that was fitted with the
/// other columns: `offsets` take the bases' coefficients, which are zero in the `mean` returned.
///
/// Base and arm share directions (a turn of the base and one of the first joints), so the last step of a training may move them far
/// in opposite ways; one half of such a step is worse than neither.
fn at_fitted_bases(
    unknowns: &[Unknown],
    offsets: &mut DVector<f64>,
    mut mean: DVector<f64>,
) -> DVector<f64> {
    for (place, unknown) in unknowns.iter().enumerate() {
        if matches!(unknown.parameter, Parameter::Base(_)) {
            offsets[place] += mean[place];
            mean[place] = 0.0;
        }
    }
    mean
}
