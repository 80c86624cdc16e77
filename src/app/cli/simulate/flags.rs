use std::path::PathBuf;

use clap::Args;
use nalgebra::{Isometry3, Vector3};

use crate::geometry::{isometry_from_rpy, rpy};
use crate::kinematics::{Arm, Joint};
use crate::simulate::settings::{Cell, SimulateSettings, TrackerErrors};
use crate::simulate::{Poses, SimulateError};

/// Where to measure.
#[derive(Debug, Clone, Args)]
#[group(skip)]
#[command(next_help_heading = "Where to measure")]
pub(super) struct PoseFlags {
    /// Reported joint angles at the start, degrees (mm for a joint that slides): their arm configuration is the session's.
    #[arg(long, value_name = "Q1,Q2,…", value_parser = list, allow_hyphen_values = true)]
    home: List,
    /// Size of the box to measure in, mm.
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, default_value = "600,600,600")]
    size: [f64; 3],
    /// Centre of the box in the base frame, mm; where the target is at home when not given.
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    centre: Option<[f64; 3]>,
    /// Measure on a uniform grid of this step, mm, in the orientation that the target has at home (the default, at 100).
    #[arg(long, value_name = "MM", value_parser = finite, conflicts_with_all = ["random", "random_joints"])]
    grid_step: Option<f64>,
    /// Measure this many random poses in the box.
    #[arg(long, value_name = "N", conflicts_with = "random_joints")]
    random: Option<usize>,
    /// Random poses: largest rotation away from home's orientation, degrees.
    #[arg(long, value_name = "DEG", value_parser = finite, default_value_t = 30.0)]
    cone_deg: f64,
    /// Measure this many random joint configurations about home.
    #[arg(long, value_name = "N")]
    random_joints: Option<usize>,
    /// Measure the poses of a file of targets with joint angles, in its order: what `posegrid plan --out` writes, for one.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["grid_step", "random", "random_joints"])]
    pub(super) poses: Option<PathBuf>,
    /// Random joint configurations: how far each joint goes to either side of home, degrees.
    #[arg(long, value_name = "DEG", value_parser = finite, default_value_t = 40.0)]
    spread_deg: f64,
    /// Random joint configurations: how far a joint that slides goes to either side of home, mm.
    #[arg(long, value_name = "MM", value_parser = finite, default_value_t = 400.0)]
    spread_mm: f64,
}

impl PoseFlags {
    /// The joints at the start, rad or mm; [`SimulateError::Length`] unless there is one value for each joint.
    pub(super) fn home(&self, arm: &Arm) -> Result<Vec<f64>, SimulateError> {
        let joints = arm.joints();
        if self.home.0.len() != joints.len() {
            let (what, joints, found) = ("--home", joints.len(), self.home.0.len());
            return Err(SimulateError::Length { what, joints, found });
        }
        let values = joints.iter().zip(&self.home.0);
        Ok(values.map(|(joint, value)| joint.read(*value)).collect())
    }

    /// Travel of each joint to either side of home, rad or mm.
    fn spread(&self, arm: &Arm) -> Vec<f64> {
        let spread = |joint: &Joint| {
            if joint.slides { self.spread_mm } else { self.spread_deg.to_radians() }
        };
        arm.joints().iter().map(spread).collect()
    }

    /// Where to measure; `listed` are the joint angles of [`Self::poses`].
    pub(super) fn places(
        &self,
        arm: &Arm,
        cell: &Cell,
        listed: Option<&[Vec<f64>]>,
    ) -> Result<Poses, SimulateError> {
        if let Some(joints) = listed {
            return Ok(Poses::Listed { joints: joints.to_vec() });
        }
        let home = self.home(arm)?;
        if let Some(count) = self.random_joints {
            let spread = self.spread(arm);
            let about =
                |side: f64| home.iter().zip(&spread).map(|(q, own)| q + side * own).collect();
            let (lower, upper) = (about(-1.0), about(1.0));
            return Ok(Poses::Joints { count, lower, upper });
        }
        let flange_from_target =
            isometry_from_rpy(cell.flange_from_target_mm, cell.flange_from_target_rpy);
        Ok(self.boxed(&(arm.flange(&home).isometry() * flange_from_target)))
    }

    /// A grid or random poses in the box about where the target is at home.
    fn boxed(&self, at_home: &Isometry3<f64>) -> Poses {
        // Home gives whole millimetres, to keep the number short.
        let centre = self.centre.map_or(at_home.translation.vector.map(f64::round), Into::into);
        let half = Vector3::from(self.size) / 2.0;
        let (lower_mm, upper_mm) = ((centre - half).into(), (centre + half).into());
        let orientation_rpy = rpy(&at_home.rotation);
        let (cone_rad, step_mm) = (self.cone_deg.to_radians(), self.grid_step.unwrap_or(100.0));
        match self.random {
            Some(count) => Poses::Box { count, lower_mm, upper_mm, orientation_rpy, cone_rad },
            None => Poses::Grid { lower_mm, upper_mm, step_mm, orientation_rpy },
        }
    }
}

/// Sizes of the errors; 0 switches one off.
#[expect(clippy::struct_excessive_bools, reason = "each is a flag of the command line")]
#[derive(Debug, Clone, Args)]
#[group(skip)]
#[command(next_help_heading = "Errors (realistic ones where not given)")]
pub(super) struct ErrorFlags {
    /// Start from an arm, a tracker and clocks without any error instead of realistic ones.
    #[arg(long)]
    exact: bool,
    /// Standard deviation of link lengths, mm.
    #[arg(long, value_name = "MM", value_parser = finite)]
    length_sd_mm: Option<f64>,
    /// Standard deviation of link angles, mrad.
    #[arg(long, value_name = "MRAD", value_parser = finite)]
    angle_sd_mrad: Option<f64>,
    /// Slow part of the joint error curves, µrad rms.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    slow_curve_urad: Option<f64>,
    /// Fast part of the joint error curves, µrad rms.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    fast_curve_urad: Option<f64>,
    /// Amplitude of the gear lines, µrad.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    gear_line_urad: Option<f64>,
    /// Backlash, µrad.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    backlash_urad: Option<f64>,
    /// Settling error: how far the controller stops before its command, µrad.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    stops_short_urad: Option<f64>,
    /// Command–feedback weight: where the arm stops between reported (0) and commanded (1) angle.
    #[arg(long, value_name = "SHARE", value_parser = finite)]
    nearer_command: Option<f64>,
    /// Repeatability, µrad per joint.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    repeatability_urad: Option<f64>,
    /// Deflection of a joint under the stretched arm's weight, µrad.
    #[arg(long, value_name = "URAD", value_parser = finite)]
    sag_urad: Option<f64>,
    /// Standard deviation of the target's mounting, mm per axis.
    #[arg(long, value_name = "MM", value_parser = finite)]
    target_sd_mm: Option<f64>,
    /// Slow drift of the base, mm.
    #[arg(long, value_name = "MM", value_parser = finite)]
    base_drift_mm: Option<f64>,
    /// Step by which the base jumps half way through the session, as bumped, mm.
    #[arg(long, value_name = "MM", value_parser = finite)]
    bump_mm: Option<f64>,
    /// Slow drift of the tracker on its stand, mm; it turns as well, by as much at two metres.
    #[arg(long, value_name = "MM", value_parser = finite)]
    tracker_drift_mm: Option<f64>,
    /// Step by which the tracker jumps a third of the way through the session, as bumped, mm; it turns as well, by as much at two metres.
    #[arg(long, value_name = "MM", value_parser = finite)]
    tracker_bump_mm: Option<f64>,
    /// A 6-DoF target, which gives its orientation, instead of a reflector.
    #[arg(long)]
    six_dof: bool,
    /// A tracker without noise.
    #[arg(long)]
    no_tracker_noise: bool,
    /// Scale error of the tracker, ppm, positive where it measures too long: a wrong length unit.
    #[arg(long, value_name = "PPM", value_parser = finite, allow_hyphen_values = true)]
    tracker_scale_ppm: Option<f64>,
    /// Share of stations that the beam misses.
    #[arg(long, value_name = "SHARE", value_parser = finite)]
    lost_share: Option<f64>,
    /// Write a lost beam as 0 0 0, as some instruments do.
    #[arg(long)]
    lost_as_zeros: bool,
    /// Share of readings that are 2 to 20 mm off.
    #[arg(long, value_name = "SHARE", value_parser = finite)]
    outlier_share: Option<f64>,
    /// Time by which the tracker's clock is ahead at the first joint state, s.
    #[arg(long, value_name = "S", value_parser = finite, allow_hyphen_values = true)]
    clock_offset_s: Option<f64>,
    /// Rate by which the tracker's clock is fast, ppm.
    #[arg(long, value_name = "PPM", value_parser = finite, allow_hyphen_values = true)]
    clock_drift_ppm: Option<f64>,
    /// Shortest dwell, s.
    #[arg(long, value_name = "S", value_parser = finite)]
    dwell_s: Option<f64>,
    /// Dwells are longer by a random time up to this, s.
    #[arg(long, value_name = "S", value_parser = finite)]
    dwell_spread_s: Option<f64>,
    /// Joint states per second.
    #[arg(long, value_name = "HZ", value_parser = finite)]
    joint_rate_hz: Option<f64>,
    /// Tracker readings per second.
    #[arg(long, value_name = "HZ", value_parser = finite)]
    reading_rate_hz: Option<f64>,
}

impl ErrorFlags {
    pub(super) fn settings(
        &self,
        seed: u64,
        home: Vec<f64>,
        poses: impl FnOnce(&Cell) -> Result<Poses, SimulateError>,
    ) -> Result<SimulateSettings, SimulateError> {
        let poses = poses(&Cell::default())?;
        let mut settings = if self.exact {
            SimulateSettings::exact(seed, home, poses)
        } else {
            SimulateSettings::realistic(seed, home, poses)
        };
        self.change_arm(&mut settings);
        self.change_cell(&mut settings);
        self.change_times(&mut settings);
        Ok(settings)
    }

    fn change_arm(&self, settings: &mut SimulateSettings) {
        let (geometry, joints) = (&mut settings.geometry, &mut settings.joints);
        set(&mut geometry.length_sd_mm, self.length_sd_mm, 1.0);
        set(&mut geometry.angle_sd_rad, self.angle_sd_mrad, 1e-3);
        set(&mut joints.slow_curve_rad, self.slow_curve_urad, 1e-6);
        set(&mut joints.fast_curve_rad, self.fast_curve_urad, 1e-6);
        set(&mut joints.gear_line_rad, self.gear_line_urad, 1e-6);
        set(&mut joints.backlash_rad, self.backlash_urad, 1e-6);
        set(&mut joints.stops_short_rad, self.stops_short_urad, 1e-6);
        set(&mut joints.nearer_command, self.nearer_command, 1.0);
        set(&mut joints.repeatability_rad, self.repeatability_urad, 1e-6);
        set(&mut settings.gravity.sag_rad, self.sag_urad, 1e-6);
    }

    fn change_cell(&self, settings: &mut SimulateSettings) {
        let cell = &mut settings.cell;
        set(&mut cell.target_sd_mm, self.target_sd_mm, 1.0);
        set(&mut cell.base_drift_mm, self.base_drift_mm, 1.0);
        set(&mut cell.bump_mm, self.bump_mm, 1.0);
        set(&mut cell.tracker_drift_mm, self.tracker_drift_mm, 1.0);
        set(&mut cell.tracker_bump_mm, self.tracker_bump_mm, 1.0);
        cell.six_dof |= self.six_dof;
        let tracker = &mut settings.tracker;
        if self.no_tracker_noise {
            let (lost_share, outlier_share) = (tracker.lost_share, tracker.outlier_share);
            *tracker = TrackerErrors { lost_share, outlier_share, ..TrackerErrors::none() };
        }
        set(&mut tracker.scale, self.tracker_scale_ppm, 1e-6);
        set(&mut tracker.lost_share, self.lost_share, 1.0);
        set(&mut tracker.outlier_share, self.outlier_share, 1.0);
        tracker.lost_as_zeros |= self.lost_as_zeros;
    }

    fn change_times(&self, settings: &mut SimulateSettings) {
        let (clocks, motion) = (&mut settings.clocks, &mut settings.motion);
        set(&mut clocks.offset_s, self.clock_offset_s, 1.0);
        set(&mut clocks.drift_ppm, self.clock_drift_ppm, 1.0);
        set(&mut motion.dwell_s, self.dwell_s, 1.0);
        set(&mut motion.dwell_spread_s, self.dwell_spread_s, 1.0);
        set(&mut motion.joint_rate_hz, self.joint_rate_hz, 1.0);
        set(&mut motion.reading_rate_hz, self.reading_rate_hz, 1.0);
    }
}

fn set(setting: &mut f64, flag: Option<f64>, unit: f64) {
    if let Some(value) = flag {
        *setting = value * unit;
    }
}

#[derive(Debug, Clone)]
struct List(Vec<f64>);

pub(super) fn finite(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(format!("{text:?} is not a finite number")),
    }
}

fn list(text: &str) -> Result<List, String> {
    let numbers: Result<_, _> = text.split(',').map(finite).collect();
    numbers.map(List)
}

pub(super) fn five(text: &str) -> Result<[f64; 5], String> {
    let five: [f64; 5] = numbers(text, "five")?;
    if five[4] > 0.0 {
        Ok(five)
    } else {
        Err("the last number is a standard deviation: above zero".to_owned())
    }
}

pub(super) fn triple(text: &str) -> Result<[f64; 3], String> {
    numbers(text, "three")
}

/// `N` numbers, separated by commas; `wanted` is N as the message says it.
pub(super) fn numbers<const N: usize>(text: &str, wanted: &str) -> Result<[f64; N], String> {
    let List(numbers) = list(text)?;
    let count = numbers.len();
    <[f64; N]>::try_from(numbers)
        .map_err(|_| format!("{count} numbers; give {wanted}, separated by commas"))
}
