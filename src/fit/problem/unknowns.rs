//! What a fit looks for, and what is expected of it before any measurement.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::geometry::{Base, Flange, Target, Tracker, Transform};
use crate::kinematics::{Motion, Parameter};

/// The two frames of one session that the fit finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frames {
    /// Where the base stands in the tracker's frame.
    pub tracker_from_base: Transform<Tracker, Base>,
    /// Where the target sits at the flange; turned only where orientations are measured.
    pub flange_from_target: Transform<Flange, Target>,
}

/// One unknown of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unknown {
    /// The session whose frame it belongs to; `None` for the arm's geometry.
    pub session: Option<usize>,
    /// What it is.
    pub parameter: Parameter,
}

/// Which parameters a fit may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// Base and target frames alone.
    BaseAndTarget,
    /// The base frame alone, for a session judged by an arm identified elsewhere.
    Base,
    /// Base and target frames, and the arm's geometry.
    Geometry,
}

/// Where the target sits at the flange, as far as it is known before the fit.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KnownTarget {
    /// Along the flange's axes, mm.
    pub xyz_mm: [f64; 3],
    /// Standard uncertainty per axis, mm.
    pub sd_mm: f64,
}

/// What is expected of the unknowns before any measurement, as standard deviations; the rest is free.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Prior {
    /// Of the geometry's lengths, mm; and of its angles, rad.
    pub geometry: Option<(f64, f64)>,
    /// Of the target's place.
    pub target: Option<KnownTarget>,
}

impl Prior {
    /// The expected offset of an unknown from `starts` and its standard deviation; `None` where it is free.
    pub(super) fn of(&self, unknown: Unknown, starts: &[Frames]) -> Option<(f64, f64)> {
        match (unknown.session, unknown.parameter) {
            (None, parameter) => {
                let (length_mm, angle_rad) = self.geometry?;
                Some((
                    0.0,
                    if parameter.is_angle() {
                        angle_rad
                    } else {
                        length_mm
                    },
                ))
            }
            (Some(session), Parameter::Target(Motion::Translation(axis))) => {
                let known = self.target?;
                let start = starts[session]
                    .flange_from_target
                    .isometry()
                    .translation
                    .vector;
                let along = axis.unit().dot(&(Vector3::from(known.xyz_mm) - start));
                Some((along, known.sd_mm))
            }
            (Some(_), _) => None,
        }
    }
}
