//! Real command lines: a robot's name in a lake, folders, units that slipped, whole turns, and what is refused beyond what was seen.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use posegrid::files::schema;
use posegrid::files::table::{self, Table};

use super::cell::{Cell, SAMPLE, Sample, field};

/// How a command ended.
pub(super) struct Ended {
    code: Option<i32>,
    /// Its result, or its file of that.
    pub(super) results: String,
    messages: String,
}

impl Ended {
    pub(super) fn expect(&self, code: i32, told: &[&str]) {
        assert_eq!(self.code, Some(code), "{}", self.messages);
        for part in told {
            assert!(self.messages.contains(part), "{part}: {}", self.messages);
        }
    }
}

pub(super) fn compensate(args: &[&str]) -> Ended {
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let output = command.arg("compensate").args(args).output();
    let output = output.expect("started");
    Ended {
        code: output.status.code(),
        results: String::from_utf8(output.stdout).expect("text"),
        messages: String::from_utf8(output.stderr).expect("text"),
    }
}

/// The lake of a run of a pipeline file.
fn run(pipeline: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let output = command.arg("run").arg(pipeline).arg("--lake");
    let output = output.arg(folder.path()).output().expect("started");
    assert_ne!(output.status.code(), Some(1), "the run has a result");
    folder
}

/// The lake of the quickstart.
pub(super) fn lake() -> &'static Path {
    static LAKE: OnceLock<tempfile::TempDir> = OnceLock::new();
    LAKE.get_or_init(|| run(Path::new("pipelines/quickstart.toml"))).path()
}

/// The file of a table of the only run in a lake.
pub(super) fn file_of(lake: &Path, table: &str) -> PathBuf {
    let session = lake.join(table).join("kr210-demo/quickstart");
    let mut files = fs::read_dir(session).expect("there");
    files.next().expect("one").expect("listed").path()
}

/// A node in the middle of the table, where it has a value and every joint is within what was measured.
struct Node {
    place_mm: [f64; 3],
    joints_rad: Vec<f64>,
}

fn node() -> Node {
    let table: Table =
        table::read(&file_of(lake(), "compensation"), schema::find("compensation").expect("known"))
            .expect("a table");
    let within = table.bool("within_joint_ranges");
    let mut known = (0..table.rows())
        .filter(|&row| table.text("refused").is_null(row))
        .filter(|&row| within.is_valid(row) && within.value(row));
    let row = known.find(|row| *row >= table.rows() / 2).expect("one");
    let joints = table.list("joints_rad").value(row);
    Node {
        place_mm: ["x_mm", "y_mm", "z_mm"].map(|name| table.f64(name).value(row)),
        joints_rad: joints.as_primitive::<Float64Type>().values().to_vec(),
    }
}

/// A file of one target with joint angles, and its path as text.
fn joints_file(folder: &Path, unit: &str, angles: &[f64]) -> String {
    let names: Vec<String> = (1..=6).map(|joint| format!("q{joint}_{unit}")).collect();
    let angles: Vec<String> = angles.iter().map(|angle| format!("{angle:.10}")).collect();
    let path = folder.join(format!("joints-{unit}-{}.csv", angles[5]));
    let text = format!("target,{}\nA,{}\n", names.join(","), angles.join(","));
    fs::write(&path, text).expect("writable");
    text_of(&path)
}

fn place_file(folder: &Path, name: &str, [x, y, z]: [f64; 3]) -> String {
    let path = folder.join(name);
    fs::write(&path, format!("target,x_mm,y_mm,z_mm\nA,{x},{y},{z}\n")).expect("writable");
    text_of(&path)
}

pub(super) fn text_of(path: &Path) -> String {
    path.to_str().expect("text").to_owned()
}

fn degrees(angles: &[f64]) -> Vec<f64> {
    angles.iter().map(|angle| angle.to_degrees()).collect()
}

#[test]
fn a_robot_is_named_in_its_lake_and_the_run_taken_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let (lake_text, node) = (text_of(lake()), node());
    let joints = joints_file(folder.path(), "deg", &degrees(&node.joints_rad));
    let named = compensate(&["kr210-demo", &joints, "--lake", &lake_text]);
    let run = file_of(lake(), "runs");
    let run = run.file_stem().expect("named").to_string_lossy();
    let told = format!("current run of robot \"kr210-demo\": {run}, of session \"quickstart\"");
    named.expect(0, &[&told, "its table calibrations", "frame: the surveyed base"]);
    let given = compensate(&[&text_of(&file_of(lake(), "calibrations")), &joints]);
    assert_eq!(named.results, given.results, "as the file itself");
    // Positions alone are for the nodes of the grid.
    let place = place_file(folder.path(), "place.csv", node.place_mm);
    let named = compensate(&["kr210-demo", &place, "--lake", &lake_text]);
    named.expect(0, &["its table compensation", "frame: the surveyed base"]);
    let by = ["--session", "quickstart", "--by", "calibrations"];
    let args = [&["kr210-demo", &place, "--lake", &lake_text][..], &by].concat();
    compensate(&args).expect(1, &["its table calibrations", "neither joint angles"]);
    compensate(&["kr6", &place, "--lake", &lake_text])
        .expect(2, &["has no robot \"kr6\"; its robots: kr210-demo"]);
    let args = ["kr210-demo", &place, "--lake", &lake_text, "--session", "mon"];
    compensate(&args).expect(2, &["has no run of robot \"kr210-demo\", session \"mon\""]);
    compensate(&["kr210-demo", &place]).expect(2, &["there is no file kr210-demo", "--lake"]);
}

#[test]
fn a_folder_is_told_which_files_to_give() {
    let folder = tempfile::tempdir().expect("a folder");
    let place = place_file(folder.path(), "place.csv", [1500.0, 0.0, 1000.0]);
    let lake_text = text_of(lake());
    compensate(&[&lake_text, &place]).expect(2, &["is a lake", "--lake", "its robots: kr210-demo"]);
    let table = file_of(lake(), "compensation");
    let tables = text_of(&lake().join("compensation"));
    compensate(&[&tables, &place]).expect(2, &["is a folder; give a file", &text_of(&table)]);
    let targets = text_of(folder.path());
    compensate(&[&text_of(&table), &targets]).expect(2, &["is a folder", "place.csv"]);
    let args = [&text_of(&table), &place, "--out", &targets];
    compensate(&args).expect(2, &["is a folder; give a new file in it as --out"]);
}

#[test]
fn a_unit_that_slipped_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let node = node();
    let arm = text_of(&file_of(lake(), "calibrations"));
    let radians = joints_file(folder.path(), "deg", &node.joints_rad);
    compensate(&[&arm, &radians]).expect(1, &["as radians", "q1_rad, q2_rad"]);
    let in_degrees = degrees(&node.joints_rad);
    let named_radians = joints_file(folder.path(), "rad", &in_degrees);
    compensate(&[&arm, &named_radians]).expect(1, &["as degrees", "q1_deg, q2_deg"]);
    let metres = node.place_mm.map(|mm| mm / 1000.0);
    let metres = place_file(folder.path(), "metres.csv", metres);
    let table = text_of(&file_of(lake(), "compensation"));
    compensate(&[&table, &metres]).expect(1, &["in metres", "by 1000"]);
    // A target outside that is in no other unit either has no such word.
    let mut away = in_degrees;
    away[0] += 50.0;
    let away = joints_file(folder.path(), "deg", &away);
    let told = compensate(&[&arm, &away]);
    told.expect(1, &["beyond the"]);
    assert!(!told.messages.contains("if they are"), "{}", told.messages);
}

#[test]
fn joint_angles_a_whole_turn_away_are_commanded_on_their_turn() {
    let folder = tempfile::tempdir().expect("a folder");
    let node = node();
    let arm = text_of(&file_of(lake(), "calibrations"));
    let here = degrees(&node.joints_rad);
    let mut there = here.clone();
    // The arm's sixth joint goes from −350° to 350°.
    there[5] -= 360.0 * here[5].signum();
    assert!(there[5].abs() < 349.0, "{}", there[5]);
    let [here, there] = [here, there].map(|angles| {
        let done = compensate(&[&arm, &joints_file(folder.path(), "deg", &angles)]);
        done.expect(0, &["1 corrected"]);
        done.results
    });
    let number = |csv: &str, column: &str| field(csv, "A", column).parse::<f64>().expect("one");
    for column in ["x_mm", "y_mm", "z_mm", "correction_sd_mm", "q1_deg", "q5_deg"] {
        let apart = number(&here, column) - number(&there, column);
        assert!(apart.abs() < 1e-5, "{column}: {apart}");
    }
    for column in ["q6_deg", "target_q6_deg"] {
        let apart = (number(&here, column) - number(&there, column)).abs();
        assert!((apart - 360.0).abs() < 1e-6, "{column}: {apart}");
    }
    assert_eq!(field(&there, "A", "allowed"), "");
    // A turn that the arm cannot make is beyond its limits.
    let mut beyond = degrees(&node.joints_rad);
    beyond[0] += 360.0;
    compensate(&[&arm, &joints_file(folder.path(), "deg", &beyond)])
        .expect(1, &["1 joint_limits", "\"joint_a1\""]);
    // Half a turn is no whole one.
    let mut half = node.joints_rad.clone();
    half[5] -= PI * half[5].signum();
    compensate(&[&arm, &joints_file(folder.path(), "rad", &half)]).expect(1, &["1 joint_range"]);
}

#[test]
fn a_temperature_a_little_outside_says_what_it_does_and_how_to_go_on() {
    let cell = Cell::new(&SAMPLE);
    let table = text_of(&cell.table);
    let targets = place_file(cell.folder.path(), "t.csv", [751.0, 20.0, 450.0]);
    let outside = [&table, &targets, "--temperature-c", "22.2"];
    compensate(&outside).expect(2, &["0.70 °C above", "per metre", "--allow temperature"]);
    let args = [&outside[..], &["--allow", "temperature"]].concat();
    let done = compensate(&args);
    done.expect(0, &[]);
    assert_eq!(field(&done.results, "A", "allowed"), "temperature");
    // Several things at once are told at once and allowed one by one.
    let args = [&outside[..], &["--payload-kg", "30"]].concat();
    compensate(&args).expect(2, &["--allow payload --allow temperature"]);
    let args = [&args[..], &["--allow", "temperature", "--allow", "payload"]].concat();
    let done = compensate(&args);
    done.expect(0, &[]);
    assert_eq!(field(&done.results, "A", "allowed"), "payload temperature");
}

#[test]
fn a_table_that_is_not_met_needs_its_exception_on_the_command_line() {
    let cell = Cell::new(&Sample { verdict: "not_met", ..SAMPLE });
    let table = text_of(&cell.table);
    let targets = place_file(cell.folder.path(), "t.csv", [751.0, 20.0, 450.0]);
    let refused = compensate(&[&table, &targets]);
    refused.expect(2, &["does not meet", "--allow not-met"]);
    assert_eq!(refused.results, "");
    compensate(&[&table, &targets, "--allow", "not-shown"]).expect(2, &["--allow not-met"]);
    let args = [&table, &targets, "--allow", "not-shown", "--allow", "not-met"];
    compensate(&args).expect(3, &["1 corrected", "that is allowed"]);
}

#[test]
fn a_flipped_sign_in_the_tool_leaves_no_table_to_correct_with() {
    let folder = tempfile::tempdir().expect("a folder");
    let root = fs::canonicalize("pipelines").expect("there");
    let text = fs::read_to_string(root.join("quickstart.toml")).expect("readable");
    let quick = [
        ("\"robots/", format!("\"{}/robots/", root.display())),
        ("\"../tests", format!("\"{}/../tests", root.display())),
        (
            "flange_from_tool = { xyz_mm = [25, -40, 100]",
            "flange_from_tool = { xyz_mm = [25, 40, 100]".to_owned(),
        ),
        ("steps_mm = [60, 90, 120, 180, 240, 360, 720]", "steps_mm = [240, 360]".to_owned()),
    ];
    let text = quick.iter().fold(text, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    });
    let pipeline = folder.path().join("flipped.toml");
    fs::write(&pipeline, text).expect("writable");
    let lake = folder.path().join("lake");
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let done = command.arg("run").arg(&pipeline).arg("--lake").arg(&lake);
    let done = done.output().expect("started");
    let results = String::from_utf8(done.stdout).expect("text");
    assert_eq!(done.status.code(), Some(1), "{results}");
    assert!(results.contains("flange_from_tool has the wrong sign in y"), "{results}");
    for table in ["calibrations", "compensation"] {
        assert!(!lake.join(table).exists(), "{table} was published");
    }
}
