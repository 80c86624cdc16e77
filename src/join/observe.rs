//! Observation: a recording → checked columns and the dwells that either log shows.

use super::dwell::{ArmDwell, TargetDwell, arm_dwells, target_dwells};
use super::pattern::{Dwells, MIN_PAIRS};
use super::rest::{Rest, at_rest};
use super::sighting::Sightings;
use super::{JoinError, JoinSettings};
use crate::ingest::{JointSamples, PoseSamples, TemperatureSamples};
use crate::kinematics::Arm;
use crate::units::{NS_PER_S, Stamp, Tracker};

/// What the two logs show, each in its own clock.
#[derive(Debug, Clone)]
pub struct Observation {
    /// When the first reading that is a measurement was taken.
    pub first_measured: Stamp<Tracker>,
    /// The usual sample intervals of the two logs, s.
    pub sampling_s: [f64; 2],
    /// Joint motion within the window of rest, rad.
    pub still_rad: f64,
    /// Target motion within it, mm.
    pub still_mm: f64,
    /// Dwells of the arm.
    pub arm: Vec<ArmDwell>,
    /// Dwells of the target.
    pub target: Vec<TargetDwell>,
}

/// The rest of the recording's joints, once its columns are checked.
pub fn joints_at_rest(
    joints: &JointSamples,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Rest, JoinError> {
    check_joints(joints, arm)?;
    let stamps_ns: Vec<i64> = joints.stamps.iter().map(|stamp| stamp.ns()).collect();
    let angles = &joints.angles;
    Ok(at_rest(
        &stamps_ns,
        angles.all(),
        angles.joints(),
        &settings.arm_rule(),
    ))
}

/// Finds the dwells of both logs, where it is known where the joints rest.
pub fn observe(
    sightings: &Sightings<'_>,
    arm_rest: &Rest,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Observation, JoinError> {
    enough("controller", arm_rest, ("rad", "still_rad"), settings)?;
    let arm_dwells = arm_dwells(arm_rest, arm);
    let target_rest = sightings.rest();
    enough("tracker", target_rest, ("mm", "still_mm"), settings)?;
    Ok(Observation {
        first_measured: Stamp::from_ns(target_rest.span_ns.0),
        sampling_s: [arm_rest, target_rest].map(|rest| rest.interval_ns as f64 / NS_PER_S),
        still_rad: arm_rest.threshold,
        still_mm: target_rest.threshold,
        arm: arm_dwells,
        target: target_dwells(sightings)?,
    })
}

impl Observation {
    /// The two logs' dwells side by side.
    pub fn dwells(&self) -> Dwells<'_> {
        Dwells {
            arm: &self.arm,
            target: &self.target,
        }
    }

    /// The usual standard deviation of a reading at rest per axis, mm.
    pub fn usual_scatter_mm(&self) -> [f64; 3] {
        let all = |axis: usize| {
            self.target
                .iter()
                .map(|dwell| dwell.scatter_mm[axis])
                .collect()
        };
        std::array::from_fn(|axis| {
            let mut scatters: Vec<f64> = all(axis);
            super::dwell::median(&mut scatters)
        })
    }
}

/// Every column of poses as long as their stamps, which do not decrease.
pub fn check_poses<C>(table: &'static str, poses: &PoseSamples<C>) -> Result<(), JoinError> {
    let orientations = poses.orientations.as_ref().map(Vec::len);
    let covariances = poses.covariances.as_ref().map(Vec::len);
    let mut columns = vec![("position", poses.positions.len())];
    columns.extend(orientations.map(|rows| ("orientation", rows)));
    columns.extend(covariances.map(|rows| ("covariance", rows)));
    check_rows(table, &poses.stamps, &columns)
}

fn check_joints(joints: &JointSamples, arm: &Arm) -> Result<(), JoinError> {
    let angles = &joints.angles;
    if angles.joints() != arm.joints().len() {
        return Err(JoinError::JointCount {
            model: arm.model().to_owned(),
            found: angles.joints(),
            expected: arm.joints().len(),
        });
    }
    check_rows("joints", &joints.stamps, &[("angle", angles.len())])?;
    for (sample, row) in angles.rows().enumerate() {
        if let Some(joint) = row.iter().position(|angle| !angle.is_finite()) {
            return Err(JoinError::AngleNotFinite {
                joint: arm.joints()[joint].name.clone(),
                sample,
            });
        }
    }
    Ok(())
}

/// The same of temperatures.
pub fn check_temperatures(temperatures: &TemperatureSamples) -> Result<(), JoinError> {
    let columns = [("celsius", temperatures.celsius.len())];
    check_rows("temperatures", &temperatures.stamps, &columns)
}

fn check_rows<C>(
    table: &'static str,
    stamps: &[Stamp<C>],
    columns: &[(&'static str, usize)],
) -> Result<(), JoinError> {
    let unordered = stamps.windows(2).position(|pair| pair[1] < pair[0]);
    for &(column, found) in columns {
        if found != stamps.len() || unordered.is_some() {
            return Err(JoinError::Columns {
                table,
                column,
                found,
                expected: stamps.len(),
                row: unordered.map_or(found.min(stamps.len()), |row| row + 1),
            });
        }
    }
    Ok(())
}

fn enough(
    side: &'static str,
    found: &Rest,
    (unit, key): (&'static str, &'static str),
    settings: &JoinSettings,
) -> Result<(), JoinError> {
    if found.stretches.len() >= MIN_PAIRS {
        return Ok(());
    }
    let (first_ns, last_ns) = found.span_ns;
    Err(JoinError::TooFewDwells {
        side,
        found: found.stretches.len(),
        needed: MIN_PAIRS,
        samples: found.samples,
        span_s: last_ns.saturating_sub(first_ns) as f64 / NS_PER_S,
        threshold: found.threshold,
        unit,
        window_s: settings.window_s,
        key,
    })
}
