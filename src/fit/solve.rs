//! Levenberg–Marquardt on the normal equations, columns scaled to unit norm, with a weak prior and a robust loss.
//!
//! The cost is `rᵀ W r / s² + Σ (x_i / sd_i)²`: the prior is weighed against the misfit the model really has, not
//! against the instrument's noise, so that a model that cannot fit does not drown the prior. `s²` and the robust
//! weights are renewed between rounds of Levenberg–Marquardt.

use nalgebra::{DMatrix, DVector};

use super::loss::Loss;
use super::problem::{Normal, Problem};

/// How a solution ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convergence {
    /// The last step changed nothing that matters.
    Converged,
    /// The limit of iterations was reached first.
    IterationLimit,
    /// No step lowered the cost, though the gradient was not yet zero.
    Stalled,
}

/// A solved problem.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Offsets in the order of the problem's unknowns.
    pub offsets: DVector<f64>,
    /// How it ended.
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
/// A step below this many standard errors of every unknown changes nothing.
const STEP_TOLERANCE: f64 = 1e-6;

/// Solves `problem` from its start; `rank` is the number of unknowns the poses can tell apart.
pub fn solve(problem: &Problem<'_>, loss: Loss, rank: usize) -> Solution {
    let size = problem.unknowns().len();
    let mut offsets = DVector::zeros(size);
    let mut norms = problem.norms(&offsets);
    let start_cost = squares(&norms);
    let (mut weights, mut factor) = (vec![1.0; norms.len()], 1.0);
    let (mut iterations, mut convergence) = (0, Convergence::IterationLimit);
    for _ in 0..ROUNDS {
        let before = offsets.clone();
        let descent = descend(problem, offsets, &weights, factor);
        iterations += descent.steps;
        convergence = descent.convergence;
        offsets = descent.offsets;
        norms = problem.norms(&offsets);
        weights = loss.weights(&norms);
        factor = variance_factor(problem, &norms, &weights, rank);
        let scales = step_scales(&problem.normal(&offsets, &weights), problem, factor);
        if (&offsets - before).component_div(&scales).amax() < 1e-3 {
            break;
        }
    }
    let information = problem.normal(&offsets, &weights).information;
    let cost = [start_cost, squares(&norms)];
    Solution {
        offsets,
        convergence,
        iterations,
        cost,
        variance_factor: factor,
        weights,
        information,
    }
}

struct Descent {
    offsets: DVector<f64>,
    steps: usize,
    convergence: Convergence,
}

/// One round: the weights and the variance factor stay as they are.
fn descend(problem: &Problem<'_>, start: DVector<f64>, weights: &[f64], factor: f64) -> Descent {
    let cost_at = |offsets: &DVector<f64>| {
        let norms = problem.norms(offsets);
        let misfit: f64 = norms
            .iter()
            .zip(weights)
            .map(|(norm, weight)| weight * norm * norm)
            .sum();
        misfit / factor + problem.prior_cost(offsets)
    };
    let mut offsets = start;
    let mut cost = cost_at(&offsets);
    let mut damping = 1e-6;
    for step in 1..=STEPS_PER_ROUND {
        let normal = problem.normal(&offsets, weights);
        let scales = step_scales(&normal, problem, factor);
        let gradient = &normal.gradient / factor + problem.prior_pull(&offsets);
        let matrix = posterior_information(&normal.information, problem.prior_precision(), factor);
        loop {
            let change = damped_step(&matrix, &gradient, &scales, damping);
            let tried = &offsets + &change;
            let tried_cost = cost_at(&tried);
            let small = change.component_div(&scales).amax() < STEP_TOLERANCE;
            if tried_cost <= cost {
                (offsets, cost) = (tried, tried_cost);
                damping = (damping * 0.1).max(1e-12);
                if small {
                    return Descent {
                        offsets,
                        steps: step,
                        convergence: Convergence::Converged,
                    };
                }
                break;
            }
            if small {
                return Descent {
                    offsets,
                    steps: step,
                    convergence: Convergence::Converged,
                };
            }
            damping = (damping * 10.0).max(1e-9);
            if damping > 1e9 {
                return Descent {
                    offsets,
                    steps: step,
                    convergence: Convergence::Stalled,
                };
            }
        }
    }
    Descent {
        offsets,
        steps: STEPS_PER_ROUND,
        convergence: Convergence::IterationLimit,
    }
}

/// `s⁻² Jᵀ W J + P`.
pub fn posterior_information(
    information: &DMatrix<f64>,
    precision: &DVector<f64>,
    factor: f64,
) -> DMatrix<f64> {
    let mut matrix = information / factor;
    for i in 0..precision.len() {
        matrix[(i, i)] += precision[i];
    }
    matrix
}

/// What an unknown alone would have as standard error: the inverse norm of its column. 1 for a zero column.
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
    let size = gradient.len();
    let mut scaled = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] * scales[i] * scales[j]);
    for i in 0..size {
        scaled[(i, i)] += damping;
    }
    let right = gradient.component_mul(scales);
    let solved = scaled
        .cholesky()
        .map_or_else(|| right.clone(), |factor| factor.solve(&right));
    solved.component_mul(scales)
}

fn variance_factor(problem: &Problem<'_>, norms: &[f64], weights: &[f64], rank: usize) -> f64 {
    let misfit: f64 = norms
        .iter()
        .zip(weights)
        .map(|(norm, weight)| weight * norm * norm)
        .sum();
    let mean_weight = weights.iter().sum::<f64>() / weights.len().max(1) as f64;
    let freedom = mean_weight
        .mul_add(problem.row_count() as f64, -(rank as f64))
        .max(1.0);
    // Exact synthetic data fits to rounding; a floor keeps the prior from being weighed against nothing.
    (misfit / freedom).max(1e-12)
}

fn squares(norms: &[f64]) -> f64 {
    norms.iter().map(|norm| norm * norm).sum()
}
