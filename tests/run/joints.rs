//! Targets corrected by the identified arm that a run published, as joint angles and as poses.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use posegrid::files::table::Table;
use posegrid::geometry::isometry_from_rpy;
use posegrid::kinematics::{Arm, InverseSettings, RobotFile, inverse};

use super::cell::{Ended, alone, ended, posegrid, undisturbed};

const NEAR_MM: f64 = 0.001;

/// A node of the published table that has a value, and the target whose command it is.
struct Node {
    place: [f64; 3],
    target: [f64; 3],
    quaternion: [f64; 4],
    configuration: String,
    joints: Vec<f64>,
}

fn nodes() -> Vec<Node> {
    let table = undisturbed().table("compensation", "mon");
    let known = (0..table.rows()).filter(|&row| table.text("refused").is_null(row));
    known.map(|row| node(&table, row)).collect()
}

fn node(table: &Table, row: usize) -> Node {
    let numbers = |names: [&str; 3]| names.map(|name| table.f64(name).value(row));
    let place = numbers(["x_mm", "y_mm", "z_mm"]);
    let error = numbers(["error_x_mm", "error_y_mm", "error_z_mm"]);
    let joints = table.list("joints_rad").value(row);
    Node {
        place,
        target: [0, 1, 2].map(|axis| place[axis] + error[axis]),
        quaternion: ["qx", "qy", "qz", "qw"].map(|name| table.f64(name).value(row)),
        configuration: table.text("configuration").value(row).to_owned(),
        joints: joints.as_primitive::<Float64Type>().values().to_vec(),
    }
}

fn kr210() -> Arm {
    let text = fs::read_to_string("pipelines/robots/kr210-r2700-extra.toml").expect("readable");
    let file: RobotFile = toml::from_str(&text).expect("a robot file");
    file.arm().expect("a valid arm")
}

/// Where the run has the tool at the flange: command and target are one point, so it is where the fit found the target.
fn tool() -> Isometry3<f64> {
    let table = undisturbed().table("calibrations", "mon");
    let place = ["x", "y", "z"].map(|axis| {
        let column = table.f64(&format!("flange_from_tool_{axis}_mm"));
        column.value(0)
    });
    isometry_from_rpy(place, [0.0; 3])
}

/// The nominal arm's joint angles for a node's target; commands are in the base frame.
fn nominal_joints(arm: &Arm, tool: &Isometry3<f64>, node: &Node) -> Vec<f64> {
    let [x, y, z, w] = node.quaternion;
    let pose = Isometry3::from_parts(
        Translation3::from(node.target),
        UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
    );
    let offsets = arm.no_offsets();
    let settings = InverseSettings::default();
    inverse(arm, &offsets, &pose, tool, &node.joints, &settings).expect("beside the node")
}

const POSITION: &str = "x_mm,y_mm,z_mm";
const RADIANS: &str = "q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad";
const DEGREES: &str = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg";

fn list(values: &[f64], scale: f64) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{:.12}", value * scale)).collect();
    texts.join(",")
}

/// How a run of `compensate` ended, and its result.
struct Run {
    ended: Ended,
    rows: Vec<csv::StringRecord>,
    columns: Vec<String>,
}

impl Run {
    fn of(name: &str, table: &Path, text: &str, flags: &[&str]) -> Self {
        let targets: PathBuf = undisturbed().path(&format!("{name}.csv"));
        fs::write(&targets, text).expect("writable");
        let ended = ended(posegrid().arg("compensate").arg(table).arg(&targets).args(flags));
        let mut reader = csv::Reader::from_reader(ended.results.as_bytes());
        let headers = reader.headers().expect("a first line").clone();
        Self {
            columns: headers.iter().map(str::to_owned).collect(),
            rows: reader.records().map(|row| row.expect("a row")).collect(),
            ended,
        }
    }

    fn text(&self, row: usize, column: &str) -> &str {
        let place = self.columns.iter().position(|name| name == column);
        let place = place.unwrap_or_else(|| panic!("{column} is not in {:?}", self.columns));
        &self.rows[row][place]
    }

    /// Joint angles to command, in the unit that the targets had, as rad.
    fn joints(&self, row: usize) -> Vec<f64> {
        let in_degrees = self.columns.iter().any(|column| column == "q1_deg");
        let names = if in_degrees { DEGREES } else { RADIANS };
        let angle = |name| self.numbers(row, [name])[0];
        let unit = if in_degrees { PI / 180.0 } else { 1.0 };
        names.split(',').map(|name| angle(name) * unit).collect()
    }

    fn numbers<const N: usize>(&self, row: usize, columns: [&str; N]) -> [f64; N] {
        columns.map(|column| self.text(row, column).parse().expect(column))
    }
}

fn arm_file() -> PathBuf {
    alone("calibrations")
}

#[test]
fn a_node_is_corrected_by_its_joint_angles_as_by_the_table() {
    let (arm, tool, nodes) = (kr210(), tool(), nodes());
    assert!(nodes.len() > 20, "a table worth the name");
    let poses: Vec<String> = nodes
        .iter()
        .enumerate()
        .map(|(row, node)| {
            let position = list(&node.target, 1.0);
            let turn = list(&node.quaternion, 1.0);
            format!("n{row},{position},{turn},{}\n", node.configuration)
        })
        .collect();
    let angles: Vec<String> = nodes
        .iter()
        .enumerate()
        .map(|(row, node)| {
            let joints = nominal_joints(&arm, &tool, node);
            format!("n{row},{}\n", list(&joints, 180.0 / PI))
        })
        .collect();
    let by_pose = Run::of(
        "node-poses",
        &arm_file(),
        &format!("target,{POSITION},qx,qy,qz,qw,configuration\n{}", poses.concat()),
        &[],
    );
    let by_joints =
        Run::of("node-joints", &arm_file(), &format!("target,{DEGREES}\n{}", angles.concat()), &[]);
    let by_table = Run::of(
        "node-table",
        &alone("compensation"),
        &format!("target,{POSITION},qx,qy,qz,qw,configuration\n{}", poses.concat()),
        &[],
    );
    for run in [&by_pose, &by_joints] {
        run.ended.expect(0, &["refused: none"]);
        assert_eq!(run.rows.len(), nodes.len());
        for (row, node) in nodes.iter().enumerate() {
            let command = run.numbers(row, ["x_mm", "y_mm", "z_mm"]);
            let away = (0..3).map(|axis| (command[axis] - node.place[axis]).abs());
            let away = away.fold(0.0, f64::max);
            assert!(away < NEAR_MM, "node {row}: {away} mm from the table's");
            for (found, expected) in run.joints(row).iter().zip(&node.joints) {
                assert!((found - expected).abs() < 1e-8, "{found} {expected}");
            }
            assert_eq!(run.text(row, "corrected_by"), "calibrations");
        }
    }
    // Where the table has the command, its standard deviation is the arm's.
    let inner = (0..nodes.len()).filter(|&row| by_table.text(row, "refused").is_empty());
    let mut compared = 0;
    for row in inner {
        let column = ["correction_sd_mm"];
        let [own] = by_joints.numbers(row, column);
        let [table] = by_table.numbers(row, column);
        assert!((own - table).abs() < 1e-5, "{own} {table}");
        compared += 1;
        // The survey, as both tables state it: 0.02 mm along three axes, and 0.0003° about the two across the way to the target.
        let at = nodes[row].target;
        let way_mm = at.iter().map(|x| x * x).sum::<f64>().sqrt();
        let turned_mm = 0.0003_f64.to_radians() * way_mm;
        let survey_mm = (3.0 * 0.02_f64.powi(2) + 2.0 * turned_mm.powi(2)).sqrt();
        for run in [&by_joints, &by_table] {
            let [of_frame] = run.numbers(row, ["correction_frame_sd_mm"]);
            assert!((of_frame - survey_mm).abs() < 2e-6, "{of_frame} {survey_mm}");
            assert!(own > of_frame, "the arm's own share is not lost");
        }
    }
    assert!(compared > 0, "some nodes are commands of inner targets");
}

#[test]
fn joint_angles_that_were_not_measured_are_refused_by_how_much_unless_allowed() {
    let node = &nodes()[0];
    let mut away = node.joints.clone();
    away[0] += 1.0;
    let mut beyond_limit = node.joints.clone();
    beyond_limit[4] = 130_f64.to_radians();
    let mut singular = node.joints.clone();
    singular[4] = 0.001;
    let rows = format!(
        "target,{RADIANS}\nfine,{}\naway,{}\nlimit,{}\nsingular,{}\n",
        list(&node.joints, 1.0),
        list(&away, 1.0),
        list(&beyond_limit, 1.0),
        list(&singular, 1.0)
    );
    let run = Run::of("unmeasured", &arm_file(), &rows, &[]);
    run.ended.expect(3, &["1 joint_limits, 1 joint_range, 1 singularity"]);
    for (row, word) in ["", "joint_range", "joint_limits", "singularity"].iter().enumerate() {
        assert_eq!(run.text(row, "refused"), *word);
        assert_eq!(run.text(row, "q1_rad").is_empty(), !word.is_empty());
    }
    let reason = run.text(1, "reason");
    assert!(reason.contains("\"joint_a1\" at ") && reason.contains("° beyond the "), "{reason}");
    let allowed = Run::of("allowed", &arm_file(), &rows, &["--allow", "joint-range"]);
    allowed.ended.expect(3, &["1 targets were corrected by an exception"]);
    assert_eq!(allowed.text(1, "allowed"), "joint_range");
    assert_eq!(allowed.text(0, "allowed"), "");
    let sd = |row| allowed.numbers(row, ["correction_sd_mm"])[0];
    assert!(sd(1) > 1.5 * sd(0), "the model says that it knows less there: {} {}", sd(1), sd(0));
}

#[test]
fn targets_that_say_too_little_or_two_things_are_refused() {
    let node = &nodes()[0];
    let (position, turn) = (list(&node.target, 1.0), list(&node.quaternion, 1.0));
    let joints = list(&node.joints, 1.0);
    let moved = list(&node.target.map(|x| x + 10.0), 1.0);
    let empty = ",,,,,";
    let rows = format!(
        "target,{POSITION},qx,qy,qz,qw,configuration,{RADIANS}\n\
         no_orientation,{position},,,,,{},{empty}\n\
         configuration,{position},{turn},,{empty}\n\
         configuration again,{position},{turn},shoulder- elbow- wrist-,{empty}\n\
         apart,{moved},,,,,,{joints}\n\
         both,{position},,,,,,{joints}\n",
        node.configuration
    );
    let run = Run::of("too-little", &arm_file(), &rows, &[]);
    run.ended.expect(3, &["pose 16.6", " mm and 0.00° from that"]);
    for (row, word) in
        ["no_orientation", "configuration", "configuration", "apart", ""].iter().enumerate()
    {
        assert_eq!(run.text(row, "refused"), *word, "{:?}", run.rows[row]);
    }
    let table = alone("compensation");
    let rows = format!("target,{RADIANS}\nA,{joints}\n");
    let by_table = Run::of("joints-on-table", &table, &rows, &[]);
    by_table.ended.expect(1, &["table `calibrations` of the same run"]);
    assert_eq!(by_table.text(0, "refused"), "no_position");
    let short = Run::of("short", &arm_file(), "target,q1_rad\nA,0\n", &[]);
    short.ended.expect(1, &["has 1 joint angles, the arm has joints joint_a1, "]);
}

#[test]
fn a_table_that_corrects_nothing_is_refused() {
    let stations = undisturbed().table_file("stations", "mon");
    let targets = undisturbed().path("nothing.csv");
    fs::write(&targets, format!("target,{RADIANS}\nA,0,0,0,0,0,0\n")).expect("writable");
    let run = ended(posegrid().arg("compensate").arg(stations).arg(&targets));
    run.expect(2, &["holds table \"stations\"", "\"calibrations\" of a run"]);
}

#[test]
fn a_reader_that_goes_away_ends_it_quietly() {
    // 2000 rows are more than a pipe holds.
    let joints = list(&nodes()[0].joints, 1.0);
    let rows: Vec<String> = (0..2000).map(|row| format!("n{row},{joints}\n")).collect();
    let targets = undisturbed().path("many.csv");
    fs::write(&targets, format!("target,{RADIANS}\n{}", rows.concat())).expect("writable");
    let program = env!("CARGO_BIN_EXE_posegrid");
    let mut child = Command::new(program)
        .arg("compensate")
        .arg(arm_file())
        .arg(&targets)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    drop(child.stdout.take());
    let run = Ended::from(child.wait_with_output().expect("ended"));
    run.expect(0, &["2000 targets: 2000 corrected"]);
    assert!(!run.messages.contains("pipe"), "{}", run.messages);
}
