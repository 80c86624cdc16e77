//! The rows of one block of a log as columns, before units and checks, in the order of the file.

use super::JointAngles;

/// Joint angles in the unit of the log; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedJoints {
    /// Time of each row, ns of the source that the pipeline file names.
    pub stamps: Vec<i64>,
    /// In the same order.
    pub angles: JointAngles,
}

/// Poses or points in the unit of the log; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedPoses {
    /// Time of each row, ns of the source that the pipeline file names.
    pub stamps: Vec<i64>,
    /// x y z.
    pub positions: Vec<[f64; 3]>,
    /// x y z w as logged, where the message type has them.
    pub orientations: Option<Vec<[f64; 4]>>,
    /// xx xy xz yy yz zz in the log's unit squared, where the message type has them.
    pub covariances: Option<Vec<[f64; 6]>>,
}

/// Temperatures; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedTemperatures {
    /// Time of each row, ns of the source that the pipeline file names.
    pub stamps: Vec<i64>,
    /// °C.
    pub celsius: Vec<f64>,
}
