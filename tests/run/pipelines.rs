//! Pipeline files: those in `pipelines/` load, and bad ones get a clear error and exit code 2.

use crate::common;
mod documents;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, SystemTime};

use posegrid::kinematics::RobotFile;
use posegrid::pipeline::configuration::{Configuration, ConfigurationError, Overrides, Why};
use posegrid::pipeline::file::PipelineFile;
use posegrid::pipeline::planning::Planning;

/// TOML files of a folder, by name.
fn files(folder: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("the folder is part of the project");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("readable").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
    paths.sort();
    assert!(!paths.is_empty(), "{folder} has no TOML file");
    paths
}

#[test]
fn every_robot_file_makes_an_arm() {
    for path in files("pipelines/robots") {
        let text = fs::read_to_string(&path).expect("readable");
        let file: RobotFile =
            toml::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        file.arm().unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}

#[test]
fn every_pipeline_file_of_a_benchmark_is_read() {
    for path in files("pipelines/benchmarks/arms") {
        let text = fs::read_to_string(&path).expect("readable");
        toml::from_str::<PipelineFile>(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    }
}

#[test]
fn every_pipeline_file_makes_a_plan_of_six_steps_or_more() {
    let recordings = common::recording("README.md").is_some();
    for path in files("pipelines") {
        let text = fs::read_to_string(&path).expect("readable");
        toml::from_str::<PipelineFile>(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        if !recordings && text.contains("../shared/") {
            eprintln!("SKIPPED: the sessions of {} are absent", path.display());
            continue;
        }
        if text.contains("\n[plan]") {
            // Its sessions are still to be measured.
            let planning = Planning::load(&path, None, None).unwrap_or_else(|e| panic!("{e}"));
            assert!(planning.settings.grid.steps_mm.len() >= 6);
            continue;
        }
        let configuration =
            Configuration::load(&path, &Overrides::default()).unwrap_or_else(|e| panic!("{e}"));
        assert!(configuration.stages.grid.steps_mm.len() >= 6, "{}", path.display());
        // Published tables do not state everything.
        let unstated = ["[robot] up", "there is no [commanded]"];
        let is_told = |remark: &&String| {
            let of_table = text.contains("\n[stations]");
            !(of_table && unstated.iter().any(|own| remark.starts_with(own)))
        };
        let remarks: Vec<&String> = configuration.remarks.iter().filter(is_told).collect();
        assert!(remarks.is_empty(), "{}: {remarks:?}", path.display());
    }
}

#[test]
fn the_settings_of_a_run_do_not_know_where_it_ran() {
    let cell = Cell::new(&[]);
    let configuration = cell.configuration(&Overrides::default()).expect("a good file");
    let elsewhere = Cell::new(&[]).configuration(&Overrides::default()).expect("a good file");
    assert_eq!(configuration.settings, elsewhere.settings);
    for hidden in [cell.folder(), "arm.toml", "cell-3", "controller.mcap"] {
        assert!(!configuration.settings.contains(hidden), "{hidden} in {}", configuration.settings);
    }
    let stricter = Cell::new(&[("mm = 0.5", "mm = 0.4")]);
    let stricter = stricter.configuration(&Overrides::default()).expect("a good file");
    assert_ne!(configuration.settings, stricter.settings);
}

#[test]
fn sessions_are_the_folders_with_both_logs_and_others_are_reported() {
    let configuration = Cell::new(&[]).configuration(&Overrides::default()).expect("good");
    let names: Vec<_> = configuration.pieces.iter().map(|piece| piece.session.as_str()).collect();
    assert_eq!(names, ["mon", "tue"]);
    let left: Vec<_> = configuration.left_out.iter().map(|left| left.name.as_str()).collect();
    assert_eq!(left, ["none"], "it has neither log");
    assert_eq!(configuration.set_aside.len(), 1, "it has a controller's log only");
    let half = &configuration.set_aside[0];
    assert_eq!((half.session.as_str(), half.before), ("half", 0));
    assert_eq!(half.why, Why::Waits("it has no tracker.mcap yet".to_owned()));
}

#[test]
fn pools_learn_from_each_all_or_everything_until() {
    let cell = |pool: &str| {
        let pool = format!("folder = \"cell\"\npool = {pool}");
        Cell::new(&[("folder = \"cell\"", &pool)])
    };
    let pieces = |pool: &str, sessions: &[&str]| {
        let overrides = Overrides {
            sessions: sessions.iter().map(|&own| own.to_owned()).collect(),
            ..Overrides::default()
        };
        let cell = cell(pool).with_logs("wed", &["controller", "tracker"]);
        let configuration = cell.configuration(&overrides).expect("good");
        let piece = |p: &posegrid::pipeline::configuration::WorkPiece| {
            let training: Vec<_> = p.training.iter().map(|s| s.name.clone()).collect();
            format!("{}: {}", p.session, training.join(" "))
        };
        configuration.pieces.iter().map(piece).collect::<Vec<_>>()
    };
    let two = ["mon", "tue"];
    assert_eq!(pieces("\"each\"", &two), ["mon: mon", "tue: tue"]);
    assert_eq!(pieces("\"all\"", &two), ["pooled: mon tue"]);
    assert_eq!(pieces("\"until\"", &two), ["mon: mon", "tue: mon tue"]);
    // Of more than the latest two the first is left out; `half` waits and does not count.
    let latest = |pool: &str| format!("\"{pool}\"\npool_latest = 2");
    let three = ["tue", "half", "mon", "wed"];
    assert_eq!(pieces(&latest("all"), &three), ["pooled: mon wed"]);
    let until = ["tue: tue", "mon: tue mon", "wed: mon wed"];
    assert_eq!(pieces(&latest("until"), &three), until);
    for (pool, wanted) in [
        ("\"each\"\npool_latest = 2", "left out where each session"),
        ("\"until\"\npool_latest = 1", "2 or more"),
    ] {
        let refused = cell(pool).configuration(&Overrides::default());
        let told = refused.expect_err("no such pool").to_string();
        assert!(told.contains("pool_latest") && told.contains(wanted), "{told}");
    }
}

#[test]
fn a_tool_tip_is_stated_in_the_frame_of_the_tool_or_the_flange() {
    // The tool is 100 mm before the flange and 10 mm beside it, turned by 90° about z: its x is the flange's y.
    let tool = "target_is_tool = true\nflange_from_tool = { xyz_mm = [10, 0, 100], euler_deg = [0, 0, 90], euler_order = \"fixed-xyz\" }";
    let tip = |frame: &str| {
        let report = format!(
            "[report]\ntool_tip = {{ frame = \"{frame}\", xyz_mm = [5, 0, 200] }}\n[tolerance]"
        );
        let cell = Cell::new(&[("target_is_tool = true", tool), ("[tolerance]", &report)]);
        let configuration = cell.configuration(&Overrides::default()).expect("good");
        let tip = configuration.stages.tool_tip.expect("stated");
        format!("{:.3} {:.3} {:.3}", tip.x, tip.y, tip.z)
    };
    assert_eq!(tip("tool"), "10.000 5.000 300.000");
    assert_eq!(tip("flange"), "5.000 0.000 200.000");
    let none = Cell::new(&[]).configuration(&Overrides::default()).expect("good");
    assert_eq!(none.stages.tool_tip, None);
}

#[test]
fn a_test_session_is_not_learnt_from() {
    let test = |sessions: &[&str]| {
        Cell::new(&[]).configuration(&Overrides {
            sessions: sessions.iter().map(ToString::to_string).collect(),
            test: vec!["tue".to_owned()],
            ..Overrides::default()
        })
    };
    let configuration = test(&[]).expect("good");
    assert_eq!(configuration.pieces.len(), 1);
    assert_eq!(configuration.pieces[0].training[0].name, "mon");
    assert_eq!(configuration.pieces[0].test[0].name, "tue");
    let both = test(&["tue"]).expect_err("learnt from and judging");
    assert!(matches!(both, ConfigurationError::NamedTwice { .. }), "{both}");
}

/// Each change to a good file, and what the message has to hold.
const BAD: [(&str, &str, &[&str]); 29] = [
    (
        "[tolerance]",
        "[report]\nlocate = { by = \"chosen\", stations = 3 }\n[tolerance]",
        &["[report.locate] stations = 3", "4 or more"],
    ),
    (
        "[tolerance]",
        "[report]\nlocate = { by = \"best\" }\n[tolerance]",
        &["by = \"best\"", "\"first\" or \"chosen\""],
    ),
    (
        "[tolerance]",
        "[report]\ntool_tip = { frame = \"tool\", xyz_mm = [0, 0, 200] }\n[tolerance]",
        &["[commanded] flange_from_tool is missing", "tool_tip", "frame = \"flange\""],
    ),
    (
        "[tolerance]",
        "[report]\ntool_tip = { xyz_mm = [0, 0, 200] }\n[tolerance]",
        &["[report.tool_tip]", "needs frame (\"flange\" or \"tool\")"],
    ),
    (
        "mm = 0.5",
        "mm = 0.5\ntolerence = 1",
        &["[tolerance] has tolerence (line 36), which nothing reads", "confidence"],
    ),
    (
        "topic = \"/p\"\ntime = \"header\"\nunit = \"m\"",
        "topic = \"/p\"\ntime = \"header\"",
        &["[tracker] (line 23) needs unit", "\"m\", \"mm\", \"cm\", \"inch\", \"ft\" or \"um\""],
    ),
    (
        "unit = \"rad\"",
        "unit = \"grad\"",
        &["unit = \"grad\"", "\"rad\", \"deg\" or \"gon\" (line 14)"],
    ),
    ("uncertainty = ", "# ", &["[tracker] (line 23) needs uncertainty", "range_um = 10"]),
    (
        "target_is_tool = true",
        "",
        &["[commanded] (line 16) needs target_is_tool", "measured reflector"],
    ),
    (
        "target_is_tool = true",
        "target_is_tool = false",
        &["[commanded] flange_from_tool is missing"],
    ),
    (
        "quaternion_xyzw = [0, 0, 0, 1]",
        "euler_deg = [0, 0, 90]",
        &["base_from_command", "euler_order", "moving-zyx"],
    ),
    ("steps_mm = [50, 100]", "steps_mm = [50, 100]\nwithin = -0.05", &["[grid] within = -0.05"]),
    (
        "steps_mm = [50, 100]",
        "steps_mm = [50, 100]\nchoose = \"largest\"",
        &["choose = \"largest\"", "\"within\" or \"fewest-nodes\""],
    ),
    ("steps_mm = [50, 100]", "steps_mm = []", &["[grid] steps_mm = []", "one value or more"]),
    ("steps_mm = [50, 100]", "steps_mm = [50, -1]", &["[grid] steps_mm = -1", "1e-6 or more"]),
    ("steps_mm = [50, 100]", "steps_mm = [50, 50.0]", &["[grid] steps_mm = 50", "given once"]),
    ("steps_mm = [50, 100]", "steps_mm = [50, nan]", &["[grid] steps_mm = nan", "finite"]),
    ("share = 0.95", "share = 95", &["[tolerance] share = 95", "above 0 and below 1"]),
    ("confidence = 0.95", "confidence = 1.0", &["[tolerance] confidence = 1"]),
    ("up = [0, 0, 1]", "up = [0, 0, 9.81]", &["[robot] up", "9.81", "length 1"]),
    ("up = [0, 0, 1]", "up = [0, 0, 0]", &["[robot] up", "length 0"]),
    ("file = \"arm.toml\"", "file = \"arn.toml\"", &["arn.toml", "[robot] file", "No such file"]),
    ("folder = \"cell\"", "folder = \"cel\"", &["cel,", "[input] folder", "No such file"]),
    (
        "folder = \"cell\"",
        "folder = \"cell\"\nsessions = [\"wed\"]",
        &["session \"wed\"", "no such folder", "mon, tue"],
    ),
    (
        "folder = \"cell\"",
        "folder = \"cell\"\nsessions = [\"none\"]",
        &["session \"none\"", "no tracker.mcap"],
    ),
    (
        "folder = \"cell\"",
        "folder = \"cell\"\nsessions_by = \"file_name\"",
        &["[input] controller", "{session}"],
    ),
    (
        "folder = \"cell\"",
        "folder = \"cell\"\ntracker = \"{session}.mcap\"",
        &["[input] tracker", "sessions_by"],
    ),
    ("folder = \"cell\"", "folder = \"cell\"\nsessions = [\"../cell/mon\"]", &["not by a path"]),
    (
        "[tolerance]",
        "[fit]\norientation = true\n[tolerance]",
        &["[fit] has orientation (line 35)", "orientations"],
    ),
];

#[test]
fn a_bad_file_is_reported_what_is_wrong_where_and_what_would_do() {
    for (good, bad, told) in BAD {
        let cell = Cell::new(&[(good, bad)]);
        let error = cell.configuration(&Overrides::default());
        let error = error.expect_err(bad).to_string();
        for part in told {
            assert!(error.contains(part), "{bad}: no {part:?} in: {error}");
        }
    }
}

#[test]
fn several_missing_keys_are_told_at_once_with_their_lines() {
    let cell = Cell::new(&[
        ("unit = \"rad\"\n", ""),
        ("share = 0.95\nconfidence = 0.95\n", "tolerence = 1\n"),
        ("uncertainty = ", "# "),
    ]);
    let error = cell.configuration(&Overrides::default()).expect_err("keys are missing");
    let told = error.to_string();
    for part in [
        "[controller] (line 11) needs unit (\"rad\", \"deg\" or \"gon\"), such as unit = \"rad\"",
        "[tracker] (line 22) needs uncertainty, such as ",
        "[tolerance] (line 33) needs share, confidence; [tolerance] has tolerence (line 35), which nothing reads",
        "; every key: `posegrid schema pipeline`",
    ] {
        assert!(told.contains(part), "no {part:?} in: {told}");
    }
    let cell = Cell::new(&[]);
    let arm = cell.path("arm.toml");
    let text = fs::read_to_string(&arm).expect("readable");
    let without: Vec<&str> = text.lines().filter(|line| !line.starts_with("d_mm")).collect();
    fs::write(&arm, without.join("\n")).expect("writable");
    let error = cell.configuration(&Overrides::default()).expect_err("keys are missing");
    let told = error.to_string();
    for part in [
        "arm.toml: ",
        "`posegrid schema robot`",
        "[[joint]] 1 (line ",
        "[[joint]] 2 (line ",
        "needs d_mm",
    ] {
        assert!(told.contains(part), "no {part:?} in: {told}");
    }
    let out = cell.path("simulated");
    let output = posegrid().arg("simulate").arg(&arm).args(POSES).arg("--out").arg(&out).output();
    let message = String::from_utf8(output.expect("runs").stderr).expect("UTF-8");
    assert!(message.contains("[[joint]] 2 (line ") && !message.contains("\\n"), "{message}");
}

#[test]
fn settings_of_other_sections_are_checked_before_a_log_is_opened() {
    for (section, key) in [
        ("[join]\nwindow_s = 0", "[join] window_s = 0"),
        ("[fit]\nrepeatability_mm = -0.1", "[fit] repeatability_mm = -0.1"),
        ("[fit]\nloss = { kind = \"huber\", tuning = 0 }", "[fit.loss] tuning = 0"),
        ("[fit]\norientations = true", "uncertainty.orientation_rad is missing"),
        ("[fit.full]\nnoise_mm = 0", "[fit.full] noise_mm = 0"),
        ("[similarity]\njoint_weights = [1, 1]", "joint_weights = 2 weights"),
        ("[limits]\nchunk_bytes = 0", "[limits] chunk_bytes = 0"),
    ] {
        let cell = Cell::new(&[("[tolerance]", &format!("{section}\n[tolerance]"))]);
        let error = cell.configuration(&Overrides::default());
        let error = error.expect_err(section).to_string();
        assert!(error.contains(key), "{section}: {error}");
    }
}

#[test]
fn fields_of_messages_are_checked_and_taken_over() {
    let with = |topic: &str, keys: &str| {
        let topic = format!("topic = \"{topic}\"");
        Cell::new(&[(&topic, &format!("{topic}\n{keys}"))]).configuration(&Overrides::default())
    };
    for (topic, fields, told) in [
        ("/p", "x = \"a\"", "[tracker] fields = 1 of x, y, z"),
        (
            "/p",
            "x = \"a\", y = \"b[\", z = \"c\"",
            "[tracker] fields = \"b[\", but it has to be a field path",
        ),
        ("/p", "u = \"a\"", "[tracker.fields] has u (line 25)"),
        ("/c", "temperature = \"t\"", "[commanded] fields.temperature"),
        ("/j", "angles = \"q\"", "[controller] fields.angles = \"q\""),
        ("/j", "angles = [\"q\"]", "one path for each of the arm's"),
    ] {
        let error = with(topic, &format!("fields = {{ {fields} }}")).expect_err(fields).to_string();
        assert!(error.contains(told), "{fields}: {error}");
    }
    let configuration =
        with("/p", "frame = \"laser\"\nfields = { x = \"a\", y = \"b[1]\", z = \"c\" }");
    let configuration = configuration.expect("a good file");
    let mapping = configuration.reads.mapping().expect("logs");
    assert_eq!(mapping.tracker.fields.position(), Some(["a", "b[1]", "c"]));
    assert_eq!(mapping.tracker.frame.as_deref(), Some("laser"));
    // What is read of a message decides a result, so it is part of a run's name.
    assert!(configuration.settings.contains("b[1]") && configuration.settings.contains("laser"));
}

#[test]
fn the_command_line_exits_with_2_on_bad_usage_and_says_why_on_stderr() {
    let cell = Cell::new(&[("share = 0.95", "share = 95")]);
    for command in ["run", "check"] {
        let output = posegrid().arg(command).arg(&cell.file).output().expect("runs");
        assert_eq!(output.status.code(), Some(2));
        assert!(output.stdout.is_empty(), "results only on stdout");
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains("[tolerance] share = 95"), "{message}");
    }
    for bad in [&["run"][..], &["fly"], &["run", "p.toml", "--jobs", "0"], &["run", "absent.toml"]]
    {
        assert_eq!(posegrid().args(bad).output().expect("started").status.code(), Some(2));
    }
}

/// Poses of a simulated session.
const POSES: [&str; 6] =
    ["--home", "0,-75,100,25,55,-15", "--size", "720,1440,720", "--grid-step", "120"];

/// Words that name an error of the system or of a library, and no remedy.
const NO_HELP: [&str; 4] = ["os error 21", "External", "Parquet error", "\\n"];

#[test]
fn what_is_given_in_the_place_of_a_file_is_named_with_what_to_give() {
    let cell = Cell::new(&[]);
    let (folder, text) = (cell.path("cell/none"), cell.path("text.parquet"));
    fs::write(&text, "target,x_mm,y_mm,z_mm\nA,1,2,3\n").expect("writable");
    let cut = cell.path("cut.parquet");
    fs::write(&cut, "PAR1 and no more").expect("writable");
    let targets = cell.path("targets.csv");
    fs::copy(&text, &targets).expect("writable");
    let [folder, text, cut, targets] =
        [&folder, &text, &cut, &targets].map(|path| path.to_str().expect("UTF-8").to_owned());
    let (file, whole) = (cell.file.to_str().expect("UTF-8"), cell.folder());
    let out = format!("{whole}/out");
    let nowhere = format!("{whole}/nowhere");
    let wants_file: &[&str] = &["it is a folder", "give the path of a TOML file"];
    let simulate = [&["simulate", &folder, "--out", &out][..], &POSES].concat();
    let cases: [(&[&str], &[&str]); 18] = [
        (&["run", &folder], wants_file),
        (&["check", &folder], wants_file),
        (&["plan", &folder], wants_file),
        (&["run", &nowhere], &["No such file", "give the path of a TOML file"]),
        (&["inspect", &folder], &["it is a folder", "no log in it"]),
        (&["inspect", &nowhere], &["No such file"]),
        (&simulate, &["it is a folder", "give the path of a robot file"]),
        (&["compensate", &folder, &targets], &["is a folder; give a file of table compensation"]),
        (&["compensate", &text, &targets], &["it is a text", "name the right file"]),
        (&["compensate", &cut, &targets], &["its end is missing", "get it anew"]),
        (&["compensate", &nowhere, &targets], &["there is no file", "--lake"]),
        (
            &["export", &folder, "--format", "csv"],
            &["is a folder; give a file of a table of a run"],
        ),
        (&["export", &text, "--format", "csv"], &["it is a text", "name the right file"]),
        (&["export", &nowhere, "--format", "csv"], &["No such file", "check its name"]),
        (&["history", file], &["there is no lake", "printed as its tables"]),
        (&["history", &nowhere], &["there is no lake", "printed as its tables"]),
        (&["verify", file], &["folder"]),
        (&["verify", &nowhere], &["no"]),
    ];
    for (args, told) in cases {
        let output = posegrid().args(args).output().expect("runs");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(matches!(output.status.code(), Some(1 | 2)), "{args:?}: {message}");
        assert!(!message.is_empty(), "{args:?}");
        for part in told {
            assert!(message.contains(part), "{args:?}: no {part:?} in: {message}");
        }
        for part in NO_HELP {
            assert!(!message.contains(part), "{args:?}: {part:?} in: {message}");
        }
    }
}

#[test]
fn an_unknown_session_on_the_command_line_is_bad_usage() {
    let cell = Cell::new(&[]);
    let output = posegrid().arg("run").arg(&cell.file).arg("wed").output().expect("runs");
    assert_eq!(output.status.code(), Some(2));
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("mon, tue"), "{message}");
}

#[test]
fn messages_for_a_scheduler_are_json_lines() {
    let output =
        posegrid().args(["run", "absent.toml", "--log-format", "json"]).output().expect("runs");
    let text = String::from_utf8(output.stderr).expect("UTF-8");
    let message: serde_json::Value = serde_json::from_str(text.trim()).expect("one JSON object");
    assert_eq!(message["level"], "ERROR");
    let told = message["fields"]["message"].as_str().expect("a text");
    assert!(told.contains("absent.toml"), "{told}");
}

#[test]
fn a_dry_run_lists_the_work_and_makes_no_lake() {
    let cell = Cell::new(&[]);
    let output = posegrid().args(["run", "--dry-run", "--test", "tue"]).arg(&cell.file).output();
    let output = output.expect("runs");
    assert_eq!(output.status.code(), Some(0));
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        "mon: learns from mon; judged on tue\nwaits        half: it has no tracker.mcap yet\n"
    );
    assert!(!cell.root.path().join("lake").exists());
}

#[test]
fn a_check_shows_the_arm_with_its_parallel_joint() {
    let cell = Cell::new(&[]);
    let output = posegrid().arg("check").arg(&cell.file).output().expect("runs");
    assert_eq!(output.status.code(), Some(0));
    let text = String::from_utf8_lossy(&output.stdout);
    let second = text.lines().find(|line| line.contains("joint_a2")).expect("named");
    assert!(second.contains("Hayati"), "axes 2 and 3 of a KR 210 are parallel: {second}");
    assert_eq!(text.matches("Hayati").count(), 1, "{text}");
}

#[test]
fn a_session_without_a_result_does_not_stop_the_others() {
    let cell = Cell::new(&[]);
    let output =
        posegrid().arg("run").arg(&cell.file).args(["--jobs", "2"]).output().expect("runs");
    assert_eq!(output.status.code(), Some(1), "both logs are empty files");
    let text = String::from_utf8_lossy(&output.stdout);
    for session in ["mon: no result", "tue: no result", "0 of 2 within"] {
        assert!(text.contains(session), "{text}");
    }
}

fn posegrid() -> Command {
    Command::new(env!("CARGO_BIN_EXE_posegrid"))
}

/// A folder with a pipeline file, a robot file and two sessions whose logs are empty files.
struct Cell {
    root: tempfile::TempDir,
    file: PathBuf,
}

const GOOD: &str = r#"[robot]
file = "arm.toml"
name = "cell-3"
up = [0, 0, 1]

[input]
folder = "cell"



[controller]
topic = "/j"
time = "header"
unit = "rad"

[commanded]
topic = "/c"
time = "header"
unit = "m"
base_from_command = { xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }
target_is_tool = true

[tracker]
topic = "/p"
time = "header"
unit = "m"
uncertainty = { range_um = 10, range_um_per_m = 0.3, transverse_um = 15, transverse_um_per_m = 6, divisor = 2 }
tracker_from_base = "fitted"

[grid]
steps_mm = [50, 100]
box = { low_mm = [0, 0, 0], high_mm = [300, 400, 200] }

[tolerance]
mm = 0.5
share = 0.95
confidence = 0.95

[output]
lake = "lake"
"#;

impl Cell {
    /// A good cell with texts of its pipeline file replaced.
    fn new(changes: &[(&str, &str)]) -> Self {
        let root = tempfile::tempdir().expect("a temporary folder");
        let mut text = GOOD.to_owned();
        for (good, other) in changes {
            assert!(text.contains(good), "{good:?} is not in the file");
            text = text.replacen(good, other, 1);
        }
        let write = |path: &str, text: &str| {
            let path = root.path().join(path);
            fs::create_dir_all(path.parent().expect("in a folder")).expect("writable");
            fs::write(path, text).expect("writable");
        };
        write("pipeline.toml", &text);
        let arm = Path::new("pipelines/robots/kr210-r2700-extra.toml");
        write("arm.toml", &fs::read_to_string(arm).expect("part of the project"));
        fs::create_dir_all(root.path().join("cell/none")).expect("writable");
        let file = root.path().join("pipeline.toml");
        let both = ["controller", "tracker"];
        Self { root, file }
            .with_logs("mon", &both)
            .with_logs("tue", &both)
            .with_logs("half", &both[..1])
    }

    /// The same cell with empty logs of a session that were last written an hour ago, so that the session does not wait for them.
    fn with_logs(self, session: &str, logs: &[&str]) -> Self {
        let folder = self.path("cell").join(session);
        fs::create_dir_all(&folder).expect("writable");
        for log in logs {
            let log = fs::File::create(folder.join(format!("{log}.mcap"))).expect("writable");
            let hour_ago = SystemTime::now() - Duration::from_hours(1);
            log.set_modified(hour_ago).expect("writable");
        }
        self
    }

    fn configuration(&self, overrides: &Overrides) -> Result<Configuration, ConfigurationError> {
        Configuration::load(&self.file, overrides)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    fn folder(&self) -> &str {
        self.root.path().to_str().expect("UTF-8")
    }
}
