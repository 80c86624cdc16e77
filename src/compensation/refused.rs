//! Why a target is not corrected, by how much, and what to try.

use thiserror::Error;

use super::slips::Slip;
use super::validity::MOST_OF_LARGEST;
use crate::fit::Gap;
use crate::kinematics::InverseError;

/// A target without a corrected command.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("target {target:?} {reason}{}", slip.map_or_else(String::new, |slip| format!("; {slip}")))]
pub struct Refused {
    /// The target's name.
    pub target: String,
    /// Why.
    pub reason: Reason,
    /// The slip of a unit without which it would have a command; `None` where there is none.
    pub slip: Option<Slip>,
}

/// Why a target has no corrected command.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Reason {
    /// The model has no prediction at the target.
    #[error("{}; {}", .0, advice(.0))]
    Target(Gap),
    /// The table surrounds the target, but not the command that would attain it.
    #[error(
        "would need a command that {0}; move the target inwards by that much, or use a larger table"
    )]
    Command(Gap),
    /// Another arm configuration.
    #[error("asks for arm configuration {wanted:?}, the table is for {}", match table {
        Some(table) => format!("{table:?}"),
        None => "an arm that has no configurations; leave the targets' configuration out".to_owned(),
    })]
    Configuration {
        /// The target's.
        wanted: String,
        /// The table's, where its arm has any.
        table: Option<String>,
    },
    /// Another tool.
    #[error("is for tool {wanted:?}, the table is for {}", match table {
        Some(tool) => format!("{tool:?}"),
        None => "a tool it does not name; name it in the pipeline file, or leave the targets' tool out".to_owned(),
    })]
    Tool {
        /// The target's.
        wanted: String,
        /// The table's, where it names one.
        table: Option<String>,
    },
    /// A grid knows positions, and the target has none.
    #[error(
        "has joint angles but no position, and a compensation table knows positions only; correct it with table \
         `calibrations` of the same run"
    )]
    NoPosition,
    /// Neither joint angles nor an orientation.
    #[error(
        "states neither joint angles nor an orientation, and an arm's error depends on how it stands; give q1_rad … or \
         qx qy qz qw"
    )]
    NoOrientation,
    /// Neither joint angles nor an arm configuration.
    #[error(
        "states neither joint angles nor an arm configuration, and the arm may reach it in several ways; give q1_rad … or a \
         configuration such as \"shoulder+ elbow- wrist+\""
    )]
    NoConfiguration,
    /// An arm configuration that no joint angles within the measured ranges have.
    #[error(
        "asks for arm configuration {wanted:?}; within the joint ranges measured there is {}; measure there, or reach it in \
         another",
        measured.join(", ")
    )]
    Unmeasured {
        /// The target's.
        wanted: String,
        /// Those there are.
        measured: Vec<String>,
    },
    /// An arm configuration that no station was in.
    #[error(
        "stands in arm configuration {found:?}, and stations were measured in {}; measure there, or reach it in another",
        measured.join(", ")
    )]
    NeverMeasured {
        /// The target's, or its command's.
        found: String,
        /// Those of the stations.
        measured: Vec<String>,
    },
    /// Joint angles of another arm.
    #[error("has {found}, the arm has joints {}; give one for each, in this order or by these names", expected.join(", "))]
    Joints {
        /// What was found.
        found: String,
        /// The arm's joints.
        expected: Vec<String>,
    },
    /// Position and joint angles of different places.
    #[error(
        "has a position {apart_mm:.3} mm from where the nominal arm has the tool at its joint angles; check tool, frame and \
         unit of both, or leave one out"
    )]
    Apart {
        /// How far apart they are, mm.
        apart_mm: f64,
    },
    /// Joint angles that were not measured.
    #[error(
        "needs joint {joint:?} at {angle_deg:.3}°, {beyond_deg:.3}° beyond the {:.3}° to {:.3}° that were measured, where the \
         model knows nothing of it; measure there, or reach the target with angles inside",
        measured_deg[0], measured_deg[1]
    )]
    JointRange {
        /// The joint's name.
        joint: String,
        /// The angle needed, degrees.
        angle_deg: f64,
        /// By how much that is beyond the measured range, degrees.
        beyond_deg: f64,
        /// The measured range, degrees.
        measured_deg: [f64; 2],
    },
    /// The nominal arm does not stand there.
    #[error("is not for this arm: {0}")]
    Arm(#[from] InverseError),
    /// An error that is too large to be one of the arm that was measured.
    #[error(
        "would be corrected by {error_mm:.3} mm, and the largest error of the run's stations before correction was \
         {largest_mm:.3} mm, {MOST_OF_LARGEST} times of which is the most that is given; check the signs and units of [commanded] \
         flange_from_tool, [fit] target and the base frame in the pipeline file and run the session again, or measure where the \
         target is"
    )]
    TooLarge {
        /// The error found, mm.
        error_mm: f64,
        /// The largest of the stations, mm.
        largest_mm: f64,
    },
    /// No command attains the target.
    #[error(
        "has no command: after {iterations} iterations it still moves by {move_mm:.6} mm, as the error jumps there (errors \
         interpolated by `idw` do where two cells meet); move the target by that much, or use a trilinear table"
    )]
    NoConvergence {
        /// How often the table was asked.
        iterations: usize,
        /// What the command moved by at last, mm.
        move_mm: f64,
    },
}

/// What to try where a model has no prediction at a target.
const fn advice(gap: &Gap) -> &'static str {
    match gap {
        Gap::Orientation { .. } => "use a table made for the target's orientation",
        _ => "the table cannot tell the error there, and nothing is extrapolated",
    }
}
