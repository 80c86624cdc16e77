//! Many fits at the same poses: Jacobian and normal equations once, then each fit is a few predictions and products.
//!
//! For Monte Carlo studies before measuring: the arms drawn are all near the nominal one, where the Jacobian hardly changes.
//! Inputs: a problem at the nominal arm (its own measurements are not read) and its structural rank; then, for each fit,
//! measured positions. Steps, with J of the start throughout (the chord method, Ortega and Rheinboldt 1970, 7.1):
//! 1. `x ← x + (s⁻² JᵀWJ + P)⁻¹ (s⁻² JᵀW r(x) + P (expected − x))` until a step is below a thousandth of a standard error;
//! 2. `s²` from the residuals, and again, as [`solve`](super::solve) does it.
//!
//! It ends where `JᵀW r` vanishes for the start's J, not the solution's: thousandths of a standard error beside the least
//! squares. Positions and squares only: no orientations, no robust loss.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Point3};

use super::{Convergence, factor_of, posterior_information, scaled};
use crate::fit::problem::{BlockRows, Problem, dot};

/// A problem with its Jacobian held.
#[derive(Debug)]
pub struct Frozen<'a> {
    problem: &'a Problem<'a>,
    blocks: Vec<BlockRows>,
    information: DMatrix<f64>,
    rank: usize,
}

/// What one set of measurements gives.
#[derive(Debug, Clone, PartialEq)]
pub struct FrozenSolution {
    /// Offsets in the order of the problem's unknowns.
    pub offsets: DVector<f64>,
    /// How it ended.
    pub convergence: Convergence,
    /// `s² = rᵀ W r / (m − rank)`.
    pub variance_factor: f64,
}

const ROUNDS: usize = 4;
const STEPS_PER_ROUND: usize = 20;
const STEP_TOLERANCE: f64 = 1e-3;

impl<'a> Frozen<'a> {
    /// `problem` with the Jacobian of its start; `rank` is the number of unknowns the poses can tell apart.
    ///
    /// # Panics
    /// When an observation of the problem has an orientation.
    pub fn new(problem: &'a Problem<'a>, rank: usize) -> Self {
        let observations = problem.observations();
        assert!(
            observations.iter().all(|o| o.orientation.is_none()),
            "positions only"
        );
        let start = DVector::zeros(problem.unknowns().len());
        let mut blocks = Vec::new();
        problem.each_block(&start, |rows| blocks.push(rows.clone()));
        let weights = vec![1.0; observations.len()];
        Self {
            blocks,
            information: problem.normal(&start, &weights).information,
            problem,
            rank,
        }
    }

    /// The problem, for what its offsets mean.
    pub const fn problem(&self) -> &Problem<'a> {
        self.problem
    }

    /// `JᵀWJ` of the start.
    pub const fn information(&self) -> &DMatrix<f64> {
        &self.information
    }

    /// The fit of these positions (tracker frame, mm), one for each observation of the problem.
    ///
    /// # Panics
    /// When there are not as many positions as observations.
    pub fn solve(&self, measured: &[Point3<f64>]) -> FrozenSolution {
        assert_eq!(measured.len(), self.problem.observations().len());
        let mut offsets = DVector::zeros(self.problem.unknowns().len());
        let (mut factor, mut convergence) = (1.0, Convergence::IterationLimit);
        for _ in 0..ROUNDS {
            let Some(posterior) = Posterior::new(self, factor) else {
                return FrozenSolution {
                    offsets,
                    convergence: Convergence::Stalled,
                    variance_factor: factor,
                };
            };
            let before = offsets.clone();
            convergence = self.descend(&posterior, measured, factor, &mut offsets);
            let (_, cost) = self.gradient(&offsets, measured);
            factor = factor_of(cost, self.problem.row_count() as f64, self.rank);
            if posterior.size_of(&(&offsets - before)) < 10.0 * STEP_TOLERANCE {
                break;
            }
        }
        FrozenSolution {
            offsets,
            convergence,
            variance_factor: factor,
        }
    }

    fn descend(
        &self,
        posterior: &Posterior,
        measured: &[Point3<f64>],
        factor: f64,
        offsets: &mut DVector<f64>,
    ) -> Convergence {
        let mut last = 0.0;
        for _ in 0..STEPS_PER_ROUND {
            let (gradient, _) = self.gradient(offsets, measured);
            let gradient = gradient / factor + self.problem.prior_pull(offsets);
            let change = posterior.solve(&gradient);
            let size = gradient.dot(&change).max(0.0).sqrt();
            *offsets += change;
            if size * (size / last).min(1.0) < STEP_TOLERANCE {
                return Convergence::Converged;
            }
            last = size;
        }
        Convergence::IterationLimit
    }

    /// `JᵀW r` and `rᵀW r` at `offsets`.
    fn gradient(&self, offsets: &DVector<f64>, measured: &[Point3<f64>]) -> (DVector<f64>, f64) {
        let mut gradient = DVector::zeros(offsets.len());
        let mut cost = 0.0;
        let residuals = self.problem.residual_blocks(offsets, measured);
        for (rows, residual) in self.blocks.iter().zip(&residuals) {
            for (column, &unknown) in rows.unknowns().iter().enumerate() {
                gradient[unknown] += dot(rows.column(column), residual);
            }
            cost += dot(residual, residual);
        }
        (gradient, cost)
    }
}

/// `s⁻² JᵀWJ + P`, factored on columns of unit norm.
struct Posterior {
    matrix: DMatrix<f64>,
    scales: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Posterior {
    /// `None` where poses and prior leave something undetermined beyond what a little damping mends.
    fn new(frozen: &Frozen<'_>, factor: f64) -> Option<Self> {
        let precision = frozen.problem.prior_precision();
        let matrix = posterior_information(&frozen.information, precision, factor);
        let scales = matrix
            .diagonal()
            .map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 });
        let mut damped = scaled(&matrix, &scales);
        for i in 0..scales.len() {
            damped[(i, i)] += 1e-10;
        }
        let factor = damped.cholesky()?;
        Some(Self {
            matrix,
            scales,
            factor,
        })
    }

    fn solve(&self, gradient: &DVector<f64>) -> DVector<f64> {
        let solved = self.factor.solve(&gradient.component_mul(&self.scales));
        solved.component_mul(&self.scales)
    }

    /// A step in standard errors of its own direction.
    fn size_of(&self, change: &DVector<f64>) -> f64 {
        change.dot(&(&self.matrix * change)).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, Matrix3, Vector3};

    use super::*;
    use crate::fit::{Frames, Freedom, Loss, Observation, Prior, Structure};
    use crate::geometry::{Transform, isometry_from_rpy};
    use crate::kinematics::{Arm, RobotFile};

    const NOISE_MM: f64 = 0.03;

    fn ur10() -> Arm {
        let text = include_str!("../../../pipelines/robots/ur10.toml");
        let file: RobotFile = toml::from_str(text).expect("a robot file of this repository");
        file.arm().expect("a valid arm")
    }

    /// Within ±1, without a pattern.
    fn wave(k: usize) -> f64 {
        (k as f64 * 12.9898).sin()
    }

    fn frames() -> Frames {
        Frames {
            tracker_from_base: Transform::claim(isometry_from_rpy(
                [2500.0, 300.0, -200.0],
                [0.1, 0.2, 2.0],
            )),
            flange_from_target: Transform::claim(Isometry3::translation(40.0, -20.0, 90.0)),
        }
    }

    /// Stations of an arm whose parameters are off by up to 0.3 mm and 0.35 mrad.
    fn observed(arm: &Arm, count: usize) -> Vec<Observation> {
        let parameters = arm.chain().parameters();
        let off = |(k, p): (usize, &crate::kinematics::Parameter)| {
            wave(k + 7) * if p.is_angle() { 3.5e-4 } else { 0.3 }
        };
        let offsets: Vec<f64> = parameters.iter().enumerate().map(off).collect();
        let covariance = Matrix3::identity() * NOISE_MM.powi(2);
        let station = |i: usize| {
            let home = [0.0, -1.2, 1.6, -1.9, -1.6, 0.0_f64];
            let axes: Vec<f64> = (0..6)
                .map(|j| home[j] + 0.8 * wave(17 * i + 3 * j))
                .collect();
            let end = frames().tracker_from_base.isometry()
                * arm.chain().forward(&axes, &offsets)
                * frames().flange_from_target.isometry();
            let noise = Vector3::from_fn(|row, _| NOISE_MM * wave(1000 + 5 * i + row));
            Observation {
                session: 0,
                station: i,
                axes,
                position: Point3::from(end.translation.vector + noise),
                instrument: covariance,
                position_factor: Matrix3::identity() * NOISE_MM,
                orientation: None,
                shortfall: None,
            }
        };
        (0..count).map(station).collect()
    }

    #[test]
    fn a_frozen_jacobian_ends_beside_the_whole_fit() {
        let arm = ur10();
        let observations = observed(&arm, 150);
        let prior = Prior {
            geometry: Some((0.3, 3.5e-4)),
            target: None,
        };
        let starts = [frames()];
        let problem = Problem::new(
            &observations,
            arm.chain(),
            &starts,
            Freedom::Geometry,
            prior,
        );
        let rank = Structure::of(&problem, &DVector::zeros(problem.unknowns().len())).rank;
        let whole = super::super::solve(&problem, Loss::Squares, rank);
        let measured: Vec<_> = observations.iter().map(|o| o.position).collect();
        let frozen = Frozen::new(&problem, rank);
        let found = frozen.solve(&measured);
        assert_eq!(found.convergence, Convergence::Converged);
        let apart = &found.offsets - &whole.offsets;
        let information = posterior_information(
            &whole.information,
            problem.prior_precision(),
            whole.variance_factor,
        );
        // In standard errors, along the worst direction: noise is what a fit is uncertain by, this is far less.
        let size = apart.dot(&(&information * &apart)).sqrt();
        assert!(size < 0.03, "{size} standard errors");
        assert!((found.variance_factor / whole.variance_factor - 1.0).abs() < 1e-3);
        // What was to be found is many standard errors long.
        let moved = whole.offsets.dot(&(&information * &whole.offsets)).sqrt();
        assert!(moved > 100.0, "{moved} standard errors");
    }
}
