//! Compensation: what a run published and a target → the command at which the tool point attains the target.
//!
//! Inputs are a [`Target`] in the frame of commands and either a [`CompensationTable`], which knows the error at the nodes
//! of a lattice in one orientation, or an [`IdentifiedArm`], which predicts it at any joint angles. Output is the
//! [`Corrected`] command with the uncertainty of its correction, or why there is none ([`Refused`]). Steps
//! ([`crate::method::compensation`]):
//! 1. the target is held against what the table is valid for: orientation, arm configuration, tool; or the arm: joint
//!    limits, joint ranges measured, singularities;
//! 2. `ê(c)`, attained minus commanded position of the tool point at the command c: from the eight nodes around it
//!    ([`table`]), or from the arm's model at c's joint angles ([`identified`]);
//! 3. `command' = target − ê(command')`, iterated until it stands still.
//!
//! Both correct the position and keep the nominal orientation. A reflector does not show how the tool is turned: what
//! a model says of it is little more than its prior (milliradians), while arms are off by a few tenths of one, and normals
//! of drilled holes may be off by ten. What the turn does to the tool point is in ê.
//!
//! No error larger than 1.5 times the largest that the stations of the run themselves had is believed
//! ([`validity::MOST_OF_LARGEST`]): a wrong sign in a frame makes corrections of centimetres.
//!
//! Nothing is extrapolated: a target that the nodes do not surround or whose joint angles were not measured is refused. A
//! target near the rim of a table has a command that its correction takes a little beyond: the error there is that at the rim.

mod fixed_point;
pub mod identified;
mod pose;
pub mod refused;
pub mod slips;
pub mod table;
pub mod validity;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

pub use identified::{ArmModel, IdentifiedArm};
pub use refused::{Reason, Refused};
pub use table::{CompensationTable, Known, Misfit, Terms};
pub use validity::{Conditions, Term, UsedWith, Validity};

pub use crate::fit::Gap;
use crate::fit::{At, PoseModel, SourceId};
use crate::geometry::{Command, Position};

/// Where the controller's own tool point shall be: a position, joint angles, or both.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Target {
    /// What it is called in the file of targets.
    pub name: String,
    /// The position wanted, mm; without one it is the nominal arm's at the joint angles.
    pub position: Option<Position<Command>>,
    /// The orientation wanted; without one it is the nominal arm's at the joint angles, or the table's.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// The joint angles of the target; beside a position they say which way the arm reaches it.
    pub joints: Option<TargetJoints>,
    /// The arm configuration wanted; a target without one is taken to have the joint angles' or the table's.
    pub configuration: Option<String>,
    /// The tool it is for, where it says so.
    pub tool: Option<String>,
}

/// Joint angles of a target.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TargetJoints {
    /// The joints' names in the angles' order; none for the order of the arm.
    pub names: Vec<String>,
    /// The angles, rad.
    pub angles: Vec<f64>,
}

/// A target's command.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected {
    /// The position wanted, mm.
    pub target: Position<Command>,
    /// The position to command, mm.
    pub command: Position<Command>,
    /// The orientation to command, that of the target; `None` where it does not state one.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// The joint angles to command; a table knows positions only.
    pub joints: Option<JointCommand>,
    /// Command minus target, mm.
    pub correction: Vector3<f64>,
    /// Covariance of the correction as nodes or model have it, mm². What a grid's step itself leaves inside a cell is not
    /// in it: that is the held-out figure of the step.
    pub covariance: Matrix3<f64>,
    /// How often the table or the model was asked.
    pub iterations: usize,
    /// The exceptions without which the target would have been refused, in their order; none where none was needed.
    pub allowed: Vec<Exception>,
}

/// A reason for refusal that the caller may take upon himself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Exception {
    /// A table or an identified arm that does not meet its tolerance.
    NotMet,
    /// A table or an identified arm that was not shown to meet its tolerance.
    NotShown,
    /// Joint angles beyond those measured: the model falls back to its prior there, and the covariance says so.
    JointRange,
    /// An arm configuration that no station was in: what a joint does there was not measured.
    Configuration,
    /// Something else than the table is valid for.
    Term(Term),
}

/// Joint angles in the arm's order, rad.
#[derive(Debug, Clone, PartialEq)]
pub struct JointCommand {
    /// At which the nominal arm attains the target.
    pub target: Vec<f64>,
    /// To command.
    pub command: Vec<f64>,
}

impl JointCommand {
    /// Command minus target, rad.
    pub fn correction(&self) -> Vec<f64> {
        let pairs = self.command.iter().zip(&self.target);
        pairs.map(|(command, target)| command - target).collect()
    }
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

/// The command at which the tool point attains `target`, if the table can tell.
///
/// ```
/// use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
/// use posegrid::compensation::{CompensationTable, Known, Target, Terms, Validity, compensate};
/// use posegrid::geometry::{Position, Transform};
/// use posegrid::grid::{Interpolation, Lattice};
///
/// // A cube of 100 mm at whose nodes the arm goes 0.3 mm too far in x.
/// let lattice = Lattice { origin: Point3::new(900.0, 0.0, 700.0), step: [100.0; 3], counts: [2; 3] };
/// let node = Known {
///     joints: vec![0.0; 6],
///     error: Vector3::new(0.3, 0.0, 0.0),
///     covariance: Matrix3::identity() * 4e-4,
/// };
/// let terms = Terms {
///     table_id: "example".to_owned(),
///     orientation: UnitQuaternion::identity(),
///     orientation_tolerance_rad: 0.1,
///     configuration: None,
///     interpolation: Interpolation::Trilinear,
///     idw_power: 2.0,
///     validity: Validity::default(),
/// };
/// let table = CompensationTable::new(terms, Transform::identity(), lattice, vec![Ok(node); 8])?;
/// let wanted = Position::claim(Point3::new(950.0, 40.0, 720.0));
/// let target = Target { name: "rivet 1".to_owned(), position: Some(wanted), ..Target::default() };
/// let corrected = compensate(&table, &target)?;
/// assert!((corrected.correction - Vector3::new(-0.3, 0.0, 0.0)).norm() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compensate(table: &CompensationTable, target: &Target) -> Result<Corrected, Refused> {
    let admitted = table.terms().admit(target);
    let corrected = admitted.and_then(|()| {
        let wanted = target.position.ok_or(Reason::NoPosition)?;
        by_pose(table, target, &wanted)
    });
    corrected.map_err(|reason| Refused {
        target: target.name.clone(),
        reason,
        slip: None,
    })
}

/// By the nodes of a table. A command on the way that is a little beyond the rim is asked for at the rim.
fn by_pose(
    table: &CompensationTable,
    target: &Target,
    wanted: &Position<Command>,
) -> Result<Corrected, Reason> {
    let mut first = true;
    let converged = fixed_point::converge(wanted.point(), |command| {
        let place = if first {
            *command
        } else {
            table.at_rim(command)
        };
        let predicted = table.predict(&At::Tool {
            position: place,
            orientation: target.orientation,
        });
        let gap = if first {
            Reason::Target
        } else {
            Reason::Command
        };
        first = false;
        let predicted = predicted.map_err(gap)?;
        let covariance = table.spread(0, SourceId::ONLY, &predicted).covariance();
        let error = predicted.error_from(&place);
        table.terms().validity.admit_error(&error)?;
        Ok((error, covariance))
    })?;
    Ok(Corrected {
        target: *wanted,
        command: Position::claim(converged.command),
        orientation: target.orientation,
        joints: None,
        correction: converged.command - wanted.point(),
        covariance: converged.found,
        iterations: converged.iterations,
        allowed: Vec::new(),
    })
}

#[cfg(test)]
mod tests;
