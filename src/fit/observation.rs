//! Paired stations → observations: what was measured, and how well.
//!
//! The covariance of a measured position is the tracker's (ranging along the beam, transverse across it,
//! [`crate::method::uncertainty`]), plus the arm's repeatability, plus what the scatter of the readings leaves in their
//! mean: `scatter²/n`.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::commanded::{Commanded, SettlingError};
use crate::join::{Attained, Pairing, Station};
use crate::kinematics::Arm;
use crate::units::MM_PER_M;

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
    /// What a limit is divided by for a standard uncertainty: 2 for k = 2, √3 for a rectangular limit.
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
        let beam = position
            .coords
            .try_normalize(0.0)
            .unwrap_or_else(Vector3::x);
        let along = beam * beam.transpose();
        along * ranging.powi(2) + (Matrix3::identity() - along) * transverse.powi(2)
    }
}

/// What a fit needs of one paired station.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Which of the fit's sessions, from 0.
    pub session: usize,
    /// The station's number in its session.
    pub station: usize,
    /// The number of the station that its pose is named by: visits of one pose have one.
    pub pose: usize,
    /// Axis variables of the chain (the joint map applied), rad.
    pub axes: Vec<f64>,
    /// Measured target position in the tracker frame, mm.
    pub position: Point3<f64>,
    /// Covariance of the measured position without the arm's share: tracker and scatter of the mean, mm².
    pub instrument: Matrix3<f64>,
    /// Lower triangle L of the position's whole covariance `L Lᵀ`, repeatability included, mm.
    pub position_factor: Matrix3<f64>,
    /// Measured target orientation in the tracker frame with its standard uncertainty per axis, rad.
    pub orientation: Option<(UnitQuaternion<f64>, f64)>,
    /// What the station fell short of its command, where the log has commanded poses.
    pub settling_error: Option<SettlingError>,
}

impl Observation {
    /// A station that is still to be measured, with the instrument's covariance there (mm²).
    pub fn planned(axes: Vec<f64>, position: Point3<f64>, instrument: Matrix3<f64>) -> Self {
        Self {
            session: 0,
            station: 0,
            pose: 0,
            axes,
            position,
            instrument,
            position_factor: Matrix3::identity(),
            orientation: None,
            settling_error: None,
        }
    }
}

/// What is known of the measurement besides the readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// The tracker's.
    pub tracker: TrackerUncertainty,
    /// The arm's repeatability per axis as a standard deviation, mm.
    pub repeatability_mm: f64,
    /// Whether orientations are taken into the fit where the log has them.
    pub orientations: bool,
}

/// The paired stations of one session as observations, in station order.
pub fn observations(
    session: usize,
    stations: &[Station],
    arm: &Arm,
    noise: &Noise,
) -> Vec<Observation> {
    stations
        .iter()
        .filter(|station| station.pairing == Pairing::Paired)
        .filter_map(|station| Some((station, station.attained.as_ref()?)))
        .map(|(station, attained)| Observation {
            session,
            station: station.number,
            pose: station.number,
            axes: arm.axes(&station.joints),
            position: attained.position,
            instrument: instrument(attained, noise),
            position_factor: position_factor(attained, noise),
            orientation: orientation(attained, noise),
            settling_error: None,
        })
        .collect()
}

/// Gives observations what their stations' commands say: what they fell short of, and which pose they visit.
pub fn add_commands(observations: &mut [Observation], stations: &[Station], commanded: &Commanded) {
    let of_stations = commanded.settling_errors.iter().zip(&commanded.visits);
    let by_number: BTreeMap<usize, (Option<&SettlingError>, usize)> = stations
        .iter()
        .zip(of_stations)
        .map(|(station, (settling_error, &pose))| {
            (
                station.number,
                (settling_error.as_ref(), stations[pose].number),
            )
        })
        .collect();
    for observation in observations {
        let Some((settling_error, pose)) = by_number.get(&observation.station) else {
            continue;
        };
        observation.settling_error = settling_error.cloned();
        observation.pose = *pose;
    }
}

fn instrument(attained: &Attained, noise: &Noise) -> Matrix3<f64> {
    let mut covariance = attained.stated_covariance.map_or_else(
        || noise.tracker.covariance(&attained.position),
        |[xx, xy, xz, yy, yz, zz]| Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    );
    for axis in 0..3 {
        covariance[(axis, axis)] += attained.scatter_mm[axis].powi(2) / attained.kept.max(1) as f64;
    }
    covariance
}

fn position_factor(attained: &Attained, noise: &Noise) -> Matrix3<f64> {
    let covariance =
        instrument(attained, noise) + Matrix3::identity() * noise.repeatability_mm.powi(2);
    let isotropic = || Matrix3::identity() * noise.repeatability_mm.max(1e-3);
    covariance
        .cholesky()
        .map_or_else(isotropic, |factor| factor.l())
}

fn orientation(attained: &Attained, noise: &Noise) -> Option<(UnitQuaternion<f64>, f64)> {
    let instrument = noise
        .tracker
        .orientation_rad
        .filter(|_| noise.orientations)?;
    let of_mean =
        attained.orientation_scatter_rad.unwrap_or(0.0).powi(2) / attained.kept.max(1) as f64;
    Some((
        attained.orientation?,
        instrument.mul_add(instrument, of_mean).sqrt(),
    ))
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
