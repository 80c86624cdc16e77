//! The same work: done once, and with the same bytes however it is done.

use std::collections::BTreeMap;

use super::cell::{Cell, Ended, ended, undisturbed};

/// Files of one piece of work: thirteen tables, `runs` among them, the page, and what the history keeps of it.
const FILES: usize = 15;
/// Published files of its session as joined, of its estimate and of its grids, two each, from which another piece starts too.
const BEFORE: usize = 6;

#[test]
fn a_run_gives_every_table_and_page_of_every_session() {
    let lake = undisturbed().lake();
    for session in ["mon", "tue"] {
        let folder = format!("/kr210-demo/{session}/");
        let tables = lake.keys().filter(|path| path.contains(&folder));
        assert_eq!(tables.count(), FILES + BEFORE, "{session}: {:?}", lake.keys());
    }
    assert_eq!(lake.len(), 2 * (FILES + BEFORE), "{:?}", lake.keys());
}

#[test]
fn the_same_work_is_not_done_again_and_that_is_stated() {
    let cell = undisturbed();
    let before = written(cell);
    cell.run(&[]).expect(
        0,
        &[
            "done-before  mon: within tolerance by the compensation table, run ",
            "done-before  tue: within tolerance by the compensation table, run ",
            "2 of 2 within 0.5 mm, 0 without a result: 0 done, 2 done before, 0 not met, 0 failed, 0 waiting",
        ],
    );
    assert_eq!(written(cell), before, "no file was written again");
}

#[test]
fn other_settings_are_other_work() {
    let cell = Cell::new().with_simulated("few", &["--random", "12"]);
    cell.run(&[]).expect(3, &["not shown"]);
    assert_eq!(cell.lake().len(), FILES + BEFORE);
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    let again = cell.run(&[]);
    again.expect(3, &["tolerance 0.4 mm"]);
    assert!(!again.results.contains("done-before"), "{}", again.results);
    assert_eq!(
        cell.lake().len(),
        2 * FILES + BEFORE,
        "both runs stand side by side, of one session as joined, one estimate and its grids"
    );
}

#[test]
fn the_bytes_do_not_depend_on_threads_jobs_or_folders() {
    let expected = undisturbed().lake();
    let cell = Cell::new().with_quickstart("mon").with_quickstart("tue");
    let one_thread = |arguments: &[&str]| -> Ended {
        ended(cell.command().env("RAYON_NUM_THREADS", "1").args(arguments))
    };
    one_thread(&["--jobs", "2"]).expect(0, &["2 of 2"]);
    assert_same(&cell.lake(), &expected);
}

/// Asserts that two lakes are the same, naming the files that differ.
pub fn assert_same(found: &BTreeMap<String, Vec<u8>>, expected: &BTreeMap<String, Vec<u8>>) {
    let names = |lake: &BTreeMap<String, Vec<u8>>| lake.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(expected));
    let differing: Vec<_> = found
        .iter()
        .filter(|(path, bytes)| expected[*path] != **bytes)
        .map(|(path, _)| path)
        .collect();
    assert!(differing.is_empty(), "other bytes: {differing:?}");
}

/// When each file of the lake was last written.
fn written(cell: &Cell) -> Vec<std::time::SystemTime> {
    let lake = cell.lake();
    let time = |path: &String| {
        let metadata = cell.path("lake").join(path).metadata().expect("there");
        metadata.modified().expect("known")
    };
    lake.keys().map(time).collect()
}
