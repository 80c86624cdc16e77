//! `command' = target − ê(command')`, iterated until the command converges.

use nalgebra::{Point3, Vector3};

use super::Reason;

/// A command that moves less than this has converged, mm. A micrometre would be enough; an arm's errors change by a few
/// micrometres per mm, so a nanometre costs one iteration more, and the result does not depend on the start.
const CONVERGED_MM: f64 = 1e-6;
/// Errors of any real arm converge in three or four iterations.
const MOST_ITERATIONS: usize = 100;

pub(super) struct Converged<F> {
    pub(super) command: Point3<f64>,
    /// The further results at the command, given with the error.
    pub(super) found: F,
    /// Number of evaluations of the error.
    pub(super) iterations: usize,
}

/// The command for a target; `error_at` returns the error (mm) at a command, with any further results.
pub(super) fn converge<F>(
    target: &Point3<f64>,
    mut error_at: impl FnMut(&Point3<f64>) -> Result<(Vector3<f64>, F), Reason>,
) -> Result<Converged<F>, Reason> {
    let mut command = *target;
    let mut move_mm = f64::INFINITY;
    for iterations in 1..=MOST_ITERATIONS {
        let (error, found) = error_at(&command)?;
        let next = target - error;
        move_mm = (next - command).norm();
        command = next;
        if move_mm < CONVERGED_MM {
            return Ok(Converged { command, found, iterations });
        }
    }
    Err(Reason::NoConvergence { iterations: MOST_ITERATIONS, move_mm })
}
