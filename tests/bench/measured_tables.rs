//! How long a table of measured values takes to read: `cargo bench --bench measured_tables`. 100,000 rows of 25 columns, with point
//! and comma, once as cells (asked: 0.25 s on one core) and once by the `csv` crate into records of strings, which is the ratio's
//! floor. Then 100,000 rows of six joints and one point, and of three points side by side, from the file to stations (asked: 0.5 s).
//! Medians of nine rounds, seconds of processor. Without `--bench` (as `cargo test` calls it) a small table shows that it works.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use posegrid::files::input::Bound;
use posegrid::files::measured_table::{Form, read};
use posegrid::ingest::StationsSettings;
use posegrid::io::station_table::{self, Whose};
use posegrid::join::JoinSettings;
use posegrid::join::tabled::tabled;
use posegrid::kinematics::{Arm, RobotFile};

const COLUMNS: usize = 25;

fn main() {
    let is_bench = std::env::args().any(|arg| arg == "--bench");
    let (rows, rounds) = if is_bench { (100_000, 9) } else { (1000, 1) };
    let folder = tempfile::tempdir().expect("a temporary folder");
    println!("{rows} rows of {COLUMNS} columns            cells, s  records, s  ratio");
    for (name, separator, decimal) in [("point.csv", ',', '.'), ("comma.csv", ';', ',')] {
        let path = folder.path().join(name);
        fs::write(&path, text(rows, separator, decimal)).expect("room for a table");
        let bytes = fs::metadata(&path).expect("a file").len();
        let mut cells = Vec::new();
        let mut records = Vec::new();
        for _ in 0..rounds {
            cells.push(seconds(|| as_cells(&path, rows)));
            records.push(seconds(|| as_records(&path, separator)));
        }
        let (cells, records) = (median(cells), median(records));
        let size = bytes as f64 / 1e6;
        println!(
            "{name:<12} {size:>6.1} MB {cells:>24.3} {records:>11.3} {:>6.2}",
            cells / records.max(1e-9)
        );
    }
    to_stations(folder.path(), rows, rounds);
}

/// Places of the reflectors at the flange, mm.
const REFLECTORS: [[f64; 3]; 3] = [[60.0, 20.0, 90.0], [-40.0, 70.0, 80.0], [-20.0, -60.0, 120.0]];

/// Measures tables of so many stations, from the file to stations.
fn to_stations(folder: &Path, rows: usize, rounds: usize) {
    println!("{rows} rows to stations              read, s    join, s   whole, s");
    let arm = arm();
    for reflectors in [1, 3] {
        let path = folder.join(format!("stations-{reflectors}.csv"));
        fs::write(&path, stations(&arm, rows, reflectors)).expect("room for a table");
        let settings = section(reflectors);
        let (mut reading, mut joining) = (Vec::new(), Vec::new());
        for _ in 0..rounds {
            let before = cpu_seconds();
            let table = station_table::read(&path, &settings, &Whose::default(), &[], Bound::TABLE);
            let table = table.expect("a table of stations");
            let between = cpu_seconds();
            let joined = tabled(table.rows, &arm, &JoinSettings::default());
            joining.push(cpu_seconds() - between);
            reading.push(between - before);
            assert_eq!(joined.counts.kept, (rows * reflectors) as u64);
        }
        let (reading, joining) = (median(reading), median(joining));
        let whole = reading + joining;
        println!("{reflectors} reflectors {reading:>28.3} {joining:>10.3} {whole:>10.3}");
    }
}

fn arm() -> Arm {
    let text = fs::read_to_string("pipelines/robots/ur10.toml").expect("a robot file");
    let file: RobotFile = toml::from_str(&text).expect("a robot file");
    file.arm().expect("an arm")
}

/// `[stations]` of a table with so many reflectors.
fn section(reflectors: usize) -> StationsSettings {
    let joints: Vec<String> = (1..=6).map(|joint| format!("\"q{joint}\"")).collect();
    let mut text =
        format!("station = \"station\"\njoints = [{}]\njoint_unit = \"deg\"\n", joints.join(", "));
    for own in 0..reflectors {
        let _ = writeln!(
            text,
            "[[measured]]\nname = \"T{own}\"\nposition = [\"x{own}\", \"y{own}\", \"z{own}\"]\nunit = \"mm\""
        );
    }
    toml::from_str(&text).expect("a section")
}

/// A table of the nominal arm's stations: names, joints in degrees and positions in mm, in the frame of the base.
fn stations(arm: &Arm, rows: usize, reflectors: usize) -> String {
    let mut text = "station,q1,q2,q3,q4,q5,q6".to_owned();
    for own in 0..reflectors {
        let _ = write!(text, ",x{own},y{own},z{own}");
    }
    for row in 0..rows {
        let turn = |joint: usize| {
            ((row + 1) as f64 * [2.0, 3.0, 5.0, 7.0, 11.0, 13.0_f64][joint].sqrt()).fract()
        };
        let joints: Vec<f64> = (0..6).map(|joint| 2.4 * (turn(joint) - 0.5) - 0.4).collect();
        let flange = *arm.flange(&joints).isometry();
        let _ = write!(text, "\nS{row}");
        for angle in &joints {
            let _ = write!(text, ",{:.9}", angle.to_degrees());
        }
        for place in &REFLECTORS[..reflectors] {
            let at = flange * nalgebra::Point3::from(*place);
            let _ = write!(text, ",{:.6},{:.6},{:.6}", at.x, at.y, at.z);
        }
    }
    text.push('\n');
    text
}

/// A table of numbers with 15 digits that look random.
fn text(rows: usize, separator: char, decimal: char) -> String {
    let mut text = String::new();
    let names: Vec<String> = (0..COLUMNS).map(|column| format!("column_{column}")).collect();
    text += &names.join(&separator.to_string());
    let mut state = 1_u64;
    for cell in 0..rows * COLUMNS {
        text.push(if cell % COLUMNS == 0 { '\n' } else { separator });
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let (whole, fraction) = (state >> 54, (state >> 14) % 1_000_000_000_000);
        let sign = if state & 8192 == 0 { "" } else { "-" };
        let _ = write!(text, "{sign}{whole}{decimal}{fraction:012}");
    }
    text.push('\n');
    text
}

fn as_cells(path: &Path, rows: usize) -> usize {
    let table = read(path, Bound::TABLE, &Form::default()).expect("a table");
    assert_eq!((table.row_count(), table.columns().len()), (rows, COLUMNS));
    table.row_count()
}

fn as_records(path: &Path, separator: char) -> usize {
    let separator = u8::try_from(separator).expect("ASCII");
    let reader = csv::ReaderBuilder::new().delimiter(separator).from_path(path);
    let records = reader.expect("a file").into_records();
    let records: Vec<csv::StringRecord> = records.map(|record| record.expect("a record")).collect();
    records.len()
}

/// Seconds of processor that work takes.
fn seconds(work: impl FnOnce() -> usize) -> f64 {
    let before = cpu_seconds();
    std::hint::black_box(work());
    cpu_seconds() - before
}

/// Time of this process on a processor, s.
fn cpu_seconds() -> f64 {
    let times = fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let first = times.split_whitespace().next().unwrap_or_default();
    first.parse::<f64>().unwrap_or_default() / 1e9
}

fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    numbers[numbers.len() / 2]
}
