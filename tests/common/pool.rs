//! Sessions of one simulated arm whose joint curves change, station by station and without logs: pools of a hundred in a second.

use std::f64::consts::TAU;

use nalgebra::{Matrix3, Point3, Vector3};
use posegrid::fit::commanded::SettlingError;
use posegrid::fit::full::{FullModel, FullSettings, Purpose, Query};
use posegrid::fit::{
    self, FitSettings, Frames, Freedom, Measured, MeasuredPoint, Observation, SourceId, TargetId,
};
use posegrid::kinematics::{Arm, RobotFile};

/// Harmonics of the true curve of a joint.
const HARMONICS: usize = 3;
/// Noise of one measured position per axis, mm.
const NOISE_MM: f64 = 0.02;

/// How an arm changes.
#[derive(Debug, Clone, Copy)]
pub struct Truth {
    /// Standard deviation of each harmonic of a joint's curve in the first session, rad.
    pub curve_rad: f64,
    /// Of its change from one session to the next, which stays, rad.
    pub walk_rad: f64,
    /// Of its change in one session alone, rad.
    pub own_rad: f64,
    /// Days from one session to the next.
    pub days: f64,
}

/// An arm that is measured again and again.
pub struct MeasuredArm {
    pub arm: Arm,
    truth: Truth,
    curves: Vec<Vec<[f64; 2]>>,
    /// What each joint's zero is off, rad.
    zeros: Vec<f64>,
    /// The target in the flange, mm.
    target: Point3<f64>,
    numbers: Numbers,
    sessions: usize,
}

impl MeasuredArm {
    pub fn new(truth: Truth, seed: u64) -> Self {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/robots/ur10.toml");
        let text = std::fs::read_to_string(path).expect("part of the project");
        let file: RobotFile = toml::from_str(&text).expect("a robot file");
        let mut pool = Self {
            arm: file.arm().expect("an arm"),
            truth,
            curves: vec![vec![[0.0; 2]; HARMONICS]; 6],
            zeros: vec![0.0; 6],
            target: Point3::new(60.0, -35.0, 110.0),
            numbers: Numbers(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1),
            sessions: 0,
        };
        pool.curves = pool.changed(truth.curve_rad);
        pool
    }

    /// Gives a joint (from 0) another gear, with a curve of its own and another zero.
    pub fn repair(&mut self, joint: usize, zero_rad: f64) {
        for pair in &mut self.curves[joint] {
            *pair = pair.map(|_| self.truth.curve_rad * self.numbers.normal());
        }
        self.zeros[joint] += zero_rad;
    }

    /// Takes the target off and mounts it again, so far from where it was, mm.
    pub fn remount(&mut self, by: Vector3<f64>) {
        self.target += by;
    }

    /// The curves after a change of this size.
    fn changed(&mut self, sd_rad: f64) -> Vec<Vec<[f64; 2]>> {
        let mut curves = self.curves.clone();
        for pair in curves.iter_mut().flatten() {
            *pair = pair.map(|own| own + sd_rad * self.numbers.normal());
        }
        curves
    }

    /// The next session, of `count` stations at random poses.
    pub fn session(&mut self, count: usize) -> Vec<Observation> {
        let curves = self.changed(self.truth.own_rad);
        let (session, day) = (self.sessions, 20_000.0 + self.truth.days * self.sessions as f64);
        self.sessions += 1;
        let seen = (0..count).map(|station| {
            let axes = self.axes();
            let settling_error = axes.iter().map(|_| 3e-4 * self.numbers.normal()).collect();
            let noise = Vector3::from_fn(|_, _| NOISE_MM * self.numbers.normal());
            let place = self.place(&curves, &axes) + noise;
            Observation {
                session,
                day: Some(day),
                settling_error: Some(SettlingError::Sent(settling_error)),
                measured: Measured::Point(MeasuredPoint {
                    position: place,
                    instrument: Matrix3::identity() * NOISE_MM.powi(2),
                    factor: Matrix3::identity() * NOISE_MM,
                }),
                ..Observation::planned(station, axes, place, Matrix3::identity())
            }
        });
        let seen = seen.collect();
        self.curves = self.changed(self.truth.walk_rad);
        seen
    }

    /// Random poses, axis variables each.
    pub fn poses(&mut self, count: usize) -> Vec<Vec<f64>> {
        (0..count).map(|_| self.axes()).collect()
    }

    /// Mean error of a model at these poses of the next session's arm, in the base of its session `session`, mm.
    pub fn error_mm(&self, model: &FullModel, session: usize, poses: &[Vec<f64>]) -> f64 {
        let errors = poses.iter().map(|axes| {
            let place = self.place(&self.curves, axes);
            let axes = axes.clone();
            let seen = Observation::planned(0, axes, place, Matrix3::identity());
            let query = Query { session, own: false, station: None, ..Query::of(&seen) };
            (model.position(&query) - place).norm()
        });
        errors.sum::<f64>() / poses.len() as f64
    }

    fn axes(&mut self) -> Vec<f64> {
        let home = [0.0, -1.2, 1.6, -1.9, -1.6, 0.0];
        home.map(|home| home + 1.6 * (self.numbers.uniform() - 0.5)).to_vec()
    }

    /// Where the target is, mm.
    fn place(&self, curves: &[Vec<[f64; 2]>], axes: &[f64]) -> Point3<f64> {
        let error = |(q, curve): (&f64, &Vec<[f64; 2]>)| {
            let pairs = (1..).zip(curve);
            let errors = pairs.map(|(k, [c, s])| {
                let angle = f64::from(k) * q;
                c * angle.cos() + s * angle.sin()
            });
            q + errors.sum::<f64>()
        };
        let attained = axes.iter().zip(curves).map(error).zip(&self.zeros);
        let attained: Vec<f64> = attained.map(|(own, zero)| own + zero).collect();
        self.arm.chain().nominal(&attained) * self.target
    }
}

/// The frames of one session, found with the nominal arm.
pub fn frames(arm: &Arm, session: &[Observation]) -> Frames {
    let one: Vec<Observation> = session.iter().map(|own| of_session(own, 0)).collect();
    let settings = FitSettings::default();
    let found = fit::identify(arm, &one, 1, Freedom::BaseAndTarget, &settings).expect("a fit");
    found.frames[0].clone()
}

/// An observation as one of another session.
pub fn of_session(own: &Observation, session: usize) -> Observation {
    Observation { session, source: SourceId::ONLY, target: TargetId::ONLY, ..own.clone() }
}

/// The full error model of sessions that all start from the same frames.
pub fn trained(
    arm: &Arm,
    seen: &[Observation],
    frames: &Frames,
    settings: &FullSettings,
) -> FullModel {
    let sessions = seen.last().map_or(0, |own| own.session + 1);
    let frames = vec![frames.clone(); sessions];
    let geometry = arm.no_offsets();
    let prior = FitSettings::default().prior();
    let up = Some(Vector3::z_axis());
    FullModel::train(
        arm,
        seen,
        (&frames[..], &geometry[..]),
        &prior,
        settings,
        Purpose::Published,
        up,
    )
    .expect("a model")
}

/// Random numbers of a seed (Marsaglia's xorshift), the same on every machine.
struct Numbers(u64);

impl Numbers {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (TAU * self.uniform()).cos()
    }
}
