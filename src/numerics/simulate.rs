//! Simulate: a synthetic session with known truth, against which every number of the pipeline can be checked.
//!
//! Inputs: a nominal arm and [`SimulateSettings`]. Output: the recording that ingest would read from the session's logs,
//! and the [`Truth`] behind it. Pure: the seed is a setting, nothing is read or written.
//!
//! 1. Draw the errors of the true arm ([`ArmErrors`]).
//! 2. Command the measured target to poses; the controller computes joint angles with the nominal arm.
//! 3. Move (minimum jerk) and dwell; the controller stops with a settling error and reports its encoder angles.
//! 4. Measure the target with a tracker that has its own clock, noise across and along the beam, lost beams and outliers.

pub mod settings;
pub mod truth;

mod curve;
mod identified;
mod instrument;
mod lengths;
mod poses;
mod random;
mod stations;
mod timeline;
mod tracker;
mod true_arm;
mod visits;

use nalgebra::Vector3;
use thiserror::Error;

use crate::ingest::{CommandSamples, JointAngles, JointSamples, Recording};
use crate::kinematics::{Arm, InverseError, Joint};
use crate::units::{Controller, Stamp};

pub use curve::{GearLine, JointCurve};
pub use identified::{ApproachOffset, AxisError, AxisErrors};
pub use lengths::{LengthInstrument, LengthTruth};
pub use poses::Commanded;
pub use random::{Ingredient, Stream};
pub use settings::{Poses, SimulateSettings};
pub use true_arm::ArmErrors;
pub use truth::{TrueStation, Truth};
pub use visits::{Visit, visits};

use timeline::Timeline;

/// Resolution of logged angles, rad: encoders are no finer, and rounding gives logs the same bytes on all machines.
const ANGLE_RESOLUTION: f64 = 1e-7;
const POSITION_RESOLUTION_MM: f64 = 1e-4;
/// Resolution of logged lengths, mm: about that of the messages at two metres.
const LENGTH_RESOLUTION_MM: f64 = 1e-4;
const QUATERNION_RESOLUTION: f64 = 1e-9;
/// Resolution of logged temperatures, °C.
const TEMPERATURE_RESOLUTION: f64 = 1e-2;

/// Significant digits of true values and of stated covariances; further digits may differ between machines.
const DIGITS: usize = 10;

/// The most samples of one kind: three weeks at 20 Hz, which fit into memory.
const MOST_SAMPLES: u32 = 40_000_000;

#[derive(Debug, Clone)]
pub struct Simulated {
    pub recording: Recording,
    pub truth: Truth,
}

/// A setting of a simulation that is wrong, or poses that cannot be reached.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SimulateError {
    #[error("{what}: {found} angles, but the arm has {joints} joints; give one for each joint")]
    Length { what: &'static str, joints: usize, found: usize },
    #[error("{name} = {found}: it has to be {wanted}")]
    Setting { name: &'static str, found: f64, wanted: &'static str },
    #[error(
        "the box from {lower:?} to {upper:?} mm has no node at a step of {step} mm; \
         the lower corner comes first, and the step is positive"
    )]
    EmptyBox { lower: [f64; 3], upper: [f64; 3], step: f64 },
    #[error(
        "{asked} poses; a session has at most {most}: widen the step, shrink the box or lower the count"
    )]
    TooManyPoses { asked: f64, most: usize },
    #[error(
        "{asked:.0} samples of {what}; a session has at most {most}: lower the rate, the dwell or the number of poses"
    )]
    TooManySamples { what: &'static str, asked: f64, most: u32 },
    #[error(
        "grid node {node:?} mm: {source}; move or shrink the box, turn the tool, or start from another home"
    )]
    Node { node: [f64; 3], source: InverseError },
    #[error(
        "random pose {number} was redrawn {redraws} times and never reached, last because: {source}; \
         move or shrink the box or the cone, or start from another home"
    )]
    Unreachable { number: usize, redraws: usize, source: InverseError },
}

/// One synthetic session of `arm`, with its truth.
pub fn simulate(arm: &Arm, settings: &SimulateSettings) -> Result<Simulated, SimulateError> {
    check(arm, settings)?;
    let errors = ArmErrors::draw(arm, settings);
    let commanded = poses::commanded(arm, settings)?;
    let settings = &instrument::placed(settings, &commanded);
    let timeline = Timeline::plan(arm, settings, &errors, &commanded);
    check_samples(settings, timeline.end_s())?;
    let view = tracker::View::new(arm, settings, &errors, &timeline);
    let (readings, counts) = view.readings();
    let recording = Recording {
        joints: joint_samples(arm, settings, &timeline),
        commands: command_samples(settings, &timeline),
        readings,
        temperatures: view.temperatures(),
    };
    let truth = Truth::of(arm, settings, &errors, &view, counts);
    Ok(Simulated { recording, truth })
}

fn joint_samples(arm: &Arm, settings: &SimulateSettings, timeline: &Timeline) -> JointSamples {
    let stamps = samples(settings.motion.joint_rate_hz, timeline.end_s());
    let mut angles = JointAngles::of(settings.home.len());
    for &t in &stamps {
        let reported = timeline.state(t).reported;
        let angle =
            |(angle, joint): (f64, &Joint)| rounded(angle, ANGLE_RESOLUTION * joint.per_radian());
        angles.push(reported.into_iter().zip(arm.joints()).map(angle));
    }
    JointSamples { stamps: stamps.iter().map(|&t| stamp(settings, t)).collect(), angles }
}

fn command_samples(settings: &SimulateSettings, timeline: &Timeline) -> CommandSamples {
    let stops = &timeline.stops;
    let pose = |stop: &timeline::Stop| stop.base_from_target;
    CommandSamples {
        stamps: stops.iter().map(|stop| stamp(settings, stop.start_s)).collect(),
        positions: stops
            .iter()
            .map(|stop| tracker::logged_position(&pose(stop).translation.vector))
            .collect(),
        orientations: Some(
            stops.iter().map(|stop| tracker::logged_quaternion(&pose(stop).rotation)).collect(),
        ),
        covariances: None,
    }
}

fn samples(rate_hz: f64, end_s: f64) -> Vec<f64> {
    let times = (0_usize..).map(|place| place as f64 / rate_hz);
    times.take_while(|time| *time <= end_s).collect()
}

fn stamp(settings: &SimulateSettings, t_s: f64) -> Stamp<Controller> {
    Stamp::from_ns(settings.clocks.origin_ns).plus_ns(timeline::ns(t_s))
}

/// `value` rounded to the nearest multiple of `resolution`, a power of ten.
fn rounded(value: f64, resolution: f64) -> f64 {
    // Dividing by the whole number 1/resolution gives the double nearest to the decimal, and no −0.
    let per_unit = (1.0 / resolution).round();
    (value * per_unit).round() / per_unit + 0.0
}

/// `value` to [`DIGITS`] significant digits.
fn short(value: f64) -> f64 {
    format!("{value:.*e}", DIGITS - 1).parse().expect("a formatted number is a number")
}

/// An axis that is far from a direction of length 1: z, or x of one that is near z.
fn far_axis(direction: &Vector3<f64>) -> Vector3<f64> {
    if direction.z.abs() < 0.9 { Vector3::z() } else { Vector3::x() }
}

fn check_samples(settings: &SimulateSettings, end_s: f64) -> Result<(), SimulateError> {
    let rates = [
        ("joints", settings.motion.joint_rate_hz),
        ("the tracker", settings.motion.reading_rate_hz),
    ];
    match rates
        .into_iter()
        .map(|(what, rate_hz)| (what, rate_hz * end_s))
        .find(|(_, asked)| *asked > f64::from(MOST_SAMPLES))
    {
        Some((what, asked)) => {
            Err(SimulateError::TooManySamples { what, asked, most: MOST_SAMPLES })
        }
        None => Ok(()),
    }
}

fn check_length(what: &'static str, joints: usize, found: usize) -> Result<(), SimulateError> {
    if joints == found { Ok(()) } else { Err(SimulateError::Length { what, joints, found }) }
}

fn check(arm: &Arm, settings: &SimulateSettings) -> Result<(), SimulateError> {
    check_length("home", arm.joints().len(), settings.home.len())?;
    let motion = &settings.motion;
    let rates =
        [("joint_rate_hz", motion.joint_rate_hz), ("reading_rate_hz", motion.reading_rate_hz)];
    let positive = [
        ("move_s", motion.move_s),
        ("speed_rad_s", motion.speed_rad_s),
        ("dwell_s", motion.dwell_s),
        ("divisor", settings.tracker.divisor),
    ];
    let shares = [
        ("lost_share", settings.tracker.lost_share),
        ("outlier_share", settings.tracker.outlier_share),
    ];
    within(&rates, 0.01, 10_000.0, "between 0.01 and 10000 Hz")?;
    within(&positive, 1e-3, 1e6, "between 0.001 and a million")?;
    within(&shares, 0.0, 1.0, "between 0 and 1")?;
    check_instrument(settings)?;
    let scale = [("scale", settings.tracker.scale)];
    within(&scale, -0.1, 0.1, "between -0.1 and 0.1")?;
    within(&[("dwell_spread_s", motion.dwell_spread_s)], 0.0, 1e6, "between 0 and a million")?;
    // Times stay far from the ends of 64 bits.
    let clocks = [
        ("offset_s", settings.clocks.offset_s),
        ("origin_ns", settings.clocks.origin_ns as f64 / 1e9),
    ];
    within(&clocks, -4e9, 4e9, "within 4000000000 s of 1970 or of each other")?;
    within(&[("drift_ppm", settings.clocks.drift_ppm)], -1e5, 1e5, "between -100000 and 100000")
}

fn check_instrument(settings: &SimulateSettings) -> Result<(), SimulateError> {
    const MOST: &str = "between 0.000001 and a million";
    let positive = |named: &[(&'static str, f64)]| within(named, 1e-6, 1e6, MOST);
    positive(&[("understated", settings.understated)])?;
    match &settings.instrument {
        settings::Instrument::Tracker => Ok(()),
        settings::Instrument::Scanner(own) => positive(&[
            ("along_mm", own.along_mm),
            ("across_mm", own.across_mm),
            ("distance_mm", own.distance_mm),
        ]),
        settings::Instrument::Camera(own) => {
            positive(&[
                ("focal_px", own.focal_px),
                ("noise_px", own.noise_px),
                ("target_mm", own.target_mm),
                ("distance_mm", own.distance_mm),
            ])?;
            within(&[("corners", own.corners.into())], 2.0, 100.0, "between 2 and 100")?;
            within(&[("flipped_share", own.flipped_share)], 0.0, 1.0, "between 0 and 1")
        }
    }
}

fn within(
    settings: &[(&'static str, f64)],
    lower: f64,
    upper: f64,
    wanted: &'static str,
) -> Result<(), SimulateError> {
    match settings.iter().find(|(_, value)| !(lower..=upper).contains(value)) {
        Some(&(name, found)) => Err(SimulateError::Setting { name, found, wanted }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
