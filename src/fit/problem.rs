//! The identification problem: residuals of all observations and their identification Jacobian.
//!
//! `p_tracker = tracker_from_base · A_1(q_1) … A_n(q_n) · flange_from_target` ([`crate::method::kinematics`]). Geometry is
//! shared by all sessions of an arm; each session has its own base and target frames, and they are always part of the fit.

mod rows;
mod unknowns;

use nalgebra::{DMatrix, DVector, Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::observation::Observation;
use crate::geometry::Transform;
use crate::kinematics::batch::BLOCK;
use crate::kinematics::{
    Axis, BatchChain, BatchColumns, Chain, Element, HeldChain, Motion, Parameter,
};

use rows::Stations;
pub use rows::{BlockRows, dot};
pub use unknowns::{Frames, Freedom, KnownTarget, Prior, Unknown};

/// Observations and the chains that predict them, with a vector of unknown offsets.
#[derive(Debug)]
pub struct Problem<'a> {
    observations: &'a [Observation],
    chains: Vec<Chain>,
    unknowns: Vec<Unknown>,
    /// For each session, where each free parameter of its chain stands in the vector of unknowns.
    columns: Vec<Vec<Option<usize>>>,
    starts: Vec<Frames>,
    /// The observations of each session as columns.
    stations: Vec<Stations>,
    /// Session and first station of each block; fixed, so that sums do not depend on the number of threads.
    blocks: Vec<(usize, usize)>,
    /// Offsets that the prior expects, and its precision: `Σ precision (x − expected)²` is added to the cost.
    expected: DVector<f64>,
    precision: DVector<f64>,
}

/// The weighted normal equations at a point.
#[derive(Debug, Clone)]
pub struct Normal {
    /// `Jᵀ W J`.
    pub information: DMatrix<f64>,
    /// `Jᵀ W r`.
    pub gradient: DVector<f64>,
    /// `rᵀ W r`.
    pub cost: f64,
}

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
    pub(super) fn with_target_turn(
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
        let stations: Vec<_> = (0..starts.len())
            .map(|session| Stations::of(session, observations, arm.joint_count()))
            .collect();
        let blocks = stations.iter().enumerate().flat_map(|(session, own)| {
            let firsts = (0..own.places.len()).step_by(BLOCK);
            firsts.map(move |first| (session, first))
        });
        let blocks = blocks.collect();
        Self {
            observations,
            chains,
            columns,
            starts: starts.to_vec(),
            stations,
            blocks,
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
    pub(super) const fn prior_mean(&self) -> &DVector<f64> {
        &self.expected
    }

    /// The observations.
    pub const fn observations(&self) -> &[Observation] {
        self.observations
    }

    /// The prior's precision of each unknown (1/sd², zero where there is no prior).
    pub(super) const fn prior_precision(&self) -> &DVector<f64> {
        &self.precision
    }

    /// The prior's part of the cost's gradient at `offsets`, halved: `P (expected − x)`.
    pub(super) fn prior_pull(&self, offsets: &DVector<f64>) -> DVector<f64> {
        self.precision.component_mul(&(&self.expected - offsets))
    }

    /// The prior's part of the cost at `offsets`.
    pub(super) fn prior_cost(&self, offsets: &DVector<f64>) -> f64 {
        let away = offsets - &self.expected;
        self.precision.dot(&away.component_mul(&away))
    }

    /// Rows of residuals in all.
    pub(super) fn row_count(&self) -> usize {
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
        let mut norms = vec![0.0; self.observations.len()];
        for (session, stations) in self.stations.iter().enumerate() {
            let chain = self.batch(session, offsets);
            let squared = self.squared_norms(&chain, stations);
            for (&place, squared) in stations.places.iter().zip(squared) {
                norms[place] = squared.sqrt();
            }
        }
        norms
    }

    fn squared_norms(&self, chain: &BatchChain, stations: &Stations) -> Vec<f64> {
        let count = stations.places.len();
        if !stations.turned {
            let [x, y, z] = chain.positions(&stations.axes);
            let end = |i: usize| Vector3::new(x[i], y[i], z[i]);
            let squared = |i: usize| stations.whitened(i, end(i)).norm_squared();
            return (0..count).map(squared).collect();
        }
        let poses = chain.poses(&stations.axes);
        let squared = |i: usize| {
            let observation = &self.observations[stations.places[i]];
            let end = poses.isometry(i);
            let position = stations.whitened(i, end.translation.vector);
            let turn = residual(observation, &end)
                .rotation
                .zip(observation.orientation);
            let turn = turn.map_or(0.0, |(turn, (_, sd))| (turn / sd).norm_squared());
            position.norm_squared() + turn
        };
        (0..count).map(squared).collect()
    }

    /// Root mean square of measured minus predicted position over all observations, per axis, mm.
    pub fn misfit_mm(&self, offsets: &DVector<f64>) -> f64 {
        let mut sum = 0.0;
        for (session, stations) in self.stations.iter().enumerate() {
            let [x, y, z] = self.batch(session, offsets).positions(&stations.axes);
            for (i, &place) in stations.places.iter().enumerate() {
                let predicted = Vector3::new(x[i], y[i], z[i]);
                sum += (self.observations[place].position.coords - predicted).norm_squared();
            }
        }
        (sum / (3 * self.observations.len().max(1)) as f64).sqrt()
    }

    /// The weighted normal equations at `offsets`, one weight per observation.
    pub fn normal(&self, offsets: &DVector<f64>, weights: &[f64]) -> Normal {
        let chains = self.with_columns(offsets);
        let gram = |rows: &mut BlockRows, block: &(usize, usize)| {
            self.fill(rows, *block, &chains, weights);
            (rows.unknowns().to_vec(), rows.gram())
        };
        let grams: Vec<_> = self
            .blocks
            .par_iter()
            .map_init(BlockRows::default, gram)
            .collect();
        let size = self.unknowns.len();
        let mut information = DMatrix::zeros(size, size);
        let mut gradient = DVector::zeros(size);
        let mut cost = 0.0;
        for (unknowns, gram) in grams {
            let last = unknowns.len();
            cost += gram[(last, last)];
            for (column, &unknown) in unknowns.iter().enumerate() {
                gradient[unknown] += gram[(last, column)];
                for (row, &other) in unknowns.iter().enumerate().skip(column) {
                    let lower = (unknown.max(other), unknown.min(other));
                    information[lower] += gram[(row, column)];
                }
            }
        }
        information.fill_upper_triangle_with_lower_triangle();
        Normal {
            information,
            gradient,
            cost,
        }
    }

    /// Gives the whitened rows at `offsets` to `take`, block by block in a fixed order, no station weighted down.
    pub(super) fn each_block(&self, offsets: &DVector<f64>, mut take: impl FnMut(&BlockRows)) {
        let chains = self.with_columns(offsets);
        let weights = vec![1.0; self.observations.len()];
        let mut rows = BlockRows::default();
        for block in &self.blocks {
            self.fill(&mut rows, *block, &chains, &weights);
            take(&rows);
        }
    }

    fn fill(
        &self,
        rows: &mut BlockRows,
        (session, first): (usize, usize),
        chains: &[BatchColumns],
        weights: &[f64],
    ) {
        let stations = &self.stations[session];
        rows.fill(
            &chains[session],
            self.observations,
            weights,
            stations,
            first,
        );
    }

    fn with_columns(&self, offsets: &DVector<f64>) -> Vec<BatchColumns> {
        let at = |session: usize| {
            let local = self.local_offsets(session, offsets);
            BatchColumns::new(&self.chains[session], &local, &self.columns[session])
        };
        (0..self.chains.len()).map(at).collect()
    }

    fn batch(&self, session: usize, offsets: &DVector<f64>) -> BatchChain {
        BatchChain::new(&self.chains[session], &self.local_offsets(session, offsets))
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
