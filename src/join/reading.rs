//! What instruments read of one dwell: a reading of each source on each target that it saw.
//!
//! A session has sources (instruments, each with a frame of its own) and targets at the flange (each in a place of its own). A
//! [`Reading`] names both and holds the mean of what was read. What kinds of readings there are stands in [`ReadingKind`]; what a
//! fit makes of each kind is in [`crate::fit::observation::measured`].

use nalgebra::{Point3, UnitQuaternion};
use thiserror::Error;

use super::Station;
use crate::units::{Stamp, Tracker};

/// An instrument's place among the sources of its session, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SourceId(pub usize);

impl SourceId {
    /// The source of a session that has one: of a join of one tracker's log, of a plan, of a simulated session.
    pub const ONLY: Self = Self(0);
}

/// A reflector's place among the targets at the flange of its session, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TargetId(pub usize);

impl TargetId {
    /// The target of a session that has one.
    pub const ONLY: Self = Self(0);
}

/// What one source read of one target during a dwell, in the source's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Which instrument read it.
    pub source: SourceId,
    /// Which target it saw.
    pub target: TargetId,
    /// The mean of the samples kept.
    pub value: Value,
    /// Samples kept in the mean.
    pub kept: usize,
    /// Samples that fell into the dwell, settling and outliers included.
    pub taken: usize,
    /// First kept sample.
    pub first: Stamp<Tracker>,
    /// Last kept sample.
    pub last: Stamp<Tracker>,
    /// Temperature nearest in time, °C.
    pub temperature_c: Option<f64>,
}

/// The value of a reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Value {
    /// A position.
    Point(MeanPoint),
    /// A position and an orientation, of a 6-DoF target.
    Pose(MeanPoint, MeanOrientation),
}

/// What a source can read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReadingKind {
    /// A position: three numbers.
    Point,
    /// A position and an orientation: six numbers.
    Pose,
}

/// The mean of a dwell's positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanPoint {
    /// Mean position, mm.
    pub position: Point3<f64>,
    /// Standard deviation of a single sample per axis, mm (n − 1).
    pub scatter_mm: [f64; 3],
    /// Mean of the instrument's own stated position covariance (xx xy xz yy yz zz, mm²), where it states one.
    pub stated_covariance: Option<[f64; 6]>,
}

/// The mean of a dwell's orientations.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanOrientation {
    /// Mean orientation on SO(3).
    pub orientation: UnitQuaternion<f64>,
    /// Standard deviation of a single sample (rotation vector norm per axis, root mean square), rad.
    pub scatter_rad: f64,
}

impl Value {
    /// A pose where an orientation was read, otherwise a point.
    pub const fn of(point: MeanPoint, orientation: Option<MeanOrientation>) -> Self {
        match orientation {
            None => Self::Point(point),
            Some(orientation) => Self::Pose(point, orientation),
        }
    }

    /// What was read.
    pub const fn kind(&self) -> ReadingKind {
        match self {
            Self::Point(_) => ReadingKind::Point,
            Self::Pose(..) => ReadingKind::Pose,
        }
    }

    /// The position, where one was read.
    pub const fn point(&self) -> Option<&MeanPoint> {
        match self {
            Self::Point(point) | Self::Pose(point, _) => Some(point),
        }
    }

    /// The position, to be changed, where one was read.
    pub const fn point_mut(&mut self) -> Option<&mut MeanPoint> {
        match self {
            Self::Point(point) | Self::Pose(point, _) => Some(point),
        }
    }

    /// The orientation, where one was read.
    pub const fn turn(&self) -> Option<&MeanOrientation> {
        match self {
            Self::Point(_) => None,
            Self::Pose(_, turn) => Some(turn),
        }
    }
}

impl Reading {
    /// Mean position in the source's frame, mm, where one was read.
    pub fn position(&self) -> Option<Point3<f64>> {
        self.value.point().map(|point| point.position)
    }

    /// Mean orientation in the source's frame, where one was read.
    pub fn orientation(&self) -> Option<UnitQuaternion<f64>> {
        self.value.turn().map(|turn| turn.orientation)
    }
}

impl ReadingKind {
    /// How many numbers a reading of this kind holds: the rows of its residual.
    pub const fn rows(self) -> usize {
        match self {
            Self::Point => 3,
            Self::Pose => 6,
        }
    }
}

/// Several sources or targets where the work is for one of each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "{sources} measuring instruments and {targets} targets at the flange in one session: this step works with one instrument and one \
     target; keep the readings of one instrument on one target, or name sessions that have no others"
)]
pub struct Several {
    /// Sources of the session.
    pub sources: usize,
    /// Targets of the session.
    pub targets: usize,
}

/// Refuses stations with more than one source, target or reading of a dwell: what is for one of each asks here first.
pub fn one_source_and_target(stations: &[Station]) -> Result<(), Several> {
    let mut several = Several {
        sources: 1,
        targets: 1,
    };
    let mut most = 1;
    for station in stations {
        most = most.max(station.readings.len());
        for reading in &station.readings {
            several.sources = several.sources.max(reading.source.0 + 1);
            several.targets = several.targets.max(reading.target.0 + 1);
        }
    }
    if most > 1 || several.sources > 1 || several.targets > 1 {
        Err(several)
    } else {
        Ok(())
    }
}
