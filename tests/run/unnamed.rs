//! Readings of three reflectors that do not name them: as a log and as a table, against those of the same session with names.

use std::collections::BTreeMap;
use std::fs;

use arrow::array::Array as _;

use super::cell::{Cell, Ended};
use super::tabled;

/// Places at the flange, mm: the tool, and the reflectors beside it.
const PLACES: [[f64; 3]; 3] = [[25.0, -40.0, 100.0], [135.0, -20.0, 85.0], [55.0, 90.0, 110.0]];
const FLAGS: [&str; 12] = [
    "--random-joints",
    "70",
    "--beside",
    "110,20,-15",
    "--beside",
    "30,130,10",
    "--dwell-s",
    "3",
    "--lost-share",
    "0.05",
    "--target-sd-mm",
    "0.3",
];

/// `[fit.targets]`, each place off by this along an axis of its own, mm.
fn stated(off_mm: f64) -> String {
    let place = |(number, at): (usize, &[f64; 3])| {
        let mut at = *at;
        at[number] += off_mm;
        format!("[fit.targets.T{}]\nxyz_mm = {at:?}\nsd_mm = 0.5\n\n", number + 1)
    };
    PLACES.iter().enumerate().map(place).collect()
}

/// A cell whose pipeline file states the places of the reflectors, and geometry alone is fitted.
fn cell() -> Cell {
    Cell::new()
        .with("target = { xyz_mm = [25, -40, 100], sd_mm = 0.2 }", &format!("\n{}", stated(0.4)))
}

/// The session with these flags, read by this text in place of the quickstart's topic.
fn logged(flags: &[&str], topic: &str) -> (Cell, Ended) {
    let cell = cell()
        .with("topic = \"/tracker/point\"\n", topic)
        .with_simulated("mon", &[&FLAGS[..], flags].concat());
    let ended = cell.run(&[]);
    (cell, ended)
}

const NAMED: &str = "topic = \"/tracker/targets\"\nignore_orientation = true\nfields = { target = \"child_frame_id\" }\n\
     targets = [{ name = \"T1\", is = \"T1\" }, { name = \"T2\", is = \"T2\" }, { name = \"T3\", is = \"T3\" }]\n";
const UNNAMED: &str =
    "topic = \"/tracker/point\"\ntargets_by_geometry = [\"T1\", \"T2\", \"T3\"]\n";

/// The session as a table made with these flags.
fn as_table(flags: &[&str], change: impl Fn(&str) -> String) -> (Cell, Ended) {
    let made = Cell::new().with_simulated("mon", &[&FLAGS[..], flags].concat());
    let text = fs::read_to_string(made.session("mon").join("stations.csv")).expect("written");
    let head = text.lines().skip(1).map_while(|line| line.strip_prefix("# "));
    let section = head.fold(String::new(), |text, line| text + line + "\n");
    let cell = tabled::cell_with(cell(), &section);
    fs::create_dir_all(cell.session("mon")).expect("writable");
    let rows: String = text
        .lines()
        .filter(|line| !line.starts_with('#'))
        .fold(String::new(), |text, line| text + line + "\n");
    fs::write(cell.session("mon").join("measured.csv"), change(&rows)).expect("writable");
    let ended = cell.run(&[]);
    (cell, ended)
}

/// The rows of stations with readings: a table with a row for each reading has no others.
fn without_unread(rows: &str) -> String {
    let unread = ",".repeat(21);
    let read = rows.lines().filter(|line| !line.ends_with(&unread));
    read.fold(String::new(), |text, line| text + line + "\n")
}

/// Identified offsets by model and parameter, with their standard errors.
fn parameters(cell: &Cell) -> BTreeMap<(String, String), (f64, f64)> {
    let table = cell.table("parameters", "mon");
    let (offset, se) = (table.f64("offset"), table.f64("standard_error"));
    (0..table.rows())
        .filter(|&row| se.is_valid(row))
        .map(|row| {
            let name = table.text("parameter").value(row).to_owned();
            let model = table.text("model").value(row).to_owned();
            ((model, name), (offset.value(row), se.value(row)))
        })
        .collect()
}

/// Largest difference of two sessions' parameters, in standard errors.
fn apart(one: &Cell, other: &Cell) -> f64 {
    let (one, other) = (parameters(one), parameters(other));
    assert_eq!(one.keys().collect::<Vec<_>>(), other.keys().collect::<Vec<_>>());
    assert!(one.len() > 20);
    one.iter().map(|(name, (offset, se))| (offset - other[name].0).abs() / se).fold(0.0, f64::max)
}

/// Stations that are assigned, and the smallest ratio of a runner-up's distance to that of the assignment.
fn assigned(cell: &Cell) -> (usize, f64) {
    let table = cell.table("stations", "mon");
    let (own, other) = (table.f64("assigned_mm"), table.f64("assigned_runner_up_mm"));
    let rows = (0..table.rows()).filter(|&row| own.is_valid(row));
    let ratios: Vec<f64> = rows.map(|row| other.value(row) / own.value(row)).collect();
    (ratios.len(), ratios.into_iter().fold(f64::INFINITY, f64::min))
}

#[test]
fn readings_without_names_give_the_parameters_of_those_with_names() {
    let (named, of_named) = logged(&["--in-turn"], NAMED);
    let (unnamed, of_unnamed) = logged(&["--unnamed"], UNNAMED);
    for ended in [&of_named, &of_unnamed] {
        assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    }
    let logs = apart(&named, &unnamed);
    let (wide, of_wide) = as_table(&["--table", "--in-turn"], without_unread);
    let (long, of_long) = as_table(&["--table", "--unnamed"], str::to_owned);
    for ended in [&of_wide, &of_long] {
        assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    }
    let tables = apart(&wide, &long);
    println!(
        "largest difference of a parameter: logs {logs:.4}, tables {tables:.1e} standard errors; assigned {:?} {:?}",
        assigned(&unnamed),
        assigned(&long)
    );
    assert!(logs < 0.1 && tables < 1e-6, "{logs} {tables}");
    assert_eq!(assigned(&named).0 + assigned(&wide).0, 0);
    for cell in [&unnamed, &long] {
        let (stations, ratio) = assigned(cell);
        assert!(stations > 60 && ratio > 5.0, "{stations} {ratio}");
    }
}

#[test]
fn readings_without_names_that_come_at_once_give_the_parameters_of_those_with_names() {
    let (named, of_named) = logged(&[], NAMED);
    let (unnamed, of_unnamed) = logged(&["--unnamed", "--at-once"], UNNAMED);
    for ended in [&of_named, &of_unnamed] {
        assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    }
    let apart = apart(&named, &unnamed);
    let (stations, ratio) = assigned(&unnamed);
    println!(
        "largest difference of a parameter: {apart:.4} standard errors; assigned {stations} {ratio}"
    );
    assert!(apart < 0.1, "{apart}");
    unnamed.assert_every_reading_has_a_class("mon");
    assert!(stations > 60 && ratio > 5.0, "{stations} {ratio}");
}

#[test]
fn what_cannot_be_assigned_is_named() {
    // Blocks of three columns in any order, wide: a reading of another reflector is of no target.
    let (cell, ended) = as_table(&["--table", "--unnamed"], |rows| {
        let lines = rows.lines().enumerate().map(|(place, line)| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if place == 20 {
                let x = cells.len() - 7;
                cells[x] = "9000.0".to_owned();
            }
            cells.join(",") + "\n"
        });
        lines.collect()
    });
    assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    let rejects = cell.table("rejects", "mon");
    let reasons: Vec<&str> =
        (0..rejects.rows()).map(|row| rejects.text("reason").value(row)).collect();
    assert!(reasons.iter().any(|own| own.contains("of no target: ")), "{reasons:?}");

    // Places that are not these reflectors'.
    let elsewhere = cell.with("[135.0, -19.6, 85.0]", "[25.0, 160.0, 100.0]").run(&[]);
    assert_eq!(elsewhere.code, 1);
    assert!(elsewhere.messages.contains("under no assignment"), "{}", elsewhere.messages);
}

#[test]
fn what_is_stated_of_unnamed_targets_has_to_be_enough() {
    let few = Cell::new().with("topic = \"/tracker/point\"\n", UNNAMED);
    few.run(&[]).expect(2, &["targets_by_geometry", "no distance between T1 and T2"]);
    let both = cell().with(
        "topic = \"/tracker/point\"\n",
        &format!("{UNNAMED}targets = [{{ name = \"T1\" }}]\n"),
    );
    both.run(&[]).expect(2, &["beside targets_by_geometry"]);
}
