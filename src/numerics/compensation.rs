//! Compensation: the published result of a run and a target pose → the command at which the tool point attains the target.
//!
//! Inputs are a [`Target`] in the frame of commands and either a [`CompensationTable`], which has the error at the nodes
//! of a lattice in one orientation, or an [`IdentifiedArm`], which predicts it at any joint angles. Output is the
//! [`Corrected`] command with the uncertainty of its correction, or the reason why there is none ([`Refused`]). Steps
//! ([`crate::method::compensation`]):
//! 1. the target is compared with the validity of the table (orientation, arm configuration, tool) or of the arm (joint
//!    limits, joint ranges measured, singularities);
//! 2. `ê(c)`, attained minus commanded position of the tool point at the command c: from the eight nodes around it
//!    ([`table`]), or from the arm's model at c's joint angles ([`identified`]);
//! 3. `command' = target − ê(command')`, iterated until it converges.
//!
//! Both correct the position. A table keeps the nominal orientation, and so does an identified arm that learnt from one reflector;
//! one that learnt from a 6-DoF target or from three reflectors corrects the orientation too. A single reflector does not show the tool's orientation: a model's
//! value for it is little more than its prior (milliradians), while arms are off by a few tenths of one, and normals
//! of drilled holes may be off by ten. The effect of the turn on the tool point is in ê.
//!
//! No error larger than 1.5 times the largest that the stations of the run themselves had is believed
//! ([`validity::MOST_OF_LARGEST`]): a wrong sign in a frame makes corrections of centimetres.
//!
//! Nothing is extrapolated: a target that the nodes do not surround or whose joint angles were not measured is refused. A
//! target near the rim of a table may have a command a little beyond the rim: the error at the rim is used for it.

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

/// A target pose for the controller's own tool point: a position, joint angles, or both.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Target {
    pub name: String,
    /// The position wanted, mm; when absent, the nominal arm's at the joint angles.
    pub position: Option<Position<Command>>,
    /// The orientation wanted; when absent, the nominal arm's at the joint angles, or the table's.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// The joint angles of the target; with a position, they select the way in which the arm reaches it.
    pub joints: Option<TargetJoints>,
    /// The arm configuration wanted; when absent, that of the joint angles or the table's.
    pub configuration: Option<String>,
    /// The tool of the target; absent when the file names none.
    pub tool: Option<String>,
}

#[derive(Debug, Clone, PartialEq, Default)]
pub struct TargetJoints {
    /// The joints' names in the angles' order; empty for the order of the arm.
    pub names: Vec<String>,
    /// The angles, rad; mm of joints that slide.
    pub angles: Vec<f64>,
    /// Which of them the file states in mm; `None` where it states none of their units.
    pub slides: Option<Vec<bool>>,
}

/// A target with its corrected command.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected {
    /// The position wanted, mm.
    pub target: Position<Command>,
    /// The position to command, mm.
    pub command: Position<Command>,
    /// The orientation to command: the target's, turned where the identified arm knows orientations; `None` where it states none.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// The joint angles to command; `None` from a table, which has positions only.
    pub joints: Option<JointCommand>,
    /// Command minus target, mm.
    pub correction: Vector3<f64>,
    /// Covariance of the correction, mm²: from the nodes' or the model's covariance, and where errors are stated in a surveyed frame from
    /// that frame's uncertainty at the target. It excludes the interpolation error inside a cell: that is the held-out figure of the
    /// grid's step. `None` where it was not asked for.
    pub covariance: Option<Matrix3<f64>>,
    /// The share of the surveyed frame in the covariance, mm²: alike for all targets, as the frame is off by one motion.
    pub of_frame: Matrix3<f64>,
    /// Number of evaluations of the table or the model.
    pub iterations: usize,
    /// The exceptions without which the target would have been refused, in their order; none where none was needed.
    pub allowed: Vec<Exception>,
}

/// Whether corrections have covariances: an identified arm's cost more than its commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Covariances {
    Given,
    Omitted,
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
    /// An arm configuration that no station was in: the joints' errors there were not measured.
    Configuration,
    /// A condition that the table is not valid for.
    Term(Term),
}

/// Joint angles in the arm's order, rad.
#[derive(Debug, Clone, PartialEq)]
pub struct JointCommand {
    /// The angles at which the nominal arm attains the target.
    pub target: Vec<f64>,
    pub command: Vec<f64>,
}

impl Target {
    /// Refuses another arm configuration than the one it asks for.
    fn is_reached_in(&self, own: Option<String>) -> Result<(), Reason> {
        match &self.configuration {
            Some(wanted) if Some(wanted) != own.as_ref() => {
                Err(Reason::Configuration { wanted: wanted.clone(), table: own })
            }
            _ => Ok(()),
        }
    }
}

impl JointCommand {
    /// Command minus target, rad.
    pub fn correction(&self) -> Vec<f64> {
        self.command.iter().zip(&self.target).map(|(command, target)| command - target).collect()
    }
}

impl Corrected {
    /// Standard deviation of the correction along each axis, mm.
    pub fn standard_deviation(&self) -> Option<Vector3<f64>> {
        Some(self.covariance?.diagonal().map(f64::sqrt))
    }

    /// Root of the covariance's trace, mm.
    pub fn standard_deviation_norm(&self) -> Option<f64> {
        Some(self.covariance?.trace().sqrt())
    }

    /// Root of the trace of the surveyed frame's share, mm.
    pub fn frame_deviation_norm(&self) -> f64 {
        self.of_frame.trace().sqrt()
    }

    /// Sum of the variances along three axes without the surveyed frame's share, mm².
    pub fn own_variance_mm2(&self) -> Option<f64> {
        Some((self.covariance? - self.of_frame).trace())
    }
}

/// The command at which the tool point attains `target`, or the reason why the table has none.
///
/// ```
/// use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
/// use posegrid_numerics::compensation::{CompensationTable, Known, Target, Terms, Validity, compensate};
/// use posegrid_numerics::fit::FrameUncertainty;
/// use posegrid_arm::geometry::{Position, Transform};
/// use posegrid_numerics::grid::{Interpolation, Lattice};
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
///     interpolation_mm2: Matrix3::zeros(),
///     validity: Validity::default(),
///     frame: FrameUncertainty::default(),
///     counted: Vec::new(),
/// };
/// let table = CompensationTable::new(terms, Transform::identity(), lattice, vec![Ok(node); 8])?;
/// let wanted = Position::claim(Point3::new(950.0, 40.0, 720.0));
/// let target = Target { name: "rivet 1".to_owned(), position: Some(wanted), ..Target::default() };
/// let corrected = compensate(&table, &target)?;
/// assert!((corrected.correction - Vector3::new(-0.3, 0.0, 0.0)).norm() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compensate(table: &CompensationTable, target: &Target) -> Result<Corrected, Refused> {
    let corrected = table.terms().admit(target).and_then(|()| {
        let wanted = target.position.ok_or(Reason::NoPosition)?;
        by_pose(table, target, &wanted)
    });
    corrected.map_err(|reason| Refused { target: target.name.clone(), reason, slip: None })
}

/// By the nodes of a table. A command on the way that is a little beyond the rim is asked for at the rim.
fn by_pose(
    table: &CompensationTable,
    target: &Target,
    wanted: &Position<Command>,
) -> Result<Corrected, Reason> {
    let mut first = true;
    let converged = fixed_point::converge(wanted.point(), |command| {
        let place = if first { *command } else { table.at_rim(command) };
        let predicted =
            table.predict(&At::Tool { position: place, orientation: target.orientation });
        let gap = if first { Reason::Target } else { Reason::Command };
        first = false;
        let predicted = predicted.map_err(gap)?;
        let covariance = table.spread(0, SourceId::ONLY, &predicted).covariance();
        let error = predicted.error.unwrap_or_else(|| predicted.position - place);
        table.terms().validity.admit_error(&error)?;
        Ok((error, covariance))
    })?;
    let of_frame = table.frame_covariance(wanted);
    Ok(Corrected {
        target: *wanted,
        command: Position::claim(converged.command),
        orientation: target.orientation,
        joints: None,
        correction: converged.command - wanted.point(),
        covariance: Some(converged.found + of_frame),
        of_frame,
        iterations: converged.iterations,
        allowed: Vec::new(),
    })
}

#[cfg(test)]
mod tests;
