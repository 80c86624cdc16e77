//! The tracker's readings: the target in the tracker frame at the tracker's own times, with noise, losses and outliers.
//!
//! Uncertainty ([`crate::method::uncertainty`]): standard deviations `(constant + per distance · distance) / divisor`
//! along and across the beam. Half of that variance is the same for all readings of a station (refraction, the reflector's
//! seat), the other half is new in every reading.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use serde::Serialize;

use super::instrument::Views;
use super::random::{Ingredient, Stream};
use super::settings::{Instrument, SimulateSettings, TrackerErrors};
use super::timeline::{Timeline, ns};
use super::true_arm::ArmErrors;
use super::{
    POSITION_RESOLUTION_MM, QUATERNION_RESOLUTION, TEMPERATURE_RESOLUTION, far_axis, rounded,
};
use crate::geometry::isometry_from_rpy;
use crate::ingest::{TargetReadings, TemperatureSamples};
use crate::kinematics::Arm;
use crate::units::{ClockModel, NS_PER_S, Stamp, Tracker, whole};

/// Temperature at the start, °C, and its rise over the session.
const TEMPERATURE: (f64, f64) = (21.5, 1.8);

/// The direction of a bump, a unit vector in the base frame.
const BUMP: [f64; 3] = [0.6, -0.64, 0.48];

/// Distance at which the tracker's turns move a point as far as its shifts do, mm.
const TURNS_AT_MM: f64 = 2000.0;

/// Directions of the tracker's bump: of its shift and of its turn, unit vectors in its frame.
const TRACKER_BUMP: [[f64; 3]; 2] = [[-0.48, 0.6, 0.64], [0.0, 0.8, -0.6]];

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
pub struct TrueReadingCounts {
    /// Number of readings of the target, outliers included.
    pub seen: u64,
    pub outliers: u64,
    /// Number of moments at which the beam was lost, whether logged as zeros or not at all.
    pub lost: u64,
}

enum Reading {
    Seen(Isometry3<f64>),
    Outlier(Isometry3<f64>),
    Lost,
}

impl Reading {
    /// The pose in the log; `None` when nothing is logged.
    fn logged(self, lost_as_zeros: bool) -> Option<Isometry3<f64>> {
        match self {
            Self::Seen(pose) | Self::Outlier(pose) => Some(pose),
            Self::Lost => lost_as_zeros.then(Isometry3::identity),
        }
    }
}

impl TrueReadingCounts {
    fn count(&mut self, reading: &Reading) {
        match reading {
            Reading::Seen(_) => self.seen += 1,
            Reading::Outlier(_) => {
                self.seen += 1;
                self.outliers += 1;
            }
            Reading::Lost => self.lost += 1,
        }
    }
}

/// The session from the tracker's side.
pub(super) struct View<'a> {
    arm: &'a Arm,
    settings: &'a SimulateSettings,
    errors: &'a ArmErrors,
    pub(super) timeline: &'a Timeline,
    pub(super) tracker_from_base: Isometry3<f64>,
    pub(super) clock: ClockModel,
    drift: [[f64; 3]; 3],
    /// Of the tracker: shifts, and turns.
    tracker_drift: [[[f64; 3]; 3]; 2],
    /// Per stop: the part of the noise that all its readings share, in units of its standard deviation.
    placement: Vec<[Vector3<f64>; 2]>,
    views: Views,
    pub(super) lost: Vec<bool>,
}

impl<'a> View<'a> {
    pub(super) fn new(
        arm: &'a Arm,
        settings: &'a SimulateSettings,
        errors: &'a ArmErrors,
        timeline: &'a Timeline,
    ) -> Self {
        let cell = &settings.cell;
        let clocks = &settings.clocks;
        let stops = timeline.stops.len();
        let mut drift = Stream::new(settings.seed, Ingredient::BaseDrift);
        let mut tracker_drift = Stream::new(settings.seed, Ingredient::TrackerDrift);
        let mut placement = Stream::new(settings.seed, Ingredient::Placement);
        let mut lost = Stream::new(settings.seed, Ingredient::LostBeam);
        let mut image = Stream::new(settings.seed, Ingredient::Image);
        let mut view = Self {
            arm,
            settings,
            errors,
            timeline,
            tracker_from_base: isometry_from_rpy(
                cell.tracker_from_base_mm,
                cell.tracker_from_base_rpy,
            ),
            clock: ClockModel {
                origin: Stamp::from_ns(clocks.origin_ns),
                offset_ns: clocks.offset_s * NS_PER_S,
                drift: clocks.drift_ppm * 1e-6,
            },
            drift: std::array::from_fn(|_| drift.normal3().into()),
            tracker_drift: [(); 2].map(|()| [(); 3].map(|()| tracker_drift.normal3().into())),
            placement: (0..stops).map(|_| [placement.normal3(), placement.normal3()]).collect(),
            views: Views::draw(&settings.instrument, stops, &mut image),
            lost: (0..stops).map(|_| lost.uniform() < settings.tracker.lost_share).collect(),
        };
        view.lose_unseen();
        view
    }

    /// Counts stops at which the instrument does not find the target as lost.
    fn lose_unseen(&mut self) {
        for (number, stop) in self.timeline.stops.iter().enumerate() {
            let pose = self.tracker_from_target(stop.start_s.midpoint(stop.end_s));
            self.lost[number] |= !self.settings.instrument.sees(&pose);
        }
    }

    /// Movement of the base in its own frame, mm: zero at the start, a slow sine along each axis, and a jump half way.
    pub(super) fn base_drift(&self, t_s: f64) -> Vector3<f64> {
        let cell = &self.settings.cell;
        let slow = self.slow(&self.drift, t_s) * cell.base_drift_mm;
        if self.is_behind(t_s, self.timeline.stops.len() / 2) {
            slow + Vector3::from(BUMP) * cell.bump_mm
        } else {
            slow
        }
    }

    /// Whether a moment is in the dwell of a stop or later.
    fn is_behind(&self, t_s: f64, stop: usize) -> bool {
        self.timeline.stop_at(t_s) >= Some(stop)
    }

    /// A slow sine along each of three directions, zero at the start.
    fn slow(&self, directions: &[[f64; 3]; 3], t_s: f64) -> Vector3<f64> {
        let way = t_s / self.timeline.end_s().max(1.0);
        let along = directions.iter().enumerate().map(|(k, direction)| {
            let order = (k + 1) as f64;
            Vector3::from(*direction) * ((TAU * way * order / 2.5).sin() / order)
        });
        along.sum()
    }

    /// Where a point that stands still is seen by the tracker at a moment, from where it is seen at the start: the tracker drifts on its
    /// stand, and is bumped a third of the way through.
    pub(super) fn tracker_moved(&self, t_s: f64) -> Isometry3<f64> {
        let cell = &self.settings.cell;
        let [shifts, turns] = &self.tracker_drift;
        let drift = [shifts, turns].map(|own| self.slow(own, t_s) * cell.tracker_drift_mm);
        let bump_mm = if self.is_behind(t_s, self.timeline.stops.len() / 3) {
            cell.tracker_bump_mm
        } else {
            0.0
        };
        let [shift, turn] = TRACKER_BUMP.map(|own| Vector3::from(own) * bump_mm);
        let turn = UnitQuaternion::from_scaled_axis((drift[1] + turn) / TURNS_AT_MM);
        Isometry3::from_parts(Translation3::from(drift[0] + shift), turn)
    }

    /// True pose of the target in the frame of the base at the start, its drift included, at a moment of the controller's time, mm.
    pub(super) fn base_from_target(&self, t_s: f64) -> Isometry3<f64> {
        let state = self.timeline.state(t_s);
        let base_from_target =
            self.errors.base_from_target(self.arm, &state.reported, &state.visit);
        Translation3::from(self.base_drift(t_s)) * base_from_target
    }

    /// True pose of the target in the tracker frame at a moment of the controller's time, mm.
    pub(super) fn tracker_from_target(&self, t_s: f64) -> Isometry3<f64> {
        self.seen(t_s, &self.base_from_target(t_s))
    }

    /// The pose in the tracker frame of a target that is at this pose in the base frame at that moment, mm.
    pub(super) fn seen(&self, t_s: f64, base_from_target: &Isometry3<f64>) -> Isometry3<f64> {
        self.tracker_moved(t_s) * self.tracker_from_base * base_from_target
    }

    /// Readings at the tracker's own rate for as long as the controller runs.
    pub(super) fn readings(&self) -> (TargetReadings, TrueReadingCounts) {
        let mut noise = Stream::new(self.settings.seed, Ingredient::Reading);
        let mut outliers = Stream::new(self.settings.seed, Ingredient::Outliers);
        let mut readings = TargetReadings::default();
        let mut orientations = Vec::new();
        let mut covariances = Vec::new();
        let (instrument, understated) = (&self.settings.instrument, self.settings.understated);
        let mut counts = TrueReadingCounts::default();
        for stamp in self.stamps(self.settings.motion.reading_rate_hz) {
            let Some(reading) = self.reading(stamp, &mut noise, &mut outliers) else { break };
            counts.count(&reading);
            let is_lost = matches!(reading, Reading::Lost);
            if let Some(pose) = reading.logged(self.settings.tracker.lost_as_zeros) {
                readings.stamps.push(stamp);
                readings.positions.push(logged_position(&pose.translation.vector));
                orientations.push(logged_quaternion(&pose.rotation));
                if !instrument.is_tracker() {
                    let stated = instrument.stated(&pose, understated);
                    covariances.push(stated.filter(|_| !is_lost).unwrap_or_default());
                }
            }
        }
        readings.covariances = (!instrument.is_tracker()).then_some(covariances);
        readings.orientations = self.settings.cell.six_dof.then_some(orientations);
        (readings, counts)
    }

    /// The result at one moment. Every moment draws the same count of random numbers, so that a loss does not change others.
    fn reading(
        &self,
        stamp: Stamp<Tracker>,
        noise: &mut Stream,
        outliers: &mut Stream,
    ) -> Option<Reading> {
        let t_s = self.clock.to_controller(stamp).since_s(self.clock.origin);
        let stop = self.timeline.stop_at(t_s)?;
        let is_outlier = outliers.uniform() < self.settings.tracker.outlier_share;
        let jump = outliers.normal3().normalize() * outliers.between(2.0, 20.0);
        let pose = self.observed(&self.tracker_from_target(t_s), stop, noise);
        Some(match pose.filter(|_| !self.lost[stop]) {
            None => Reading::Lost,
            Some(pose) if is_outlier => Reading::Outlier(Translation3::from(jump) * pose),
            Some(pose) => Reading::Seen(pose),
        })
    }

    /// One temperature for each stop, at the end of its dwell.
    pub(super) fn temperatures(&self) -> TemperatureSamples {
        let ends = self.timeline.stops.iter().map(|stop| stop.end_s);
        let celsius = |t_s: f64| TEMPERATURE.0 + TEMPERATURE.1 * t_s / self.timeline.end_s();
        TemperatureSamples {
            stamps: ends.clone().map(|t_s| self.tracker_stamp(t_s)).collect(),
            celsius: ends.map(|t_s| rounded(celsius(t_s), TEMPERATURE_RESOLUTION)).collect(),
        }
    }

    fn tracker_stamp(&self, t_s: f64) -> Stamp<Tracker> {
        self.clock.to_tracker(self.clock.origin.plus_ns(ns(t_s)))
    }

    /// The tracker's own regular times, out of step with the controller's, from its start to its end.
    fn stamps(&self, rate_hz: f64) -> impl Iterator<Item = Stamp<Tracker>> {
        let first = self.tracker_stamp(0.37 / rate_hz);
        let last = self.tracker_stamp(self.timeline.end_s());
        (0..)
            .map(move |index: u32| first.plus_ns(ns(f64::from(index) / rate_hz)))
            .take_while(move |stamp| *stamp <= last)
    }

    /// The mean of all readings of a stop at which the target is stationary at `pose`.
    pub(super) fn mean(&self, stop: usize, pose: &Isometry3<f64>, noise: &mut Stream) -> Mean {
        let (motion, tracker) = (&self.settings.motion, &self.settings.tracker);
        let dwell_s = self.timeline.stops[stop].end_s - self.timeline.stops[stop].start_s;
        let readings = (dwell_s * motion.reading_rate_hz).floor().max(1.0);
        let [placed, turned] = self.placement[stop];
        let share = readings.sqrt().recip();
        let position = (placed + noise.normal3() * share) * FRAC_1_SQRT_2;
        let rotation = (turned + noise.normal3() * share) * FRAC_1_SQRT_2;
        let off = off(&pose.translation.vector, &position, tracker);
        let distance = pose.translation.vector.norm();
        let scatter_mm = FRAC_1_SQRT_2 * tracker.across_mm(distance);
        let turn = UnitQuaternion::from_scaled_axis(rotation * tracker.orientation_rad);
        Mean {
            position: Translation3::from(off) * Point3::from(pose.translation.vector),
            orientation: turn * pose.rotation,
            scatter: (scatter_mm, FRAC_1_SQRT_2 * tracker.orientation_rad),
            readings: whole(readings),
        }
    }

    /// One reading of the target at a pose in the instrument's frame; `None` where it is not seen.
    fn observed(
        &self,
        pose: &Isometry3<f64>,
        stop: usize,
        noise: &mut Stream,
    ) -> Option<Isometry3<f64>> {
        match &self.settings.instrument {
            Instrument::Tracker => Some(self.tracked(pose, stop, noise)),
            Instrument::Scanner(own) => {
                let beam = pose.translation.vector;
                let position = (self.placement[stop][0] + noise.normal3()) * FRAC_1_SQRT_2;
                let off = along_and_across(&beam, &position, own.sds_mm(beam.norm()));
                Some(Translation3::from(off) * pose)
            }
            Instrument::Camera(own) => {
                let drawn = noise.normals(own.draws(), 1.0);
                self.settings.instrument.sees(pose).then(|| {
                    let (noise, is_flipped) = self.views.noise(stop, &drawn);
                    own.read(pose, &noise, is_flipped)
                })
            }
        }
    }

    fn tracked(&self, pose: &Isometry3<f64>, stop: usize, noise: &mut Stream) -> Isometry3<f64> {
        let [placed, turned] = self.placement[stop];
        let position = (placed + noise.normal3()) * FRAC_1_SQRT_2;
        let rotation = (turned + noise.normal3()) * FRAC_1_SQRT_2;
        let tracker = &self.settings.tracker;
        let off = off(&pose.translation.vector, &position, tracker);
        let turn = UnitQuaternion::from_scaled_axis(rotation * tracker.orientation_rad);
        Isometry3::from_parts(
            Translation3::from(pose.translation.vector + off),
            turn * pose.rotation,
        )
    }
}

/// Error of the instrument, mm: its scale error, and noise made from three standard normal numbers.
pub(super) fn off(
    beam: &Vector3<f64>,
    normal: &Vector3<f64>,
    tracker: &TrackerErrors,
) -> Vector3<f64> {
    let distance = beam.norm();
    let radial = (tracker.radial_mm + tracker.radial_per_mm * distance) / tracker.divisor;
    beam * tracker.scale + along_and_across(beam, normal, [radial, tracker.across_mm(distance)])
}

/// Three standard normal numbers as noise along the beam (the first) and across it, of these standard deviations, mm.
fn along_and_across(
    beam: &Vector3<f64>,
    normal: &Vector3<f64>,
    [radial, transverse]: [f64; 2],
) -> Vector3<f64> {
    let along = beam / beam.norm().max(f64::MIN_POSITIVE);
    // Any direction other than the beam's gives two axes across it.
    let right = along.cross(&far_axis(&along)).normalize();
    let up = right.cross(&along);
    along * (radial * normal.x) + (right * normal.y + up * normal.z) * transverse
}

impl TrackerErrors {
    /// Standard deviation of one reading across the beam, mm.
    fn across_mm(&self, distance_mm: f64) -> f64 {
        (self.transverse_mm + self.transverse_per_mm * distance_mm) / self.divisor
    }
}

pub(super) fn logged_position(position: &Vector3<f64>) -> [f64; 3] {
    [position.x, position.y, position.z].map(|x| rounded(x, POSITION_RESOLUTION_MM))
}

pub(super) fn logged_quaternion(rotation: &UnitQuaternion<f64>) -> [f64; 4] {
    // One sign for a rotation: a log has no jumps between q and −q.
    let sign = if rotation.w < 0.0 { -1.0 } else { 1.0 };
    [rotation.i, rotation.j, rotation.k, rotation.w]
        .map(|x| rounded(sign * x, QUATERNION_RESOLUTION))
}

pub(super) struct Mean {
    pub(super) position: Point3<f64>,
    pub(super) orientation: UnitQuaternion<f64>,
    /// Standard deviation of one reading about the mean, per axis: mm and rad.
    pub(super) scatter: (f64, f64),
    pub(super) readings: usize,
}
