//! Targets corrected by the table that a run published: command + ê(command) is the target, by hand.

use std::fs;
use std::path::PathBuf;

use arrow::array::Array as _;
use posegrid::files::table::Table;

use super::cell::{alone, ended, posegrid, undisturbed};

/// A fixed point is found within 1 µm, and files of targets have a nanometre's digits.
const NEAR_MM: f64 = 0.0012;

/// Nodes of a table as this test understands them: places, errors, and counts along the axes.
struct Nodes {
    places: Vec<[f64; 3]>,
    errors: Vec<[f64; 3]>,
    indices: Vec<[i64; 3]>,
    step_mm: [f64; 3],
}

impl Nodes {
    fn of(table: &Table) -> Self {
        let triples = |names: [&str; 3]| -> Vec<[f64; 3]> {
            let columns = names.map(|name| table.f64(name));
            let row = |row: usize| columns.map(|column| column.value(row));
            (0..table.rows()).map(row).collect()
        };
        let indices = ["index_x", "index_y", "index_z"].map(|name| table.i64(name));
        let index = |row: usize| indices.map(|column| column.value(row));
        Self {
            places: triples(["x_mm", "y_mm", "z_mm"]),
            errors: triples(["error_x_mm", "error_y_mm", "error_z_mm"]),
            indices: (0..table.rows()).map(index).collect(),
            step_mm: triples(["step_x_mm", "step_y_mm", "step_z_mm"])[0],
        }
    }

    fn at(&self, index: [i64; 3]) -> usize {
        let found = self.indices.iter().position(|other| *other == index);
        found.expect("a node of the lattice")
    }

    /// The trilinear error in the first cell: Σ over its 8 nodes of Π (1 − distance/step) · error, mm.
    fn error(&self, place: [f64; 3]) -> [f64; 3] {
        let mut error = [0.0; 3];
        for corner in 0..8 {
            let node = self.at([corner & 1, corner >> 1 & 1, corner >> 2 & 1]);
            let share = |axis: usize| {
                1.0 - (place[axis] - self.places[node][axis]).abs() / self.step_mm[axis]
            };
            let weight = share(0) * share(1) * share(2);
            for (sum, part) in error.iter_mut().zip(self.errors[node]) {
                *sum += weight * part;
            }
        }
        error
    }
}

#[test]
fn a_command_and_its_error_make_the_target_at_a_node_and_between_nodes() {
    let table = undisturbed().table("compensation", "mon");
    assert_eq!(table.text("interpolation").value(0), "trilinear");
    assert_eq!(table.text("refused").null_count(), table.rows(), "every node has a value");
    let nodes = Nodes::of(&table);
    let first = nodes.places[nodes.at([0, 0, 0])];
    let between = [0, 1, 2].map(|axis| first[axis] + [0.3, 0.5, 0.6][axis] * nodes.step_mm[axis]);
    // An inner node, for whose target the command is the node itself.
    let node = nodes.at([1, 1, 1]);
    let inner = nodes.places[node];
    let at_node = [0, 1, 2].map(|axis| inner[axis] + nodes.errors[node][axis]);
    let outside = [first[0] - 500.0, first[1], first[2]];

    let text = |place: [f64; 3]| place.map(|value| format!("{value:.6}")).join(",");
    let rows = format!(
        "target,x_mm,y_mm,z_mm\nnode,{}\nbetween,{}\noutside,{}\n",
        text(at_node),
        text(between),
        text(outside)
    );
    let run = compensated("three", &rows);
    run.0.expect(3, &["target \"outside\" lies 500.0000 mm along −x"]);
    let [node, cell, refused] = &run.1[..] else { panic!("in = corrected + refused: {:?}", run.1) };
    assert_near(node.expect("corrected"), inner);
    let command = cell.expect("corrected");
    let error = nodes.error(command);
    assert_near([0, 1, 2].map(|axis| command[axis] + error[axis]), between);
    let moved = (0..3).map(|axis| (command[axis] - between[axis]).powi(2));
    assert!(moved.sum::<f64>().sqrt() > 0.05, "a correction worth the name");
    assert_eq!(*refused, None, "nothing is extrapolated");
}

#[test]
fn targets_that_all_lie_inside_exit_with_0_and_all_outside_with_1() {
    let nodes = Nodes::of(&undisturbed().table("compensation", "mon"));
    let first = nodes.places[nodes.at([0, 0, 0])];
    let row = |shift: f64| {
        let [x, y, z] = first.map(|value| value + shift);
        format!("target,x_mm,y_mm,z_mm\nhole-1,{x},{y},{z}\n")
    };
    compensated("inside", &row(50.0)).0.expect(0, &["1 corrected"]);
    compensated("outside", &row(-50.0)).0.expect(1, &["hole-1"]);
}

/// Runs `compensate` on a file of these rows: how it ended, and each row's command.
fn compensated(name: &str, rows: &str) -> (super::cell::Ended, Vec<Option<[f64; 3]>>) {
    let cell = undisturbed();
    let targets: PathBuf = cell.path(&format!("{name}.csv"));
    fs::write(&targets, rows).expect("writable");
    let table = alone("compensation");
    let run = ended(posegrid().arg("compensate").arg(table).arg(targets));
    let mut reader = csv::Reader::from_reader(run.results.as_bytes());
    let headers = reader.headers().expect("a first line").clone();
    let column = |name: &str| headers.iter().position(|header| header == name);
    let columns = ["x_mm", "y_mm", "z_mm"].map(|name| column(name).expect("a column"));
    let command = |row: csv::StringRecord| -> Option<[f64; 3]> {
        let values: Vec<f64> =
            columns.iter().filter_map(|&column| row[column].parse().ok()).collect();
        values.try_into().ok()
    };
    let rows = reader.records();
    let commands = rows.map(|row| command(row.expect("a row"))).collect();
    (run, commands)
}

fn assert_near(found: [f64; 3], expected: [f64; 3]) {
    for axis in 0..3 {
        let difference = (found[axis] - expected[axis]).abs();
        assert!(difference < NEAR_MM, "{found:?} is not {expected:?} mm");
    }
}
