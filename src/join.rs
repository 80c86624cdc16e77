//! Join: two logs with a clock each → stations, each a dwell of the arm with what the tracker saw of it.
//!
//! Input is a [`Recording`] and the nominal [`Arm`]; output is [`Joined`]. METHOD.md 8.
//!
//! 1. [`rest`], [`dwell`]: dwells of the arm on its joints, dwells of the target on its positions.
//! 2. [`pattern`]: the clock relations under which the two patterns of moves agree.
//! 3. [`decide`]: the one under which the nominal arm ([`placement`]) can have been where the target was seen.
//! 4. [`clock`]: offset and drift on the matched edges.
//! 5. [`pair`], [`average`]: a verdict for each dwell, means after settling; [`fate`]: one for each reading.
//! 6. [`command`]: the commanded pose in force during each dwell.

pub mod average;
pub mod clock;
pub mod command;
pub mod decide;
pub mod dwell;
pub mod fate;
pub mod pair;
pub mod pattern;
pub mod placement;
pub mod rest;
mod settings;

use nalgebra::{Point3, UnitQuaternion};
use thiserror::Error;

use self::decide::Decision;
use self::dwell::{ArmDwell, TargetDwell};
use self::fate::{Fate, Why};
use self::pattern::Dwells;
use self::placement::{Placement, Sighting};
use crate::ingest::{Recording, TargetReadings};
use crate::kinematics::Arm;
use crate::units::{ClockModel, Controller, NS_PER_S, Stamp, Tracker};

pub use settings::JoinSettings;

/// The session's stations, its clocks, and everything that did not become part of a station.
#[derive(Debug, Clone)]
pub struct Joined {
    /// Every dwell of the controller, in time order.
    pub stations: Vec<Station>,
    /// How the clocks relate.
    pub clock: ClockEstimate,
    /// Tracker dwells and readings left out, with reasons.
    pub rejects: Vec<JoinReject>,
    /// Readings by verdict; the sum is the number of readings.
    pub counts: ReadingCounts,
}

/// One dwell of the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Station {
    /// Number within the session, from 0, in controller time.
    pub number: usize,
    /// First moment at rest.
    pub start: Stamp<Controller>,
    /// Last moment at rest.
    pub end: Stamp<Controller>,
    /// Mean joint angles, rad.
    pub joints: Vec<f64>,
    /// Joint samples the mean is of.
    pub joint_samples: usize,
    /// The command in force during the dwell.
    pub command: Option<Command>,
    /// What the tracker saw, unless the dwell is unmeasured.
    pub attained: Option<Attained>,
    /// The verdict.
    pub pairing: Pairing,
}

/// A commanded pose of the controller's own tool point, in the frame the controller states commands in.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// mm.
    pub position: Point3<f64>,
    /// Where the message has one.
    pub orientation: Option<UnitQuaternion<f64>>,
}

/// The mean of a dwell's readings, in the tracker frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Attained {
    /// Mean position, mm.
    pub position: Point3<f64>,
    /// Mean orientation on SO(3), where the target is a 6-DoF one.
    pub orientation: Option<UnitQuaternion<f64>>,
    /// Standard deviation of a single reading per tracker axis, mm (n − 1).
    pub scatter_mm: [f64; 3],
    /// Standard deviation of a single orientation reading (rotation vector norm per axis, root mean square), rad.
    pub orientation_scatter_rad: Option<f64>,
    /// Mean of the tracker's own stated position covariance (xx xy xz yy yz zz, mm²), where it states one.
    pub stated_covariance: Option<[f64; 6]>,
    /// Readings kept in the mean.
    pub kept: usize,
    /// Readings that fell into the dwell, settling and outliers included.
    pub readings: usize,
    /// First and last kept reading.
    pub first: Stamp<Tracker>,
    /// Last kept reading.
    pub last: Stamp<Tracker>,
    /// Temperature nearest in time, °C.
    pub temperature_c: Option<f64>,
}

/// What became of a dwell of the arm.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pairing {
    /// It has readings of its own.
    Paired,
    /// No usable readings: why.
    Unmeasured(Unmeasured),
    /// More than one tracker dwell could belong to it, and geometry did not decide.
    Ambiguous,
}

/// Why a dwell has no measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unmeasured {
    /// No reading at all falls into it.
    NoReadings,
    /// Readings fall into it, but too few are left after settling and outlier rejection.
    TooFewReadings,
    /// The target moved while the arm stood still.
    TargetMoved,
    /// The dwell lies outside the tracker's log.
    OutsideTrackerLog,
    /// Its reading is far from where the arm can have been: a wrong reflector or a lost beam.
    WrongTarget,
}

/// The clocks and how they were found.
#[derive(Debug, Clone, PartialEq)]
pub struct ClockEstimate {
    /// The relation.
    pub model: ClockModel,
    /// Standard error of the offset at t₀, ns.
    pub offset_se_ns: f64,
    /// Standard error of the drift.
    pub drift_se: f64,
    /// Dwell edges that the refinement matched.
    pub matched_edges: usize,
    /// Root mean square of the edges' residuals, ns.
    pub edge_rms_ns: f64,
    /// How it was found, in words: which shifts were tried and what decided.
    pub method: String,
}

/// Readings by verdict.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReadingCounts {
    /// Part of a station's mean.
    pub kept: u64,
    /// Before the settling time was over.
    pub settling: u64,
    /// An outlier of its dwell.
    pub outlier: u64,
    /// Taken while the arm moved.
    pub moving: u64,
    /// At rest, but no station took them.
    pub unpaired: u64,
    /// No measurement at all: the zeros some instruments write.
    pub missing: u64,
}

/// A tracker dwell or a run of readings that no station took.
#[derive(Debug, Clone, PartialEq)]
pub struct JoinReject {
    /// First reading.
    pub start: Stamp<Tracker>,
    /// Last reading.
    pub end: Stamp<Tracker>,
    /// How many readings.
    pub readings: u64,
    /// Why, in words.
    pub reason: String,
}

/// Why two logs cannot be joined.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum JoinError {
    /// A setting that makes no sense.
    #[error("[join] {key} = {found}, but it has to be {wanted}")]
    Setting {
        /// Its name in the pipeline file.
        key: &'static str,
        /// What was found.
        found: String,
        /// What would do.
        wanted: &'static str,
    },
    /// The recording's joints are not the arm's.
    #[error(
        "the recording has {found} joint columns, but the arm {model:?} has {expected} joints: check [robot]"
    )]
    JointCount {
        /// The arm.
        model: String,
        /// Columns found.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// Columns of one table that differ in length, or stamps that decrease.
    #[error(
        "{table}: column {column:?} has {found} values for {expected} stamps, or the stamps decrease at row {row}"
    )]
    Columns {
        /// Which table.
        table: &'static str,
        /// Which column.
        column: &'static str,
        /// Values found.
        found: usize,
        /// Stamps found.
        expected: usize,
        /// First row out of order.
        row: usize,
    },
    /// A joint angle that is not a number.
    #[error(
        "joint {joint:?} is not a finite number at sample {sample}: leave such messages out at ingest"
    )]
    AngleNotFinite {
        /// The joint's name.
        joint: String,
        /// Which sample, from 0.
        sample: usize,
    },
    /// Too few dwells to match anything.
    #[error(
        "{side} log: {found} dwells in {samples} samples over {span_s:.1} s (rest: within {threshold} {unit} over \
         {window_s} s), but a join needs {needed}: check the topic and its unit, or set {key} in [join]"
    )]
    TooFewDwells {
        /// `controller` or `tracker`.
        side: &'static str,
        /// Dwells found.
        found: usize,
        /// Dwells needed.
        needed: usize,
        /// Samples looked at.
        samples: usize,
        /// First to last sample, s.
        span_s: f64,
        /// The rest threshold used.
        threshold: f64,
        /// Its unit.
        unit: &'static str,
        /// The window of rest, s.
        window_s: f64,
        /// The setting that would change it.
        key: &'static str,
    },
    /// No shift of the clocks explains the logs.
    #[error(
        "no clock offset makes the logs agree: of {arm_dwells} dwells of the arm and {target_dwells} of the target \
         the best shift leaves {pairs} pairs within {gate_mm} mm of the nominal arm (needed: {needed}{}). Do the logs \
         belong to one session, is it the right robot file, are positions in mm and angles in rad?",
        .median_mm.map_or(String::new(), |mm| format!("; median distance {mm:.1} mm"))
    )]
    NoCommonPattern {
        /// Dwells of the arm.
        arm_dwells: usize,
        /// Dwells of the target.
        target_dwells: usize,
        /// Pairs that fit at the best shift.
        pairs: usize,
        /// Pairs needed.
        needed: usize,
        /// Median distance of all pairs at the best shift.
        median_mm: Option<f64>,
        /// The geometry gate.
        gate_mm: f64,
    },
    /// Two shifts explain the logs equally well.
    #[error(
        "two clock offsets explain the logs equally well: {first_s:.3} s after the logs' starts ({first_pairs} pairs, \
         median {first_mm:.2} mm) and {second_s:.3} s ({second_pairs} pairs, {second_mm:.2} mm). Poses that repeat at \
         equal times cannot be told apart: add an irregular move, or log the whole session on both sides"
    )]
    AmbiguousShift {
        /// First offset, tracker's first stamp against controller's first stamp, s.
        first_s: f64,
        /// Its pairs.
        first_pairs: usize,
        /// Its median distance, mm.
        first_mm: f64,
        /// Second offset, s.
        second_s: f64,
        /// Its pairs.
        second_pairs: usize,
        /// Its median distance, mm.
        second_mm: f64,
    },
}

/// Joins the two logs of a session.
///
/// Every dwell of the arm becomes a station with a verdict, every reading gets a fate: `counts` sums to the number of
/// readings, and `rejects` names all that were not kept.
pub fn join(
    recording: &Recording,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Joined, JoinError> {
    settings.check()?;
    check_joints(recording, arm)?;
    let readings = &recording.readings;
    check_rows(
        "readings",
        &readings.stamps,
        &[("position", readings.positions.len())],
    )?;
    let measured = measured(readings);
    let (arm_rest, arm_dwells) = find_arm_dwells(recording, arm, settings)?;
    let (target_rest, target_dwells) = find_target_dwells(readings, &measured, settings)?;
    let dwells = Dwells {
        arm: &arm_dwells,
        target: &target_dwells,
    };
    let decision = decide::decide(dwells, settings.geometry_gate_mm)?;
    let sampling_s = [&arm_rest, &target_rest].map(|rest| rest.interval_ns as f64 / NS_PER_S);
    let (clock, placement) = settle_clock(dwells, &decision, sampling_s, recording, &measured);
    let evidence = pair::Evidence {
        recording,
        measured: &measured,
        target: &target_dwells,
        clock: clock.model,
        placement,
        gate_mm: settings
            .geometry_gate_mm
            .max(GATE_REACH * decision.median_mm),
        same_mm: SAME_REACH * target_rest.threshold,
        settings,
    };
    let mut fates = first_fates(readings.stamps.len(), &measured, &target_dwells);
    let stations = stations(recording, &arm_dwells, &evidence, &mut fates);
    Ok(Joined {
        stations,
        clock,
        rejects: fate::rejects(&fates, &readings.stamps),
        counts: fate::counts(&fates),
    })
}

/// An arm worse than the gate supposes still gets this many of its own median distances.
const GATE_REACH: f64 = 10.0;
/// Target dwells closer than this many rest thresholds are one place.
const SAME_REACH: f64 = 2.0;

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
    check_rows(
        "commands",
        &commands.stamps,
        &[("position", commands.positions.len())],
    )?;
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

/// Indices of the readings that are measurements: finite, and not the exact zeros of a missing reflector.
fn measured(readings: &TargetReadings) -> Vec<usize> {
    let is_measurement = |position: &[f64; 3]| {
        position.iter().all(|x| x.is_finite()) && position.iter().any(|&x| x != 0.0)
    };
    (0..readings.positions.len())
        .filter(|&index| is_measurement(&readings.positions[index]))
        .collect()
}

fn find_arm_dwells(
    recording: &Recording,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<(rest::Rest, Vec<ArmDwell>), JoinError> {
    let stamps_ns: Vec<i64> = recording
        .joints
        .stamps
        .iter()
        .map(|stamp| stamp.ns())
        .collect();
    let rule = settings.arm_rule();
    let found = rest::at_rest(&stamps_ns, &recording.joints.angles, &rule);
    enough(
        "controller",
        &stamps_ns,
        &found,
        ("rad", "still_rad"),
        settings,
    )?;
    let dwells = dwell::arm_dwells(&stamps_ns, &recording.joints.angles, &found, arm);
    Ok((found, dwells))
}

fn find_target_dwells(
    readings: &TargetReadings,
    measured: &[usize],
    settings: &JoinSettings,
) -> Result<(rest::Rest, Vec<TargetDwell>), JoinError> {
    let stamps_ns: Vec<i64> = measured.iter().map(|&i| readings.stamps[i].ns()).collect();
    let axis = |axis: usize| {
        measured
            .iter()
            .map(|&i| readings.positions[i][axis])
            .collect()
    };
    let axes: [Vec<f64>; 3] = std::array::from_fn(axis);
    let found = rest::at_rest(&stamps_ns, &axes, &settings.target_rule());
    enough("tracker", &stamps_ns, &found, ("mm", "still_mm"), settings)?;
    let dwells = dwell::target_dwells(&stamps_ns, &axes, &found);
    Ok((found, dwells))
}

fn enough(
    side: &'static str,
    stamps_ns: &[i64],
    found: &rest::Rest,
    (unit, key): (&'static str, &'static str),
    settings: &JoinSettings,
) -> Result<(), JoinError> {
    if found.stretches.len() >= pattern::MIN_PAIRS {
        return Ok(());
    }
    let first_ns = stamps_ns.first().copied().unwrap_or(0);
    let last_ns = stamps_ns.last().copied().unwrap_or(0);
    Err(JoinError::TooFewDwells {
        side,
        found: found.stretches.len(),
        needed: pattern::MIN_PAIRS,
        samples: stamps_ns.len(),
        span_s: last_ns.saturating_sub(first_ns) as f64 / NS_PER_S,
        threshold: found.threshold,
        unit,
        window_s: settings.window_s,
        key,
    })
}

/// Refines the clock on the supporting pairs, pairs again, and refits base and target.
fn settle_clock(
    dwells: Dwells,
    decision: &Decision,
    sampling_s: [f64; 2],
    recording: &Recording,
    measured: &[usize],
) -> (ClockEstimate, Placement) {
    let refined = clock::refine(dwells, &decision.support, sampling_s);
    let relation = refined.map_or(decision.relation, |refined| refined.relation);
    let origin = recording.joints.stamps[0];
    let first_reading = recording.readings.stamps[measured[0]];
    let apart_ns = first_reading.ns().saturating_sub(origin.ns());
    let sightings: Vec<Sighting> = decision
        .support
        .iter()
        .map(|&pair| decide::sighting(dwells, pair))
        .collect();
    let estimate = ClockEstimate {
        model: ClockModel {
            origin,
            offset_ns: relation.offset_s.mul_add(NS_PER_S, apart_ns as f64),
            drift: relation.drift,
        },
        offset_se_ns: refined.map_or(sampling_s[1], |r| r.offset_se_s) * NS_PER_S,
        drift_se: refined.map_or(0.0, |r| r.drift_se),
        matched_edges: refined.map_or(0, |r| r.matched),
        edge_rms_ns: refined.map_or(0.0, |r| r.rms_s) * NS_PER_S,
        method: method(decision, refined.is_some_and(|r| r.by_edges)),
    };
    (
        estimate,
        Placement::fit(&sightings).unwrap_or(decision.placement),
    )
}

fn method(decision: &Decision, by_edges: bool) -> String {
    format!(
        "{} shifts tried by the pattern of moves; geometry chose the one with {} pairs at a median of {:.2} mm from \
         the nominal arm (next best {} pairs); refined on {}",
        decision.tried,
        decision.support.len(),
        decision.median_mm,
        decision.rival_support,
        if by_edges {
            "the edges of dwells"
        } else {
            "the middles of dwells"
        },
    )
}

/// Before pairing: missing, moving, or at rest with no station yet.
fn first_fates(readings: usize, measured: &[usize], dwells: &[TargetDwell]) -> Vec<Fate> {
    let mut fates = vec![Fate::Missing; readings];
    for &index in measured {
        fates[index] = Fate::Moving;
    }
    for dwell in dwells {
        for &index in &measured[dwell.stretch.first..=dwell.stretch.last] {
            fates[index] = Fate::Unpaired(Why::NoArmDwell);
        }
    }
    fates
}

fn stations(
    recording: &Recording,
    dwells: &[ArmDwell],
    evidence: &pair::Evidence,
    fates: &mut [Fate],
) -> Vec<Station> {
    let stamps = &recording.joints.stamps;
    let occasion = |dwell: &ArmDwell| command::Occasion {
        start: stamps[dwell.stretch.first],
        end: stamps[dwell.stretch.last],
        flange: dwell.flange,
    };
    let occasions: Vec<_> = dwells.iter().map(occasion).collect();
    let commands = command::in_force(&recording.commands, &occasions);
    let station = |(number, (dwell, command)): (usize, (&ArmDwell, Option<Command>))| {
        let (pairing, attained) = evidence.verdict(dwell, fates);
        Station {
            number,
            start: occasions[number].start,
            end: occasions[number].end,
            joints: dwell.joints.clone(),
            joint_samples: dwell.stretch.last - dwell.stretch.first + 1,
            command,
            attained,
            pairing,
        }
    };
    dwells
        .iter()
        .zip(commands)
        .enumerate()
        .map(station)
        .collect()
}
