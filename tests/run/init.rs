//! `posegrid init`: from files of a session to a pipeline file that `check` accepts; and the summary for programs.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::cell::{Cell, ended, posegrid};

#[test]
fn logs_give_a_pipeline_file_that_checks_with_the_ready_robot_of_their_metadata() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("cell.toml");
    let init = || {
        let logs = Path::new("tests/recordings/quickstart");
        ended(posegrid().arg("init").arg(logs).arg("--out").arg(&out))
    };
    let made = init();
    made.expect(
        0,
        &["kr210-r2700-extra.toml is the ready robot", "# to state: ", "posegrid check"],
    );
    let written = fs::read_to_string(&out).expect("written");
    ended(posegrid().arg("check").arg(&out)).expect(0, &["quickstart: learns from quickstart"]);
    init().expect(2, &["is there already, and is not replaced"]);
    assert_eq!(fs::read_to_string(&out).expect("there"), written);

    let of_robot = folder.path().join("kr210-r2700-extra.toml");
    fs::remove_file(&of_robot).expect("the ready robot");
    let logs = Path::new("tests/recordings/quickstart");
    ended(posegrid().arg("init").arg(logs).arg("--out").arg(&of_robot))
        .expect(2, &["is to be the file of the ready robot"]);
    assert!(!of_robot.exists());
}

#[test]
fn a_folder_of_sessions_beside_the_pipeline_file_moves_with_it() {
    let cell = Cell::new().with_quickstart("mon");
    let session = cell.session("mon");
    let sessions = session.parent().expect("a folder of sessions");
    let beside = sessions.parent().expect("a folder of the cell");
    let name = sessions.file_name().expect("a name");
    let init = ["--out", "new.toml"];
    ended(posegrid().current_dir(beside).arg("init").arg(name).args(init)).expect(0, &["written"]);
    let written = fs::read_to_string(beside.join("new.toml")).expect("written");
    assert!(written.contains(&format!("folder = \"{}\"", name.to_string_lossy())), "{written}");
}

#[test]
fn a_table_gives_a_pipeline_file_and_tables_of_two_kinds_none() {
    let flags = ["--grid-step", "360", "--size", "720,720,360", "--table"];
    let cell = Cell::new().with_simulated("mon", &flags);
    let at = |name: &str| cell.session("mon").join(name);
    fs::write(at("b.csv"), "q1,q2,q3,q4,q5,q6,x,y,z\n1,2,3,4,5,6,7,8,9\n").expect("writable");
    let init = |files: &[&str], out: &str| {
        let files = files.iter().map(|name| at(name));
        ended(posegrid().arg("init").args(files).arg("--out").arg(at(out)))
    };
    init(&["stations.csv"], "one.toml").expect(0, &["is written"]);
    // With the ready robot that is named, the file lacks nothing.
    let named = posegrid()
        .arg("init")
        .arg(at("stations.csv"))
        .args(["--robot", "kr210-r2700-extra", "--out"])
        .arg(at("named.toml"))
        .output();
    assert!(named.is_ok_and(|named| named.status.success()));
    ended(posegrid().arg("check").arg(at("named.toml"))).expect(0, &["learns from stations"]);
    init(&["stations.csv", "b.csv"], "two.toml").expect(2, &["b.csv"]);
    assert!(!at("two.toml").exists());
    init(&["c.csv"], "three.toml").expect(2, &["c.csv"]);
}

#[test]
fn the_summary_for_programs_has_every_session_and_the_figures_of_its_run() {
    let cell = Cell::new().with_quickstart("mon").with_quickstart("tue");
    fs::write(cell.session("tue").join("tracker.mcap"), "no log").expect("writable");
    let document = |flags: &[&str]| -> Value {
        let ended = cell.run(flags);
        assert_eq!(ended.code, 1, "{}", ended.messages);
        serde_json::from_str(&ended.results).expect("one document")
    };
    let first = document(&["--format", "json"]);
    let [mon, tue] = [0, 1].map(|place| &first["sessions"][place]);
    assert_eq!((&mon["session"], &mon["state"]), (&"mon".into(), &"done".into()));
    assert_eq!((&tue["session"], &tue["state"]), (&"tue".into(), &"failed".into()));
    assert!(tue["reason"].as_str().is_some_and(|words| words.contains("tracker.mcap")), "{tue}");
    assert_eq!((&first["exit_code"], &first["totals"]["failed"]), (&1.into(), &1.into()));
    let runs = cell.table("runs", "mon");
    for figure in ["bound_mm", "mean_before_mm", "mean_after_mm"] {
        assert_eq!(mon[figure].as_f64(), Some(runs.f64(figure).value(0)), "{figure}");
    }
    // What the lake had already is told with the same figures.
    let mut again = document(&["--format", "json"])["sessions"][0].clone();
    assert_eq!(again["state"], "done-before");
    for own in ["state", "table", "warnings"] {
        again[own] = mon[own].clone();
    }
    assert_eq!(&again, mon);
}
