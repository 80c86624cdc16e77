//! Join: two logs with a clock each → stations, each a dwell of the arm with what the tracker saw of it.

use nalgebra::{Point3, UnitQuaternion};

use crate::units::{ClockModel, Controller, Stamp, Tracker};

/// The session's stations, its clocks, and everything that did not become part of a station.
#[derive(Debug, Clone)]
pub struct Joined {
    /// Every dwell of the controller, in time order.
    pub stations: Vec<Station>,
    /// How the clocks relate.
    pub clock: ClockEstimate,
    /// Tracker dwells and readings left out, with reasons.
    pub rejects: Vec<JoinReject>,
    /// Readings by verdict; the sum is the number of readings.
    pub counts: ReadingCounts,
}

/// One dwell of the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Number within the session, from 0, in controller time.
    pub number: usize,
    /// First moment at rest.
    pub start: Stamp<Controller>,
    /// Last moment at rest.
    pub end: Stamp<Controller>,
    /// Mean joint angles, rad.
    pub joints: Vec<f64>,
    /// Joint samples the mean is of.
    pub joint_samples: usize,
    /// The command in force during the dwell.
    pub command: Option<Command>,
    /// What the tracker saw, unless the dwell is unmeasured.
    pub attained: Option<Attained>,
    /// The verdict.
    pub pairing: Pairing,
}

/// A commanded pose of the controller's own tool point, in the frame the controller states commands in.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// mm.
    pub position: Point3<f64>,
    /// Where the message has one.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// The mean of a dwell's readings, in the tracker frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Attained {
    /// Mean position, mm.
    pub position: Point3<f64>,
    /// Mean orientation on SO(3), where the target is a 6-DoF one.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// Standard deviation of a single reading per tracker axis, mm (n − 1).
    pub scatter_mm: [f64; 3],
    /// Standard deviation of a single orientation reading (rotation vector norm per axis, root mean square), rad.
    pub orientation_scatter_rad: Option<f64>,
    /// Mean of the tracker's own stated position covariance (xx xy xz yy yz zz, mm²), where it states one.
    pub stated_covariance: Option<[f64; 6]>,
    /// Readings kept in the mean.
    pub kept: usize,
    /// Readings that fell into the dwell, settling and outliers included.
    pub readings: usize,
    /// First and last kept reading.
    pub first: Stamp<Tracker>,
    /// Last kept reading.
    pub last: Stamp<Tracker>,
    /// Temperature nearest in time, °C.
    pub temperature_c: Option<f64>,
}

/// What became of a dwell of the arm.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pairing {
    /// It has readings of its own.
    Paired,
    /// No usable readings: why.
    Unmeasured(Unmeasured),
    /// More than one tracker dwell could belong to it, and geometry did not decide.
    Ambiguous,
}

/// Why a dwell has no measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unmeasured {
    /// No reading at all falls into it.
    NoReadings,
    /// Readings fall into it, but too few are left after settling and outlier rejection.
    TooFewReadings,
    /// The target moved while the arm stood still.
    TargetMoved,
    /// The dwell lies outside the tracker's log.
    OutsideTrackerLog,
    /// Its reading is far from where the arm can have been: a wrong reflector or a lost beam.
    WrongTarget,
}

/// The clocks and how they were found.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockEstimate {
    /// The relation.
    pub model: ClockModel,
    /// Standard error of the offset at t₀, ns.
    pub offset_se_ns: f64,
    /// Standard error of the drift.
    pub drift_se: f64,
    /// Dwell edges that the refinement matched.
    pub matched_edges: usize,
    /// Root mean square of the edges' residuals, ns.
    pub edge_rms_ns: f64,
    /// How it was found, in words: which shifts were tried and what decided.
    pub method: String,
}

/// Readings by verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadingCounts {
    /// Part of a station's mean.
    pub kept: u64,
    /// Before the settling time was over.
    pub settling: u64,
    /// An outlier of its dwell.
    pub outlier: u64,
    /// Taken while the arm moved.
    pub moving: u64,
    /// At rest, but no station took them.
    pub unpaired: u64,
    /// No measurement at all: the zeros some instruments write.
    pub missing: u64,
}

/// A tracker dwell or a run of readings that no station took.
#[derive(Debug, Clone, PartialEq)]
pub struct JoinReject {
    /// First reading.
    pub start: Stamp<Tracker>,
    /// Last reading.
    pub end: Stamp<Tracker>,
    /// How many readings.
    pub readings: u64,
    /// Why, in words.
    pub reason: String,
}
