//! Three reflectors at the flange of a simulated arm, beside the 6-DoF target that sits there.

use crate::common;

use std::collections::BTreeMap;
use std::fs::File;
use std::io::BufWriter;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use posegrid::compensation::{
    ArmModel, Corrected, Covariances, IdentifiedArm, Target, TargetJoints, Validity,
};
use posegrid::fit::flange::turn_behind;
use posegrid::fit::full::FullSettings;
use posegrid::fit::{
    self, Calibration, ErrorBase, FitSettings, Freedom, KnownTarget, Noise, Observation,
    SurveyedBase,
};
use posegrid::geometry::{Transform, isometry_from_rpy};
use posegrid::ingest::{LoggedTarget, TargetName, TargetReadings};
use posegrid::io::log::SessionLogs;
use posegrid::io::log_writer::{TrackerLog, write_controller_log};
use posegrid::io::tables::residuals;
use posegrid::join::{
    JoinSettings, Joined, MeanOrientation, MeanPoint, Pairing, Reading, ReadingKind, SourceId,
    Station, TargetId, Unmeasured, Value, join,
};
use posegrid::judgement::{JoinedSession, Outcome, StageSettings};
use posegrid::kinematics::{Arm, Parameter};
use posegrid::report::{Accuracy, Angles, Model, Point, Split};
use posegrid::simulate::settings::{GeometryErrors, JointErrors, TrackerErrors};
use posegrid::simulate::{
    ArmErrors, Commanded, Poses, SimulateSettings, Simulated, simulate, visits,
};
use posegrid::units::{ClockModel, Stamp, Tracker};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const HOME_DEG: [f64; 6] = [0.0, -75.0, 100.0, 25.0, 55.0, -15.0];
/// The 6-DoF target, which is the controller's tool point, and the tip 200 mm before it.
const TOOL_MM: [f64; 3] = [25.0, -40.0, 100.0];
const LEVER_MM: [f64; 3] = [0.0, 0.0, 200.0];
/// Reflectors beside the 6-DoF target, along its axes, mm; the first is in its place.
const PLACES: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [110.0, 20.0, -15.0], [30.0, 130.0, 10.0]];
/// Standard deviation of a coordinate of a reading, mm: the transverse part of the data sheet at some four metres.
const NOISE_MM: f64 = 0.02;
/// That of an orientation about an axis, rad, as such noise on such places leaves it.
const NOISE_RAD: f64 = 2e-4;

fn tool() -> Isometry3<f64> {
    isometry_from_rpy(TOOL_MM, [0.0; 3])
}

/// Random poses about a home: of a realistic arm, or of one with wrong lengths and angles alone.
fn simulated(arm: &Arm, count: usize, realistic: bool) -> Simulated {
    simulate(arm, &day(7, count, realistic)).expect("in reach")
}

/// A session of the arm; `seed` draws its poses.
fn day(seed: u64, count: usize, realistic: bool) -> SimulateSettings {
    let home: Vec<f64> = HOME_DEG.map(f64::to_radians).to_vec();
    let poses = Poses::Joints {
        count,
        lower: home.iter().map(|q| q - 0.6).collect(),
        upper: home.iter().map(|q| q + 0.6).collect(),
    };
    let mut settings = SimulateSettings::realistic(seed, home, poses);
    settings.arm_seed = Some(7);
    settings.cell.six_dof = true;
    settings.cell.target_sd_mm = 0.0;
    settings.tracker = TrackerErrors::none();
    if !realistic {
        settings.joints = JointErrors::default();
        settings.gravity.sag_rad = 0.0;
        settings.cell.base_drift_mm = 0.0;
        settings.geometry = GeometryErrors { length_sd_mm: 0.4, angle_sd_rad: 3e-4 };
    }
    settings
}

/// Normal numbers of variance one, near enough: twelve even ones.
struct Normal(ChaCha8Rng);

impl Normal {
    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.0.random_range(-0.5..0.5)).sum()
    }

    fn vector(&mut self, sd: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| sd * self.next())
    }
}

fn reading(of: &Reading, target: usize, value: &Value) -> Reading {
    Reading { source: SourceId::ONLY, target: TargetId(target), value: *value, ..of.clone() }
}

fn point(position: Point3<f64>) -> MeanPoint {
    MeanPoint {
        position,
        scatter_mm: [0.0; 3],
        stated_covariance: Some([
            NOISE_MM * NOISE_MM,
            0.0,
            0.0,
            NOISE_MM * NOISE_MM,
            0.0,
            NOISE_MM * NOISE_MM,
        ]),
        motion_covariance: None,
    }
}

fn pose(reading: &Reading) -> Isometry3<f64> {
    let position = reading.position().expect("a position").coords;
    let turn = reading.orientation().expect("an orientation");
    Isometry3::from_parts(position.into(), turn)
}

/// The session as a 6-DoF target shows it, with noise.
fn six_dof(session: &JoinedSession) -> JoinedSession {
    let mut noise = Normal(ChaCha8Rng::seed_from_u64(1));
    let mut session = session.clone();
    for station in &mut session.joined.stations {
        for own in &mut station.readings {
            let seen = pose(own);
            let position = Point3::from(seen.translation.vector) + noise.vector(NOISE_MM);
            let turn = UnitQuaternion::from_scaled_axis(noise.vector(NOISE_RAD));
            let turn = MeanOrientation {
                orientation: turn * seen.rotation,
                scatter_rad: 0.0,
                stated_covariance: None,
            };
            *own = reading(own, 0, &Value::Pose(point(position), turn));
        }
    }
    session
}

/// The session as reflectors at `PLACES` show it, with noise; `is_there` tells whether a station has a reading of a target.
fn reflectors(
    session: &JoinedSession,
    is_there: impl Fn(&Station, usize) -> bool,
) -> JoinedSession {
    let mut noise = Normal(ChaCha8Rng::seed_from_u64(2));
    let mut session = session.clone();
    for station in &mut session.joined.stations {
        let Some(own) = station.readings.first().cloned() else {
            continue;
        };
        let seen = |target: usize| {
            let position = pose(&own) * Point3::from(PLACES[target]) + noise.vector(NOISE_MM);
            reading(&own, target, &Value::Point(point(position)))
        };
        let all: Vec<Reading> = (0..3).map(seen).collect();
        let kept = all.into_iter().filter(|own| is_there(station, own.target.0));
        station.readings = kept.collect();
    }
    session
}

fn noise(six_dof: bool) -> Noise {
    let mut noise = common::NOISE.clone();
    noise.repeatability_mm = 0.005;
    if six_dof {
        noise.sources[0].reads = ReadingKind::Pose;
        common::state_orientation(&mut noise, NOISE_RAD);
    }
    noise
}

fn observed(arm: &Arm, session: &JoinedSession, six_dof: bool) -> Vec<Observation> {
    fit::observations(0, &session.joined.stations, arm, &noise(six_dof))
}

fn identified(arm: &Arm, observed: &[Observation]) -> Calibration {
    let settings = FitSettings::default();
    fit::identify(arm, observed, 1, Freedom::Geometry, &settings).expect("a fit")
}

#[test]
fn three_reflectors_find_the_parameters_that_a_6_dof_target_finds() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = simulated(&arm, 150, false);
    let truth = common::joined("monday", &arm, &simulated.recording, tool());
    let three = identified(&arm, &observed(&arm, &reflectors(&truth, |_, _| true), false));
    let six = identified(&arm, &observed(&arm, &six_dof(&truth), true));
    // Each model leaves what was read: the noise.
    assert!(three.misfit_mm < 1.5 * NOISE_MM, "{} mm", three.misfit_mm);
    let (mut squares, mut largest, mut count) = (0.0, 0.0_f64, 0.0);
    for (place, own) in three.unknowns.iter().enumerate() {
        let Parameter::Link { .. } = own.parameter else {
            continue;
        };
        let other = six.unknowns.iter().position(|other| other == own);
        let other = other.expect("the same arm");
        let off = three.solution.offsets[place] - six.solution.offsets[other];
        let (a, b) = (three.standard_error(place), six.standard_error(other));
        let ratio = a / b;
        assert!(ratio > 0.4 && ratio < 2.5, "{own:?}: {a} and {b}");
        let share = off.abs() / a.hypot(b);
        squares += share * share;
        largest = largest.max(share);
        count += 1.0;
    }
    println!(
        "{count} parameters: rms {:.2} and at most {largest:.2} standard deviations apart",
        (squares / count).sqrt()
    );
    assert!(largest < 4.0, "{largest}");
    // With one reflector alone the turns of the flange are left to the prior.
    let mut one = observed(&arm, &reflectors(&truth, |_, target| target == 0), false);
    one.retain(|own| own.target == TargetId(0));
    assert_eq!(identified(&arm, &one).nominal_structure.rank, 27);
    assert_eq!(three.nominal_structure.rank, 33);
    assert_eq!(six.nominal_structure.rank, 30);
}

fn settings(simulated: &Simulated, six_dof: bool) -> StageSettings {
    let cell = &simulated.truth.settings.cell;
    let surveyed = isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
    StageSettings {
        fit: FitSettings {
            orientations: six_dof,
            target_names: ["tool", "b", "c"].map(str::to_owned).to_vec(),
            ..FitSettings::default()
        },
        full: FullSettings { harmonics: 8, ..FullSettings::default() },
        flange_from_tool: Some(tool()),
        base: Some(ErrorBase::Surveyed(SurveyedBase {
            tracker_from_base: surveyed,
            sd_mm: None,
            sd_rad: None,
        })),
        target_is_tool: Some(true),
        tool_tip: Some(Vector3::from(TOOL_MM) + Vector3::from(LEVER_MM)),
        ..common::stage_settings(noise(six_dof))
    }
}

fn outcome<'a>(
    arm: &'a Arm,
    training: JoinedSession,
    test: Vec<JoinedSession>,
    settings: &StageSettings,
) -> Outcome<'a> {
    crate::judged(arm, vec![training], test, settings).expect("a sound session")
}

fn of(figures: &[Accuracy], model: Model, angles: Angles, split: Split) -> &Accuracy {
    let is_it = |a: &&Accuracy| {
        (a.subject.model, a.subject.angles, a.subject.split) == (model, angles, split)
    };
    figures.iter().find(is_it).expect("a figure")
}

#[test]
fn wrong_orientations_of_a_6_dof_target_are_named_and_not_fitted() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = simulated(&arm, 60, true);
    let sound = six_dof(&common::joined("monday", &arm, &simulated.recording, tool()));
    let settings = settings(&simulated, true);
    let wrong = |session: &JoinedSession| {
        let found = outcome(&arm, session.clone(), Vec::new(), &settings);
        let rejects = found.training[0].joined.rejects.iter();
        let wrong = rejects.filter(|own| own.reason.starts_with("wrong orientation"));
        wrong.map(|own| own.reason.clone()).collect::<Vec<String>>()
    };
    assert_eq!(wrong(&sound), Vec::<String>::new());

    // Two that were written at each other's station, and one of a target that was turned by five degrees.
    let mut session = sound.clone();
    let stations = &mut session.joined.stations;
    let turns = [10, 20, 30].map(|own| stations[own].readings[0].orientation().expect("a pose"));
    let fifth = UnitQuaternion::from_scaled_axis(Vector3::x() * 5_f64.to_radians());
    for (at, turn) in [(10, turns[1]), (20, turns[0]), (30, fifth * turns[2])] {
        match &mut stations[at].readings[0].value {
            Value::Pose(_, own) => own.orientation = turn,
            _ => panic!("a pose"),
        }
    }
    let named = wrong(&session);
    assert_eq!(named.len(), 3, "{named:?}");
    for (own, at) in named.iter().zip([10, 20, 30]) {
        assert!(own.contains(&format!("station {at} ")), "{own}");
    }
}

/// Readings that are missing: every seventh station lacks the main reflector, every eleventh the second, every twentieth both.
fn some_missing(station: &Station, target: usize) -> bool {
    let number = station.number;
    match target {
        0 => number % 7 != 3 && number % 20 != 5,
        1 => number % 11 != 4 && number % 20 != 5,
        _ => true,
    }
}

#[test]
fn a_session_of_three_reflectors_has_figures_of_the_tip_like_one_of_a_6_dof_target() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = simulated(&arm, 130, true);
    let truth = common::joined("monday", &arm, &simulated.recording, tool());
    let three = reflectors(&truth, some_missing);
    let by_three = settings(&simulated, false);
    let outcome_of = |session, test, settings| outcome(&arm, session, test, settings);
    let mut tuesday = JoinedSession { name: "tuesday".to_owned(), ..three.clone() };
    // What an instrument reads twice is not the same: a copy would be refused.
    for (place, station) in tuesday.joined.stations.iter_mut().enumerate() {
        for reading in &mut station.readings {
            let point = reading.value.point_mut().expect("a place");
            point.position.x += [-0.01, 0.005, 0.01][place % 3];
        }
    }
    let found = outcome_of(three.clone(), vec![tuesday], &by_three);

    // Every station is of one kind, and every reading has its row.
    let stations = three.joined.stations.iter();
    let counts = stations.map(Station::measured);
    let (mut wanted, mut readings) = ([0, 0, 0], 0);
    for own in counts.filter(|own| !own.is_empty()) {
        readings += own.len();
        let has_main = own.iter().any(|own| own.target == TargetId::MAIN);
        wanted[if own.len() == 3 {
            0
        } else if has_main {
            1
        } else {
            2
        }] += 1;
    }
    let shown = &found.targets.sessions[0];
    assert_eq!([shown.poses, shown.points, shown.neither], wanted);
    assert!(wanted.iter().all(|count| *count > 3), "{wanted:?}");
    let set = |split: Split| {
        let mut sets = found.residuals.iter();
        let is_it = |set: &&posegrid::report::ResidualSet| {
            let own = &set.subject;
            (own.model, own.split, &*own.of_session) == (Model::Full, split, "monday")
        };
        sets.find(is_it).expect("residuals")
    };
    let rows = residuals::rows(&[set(Split::Blocks).clone()], &found.targets.names);
    assert_eq!(rows.len(), readings);
    let mut by_target: BTreeMap<String, usize> = BTreeMap::new();
    for row in &rows {
        let target = row.target.clone().expect("several targets have names");
        *by_target.entry(target).or_default() += 1;
    }
    assert_eq!(by_target.keys().collect::<Vec<_>>(), ["b", "c", "tool"]);
    let figure = of(&found.accuracy, Model::Full, Angles::Weighted, Split::Blocks);
    assert_eq!(figure.figures.expect("figures").n, readings);
    // Test sessions are judged too: their base by twelve chosen stations, not readings.
    let unseen = of(&found.accuracy, Model::Full, Angles::Weighted, Split::Session);
    assert!(unseen.figures.expect("figures").mean < 0.2, "{unseen:?}");
    let finders: Vec<usize> =
        found.accuracy.iter().filter_map(|own| Some(own.finders?.stations)).collect();
    assert!(!finders.is_empty() && finders.iter().all(|stations| *stations == 12), "{finders:?}");

    // The tip: as with a 6-DoF target, and not at all with one reflector.
    let by_six = settings(&simulated, true);
    let pose = outcome_of(six_dof(&truth), vec![], &by_six);
    for (model, angles, split) in [
        (Model::RawCommand, Angles::Commanded, Split::None),
        (Model::Full, Angles::Weighted, Split::Blocks),
        (Model::Geometric, Angles::Reported, Split::Blocks),
    ] {
        let three = of(&found.at_tip, model, angles, split);
        let six = of(&pose.at_tip, model, angles, split);
        assert_eq!(three.point, Point::Tip);
        let (a, b) = (three.figures.expect("poses"), six.figures.expect("poses"));
        println!(
            "{model:?} at the tip: {:.4} mm (n {}) and {:.4} mm (n {})",
            a.mean, a.n, b.mean, b.n
        );
        assert!((a.mean - b.mean).abs() < 0.02 + 0.1 * b.mean, "{model:?}: {a:?} {b:?}");
    }
    let one = outcome_of(reflectors(&truth, |_, target| target == 0), vec![], &by_three);
    let tip = of(&one.at_tip, Model::Full, Angles::Weighted, Split::Blocks);
    assert!(tip.figures.is_none(), "{tip:?}");
}

/// The station with its readings of two targets under each other's names.
fn swap(station: &mut Station, names: [usize; 2]) {
    for reading in &mut station.readings {
        let [a, b] = names;
        reading.target = match reading.target {
            TargetId(own) if own == a => TargetId(b),
            TargetId(own) if own == b => TargetId(a),
            own => own,
        };
    }
}

#[test]
fn readings_under_other_names_are_named_and_not_fitted() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = simulated(&arm, 90, true);
    let truth = common::joined("monday", &arm, &simulated.recording, tool());
    let mut three = reflectors(&truth, |_, _| true);
    let settings = settings(&simulated, false);
    let samples: usize = {
        let readings = three.joined.stations.iter().flat_map(Station::measured);
        readings.map(|own| own.kept).sum()
    };
    three.joined.counts.kept = samples as u64;
    three.joined.counts.unpaired = 0;
    let mut paired = three.joined.stations.iter_mut().filter(|own| own.measured().len() == 3);
    let mut next = || paired.next().expect("stations enough");
    // All three read, two swapped; two read, swapped: their distance says nothing; one read under another name.
    let (both, pair, single, far) = (next(), next(), next(), next());
    swap(both, [0, 1]);
    pair.readings.truncate(2);
    swap(pair, [0, 1]);
    single.readings.truncate(1);
    swap(single, [0, 2]);
    let off = far.readings[1].value.point_mut().expect("a position");
    off.position.x += 300.0;
    let wrong = [both.number, pair.number, single.number];
    let far = far.number;
    let total = {
        let readings = three.joined.stations.iter().flat_map(Station::measured);
        readings.map(|own| own.kept as u64).sum::<u64>()
    };
    three.joined.counts.kept = total;

    let found = outcome(&arm, three.clone(), vec![], &settings);
    let session = &found.training[0];
    for station in &session.joined.stations {
        let is_wrong = wrong.contains(&station.number);
        let pairing = &station.pairing;
        assert_eq!(
            *pairing == Pairing::Unmeasured(Unmeasured::WrongTarget),
            is_wrong,
            "{station:?}"
        );
    }
    let said: Vec<&str> = session.joined.rejects.iter().map(|own| &*own.reason).collect();
    let of =
        |number: usize| said.iter().filter(move |own| own.contains(&format!("station {number} ")));
    assert_eq!((of(wrong[0]).count(), of(wrong[1]).count()), (3, 2));
    let first = of(wrong[0]).next().expect("a reason");
    assert!(first.contains("what is named tool is b, what is named b is tool"), "{first}");
    assert!(first.contains("as named") && first.contains("next best"), "{first}");
    let third = of(wrong[2]).next().expect("a reason");
    assert!(third.contains("what is named c is tool"), "{third}");
    let away = of(far).next().expect("a reason");
    assert!(of(far).count() == 1 && away.starts_with("wrong target"), "{away}");
    // In = kept + rejected, and the others of that station are kept.
    let counts = &session.joined.counts;
    assert_eq!(counts.kept + counts.unpaired, total);
    let kept = found
        .residuals
        .iter()
        .find(|set| (set.subject.model, set.subject.split) == (Model::Geometric, Split::None));
    let kept = kept.expect("residuals").residuals.iter();
    assert_eq!(kept.filter(|own| own.station == far).count(), 2);
    let mean = of_model(&found);
    let sound = of_model(&outcome(&arm, reflectors(&truth, |_, _| true), vec![], &settings));
    assert!((mean - sound).abs() < 0.02, "{mean} and {sound} mm");
}

fn of_model(outcome: &Outcome<'_>) -> f64 {
    let figure = of(&outcome.accuracy, Model::Full, Angles::Weighted, Split::Blocks);
    figure.figures.expect("figures").mean
}

#[test]
fn a_swap_throughout_a_session_is_an_error_of_the_set_up() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = simulated(&arm, 60, true);
    let truth = common::joined("monday", &arm, &simulated.recording, tool());
    let sound = reflectors(&truth, |_, _| true);
    let mut swapped = JoinedSession { name: "tuesday".to_owned(), ..sound.clone() };
    for station in &mut swapped.joined.stations {
        swap(station, [1, 2]);
    }
    let mut settings = settings(&simulated, false);
    settings.full.enabled = false;
    let refused = |training: Vec<JoinedSession>, settings: &StageSettings| {
        let run = crate::judged(&arm, training, vec![], settings);
        run.map(|_| ()).expect_err("swapped").to_string()
    };
    // Beside another session, and alone beside stated places.
    let said = refused(vec![sound.clone(), swapped.clone()], &settings);
    println!("{said}");
    assert!(said.contains("session tuesday") && said.contains("what is named b is c"), "{said}");
    for (name, place) in ["tool", "b", "c"].into_iter().zip(PLACES) {
        let at = Vector3::from(TOOL_MM) + Vector3::from(place);
        let known = KnownTarget { xyz_mm: at.into(), sd_mm: 0.5 };
        settings.fit.targets.insert(name.to_owned(), known);
    }
    let said = refused(vec![swapped], &settings);
    assert!(said.contains("[fit.targets]") && said.contains("mm as named"), "{said}");
    let run = crate::judged(&arm, vec![sound], vec![], &settings);
    assert!(run.is_ok(), "{:?}", run.map(|_| ()));
}

/// The arm as a session of three reflectors identified it.
fn learnt(arm: &Arm, simulated: &Simulated, found: Outcome<'_>) -> IdentifiedArm {
    let stations = &found.training[0].joined.stations;
    let measured = (0..6).map(|joint| {
        let angles = stations.iter().map(|station| station.joints[joint]);
        angles.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], q| [low.min(q), high.max(q)])
    });
    let (_, base_target) = &found.calibrations[0];
    let full = found.full.expect("a full error model");
    assert_eq!(simulated.truth.stations.len(), stations.len());
    IdentifiedArm {
        table_id: "00ff".to_owned(),
        arm: arm.clone(),
        frames: found.error_frame.frames,
        flange_from_tool: Transform::claim(tool()),
        command_from_base: Transform::identity(),
        measured: measured.collect(),
        configurations: common::configurations(arm, tool(), stations),
        model: ArmModel {
            model: Model::Full,
            session: 0,
            shown: turn_behind(&base_target.frames[0], &full.fitted_frames()[0]),
            predicts: Box::new(full),
        },
        validity: Validity::default(),
        frame_uncertainty: posegrid::fit::FrameUncertainty::default(),
    }
}

/// What is left where the arm goes to commands: mean angle between attained and wanted orientation of the tool, as it is and without the
/// turn that all share (mrad), and mean distance from the target (mm).
#[derive(Debug)]
struct Left {
    turned: f64,
    without_constant: f64,
    away_mm: f64,
}

/// Drives the arm to the commands, or before compensation to the targets.
fn left(arm: &Arm, identified: &IdentifiedArm, corrected: &[Corrected], after: bool) -> Left {
    let day = day(9, 40, true);
    let errors = ArmErrors::draw(arm, &day);
    let joints = |own: &Corrected| {
        let joints = own.joints.as_ref().expect("joint angles");
        if after { joints.command.clone() } else { joints.target.clone() }
    };
    let commands: Vec<Commanded> = corrected
        .iter()
        .map(|own| Commanded {
            base_from_target: arm.flange(&joints(own)).isometry() * tool(),
            joints: joints(own),
        })
        .collect();
    let base = identified.frames.tracker_from_base.isometry();
    let (mut turns, mut away): (Vec<Vector3<f64>>, Vec<f64>) = (Vec::new(), Vec::new());
    for (visit, own) in visits(arm, &day, &errors, &commands).iter().zip(corrected) {
        let Some(reading) = visit.station.one_reading() else {
            continue;
        };
        let attained = base.inverse() * pose(reading);
        let target = &own.joints.as_ref().expect("joint angles").target;
        let wanted = arm.flange(target).isometry() * tool();
        turns.push((wanted.rotation.inverse() * attained.rotation).scaled_axis());
        away.push((attained.translation.vector - wanted.translation.vector).norm());
    }
    let n = turns.len() as f64;
    assert!(n > 20.0, "{n} targets");
    let mean = turns.iter().sum::<Vector3<f64>>() / n;
    let of = |constant: Vector3<f64>| {
        1e3 * turns.iter().map(|turn| (turn - constant).norm()).sum::<f64>() / n
    };
    Left {
        turned: of(Vector3::zeros()),
        without_constant: of(mean),
        away_mm: away.iter().sum::<f64>() / n,
    }
}

#[test]
fn an_arm_learnt_from_three_reflectors_corrects_orientations_too() {
    let arm = common::arm("kr210-r2700-extra");
    let simulated = simulated(&arm, 200, true);
    let truth = common::joined("monday", &arm, &simulated.recording, tool());
    let settings = settings(&simulated, false);
    let three = reflectors(&truth, |_, _| true);
    let fresh = simulate(&arm, &day(9, 60, true)).expect("in reach");
    let target = |station: &posegrid::simulate::TrueStation| Target {
        name: format!("hole {}", station.number),
        joints: Some(TargetJoints {
            slides: None,
            names: vec![],
            angles: station.commanded.clone(),
        }),
        ..Target::default()
    };
    let targets: Vec<Target> = fresh.truth.stations.iter().map(target).collect();
    let corrected = |by: &IdentifiedArm| -> Vec<Corrected> {
        let all = by.compensate(&targets, &[], Covariances::Given).into_iter();
        all.filter_map(Result::ok).collect()
    };
    let found = outcome(&arm, three.clone(), vec![], &settings);
    let mut identified = learnt(&arm, &simulated, found);
    let both = corrected(&identified);
    let before = left(&arm, &identified, &both, false);
    let after = left(&arm, &identified, &both, true);
    identified.model.shown = None;
    let positions = left(&arm, &identified, &corrected(&identified), true);
    println!("before {before:?}, by positions alone {positions:?}, by both {after:?}");
    // How the reflectors sit on the flange is found with the arm, so a turn that all targets share is not seen.
    assert!(after.without_constant < 0.5 * before.without_constant);
    assert!(after.without_constant < 0.5 * positions.without_constant);
    assert!(after.away_mm < 1.2 * positions.away_mm + 0.01);
    // Where their places are stated to a few hundredths of a millimetre, it is.
    let mut stated = settings.clone();
    for (name, place) in ["tool", "b", "c"].into_iter().zip(PLACES) {
        let at = Vector3::from(TOOL_MM) + Vector3::from(place);
        let known = KnownTarget { xyz_mm: at.into(), sd_mm: 0.02 };
        stated.fit.targets.insert(name.to_owned(), known);
    }
    let identified = learnt(&arm, &simulated, outcome(&arm, three, vec![], &stated));
    let known = left(&arm, &identified, &corrected(&identified), true);
    println!("by both, places stated: {known:?}");
    assert!(known.turned < 0.5 * before.turned, "{known:?}");

    // With one reflector orientations are commanded as they are.
    let one = outcome(&arm, reflectors(&truth, |_, target| target == 0), vec![], &settings);
    let (_, base_target) = &one.calibrations[0];
    assert_eq!(turn_behind(&base_target.frames[0], &base_target.frames[0]), None);
}

/// Three reflectors as a tracker's log has them, each message naming its own; joined.
fn from_log(arm: &Arm, simulated: &Simulated, readings: Vec<TargetReadings>) -> (Joined, u64) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [controller, tracker] =
        ["controller.mcap", "tracker.mcap"].map(|log| folder.path().join(log));
    let create = |path| BufWriter::new(File::create(path).expect("a temporary folder"));
    let joints: Vec<&str> = arm.joints().iter().map(|own| own.name.as_str()).collect();
    let (nothing, recording) = (BTreeMap::new(), &simulated.recording);
    write_controller_log(create(&controller), recording, &joints, &nothing).expect("room");
    let names = ["T1", "T2", "T3"];
    let named: Vec<(String, TargetReadings)> =
        names.iter().map(|name| (*name).to_owned()).zip(readings).collect();
    let log = TrackerLog {
        readings: &recording.readings,
        targets: &named,
        references: &[],
        lengths: &[],
        temperatures: &recording.temperatures,
    };
    log.write(create(&tracker), &nothing).expect("room");
    let mut mapping = common::mapping(arm);
    "/tracker/targets".clone_into(&mut mapping.tracker.topic);
    mapping.tracker.ignore_orientation = true;
    mapping.tracker.fields.target = Some("child_frame_id".to_owned());
    let target = |name: &&str| LoggedTarget {
        name: (*name).to_owned(),
        topic: None,
        is: Some(TargetName::Text((*name).to_owned())),
    };
    mapping.tracker.targets = names.iter().map(target).collect();
    let read = common::read(&SessionLogs::of_two(&controller, &tracker), &mapping);
    let kept = read.counts["readings.kept"];
    let joined = join(&read.input, arm, &JoinSettings::default()).expect("a sound recording");
    (joined, kept)
}

/// Asserts that every reading of a log is kept or rejected.
fn assert_balanced(joined: &Joined, read: u64) {
    let c = joined.counts;
    assert_eq!(read, c.kept + c.settling + c.outlier + c.moving + c.unpaired + c.missing);
    let rejected: u64 = joined.rejects.iter().map(|own| own.readings).sum();
    assert_eq!(read, c.kept + rejected);
}

/// Largest distance of a reading from that of the table of the same session, mm, and the numbers of readings of both.
fn beside_table(joined: &Joined, table: &[Station]) -> (f64, [usize; 2]) {
    let of = |station: &Station, target: TargetId| {
        let mut own = station.measured().iter().filter(|own| own.target == target);
        own.next().and_then(Reading::position)
    };
    let (mut largest, mut counts) = (0.0_f64, [0, 0]);
    for own in &joined.stations {
        let start = |other: &&Station| {
            own.start.since_ns(other.end) < 0 && other.start.since_ns(own.end) < 0
        };
        let other = table.iter().find(start).expect("the same dwells");
        for target in (0..3).map(TargetId) {
            let (a, b) = (of(own, target), of(other, target));
            counts[0] += usize::from(a.is_some());
            counts[1] += usize::from(b.is_some());
            if let (Some(a), Some(b)) = (a, b) {
                largest = largest.max((a - b).norm());
            }
        }
    }
    (largest, counts)
}

#[test]
fn three_reflectors_from_a_log_are_those_of_the_table_of_the_same_session() {
    let arm = common::arm("kr210-r2700-extra");
    let mut settings = day(7, 60, true);
    settings.cell.six_dof = false;
    settings.tracker = TrackerErrors::adm();
    settings.tracker.lost_share = 0.05;
    let simulated = simulate(&arm, &settings).expect("in reach");
    let beside = [PLACES[1], PLACES[2]].map(Vector3::from);
    let table = simulated.stations_with(&beside);
    // At once: every sample has all three.
    let at_once = simulated.readings_with(&beside);
    let (joined, kept) = from_log(&arm, &simulated, at_once.clone());
    assert_balanced(&joined, kept);
    let (largest, counts) = beside_table(&joined, &table);
    println!("at once: {largest:.4} mm from the table, {counts:?} readings");
    assert!(largest < 0.02 && counts[0] >= counts[1] - 3, "{largest} {counts:?}");

    // One after another: each reflector for a third of the dwell; nothing while the arm moves.
    let clocks = &simulated.truth.settings.clocks;
    let clock = ClockModel {
        origin: Stamp::from_ns(clocks.origin_ns),
        offset_ns: clocks.offset_s * 1e9,
        drift: clocks.drift_ppm * 1e-6,
    };
    let third = |stamp: Stamp<Tracker>| {
        let stations = &simulated.truth.stations;
        let own = stations.iter().find(|own| clock.to_tracker(own.end) >= stamp)?;
        let (start, end) = (clock.to_tracker(own.start), clock.to_tracker(own.end));
        let share = stamp.since_ns(start) as f64 / end.since_ns(start) as f64;
        (share >= 0.0).then_some(share * 3.0)
    };
    let one_by_one = at_once.iter().enumerate().map(|(target, own)| {
        let kept = own.stamps.iter().zip(&own.positions).filter(|(stamp, _)| {
            let target = target as f64;
            third(**stamp).is_some_and(|third| third > target + 0.1 && third < target + 0.9)
        });
        let (stamps, positions) = kept.map(|(stamp, position)| (*stamp, *position)).unzip();
        TargetReadings { stamps, positions, ..TargetReadings::default() }
    });
    let (joined, kept) = from_log(&arm, &simulated, one_by_one.collect());
    let rejected: u64 = joined.rejects.iter().map(|own| own.readings).sum();
    assert_eq!(kept, joined.counts.kept + rejected);
    let (largest, counts) = beside_table(&joined, &table);
    println!(
        "one by one: {largest:.4} mm from the table, {counts:?} readings, {}",
        joined.clock.method
    );
    assert!(largest < 0.1 && 10 * counts[0] >= 9 * counts[1], "{largest} {counts:?}");
}
