//! Grids of an estimate: published by themselves, and what runs with another tolerance, rule or judging session start from.

use std::collections::BTreeMap;
use std::fs;

use posegrid::io::rows::Row as _;
use posegrid::io::tables::grid_steps::StepRow;
use posegrid::io::tables::grids::GridErrorRow;
use posegrid::io::tables::residuals::ResidualRow;
use posegrid::report::Model;

use super::cell::{Cell, ended, posegrid, published, undisturbed};
use super::same_work::assert_same;

/// The grids of a cell's lake.
fn grids(cell: &Cell) -> Vec<String> {
    let files = cell.lake().into_keys();
    files.filter(|path| path.starts_with("grids/")).collect()
}

#[test]
fn a_run_from_grids_has_the_bytes_of_one_that_makes_them() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&["--from", "report"]).expect(2, &["no session to learn from"]);
    cell.run(&["--until", "estimate"]).expect(0, &[]);
    cell.run(&["--from", "report"])
        .expect(1, &["mon", "the lake has no grids of it", "without --from"]);
    let made = cell.run(&["--until", "table"]);
    made.expect(
        0,
        &[
            "gridded      mon: ",
            " judged steps, ",
            " mm is chosen, result ",
            "1 of 1 grids: 1 now, 0 before",
        ],
    );
    assert_eq!(
        cell.lake().len(),
        6,
        "a session as joined, an estimate and its errors, grids and theirs"
    );
    cell.run(&["--until", "table"]).expect(0, &["done-before  mon: ", "0 now, 1 before"]);
    fs::remove_dir_all(cell.path("sessions")).expect("writable");
    cell.run(&["--from", "report"]).expect(0, &["1 of 1 within 0.5 mm"]);
    let mut expected = undisturbed().lake();
    expected.retain(|path, _| path.contains("/mon/"));
    assert_same(&cell.lake(), &expected);
    // Without any log the grids are made anew from the estimate.
    let lake = cell.path("lake").to_string_lossy().into_owned();
    let pipeline = cell.pipeline().to_string_lossy().into_owned();
    let own = grids(&cell)[0].clone();
    let own = own.rsplit('/').next().expect("a file");
    let name = own.trim_end_matches(".parquet");
    ended(posegrid().args(["verify", &lake, name, "--pipeline", &pipeline])).expect(
        0,
        &["grids: 1 in the lake, 1 as written, 0 changed; 1 gridded anew and the same, 0 by runs that were recomputed"],
    );
}

#[test]
fn another_tolerance_rule_or_judge_starts_from_the_same_grids() {
    let cell = Cell::new().with_quickstart("mon").with_judge("tue", "18", "130");
    cell.run(&["mon"]).expect(0, &[]);
    let first = grids(&cell);
    assert_eq!(first.len(), 1);
    let cell =
        cell.with("mm = 0.5", "mm = 0.4").with("[grid]", "[grid]\nchoose = \"fewest-nodes\"");
    cell.run(&["mon", "--from", "report", "--test", "tue"])
        .expect(2, &["tue", "does not have it as joined"]);
    cell.run(&["mon", "--test", "tue"]).expect(0, &["0.4 mm"]);
    assert_eq!(grids(&cell), first);
    // What the lake's run has is what one has that finds everything by itself; it replaced another one, which its row says.
    let elsewhere = cell.path("elsewhere").to_string_lossy().into_owned();
    cell.run(&["mon", "--test", "tue", "--lake", &elsewhere]).expect(0, &[]);
    let mut expected = published(elsewhere.as_ref());
    expected.retain(|path, _| !path.starts_with("runs/") && !path.starts_with('.'));
    let mut own = cell.lake();
    own.retain(|path, _| expected.contains_key(path));
    assert_same(&own, &expected);
    // Other steps: other grids.
    let cell = cell.with("steps_mm = [", "steps_mm = [300, ");
    cell.run(&["mon", "--from", "report"]).expect(1, &["the lake has no grids"]);
    cell.run(&["mon", "--from", "table"]).expect(0, &[]);
    assert_eq!(grids(&cell).len(), 2);
}

#[test]
fn grids_that_were_changed_are_made_again_or_refused() {
    let cell = Cell::new().with_quickstart("mon");
    cell.run(&["--until", "table"]).expect(0, &[]);
    let lake = cell.path("lake").to_string_lossy().into_owned();
    let verified = || ended(posegrid().args(["verify", &lake]));
    verified().expect(0, &["grids: 1 in the lake, 1 as written, 0 changed"]);
    let errors = cell.table_file("grid_errors", "mon");
    let mut bytes = fs::read(&errors).expect("written");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&errors, &bytes).expect("writable");
    verified().expect(3, &["/mon grids ", "grid_errors: ", "1 changed"]);
    cell.run(&["--from", "report"]).expect(1, &["mon", "the grids", "cannot be used"]);
    cell.run(&[]).expect(0, &["1 of 1 within 0.5 mm", "it is made again"]);
}

#[test]
fn errors_of_the_grids_give_the_figures_of_the_run() {
    let cell = undisturbed();
    let answers = GridErrorRow::read(&cell.table("grid_errors", "mon"));
    // The error of the tool point against its command, station by station, which the grids are to answer.
    let measured = ResidualRow::read(&cell.table("residuals", "mon")).into_iter();
    let measured = measured.filter(|row| row.subject.model == Model::RawCommand);
    let measured: BTreeMap<usize, [f64; 3]> =
        measured.map(|row| (row.station, row.residual)).collect();
    let away = |a: &[f64; 3], b: &[f64; 3]| {
        let squares = a.iter().zip(b).map(|(a, b)| (a - b).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let mut judged = 0;
    for step in StepRow::read(&cell.table("grid_steps", "mon")) {
        let is_own = |row: &&GridErrorRow| {
            (row.source, row.interpolation, row.judgement)
                == (step.source, step.interpolation, step.judgement)
                && row.step_mm.to_bits() == step.step_mm.to_bits()
        };
        let left = answers.iter().filter(is_own);
        let left: Vec<f64> = left.map(|row| away(&measured[&row.station], &row.error_mm)).collect();
        assert_eq!(left.len(), step.errors, "{} mm", step.step_mm);
        let mean = left.iter().sum::<f64>() / left.len() as f64;
        let largest = left.iter().copied().fold(0.0, f64::max);
        if let (Some(mean_mm), Some(max_mm)) = (step.mean_mm, step.max_mm) {
            assert!((mean - mean_mm).abs() < 1e-9, "{mean} {mean_mm}");
            assert!((largest - max_mm).abs() < 1e-9, "{largest} {max_mm}");
            judged += 1;
        }
    }
    assert!(judged > 10, "{judged}");
}
