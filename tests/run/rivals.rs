//! Rivals of the model that corrects: their rows, and a table of the one that wins where it is asked for.

use arrow::array::Array as _;

use super::cell::Cell;
use super::verify::verify;

const GRID: [&str; 4] = ["--size", "720,1440,720", "--grid-step", "180"];
const ASKED: &str = "steps_mm = [240, 360]\nrivals = true";

/// A cell whose stations are dense beside joint curves, with geometry alone where `full` is not asked for, judged by another session.
fn cell(full: bool) -> Cell {
    let curves = if full { "harmonics = 12" } else { "enabled = false" };
    Cell::new()
        .with("harmonics = 12", curves)
        .with("steps_mm = [180, 240, 360]", ASKED)
        .with("[tolerance]", "[report]\nrivals = true\n\n[tolerance]")
        .with_simulated("mon", &GRID)
        .with_simulated("wed", &["--random", "120"])
}

/// Distinct models of the judged steps whose nodes are of a model.
fn gridded(cell: &Cell) -> Vec<String> {
    let steps = cell.table("grid_steps", "mon");
    let models = steps.text("model");
    let mut found: Vec<String> = (0..models.len())
        .filter(|row| models.is_valid(*row))
        .map(|row| models.value(row).to_owned())
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

/// Value and expanded uncertainty of the figures of this name on a split, with the model of each.
fn figures(cell: &Cell, name: &str, split: &str) -> Vec<(String, f64, f64)> {
    let table = cell.table("accuracy", "mon");
    let (names, splits, models) = (table.text("name"), table.text("split"), table.text("model"));
    let (values, widths) = (table.f64("value"), table.f64("expanded_uncertainty"));
    let is_it = |row: &usize| names.value(*row) == name && splits.value(*row) == split;
    let figure = |row: usize| {
        let model = models.value(row).to_owned();
        (model, values.value(row), widths.value(row))
    };
    (0..names.len()).filter(is_it).map(figure).collect()
}

#[test]
fn a_table_is_of_a_rival_where_it_wins_and_is_asked_for() {
    let cell = cell(false);
    let ended = cell.run(&["mon", "--test", "wed"]);
    ended.no_defect();
    let won = figures(&cell, "mean_difference_after_choice", "blocks");
    let [(winner, value, width)] = &won[..] else { panic!("one rival is chosen: {won:?}") };
    assert!(value + width < 0.0, "{won:?}");
    assert!(gridded(&cell).iter().eq([winner]), "{winner}");
    let lake = cell.lake().into_iter();
    let mut pages = lake.filter(|(path, _)| path.starts_with("report/"));
    let (_, page) = pages.next().expect("a page");
    let page = String::from_utf8(page).expect("text");
    assert!(page.contains("node values are of a rival"), "the page says so");
    assert!(page.contains("; it wins."), "and who won");
    // Each rival is judged on both splits, with its coverage, on a session that took no part too.
    assert_eq!(figures(&cell, "mean_difference", "blocks").len(), 3);
    for split in ["blocks", "session"] {
        let inside = figures(&cell, "share_in_ellipsoid", split);
        let of_rivals = inside.iter().filter(|(model, ..)| model != "full");
        println!("{split}: {inside:?}");
        assert!(of_rivals.count() >= 3, "{inside:?}");
    }
    verify(&cell, &[]).expect(0, &["1 run: 1 the same"]);
}

#[test]
fn the_full_error_model_keeps_the_table_where_no_rival_wins() {
    let cell = cell(true);
    cell.run(&["mon", "--test", "wed"]).no_defect();
    let beside = figures(&cell, "mean_difference", "blocks");
    assert_eq!(beside.len(), 3);
    assert!(beside.iter().all(|(_, value, _)| *value > 0.0), "{beside:?}");
    assert_eq!(gridded(&cell), ["full"]);
}

#[test]
fn a_table_of_rivals_needs_rivals() {
    let cell = Cell::new().with("steps_mm = [180, 240, 360]", ASKED).with_quickstart("mon");
    cell.run(&[]).expect(2, &["[grid] rivals", "[report] rivals = true"]);
}
