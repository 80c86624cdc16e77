//! Figures of ISO 9283 of a session that goes to poses again: those of the arm as it really is, in the table and on the page.

use std::collections::BTreeMap;
use std::fs;

use arrow::array::Array as _;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::cell::{Cell, files, undisturbed};

/// The middle of the work space and four places around it, degrees from home.
const FIVE: [[f64; 6]; 5] = [
    [0.0; 6],
    [12.0, 6.0, -6.0, 5.0, 4.0, -5.0],
    [-12.0, 6.0, -6.0, -5.0, 4.0, 5.0],
    [12.0, -6.0, 6.0, 5.0, -4.0, 5.0],
    [-12.0, -6.0, 6.0, -5.0, -4.0, -5.0],
];
const HOME: [f64; 6] = [0.0, -75.0, 100.0, 25.0, 55.0, -15.0];
/// Poses that are visited once, before the five.
const OTHERS: usize = 40;
/// How often the five are visited.
const CYCLES: usize = 6;

/// Other poses, spread by irrational steps, then the five in turn.
pub fn poses() -> String {
    let other = |number: usize| -> [f64; 6] {
        std::array::from_fn(|joint| {
            14.0 * (1.7 * number as f64 * (joint as f64 + 2.0).sqrt()).sin()
        })
    };
    let all = (1..=OTHERS).map(other).chain((0..CYCLES).flat_map(|_| FIVE));
    let line = |(number, offsets): (usize, [f64; 6])| {
        let joints =
            HOME.iter().zip(offsets).map(|(home, offset)| format!(",{:.6}", home + offset));
        format!("p{number}{}\n", joints.collect::<String>())
    };
    let lines: String = all.enumerate().map(line).collect();
    format!("target,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg\n{lines}")
}

/// Where the arm really stood at the visits of one of the five, by what the simulation says of it.
struct True {
    errors: Vec<Vector3<f64>>,
    turns: Vec<UnitQuaternion<f64>>,
}

fn truth(cell: &Cell, of_five: usize) -> True {
    let mut file =
        csv::Reader::from_path(cell.session("again").join("truth_stations.csv")).unwrap();
    let headers = file.headers().unwrap().clone();
    let rows: Vec<csv::StringRecord> = file.records().map(Result::unwrap).collect();
    let visits = rows.iter().skip(OTHERS + of_five).step_by(FIVE.len());
    let number = |row: &csv::StringRecord, column: &str| -> f64 {
        let place = headers.iter().position(|name| name == column).unwrap();
        row[place].parse().unwrap()
    };
    let error = |row| ["error_x_mm", "error_y_mm", "error_z_mm"].map(|column| number(row, column));
    let turn = |row| ["base_qw", "base_qx", "base_qy", "base_qz"].map(|column| number(row, column));
    True {
        errors: visits.clone().map(|row| error(row).into()).collect(),
        turns: visits
            .map(turn)
            .map(|[w, x, y, z]| UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)))
            .collect(),
    }
}

fn deviation(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let squares: f64 = values.map(|value| (value - mean).powi(2)).sum();
    (mean, (squares / (n - 1.0)).sqrt())
}

#[test]
fn repeated_visits_give_the_figures_of_the_arm_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("poses.csv");
    fs::write(&file, poses()).unwrap();
    let exact = ["--no-tracker-noise", "--outlier-share", "0", "--six-dof", "--poses"];
    let flags: Vec<&str> = exact.into_iter().chain(file.to_str()).collect();
    let cell = Cell::new()
        .with("/tracker/point", "/tracker/pose")
        .with("[fit]", "[fit]\norientations = true")
        .with("divisor = 2 }", "divisor = 2, orientation_rad = 1e-5 }")
        .with_simulated("again", &flags);
    // Whether any step can be shown to be good with so few stations is of no interest.
    let ended = cell.run(&[]);
    assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    let table = cell.table("accuracy", "again");
    let figures: BTreeMap<(String, String, Option<i64>), f64> = (0..table.rows())
        .filter(|&row| {
            table.text("quantity").value(row) == "iso_9283" && table.f64("value").is_valid(row)
        })
        .map(|row| {
            let text = |column: &str| table.text(column).value(row).to_owned();
            let poses = table.i64("pose");
            let pose = poses.is_valid(row).then(|| poses.value(row));
            ((text("model"), text("name"), pose), table.f64("value").value(row))
        })
        .collect();
    let figure = |model: &str, name: &str, pose: usize| {
        let key = (model.to_owned(), name.to_owned(), Some(i64::try_from(pose).unwrap()));
        *figures.get(&key).unwrap_or_else(|| panic!("{key:?} in {:?}", figures.keys()))
    };
    for of_five in 0..FIVE.len() {
        let (pose, truth) = (OTHERS + of_five, truth(&cell, of_five));
        let mean = truth.errors.iter().sum::<Vector3<f64>>() / CYCLES as f64;
        // What is logged is rounded to 0.1 µm and 0.1 µrad, the surveyed base to 1e-9 of a turn.
        let near = |name: &str, found: f64, expected: f64| {
            assert!(
                (found - expected).abs() < 2e-3,
                "{name} of {pose}: {found}, in truth {expected}"
            );
        };
        near("AP_p", figure("raw_command", "AP_p", pose), mean.norm());
        for (name, expected) in ["AP_x", "AP_y", "AP_z"].into_iter().zip(mean.iter()) {
            near(name, figure("raw_command", name, pose), *expected);
        }
        let (l, s) = deviation(truth.errors.iter().map(|error| (error - mean).norm()));
        for model in ["raw_command", "base_target"] {
            near("RP_l", figure(model, "RP_l", pose), l + 3.0 * s);
        }
        let first = truth.turns[0];
        for (axis, name) in ["RP_a", "RP_b", "RP_c"].into_iter().enumerate() {
            let about = truth.turns.iter().map(|turn| (turn * first.inverse()).scaled_axis()[axis]);
            let found = figure("base_target", name, pose);
            let expected = 3.0 * deviation(about).1;
            assert!(
                (found - expected).abs() < 2e-6,
                "{name} of {pose}: {found}, in truth {expected}"
            );
        }
    }
    let all: Vec<_> =
        figures.keys().filter(|(_, _, pose)| pose.is_some_and(|pose| pose < 40)).collect();
    assert!(all.is_empty(), "poses visited once have no figure: {all:?}");
    let page = page(&cell, "again");
    for value in figures.values() {
        assert!(page.contains(&format!("value=\"{value}\"")), "{value} is not on the page");
    }
}

fn page(cell: &Cell, session: &str) -> String {
    let mut pages = files(&cell.path("lake/report")).into_iter();
    let of_session = |(path, _): &(String, Vec<u8>)| path.contains(&format!("/{session}/"));
    let (_, bytes) = pages.find(of_session).expect("a page");
    String::from_utf8(bytes).unwrap()
}

#[test]
fn a_session_without_repeated_poses_says_so() {
    let table = undisturbed().table("accuracy", "mon");
    let rows: Vec<usize> =
        (0..table.rows()).filter(|&row| table.text("quantity").value(row) == "iso_9283").collect();
    let names: Vec<&str> = rows.iter().map(|&row| table.text("name").value(row)).collect();
    assert_eq!(names, ["AP_p", "RP_l"]);
    let reason = "no pose was commanded twice: 637 stations went to as many poses";
    for row in rows {
        assert!(table.f64("value").is_null(row));
        assert_eq!(table.text("reason").value(row), reason);
    }
    assert!(page(undisturbed(), "mon").contains(reason));
}
