//! Readings of instruments during one dwell: one of each source on each target that it measured.
//!
//! A session has sources (instruments, each with a frame of its own) and targets at the flange (each in a place of its own). A
//! [`Reading`] names both and has the mean of the samples. [`ReadingKind`] lists the kinds of readings; the use of each kind in
//! a fit is in [`crate::fit::observation::measured`].

use nalgebra::{Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Station;
use crate::geometry::{PoseCovariance, TurnCovariance, symmetric, upper};
use crate::units::{Stamp, Tracker};

/// An instrument's index among the sources of its session, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct SourceId(pub usize);

impl SourceId {
    /// The source of a session with only one: from a join of one tracker's log, a plan or a simulation.
    pub const ONLY: Self = Self(0);
}

/// A reflector's index among the targets on the flange of its session, from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct TargetId(pub usize);

impl TargetId {
    pub const ONLY: Self = Self(0);
    /// The first target of a session with several: the one that errors of one tool point are stated by.
    pub const MAIN: Self = Self(0);

    /// Its name among `names`, or its number from 1 where it has none.
    pub fn name(self, names: &[String]) -> String {
        names.get(self.0).cloned().unwrap_or_else(|| (self.0 + 1).to_string())
    }
}

/// The reading of one source on one target during a dwell, in the source's frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    pub source: SourceId,
    pub target: TargetId,
    pub value: Value,
    pub kept: usize,
    /// Number of samples in the dwell, settling and outliers included.
    pub taken: usize,
    pub first: Stamp<Tracker>,
    pub last: Stamp<Tracker>,
    /// Temperature nearest in time, °C.
    pub temperature_c: Option<f64>,
}

/// What is read of a target, by the kind of reading: of a place the point `P`, with an orientation `T`, or one length `L`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ByKind<P, T, L> {
    Point(P),
    Pose(P, T),
    Distance(L),
    Height(L),
}

/// The mean of a dwell's samples.
pub type Value = ByKind<MeanPoint, MeanOrientation, MeanLength>;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ReadingKind {
    Point,
    Pose,
    Distance,
    Height,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanPoint {
    pub position: Point3<f64>,
    /// Standard deviation of a single sample per axis, mm (n − 1).
    pub scatter_mm: [f64; 3],
    /// Mean of the instrument's own stated position covariance (xx xy xz yy yz zz, mm²); absent where it states none.
    pub stated_covariance: Option<[f64; 6]>,
    /// Covariance that following the references adds (xx xy xz yy yz zz, mm²); absent where no references were followed.
    pub motion_covariance: Option<[f64; 6]>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanLength {
    pub mm: f64,
    pub sd_mm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanOrientation {
    pub orientation: UnitQuaternion<f64>,
    /// Standard deviation of a single sample (rotation vector norm per axis, root mean square), rad.
    pub scatter_rad: f64,
    /// Mean of the instrument's own stated covariance of the orientation, alone and with the position; absent where it states none.
    pub stated_covariance: Option<TurnCovariance>,
}

impl MeanPoint {
    /// The covariance that the instrument states of the pose with this position and that orientation.
    pub const fn stated_with(&self, turn: &MeanOrientation) -> PoseCovariance {
        PoseCovariance { position: self.stated_covariance, turn: turn.stated_covariance }
    }
}

impl Value {
    pub const fn of(point: MeanPoint, orientation: Option<MeanOrientation>) -> Self {
        match orientation {
            None => Self::Point(point),
            Some(orientation) => Self::Pose(point, orientation),
        }
    }

    /// The inverse of a pose: of the target's in the camera's frame the camera's in the target's. `None` of a point.
    ///
    /// Scatter of the orientation moves the inverse's position at the end of the ray, and so does its stated covariance; one of the
    /// position alone is turned.
    pub fn inverted(&self) -> Option<Self> {
        let Self::Pose(point, turn) = self else { return None };
        let pose = Isometry3::from_parts(point.position.into(), turn.orientation);
        let stated = point.stated_with(turn).inverted(&pose);
        let inverse = pose.inverse();
        let back = *inverse.rotation.to_rotation_matrix().matrix();
        let turned = |own: Matrix3<f64>| back * own * back.transpose();
        let arm = point.position.coords.cross_matrix();
        let scatter = Matrix3::from_diagonal(&Vector3::from(point.scatter_mm).map(|sd| sd * sd));
        let scatter = turned(scatter - arm * arm * turn.scatter_rad.powi(2));
        let point = MeanPoint {
            position: Point3::from(inverse.translation.vector),
            scatter_mm: [0, 1, 2].map(|axis| scatter[(axis, axis)].max(0.0).sqrt()),
            stated_covariance: stated.position,
            motion_covariance: point.motion_covariance.map(|own| upper(&turned(symmetric(own)))),
        };
        let (orientation, stated_covariance) = (inverse.rotation, stated.turn);
        Some(Self::Pose(point, MeanOrientation { orientation, stated_covariance, ..*turn }))
    }
}

impl<P, T, L> ByKind<P, T, L> {
    pub const fn kind(&self) -> ReadingKind {
        match self {
            Self::Point(_) => ReadingKind::Point,
            Self::Pose(..) => ReadingKind::Pose,
            Self::Distance(_) => ReadingKind::Distance,
            Self::Height(_) => ReadingKind::Height,
        }
    }

    pub const fn point(&self) -> Option<&P> {
        match self {
            Self::Point(point) | Self::Pose(point, _) => Some(point),
            Self::Distance(_) | Self::Height(_) => None,
        }
    }

    pub const fn point_mut(&mut self) -> Option<&mut P> {
        match self {
            Self::Point(point) | Self::Pose(point, _) => Some(point),
            Self::Distance(_) | Self::Height(_) => None,
        }
    }

    pub const fn turn(&self) -> Option<&T> {
        match self {
            Self::Point(_) | Self::Distance(_) | Self::Height(_) => None,
            Self::Pose(_, turn) => Some(turn),
        }
    }

    pub const fn length(&self) -> Option<&L> {
        match self {
            Self::Point(_) | Self::Pose(..) => None,
            Self::Distance(length) | Self::Height(length) => Some(length),
        }
    }
}

impl Reading {
    /// Mean position in the source's frame, mm; `None` where none was read.
    pub fn position(&self) -> Option<Point3<f64>> {
        self.value.point().map(|point| point.position)
    }

    /// Mean orientation in the source's frame; `None` where none was read.
    pub fn orientation(&self) -> Option<UnitQuaternion<f64>> {
        self.value.turn().map(|turn| turn.orientation)
    }
}

impl ReadingKind {
    /// Number of values in a reading of this kind, which is the number of rows of its residual.
    pub const fn rows(self) -> usize {
        match self {
            Self::Point => 3,
            Self::Pose => 6,
            Self::Distance | Self::Height => 1,
        }
    }

    pub const fn is_length(self) -> bool {
        matches!(self, Self::Distance | Self::Height)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "{sources} measuring instruments in one session: errors, tables and figures are stated by one instrument's readings; keep the \
     readings of one"
)]
pub struct SeveralSources {
    pub sources: usize,
}

/// Refuses stations with positions or poses of more than one source, for steps that work with one. Sources of one length take part
/// in a fit and in nothing behind it: they may be any number, and come after the source of places.
pub fn one_source(stations: &[Station]) -> Result<(), SeveralSources> {
    let readings = stations.iter().flat_map(|station| &station.readings);
    let places = readings.filter(|reading| !reading.value.kind().is_length());
    match places.map(|reading| reading.source.0 + 1).max() {
        None | Some(..=1) => Ok(()),
        Some(sources) => Err(SeveralSources { sources }),
    }
}
