//! Settings of a simulation. Every ingredient is switched off by 0; [`SimulateSettings::exact`] has them all off.

use serde::Serialize;

/// A synthetic session: poses, errors of the arm, the cell, the instrument, the clocks.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulateSettings {
    pub seed: u64,
    /// Seed of the arm's errors, for another session of the same arm. Absent: `seed`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub arm_seed: Option<u64>,
    /// Reported angles (rad) at the start; the whole session is in their arm configuration.
    pub home: Vec<f64>,
    pub poses: Poses,
    pub geometry: GeometryErrors,
    pub joints: JointErrors,
    pub gravity: Gravity,
    /// Places of base, measured target and tracker.
    pub cell: Cell,
    pub tracker: TrackerErrors,
    /// The instrument: a laser tracker, or another one in its place.
    #[serde(skip_serializing_if = "Instrument::is_tracker")]
    pub instrument: Instrument,
    /// Factor by which the standard deviations that readings state are too small.
    #[serde(skip_serializing_if = "is_one")]
    pub understated: f64,
    pub clocks: Clocks,
    pub motion: MotionTimes,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Poses {
    Grid {
        lower_mm: [f64; 3],
        upper_mm: [f64; 3],
        step_mm: f64,
        /// The target's orientation: fixed-axis roll, pitch, yaw, rad.
        orientation_rpy: [f64; 3],
    },
    Box {
        count: usize,
        lower_mm: [f64; 3],
        upper_mm: [f64; 3],
        /// The mean orientation: fixed-axis roll, pitch, yaw, rad.
        orientation_rpy: [f64; 3],
        cone_rad: f64,
    },
    Joints {
        count: usize,
        lower: Vec<f64>,
        upper: Vec<f64>,
    },
    /// Given joint angles, in their order: a planned session for one.
    Listed {
        joints: Vec<Vec<f64>>,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GeometryErrors {
    pub length_sd_mm: f64,
    pub angle_sd_rad: f64,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct JointErrors {
    /// Root mean square of the slow part of each joint's error curve (correlated over 50°), rad.
    pub slow_curve_rad: f64,
    /// Root mean square of its fast part (correlated over 6°), rad.
    pub fast_curve_rad: f64,
    /// Amplitude of a sine at the gear's cycles per turn, rad.
    pub gear_line_rad: f64,
    /// Backlash, rad: the joint is off by half of it, against the direction of its last move.
    pub backlash_rad: f64,
    pub stops_short_rad: f64,
    /// Command–feedback weight: the true angle's share of the way from reported to commanded angle, β in
    /// [`crate::method::error_model`].
    pub nearer_command: f64,
    /// Repeatability: standard deviation from visit to visit, rad.
    pub repeatability_rad: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gravity {
    /// Deflection of a typical joint when the arm after it is stretched out level, rad.
    pub sag_rad: f64,
    pub up: [f64; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cell {
    pub tracker_from_base_mm: [f64; 3],
    /// Orientation of the base in the tracker frame: fixed-axis roll, pitch, yaw, rad.
    pub tracker_from_base_rpy: [f64; 3],
    /// Position of the measured target in the flange frame as the controller knows it, mm.
    pub flange_from_target_mm: [f64; 3],
    /// Orientation of the measured target in the flange frame: fixed-axis roll, pitch, yaw, rad.
    pub flange_from_target_rpy: [f64; 3],
    /// Standard deviation per axis of the target's true position about the known one, mm.
    pub target_sd_mm: f64,
    pub base_drift_mm: f64,
    /// Step by which the base jumps half way through the session, mm.
    #[serde(skip_serializing_if = "is_zero")]
    pub bump_mm: f64,
    /// Typical slow drift of the tracker on its stand over the session, mm; it turns as well, by as much at two metres.
    #[serde(skip_serializing_if = "is_zero")]
    pub tracker_drift_mm: f64,
    /// Step by which the tracker jumps a third of the way through the session, mm; it turns as well, by as much at two metres.
    #[serde(skip_serializing_if = "is_zero")]
    pub tracker_bump_mm: f64,
    /// Whether orientation is measured (6-DoF) or only position.
    pub six_dof: bool,
}

/// Uncertainty of the instrument: maximum permissible errors over a divisor ([`crate::method::uncertainty`]).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackerErrors {
    /// Along the beam: constant part, mm.
    pub radial_mm: f64,
    /// Along the beam: part per distance, mm/mm.
    pub radial_per_mm: f64,
    /// Across the beam: constant part, mm.
    pub transverse_mm: f64,
    /// Across the beam: part per distance, mm/mm.
    pub transverse_per_mm: f64,
    pub divisor: f64,
    /// Scale error of the instrument, as a share of the distance; positive when it measures too long.
    #[serde(skip_serializing_if = "is_zero")]
    pub scale: f64,
    /// Standard deviation of an orientation, rad per axis.
    pub orientation_rad: f64,
    pub lost_share: f64,
    /// Whether a lost beam is logged as 0 0 0 (true) or not at all.
    pub lost_as_zeros: bool,
    pub outlier_share: f64,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_one(factor: &f64) -> bool {
    factor.to_bits() == 1.0_f64.to_bits()
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde gives a reference")]
fn is_zero(scale: &f64) -> bool {
    *scale == 0.0
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Instrument {
    #[default]
    Tracker,
    Scanner(ScannerSettings),
    Camera(CameraSettings),
}

impl Instrument {
    pub const fn is_tracker(&self) -> bool {
        matches!(self, Self::Tracker)
    }

    pub const fn name(&self) -> &'static str {
        match self {
            Self::Tracker => "laser tracker",
            Self::Scanner(_) => "scanner",
            Self::Camera(_) => "camera",
        }
    }
}

/// A stationary scanner (structured light, a laser line) that reads points and states their covariances.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScannerSettings {
    /// Standard deviation along the line of sight at 1 m, mm; it grows with the square of the distance.
    pub along_mm: f64,
    pub across_mm: f64,
    pub distance_mm: f64,
}

/// A camera that sees a flat, square target and states the covariance of its pose.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct CameraSettings {
    pub focal_px: f64,
    /// Standard deviation of a corner in the image along each axis, for a target seen from the front, pixels.
    pub noise_px: f64,
    pub target_mm: f64,
    pub corners: u32,
    /// Whether the camera is on the flange and the target in the cell.
    pub on_flange: bool,
    /// Distance of camera and target in the middle of the poses, mm.
    pub distance_mm: f64,
    /// Share of stations at which the second solution of a flat target is read.
    pub flipped_share: f64,
}

/// `tracker − t₀ = (1 + drift)(controller − t₀) + offset`, t₀ the first joint sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Clocks {
    pub origin_ns: i64,
    pub offset_s: f64,
    pub drift_ppm: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MotionTimes {
    /// Constant part of the time of every move, s; the distance over the speed is added.
    pub move_s: f64,
    pub speed_rad_s: f64,
    pub dwell_s: f64,
    /// Dwells are longer by a random time up to this, s.
    pub dwell_spread_s: f64,
    pub joint_rate_hz: f64,
    pub reading_rate_hz: f64,
}

impl SimulateSettings {
    /// An arm that is exactly nominal, measured without error and with equal clocks; ingredients are then switched on.
    pub fn exact(seed: u64, home: Vec<f64>, poses: Poses) -> Self {
        Self {
            seed,
            arm_seed: None,
            home,
            poses,
            geometry: GeometryErrors { length_sd_mm: 0.0, angle_sd_rad: 0.0 },
            joints: JointErrors::default(),
            gravity: Gravity { sag_rad: 0.0, up: [0.0, 0.0, 1.0] },
            cell: Cell::default(),
            tracker: TrackerErrors::none(),
            instrument: Instrument::Tracker,
            understated: 1.0,
            clocks: Clocks { origin_ns: 1_700_000_000_000_000_000, offset_s: 0.0, drift_ppm: 0.0 },
            motion: MotionTimes::default(),
        }
    }

    /// Errors typical of a good industrial arm: about a millimetre uncompensated, most of it geometry.
    pub fn realistic(seed: u64, home: Vec<f64>, poses: Poses) -> Self {
        Self {
            geometry: GeometryErrors { length_sd_mm: 0.4, angle_sd_rad: 3e-4 },
            joints: JointErrors {
                slow_curve_rad: 1e-4,
                fast_curve_rad: 2e-5,
                gear_line_rad: 1e-5,
                backlash_rad: 2e-5,
                stops_short_rad: 5e-5,
                nearer_command: 0.5,
                repeatability_rad: 5e-6,
            },
            gravity: Gravity { sag_rad: 4e-4, up: [0.0, 0.0, 1.0] },
            cell: Cell { target_sd_mm: 0.1, base_drift_mm: 0.02, bump_mm: 0.0, ..Cell::default() },
            tracker: TrackerErrors {
                lost_share: 0.005,
                outlier_share: 0.001,
                ..TrackerErrors::adm()
            },
            clocks: Clocks {
                origin_ns: 1_700_000_000_000_000_000,
                offset_s: 21.703,
                drift_ppm: 18.0,
            },
            ..Self::exact(seed, home, poses)
        }
    }
}

impl Default for Cell {
    /// The tracker is 4 m in front of the arm and turned towards it, the reflector 100 mm in front of the flange, off its axis.
    fn default() -> Self {
        Self {
            tracker_from_base_mm: [4200.0, -900.0, -650.0],
            tracker_from_base_rpy: [0.004, -0.007, 2.6],
            flange_from_target_mm: [25.0, -40.0, 100.0],
            flange_from_target_rpy: [0.0; 3],
            target_sd_mm: 0.0,
            base_drift_mm: 0.0,
            bump_mm: 0.0,
            tracker_drift_mm: 0.0,
            tracker_bump_mm: 0.0,
            six_dof: false,
        }
    }
}

impl TrackerErrors {
    pub const fn none() -> Self {
        Self {
            radial_mm: 0.0,
            radial_per_mm: 0.0,
            transverse_mm: 0.0,
            transverse_per_mm: 0.0,
            divisor: 2.0,
            scale: 0.0,
            orientation_rad: 0.0,
            lost_share: 0.0,
            lost_as_zeros: false,
            outlier_share: 0.0,
        }
    }

    /// The example of [`crate::method::uncertainty`]: 10 µm + 0.3 µm/m along the beam, 15 µm + 6 µm/m across, divisor 2.
    pub const fn adm() -> Self {
        Self {
            radial_mm: 0.010,
            radial_per_mm: 0.3e-6,
            transverse_mm: 0.015,
            transverse_per_mm: 6e-6,
            orientation_rad: 130e-6,
            ..Self::none()
        }
    }
}

impl Default for MotionTimes {
    fn default() -> Self {
        Self {
            move_s: 0.5,
            speed_rad_s: 0.6,
            dwell_s: 1.0,
            dwell_spread_s: 0.4,
            joint_rate_hz: 20.0,
            reading_rate_hz: 20.0,
        }
    }
}
