//! Synthetic sessions with known truth, for the tests of the join.

use nalgebra::{Isometry3, Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::stationary::tests::find_stationary;
use super::{JoinError, JoinInput, JoinSettings, Joined, Pairing, ReferenceReadings, join};
use crate::geometry::isometry_from_rpy;
use crate::ingest::{JointAngles, JointSamples, Recording};
use crate::kinematics::{Arm, RobotFile};
use crate::units::{NS_PER_S, Stamp, round_ns};

pub(super) fn ur10() -> Arm {
    toml::from_str::<RobotFile>(include_str!("../../../pipelines/robots/ur10.toml"))
        .expect("a robot file of the project")
        .arm()
        .expect("an arm")
}

/// The settings of a synthetic session. Each test changes the one thing that it is about.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub seed: u64,
    pub poses: Vec<[f64; 6]>,
    pub dwell_s: Vec<f64>,
    pub move_s: f64,
    pub arm_hz: f64,
    pub tracker_hz: f64,
    /// Standard deviations.
    pub noise_mm: f64,
    pub noise_rad: f64,
    /// Least step of a reported angle, rad; 0 for none.
    pub quantum_rad: f64,
    pub offset_s: f64,
    pub drift: f64,
    /// The target in the flange frame, mm.
    pub target_mm: [f64; 3],
    /// Factor on the joints' errors of about a milliradian.
    pub arm_error: f64,
    /// First controller stamp, ns.
    pub origin_ns: i64,
}

pub(super) const STARTS_RESTING_S: f64 = 0.5;

impl Scene {
    /// Random poses, dwells of exactly equal length, 50 and 20 Hz, 20 µm noise.
    pub fn random(stations: usize, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut pose = || {
            let mut angle = |low: f64, high: f64| rng.random_range(low..high);
            [
                angle(-1.5, 1.5),
                angle(-2.2, -0.8),
                angle(0.5, 2.2),
                angle(-2.0, 0.0),
                angle(-1.5, 1.5),
                angle(-1.5, 1.5),
            ]
        };
        Self {
            seed,
            poses: (0..stations).map(|_| pose()).collect(),
            dwell_s: vec![1.0; stations],
            move_s: 0.8,
            arm_hz: 50.0,
            tracker_hz: 20.0,
            noise_mm: 0.02,
            noise_rad: 0.0,
            quantum_rad: 0.0,
            offset_s: 12.3456,
            drift: 30e-6,
            target_mm: [10.0, -20.0, 90.0],
            arm_error: 1.0,
            origin_ns: 1_605_000_000_000_000_000,
        }
    }

    /// Start of each dwell, s after the first controller stamp.
    pub(super) fn starts_s(&self) -> Vec<f64> {
        let mut at_s = 0.0;
        let mut starts = Vec::new();
        for (station, dwell_s) in self.dwell_s.iter().enumerate() {
            starts.push(at_s);
            at_s += dwell_s + self.move_s + if station == 0 { STARTS_RESTING_S } else { 0.0 };
        }
        starts
    }

    pub fn end_s(&self) -> f64 {
        self.starts_s()[self.poses.len() - 1] + self.dwell_s[self.poses.len() - 1]
    }

    /// True joint angles at a moment of controller time: minimum jerk between dwells.
    pub(super) fn angles(&self, starts_s: &[f64], at_s: f64) -> [f64; 6] {
        let here = starts_s.partition_point(|&start| start <= at_s).saturating_sub(1);
        let Some(&next_s) = starts_s.get(here + 1) else { return self.poses[here] };
        let share = (1.0 - (next_s - at_s) / self.move_s).clamp(0.0, 1.0);
        let gone = share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
        std::array::from_fn(|i| {
            self.poses[here][i] + gone * (self.poses[here + 1][i] - self.poses[here][i])
        })
    }

    /// True position of the target in the tracker frame, mm: the nominal arm with joint errors.
    pub fn target(&self, arm: &Arm, angles: &[f64; 6]) -> Vector3<f64> {
        let errors = [1e-3, -0.7e-3, 1.2e-3, -1e-3, 0.8e-3, 0.0];
        let real: Vec<f64> =
            angles.iter().zip(errors).map(|(q, error)| q + self.arm_error * error).collect();
        let tracker_from_base: Isometry3<f64> =
            isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]);
        (tracker_from_base * arm.flange(&real).isometry() * Point3::from(self.target_mm)).coords
    }

    /// Both logs.
    pub fn record(&self, arm: &Arm) -> Recording {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ 0x5eed);
        let starts_s = self.starts_s();
        let mut recording = Recording::default();
        recording.joints.angles = JointAngles::of(6);
        let mut at_s = 0.0;
        while at_s <= self.end_s() {
            recording
                .joints
                .stamps
                .push(Stamp::from_ns(self.origin_ns + round_ns(at_s * NS_PER_S)));
            let reported = self.angles(&starts_s, at_s).map(|angle| {
                let noisy = angle + self.noise_rad * gaussian(&mut rng);
                let quantum = self.quantum_rad;
                if quantum > 0.0 { (noisy / quantum).round() * quantum } else { noisy }
            });
            recording.joints.angles.push(reported);
            at_s += 1.0 / self.arm_hz;
        }
        let mut at_s = 0.013;
        while at_s <= self.end_s() {
            let ahead_ns = round_ns((self.offset_s + self.drift * at_s) * NS_PER_S);
            let stamp_ns = self.origin_ns + round_ns(at_s * NS_PER_S) + ahead_ns;
            recording.readings.stamps.push(Stamp::from_ns(stamp_ns));
            let truth = self.target(arm, &self.angles(&starts_s, at_s));
            let position = truth.map(|x| x + self.noise_mm * gaussian(&mut rng));
            recording.readings.positions.push(position.into());
            at_s += 1.0 / self.tracker_hz;
        }
        recording
    }

    /// Keeps the readings for which `keep(controller seconds)` holds.
    pub(super) fn keep_readings(&self, recording: &mut Recording, keep: impl Fn(f64) -> bool) {
        let readings = &mut recording.readings;
        let kept: Vec<bool> =
            readings.stamps.iter().map(|stamp| keep(self.controller_s(stamp.ns()))).collect();
        let mut next = kept.iter();
        readings.stamps.retain(|_| *next.next().expect("one each"));
        let mut next = kept.iter();
        readings.positions.retain(|_| *next.next().expect("one each"));
    }

    /// Controller time of a tracker stamp, s.
    pub fn controller_s(&self, tracker_ns: i64) -> f64 {
        ((tracker_ns - self.origin_ns) as f64 / NS_PER_S - self.offset_s) / (1.0 + self.drift)
    }

    /// Joins and checks all that must hold in any scene: conservation, no wrong mean, the clock. Returns the join.
    pub fn joined(&self, recording: &Recording) -> Joined {
        self.joined_with(recording, &JoinSettings::default())
    }

    fn joined_with(&self, recording: &Recording, settings: &JoinSettings) -> Joined {
        let arm = ur10();
        let joined =
            join_recorded(recording, &arm, settings).unwrap_or_else(|error| panic!("{error}"));
        check_conservation(recording, &joined);
        self.check_means(&arm, &joined);
        joined
    }

    fn check_means(&self, arm: &Arm, joined: &Joined) {
        let starts_s = self.starts_s();
        for station in &joined.stations {
            let [reading] = &station.readings[..] else {
                assert!(station.readings.is_empty(), "one tracker sees one target");
                continue;
            };
            let position = reading.position().expect("a position");
            assert_eq!(station.pairing, Pairing::Paired);
            let middle_ns = i64::midpoint(station.start.ns(), station.end.ns()) - self.origin_ns;
            let truth = self.target(arm, &self.angles(&starts_s, middle_ns as f64 / NS_PER_S));
            let off_mm = (position.coords - truth).norm();
            // Six standard errors of the mean of a three-vector, plus the motion below the stationary threshold.
            let allowed_mm = 6.0 * self.noise_mm * (3.0 / reading.kept as f64).sqrt() + 0.005;
            assert!(off_mm < allowed_mm, "station {}: {off_mm} mm off", station.number);
        }
    }

    /// Checks that the clock is within `offset_ms` at t₀ and `drift_ppm` of the truth.
    pub fn check_clock(&self, joined: &Joined, offset_ms: f64, drift_ppm: f64) {
        let model = joined.clock.model;
        let off_ms = (model.offset_ns - self.offset_s * NS_PER_S) / 1e6;
        let off_ppm = (model.drift - self.drift) * 1e6;
        assert!(off_ms.abs() < offset_ms, "offset off by {off_ms} ms, {:?}", joined.clock);
        assert!(off_ppm.abs() < drift_ppm, "drift off by {off_ppm} ppm, {:?}", joined.clock);
    }
}

/// Joins a recording: the detector processes its joints, poses are in memory.
pub(super) fn join_recorded(
    recording: &Recording,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Joined, JoinError> {
    join_beside(recording, Vec::new(), arm, settings)
}

/// Joins a recording with readings of references.
pub(super) fn join_beside(
    recording: &Recording,
    references: Vec<ReferenceReadings>,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Joined, JoinError> {
    let JointSamples { stamps, angles } = &recording.joints;
    let stamps_ns: Vec<i64> = stamps.iter().map(|stamp| stamp.ns()).collect();
    let rule = settings.arm_rule();
    let input = JoinInput {
        joints: find_stationary(&stamps_ns, angles.all(), angles.joints(), &rule),
        commands: Box::new(recording.commands.clone()),
        readings: Box::new(recording.readings.clone()),
        others: Vec::new(),
        references,
        lengths: Vec::new(),
        temperatures: recording.temperatures.clone(),
    };
    join(&input, arm, settings)
}

pub(super) fn paired(joined: &Joined) -> usize {
    joined.stations.iter().filter(|station| station.pairing == Pairing::Paired).count()
}

pub(super) fn check_conservation(recording: &Recording, joined: &Joined) {
    let c = joined.counts;
    let counted = c.kept + c.settling + c.outlier + c.moving + c.unpaired + c.missing;
    assert_eq!(counted, recording.readings.stamps.len() as u64);
    let rejected: u64 = joined.rejects.iter().map(|reject| reject.readings).sum();
    assert_eq!(rejected + c.kept, counted);
    let kept: usize =
        joined.stations.iter().flat_map(|s| &s.readings).map(|reading| reading.kept).sum();
    assert_eq!(kept as u64, c.kept);
}

/// Box–Muller: a standard normal number.
pub(super) fn gaussian(rng: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (rng.random_range(1e-12..1.0), rng.random_range(0.0..1.0));
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}
