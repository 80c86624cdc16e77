//! A lake of many robots and nights, made from the lake of one run: `cargo bench --bench lake -- FROM TO ROBOTS NIGHTS [FIRST]`.
//!
//! FROM has one run of one session, and what its history keeps (`posegrid history FROM`). TO gets, for each robot and night from FIRST on, the
//! rows of `runs` and `accuracy` and what the history keeps, which is all that `posegrid compact` and `posegrid history` read: no calibration and
//! no page. Errors, verdicts and offsets differ by robot and night, without a random number. Without arguments nothing is measured.

use std::fs;
use std::path::{Path, PathBuf};

use posegrid::files::table::{Table, write};
use posegrid::io::lake::{Lake, figures_key};
use posegrid::io::rows::Row as _;
use posegrid::io::tables::accuracy::AccuracyRow;
use posegrid::io::tables::runs::{Ending, RunRow, row_digest};
use posegrid::io::tables::stage_results::{FileColumns, InputColumns};
use posegrid::io::tables::words::TableVerdict;
use posegrid::manifest::{RunKey, digest};
use posegrid::report::Subject;
use posegrid::units::WallTime;
use rayon::prelude::*;
use serde_json::{Value, json};

/// 2026-01-01 22:00, UTC.
const BEGIN_S: i64 = 1_767_304_800;
const DAY_S: i64 = 86_400;
/// Seconds from the session of one robot to that of the next.
const APART_S: i64 = 90;

fn main() {
    let given: Vec<String> = std::env::args().skip(1).filter(|own| own != "--bench").collect();
    let [from, to, robots, nights, rest @ ..] = &given[..] else {
        println!("lake: nothing is measured without FROM TO ROBOTS NIGHTS");
        return;
    };
    let number = |text: &String| text.parse::<usize>().expect("a number");
    let first = rest.first().map_or(0, number);
    let template = Template::read(from);
    let nights = first..first + number(nights);
    (0..number(robots)).into_par_iter().for_each(|robot| {
        for night in nights.clone() {
            template.put(Path::new(to), robot, night);
        }
    });
}

/// What one run published, and what is kept of it.
struct Template {
    row: RunRow,
    accuracy: Vec<AccuracyRow>,
    kept: Value,
}

impl Template {
    fn read(from: &str) -> Self {
        let lake = Lake::new(from);
        let (_, row) = lake.runs().expect("a lake").swap_remove(0);
        let row = row.expect("a row").table;
        let key = row.key().expect("of one run").clone();
        let accuracy = lake.read("accuracy", &key).expect("its accuracy");
        let kept = figures_key(&key).ok().and_then(|key| lake.kept(&key));
        let kept = kept.expect("posegrid history FROM keeps it");
        Self {
            row: RunRow::read(&row).swap_remove(0),
            accuracy: AccuracyRow::read(&accuracy),
            kept: serde_json::from_str(&kept).expect("JSON"),
        }
    }

    fn put(&self, to: &Path, robot: usize, night: usize) {
        let session = format!("night-{night:04}");
        let name = format!("robot-{robot:03}");
        let run = blake3::hash(format!("{name}/{session}").as_bytes()).to_hex()[..32].to_owned();
        let key = RunKey::new(name, &session, run);
        let [night_i, robot_i] = [night, robot].map(|own| i64::try_from(own).expect("few"));
        let started_s = BEGIN_S + DAY_S * night_i + APART_S * robot_i;
        let started = WallTime::of_us(1_000_000 * started_s);
        let factor = 0.8 + 0.4 * phase(robot, 7) + 0.05 * phase(robot * 31 + night, 11);
        let accuracy = self.accuracy(&key, started, factor);
        let accuracy = save(to, &accuracy, &key);
        let of = [blake3::hash(key.run.as_bytes()).to_hex().to_string(), accuracy];
        let row = self.row(&key, started, factor, &of, (robot, night));
        save(to, &row, &key);
        self.keep(to, &key, &of, started_s, (robot, night));
    }

    fn accuracy(&self, key: &RunKey, started: WallTime, factor: f64) -> Table {
        let own = |row: &AccuracyRow| AccuracyRow {
            subject: Subject { of_session: key.session.clone(), ..row.subject.clone() },
            session_started: Some(started),
            value: row.value.map(|value| factor * value),
            table_id: row.table_id.as_ref().map(|_| key.run.clone()),
            ..row.clone()
        };
        let rows = self.accuracy.iter().map(own).collect();
        AccuracyRow::table(rows, key).expect("a table").table
    }

    fn row(
        &self,
        key: &RunKey,
        started: WallTime,
        factor: f64,
        of: &[String; 2],
        (robot, night): (usize, usize),
    ) -> Table {
        let names = &self.row.files.names;
        let renamed = |name: &String| {
            let table = name.split('/').next().expect("a table");
            format!("{table}/{}", key.session)
        };
        let digest = |name: &String| match name.split('/').next() {
            Some("calibrations") => of[0].clone(),
            Some("accuracy") => of[1].clone(),
            _ => blake3::hash(format!("{name}{}", key.run).as_bytes()).to_hex().to_string(),
        };
        let scaled = |value: Option<f64>| value.map(|value| factor * value);
        let (inputs, ending) = (&self.row.inputs, &self.row.ending);
        let digest_of_input = |name: &String| match name.as_str() {
            "robot" => "00".repeat(32),
            _ => digest(name),
        };
        let unsigned = RunRow {
            sessions: vec![key.session.clone()],
            files: FileColumns {
                names: names.iter().map(renamed).collect(),
                digests: names.iter().map(digest).collect(),
                ..self.row.files.clone()
            },
            inputs: InputColumns {
                digests: inputs.names.iter().map(digest_of_input).collect(),
                ..inputs.clone()
            },
            ending: Ending {
                session_started: Some(started),
                first_session_started: Some(started),
                verdict: match robot % 20 {
                    3 => TableVerdict::NotMet,
                    11 => TableVerdict::NotShown,
                    5 if night % 7 == 6 => TableVerdict::NotMet,
                    _ => TableVerdict::Met,
                },
                mean_before_mm: scaled(ending.mean_before_mm),
                mean_after_mm: scaled(ending.mean_after_mm),
                bound_mm: scaled(ending.bound_mm),
                replaces: None,
                replaced_row_digest: None,
                ..ending.clone()
            },
            row_digest: None,
            ..self.row.clone()
        };
        let table = |row| RunRow::table(vec![row], key).expect("a row").table;
        let signed = Some(row_digest(&table(unsigned.clone())));
        table(RunRow { row_digest: signed, ..unsigned })
    }

    fn keep(
        &self,
        to: &Path,
        key: &RunKey,
        of: &[String; 2],
        started_s: i64,
        (robot, night): (usize, usize),
    ) {
        let mut kept = self.kept.clone();
        kept["of"] = json!(of);
        kept["measured_at_ns"] = json!(1_000_000_000 * started_s);
        // The base moves by a hundredth of a millimetre each night, and of some robots by half a millimetre once.
        let base = kept.pointer_mut("/estimate/base/0").expect("a base");
        let x = f64::from_bits(base.as_u64().expect("bits"));
        let step = if robot % 17 == 4 && night >= 20 { 0.5 } else { 0.0 };
        let x = x + 0.01 * phase(robot * 13 + night, 9) + step;
        *base = json!(x.to_bits());
        let lake = Lake::new(to);
        lake.keep(&figures_key(key).expect("a key"), &kept.to_string()).expect("writable");
    }
}

/// A number from −1 to 1 that follows from another one.
fn phase(number: usize, period: usize) -> f64 {
    (number as f64 * 2.399 + period as f64).sin()
}

/// Writes a table without the waits for the disk that a run has; returns its digest.
fn save(to: &Path, table: &Table, key: &RunKey) -> String {
    let path: PathBuf = to
        .join(&table.schema().table)
        .join(&key.robot)
        .join(&key.session)
        .join(format!("{}.parquet", key.run));
    let bytes = write(table, Vec::new()).expect("a table");
    put(&path, &bytes);
    digest(&bytes[..]).expect("bytes").0
}

fn put(path: &Path, bytes: &[u8]) {
    fs::create_dir_all(path.parent().expect("in a folder")).expect("writable");
    fs::write(path, bytes).expect("writable");
}
