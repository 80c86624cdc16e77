//! What the schemas allow against what runs write: every word of every column is written by some run, and every column
//! has a value in some run. Tables come from the commands themselves, on sessions that show what is rare.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use posegrid::files::schema::{self, Role};
use posegrid::files::table;

use super::cell::{Cell, ended, posegrid, undisturbed};
use super::{conventions, damaged, driven, iso_9283, planned};

/// Words that no run here writes: column, words, and where they are held instead, or what they wait for.
const NOT_BY_A_RUN: &[(&str, &[&str], &str)] = &[
    (
        "calibrations.error_frame",
        &["fitted"],
        "these cells are surveyed; src/io/tables/tests.rs writes one whose base was fitted, and so do the runs of real recordings",
    ),
    (
        "compensation.error_frame",
        &["fitted"],
        "these cells are surveyed; src/io/tables/tests.rs writes one whose base was fitted, and so do the runs of real recordings",
    ),
    (
        "compensation.refused",
        &["singularity", "branches"],
        "src/compensation/tests.rs: a node of such a table, and two nodes that no joint motion joins",
    ),
    (
        "corrected_targets.refused",
        &["refused_node", "branches", "no_convergence", "too_large"],
        "tests/run/compensate.rs and src/numerics/compensation/tests.rs: tables made for it, with a hole, with a jump and with a smaller largest error",
    ),
    (
        "corrections.form",
        &["krl", "rapid", "fanuc", "urscript"],
        "tests/run/compensate/programs.rs and src/app/cli/compensate/program/write.rs: files of programs",
    ),
    ("joint_errors.joint_unit", &["mm"], "tests/run/any_arm.rs: an arm on a track"),
    (
        "rejects.code",
        &[
            "nothing_lost",
            "unusable",
            "repeated",
            "alone",
            "target_moved",
            "wrong_target",
            "instrument_moved",
            "flipped_view",
            "several_candidates",
        ],
        "src/io/tables/rejects.rs: words of faults that these cells do not have",
    ),
    (
        "rejects.kind",
        &["rows", "references"],
        "tests/run/tabled.rs: these cells have logs, and rows are of tables of stations",
    ),
    (
        "references.stands_on",
        &["base", "floor"],
        "tests/run/tabled/references.rs: these cells have logs, and references are of tables of stations",
    ),
    (
        "reference_motion.stands_on",
        &["base", "floor"],
        "tests/run/tabled/references.rs: these cells have logs, and references are of tables of stations",
    ),
    (
        "reference_motion.event",
        &["bump", "shock"],
        "tests/run/tabled/references.rs: these cells have logs, and references are of tables of stations",
    ),
    (
        "history.kind",
        &["reference"],
        "tests/run/tabled/references.rs: these cells have logs, and references are of tables of stations",
    ),
    (
        "drift.verdict",
        &["small"],
        "tests/run/history: nothing moved significantly and by less than counts between these sessions",
    ),
    (
        "runs.verdict_of",
        &["nothing"],
        "src/report/verdict.rs: of every run here some correction helps",
    ),
    (
        "grid_steps.angles",
        &["reported", "weighted"],
        "steps are judged from commands alone: to go from the schema",
    ),
    ("grid_steps.model", &["base_target"], "no grid goes by base_target: to go from the schema"),
    (
        "grid_steps.split",
        &["none"],
        "no step is judged on what it was made from: to go from the schema",
    ),
    (
        "parameters.belongs_to",
        &["gauge"],
        "tests/run/lengths.rs: these cells have a tracker alone, and gauges read lengths",
    ),
    (
        "parameters.quantity",
        &["offset", "tilt_1", "tilt_2"],
        "tests/run/lengths.rs: quantities of gauges",
    ),
    (
        "readings.reads",
        &["distance", "height"],
        "tests/run/lengths.rs: these cells have a tracker alone, which reads positions",
    ),
    (
        "readings.reason",
        &["target_moved", "wrong_target", "instrument_moved", "flipped_view", "several_candidates"],
        "as of stations.reason; wrong targets and flips are left out by an estimate, after the readings were published",
    ),
    (
        "sources.model",
        &["base_target", "geometric", "full"],
        "tests/run/lengths.rs: these cells have a tracker alone",
    ),
    (
        "sources.reads",
        &["point", "pose", "distance", "height"],
        "tests/run/lengths.rs: these cells have a tracker alone, which reads positions",
    ),
    (
        "estimate_residuals.base_refit",
        &["first"],
        "tests/run/estimated.rs: the sessions of the one pool here are found by chosen stations",
    ),
    (
        "length_residuals.model",
        &["base_target", "geometric", "full"],
        "tests/run/lengths.rs: these cells have a tracker alone",
    ),
    (
        "length_residuals.role",
        &["training", "held_out"],
        "tests/run/lengths.rs: these cells have a tracker alone",
    ),
    (
        "length_residuals.reads",
        &["distance", "height"],
        "tests/run/lengths.rs: these cells have a tracker alone, which reads positions",
    ),
    (
        "parameters.identifiability",
        &["moves_nothing"],
        "a reflector on the last axis, which no simulated session has",
    ),
    (
        "sampling_plan.design",
        &["uniform_grid", "d_optimal"],
        "a session's poses are of the design greedy_variance, those that verify of random: to go from the schema",
    ),
    (
        "semivariograms.similarity",
        &["not_shown"],
        "src/similarity/variogram.rs: fewer pairs than stations that can be fitted have",
    ),
    (
        "stations.reason",
        &["target_moved", "wrong_target", "instrument_moved", "flipped_view", "several_candidates"],
        "src/join/fault_tests.rs: readings moved by hand while the arm is stationary; tests/run/tabled/references.rs: a bump; tests/cameras.rs: a camera's flipped views",
    ),
    (
        "stations.verdict",
        &["ambiguous"],
        "src/join/fault_tests.rs: a target that was knocked while the arm is stationary",
    ),
];

/// Columns that have a value in no run here, and why.
const NULL_IN_EVERY_RUN: &[(&str, &str)] = &[
    ("sources.", NO_LENGTHS),
    ("length_residuals.", NO_LENGTHS),
    ("references.", OF_TABLES),
    ("reference_motion.", OF_TABLES),
    ("stations.motion_cov_", OF_TABLES),
    ("readings.motion_cov_", OF_TABLES),
    ("readings.stated_", NO_COVARIANCE),
    ("readings.length_", NO_LENGTHS),
    (
        "rejects.line",
        "tests/run/tabled.rs: these cells have logs, and lines are of tables of stations",
    ),
    (
        "rejects.column",
        "tests/run/tabled.rs: these cells have logs, and columns are of tables of stations",
    ),
    (
        "estimate_residuals.target",
        "tests/reflectors.rs: these cells have one target, which has no name",
    ),
    ("residuals.target", "tests/reflectors.rs: these cells have one target, which has no name"),
    ("grid_steps.phases", "no grid is decimated: to go from the schema"),
    ("calibrations.camera_size", "tests/cameras.rs: these cells have a tracker"),
    ("calibrations.joint_units", ALL_TURN),
    ("compensation.joint_units", ALL_TURN),
    ("sampling_plan.joint_units", ALL_TURN),
    ("logs.stated_", NO_COVARIANCE),
    ("stations.stated_", NO_COVARIANCE),
];
const OF_TABLES: &str = "tests/run/tabled/references.rs: these cells have logs, and references are of tables of stations";
const ALL_TURN: &str = "every joint of these arms turns; tests/run/any_arm.rs has one that slides";
const NO_LENGTHS: &str = "tests/run/lengths.rs: these cells have a tracker alone, and these are of instruments of one length";
const NO_COVARIANCE: &str = "the simulated tracker states none; tests/covariances.rs has them from logs and tables to the fit";

/// What was found in the files read so far.
#[derive(Default)]
struct Written {
    /// Words by column, named TABLE.COLUMN.
    words: BTreeMap<String, BTreeSet<String>>,
    /// Columns with a value in some row.
    filled: BTreeSet<String>,
}

impl Written {
    /// Adds every table under a folder.
    fn folder(&mut self, folder: &Path) {
        for entry in fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("readable").path();
            if path.is_dir() {
                self.folder(&path);
            } else if path.extension().is_some_and(|end| end == "parquet") {
                self.file(&path);
            }
        }
    }

    /// Adds the table in a file.
    fn file(&mut self, path: &Path) {
        let name = table::head(path).expect("a table").table;
        let schema = schema::find(&name.expect("a published table")).expect("known");
        let table = table::read(path, schema).expect("a table by its schema");
        for column in &schema.columns {
            let name = format!("{}.{}", schema.table, column.name);
            let array = table.batch().column_by_name(&column.name).expect("by its schema");
            if array.null_count() < array.len() {
                self.filled.insert(name.clone());
            }
            if column.values.is_some() {
                let words = array.as_string::<i32>().iter().flatten();
                let found = self.words.entry(name).or_default();
                found.extend(words.map(str::to_owned));
            }
        }
    }

    /// Words that the schemas allow and no file had, by column.
    fn missing_words(&self) -> BTreeMap<String, BTreeSet<String>> {
        let mut missing = BTreeMap::new();
        for (table, column) in columns() {
            let name = format!("{table}.{}", column.name);
            let found = self.words.get(&name);
            let is_missing = |word: &&String| !found.is_some_and(|found| found.contains(*word));
            let words: BTreeSet<String> =
                column.values.iter().flatten().filter(is_missing).cloned().collect();
            if !words.is_empty() {
                missing.insert(name, words);
            }
        }
        missing
    }

    /// Columns that had no value in any file.
    fn missing_columns(&self) -> Vec<String> {
        columns()
            .map(|(table, column)| format!("{table}.{}", column.name))
            .filter(|name| !self.filled.contains(name))
            .collect()
    }
}

/// The columns of the published tables of a lake, each with its table's name.
fn columns() -> impl Iterator<Item = (&'static str, &'static schema::ColumnSchema)> {
    schema::all()
        .iter()
        .filter(|schema| schema.role == Role::Published)
        .flat_map(|schema| schema.columns.iter().map(|column| (schema.table.as_str(), column)))
}

#[test]
fn every_word_and_every_column_is_written_by_some_run() {
    let mut written = Written::default();
    written.folder(&undisturbed().path("lake"));
    for make in RUNS {
        let cell = make();
        for folder in ["lake", "trend", "corrected"] {
            let folder = cell.path(folder);
            if folder.exists() {
                written.folder(&folder);
            }
        }
    }
    let excepted = NOT_BY_A_RUN.iter().map(|(column, words, _)| {
        let words = words.iter().copied().map(str::to_owned);
        ((*column).to_owned(), words.collect())
    });
    assert_eq!(
        written.missing_words(),
        excepted.collect::<BTreeMap<_, BTreeSet<_>>>(),
        "words that no run wrote (left), and those that are known to be so (right)"
    );
    let is_known = |column: &str| {
        let mut known = NULL_IN_EVERY_RUN.iter();
        known.any(|(begin, _)| column.starts_with(begin))
    };
    let missing = written.missing_columns();
    let unknown: Vec<_> = missing.iter().filter(|column| !is_known(column)).collect();
    assert!(unknown.is_empty(), "null in every run: {unknown:?}");
    for (begin, reason) in NULL_IN_EVERY_RUN {
        let is_missing = missing.iter().any(|column| column.starts_with(begin));
        assert!(is_missing, "{begin} has values now; it is listed as null: {reason}");
    }
}

/// Cells in which commands wrote tables.
const RUNS: &[fn() -> Cell] = &[
    driven_by_a_table,
    orientations,
    pool,
    tested,
    measured_nodes,
    few_stations,
    beyond_reach,
    damaged_logs,
    plan,
    changes,
    conventions::every_one,
];

/// Runs the pipeline of a cell, which has a result, good or not.
fn ran(cell: Cell, arguments: &[&str]) -> Cell {
    let ended = cell.run(arguments);
    assert!([0, 3].contains(&ended.code), "{}{}", ended.results, ended.messages);
    cell
}

/// A session that was driven by a table of the session before.
fn driven_by_a_table() -> Cell {
    ran(driven::driven(), &["tue"])
}

/// A session with measured orientations that goes to five poses again and again, judged at a tool tip; its log's samples
/// are published, both kinds of nodes tried, and targets corrected.
fn orientations() -> Cell {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let poses = folder.path().join("poses.csv");
    fs::write(&poses, iso_9283::poses()).expect("writable");
    let path = poses.to_str().expect("UTF-8");
    let cell = Cell::new()
        .with("/tracker/point", "/tracker/pose")
        .with(
            "[fit]",
            "[fit]\norientations = true\nloss = { kind = \"cauchy\", tuning = 2.5 }",
        )
        .with("divisor = 2 }", "divisor = 2, orientation_rad = 1e-5 }")
        .with(
            "[tolerance]",
            "interpolations = [\"idw\", \"trilinear\"]\nsources = [\"measured\", \"model\"]\n\n\
             [report]\ntool_tip = { frame = \"tool\", xyz_mm = [5, 0, 200] }\n\n[tolerance]",
        )
        .with("lake = \"lake\"", "lake = \"lake\"\nlogs = true")
        .with(
            "base = \"base\"",
            "base = \"base\"\npayload_kg = 12.5\ncontroller_model = \"KR C4\"\nabsolute_accuracy_option = false",
        )
        .with_simulated("again", &["--six-dof", "--poses", path]);
    let cell = ran(cell, &[]);
    corrected(&cell, "again");
    cell
}

/// Three sessions learnt from together, each judged by the others too; in one the beam is lost often, and written as zeros,
/// one is measured in a wrong length unit.
fn pool() -> Cell {
    let lost = ["--lost-as-zeros", "--lost-share", "0.1", "--random", "61"];
    let scaled = ["--tracker-scale-ppm", "400", "--random", "62"];
    let cell = Cell::new()
        .with("# sessions", "pool = \"all\"")
        .with(
            "[tolerance]",
            "[report]\nleave_sessions_out = true\nlocate = { by = \"chosen\", stations = 12 }\n\n[tolerance]",
        )
        .with("[fit]", "[fit]\nloss = { kind = \"huber\", tuning = 1.5 }")
        .with_simulated("mon", &["--random", "60"])
        .with_simulated("tue", &lost)
        .with_simulated("wed", &scaled);
    ran(cell, &[])
}

/// A session that another one judges, which is of another arm; its table corrects a target.
fn tested() -> Cell {
    let other = ["--arm", "5", "--size", "600,1200,600", "--cone-deg", "3", "--random", "130"];
    let cell = Cell::new()
        .with_simulated("mon", &["--size", "720,1440,720", "--grid-step", "240"])
        .with_simulated("wed", &other);
    let cell = ran(cell, &["mon", "--test", "wed"]);
    let table = cell.table("compensation", "mon");
    let mean = |column| {
        let values = table.f64(column).values();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let [x, y, z] = ["x_mm", "y_mm", "z_mm"].map(mean);
    let target = format!("target,x_mm,y_mm,z_mm\nA,{x},{y},{z}\n");
    fs::write(cell.path("target.csv"), target).expect("writable");
    let mut command = posegrid();
    command.arg("compensate").arg(cell.table_file("compensation", "mon"));
    command
        .arg(cell.path("target.csv"))
        .arg("--out")
        .arg(cell.path("out.csv"))
        .args(["--allow", "not-met"]);
    ended(&mut command).expect(3, &["1 corrected"]);
    cell
}

/// A grid whose stations are the nodes, one of them without a measurement now and then, and geometry alone.
fn measured_nodes() -> Cell {
    let flags = ["--size", "480,480,480", "--grid-step", "120", "--lost-share", "0.15"];
    let cell = Cell::new()
        .with("steps_mm = [180, 240, 360]", "steps_mm = [240]\nsources = [\"measured\"]")
        .with("harmonics = 12", "enabled = false")
        .with_simulated("mon", &flags);
    ran(cell, &[])
}

/// Stations too few to show anything, and geometry alone.
fn few_stations() -> Cell {
    let cell = Cell::new()
        .with("harmonics = 12", "enabled = false")
        .with_simulated("mon", &["--random", "12"]);
    ran(cell, &[])
}

/// A grid in a box that the arm does not reach all of; the tool is stated beside the measured target.
fn beyond_reach() -> Cell {
    let steps = "steps_mm = [400]\nbox = { low_mm = [0, -1500, 0], high_mm = [3200, 1500, 2400] }";
    let cell = Cell::new()
        .with("steps_mm = [180, 240, 360]", steps)
        .with("target_is_tool = true", "target_is_tool = false")
        .with_simulated("mon", &["--random-joints", "120"]);
    ran(cell, &[])
}

/// Logs with a broken chunk, without one, and cut.
fn damaged_logs() -> Cell {
    let cell = Cell::new()
        .with("# sessions", "max_lost_share = 1.0\nmax_rejected_share = 1.0\nsettle_s = 0")
        .with("harmonics = 12", "enabled = false")
        .with_quickstart("mon")
        .with_quickstart("tue")
        .with_quickstart("wed")
        .with_log("mon", "controller.mcap", |mut bytes| {
            bytes[100_000] ^= 0x10;
            bytes
        })
        .with_log("tue", "controller.mcap", |bytes| damaged::without_a_chunk(&bytes))
        .with_log("wed", "tracker.mcap", |bytes| bytes[..bytes.len() / 2].to_vec());
    ran(cell, &[])
}

/// A plan from a prior, with drift checks, of a tolerance that it meets.
fn plan() -> Cell {
    let cell = planned::planning()
        .with("[plan.known]\n# of the past", "# known")
        .with("mm = 0.5", "mm = 5")
        .with("poses = [12]", "poses = [12, 20]")
        .with("whole_model_robots = 1", "whole_model_robots = 2")
        .with(
            "drift_check_every = 0",
            "drift_check_every = 5\nrobots_meet = { share = 0.5, confidence = 0.5 }",
        )
        .with("steps_mm = [500]", "steps_mm = [500, 1000]\nsources = [\"measured\", \"model\"]");
    let ended = ended(posegrid().arg("plan").arg(cell.pipeline()));
    assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    cell
}

/// Sessions in a row, and their history: the same arm, its target moved, its target set up anew, another arm, and the first
/// one again, once more by other settings.
fn changes() -> Cell {
    const SAME: usize = 8;
    let same = (0..SAME).map(|place| (format!("s{place}"), ["--arm", "3"]));
    let changed = [["--target-sd-mm", "1"], ["--target-sd-mm", "40"], ["--arm", "5"]];
    let changed = changed.into_iter().enumerate();
    let changed = changed.map(|(place, flags)| (format!("t{place}"), flags));
    let last = [("u0".to_owned(), ["--arm", "3"])];
    let cell = Cell::new().with("sd_mm = 0.2", "sd_mm = 50");
    let cell =
        same.chain(changed).chain(last).enumerate().fold(cell, |cell, (place, (name, flags))| {
            let poses = (60 + place).to_string();
            let flags = [&flags[..], &["--random", &poses]].concat();
            cell.with_simulated(&name, &flags)
        });
    let cell = ran(cell, &[]);
    let cell = ran(cell.with("mm = 0.5", "mm = 0.6"), &["u0"]);
    let (lake, trend) = (cell.path("lake"), cell.path("trend"));
    let history = ended(posegrid().arg("history").arg(lake).arg("--out").arg(trend));
    assert!([0, 3].contains(&history.code), "{}", history.messages);
    cell
}

/// Targets corrected by both tables of a run, by every exception, and refused for what can be wrong with them.
fn corrected(cell: &Cell, session: &str) {
    fs::create_dir(cell.path("corrected")).expect("writable");
    let table = cell.table("compensation", session);
    let known = (0..table.rows()).find(|&row| table.text("refused").is_null(row));
    let node = known.expect("a node with a value");
    let numbers = |columns: &[&str]| -> String {
        let values = columns.iter().map(|column| table.f64(column).value(node));
        listed(&values.collect::<Vec<_>>()) + ","
    };
    let (place, turn) = (numbers(&["x_mm", "y_mm", "z_mm"]), numbers(&["qx", "qy", "qz", "qw"]));
    let configuration = table.text("configuration").value(node).to_owned();
    let joints = table.list("joints_rad").value(node);
    let joints = joints.as_primitive::<Float64Type>().values().to_vec();
    let with = |joint: usize, angle: f64| {
        let mut joints = joints.clone();
        joints[joint] = angle;
        format!(",{}", listed(&joints))
    };
    let stations = cell.table("stations", session);
    let own = stations.list("joints_rad").value(0);
    let own = format!(",{}", listed(own.as_primitive::<Float64Type>().values()));
    let no_joints = ",".repeat(6);
    let write = |name: &str, text: &str| {
        fs::write(cell.path(name), text).expect("writable");
    };
    let wrong = [
        format!("no_orientation,{place},,,,{configuration},{no_joints}"),
        format!("configuration,{place}{turn},{no_joints}"),
        format!("apart,1,2,3,,,,,,{own}"),
        format!("joint_range,,,,,,,,,{}", with(0, joints[0] + 1.5)),
        format!("joint_limits,,,,,,,,,{}", with(4, 130_f64.to_radians())),
        format!("singularity,,,,,,,,,{}", with(4, 0.001)),
        format!("tool,{place}{turn}{configuration},drill{no_joints}"),
        format!("out_of_reach,9000,0,0,{turn}{configuration},{no_joints}"),
        format!("orientation,{place}1,0,0,0,{configuration},{no_joints}"),
        format!("outside,9000,0,0,,,,,{configuration},{no_joints}"),
    ];
    let columns = "target,x_mm,y_mm,z_mm,qx,qy,qz,qw,configuration,tool";
    let angles = "q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad";
    write("wrong.csv", &format!("{columns},{angles}\n{}\n", wrong.join("\n")));
    write("short.csv", "target,q1_rad\nA,0\n");
    write("one.csv", &format!("target,{angles}\nA{own}\n"));
    write("far.csv", &format!("target,{angles}\nA{}\n", with(0, joints[0] + 1.0)));
    compensated(cell, session);
}

/// Runs `compensate` on the files of targets.
fn compensated(cell: &Cell, session: &str) {
    let arm = cell.table_file("calibrations", session);
    let grid = cell.table_file("compensation", session);
    let files: [(&Path, &str, &str, &str); 14] = [
        (&arm, "wrong.csv", "by_arm.parquet", ""),
        (&grid, "wrong.csv", "by_grid.parquet", ""),
        (&arm, "short.csv", "short.parquet", ""),
        (&arm, "one.csv", "one.csv", ""),
        (&arm, "one.csv", "one.json", ""),
        (&arm, "far.csv", "range.parquet", "--allow joint-range"),
        (&arm, "one.csv", "tool.parquet", "--allow tool --tool drill"),
        (&arm, "one.csv", "payload.parquet", "--allow payload --payload-kg 99"),
        (&arm, "one.csv", "mounting.parquet", "--allow mounting --mounting wall"),
        (&arm, "one.csv", "base.parquet", "--allow base --base other"),
        (
            &arm,
            "one.csv",
            "controller.parquet",
            "--allow controller-model --controller-model other",
        ),
        (&arm, "one.csv", "absolute.parquet", "--allow absolute-accuracy --absolute-accuracy on"),
        (&arm, "one.csv", "temperature.parquet", "--allow temperature --temperature-c 60"),
        (&arm, "wrong.csv", "configuration.parquet", "--allow configuration"),
    ];
    for (table, targets, out, flags) in files {
        let mut command = posegrid();
        command.arg("compensate").arg(table).arg(cell.path(targets));
        command.arg("--out").arg(cell.path("corrected").join(out));
        command.args(["--allow", "not-met", "--allow", "not-shown"]);
        let ended = ended(command.args(flags.split_whitespace()));
        assert!([0, 1, 3].contains(&ended.code), "{out}: {}", ended.messages);
    }
}

/// Numbers with commas between them.
fn listed(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(f64::to_string).collect();
    texts.join(",")
}
