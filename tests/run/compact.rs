//! `posegrid compact` on lakes of small synthetic runs: the rows of the tables, once each, by month; in whatever steps, and whoever else is at it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use posegrid::files::table::Table;
use posegrid::io::lake::{CompactFile, KEYS, Lake};
use posegrid::io::rows::Row as _;
use posegrid::io::tables::accuracy::{AccuracyRow, BeforeAfter, FigureKind, FigureName};
use posegrid::io::tables::runs::{self, Ending};
use posegrid::io::tables::words::{Role, TableVerdict, Unit, VerdictOf};
use posegrid::manifest::{RunKey, Work};
use posegrid::pipeline::compact::{Compacted, compact};
use posegrid::progress::Quiet;
use posegrid::report::{Angles, BaseRefit, Model, Moment, Point, Split, Subject};
use posegrid::units::WallTime;
use rayon::prelude::*;

/// 2026-01-31 22:00, UTC, and a day, in microseconds.
const BEGIN_US: i64 = 1_769_896_800_000_000;
const DAY_US: i64 = 86_400_000_000;

fn figure(name: FigureName, session: &str, value: f64) -> AccuracyRow {
    AccuracyRow {
        subject: Subject {
            split: Split::Blocks,
            of_session: session.to_owned(),
            model: Model::BaseTarget,
            angles: Angles::Reported,
            base_refit: BaseRefit::None,
        },
        base_stations: None,
        target_found: None,
        role: Role::HeldOut,
        evidence: Moment::Before,
        moment: BeforeAfter::Before,
        point: Point::Measured,
        quantity: FigureKind::PositionError,
        name,
        session_started: None,
        pose: None,
        value: Some(value),
        unit: Unit::Mm,
        expanded_uncertainty: None,
        coverage_factor: None,
        n: 10,
        visits: None,
        blocks: None,
        n_needed: None,
        share: None,
        confidence: None,
        tolerance: None,
        verdict: None,
        reason: None,
        table_id: None,
    }
}

/// Publishes a run of a robot on a day after the first; without a date where there is none.
fn publish(lake: &Lake, robot: &str, session: &str, day: Option<i64>) -> RunKey {
    let rows = [FigureName::Mean, FigureName::P95].map(|name| figure(name, session, 0.5));
    publish_figures(lake, robot, session, day, rows.to_vec())
}

/// Publishes a run with these figures.
fn publish_figures(
    lake: &Lake,
    robot: &str,
    session: &str,
    day: Option<i64>,
    rows: Vec<AccuracyRow>,
) -> RunKey {
    let work = Work {
        robot: robot.to_owned(),
        session: session.to_owned(),
        pipeline: "nightly".to_owned(),
        sessions: vec![session.to_owned()],
        test_sessions: Vec::new(),
        inputs: Vec::new(),
        settings: "{}".to_owned(),
    };
    let key = work.key();
    let mut run = lake.start(&key).expect("a lake").expect("a new run");
    let accuracy = AccuracyRow::table(rows, &key).expect("a table");
    run.publish(&accuracy.table).expect("written");
    let started = day.map(|day| WallTime::of_us(BEGIN_US + DAY_US * day));
    let ending = Ending {
        session_started: started,
        first_session_started: started,
        verdict: TableVerdict::Met,
        verdict_of: Some(VerdictOf::Compensation),
        statement: Some("met".to_owned()),
        mean_before_mm: Some(0.5),
        mean_after_mm: Some(0.1),
        bound_mm: Some(0.3),
        ..Ending::default()
    };
    let row = runs::table(&work, &[], run.written(), &ending).expect("a row");
    run.commit(&row).expect("committed");
    key
}

/// Two robots on the last day of January and the first of February, and a session without a date.
fn sample(root: &Path) -> Lake {
    let lake = Lake::new(root);
    for robot in ["b ü", "a"] {
        publish(&lake, robot, "mon", Some(0));
        publish(&lake, robot, "tue", Some(1));
    }
    publish(&lake, "a", "some", None);
    lake
}

fn compacted(lake: &Lake) -> Compacted {
    compact(lake, &Quiet).expect("compacted")
}

/// The robot and session of each row of a table in the compact form, in its order, by month.
fn rows(
    lake: &Lake,
    files: &[CompactFile],
    table: &str,
) -> BTreeMap<String, Vec<(String, String)>> {
    let own = files.iter().filter(|file| file.table == table);
    let keys = |file: &CompactFile| {
        let keys = lake.read_compact(file).expect("readable").keys();
        let keys = keys.into_iter().map(|key| (key.robot, key.session));
        (file.month.clone(), keys.collect())
    };
    own.map(keys).collect()
}

/// The files of a lake's compact form with their bytes, without states.
fn generations(root: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let folders = |folder: &Path| -> Vec<_> {
        let found = fs::read_dir(folder).expect("readable");
        found.map(|entry| entry.expect("readable").path()).collect()
    };
    let compact = root.join("compact");
    let tables = folders(&compact).into_iter().filter(|own| !own.ends_with("states"));
    for file in tables.flat_map(|own| folders(&own)).flat_map(|own| folders(&own)) {
        let name = file.strip_prefix(&compact).expect("below");
        found.insert(name.display().to_string(), fs::read(&file).expect("readable"));
    }
    found
}

fn pair(robot: &str, session: &str) -> (String, String) {
    (robot.to_owned(), session.to_owned())
}

#[test]
fn every_row_is_in_its_month_once_as_it_was_published() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = sample(folder.path());
    let done = compacted(&lake);
    assert_eq!((done.state, done.runs, done.added), (1, 5, 5));
    assert_eq!(done.files.len(), 3 * 3, "runs, accuracy and keys of three months");
    let runs = rows(&lake, &done.files, "runs");
    assert_eq!(runs["2026-01"], [pair("a", "mon"), pair("b ü", "mon")]);
    assert_eq!(runs["2026-02"], [pair("a", "tue"), pair("b ü", "tue")]);
    assert_eq!(runs["undated"], [pair("a", "some")]);
    let accuracy = rows(&lake, &done.files, "accuracy");
    assert_eq!(accuracy["undated"], [pair("a", "some"), pair("a", "some")]);
    // The rows are those of the run's own files.
    for name in ["runs", "accuracy"] {
        let file = done.files.iter().find(|file| file.table == name && file.month == "undated");
        let table = lake.read_compact(file.expect("there")).expect("readable");
        let own: Table = lake.read(name, &table.keys()[0]).expect("readable");
        assert_eq!(own.batch(), table.batch());
    }
    // Without anything new nothing is written.
    let again = compacted(&lake);
    assert!(
        !again.is_new && again.state == 1 && again.files == done.files && again.months.is_empty()
    );
}

#[test]
fn steps_and_one_go_give_the_same_bytes_and_only_months_with_new_runs_are_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = sample(folder.path());
    let before = compacted(&lake);
    publish(&lake, "a", "wed", Some(2));
    let done = compacted(&lake);
    assert_eq!((done.state, done.added, &done.months[..]), (2, 1, &["2026-02".to_owned()][..]));
    let same = |file: &&CompactFile| before.files.contains(file);
    assert_eq!(done.files.iter().filter(same).count(), 6);
    // A run that is removed goes from it too.
    let gone = lake.place("runs", &publish(&lake, "a", "thu", Some(3)));
    assert_eq!(compacted(&lake).added, 1);
    fs::remove_file(gone.expect("a place").named()).expect("there");
    let done = compacted(&lake);
    assert_eq!((done.gone, done.runs), (1, 6));
    // What is named is what one go makes.
    let named: BTreeSet<String> =
        done.files.iter().map(|file| file.file["compact/".len()..].to_owned()).collect();
    let mut in_steps = generations(folder.path());
    in_steps.retain(|name, _| named.contains(name));
    fs::remove_dir_all(folder.path().join("compact")).expect("there");
    compacted(&lake);
    assert_eq!(generations(folder.path()), in_steps);
}

#[test]
fn requests_are_in_the_month_in_which_they_were_made() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = sample(folder.path());
    let [mon, tue] = ["mon", "tue"].map(|session| {
        let listed = lake.run_files().expect("listed").into_iter();
        let mut own = listed.filter(|file| file.key.starts_with(&format!("runs/a/{session}/")));
        let file = own.next().expect("published").key;
        let run = file.rsplit('/').next().expect("a name").trim_end_matches(".parquet");
        RunKey::new("a", session, run)
    });
    lake.ask(&mon).expect("recorded");
    let done = compacted(&lake);
    let asked = |files: &[CompactFile]| {
        let months = rows(&lake, files, "asked").into_values();
        months.flatten().collect::<Vec<_>>()
    };
    assert_eq!(asked(&done.files), [pair("a", "mon")]);
    assert_eq!((done.runs, done.added), (5, 5), "a request is no run");
    // A further one is added, and one that is removed goes.
    lake.ask(&tue).expect("recorded");
    let done = compacted(&lake);
    assert_eq!((done.state, done.added, done.months.len()), (2, 0, 1));
    assert_eq!(asked(&done.files), [pair("a", "mon"), pair("a", "tue")]);
    fs::remove_file(folder.path().join("asked/a/mon/00000001.parquet")).expect("there");
    let done = compacted(&lake);
    assert_eq!((asked(&done.files), done.gone, done.runs), (vec![pair("a", "tue")], 0, 5));
    let again = compacted(&lake);
    assert!(!again.is_new && again.runs == 5);
}

#[test]
fn one_that_was_killed_leaves_the_state_before_and_several_at_once_make_one() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = sample(folder.path());
    let whole = compacted(&lake);
    let files = generations(folder.path());
    // Killed before its state was created: the files are there, and no state names them.
    fs::remove_file(folder.path().join("compact/states/00000001.jsonl")).expect("there");
    assert_eq!(lake.compact_state().expect("readable").number, 0);
    let (again, other) = thread::scope(|scope| {
        let other = scope.spawn(|| compacted(&lake));
        (compacted(&lake), other.join().expect("no panic"))
    });
    assert_eq!((again.files, other.files), (whole.files.clone(), whole.files));
    assert_eq!(again.state.max(other.state), 1);
    assert_eq!(generations(folder.path()), files);
}

#[test]
fn what_cannot_be_read_is_left_out_and_a_damaged_generation_is_made_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = sample(folder.path());
    let key = publish(&lake, "a", "wed", Some(2));
    let accuracy = lake.place("accuracy", &key).expect("a place").named();
    let sound = fs::read(&accuracy).expect("there");
    let mut damaged = sound.clone();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x10;
    fs::write(&accuracy, damaged).expect("writable");
    let posegrid = || Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let told = posegrid().arg("compact").arg(folder.path()).output().expect("started");
    let messages = String::from_utf8_lossy(&told.stderr).into_owned();
    assert_eq!(told.status.code(), Some(3), "{messages}");
    assert!(messages.contains("is not what its run wrote"), "{messages}");
    fs::write(&accuracy, sound).expect("writable");
    let done = compacted(&lake);
    assert_eq!((done.state, done.added, done.runs), (2, 1, 6));
    // A generation that was changed is made from its runs.
    let file = done.files.iter().find(|file| file.table == "runs").expect("there");
    fs::write(folder.path().join(&file.file), "not a table").expect("writable");
    publish(&lake, "a", "fri", Some(-1));
    let after = compacted(&lake);
    assert_eq!(after.runs, 7);
    assert_eq!(rows(&lake, &after.files, "runs")["2026-01"].len(), 3);
    // So is one of a month that has no new run, and one that is gone.
    let file = after.files.iter().find(|file| file.table == "accuracy").expect("there");
    let path = folder.path().join(&file.file);
    let sound = fs::read(&path).expect("there");
    let mut flipped = sound.clone();
    flipped[sound.len() / 2] ^= 0x10;
    for harmed in [Some(flipped), None] {
        match harmed {
            Some(bytes) => fs::write(&path, bytes).expect("writable"),
            None => fs::remove_file(&path).expect("there"),
        }
        assert_eq!(compacted(&lake).files, after.files);
        assert_eq!(fs::read(&path).expect("there"), sound);
    }
    let nowhere = posegrid().arg("compact").arg(folder.path().join("none")).output();
    assert_eq!(nowhere.expect("started").status.code(), Some(2));
}

#[test]
fn replaced_files_stay_for_a_day() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = sample(folder.path());
    compacted(&lake);
    publish(&lake, "a", "wed", Some(2));
    assert_eq!(compacted(&lake).removed, 0);
    let files = generations(folder.path()).len();
    assert_eq!(files, 9 + 3);
    // As if both states had been made three and two days ago.
    let old = |name: &str, days: u64| {
        let file = fs::File::options().write(true).open(folder.path().join("compact").join(name));
        let then = SystemTime::now() - Duration::from_hours(24 * days);
        file.expect("there").set_modified(then).expect("set");
    };
    for name in generations(folder.path()).keys() {
        old(name, 3);
    }
    old("states/00000001.jsonl", 3);
    old("states/00000002.jsonl", 2);
    publish(&lake, "a", "thu", Some(3));
    let done = compacted(&lake);
    // The first state and the three files that only it named; those of the second were replaced just now.
    assert_eq!((done.state, done.removed), (3, 4));
    assert_eq!(generations(folder.path()).len(), 9 + 3);
    let keys = done.files.iter().filter(|file| file.table == KEYS);
    assert_eq!(keys.map(|file| file.runs).sum::<u64>(), 7);
}

/// 240 figures, as many as a session with a few steps has: before and after, of four models, held out and in training.
fn figures(session: &str, day: i64) -> Vec<AccuracyRow> {
    let models = [Model::BaseTarget, Model::Geometric, Model::Full, Model::Table];
    let names =
        [FigureName::Mean, FigureName::Rms, FigureName::P95, FigureName::Max, FigureName::P99];
    let mut rows = Vec::new();
    for (place, model) in models.into_iter().enumerate() {
        for role in [Role::HeldOut, Role::Training] {
            for split in [Split::Blocks, Split::Session] {
                for base_refit in [BaseRefit::None, BaseRefit::Chosen, BaseRefit::All] {
                    for name in names {
                        let value = 0.5 / (1.0 + place as f64) + 1e-4 * day as f64;
                        let row = figure(name, session, value);
                        rows.push(AccuracyRow {
                            subject: Subject { model, split, base_refit, ..row.subject },
                            role,
                            session_started: Some(WallTime::of_us(BEGIN_US + DAY_US * day)),
                            moment: if place == 0 {
                                BeforeAfter::Before
                            } else {
                                BeforeAfter::After
                            },
                            ..row
                        });
                    }
                }
            }
        }
    }
    rows
}

#[test]
#[ignore = "73,000 sessions, a quarter of an hour and 2 GB of disk; see .github/CONTRIBUTING.md"]
fn a_year_of_200_robots_is_compacted_and_asked() {
    let folder = tempfile::tempdir().expect("a folder");
    let lake = Lake::new(folder.path());
    let begun = Instant::now();
    let robots: Vec<usize> = (0..200).collect();
    robots.par_iter().for_each(|robot| {
        for day in 0..365 {
            let session = format!("day-{day:03}");
            let figures = figures(&session, day);
            publish_figures(&lake, &format!("r{robot:03}"), &session, Some(day), figures);
        }
    });
    println!("73,000 runs published in {:.0?}", begun.elapsed());
    let told = |what: &str, lake: &Lake| {
        let begun = Instant::now();
        let done = compacted(lake);
        println!("{what}: {} runs in {:.1?}", done.added, begun.elapsed());
        done
    };
    assert_eq!(told("compact", &lake).added, 73_000);
    assert_eq!(told("nothing new", &lake).added, 0);
    robots.par_iter().for_each(|robot| {
        let figures = figures("day-365", 365);
        publish_figures(&lake, &format!("r{robot:03}"), "day-365", Some(365), figures);
    });
    let done = told("one more night", &lake);
    assert_eq!((done.added, done.runs), (200, 73_200));
    // Three files for each of the thirteen months that it spans, or a few more.
    assert!(done.files.len() <= 42, "{} files", done.files.len());
    let python = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/ci-venv/bin/python");
    let spark = std::process::Command::new(&python)
        .args(["-c", "import pyspark"])
        .status()
        .is_ok_and(|ended| ended.success());
    let asked = std::process::Command::new(python)
        .args([
            concat!(env!("CARGO_MANIFEST_DIR"), "/tests/readers/read_compact.py"),
            env!("CARGO_BIN_EXE_posegrid"),
        ])
        .arg(folder.path())
        .arg("--only-time")
        .args(spark.then_some("--spark"))
        .status();
    assert!(asked.expect("target/ci-venv of .ci/run").success());
}
