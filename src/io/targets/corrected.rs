//! Commands of targets → table `corrected_targets`.

use std::sync::Arc;

use crate::compensation::{Corrected, Exception, JointCommand, Reason, Refused, Target, Term};
use crate::fit::Gap;
use crate::geometry::upper;
use crate::kinematics::InverseError;
use crate::manifest::RunKey;
use crate::rows::{Row as _, Word as _, row, words};
use crate::table::{Table, TableError};
use crate::tables::words::{CorrectingTable, xyzw};

row! {
    pub struct CorrectedRow of "corrected_targets" {
        row: usize,
        target: String,
        command as [x_mm, y_mm, z_mm]: Option<[f64; 3]>,
        command_turn as [qx, qy, qz, qw]: Option<[f64; 4]>,
        configuration: Option<String>,
        tool: Option<String>,
        table_id: Arc<str>,
        corrected_by: CorrectingTable,
        joint_names: Option<Arc<[String]>>,
        joints_rad: Option<Vec<f64>>,
        target_joints_rad: Option<Vec<f64>>,
        correction_joints_rad: Option<Vec<f64>>,
        target_at as [target: point]: Option<[f64; 3]>,
        correction as point: Option<[f64; 3]>,
        correction_sd as point: Option<[f64; 3]>,
        correction_sd_mm: Option<f64>,
        correction_frame_sd_mm: Option<f64>,
        correction_cov_mm2 as [correction_cov: covariance]: Option<[f64; 6]>,
        iterations: Option<usize>,
        allowed: Vec<String>,
        refused: Option<RefusedFor>,
        reason: Option<String>,
    }
}

words! {
    #[derive(PartialOrd, Ord)]
    pub enum RefusedFor {
        Outside: "outside",
        RefusedNode: "refused_node",
        Branches: "branches",
        Orientation: "orientation",
        Configuration: "configuration",
        Tool: "tool",
        NoConvergence: "no_convergence",
        NoPosition: "no_position",
        NoOrientation: "no_orientation",
        Joints: "joints",
        Apart: "apart",
        JointRange: "joint_range",
        JointLimits: "joint_limits",
        OutOfReach: "out_of_reach",
        Singularity: "singularity",
        TooLarge: "too_large",
    }
    Exception {
        NotMet: "not_met",
        NotShown: "not_shown",
        JointRange: "joint_range",
        Configuration: "configuration",
        Term(Term::Tool): "tool",
        Term(Term::Payload): "payload",
        Term(Term::Mounting): "mounting",
        Term(Term::Base): "base",
        Term(Term::ControllerModel): "controller_model",
        Term(Term::AbsoluteAccuracy): "absolute_accuracy",
        Term(Term::Temperature): "temperature",
    }
}

impl From<&Reason> for RefusedFor {
    fn from(reason: &Reason) -> Self {
        match reason {
            Reason::Target(gap) | Reason::Command(gap) => gap.into(),
            Reason::Configuration { .. }
            | Reason::NoConfiguration
            | Reason::Redundant { .. }
            | Reason::Unmeasured { .. }
            | Reason::NeverMeasured { .. }
            | Reason::Arm(
                InverseError::ConfigurationChanged { .. } | InverseError::BranchChanged,
            ) => Self::Configuration,
            Reason::NoPosition => Self::NoPosition,
            Reason::NoOrientation => Self::NoOrientation,
            Reason::Joints { .. } | Reason::JointUnit { .. } => Self::Joints,
            Reason::Apart { .. } => Self::Apart,
            Reason::JointRange { .. } => Self::JointRange,
            Reason::Arm(InverseError::NotReachable { .. } | InverseError::Orientation { .. }) => {
                Self::OutOfReach
            }
            Reason::Arm(InverseError::LimitReached { .. }) => Self::JointLimits,
            Reason::Arm(InverseError::NearSingularity { .. }) => Self::Singularity,
            Reason::Tool { .. } => Self::Tool,
            Reason::NoConvergence { .. } => Self::NoConvergence,
            Reason::TooLarge { .. } => Self::TooLarge,
        }
    }
}

impl From<&Gap> for RefusedFor {
    fn from(gap: &Gap) -> Self {
        match gap {
            Gap::NoJoints => Self::Joints,
            Gap::NoPosition => Self::NoPosition,
            Gap::Orientation { .. } => Self::Orientation,
            Gap::Outside { .. } => Self::Outside,
            Gap::Node { .. } => Self::RefusedNode,
            Gap::Branches => Self::Branches,
        }
    }
}

#[derive(Debug, Clone, Copy)]
pub struct CorrectedBy<'a> {
    pub key: &'a RunKey,
    /// The run's name for targets corrected with it.
    pub table_id: &'a str,
    pub table: CorrectingTable,
    /// The joints in the order of joint angles; none where there are no joint angles.
    pub joint_names: &'a [String],
}

pub fn corrected(
    targets: &[Target],
    outcomes: &[Result<Corrected, Refused>],
    by: CorrectedBy<'_>,
) -> Result<Table, TableError> {
    let table_id: Arc<str> = by.table_id.into();
    let names = (!by.joint_names.is_empty()).then(|| Arc::<[String]>::from(by.joint_names));
    // A target's row, with the command where there is one: by how much it differs, how sure that is, and how it was found.
    let row = |(row, (target, outcome)): (usize, (&Target, &Result<Corrected, Refused>))| {
        let (done, refused) = (outcome.as_ref().ok(), outcome.as_ref().err());
        let joints = done.and_then(|own| own.joints.as_ref());
        let (stated, asked) = (target.position.as_ref(), target.orientation.as_ref());
        CorrectedRow {
            row,
            target: target.name.clone(),
            command: done.map(|own| own.command.coords().into()),
            command_turn: done.and_then(|own| own.orientation.as_ref()).or(asked).map(xyzw),
            configuration: target.configuration.clone(),
            tool: target.tool.clone(),
            table_id: Arc::clone(&table_id),
            corrected_by: by.table,
            joint_names: names.clone(),
            joints_rad: joints.map(|own| own.command.clone()),
            target_joints_rad: joints.map(|own| own.target.clone()),
            correction_joints_rad: joints.map(JointCommand::correction),
            target_at: done.map(|own| &own.target).or(stated).map(|place| place.coords().into()),
            correction: done.map(|own| own.correction.into()),
            correction_sd: done.and_then(Corrected::standard_deviation).map(Into::into),
            correction_sd_mm: done.and_then(Corrected::standard_deviation_norm),
            correction_frame_sd_mm: done.map(Corrected::frame_deviation_norm),
            correction_cov_mm2: done.and_then(|own| own.covariance.as_ref()).map(upper),
            iterations: done.map(|own| own.iterations),
            allowed: done
                .iter()
                .flat_map(|own| &own.allowed)
                .map(|own| own.word().to_owned())
                .collect(),
            refused: refused.map(|own| (&own.reason).into()),
            reason: refused.map(ToString::to_string),
        }
    };
    let rows = targets.iter().zip(outcomes).enumerate().map(row);
    Ok(CorrectedRow::table(rows.collect(), by.key)?.table)
}
