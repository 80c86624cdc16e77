//! The unknowns of a fit and their prior.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::fit::frames::{Channel, Frames};
use crate::fit::gauge::Gauge;
use crate::join::{SourceId, TargetId};
use crate::kinematics::{GaugePart, Motion, Parameter};

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unknown {
    pub owner: Owner,
    pub parameter: Parameter,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Owner {
    Arm,
    /// A session's source: the pose of the base in its frame.
    Source {
        session: usize,
        source: SourceId,
    },
    /// A session's target: its pose on the flange.
    Target {
        session: usize,
        target: TargetId,
    },
}

impl Unknown {
    /// A parameter of the chain between a channel's source and target.
    pub(in crate::fit) const fn of(channel: Channel, parameter: Parameter) -> Self {
        let Channel { session, source, target } = channel;
        let owner = match parameter {
            Parameter::Base(_) | Parameter::Gauge(_) => Owner::Source { session, source },
            Parameter::Link { .. } => Owner::Arm,
            Parameter::Target(_) => Owner::Target { session, target },
        };
        Self { owner, parameter }
    }

    /// The session whose frame it belongs to; `None` for the arm's geometry.
    pub const fn session(&self) -> Option<usize> {
        match self.owner {
            Owner::Arm => None,
            Owner::Source { session, .. } | Owner::Target { session, .. } => Some(session),
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Freedom {
    BaseAndTarget,
    Base,
    Geometry,
}

/// Position of the measured target on the flange known before the fit.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KnownTarget {
    /// Position along the flange's axes, mm.
    pub xyz_mm: [f64; 3],
    pub sd_mm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetDistance {
    pub between: [TargetId; 2],
    pub mm: f64,
    pub sd_mm: f64,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KnownDistance {
    pub between: [String; 2],
    pub mm: f64,
    pub sd_mm: f64,
}

/// Priors of the unknowns, as standard deviations; unknowns without one are free.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Prior {
    /// Standard deviations of the geometry's lengths, mm, and of its angles, rad.
    pub geometry: Option<(f64, f64)>,
    /// Known position of each target of every session, in their order; `None`, and targets after the last, have no prior.
    pub targets: Vec<Option<KnownTarget>>,
    pub distances: Vec<TargetDistance>,
    /// Stated place and offset of each source of lengths, in every session, in their order; those after the last have no prior.
    pub gauges: Vec<KnownGauge>,
}

/// The stated place and offset of an instrument that reads one length, before the fit.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct KnownGauge {
    /// The anchor's place in the base's frame, mm, with its standard uncertainty per axis, mm; `None` where it is not known.
    pub place: Option<KnownTarget>,
    /// The reading at no distance, mm, with its standard uncertainty, mm; `None` where it is free.
    pub offset: Option<(f64, f64)>,
}

impl Prior {
    /// The expected offset of an unknown from `starts` and its standard deviation; `None` where it is free.
    pub(super) fn of(&self, unknown: Unknown, starts: &[Frames]) -> Option<(f64, f64)> {
        match (unknown.owner, unknown.parameter) {
            (Owner::Arm, parameter) => {
                let (length_mm, angle_rad) = self.geometry?;
                Some((0.0, if parameter.is_angle() { angle_rad } else { length_mm }))
            }
            (Owner::Target { session, target }, Parameter::Target(Motion::Translation(axis))) => {
                let known = self.targets.get(target.0).copied().flatten()?;
                let start = starts[session].flange_from_target(target).isometry();
                let start = start.translation.vector;
                let along = axis.unit().dot(&(Vector3::from(known.xyz_mm) - start));
                Some((along, known.sd_mm))
            }
            (Owner::Source { session, source }, Parameter::Gauge(part)) => {
                let Some(Gauge::Distance(start)) = starts[session].gauge(source) else {
                    return None;
                };
                let known = self.gauges.get(source.0)?;
                match part {
                    GaugePart::Place(axis) => {
                        let known = known.place?;
                        let away = Vector3::from(known.xyz_mm) - start.place.coords;
                        Some((axis.unit().dot(&away), known.sd_mm))
                    }
                    GaugePart::Offset => {
                        let (mm, sd_mm) = known.offset?;
                        Some((mm - start.offset_mm, sd_mm))
                    }
                    GaugePart::Tilt | GaugePart::OtherTilt | GaugePart::Height => None,
                }
            }
            (Owner::Source { .. } | Owner::Target { .. }, _) => None,
        }
    }
}
