//! Columns as they stand in a log, before units and checks; rows in the order of the file.

use std::collections::BTreeMap;

use super::{JointAngles, LogReject};

/// What was decoded of a session's logs.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decoded {
    /// Joint states.
    pub joints: DecodedJoints,
    /// Commanded poses, where the pipeline file names their topic.
    pub commands: Option<DecodedPoses>,
    /// Readings of the target.
    pub readings: DecodedPoses,
    /// Temperatures, where the pipeline file names their topic.
    pub temperatures: Option<DecodedTemperatures>,
    /// What could not be decoded.
    pub rejects: Vec<LogReject>,
    /// Metadata records of the logs.
    pub metadata: BTreeMap<String, String>,
    /// How much was read.
    pub counts: BTreeMap<String, u64>,
}

/// Joint angles in the unit of the log; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedJoints {
    /// Where the rows come from.
    pub origins: Origins,
    /// Time of each row, ns of the source that the pipeline file names.
    pub stamps: Vec<i64>,
    /// In the same order.
    pub angles: JointAngles,
}

/// Poses or points in the unit of the log; columns of equal length.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DecodedPoses {
    /// Where the rows come from.
    pub origins: Origins,
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
    /// Where the rows come from.
    pub origins: Origins,
    /// Time of each row, ns of the source that the pipeline file names.
    pub stamps: Vec<i64>,
    /// °C.
    pub celsius: Vec<f64>,
}

/// Which byte range of which file each row was decoded from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Origins {
    /// The files, as the pipeline names them, in row order; several where a recording was split.
    pub files: Vec<String>,
    /// The topic.
    pub topic: String,
    /// One for each byte range that has rows, in row order.
    pub blocks: Vec<Origin>,
}

/// A byte range and the rows up to which it reaches.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Origin {
    /// One past the last row that comes from here.
    pub rows_end: usize,
    /// Which of the files.
    pub file: usize,
    /// First byte in the file as stored.
    pub byte_start: u64,
    /// One past the last byte.
    pub byte_end: u64,
}

impl Origins {
    /// Where a row comes from.
    pub fn of_row(&self, row: usize) -> Option<&Origin> {
        let index = self.blocks.partition_point(|origin| origin.rows_end <= row);
        self.blocks.get(index)
    }

    /// The files in words.
    pub fn names(&self) -> String {
        self.files.join(", ")
    }

    /// Adds the origins of the rows of a later file behind `rows` own ones.
    fn append(&mut self, rows: usize, later: Self) {
        let files = self.files.len();
        self.blocks.extend(later.blocks.iter().map(|origin| Origin {
            rows_end: rows + origin.rows_end,
            file: files + origin.file,
            ..*origin
        }));
        self.files.extend(later.files);
    }
}

impl DecodedJoints {
    /// Adds the rows of a later file.
    pub fn append(&mut self, mut later: Self) {
        self.origins.append(self.stamps.len(), later.origins);
        self.stamps.append(&mut later.stamps);
        self.angles.append(later.angles.all());
    }
}

impl DecodedPoses {
    /// Adds the rows of a later file.
    pub fn append(&mut self, mut later: Self) {
        self.origins.append(self.stamps.len(), later.origins);
        self.stamps.append(&mut later.stamps);
        self.positions.append(&mut later.positions);
        if let Some(mut more) = later.orientations {
            self.orientations.get_or_insert_default().append(&mut more);
        }
        if let Some(mut more) = later.covariances {
            self.covariances.get_or_insert_default().append(&mut more);
        }
    }
}

impl DecodedTemperatures {
    /// Adds the rows of a later file.
    pub fn append(&mut self, mut later: Self) {
        self.origins.append(self.stamps.len(), later.origins);
        self.stamps.append(&mut later.stamps);
        self.celsius.append(&mut later.celsius);
    }
}
