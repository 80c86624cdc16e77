//! Instruments that read one length: what they identify, their rows, and the truth that a fit recovers from them.

use nalgebra::{DVector, Point3, Unit, UnitVector3, Vector3};

use super::full::saved::SavedFull;
use super::full::{FullModel, FullSettings, Purpose};
use super::*;
use crate::geometry::{Base, Flange, Target, Tracker, Transform, isometry_from_rpy};
use crate::kinematics::{GaugePart, LinkQuantity, RobotFile};

const STATIONS: usize = 90;
const TARGET: [f64; 3] = [60.0, 20.0, 80.0];
/// Places of anchors in the base's frame, mm, and the readings at no distance, mm.
const ANCHORS: [([f64; 3], f64); 3] = [
    ([1400.0, 300.0, -200.0], 35.0),
    ([-300.0, 1500.0, 900.0], -12.0),
    ([200.0, -1300.0, 1600.0], 4.0),
];

fn arm() -> Arm {
    let text = include_str!("../../../pipelines/robots/ur10.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

fn anchor(place: usize) -> Sees {
    let (xyz, offset_mm) = ANCHORS[place];
    Sees::Length(Gauge::Distance(Anchor { place: xyz.into(), offset_mm }))
}

fn plane(normal: [f64; 3], height_mm: f64) -> Sees {
    let normal: UnitVector3<f64> = Unit::new_normalize(normal.into());
    Sees::Length(Gauge::Height(Plane::new(normal, height_mm)))
}

fn truth(sees: &[Sees]) -> Frames {
    let base = isometry_from_rpy([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]);
    let base: Transform<Tracker, Base> = Transform::claim(base);
    let target: Transform<Flange, Target> = Transform::claim(isometry_from_rpy(TARGET, [0.0; 3]));
    let frames = Frames::new(vec![base; sees.len()], vec![target]);
    frames.expect("some of each").seeing(sees)
}

fn axes(place: usize) -> Vec<f64> {
    let middle = [0.3, -1.4, 1.7, -1.2, -1.1, 0.4];
    let angle = |joint: usize| {
        let turn = (place + 1) as f64 * [2.0, 3.0, 5.0, 7.0, 11.0, 13.0_f64][joint].sqrt();
        middle[joint] + 2.4 * (turn.fract() - 0.5)
    };
    (0..6).map(angle).collect()
}

/// Standard normal numbers by a sum of twelve uniform ones, from a plain generator: the same on every machine.
struct Normals(u64);

impl Normals {
    fn next(&mut self) -> f64 {
        let uniform = |state: &mut u64| {
            *state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        };
        (0..12).map(|_| uniform(&mut self.0)).sum::<f64>() - 6.0
    }
}

/// Standard deviations of the readings of a source, mm: stated, and of the noise that is put on them.
#[derive(Clone, Copy)]
struct Sizes {
    stated_mm: f64,
    true_mm: f64,
}

const EXACT: Sizes = Sizes { stated_mm: 0.02, true_mm: 0.0 };

/// The readings of each source of `frames` at `stations` stations of an arm with `errors`.
fn seen(
    arm: &Arm,
    frames: &Frames,
    errors: &[f64],
    stations: usize,
    sizes: &[Sizes],
    normals: &mut Normals,
) -> Vec<Observation> {
    let mut observations = Vec::new();
    for station in 0..stations {
        let flange = arm.chain().forward(&axes(station), errors);
        for (source, (sees, sizes)) in frames.sees().iter().zip(sizes).enumerate() {
            let source = SourceId(source);
            let pair = frames.pair(source, TargetId::ONLY);
            let pose =
                pair.tracker_from_base.isometry() * flange * pair.flange_from_target.isometry();
            let place = Point3::from(pose.translation.vector);
            let mut noise = || normals.next() * sizes.true_mm;
            let measured = match sees {
                Sees::Length(gauge) => {
                    let length = MeasuredLength {
                        mm: gauge.reading_mm(&place) + noise(),
                        instrument_mm: sizes.stated_mm,
                        sd_mm: sizes.stated_mm,
                    };
                    match gauge {
                        Gauge::Distance(_) => Measured::Distance(length),
                        Gauge::Height(_) => Measured::Height(length),
                    }
                }
                Sees::Places | Sees::Nothing => Measured::Point(MeasuredPoint {
                    position: place + Vector3::new(noise(), noise(), noise()),
                    instrument: nalgebra::Matrix3::identity() * sizes.stated_mm.powi(2),
                    factor: nalgebra::Matrix3::identity() * sizes.stated_mm,
                }),
            };
            observations.push(Observation {
                source,
                measured,
                ..Observation::planned(station, axes(station), place, nalgebra::Matrix3::identity())
            });
        }
    }
    observations
}

fn exact(arm: &Arm, frames: &Frames, errors: &[f64]) -> Vec<Observation> {
    let sizes = vec![EXACT; frames.sees().len()];
    seen(arm, frames, errors, STATIONS, &sizes, &mut Normals(1))
}

/// Errors of 0.4 mm and 0.5 mrad of parameters that no frame absorbs.
fn errors(arm: &Arm) -> Vec<f64> {
    let error = |parameter: &Parameter| match parameter {
        Parameter::Link { joint: 2 | 3, quantity: LinkQuantity::A } => 0.4,
        Parameter::Link { joint: 3..=5, quantity: LinkQuantity::Theta } => -0.5e-3,
        _ => 0.0,
    };
    arm.chain().parameters().iter().map(error).collect()
}

/// Directions that these sources identify, of instruments, arm and target together.
fn directions(sees: &[Sees]) -> usize {
    let (arm, starts) = (arm(), [truth(sees)]);
    let observed = exact(&arm, &starts[0], &arm.no_offsets());
    let prior = Prior::default();
    let problem = Problem::new(&observed, arm.chain(), &starts, Freedom::Geometry, &prior);
    Structure::of(&problem, &DVector::zeros(problem.unknowns.len())).rank
}

#[test]
fn lengths_identify_the_arm_but_for_what_turns_about_their_anchors() {
    let tilted = plane([0.3, -0.5, 0.8], 250.0);
    let level = plane([0.0, 0.0, 1.0], 250.0);
    // One point: 4 · 6 joints + 6 of a flange whose pose is seen, less the three turns about the point.
    assert_eq!(directions(&[Sees::Places]), 27);
    // No reading of one anchor shows the three turns about it; its offset is one more.
    assert_eq!(directions(&[anchor(0)]), 27 - 3 + 1);
    // Three anchors stand for the tracker's frame (six); their three distances from one another and three offsets are their own.
    assert_eq!(directions(&[anchor(0), anchor(1), anchor(2)]), 27 + 3 + 3);
    // Two lack the turn about their line, and have one distance.
    assert_eq!(directions(&[anchor(0), anchor(1)]), 27 - 1 + 1 + 2);
    // No height shows the two shifts in the plane and the turn about its normal.
    assert_eq!(directions(&[tilted]), 27 - 3);
    // Across the first axis, neither the first link's length nor the shift along the horizontal axes 2 to 4 changes a height.
    assert_eq!(directions(&[level]), 27 - 3 - 2);
    // Beside a tracker each instrument adds its own unknowns and nothing is lost.
    assert_eq!(directions(&[Sees::Places, anchor(0)]), 27 + 4);
    assert_eq!(directions(&[Sees::Places, level]), 27 + 3);
}

/// All blocks' rows below each other, each column at the place of its unknown, and the residual after them.
fn stacked(problem: &Problem<'_>, at: &DVector<f64>) -> Vec<Vec<f64>> {
    let mut columns = vec![Vec::new(); at.len() + 1];
    problem.each_block(at, |block| {
        let unknowns = &block.unknowns;
        let residual = block.column(unknowns.len());
        columns[at.len()].extend_from_slice(residual);
        for (unknown, column) in columns[..at.len()].iter_mut().enumerate() {
            match unknowns.iter().position(|own| *own == unknown) {
                Some(place) => column.extend_from_slice(block.column(place)),
                None => column.extend(vec![0.0; residual.len()]),
            }
        }
    });
    columns
}

#[test]
fn the_rows_of_lengths_are_the_numerical_ones() {
    let arm = arm();
    let sees = [Sees::Places, anchor(0), plane([0.3, -0.5, 0.8], 250.0)];
    let starts = [truth(&sees)];
    let observed = exact(&arm, &starts[0], &errors(&arm));
    let prior = Prior::default();
    let problem = Problem::new(&observed, arm.chain(), &starts, Freedom::Geometry, &prior);
    // Away from the starts, so that tilted normals and residuals are not those of the start.
    let size = |unknown: &Unknown| {
        if unknown.parameter.is_angle() { 1e-2 } else { 1.0 }
    };
    let sizes = problem.unknowns.iter().map(size).enumerate();
    let at = sizes.map(|(place, size)| size * (place as f64 * 0.7).sin());
    let at = DVector::from_vec(at.collect());
    let analytic = stacked(&problem, &at);
    let norms = problem.norms(&at);
    let squares: f64 = analytic[at.len()].iter().map(|r| r * r).sum();
    let expected: f64 = norms.iter().map(|r| r * r).sum();
    assert!((squares / expected - 1.0).abs() < 1e-12, "norms and rows agree");
    for (place, unknown) in problem.unknowns.iter().enumerate() {
        let step = if unknown.parameter.is_angle() { 1e-6 } else { 1e-3 };
        let moved = |by: f64| {
            let mut moved = at.clone();
            moved[place] += by;
            stacked(&problem, &moved).swap_remove(at.len())
        };
        let (ahead, behind) = (moved(step), moved(-step));
        let largest = analytic[place].iter().fold(0.0, |a: f64, b| a.max(b.abs()));
        assert!(largest > 0.0, "{unknown:?} moves something");
        for ((ahead, behind), analytic) in ahead.iter().zip(&behind).zip(&analytic[place]) {
            let numerical = (behind - ahead) / (2.0 * step);
            assert!(
                (numerical - analytic).abs() < 1e-5 * largest + 1e-3,
                "{unknown:?}: {numerical} for {analytic}"
            );
        }
    }
}

/// The anchor of a source; a plane's normal and height otherwise.
fn assert_same_gauges(found: &Frames, wanted: &Frames, tolerance_mm: f64) {
    for (found, wanted) in found.sees().iter().zip(wanted.sees()) {
        let (off_mm, off) = match (found, wanted) {
            (Sees::Length(Gauge::Distance(a)), Sees::Length(Gauge::Distance(b))) => {
                ((a.place - b.place).norm(), a.offset_mm - b.offset_mm)
            }
            (Sees::Length(Gauge::Height(a)), Sees::Length(Gauge::Height(b))) => {
                (1e3 * a.normal.angle(&b.normal), a.height_mm - b.height_mm)
            }
            (a, b) => {
                assert_eq!(a, b);
                (0.0, 0.0)
            }
        };
        assert!(
            off_mm < tolerance_mm && off.abs() < tolerance_mm,
            "{off_mm} mm and {off} mm: {found:?} for {wanted:?}"
        );
    }
}

#[test]
fn anchors_and_planes_are_found_from_lengths_alone() {
    let arm = arm();
    for sees in [
        vec![anchor(0)],
        vec![anchor(1)],
        vec![anchor(2)],
        vec![anchor(0), anchor(1), anchor(2)],
        vec![plane([0.3, -0.5, 0.8], 250.0)],
        vec![plane([0.0, 0.0, -1.0], -250.0), plane([1.0, 0.1, 0.0], 900.0)],
        vec![Sees::Places, anchor(1), plane([0.0, 1.0, 0.2], -400.0)],
    ] {
        let wanted = truth(&sees);
        let observed = exact(&arm, &wanted, &arm.no_offsets());
        let settings = FitSettings::default();
        let found = identify(&arm, &observed, 1, Freedom::BaseAndTarget, &settings).expect("a fit");
        assert!(found.misfit_mm < 1e-4, "{} mm", found.misfit_mm);
        assert_same_gauges(&found.frames[0], &wanted, 1e-3);
    }
}

#[test]
fn errors_of_the_arm_are_found_from_three_anchors_alone() {
    let arm = arm();
    let wanted = truth(&[anchor(0), anchor(1), anchor(2)]);
    let observed = exact(&arm, &wanted, &errors(&arm));
    let found = identify(&arm, &observed, 1, Freedom::Geometry, &FitSettings::default());
    let found = found.expect("a fit");
    assert!(found.misfit_mm < 1e-4, "{} mm", found.misfit_mm);
    assert_eq!(found.nominal_structure.rank, 33);
    let pairs = found.geometry.iter().zip(errors(&arm));
    for (unknown, (found, wanted)) in found.unknowns.iter().zip(pairs) {
        let tolerance = if unknown.parameter.is_angle() { 2e-6 } else { 2e-3 };
        assert!((found - wanted).abs() < tolerance, "{}: {found} for {wanted}", unknown.parameter);
    }
}

/// Standard deviations of the geometry that sessions are drawn with, mm and mrad; the prior of their fits.
const GEOMETRY: (f64, f64) = (0.4, 0.4);

fn drawn_settings() -> FitSettings {
    FitSettings {
        prior_length_mm: GEOMETRY.0,
        prior_angle_mrad: GEOMETRY.1,
        ..FitSettings::default()
    }
}

/// An arm whose errors are drawn from the prior.
fn drawn_errors(arm: &Arm, normals: &mut Normals) -> Vec<f64> {
    let size = |parameter: &Parameter| {
        if parameter.is_angle() { GEOMETRY.1 * 1e-3 } else { GEOMETRY.0 }
    };
    let parameters = arm.chain().parameters();
    parameters.iter().map(|own| size(own) * normals.next()).collect()
}

/// A simulated session of known truth, and its fit.
struct Drawn {
    errors: Vec<f64>,
    wanted: Frames,
    found: Calibration,
}

impl Drawn {
    fn new(arm: &Arm, seed: u64, sees: &[Sees], stations: usize, sizes: &[Sizes]) -> Self {
        let mut normals = Normals(seed);
        let (errors, wanted) = (drawn_errors(arm, &mut normals), truth(sees));
        let observed = seen(arm, &wanted, &errors, stations, sizes, &mut normals);
        let found = identify(arm, &observed, 1, Freedom::Geometry, &drawn_settings());
        Self { errors, wanted, found: found.expect("a fit") }
    }

    /// Found minus true in standard errors, of each parameter of the arm and of each instrument of lengths.
    fn off(&self) -> Vec<f64> {
        let gauge =
            |source: SourceId| self.found.frames[0].gauge(source).zip(self.wanted.gauge(source));
        let unknowns = self.found.unknowns.iter().enumerate();
        let off = unknowns.filter_map(|(place, unknown)| {
            let away = match (unknown.owner, unknown.parameter) {
                (Owner::Arm, _) => self.found.geometry[place] - self.errors[place],
                (Owner::Source { source, .. }, Parameter::Gauge(part)) => {
                    part_off(gauge(source)?, part)
                }
                _ => return None,
            };
            Some(away / self.found.standard_error(place))
        });
        off.collect()
    }
}

/// Found minus true of one part, mm or rad.
fn part_off((found, wanted): (&Gauge, &Gauge), part: GaugePart) -> f64 {
    match (found, wanted, part) {
        (Gauge::Distance(a), Gauge::Distance(b), GaugePart::Place(axis)) => {
            (a.place - b.place).dot(&axis.unit())
        }
        (Gauge::Distance(a), Gauge::Distance(b), GaugePart::Offset) => a.offset_mm - b.offset_mm,
        (Gauge::Height(a), Gauge::Height(b), GaugePart::Height) => a.height_mm - b.height_mm,
        (Gauge::Height(_), Gauge::Height(b), part) => {
            // Readings change with a tilt as the normal does: on a target far out along it.
            let far = Point3::from(*b.normal * 0.0);
            let along = |on: &Gauge, at: &Point3<f64>| on.by_part(part, at);
            let axis = Vector3::from_fn(|row, _| {
                let mut at = far;
                at[row] += 1.0;
                along(wanted, &at)
            });
            let Gauge::Height(a) = found else { return f64::NAN };
            a.normal.dot(&axis)
        }
        _ => f64::NAN,
    }
}

/// Sessions of a tracker, a distance and a height, of distances alone, and of heights alone.
fn kinds() -> [(Vec<Sees>, Vec<Sizes>); 3] {
    let of = |true_mm: f64| Sizes { stated_mm: 0.03, true_mm };
    let tilted = plane([0.3, -0.5, 0.8], 250.0);
    [
        (vec![Sees::Places, anchor(1), tilted], vec![of(0.03), of(0.09), of(0.015)]),
        (vec![anchor(0), anchor(1), anchor(2)], vec![of(0.03), of(0.03), of(0.06)]),
        (vec![tilted], vec![of(0.05)]),
    ]
}

/// Share of the 95 % intervals of `sessions` sessions of each kind that contain the truth, session by session.
fn covered(sessions: u64) -> Vec<f64> {
    let arm = arm();
    let each = (0..sessions).flat_map(|seed| kinds().into_iter().map(move |kind| (seed, kind)));
    let share = |(seed, (sees, sizes)): (u64, (Vec<Sees>, Vec<Sizes>))| {
        let off = Drawn::new(&arm, 1000 + seed, &sees, STATIONS, &sizes).off();
        let inside = off.iter().filter(|off| off.abs() < 1.96).count();
        inside as f64 / off.len() as f64
    };
    each.map(share).collect()
}

/// Mean, and the standard error of it.
fn mean(shares: &[f64]) -> (f64, f64) {
    let n = shares.len() as f64;
    let mean = shares.iter().sum::<f64>() / n;
    let squares: f64 = shares.iter().map(|share| (share - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0) / n).sqrt())
}

#[test]
fn intervals_of_a_handful_of_sessions_contain_the_truth() {
    let shares = covered(4);
    let (mean, _) = mean(&shares);
    assert!(mean > 0.90 && mean < 0.995, "{mean}: {shares:?}");
}

#[test]
#[ignore = "300 sessions: minutes"]
fn ninety_five_percent_of_intervals_contain_the_truth() {
    let (mean, error) = mean(&covered(100));
    assert!((mean - 0.95).abs() < 2.0 * error + 0.005, "{mean} ± {error}");
}

#[test]
fn the_size_of_each_sources_noise_is_found() {
    let arm = arm();
    let sees = [Sees::Places, anchor(1)];
    let wrong =
        [Sizes { stated_mm: 0.03, true_mm: 0.03 }, Sizes { stated_mm: 0.02, true_mm: 0.06 }];
    let drawn = Drawn::new(&arm, 7, &sees, 400, &wrong);
    let [tracker, distance] = &drawn.found.sources[..] else {
        panic!("two sources: {:?}", drawn.found.sources);
    };
    assert_eq!((tracker.rows, distance.rows), (1200, 400));
    assert!((distance.stated_mm - 0.02).abs() < 1e-9, "{distance:?}");
    for (own, wanted) in [(tracker, 1.0), (distance, 3.0)] {
        let error = own.factor_error().expect("redundant readings");
        assert!(error < 0.05 * own.factor, "{own:?}");
        assert!((own.factor - wanted).abs() < 3.0 * error, "{own:?} for {wanted}");
    }
    // What the unknowns took from the readings, and the prior's part of them.
    let taken = 1600.0 - tracker.redundancy - distance.redundancy;
    let shares = sources::shares(&drawn.found.sources);
    let unknowns = drawn.found.unknowns.len() as f64;
    assert!((taken / unknowns - shares).abs() < 1e-9);
    assert!(shares > 0.7 && shares < 1.0, "{shares}");
    assert!(tracker.share > distance.share);
}

#[test]
fn one_sources_share_is_what_the_prior_leaves() {
    let arm = arm();
    let sizes = [kinds()[0].1[0]];
    let drawn = Drawn::new(&arm, 3, &[Sees::Places], 100, &sizes);
    let [own] = &drawn.found.sources[..] else {
        panic!("one source");
    };
    // 27 directions of all unknowns are the readings', but for what the prior adds to them.
    assert!((own.share * drawn.found.unknowns.len() as f64 - 27.0).abs() < 1.5, "{own:?}");
    assert!((own.factor - 1.0).abs() < 4.0 * own.factor_error().expect("redundant"), "{own:?}");
}

/// Root mean square error of predicted targets in the tracker's frame at poses that were not measured, mm.
fn wrong_by(arm: &Arm, drawn: &Drawn) -> f64 {
    let at = |frames: &Frames, offsets: &[f64], place: usize| {
        let pair = frames.pair(SourceId::ONLY, TargetId::ONLY);
        let flange = arm.chain().forward(&axes(place), offsets);
        let pose = pair.tracker_from_base.isometry() * flange * pair.flange_from_target.isometry();
        pose.translation.vector
    };
    let off = |place: usize| {
        let found = at(&drawn.found.frames[0], &drawn.found.geometry, place);
        (found - at(&drawn.wanted, &drawn.errors, place)).norm_squared()
    };
    ((1000..1200).map(off).sum::<f64>() / 200.0).sqrt()
}

#[test]
fn sources_together_predict_better_than_one_and_than_by_their_stated_sizes() {
    let arm = arm();
    // The tracker is three times worse than stated, the distances three times better.
    let sizes = [(0.03, 0.09), (0.09, 0.03), (0.09, 0.03), (0.09, 0.03)];
    let sizes = sizes.map(|(stated_mm, true_mm)| Sizes { stated_mm, true_mm });
    let sees = [Sees::Places, anchor(0), anchor(1), anchor(2)];
    let (mut together, mut alone, mut stated) = (0.0, 0.0, 0.0);
    for seed in 0..6 {
        let drawn = Drawn::new(&arm, 50 + seed, &sees, 60, &sizes);
        together += wrong_by(&arm, &drawn).powi(2);
        alone += wrong_by(&arm, &Drawn::new(&arm, 50 + seed, &sees[..1], 60, &sizes)).powi(2);
        let mut normals = Normals(50 + seed);
        let errors = drawn_errors(&arm, &mut normals);
        let observed = seen(&arm, &drawn.wanted, &errors, 60, &sizes, &mut normals);
        let settings = drawn_settings();
        let starts = start::frames(&arm, &observed, 1, &settings).expect("a start");
        let found = identify_sized(&arm, &observed, &starts, Freedom::Geometry, &settings, None);
        stated += wrong_by(&arm, &Drawn { found, ..drawn }).powi(2);
    }
    let [together, alone, stated] = [together, alone, stated].map(|sum: f64| (sum / 6.0).sqrt());
    assert!(together < 0.8 * alone, "{together} mm, alone {alone} mm");
    assert!(together < 0.95 * stated, "{together} mm, by stated sizes {stated} mm");
}

#[test]
fn the_full_error_model_learns_from_lengths() {
    let arm = arm();
    let (sees, sizes) = kinds()[0].clone();
    let mut normals = Normals(11);
    let wanted = truth(&sees);
    let observed = seen(&arm, &wanted, &errors(&arm), STATIONS, &sizes, &mut normals);
    let settings = FitSettings::default();
    let start = identify(&arm, &observed, 1, Freedom::Geometry, &settings).expect("a fit");
    let full = FullSettings {
        harmonics: 2,
        gear_lines: false,
        drift: false,
        session_scale_ppm: 0.0,
        ..FullSettings::default()
    };
    let (frames, geometry) = (&start.frames, &start.geometry);
    let model = FullModel::train(
        &arm,
        &observed,
        (&frames[..], &geometry[..]),
        &settings.prior(),
        &full,
        Purpose::Published,
        None,
    );
    let model = model.expect("a positive covariance");
    assert_same_gauges(&model.fitted_frames()[0], &wanted, 0.5);
    // Distances three times worse than stated, heights twice better; the arm's repeatability takes a part of it.
    let [_, distances, heights] = &model.trained.repeatability.lengths[..] else {
        panic!("three sources: {:?}", model.trained.repeatability.lengths);
    };
    assert!(distances.sqrt() > 1.5 && distances.sqrt() < 4.0, "{distances}");
    assert!(heights.sqrt() < 1.1, "{heights}");
    // As text and back.
    let text = serde_json::to_string(&model.saved(&arm, &["mon"])).expect("JSON");
    let back = FullModel::from_saved(&SavedFull::read(&text).expect("what was written"));
    let back = back.expect("a full error model");
    assert_same_gauges(&back.fitted_frames()[0], &model.fitted_frames()[0], 1e-6);
}

#[test]
fn too_few_lengths_are_refused() {
    let arm = arm();
    let wanted = truth(&[Sees::Places, anchor(0)]);
    let mut observed = exact(&arm, &wanted, &arm.no_offsets());
    observed.retain(|o| o.source == SourceId::ONLY || o.station < 7);
    let found = identify(&arm, &observed, 1, Freedom::BaseAndTarget, &FitSettings::default());
    let said = found.map(|_| ()).expect_err("seven readings").to_string();
    assert!(said.contains("7 readings") && said.contains("at least 8"), "{said}");
}

/// A session of one of the [`kinds`] of an arm with drawn errors, with wrong numbers: the source, the station and what is added, mm.
fn with_wrong(kind: usize, seed: u64, wrong: &[(usize, usize, f64)]) -> (Arm, Vec<Observation>) {
    let (arm, mut normals) = (arm(), Normals(seed));
    let (sees, sizes) = kinds()[kind].clone();
    let errors = drawn_errors(&arm, &mut normals);
    let wanted = truth(&sees);
    let mut observed = seen(&arm, &wanted, &errors, STATIONS, &sizes, &mut normals);
    for own in &mut observed {
        let mut added = wrong.iter();
        let added = added.find(|(source, at, _)| (own.source.0, own.station) == (*source, *at));
        if let (Some((_, _, mm)), Measured::Distance(length) | Measured::Height(length)) =
            (added, &mut own.measured)
        {
            length.mm += mm;
        }
    }
    (arm, observed)
}

/// The source and the station of each reading that the gate takes for a wrong number.
fn taken(arm: &Arm, observed: &[Observation]) -> Vec<(usize, usize)> {
    let noise = Noise { sources: Vec::new(), repeatability_mm: 0.0, stated: Vec::new() };
    let wrong = wrong_lengths::check(arm, observed, 1, &drawn_settings(), &noise);
    let wrong = wrong.expect("one target").into_iter();
    wrong.map(|own| (own.source.expect("one reading").0, own.station)).collect()
}

#[test]
fn wrong_numbers_of_millimetres_and_of_metres_are_found() {
    let wrong = [
        (1, 4, 3.0),
        (1, 30, 2000.0),
        (2, 31, -1000.0),
        (2, 60, -2.0),
        (1, 61, 40.0),
        (1, 88, -0.9e3),
    ];
    let mut wanted: Vec<_> = wrong.iter().map(|(source, at, _)| (*source, *at)).collect();
    wanted.sort_by_key(|(source, at)| (*at, *source));
    for kind in 0..2 {
        for seed in 0..3 {
            let (arm, observed) = with_wrong(kind, 400 + seed, &wrong);
            let found = taken(&arm, &observed);
            assert_eq!(found, wanted, "kind {kind}, seed {seed}");
        }
    }
}

#[test]
fn readings_behind_a_slip_of_the_wire_are_found() {
    let slipped: Vec<(usize, usize, f64)> = (75..STATIONS).map(|at| (1, at, 6.0)).collect();
    let wanted: Vec<(usize, usize)> =
        slipped.iter().map(|(source, at, _)| (*source, *at)).collect();
    let (arm, observed) = with_wrong(0, 9, &slipped);
    assert_eq!(taken(&arm, &observed), wanted);
}

#[test]
fn sound_readings_are_hardly_ever_taken_for_wrong_numbers() {
    let sessions = (0..24).flat_map(|seed| (0..3).map(move |kind| (kind, seed)));
    let wrong = sessions.map(|(kind, seed)| {
        let (arm, observed) = with_wrong(kind, 700 + seed, &[]);
        taken(&arm, &observed).len()
    });
    let wrong: usize = wrong.sum();
    assert!(wrong <= 1, "{wrong} readings in 72 sessions");
}

#[test]
fn the_start_is_not_moved_by_wrong_numbers() {
    let arm = arm();
    for sees in [anchor(1), plane([0.3, -0.5, 0.8], 250.0)] {
        let wanted = truth(&[sees]);
        let mut observed = exact(&arm, &wanted, &arm.no_offsets());
        for (place, own) in observed.iter_mut().enumerate() {
            if let Measured::Distance(length) | Measured::Height(length) = &mut own.measured
                && place % 9 == 0
            {
                length.mm += if place % 2 == 0 { 3000.0 } else { -700.0 };
            }
        }
        let settings = FitSettings { loss: Loss::Cauchy { tuning: 2.0 }, ..FitSettings::default() };
        let found = identify(&arm, &observed, 1, Freedom::BaseAndTarget, &settings).expect("a fit");
        assert_same_gauges(&found.frames[0], &wanted, 1e-3);
    }
}
