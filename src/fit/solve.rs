//! Levenberg–Marquardt on the normal equations, columns scaled to unit norm, with a weak prior and a robust loss.
//!
//! The cost is `rᵀ W r / s² + Σ (x_i / sd_i)²`: the prior is weighted against the actual misfit of the model, not
//! against the instrument's noise, so that a model that cannot fit does not override the prior. `s²` and the robust
//! weights are recomputed between rounds of Levenberg–Marquardt.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::loss::{Loss, Numbers};
use super::problem::{Normal, Problem};

/// The state in which the solver ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Convergence {
    /// The last step was negligible.
    Converged,
    /// The limit of iterations was reached first.
    IterationLimit,
    /// No step lowered the cost, though the gradient was not yet zero.
    Stalled,
}

/// A solved problem.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Solution {
    /// Offsets in the order of the problem's unknowns.
    pub offsets: DVector<f64>,
    /// The state in which the solver ended.
    pub convergence: Convergence,
    /// Levenberg–Marquardt steps in all rounds.
    pub iterations: usize,
    /// Unweighted `rᵀ r` of whitened residuals before and after.
    pub cost: [f64; 2],
    /// `s² = rᵀ W r / (m − rank)`: 1 where the noise explains the misfit.
    pub variance_factor: f64,
    /// Robust weight of each observation.
    pub weights: Vec<f64>,
    /// `Jᵀ W J` at the solution.
    pub information: DMatrix<f64>,
}

const ROUNDS: usize = 12;
const STEPS_PER_ROUND: usize = 30;
/// A step below this many standard errors, of any combination of unknowns, is negligible.
const STEP_TOLERANCE: f64 = 1e-6;
/// The same where further rounds follow, which end when a whole round moves less than [`ROUND_TOLERANCE`].
const STEP_TOLERANCE_IN_ROUNDS: f64 = 1e-4;
/// A round that moves every unknown by less than this many standard errors is the last one.
const ROUND_TOLERANCE: f64 = 1e-3;
/// A cost is a sum of thousands of squares: below this share of it a difference is rounding.
const ROUNDING: f64 = 1e-12;
const LEAST_DAMPING: f64 = 1e-12;
/// The squared share of an unknown's column that is independent of the others; above it the normal equations are accurate.
const DETERMINED: f64 = 1e-9;

/// Solves `problem` from its start; `rank` is the number of independent unknowns.
pub fn solve(problem: &Problem<'_>, loss: Loss, rank: usize) -> Solution {
    let mut point = Point::at(problem, DVector::zeros(problem.unknowns().len()));
    let start_cost = squares(&point.norms);
    let (mut weights, mut factor) = (vec![1.0; point.norms.len()], 1.0);
    let (mut iterations, mut convergence) = (0, Convergence::IterationLimit);
    // Without robust weights and prior, a further round would give the same solution.
    let one_round = loss == Loss::Squares && problem.is_free();
    let tolerance = if one_round {
        STEP_TOLERANCE
    } else {
        STEP_TOLERANCE_IN_ROUNDS
    };
    let mut pace = 1.0;
    for _ in 0..ROUNDS {
        let before = point.offsets.clone();
        let descent = descend(problem, point, (&weights, factor), tolerance, pace);
        iterations += descent.steps;
        convergence = descent.convergence;
        (point, pace) = (descent.point, descent.pace);
        weights = robust_weights(problem, loss, &point.norms);
        factor = variance_factor(problem, &point.norms, &weights, rank);
        let moved = (&point.offsets - before).component_div(&descent.scales);
        let done = one_round && convergence == Convergence::Converged;
        if done || moved.amax() < ROUND_TOLERANCE {
            break;
        }
    }
    Solution {
        convergence,
        iterations,
        cost: [start_cost, squares(&point.norms)],
        variance_factor: factor,
        information: problem.normal(&point.offsets, &weights).information,
        offsets: point.offsets,
        weights,
    }
}

/// Offsets, and the whitened residual norm of each observation there.
struct Point {
    offsets: DVector<f64>,
    norms: Vec<f64>,
}

impl Point {
    fn at(problem: &Problem<'_>, offsets: DVector<f64>) -> Self {
        let norms = problem.norms(&offsets);
        Self { offsets, norms }
    }
}

struct Descent {
    point: Point,
    steps: usize,
    convergence: Convergence,
    /// The standard error that each unknown alone would have before the last step.
    scales: DVector<f64>,
    /// Size of the last step over that of the one before, at most 1.
    pace: f64,
}

/// One round: the weights and the variance factor stay as they are. `pace` is that of the round before, 1 without one.
fn descend(
    problem: &Problem<'_>,
    start: Point,
    (weights, factor): (&[f64], f64),
    tolerance: f64,
    mut pace: f64,
) -> Descent {
    let cost_at = |point: &Point| {
        let norms = point.norms.iter().zip(weights);
        let misfit: f64 = norms.map(|(norm, weight)| weight * norm * norm).sum();
        misfit / factor + problem.prior_cost(&point.offsets)
    };
    let mut point = start;
    let mut cost = cost_at(&point);
    let (mut damping, mut last_size) = (None, 0.0);
    let mut step = 1;
    loop {
        let normal = problem.normal(&point.offsets, weights);
        let scales = step_scales(&normal, problem, factor);
        let gradient = &normal.gradient / factor + problem.prior_pull(&point.offsets);
        let matrix = problem.posterior_information(&normal.information, &point.offsets, factor);
        let mut here = damping.unwrap_or_else(|| first_damping(&matrix, &scales));
        let ended = loop {
            let change = damped_step(&matrix, &gradient, &scales, here);
            let tried = Point::at(problem, &point.offsets + &change);
            let tried_cost = cost_at(&tried);
            // The step in standard errors, along the direction in which it is largest (Newton's decrement).
            let size = gradient.dot(&change).max(0.0).sqrt();
            if tried_cost <= cost * (1.0 + ROUNDING) {
                (point, cost) = (tried, tried_cost);
                damping = Some((here * 0.1).max(LEAST_DAMPING));
                // Steps fall by a steady factor or faster, so the next step is smaller by that factor at least.
                if last_size > 0.0 {
                    pace = (size / last_size).min(1.0);
                }
                last_size = size;
                break (size * pace < tolerance).then_some(Convergence::Converged);
            }
            if size < tolerance {
                break Some(Convergence::Converged);
            }
            here = (here * 10.0).max(1e-9);
            if here > 1e9 {
                break Some(Convergence::Stalled);
            }
        };
        let limit = (step == STEPS_PER_ROUND).then_some(Convergence::IterationLimit);
        if let Some(convergence) = ended.or(limit) {
            return Descent {
                point,
                steps: step,
                convergence,
                scales,
                pace,
            };
        }
        step += 1;
    }
}

/// The first damping: very small where poses or prior determine every unknown, since Newton's step is best there; otherwise
/// large enough to keep undetermined unknowns from following rounding errors.
fn first_damping(matrix: &DMatrix<f64>, scales: &DVector<f64>) -> f64 {
    let scaled = scaled(matrix, scales);
    let pivots = scaled.cholesky().map(|factor| factor.l_dirty().diagonal());
    let least = pivots.map_or(0.0, |pivots| {
        pivots.iter().fold(1.0, |a: f64, b| a.min(b * b))
    });
    if least > DETERMINED {
        LEAST_DAMPING
    } else {
        1e-6
    }
}

/// `D A D`.
fn scaled(matrix: &DMatrix<f64>, scales: &DVector<f64>) -> DMatrix<f64> {
    let size = scales.len();
    DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] * scales[i] * scales[j])
}

/// The standard error that each unknown alone would have: the inverse norm of its column; 1 for a zero column.
fn step_scales(normal: &Normal, problem: &Problem<'_>, factor: f64) -> DVector<f64> {
    let diagonal = normal.information.diagonal() / factor + problem.prior_precision();
    diagonal.map(|norm_squared| {
        if norm_squared > 0.0 {
            norm_squared.sqrt().recip()
        } else {
            1.0
        }
    })
}

/// `(D A D + λ I)⁻¹ D g`, scaled back: columns have unit norm, so one damping serves all.
fn damped_step(
    matrix: &DMatrix<f64>,
    gradient: &DVector<f64>,
    scales: &DVector<f64>,
    damping: f64,
) -> DVector<f64> {
    let mut scaled = scaled(matrix, scales);
    for i in 0..gradient.len() {
        scaled[(i, i)] += damping;
    }
    let right = gradient.component_mul(scales);
    let solved = scaled
        .cholesky()
        .map_or_else(|| right.clone(), |factor| factor.solve(&right));
    solved.component_mul(scales)
}

/// The robust weight of each observation, the readings of each source by a scale of their own: stated uncertainties of different
/// instruments are rarely of one scale.
fn robust_weights(problem: &Problem<'_>, loss: Loss, norms: &[f64]) -> Vec<f64> {
    let mut sources: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (place, own) in problem.observations().iter().enumerate() {
        let key = (own.source, Numbers::of(own.measured.kind()));
        sources.entry(key).or_default().push(place);
    }
    let mut weights = vec![1.0; norms.len()];
    for ((_, numbers), places) in sources {
        let own: Vec<f64> = places.iter().map(|&place| norms[place]).collect();
        for (place, weight) in places.into_iter().zip(loss.weights(&own, numbers)) {
            weights[place] = weight;
        }
    }
    weights
}

fn variance_factor(problem: &Problem<'_>, norms: &[f64], weights: &[f64], rank: usize) -> f64 {
    let misfit: f64 = norms
        .iter()
        .zip(weights)
        .map(|(norm, weight)| weight * norm * norm)
        .sum();
    let observations = problem.observations().iter().zip(weights);
    let rows = observations.map(|(own, weight)| weight * own.measured.kind().rows() as f64);
    factor_of(misfit, rows.sum(), rank)
}

/// `misfit / (rows − rank)`.
fn factor_of(misfit: f64, rows: f64, rank: usize) -> f64 {
    // Exact synthetic data fits to rounding; a floor keeps the prior's weight finite.
    (misfit / (rows - rank as f64).max(1.0)).max(1e-12)
}

fn squares(norms: &[f64]) -> f64 {
    norms.iter().map(|norm| norm * norm).sum()
}
