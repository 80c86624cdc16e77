//! What a fit looks for, and what is expected of it before any measurement.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::fit::frames::{Channel, Frames};
use crate::join::{SourceId, TargetId};
use crate::kinematics::{Motion, Parameter};

/// One unknown of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unknown {
    /// What it belongs to.
    pub owner: Owner,
    /// What it is.
    pub parameter: Parameter,
}

/// What an unknown belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Owner {
    /// The arm, whatever the session.
    Arm,
    /// A session's source: where the base stands in its frame.
    Source {
        /// Which of the fit's sessions, from 0.
        session: usize,
        /// Which of its sources.
        source: SourceId,
    },
    /// A session's target: where it sits at the flange.
    Target {
        /// Which of the fit's sessions, from 0.
        session: usize,
        /// Which of its targets.
        target: TargetId,
    },
}

impl Unknown {
    /// A parameter of the chain between a channel's source and target.
    pub(in crate::fit) const fn of(channel: Channel, parameter: Parameter) -> Self {
        let Channel {
            session,
            source,
            target,
        } = channel;
        let owner = match parameter {
            Parameter::Base(_) => Owner::Source { session, source },
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
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Prior {
    /// Of the geometry's lengths, mm; and of its angles, rad.
    pub geometry: Option<(f64, f64)>,
    /// Of the place of each target of every session, in their order; nothing is expected of targets behind the last.
    pub targets: Vec<Option<KnownTarget>>,
}

impl Prior {
    /// The expected offset of an unknown from `starts` and its standard deviation; `None` where it is free.
    pub(super) fn of(&self, unknown: Unknown, starts: &[Frames]) -> Option<(f64, f64)> {
        match (unknown.owner, unknown.parameter) {
            (Owner::Arm, parameter) => {
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
            (Owner::Target { session, target }, Parameter::Target(Motion::Translation(axis))) => {
                let known = self.targets.get(target.0).copied().flatten()?;
                let start = starts[session].flange_from_target(target).isometry();
                let start = start.translation.vector;
                let along = axis.unit().dot(&(Vector3::from(known.xyz_mm) - start));
                Some((along, known.sd_mm))
            }
            (Owner::Source { .. } | Owner::Target { .. }, _) => None,
        }
    }
}
