//! `posegrid benchmark`: suites load, figures are those of independent code, other programs enter, and bad input is named.
//!
//! A small arm is made here: a UR10 whose joints are off, at 144 poses in six slabs, with errors that only the joints explain. Tables of
//! real arms are at `../shared/stations`; without them the tests of reference figures say that they did not run, and fail where `CI` is
//! set.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;
use nalgebra::{Isometry3, Point3, Vector3};
use posegrid::benchmark::FigureName;
use posegrid::io::tables::benchmark::{BenchmarkRow, Entrant};
use posegrid::kinematics::RobotFile;
use posegrid::pipeline::benchmark::{Asked, benchmark, suite};
use posegrid::pipeline::file::PipelineFile;
use posegrid::progress::Quiet;

/// A suite of the small arm, with its data, in a folder of its own.
struct Cell {
    folder: tempfile::TempDir,
}

const SESSION: &str = "monday";
const STATIONS: usize = 144;

/// Joint angles of a station, rad: three slabs by the first joint, and a smaller grid in each; the wrist moves with both.
fn joints(place: usize) -> [f64; 6] {
    let [slab, row, column] = [place / 24, place / 6 % 4, place % 6].map(|own| own as f64);
    let twist = (place * 37 % 11) as f64 / 11.0;
    [
        0.25 * slab - 0.6,
        -1.4 + 0.15 * row + 0.01 * twist,
        1.2 + 0.12 * column,
        -0.8 + 0.3 * twist,
        0.7 + 0.5 * (place * 53 % 13) as f64 / 13.0,
        -1.0 + 2.0 * (place * 29 % 17) as f64 / 17.0,
    ]
}

/// The measured point of a station, mm in the tracker's frame: the nominal arm, joints that are off, and an eccentric second gear.
fn measured(robot: &str, place: usize) -> Point3<f64> {
    let file: RobotFile = toml::from_str(robot).expect("a robot file");
    let arm = file.arm().expect("an arm");
    let mut joints = joints(place);
    for (joint, off) in joints.iter_mut().zip([0.0, 1.5e-3, -1e-3, 2e-3, -1.5e-3, 0.0]) {
        *joint += off;
    }
    joints[1] += 4e-4 * (3.0 * joints[1]).sin();
    let tracker_from_base = Isometry3::new(Vector3::new(2500.0, -400.0, 300.0), Vector3::z() * 0.7);
    let target = Point3::new(5.0, -12.0, 90.0);
    let noise = Vector3::from_fn(|axis, _| 0.02 * ((place * (31 + 12 * axis)) % 19) as f64 / 19.0);
    tracker_from_base * (arm.flange(&joints).isometry() * target) + noise
}

impl Cell {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let own = Self { folder };
        let robot = fs::read_to_string("pipelines/robots/ur10.toml").expect("readable");
        let mut table = "q1,q2,q3,q4,q5,q6,x,y,z\n".to_owned();
        for place in 0..STATIONS {
            let angles = joints(place).map(|own| own.to_string()).join(",");
            let at = measured(&robot, place);
            writeln!(table, "{angles},{},{},{}", at.x, at.y, at.z).expect("a string");
        }
        own.write("robot.toml", &robot);
        own.write(&format!("data/{SESSION}.csv"), &table);
        own.write("arm.toml", PIPELINE);
        let digest = blake3::hash(table.as_bytes()).to_hex();
        own.write("suite.toml", &SUITE.replace("DIGEST", &digest));
        own
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().expect("in the folder")).expect("writable");
        fs::write(path, text).expect("writable");
    }

    /// Changes the suite.
    fn with(self, from: &str, to: &str) -> Self {
        let suite = fs::read_to_string(self.path("suite.toml")).expect("readable");
        assert!(suite.contains(from), "{from}");
        self.write("suite.toml", &suite.replacen(from, to, 1));
        self
    }

    fn asked(&self) -> Asked {
        Asked { suite: self.path("suite.toml"), ..Asked::default() }
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::cargo_bin("posegrid").expect("built with the tests");
        let (suite, out) = (self.path("suite.toml"), self.path("out"));
        command.arg("benchmark").arg(suite).arg("--out").arg(out).args(arguments);
        command
    }

    /// The message of a command that ends with `code`.
    fn fails(&self, code: i32, arguments: &[&str]) -> String {
        let ended = self.command(arguments).output().expect("run");
        let message = String::from_utf8_lossy(&ended.stderr).into_owned();
        assert_eq!(ended.status.code(), Some(code), "{message}");
        assert!(ended.stdout.is_empty(), "results on stdout: {ended:?}");
        assert!(!self.path("out/benchmark.parquet").exists());
        message
    }

    /// Predictions of the stations that test, changed, as `--predictions`.
    fn predictions(&self, change: impl Fn(Point3<f64>) -> Point3<f64>) -> String {
        let robot = fs::read_to_string(self.path("robot.toml")).expect("readable");
        let mut text = "station,x,y,z\n".to_owned();
        for place in (1..STATIONS).step_by(2) {
            let at = change(measured(&robot, place));
            writeln!(text, "{place},{},{},{}", at.x, at.y, at.z).expect("a string");
        }
        self.write("mine/small/even-to-odd.csv", &text);
        format!("mine={}", self.path("mine").display())
    }
}

const PIPELINE: &str = r#"
[robot]
file = "robot.toml"
name = "small"
up = [0, 0, 1]

[input]
folder = "data"
sessions_by = "file_name"
stations = "{session}.csv"

[stations]
joints = ["q1", "q2", "q3", "q4", "q5", "q6"]
joint_unit = "rad"

[stations.measured]
position = ["x", "y", "z"]
unit = "mm"

[tracker]
uncertainty = { range_um = 20, range_um_per_m = 0, transverse_um = 20, transverse_um_per_m = 0, divisor = 2 }

[grid]
steps_mm = [50, 100, 150, 200, 250, 300]

[tolerance]
mm = 0.5
share = 0.95
confidence = 0.95

[output]
lake = "lake"
"#;

const SUITE: &str = r#"
name = "small"
description = "An arm that was made."

[bootstrap]
draws = 300

[[arm]]
name = "small"
pipeline = "arm.toml"
source = { repository = "https://example.org/small", licence = "CC0-1.0" }

[[arm.session]]
name = "monday"
stations = 144
file = [{ path = "monday.csv", origin = "tables/monday.csv", blake3 = "DIGEST" }]

[[arm.split]]
name = "even-to-odd"
kind = "rows"
train = { monday = "0-142/2" }
test = { monday = "1-143/2" }
beside = "slabs"
published = [{ model = "a thesis", figure = "mean", value = 0.3, source = "its table 4" }]

[[arm.split]]
name = "slabs"
kind = "region"
train = { monday = "0-95" }
test = { monday = "96-143" }
"#;

fn files(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("part of the project");
    let mut paths: Vec<PathBuf> = entries.map(|own| own.expect("readable").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
    paths.sort();
    assert!(!paths.is_empty(), "{folder}");
    paths
}

#[test]
fn every_suite_loads_with_the_pipeline_files_that_it_names() {
    for path in files("pipelines/benchmarks") {
        let suite = suite(&path).unwrap_or_else(|error| panic!("{error}"));
        for arm in &suite.arms {
            let pipeline = path.with_file_name("").join(&arm.pipeline);
            let text = fs::read_to_string(&pipeline)
                .unwrap_or_else(|e| panic!("{}: {e}", pipeline.display()));
            let file: PipelineFile =
                toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", pipeline.display()));
            assert!(
                pipeline.with_file_name("").join(&file.robot.file).exists(),
                "{}",
                pipeline.display()
            );
        }
    }
}

/// The value of a figure of one model of posegrid, or of a publication.
fn value(rows: &[BenchmarkRow], split: (&str, &str), model: &str, figure: FigureName) -> f64 {
    let mut own = rows.iter().filter(|row| (&*row.robot, &*row.split) == split);
    let row = own
        .find(|row| row.model == model && row.figure == figure && row.entrant != Entrant::Program);
    row.unwrap_or_else(|| panic!("{split:?} {model} {figure:?}")).value
}

#[test]
fn figures_of_a_made_arm_leak_by_rows_and_have_intervals() {
    let cell = Cell::new();
    let result = benchmark(&cell.asked(), &Quiet).unwrap_or_else(|error| panic!("{error}"));
    let rows = &result.rows.rows;
    let of = |split: &str, model: &str| value(rows, ("small", split), model, FigureName::Mean);
    // The joints that are off are found; the gear's eccentricity is more than geometry knows.
    assert!(of("even-to-odd", "geometric") < 0.3 * of("even-to-odd", "base_target"));
    assert!(of("even-to-odd", "full") < of("even-to-odd", "geometric"));
    for row in rows {
        assert_eq!(row.leaks, row.split == "even-to-odd", "{row:?}");
        assert_eq!(row.train_stations + row.test_stations, STATIONS);
        if let Some((low, high)) = row.low.zip(row.high) {
            assert!(low <= high, "{row:?}");
            // The largest error of a draw is never above that of all.
            assert!(row.figure != FigureName::Max || high <= row.value, "{row:?}");
        }
    }
    let told = &result.told[0].1[0];
    assert!(told.contains("144 read = 144 kept + 0 left out"), "{told}");
    let published =
        rows.iter().find(|row| row.entrant == Entrant::Published).expect("a published figure");
    assert_eq!((published.source.as_deref(), published.value), (Some("its table 4"), 0.3));
}

#[test]
fn the_same_bytes_at_any_thread_count_and_the_leak_in_words() {
    let cell = Cell::new();
    let run = |threads: &str| {
        let mut command = cell.command(&[]);
        let ended = command.env("RAYON_NUM_THREADS", threads).assert().code(0);
        let stdout = String::from_utf8_lossy(&ended.get_output().stdout).into_owned();
        let files = ["benchmark.parquet", "benchmark.html"]
            .map(|name| fs::read(cell.path("out").join(name)).expect("written"));
        (stdout, files)
    };
    let (stdout, files) = run("1");
    assert_eq!((stdout.clone(), files.clone()), run("3"));
    assert!(
        stdout.contains("leaks: the stations that judge stand among those that train"),
        "{stdout}"
    );
    assert!(stdout.contains("; on slabs: "), "{stdout}");
    let page = String::from_utf8_lossy(&files[1]).into_owned();
    assert!(page.contains("1 of the splits leaks"), "the page names it");
}

#[test]
fn another_program_is_judged_by_the_same_code() {
    let cell = Cell::new();
    // Predictions 0.1 mm off along x: every figure of length is 0.1 mm.
    let given = cell.predictions(|at| at + Vector3::new(0.1, 0.0, 0.0));
    let (name, path) = given.split_once('=').expect("NAME=PATH");
    let asked = Asked {
        splits: vec!["even-to-odd".to_owned()],
        predictions: vec![(name.to_owned(), path.into())],
        ..cell.asked()
    };
    let result = benchmark(&asked, &Quiet).unwrap_or_else(|error| panic!("{error}"));
    let mine: Vec<&BenchmarkRow> =
        result.rows.rows.iter().filter(|row| row.entrant == Entrant::Program).collect();
    assert_eq!(mine.len(), 6, "no coverage without covariances");
    let full = result.rows.rows.iter().find(|row| {
        let of = (row.split.as_str(), row.model.as_str(), row.figure);
        of == ("even-to-odd", "full", FigureName::Mean) && row.entrant == Entrant::Posegrid
    });
    let full_mm = full.expect("a full error model").value;
    let is_difference = |row: &BenchmarkRow| row.figure == FigureName::Difference;
    let difference = mine.iter().find(|row| is_difference(row));
    let difference_mm = difference.expect("a difference").value;
    assert!(
        (difference_mm - (0.1 - full_mm)).abs() < 1e-9,
        "{difference_mm} beside 0.1 - {full_mm}"
    );
    let lengths = mine.iter().filter(|row| row.figure.is_length());
    for row in lengths.filter(|row| !is_difference(row)) {
        assert!((row.value - 0.1).abs() < 1e-9 && row.test_stations == STATIONS / 2, "{row:?}");
    }
    assert_eq!(result.remarks, ["mine has no predictions for small/slabs"]);
}

#[test]
fn what_is_exported_is_enough_and_has_no_answers() {
    let cell = Cell::new();
    let given = cell.path("given");
    let folder = given.display().to_string();
    cell.command(&["--export", &folder]).assert().code(0);
    assert!(given.join("small/robot.toml").exists());
    let read = |name: &str| {
        fs::read_to_string(given.join("small/even-to-odd").join(name)).expect("written")
    };
    let (train, test) = (read("train.csv"), read("test.csv"));
    assert_eq!((train.lines().count(), test.lines().count()), (73, 73));
    assert!(train.starts_with("session,station,q1,q2,q3,q4,q5,q6,x,y,z\nmonday,0,"), "{train}");
    assert!(test.lines().skip(1).all(|line| line.ends_with(",,,")), "{test}");
    assert!(!cell.path("out").exists(), "nothing is judged");
}

#[test]
fn predictions_of_the_wrong_stations_unit_frame_or_with_nan_are_refused() {
    let cell = Cell::new();
    let refused = |given: &str| cell.fails(1, &["--predictions", given]);
    let given = cell.predictions(|at| at / 1000.0);
    let message = refused(&given);
    assert!(message.contains("these look like metres, where millimetres are needed"), "{message}");
    assert!(
        message.contains("predictions of mine, arm \"small\", split \"even-to-odd\""),
        "{message}"
    );
    let turned = Isometry3::rotation(Vector3::z() * 0.3);
    let message = refused(&cell.predictions(|at| turned * at + Vector3::x() * 40.0));
    assert!(message.contains("these look like another frame: they fit to"), "{message}");
    cell.predictions(|at| at);
    let file = cell.path("mine/small/even-to-odd.csv");
    let good = fs::read_to_string(&file).expect("written");
    let change =
        |from: &str, to: &str| fs::write(&file, good.replacen(from, to, 1)).expect("writable");
    change("\n7,", "\n8,");
    let message = refused(&given);
    assert!(message.contains("1 missing (monday/7), 1 that do not test (monday/8)"), "{message}");
    change("\n7,", "\n5,");
    let message = refused(&given);
    assert!(
        message.contains("line 5: station 5") && message.contains("line 4 already"),
        "{message}"
    );
    let second = good.lines().nth(2).expect("a line").split(',').nth(2).expect("y").to_owned();
    change(&second, "NaN");
    let message = refused(&given);
    assert!(message.contains("line 3: y is \"NaN\", which is no finite number"), "{message}");
    let message = cell.fails(1, &["--predictions", "mine=/nowhere"]);
    assert!(message.contains("--arm and --split choose it"), "{message}");
}

#[test]
fn a_bad_suite_is_named_with_exit_code_2() {
    let fault = |from: &str, to: &str| Cell::new().with(from, to).fails(2, &[]);
    let overlap = fault("test = { monday = \"1-143/2\" }", "test = { monday = \"1-143/2, 4\" }");
    assert!(
        overlap.contains("arm \"small\", split \"even-to-odd\", train and test: station 4 of session \"monday\" is in both"),
        "{overlap}"
    );
    let unknown = fault("draws = 300", "drawn = 300");
    assert!(unknown.contains("drawn"), "{unknown}");
    let missing = fault("96-143", "96-144");
    assert!(
        missing.contains("station 144 of session \"monday\" does not exist: it has 144"),
        "{missing}"
    );
    let beside = fault("beside = \"slabs\"\n", "");
    assert!(beside.contains("a split by rows may leak: name the split"), "{beside}");
    let kind = fault("kind = \"region\"", "kind = \"session\"");
    assert!(kind.contains("session \"monday\" trains too"), "{kind}");
    let list = fault("0-95", "95-0");
    assert!(list.contains("is no list of stations"), "{list}");
    let message = Cell::new().fails(2, &["--arm", "large"]);
    assert!(message.contains("no arm \"large\"; it has small"), "{message}");
}

#[test]
fn data_that_are_missing_or_altered_are_named_with_exit_code_1() {
    let cell = Cell::new();
    let table = cell.path("data/monday.csv");
    let text = fs::read_to_string(&table).expect("readable");
    fs::write(&table, text.clone() + "\n").expect("writable");
    let message = cell.fails(1, &[]);
    assert!(
        message.contains("digest") && message.contains("another version or was altered"),
        "{message}"
    );
    fs::remove_file(&table).expect("there");
    let message = cell.fails(1, &[]);
    assert!(
        message.contains("download tables/monday.csv from https://example.org/small (CC0-1.0)"),
        "{message}"
    );
    // Data in another folder.
    cell.write("elsewhere/monday.csv", &text);
    let elsewhere = cell.path("elsewhere").display().to_string();
    cell.command(&["--data", &elsewhere]).assert().code(0);
}

/// Largest difference from a figure of independent code, as a share: the figures are stated to three or four digits.
const APART: f64 = 1e-3;

/// The suite of tables with its pipeline files set up as that code is: no weak prior, and positions alone.
fn as_independent_code(folder: &Path) -> PathBuf {
    let write = |name: &str, text: String| {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("writable");
        fs::write(path, text).expect("writable");
    };
    for robot in ["pipelines/robots/wam.toml", "tests/robots/positioner.toml"] {
        write(robot, fs::read_to_string(robot).expect("readable"));
    }
    for name in ["pipelines/stations-wam.toml", "pipelines/stations-positioner.toml"] {
        let text = fs::read_to_string(name).expect("readable");
        let plain = "[fit]\nprior_length_mm = 0\nprior_angle_mrad = 0\n";
        let changed =
            text.replace("orientations = true", "orientations = false").replace("[fit]\n", plain);
        assert_ne!(text, changed);
        write(name, changed);
    }
    let suite = "pipelines/benchmarks/stations.toml";
    write(suite, fs::read_to_string(suite).expect("readable"));
    folder.join(suite)
}

#[test]
fn base_target_and_geometry_are_those_of_independent_code() {
    let data = Path::new("../shared/stations");
    if !data.exists() {
        assert!(std::env::var_os("CI").is_none(), "../shared/stations: absent");
        eprintln!(
            "SKIPPED: ../shared/stations: absent, so no figure was compared with another program"
        );
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    let asked = Asked {
        suite: as_independent_code(folder.path()),
        data: Some(data.to_owned()),
        arms: vec!["wam".to_owned(), "positioner".to_owned()],
        ..Asked::default()
    };
    let result = benchmark(&asked, &Quiet).unwrap_or_else(|error| panic!("{error}"));
    let rows = &result.rows.rows;
    let published = rows.iter().filter(|row| row.model.ends_with(", independent code"));
    let mut compared = 0;
    for reference in published {
        let model = if reference.model.starts_with("base") { "base_target" } else { "geometric" };
        let own = value(rows, (&reference.robot, &reference.split), model, reference.figure);
        println!(
            "{} {} {model} {:?}: {own:.4}, independent code {:.4}",
            reference.robot, reference.split, reference.figure, reference.value
        );
        assert!((own / reference.value - 1.0).abs() < APART, "{own} {reference:?}");
        compared += 1;
    }
    assert_eq!(compared, 9);
}
