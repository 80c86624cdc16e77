//! Whether the stations so far are enough, and the most informative poses to measure next: a design that stops by itself.
//!
//! Inputs: the full error model of the stations so far, poses of the region that matters, poses that may be measured.
//! 1. Arms are drawn from the model's posterior, with all poses of the region together; to each pose the base's
//!    between-session variation, the joints' approach-direction offsets and the error that no visit repeats are added.
//! 2. The error that the mean model leaves on each is judged like a simulated robot of a plan: the bound that the share of
//!    them asked for stays below is the promise.
//! 3. Where that is above the tolerance, poses are chosen one after another as in a plan, until the expected errors have
//!    fallen by the factor by which the promise is too large.

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::compare::Expected;
use super::design::{Candidate, Design};
use super::outcomes::{Outcomes, RobotOutcome};
use super::settings::PlanSettings;
use crate::fit::full::{FullModel, Known, Query};
use crate::simulate::{Ingredient, Stream};

/// Number of arms that are drawn; a promise for 95 % with 95 % confidence needs 59.
const ARMS: usize = 300;

/// The most informative poses to measure next.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Next {
    pub poses: Vec<usize>,
    pub are_enough: bool,
}

/// The promise of the session so far over the region, if no more were measured. `session` is its index in the model.
pub fn promised(
    model: &FullModel,
    session: usize,
    region: &[Vec<f64>],
    settings: &PlanSettings,
) -> Outcomes {
    let mut rows = DMatrix::zeros(3 * region.len(), model.trained.layout.size());
    let mut alone = Vec::with_capacity(region.len());
    for (place, axes) in region.iter().enumerate() {
        let query = Query::at(axes, session, Known::Commanded);
        let predicted = model.predict(&query);
        rows.rows_mut(3 * place, 3).copy_from(&predicted.rows);
        alone.push(half(&(predicted.approach + model.visit_covariance(&query))));
    }
    let together = model.posterior.half(&rows);
    let day_mm = model.any_time_variance().sqrt();
    let mut stream = Stream::new(settings.seed, Ingredient::Posterior);
    let z = DMatrix::from_vec(together.nrows(), ARMS, stream.normals(together.nrows() * ARMS, 1.0));
    let left = together.tr_mul(&z);
    let arms: Vec<RobotOutcome> = left
        .column_iter()
        .map(|arm| {
            let day = stream.normal3() * day_mm;
            let norms: Vec<f64> = alone
                .iter()
                .enumerate()
                .map(|(place, half)| {
                    let open = Vector3::from_fn(|axis, _| arm[3 * place + axis]);
                    (open + half * stream.normal3() + day).norm()
                })
                .collect();
            RobotOutcome::of(norms.into_iter().map(|norm| Some(Ok(norm))), &settings.tolerance)
        })
        .collect();
    Outcomes::of(arms.iter(), settings.robots_meet)
}

/// The poses that bring the promise from `promised_mm` to the tolerance, as far as `candidates` can.
pub fn next(
    model: &FullModel,
    region: &[Vec<f64>],
    candidates: &[Candidate],
    promised_mm: f64,
    settings: &PlanSettings,
) -> Next {
    let of_visit = |axes: &Vec<f64>| {
        let query = Query::at(axes, 0, Known::Commanded);
        model.visit_covariance(&query) + model.predict(&query).approach
    };
    let visit: Vec<Matrix3<f64>> = region.iter().map(of_visit).collect();
    let expected = |design: &Design<'_>| Expected::of(&design.region, &visit, settings).share_mm;
    let mut design = Design::new(model, candidates, region);
    let wanted = expected(&design) * settings.tolerance.mm / promised_mm;
    let mut are_enough = false;
    while !are_enough && design.choose().is_some() {
        are_enough = expected(&design) <= wanted;
    }
    Next { poses: design.chosen.clone(), are_enough }
}

/// A matrix H with `H Hᵀ` = covariance.
fn half(covariance: &Matrix3<f64>) -> Matrix3<f64> {
    let eigen = covariance.symmetric_eigen();
    let sizes = eigen.eigenvalues.map(|variance| variance.max(0.0).sqrt());
    eigen.eigenvectors * Matrix3::from_diagonal(&sizes)
}
