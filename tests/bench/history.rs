//! How long a history takes: `cargo bench --bench history`. A lake of 10,000 sessions of one robot (asked: 1 s on two cores), once
//! from nothing and then from what was kept; beside it the floor, reading and digesting every row of `runs`. The sessions carry
//! a geometric model of 36 unknowns; full error models take some 70 ms each the first time, and the same time from what was kept.
//!
//! `cargo bench --bench history -- 365 200` has so many sessions of each of so many robots, and at the end one more of each (asked: 30 s).

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use posegrid::files::schema::{self, ColumnType};
use posegrid::files::table::{Columns, Table, write};
use posegrid::fit::saved::SavedCalibration;
use posegrid::fit::{self, FitSettings, Freedom, Noise, Source, TrackerUncertainty};
use posegrid::io::lake::Lake;
use posegrid::io::tables::runs::{self, Ending};
use posegrid::io::tables::words::{TableVerdict, VerdictOf};
use posegrid::join::ReadingKind;
use posegrid::kinematics::{Arm, RobotFile};
use posegrid::manifest::{Input, RunKey, Work, Written, digest};
use posegrid::pipeline::history::{Asked, history};
use posegrid::progress::Quiet;
use posegrid::simulate::{Poses, SimulateSettings, simulate};
use posegrid::units::WallTime;
use rayon::prelude::*;

fn main() {
    let mut asked = std::env::args().filter_map(|arg| arg.parse().ok());
    let is_bench = std::env::args().any(|arg| arg == "--bench");
    let sessions: usize = asked.next().unwrap_or(if is_bench { 10_000 } else { 20 });
    let robots: usize = asked.next().unwrap_or(1);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let lake = Lake::new(folder.path());
    let model = model();
    (0..robots * sessions)
        .into_par_iter()
        .for_each(|place| put(&lake, place / sessions, place % sessions, &model));
    println!("{sessions} sessions of each of {robots} robots");
    let asked = |name: &str, sessions: usize| {
        let found =
            measured(name, || history(&lake, &Asked::default(), &Quiet).expect("a history"));
        for own in &found {
            assert_eq!((own.sessions.len(), own.left_out.len()), (sessions, 0));
        }
        let kept: usize = found.iter().map(|own| own.from_summary).sum();
        println!("  {kept} of them kept");
    };
    for name in ["from nothing", "from what was kept", "again", "again"] {
        asked(name, sessions);
    }
    (0..robots).into_par_iter().for_each(|robot| put(&lake, robot, sessions, &model));
    asked("one more of each robot", sessions + 1);
    let bytes = measured("rows of runs read and digested", || files(&folder.path().join("runs")));
    println!("  {:.1} MB", bytes as f64 / 1e6);
}

fn measured<T>(name: &str, work: impl FnOnce() -> T) -> T {
    let (begin, before) = (Instant::now(), cpu_seconds());
    let done = work();
    let (wall, cpu) = (begin.elapsed().as_secs_f64(), cpu_seconds() - before);
    println!("{name:<32} {wall:>8.2} s, {cpu:>8.2} s of processor");
    done
}

/// User and system time of this process, s.
fn cpu_seconds() -> f64 {
    let stat = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // Fields 14 and 15, counted behind the command's closing parenthesis, in hundredths of a second.
    let fields = stat.rsplit(')').next().unwrap_or("").split_whitespace();
    let ticks = fields.skip(11).take(2).map(|ticks| ticks.parse().unwrap_or(f64::NAN));
    ticks.sum::<f64>() / 100.0
}

fn files(folder: &Path) -> usize {
    let inside = |folder: &Path| -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).expect("readable");
        entries.map(|own| own.expect("readable").path()).collect()
    };
    let robots = inside(folder);
    let sessions: Vec<PathBuf> = robots.iter().flat_map(|robot| inside(robot)).collect();
    let of = |session: &PathBuf| -> usize {
        let rows = fs::read_dir(session)
            .expect("readable")
            .map(|row| fs::read(row.expect("readable").path()).expect("readable"));
        rows.map(|bytes| {
            let _ = blake3::hash(&bytes);
            bytes.len()
        })
        .sum()
    };
    sessions.par_iter().map(of).sum()
}

/// A geometric calibration of a KR 210 as a run publishes it; the session's name stands for `SESSION`.
fn model() -> String {
    let text = fs::read_to_string("pipelines/robots/kr210-r2700-extra.toml").expect("a robot file");
    let arm: Arm = toml::from_str::<RobotFile>(&text).expect("a robot file").arm().expect("an arm");
    let home: Vec<f64> = [0.0_f64, -75.0, 95.0, 0.0, 60.0, 0.0].map(f64::to_radians).to_vec();
    let around = |side: f64| home.iter().map(|q| q + side * 0.6).collect();
    let poses = Poses::Joints { count: 80, lower: around(-1.0), upper: around(1.0) };
    let simulated =
        simulate(&arm, &SimulateSettings::realistic(1, home.clone(), poses)).expect("in reach");
    let tracker = TrackerUncertainty {
        range_um: 10.0,
        range_um_per_m: 0.3,
        transverse_um: 15.0,
        transverse_um_per_m: 6.0,
        divisor: 2.0,
        orientation_rad: None,
    };
    let noise =
        Noise::of_one(Source { reads: ReadingKind::Point, uncertainty: tracker.into() }, 0.03);
    let seen = fit::observations(0, &simulated.stations(), &arm, &noise);
    let fitted =
        fit::identify(&arm, &seen, 1, Freedom::Geometry, &FitSettings::default()).expect("a fit");
    serde_json::to_string(&SavedCalibration::of(&fitted, &arm, &["SESSION"])).expect("JSON")
}

/// Writes what the history reads of one session, without the waits for the disk that a run has.
fn put(lake: &Lake, robot: usize, number: usize, model: &str) {
    let session = format!("s{number:06}");
    let work = Work {
        robot: format!("kr210-{robot:03}"),
        session: session.clone(),
        pipeline: "nightly".to_owned(),
        sessions: vec![session.clone()],
        test_sessions: Vec::new(),
        inputs: vec![Input { name: "robot".to_owned(), bytes: 1, digest: "00".repeat(32) }],
        // As long as the settings of a real run.
        settings: format!("{{\"settings\":\"{}\"}}", "x".repeat(2600)),
    };
    let key = work.key();
    let stamp = i64::try_from(number).expect("few sessions");
    let clocks =
        filled("clocks", 1, &key, |columns| (columns.same("origin_ns", stamp), vec!["origin_ns"]));
    let own = model.replace("SESSION", &session);
    let calibrations = filled("calibrations", 1, &key, |columns| {
        (columns.same("model_kind", "geometric").same("model", own), vec!["model_kind", "model"])
    });
    let names = ["mean", "p95"];
    let accuracy = filled("accuracy", 2, &key, |columns| {
        let columns = columns
            .same("split", "blocks")
            .same("model", "base_target")
            .same("role", "held_out")
            .same("of_session", &session)
            .column("name", names)
            .column("value", [Some(0.3 + 1e-3 * (number % 7) as f64), Some(0.6)]);
        (columns, vec!["split", "model", "role", "of_session", "name", "value"])
    });
    let written = [clocks, calibrations, accuracy].map(|table| save(lake, &table, &key));
    let outcome = Ending {
        verdict: TableVerdict::Met,
        verdict_of: Some(VerdictOf::Compensation),
        statement: Some("met by the compensation table".to_owned()),
        ..Ending::default()
    };
    let row = runs::table(&work, &[], &written, &outcome).expect("a row");
    save(lake, &row, &key);
}

fn save(lake: &Lake, table: &Table, key: &RunKey) -> Written {
    let path = lake.place(&table.schema().table, key).expect("a path").named();
    fs::create_dir_all(path.parent().expect("in a folder")).expect("writable");
    let bytes = write(table, Vec::new()).expect("a table");
    fs::write(&path, &bytes).expect("writable");
    Written {
        table: table.schema().table.clone(),
        session: key.session.clone(),
        rows: table.rows() as u64,
        digest: digest(&bytes[..]).expect("bytes").0,
    }
}

/// A table whose other columns hold anything that their contract allows.
fn filled(
    name: &str,
    rows: usize,
    key: &RunKey,
    own: impl FnOnce(Columns) -> (Columns, Vec<&'static str>),
) -> Table {
    let schema = schema::find(name).expect("a table");
    let (mut columns, given) = own(Columns::new(schema, rows).key(key));
    for column in &schema.columns[3..] {
        let name = column.name.as_str();
        if column.nullable || given.contains(&name) {
            continue;
        }
        columns = match column.kind {
            ColumnType::Float64 => columns.same(name, 0.0),
            ColumnType::Int64 => columns.same(name, 0_i64),
            ColumnType::Bool => columns.same(name, false),
            ColumnType::Timestamp => columns.same(name, WallTime::of_us(0)),
            ColumnType::String => {
                columns.same(name, column.values.as_ref().map_or("", |words| words[0].as_str()))
            }
            ColumnType::ListFloat64 => columns.same(name, Vec::<f64>::new()),
            ColumnType::ListInt64 => columns.same(name, Vec::<u64>::new()),
            ColumnType::ListString => columns.same(name, Vec::<String>::new()),
        };
    }
    columns.rest_absent().finish().expect("the contract is kept")
}
