//! Whether 95 % intervals of the arm's parameters hold the truth for each kind of measurement: one reflector and three, a 6-DoF target,
//! distances and heights, a tracker with a ball bar, and a tracker that drifts and is bumped under references.
//!
//! Arms are drawn from the prior that the fit states, and sessions are made here, without the simulator. The proof is of 500 sessions and
//! runs by a command of its own: `cargo test --release --test library kinds:: -- --ignored --nocapture`. For each kind it prints the share of
//! intervals that hold the truth, pooled over parameters, with a standard error over sessions, since those of one session err together.
//! 95 % has to be inside all seven intervals of these shares, which hold together with 95 %. Measured: 94.3 % (three distances, whose
//! noise sizes are found from few readings) to 95.3 % (6-DoF target), each ± 0.3. A few sessions of each kind are among the normal tests.

use crate::common;

use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion, Vector3};
use posegrid::fit::{
    self, Calibration, FitSettings, Freedom, Noise, Observation, Source, TrackerUncertainty,
};
use posegrid::geometry::isometry_from_rpy;
use posegrid::ingest::StandsOn;
use posegrid::join::references::ReferenceId;
use posegrid::join::tabled::{Row, RowReading, RowReference, Rows, tabled};
use posegrid::join::{
    JoinSettings, MeanLength, MeanOrientation, MeanPoint, ReadingKind, SourceId, TargetId, Value,
};
use posegrid::kinematics::{Arm, Parameter};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

const STATIONS: usize = 120;
const PRIOR_MM: f64 = 0.4;
const PRIOR_MRAD: f64 = 0.3;
/// Standard deviations of readings: of a coordinate, of an orientation about an axis, of a length.
const POINT_MM: f64 = 0.03;
const TURN_RAD: f64 = 1.5e-4;
const LENGTH_MM: f64 = 0.02;
/// Half the width of a 95 % interval over its standard deviation.
const INTERVAL: f64 = 1.959_964;
/// Half the width of seven intervals that hold together with 95 %, each with a seventh of the chance to miss.
const TOGETHER: f64 = 2.690_110;
/// A parameter counts where the session tells it better than half as well as the prior.
const IDENTIFIABLE: f64 = 0.5;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Reflector,
    ThreeReflectors,
    SixDof,
    ThreeDistances,
    HeightsAndDistance,
    TrackerAndBallBar,
    References,
}

const KINDS: [Kind; 7] = [
    Kind::Reflector,
    Kind::ThreeReflectors,
    Kind::SixDof,
    Kind::ThreeDistances,
    Kind::HeightsAndDistance,
    Kind::TrackerAndBallBar,
    Kind::References,
];

/// Normal numbers by Box and Muller.
struct Normal(ChaCha8Rng);

impl Normal {
    fn next(&mut self) -> f64 {
        let (u, v): (f64, f64) = (self.0.random_range(1e-15..1.0), self.0.random_range(0.0..1.0));
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }

    fn vector(&mut self, sd: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sd * self.next())
    }
}

/// A session: its arm's true offsets, and what was read.
struct Session {
    kind: Kind,
    offsets: Vec<f64>,
    normal: Normal,
}

impl Session {
    fn new(kind: Kind, arm: &Arm, seed: u64) -> Self {
        let mut normal = Normal(ChaCha8Rng::seed_from_u64(seed));
        let parameters = arm.chain().parameters();
        let offsets = parameters.iter().map(|parameter| {
            let sd = if parameter.is_angle() { 1e-3 * PRIOR_MRAD } else { PRIOR_MM };
            sd * normal.next()
        });
        Self { kind, offsets: offsets.collect(), normal }
    }

    /// The rows of the session's table.
    fn rows(&mut self, arm: &Arm) -> Rows {
        let rows = (0..STATIONS).map(|station| self.row(arm, station)).collect();
        let references = match self.kind {
            Kind::References => (0..4).map(|own| (format!("B{own}"), StandsOn::Base)).collect(),
            _ => Vec::new(),
        };
        Rows {
            file: "kinds.csv".to_owned(),
            rows,
            apart: Vec::new(),
            references,
            rejects: Vec::new(),
        }
    }

    fn row(&mut self, arm: &Arm, station: usize) -> Row {
        let middle = [0.3, -1.4, 1.7, -1.2, -1.1, 0.4];
        let spread = [1.0, 0.6, 0.8, 1.2, 0.9, 1.5];
        let joints: Vec<f64> = (0..6)
            .map(|joint| middle[joint] + spread[joint] * self.normal.0.random_range(-1.0..1.0))
            .collect();
        let flange = arm.chain().forward(&arm.axes(&joints), &self.offsets);
        let moved = self.motion(station);
        let tracker = moved * isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]);
        let target = flange * isometry_from_rpy([60.0, 20.0, 80.0], [0.0; 3]);
        let mut readings = Vec::new();
        let mut add = |source: usize, target: usize, value: Value| {
            readings.push(RowReading {
                source: SourceId(source),
                target: TargetId(target),
                line: station as u64 + 2,
                value,
                samples: 1,
            });
        };
        let beside = [[0.0; 3], [120.0, 15.0, -20.0], [35.0, 140.0, 10.0]];
        match self.kind {
            Kind::Reflector | Kind::References | Kind::TrackerAndBallBar => {
                let place = tracker * Point3::from(target.translation.vector);
                add(0, 0, Value::Point(point(place + self.normal.vector(POINT_MM))));
            }
            Kind::ThreeReflectors => {
                for (own, at) in beside.iter().enumerate() {
                    let place = tracker * target * Point3::from(*at);
                    add(0, own, Value::Point(point(place + self.normal.vector(POINT_MM))));
                }
            }
            Kind::SixDof => {
                let pose = tracker * target;
                let place = Point3::from(pose.translation.vector) + self.normal.vector(POINT_MM);
                let turn = MeanOrientation {
                    orientation: UnitQuaternion::from_scaled_axis(self.normal.vector(TURN_RAD))
                        * pose.rotation,
                    scatter_rad: 0.0,
                    stated_covariance: None,
                };
                add(0, 0, Value::Pose(point(place), turn));
            }
            Kind::ThreeDistances | Kind::HeightsAndDistance => {}
        }
        let place = Point3::from(target.translation.vector);
        for (source, length) in self.lengths(&place) {
            add(source, 0, length);
        }
        Row {
            line: station as u64 + 2,
            joints,
            command: None,
            time_ns: None,
            temperature_c: None,
            readings,
            references: self.references(&tracker, station),
        }
    }

    /// The instruments of one length, as sources behind the first.
    fn lengths(&mut self, place: &Point3<f64>) -> Vec<(usize, Value)> {
        let anchors = [
            ([1400.0, 300.0, -200.0], 35.0),
            ([-300.0, 1500.0, 900.0], -12.0),
            ([200.0, -1300.0, 1600.0], 4.0),
        ];
        let mut noise = || LENGTH_MM * self.normal.next();
        let mut distance = |source: usize, own: usize| {
            let (anchor, offset) = anchors[own];
            let mm = (place - Point3::from(anchor)).norm() + offset + noise();
            (source, Value::Distance(length(mm)))
        };
        match self.kind {
            Kind::ThreeDistances => (0..3).map(|own| distance(own + 1, own)).collect(),
            Kind::TrackerAndBallBar => vec![distance(1, 0)],
            Kind::HeightsAndDistance => {
                let first = distance(1, 1);
                let normals = [[0.3, -0.5, 0.8], [0.9, 0.2, -0.1]];
                let heights = normals.iter().enumerate().map(|(own, normal)| {
                    let normal = Vector3::from(*normal).normalize();
                    let mm = normal.dot(&place.coords) - 200.0 + noise();
                    (own + 2, Value::Height(length(mm)))
                });
                [first].into_iter().chain(heights).collect()
            }
            Kind::Reflector | Kind::ThreeReflectors | Kind::SixDof | Kind::References => Vec::new(),
        }
    }

    /// The motion of the tracker's surroundings at a station: a drift, and a bump at two thirds.
    fn motion(&self, station: usize) -> Isometry3<f64> {
        if self.kind != Kind::References {
            return Isometry3::identity();
        }
        let share = station as f64 / STATIONS as f64;
        let bump = if share < 0.66 { 0.0 } else { 1.0 };
        let shift = Vector3::new(0.3 * share + 2.0 * bump, (2.0 * share).sin() * 0.2, -bump);
        let turn = Vector3::new(5e-5 * share, -1e-3 * bump, 1e-4 * share);
        Isometry3::from_parts(shift.into(), Rotation3::new(turn).into())
    }

    fn references(&mut self, tracker: &Isometry3<f64>, station: usize) -> Vec<RowReference> {
        if self.kind != Kind::References {
            return Vec::new();
        }
        let places = [
            [600.0, 500.0, 0.0],
            [-500.0, 450.0, 90.0],
            [100.0, -680.0, 600.0],
            [-300.0, -500.0, 50.0],
        ];
        let reading = |(own, at): (usize, [f64; 3])| RowReference {
            reference: ReferenceId(own),
            line: station as u64 + 2,
            position: tracker * Point3::from(at) + self.normal.vector(POINT_MM),
        };
        places.into_iter().enumerate().map(reading).collect()
    }
}

fn point(position: Point3<f64>) -> MeanPoint {
    let variance = POINT_MM * POINT_MM;
    MeanPoint {
        position,
        scatter_mm: [0.0; 3],
        stated_covariance: Some([variance, 0.0, 0.0, variance, 0.0, variance]),
        motion_covariance: None,
    }
}

fn length(mm: f64) -> MeanLength {
    MeanLength { mm, sd_mm: LENGTH_MM }
}

/// What the readings do not show: the repeatability is none, and positions state their own covariance.
fn noise(kind: Kind) -> Noise {
    let uncertainty = TrackerUncertainty {
        range_um: 10.0,
        range_um_per_m: 0.3,
        transverse_um: 15.0,
        transverse_um_per_m: 6.0,
        divisor: 2.0,
        orientation_rad: Some(TURN_RAD),
    };
    let source = |reads| Source { reads, uncertainty: uncertainty.into() };
    let first = if kind == Kind::SixDof { ReadingKind::Pose } else { ReadingKind::Point };
    let (distance, height) = (source(ReadingKind::Distance), source(ReadingKind::Height));
    let more = match kind {
        Kind::ThreeDistances => vec![distance; 3],
        Kind::HeightsAndDistance => vec![distance, height, height],
        Kind::TrackerAndBallBar => vec![distance],
        Kind::Reflector | Kind::ThreeReflectors | Kind::SixDof | Kind::References => Vec::new(),
    };
    Noise {
        sources: [source(first)].into_iter().chain(more).collect(),
        repeatability_mm: 1e-4,
        stated: Vec::new(),
    }
}

fn identified(arm: &Arm, kind: Kind, rows: Rows) -> Calibration {
    let stations = tabled(rows, arm, &JoinSettings::default()).stations;
    let observed: Vec<Observation> = fit::observations(0, &stations, arm, &noise(kind));
    let settings = FitSettings {
        prior_length_mm: PRIOR_MM,
        prior_angle_mrad: PRIOR_MRAD,
        ..FitSettings::default()
    };
    fit::identify(arm, &observed, 1, Freedom::Geometry, &settings).expect("a fit")
}

/// Errors of one session's identifiable parameters, each over its standard deviation.
fn errors(arm: &Arm, kind: Kind, seed: u64) -> Vec<f64> {
    let mut session = Session::new(kind, arm, seed);
    let rows = session.rows(arm);
    let found = identified(arm, kind, rows);
    let parameters = arm.chain().parameters();
    let error = |(place, unknown): (usize, &fit::Unknown)| {
        let Parameter::Link { .. } = unknown.parameter else {
            return None;
        };
        let own = parameters.iter().position(|own| *own == unknown.parameter)?;
        let sd = found.covariance[(place, place)].sqrt();
        let identifiable = sd < IDENTIFIABLE * found.prior_sd[place]?;
        let off = found.solution.offsets[place] - session.offsets[own];
        identifiable.then_some(off / sd)
    };
    found.unknowns.iter().enumerate().filter_map(error).collect()
}

/// The share of intervals that hold the truth, its standard error over sessions, and the mean squared error.
struct Share {
    inside: f64,
    error: f64,
    mean_square: f64,
    intervals: usize,
}

fn share(arm: &Arm, kind: Kind, sessions: u64) -> Share {
    let all: Vec<Vec<f64>> =
        (0..sessions).into_par_iter().map(|seed| errors(arm, kind, seed)).collect();
    let inside = |own: &Vec<f64>| own.iter().filter(|z| z.abs() <= INTERVAL).count() as f64;
    let intervals: usize = all.iter().map(Vec::len).sum();
    let share = all.iter().map(inside).sum::<f64>() / intervals as f64;
    let off = |own: &Vec<f64>| (inside(own) - share * own.len() as f64).powi(2);
    Share {
        inside: share,
        error: all.iter().map(off).sum::<f64>().sqrt() / intervals as f64,
        mean_square: all.iter().flatten().map(|z| z * z).sum::<f64>() / intervals as f64,
        intervals,
    }
}

fn shown(sessions: u64) -> Vec<(Kind, Share)> {
    let arm = common::arm("ur10");
    let of = |kind: Kind| {
        let share = share(&arm, kind, sessions);
        println!(
            "{:<20} {:>6.2} % ± {:.2} of {:>6} intervals, mean square {:.3}",
            format!("{kind:?}"),
            100.0 * share.inside,
            100.0 * share.error,
            share.intervals,
            share.mean_square,
        );
        (kind, share)
    };
    KINDS.into_iter().map(of).collect()
}

#[test]
fn a_few_sessions_of_each_kind_have_sound_intervals() {
    for (kind, share) in shown(12) {
        assert!(
            (0.88..=1.0).contains(&share.inside) && (0.5..2.0).contains(&share.mean_square),
            "{kind:?}: {} of {}, mean square {}",
            share.inside,
            share.intervals,
            share.mean_square
        );
        // Each kind tells the arm: more than a few parameters count.
        assert!(share.intervals >= 12 * 6, "{kind:?}: {}", share.intervals);
    }
}

#[test]
#[ignore = "a long proof: cargo test --release --test library kinds:: -- --ignored --nocapture"]
fn intervals_of_500_sessions_of_each_kind_hold_95_percent() {
    for (kind, share) in shown(500) {
        let off = (share.inside - 0.95).abs();
        // Seven kinds are asked at once: each may be off by chance with a seventh of 5 %.
        let allowed = TOGETHER * share.error;
        assert!(off <= allowed, "{kind:?}: {:.4} ± {:.4}", share.inside, share.error);
    }
}
