//! Input that cannot be worked on: each ends with the right exit code, and a message that says what, where and what to try.

use std::fs;

use super::cell::{Cell, Ended, ended, posegrid};

/// A cell with one small session `mon`, of 12 random poses.
fn small() -> Cell {
    Cell::new().with_simulated("mon", &["--random", "12"])
}

/// Runs a cell that gives no result, and asserts that it published nothing.
fn no_result(cell: &Cell, texts: &[&str]) {
    let ended = cell.run(&[]);
    ended.expect(1, texts);
    ended.expect(1, &["1 without a result", "mon: no result"]);
    assert!(cell.lake().is_empty(), "{:?}", cell.lake().keys());
}

fn bad_usage(cell: &Cell, texts: &[&str]) -> Ended {
    let ended = cell.run(&[]);
    ended.expect(2, texts);
    assert!(ended.results.is_empty(), "{}", ended.results);
    assert!(cell.lake().is_empty(), "{:?}", cell.lake().keys());
    ended
}

#[test]
fn a_missing_log_of_a_session_is_reported_and_the_others_have_their_result() {
    let cell = small().with_simulated("tue", &["--random", "7"]);
    fs::remove_file(cell.session("tue").join("controller.mcap")).expect("was there");
    // 12 stations cannot show 95 %: 3, and not 1.
    let texts = ["waits        tue: it has no controller.mcap yet", "0 without a result"];
    cell.run(&[]).expect(3, &texts);
    cell.run(&["tue"]).expect(0, &texts[..1]);
}

#[test]
fn an_empty_log_is_reported() {
    let cell = small().with_log("mon", "controller.mcap", |_| Vec::new());
    no_result(&cell, &["mon/controller.mcap: the file is empty"]);
}

#[test]
fn a_file_that_is_no_log_is_reported() {
    let cell = small().with_log("mon", "tracker.mcap", |_| b"time,x,y,z\n0,1,2,3\n".to_vec());
    no_result(&cell, &["mon/tracker.mcap: not an MCAP log"]);
}

#[test]
fn an_unknown_topic_is_reported_with_those_there_are() {
    let cell = small().with("\"/tracker/point\"", "\"/tracker/pose\"");
    let topics = ["no topic \"/tracker/pose\"", "\"/tracker/point\"", "\"/tracker/temperature\""];
    no_result(&cell, &topics);
}

#[test]
fn a_joint_that_no_message_names_is_reported() {
    let cell = small();
    let path = cell.path("robots/kr210-r2700-extra.toml");
    let robot = fs::read_to_string(&path).expect("readable");
    fs::write(&path, robot.replace("joint_a6", "joint_a7")).expect("writable");
    no_result(&cell, &["joint_a7", "mon/controller.mcap"]);
}

#[test]
fn an_unknown_key_of_the_pipeline_file_is_reported_with_its_line() {
    let cell = small().with("share = 0.95", "share = 0.95\nshares = 1");
    bad_usage(&cell, &["pipeline.toml", "has shares (line "]);
}

#[test]
fn a_missing_unit_is_asked_for_and_not_guessed() {
    let cell = small().with("unit = \"rad\"", "");
    bad_usage(&cell, &["[controller]", "needs unit (\"rad\", \"deg\" or \"gon\")"]);
}

#[test]
fn a_flat_box_of_the_pipeline_file_is_reported_before_a_log_is_opened() {
    let bounds = "box = { low_mm = [1500, 0, 800], high_mm = [1800, 300, 800] }\n";
    let cell = small().with("[tolerance]", &format!("{bounds}\n[tolerance]"));
    // [grid] ends where [tolerance] begins, so the box is in it.
    bad_usage(&cell, &["[grid] box", "300 × 300 × 0 mm"]);
}

#[test]
fn steps_larger_than_the_measured_box_make_one_cell_and_are_judged_once() {
    let flags = ["--random", "12", "--size", "250,250,250"];
    let cell = Cell::new().with_simulated("mon", &flags).with("360]", "360, 4000]");
    cell.run(&[]).expect(3, &["not shown to be within tolerance"]);
    let steps = cell.table("grid_steps", "mon");
    let is = |row: &usize, step_mm: f64| {
        steps.text("source").value(*row) == "model"
            && (steps.f64("step_mm").value(*row) - step_mm).abs() < 1e-9
    };
    let mut told = 0;
    for row in (0..steps.rows()).filter(|row| is(row, 4000.0)) {
        let reason = steps.text("reason").value(row);
        assert!(reason.contains("the same pitches as the step of"), "{reason}");
        assert_eq!(steps.i64("nodes").value(row), 0);
        assert!(steps.f64("pitch_x_mm").value(row) < 251.0);
        told += 1;
    }
    // Two interpolations, by local cells and by the table.
    assert_eq!(told, 4);
    assert_eq!(steps.bool("chosen").true_count(), 1);
    assert!(cell.table("compensation", "mon").rows() >= 8);
}

#[test]
fn a_session_in_a_plane_has_an_identified_arm_and_no_table() {
    let cell = Cell::new().with_simulated("mon", &["--random", "80", "--size", "600,600,0.2"]);
    cell.run(&["--verbose"]).expect(
        0,
        &[
            "within tolerance by the identified arm",
            "not shown to be met by the compensation table: held-out blocks of mon: no step gives a table",
            "the box is flat along z",
        ],
    );
    let steps = cell.table("grid_steps", "mon");
    assert_eq!(steps.bool("chosen").true_count(), 0);
    assert_eq!(cell.table("compensation", "mon").rows(), 0);
    assert!(cell.table("calibrations", "mon").rows() > 0);
}

#[test]
fn too_few_stations_are_reported_with_both_numbers() {
    let cell = Cell::new().with_simulated("mon", &["--random", "5"]);
    no_result(&cell, &["session mon: join: controller log: 5 dwells", "needs 6"]);
}

#[test]
fn few_stations_have_a_result_that_shows_nothing() {
    let ended = small().run(&[]);
    ended.expect(3, &["not shown to be within tolerance", "59 poses are needed"]);
}

#[test]
fn stations_in_one_place_are_reported() {
    // One pose, again and again: nothing tells one dwell from another.
    let flags = ["--random", "30", "--size", "0,0,0", "--cone-deg", "0"];
    let cell = Cell::new().with_simulated("mon", &flags);
    no_result(&cell, &["session mon: join: ", "30 dwells of the arm"]);
}

#[test]
fn stations_on_a_line_are_reported() {
    let flags = ["--random", "30", "--size", "900,0,0", "--cone-deg", "0"];
    let cell = Cell::new().with_simulated("mon", &flags);
    let ended = cell.run(&[]);
    ended.expect(1, &["fit: ", "on a line", "spread the poses"]);
    ended.expect(1, &["1 without a result", "mon: no result"]);
    // The session as joined is sound, and the next run starts from it; of the run there is nothing.
    let lake = cell.lake();
    let tables: Vec<&str> = lake.keys().filter_map(|path| path.split('/').next()).collect();
    assert_eq!(tables, ["joined_sessions", "readings"]);
}

#[test]
fn a_bad_session_does_not_stop_the_others() {
    let cell = small().with_simulated("sun", &["--random", "12"]).with_log(
        "mon",
        "controller.mcap",
        |_| Vec::new(),
    );
    let ended = cell.run(&["--jobs", "2"]);
    ended.expect(1, &["mon: no result", "sun: not shown", "1 without a result"]);
    assert_eq!(cell.table("runs", "sun").rows(), 1);
    assert_eq!(cell.table("stations", "sun").rows(), 12);
    assert!(cell.lake().keys().all(|path| !path.contains("/mon/")));
}

#[test]
fn a_pipeline_file_that_is_not_there_is_reported() {
    let ended = super::cell::ended(posegrid().args(["run", "no/such/pipeline.toml"]));
    ended.expect(2, &["no/such/pipeline.toml"]);
}

/// `check` of the cell's pipeline file.
fn checked(cell: &Cell) -> Ended {
    ended(posegrid().arg("check").arg(cell.pipeline()))
}

#[test]
fn a_name_that_no_lake_takes_is_reported_by_check_and_by_run_alike() {
    // 61 letters of two bytes, three characters a byte: 366 of 180.
    let name = "ü".repeat(61);
    let cell = small().with("name = \"kr210-demo\"", &format!("name = \"{name}\""));
    let texts = ["[robot] name", "takes 366 bytes as a folder's name", "shorter robot name"];
    bad_usage(&cell, &texts);
    checked(&cell).expect(2, &texts);
    let cell = small();
    fs::rename(cell.session("mon"), cell.session(&name)).expect("a folder of this name");
    let texts = ["takes 366 bytes as a folder's name", "shorter session name"];
    checked(&cell).expect(2, &texts);
    cell.run(&[]).expect(2, &texts);
}

#[cfg(target_os = "linux")]
#[test]
fn files_that_are_none_and_files_without_an_end_are_reported_at_once() {
    let cell = small();
    let robot = fs::read_to_string(cell.pipeline()).expect("readable");
    let robot = robot.lines().find_map(|line| line.strip_prefix("file = ")).expect("a robot file");
    let robot = robot.trim_matches('"').to_owned();
    let pipe = cell.path("pipe.toml");
    let made = std::process::Command::new("mkfifo").arg(&pipe).status();
    assert!(made.expect("mkfifo").success());
    for (file, told) in [
        ("/dev/zero", "it is a device, and only files are read"),
        (&*pipe.to_string_lossy(), "it is a pipe (FIFO), and only files are read"),
        (&*cell.path("").to_string_lossy(), "it is a folder"),
    ] {
        ended(posegrid().arg("check").arg(file))
            .expect(2, &["cannot read the pipeline file", told]);
        let other = small().with(&robot, file);
        checked(&other).expect(2, &["cannot read the robot file", told]);
    }
    let large = cell.path("large.toml");
    let sparse = fs::File::create(&large).expect("writable");
    sparse.set_len(6 << 30).expect("no room is taken");
    let told = ["large.toml", "6442450944 bytes, more than the limit of 1048576"];
    ended(posegrid().arg("check").arg(&large)).expect(2, &told);
    // What drove a session is bounded by the pipeline file.
    let drove = cell.session("mon").join("corrected.csv");
    let sparse = fs::File::create(&drove).expect("writable");
    sparse.set_len(6 << 30).expect("no room is taken");
    no_result(
        &cell,
        &["corrected.csv", "more than the limit of 67108864", "file_bytes in [limits]"],
    );
}
