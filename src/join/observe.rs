//! Observation: a recording → checked columns and the dwells that either log shows.

use nalgebra::Vector3;

use super::dwell::{ArmDwell, TargetDwell, arm_dwells, target_dwells};
use super::pattern::{Dwells, MIN_PAIRS};
use super::rest::{Rest, at_rest};
use super::{JoinError, JoinSettings};
use crate::ingest::{JointSamples, Recording, TargetReadings};
use crate::kinematics::Arm;
use crate::units::{NS_PER_S, Stamp};

/// What the two logs show, each in its own clock.
#[derive(Debug, Clone)]
pub struct Observation {
    /// Indices of the readings that are measurements.
    pub measured: Vec<usize>,
    /// When they were taken, s after the first of them.
    pub times_s: Vec<f64>,
    /// Their positions, mm.
    pub positions: Vec<Vector3<f64>>,
    /// The usual sample intervals of the two logs, s.
    pub sampling_s: [f64; 2],
    /// Joint motion within the window of rest, rad.
    pub still_rad: f64,
    /// Target motion within it, mm.
    pub still_mm: f64,
    /// Dwells of the arm.
    pub arm: Vec<ArmDwell>,
    /// Dwells of the target, in indices of `measured`.
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
    Ok(at_rest(&stamps_ns, &joints.angles, &settings.arm_rule()))
}

/// Checks the recording but for its joints, whose rest is known, and finds the dwells of both logs.
pub fn observe(
    recording: &Recording,
    arm_rest: &Rest,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Observation, JoinError> {
    check_others(recording)?;
    let readings = &recording.readings;
    check_readings(readings)?;
    let measured = measured(readings);
    enough("controller", arm_rest, ("rad", "still_rad"), settings)?;
    let dwells = arm_dwells(arm_rest, arm);
    let (target_rest, target) = find_target_dwells(readings, &measured, settings)?;
    let first = readings.stamps[measured[0]];
    Ok(Observation {
        times_s: measured
            .iter()
            .map(|&i| readings.stamps[i].since_s(first))
            .collect(),
        positions: measured
            .iter()
            .map(|&i| Vector3::from(readings.positions[i]))
            .collect(),
        measured,
        sampling_s: [arm_rest, &target_rest].map(|rest| rest.interval_ns as f64 / NS_PER_S),
        still_rad: arm_rest.threshold,
        still_mm: target_rest.threshold,
        arm: dwells,
        target,
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

/// Every column of the readings as long as their stamps.
fn check_readings(readings: &TargetReadings) -> Result<(), JoinError> {
    let mut columns = vec![("position", readings.positions.len())];
    columns.extend(
        readings
            .orientations
            .as_ref()
            .map(|column| ("orientation", column.len())),
    );
    columns.extend(
        readings
            .covariances
            .as_ref()
            .map(|column| ("covariance", column.len())),
    );
    check_rows("readings", &readings.stamps, &columns)
}

fn check_joints(joints: &JointSamples, arm: &Arm) -> Result<(), JoinError> {
    if joints.angles.len() != arm.joints().len() {
        return Err(JoinError::JointCount {
            model: arm.model().to_owned(),
            found: joints.angles.len(),
            expected: arm.joints().len(),
        });
    }
    for (column, joint) in joints.angles.iter().zip(arm.joints()) {
        check_rows("joints", &joints.stamps, &[("angle", column.len())])?;
        if let Some(sample) = column.iter().position(|angle| !angle.is_finite()) {
            return Err(JoinError::AngleNotFinite {
                joint: joint.name.clone(),
                sample,
            });
        }
    }
    Ok(())
}

fn check_others(recording: &Recording) -> Result<(), JoinError> {
    let commands = &recording.commands;
    let mut columns = vec![("position", commands.positions.len())];
    columns.extend(
        commands
            .orientations
            .as_ref()
            .map(|column| ("orientation", column.len())),
    );
    check_rows("commands", &commands.stamps, &columns)?;
    let celsius = recording.temperatures.celsius.len();
    check_rows(
        "temperatures",
        &recording.temperatures.stamps,
        &[("celsius", celsius)],
    )
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

/// No tracker reaches this far, mm; numbers beyond it (or none) would only overflow the fits.
const FARTHEST_MM: f64 = 1e9;

/// Indices of the readings that are measurements: within reach, and not the exact zeros of a missing reflector.
fn measured(readings: &TargetReadings) -> Vec<usize> {
    let is_measurement = |position: &[f64; 3]| {
        position.iter().all(|x| x.abs() < FARTHEST_MM) && position.iter().any(|&x| x != 0.0)
    };
    (0..readings.positions.len())
        .filter(|&index| is_measurement(&readings.positions[index]))
        .collect()
}

fn find_target_dwells(
    readings: &TargetReadings,
    measured: &[usize],
    settings: &JoinSettings,
) -> Result<(Rest, Vec<TargetDwell>), JoinError> {
    let stamps_ns: Vec<i64> = measured.iter().map(|&i| readings.stamps[i].ns()).collect();
    let axis = |axis: usize| {
        measured
            .iter()
            .map(|&i| readings.positions[i][axis])
            .collect()
    };
    let axes: [Vec<f64>; 3] = std::array::from_fn(axis);
    let found = at_rest(&stamps_ns, &axes, &settings.target_rule());
    enough("tracker", &found, ("mm", "still_mm"), settings)?;
    let dwells = target_dwells(&axes, &found);
    Ok((found, dwells))
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
