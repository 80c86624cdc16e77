//! The identification problem: residuals of all observations and their identification Jacobian.
//!
//! `p_tracker = tracker_from_base · A_1(q_1) … A_n(q_n) · flange_from_target` (METHOD.md 2). Geometry is shared by all
//! sessions of an arm; each session has its own base and target frames, and they are always part of the fit.

use nalgebra::{DMatrix, DVector, Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::observation::Observation;
use crate::geometry::{Base, Flange, Target, Tracker, Transform};
use crate::kinematics::{Axis, Chain, Element, HeldChain, Motion, Parameter, Twist};

/// The two frames of one session that the fit finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frames {
    /// Where the base stands in the tracker's frame.
    pub tracker_from_base: Transform<Tracker, Base>,
    /// Where the target sits at the flange; turned only where orientations are measured.
    pub flange_from_target: Transform<Flange, Target>,
}

/// One unknown of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unknown {
    /// The session whose frame it belongs to; `None` for the arm's geometry.
    pub session: Option<usize>,
    /// What it is.
    pub parameter: Parameter,
}

/// Which parameters a fit may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// Base and target frames alone.
    BaseAndTarget,
    /// The base frame alone, for a session judged by an arm identified elsewhere.
    Base,
    /// Base and target frames, and the arm's geometry.
    Geometry,
}

/// Where the target sits at the flange, as far as it is known before the fit.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KnownTarget {
    /// Along the flange's axes, mm.
    pub xyz_mm: [f64; 3],
    /// Standard uncertainty per axis, mm.
    pub sd_mm: f64,
}

/// What is expected of the unknowns before any measurement, as standard deviations; the rest is free.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Prior {
    /// Of the geometry's lengths, mm; and of its angles, rad.
    pub geometry: Option<(f64, f64)>,
    /// Of the target's place.
    pub target: Option<KnownTarget>,
}

impl Prior {
    /// The expected offset of an unknown from `starts` and its standard deviation; `None` where it is free.
    fn of(&self, unknown: Unknown, starts: &[Frames]) -> Option<(f64, f64)> {
        match (unknown.session, unknown.parameter) {
            (None, parameter) => {
                let (length_mm, angle_rad) = self.geometry?;
                Some((
                    0.0,
                    if parameter.is_angle() {
                        angle_rad
                    } else {
                        length_mm
                    },
                ))
            }
            (Some(session), Parameter::Target(Motion::Translation(axis))) => {
                let known = self.target?;
                let start = starts[session]
                    .flange_from_target
                    .isometry()
                    .translation
                    .vector;
                let along = axis.unit().dot(&(Vector3::from(known.xyz_mm) - start));
                Some((along, known.sd_mm))
            }
            (Some(_), _) => None,
        }
    }
}

/// Observations and the chains that predict them, with a vector of unknown offsets.
#[derive(Debug)]
pub struct Problem<'a> {
    observations: &'a [Observation],
    chains: Vec<Chain>,
    unknowns: Vec<Unknown>,
    /// For each session, where each free parameter of its chain stands in the vector of unknowns.
    columns: Vec<Vec<Option<usize>>>,
    starts: Vec<Frames>,
    /// Offsets that the prior expects, and its precision: `Σ precision (x − expected)²` is added to the cost.
    expected: DVector<f64>,
    precision: DVector<f64>,
}

/// Whitened residuals and Jacobian of one observation: three rows for a position, six with an orientation.
#[derive(Debug, Clone)]
pub struct Rows {
    /// Measured minus predicted, whitened.
    pub residual: DVector<f64>,
    /// Derivative of the prediction with respect to all unknowns, whitened.
    pub jacobian: DMatrix<f64>,
}

/// The weighted normal equations at a point.
#[derive(Debug, Clone)]
pub struct Normal {
    /// `Jᵀ W J`.
    pub information: DMatrix<f64>,
    /// `Jᵀ W r`.
    pub gradient: DVector<f64>,
}

/// Observations a worker sums at once; fixed, so that sums do not depend on the number of threads.
const CHUNK: usize = 32;

impl<'a> Problem<'a> {
    /// A problem on `observations` of `starts.len()` sessions, around `arm` and the starting frames.
    pub fn new(
        observations: &'a [Observation],
        arm: &Chain,
        starts: &[Frames],
        freedom: Freedom,
        prior: Prior,
    ) -> Self {
        let turned = observations
            .iter()
            .any(|observation| observation.orientation.is_some());
        Self::with_target_turn(observations, arm, starts, freedom, prior, turned)
    }

    /// The same, the target's orientation free or not whatever the observations are: for predictions without any.
    pub fn with_target_turn(
        observations: &'a [Observation],
        arm: &Chain,
        starts: &[Frames],
        freedom: Freedom,
        prior: Prior,
        turned: bool,
    ) -> Self {
        let chains: Vec<_> = starts
            .iter()
            .map(|frames| measurement_chain(arm, frames, turned))
            .collect();
        let mut unknowns = Vec::new();
        if freedom == Freedom::Geometry {
            unknowns.extend(arm.parameters().into_iter().map(|parameter| Unknown {
                session: None,
                parameter,
            }));
        }
        for (session, chain) in chains.iter().enumerate() {
            let frames = chain
                .parameters()
                .into_iter()
                .filter(|parameter| match parameter {
                    Parameter::Base(_) => true,
                    Parameter::Target(_) => freedom != Freedom::Base,
                    Parameter::Link { .. } => false,
                });
            unknowns.extend(frames.map(|parameter| Unknown {
                session: Some(session),
                parameter,
            }));
        }
        let columns = chains.iter().enumerate().map(|(session, chain)| {
            let place = |parameter: &Parameter| {
                let session = (!matches!(parameter, Parameter::Link { .. })).then_some(session);
                unknowns.iter().position(|unknown| {
                    *unknown
                        == Unknown {
                            session,
                            parameter: *parameter,
                        }
                })
            };
            chain.parameters().iter().map(place).collect()
        });
        let columns = columns.collect();
        let priors = unknowns.iter().map(|unknown| prior.of(*unknown, starts));
        let priors: Vec<_> = priors
            .map(|prior| prior.map_or((0.0, 0.0), |(mean, sd)| (mean, sd.powi(-2))))
            .collect();
        let column = |pick: fn(&(f64, f64)) -> f64| {
            DVector::from_iterator(priors.len(), priors.iter().map(pick))
        };
        let (expected, precision) = (column(|prior| prior.0), column(|prior| prior.1));
        Self {
            observations,
            chains,
            columns,
            starts: starts.to_vec(),
            expected,
            precision,
            unknowns,
        }
    }

    /// The unknowns in the order of the vector.
    pub fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    /// The frames the offsets start from, session by session.
    pub fn starts(&self) -> &[Frames] {
        &self.starts
    }

    /// Offsets that the prior expects.
    pub const fn prior_mean(&self) -> &DVector<f64> {
        &self.expected
    }

    /// The observations.
    pub const fn observations(&self) -> &[Observation] {
        self.observations
    }

    /// The prior's precision of each unknown (1/sd², zero where there is no prior).
    pub const fn prior_precision(&self) -> &DVector<f64> {
        &self.precision
    }

    /// The prior's part of the cost's gradient at `offsets`, halved: `P (expected − x)`.
    pub fn prior_pull(&self, offsets: &DVector<f64>) -> DVector<f64> {
        self.precision.component_mul(&(&self.expected - offsets))
    }

    /// The prior's part of the cost at `offsets`.
    pub fn prior_cost(&self, offsets: &DVector<f64>) -> f64 {
        let away = offsets - &self.expected;
        self.precision.dot(&away.component_mul(&away))
    }

    /// Rows of residuals in all.
    pub fn row_count(&self) -> usize {
        self.observations
            .iter()
            .map(|o| if o.orientation.is_some() { 6 } else { 3 })
            .sum()
    }

    /// Each session's measurement chain, from the tracker's frame to the target, at `offsets`.
    pub fn held(&self, offsets: &DVector<f64>) -> Vec<HeldChain> {
        let held = |session: usize| {
            let local = self.local_offsets(session, offsets);
            HeldChain::new(&self.chains[session], &local, &self.columns[session])
        };
        (0..self.chains.len()).map(held).collect()
    }

    /// Whitened residual norm of each observation.
    pub fn norms(&self, offsets: &DVector<f64>) -> Vec<f64> {
        let chains = self.held(offsets);
        let norm = |observation: &Observation| {
            let predicted = chains[observation.session].end(&observation.axes);
            let residual = residual(observation, &predicted);
            let whitened = whitened_position(observation, &residual.position);
            let turned = residual.rotation.zip(observation.orientation);
            let rotation = turned.map_or(0.0, |(rotation, (_, sd))| (rotation / sd).norm_squared());
            (whitened.norm_squared() + rotation).sqrt()
        };
        self.observations
            .par_iter()
            .with_min_len(CHUNK)
            .map(norm)
            .collect()
    }

    /// Whitened residual and Jacobian rows of one observation, at the offsets that its session's chain is held at.
    pub fn rows(&self, observation: &Observation, chain: &HeldChain) -> Rows {
        let view = chain.view(&observation.axes);
        let residual = residual(observation, &view.end);
        let count = if observation.orientation.is_some() {
            6
        } else {
            3
        };
        let mut rows = Rows {
            residual: DVector::zeros(count),
            jacobian: DMatrix::zeros(count, self.unknowns.len()),
        };
        rows.residual
            .fixed_rows_mut::<3>(0)
            .copy_from(&whitened_position(observation, &residual.position));
        if let (Some(rotation), Some((_, sd))) = (residual.rotation, observation.orientation) {
            rows.residual
                .fixed_rows_mut::<3>(3)
                .copy_from(&(rotation / sd));
        }
        for (column, twist) in &view.unknowns {
            fill(&mut rows.jacobian, *column, observation, twist);
        }
        rows
    }

    /// The weighted normal equations at `offsets`, one weight per observation.
    pub fn normal(&self, offsets: &DVector<f64>, weights: &[f64]) -> Normal {
        let size = self.unknowns.len();
        let chains = self.held(offsets);
        let part = |(observations, weights): (&[Observation], &[f64])| {
            let mut sum = Normal {
                information: DMatrix::zeros(size, size),
                gradient: DVector::zeros(size),
            };
            for (observation, &weight) in observations.iter().zip(weights) {
                let Rows { residual, jacobian } =
                    self.rows(observation, &chains[observation.session]);
                sum.information.gemm_tr(weight, &jacobian, &jacobian, 1.0);
                sum.gradient.gemv_tr(weight, &jacobian, &residual, 1.0);
            }
            sum
        };
        let parts: Vec<_> = self
            .observations
            .par_chunks(CHUNK)
            .zip(weights.par_chunks(CHUNK))
            .map(part)
            .collect();
        let zero = Normal {
            information: DMatrix::zeros(size, size),
            gradient: DVector::zeros(size),
        };
        parts.into_iter().fold(zero, |sum, part| Normal {
            information: sum.information + part.information,
            gradient: sum.gradient + part.gradient,
        })
    }

    /// The frames of each session once `offsets` are taken into them.
    pub fn frames(&self, offsets: &DVector<f64>) -> Vec<Frames> {
        (0..self.chains.len())
            .map(|session| self.session_frames(session, offsets))
            .collect()
    }

    /// The geometry's offsets in the order of the arm's own chain; zeros where geometry was held.
    pub fn geometry(&self, offsets: &DVector<f64>) -> Vec<f64> {
        let is_link = |parameter: &Parameter| matches!(parameter, Parameter::Link { .. });
        let chain = &self.chains[0];
        let places = chain.parameters().into_iter().zip(&self.columns[0]);
        places
            .filter(|(parameter, _)| is_link(parameter))
            .map(|(_, place)| place.map_or(0.0, |place| offsets[place]))
            .collect()
    }

    fn session_frames(&self, session: usize, offsets: &DVector<f64>) -> Frames {
        let offset = |parameter| {
            let unknown = Unknown {
                session: Some(session),
                parameter,
            };
            let place = self.unknowns.iter().position(|u| *u == unknown);
            place.map_or(0.0, |place| offsets[place])
        };
        let moved = |of: fn(Motion) -> Parameter, motions: fn(Axis) -> Motion| {
            Axis::ALL.iter().fold(Isometry3::identity(), |end, &axis| {
                end * motions(axis).by(offset(of(motions(axis))))
            })
        };
        let start = &self.starts[session];
        let base =
            moved(Parameter::Base, Motion::Translation) * moved(Parameter::Base, Motion::Rotation);
        let shift = moved(Parameter::Target, Motion::Translation);
        let turn = moved(Parameter::Target, Motion::Rotation);
        Frames {
            tracker_from_base: Transform::claim(start.tracker_from_base.isometry() * base),
            // The shift is along the flange's axes, the turn about the target's own.
            flange_from_target: Transform::claim(
                shift * start.flange_from_target.isometry() * turn,
            ),
        }
    }

    fn local_offsets(&self, session: usize, offsets: &DVector<f64>) -> Vec<f64> {
        self.columns[session]
            .iter()
            .map(|place| place.map_or(0.0, |place| offsets[place]))
            .collect()
    }
}

/// `tracker_from_base · (six small motions) · arm · (three small shifts) · flange_from_target · (three small turns)`.
fn measurement_chain(arm: &Chain, frames: &Frames, turned: bool) -> Chain {
    let free = |of: fn(Motion) -> Parameter, motion| Element::Free {
        motion,
        nominal: 0.0,
        parameter: of(motion),
    };
    let shifts = |of| Axis::ALL.map(|axis| free(of, Motion::Translation(axis)));
    let turns = |of| Axis::ALL.map(|axis| free(of, Motion::Rotation(axis)));
    let mut before = vec![Element::Fixed(*frames.tracker_from_base.isometry())];
    before.extend(shifts(Parameter::Base));
    before.extend(turns(Parameter::Base));
    let mut after = Vec::from(shifts(Parameter::Target));
    after.push(Element::Fixed(*frames.flange_from_target.isometry()));
    if turned {
        after.extend(turns(Parameter::Target));
    }
    arm.extended(before, after)
}

/// Measured minus predicted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Position, mm.
    pub position: Vector3<f64>,
    /// Orientation as a rotation vector, rad, where it was measured.
    pub rotation: Option<Vector3<f64>>,
}

/// Measured minus predicted target of one observation.
pub fn residual(observation: &Observation, predicted: &Isometry3<f64>) -> Residual {
    let turn =
        |measured: UnitQuaternion<f64>| (measured * predicted.rotation.inverse()).scaled_axis();
    Residual {
        position: observation.position.coords - predicted.translation.vector,
        rotation: observation.orientation.map(|(measured, _)| turn(measured)),
    }
}

fn whitened_position(observation: &Observation, vector: &Vector3<f64>) -> Vector3<f64> {
    let solved = observation.position_factor.solve_lower_triangular(vector);
    solved.expect("a Cholesky factor has a positive diagonal")
}

fn fill(jacobian: &mut DMatrix<f64>, column: usize, observation: &Observation, twist: &Twist) {
    let linear = whitened_position(observation, &twist.linear);
    jacobian
        .fixed_view_mut::<3, 1>(0, column)
        .copy_from(&linear);
    if let Some((_, sd)) = observation.orientation {
        jacobian
            .fixed_view_mut::<3, 1>(3, column)
            .copy_from(&(twist.angular / sd));
    }
}
