//! Pools of many sessions: old sessions count less where the arm changes, and a pool is the same whatever the number of threads.

use crate::common;

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;
use std::process::{Command, Output};

use common::pool::{MeasuredArm, Truth, frames, of_session, trained};
use common::position;
use nalgebra::Vector3;
use posegrid::files::{schema, table};
use posegrid::fit::Observation;
use posegrid::fit::full::{Day, FullModel, FullSettings, Query, Repair};
use posegrid::units::WallTime;

/// Coarse curves, as those of the simulated arm are: training takes a second.
fn settings() -> FullSettings {
    FullSettings {
        harmonics: 6,
        gear_lines: false,
        drift: false,
        session_scale_ppm: 0.0,
        ..FullSettings::default()
    }
}

/// Three sessions a month, whose curves wander by three tenths of their size in a year.
const SLOW: Truth = Truth { curve_rad: 2e-4, walk_rad: 1e-5, own_rad: 4e-6, days: 11.0 };

/// The mean error in the next session, mm: by a model of all sessions with their dates, of the last ten alone, and of all without dates.
fn next_by(sessions: usize, stations: usize, seed: u64) -> [f64; 3] {
    let mut measured = MeasuredArm::new(SLOW, seed);
    let all: Vec<Observation> = (0..sessions).flat_map(|_| measured.session(stations)).collect();
    let start = frames(&measured.arm, &all[..stations]);
    let last = sessions - 10;
    let undated = |own: &Observation| Observation { day: None, ..own.clone() };
    let latest: Vec<Observation> = all[last * stations..]
        .iter()
        .map(|own| undated(&of_session(own, own.session - last)))
        .collect();
    let even: Vec<Observation> = all.iter().map(undated).collect();
    let arm = measured.arm.clone();
    let poses = measured.poses(300);
    let by = [(&all, sessions - 1), (&latest, 9), (&even, sessions - 1)];
    by.map(|(seen, session)| {
        let model = trained(&arm, seen, &start, &settings());
        measured.error_mm(&model, session, &poses)
    })
}

/// A pool that does not wander.
const STEADY: Truth = Truth { curve_rad: 2e-4, walk_rad: 0.0, own_rad: 1e-5, days: 1.0 };

#[test]
fn old_sessions_count_less_where_the_arm_changes() {
    let errors = next_by(40, 40, 3);
    println!("{errors:.4?}");
    let [dated, latest, even] = errors;
    assert!(dated < latest && dated < even, "{errors:?}");
}

/// The measurement that the chapter on the error model states; minutes.
#[test]
#[ignore = "takes minutes: the figures of the chapter on the error model"]
fn a_hundred_sessions_predict_the_next_better_than_the_last_ten_and_than_all_alike() {
    let (mut better, mut sums) = (0, [0.0; 3]);
    for seed in 1..=20 {
        let errors = next_by(100, 60, seed);
        let [dated, latest, even] = errors;
        println!("{seed:>4} {dated:.4} {latest:.4} {even:.4}");
        better += usize::from(dated < latest && dated < even);
        (0..3).for_each(|k| sums[k] += errors[k] / 20.0);
    }
    println!("mean {sums:.4?}, better on {better} of 20");
    assert!(better >= 16, "{better} of 20");
}

/// Six sessions of an arm, then two with another gear in its third joint.
const BEFORE: usize = 6;
const AFTER: usize = 2;
const REPAIRED: usize = 2;

/// An arm whose third joint is repaired, and its sessions of `stations` stations each.
fn repaired_arm(stations: usize, seed: u64) -> (MeasuredArm, Vec<Observation>) {
    let mut measured = MeasuredArm::new(STEADY, seed);
    let mut seen: Vec<Observation> = Vec::new();
    for session in 0..BEFORE + AFTER {
        if session == BEFORE {
            measured.repair(REPAIRED, 1.5e-3);
        }
        seen.extend(measured.session(stations));
    }
    (measured, seen)
}

/// Settings with the repair of a joint between the sixth session and the seventh.
fn with_repair() -> FullSettings {
    // The days of the sessions are whole.
    let from = WallTime::of_us((20_000 + 6) * 86_400_000_000 - 1);
    FullSettings { repaired: vec![Repair { joint: REPAIRED + 1, from: Day(from) }], ..settings() }
}

#[test]
fn sessions_before_a_repair_say_nothing_of_the_joint_and_what_they_know_of_the_others() {
    const STATIONS: usize = 40;
    let mut better = 0;
    for seed in 1..=5 {
        let (mut measured, seen) = repaired_arm(STATIONS, seed);
        let start = frames(&measured.arm, &seen[..STATIONS]);
        let arm = measured.arm.clone();
        let poses = measured.poses(300);
        let latest = seen[BEFORE * STATIONS..].iter();
        let latest: Vec<Observation> =
            latest.map(|own| of_session(own, own.session - BEFORE)).collect();
        let told = trained(&arm, &seen, &start, &with_repair());
        let untold = trained(&arm, &seen, &start, &settings());
        let alone = trained(&arm, &latest, &start, &settings());
        let told_mm = measured.error_mm(&told, BEFORE + AFTER - 1, &poses);
        let untold_mm = measured.error_mm(&untold, BEFORE + AFTER - 1, &poses);
        let alone_mm = measured.error_mm(&alone, AFTER - 1, &poses);
        println!("{seed}: told {told_mm:.4}, alone {alone_mm:.4}, untold {untold_mm:.4}");
        assert!(told_mm < untold_mm, "{seed}: {told_mm} {untold_mm}");
        better += usize::from(told_mm < alone_mm);
        // Sessions before are seen with the gear that they had.
        let left = |own: &Observation| (told.position(&Query::of(own)) - position(own)).norm();
        let before = &seen[..BEFORE * STATIONS];
        let mean = before.iter().map(left).sum::<f64>() / before.len() as f64;
        assert!(mean < 0.05, "{seed}: {mean} mm left of the sessions before");
    }
    assert!(better >= 4, "better than the last two alone on {better} of 5");
}

#[test]
fn a_pool_with_a_repair_predicts_the_same_when_it_is_read_back() {
    let (measured, seen) = repaired_arm(30, 7);
    let start = frames(&measured.arm, &seen[..30]);
    let model = trained(&measured.arm, &seen, &start, &with_repair());
    let names: Vec<String> = (0..BEFORE + AFTER).map(|day| format!("day-{day}")).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let text = serde_json::to_string(&model.saved(&measured.arm, &names)).expect("text");
    let saved = posegrid::fit::full::saved::SavedFull::read(&text).expect("its own text");
    let again = FullModel::from_saved(&saved).expect("its own model");
    for own in seen.iter().step_by(7) {
        for of_session in [true, false] {
            let query = Query { own: of_session, ..Query::of(own) };
            let apart = (model.position(&query) - again.position(&query)).norm();
            assert!(apart < 1e-9, "{apart}");
            // The fast way and the one of rows are one.
            let apart = (model.position(&query) - model.predict(&query).position).norm();
            assert!(apart < 1e-6, "{apart}");
        }
    }
}

/// Writes the sessions as one table, an hour apart a station, and a pipeline file of them as one pool.
fn tabled(folder: &Path, seen: &[Observation], repaired: &str) {
    let mut table = String::from("session,t,q1,q2,q3,q4,q5,q6,x,y,z\n");
    for own in seen {
        let (day, minute) = (own.session + 1, own.station);
        write!(table, "day-{day},2026-03-{day:02}T{:02}:{:02}:00Z", 8 + minute / 60, minute % 60)
            .expect("text");
        for angle in &own.axes {
            write!(table, ",{angle}").expect("text");
        }
        let place = position(own);
        writeln!(table, ",{},{},{}", place.x, place.y, place.z).expect("text");
    }
    std::fs::create_dir_all(folder.join("measured")).expect("a folder");
    std::fs::write(folder.join("measured/stations.csv"), table).expect("a table");
    let robot = concat!(env!("CARGO_MANIFEST_DIR"), "/pipelines/robots/ur10.toml");
    let text = format!(
        r#"
[robot]
file = "{robot}"
name = "arm"
up = [0, 0, 1]

[input]
folder = "measured"
stations = "stations.csv"
sessions_by = "column"
pool = "all"

[stations]
session = "session"
joints = ["q1", "q2", "q3", "q4", "q5", "q6"]
joint_unit = "rad"
time = {{ column = "t", unit = "iso8601" }}
measured = {{ position = ["x", "y", "z"], unit = "mm" }}

[tracker]
uncertainty = {{ range_um = 40, range_um_per_m = 0, transverse_um = 40, transverse_um_per_m = 0, divisor = 2 }}

[fit.full]
harmonics = 6
gear_lines = false
{repaired}

[grid]
steps_mm = [200, 400]

[tolerance]
mm = 0.5
share = 0.95
confidence = 0.95

[output]
lake = "lake"
"#
    );
    std::fs::write(folder.join("pool.toml"), text).expect("a pipeline file");
}

/// The sessions that were judged by a training without them, by the table of residuals of a session.
fn left_out(folder: &Path, session: &str) -> Vec<String> {
    let of_session = folder.join("lake/residuals/arm").join(session);
    let tables = std::fs::read_dir(of_session).expect("a folder");
    let paths: Vec<_> = tables.map(|own| own.expect("a table").path()).collect();
    assert_eq!(paths.len(), 1, "{paths:?}");
    let schema = schema::find("residuals").expect("a published table");
    let residuals = table::read(&paths[0], schema).expect("a table by its schema");
    let (split, session) = (residuals.text("split"), residuals.text("of_session"));
    let rows = (0..residuals.rows()).filter(|&row| split.value(row) == "session");
    let sessions: BTreeSet<&str> = rows.map(|row| session.value(row)).collect();
    sessions.into_iter().map(str::to_owned).collect()
}

/// Mean error of the full model in a session that only judged, its base found from chosen stations, mm.
fn judged_mm(folder: &Path, session: &str) -> f64 {
    let schema = schema::find("residuals").expect("a published table");
    let tables = std::fs::read_dir(folder.join("lake/residuals/arm/pooled")).expect("a folder");
    let paths: Vec<_> = tables.map(|own| own.expect("a table").path()).collect();
    let residuals = table::read(&paths[0], schema).expect("a table by its schema");
    let is = |row: usize, column: &str, wanted: &str| residuals.text(column).value(row) == wanted;
    let rows = (0..residuals.rows()).filter(|&row| {
        is(row, "of_session", session)
            && is(row, "split", "session")
            && is(row, "model", "full")
            && is(row, "base_refit", "chosen")
    });
    let errors: Vec<f64> = rows.map(|row| residuals.f64("residual_mm").value(row)).collect();
    assert!(errors.len() > 50, "{} errors", errors.len());
    errors.iter().sum::<f64>() / errors.len() as f64
}

#[test]
fn a_session_that_only_judges_has_the_target_of_the_latest_that_trained() {
    let mut measured = MeasuredArm::new(STEADY, 5);
    let mut seen = measured.session(80);
    measured.remount(Vector3::new(1.5, -1.0, 0.5));
    seen.extend((0..2).flat_map(|_| measured.session(80)));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let folder = folder.path();
    tabled(folder, &seen, "");
    let file = folder.join("pool.toml");
    let text = std::fs::read_to_string(&file).expect("a pipeline file");
    let sessions = "sessions = [\"day-1\", \"day-2\"]\ntest = [\"day-3\"]\npool = \"all\"";
    std::fs::write(&file, text.replace("pool = \"all\"", sessions)).expect("a pipeline file");
    let output = run(folder);
    assert!(matches!(output.status.code(), Some(0 | 3)), "{}", stderr(&output));
    // The target of the first session is 1.9 mm away.
    let error = judged_mm(folder, "day-3");
    assert!(error < 0.15, "{error} mm");
}

fn run(folder: &Path) -> Output {
    posegrid(folder, &["run", "pool.toml"])
}

fn posegrid(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the program starts")
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_repair_that_the_pipeline_file_states_lets_a_pool_go_on() {
    let (_, seen) = repaired_arm(60, 11);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let repair = |joint: usize, from: &str| {
        format!("[[fit.full.repaired]]\njoint = {joint}\nfrom = \"{from}\"")
    };
    tabled(folder.path(), &seen, &repair(3, "2026-03-07"));
    let told = run(folder.path());
    assert!(matches!(told.status.code(), Some(0 | 3)), "{}", stderr(&told));
    assert!(
        stderr(&told).contains("joint 3 was repaired on 2026-03-07 00:00:00: of it day-1, day-2"),
        "{}",
        stderr(&told)
    );
    let verified = posegrid(folder.path(), &["verify", "lake", "--pipeline", "pool.toml"]);
    assert!(verified.status.success(), "{}", stderr(&verified));

    println!("{}", String::from_utf8_lossy(&told.stdout));
    assert_eq!(left_out(folder.path(), "pooled"), ["day-7", "day-8"]);
    // Another joint, no date, a session that judges the gear of before, sessions without dates.
    let judging = ("pool = \"all\"", "test = [\"day-2\"]");
    let undated = ("time = { column = \"t\", unit = \"iso8601\" }", "");
    for (joint, from, (old, new), code, wanted) in [
        (7, "2026-03-07", ("", ""), 2, "joint = 7, but it has to be 1 to 6"),
        (3, "7 March", ("", ""), 2, "write \"2026-05-14\""),
        (3, "2026-03-07", judging, 1, "session day-2 judges the arm"),
        (3, "2026-03-07", undated, 1, "session day-1 has no date"),
    ] {
        tabled(folder.path(), &seen, &repair(joint, from));
        let path = folder.path().join("pool.toml");
        let text = std::fs::read_to_string(&path).expect("written above");
        std::fs::write(&path, text.replace(old, new)).expect("a pipeline file");
        let refused = run(folder.path());
        assert_eq!(refused.status.code(), Some(code), "{}", stderr(&refused));
        assert!(stderr(&refused).contains(wanted), "{}", stderr(&refused));
    }
}
