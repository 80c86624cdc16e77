//! What judges a run: held-out blocks and every test session, each pose once however often it was visited. The worst decides, with
//! its reason, and everything that states a verdict states that one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use arrow::array::Array as _;
use posegrid::files::table::Table;

use super::cell::{Cell, Ended, files};

/// Monday: a grid of 4 × 7 × 4 poses by the arm of seed 3.
fn monday() -> Cell {
    let flags = ["--size", "720,1440,720", "--grid-step", "240"];
    Cell::new().with_simulated("mon", &flags)
}

fn text<'t>(table: &'t Table, column: &str, row: usize) -> &'t str {
    table.text(column).value(row)
}

/// The rows in which these columns have these words.
fn rows(table: &Table, words: &[(&str, &str)]) -> Vec<usize> {
    let is = |row: &usize| words.iter().all(|(column, word)| text(table, column, *row) == *word);
    (0..table.rows()).filter(is).collect()
}

/// The only row in which these columns have these words.
fn row(table: &Table, words: &[(&str, &str)]) -> usize {
    let found = rows(table, words);
    assert_eq!(found.len(), 1, "rows with {words:?}");
    found[0]
}

/// Every place that states the verdict of Monday's run states this one, with a reason that holds all these texts.
fn everywhere(cell: &Cell, ended: &Ended, verdict: &str, reason: &[&str]) {
    let runs = cell.table("runs", "mon");
    let steps = cell.table("grid_steps", "mon");
    let chosen = (0..steps.rows()).find(|&row| steps.bool("chosen").value(row));
    let accuracy = cell.table("accuracy", "mon");
    let of_table =
        [("model", "table"), ("split", "blocks"), ("name", "bound"), ("point", "tool_point")];
    let stated = [
        (&runs, 0),
        (&steps, chosen.expect("a chosen step")),
        (&accuracy, row(&accuracy, &of_table)),
    ];
    let page = files(&cell.path("lake/report")).into_values().next();
    let page = String::from_utf8(page.expect("a page")).unwrap();
    for (table, row) in stated {
        let name = &table.schema().table;
        assert_eq!(text(table, "verdict", row), verdict, "{name}");
        let reasons = table.text("reason");
        assert_eq!(reasons.is_null(row), reason.is_empty(), "{name}");
        for part in reason {
            assert!(reasons.value(row).contains(part), "{name}: {}", reasons.value(row));
        }
    }
    let compensation = cell.table("compensation", "mon");
    assert_eq!(text(&compensation, "verdict", 0), verdict);
    for part in reason {
        assert!(ended.results.contains(part), "{part:?} is not in {}", ended.results);
        assert!(page.contains(part), "{part:?} is not on the page");
    }
    let (line, tolerance) = match verdict {
        "met" => (
            "done         mon: within tolerance by the compensation table, run",
            "tolerance 0.5 mm: met by the compensation table: ",
        ),
        "not_met" => (
            "done         mon: not within tolerance by the compensation table: ",
            "tolerance 0.5 mm: not met by the compensation table: ",
        ),
        _ => (
            "done         mon: not shown to be within tolerance by the compensation table: ",
            "tolerance 0.5 mm: not shown to be met by the compensation table: ",
        ),
    };
    assert!(ended.results.starts_with(line), "{}", ended.results);
    assert!(ended.results.contains(tolerance), "{}", ended.results);
    let headline = match verdict {
        "met" => "Tolerance met",
        "not_met" => "Tolerance not met",
        _ => "Not shown to meet the tolerance",
    };
    assert!(page.contains(headline));
}

#[test]
fn a_test_session_of_this_arm_agrees() {
    let cell = monday().with_judge("tue", "3", "130");
    let ended = cell.run(&["mon", "--test", "tue", "--verbose"]);
    ended.expect(0, &["judged by held-out blocks of mon: met", "judged by test session tue: met"]);
    assert!(!ended.results.contains("another arm"), "{}", ended.results);
    everywhere(&cell, &ended, "met", &[]);
    // Twelve chosen stations find the base; of the others the table answers for those in its box.
    let steps = cell.table("grid_steps", "mon");
    let tue = row(&steps, &[("split", "session"), ("of_session", "tue")]);
    assert_eq!(text(&steps, "verdict", tue), "met");
    assert!(steps.i64("held_out").value(tue) >= 59 && steps.i64("visits").value(tue) <= 118);
    let accuracy = cell.table("accuracy", "mon");
    let words = [("of_session", "tue"), ("model", "table"), ("name", "bound")];
    let bound = row(&accuracy, &words);
    assert_eq!(text(&accuracy, "evidence", bound), "predicted");
    let apart = accuracy.f64("value").value(bound) - steps.f64("bound_mm").value(tue);
    assert!(apart.abs() < 1e-12, "{apart}");
    // What the table leaves in another session is about what the model does: its base is found as theirs is.
    let words = [
        ("of_session", "tue"),
        ("model", "full"),
        ("angles", "commanded"),
        ("name", "mean"),
        ("base_refit", "chosen"),
    ];
    let of_model = accuracy.f64("value").value(row(&accuracy, &words));
    let of_table = steps.f64("mean_mm").value(tue);
    assert!(of_table < 2.0 * of_model, "{of_table} {of_model}");
    let again = cell.run(&["mon", "--test", "tue"]);
    again.expect(0, &["done-before  mon: within tolerance by the compensation table, run"]);
}

#[test]
fn a_base_from_chosen_stations_is_said_everywhere_and_they_do_not_judge() {
    let cell = monday()
        .with_judge("tue", "3", "130")
        .with("[output]", "[report]\nlocate = { by = \"chosen\", target = \"own\" }\n\n[output]");
    let ended = cell.run(&["mon", "--test", "tue", "--verbose"]);
    let words = "base and target from 12 stations chosen by their poses";
    ended.expect(0, &["judged by test session tue: met", words]);
    let page = files(&cell.path("lake/report")).into_values().next();
    let page = String::from_utf8(page.expect("a page")).unwrap();
    assert!(page.contains("base from stations chosen by their poses"));
    let words = [
        ("of_session", "tue"),
        ("base_refit", "chosen"),
        ("model", "full"),
        ("angles", "commanded"),
    ];
    let accuracy = cell.table("accuracy", "mon");
    let own = rows(&accuracy, &words);
    assert!(!own.is_empty() && rows(&accuracy, &[("base_refit", "first")]).is_empty());
    for row in own {
        assert_eq!(accuracy.i64("base_stations").value(row), 12);
        assert!(accuracy.bool("target_found").value(row));
    }
    let residuals = cell.table("residuals", "mon");
    let own = rows(&residuals, &words);
    let taken = |row: &&usize| residuals.bool("used_for_refit").value(**row);
    assert_eq!(own.iter().filter(taken).count(), 12);
    // They are spread over the box, and not the first.
    let last = own.iter().filter(taken);
    let last = last.map(|&row| residuals.i64("station").value(row)).max();
    assert!(last.is_some_and(|last| last > 50), "{last:?}");
}

#[test]
fn a_test_session_of_another_arm_decides_and_is_named() {
    let cell = monday().with_judge("wed", "5", "130");
    let ended = cell.run(&["mon", "--test", "wed", "--verbose"]);
    ended.expect(
        3,
        &["judged by held-out blocks of mon: met", "judged by test session wed: not met"],
    );
    let reason = [
        "test session wed: ",
        "full error model from commands alone: bound ",
        "another arm, this one before or after a repair, or poses unlike",
    ];
    everywhere(&cell, &ended, "not_met", &reason);
    let steps = cell.table("grid_steps", "mon");
    let wed = row(&steps, &[("split", "session"), ("of_session", "wed")]);
    assert_eq!(text(&steps, "verdict", wed), "not_met");
    let again = cell.run(&["mon", "--test", "wed"]);
    again.expect(
        3,
        &["done-before  mon: not within tolerance by the compensation table: test session wed: full error model"],
    );
}

#[test]
fn a_reflector_that_was_put_on_again_is_said_and_no_other_arm_is_blamed() {
    // The reflector of Monday stands 0.1 mm off (standard deviation) from where the controller has it, Tuesday's ten times as far.
    let turned = |size: &'static str| ["--size", size, "--cone-deg", "40", "--random", "150"];
    let again = [&["--arm", "3", "--target-sd-mm", "1"], &turned("600,1200,600")[..]].concat();
    let cell =
        Cell::new().with_simulated("mon", &turned("720,1440,720")).with_simulated("tue", &again);
    let ended = cell.run(&["mon", "--test", "tue", "--verbose"]);
    let said = [
        "its stations say that the reflector was put on again or moved",
        "with the known one",
        "base and target from 12 stations chosen by their poses",
    ];
    for text in said {
        assert!(ended.results.contains(text), "{}", ended.results);
    }
    assert!(!ended.results.contains("another arm"), "{}", ended.results);
    let page = files(&cell.path("lake/report")).into_values().next();
    let page = String::from_utf8(page.expect("a page")).unwrap();
    assert!(page.contains(said[0]));
    // Who says that it stayed is told too.
    let cell = cell
        .with("[output]", "[report]\nlocate = { by = \"chosen\", target = \"known\" }\n\n[output]");
    let ended = cell.run(&["mon", "--test", "tue", "--verbose"]);
    for text in [said[0], "[report] locate has target = \"known\"", "base from 12 stations"] {
        assert!(ended.results.contains(text), "{}", ended.results);
    }
}

#[test]
fn a_judge_that_trained_under_another_name_is_refused() {
    // Both are made by one seed: the same stations in the same clocks.
    let cell = Cell::new().with_judge("mon", "3", "80").with_judge("tue", "3", "80");
    cell.run(&["mon", "--test", "tue"]).expect(
        1,
        &[
            "session tue judges, but ",
            " measured stations train under another name",
            "are those of mon, at most rounded or moved as one",
            "take tue out of [input] test",
        ],
    );
    // They may be learnt from together: whoever is left out judges what the other one taught.
    let pooled = cell.with("# sessions", "pool = \"all\"").run(&[]);
    assert!(pooled.results.contains("pooled"), "{}", pooled.results);
    assert!(!pooled.messages.contains("under another name"));
}

#[test]
fn a_test_session_of_few_stations_shows_nothing() {
    // Eight of the 40 find the base: too few are left to judge.
    let cell = monday().with_judge("thu", "3", "40");
    let ended = cell.run(&["mon", "--test", "thu", "--verbose"]);
    ended.expect(
        3,
        &["judged by held-out blocks of mon: met", "judged by test session thu: not shown"],
    );
    let reason =
        ["32 poses held out; 59 poses are needed", "8 stations find the base ([report] locate)"];
    everywhere(&cell, &ended, "not_shown", &reason);
}

/// Thirty poses of a grid in so many rounds, as targets with joint angles.
fn thirty(rounds: usize) -> String {
    let flags = ["--size", "720,1440,360", "--grid-step", "360"];
    let grid = Cell::new().with_simulated("grid", &flags);
    let truth = grid.session("grid").join("truth_stations.csv");
    let mut file = csv::Reader::from_path(truth).expect("the truth of the session");
    let headers = file.headers().expect("a header").clone();
    let first = headers.iter().position(|name| name == "commanded_joint_a1");
    let first = first.expect("commanded joints");
    let pose = |row: csv::StringRecord| -> Vec<String> {
        let joints = row.iter().skip(first).take(6);
        joints.map(str::to_owned).collect()
    };
    let poses: Vec<Vec<String>> = file.records().map(|row| pose(row.expect("a row"))).collect();
    assert_eq!(poses.len(), 30);
    let line = |visit: usize| format!("p{visit},{}\n", poses[visit % 30].join(","));
    let lines: String = (0..30 * rounds).map(line).collect();
    format!("target,q1_rad,q2_rad,q3_rad,q4_rad,q5_rad,q6_rad\n{lines}")
}

fn with_thirty(cell: Cell, name: &str, rounds: usize) -> Cell {
    let file = cell.path(&format!("{name}.csv"));
    fs::write(&file, thirty(rounds)).expect("writable");
    let path = file.to_str().expect("UTF-8").to_owned();
    cell.with_simulated(name, &["--poses", &path])
}

#[test]
fn visits_of_one_pose_count_once() {
    let cell = with_thirty(Cell::new(), "mon", 6);
    let ended = cell.run(&["mon", "--verbose"]);
    // Thirty poses show nothing, however often they are visited.
    assert_eq!(ended.code, 3, "{}{}", ended.results, ended.messages);
    assert_eq!(text(&cell.table("runs", "mon"), "verdict", 0), "not_shown");
    assert!(ended.results.contains("(30 poses in 1"), "{}", ended.results);
    let accuracy = cell.table("accuracy", "mon");
    let bounds =
        rows(&accuracy, &[("name", "bound"), ("split", "blocks"), ("point", "measured_point")]);
    assert!(bounds.len() >= 3, "{bounds:?}");
    for row in bounds {
        let (n, visits) = (accuracy.i64("n").value(row), accuracy.i64("visits").value(row));
        // A beam is lost now and then.
        assert!(n == 30 && (150..=180).contains(&visits), "{n} poses, {visits} visits");
        assert!(accuracy.f64("value").is_null(row));
        assert_eq!(text(&accuracy, "verdict", row), "not_shown");
    }
    let steps = cell.table("grid_steps", "mon");
    for row in 0..steps.rows() {
        let (n, visits) = (steps.i64("held_out").value(row), steps.i64("visits").value(row));
        assert!(n <= 30 && visits <= 6 * n, "{n} poses, {visits} visits");
        assert_eq!(text(&steps, "verdict", row), "not_shown");
    }
    one_fold_a_pose(&cell);
}

/// No pose has visits in two folds: those in training would tell of those held out.
fn one_fold_a_pose(cell: &Cell) {
    let residuals = cell.table("residuals", "mon");
    let mut folds: BTreeMap<i64, BTreeSet<i64>> = BTreeMap::new();
    for row in rows(&residuals, &[("split", "blocks"), ("model", "full"), ("angles", "weighted")]) {
        let station = residuals.i64("station").value(row);
        folds.entry(station % 30).or_default().insert(residuals.i64("fold").value(row));
    }
    assert_eq!(folds.len(), 30);
    assert!(folds.values().all(|own| own.len() == 1), "{folds:?}");
    let used: BTreeSet<&i64> = folds.values().flatten().collect();
    assert!(used.len() > 4, "the poses are in {used:?} only");
}

#[test]
fn visits_of_one_pose_in_a_test_session_count_once_and_never_where_they_found_the_base() {
    let cell = with_thirty(monday(), "tue", 6)
        .with("[output]", "[report]\nlocate = { by = \"first\", stations = 10 }\n\n[output]");
    let ended = cell.run(&["mon", "--test", "tue", "--verbose"]);
    ended.expect(3, &["judged by test session tue: not shown"]);
    let accuracy = cell.table("accuracy", "mon");
    let words = [
        ("name", "bound"),
        ("of_session", "tue"),
        ("base_refit", "first"),
        ("model", "full"),
        ("angles", "commanded"),
    ];
    let bound = row(&accuracy, &words);
    // Ten of the thirty find the base.
    let (n, visits) = (accuracy.i64("n").value(bound), accuracy.i64("visits").value(bound));
    assert!(n == 20 && (100..=120).contains(&visits), "{n} poses, {visits} visits");
    let reason = text(&accuracy, "reason", bound);
    assert!(
        reason.contains("10 stations find the base")
            && reason.contains("more are visits of their poses"),
        "{reason}"
    );
}
