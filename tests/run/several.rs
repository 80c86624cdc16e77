//! Sessions with three reflectors and with instruments of one length in what compares and plans sessions: `posegrid history`, and
//! `posegrid plan` from a past session.

use std::fs;

use super::cell::{Cell, Ended, ended, posegrid};
use super::lengths::{blanked, section};
use super::tabled;

/// Places of two reflectors beside the target, along its axes.
const BESIDE: [&str; 2] = ["120,0,0", "0,120,0"];
const BAR: &str = "2600,1500,300,20,0.05";
const FACE: &str = "0,0,1,-400,0.03";
const TARGETS: &str = "targets = { T1 = { xyz_mm = [25, -40, 100], sd_mm = 0.2 } }";

/// The table of a simulated session of the arm: three reflectors, a bar and a face.
fn simulated(cell: &Cell, seed: usize) -> String {
    let out = cell.path(&format!("simulated-{seed}"));
    let mut command = posegrid();
    command
        .args(["simulate", "pipelines/robots/kr210-r2700-extra.toml"])
        .args(["--arm", "3", "--seed", &seed.to_string()])
        .args(["--home", "0,-75,100,25,55,-15", "--random-joints", "100"])
        .args(["--base-drift-mm", "0", "--table"])
        .args(["--distance-from", BAR, "--height-above", FACE]);
    for place in BESIDE {
        command.args(["--beside", place]);
    }
    let made = ended(command.arg("--out").arg(&out));
    assert_eq!(made.code, 0, "{}", made.messages);
    fs::read_to_string(out.join("stations.csv")).expect("written")
}

/// The table with a constant added to the angle of joint 3, degrees: its zero is off by as much the other way.
fn with_zero_off(table: &str, by_deg: f64) -> String {
    let mut lines = table.lines();
    let header = lines.next().expect("a header");
    let place = header.split(',').position(|name| name == "joint_a3");
    let place = place.expect("a column of joint 3");
    let moved = |line: &str| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        let angle: f64 = cells[place].parse().expect("an angle");
        cells[place] = format!("{:.7}", angle + by_deg);
        cells.join(",")
    };
    let rows: Vec<String> = lines.map(moved).collect();
    format!("{header}\n{}\n", rows.join("\n"))
}

/// The section of such tables without commands, whose angles know nothing of a zero that is off.
fn without_commands(section: &str) -> String {
    let lines = section.lines();
    let kept = lines.filter(|line| !line.starts_with("commanded"));
    kept.fold(String::new(), |text, line| text + line + "\n")
}

/// A session's name, the columns of its table that are blank, and the turn of joint 3's zero, degrees.
type Night = (&'static str, fn(&str) -> bool, f64);

fn nothing(_: &str) -> bool {
    false
}

fn all_but_one_reflector(name: &str) -> bool {
    name.starts_with("T2") || name.starts_with("T3") || name.starts_with('L')
}

fn all_reflectors(name: &str) -> bool {
    ["T1_", "T2_", "T3_"].iter().any(|own| name.starts_with(own))
}

/// A cell with these sessions; the session `judge`, with all readings, only judges.
fn nights(nights: &[Night]) -> Cell {
    let cell = Cell::new();
    let judge: Night = ("judge", nothing, 0.0);
    let all: Vec<&Night> = nights.iter().chain([&judge]).collect();
    let tables: Vec<String> = (0..all.len()).map(|night| simulated(&cell, 50 + night)).collect();
    let pipeline = fs::read_to_string("pipelines/quickstart.toml").expect("readable");
    let commands = pipeline.split("\n\n").find(|own| own.starts_with("[commanded]"));
    let survey = pipeline.lines().find(|own| own.starts_with("tracker_from_base"));
    let cell = tabled::cell_with(cell, &without_commands(&section(&tables[0])))
        .with("folder = \"sessions\"", "folder = \"sessions\"\ntest = [\"judge\"]")
        .with("target = { xyz_mm = [25, -40, 100], sd_mm = 0.2 }", TARGETS)
        .with(survey.expect("a survey"), "");
    let commands = commands
        .expect("a section")
        .replace("topic = \"/commanded_pose\"\ntime = \"header\"\nunit = \"m\"\n", "");
    let cell = cell.with(&commands, "");
    for ((name, is_blank, by_deg), table) in all.into_iter().zip(tables) {
        fs::create_dir_all(cell.session(name)).expect("writable");
        let text = with_zero_off(&blanked(&table, is_blank), *by_deg);
        fs::write(cell.session(name).join("measured.csv"), text).expect("writable");
    }
    cell
}

/// Runs the pipeline: every session has a result.
fn run(cell: &Cell) -> Ended {
    let run = cell.run(&[]);
    let told = format!("{}{}", run.results, run.messages);
    assert!(run.code == 0 || run.code == 3, "{told}");
    run.no_defect();
    run
}

#[test]
fn sessions_of_one_arm_are_compared_whatever_measured_them() {
    let cell = nights(&[
        ("1-three", nothing, 0.0),
        ("2-three", nothing, 0.0),
        ("3-one", all_but_one_reflector, 0.0),
        ("4-lengths", all_reflectors, 0.0),
        ("5-three", nothing, 0.0),
        ("6-off", nothing, 0.03),
    ]);
    run(&cell);
    let out = cell.path("trend");
    let history = ended(posegrid().arg("history").arg(cell.path("lake")).arg("--out").arg(&out));
    history.expect(
        3,
        &[
            "kr210-demo: 6 sessions, 1-three to 6-off",
            "changes: 1 sessions",
            "6-off: offset of joint 3 moved by -5",
            "history.parquet",
        ],
    );
    // What is kept between two calls says the same.
    let again = ended(posegrid().arg("history").arg(cell.path("lake")));
    again.expect(3, &["6-off: offset of joint 3 moved by -5"]);
}

const PLAN: &str = "[plan]
home_deg = [0, -75, 100, 25, 55, -15]
tracker_from_base = { xyz_mm = [4200, -900, -650], euler_deg = [0, 0, 149], euler_order = \"fixed-xyz\" }
poses = [12]
robots = 2
whole_model_robots = 1
test_poses = 60
candidates = 60
verify_poses = 4
drift_check_every = 0

[plan.known]
session = \"1-three\"

[tolerance]";

/// Sessions that were measured, and a plan from the first of them.
fn planning() -> Cell {
    let cell = nights(&[
        ("1-three", nothing, 0.0),
        ("2-three", nothing, 0.0),
        ("4-lengths", all_reflectors, 0.0),
    ])
    .with("[tolerance]", PLAN)
    .with(
        "steps_mm = [180, 240, 360]",
        "steps_mm = [500]\nbox = { low_mm = [1000, -500, 600], high_mm = [2000, 500, 1600] }",
    );
    run(&cell);
    cell
}

fn plan(cell: &Cell, arguments: &[&str]) -> Ended {
    ended(posegrid().arg("plan").arg(cell.pipeline()).args(arguments))
}

#[test]
fn a_plan_starts_from_a_session_of_three_reflectors_and_lengths() {
    let cell = planning();
    let planned = plan(&cell, &[]);
    planned.expect(3, &["12 poses to identify, 4 to verify"]);
    // A session of three reflectors and lengths against its plan, and the poses after a remount.
    let so_far = plan(&cell, &["--measured", "2-three"]);
    let told = format!("{}{}", so_far.results, so_far.messages);
    assert!(told.contains("stations to identify (12 poses are planned)"), "{told}");
    so_far.no_defect();
    let located = plan(&cell, &["--locate", "6"]);
    let told = format!("{}{}", located.results, located.messages);
    assert!([0, 3].contains(&located.code), "{told}");
    located.no_defect();

    // From lengths alone: the arm is known, the base in a tracker's frame is not.
    let cell = cell.with("session = \"1-three\"", "session = \"4-lengths\"");
    plan(&cell, &[]).expect(3, &["12 poses to identify, 4 to verify"]);
    let cell = cell.with("session = \"4-lengths\"", "session = \"4-lengths\"\nbase = \"same\"");
    plan(&cell, &[]).expect(2, &["read one length each", "say base = \"new\""]);
}
