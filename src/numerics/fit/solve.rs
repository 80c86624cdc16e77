//! Levenberg–Marquardt on the normal equations, columns scaled to unit norm, with a weak prior and a robust loss.
//!
//! The cost is `rᵀ W r / s² + Σ (x_i / sd_i)²`: the prior is weighted against the actual misfit of the model, not
//! against the instrument's noise, so that a model that cannot fit does not override the prior. `s²` and the robust weights are 1 until the
//! next step is expected to be small beside the standard errors; from then on they follow the misfit at each
//! step, so they and the fit converge together.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::loss::{Loss, Numbers};
use super::problem::Problem;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Convergence {
    /// The last step was negligible.
    Converged,
    /// The limit of iterations was reached first.
    IterationLimit,
    /// No step lowered the cost, though the gradient was not yet zero.
    Stalled,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Solution {
    pub offsets: DVector<f64>,
    pub convergence: Convergence,
    /// Levenberg–Marquardt steps in all rounds.
    pub iterations: usize,
    /// Unweighted `rᵀ r` of whitened residuals before and after.
    pub cost: [f64; 2],
    /// `s² = rᵀ W r / (m − rank)`: 1 where the noise explains the misfit.
    pub variance_factor: f64,
    pub weights: Vec<f64>,
    pub information: DMatrix<f64>,
}

const STEPS: usize = 200;
/// A step below this many standard errors, of any combination of unknowns, is negligible.
const STEP_TOLERANCE: f64 = 1e-6;
/// Robust weights and the variance factor are those of the misfit once the next step is below this many standard errors.
const NEAR: f64 = 0.1;
/// A cost is a sum of thousands of squares: below this share of it a difference is rounding.
const ROUNDING: f64 = 1e-12;
const LEAST_DAMPING: f64 = 1e-12;
const LARGEST_DAMPING: f64 = 1e9;
const DETERMINED: f64 = 1e-9;

/// Solves `problem` from these offsets; `rank` is the number of independent unknowns.
pub fn solve(problem: &Problem<'_>, start: DVector<f64>, loss: Loss, rank: usize) -> Solution {
    let mut point = Point::at(problem, start);
    let start_cost = squares(&point.norms);
    let (mut weights, mut factor) = (vec![1.0; point.norms.len()], 1.0);
    // Without robust weights and prior, the solution does not depend on the variance factor.
    let is_free = loss == Loss::Squares && problem.is_free();
    let (mut gait, mut is_near) = (Gait::FIRST, is_free);
    let (mut iterations, mut convergence) = (0, Convergence::IterationLimit);
    while iterations < STEPS {
        iterations += 1;
        let step = step(problem, point, &weights, factor, gait);
        (point, gait) = (step.point, step.gait);
        // Steps fall by a steady factor or faster, so the next one is no larger than this.
        let next = gait.size * gait.pace;
        let converged = (next < STEP_TOLERANCE).then_some(Convergence::Converged);
        let ended = step.ended.or(converged);
        if is_near && let Some(ended) = ended {
            convergence = ended;
            break;
        }
        is_near |= next < NEAR || ended.is_some();
        if is_near && !is_free {
            weights = robust_weights(problem, loss, &point.norms);
            factor = variance_factor(problem, &point.norms, &weights, rank);
        }
    }
    weights = robust_weights(problem, loss, &point.norms);
    Solution {
        convergence,
        iterations,
        cost: [start_cost, squares(&point.norms)],
        variance_factor: variance_factor(problem, &point.norms, &weights, rank),
        information: problem.normal(&point.offsets, &weights).information,
        offsets: point.offsets,
        weights,
    }
}

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

/// The size and damping of the last step, from which the next one follows.
#[derive(Clone, Copy)]
struct Gait {
    size: f64,
    /// Size of the last step over that of the one before, at most 1.
    pace: f64,
    /// The damping of the next step; `None` before the first.
    damping: Option<f64>,
}

impl Gait {
    const FIRST: Self = Self { size: 0.0, pace: 1.0, damping: None };

    /// After a step of this size at this damping.
    fn after(self, size: f64, damping: f64) -> Self {
        Self {
            size,
            pace: if self.size > 0.0 { (size / self.size).min(1.0) } else { 1.0 },
            damping: Some((0.1 * damping).max(LEAST_DAMPING)),
        }
    }
}

struct Step {
    point: Point,
    gait: Gait,
    /// Whether what was tried was negligible or stalled, where nothing lowered the cost; `None` after a step.
    ended: Option<Convergence>,
}

/// One step of Levenberg–Marquardt at fixed weights and variance factor.
fn step(problem: &Problem<'_>, point: Point, weights: &[f64], factor: f64, gait: Gait) -> Step {
    let cost_at = |point: &Point| {
        let norms = point.norms.iter().zip(weights);
        let misfit: f64 = norms.map(|(norm, weight)| weight * norm * norm).sum();
        misfit / factor + problem.prior_cost(&point.offsets)
    };
    let allowed = cost_at(&point) * (1.0 + ROUNDING);
    let slope = Slope::at(problem, &point.offsets, weights, factor);
    let mut damping = gait.damping.unwrap_or_else(|| slope.first_damping());
    let mut is_first = true;
    loop {
        let change = slope.damped_step(damping);
        let mut tried = Point::at(problem, &point.offsets + &change);
        // The step in standard errors, along the direction in which it is largest (Newton's decrement).
        let size = slope.gradient.dot(&change).max(0.0).sqrt();
        if is_first && size > NEAR && cost_at(&tried) > allowed {
            // A valley that bends is left by a straight step; the next one leads back into it, further along.
            let slope = Slope::at(problem, &tried.offsets, weights, factor);
            tried = Point::at(problem, tried.offsets + slope.damped_step(damping));
        }
        if cost_at(&tried) <= allowed {
            return Step { point: tried, gait: gait.after(size, damping), ended: None };
        }
        (damping, is_first) = ((damping * 10.0).max(1e-9), false);
        let ended = if size < STEP_TOLERANCE {
            Convergence::Converged
        } else if damping > LARGEST_DAMPING {
            Convergence::Stalled
        } else {
            continue;
        };
        return Step { point, gait, ended: Some(ended) };
    }
}

/// The normal equations at a point, prior included.
struct Slope {
    matrix: DMatrix<f64>,
    gradient: DVector<f64>,
    /// The standard error that each unknown alone would have: the inverse norm of its column; 1 for a zero column.
    scales: DVector<f64>,
}

impl Slope {
    fn at(problem: &Problem<'_>, offsets: &DVector<f64>, weights: &[f64], factor: f64) -> Self {
        let normal = problem.normal(offsets, weights);
        let diagonal = normal.information.diagonal() / factor + &problem.precision;
        let scale = |squared: f64| if squared > 0.0 { squared.sqrt().recip() } else { 1.0 };
        Self {
            matrix: problem.posterior_information(&normal.information, offsets, factor),
            gradient: normal.gradient / factor + problem.prior_pull(offsets),
            scales: diagonal.map(scale),
        }
    }

    /// The first damping: very small where poses or prior determine every unknown, since Newton's step is best there; otherwise
    /// large enough to keep undetermined unknowns from following rounding errors.
    fn first_damping(&self) -> f64 {
        let pivots = self.scaled().cholesky().map(|factor| factor.l_dirty().diagonal());
        let least = pivots.map_or(0.0, |pivots| pivots.iter().fold(1.0, |a: f64, b| a.min(b * b)));
        if least > DETERMINED { LEAST_DAMPING } else { 1e-6 }
    }

    /// `D A D`.
    fn scaled(&self) -> DMatrix<f64> {
        let (size, scales) = (self.scales.len(), &self.scales);
        DMatrix::from_fn(size, size, |i, j| self.matrix[(i, j)] * scales[i] * scales[j])
    }

    /// `(D A D + λ I)⁻¹ D g`, scaled back: columns have unit norm, so one damping serves all.
    fn damped_step(&self, damping: f64) -> DVector<f64> {
        let mut scaled = self.scaled();
        for i in 0..self.gradient.len() {
            scaled[(i, i)] += damping;
        }
        let right = self.gradient.component_mul(&self.scales);
        let solved = scaled.cholesky().map_or_else(|| right.clone(), |factor| factor.solve(&right));
        solved.component_mul(&self.scales)
    }
}

/// The robust weight of each observation, the readings of each source by a scale of their own: stated uncertainties of different
/// instruments are rarely of one scale.
fn robust_weights(problem: &Problem<'_>, loss: Loss, norms: &[f64]) -> Vec<f64> {
    let mut sources: BTreeMap<_, Vec<usize>> = BTreeMap::new();
    for (place, own) in problem.observations.iter().enumerate() {
        sources.entry((own.source, Numbers::of(own.measured.kind()))).or_default().push(place);
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
    let misfit: f64 = norms.iter().zip(weights).map(|(norm, weight)| weight * norm * norm).sum();
    let observations = problem.observations.iter().zip(weights);
    let rows = observations.map(|(own, weight)| weight * own.measured.kind().rows() as f64);
    let rows: f64 = rows.sum();
    // Exact synthetic data fits to rounding; a floor keeps the prior's weight finite.
    (misfit / (rows - rank as f64).max(1.0)).max(1e-12)
}

fn squares(norms: &[f64]) -> f64 {
    norms.iter().map(|norm| norm * norm).sum()
}
