//! `posegrid robot`, and a URDF as the robot file of a run.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use posegrid::kinematics::{Convention, JointFile, RobotFile};

use super::cell::{Cell, Ended, ended, posegrid};

const KR210: &str = "pipelines/robots/kr210-r2700-extra.toml";

/// Joint positions between the limits of the KR 210, with its own names of them.
const POSES: &str = "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6\n\
    0,-90,90,0,0,0\n-30.5,-60.25,100,25,55,-15\n170,-130,-110,340,-120,345\n";

/// The KR 210 as a URDF: its chain with joints of other names, and a camera beside it.
fn urdf() -> String {
    let text = fs::read_to_string(KR210).expect("part of the project");
    let file: RobotFile = toml::from_str(&text).expect("a robot file");
    let file = file.restated(Convention::Urdf).expect("any arm");
    let mut urdf =
        "<?xml version=\"1.0\"?>\n<robot name=\"kr210\">\n<link name=\"base_link\"/>\n".to_owned();
    let mut parent = "base_link".to_owned();
    for (number, joint) in (1..).zip(&file.joint) {
        let child = format!("link_{number}");
        let axis = joint.axis.expect("a URDF's").map(|x| x * f64::from(joint.sign.unwrap_or(1)));
        let [lower, upper] = joint.limits_deg.expect("revolute").map(f64::to_radians);
        let inside =
            format!("<axis xyz=\"{}\"/><limit lower=\"{lower}\" upper=\"{upper}\"/>", three(axis));
        push(&mut urdf, &format!("a{number}"), "revolute", [&parent, &child], joint, &inside);
        parent = child;
    }
    let flange = JointFile { origin: file.flange, ..JointFile::default() };
    push(&mut urdf, "to_tool", "fixed", [&parent, "tool0"], &flange, "");
    push(&mut urdf, "to_camera", "fixed", [&parent, "camera"], &flange, "");
    urdf + "</robot>\n"
}

fn push(
    urdf: &mut String,
    name: &str,
    kind: &str,
    [parent, child]: [&str; 2],
    joint: &JointFile,
    inside: &str,
) {
    let origin = joint.origin.expect("a URDF's");
    let (xyz, rpy) = (
        origin.xyz_mm.map(|mm| mm / 1000.0),
        origin.euler_deg.expect("angles").map(f64::to_radians),
    );
    let (xyz, rpy) = (three(xyz), three(rpy));
    writeln!(
        urdf,
        "<link name=\"{child}\"><inertial/></link>\n<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/>\
         <child link=\"{child}\"/><origin xyz=\"{xyz}\" rpy=\"{rpy}\"/>{inside}</joint>"
    )
    .expect("a string");
}

fn three([x, y, z]: [f64; 3]) -> String {
    format!("{x} {y} {z}")
}

/// A folder with the KR 210's URDF and joint positions.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().expect("a temporary folder"));
        fs::write(folder.path("kr210.urdf"), urdf()).expect("writable");
        fs::write(folder.path("poses.csv"), POSES).expect("writable");
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// `posegrid robot` with these arguments, from the folder.
    fn robot(&self, arguments: &[&str]) -> Ended {
        let mut command = posegrid();
        command.current_dir(self.0.path()).arg("robot");
        ended(command.args(arguments))
    }

    /// The flange at the folder's joint positions.
    fn flanges(&self, arguments: &[&str]) -> Vec<Vec<f64>> {
        let ended = self.robot(&[arguments, &["--at", "poses.csv"]].concat());
        ended.expect(0, &["x_mm,y_mm,z_mm,qx,qy,qz,qw\n"]);
        let rows = ended.results.lines().skip(1);
        rows.map(|row| row.split(',').map(|x| x.parse().expect("a number")).collect()).collect()
    }
}

const NAMES: &str = "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6";

fn largest_difference(one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    assert_eq!((one.len(), one[0].len()), (3, 7));
    let pairs = one.iter().flatten().zip(other.iter().flatten());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn ready_robots_are_listed_and_printed_as_they_are() {
    let folder = Folder::new();
    folder
        .robot(&["--list"])
        .expect(0, &["name  ", "kr210-r2700-extra         6", "Universal Robots UR10e"]);
    let printed = folder.robot(&["kr210-r2700-extra"]);
    printed.expect(0, &[]);
    let file = fs::read_to_string(KR210).expect("readable");
    // The first line names a schema that stands beside the file, and nowhere else.
    let (schema, rest) = file.split_once('\n').expect("lines");
    assert!(schema.starts_with("#:schema "), "{schema}");
    assert_eq!(printed.results, rest);
}

#[test]
fn a_urdf_its_robot_file_and_every_convention_are_one_arm() {
    let folder = Folder::new();
    let expected = folder.flanges(&["kr210-r2700-extra"]);
    let chain = ["kr210.urdf", "--tip", "tool0", "--joints", NAMES];
    assert!(largest_difference(&expected, &folder.flanges(&chain)) < 1e-9);
    let made = folder.robot(&chain);
    made.expect(
        0,
        &[
            "# Made by posegrid robot from \"kr210.urdf\": the chain from link \"base_link\" to link \"tool0\".\n",
            "# Left out: 8 inertial, 1 joints beside the chain.\n",
            "name = \"joint_a1\"\n",
        ],
    );
    fs::write(folder.path("robot.toml"), made.results).expect("writable");
    for convention in Convention::ALL {
        let word = convention.word();
        let found = folder.flanges(&["robot.toml", "--convention", word]);
        let apart = largest_difference(&expected, &found);
        assert!(apart < 1e-8, "{word}: {apart}");
    }
}

#[test]
fn what_is_no_robot_file_is_reported_with_what_to_do() {
    let folder = Folder::new();
    let cases: [(&[&str], &[&str]); 8] = [
        (&["kr211"], &["there is no file kr211", "ur10e"]),
        (
            &["kr210.urdf"],
            &[
                "several links end the chains behind \"base_link\": \"tool0\", \"camera\"",
                "--tip LINK",
            ],
        ),
        (
            &["kr210.urdf", "--tip", "tool"],
            &["tip = \"tool\" is no link of the URDF", "\"link_6\""],
        ),
        (
            &["kr210.urdf", "--tip", "tool0", "--joints", "a,b"],
            &["joints names 2 joints, but the controller reports 6"],
        ),
        (&["kr210-r2700-extra", "--tip", "tool0"], &["the chain of this robot file is the arm"]),
        (
            &["kr210.urdf", "--tip", "tool0", "--at", "poses.csv"],
            &["poses.csv: the first line names the columns \"joint_a1\"", "\"a6\""],
        ),
        (&["poses.csv"], &["poses.csv: line 1, column 9"]),
        (&[], &["required"]),
    ];
    for (arguments, texts) in cases {
        let ended = folder.robot(arguments);
        ended.expect(2, texts);
        assert!(ended.results.is_empty(), "{}", ended.results);
    }
}

#[test]
fn a_run_takes_a_urdf_and_its_links_are_part_of_its_settings() {
    let cell = Cell::new().with_quickstart("mon");
    fs::write(cell.path("robots/kr210.urdf"), urdf()).expect("writable");
    let file = "file = \"robots/kr210-r2700-extra.toml\"";
    let names: Vec<String> = NAMES.split(',').map(|name| format!("{name:?}")).collect();
    let joints = format!("joints = [{}]", names.join(", "));
    let cell = cell.with(file, &format!("file = \"robots/kr210.urdf\"\n{joints}"));
    cell.run(&[]).expect(2, &["kr210.urdf: several links", "tip = \"LINK\" beside [robot] file"]);
    let cell = cell.with("joints = ", "tip = \"tool0\"\njoints = ");
    cell.run(&[]).expect(0, &["1 of 1 within 0.5 mm"]);
    let settings = cell.table("runs", "mon");
    let settings = settings.text("settings").value(0).to_owned();
    assert!(settings.contains("\"tip\":\"tool0\""), "{settings}");
    assert!(Path::new(&cell.table_file("calibrations", "mon")).exists());
}

#[test]
fn a_session_is_simulated_of_a_urdf() {
    let folder = Folder::new();
    let simulated = |more: &[&str]| {
        let mut command = posegrid();
        command.current_dir(folder.0.path());
        command.args(["simulate", "kr210.urdf", "--out", "made", "--random", "3"]);
        ended(command.args(["--home", "0,-75,100,25,55,-15"]).args(more))
    };
    simulated(&[]).expect(2, &["kr210.urdf: several links end the chains"]);
    simulated(&["--tip", "tool0", "--joints", NAMES]).expect(0, &["3 stations of a kr210"]);
    let truth = fs::read_to_string(folder.path("made/truth_stations.csv")).expect("written");
    assert!(truth.contains("joint_a6"), "{truth}");
}
