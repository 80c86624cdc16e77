//! Tables as people have them (`../shared/stations`), in every form, against what other programs read in the same files
//! (`tests/readers/measured_tables.py`): every number to the last bit.
//!
//! Python is `POSEGRID_PYTHON`, or that of `target/ci-venv`; it needs pandas, pyarrow, openpyxl and `PyYAML`. Without them, or
//! without the tables, the test says that it did not run, and fails where `CI` is set.

#[path = "../common/fuzz.rs"]
mod fuzz;

use std::path::{Path, PathBuf};
use std::process::Command;

use posegrid::files::input::Bound;
use posegrid::files::measured_table::{Cell, Form, MeasuredTable, read};

fn python() -> Option<PathBuf> {
    let stated = std::env::var_os("POSEGRID_PYTHON").map(PathBuf::from);
    let python = stated.unwrap_or_else(|| "target/ci-venv/bin/python".into());
    let packages = ["-c", "import pandas, pyarrow, openpyxl, yaml"];
    let has_them = Command::new(&python).args(packages).output();
    if has_them.is_ok_and(|ended| ended.status.success()) {
        return Some(python);
    }
    absent("pandas, pyarrow, openpyxl and PyYAML in POSEGRID_PYTHON or target/ci-venv")
}

fn stations() -> Option<PathBuf> {
    let folder = PathBuf::from("../shared/stations");
    if folder.exists() {
        return Some(folder);
    }
    absent("../shared/stations")
}

fn absent<T>(what: &str) -> Option<T> {
    assert!(std::env::var_os("CI").is_none(), "{what}: absent");
    eprintln!("SKIPPED: {what}: absent, so no table was compared with another program");
    None
}

/// A number as `float.hex` of Python writes it.
fn from_hex(text: &str) -> f64 {
    let (text, sign) = match text.strip_prefix('-') {
        Some(rest) => (rest, -1.0),
        None => (text, 1.0),
    };
    let (digits, exponent) = text.split_once('p').expect("an exponent");
    let digits = digits.strip_prefix("0x").expect("hexadecimal digits");
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let all = u64::from_str_radix(&format!("{whole}{fraction}"), 16).expect("digits");
    let exponent: i32 = exponent.parse().expect("an exponent");
    let places = i32::try_from(4 * fraction.len()).expect("few digits");
    // Exact: a double has fewer bits than the digits, and none of these is near the ends of its range.
    sign * all as f64 * 2.0_f64.powi(exponent - places)
}

fn check_cell(cell: Cell<'_>, expected: &str, at: &str) {
    match cell {
        Cell::Blank => assert_eq!(expected, "", "{at}"),
        Cell::Number(number) => {
            assert!(expected.contains("0x"), "{at}: {number} is {expected:?} elsewhere");
            assert_eq!(number.to_bits(), from_hex(expected).to_bits(), "{at}: {number}");
        }
        Cell::Text(text) => assert_eq!(text, expected, "{at}"),
    }
}

fn check(path: &Path, table: &MeasuredTable) {
    let expected = std::fs::read_to_string(format!("{}.expected", path.display())).expect("a text");
    let mut lines = expected.lines();
    let names: Vec<&str> = lines.next().expect("names").split('\t').collect();
    assert_eq!(table.columns(), names, "{}", path.display());
    let rows: Vec<&str> = lines.collect();
    assert_eq!(table.row_count(), rows.len(), "{}", path.display());
    assert!(table.left_out.is_empty(), "{}", path.display());
    for (row, line) in rows.into_iter().enumerate() {
        for (column, expected) in line.split('\t').enumerate() {
            let at = format!("{}, row {row}, column {column}", path.display());
            check_cell(table.cell(row, column), expected, &at);
        }
    }
}

#[test]
fn every_form_of_the_six_tables_is_read_as_other_programs_read_it() {
    let (Some(python), Some(stations)) = (python(), stations()) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let ended = Command::new(python)
        .arg("tests/readers/measured_tables.py")
        .args([&stations, &folder.path().to_owned()])
        .output()
        .expect("Python starts");
    let told = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.success(), "{told}");
    let files = std::fs::read_dir(folder.path()).expect("a folder");
    let mut files: Vec<PathBuf> = files.map(|file| file.expect("a file").path()).collect();
    files.retain(|file| file.extension().is_none_or(|extension| extension != "expected"));
    files.sort();
    assert_eq!(files.len(), 5 * 13 + 8, "files in all forms");
    for file in &files {
        let table = read(file, Bound::TARGETS, &Form::default());
        let table = table.unwrap_or_else(|error| panic!("{error}"));
        check(file, &table);
    }
}

#[test]
fn the_six_tables_are_read_as_they_lie_there() {
    let Some(stations) = stations() else { return };
    for (name, rows, columns, first) in [
        ("ur10-grid.csv", 615, 20, "Timestamp"),
        ("ur10-random-a.csv", 700, 26, "Timestamp"),
        ("ur10-random-b.csv", 700, 26, "Timestamp"),
        ("wam-grid.csv", 216, 14, "step_order"),
        ("wam-random20.csv", 20, 14, "step_order"),
        ("positioner.yaml", 205, 10, "key"),
    ] {
        let table = read(&stations.join(name), Bound::TARGETS, &Form::default());
        let table = table.unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(table.row_count(), rows, "{name}");
        assert_eq!(table.columns().len(), columns, "{name}: {:?}", table.columns());
        assert_eq!(table.columns()[0], first, "{name}");
    }
    let positioner = read(&stations.join("positioner.yaml"), Bound::TARGETS, &Form::default());
    let positioner = positioner.expect("a table");
    for name in ["pose.qw", "pose.x", "target_joints[0]", "target_joints[1]"] {
        assert!(positioner.column(name).is_some(), "{name}: {:?}", positioner.columns());
    }
    let grid = read(&stations.join("ur10-grid.csv"), Bound::TARGETS, &Form::default());
    let grid = grid.expect("a table");
    let elbow = grid.column("elbow_joint").expect("a column");
    assert_eq!(grid.cell(0, elbow), Cell::Number(-1.128_429_999_999_999_8));
    assert_eq!(grid.line(0), 2);
}

/// Reads bytes under a name and looks at every cell; tells how that went.
fn tried(bytes: &[u8], ending: &str) -> String {
    let bound = Bound { bytes: 1 << 24, advice: "split it" };
    let mut file = tempfile::Builder::new().suffix(ending).tempfile().expect("a file");
    std::io::Write::write_all(&mut file, bytes).expect("room");
    match read(file.path(), bound, &Form::default()) {
        Err(error) => error.kind.to_string(),
        Ok(table) => {
            let texts = (0..table.row_count()).flat_map(|row| {
                assert!(table.line(row) > 0);
                (0..table.columns().len()).map(move |column| (row, column))
            });
            let texts = texts.filter(|&(row, column)| match table.cell(row, column) {
                Cell::Number(number) => {
                    assert!(!number.is_infinite());
                    false
                }
                Cell::Text(text) => !text.is_empty(),
                Cell::Blank => false,
            });
            let remarks = table.remarks.join(" ");
            format!("{remarks} texts {} units {}", texts.count() > 0, table.units.is_some())
        }
    }
}

#[test]
fn workbooks_of_other_kinds_are_to_be_saved_anew() {
    let ods = b"PK\x03\x04mimetypeapplication/vnd.oasis.opendocument.spreadsheet";
    let xls = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1";
    for (bytes, ending) in [(&ods[..], ".ods"), (&ods[..], ".xlsx"), (&xls[..], ".xls")] {
        let told = tried(bytes, ending);
        assert!(told.contains("save it as .xlsx or .csv"), "{ending}: {told}");
    }
}

#[test]
fn texts_changed_at_random_are_tables_or_errors() {
    let seeds = [
        "Arm;;\nstation;x;y\n;[mm];[mm]\nP1;1,5;2\nP2;-3;\"4,5\"\n",
        "# station x y\n1 1.5 2\n2 nan 3e5\n",
        "a,b\n1,2\n3,4,5\n",
        "x|y\r1|2\r",
    ];
    let seeds = seeds.map(|seed| seed.as_bytes().to_vec()).to_vec();
    fuzz::fuzz("measured_text", seeds, fuzz::change_words, |bytes| tried(bytes, ".csv"));
}

#[test]
fn json_changed_at_random_is_a_table_or_an_error() {
    let seeds = [
        r#"[{"a": 1.5, "q": [1, 2], "p": {"x": null}}, {"a": "t", "q": [3]}]"#,
        "{\"a\": 1}\n{\"a\": -2e3}\n",
        r#"{"x": [1, 2], "y": ["a", true]}"#,
        r#"{"7": {"x": 1}, "8": {"x": 2}}"#,
    ];
    let seeds = seeds.map(|seed| seed.as_bytes().to_vec()).to_vec();
    fuzz::fuzz("measured_json", seeds, fuzz::change_words, |bytes| tried(bytes, ".json"));
}

#[test]
fn yaml_changed_at_random_is_a_table_or_an_error() {
    let seeds = [
        "'7':\n  a: &a {x: 1, q: [1, 2]}\n'8':\n  a:\n    <<: *a\n    x: .nan\n",
        "- x: 1\n  y: 'a'\n- x: ~\n",
        "---\nx: 1\n---\nx: |\n  2\n...\n",
    ];
    let seeds = seeds.map(|seed| seed.as_bytes().to_vec()).to_vec();
    fuzz::fuzz("measured_yaml", seeds, fuzz::change_words, |bytes| tried(bytes, ".yaml"));
}
