//! Files that somebody gives, besides logs, changed at random: targets of each form, corrected targets, and tables.
//!
//! `POSEGRID_FUZZ_SECONDS=600 cargo test --release --test run compensate::fuzz::` takes ten minutes for each target. What is
//! read must be whole (every target has a place, all numbers are finite, no name twice), and what is written of it must be
//! known as corrected.

#[path = "../../common/fuzz.rs"]
mod harness;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Vector3};
use posegrid::cli::compensate::program::ProgramArgs;
use posegrid::cli::compensate::{self, CompensateArgs, UsedWithArgs};
use posegrid::cli::export::{self, ExportArgs, ExportFormat};
use posegrid::compensation::Exception;
use posegrid::compensation::{Corrected, Refused, Target};
use posegrid::files::input::Bound;
use posegrid::files::schema;
use posegrid::files::table;
use posegrid::geometry::Position;
use posegrid::ingest::AngleUnit;
use posegrid::io::tables::words::CorrectingTable;
use posegrid::io::targets::{self, CorrectedBy, Targets, driving};
use posegrid::manifest::RunKey;

use super::cell::{Cell, SAMPLE, Sample};
use super::quickstart::quickstart;
use harness::{change, change_words, fuzz};

const CSV: &str = "target,x_mm,y_mm,z_mm,qx,qy,qz,qw,configuration,tool,q1_deg,q2_deg,note\n\
A,749.7,20,450,0,0,0,1,\"shoulder+ elbow- wrist+\",drill,1,2,x\n\"b, \"\"2\"\"\",652.5,-20.25,555.1,,,,,,,,,\n'=1,1,2,3,,,,,,,,,\n";
const JSON: &str = r#"{"part": 7, "targets": [{"target": "A", "x_mm": 749.7, "y_mm": 20, "z_mm": 450, "q1_deg": 1},
{"target": "b", "x_mm": 652.5, "y_mm": -20.25, "z_mm": 5e2, "qx": 0, "qy": 0, "qz": 0, "qw": 1, "note": {"table_id": null}}]}"#;
/// A folder with one file that changes.
struct Place {
    folder: tempfile::TempDir,
    name: &'static str,
}

impl Place {
    fn new(name: &'static str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        Self { folder, name }
    }

    fn with(&self, bytes: &[u8]) -> PathBuf {
        let path = self.folder.path().join(self.name);
        fs::write(&path, bytes).expect("writable");
        path
    }
}

fn moved(target: &Target) -> Corrected {
    let place = target.position.unwrap_or_else(|| Position::claim([0.0; 3].into()));
    let by = Vector3::new(0.125, -0.25, 0.5);
    Corrected {
        target: place,
        command: Position::claim(place.point() + by),
        orientation: target.orientation,
        joints: None,
        correction: by,
        covariance: Some(Matrix3::identity()),
        of_frame: Matrix3::zeros(),
        iterations: 1,
        allowed: Vec::new(),
    }
}

/// What holds of every file that is read as targets.
fn check(found: &Targets) {
    let names: BTreeSet<&str> = found.targets.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names.len(), found.targets.len());
    for target in &found.targets {
        let place = target.position.iter().flat_map(|own| own.point().coords.iter());
        let angles = target.joints.iter().flat_map(|own| &own.angles);
        assert!(place.chain(angles).all(|number| number.is_finite()));
        assert!(target.position.is_some() || target.joints.is_some());
    }
}

/// Writes commands for the targets in all forms: each is read as what drove a session, and refused as targets.
fn check_corrected(found: &Targets) {
    let outcomes: Vec<Result<_, Refused>> =
        found.targets.iter().map(|own| Ok(moved(own))).collect();
    let key = RunKey::new("=robot", "mon", "00ff");
    let by = CorrectedBy {
        key: &key,
        table_id: "00ff",
        table: CorrectingTable::Calibrations,
        joint_names: &[],
    };
    let Ok(result) = targets::corrected(&found.targets, &outcomes, by) else {
        return; // Places so far out that sums of them are no numbers.
    };
    let (mut csv, mut json) = (Vec::new(), Vec::new());
    targets::write_csv(&result, AngleUnit::Deg, &mut csv).expect("CSV");
    targets::write_json(&result, AngleUnit::Deg, &mut json).expect("JSON");
    let parquet = table::write(&result, Vec::new()).expect("Parquet");
    for (name, bytes) in [("c.csv", csv), ("c.json", json), ("c.parquet", parquet)] {
        let path = Place::new(name);
        let path = path.with(&bytes);
        let told = targets::read(&path).expect_err("corrected already").to_string();
        assert!(told.contains("corrected already"), "{name}: {told}");
        let drove = driving::read(&path, Bound::TARGETS).expect(name);
        assert_eq!((drove.key.robot.as_str(), drove.targets.len()), ("=robot", outcomes.len()));
        for (was, is) in found.targets.iter().zip(&drove.targets) {
            // Readers of CSV take blanks off both ends of a cell.
            assert_eq!(was.name.trim(), is.name.trim(), "{name}");
        }
    }
}

fn told(error: &impl std::fmt::Display) -> String {
    error.to_string()
}

fn read_targets(path: &Path) -> String {
    match targets::read(path) {
        Err(error) => told(&error),
        Ok(found) => {
            check(&found);
            check_corrected(&found);
            format!("read {} {:?}", found.targets.is_empty(), found.unused)
        }
    }
}

#[test]
fn targets_csv() {
    let place = Place::new("targets.csv");
    fuzz("targets_csv", vec![CSV.into()], change_words, |bytes| read_targets(&place.with(bytes)));
}

#[test]
fn targets_json() {
    let place = Place::new("targets.json");
    fuzz("targets_json", vec![JSON.into()], change_words, |bytes| read_targets(&place.with(bytes)));
}

/// Targets as Parquet, of other writers' types too.
fn parquet_targets() -> Vec<Vec<u8>> {
    let place = Place::new("targets.csv");
    let found = targets::read(&place.with(CSV.as_bytes())).expect("sound");
    let rows = found.targets.len();
    let schema = schema::find("targets").expect("a schema");
    let columns = table::Columns::new(schema, rows)
        .column("target", found.targets.iter().map(|own| &own.name))
        .group(
            ["x_mm", "y_mm", "z_mm"],
            found.targets.iter().map(|own| own.position.map(|p| p.coords().into())),
        )
        .group::<4, Option<[f64; 4]>>(
            ["qx", "qy", "qz", "qw"],
            found.targets.iter().map(|own| own.orientation.map(|q| q.coords.into())),
        )
        .column(
            "joints_rad",
            found.targets.iter().map(|own| Some(own.joints.as_ref()?.angles.clone())),
        );
    let whole = columns.rest_absent().finish().expect("a table");
    vec![table::write(&whole, Vec::new()).expect("Parquet")]
}

#[test]
fn targets_parquet() {
    let place = Place::new("targets.parquet");
    fuzz("targets_parquet", parquet_targets(), change, |bytes| read_targets(&place.with(bytes)));
}

/// Corrected targets in each form, as `compensate` writes them: the form's letter, then the file.
fn corrected_seeds() -> Vec<Vec<u8>> {
    let cell = Cell::new(&SAMPLE);
    fs::write(cell.path("t.csv"), "target,x_mm,y_mm,z_mm\n=A,751,20,450\nfar,950.5,20,450\n")
        .expect("writable");
    let seed = |(letter, name): (u8, &str)| {
        cell.compensate("t.csv", Some(name)).expect("corrected");
        [vec![letter], fs::read(cell.path(name)).expect("there")].concat()
    };
    [(b'c', "o.csv"), (b'j', "o.json"), (b'p', "o.parquet")].map(seed).into()
}

#[test]
fn corrected_targets() {
    let places = ["o.csv", "o.json", "o.parquet"].map(Place::new);
    let changed = |bytes: &mut Vec<u8>, others: &[Vec<u8>], chance: &mut harness::Chance| {
        if bytes.first() == Some(&b'p') {
            change(bytes, others, chance);
        } else {
            change_words(bytes, others, chance);
        }
    };
    fuzz("corrected_targets", corrected_seeds(), changed, |bytes| {
        let Some((letter, bytes)) = bytes.split_first() else {
            return "nothing".to_owned();
        };
        let place = &places[usize::from(*letter) % places.len()];
        match driving::read(&place.with(bytes), Bound::TARGETS) {
            Err(error) => told(&error),
            Ok(found) => {
                let numbers = found.targets.iter().flat_map(|own| own.command.coords.iter());
                assert!(numbers.clone().all(|number| number.is_finite()));
                format!("read {} {}", found.table, found.targets.is_empty())
            }
        }
    });
}

/// Tables of a run: the nodes of the sample, and all of a session.
fn tables() -> Vec<Vec<u8>> {
    let sample = |sample: &Sample| fs::read(Cell::new(sample).table).expect("there");
    let mut seeds = vec![sample(&SAMPLE)];
    let done = quickstart();
    for table in ["calibrations", "joint_errors", "residuals", "compensation", "grid_steps"] {
        let bytes = fs::read(done.folder.join(done.table(table))).expect("there");
        // Longer inputs only take longer; what is cut off a Parquet file is its description.
        if bytes.len() <= harness::LONGEST {
            seeds.push(bytes);
        }
    }
    assert!(seeds.len() > 2, "{} tables are short enough", seeds.len());
    seeds
}

#[test]
fn tables_given_by_hand() {
    let place = Place::new("table.parquet");
    let targets = place.folder.path().join("targets.csv");
    fs::write(&targets, "target,x_mm,y_mm,z_mm\nA,751,20,450\nB,1575,33,961\n").expect("writable");
    let formats = [ExportFormat::Csv, ExportFormat::Urdf];
    fuzz("tables_given_by_hand", tables(), change, |bytes| {
        let table = place.with(bytes);
        let args = CompensateArgs {
            table: table.clone(),
            targets: targets.clone(),
            out: None,
            allow: vec![Exception::NotMet, Exception::NotShown],
            no_record: false,
            no_covariance: false,
            lake: None,
            session: None,
            by: None,
            used_with: UsedWithArgs::default(),
            program: ProgramArgs::default(),
        };
        let mut outcome = match compensate::run(&args, Vec::new()) {
            Err(error) => told(&error),
            Ok(done) => done.to_string(),
        };
        for format in formats {
            let args = ExportArgs {
                table: table.clone(),
                format,
                out: None,
                convention: None,
                urdf: None,
                base: None,
                tip: None,
            };
            if let Err(error) = export::run(&args) {
                outcome += &told(&error);
            }
        }
        outcome
    });
}
