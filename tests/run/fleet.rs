//! One pipeline file of several robots: each has what a file of its own gives it, and what is wrong with one stays with it.

use std::collections::BTreeMap;
use std::fs;

use super::cell::{Cell, Ended, ended, posegrid, undisturbed};
use super::same_work::assert_same;

/// The name of the robot in the quickstart's pipeline file, and the folder of its sessions.
const FIRST: &str = "kr210-demo";

/// A cell of two robots, the second with a tolerance of its own, in folders of their own.
fn two_robots() -> Cell {
    let robots = format!(
        "[[robots]]\nname = \"{FIRST}\"\n\n[[robots]]\nname = \"second\"\nfolder = \"line/2\"\ntolerance = {{ mm = 0.4 }}\n\
         robot = {{ valid_for = {{ tool = \"other holder\" }} }}\n\n[output]"
    );
    Cell::new().with("name = \"kr210-demo\"\n", "").with("[output]", &robots)
}

/// The files of one robot in a cell's lake.
fn of(cell: &Cell, robot: &str) -> BTreeMap<String, Vec<u8>> {
    let lake = cell.lake().into_iter();
    lake.filter(|(path, _)| path.split('/').nth(1) == Some(robot)).collect()
}

fn check(cell: &Cell, arguments: &[&str]) -> Ended {
    ended(posegrid().arg("check").arg(cell.pipeline()).args(arguments))
}

#[test]
fn each_robot_has_the_bytes_of_a_pipeline_file_of_its_own() {
    let cell = two_robots()
        .with_quickstart("kr210-demo/mon")
        .with_quickstart("kr210-demo/tue")
        .with_quickstart("line/2/mon")
        .with_quickstart("stranger/mon");
    check(&cell, &[]).expect(
        0,
        &[
            "kr210-demo: KUKA KR 210 R2700 extra, 0.5 mm for 95 % of positions, 2 sessions",
            "second: KUKA KR 210 R2700 extra, 0.4 mm",
            "second/mon: learns from mon",
            "waits        stranger: no robot of the pipeline file has this folder",
        ],
    );
    check(&cell, &["--robot", "second"]).expect(0, &["tolerance    0.4 mm", "robot        second"]);
    cell.run(&["--jobs", "2"]).expect(
        0,
        &[
            "done         kr210-demo/mon: within tolerance",
            "done         kr210-demo/tue: within tolerance",
            "done         second/mon: within tolerance",
            "waits        stranger: ",
            "3 of 3 within their robot's tolerance, 0 without a result: 3 done, 0 done before, 0 not met, 0 failed, 1 waiting",
        ],
    );
    assert_same(&of(&cell, FIRST), &of(undisturbed(), FIRST));
    let alone = Cell::new()
        .with("name = \"kr210-demo\"", "name = \"second\"")
        .with("tool = \"reflector holder\"", "tool = \"other holder\"")
        .with("mm = 0.5", "mm = 0.4")
        .with_quickstart("mon");
    alone.run(&[]).expect(0, &["1 of 1 within 0.4 mm"]);
    assert_same(&of(&cell, "second"), &of(&alone, "second"));
    cell.run(&["--robot", "second"]).expect(0, &["1 of 1 within 0.4 mm", "1 done before"]);
    cell.run(&["--from", "table"]).expect(0, &["done-before  second/mon", "3 done before"]);
    let lake = cell.path("lake");
    let verified =
        posegrid().arg("verify").arg(&lake).arg("--pipeline").arg(cell.pipeline()).output();
    Ended::from(verified.expect("started")).expect(0, &["3 runs: 3 the same"]);
}

#[test]
fn what_is_wrong_with_one_robot_stays_with_it() {
    let cell = two_robots()
        .with("tolerance = { mm = 0.4 }", "tolerance = { mm = -1 }")
        .with_quickstart("kr210-demo/mon")
        .with_quickstart("line/2/mon");
    cell.run(&[]).expect(
        1,
        &[
            "done         kr210-demo/mon: within tolerance",
            "failed       second: no result: robot \"second\" ([[robots]] 2): ",
            "[tolerance] mm = -1, but it has to be 1e-6 to 1000000",
            "1 failed",
        ],
    );
    cell.run(&["--robot", "second"]).expect(2, &["robot \"second\" ([[robots]] 2)"]);
    cell.run(&["--robot", "third"])
        .expect(2, &["has no robot \"third\"; its robots: kr210-demo, second"]);
    let without = two_robots().with_quickstart("kr210-demo/mon");
    without.run(&[]).expect(0, &["waits        second: there is no folder ", "1 waiting"]);
    Cell::new().with_quickstart("mon").run(&["--robot", "a"]).expect(2, &["it is of one robot"]);
    let plan = posegrid().arg("plan").arg(cell.pipeline()).output();
    Ended::from(plan.expect("started"))
        .expect(2, &["robot kr210-demo\nno plan: ", "robot second\nno plan: ", "[plan]"]);
}

/// A cell whose robots stand in a table beside its pipeline file.
fn tabled(by: &str) -> Cell {
    let input = format!(
        "# sessions\nrobots = \"robots.csv\"\nrobots_by = \"{by}\"\nsessions_by = \"file_name\"\n\
         controller = \"{{robot}}_{{session}}_controller.mcap\"\ntracker = \"{{robot}}_{{session}}_tracker.mcap\""
    );
    let cell = Cell::new()
        .with("name = \"kr210-demo\"\n", "")
        .with("file = \"robots/kr210-r2700-extra.toml\"\n", "")
        .with("# sessions", &input);
    let table = "name;robot.file;tolerance.mm\nkr210-demo;robots/kr210-r2700-extra.toml;\nkr 2;robots/kr210-r2700-extra.toml;0.4\n";
    fs::write(cell.path("robots.csv"), table).expect("writable");
    fs::create_dir(cell.path("sessions")).expect("writable");
    for name in ["kr210-demo_mon", "kr210-demo_tue", "kr 2_mon", "kr3_mon"] {
        for side in ["controller", "tracker"] {
            let from = format!("tests/recordings/quickstart/{side}.mcap");
            let to = cell.path(&format!("sessions/{name}_{side}.mcap"));
            fs::copy(from, to).expect("copied");
        }
    }
    cell
}

#[test]
fn robots_of_a_table_are_found_by_file_names() {
    let cell = tabled("file_name");
    cell.run(&[]).expect(
        0,
        &[
            "done         kr210-demo/tue: within tolerance",
            "done         kr 2/mon: within tolerance",
            "waits        kr3: no robot of the pipeline file is called so, as kr3_mon_controller.mcap and another file state",
            "3 done, 0 done before",
        ],
    );
    assert_same(&of(&cell, FIRST), &of(undisturbed(), FIRST));
    fs::write(cell.path("robots.csv"), "name,robot.fill\na,b\n").expect("writable");
    cell.run(&[]).expect(2, &["robot \"a\" (row 2 of robots.csv)", "fill"]);
    fs::write(cell.path("robots.csv"), "names\na\n").expect("writable");
    cell.run(&[]).expect(2, &["robots.csv", "it has no column `name`"]);
}

#[test]
fn robots_are_found_by_what_logs_state() {
    let cell = Cell::new()
        .with("name = \"kr210-demo\"\n", "")
        .with("# sessions", "robots_by = \"metadata\"")
        .with(
            "[output]",
            "[[robots]]\nname = \"kr210-demo\"\n\n[[robots]]\nname = \"second\"\n\n[output]",
        )
        .with_quickstart("mon")
        .with_quickstart("tue")
        .with_simulated("other", &["--robot-name", "somebody", "--grid-step", "480"]);
    cell.run(&[]).expect(
        0,
        &[
            "done         kr210-demo/mon: within tolerance",
            "waits        second: no session to learn from",
            "waits        other: its logs are of \"somebody\", and no robot of the pipeline file is called so",
            "2 of 2 within 0.5 mm",
        ],
    );
    assert_same(&of(&cell, FIRST), &of(undisturbed(), FIRST));
}
