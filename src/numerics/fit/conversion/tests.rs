//! One arm in every convention: fitted to the same stations it predicts the same, and its errors are carried from one to the other.

use std::ops::Range;

use nalgebra::{UnitQuaternion, Vector3};

use super::*;
use crate::fit::{
    Calibration, FitSettings, Frames, Freedom, Noise, Observation, Prior, Problem, Source,
    Structure, TrackerUncertainty, identify_from, observations,
};
use crate::geometry::{Base, Flange, Target, Tracker, Transform, isometry_from_rpy};
use crate::join::{
    MeanOrientation, MeanPoint, Pairing, Reading, ReadingKind, SourceId, Station, TargetId, Value,
};
use crate::kinematics::{Convention, LinkQuantity, RobotFile};
use crate::units::Stamp;

pub(crate) const FILES: [&str; 2] = [
    include_str!("../../../../pipelines/robots/kr210-r2700-extra.toml"),
    include_str!("../../../../pipelines/robots/ur10.toml"),
];
const STATIONS: usize = 250;
/// Standard deviation of the readings, mm and rad.
const NOISE_MM: f64 = 0.02;
const NOISE_RAD: f64 = 1e-4;

fn file(text: &str) -> RobotFile {
    toml::from_str(text).expect("a robot file")
}

fn in_convention(text: &str, convention: Convention) -> Arm {
    let restated = file(text).restated(convention).expect("the same arm");
    restated.arm().expect("an arm")
}

/// Numbers without a pattern between −1 and 1, of standard deviation 0.58.
fn irregular(place: usize) -> f64 {
    let number = ((place + 1) as f64 * 0.754_877_666_246_693).fract() * 7919.0;
    2.0 * number.fract() - 1.0
}

/// The true arm: six errors at every joint, 0.2 mm and 0.2 mrad.
pub(crate) struct Truth {
    pub(crate) arm: Arm,
    offsets: Vec<f64>,
    pub(crate) frames: Frames,
    /// Moves the joints from where they are reported to where they are, and gives what is added to the seen position, mm.
    pub(crate) beyond: fn(&mut [f64]) -> Vector3<f64>,
}

impl Truth {
    pub(crate) fn new(text: &str, target_mm: [f64; 3]) -> Self {
        let urdf = file(text).restated(Convention::Urdf);
        Self::of(&urdf.expect("the same arm"), target_mm)
    }

    fn of(urdf: &RobotFile, target_mm: [f64; 3]) -> Self {
        let arm = urdf.arm().expect("an arm");
        let parameters = arm.chain().parameters();
        let error =
            |(place, parameter): (usize, &Parameter)| irregular(place) * 0.35 * size(parameter);
        let offsets = parameters.iter().enumerate().map(error).collect();
        let base = isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]);
        let target = isometry_from_rpy(target_mm, [0.1, 0.2, -0.3]);
        let frames = Frames::new(
            vec![Transform::<Tracker, Base>::claim(base)],
            vec![Transform::<Flange, Target>::claim(target)],
        );
        Self { arm, offsets, frames: frames.expect("one of each"), beyond: |_| Vector3::zeros() }
    }

    /// This arm with each of its errors multiplied by `factor`.
    pub(crate) fn times(mut self, factor: f64) -> Self {
        self.offsets.iter_mut().for_each(|offset| *offset *= factor);
        self
    }

    /// Joint angles of a station, within the middle three quarters of the ranges.
    fn joints(&self, place: usize) -> Vec<f64> {
        let own = spread_joints(&self.arm, u32::try_from(place).expect("few"));
        let within = |(joint, q): (&crate::kinematics::Joint, &f64)| {
            let middle = 0.5 * (joint.lower + joint.upper);
            middle + 0.75 * (q - middle)
        };
        self.arm.joints().iter().zip(&own).map(within).collect()
    }

    fn station(&self, place: usize, poses: bool) -> Station {
        let joints = self.joints(place);
        let mut actual = joints.clone();
        let shift = (self.beyond)(&mut actual);
        let pair = self.frames.pair(SourceId::ONLY, TargetId::ONLY);
        let flange = self.arm.chain().forward(&self.arm.axes(&actual), &self.offsets);
        let seen = pair.tracker_from_base.isometry() * flange * pair.flange_from_target.isometry();
        let noise = |first: usize| {
            Vector3::from_fn(|axis, _| irregular(17 * place + 3 * axis + first) / 0.58)
        };
        let point = MeanPoint {
            position: (seen.translation.vector + noise(0) * NOISE_MM + shift).into(),
            scatter_mm: [0.0; 3],
            stated_covariance: None,
            motion_covariance: None,
        };
        let turn = MeanOrientation {
            orientation: seen.rotation * UnitQuaternion::from_scaled_axis(noise(9) * NOISE_RAD),
            scatter_rad: 0.0,
            stated_covariance: None,
        };
        Station {
            number: place,
            start: Stamp::from_ns(0),
            end: Stamp::from_ns(0),
            readings: vec![Reading {
                source: SourceId::ONLY,
                target: TargetId::ONLY,
                value: Value::of(point, poses.then_some(turn)),
                kept: 20,
                taken: 20,
                first: Stamp::from_ns(0),
                last: Stamp::from_ns(0),
                temperature_c: None,
            }],
            joints,
            joint_samples: 50,
            command: None,
            pairing: Pairing::Paired,
        }
    }

    pub(crate) fn observed(&self, poses: bool) -> Vec<Observation> {
        self.observed_at(0..STATIONS, poses)
    }

    /// The stations of these places; those from [`STATIONS`] on are at other poses.
    pub(crate) fn observed_at(&self, places: Range<usize>, poses: bool) -> Vec<Observation> {
        let stations: Vec<Station> = places.map(|place| self.station(place, poses)).collect();
        let noise = Noise {
            sources: vec![Source {
                reads: if poses { ReadingKind::Pose } else { ReadingKind::Point },
                uncertainty: TrackerUncertainty {
                    range_um: 20.0,
                    range_um_per_m: 0.0,
                    transverse_um: 20.0,
                    transverse_um_per_m: 0.0,
                    divisor: 1.0,
                    orientation_rad: poses.then_some(NOISE_RAD),
                }
                .into(),
            }],
            repeatability_mm: 0.0,
            stated: Vec::new(),
        };
        observations(0, &stations, &self.arm, &noise)
    }
}

fn fitted(truth: &Truth, arm: &Arm, seen: &[Observation], prior: bool) -> Calibration {
    let size = if prior { 3.0 } else { 0.0 };
    let settings = FitSettings {
        prior_length_mm: size,
        prior_angle_mrad: size,
        repeatability_mm: 0.0,
        ..FitSettings::default()
    };
    identify_from(arm, seen, std::slice::from_ref(&truth.frames), Freedom::Geometry, &settings)
}

/// Positions of the target at poses that took no part.
fn predicted(truth: &Truth, arm: &Arm, found: &Calibration) -> Vec<Vector3<f64>> {
    let pair = found.frames[0].pair(SourceId::ONLY, TargetId::ONLY);
    let at = |place: usize| {
        let flange = found.chain.nominal(&arm.axes(&truth.joints(place)));
        let target =
            pair.tracker_from_base.isometry() * flange * pair.flange_from_target.isometry();
        target.translation.vector
    };
    (STATIONS..STATIONS + 300).map(at).collect()
}

fn largest(a: &[Vector3<f64>], b: &[Vector3<f64>]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn every_convention_fits_and_predicts_alike() {
    let off_axis = [60.0, -35.0, 110.0];
    let cases = [(true, off_axis, 30), (false, off_axis, 27), (false, [0.0, 0.0, 110.0], 25)];
    for text in FILES {
        for (poses, target_mm, rank) in cases {
            let truth = Truth::new(text, target_mm);
            let seen = truth.observed(poses);
            let mut first: Option<Vec<Vector3<f64>>> = None;
            for convention in Convention::ALL {
                let arm = in_convention(text, convention);
                let found = fitted(&truth, &arm, &seen, rank == 25);
                assert_eq!(found.nominal_structure.rank, rank, "{} {convention:?}", arm.model());
                let own = predicted(&truth, &arm, &found);
                let first = first.get_or_insert_with(|| own.clone());
                let apart = largest(first, &own);
                assert!(apart < 1e-4, "{} {convention:?} poses {poses}: {apart:e} mm", arm.model());
            }
        }
    }
}

/// The errors of a fit, as those of its chain from base to target.
fn errors_of(found: &Calibration) -> Errors {
    let parameters: Vec<Parameter> = found.unknowns.iter().map(|own| own.parameter).collect();
    Errors {
        parameters,
        offsets: found.solution.offsets.clone(),
        covariance: found.covariance.clone(),
    }
}

/// The covariance of the predicted target at poses that took no part, as standard deviations, mm.
fn spread(truth: &Truth, arm: &Arm, errors: &Errors) -> Vec<f64> {
    let pair = truth.frames.pair(SourceId::ONLY, TargetId::ONLY);
    let chain = measured(arm.chain(), pair.flange_from_target.isometry());
    let offsets = errors.of(&chain);
    let at = |place: usize| {
        let axes = arm.axes(&truth.joints(place));
        let rows = jacobian(&chain, &offsets, std::iter::once(&axes));
        let rows = errors.columns(&chain, &rows.rows(0, 3).into_owned());
        (&rows * &errors.covariance * rows.transpose()).trace().sqrt()
    };
    (STATIONS..STATIONS + 50).map(at).collect()
}

#[test]
fn errors_are_carried_with_their_covariance() {
    let target_mm = [60.0, -35.0, 110.0];
    for text in FILES {
        let truth = Truth::new(text, target_mm);
        let seen = truth.observed(true);
        let from = in_convention(text, Convention::StandardDh);
        let found = fitted(&truth, &from, &seen, true);
        let errors = errors_of(&found);
        let pair = truth.frames.pair(SourceId::ONLY, TargetId::ONLY);
        for convention in Convention::ALL {
            let to = in_convention(text, convention);
            let carried = converted(&from, &errors, &to, pair.flange_from_target.isometry());
            assert!(carried.left_mm < 1e-9 && carried.left_rad < 1e-12);
            let own = spread(&truth, &from, &errors);
            let other = spread(&truth, &to, &carried.errors);
            for (own, other) in own.iter().zip(&other) {
                assert!((own - other).abs() < 1e-6 * own, "{convention:?}: {own} {other}");
            }
        }
    }
}

/// The arm with a tilt between its second and third axes, which were parallel, in the plane of the two.
fn tilted(degrees: f64) -> RobotFile {
    let mut file = file(FILES[1]).restated(Convention::Urdf).expect("the same arm");
    let [x, y, z] = file.joint[2].axis.expect("an axis");
    let along = Vector3::new(1.0, 0.0, 0.0);
    let axis = Vector3::new(x, y, z) + along * degrees.to_radians().tan();
    file.joint[2].axis = Some(axis.into());
    file
}

/// The chain of a DH table without Hayati's β: every d free.
fn without_beta(arm: &Arm) -> Arm {
    let elements = arm.chain().elements().iter();
    let elements = elements.filter(|element| {
        !matches!(element.parameter(), Some(Parameter::Link { quantity: LinkQuantity::Beta, .. }))
    });
    arm.with_chain(Chain::new(elements.cloned().collect()))
}

/// Condition of the column-scaled Jacobian over the 27 directions that an arm has.
fn condition(truth: &Truth, arm: &Arm, seen: &[Observation]) -> f64 {
    let starts = std::slice::from_ref(&truth.frames);
    let problem = Problem::new(seen, arm.chain(), starts, Freedom::Geometry, &Prior::default());
    let found = Structure::of(&problem, &DVector::zeros(problem.unknowns.len()));
    found.singular_values[0] / found.singular_values[26].max(1e-300)
}

#[test]
fn nearly_parallel_axes_are_well_conditioned_where_no_common_normal_is_needed() {
    let placed = [Convention::Cpc, Convention::Poe, Convention::MinimalPoe, Convention::Urdf];
    for degrees in [0.1, 0.2, 0.4, 1.0, 5.0, 30.0] {
        let file = tilted(degrees);
        let truth = Truth::of(&file, [60.0, -35.0, 110.0]);
        let seen = truth.observed(false);
        let of =
            |convention| file.restated(convention).expect("the same arm").arm().expect("an arm");
        let plain = condition(&truth, &without_beta(&of(Convention::MdH)), &seen);
        let with_beta = condition(&truth, &of(Convention::StandardDh), &seen);
        let s_model = condition(&truth, &of(Convention::SModel), &seen);
        let placed = placed.map(|convention| condition(&truth, &of(convention), &seen));
        println!(
            "{degrees:>5}°: DH {plain:.0}, with β {with_beta:.0}, S-model {s_model:.0}, CPC, POE, minimal POE and URDF {placed:.0?}"
        );
        assert!(placed.iter().all(|&condition| condition < 20.0), "{degrees}°: {placed:?}");
        // A common normal goes with the inverse of the angle, and its condition with the inverse squared; Stone's model has one too.
        let common_normal = 25_000.0 / degrees.powi(2);
        for table in [plain, s_model].into_iter().filter(|_| degrees < 10.0) {
            assert!((0.5..2.0).contains(&(table / common_normal)), "{degrees}°: {table}");
        }
    }
}
