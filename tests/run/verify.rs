//! Past runs recomputed: what is the same, and what is told when a file, an input, a setting or a value is not.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;

use arrow::array::{ArrayRef, AsArray, Float64Array};
use arrow::datatypes::Float64Type;
use posegrid::manifest::{Work, digest};
use posegrid::pipeline::verify::Claim;

use super::cell::{Cell, Ended, ended, posegrid, undisturbed};
use super::forged::{Anew, claim_digest, digest_of, rewrite, same_text, seal, seal_row, texts};

/// One step, and the box that a plan needs, as it has no stations to take one from.
const BOX: &str =
    "steps_mm = [500]\nbox = { low_mm = [1000, -500, 600], high_mm = [2000, 500, 1600] }";
/// The smallest plan there is, of no use but to be made twice.
const PLAN: &str = "[plan]
seed = 4
home_deg = [0, -75, 100, 25, 55, -15]
tracker_from_base = { xyz_mm = [4200, -900, -650], euler_deg = [0, 0, 149], euler_order = \"fixed-xyz\" }
poses = [10]
robots = 2
whole_model_robots = 1
test_poses = 10
candidates = 30
verify_poses = 2

[tolerance]";

/// A cell with the sessions, and the lake, of the undisturbed one.
pub fn copied() -> Cell {
    let cell = Cell::new().with_quickstart("mon").with_quickstart("tue");
    for (name, bytes) in undisturbed().lake() {
        let path = cell.path("lake").join(name);
        fs::create_dir_all(path.parent().expect("in a lake")).expect("writable");
        fs::write(path, bytes).expect("writable");
    }
    cell
}

/// `posegrid verify` of the cell's lake by its pipeline file; temporary folders stand, and have to go, in the cell.
pub fn verify(cell: &Cell, arguments: &[&str]) -> Ended {
    let pipeline = cell.pipeline();
    let pipeline = pipeline.to_str().expect("a path in words");
    by_digests(cell, &[&["--pipeline", pipeline], arguments].concat())
}

/// `posegrid verify` of the cell's lake by digests alone: without the pipeline file no run is computed anew, which takes seconds for each.
pub fn by_digests(cell: &Cell, arguments: &[&str]) -> Ended {
    let temporary = cell.path("temporary");
    fs::create_dir_all(&temporary).expect("writable");
    let before = cell.lake();
    let mut command = posegrid();
    command.env("TMPDIR", &temporary).arg("verify").arg(cell.path("lake"));
    let ended = ended(command.args(arguments));
    assert!(cell.lake() == before, "the lake is only read");
    let left = fs::read_dir(&temporary).expect("there").count();
    assert_eq!(left, 0, "temporary folders are removed");
    ended
}

/// The row of the number that is farthest from zero.
fn largest(numbers: &Float64Array) -> usize {
    let size = |row: &usize| numbers.value(*row).abs();
    let rows = 0..numbers.len();
    rows.max_by(|a, b| size(a).total_cmp(&size(b))).expect("rows")
}

/// A column of numbers with the largest of them a thousandth larger.
fn a_thousandth_more(array: &ArrayRef) -> ArrayRef {
    let numbers = array.as_primitive::<Float64Type>();
    let changed = largest(numbers);
    let more = |row| if row == changed { 1.001 } else { 1.0 };
    let all = numbers.iter().enumerate();
    let changed = all.map(|(row, x)| x.map(|x| x * more(row)));
    Arc::new(changed.collect::<Float64Array>())
}

/// Makes a session's run one of another version, which did not know `[similarity]` yet: named as that version named it.
fn of_version(cell: &Cell, session: &str, version: &str) {
    let claim = Claim::of(&cell.table("runs", session)).expect("a row");
    let own = &claim.run.made.settings;
    let mut settings: serde_json::Value = serde_json::from_str(own).expect("JSON");
    let section = settings.as_object_mut().expect("sections").remove("similarity");
    assert!(section.is_some(), "{own}");
    let work = Work { settings: settings.to_string(), ..claim.work() };
    let run = work.key_by_version(version).run;
    let mut digests = BTreeMap::new();
    for file in &claim.files {
        let path = cell.table_file(&file.table, session);
        if file.table != "report" {
            Anew::of(&path)
                .entry("posegrid.run", &run)
                .write(|column, array| (column == "run").then(|| same_text(&run, array.len())));
            seal(&path, &file.table);
        }
        digests.insert(file.digest.clone(), digest_of(&path));
        let ending = path.extension().expect("it has one").to_string_lossy();
        fs::rename(&path, path.with_file_name(format!("{run}.{ending}"))).expect("writable");
    }
    let row = cell.table_file("runs", session);
    let by = format!("posegrid version {version}");
    let anew = Anew::of(&row).entry("posegrid.run", &run).created_by(&by);
    anew.write(|column, array| match column {
        "run" => Some(same_text(&run, 1)),
        "version" => Some(same_text(version, 1)),
        "settings" => Some(same_text(&work.settings, 1)),
        "settings_digest" => {
            let (digest, _) = digest(work.settings.as_bytes()).expect("in memory");
            Some(same_text(&digest, 1))
        }
        "table_digests" => Some(texts(array, |before| digests[before].clone())),
        _ => None,
    });
    seal_row(&row);
    fs::rename(&row, row.with_file_name(format!("{run}.parquet"))).expect("writable");
}

#[test]
fn the_same_work_is_the_same_byte_for_byte() {
    let ended = verify(undisturbed(), &[]);
    ended.expect(
        0,
        &[
            "kr210-demo/mon run ",
            ": the same\n",
            // Eleven tables and the page; the row of runs is compared by value.
            "13 files recomputed, byte for byte the same",
            "2 runs: 2 the same",
        ],
    );
    // A sample is drawn, and what is not drawn is told.
    let sample = verify(undisturbed(), &["--sample", "1", "--seed", "3"]);
    sample.expect(0, &["1 run: 1 the same; 1 not drawn"]);
}

#[test]
fn a_flipped_byte_of_a_published_table_is_reported_by_table_with_both_digests() {
    let cell = copied();
    let path = cell.table_file("residuals", "mon");
    let sound = digest_of(&path);
    let mut bytes = fs::read(&path).expect("there");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, bytes).expect("writable");
    let altered = digest_of(&path);
    let ended = verify(&cell, &["mon"]);
    let told = format!(
        "output residuals/mon: digest {altered}, the row states {sound}; recomputed, it is as the row states"
    );
    ended.expect(3, &["outputs altered", &told, "12 files recomputed"]);
}

#[test]
fn a_table_that_is_gone_is_reported() {
    let cell = copied();
    fs::remove_file(cell.table_file("compensation", "mon")).expect("there");
    let ended = verify(&cell, &[]);
    ended.expect(
        3,
        &[
            "output compensation/mon: missing, and cited by its run's row and page, the row states ",
            "recomputed, it is as the row states",
            "2 runs: 1 outputs missing, 1 the same",
        ],
    );
}

#[test]
fn a_changed_input_is_reported_by_name_and_a_missing_one_too() {
    let cell = copied();
    let sound = digest_of(&cell.session("mon").join("tracker.mcap"));
    let cell = cell.with_log("mon", "tracker.mcap", |mut bytes| {
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        bytes
    });
    let altered = digest_of(&cell.session("mon").join("tracker.mcap"));
    let ended = verify(&cell, &["mon"]);
    let inputs = ended.results.matches("\n  input ").count();
    assert_eq!(inputs, 1, "no other input: {}", ended.results);
    ended.expect(3, &["inputs altered", "input mon/tracker: ", &sound, &altered]);
    fs::remove_file(cell.session("mon").join("tracker.mcap")).expect("there");
    let ended = verify(&cell, &["mon"]);
    ended.expect(1, &["not recomputed, inputs missing", "it has no tracker.mcap", &sound]);
}

#[test]
fn a_changed_setting_is_reported_by_key_with_both_values() {
    let cell = copied().with("mm = 0.5", "mm = 0.4");
    let ended = verify(&cell, &["mon"]);
    ended.expect(3, &["settings differ", "setting tolerance.mm: 0.4, the row states 0.5"]);
    let settings = ended.results.matches("\n  setting ").count();
    assert_eq!(settings, 1, "no other setting: {}", ended.results);
}

#[test]
fn a_changed_value_is_reported_by_column_even_when_its_digest_was_changed_with_it() {
    let cell = copied();
    let path = cell.table_file("parameters", "mon");
    let before = digest_of(&path);
    let table = cell.table("parameters", "mon");
    let offsets = table.f64("offset");
    let offset = offsets.value(largest(offsets));
    // A thousandth more in one row.
    rewrite(&path, |column, array| (column == "offset").then(|| a_thousandth_more(array)));
    seal(&path, "parameters");
    claim_digest(&cell, "parameters", "mon", &before);
    let ended = verify(&cell, &["mon"]);
    // 0.001 of the larger number, which is the published one: 0.001 / 1.001.
    let published = offset * 1.001;
    ended.expect(
        3,
        &[
            ": differs\n",
            "parameters/mon: column offset: 1 of ",
            &format!("by at most {:.3e}", (published - offset).abs()),
            "(relative 9.990e-4",
            &format!("{published:?} published, {offset:?} computed"),
        ],
    );
    let columns = ended.results.matches(": column ").count();
    assert_eq!(columns, 1, "no other column: {}", ended.results);
}

#[test]
fn a_file_written_anew_with_the_same_values_is_reported_as_such() {
    let cell = copied();
    let path = cell.table_file("parameters", "mon");
    let before = digest_of(&path);
    rewrite(&path, |_, _| None);
    assert_ne!(digest_of(&path), before, "another writer, other bytes");
    claim_digest(&cell, "parameters", "mon", &before);
    let ended = verify(&cell, &["mon"]);
    ended.expect(
        0,
        &[
            ": the same values in other bytes, largest relative difference 0.0e0",
            "parameters/mon: the same values in other bytes",
            "12 files recomputed, byte for byte the same",
        ],
    );
}

#[test]
fn a_row_that_says_something_else_than_was_computed_is_reported() {
    let cell = copied();
    // With every digest changed along: only what follows from the work tells.
    rewrite(&cell.table_file("runs", "mon"), |column, _| {
        (column == "verdict").then(|| same_text("not_met", 1))
    });
    seal_row(&cell.table_file("runs", "mon"));
    rewrite(&cell.table_file("runs", "tue"), |column, _| {
        (column == "settings").then(|| same_text("{}", 1))
    });
    seal_row(&cell.table_file("runs", "tue"));
    let ended = verify(&cell, &[]);
    ended.expect(
        3,
        &[
            "runs/mon: column verdict: 1 of 1 cells differ, first \"not_met\" published, \"met\" computed",
            "from its inputs, settings and version follows",
            "its settings have the digest",
            "2 runs: 1 differs, 1 row of runs altered",
        ],
    );
}

#[test]
fn what_cannot_be_verified_is_reported() {
    let cell = copied();
    verify(&cell, &["wed"]).expect(2, &["\"wed\" is neither a run nor a session", "mon, tue"]);
    let lake = cell.path("lake");
    let by = |pipeline: &Path, arguments: &[&str]| {
        let mut command = posegrid();
        command.arg("verify").arg(&lake).arg("--pipeline").arg(pipeline);
        ended(command.args(arguments))
    };
    by(&cell.path("no.toml"), &[]).expect(2, &["no.toml"]);
    let other = cell.path("other.toml");
    fs::copy(cell.pipeline(), &other).expect("copied");
    by(&other, &[]).expect(2, &["has no run by other", "its runs are by pipeline"]);
    by(&other, &["mon"]).expect(1, &["it was made by the pipeline file \"pipeline\""]);
    let bare = |lake: &Path| ended(posegrid().arg("verify").arg(lake));
    bare(&lake).expect(0, &["2 runs: 2 not recomputed; only the digests of these 2 were compared"]);
    bare(&cell.path("nowhere")).expect(2, &["there is no lake in", "no such folder"]);
    bare(&cell.path("sessions")).expect(2, &["it has no row in runs"]);
}

#[test]
fn a_version_that_computes_differently_is_reported_with_the_largest_difference() {
    let cell = copied();
    // That version's page said something else, as it named the version.
    for session in ["mon", "tue"] {
        fs::write(cell.table_file("report", session), "<!doctype html>").expect("writable");
    }
    of_version(&cell, "mon", "0.0.9");
    let parameters = cell.table_file("parameters", "tue");
    rewrite(&parameters, |column, array| (column == "offset").then(|| a_thousandth_more(array)));
    seal(&parameters, "parameters");
    of_version(&cell, "tue", "0.0.9");
    let ended = verify(&cell, &[]);
    ended.expect(
        3,
        &[
            "computed by version 0.0.9, this is ",
            "setting similarity.bins: 15, the row states nothing",
            "the same values in other bytes, largest relative difference 0.0e0",
            "parameters/tue: column offset: 1 of ",
            "relative 9.990e-4",
            "report/tue: pages are not compared across versions",
            "2 runs: 1 the same values in other bytes, 1 differs",
        ],
    );
    let columns = ended.results.matches(": column ").count();
    assert_eq!(columns, 1, "no other column: {}", ended.results);
}

#[test]
fn a_plan_is_verified_like_a_session() {
    let cell = Cell::new().with("steps_mm = [180, 240, 360]", BOX).with("[tolerance]", PLAN);
    let planned = ended(posegrid().arg("plan").arg(cell.pipeline()));
    planned.expect(3, &["plan ", "tables: "]);
    let same = verify(&cell, &["plan"]);
    same.expect(0, &["/plan run ", ": the same\n", " files recomputed, byte for byte the same"]);
    let cell = cell.with("seed = 4", "seed = 5");
    let other = verify(&cell, &[]);
    other.expect(3, &["settings differ", "setting plan.seed: 5, the row states 4"]);
}

#[test]
fn what_an_interrupted_verify_leaves_is_removed_by_the_next() {
    let temporary = undisturbed().path("temporary of an interrupted one");
    fs::create_dir(&temporary).expect("writable");
    let command = || {
        let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
        command.env("TMPDIR", &temporary).arg("verify").arg(undisturbed().path("lake"));
        command.arg("--pipeline").arg(undisturbed().pipeline()).arg("mon");
        command.stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let left = || fs::read_dir(&temporary).expect("there").count();
    let mut child = command().spawn().expect("started");
    while left() == 0 && child.try_wait().expect("our own child").is_none() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    child.kill().expect("killed, or gone");
    child.wait().expect("our own child");
    assert_eq!(left(), 1, "killed in the middle, as soon as its folder was there");
    assert!(command().status().expect("started").success());
    assert_eq!(left(), 0);
}

#[test]
fn a_row_that_names_what_its_run_did_not_start_from_is_found() {
    let cell = copied().with("[tolerance]", "[join]\nmin_readings = 4\n\n[tolerance]");
    let own = fs::read_dir(cell.path("lake/joined_sessions/kr210-demo/mon")).expect("there");
    let own = own.last().expect("one").expect("readable").file_name();
    cell.run(&["mon", "--until", "session"]).expect(0, &["joined       mon: "]);
    let both = fs::read_dir(cell.path("lake/joined_sessions/kr210-demo/mon")).expect("there");
    let mut both = both.map(|entry| entry.expect("readable").file_name());
    let other = both.find(|name| *name != own).expect("another result");
    let other = other.to_string_lossy().replace(".parquet", "");
    let row = cell.table_file("runs", "mon");
    rewrite(&row, |column, array| {
        (column == "made_of").then(|| texts(array, |_| format!("mon/{other}")))
    });
    seal_row(&row);
    let lake = cell.path("lake").to_string_lossy().into_owned();
    let told = format!("it states that it started from mon/{other}, and from its inputs");
    ended(posegrid().args(["verify", &lake, "mon"])).expect(3, &["row of runs altered", &told]);
}
