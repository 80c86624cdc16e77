//! A pool that grows: a further session enters by its own sums, at the cost of that session and a few solves.
//!
//! What a trained pool says of its columns is the sums of its rows ([`super::regression::sessions`]) at stated noise, weights and
//! linearisation. A further session at the same noise adds a block of its own and its part of the shared one; what the others said
//! stays as it was summed. So the sizes, the new session's weights and its frames converge on sums that are at hand:
//! 1. the columns of the new session, those of the last one repeated;
//! 2. rounds of the new session's rows, sizes, leave-one-out residuals and weights;
//! 3. the posterior of all.
//!
//! The sums are those of the training's last round. Where the shared geometry moved further than their linearisation holds, the pool is
//! trained anew from all its stations; so is one whose curves age, since the latest session is another, and one with a repair.

use nalgebra::{DVector, UnitVector3};

use super::approach::ApproachOffsets;
use super::columns::{middles, unknown_variances};
use super::components::Components;
use super::layout::{Block, Layout};
use super::leave_one_out::leave_one_out;
use super::partition::Partition;
use super::regression::sessions::SessionSums;
use super::regression::{Evidence, Sums};
use super::rows::{Around, prior_mean, stations};
use super::train::{Settled, State, settle};
use super::whitening::sums_of;
use super::{FullModel, FullSettings, PartEvidence};
use crate::fit::frames::Frames;
use crate::fit::observation::Observation;
use crate::fit::problem::{Freedom, Prior, Problem, Unknown};
use crate::kinematics::Arm;

/// Rounds of the new session: the base's start is within a millimetre, and its weights settle.
const ROUNDS: usize = 3;
/// A shared angle that moves by more than this since the sums were made bends a metre by more than half a micrometre, rad.
const LARGEST_TURN_RAD: f64 = 1e-3;

/// The sums of a trained pool, for sessions to come.
#[derive(Debug, Clone)]
pub struct PoolSums {
    state: State,
    unknowns: Vec<Unknown>,
    turned: bool,
    sums: SessionSums,
    parts: Vec<PartEvidence>,
    approach: Option<ApproachOffsets>,
    /// Weight of each observation so far.
    weights: Vec<f64>,
}

impl PoolSums {
    /// Takes the sums of a settled training; `None` unless it is of several sessions whose curves do not age, and without a repair.
    pub(super) fn of(settled: &mut Settled, problem: &Problem<'_>, turned: bool) -> Option<Self> {
        let taken = Evidence::Sums(Sums::zero(0));
        let Evidence::Sessions(sums) = std::mem::replace(&mut settled.evidence, taken) else {
            return None;
        };
        let layout = &settled.state.layout;
        let is_steady = layout.ages_years().is_empty() && layout.repairs_to_come().is_empty();
        is_steady.then(|| Self {
            state: settled.state.clone(),
            unknowns: problem.unknowns().to_vec(),
            turned,
            sums,
            parts: Vec::new(),
            approach: None,
            weights: Vec::new(),
        })
    }

    /// Takes evidence of parts, settling errors and weights from the full error model.
    pub(super) fn of_model(&mut self, model: &FullModel) {
        self.parts.clone_from(&model.parts);
        self.approach.clone_from(&model.approach);
        self.weights.clone_from(&model.weights);
    }

    /// The model of these sessions and one more, and the sums of all. `observations` are those of the new session, whose number is that
    /// of the sessions before; `frames` are those of all, as the training had them, and the new one's.
    ///
    /// `None` where the pool has to be trained anew: the shared geometry moved further than the linearisation holds, or the session
    /// has parts that the last one had not; or where rounding made a matrix indefinite.
    pub fn with_session(
        &self,
        arm: &Arm,
        observations: &[Observation],
        frames: &[Frames],
        prior: &Prior,
        settings: &FullSettings,
        up: Option<UnitVector3<f64>>,
    ) -> Option<(FullModel, Self)> {
        let chain = arm.chain();
        let geometry = Freedom::Geometry;
        let problem =
            Problem::with_target_turn(observations, chain, frames, geometry, prior, self.turned);
        let mut state = self.wider(&problem, settings)?;
        let new = frames.len() - 1;
        let up = up.map(UnitVector3::into_inner);
        let all: Vec<usize> = (0..state.weights.len()).collect();
        let mut round = 0;
        loop {
            round += 1;
            let expected = prior_mean(&problem, &state);
            let around = Around::new(&problem, &state, up);
            let mut sums = self.before(&around.partition)?;
            let own = sums_of(&around, (new, &all), &around.rows(&all), &expected);
            sums.add(new, &own, 1.0);
            let evidence = Evidence::Sessions(sums);
            let mut components = state.components.clone();
            let posterior = settle(&mut components, &evidence, 1)?;
            let left_out = leave_one_out(&around, &expected, &posterior);
            state.components = components;
            if round == ROUNDS {
                let mut settled = Settled {
                    state,
                    evidence,
                    posterior,
                    prior_mean: expected,
                    left_out,
                };
                if !holds(&problem, &settled) {
                    return None;
                }
                let mut sums = Self::of(&mut settled, &problem, self.turned)?;
                let empty =
                    Problem::with_target_turn(&[], chain, frames, geometry, prior, self.turned);
                let scale_evidence = settled.scale_evidence(&problem);
                let grown = FullModel::of_settled((&problem, empty), settled, settings, up);
                let model = FullModel {
                    scale_evidence,
                    parts: self.parts.clone(),
                    approach: self.approach.clone(),
                    weights: self
                        .weights
                        .iter()
                        .copied()
                        .chain(grown.weights.clone())
                        .collect(),
                    ..grown
                };
                sums.of_model(&model);
                return Some((model, sums));
            }
            state.weights = left_out.iter().map(|own| own.weight(state.tails)).collect();
            state.move_frames(&problem, new, &(posterior.mean() + expected));
        }
    }

    /// The state of a pool with one more session, whose stations have weight 1 and whose frames start where they are.
    fn wider(&self, problem: &Problem<'_>, settings: &FullSettings) -> Option<State> {
        let sessions = problem.starts().len();
        let layout = self.wider_layout(problem.unknowns().len(), sessions.checked_sub(2)?);
        let offset = |own: &Unknown| {
            let past = self.unknowns.iter().position(|other| other == own);
            past.map_or(0.0, |past| self.state.offsets[past])
        };
        let variances = unknown_variances(problem);
        let mut components = Components::new(&layout, &variances, settings, self.state.span);
        components.take_sizes(&self.state.components);
        let offsets = problem.unknowns().iter().map(offset);
        let mut all = self.state.middles.clone();
        all.extend(middles(problem).pop());
        Some(State {
            layout,
            components,
            repeatability: self.state.repeatability.clone(),
            tails: self.state.tails,
            weights: vec![1.0; stations(problem.observations()).len()],
            offsets: DVector::from_iterator(problem.unknowns().len(), offsets),
            span: self.state.span,
            middles: all,
        })
    }

    /// The columns with those of one more session, which has the parts of the session `last`.
    fn wider_layout(&self, unknowns: usize, last: usize) -> Layout {
        let past = &self.state.layout;
        let mut layout =
            Layout::new(past.period_turns()).with_slides(past.slide_periods_mm().to_vec());
        for (block, columns) in past.blocks() {
            if block == Block::Unknowns {
                layout.push(block, unknowns);
                continue;
            }
            layout.push(block, columns.len());
            if let Some(next) = block.of_next(last) {
                layout.push(next, columns.len());
            }
        }
        layout
    }

    /// The sums so far, with an empty block for the new session; `None` unless all others have the columns that they had.
    fn before(&self, partition: &Partition) -> Option<SessionSums> {
        let mut sums = SessionSums::zero(partition);
        let lengths = |own: &[Vec<usize>]| own.iter().map(Vec::len).collect::<Vec<_>>();
        let sessions = self.sums.own.len();
        let same = lengths(&partition.own[..sessions]) == lengths(&self.sums.partition.own)
            && partition.common.len() == self.sums.partition.common.len();
        same.then(|| {
            sums.own[..sessions].clone_from_slice(&self.sums.own);
            sums.common = self.sums.common.clone();
            sums
        })
    }
}

/// Whether the shared geometry is near enough to where the rows were made.
fn holds(problem: &Problem<'_>, settled: &Settled) -> bool {
    let mean = settled.posterior.mean() + &settled.prior_mean;
    let mut shared = problem.unknowns().iter().zip(&mean);
    shared.all(|(own, moved)| {
        let turns = own.session().is_none() && own.parameter.is_angle();
        !turns || moved.abs() < LARGEST_TURN_RAD
    })
}

impl State {
    /// Moves the frames of one session to their means.
    fn move_frames(&mut self, problem: &Problem<'_>, session: usize, mean: &DVector<f64>) {
        for (place, own) in problem.unknowns().iter().enumerate() {
            if own.session() == Some(session) {
                self.offsets[place] += mean[place];
            }
        }
    }
}
