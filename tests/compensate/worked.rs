//! The README's worked example: its numbers are a table's, and a calculator finds what `posegrid compensate` does.

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use posegrid::compensation::{CompensationTable, Known, Target, Terms, Validity, compensate};
use posegrid::geometry::{Position, Transform};
use posegrid::grid::{Interpolation, Lattice};

/// The README's numbers have this many digits, mm.
const HALF_DIGIT_MM: f64 = 0.5e-6;

/// The README from the line that begins the example.
fn example() -> String {
    let readme = std::fs::read_to_string("README.md").unwrap();
    let start = readme
        .find("### A target by hand")
        .expect("the README has the example");
    let text = &readme[start..];
    let end = text[4..].find("\n## ").map_or(text.len(), |end| end + 4);
    text[..end].replace('−', "-")
}

/// The numbers of each row of the example's table: x, y, z, weight, errors.
fn rows(text: &str) -> Vec<[f64; 7]> {
    let numbers = |line: &str| -> Option<[f64; 7]> {
        let cells = line
            .trim()
            .trim_matches('|')
            .split('|')
            .map(|cell| cell.trim().parse().ok());
        cells.collect::<Option<Vec<f64>>>()?.try_into().ok()
    };
    text.lines().filter_map(numbers).collect()
}

/// The three numbers in parentheses that follow some words.
fn after(text: &str, words: &str) -> Vector3<f64> {
    let text = text.replace('\n', " ");
    let (_, rest) = text
        .split_once(words)
        .unwrap_or_else(|| panic!("{words:?} is not in {text}"));
    let inside = rest.split(['(', ')']).nth(1).unwrap();
    let numbers: Vec<f64> = inside
        .split(',')
        .map(|n| n.trim().parse().unwrap())
        .collect();
    Vector3::from_column_slice(&numbers)
}

#[test]
fn the_readme_is_right() {
    let text = example();
    let rows = rows(&text);
    assert_eq!(rows.len(), 8);
    let target = after(&text, "The target is at");
    // By hand: each weight from the place, each axis the sum of weight times error.
    let (low, high) = (
        Vector3::from_row_slice(&rows[0][..3]),
        Vector3::from_row_slice(&rows[7][..3]),
    );
    let mut sum = Vector3::zeros();
    for [x, y, z, weight, errors @ ..] in &rows {
        let node = Vector3::new(*x, *y, *z);
        let share =
            |axis: usize| 1.0 - (target[axis] - node[axis]).abs() / (high[axis] - low[axis]);
        assert!(
            (weight - share(0) * share(1) * share(2)).abs() < 1e-12,
            "{node}"
        );
        sum += Vector3::from(*errors) * *weight;
    }
    assert!(
        (sum - after(&text, "error at the target")).amax() < HALF_DIGIT_MM,
        "{sum}"
    );
    let first = after(&text, "first command");
    assert!(
        (target - sum - first).amax() < 2.0 * HALF_DIGIT_MM,
        "{}",
        target - sum
    );
    // By the program.
    let lattice = Lattice {
        origin: Point3::from(low),
        step: (high - low).into(),
        counts: [2; 3],
    };
    let known = |row: &[f64; 7]| Known {
        joints: vec![0.0; 6],
        error: Vector3::new(row[4], row[5], row[6]),
        covariance: Matrix3::identity(),
    };
    let terms = Terms {
        table_id: "readme".to_owned(),
        orientation: UnitQuaternion::identity(),
        orientation_tolerance_rad: 0.1,
        configuration: None,
        interpolation: Interpolation::Trilinear,
        idw_power: 0.0,
        validity: Validity::default(),
    };
    let nodes = rows.iter().map(|row| Ok(known(row))).collect();
    let table = CompensationTable::new(terms, Transform::identity(), lattice, nodes).unwrap();
    let wanted = Target {
        name: "A".to_owned(),
        position: Some(Position::claim(Point3::from(target))),
        ..Target::default()
    };
    let found = compensate(&table, &wanted).unwrap().command.coords();
    assert!(
        (found - after(&text, "posegrid compensate` says")).amax() < HALF_DIGIT_MM,
        "{found}"
    );
    // The step that the calculator left out is as small as the text says.
    assert!(
        (found - first).norm() < 0.0005 && (found - first).norm() > 0.00005,
        "{}",
        (found - first).norm()
    );
}
