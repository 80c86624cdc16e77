//! Observation: a recording → checked columns and the dwells that either log shows.

use nalgebra::Vector3;

use super::dwell::{ArmDwell, TargetDwell, arm_dwells, target_dwells};
use super::pattern::{Dwells, MIN_PAIRS};
use super::rest::{Rest, at_rest};
use super::{JoinError, JoinSettings};
use crate::ingest::{Recording, TargetReadings};
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
    /// Rest of the joints (thresholds in rad).
    pub arm_rest: Rest,
    /// Rest of the target (thresholds in mm).
    pub target_rest: Rest,
    /// Dwells of the arm.
    pub arm: Vec<ArmDwell>,
    /// Dwells of the target, in indices of `measured`.
    pub target: Vec<TargetDwell>,
}

/// Checks the recording and finds the dwells of both logs.
pub fn observe(
    recording: &Recording,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Observation, JoinError> {
    check_joints(recording, arm)?;
    let readings = &recording.readings;
    check_readings(readings)?;
    let measured = measured(readings);
    let (arm_rest, arm) = find_arm_dwells(recording, arm, settings)?;
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
        arm_rest,
        target_rest,
        arm,
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

    /// The usual sample intervals of the two logs, s.
    pub fn sampling_s(&self) -> [f64; 2] {
        [&self.arm_rest, &self.target_rest].map(|rest| rest.interval_ns as f64 / NS_PER_S)
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

fn check_joints(recording: &Recording, arm: &Arm) -> Result<(), JoinError> {
    let joints = &recording.joints;
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

fn find_arm_dwells(
    recording: &Recording,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<(Rest, Vec<ArmDwell>), JoinError> {
    let stamps_ns: Vec<i64> = recording
        .joints
        .stamps
        .iter()
        .map(|stamp| stamp.ns())
        .collect();
    let rule = settings.arm_rule();
    let found = at_rest(&stamps_ns, &recording.joints.angles, &rule);
    enough(
        "controller",
        &stamps_ns,
        &found,
        ("rad", "still_rad"),
        settings,
    )?;
    let dwells = arm_dwells(&stamps_ns, &recording.joints.angles, &found, arm);
    Ok((found, dwells))
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
    enough("tracker", &stamps_ns, &found, ("mm", "still_mm"), settings)?;
    let dwells = target_dwells(&stamps_ns, &axes, &found);
    Ok((found, dwells))
}

fn enough(
    side: &'static str,
    stamps_ns: &[i64],
    found: &Rest,
    (unit, key): (&'static str, &'static str),
    settings: &JoinSettings,
) -> Result<(), JoinError> {
    if found.stretches.len() >= MIN_PAIRS {
        return Ok(());
    }
    let first_ns = stamps_ns.first().copied().unwrap_or(0);
    let last_ns = stamps_ns.last().copied().unwrap_or(0);
    Err(JoinError::TooFewDwells {
        side,
        found: found.stretches.len(),
        needed: MIN_PAIRS,
        samples: stamps_ns.len(),
        span_s: last_ns.saturating_sub(first_ns) as f64 / NS_PER_S,
        threshold: found.threshold,
        unit,
        window_s: settings.window_s,
        key,
    })
}
