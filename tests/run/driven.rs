//! The closed loop by the commands an operator has: a session, its table, corrected commands, the session they drove.

use std::fmt::Write as _;
use std::fs;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;
use posegrid::files::table::Table;

use super::cell::{Cell, ended, posegrid};

const HOME: &str = "0,-75,100,25,55,-15";

/// A cell whose arm was measured on monday and driven by monday's table on tuesday.
pub fn driven() -> Cell {
    let poses = ["--random", "150", "--cone-deg", "10"];
    let cell = Cell::new().with_simulated("mon", &poses);
    assert_ne!(cell.run(&["mon"]).code, 1, "monday has a result");
    let stations = cell.table("stations", "mon");
    fs::write(cell.path("targets.csv"), targets(&stations)).expect("writable");
    let tuesday = cell.session("tue");
    fs::create_dir_all(&tuesday).expect("writable");
    let corrected = tuesday.join("corrected.json");
    let table = cell.table_file("calibrations", "mon");
    let done = ended(
        posegrid()
            .arg("compensate")
            .args([&table, &cell.path("targets.csv")])
            // How good the table is takes no part in this.
            .args(["--allow", "not-met", "--allow", "not-shown"])
            .arg("--out")
            .arg(&corrected),
    );
    assert!(corrected.exists(), "{}", done.messages);
    let flags = ["--arm", "3", "--seed", "4", "--session", "tue", "--home", HOME];
    let made = ended(
        posegrid()
            .args(["simulate", "pipelines/robots/kr210-r2700-extra.toml"])
            .args(flags)
            .arg("--poses")
            .arg(&corrected)
            .arg("--out")
            .arg(&tuesday),
    );
    assert_eq!(made.code, 0, "{}", made.messages);
    cell
}

/// A file of targets: the joint angles that each station was commanded to.
fn targets(stations: &Table) -> String {
    let mut text = "target,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad\n".to_owned();
    let angles = stations.list("commanded_joints_rad");
    for row in (0..stations.rows()).filter(|&row| angles.is_valid(row)) {
        let angles = angles.value(row);
        let angles = angles.as_primitive::<Float64Type>().values();
        let angles: Vec<String> = angles.iter().map(|q| format!("{q:.10}")).collect();
        writeln!(text, "hole {row},{}", angles.join(",")).expect("a string");
    }
    text
}

#[test]
fn a_session_driven_by_a_table_is_judged_as_what_it_is() {
    let cell = driven();
    let run = cell.run(&["tue", "--verbose"]);
    let mon = cell.table("runs", "mon").text("run").value(0).to_owned();
    assert_ne!(run.code, 1, "{}", run.messages);
    for text in [
        &*format!("driven by table {mon} of session mon: "),
        "MEASURED AFTER",
        "before → after, measured: mean ",
        "corrections were applied as meant",
        "the table HOLDS",
        "not contradicted",
    ] {
        assert!(run.results.contains(text), "{text:?} is not in:\n{}", run.results);
    }
    let accuracy = cell.table("accuracy", "tue");
    let (evidence, name, value) =
        (accuracy.text("evidence"), accuracy.text("name"), accuracy.f64("value"));
    let mean = |wanted: &str, model: &str| {
        let row = (0..accuracy.rows()).find(|&row| {
            (evidence.value(row), name.value(row), accuracy.text("model").value(row))
                == (wanted, "mean", model)
                && accuracy.text("split").value(row) == "session"
        });
        value.value(row.unwrap_or_else(|| panic!("no mean of {model}, {wanted}")))
    };
    let (before, after) = (mean("measured", "raw_command"), mean("measured_after", "table"));
    assert!(after < 0.15 && after < before / 2.0, "{before} → {after}");
    let stations = cell.table("stations", "tue");
    assert_eq!(stations.text("table_id").value(0), mon);
    assert!(stations.text("target").value(0).starts_with("hole "));
    let page = fs::read_to_string(page(&cell)).expect("a page");
    assert!(
        page.contains("This session was driven by a table: the table HOLDS"),
        "the page opens with whether the table holds"
    );
    // Held against the same promise again, in a lake of its own.
    let verified = ended(
        posegrid()
            .arg("verify")
            .arg(cell.path("lake"))
            .arg("tue")
            .arg("--pipeline")
            .arg(cell.pipeline()),
    );
    assert_eq!(verified.code, 0, "{}{}", verified.results, verified.messages);
}

fn page(cell: &Cell) -> std::path::PathBuf {
    let folder = cell.path("lake/report/kr210-demo/tue");
    let mut pages =
        fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").path());
    pages.next().expect("a page")
}

#[test]
fn a_file_that_says_nothing_of_a_table_is_reported() {
    let cell = Cell::new().with_quickstart("mon");
    fs::write(cell.session("mon").join("corrected.csv"), "target,x_mm\nA,1\n").expect("writable");
    cell.run(&[])
        .expect(1, &["session mon: corrected targets: ", "corrected.csv: it cannot be read"]);
}
