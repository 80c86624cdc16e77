//! The run that was asked for last is the current one of its session, for all who read the lake; and what `verify` tells of requests.

use std::fs;
use std::path::Path;
use std::thread::{self, sleep};
use std::time::Duration;

use arrow::array::Array as _;
use posegrid::files::store::Listed;
use posegrid::io::lake::{ASKED, Lake};
use posegrid::manifest::RunKey;
use serde_json::Value;

use super::cell::{Cell, Ended, ended, ended_with, posegrid};
use super::verify::verify;

/// Longer than a file that changed is taken to change again at a time that is stated alike.
const SETTLED: Duration = Duration::from_millis(2200);
/// Where a robot's session has its requests.
const REQUESTS: &str = "lake/asked/kr210-demo/mon";

fn lake(cell: &Cell) -> Lake {
    Lake::new(cell.path("lake"))
}

/// The current run of Monday.
fn current(cell: &Cell) -> String {
    let key = RunKey::new("kr210-demo", "mon", "");
    let current = lake(cell).current(&key).expect("readable");
    current.expect("there is one").run
}

/// Number, run and replaced run of each request.
fn requests(cell: &Cell) -> Vec<(u64, String, Option<String>)> {
    let lake = lake(cell);
    let files = lake.requests(ASKED).expect("listed").into_iter();
    let row = |file: Listed| {
        let (key, row) = lake.request(&file.key).expect("readable");
        (row.number, key.run, row.replaced)
    };
    files.map(row).collect()
}

/// A session of 12 random poses, identified by geometry alone: no verdict can be shown, and it takes a second.
fn small() -> Cell {
    let cell = Cell::new().with("harmonics = 12", "enabled = false");
    cell.with_simulated("mon", &["--random", "12"])
}

/// Corrects a target in the middle of the table by the robot's current run.
fn compensate(cell: &Cell) -> Ended {
    let table = lake(cell).read("compensation", &RunKey::new("kr210-demo", "mon", current(cell)));
    let table = table.expect("readable");
    let middle = (table.rows() / 2..table.rows()).find(|row| table.text("refused").is_null(*row));
    let [x, y, z] =
        ["x_mm", "y_mm", "z_mm"].map(|name| table.f64(name).value(middle.expect("a node")));
    let targets = cell.path("targets.csv");
    fs::write(&targets, format!("target,x_mm,y_mm,z_mm\nA,{x},{y},{z}\n")).expect("writable");
    let mut command = posegrid();
    command.arg("compensate").arg("kr210-demo").arg(targets);
    ended(command.arg("--lake").arg(cell.path("lake")))
}

#[test]
fn a_tolerance_that_comes_back_is_current_again_for_all_who_read_the_lake() {
    let cell = Cell::new().with("mm = 0.5", "mm = 0.1").with_quickstart("mon");
    cell.run(&[]).expect(3, &["0 of 1 within 0.1 mm"]);
    let strict = current(&cell);
    compensate(&cell).expect(2, &["does not meet"]);
    let cell = cell.with("mm = 0.1", "mm = 0.5");
    let told =
        format!("takes the place of run {strict}: tolerance.mm 0.1 → 0.5; verdict not met → met");
    cell.run(&[]).expect(0, &["1 done, 0 done before", &told]);
    let loose = current(&cell);
    compensate(&cell).expect(0, &[&loose]);

    let cell = cell.with("mm = 0.5", "mm = 0.1");
    let told = format!(
        "mon: run {strict} is current again, in place of run {loose}: tolerance.mm 0.5 → 0.1; verdict met → not met"
    );
    cell.run(&[]).expect(3, &["0 done, 1 done before", &told]);
    assert_eq!(current(&cell), strict);
    compensate(&cell).expect(2, &["does not meet"]);
    let history = ended(posegrid().arg("history").arg(cell.path("lake")));
    history.expect(0, &["1 used", "1 replaced by another run"]);
    // Asked for once more it changes nothing, whether or not its files are digested.
    for flags in [&[][..], &["--fresh"]] {
        let again = cell.run(flags);
        again.expect(3, &["done-before"]);
        assert!(!again.results.contains("current again"), "{}", again.results);
    }
    let some = |run: &String| Some(run.clone());
    let all = [
        (1, strict.clone(), None),
        (2, loose.clone(), some(&strict)),
        (3, strict.clone(), some(&loose)),
    ];
    assert_eq!(requests(&cell), all);
    // By month it is the same, and a further request is added to it.
    let compact = |cell: &Cell| ended(posegrid().arg("compact").arg(cell.path("lake")));
    compact(&cell).expect(0, &["state 1: 2 runs, 2 new", "compact/asked: 1 files, 3 rows"]);
    let cell = cell.with("mm = 0.1", "mm = 0.5");
    cell.run(&[]).expect(0, &["is current again"]);
    compact(&cell).expect(0, &["state 2: 2 runs, 0 new", "compact/asked: 1 files, 4 rows"]);
}

#[test]
fn a_robot_file_that_is_edited_and_restored_is_current_again() {
    let cell = small();
    let robot = cell.path("robots/kr210-r2700-extra.toml");
    let as_it_was = fs::read(&robot).expect("readable");
    sleep(SETTLED);
    cell.run(&[]).expect(3, &["1 done, 0 done before"]);
    let first = current(&cell);
    fs::write(&robot, [&as_it_was[..], b"\n# edited\n"].concat()).expect("writable");
    cell.run(&[]).expect(3, &[&format!("takes the place of run {first}: another robot file")]);
    let edited = current(&cell);
    assert_ne!(edited, first);
    // The index knows both by their files, and only the current one is told without more.
    fs::write(&robot, as_it_was).expect("writable");
    let told =
        format!("run {first} is current again, in place of run {edited}: another robot file");
    cell.run(&[]).expect(3, &["done-before", &told]);
    assert_eq!(current(&cell), first);
    let again = cell.run(&[]);
    assert!(!again.results.contains("is current again"), "{}", again.results);
}

#[test]
fn a_request_that_was_stopped_is_repeated_and_a_lake_without_requests_goes_by_its_rows() {
    let cell = small();
    cell.run(&[]).expect(3, &[]);
    let first = current(&cell);
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    cell.run(&[]).expect(3, &[]);
    let second = current(&cell);
    let last = cell.path(REQUESTS).join("00000002.parquet");
    // As a process leaves it that was killed between its row in `runs` and its request.
    fs::remove_file(&last).expect("there");
    assert_eq!(current(&cell), first, "nothing was changed");
    let told = format!("run {second} is current again, in place of run {first}");
    cell.run(&[]).expect(3, &["0 done, 1 done before", &told]);
    assert_eq!(current(&cell), second);
    assert_eq!(requests(&cell)[1], (2, second.clone(), Some(first.clone())));
    // As an earlier version leaves it.
    fs::remove_dir_all(cell.path("lake/asked")).expect("there");
    assert_eq!(current(&cell), second, "it is the one that no other replaces");
    let cell = cell.with("mm = 0.4", "mm = 0.5");
    let told = format!("run {first} is current again, in place of run {second}");
    cell.run(&[]).expect(3, &["done-before", &told]);
    assert_eq!(requests(&cell), [(1, first, Some(second))]);
}

#[test]
fn two_tasks_at_once_have_a_request_each_and_the_later_one_is_current() {
    let cell = small().with("mm = 0.5", "mm = 0.4");
    let text = fs::read_to_string(cell.pipeline()).expect("readable");
    let other = cell.path("other.toml");
    fs::write(&other, text.replace("mm = 0.4", "mm = 0.3")).expect("writable");
    sleep(SETTLED);
    let task = |pipeline: &Path| {
        let listed = ended(posegrid().arg("tasks").arg(pipeline));
        listed.expect(0, &[]);
        listed.results
    };
    let own = cell.pipeline();
    let both = [&own, &other].map(|pipeline| (pipeline, task(pipeline)));
    let done = |pipeline: &Path, task: &str| -> Value {
        let done = ended_with(posegrid().arg("task").arg(pipeline), task);
        done.expect(0, &["\"ended\":\"done"]);
        serde_json::from_str(&done.results).expect("a line of JSON")
    };
    let runs: Vec<Value> = thread::scope(|scope| {
        let ends = both.each_ref().map(|(pipeline, task)| scope.spawn(|| done(pipeline, task)));
        ends.map(|own| own.join().expect("it ends")).into()
    });
    let [first, second] = &requests(&cell)[..] else {
        panic!("two requests: {:?}", requests(&cell));
    };
    assert_eq!((first.0, second.0), (1, 2));
    assert_eq!(second.2.as_ref(), Some(&first.1));
    assert_eq!(current(&cell), second.1);
    let of = |run: &String| runs.iter().position(|own| own["run"] == **run).expect("one of both");
    let words = runs[of(&second.1)]["took_place"].as_str().expect("it took the place");
    assert!(words.contains(&first.1), "{words}");
    // The other is to be done again, by whoever lists it, and is current then.
    let (pipeline, id) = &both[of(&first.1)];
    // What the lake's runs took is what the next may take: only that differs.
    let named = |task: &str| serde_json::from_str::<Value>(task).map(|own| own["id"].clone());
    assert_eq!(named(&task(pipeline)).expect("a task"), named(id).expect("a task"));
    assert_eq!(task(both[of(&second.1)].0), "");
    let again = done(pipeline, id);
    assert_eq!(again["ended"], "done-before");
    assert!(again["took_place"].as_str().is_some_and(|own| own.contains("is current again")));
    assert_eq!(current(&cell), first.1);
    assert_eq!(task(pipeline), "");
}

#[test]
fn verify_names_requests_that_are_missing_or_changed() {
    let cell = small();
    cell.run(&[]).expect(3, &[]);
    let cell = cell.with("mm = 0.5", "mm = 0.4");
    cell.run(&[]).expect(3, &[]);
    let cell = cell.with("mm = 0.4", "mm = 0.5");
    cell.run(&[]).expect(3, &["is current again"]);
    let sound = verify(&cell, &["mon"]);
    assert!(!sound.results.contains("asked: "), "{}", sound.results);
    let file = |number: u64| cell.path(REQUESTS).join(format!("{number:08}.parquet"));
    let (second, third) = (fs::read(file(2)).expect("there"), fs::read(file(3)).expect("there"));
    fs::remove_file(file(2)).expect("there");
    let told =
        format!("asked: {}: the request before it, number 2, was removed", file(3).display());
    verify(&cell, &["mon"]).expect(3, &[&told]);
    fs::write(file(2), &third).expect("writable");
    let told = format!("asked: {} does not hold the request", file(2).display());
    verify(&cell, &[]).expect(3, &[&told]);
    fs::write(file(2), second).expect("writable");
    // A run that is gone from `runs` was asked for.
    let run = requests(&cell)[1].1.clone();
    fs::remove_file(cell.path("lake/runs/kr210-demo/mon").join(format!("{run}.parquet")))
        .expect("there");
    let told = format!("its run {run} has no row in runs");
    verify(&cell, &[]).expect(3, &[&told]);
}
