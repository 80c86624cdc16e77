//! A file of table `corrected_targets` → the commands that drove a session, and the run whose table corrected them;
//! only the columns needed for a comparison are read.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::Point3;
use serde::Deserialize;

use super::{CorrectedRow, Form, TargetsError, TargetsErrorKind, bytes, formula};
use crate::input::Bound;
pub use crate::judgement::DrivingFile;
use crate::manifest::RunKey;
use crate::report::driven::CorrectedTarget;
use crate::rows::{Field as _, Row as _, columns};
use crate::table;

const TABLES: [&str; 2] = ["compensation", "calibrations"];

columns! {
    /// One row; the file has more columns.
    #[derive(Deserialize)]
    pub struct DrivingRow {
        robot: String,
        session: String,
        run: String,
        target: String,
        corrected_by: String,
        x_mm: Option<f64>,
        y_mm: Option<f64>,
        z_mm: Option<f64>,
        target_x_mm: Option<f64>,
        target_y_mm: Option<f64>,
        target_z_mm: Option<f64>,
        correction_cov_xx_mm2: Option<f64>,
        correction_cov_yy_mm2: Option<f64>,
        correction_cov_zz_mm2: Option<f64>,
        /// Files of earlier versions do not have it.
        #[serde(default)]
        correction_frame_sd_mm: Option<f64>,
    }
}

pub fn read(path: &Path, bound: Bound) -> Result<DrivingFile, TargetsError> {
    let rows = match Form::of(path)? {
        Form::Csv => from_csv(path, bound)?,
        Form::Parquet => {
            let table = table::read_within(path, CorrectedRow::schema(), bound)?;
            DrivingRow::all(&table, &[]).collect()
        }
        Form::Json => serde_json::from_slice(&bytes(path, bound)?)
            .map_err(|source| TargetsErrorKind::Json(source).at(path))?,
    };
    let of = rows.iter().map(|row| (&row.robot, &row.session, &row.run, &row.corrected_by));
    let mut of = of.collect::<BTreeSet<_>>().into_iter();
    let empty = || TargetsErrorKind::Empty.at(path);
    let (robot, session, run, table) = of.next().ok_or_else(empty)?;
    if of.next().is_some() {
        return Err(TargetsErrorKind::SeveralTables.at(path));
    }
    if !TABLES.contains(&table.as_str()) {
        return Err(TargetsErrorKind::NotOfATable(table.clone()).at(path));
    }
    // `nan` and `inf` can be written as text.
    if let Some(row) = rows.iter().position(|row| !row.numbers().all(f64::is_finite)) {
        let target = rows[row].target.clone();
        return Err(TargetsErrorKind::NotANumber { row, target }.at(path));
    }
    let targets: Vec<CorrectedTarget> = rows.iter().filter_map(DrivingRow::corrected).collect();
    let (refused, table) = (rows.len() - targets.len(), table.clone());
    Ok(DrivingFile { key: RunKey::new(robot, session, run), table, refused, targets })
}

fn from_csv(path: &Path, bound: Bound) -> Result<Vec<DrivingRow>, TargetsError> {
    let failed = |source| TargetsErrorKind::Csv(source).at(path);
    let bytes = bytes(path, bound)?;
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    reader.deserialize().map(|row| row.map(DrivingRow::unmarked).map_err(failed)).collect()
}

impl DrivingRow {
    /// The row of a CSV file, its texts without what keeps spreadsheets from running them.
    fn unmarked(mut self) -> Self {
        let texts = [&mut self.robot, &mut self.session, &mut self.run, &mut self.target];
        for text in texts {
            *text = formula::unmarked(text).to_owned();
        }
        self
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        let command = [self.x_mm, self.y_mm, self.z_mm];
        let target = [self.target_x_mm, self.target_y_mm, self.target_z_mm];
        let uncertainty = [
            self.correction_cov_xx_mm2,
            self.correction_cov_yy_mm2,
            self.correction_cov_zz_mm2,
            self.correction_frame_sd_mm,
        ];
        command.into_iter().chain(target).chain(uncertainty).flatten()
    }

    /// The target with its command; `None` where it was refused.
    fn corrected(&self) -> Option<CorrectedTarget> {
        let point = |[x, y, z]: [Option<f64>; 3]| Some(Point3::new(x?, y?, z?));
        // A file without covariances states none.
        let axes =
            [self.correction_cov_xx_mm2, self.correction_cov_yy_mm2, self.correction_cov_zz_mm2];
        let stated: f64 = axes.into_iter().flatten().sum();
        let of_frame_mm = self.correction_frame_sd_mm.unwrap_or_default();
        Some(CorrectedTarget {
            name: self.target.clone(),
            target: point([self.target_x_mm, self.target_y_mm, self.target_z_mm])?,
            command: point([self.x_mm, self.y_mm, self.z_mm])?,
            variance_mm2: (stated - of_frame_mm.powi(2)).max(0.0),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::words::CorrectingTable;
    use std::fs;

    use nalgebra::Matrix3;

    use super::super::{CorrectedBy, corrected, write_csv, write_json};
    use crate::compensation::{Corrected, Reason, Refused, Target};
    use crate::geometry::Position;
    use crate::ingest::AngleUnit;

    const HEAD: &str = "robot,session,run,target,corrected_by,x_mm,y_mm,z_mm,target_x_mm,target_y_mm,target_z_mm,\
        correction_cov_xx_mm2,correction_cov_xy_mm2,correction_cov_xz_mm2,correction_cov_yy_mm2,correction_cov_yz_mm2,\
        correction_cov_zz_mm2,note\n";

    fn from(text: &str) -> Result<DrivingFile, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("corrected.csv");
        fs::write(&path, text).expect("writable");
        read(&path, Bound::TARGETS).map_err(|error| error.to_string())
    }

    #[test]
    fn commands_are_read_with_the_run_they_are_of_and_refusals_counted() {
        let file = from(&format!(
            "{HEAD}kr,mon,00ff,A,compensation,1.5,2,3,1,2,3,4,0,0,5,0,6,x\nkr,mon,00ff,B,compensation,,,,7,8,9,,,,,,,y\n"
        ))
        .expect("a good file");
        assert_eq!(file.key, RunKey::new("kr", "mon", "00ff"));
        assert_eq!((file.targets.len(), file.refused, file.table.as_str()), (1, 1, "compensation"));
        assert_eq!(
            file.targets[0].command - file.targets[0].target,
            nalgebra::Vector3::new(0.5, 0.0, 0.0)
        );
        // 4 + 5 + 6; a file of an earlier version does not state the frame's share.
        assert!((file.targets[0].variance_mm2 - 15.0).abs() < 1e-12);
    }

    #[test]
    fn a_number_that_is_none_is_reported_by_row_and_target() {
        let wrong = from(&format!(
            "{HEAD}kr,mon,00ff,A,compensation,1.5,2,3,1,2,3,4,0,0,5,0,6,x\nkr,mon,00ff,B,compensation,nan,2,3,1,2,3,4,0,0,5,0,6,x\n"
        ))
        .unwrap_err();
        assert!(wrong.contains("row 1, target \"B\""), "{wrong}");
    }

    /// One corrected target and one refused, as `compensate` has them.
    fn corrected_table() -> table::Table {
        let target = |name: &str| Target {
            name: name.to_owned(),
            position: Some(Position::claim(Point3::new(1500.0, 20.0, 900.0))),
            ..Target::default()
        };
        let correction = nalgebra::Vector3::new(0.123_456, -0.2, 0.000_001);
        let done = Corrected {
            target: Position::claim(Point3::new(1500.0, 20.0, 900.0)),
            command: Position::claim(Point3::new(1500.0, 20.0, 900.0) + correction),
            orientation: None,
            joints: None,
            correction,
            covariance: Some(Matrix3::new(4e-4, 1e-5, 0.0, 1e-5, 5e-4, -2e-5, 0.0, -2e-5, 6e-4)),
            of_frame: Matrix3::identity() * 3e-4,
            iterations: 2,
            allowed: Vec::new(),
        };
        let refused = Refused { target: "B".to_owned(), reason: Reason::NoOrientation, slip: None };
        let key = RunKey::new("kr", "mon", "00ff");
        let by = CorrectedBy {
            key: &key,
            table_id: "00ff",
            table: CorrectingTable::Calibrations,
            joint_names: &[],
        };
        corrected(&[target("A"), target("B")], &[Ok(done), Err(refused)], by).expect("a table")
    }

    #[test]
    fn what_compensate_writes_is_read_alike_in_every_form() {
        let table = corrected_table();
        let folder = tempfile::tempdir().expect("a folder");
        let written = |name: &str, bytes: Vec<u8>| {
            let path = folder.path().join(name);
            fs::write(&path, bytes).expect("writable");
            read(&path, Bound::TARGETS).expect(name)
        };
        let (mut csv, mut json) = (Vec::new(), Vec::new());
        write_csv(&table, AngleUnit::Deg, &mut csv).expect("CSV");
        write_json(&table, AngleUnit::Deg, &mut json).expect("JSON");
        let parquet = table::write(&table, Vec::new()).expect("Parquet");
        let json = written("corrected.json", json);
        assert_eq!((json.targets.len(), json.refused), (1, 1));
        let moved = json.targets[0].command - json.targets[0].target;
        // Lengths are written to the nanometre.
        assert!((moved - nalgebra::Vector3::new(0.123_456, -0.2, 0.000_001)).norm() < 2e-6);
        assert_eq!(json, written("corrected.csv", csv));
        let parquet = written("corrected.parquet", parquet);
        assert_eq!((json.key, json.table), (parquet.key, parquet.table));
        let apart = json.targets[0].command - parquet.targets[0].command;
        assert!(apart.norm() < 2e-6, "{apart}");
        // 15e-4, of which the surveyed frame has 9e-4.
        for target in [&json.targets[0], &parquet.targets[0]] {
            assert!((target.variance_mm2 - 6e-4).abs() < 1e-7, "{target:?}");
        }
    }

    #[test]
    fn a_file_larger_than_its_limit_is_reported_and_not_read() {
        let folder = tempfile::tempdir().expect("a folder");
        for name in ["corrected.csv", "corrected.json", "corrected.parquet"] {
            let path = folder.path().join(name);
            let sparse = fs::File::create(&path).expect("writable");
            sparse.set_len(6 << 30).expect("no room is taken");
            let limits = crate::log::Limits::default();
            let told = read(&path, Bound::of(limits)).unwrap_err().to_string();
            for part in [name, "6442450944 bytes", "limit of 67108864", "file_bytes in [limits]"] {
                assert!(told.contains(part), "{told}");
            }
        }
    }

    #[test]
    fn names_that_a_spreadsheet_would_run_come_back_as_they_were() {
        let row = "'=kr,'-mon,00ff,'@A,compensation,-1.5,2,3,1,2,3,4,0,0,5,0,6,x\n";
        let file = from(&format!("{HEAD}{row}")).expect("a good file");
        assert_eq!(file.key, RunKey::new("=kr", "-mon", "00ff"));
        assert_eq!(file.targets[0].name, "@A");
        assert_eq!(file.targets[0].command.x.to_string(), "-1.5");
    }

    #[test]
    fn json_of_another_shape_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("corrected.json");
        for text in ["{}", "[{\"target\": \"A\"}]", "[1]", "["] {
            fs::write(&path, text).expect("writable");
            let error = read(&path, Bound::TARGETS).unwrap_err().to_string();
            assert!(error.contains("corrected.json: it cannot be read as JSON"), "{error}");
        }
    }

    #[test]
    fn files_of_two_tables_or_of_none_are_refused() {
        let row =
            |run: &str| format!("kr,mon,{run},A{run},compensation,1.5,2,3,1,2,3,4,0,0,5,0,6,x\n");
        let two = from(&format!("{HEAD}{}{}", row("00ff"), row("00fe"))).unwrap_err();
        assert!(two.contains("several tables"), "{two}");
        assert!(from(HEAD).unwrap_err().contains("holds no target"));
        let nothing = format!("{HEAD}{}", row("00ff").replace("compensation", "stations"));
        assert!(from(&nothing).unwrap_err().contains("corrected by \"stations\""));
        let other = from("target,x_mm\nA,1\n").unwrap_err();
        assert!(other.contains("missing field"), "{other}");
    }
}
