//! `command' = target − ê(command')`, iterated until the command stands still.

use nalgebra::{Point3, Vector3};

use super::Reason;

/// A command that moves less than this stands still, mm. A micrometre would do; an arm's errors change by a few
/// micrometres per mm, so a nanometre costs one iteration more, and it leaves no trace of where the iteration began.
const STANDS_STILL_MM: f64 = 1e-6;
/// Errors of any real arm converge in three or four iterations.
const MOST_ITERATIONS: usize = 100;

/// Where a command came to stand still.
pub(super) struct Converged<F> {
    /// The command.
    pub(super) command: Point3<f64>,
    /// What was found beside the error there.
    pub(super) found: F,
    /// How often the error was asked for.
    pub(super) iterations: usize,
}

/// The command for a target, by the error (mm) that `error_at` has at a command beside whatever else it finds there.
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
        if move_mm < STANDS_STILL_MM {
            return Ok(Converged {
                command,
                found,
                iterations,
            });
        }
    }
    Err(Reason::NoConvergence {
        iterations: MOST_ITERATIONS,
        move_mm,
    })
}
