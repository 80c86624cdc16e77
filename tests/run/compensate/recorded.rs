//! The lake's record of corrections: what was written is known, whatever was stripped of it.

use std::fs;
use std::path::PathBuf;

use posegrid::cli::compensate::{CompensateCommandError, UsedWithArgs};
use posegrid::files::table;
use posegrid::io::lake::{Correction, Lake, is_correction};
use posegrid::io::rows::Word as _;

use super::cell::{Cell, SAMPLE, Sample, field};

/// A cell whose table stands in its lake.
fn in_lake(sample: &Sample) -> (Cell, Lake) {
    let mut cell = Cell::new(sample);
    let root = cell.path("lake");
    let session = root.join("compensation/ur10/monday");
    fs::create_dir_all(&session).unwrap();
    fs::create_dir_all(root.join("runs")).unwrap();
    let table = session.join("00ff.parquet");
    fs::rename(&cell.table, &table).unwrap();
    cell.table = table;
    (cell, Lake::new(root))
}

fn records(lake: &Lake) -> Vec<Correction> {
    let records = lake.corrections().unwrap().into_iter();
    records.map(|(_, _, record)| record.unwrap()).collect()
}

fn record_files(cell: &Cell) -> Vec<PathBuf> {
    let Ok(found) = fs::read_dir(cell.path("lake/corrections/ur10/monday")) else {
        return Vec::new();
    };
    found.map(|entry| entry.unwrap().path()).collect()
}

const TARGETS: &str =
    "target,x_mm,y_mm,z_mm\nA,751,20,450\nB,652.5,-20.25,555.125\nfar,1951,20,450\n";
fn refused(cell: &Cell, targets: &str) -> String {
    let error = cell.compensate(targets, None).unwrap_err();
    assert_eq!(error.exit_code(), 2, "{error}");
    let error = error.to_string();
    assert!(error.contains("corrected already"), "{error}");
    error
}

#[test]
fn what_was_written_is_recorded_once_and_its_targets_may_be_corrected_again() {
    let (cell, lake) = in_lake(&SAMPLE);
    let (done, first) = cell.csv(TARGETS).unwrap();
    assert!(!done.to_string().contains("not recorded"), "{done}");
    let [record] = &records(&lake)[..] else {
        panic!("one file was written");
    };
    assert_eq!((record.targets, record.corrected), (3, 2));
    assert_eq!((record.form.word(), record.corrected_by.word()), ("csv", "compensation"));
    assert_eq!((record.key.robot.as_str(), record.key.run.as_str()), ("ur10", "00ff"));
    assert_eq!(record.targets_digest, blake3::hash(TARGETS.as_bytes()).to_hex().as_str());
    assert_eq!(record.file_digest, blake3::hash(first.as_bytes()).to_hex().as_str());
    // c + 1 + 0.002 (c − 600) = 751 has c = 600 + 150 / 1.002 mm.
    assert!((record.positions[0][0] - (600.0 + 150.0 / 1.002)).abs() < 1e-6);
    let (_, second) = cell.csv(TARGETS).unwrap();
    assert_eq!((first, records(&lake).len()), (second, 1), "the same once more");
    cell.compensate("targets.csv", Some("out.json")).unwrap();
    assert_eq!(records(&lake).len(), 2, "another file is another row");
    for file in record_files(&cell) {
        let key = file.strip_prefix(cell.path("lake")).unwrap();
        assert!(is_correction(&key.to_string_lossy()), "{key:?}");
    }
}

#[test]
fn a_file_without_its_marks_is_known_by_its_positions() {
    let (cell, _) = in_lake(&SAMPLE);
    fs::write(cell.path("targets.csv"), TARGETS).unwrap();
    cell.compensate("targets.csv", Some("out.csv")).unwrap();
    let written = fs::read_to_string(cell.path("out.csv")).unwrap();
    assert!(refused(&cell, "out.csv").contains("the file posegrid wrote"));
    let marked = written.replace("refused,", "note,");
    fs::write(cell.path("bare.csv"), marked).unwrap();
    assert!(refused(&cell, "bare.csv").contains("with table \"t-1\""));
    let row = |name: &str| {
        let [x, y, z] = ["x_mm", "y_mm", "z_mm"].map(|column| field(&written, name, column));
        format!("{name},{x},{y},{z}\n")
    };
    let bare = format!("target,x_mm,y_mm,z_mm\n{}{}", row("A"), row("B"));
    fs::write(cell.path("bare.csv"), bare).unwrap();
    let told = refused(&cell, "bare.csv");
    for part in [
        "2 of its 2 targets, \"A\" first,",
        "posegrid wrote on 20",
        "UTC",
        "table 00ff",
        "session \"monday\"",
        "corrections/ur10/monday",
    ] {
        assert!(told.contains(part), "{part}: {told}");
    }
}

#[test]
fn one_command_among_targets_is_found_in_any_form_and_rounded_to_a_micrometre() {
    let (cell, _) = in_lake(&SAMPLE);
    let (_, csv) = cell.csv(TARGETS).unwrap();
    let number = |column: &str| field(&csv, "A", column).parse::<f64>().unwrap();
    let [x, y, z] = ["x_mm", "y_mm", "z_mm"].map(number);
    let text = format!(
        "[{{\"target\": \"new\", \"x_mm\": 700, \"y_mm\": 0, \"z_mm\": 450}},\n{{\"target\": \"Q\", \"x_mm\": {x:.3}, \"y_mm\": {y:.3}, \"z_mm\": {z:.3}}}]"
    );
    fs::write(cell.path("mixed.json"), text).unwrap();
    assert!(refused(&cell, "mixed.json").contains("1 of its 2 targets, \"Q\" first,"));
    // A hundredth of a millimetre beside it is another place.
    let text = format!("target,x_mm,y_mm,z_mm\nQ,{},{y},{z}\n", x + 0.01);
    fs::write(cell.path("beside.csv"), text).unwrap();
    cell.compensate("beside.csv", None).unwrap();
}

#[test]
fn commands_that_are_their_targets_say_nothing() {
    let (cell, lake) = in_lake(&Sample { error: |_| [0.000_5, 0.0, 0.0], ..SAMPLE });
    cell.csv("target,x_mm,y_mm,z_mm\nA,751,20,450\n").unwrap();
    assert!(records(&lake)[0].positions.is_empty());
    cell.csv("target,x_mm,y_mm,z_mm\nB,751,20,450\n").unwrap();
}

#[test]
fn a_lake_that_takes_no_record_is_a_choice_of_the_caller() {
    let (cell, lake) = in_lake(&SAMPLE);
    // A file in the robot's folder's place: nothing can be made in it, by whomever.
    fs::create_dir(cell.path("lake/corrections")).unwrap();
    fs::write(cell.path("lake/corrections/ur10"), "").unwrap();
    fs::write(cell.path("targets.csv"), TARGETS).unwrap();
    let error = cell.compensate("targets.csv", Some("out.csv")).unwrap_err();
    assert!(matches!(*error, CompensateCommandError::NotRecorded { .. }), "{error}");
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("give --no-record"), "{error}");
    assert!(!cell.path("out.csv").exists(), "nothing was written");
    let args = UsedWithArgs::default();
    let (done, _) = cell.without_record("targets.csv", "out.csv", &args).unwrap();
    assert!(done.to_string().contains("not recorded: the lake takes no record"), "{done}");
    assert!(cell.path("out.csv").exists());
    assert!(lake.corrections().unwrap().is_empty());
}

#[test]
fn a_record_that_cannot_be_believed_stops_the_work_and_names_itself() {
    let (cell, lake) = in_lake(&SAMPLE);
    cell.csv(TARGETS).unwrap();
    let [file] = &record_files(&cell)[..] else {
        panic!("one record");
    };
    let mut record = records(&lake).remove(0);
    record.positions[0][0] += 1.0;
    let whole = fs::read(file).unwrap();
    // Another row under the first one's name, and half of the file.
    let edited =
        table::Columns::like(&record.table().unwrap()).same("digest", "00").finish().unwrap();
    for bytes in [table::write(&edited, Vec::new()).unwrap(), whole[..whole.len() / 2].to_vec()] {
        fs::write(file, bytes).unwrap();
        let error = cell.compensate("targets.csv", None).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("cannot be used"), "{error}");
        assert!(error.to_string().contains(&file.display().to_string()), "{error}");
    }
}

#[test]
fn a_table_outside_of_a_lake_corrects_and_says_that_nothing_is_recorded() {
    let cell = Cell::new(&SAMPLE);
    let (done, _) = cell.csv(TARGETS).unwrap();
    assert!(done.to_string().contains("not recorded: the table is in no lake"), "{done}");
    // Under the name of another run it is not the lake's.
    let (mut cell, lake) = in_lake(&SAMPLE);
    let other = cell.table.with_file_name("00fe.parquet");
    fs::rename(&cell.table, &other).unwrap();
    cell.table = other;
    cell.csv(TARGETS).unwrap();
    assert!(records(&lake).is_empty());
}
