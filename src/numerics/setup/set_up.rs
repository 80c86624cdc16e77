//! The set-up of a cell as a pipeline file and its robot file state it.

use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3,
};

use super::evidence::Evidence;
use crate::ingest::{AngleUnit, LengthUnit, OrientationForm};
use crate::join::Command;
use crate::kinematics::Arm;

/// The set-up: the arm, how its angles are reported, the units and the frames.
#[derive(Debug, Clone, PartialEq)]
pub struct SetUp {
    pub arm: Arm,
    /// Joint angles from reported ones, a square matrix; the identity as stated.
    pub joints_from_reported: DMatrix<f64>,
    /// Map on measured positions, a factor or a reflection; the identity as stated.
    pub reading_map: Matrix3<f64>,
    /// How measured orientations are read otherwise than stated.
    pub reading_turns: Reread,
    /// The form of measured orientations; `None` of quaternions in a log.
    pub reading_form: Option<OrientationForm>,
    /// The rows, counted from a row, whose joints, measured position, measured orientation and command belong to it; 0 as stated.
    pub rows: [i8; 4],
    /// Factor on commanded positions; 1 as stated.
    pub command_scale: f64,
    pub command_turns: Reread,
    pub command_form: Option<OrientationForm>,
    pub base_from_command: Isometry3<f64>,
    /// The controller's tool at the flange, mm; `None` where it is not stated.
    pub flange_from_tool: Option<Isometry3<f64>>,
    /// The measured target at the flange, mm; `None` where it is not stated.
    pub target: Option<Vector3<f64>>,
    pub target_is_tool: bool,
    /// The surveyed base in the tracker's frame, mm; `None` where it is fitted.
    pub tracker_from_base: Option<Isometry3<f64>>,
    pub unit_keys: UnitKeys,
    pub units: Units,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Units {
    pub angles: AngleUnit,
    pub slides: LengthUnit,
    pub readings: LengthUnit,
    pub commands: LengthUnit,
}

/// The keys of a pipeline file that state units, for whoever has to edit one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UnitKeys {
    pub angles: &'static str,
    pub slides: &'static str,
    pub readings: &'static str,
    pub commands: &'static str,
}

impl Units {
    /// One of angles and one of lengths.
    pub const fn of(angles: AngleUnit, lengths: LengthUnit) -> Self {
        Self { angles, slides: lengths, readings: lengths, commands: lengths }
    }
}

impl UnitKeys {
    /// Where sessions are logs.
    pub const LOGS: Self = Self {
        angles: "[controller] unit",
        slides: "[controller] length_unit",
        readings: "[tracker] unit",
        commands: "[commanded] unit",
    };
    /// Where sessions are tables of stations.
    pub const TABLES: Self = Self {
        angles: "[stations] joint_unit",
        slides: "[stations] length_unit",
        readings: "[stations.measured] unit",
        commands: "[stations.commanded] unit",
    };
}

impl SetUp {
    /// A set-up of `arm` alone: units as stated, commands in the base frame, nothing else known.
    pub fn of_arm(arm: Arm) -> Self {
        let joints = arm.joints().len();
        Self {
            arm,
            joints_from_reported: DMatrix::identity(joints, joints),
            reading_map: Matrix3::identity(),
            reading_turns: Reread::AsStated,
            reading_form: None,
            rows: [0; 4],
            command_scale: 1.0,
            command_turns: Reread::AsStated,
            command_form: None,
            base_from_command: Isometry3::identity(),
            flange_from_tool: None,
            target: None,
            target_is_tool: false,
            tracker_from_base: None,
            unit_keys: UnitKeys::LOGS,
            units: Units::of(AngleUnit::Deg, LengthUnit::Mm),
        }
    }

    /// This set-up as it is for a target that is neither the tool nor the stated one.
    #[must_use]
    pub fn of_another_target(&self) -> Self {
        Self { target: None, target_is_tool: false, flange_from_tool: None, ..self.clone() }
    }

    /// The nominal flange at reported angles, in the base frame, mm.
    pub(super) fn flange(&self, reported: &[f64]) -> Isometry3<f64> {
        let joints = &self.joints_from_reported * DVector::from_column_slice(reported);
        *self.arm.flange(joints.as_slice()).isometry()
    }

    /// The nominal flange at each station, in the base frame, mm.
    pub(super) fn flanges(&self, evidence: &Evidence) -> Vec<Isometry3<f64>> {
        let stations = evidence.of_row(self.rows[0]).into_iter();
        stations.map(|station| self.flange(&station.reported)).collect()
    }

    /// This set-up with `offsets` (in the order of the chain's parameters, mm and rad) on the nominal arm.
    pub(super) fn with_offsets(&self, offsets: &[f64]) -> Self {
        let arm = self.arm.with_chain(self.arm.chain().with_offsets(offsets));
        Self { arm, ..self.clone() }
    }

    /// Whether arm, reported angles or readings differ from another set-up's: commands and stated frames play no part in the join.
    pub(super) fn joins_otherwise(&self, other: &Self) -> bool {
        self.reading_map != other.reading_map
            || self.rows != other.rows
            || self.joints_from_reported != other.joints_from_reported
            || self.arm != other.arm
    }

    /// A command's orientation in the base frame; `None` where it has none.
    pub(super) fn commanded_turn(&self, command: &Command) -> Option<UnitQuaternion<f64>> {
        Some(self.base_from_command.rotation * self.command_turns.of(&command.orientation?))
    }

    /// Whether sessions are tables of stations.
    pub(super) fn is_of_tables(&self) -> bool {
        self.unit_keys == UnitKeys::TABLES
    }

    /// The target as the file states it: by its own key, otherwise as the tool's origin where the two are one point.
    pub(super) fn stated_target(&self) -> Option<Vector3<f64>> {
        let tool = self.flange_from_tool.filter(|_| self.target_is_tool);
        self.target.or_else(|| tool.map(|tool| tool.translation.vector))
    }

    /// The stated tool's origin and the stated target, where both are stated and meant to be one point.
    pub(super) fn one_point(&self) -> Option<[Vector3<f64>; 2]> {
        let tool = self.flange_from_tool.filter(|_| self.target_is_tool)?;
        Some([tool.translation.vector, self.target?])
    }
}

/// How orientations are read otherwise than stated.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum Reread {
    #[default]
    AsStated,
    /// By a map on the parts x, y, z, w of quaternions.
    Parts(Matrix4<f64>),
    /// The numbers of the first form as those of the second.
    Form(Box<[OrientationForm; 2]>),
}

impl Reread {
    pub(super) fn of(&self, orientation: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        match self {
            Self::AsStated => *orientation,
            Self::Parts(parts) => {
                UnitQuaternion::from_quaternion(Quaternion::from_vector(parts * orientation.coords))
            }
            Self::Form(forms) => {
                let [stated, other] = &**forms;
                let numbers = stated.numbers(orientation);
                numbers.and_then(|numbers| other.rotation(numbers)).unwrap_or(*orientation)
            }
        }
    }
}
