//! Sessions with several sources and targets: two instruments in frames of their own, one of points and one of poses, and three
//! targets at the flange of an arm whose errors are known.

use nalgebra::{DVector, Isometry3, Matrix3, UnitQuaternion, Vector3};

use super::commanded::{self, CommandFrames};
use super::full::next::{Mounted, Mounting, Placed};
use super::full::saved::SavedFull;
use super::full::{FullModel, FullSettings, Purpose, Query};
use super::saved::SavedCalibration;
use super::*;
use crate::geometry::{Base, Flange, Target, Tracker, Transform, isometry_from_rpy};
use crate::join::{
    Command, MeanOrientation, MeanPoint, Pairing, Reading, ReadingKind, Station, Value, one_source,
};
use crate::kinematics::{LinkQuantity, Parameter, RobotFile};
use crate::units::Stamp;

const STATIONS: usize = 120;

fn ur10() -> Arm {
    let text = include_str!("../../../pipelines/robots/ur10.toml");
    let file: RobotFile = toml::from_str(text).expect("a robot file");
    file.arm().expect("a valid arm")
}

/// True poses of the base in the frames of both instruments, and of the three targets on the flange.
fn truth() -> Frames {
    let base = |xyz, rpy| Transform::<Tracker, Base>::claim(isometry_from_rpy(xyz, rpy));
    let target = |xyz, rpy| Transform::<Flange, Target>::claim(isometry_from_rpy(xyz, rpy));
    let sources = vec![
        base([2500.0, -900.0, 400.0], [0.02, -0.01, 2.0]),
        base([-1800.0, 2600.0, 300.0], [-0.01, 0.015, -1.1]),
    ];
    let targets = vec![
        target([10.0, -20.0, 90.0], [0.1, 0.2, -0.3]),
        target([120.0, 40.0, 60.0], [0.0, -0.4, 1.0]),
        target([-80.0, 70.0, 130.0], [0.5, 0.0, 0.2]),
    ];
    Frames::new(sources, targets).expect("some of each")
}

/// Errors of parameters that neither a base nor a target can absorb: 0.4 mm and 0.5 mrad.
fn errors(arm: &Arm) -> Vec<f64> {
    let error = |parameter: &Parameter| match parameter {
        Parameter::Link { joint: 2 | 3, quantity: LinkQuantity::A } => 0.4,
        Parameter::Link { joint: 3..=5, quantity: LinkQuantity::Theta } => -0.5e-3,
        _ => 0.0,
    };
    arm.chain().parameters().iter().map(error).collect()
}

/// Poses without a pattern: an irrational rotation per joint, within 1.2 rad of an ordinary pose.
fn joints(place: usize) -> Vec<f64> {
    let middle = [0.3, -1.4, 1.7, -1.2, -1.1, 0.4];
    let angle = |joint: usize| {
        let turn = (place + 1) as f64 * [2.0, 3.0, 5.0, 7.0, 11.0, 13.0_f64][joint].sqrt();
        middle[joint] + 2.4 * (turn.fract() - 0.5)
    };
    (0..6).map(angle).collect()
}

/// The target's pose in the source's frame at joint angles, without noise.
fn seen(arm: &Arm, joints: &[f64], pair: &FramePair) -> Isometry3<f64> {
    let flange = arm.chain().forward(&arm.axes(joints), &errors(arm));
    pair.tracker_from_base.isometry() * flange * pair.flange_from_target.isometry()
}

/// One dwell: the first instrument reads the position of one target, the second the pose of the next.
fn station(arm: &Arm, number: usize) -> Station {
    let joints = joints(number);
    let reading = |source: usize| {
        let (source, target) = (SourceId(source), TargetId((number + source) % 3));
        let pose = seen(arm, &joints, &truth().pair(source, target));
        let point = MeanPoint {
            position: pose.translation.vector.into(),
            scatter_mm: [0.0; 3],
            stated_covariance: None,
            motion_covariance: None,
        };
        let turn = MeanOrientation {
            orientation: pose.rotation,
            scatter_rad: 0.0,
            stated_covariance: None,
        };
        Reading {
            source,
            target,
            value: Value::of(point, (source.0 == 1).then_some(turn)),
            kept: 20,
            taken: 20,
            first: Stamp::from_ns(0),
            last: Stamp::from_ns(0),
            temperature_c: None,
        }
    };
    Station {
        number,
        start: Stamp::from_ns(0),
        end: Stamp::from_ns(0),
        readings: vec![reading(0), reading(1)],
        joints,
        joint_samples: 50,
        command: None,
        pairing: Pairing::Paired,
    }
}

fn noise() -> Noise {
    let source = |reads, orientation_rad| Source {
        reads,
        uncertainty: TrackerUncertainty {
            range_um: 10.0,
            range_um_per_m: 0.3,
            transverse_um: 15.0,
            transverse_um_per_m: 6.0,
            divisor: 2.0,
            orientation_rad,
        }
        .into(),
    };
    Noise {
        sources: vec![source(ReadingKind::Point, None), source(ReadingKind::Pose, Some(50e-6))],
        repeatability_mm: 0.03,
        stated: Vec::new(),
    }
}

fn stations(arm: &Arm) -> Vec<Station> {
    (0..STATIONS).map(|number| station(arm, number)).collect()
}

fn observed(arm: &Arm) -> Vec<Observation> {
    observations(0, &stations(arm), arm, &noise())
}

fn identified(arm: &Arm) -> Calibration {
    let settings = FitSettings::default();
    identify(arm, &observed(arm), 1, Freedom::Geometry, &settings).expect("a fit")
}

/// Distance of two placements, mm and rad.
fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    let off = a.translation.vector - b.translation.vector;
    (off.norm(), a.rotation.angle_to(&b.rotation))
}

fn assert_same_frames(found: &Frames, wanted: &Frames) {
    assert_eq!(
        (found.sources().len(), found.targets().len()),
        (wanted.sources().len(), wanted.targets().len())
    );
    let sources = found.sources().iter().zip(wanted.sources());
    let sources = sources.map(|(a, b)| apart(a.isometry(), b.isometry()));
    let targets = found.targets().iter().zip(wanted.targets());
    let targets = targets.map(|(a, b)| apart(a.isometry(), b.isometry()));
    for (place, (off_mm, off_rad)) in sources.chain(targets).enumerate() {
        assert!(off_mm < 1e-3 && off_rad < 1e-6, "frame {place}: {off_mm} mm, {off_rad} rad");
    }
}

#[test]
fn each_reading_is_an_observation_of_its_kind() {
    let arm = ur10();
    let observed = observed(&arm);
    assert_eq!(observed.len(), 2 * STATIONS);
    let rows: usize = observed.iter().map(|o| o.measured.kind().rows()).sum();
    assert_eq!(rows, 9 * STATIONS, "three of a point, six of a pose");
    let second = &observed[1];
    assert_eq!((second.source, second.target), (SourceId(1), TargetId(1)));
    // 50 µrad of the instrument, nothing of scatter: the covariance of the rows is block by block what was stated.
    let covariance = second.measured.instrument();
    assert!((covariance[(4, 4)].sqrt() - 50e-6).abs() < 1e-12);
    let point = second.point().expect("a pose has a position");
    assert_eq!(covariance.fixed_view::<3, 3>(0, 0), point.instrument);
}

#[test]
fn two_sources_and_three_targets_are_identified_with_the_geometry() {
    let arm = ur10();
    let found = identified(&arm);
    assert!(found.misfit_mm < 1e-4, "{} mm", found.misfit_mm);
    assert_same_frames(&found.frames[0], &truth());
    let wanted = errors(&arm);
    for (unknown, (found, wanted)) in found.unknowns.iter().zip(found.geometry.iter().zip(wanted)) {
        let tolerance = if unknown.parameter.is_angle() { 1e-6 } else { 1e-3 };
        assert!((found - wanted).abs() < tolerance, "{}: {found} for {wanted}", unknown.parameter);
    }
    // Six of each base, six of each target (turns too, as poses are read), and the geometry.
    let geometry = arm.chain().parameters().len();
    assert_eq!(found.unknowns.len(), geometry + 2 * 6 + 3 * 6);
}

#[test]
fn one_target_does_not_explain_readings_of_three() {
    let arm = ur10();
    let mut observed = observed(&arm);
    for observation in &mut observed {
        observation.target = TargetId::ONLY;
    }
    let found = identify(&arm, &observed, 1, Freedom::Geometry, &FitSettings::default());
    let misfit_mm = found.expect("a fit").misfit_mm;
    // The targets are some 100 mm apart.
    assert!(misfit_mm > 10.0, "{misfit_mm} mm");
}

#[test]
fn the_jacobian_is_the_numerical_one_for_each_source_and_target() {
    let arm = ur10();
    let (observed, starts) = (observed(&arm), [truth()]);
    let prior = Prior::default();
    let problem = Problem::new(&observed, arm.chain(), &starts, Freedom::Geometry, &prior);
    let mut at = DVector::zeros(problem.unknowns.len());
    let errors = DVector::from_vec(errors(&arm));
    at.rows_mut(0, errors.len()).copy_from(&errors);
    // All blocks' rows below each other, each column at the place of its unknown; the residual after them.
    let rows = |at: &DVector<f64>| {
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
    };
    let analytic = rows(&at);
    let (step, last) = (1e-6, at.len());
    for (place, unknown) in problem.unknowns.iter().enumerate() {
        let moved = |by: f64| {
            let mut moved = at.clone();
            moved[place] += by;
            rows(&moved).swap_remove(last)
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

#[test]
fn the_full_error_model_knows_each_source_and_target_and_so_does_its_next_session() {
    let arm = ur10();
    let (start, observed) = (identified(&arm), observed(&arm));
    let settings = FullSettings {
        harmonics: 3,
        gear_lines: false,
        session_scale_ppm: 0.0,
        ..FullSettings::default()
    };
    let (frames, geometry) = (&start.frames, &start.geometry);
    let prior = FitSettings::default().prior();
    let up = Some(Vector3::z_axis());
    let model = FullModel::train(
        &arm,
        &observed,
        (&frames[..], &geometry[..]),
        &prior,
        &settings,
        Purpose::Published,
        up,
    );
    let model = model.expect("a positive covariance");
    let largest = |model: &FullModel| {
        let off = |o: &Observation| {
            let point = o.point().expect("a position").position;
            (model.position(&Query::of(o)) - point).norm()
        };
        observed.iter().map(off).fold(0.0, f64::max)
    };
    assert!(largest(&model) < 1e-2, "{} mm", largest(&model));

    // As text and back.
    let text = serde_json::to_string(&model.saved(&arm, &["mon"])).expect("JSON");
    let read = SavedFull::read(&text).expect("what was written");
    let back = FullModel::from_saved(&read).expect("a full error model");
    assert_same_frames(&back.fitted_frames()[0], &model.fitted_frames()[0]);
    assert!((largest(&back) - largest(&model)).abs() < 1e-6);

    // A new session: the second instrument was moved, the first target mounted again.
    let mounting = Mounting {
        session: 0,
        sources: vec![Placed::Same, Placed::Moved(truth().sources()[1])],
        targets: vec![Mounted::Again { sd_mm: 0.1 }, Mounted::Same, Mounted::Same],
    };
    let next = model.next(&arm, &mounting, STATIONS, &settings, up);
    let next = next.expect("a positive covariance");
    let open = |source: usize, target: usize| {
        let query =
            Query { source: SourceId(source), target: TargetId(target), ..Query::of(&observed[0]) };
        next.covariances(&next.predict(&query).rows)[0].trace().sqrt()
    };
    let (same, again, moved) = (open(0, 1), open(0, 0), open(1, 1));
    // √3 · 0.1 mm more for the target that was mounted again; the moved base is unknown.
    let expected = (same * same + 3.0 * 0.1_f64.powi(2)).sqrt();
    assert!((again - expected).abs() < 0.05, "{again} for {expected}");
    assert!(moved > 100.0 * again, "{moved} mm");
    let starts = mounting.starts(&next.starts()[0], &truth());
    let learned = next.learned(&arm, &observed, starts);
    let learned = learned.expect("a positive covariance");
    assert!(largest(&learned) < 1e-2, "{} mm", largest(&learned));
}

#[test]
fn saved_frames_of_one_are_an_object_and_of_several_a_list() {
    let arm = ur10();
    let several = SavedCalibration::of(&identified(&arm), &arm, &["mon"]);
    let text = serde_json::to_string(&several).expect("JSON");
    let back = SavedCalibration::read(&text).expect("what was written");
    assert_eq!(back.unknowns, several.unknowns);
    assert_same_frames(&back.sessions[0].frames().expect("whole"), &truth());
    assert!(text.contains(r#""tracker_from_base":[{"#));

    let mut one = observed(&arm);
    one.retain(|o| (o.source, o.target) == (SourceId(0), TargetId(0)));
    let settings = FitSettings::default();
    let one = identify(&arm, &one, 1, Freedom::BaseAndTarget, &settings).expect("a fit");
    let text = serde_json::to_string(&SavedCalibration::of(&one, &arm, &["mon"])).expect("JSON");
    assert!(text.contains(r#""tracker_from_base":{"#) && !text.contains(r#""of":"#));
}

#[test]
fn what_is_for_one_source_and_one_target_refuses_several() {
    assert_eq!(truth().one(), None);
    let sources = one_source(&stations(&ur10())).map_err(|several| several.sources);
    assert_eq!(sources, Err(2));
    assert_eq!(truth().main().map_err(|several| several.sources), Err(2));
    let one = FramePair::only(truth().sources()[0], truth().targets()[0]);
    assert_eq!(Frames::from(one).one(), Some(one));

    // A place stated for one target does not apply to three, and targets are numbered without gaps.
    let arm = ur10();
    let settings = FitSettings {
        target: Some(KnownTarget { xyz_mm: [10.0, -20.0, 90.0], sd_mm: 0.1 }),
        ..FitSettings::default()
    };
    let mut observed = observed(&arm);
    let fit = |observed: &[Observation], settings: &FitSettings| {
        identify(&arm, observed, 1, Freedom::BaseAndTarget, settings).map(|_| ())
    };
    assert_eq!(
        fit(&observed, &settings),
        Err(FitError::KnownTargetOfSeveral { session: 0, targets: 3 })
    );
    observed.retain(|o| o.target != TargetId(1));
    assert_eq!(
        fit(&observed, &FitSettings::default()),
        Err(FitError::UnseenTarget { session: 0, target: 1 })
    );
}

#[test]
fn a_source_of_points_takes_no_orientation() {
    let arm = ur10();
    let mut noise = noise();
    noise.sources[1].reads = ReadingKind::Point;
    let observed = observations(0, &stations(&arm), &arm, &noise);
    assert!(observed.iter().all(|o| o.measured.turn().is_none()));
    assert!(!noise.takes_orientations());
    let turned = Measured::Point(MeasuredPoint {
        position: nalgebra::Point3::origin(),
        instrument: Matrix3::identity(),
        factor: Matrix3::identity(),
    });
    let predicted = Isometry3::from_parts(
        [1.0, 2.0, 3.0].into(),
        UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3),
    );
    assert_eq!(turned.residual(&predicted, None), vec![-1.0, -2.0, -3.0]);
}

#[test]
fn a_command_that_the_arm_has_left_is_none() {
    let arm = ur10();
    let mut stations = stations(&arm);
    for own in 0..stations.len() {
        // That of the sixth stays in force, and those of the first two are one.
        let of = match own {
            1 => 0,
            own => own.min(5),
        };
        let flange = arm.flange(&stations[of].joints);
        stations[own].command = Some(Command {
            position: flange.isometry().translation.vector.into(),
            orientation: Some(flange.isometry().rotation),
        });
    }
    stations[1].joints = stations[0].joints.clone();
    let tool = Some(Isometry3::identity());
    let frames = CommandFrames { base_from_command: Isometry3::identity(), flange_from_tool: tool };
    let known = commanded::commanded(&stations, &arm, &frames);
    let are_known: Vec<bool> = known.poses.iter().map(Option::is_some).collect();
    assert_eq!(are_known, [vec![true; 6], vec![false; stations.len() - 6]].concat());
    assert!(known.trust.agrees());
}
