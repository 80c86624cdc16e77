//! The reasons why a target is not corrected: the limit, by how much it is exceeded, and what to try.

use thiserror::Error;

use super::slips::Slip;
use super::validity::MOST_OF_LARGEST;
use crate::fit::Gap;
use crate::kinematics::InverseError;

/// A target without a corrected command.
#[derive(Debug, Clone, PartialEq, Error)]
#[error("target {target:?} {reason}{}", slip.map_or_else(String::new, |slip| format!("; {slip}")))]
pub struct Refused {
    pub target: String,
    pub reason: Reason,
    /// The slip of a unit without which it would have a command; `None` where there is none.
    pub slip: Option<Slip>,
}

/// The reason why a target has no corrected command.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Reason {
    /// The model has no prediction at the target.
    #[error("{}; {}", .0, advice(.0))]
    Target(Gap),
    /// The target is inside the table, but the command that would attain it is not.
    #[error(
        "would need a command that {0}; move the target inwards by that much, or use a larger table"
    )]
    Command(Gap),
    #[error("asks for arm configuration {wanted:?}, the table is for {}", match table {
        Some(table) => format!("{table:?}"),
        None => "an arm that has no configurations; leave the targets' configuration out".to_owned(),
    })]
    Configuration {
        wanted: String,
        /// The table's configuration; `None` when its arm has none.
        table: Option<String>,
    },
    #[error("is for tool {wanted:?}, the table is for {}", match table {
        Some(tool) => format!("{tool:?}"),
        None => "a tool it does not name; name it in the pipeline file, or leave the targets' tool out".to_owned(),
    })]
    Tool {
        wanted: String,
        /// The table's tool; `None` when it names none.
        table: Option<String>,
    },
    #[error(
        "has joint angles but no position, and a compensation table has positions only; correct it with table \
         `calibrations` of the same run"
    )]
    NoPosition,
    #[error(
        "states neither joint angles nor an orientation, and an arm's error depends on its joint angles; give q1_rad … or \
         qx qy qz qw"
    )]
    NoOrientation,
    #[error(
        "states neither joint angles nor an arm configuration, and the arm may reach it in several ways; give q1_rad … or a \
         configuration such as \"shoulder+ elbow- wrist+\""
    )]
    NoConfiguration,
    #[error(
        "asks for arm configuration {wanted:?}; the joint ranges measured contain {}; measure there, or reach it in \
         another",
        measured.join(", ")
    )]
    Unmeasured {
        wanted: String,
        /// The configurations within the joint ranges measured.
        measured: Vec<String>,
    },
    #[error(
        "is in arm configuration {found:?}, but stations were measured in {}; measure there, or reach it in another",
        measured.join(", ")
    )]
    NeverMeasured {
        /// The configuration of the target or of its command.
        found: String,
        /// The configurations of the stations.
        measured: Vec<String>,
    },
    #[error("has {found}, the arm has joints {}; give one for each, in this order or by these names", expected.join(", "))]
    Joints {
        found: String,
        /// The names of the arm's joints.
        expected: Vec<String>,
    },
    #[error(
        "states joint {joint:?} {}", if *slides { "as an angle, and it slides: give it in mm, as q1_mm for the first joint" } else { "in mm, and it turns: give it in rad or deg" }
    )]
    JointUnit { joint: String, slides: bool },
    #[error(
        "has a pose {apart_mm:.3} mm and {apart_deg:.2}° from that of the tool of the nominal arm at its joint angles; check tool, frame, units \
         and the order of qx, qy, qz and qw, or leave one out"
    )]
    Apart { apart_mm: f64, apart_deg: f64 },
    #[error(
        "states no joint angles, and an arm with {joints} joints reaches it in infinitely many ways, each with an error of its \
         own; give q1_rad … or q1_deg …"
    )]
    Redundant { joints: usize },
    #[error(
        "needs joint {joint:?} at {value:.3}{unit}, {beyond:.3}{unit} beyond the {:.3}{unit} to {:.3}{unit} that were measured: \
         the model has no information there; measure there, or reach the target with angles inside",
        measured[0], measured[1]
    )]
    JointRange {
        joint: String,
        /// The angle or length needed, degrees or mm.
        value: f64,
        /// Its distance from the measured range, degrees or mm.
        beyond: f64,
        /// The measured range, degrees or mm.
        measured: [f64; 2],
        /// The unit of these, as it follows a number.
        unit: &'static str,
    },
    /// The nominal arm cannot reach the target.
    #[error("is not for this arm: {0}")]
    Arm(#[from] InverseError),
    #[error(
        "would be corrected by {error_mm:.3} mm, and the largest error of the run's stations before correction was \
         {largest_mm:.3} mm, {MOST_OF_LARGEST} times of which is the most that is given; check the signs and units of [commanded] \
         flange_from_tool, [fit] target and the base frame in the pipeline file and run the session again, or measure where the \
         target is"
    )]
    TooLarge {
        error_mm: f64,
        /// The largest of the stations, mm.
        largest_mm: f64,
    },
    #[error(
        "has no command: after {iterations} iterations the command still moves by {move_mm:.6} mm, as the error jumps there \
         (errors interpolated by `idw` do where two cells meet); move the target by that much, or use a trilinear table"
    )]
    NoConvergence {
        /// Number of evaluations of the table.
        iterations: usize,
        /// Size of the last move of the command, mm.
        move_mm: f64,
    },
}

/// The advice for a target at which a model has no prediction.
const fn advice(gap: &Gap) -> &'static str {
    match gap {
        Gap::Orientation { .. } => "use a table made for the target's orientation",
        _ => "the table has no error there, and nothing is extrapolated",
    }
}
