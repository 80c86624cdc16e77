//! The rows of one block of a log as columns, before units and checks, in the order of the file.

use super::{JointAngles, LoggedCovariance};

/// Joint angles in the unit of the log; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedJoints {
    /// Time of each row, ns of the source that the pipeline file names.
    pub stamps: Vec<i64>,
    pub angles: JointAngles,
    /// Recorder's time of each row, ns; here and below.
    pub logged: Vec<i64>,
}

/// Poses or points in the unit of the log; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedPoses {
    pub stamps: Vec<i64>,
    /// Position x y z of each row.
    pub positions: Vec<[f64; 3]>,
    /// Quaternion x y z w as logged; absent where the message type has none.
    pub orientations: Option<Vec<[f64; 4]>>,
    /// Covariances as logged, in the log's unit of length and rad; absent where the message type has none.
    pub covariances: Option<Vec<LoggedCovariance>>,
    pub logged: Vec<i64>,
}

/// Temperatures; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedTemperatures {
    pub stamps: Vec<i64>,
    pub celsius: Vec<f64>,
    pub logged: Vec<i64>,
}
