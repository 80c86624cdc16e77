//! Readings of paired stations → observations: the measured values with their covariances.
//!
//! The covariance of a measured position is the tracker's (ranging along the beam, transverse across it,
//! [`crate::method::uncertainty`]), plus the arm's repeatability, plus the variance of the readings' mean: `scatter²/n`. Readings that
//! state their covariance scatter in its shape. Each kind of reading in a fit: [`measured`], [`rows`].

pub mod camera;
pub mod measured;
pub mod rows;

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::commanded::{Commanded, SettlingError};
use super::frames::{Channel, MeasuredFlange};
use crate::join::{Reading, ReadingKind, SourceId, Station, TargetId};
use crate::kinematics::Arm;
use crate::units::MM_PER_M;

pub use camera::{CameraUncertainty, Mounted};
pub use measured::{Measured, MeasuredLength, MeasuredOrientation, MeasuredPoint, stated_of};

/// A tracker's uncertainty as its data sheet states it: limits, to be divided by `divisor` for a standard uncertainty.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TrackerUncertainty {
    /// Ranging: constant part, µm.
    pub range_um: f64,
    /// Ranging: part that grows with the range, µm/m.
    pub range_um_per_m: f64,
    /// Transverse: constant part, µm.
    pub transverse_um: f64,
    /// Transverse: part that grows with the range, µm/m.
    pub transverse_um_per_m: f64,
    /// Divisor from a limit to a standard uncertainty: 2 for k = 2, √3 for a rectangular limit.
    pub divisor: f64,
    /// Standard uncertainty of a 6-DoF target's orientation, rad; needed where orientations are fitted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation_rad: Option<f64>,
}

impl TrackerUncertainty {
    /// Covariance of one position, mm², in the tracker frame: `R diag(u_r², u_t², u_t²) Rᵀ`, R along the beam.
    pub fn covariance(&self, position: &Point3<f64>) -> Matrix3<f64> {
        let range_m = position.coords.norm() / MM_PER_M;
        let standard_mm =
            |constant: f64, per_m: f64| per_m.mul_add(range_m, constant) / (1000.0 * self.divisor);
        let ranging = standard_mm(self.range_um, self.range_um_per_m);
        let transverse = standard_mm(self.transverse_um, self.transverse_um_per_m);
        let beam = position.coords.try_normalize(0.0).unwrap_or_else(Vector3::x);
        let along = beam * beam.transpose();
        along * ranging.powi(2) + (Matrix3::identity() - along) * transverse.powi(2)
    }
}

/// The uncertainty of an instrument, by its kind: `uncertainty` or `camera` of `[tracker]`.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
pub enum Uncertainty {
    #[serde(rename = "uncertainty")]
    Tracker(TrackerUncertainty),
    #[serde(rename = "camera")]
    Camera(CameraUncertainty),
}

impl From<TrackerUncertainty> for Uncertainty {
    fn from(tracker: TrackerUncertainty) -> Self {
        Self::Tracker(tracker)
    }
}

impl Uncertainty {
    pub fn covariance(&self, position: &Point3<f64>) -> Matrix3<f64> {
        match self {
            Self::Tracker(tracker) => tracker.covariance(position),
            Self::Camera(camera) => camera.covariance(position),
        }
    }

    /// Standard uncertainty of an orientation per axis at a position, rad; `None` where none is stated.
    pub fn orientation_rad(&self, position: &Point3<f64>) -> Option<f64> {
        match self {
            Self::Tracker(tracker) => tracker.orientation_rad,
            Self::Camera(camera) => Some(camera.orientation_rad(position.coords.norm())),
        }
    }

    pub const fn camera(&self) -> Option<&CameraUncertainty> {
        match self {
            Self::Tracker(_) => None,
            Self::Camera(camera) => Some(camera),
        }
    }
}

/// The data of one reading of a paired station that a fit needs.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    pub session: usize,
    pub source: SourceId,
    pub target: TargetId,
    pub station: usize,
    /// The number of the station that names its pose: visits of one pose have the same.
    pub pose: usize,
    /// Axis variables of the chain (the joint map applied), rad.
    pub axes: Vec<f64>,
    pub measured: Measured,
    /// The station's settling error; absent without commanded poses.
    pub settling_error: Option<SettlingError>,
    /// The flange's orientation from several targets; only on the main target's observation, and not fitted: its readings are.
    pub flange: Option<MeasuredFlange>,
    /// Whether the motion that references show was taken out of it: what drifts then drifts no more.
    pub follows_references: bool,
    /// The day that its session began, in days since 1970; absent where no clock of the session has an epoch.
    pub day: Option<f64>,
}

impl Observation {
    /// A station of a session with one source and one target that is still to be measured, with the instrument's covariance
    /// there (mm²); readings beside each other with one station's number are of one pose that the arm attained.
    pub fn planned(
        station: usize,
        axes: Vec<f64>,
        position: Point3<f64>,
        instrument: Matrix3<f64>,
    ) -> Self {
        Self {
            session: 0,
            source: SourceId::ONLY,
            target: TargetId::ONLY,
            station,
            pose: station,
            axes,
            measured: Measured::Point(MeasuredPoint {
                position,
                instrument,
                factor: Matrix3::identity(),
            }),
            settling_error: None,
            flange: None,
            follows_references: false,
            day: None,
        }
    }

    pub const fn channel(&self) -> Channel {
        Channel { session: self.session, source: self.source, target: self.target }
    }

    pub const fn point(&self) -> Option<&MeasuredPoint> {
        self.measured.point()
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// The kind of reading used: the orientation of a pose only from a source of poses.
    pub reads: ReadingKind,
    pub uncertainty: Uncertainty,
}

impl Source {
    pub fn states_orientations(&self) -> bool {
        self.uncertainty.orientation_rad(&Point3::origin()).is_some()
    }
}

/// The uncertainties of the measurement that the readings do not show.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    pub sources: Vec<Source>,
    pub repeatability_mm: f64,
    /// Size of the covariances that each source's readings state, in order of [`SourceId`]; behind the last as stated.
    pub stated: Vec<StatedSize>,
}

/// Factors on the standard deviations that readings state of themselves.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StatedSize {
    pub position: f64,
    pub orientation: f64,
}

impl StatedSize {
    pub const ONE: Self = Self { position: 1.0, orientation: 1.0 };
}

impl Noise {
    pub fn of_one(source: Source, repeatability_mm: f64) -> Self {
        Self { sources: vec![source], repeatability_mm, stated: Vec::new() }
    }

    pub fn source(&self, source: SourceId) -> &Source {
        &self.sources[source.0]
    }

    pub fn stated_size(&self, source: SourceId) -> StatedSize {
        self.stated.get(source.0).copied().unwrap_or(StatedSize::ONE)
    }

    /// This noise with these sizes of what readings state.
    #[must_use]
    pub fn with_stated(&self, stated: &[StatedSize]) -> Self {
        Self { stated: stated.to_vec(), ..self.clone() }
    }

    pub fn takes_orientations(&self) -> bool {
        let mut sources = self.sources.iter();
        sources.any(|source| source.reads == ReadingKind::Pose)
    }
}

/// The readings of one session's paired stations as observations, in station order; readings of sources that `noise` does not
/// list are left out.
pub fn observations(
    session: usize,
    stations: &[Station],
    arm: &Arm,
    noise: &Noise,
) -> Vec<Observation> {
    let observation = |station: &Station, reading: &Reading| {
        let source = noise.sources.get(reading.source.0)?;
        let (size, point) = (noise.stated_size(reading.source), reading.value.point());
        Some(Observation {
            session,
            source: reading.source,
            target: reading.target,
            station: station.number,
            pose: station.number,
            axes: arm.axes(&station.joints),
            measured: Measured::of(reading, source, size, noise.repeatability_mm),
            settling_error: None,
            flange: None,
            follows_references: point.is_some_and(|point| point.motion_covariance.is_some()),
            day: None,
        })
    };
    let of = |station| {
        Station::measured(station).iter().filter_map(move |reading| observation(station, reading))
    };
    stations.iter().flat_map(of).collect()
}

/// Adds the settling errors and the poses visited, found from the commands, to observations.
pub fn add_commands(observations: &mut [Observation], stations: &[Station], commanded: &Commanded) {
    let of_stations = commanded.settling_errors.iter().zip(&commanded.visits);
    let of_stations = stations.iter().zip(of_stations).map(|(station, (settling_error, &pose))| {
        (station.number, (settling_error.as_ref(), stations[pose].number))
    });
    let by_number: BTreeMap<usize, (Option<&SettlingError>, usize)> = of_stations.collect();
    for observation in observations {
        let Some((settling_error, pose)) = by_number.get(&observation.station) else { continue };
        observation.settling_error = settling_error.cloned();
        observation.pose = *pose;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn covariance_is_ranging_along_the_beam_and_transverse_across() {
        let leica = TrackerUncertainty {
            range_um: 10.0,
            range_um_per_m: 0.3,
            transverse_um: 15.0,
            transverse_um_per_m: 6.0,
            divisor: 2.0,
            orientation_rad: None,
        };
        // 10 m along x: ranging (10 + 3)/2 µm, transverse (15 + 60)/2 µm.
        let covariance = leica.covariance(&Point3::new(10_000.0, 0.0, 0.0));
        assert!((covariance[(0, 0)].sqrt() - 0.0065).abs() < 1e-12);
        assert!((covariance[(1, 1)].sqrt() - 0.0375).abs() < 1e-12);
        assert!(covariance[(0, 1)].abs() < 1e-18);
    }
}
