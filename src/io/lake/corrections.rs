//! Records of the files that `posegrid compensate` wrote with the tables of a lake:
//! `corrections/ROBOT/SESSION/CORRECTION.parquet`, created whole and once. A record is no part of a run; its own digest
//! shows whether it is unchanged ([`Correction::of`]), and its name follows from its content.

use std::path::Path;
use std::time::SystemTime;

use super::{Lake, LakeError, Result, file_key, session_key};
use crate::manifest::RunKey;
use crate::rows::{Row as _, Word as _, row};
use crate::schema::KEY_COLUMNS;
use crate::store::Place;
use crate::table::{Table, TableError};
use crate::tables::words::{CorrectedForm, CorrectingTable};

pub const CORRECTIONS: &str = "corrections";

row! {
    pub struct CorrectionRow of "corrections" {
        correction: String,
        corrected_by: CorrectingTable,
        form: CorrectedForm,
        version: String,
        targets_digest: String,
        file_digest: String,
        targets: i64,
        corrected: i64,
        refused: i64,
        x_mm: Vec<f64>,
        y_mm: Vec<f64>,
        z_mm: Vec<f64>,
        joints: usize,
        joints_rad: Vec<f64>,
        digest: String,
    }
}

const NAME: usize = 32;

pub fn is_correction(key: &str) -> bool {
    let parts: Vec<&str> = key.split('/').collect();
    let [CORRECTIONS, _robot, _session, file] = parts[..] else { return false };
    let name = file.strip_suffix(".parquet").unwrap_or_default();
    name.len() == NAME && name.bytes().all(|byte| byte.is_ascii_hexdigit())
}

#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    pub key: RunKey,
    pub corrected_by: CorrectingTable,
    pub form: CorrectedForm,
    pub version: String,
    /// BLAKE3 of the file of targets, hexadecimal.
    pub targets_digest: String,
    /// BLAKE3 of the file written, hexadecimal.
    pub file_digest: String,
    pub targets: i64,
    pub corrected: i64,
    /// Positions commanded, mm, in the frame of commands.
    pub positions: Vec<[f64; 3]>,
    /// Joint angles of the same commands, rad; empty where none were commanded.
    pub joints: Vec<Vec<f64>>,
}

/// The time at which it was written, where the file system states it; an error states why it cannot be read.
pub type Recorded = (Place, Option<SystemTime>, Result<Correction, String>);

impl Correction {
    pub fn table(&self) -> Result<Table, TableError> {
        Ok(CorrectionRow::table(vec![self.row()], &self.key)?.table)
    }

    fn row(&self) -> CorrectionRow {
        let axis = |axis: usize| self.positions.iter().map(|p| p[axis]).collect();
        let digest = self.digest();
        CorrectionRow {
            correction: digest[..NAME].to_owned(),
            corrected_by: self.corrected_by,
            form: self.form,
            version: self.version.clone(),
            targets_digest: self.targets_digest.clone(),
            file_digest: self.file_digest.clone(),
            targets: self.targets,
            corrected: self.corrected,
            refused: self.targets.saturating_sub(self.corrected),
            x_mm: axis(0),
            y_mm: axis(1),
            z_mm: axis(2),
            joints: self.joints.first().map_or(0, Vec::len),
            joints_rad: self.joints.concat(),
            digest,
        }
    }

    /// The record in a table; an error states what is wrong with it.
    pub fn of(table: &Table) -> Result<Self, String> {
        let rows = CorrectionRow::read(table);
        let [row] = &rows[..] else {
            return Err(format!("it has {} rows, and a record has one", rows.len()));
        };
        let [robot, session, run] = KEY_COLUMNS.map(|part| table.text(part).value(0));
        let [x, y, z] = [&row.x_mm, &row.y_mm, &row.z_mm];
        let positions = x.iter().zip(y).zip(z).map(|((&x, &y), &z)| [x, y, z]);
        let record = Self {
            key: RunKey::new(robot, session, run),
            corrected_by: row.corrected_by,
            form: row.form,
            version: row.version.clone(),
            targets_digest: row.targets_digest.clone(),
            file_digest: row.file_digest.clone(),
            targets: row.targets,
            corrected: row.corrected,
            positions: positions.collect(),
            joints: match row.joints {
                0 => Vec::new(),
                joints => row.joints_rad.chunks(joints).map(<[f64]>::to_vec).collect(),
            },
        };
        // Lists that were edited to other lengths come out otherwise, as a digest does that is not the record's.
        if record.row() == *row {
            Ok(record)
        } else {
            Err("its row is not the one that was written: its digest is different".to_owned())
        }
    }

    fn file_key(&self) -> Result<String> {
        let folder = session_key(CORRECTIONS, &self.key)?;
        Ok(format!("{folder}/{}.parquet", &self.digest()[..NAME]))
    }

    fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new();
        // Each text is hashed with its length: ("ab", "c") and ("a", "bc") are different records.
        let mut add = |bytes: &[u8]| {
            hasher.update(&(bytes.len() as u64).to_le_bytes());
            hasher.update(bytes);
        };
        let RunKey { robot, session, run } = &self.key;
        let texts = [
            robot,
            session,
            run,
            self.corrected_by.word(),
            self.form.word(),
            &self.version,
            &self.targets_digest,
            &self.file_digest,
        ];
        for text in texts {
            add(text.as_bytes());
        }
        add(&self.targets.to_le_bytes());
        add(&self.corrected.to_le_bytes());
        add(&(self.positions.len() as u64).to_le_bytes());
        let bytes = |numbers: &[f64]| numbers.iter().flat_map(|n| n.to_le_bytes()).collect();
        let mut list = |numbers: &[f64]| {
            let bytes: Vec<u8> = bytes(numbers);
            add(&bytes);
        };
        self.positions.iter().for_each(|position| list(position));
        self.joints.iter().for_each(|joints| list(joints));
        hasher.finalize().to_hex().to_string()
    }
}

impl Lake {
    /// The lake in a folder that holds a file `TABLE/ROBOT/SESSION/RUN.parquet` next to `runs`; `None` where the file
    /// is elsewhere, or has another name than its run's.
    pub fn around(file: &Path, table: &str, key: &RunKey) -> Option<Self> {
        let real = file.canonicalize().ok()?;
        let root = real.ancestors().nth(4)?;
        let own = file_key(table, key).ok()?;
        (root.join("runs").is_dir() && root.join(own) == real).then(|| Self::new(root))
    }

    /// Sorted by robot, session and name; one that cannot be read does not stop the others.
    pub fn corrections(&self) -> Result<Vec<Recorded>> {
        let listed = self.store.list(CORRECTIONS, 2..=2)?.into_iter();
        let keys = listed.map(|listed| listed.key);
        let records = keys.filter(|key| is_correction(key)).map(|key| {
            let place = self.store.place(&key);
            let modified = |path: &Path| path.metadata().and_then(|own| own.modified()).ok();
            let written = place.as_path().and_then(modified);
            let record = self.correction(&key);
            (place, written, record)
        });
        Ok(records.collect())
    }

    /// The record of a key; an error states why the file there is no valid record.
    pub fn correction(&self, key: &str) -> Result<Correction, String> {
        let text = |error: LakeError| error.to_string();
        let table = self.read_key(key, CorrectionRow::schema()).map_err(text)?;
        let record = Correction::of(&table)?;
        let own = record.file_key().map_err(text)?;
        if own == key { Ok(record) } else { Err(format!("its content is that of {own}")) }
    }

    /// Records a correction; returns whether it was not recorded yet.
    pub fn record(&self, correction: &Correction) -> Result<bool> {
        let table = correction.table().map_err(|source| LakeError::Record { source })?;
        let key = correction.file_key()?;
        if self.store.exists(&key)? {
            return Ok(false);
        }
        let (temporary, _) = self.write(&table, &key)?;
        Ok(self.store.create(&key, temporary)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::Columns;

    fn sample() -> Correction {
        Correction {
            key: RunKey::new("kr 210", "mon", "00ff"),
            corrected_by: CorrectingTable::Calibrations,
            form: CorrectedForm::Krl,
            version: "0.1.0".to_owned(),
            targets_digest: "aa".to_owned(),
            file_digest: "bb".to_owned(),
            targets: 3,
            corrected: 2,
            positions: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.5]],
            joints: vec![vec![0.1; 6], vec![0.2; 6]],
        }
    }

    #[test]
    fn a_record_is_created_once_and_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let lake = Lake::new(folder.path());
        assert!(lake.corrections().unwrap().is_empty());
        let no_joints = Correction { joints: Vec::new(), ..sample() };
        assert!(lake.record(&sample()).unwrap());
        assert!(!lake.record(&sample()).unwrap(), "the same once more");
        assert!(lake.record(&no_joints).unwrap());
        let mut records: Vec<_> = lake.corrections().unwrap();
        records.sort_by_key(|(_, _, record)| record.as_ref().unwrap().joints.len());
        let found: Vec<_> = records.iter().map(|(_, _, record)| record.clone()).collect();
        assert_eq!(found, [Ok(no_joints), Ok(sample())]);
        let (place, written, _) = &records[0];
        assert!(written.is_some());
        let key = place.as_path().unwrap().strip_prefix(folder.path()).unwrap();
        assert!(is_correction(&key.to_string_lossy()), "{key:?}");
        assert!(key.starts_with("corrections/kr%20210/mon"), "{key:?}");
    }

    #[test]
    fn a_row_that_was_edited_is_reported() {
        let table = sample().table().unwrap();
        assert_eq!(Correction::of(&table), Ok(sample()));
        let edited = [
            Columns::like(&table).same("x_mm", vec![1.0, 4.1]),
            Columns::like(&table).same("x_mm", vec![1.0]),
            Columns::like(&table).same("file_digest", "bc"),
            Columns::like(&table).same("refused", 0_i64),
            Columns::like(&table).same("joints", 5_i64),
            Columns::like(&table).same("correction", "00"),
        ];
        for edited in edited {
            let told = Correction::of(&edited.finish().unwrap()).unwrap_err();
            assert!(told.contains("its digest is different"), "{told}");
        }
    }

    #[test]
    fn keys_of_records_are_known_and_no_others() {
        let name = "0123456789abcdef0123456789abcdef";
        assert!(is_correction(&format!("corrections/r/s/{name}.parquet")));
        for other in [
            format!("corrections/r/{name}.parquet"),
            format!("corrections/r/s/t/{name}.parquet"),
            format!("compensation/r/s/{name}.parquet"),
            format!("corrections/r/s/{name}.csv"),
            "corrections/r/s/zz.parquet".to_owned(),
        ] {
            assert!(!is_correction(&other), "{other}");
        }
    }
}
