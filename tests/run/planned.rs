//! Plans that start from a past run, and sessions held against their plan while they are measured.

use std::fs;

use arrow::array::AsArray as _;

use super::cell::{Cell, Ended, ended, posegrid, undisturbed};

const BOX: &str =
    "steps_mm = [500]\nbox = { low_mm = [1000, -500, 600], high_mm = [2000, 500, 1600] }";
const PLAN: &str = "[plan]
home_deg = [0, -75, 100, 25, 55, -15]
tracker_from_base = { xyz_mm = [4200, -900, -650], euler_deg = [0, 0, 149], euler_order = \"fixed-xyz\" }
poses = [12]
robots = 2
whole_model_robots = 1
test_poses = 60
candidates = 40
verify_poses = 4
drift_check_every = 0

[plan.known]
# of the past

[tolerance]";

/// A cell with a plan, and the lake of the undisturbed one.
pub fn planning() -> Cell {
    let cell = Cell::new().with("steps_mm = [180, 240, 360]", BOX).with("[tolerance]", PLAN);
    for (name, bytes) in undisturbed().lake() {
        let path = cell.path("lake").join(name);
        fs::create_dir_all(path.parent().expect("in a lake")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    cell
}

fn plan(cell: &Cell, arguments: &[&str]) -> Ended {
    ended(posegrid().arg("plan").arg(cell.pipeline()).args(arguments))
}

#[test]
fn a_past_run_takes_the_place_of_the_prior() {
    let cell =
        planning().with("# of the past", "session = \"mon\"").with("poses = [12]", "poses = [5]");
    plan(&cell, &[]).expect(3, &["greedy variance       5", "plan "]);
    let runs = cell.table("runs", "plan");
    let inputs = runs.list("input_names").value(0);
    let inputs: Vec<_> = inputs.as_string::<i32>().iter().flatten().collect();
    assert_eq!(inputs, ["robot", "calibrations"]);
    let verified = ended(
        posegrid()
            .args(["verify", "--pipeline"])
            .arg(cell.pipeline())
            .arg(cell.path("lake"))
            .arg("plan"),
    );
    verified.expect(0, &["/plan run ", ": the same\n"]);
    // The same run by its file, and another way to mount it: another plan.
    let file = cell.table_file("calibrations", "mon");
    let relative = file.strip_prefix(cell.path("")).expect("in the cell");
    let named = format!("calibrations = {relative:?}\nbase = \"same\"\ntarget = \"same\"");
    let cell = cell.with("session = \"mon\"", &named);
    plan(&cell, &[]).expect(3, &["greedy variance       5", "plan "]);
}

#[test]
fn plans_of_all_robots_are_made_at_once_or_one_by_one() {
    let robots = "[[robots]]\nname = \"kr210-demo\"\n\n[[robots]]\nname = \"second\"\n\n[[robots]]\nname = \"third\"\nplan = { home_deg = [0] }\n\n[output]";
    let cell = planning()
        .with("[plan.known]\n# of the past\n\n", "")
        .with("name = \"kr210-demo\"\n", "")
        .with("[output]", robots);
    // One by one, as an engine hands them out: what is there is not made again.
    for made in ["uniform grid", "the lake has this plan already"] {
        assert!(plan(&cell, &["--robot", "second"]).results.contains(made), "{made}");
    }
    let one_file = cell.path("poses.csv").to_string_lossy().into_owned();
    plan(&cell, &["--out", &one_file]).expect(2, &["put {robot} into its name"]);
    let files = cell.path("{robot}.csv").to_string_lossy().into_owned();
    plan(&cell, &["--out", &files]).expect(
        1,
        &[
            "robot kr210-demo\nuniform grid",
            "robot second\nthe lake has this plan already",
            "robot third\nno plan: ",
            "home_deg",
        ],
    );
    for robot in ["kr210-demo", "second"] {
        let poses = fs::read_to_string(cell.path(&format!("{robot}.csv")));
        assert!(poses.expect("written").lines().count() > 4, "{robot}");
    }
    plan(&cell, &["--measured", "mon"]).expect(2, &["name one of them with --robot"]);
}

#[test]
fn what_cannot_take_the_place_of_the_prior_is_reported() {
    let with = |known: &str| planning().with("# of the past", known);
    let wrong = |cell: &Cell, texts: &[&str]| plan(cell, &[]).expect(2, texts);
    wrong(&planning(), &["[plan.known] names neither", "give either calibrations"]);
    wrong(&with("session = \"mon\"\ncalibrations = \"x\""), &["[plan.known] names both"]);
    wrong(
        &with("session = \"wed\""),
        &["session = \"wed\"", "has no run of it for robot \"kr210-demo\""],
    );
    wrong(&with("calibrations = \"no.parquet\""), &["[plan.known]", "no.parquet"]);
    let cell = with("session = \"mon\"");
    let stations = cell.table_file("stations", "mon");
    let named = format!("calibrations = {stations:?}");
    wrong(&cell.with("session = \"mon\"", &named), &["[plan.known]", "stations"]);
    wrong(
        &with("session = \"mon\"")
            .with("target = { xyz_mm = [25, -40, 100]", "target = { xyz_mm = [25, -40, 160]"),
        &["the target of ", "60.", "say target = \"other\""],
    );
    let cell = with("session = \"mon\"");
    let calibrations = cell.table_file("calibrations", "mon");
    let robot = cell.path("robots/kr210-r2700-extra.toml");
    let text = fs::read_to_string(&robot).expect("readable");
    let named = format!("calibrations = {calibrations:?}");
    let cell = cell.with("session = \"mon\"", &named);
    let cell = cell.with("name = \"kr210-demo\"", "name = \"kr210-other\"");
    wrong(&cell, &["is of robot \"kr210-demo\"", "the plan is for \"kr210-other\""]);
    let cell = cell.with("name = \"kr210-other\"", "name = \"kr210-demo\"");
    fs::write(&robot, text.replacen("1150", "1100", 1)).expect("writable");
    wrong(&cell, &["the nominal arm of ", "lengths or angles differ"]);
    let (five, _) = text.rsplit_once("[[joint]]").expect("joints");
    let five = five.replace(
        "home_deg = [0.0, -90.0, 90.0, 0.0, 0.0, 0.0]",
        "home_deg = [0.0, -90.0, 90.0, 0.0, 0.0]",
    );
    fs::write(&robot, five).expect("writable");
    let cell =
        cell.with("home_deg = [0, -75, 100, 25, 55, -15]", "home_deg = [0, -75, 100, 25, 55]");
    wrong(&cell, &["has 6 joints", "has 5"]);
}

#[test]
fn a_session_is_held_against_its_plan_while_it_is_measured() {
    let cell = planning().with("[plan.known]\n# of the past\n", "");
    plan(&cell, &["--measured", "wed"]).expect(1, &["has no plan", "make it first"]);
    let csv = cell.path("poses.csv");
    let made = ended(posegrid().arg("plan").arg(cell.pipeline()).arg("--out").arg(&csv));
    made.expect(3, &["12 poses to identify, 4 to verify"]);
    let all = fs::read_to_string(&csv).expect("poses");
    let lines: Vec<&str> = all.lines().collect();
    assert_eq!(lines.len(), 17);
    let part = cell.path("part.csv");
    fs::write(&part, lines[..9].join("\n")).expect("writable");
    let poses = |path: &std::path::Path| path.to_str().expect("UTF-8").to_owned();
    let identify = |lines: &[&str]| lines.iter().filter(|line| line.contains("identify")).count();
    let of = identify(&lines[..9]);
    let cell = cell
        .with_simulated("wed", &["--poses", &poses(&part), "--lost-share", "0"])
        .with_simulated("thu", &["--poses", &poses(&csv), "--lost-share", "0"]);
    plan(&cell, &["--measured", "fri"]).expect(2, &["session \"fri\"", "wed"]);
    let so_far = plan(&cell, &["--measured", "wed"]);
    let verify = 8 - of;
    so_far.expect(
        3,
        &[
            &format!("{of} stations to identify (12 poses are planned), {verify} to verify"),
            "not enough for 0.5 mm",
        ],
    );
    // What is left of the plan is named, nothing that was measured is.
    let named: Vec<&str> =
        so_far.results.rsplit_once(": ").expect("poses").1.split_whitespace().collect();
    let measured = |name: &&&str| name[1..].parse::<usize>().expect("a place") < 8;
    assert!(!named.is_empty() && named.iter().filter(measured).count() == 0, "{named:?}");
    let whole = plan(&cell, &["--measured", "thu"]);
    assert!(whole.results.contains("12 stations to identify (12 poses are planned), 4 to verify"));
    whole.no_defect();
}
