//! Dwells of the arm (on its joints) and of the target (on its positions), in seconds from each log's first stamp.
//!
//! An edge lies half way between the last moving and the first stationary sample. Where a log begins, ends or breaks off
//! inside a dwell there is no edge: the true one is outside.

use nalgebra::{Isometry3, Vector3};

use super::JoinError;
use super::average::{median, robust_sigma};
use super::readings::Readings;
use super::stationary::{Stationary, StationaryStretch, Stretch};
use crate::kinematics::Arm;
use crate::units::{Controller, NS_PER_S, Stamp, Tracker};

/// Start and end of a dwell in its own clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// First stationary sample, s.
    pub start_s: f64,
    /// Last stationary sample, s.
    pub end_s: f64,
    /// End of the motion before it, s; `None` where it was not seen.
    pub arrived_s: Option<f64>,
    /// Start of the motion after it, s; `None` where it was not seen.
    pub left_s: Option<f64>,
}

impl Span {
    pub fn middle_s(&self) -> f64 {
        f64::midpoint(self.arrival_s(), self.departure_s())
    }

    /// The edge where it was seen, otherwise the first sample, s.
    pub(super) fn arrival_s(&self) -> f64 {
        self.arrived_s.unwrap_or(self.start_s)
    }

    /// The edge where it was seen, otherwise the last sample, s.
    pub(super) fn departure_s(&self) -> f64 {
        self.left_s.unwrap_or(self.end_s)
    }

    /// The span so much later, s.
    pub(super) fn later(self, by_s: f64) -> Self {
        Self {
            start_s: self.start_s + by_s,
            end_s: self.end_s + by_s,
            arrived_s: self.arrived_s.map(|at_s| at_s + by_s),
            left_s: self.left_s.map(|at_s| at_s + by_s),
        }
    }

    fn of(stretch: &StationaryStretch, stationary: &Stationary) -> Self {
        let origin = stationary.span_ns.0;
        let seconds = |stamp_ns: i64| stamp_ns.saturating_sub(origin) as f64 / NS_PER_S;
        // The samples around an edge limit its resolution: across a break it was not seen.
        let edge = |before_ns: i64, after_ns: i64| {
            let apart = after_ns.saturating_sub(before_ns);
            (apart <= stationary.interval_ns.saturating_mul(2))
                .then(|| f64::midpoint(seconds(before_ns), seconds(after_ns)))
        };
        let (start_ns, end_ns) = (stretch.start_ns, stretch.end_ns);
        Self {
            start_s: seconds(start_ns),
            end_s: seconds(end_ns),
            arrived_s: stretch.before_ns.and_then(|before| edge(before, start_ns)),
            left_s: stretch.after_ns.and_then(|after| edge(end_ns, after)),
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct ArmDwell {
    pub start: Stamp<Controller>,
    pub end: Stamp<Controller>,
    pub samples: usize,
    /// Start and end in seconds since the controller's first stamp.
    pub span: Span,
    pub joints: Vec<f64>,
    pub flange: Isometry3<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct TargetDwell {
    pub stretch: Stretch,
    pub start: Stamp<Tracker>,
    pub end: Stamp<Tracker>,
    /// Start and end in seconds since the tracker's first stamp.
    pub span: Span,
    pub position: Vector3<f64>,
    /// Standard deviation per axis by the median absolute deviation, mm.
    pub scatter_mm: [f64; 3],
}

pub(super) fn arm_dwells(stationary: &Stationary, arm: &Arm) -> Vec<ArmDwell> {
    let dwell = |stretch: &StationaryStretch| ArmDwell {
        start: Stamp::from_ns(stretch.start_ns),
        end: Stamp::from_ns(stretch.end_ns),
        samples: stretch.stretch.last - stretch.stretch.first + 1,
        span: Span::of(stretch, stationary),
        flange: *arm.flange(&stretch.means).isometry(),
        joints: stretch.means.clone(),
    };
    stationary.stretches.iter().map(dwell).collect()
}

pub(super) fn target_dwells(readings: &Readings<'_>) -> Result<Vec<TargetDwell>, JoinError> {
    let stationary = &readings.stationary;
    let dwell = |stretch: &StationaryStretch| {
        let mut axes = readings.of(stretch.stretch)?.axes();
        Ok(TargetDwell {
            stretch: stretch.stretch,
            start: Stamp::from_ns(stretch.start_ns),
            end: Stamp::from_ns(stretch.end_ns),
            span: Span::of(stretch, stationary),
            position: axes.each_mut().map(|axis| median(axis)).into(),
            scatter_mm: axes.each_mut().map(|axis| robust_sigma(axis)),
        })
    };
    stationary.stretches.iter().map(dwell).collect()
}
