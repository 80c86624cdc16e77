//! Estimates: published by themselves, and what runs with other steps, tolerances or judging sessions start from.

use std::fs;

use posegrid::io::rows::Row as _;
use posegrid::io::tables::residuals::{EstimateResidualRow, ResidualRow};
use posegrid::report::{Model, Split};

use super::cell::{Cell, Ended, ended, posegrid, undisturbed};
use super::same_work::assert_same;

/// The estimates of a cell's lake.
fn estimates(cell: &Cell) -> Vec<String> {
    let files = cell.lake().into_keys();
    files.filter(|path| path.starts_with("estimates/")).collect()
}

fn verified(cell: &Cell, names: &[&str]) -> Ended {
    let lake = cell.path("lake").to_string_lossy().into_owned();
    ended(posegrid().args(["verify", &lake]).args(names))
}

#[test]
fn a_run_from_an_estimate_has_the_bytes_of_one_that_trains() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&["--from", "estimate", "--until", "estimate"])
        .expect(2, &["no session to learn from"]);
    cell.run(&["--until", "estimate"]).expect(
        0,
        &[
            "estimated    mon: ",
            "readings, misfit of the geometry 0.",
            "1 of 1 estimates: 1 now, 0 before",
        ],
    );
    assert_eq!(cell.lake().len(), 4, "a session as joined, an estimate and its errors");
    cell.run(&["--until", "estimate"]).expect(0, &["done-before  mon: ", "0 now, 1 before"]);
    fs::remove_dir_all(cell.path("sessions")).expect("writable");
    cell.run(&["--from", "table"]).expect(0, &["1 of 1 within 0.5 mm"]);
    let mut expected = undisturbed().lake();
    expected.retain(|path, _| path.contains("/mon/"));
    assert_same(&cell.lake(), &expected);
    // Without any log the estimate is trained anew from the session as joined.
    let pipeline = cell.pipeline().to_string_lossy().into_owned();
    let estimate = estimates(&cell)[0].clone();
    let estimate = estimate.rsplit('/').next().expect("a file");
    let name = estimate.trim_end_matches(".parquet");
    verified(&cell, &[name, "--pipeline", &pipeline]).expect(
        0,
        &["estimates: 1 in the lake, 1 as written, 0 changed; 1 estimated anew and the same, 0 by runs that were recomputed"],
    );
}

#[test]
fn what_comes_after_the_fit_starts_from_the_same_estimate() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&[]).expect(0, &[]);
    let first = estimates(&cell);
    assert_eq!(first.len(), 1);
    // Steps, tolerance, a judging session: the same trainings.
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    cell.run(&["--from", "table"]).expect(0, &["1 of 1 within 0.4 mm"]);
    let cell = cell.with_judge("tue", "18", "130");
    cell.run(&["mon", "--test", "tue"]).expect(0, &["0.4 mm"]);
    assert_eq!(estimates(&cell), first);
    // Another fit: another estimate.
    let cell = cell.with("sd_mm = 0.2 }", "sd_mm = 0.3 }");
    cell.run(&["mon", "--from", "table"])
        .expect(1, &["mon", "the lake has no estimate", "without --from"]);
}

#[test]
fn an_estimate_that_was_changed_is_trained_again_or_refused() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&["--until", "estimate"]).expect(0, &[]);
    verified(&cell, &[]).expect(0, &["estimates: 1 in the lake, 1 as written, 0 changed"]);
    let errors = cell.table_file("estimate_residuals", "mon");
    let aside = cell.path("aside.parquet");
    fs::rename(&errors, &aside).expect("writable");
    verified(&cell, &[]).expect(3, &["/mon estimate ", "estimate_residuals: ", "1 changed"]);
    fs::rename(&aside, &errors).expect("writable");
    let file = cell.path("lake").join(&estimates(&cell)[0]);
    let mut bytes = fs::read(&file).expect("written");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&file, &bytes).expect("writable");
    verified(&cell, &[]).expect(3, &["estimates: 1 in the lake, 0 as written, 1 changed"]);
    cell.run(&["--from", "table"]).expect(1, &["mon", "the estimate", "cannot be used"]);
    cell.run(&[]).expect(0, &["1 of 1 within 0.5 mm", "it is made again"]);
}

#[test]
fn a_pool_from_its_estimate_has_the_bytes_of_one_that_trains() {
    let flags = ["--random", "40"];
    let cell = Cell::new()
        .with("# sessions", "pool = \"all\"")
        .with_simulated("mon", &flags)
        .with_simulated("tue", &flags);
    let first = cell.run(&[]);
    let whole = cell.lake();
    assert!(
        whole.keys().any(|path| path.starts_with("estimates/kr210-demo/pooled/")),
        "{:?}",
        first.messages
    );
    errors_are_those_of_the_run(&cell);
    fs::rename(cell.path("lake"), cell.path("whole")).expect("writable");
    cell.run(&["--until", "estimate"]).expect(0, &["1 of 1 estimates: 1 now, 0 before"]);
    cell.run(&["--from", "table"]).expect(first.code, &[]);
    assert_same(&cell.lake(), &whole);
}

/// Asserts that an estimate's errors of its stations are those that its run has of them.
fn errors_are_those_of_the_run(cell: &Cell) {
    let own = EstimateResidualRow::read(&cell.table("estimate_residuals", "pooled"));
    let own: Vec<ResidualRow> = own.into_iter().map(|row| row.residual).collect();
    let of_run = ResidualRow::read(&cell.table("residuals", "pooled"));
    let of_models =
        |row: &ResidualRow| ![Model::RawCommand, Model::Table].contains(&row.subject.model);
    let of_run: Vec<ResidualRow> = of_run.into_iter().filter(of_models).collect();
    assert_eq!(own, of_run);
    let held_out = |session: &str| {
        let own = own.iter().filter(|row| row.subject.of_session == session);
        let own = own
            .filter(|row| row.subject.model == Model::Full && row.subject.split == Split::Blocks);
        own.filter(|row| row.fold.is_some() && row.predicted_cov_mm2.is_some()).count()
    };
    assert!(held_out("mon") >= 40 && held_out("tue") >= 40);
    assert!(own.iter().any(|row| row.subject.split == Split::Session));
}
