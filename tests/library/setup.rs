//! The set-up check: sound sessions are named nothing, and each of the usual mistakes is named.

use crate::common;

use std::f64::consts::{FRAC_PI_2, PI};
use std::ops::Range;
use std::sync::{Arc, LazyLock};

use nalgebra::{DMatrix, Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use posegrid::geometry::{Placement, isometry_from_rpy};
use posegrid::ingest::{AngleUnit, LengthUnit};
use posegrid::join::{Command, JoinSettings, join};
use posegrid::kinematics::{Chain, Convention, Element, LinkQuantity, Parameter, RobotFile};
use posegrid::setup::{
    Agreement, Alternatives, Evidence, Finding, FrameKey, KnownArm, OtherReading, SetUp, UnitKeys,
    check,
};
use posegrid::simulate::settings::Cell;
use posegrid::simulate::{Poses, SimulateSettings, simulate};

const GATE_MM: f64 = 30.0;

/// The KR 210's and the UR10's home, degrees.
const ARMS: [(&str, [f64; 6]); 2] = [
    ("kr210-r2700-extra", [0.0, -75.0, 100.0, 25.0, 55.0, -15.0]),
    ("ur10", [10.0, -100.0, 110.0, -70.0, -80.0, 15.0]),
];

fn known_arms() -> Vec<KnownArm> {
    let known = |name: &str| KnownArm { file: format!("{name}.toml"), arm: common::arm(name) };
    ["irb120", "kr210-r2700-extra", "ur10", "ur10e", "ur5", "ur5e"].map(known).to_vec()
}

/// A sound session of an arm that is three times as wrong as good ones are.
fn session(number: u64) -> (SetUp, Evidence) {
    let (name, home) = ARMS[usize::try_from(number % 2).expect("small")];
    let arm = common::arm(name);
    let home: Vec<f64> = home.iter().map(|angle: &f64| angle.to_radians()).collect();
    let spread = 0.45;
    let poses = Poses::Joints {
        count: 120,
        lower: home.iter().map(|q| q - spread).collect(),
        upper: home.iter().map(|q| q + spread).collect(),
    };
    let mut settings = SimulateSettings::realistic(1000 + number, home, poses);
    settings.geometry.length_sd_mm = 1.2;
    settings.geometry.angle_sd_rad = 9e-4;
    settings.gravity.sag_rad = 1.2e-3;
    settings.joints.slow_curve_rad = 3e-4;
    settings.cell.target_sd_mm = 0.3;
    settings.cell.six_dof = number % 3 == 1;
    settings.cell.flange_from_target_mm = [60.0, -25.0, 140.0];
    settings.cell.flange_from_target_rpy = [0.3, -0.2, 0.5];
    let simulated = simulate(&arm, &settings).expect("in reach");
    let cell = &settings.cell;
    let tool = isometry_from_rpy(cell.flange_from_target_mm, cell.flange_from_target_rpy);
    let stated = SetUp {
        flange_from_tool: Some(tool),
        target: (!number.is_multiple_of(3)).then_some(tool.translation.vector),
        target_is_tool: true,
        tracker_from_base: (number % 4 < 2)
            .then(|| isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy)),
        ..SetUp::of_arm(arm)
    };
    (stated, Evidence::of_stations(&simulated.stations()))
}

/// The session with less stated in its file or its logs: no commands, no tool, no orientations of commands.
fn poorer(number: u64, stated: &mut SetUp, evidence: &mut Evidence) {
    let stations = evidence.stations.iter_mut();
    match number % 4 {
        0 => stations.for_each(|station| station.command = None),
        1 => stated.flange_from_tool = None,
        2 => stations
            .filter_map(|s| s.command.as_mut())
            .for_each(|command| command.orientation = None),
        _ => (stated.target, stated.tracker_from_base) = (None, None),
    }
}

fn alternatives() -> Alternatives {
    Alternatives { arms: Arc::new(LazyLock::new(known_arms)), ..Alternatives::default() }
}

fn real(name: &str) -> Option<(SetUp, Evidence)> {
    let arm = common::arm("ur10");
    let read = common::session(name, &arm)?;
    let joined = join(&read.input, &arm, &JoinSettings::default()).expect(name);
    let stated = SetUp {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
        target: Some(Vector3::new(-0.2, 0.2, 92.8)),
        ..SetUp::of_arm(arm)
    };
    Some((stated, Evidence::of_stations(&joined.stations)))
}

#[test]
fn real_sessions_agree_with_their_set_up() {
    for name in ["ur10-random-a", "ur10-random-b", "ur10-grid", "ur10-joint"] {
        let Some((stated, evidence)) = real(name) else {
            continue;
        };
        println!("{name}: {:?}", Agreement::of(&stated, &evidence));
        assert_eq!(check(&stated, &evidence, &alternatives(), GATE_MM), None, "{name}");
    }
}

#[test]
fn sound_sessions_of_wide_errors_are_named_nothing() {
    false_alarms(30);
}

#[test]
#[ignore = "300 arms: minutes"]
fn three_hundred_sound_sessions_are_named_nothing() {
    false_alarms(300);
}

fn false_alarms(arms: u64) {
    let mut alarms = Vec::new();
    for number in 0..arms {
        let (mut stated, mut evidence) = session(number);
        for what in ["all stated", "less stated"] {
            if let Some(finding) = check(&stated, &evidence, &alternatives(), GATE_MM) {
                println!("{number}, {what}: {finding}");
                alarms.push(number);
            }
            poorer(number, &mut stated, &mut evidence);
        }
    }
    assert!(alarms.is_empty(), "{alarms:?}");
}

/// A mistake made in a sound set-up or in its logs, and words of which the first finding has to have one: the mistake's own, or
/// those of its class where the logs cannot separate two.
struct Kind {
    name: &'static str,
    make: fn(&mut SetUp, &mut Evidence),
    named: &'static [&'static str],
}

fn turned_about_z(angle: f64) -> Isometry3<f64> {
    isometry_from_rpy([0.0; 3], [0.0, 0.0, angle])
}

fn swap(stated: &mut SetUp, first: usize, second: usize) {
    let count = stated.arm.joints().len();
    let mut map = DMatrix::identity(count, count);
    map.swap_columns(first, second);
    stated.joints_from_reported = map;
}

/// A link quantity of the robot file changed.
fn link(stated: &mut SetUp, joint: usize, quantity: LinkQuantity, change: impl Fn(f64) -> f64) {
    let of = |parameter: Parameter| parameter == Parameter::Link { joint, quantity };
    let elements = stated.arm.chain().elements().iter().map(|element| match element {
        Element::Free { motion, nominal, parameter } if of(*parameter) => {
            Element::Free { motion: *motion, nominal: change(*nominal), parameter: *parameter }
        }
        other => other.clone(),
    });
    stated.arm = stated.arm.with_chain(Chain::new(elements.collect()));
}

fn tool(stated: &mut SetUp, change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) {
    stated.flange_from_tool = stated.flange_from_tool.map(change);
}

fn joints(evidence: &mut Evidence, change: impl Fn(usize, &mut f64)) {
    for station in &mut evidence.stations {
        station.reported.iter_mut().enumerate().for_each(|(joint, q)| change(joint, q));
    }
}

fn commands(evidence: &mut Evidence, change: impl Fn(&mut Command)) {
    evidence.stations.iter_mut().filter_map(|s| s.command.as_mut()).for_each(change);
}

fn scaled_readings(evidence: &mut Evidence, factor: f64) {
    evidence.stations.iter_mut().for_each(|station| station.measured *= factor);
}

/// The orientation with its parts x, y, z, w from other places.
fn parts(q: UnitQuaternion<f64>, places: [usize; 4]) -> UnitQuaternion<f64> {
    let [x, y, z, w] = places.map(|place| q.coords[place]);
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

/// Measured orientations of a target that sits askew, changed.
fn measured_turns(
    stated: &SetUp,
    evidence: &mut Evidence,
    change: impl Fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>,
) {
    let base = isometry_from_rpy([0.0; 3], Cell::default().tracker_from_base_rpy);
    let target = isometry_from_rpy([0.0; 3], [0.4, 0.7, -1.1]);
    for station in &mut evidence.stations {
        let flange = stated.arm.flange(&station.reported);
        let turn = base.rotation * flange.isometry().rotation * target.rotation;
        station.orientation = Some(change(turn));
    }
}

/// A table whose readings stand so many rows further down.
fn shifted_rows(stated: &mut SetUp, evidence: &mut Evidence, rows: usize) {
    stated.unit_keys = UnitKeys::TABLES;
    let count = evidence.stations.len();
    let mut stations = evidence.stations.clone();
    for (place, station) in evidence.stations.iter().enumerate() {
        stations[(place + rows) % count].measured = station.measured;
    }
    for station in &mut stations {
        station.orientation = None;
    }
    *evidence = Evidence::spread(stations);
}

/// A set-up with a survey: some kinds are about it.
fn surveyed(stated: &mut SetUp) {
    let cell = Cell::default();
    stated.tracker_from_base =
        Some(isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy));
}

const KINDS: [Kind; 47] = [
    Kind {
        name: "frame of commands turned by 180°",
        make: |s, _| s.base_from_command = turned_about_z(PI),
        named: &["base_from_command"],
    },
    Kind {
        name: "frame of commands turned by 90°",
        make: |s, _| s.base_from_command = turned_about_z(FRAC_PI_2),
        named: &["base_from_command"],
    },
    Kind {
        name: "surveyed base turned by 180°",
        make: |s, _| {
            surveyed(s);
            s.tracker_from_base = s.tracker_from_base.map(|base| base * turned_about_z(PI));
        },
        named: &["tracker_from_base"],
    },
    Kind {
        name: "surveyed base inverted",
        make: |s, _| {
            surveyed(s);
            s.tracker_from_base = s.tracker_from_base.map(|base| base.inverse());
        },
        named: &["tracker_from_base is inverted"],
    },
    Kind {
        name: "tool and target 80 mm apart",
        make: |s, _| {
            s.target = Some(s.flange_from_tool.expect("stated").translation.vector);
            tool(s, |tool| Translation3::new(0.0, 0.0, 80.0) * tool);
        },
        named: &["flange_from_tool"],
    },
    Kind {
        name: "tool left out",
        make: |s, _| tool(s, |_| Isometry3::identity()),
        named: &["flange_from_tool"],
    },
    Kind {
        name: "tool mirrored",
        make: |s, _| {
            tool(s, |tool| {
                Isometry3::from_parts(Translation3::new(60.0, 25.0, 140.0), tool.rotation)
            });
        },
        named: &["flange_from_tool"],
    },
    Kind {
        name: "tool in metres",
        make: |s, _| {
            tool(s, |tool| {
                Isometry3::from_parts(Translation3::new(0.06, -0.025, 0.14), tool.rotation)
            });
        },
        named: &["flange_from_tool"],
    },
    Kind {
        name: "tool inverted",
        make: |s, _| tool(s, |tool| tool.inverse()),
        named: &["flange_from_tool is inverted"],
    },
    Kind {
        name: "nominal a_2 wrong by 100 mm",
        make: |s, _| link(s, 2, LinkQuantity::A, |a| a - 100.0),
        named: &["a_mm"],
    },
    Kind {
        name: "nominal d_4 wrong by 100 mm",
        make: |s, _| link(s, 4, LinkQuantity::D, |d| d + 100.0),
        named: &["d_mm"],
    },
    Kind {
        name: "sign of a DH length",
        make: |s, _| link(s, 2, LinkQuantity::A, |a| -a),
        named: &["a_mm of link 2"],
    },
    Kind {
        name: "sign of a DH twist",
        make: |s, _| link(s, 1, LinkQuantity::Alpha, |alpha| -alpha),
        named: &["alpha_deg of link 1"],
    },
    Kind { name: "joints 5 and 6 swapped", make: |s, _| swap(s, 4, 5), named: &["are swapped"] },
    Kind { name: "joints 1 and 2 swapped", make: |s, _| swap(s, 0, 1), named: &["are swapped"] },
    Kind {
        name: "joints 5 and 6 swapped, and one counted the other way",
        make: |s, e| {
            swap(s, 4, 5);
            joints(e, |joint, q| *q *= if joint == 4 { -1.0 } else { 1.0 });
        },
        named: &["(joint 6) are swapped, and "],
    },
    Kind {
        name: "commands w, x, y, z of the inverse",
        make: |_, e| {
            let wxyz = |q: UnitQuaternion<f64>| parts(q.inverse(), [3, 0, 1, 2]);
            commands(e, |c| c.orientation = c.orientation.map(wxyz));
        },
        named: &["of the inverse orientation, in the order w, x, y, z"],
    },
    Kind {
        name: "joint 3 counted the other way",
        make: |_, e| {
            e.stations.iter_mut().for_each(|station| station.reported[2] *= -1.0);
        },
        named: &["the other way"],
    },
    Kind {
        name: "zero of joint 2 a right angle away",
        make: |_, e| {
            e.stations.iter_mut().for_each(|station| station.reported[1] += FRAC_PI_2);
        },
        named: &["the zero of"],
    },
    Kind {
        name: "angles in degrees read as radians",
        make: |s, e| {
            s.units.angles = AngleUnit::Rad;
            e.stations.iter_mut().flat_map(|s| &mut s.reported).for_each(|q| *q = q.to_degrees());
        },
        named: &["joint angles are in deg"],
    },
    Kind {
        name: "angles in radians read as degrees",
        make: |_, e| {
            e.stations.iter_mut().flat_map(|s| &mut s.reported).for_each(|q| *q = q.to_radians());
        },
        named: &["joint angles are in rad"],
    },
    Kind {
        name: "readings in metres read as mm",
        make: |_, e| {
            e.stations.iter_mut().for_each(|station| station.measured /= 1000.0);
        },
        named: &["tracker's positions are in m"],
    },
    Kind {
        name: "commands in metres read as mm",
        make: |_, e| {
            e.stations
                .iter_mut()
                .filter_map(|s| s.command.as_mut())
                .for_each(|c| c.position.coords /= 1000.0);
        },
        named: &["commanded positions are in m"],
    },
    Kind {
        name: "another arm's file",
        make: |s, _| {
            let other = if s.arm.model().contains("UR10") { "ur10e" } else { "irb120" };
            s.arm = common::arm(other);
        },
        named: &["the robot file is of another arm"],
    },
    Kind {
        name: "target mirrored",
        make: |s, _| {
            surveyed(s);
            s.target = Some(Vector3::new(60.0, 25.0, 140.0));
        },
        named: &["[fit] target"],
    },
    Kind {
        name: "coupled joint 3",
        make: |_, e| {
            e.stations.iter_mut().for_each(|station| station.reported[2] += station.reported[1]);
        },
        named: &["turns by it - "],
    },
    Kind {
        name: "readings in inches read as mm",
        make: |_, e| scaled_readings(e, 1.0 / 25.4),
        named: &["tracker's positions are in inch"],
    },
    Kind {
        name: "readings in cm read as m",
        make: |s, e| {
            s.units.readings = LengthUnit::M;
            scaled_readings(e, 100.0);
        },
        named: &["tracker's positions are in cm"],
    },
    Kind {
        name: "commands in inches read as m",
        make: |s, e| {
            s.units.commands = LengthUnit::M;
            commands(e, |c| c.position.coords *= 1.0 / 0.0254);
        },
        named: &["commanded positions are in inch"],
    },
    Kind {
        name: "joints in gon read as degrees",
        make: |_, e| joints(e, |_, q| *q /= 0.9),
        named: &["joint angles are in gon"],
    },
    Kind {
        name: "joint 4 alone in radians",
        make: |_, e| joints(e, |joint, q| *q = if joint == 3 { q.to_radians() } else { *q }),
        named: &["(joint 4) alone is in rad"],
    },
    Kind {
        name: "readings mirrored in z",
        make: |_, e| e.stations.iter_mut().for_each(|s| s.measured.z *= -1.0),
        named: &["mirrored", "tracker's z counts the other way"],
    },
    Kind {
        name: "x and y of readings exchanged",
        make: |_, e| e.stations.iter_mut().for_each(|s| s.measured.swap_rows(0, 1)),
        named: &["mirrored", "tracker's x and y are exchanged"],
    },
    Kind {
        name: "commands w, x, y, z",
        make: |_, e| commands(e, |c| c.orientation = c.orientation.map(|q| parts(q, [3, 0, 1, 2]))),
        named: &["commanded quaternions are in the order w, x, y, z"],
    },
    Kind {
        name: "commands x, y, z, w read as w, x, y, z",
        make: |_, e| commands(e, |c| c.orientation = c.orientation.map(|q| parts(q, [1, 2, 3, 0]))),
        named: &["commanded quaternions are in the order x, y, z, w"],
    },
    Kind {
        name: "commanded orientations inverse",
        make: |_, e| commands(e, |c| c.orientation = c.orientation.map(|q| q.inverse())),
        named: &["commanded quaternions are of the inverse"],
    },
    Kind {
        name: "measured quaternions w, x, y, z",
        make: |s, e| measured_turns(s, e, |q| parts(q, [3, 0, 1, 2])),
        named: &["measured quaternions are in the order w, x, y, z"],
    },
    Kind {
        name: "measured orientations inverse",
        make: |s, e| measured_turns(s, e, |q| q.inverse()),
        named: &["measured quaternions are of the inverse"],
    },
    Kind {
        name: "readings one row too low",
        make: |s, e| shifted_rows(s, e, 1),
        named: &["readings stand one row too low"],
    },
    Kind {
        name: "readings one row too high",
        make: |s, e| {
            let count = e.stations.len();
            shifted_rows(s, e, count - 1);
        },
        named: &["readings stand one row too high"],
    },
    Kind {
        name: "tool and target mistyped alike",
        make: |s, _| {
            tool(s, |tool| Translation3::new(0.0, 63.0, 0.0) * tool);
            s.target = s.flange_from_tool.map(|tool| tool.translation.vector);
        },
        named: &["flange_from_tool and [fit] target"],
    },
    Kind {
        name: "base turned by 180° and tool left out",
        make: |s, _| {
            s.base_from_command = turned_about_z(PI);
            tool(s, |_| Isometry3::identity());
        },
        named: &["base_from_command is turned by 180° about z; and [commanded] flange_from_tool"],
    },
    Kind {
        name: "readings in inches and base turned by 90°",
        make: |s, e| {
            s.base_from_command = turned_about_z(FRAC_PI_2);
            scaled_readings(e, 1.0 / 25.4);
        },
        named: &[
            "positions are in inch; and",
            "base_from_command is turned by -90° about z; and the tracker's",
        ],
    },
    Kind {
        name: "joints 5 and 6 swapped and readings in metres",
        make: |s, e| {
            swap(s, 4, 5);
            scaled_readings(e, 1e-3);
        },
        named: &["are swapped; and the tracker's", "positions are in m; and"],
    },
    Kind {
        name: "joint 3 the other way and commands in metres",
        make: |_, e| {
            joints(e, |joint, q| *q *= if joint == 2 { -1.0 } else { 1.0 });
            commands(e, |c| c.position.coords /= 1000.0);
        },
        named: &["the other way; and the commanded", "positions are in m; and"],
    },
    Kind {
        name: "commands w, x, y, z and base turned by 90°",
        make: |s, e| {
            s.base_from_command = turned_about_z(FRAC_PI_2);
            commands(e, |c| c.orientation = c.orientation.map(|q| parts(q, [3, 0, 1, 2])));
        },
        named: &["order w, x, y, z; and", "about z; and the commanded quaternions"],
    },
    Kind {
        name: "angles in radians read as degrees and tool turned",
        make: |s, e| {
            joints(e, |_, q| *q = q.to_radians());
            tool(s, |tool| tool * turned_about_z(FRAC_PI_2));
        },
        named: &["angles are in rad; and", "flange_from_tool is turned by -90° about z; and"],
    },
];

#[test]
fn usual_mistakes_are_named() {
    mistakes(|kind| kind % 6..kind % 6 + 1);
}

#[test]
#[ignore = "ten arms for each kind"]
fn usual_mistakes_are_named_on_ten_arms() {
    mistakes(|_| 0..10);
}

/// The kinds of mistake on some arms each, by the kind's number.
fn mistakes(arms: fn(u64) -> Range<u64>) {
    let (mut right, mut wrong, mut all) = (0, 0, 0);
    let kinds = (0..).zip(&KINDS);
    for (kind, number) in kinds.flat_map(|(place, kind)| arms(place).map(move |arm| (kind, arm))) {
        let (mut stated, mut evidence) = session(number);
        (kind.make)(&mut stated, &mut evidence);
        let found = check(&stated, &evidence, &alternatives(), GATE_MM);
        let named = |finding: &Finding| {
            let is_own = |what: &str| kind.named.iter().any(|words| what.contains(words));
            finding.is_grave && finding.mistakes.iter().any(|mistake| is_own(&mistake.what))
        };
        all += 1;
        if found.as_ref().is_some_and(named) {
            right += 1;
            continue;
        }
        let is_wrong = found.as_ref().is_some_and(|finding| !finding.mistakes.is_empty());
        wrong += usize::from(is_wrong);
        let words = found.as_ref().map_or("nothing".to_owned(), ToString::to_string);
        let sort = if is_wrong { "WRONG" } else { "not named" };
        println!("{}, arm {number}, {sort}: {words}", kind.name);
    }
    println!("{right} of {all} named, {wrong} wrongly");
    assert!(wrong == 0 && 20 * right >= 19 * all, "{right} of {all}, {wrong} wrongly");
}

#[test]
fn another_convention_of_the_robot_file_is_named() {
    let text = std::fs::read_to_string("pipelines/robots/kr210-r2700-extra.toml").expect("a file");
    let file = |convention| {
        let mut file: RobotFile = toml::from_str(&text).expect("a robot file");
        file.convention = convention;
        file.arm().expect("an arm")
    };
    let (mut stated, evidence) = session(0);
    let right = KnownArm { file: "standard-dh".to_owned(), arm: stated.arm };
    stated.arm = file(Convention::ModifiedDh);
    let alternatives = Alternatives { convention: Some(right), ..alternatives() };
    let finding = check(&stated, &evidence, &alternatives, GATE_MM).expect("another arm");
    assert_eq!(finding.mistakes[0].edit, "robot file: convention = \"standard-dh\"", "{finding}");
}

#[test]
fn small_disagreements_are_warnings() {
    for number in 0..4 {
        let (mut stated, evidence) = session(number);
        tool(&mut stated, |tool| tool * Translation3::new(0.0, 3.0, 4.0));
        stated.target = None;
        let finding =
            check(&stated, &evidence, &alternatives(), GATE_MM).expect("five millimetres");
        assert!(!finding.is_grave, "{finding}");
        assert!(finding.mistakes[0].what.contains("flange_from_tool"), "{finding}");
    }
}

#[test]
fn another_convention_of_the_same_numbers_is_named() {
    let placement: Placement = toml::from_str(
        "xyz_mm = [60.0, -25.0, 140.0]\neuler_deg = [17.19, -11.46, 28.65]\neuler_order = \"moving-zyx\"",
    )
    .expect("a placement");
    let (mut stated, evidence) = session(0);
    stated.flange_from_tool = Some(placement.isometry().expect("complete"));
    let others = placement.other_conventions().into_iter();
    let readings = others.map(|(convention, placed)| OtherReading {
        frame: FrameKey::Tool,
        convention,
        placed,
    });
    let alternatives = Alternatives { readings: readings.collect(), ..alternatives() };
    let finding =
        check(&stated, &evidence, &alternatives, GATE_MM).expect("turned by tens of degrees");
    assert!(finding.mistakes[0].what.contains("fixed-xyz"), "{finding}");
}
