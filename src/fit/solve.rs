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
/// A cost is a sum of thousands of squares: below this share of it a difference is rounding.
const ROUNDING: f64 = 1e-12;
const LEAST_DAMPING: f64 = 1e-12;
/// The squared share of an unknown's column that is independent of the others; above it the normal equations are accurate.
const DETERMINED: f64 = 1e-9;

/// Solves `problem` from its start; `rank` is the number of independent unknowns.
pub fn solve(problem: &Problem<'_>, loss: Loss, rank: usize) -> Solution {
    let offsets = DVector::zeros(problem.unknowns().len());
    let mut norms = problem.norms(&offsets);
    let start_cost = squares(&norms);
    let (mut weights, mut factor) = (vec![1.0; norms.len()], 1.0);
    let normal = problem.normal(&offsets, &weights);
    let mut point = Point { offsets, normal };
    let (mut iterations, mut convergence) = (0, Convergence::IterationLimit);
    // Without robust weights and prior, a further round would give the same solution.
    let one_round = loss == Loss::Squares && problem.is_free();
    for _ in 0..ROUNDS {
        let before = point.offsets.clone();
        let descent = descend(problem, point, &weights, factor);
        iterations += descent.steps;
        convergence = descent.convergence;
        point = descent.point;
        norms = problem.norms(&point.offsets);
        let renewed = robust_weights(problem, loss, &norms);
        factor = variance_factor(problem, &norms, &renewed, rank);
        if renewed != weights {
            weights = renewed;
            point.normal = problem.normal(&point.offsets, &weights);
        }
        let scales = step_scales(&point.normal, problem, factor);
        let done = one_round && convergence == Convergence::Converged;
        if done || (&point.offsets - before).component_div(&scales).amax() < 1e-3 {
            break;
        }
    }
    let cost = [start_cost, squares(&norms)];
    Solution {
        offsets: point.offsets,
        convergence,
        iterations,
        cost,
        variance_factor: factor,
        weights,
        information: point.normal.information,
    }
}

/// Offsets and the normal equations there.
struct Point {
    offsets: DVector<f64>,
    normal: Normal,
}

struct Descent {
    point: Point,
    steps: usize,
    convergence: Convergence,
}

/// One round: the weights and the variance factor stay as they are.
fn descend(problem: &Problem<'_>, start: Point, weights: &[f64], factor: f64) -> Descent {
    let cost_at = |point: &Point| point.normal.cost / factor + problem.prior_cost(&point.offsets);
    let mut point = start;
    let mut cost = cost_at(&point);
    let (mut damping, mut last_size) = (None, 0.0);
    let ended = |point, steps, convergence| Descent {
        point,
        steps,
        convergence,
    };
    for step in 1..=STEPS_PER_ROUND {
        let scales = step_scales(&point.normal, problem, factor);
        let gradient = &point.normal.gradient / factor + problem.prior_pull(&point.offsets);
        let information = &point.normal.information;
        let matrix = problem.posterior_information(information, &point.offsets, factor);
        let mut here = damping.unwrap_or_else(|| first_damping(&matrix, &scales));
        loop {
            let change = damped_step(&matrix, &gradient, &scales, here);
            let offsets = &point.offsets + &change;
            let normal = problem.normal(&offsets, weights);
            let tried = Point { offsets, normal };
            let tried_cost = cost_at(&tried);
            // The step in standard errors, along the direction in which it is largest (Newton's decrement).
            let size = gradient.dot(&change).max(0.0).sqrt();
            if tried_cost <= cost * (1.0 + ROUNDING) {
                (point, cost) = (tried, tried_cost);
                damping = Some((here * 0.1).max(LEAST_DAMPING));
                // Steps fall by a steady factor or faster, so the next step is smaller by that factor at least.
                if size * (size / last_size).min(1.0) < STEP_TOLERANCE {
                    return ended(point, step, Convergence::Converged);
                }
                last_size = size;
                break;
            }
            if size < STEP_TOLERANCE {
                return ended(point, step, Convergence::Converged);
            }
            here = (here * 10.0).max(1e-9);
            if here > 1e9 {
                return ended(point, step, Convergence::Stalled);
            }
        }
    }
    ended(point, STEPS_PER_ROUND, Convergence::IterationLimit)
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
