//! Training: rounds of linear regression, in which sizes, noise, weights and gear lines converge.
//!
//! Each round: rows at the current geometry, without harmonics that add next to nothing; whitened by the current
//! noise and weights; one Gram matrix, of the columns or, where they are fewer, of the rows; one factor with its inverse, from which
//! follow a step of the variance components and leave-one-out residuals; from these the noise, the weights and new gear lines. The
//! last round has all columns and a few steps more of the sizes.

use std::ops::Range;

use nalgebra::{DVector, Vector3};

use super::columns::{layout, middles, unknown_variances};
use super::components::Components;
use super::layout::Block;
use super::leave_one_out::{LeftOut, find_lines, leave_one_out};
use super::lines::FoundLine;
use super::noise::{Repeatability, of_length};
use super::regression::{Evidence, Inverse, Posterior};
use super::rows::{Around, State, prior_mean, stations};
use super::settings::FullSettings;
use super::student::Tails;
use super::whitening::evidence;
use crate::fit::observation::Observation;
use crate::fit::problem::Problem;

/// Rounds before the last, which only converges.
const ROUNDS: usize = 4;
/// Those of a training that starts where another with more parts ended.
const FEWER_ROUNDS: usize = 2;
/// Steps of the sizes in the last round.
const LAST_STEPS: usize = 2;
const LINE_ROUNDS: usize = 3;

#[derive(Debug, Clone)]
pub struct Settled {
    pub state: State,
    pub evidence: Evidence,
    pub posterior: Posterior,
    /// Prior mean of the columns at the last round's offsets.
    pub prior_mean: DVector<f64>,
}

/// Trains on `problem` from the offsets of a geometric fit; `None` if a factorisation fails.
pub fn train(
    problem: &Problem<'_>,
    start: DVector<f64>,
    settings: &FullSettings,
    up: Option<Vector3<f64>>,
) -> Option<Settled> {
    settled(problem, State::expected(problem, start, settings, up), settings, ROUNDS)
}

impl Settled {
    pub(super) fn leave_one_out(&self, problem: &Problem<'_>) -> Vec<LeftOut> {
        let around = Around::new(problem, &self.state);
        leave_one_out(&around, &self.prior_mean, &self.posterior, self.posterior.inverse())
    }

    /// Trains a model with fewer parts on the same stations: it starts where this one ended, but for the sizes.
    pub(super) fn with_fewer_parts(
        &self,
        problem: &Problem<'_>,
        settings: &FullSettings,
    ) -> Option<Self> {
        let start = self.state.offsets.clone();
        let mut state = State::expected(problem, start, settings, self.state.up);
        state.weights.clone_from(&self.state.weights);
        settled(problem, state, settings, FEWER_ROUNDS)
    }
}

fn settled(
    problem: &Problem<'_>,
    mut state: State,
    settings: &FullSettings,
    rounds: usize,
) -> Option<Settled> {
    let expected = state.repeatability.clone();
    state.repeatability.start_from(problem.misfit_mm(&state.offsets));
    for round in 0..rounds {
        let narrow = state.narrowed(&Around::new(problem, &state));
        let prior_mean = prior_mean(problem, &narrow);
        let around = Around::new(problem, &narrow);
        let mut components = narrow.components.clone();
        let (posterior, inverse) = components.step(&evidence(&around, &prior_mean))?;
        let left_out = leave_one_out(&around, &prior_mean, &posterior, inverse);
        state.components.take_sizes(&components);
        let noise: Vec<_> = left_out.iter().map(|own| &own.noise).collect();
        state.repeatability.update(&noise, &expected);
        if settings.student_t > 0.0 {
            let distance = |own: &LeftOut| (own.distance_squared, own.residual.len() as f64);
            state.tails = Tails::of(&left_out.iter().map(distance).collect::<Vec<_>>());
        }
        state.weights = left_out.iter().map(|l| l.weight(state.tails)).collect();
        if settings.gear_lines && round < LINE_ROUNDS {
            state.take_in(&find_lines(problem, &state.layout, &left_out, settings), settings);
        }
        state.offsets += (posterior.mean() + prior_mean).rows(0, state.offsets.len());
    }
    let prior_mean = prior_mean(problem, &state);
    let evidence = evidence(&Around::new(problem, &state), &prior_mean);
    for _ in 0..LAST_STEPS {
        state.components.step(&evidence)?;
    }
    let posterior = evidence.posterior_at(state.components.variances().map(f64::sqrt))?;
    Some(Settled { state, evidence, posterior, prior_mean })
}

impl State {
    /// The state before the first round, with expected sizes.
    pub(super) fn expected(
        problem: &Problem<'_>,
        offsets: DVector<f64>,
        settings: &FullSettings,
        up: Option<Vector3<f64>>,
    ) -> Self {
        let observations = problem.observations;
        let last = observations.iter().map(|o| o.station).max().unwrap_or(0);
        let span = (last + 1) as f64;
        let layout = layout(problem, &offsets, settings, up.is_some(), span);
        let components = Components::new(&layout, &unknown_variances(problem), settings, span);
        let joints = observations.first().map_or(0, |o| o.axes.len());
        let sources = observations.iter().filter_map(of_length).max();
        let repeatability = Repeatability::expected(settings, &problem.slides()[..joints]);
        Self {
            up,
            components,
            repeatability: Repeatability {
                lengths: vec![1.0; sources.map_or(0, |last| last + 1)],
                own: has_several(observations).then_some(repeatability.position),
                ..repeatability
            },
            tails: Tails::Normal,
            weights: vec![1.0; stations(observations).len()],
            middles: middles(problem),
            offsets,
            span,
            layout,
        }
    }

    fn take_in(&mut self, found: &[FoundLine], settings: &FullSettings) {
        for line in found {
            self.layout.push(Block::Line { joint: line.joint, cycles: line.cycles }, 2);
        }
        self.components.add_lines(&self.layout, settings);
    }
}

/// Whether some station has readings of several places, which distinguish each reading's noise from the arm's.
fn has_several(observations: &[Observation]) -> bool {
    let places = |own: &Range<usize>| {
        observations[own.clone()].iter().filter(|own| own.point().is_some()).count()
    };
    stations(observations).iter().any(|own| places(own) > 1)
}

impl Components {
    /// Makes a step of the sizes on the rows of one round; returns the posterior before it and its inverse. `None` if a factorisation fails.
    fn step(&mut self, evidence: &Evidence) -> Option<(Posterior, Inverse)> {
        let variances = self.variances();
        let posterior = evidence.posterior_at(variances.map(f64::sqrt))?;
        let inverse = posterior.inverse();
        let squares = posterior.whitened.map(|u| u * u);
        self.update(&squares, &posterior.determined(&inverse), &variances);
        Some((posterior, inverse))
    }
}
