//! What the owner of a lake may delete, what that costs, and that `posegrid verify` tells each case for what it is.

use std::fs;
use std::path::{Path, PathBuf};

use super::cell::{Cell, Ended, ended, files, posegrid};
use super::driven::driven;
use super::planned::planning;
use super::verify::verify;

/// A cell with one session of 12 random poses, identified by geometry alone, and its run.
fn small() -> (Cell, String) {
    let cell = Cell::new().with("harmonics = 12", "enabled = false");
    let cell = cell.with_simulated("mon", &["--random", "12"]);
    assert_ne!(cell.run(&[]).code, 1);
    let run = cell.table("runs", "mon").text("run").value(0).to_owned();
    (cell, run)
}

/// The runs of a session but for `first`.
fn later(cell: &Cell, session: &str, first: &str) -> String {
    let rows = files(&cell.path("lake/runs/kr210-demo").join(session));
    let mut runs = rows.keys().filter_map(|row| row.strip_suffix(".parquet"));
    let later = runs.find(|run| *run != first).expect("another run");
    later.to_owned()
}

/// Paths in the lake of what a run wrote, its row in `runs` left out.
fn files_of(cell: &Cell, run: &str) -> Vec<PathBuf> {
    let all = cell.lake().into_keys();
    let own = all.filter(|path| {
        path.contains(run) && !path.starts_with("runs/") && !path.starts_with(".history/")
    });
    own.map(|path| cell.path("lake").join(path)).collect()
}

fn remove(paths: &[PathBuf]) {
    for path in paths {
        fs::remove_file(path).expect("there");
    }
}

/// The cell's pipeline file as it is, in a folder of its own, with its sessions in `sessions` beside the cell's.
fn filed_away(cell: &Cell, folder: &str, sessions: &str) -> PathBuf {
    let text = fs::read_to_string(cell.pipeline()).expect("readable");
    let text = text
        .replace("\"sessions\"", &format!("\"../{sessions}\""))
        .replace("\"robots/", "\"../robots/")
        .replace("\"lake\"", "\"../lake\"");
    let path = cell.path(folder).join("pipeline.toml");
    fs::create_dir_all(cell.path(folder)).expect("writable");
    fs::write(&path, text).expect("writable");
    path
}

fn verify_by(cell: &Cell, pipeline: &Path, name: &str) -> Ended {
    let mut command = posegrid();
    command.arg("verify").arg(cell.path("lake")).arg(name);
    ended(command.arg("--pipeline").arg(pipeline))
}

#[test]
fn a_superseded_run_is_found_by_its_name_and_may_go_but_for_its_row() {
    let (cell, first) = small();
    let old = filed_away(&cell, "as it was", "sessions");
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    assert_ne!(cell.run(&[]).code, 1);
    let second = later(&cell, "mon", &first);
    // By the name that a file of corrected targets has: with today's settings, and with those it was computed with.
    verify(&cell, &[&first]).expect(3, &[&format!("run {first}: settings differ")]);
    verify_by(&cell, &old, &first).expect(0, &[&format!("run {first}: the same")]);

    let own = files_of(&cell, &first);
    remove(&own[..1]);
    verify(&cell, &[&first])
        .expect(3, &["outputs missing", "missing, and cited by its run's row and page"]);
    let history = || ended(posegrid().arg("history").arg(cell.path("lake")));
    let before = history();
    remove(&own[1..]);
    // The history needs nothing of it, even when it has to be made again.
    fs::remove_dir_all(cell.path("lake/.history")).expect("there");
    let after = history();
    assert_eq!((after.code, &after.results), (before.code, &before.results));
    assert!(before.results.contains("1 replaced by another run"), "{}", before.results);
    verify(&cell, &[]).expect(
        0,
        &[
            &format!(
                "run {first}: removed: of its files none is there; run {second} had taken its place"
            ),
            &format!("none of its {} files is there", own.len()),
            &format!("run {second}: the same"),
            "1 removed, superseded",
        ],
    );
    // Nothing of the one that took its place may go.
    let current = files_of(&cell, &second);
    let bytes = fs::read(&current[0]).expect("there");
    fs::remove_file(&current[0]).expect("there");
    verify(&cell, &[&second]).expect(3, &["outputs missing"]);
    fs::write(&current[0], bytes).expect("writable");
    // Nor may a row.
    let row = cell.path("lake/runs/kr210-demo/mon").join(format!("{first}.parquet"));
    fs::remove_file(row).expect("there");
    verify(&cell, &[]).expect(
        3,
        &[
            "what it cites is missing",
            &format!("cites run {first}, whose place it took: the lake has no row of it"),
        ],
    );
}

#[test]
fn logs_may_be_archived_and_what_came_of_them_is_still_checked() {
    let (cell, run) = small();
    let digest = |log: &str| {
        let bytes = fs::read(cell.session("mon").join(log)).expect("there");
        blake3::hash(&bytes).to_hex().to_string()
    };
    let (controller, tracker) = (digest("controller.mcap"), digest("tracker.mcap"));
    let sound =
        format!("its {} files have the digests that its row states", files_of(&cell, &run).len());
    let told = [
        "not recomputed, inputs missing",
        "input mon/controller: gone",
        &controller,
        "input mon/tracker: gone",
        &tracker,
        &sound,
    ];
    // The session's folder first, and then the folder of all of them.
    fs::create_dir(cell.path("archive")).expect("writable");
    fs::rename(cell.session("mon"), cell.path("archive/mon")).expect("writable");
    verify(&cell, &["mon"]).expect(1, &told);
    fs::remove_dir(cell.path("sessions")).expect("empty");
    verify(&cell, &["mon"]).expect(1, &told);
    // An altered file is told all the same, and outranks.
    let table = cell.table_file("residuals", "mon");
    let bytes = fs::read(&table).expect("there");
    fs::write(&table, b"other bytes").expect("writable");
    let altered = verify(&cell, &["mon"]);
    altered.expect(3, &["outputs altered", "output residuals/mon: digest "]);
    assert!(!altered.results.contains(&sound), "{}", altered.results);
    fs::write(&table, bytes).expect("writable");
    // Brought back, wherever to, they are as good as ever.
    let back = filed_away(&cell, "again", "archive");
    verify_by(&cell, &back, "mon").expect(0, &[": the same\n"]);
}

#[test]
fn a_file_that_was_deleted_is_the_same_when_it_is_made_again() {
    let (cell, _) = small();
    let path = cell.table_file("residuals", "mon");
    fs::remove_file(&path).expect("there");
    verify(&cell, &[]).expect(
        3,
        &[
            "outputs missing",
            "output residuals/mon: missing",
            "recomputed, it is as the row states",
        ],
    );
    // `run` finds the run in the lake and makes nothing; into another folder it makes the same.
    cell.run(&[]).expect(3, &["done-before"]);
    assert!(!path.exists());
    let other = cell.path("other");
    cell.run(&["--lake", other.to_str().expect("UTF-8")]);
    let made = path.strip_prefix(cell.path("lake")).expect("in it");
    fs::copy(other.join(made), &path).expect("copied");
    verify(&cell, &[]).expect(0, &["1 run: 1 the same"]);
}

#[test]
fn a_plan_that_the_lake_never_had_is_reported_and_changes_nothing() {
    let (cell, _) = small();
    let cell = cell.with("[tolerance]", "[report]\nplan = \"feed\"\n\n[tolerance]");
    assert_ne!(cell.run(&[]).code, 1);
    let run = cell.path("lake/runs/kr210-demo/mon");
    assert_eq!(files(&run).len(), 2);
    let told = "cites run feed, the plan it was measured by: the lake has no row of it";
    verify(&cell, &["mon"]).expect(3, &["1 settings differ", "1 the same", told]);
}

#[test]
fn a_driven_session_is_verified_with_the_run_that_drove_it() {
    let cell = driven();
    assert_ne!(cell.run(&["tue"]).code, 1);
    let mon = cell.table("runs", "mon").text("run").value(0).to_owned();
    verify(&cell, &["tue"]).expect(0, &[": the same\n"]);
    let tables = ["accuracy", "calibrations", "compensation"];
    remove(&tables.map(|table| cell.table_file(table, "mon")));
    let told = format!(
        "cites run {mon}, whose table drove the session: its calibrations/mon, compensation/mon, accuracy/mon missing"
    );
    // All but its page, which was held against that promise, is made again byte for byte.
    verify(&cell, &["tue"]).expect(
        3,
        &[
            "what it cites is missing",
            &told,
            "12 files recomputed, byte for byte the same",
            "report/tue: the page says something else",
        ],
    );
}

#[test]
fn a_plan_stays_verified_when_the_run_that_it_starts_from_is_superseded() {
    let cell = planning()
        .with("# of the past", "session = \"mon\"")
        .with("poses = [12]", "poses = [5]")
        .with_quickstart("mon");
    let mon = cell.table("runs", "mon").text("run").value(0).to_owned();
    ended(posegrid().arg("plan").arg(cell.pipeline())).expect(3, &["plan "]);
    let text = fs::read_to_string(cell.pipeline()).expect("readable");
    let other = cell.path("other.toml");
    fs::write(&other, text.replace("harmonics = 12", "enabled = false")).expect("writable");
    let again = ended(posegrid().arg("run").arg(&other).arg("mon"));
    assert_ne!(again.code, 1, "{}", again.messages);
    let later = later(&cell, "mon", &mon);
    let told =
        format!("cites run {mon}, whose arm it starts from: there, and superseded by run {later}");
    verify(&cell, &["plan"]).expect(0, &[": the same\n", &told]);
    // Without its table there is nothing to start from.
    let table = format!("lake/calibrations/kr210-demo/mon/{mon}.parquet");
    fs::remove_file(cell.path(&table)).expect("there");
    let told = format!(
        "cites run {mon}, whose arm it starts from: its calibrations/mon missing; it cannot be planned again"
    );
    verify(&cell, &["plan"])
        .expect(1, &["not recomputed, inputs missing", "input calibrations: gone", &told]);
}
