//! Compensation: the published table and a target → the command at which the tool point attains the target.
//!
//! Inputs are a [`CompensationTable`] and a [`Target`] in the frame of commands; output is the [`Corrected`] command with
//! the uncertainty of its correction, or why there is none ([`Refused`]). Steps (METHOD.md 6):
//! 1. the target is held against what the table is valid for: orientation, arm configuration, tool;
//! 2. `ê(c)`, attained minus commanded position, follows from the eight nodes around the command c ([`table`]);
//! 3. `command' = target − ê(command')`, iterated until it stands still.
//!
//! Nothing is extrapolated: a target, or a command on the way, that the nodes do not surround is refused.

pub mod refused;
pub mod table;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

pub use refused::{Gap, Reason, Refused};
pub use table::{CompensationTable, Known, Misfit, Terms, Validity};

use crate::geometry::{Command, Position};

/// Where the controller's own tool point shall be.
#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// What it is called in the file of targets.
    pub name: String,
    /// The position wanted, mm.
    pub position: Position<Command>,
    /// The orientation wanted; a target without one is taken to have the table's.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// The arm configuration wanted, in the table's words; a target without one is taken to have the table's.
    pub configuration: Option<String>,
    /// The tool it is for, where it says so.
    pub tool: Option<String>,
}

/// A target's command.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected {
    /// The position to command, mm.
    pub command: Position<Command>,
    /// Command minus target, mm.
    pub correction: Vector3<f64>,
    /// Covariance of the correction as the nodes have it, mm². What the step itself leaves inside a cell is not in it:
    /// that is the held-out figure of the step.
    pub covariance: Matrix3<f64>,
    /// How often the table was asked.
    pub iterations: usize,
}

impl Corrected {
    /// Standard deviation of the correction along each axis, mm.
    pub fn standard_deviation(&self) -> Vector3<f64> {
        self.covariance.diagonal().map(f64::sqrt)
    }

    /// Root of the covariance's trace, mm.
    pub fn standard_deviation_norm(&self) -> f64 {
        self.covariance.trace().sqrt()
    }
}

/// A command that moves less than this stands still, mm. A micrometre would do; an arm's errors change by a few
/// micrometres per mm, so a nanometre costs one iteration more, and it leaves no trace of where the iteration began.
const STANDS_STILL_MM: f64 = 1e-6;
/// Errors of any real arm settle in three or four iterations.
const MOST_ITERATIONS: usize = 100;

/// The command at which the tool point attains `target`, if the table can tell.
pub fn compensate(table: &CompensationTable, target: &Target) -> Result<Corrected, Refused> {
    let admitted = table.terms().admit(target);
    admitted
        .and_then(|()| fixed_point(table, &target.position))
        .map_err(|reason| Refused {
            target: target.name.clone(),
            reason,
        })
}

fn fixed_point(table: &CompensationTable, target: &Position<Command>) -> Result<Corrected, Reason> {
    let mut command = *target;
    let mut move_mm = f64::INFINITY;
    for iterations in 1..=MOST_ITERATIONS {
        let estimate = table.error_at(&command).map_err(|gap| match iterations {
            1 => Reason::Target(gap),
            _ => Reason::Command(gap),
        })?;
        let next = target.point() - estimate.error;
        move_mm = (next - command.point()).norm();
        command = Position::claim(next);
        if move_mm < STANDS_STILL_MM {
            return Ok(Corrected {
                command,
                correction: command.coords() - target.coords(),
                covariance: estimate.covariance,
                iterations,
            });
        }
    }
    Err(Reason::NoConvergence {
        iterations: MOST_ITERATIONS,
        move_mm,
    })
}

#[cfg(test)]
mod tests;
