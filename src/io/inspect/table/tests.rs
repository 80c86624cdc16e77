//! Small tables of known truth: a ready UR10 whose lengths are off by a millimetre, watched by a tracker, written in the ways of people.

use std::fmt::Write as _;

use nalgebra::{Isometry3, Point3, Vector3};

use super::*;
use crate::geometry::{isometry_from_rpy, rpy};
use crate::ingest::{AngleUnit, LengthUnit, OrientationForm, StationsSettings, TableTime};
use crate::kinematics::{Arm, RobotFile};

/// One station: joints in rad, flange in the base frame (mm), the point of a target in the tracker's frame (mm).
struct Station {
    joints: [f64; 6],
    flange: Isometry3<f64>,
}

const TARGETS_MM: [[f64; 3]; 3] = [[40.0, 0.0, 80.0], [-30.0, 45.0, 80.0], [-30.0, -45.0, 85.0]];

fn tracker_from_base() -> Isometry3<f64> {
    isometry_from_rpy([2500.0, -700.0, 350.0], [0.02, -0.03, 2.1])
}

fn ur10() -> Arm {
    let ready = crate::robot::ready::ReadyRobot::find("ur10").expect("ready");
    toml::from_str::<RobotFile>(ready.text).expect("a robot file").arm().expect("an arm")
}

/// Stations all over the work space; angles in degrees go beyond a turn in radians.
fn stations(count: usize) -> Vec<Station> {
    let arm = ur10();
    let nominal = arm.chain().with_offsets(&arm.no_offsets());
    let arm = arm.with_chain(nominal);
    (0..count)
        .map(|number| {
            let t = number as f64;
            let joints = [
                1.2 * (0.7 * t).sin(),
                -1.4 + 0.5 * (1.3 * t).cos(),
                1.5 + 0.6 * (2.1 * t).sin(),
                -1.2 + 0.8 * (0.4 * t).cos(),
                1.4 * (1.9 * t).sin(),
                1.8 * (0.9 * t).cos(),
            ];
            Station { joints, flange: *arm.flange(&joints).isometry() }
        })
        .collect()
}

impl Station {
    /// Where a target is measured: an arm that is off by about half a millimetre, by a smooth error of its joints.
    fn measured(&self, target: usize) -> Vector3<f64> {
        let error =
            Vector3::new(self.joints[1].sin(), self.joints[2].cos(), self.joints[0].sin()) * 0.5;
        let point = self.flange * Point3::from(TARGETS_MM[target]) + error;
        (tracker_from_base() * point).coords
    }
}

/// The file with this text.
fn inspected(name: &str, text: &str, arms: &Arms) -> TableInspection {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    std::fs::write(&path, text).expect("writable");
    inspect(&path, Bound::TARGETS, arms).expect("a table")
}

fn named() -> Arms {
    Arms::named("ur10.toml".to_owned(), ur10())
}

fn guess_of(text: &str) -> Guess {
    inspected("measured.csv", text, &named()).guess.expect("joints and a position")
}

fn row(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{value:.6}")).collect();
    texts.join(",") + "\n"
}

fn has_doubt(guess: &Guess, key: Key) -> bool {
    guess.doubts.iter().any(|doubt| doubt.key == key)
}

fn median_mm(guess: &Guess) -> f64 {
    guess.verdict.as_ref().expect("an arm with six joints").best.median_mm
}

#[test]
fn a_plain_table_has_no_doubts_about_units_and_finds_its_arm_among_the_ready_ones() {
    let mut text = "q1,q2,q3,q4,q5,q6,x,y,z\n".to_owned();
    for station in stations(60) {
        let at = station.measured(0);
        text += &row(&[&station.joints[..], at.as_slice()].concat());
    }
    let guess = inspected("measured.csv", &text, &Arms::ready()).guess.expect("a guess");
    let verdict = guess.verdict.as_ref().expect("ready arms have six joints");
    assert_eq!(guess.arms[verdict.best.arm], "ur10.toml");
    assert!(verdict.best.median_mm < 1.0, "{}", verdict.best.median_mm);
    assert_eq!(guess.settings.joints, ["q1", "q2", "q3", "q4", "q5", "q6"]);
    assert_eq!(
        (guess.settings.joint_unit, guess.settings.measured[0].unit),
        (AngleUnit::Rad, LengthUnit::Mm)
    );
    for key in [Key::Joints, Key::JointUnit, Key::Unit, Key::Position] {
        assert!(!has_doubt(&guess, key), "{:?}", guess.doubts);
    }
    // That the arm was found and not named is told.
    assert!(has_doubt(&guess, Key::Robot));
    let base = guess.base.expect("an arm that agrees");
    assert!((base.translation.vector - tracker_from_base().translation.vector).norm() < 5.0);
}

#[test]
fn positions_in_any_unit_of_length_are_found() {
    for unit in by_arm::LENGTHS {
        let mut text = "q1,q2,q3,q4,q5,q6,x,y,z\n".to_owned();
        for station in stations(60) {
            let at = station.measured(0) / unit.to_mm();
            text += &row(&[&station.joints[..], at.as_slice()].concat());
        }
        let guess = guess_of(&text);
        assert_eq!(guess.settings.measured[0].unit, unit);
        assert!(!has_doubt(&guess, Key::Unit), "{:?}", guess.doubts);
    }
}

#[test]
fn columns_without_a_header_are_found_by_the_arm_in_degrees_and_metres() {
    let mut text = String::new();
    for station in stations(60) {
        let at = station.measured(0) / 1000.0;
        text += &row(&[at.as_slice(), &station.joints.map(f64::to_degrees)[..]].concat());
    }
    let guess = guess_of(&text);
    assert!(median_mm(&guess) < 1.0, "{}", median_mm(&guess));
    assert_eq!(guess.settings.joint_unit, AngleUnit::Deg);
    assert_eq!(guess.settings.measured[0].unit, LengthUnit::M);
    assert_eq!(guess.settings.measured[0].position, ["1", "2", "3"]);
    assert_eq!(guess.settings.joints, ["4", "5", "6", "7", "8", "9"]);
    assert!(has_doubt(&guess, Key::Joints), "no name says it");
}

#[test]
fn three_targets_with_zeros_for_missing_ones_and_a_still_one_on_the_base() {
    let mut text = "J1[deg],J2[deg],J3[deg],J4[deg],J5[deg],J6[deg],T1_X,T1_Y,T1_Z,T2_X,T2_Y,T2_Z,T3_X,T3_Y,T3_Z,B1_X,B1_Y,B1_Z\n".to_owned();
    for (number, station) in stations(60).iter().enumerate() {
        let mut values = station.joints.map(f64::to_degrees).to_vec();
        for target in 0..3 {
            let is_missing = (target == 0 && number % 3 == 0) || (target == 2 && number % 4 == 0);
            let at = if is_missing { Vector3::zeros() } else { station.measured(target) };
            values.extend(at.as_slice());
        }
        let still = if number % 10 == 0 {
            [0.0; 3]
        } else {
            [2510.0, -690.0, 100.0 + 0.01 * (number as f64).sin()]
        };
        values.extend(still);
        text += &row(&values);
    }
    let guess = guess_of(&text);
    let names: Vec<_> = guess.settings.measured.iter().filter_map(|own| own.name.clone()).collect();
    // The one that is never missing is the main one.
    assert_eq!(names, ["T2", "T3", "T1"]);
    assert!(median_mm(&guess) < 1.0, "{}", median_mm(&guess));
    assert_eq!(guess.settings.joint_unit, AngleUnit::Deg);
    // What stands still is a reference; where it stands nobody can tell from the table.
    let references = &guess.settings.references;
    assert!(matches!(&references[..], [own] if own.name == "B1"), "{references:?}");
    assert!(guess.doubts.iter().any(|doubt| doubt.key == Key::Reference));
}

#[test]
fn a_nominal_set_beside_the_measured_one_is_the_command() {
    let names = [
        ["x_t,y_t,z_t", "x_m,y_m,z_m", "x_t", "x_m"],
        ["x,y,z", "x.1,y.1,z.1", "x", "x.1"],
        ["x,y,z", "x,y,z", "x #1", "x #2"],
        ["x_m,y_m,z_m", "x_t,y_t,z_t", "x_t", "x_m"],
        // The order alone would tell it wrongly: the arm does.
        ["x,y,z", "x.1,y.1,z.1", "x.1", "x"],
    ];
    for [first, second, command, measured] in names {
        let mut text = format!("q1,q2,q3,q4,q5,q6,{first},{second}\n");
        for station in stations(60) {
            let nominal = (station.flange * Point3::from(TARGETS_MM[0])).coords;
            let mut both = [nominal, station.measured(0)];
            both.rotate_left(usize::from(first.contains(measured)));
            text += &row(&[&station.joints[..], both[0].as_slice(), both[1].as_slice()].concat());
        }
        let guess = guess_of(&text);
        let [own] = &guess.settings.measured[..] else {
            panic!("one reflector: {:?}", guess.settings.measured);
        };
        assert_eq!(own.position[0], measured);
        let commanded = guess.settings.commanded.as_ref().expect("commands near the arm");
        assert_eq!(commanded.position[0], command);
    }
}

#[test]
fn the_long_form_has_columns_of_stations_and_targets() {
    let mut text = "Punkt,Reflektor,Achse1 (°),Achse2 (°),Achse3 (°),Achse4 (°),Achse5 (°),Achse6 (°),X [mm],Y [mm],Z [mm]\n".to_owned();
    for (number, station) in stations(30).iter().enumerate() {
        for (target, name) in ["links", "mitte", "rechts"].iter().enumerate() {
            if target == 1 || number % 5 != target {
                let values =
                    [&station.joints.map(f64::to_degrees)[..], station.measured(target).as_slice()]
                        .concat();
                write!(text, "{number},{name},{}", row(&values)).expect("a string");
            }
        }
    }
    let guess = guess_of(&text);
    let settings = &guess.settings;
    assert_eq!(settings.station.as_deref(), Some("Punkt"));
    assert_eq!(settings.target.as_deref(), Some("Reflektor"));
    assert_eq!(settings.targets, ["mitte", "links", "rechts"]);
    assert_eq!(settings.measured.len(), 1);
    assert!(median_mm(&guess) < 1.0, "{}", median_mm(&guess));
}

#[test]
fn joints_from_flange_to_base_are_turned_round() {
    let mut text = "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,x,y,z\n".to_owned();
    for station in stations(60) {
        let mut joints = station.joints;
        joints.reverse();
        text += &row(&[&joints[..], station.measured(0).as_slice()].concat());
    }
    let guess = guess_of(&text);
    assert_eq!(
        guess.settings.joints,
        ["joint_6", "joint_5", "joint_4", "joint_3", "joint_2", "joint_1"]
    );
    assert!(has_doubt(&guess, Key::Joints), "{:?}", guess.doubts);
    assert!(median_mm(&guess) < 1.0);
}

#[test]
fn a_sign_is_named_by_the_search_of_the_set_up() {
    let mut text = "joint_1,joint_2,joint_3,joint_4,joint_5,joint_6,x,y,z\n".to_owned();
    for station in stations(60) {
        let mut joints = station.joints;
        joints[2] *= -1.0;
        text += &row(&[&joints[..], station.measured(0).as_slice()].concat());
    }
    let guess = guess_of(&text);
    let verdict = guess.verdict.as_ref().expect("an arm");
    assert!(!verdict.agrees(), "{}", verdict.best.median_mm);
    let finding = verdict.finding.as_ref().expect("one change explains it");
    assert!(finding.contains("(joint 3) the other way"), "{finding}");
    assert!(has_doubt(&guess, Key::Robot));
}

#[test]
fn a_decimal_comma_with_commands_in_metres_and_orientations_in_two_forms() {
    let mut text = "Zeit;Soll x;Soll y;Soll z;Soll roll;Soll pitch;Soll yaw;q1;q2;q3;q4;q5;q6;mess_x;mess_std_x;mess_y;mess_std_y;mess_z;mess_std_z;\
                    mess_rx;mess_ry;mess_rz;Temperatur\n"
        .to_owned();
    let (tool, target) = (
        isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, 1.5]),
        isometry_from_rpy([0.0, 0.0, 90.0], [0.3, -0.2, 0.5]),
    );
    let turned = isometry_from_rpy([0.0, 0.0, 0.0], [0.0, 0.0, std::f64::consts::PI]);
    for (number, station) in stations(60).iter().enumerate() {
        let command = turned * station.flange * tool;
        let at = tracker_from_base() * station.flange * target;
        // Angles about moving x, y, z: those of the inverse about fixed axes, counted back.
        let moving = rpy(&at.rotation.inverse()).map(|angle| -angle.to_degrees());
        let metres = command.translation.vector / 1000.0;
        let mut values = vec![1.75e9 + 20.0 * number as f64];
        values.extend(metres.as_slice());
        values.extend(rpy(&command.rotation));
        values.extend(station.joints);
        for axis in 0..3 {
            values.extend([at.translation.vector[axis], 0.01]);
        }
        values.extend(moving);
        values.push(21.5);
        let texts: Vec<String> =
            values.iter().map(|value| format!("{value:.6}").replace('.', ",")).collect();
        writeln!(text, "{}", texts.join(";")).expect("a string");
    }
    let guess = guess_of(&text);
    let settings = &guess.settings;
    let time = settings.time.as_ref().expect("times that differ");
    assert_eq!((time.column.as_str(), time.unit), ("Zeit", TableTime::S));
    assert_eq!(settings.temperature.as_deref(), Some("Temperatur"));
    let [measured] = &settings.measured[..] else {
        panic!("one target");
    };
    assert_eq!(measured.position, ["mess_x", "mess_y", "mess_z"]);
    assert_eq!(measured.sd.as_ref().expect("standard deviations")[2], "mess_std_z");
    let OrientationForm::Angles(_, order, unit) =
        measured.orientation.as_ref().expect("an orientation").form
    else {
        panic!("angles");
    };
    assert_eq!((String::from(order).as_str(), unit), ("moving-xyz", AngleUnit::Deg));
    let commanded = settings.commanded.as_ref().expect("commands near the arm");
    assert_eq!(commanded.unit, LengthUnit::M);
    let commands = guess.commands.as_ref().expect("commands");
    assert!(commands.is_of_base && commands.base_from_command.translation.vector.norm() < 1e-9);
    assert!((commands.base_from_command.rotation.angle().to_degrees() - 180.0).abs() < 1e-6);
    assert!((commands.flange_from_tool.translation.vector - tool.translation.vector).norm() < 0.1);
    assert!(commands.flange_from_tool.rotation.angle_to(&tool.rotation) < 1e-3);
}

#[test]
fn a_target_and_a_difference_are_added_where_the_target_is_computed_from_the_joints() {
    let mut text = "no,x_t,y_t,z_t,x_dif,y_dif,z_dif,j1,j2,j3,j4,j5,j6\n".to_owned();
    for (number, station) in stations(60).iter().enumerate() {
        let computed =
            (tracker_from_base() * (station.flange * Point3::from(TARGETS_MM[0]))).coords;
        let values = [
            computed.as_slice(),
            (station.measured(0) - computed).as_slice(),
            &station.joints.map(f64::to_degrees)[..],
        ]
        .concat();
        write!(text, "{number},{}", row(&values)).expect("a string");
    }
    let guess = guess_of(&text);
    assert_eq!(guess.settings.measured[0].position, ["x_t + x_dif", "y_t + y_dif", "z_t + z_dif"]);
    assert!(has_doubt(&guess, Key::Position), "the sign is a convention");
}

#[test]
fn sessions_stand_in_a_column_and_times_that_a_spreadsheet_ruined_are_not_used() {
    let mut text = "day,timestamp,q1,q2,q3,q4,q5,q6,x,y,z\n".to_owned();
    for (number, station) in stations(60).iter().enumerate() {
        // The tracker was moved overnight.
        let at = if number < 35 {
            station.measured(0)
        } else {
            station.measured(0) + Vector3::new(300.0, 0.0, 0.0)
        };
        let day = if number < 35 { "monday" } else { "tuesday" };
        write!(text, "{day},2.02011E+13,{}", row(&[&station.joints[..], at.as_slice()].concat()))
            .expect("a string");
    }
    let guess = guess_of(&text);
    assert_eq!(guess.settings.session.as_deref(), Some("day"));
    assert_eq!(guess.sessions, ["monday", "tuesday"]);
    assert!(guess.settings.time.is_none());
    assert!(
        guess
            .notes
            .iter()
            .any(|note| note.contains("timestamp") && note.contains("digits of it are lost")),
        "{:?}",
        guess.notes
    );
    assert!(median_mm(&guess) < 1.0, "{}", median_mm(&guess));
}

#[test]
fn without_an_arm_of_as_many_joints_units_follow_from_sizes_and_are_unsure() {
    let mut text = "q1,q2,px,py,pz,qx,qy,qz,qw\n".to_owned();
    for number in 0..20_u32 {
        let t = f64::from(number) / 10.0;
        text += &row(&[
            t,
            -t / 2.0,
            0.4 + t.sin() / 3.0,
            t.cos() / 3.0,
            1.1,
            t.sin(),
            0.0,
            0.0,
            t.cos(),
        ]);
    }
    let guess = inspected("camera.csv", &text, &Arms::ready()).guess.expect("a guess");
    assert!(guess.verdict.is_none());
    let settings: &StationsSettings = &guess.settings;
    assert_eq!((settings.joint_unit, settings.measured[0].unit), (AngleUnit::Rad, LengthUnit::M));
    let form = &settings.measured[0].orientation.as_ref().expect("a quaternion").form;
    assert_eq!(*form, OrientationForm::Quaternion(["qx", "qy", "qz", "qw"].map(str::to_owned)));
    for key in [Key::Robot, Key::JointUnit, Key::Unit, Key::Orientation] {
        assert!(has_doubt(&guess, key), "{key:?}: {:?}", guess.doubts);
    }
}

#[test]
fn a_table_without_positions_says_what_is_lacking() {
    let found = inspected("a.csv", "name,value\na,1\nb,2\nc,3\n", &Arms::ready());
    let lacking = found.guess.expect_err("nothing to guess");
    assert!(lacking.contains("joints") && lacking.contains("position"), "{lacking}");
    assert_eq!(found.columns[0].texts, 3);
}

/// The flange as the tracker sees it, a target's place in its last column: sixteen numbers, row by row.
fn matrix_of(station: &Station) -> [f64; 16] {
    let turn = (tracker_from_base() * station.flange).rotation.to_rotation_matrix();
    let at = station.measured(0);
    std::array::from_fn(|n| match (n / 4, n % 4) {
        (3, 3) => 1.0,
        (3, _) => 0.0,
        (row, 3) => at[row],
        (row, column) => turn[(row, column)],
    })
}

#[test]
fn a_matrix_in_columns_is_an_orientation_with_its_position() {
    let joints = "J1,J2,J3,J4,J5,J6";
    let numbered = |name: &str, first: usize| {
        let place = |n: usize| format!("{name}{}{}", first + n / 4, first + n % 4);
        (0..16).map(place).collect::<Vec<_>>().join(",")
    };
    let counted = |name: &str, first: usize| {
        (0..16).map(|n| format!("{name}{}", first + n)).collect::<Vec<_>>().join(",")
    };
    let named = "r11,r12,r13,tx,r21,r22,r23,ty,r31,r32,r33,tz".to_owned();
    let wide = [0, 1, 2, 4, 5, 6, 8, 9, 10];
    let long = [0, 4, 8, 1, 5, 9, 2, 6, 10];
    // The header, the order in which numbers are written, and the places of the rotation and position in it, row by row.
    let cases = [
        (numbered("m", 0), false, wide, [3, 7, 11]),
        (numbered("T_", 1), false, wide, [3, 7, 11]),
        (numbered("pose_", 0), true, long, [12, 13, 14]),
        (counted("m", 0), false, wide, [3, 7, 11]),
        (counted("pose_", 1), true, long, [12, 13, 14]),
        (named, false, wide, [3, 7, 11]),
        ("nx,ox,ax,px,ny,oy,ay,py,nz,oz,az,pz".to_owned(), false, wide, [3, 7, 11]),
    ];
    for (header, by_columns, turn, position) in cases {
        let names: Vec<&str> = header.split(',').collect();
        let mut text = format!("{joints},{header}\n");
        for station in stations(40) {
            let own = matrix_of(&station);
            let own = |n: usize| own[if by_columns { n % 4 * 4 + n / 4 } else { n }];
            let own: Vec<f64> = (0..names.len()).map(own).collect();
            text += &row(&[&station.joints.map(f64::to_degrees)[..], &own].concat());
        }
        let guess = guess_of(&text);
        let [reading] = &guess.settings.measured[..] else { panic!("{header}: one reading") };
        assert_eq!(reading.position, position.map(|place| names[place].to_owned()), "{header}");
        let form = reading.orientation.as_ref().map(|own| own.form.clone());
        let expected = OrientationForm::Matrix(turn.map(|place| names[place].to_owned()));
        assert_eq!(form, Some(expected), "{header} {:?}", guess.doubts);
        assert_eq!(guess.notes, [] as [String; 0], "{header}");
    }
}

#[test]
fn a_matrix_that_nothing_tells_is_noted_and_not_suggested() {
    let names: Vec<String> = (0..16).map(|n| format!("m{}{}", n / 4, n % 4)).collect();
    let names = names.join(",");
    let table = |cell: &dyn Fn(&[f64; 16], usize) -> f64| {
        let mut text = format!("q1,q2,q3,q4,q5,q6,x,y,z,{names}\n");
        for station in stations(40) {
            let own = matrix_of(&station);
            let own: Vec<f64> = (0..16).map(|n| cell(&own, n)).collect();
            text += &row(&[&station.joints[..], station.measured(0).as_slice(), &own].concat());
        }
        guess_of(&text)
    };
    let at_zero = table(&|own, n| if n % 4 == 3 && n < 12 { 0.0 } else { own[n] });
    let scaled = table(&|own, n| own[n] * 2.0);
    for (guess, word) in [(at_zero, "tell rows from columns"), (scaled, "no rotation")] {
        assert_eq!(guess.settings.measured[0].position, ["x", "y", "z"].map(str::to_owned));
        assert!(guess.settings.measured[0].orientation.is_none(), "{word}");
        let notes = guess.notes.join(" ");
        assert!(notes.contains("m00 to m33") && notes.contains(word), "{notes}");
    }
}

#[test]
fn digits_with_marks_beside_them_are_noted() {
    let table = |other: fn(f64) -> String| {
        let mut text = "q1,q2,q3,q4,q5,q6,x,y,z\n".to_owned();
        for station in stations(40) {
            let all = [&station.joints[..], station.measured(0).as_slice()].concat();
            let cells: Vec<String> = all.into_iter().map(other).collect();
            text += &(cells.join(",") + "\n");
        }
        inspected("measured.csv", &text, &named()).guess
    };
    let bracketed = table(|x| if x < 0.0 { format!("({:.6})", -x) } else { format!("{x:.6}") });
    let bracketed = bracketed.expect_err("no y");
    assert!(bracketed.contains("column \"q2\" has no numbers: \"(0."), "{bracketed}");
    let degrees = |x: f64| if x.abs() < 9.0 { format!("{x:.6}°") } else { format!("{x:.6}") };
    let with_unit = table(degrees).expect_err("no joints");
    assert!(with_unit.contains("column \"q1\" has no numbers: \""), "{with_unit}");
    assert!(table(|x| format!("{x:.6}").replace('-', "−")).expect("six joints").notes.is_empty());
}
