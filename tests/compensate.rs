//! `posegrid compensate` from files to files: a table as a run publishes it, targets as somebody else writes them.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

use arrow::array::{Array as _, StringArray};
use nalgebra::{Point3, Vector3};
use posegrid::cli::compensate::{
    self, CompensateArgs, CompensateCommandError, Compensated, UsedWithArgs,
};
use posegrid::geometry::Position;
use posegrid::io::compensation_table::{self, TableVerdict};
use posegrid::io::schema;
use posegrid::io::table::{self, Columns, Table};
use posegrid::manifest::RunKey;

const COUNTS: [usize; 3] = [4, 3, 3];
const NODES: usize = 36;
const STEP_MM: f64 = 100.0;
/// The node at (600, −100, 400) mm has no value.
const REFUSED: usize = 0;

/// What a test changes of the sample table.
#[derive(Clone, Copy)]
struct Sample {
    /// The frame of commands is turned by this about z against the lattice.
    turn_rad: f64,
    table_id: fn(usize) -> &'static str,
    place: fn(usize) -> usize,
    power: Option<f64>,
    shift_mm: fn(usize) -> f64,
    variance_mm2: f64,
    verdict: &'static str,
}

const SAMPLE: Sample = Sample {
    turn_rad: 0.0,
    table_id: |_| "t-1",
    place: |node| node,
    power: None,
    shift_mm: |_| 0.0,
    variance_mm2: 0.0004,
    verdict: "met",
};

fn index(node: usize) -> [usize; 3] {
    let [nx, ny, _] = COUNTS;
    [node % nx, node / nx % ny, node / (nx * ny)]
}

fn turned(sample: &Sample, [x, y, z]: [f64; 3]) -> [f64; 3] {
    let (sin, cos) = sample.turn_rad.sin_cos();
    [cos * x - sin * y, sin * x + cos * y, z]
}

/// 1 mm along the lattice's x, and 2 µm more per mm of it; −0.5 mm along z.
fn stretch([x, _, _]: [f64; 3]) -> [f64; 3] {
    [1.0 + 0.002 * (x - 600.0), 0.0, -0.5]
}

fn sample_table(sample: &Sample) -> Table {
    let nodes = 0..NODES;
    let on_lattice = |node: usize| {
        let [i, j, k] = index(node).map(|index| index as f64 * STEP_MM);
        [600.0 + i + (sample.shift_mm)(node), -100.0 + j, 400.0 + k]
    };
    let known = |node: usize| (node != REFUSED).then_some(node);
    let variance = [1.0, 0.0, 0.0, 1.0, 0.0, 1.0].map(|part| part * sample.variance_mm2);
    let indices = |axis: usize| nodes.clone().map(move |node| index(node)[axis]);
    let half = sample.turn_rad / 2.0;
    let columns = Columns::new(schema::find("compensation").unwrap(), nodes.len())
        .key(&RunKey::new("ur10", "monday", "00ff"))
        .column("node", nodes.clone().map(sample.place))
        .same("orientation", 0_u64)
        .column("index_x", indices(0))
        .column("index_y", indices(1))
        .column("index_z", indices(2))
        .column("table_id", nodes.clone().map(sample.table_id))
        .group(
            ["x_mm", "y_mm", "z_mm"],
            nodes.clone().map(|node| turned(sample, on_lattice(node))),
        )
        .group(
            ["qx", "qy", "qz", "qw"],
            nodes.clone().map(|_| [0.0, 0.0, half.sin(), half.cos()]),
        )
        .same("configuration", Some("shoulder+ elbow- wrist+"))
        .same("joint_names", &["a1", "a2", "a3", "a4", "a5", "a6"][..])
        .column(
            "joints_rad",
            nodes.clone().map(|node| known(node).map(|_| vec![0.1; 6])),
        )
        .group(
            ["error_x_mm", "error_y_mm", "error_z_mm"],
            nodes
                .clone()
                .map(|node| known(node).map(|node| turned(sample, stretch(on_lattice(node))))),
        )
        .group(
            [
                "error_cov_xx_mm2",
                "error_cov_xy_mm2",
                "error_cov_xz_mm2",
                "error_cov_yy_mm2",
                "error_cov_yz_mm2",
                "error_cov_zz_mm2",
            ],
            nodes.clone().map(|node| known(node).map(|_| variance)),
        )
        .column(
            "error_sd_mm",
            nodes
                .clone()
                .map(|node| known(node).map(|_| 0.02 * 3.0_f64.sqrt())),
        )
        .column(
            "refused",
            nodes
                .clone()
                .map(|node| (node == REFUSED).then_some("singularity")),
        );
    support(terms(columns, sample), nodes.len())
        .finish()
        .unwrap()
}

/// What a table says of itself, the same in every row.
fn terms(columns: Columns, sample: &Sample) -> Columns {
    let half = sample.turn_rad / 2.0;
    let interpolation = if sample.power.is_some() {
        "idw"
    } else {
        "trilinear"
    };
    columns
        .group(
            [
                "command_from_base_x_mm",
                "command_from_base_y_mm",
                "command_from_base_z_mm",
            ],
            vec![[0.0; 3]; NODES],
        )
        .group(
            [
                "command_from_base_qx",
                "command_from_base_qy",
                "command_from_base_qz",
                "command_from_base_qw",
            ],
            vec![[0.0, 0.0, half.sin(), half.cos()]; NODES],
        )
        .same("step_x_mm", STEP_MM)
        .same("step_y_mm", STEP_MM)
        .same("step_z_mm", STEP_MM)
        .same("source", "model")
        .same("interpolation", interpolation)
        .same("idw_power", sample.power)
        .same("angles", "reported")
        .same("orientation_tolerance_deg", 5.0)
        .same("verdict", sample.verdict)
        .same("tool", Some("drill"))
        .same("payload_kg", Some(12.5))
        .same("temperature_min_c", Some(19.25))
        .same("temperature_max_c", Some(21.5))
        .absent([
            "mounting",
            "base",
            "controller_model",
            "absolute_accuracy_option",
        ])
}

/// Columns that only people read.
fn support(columns: Columns, nodes: usize) -> Columns {
    let known = |node: usize| (node != REFUSED).then_some(node);
    columns
        .same("nearest_station_mm", Some(12.0))
        .column(
            "nearest_station_rad",
            (0..nodes).map(|node| known(node).map(|_| 0.05)),
        )
        .same("stations_near", 3_u64)
        .column(
            "within_joint_ranges",
            (0..nodes).map(|node| known(node).map(|_| true)),
        )
}

fn save(folder: &Path, sample: &Sample) -> PathBuf {
    let path = folder.join("table.parquet");
    fs::write(
        &path,
        table::write(&sample_table(sample), Vec::new()).unwrap(),
    )
    .unwrap();
    path
}

struct Cell {
    folder: tempfile::TempDir,
    table: PathBuf,
}

impl Cell {
    fn new(sample: &Sample) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let table = save(folder.path(), sample);
        Self { folder, table }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn compensate(
        &self,
        targets: &str,
        out: Option<&str>,
    ) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        let args = CompensateArgs {
            table: self.table.clone(),
            targets: self.path(targets),
            out: out.map(|out| self.path(out)),
            allow: None,
            used_with: UsedWithArgs::default(),
        };
        let mut stdout = Vec::new();
        let compensated = compensate::run(&args, &mut stdout)?;
        Ok((compensated, String::from_utf8(stdout).unwrap()))
    }

    fn csv(&self, rows: &str) -> Result<(Compensated, String), Box<CompensateCommandError>> {
        fs::write(self.path("targets.csv"), rows).unwrap();
        self.compensate("targets.csv", None)
    }
}

/// The cell of a column in the row of a target.
fn field(csv: &str, target: &str, column: &str) -> String {
    let mut reader = csv::Reader::from_reader(csv.as_bytes());
    let place = |reader: &mut csv::Reader<&[u8]>, name: &str| {
        reader
            .headers()
            .unwrap()
            .iter()
            .position(|c| c == name)
            .unwrap()
    };
    let (name, wanted) = (place(&mut reader, "target"), place(&mut reader, column));
    let row = reader
        .records()
        .map(Result::unwrap)
        .find(|row| &row[name] == target)
        .unwrap();
    row[wanted].to_owned()
}

#[test]
fn a_csv_of_targets_becomes_a_csv_of_commands() {
    let cell = Cell::new(&SAMPLE);
    let (done, csv) = cell
        .csv("target,x_mm,y_mm,z_mm\n\"wing, left\",751,20,450\nA,652.5,-20.25,555.125\n")
        .unwrap();
    assert_eq!(done.exit_code(), 0, "{done}");
    // c + 1 + 0.002 (c − 600) = 751 has c = 600 + 150 / 1.002 = 749.700599 mm.
    assert_eq!(field(&csv, "wing, left", "x_mm"), "749.700599");
    assert_eq!(field(&csv, "wing, left", "y_mm"), "20.000000");
    assert_eq!(field(&csv, "wing, left", "z_mm"), "450.500000");
    assert_eq!(field(&csv, "wing, left", "correction_x_mm"), "-1.299401");
    assert_eq!(field(&csv, "wing, left", "correction_sd_x_mm"), "0.020000");
    assert_eq!(field(&csv, "A", "target_y_mm"), "-20.250000");
    assert_eq!(field(&csv, "A", "table_id"), "t-1");
    assert_eq!(field(&csv, "A", "run"), "00ff");
    assert_eq!(field(&csv, "A", "refused"), "");
    let order: Vec<_> = csv
        .lines()
        .skip(1)
        .map(|line| line.contains("wing"))
        .collect();
    assert_eq!(
        order,
        [true, false],
        "rows stay in the order of the program"
    );
    let said = done.to_string();
    assert!(
        said.contains("tool \"drill\", payload 12.5 kg, 19.2 to 21.5 °C"),
        "{said}"
    );
    assert!(said.contains("2 targets state no orientation"), "{said}");
    assert!(
        said.ends_with("2 targets: 2 corrected, refused: none; largest correction 1.392 mm"),
        "{said}"
    );
}

#[test]
fn a_refused_target_is_a_row_with_its_reason_and_no_command() {
    let cell = Cell::new(&SAMPLE);
    let rows = "target,x_mm,y_mm,z_mm,qx,qy,qz,qw,tool\n\
                fine,751,20,450,0,0,0,1,drill\nfar,950.5,20,450,,,,,\nhole,610,-90,410,,,,,\n\
                turned,751,20,450,0.70710678,0,0,0.70710678,\nother,751,20,450,,,,,rivet\n";
    let (done, csv) = cell.csv(rows).unwrap();
    assert_eq!(done.exit_code(), 3);
    for (target, word) in [
        ("fine", ""),
        ("far", "outside"),
        ("hole", "refused_node"),
        ("turned", "orientation"),
        ("other", "tool"),
    ] {
        assert_eq!(field(&csv, target, "refused"), word);
        assert_eq!(
            field(&csv, target, "x_mm").is_empty(),
            !word.is_empty(),
            "{target}"
        );
    }
    let reason = field(&csv, "far", "reason");
    assert!(
        reason.starts_with("target \"far\" lies 50.5000 mm along +x beyond the table's box"),
        "{reason}"
    );
    assert_eq!(field(&csv, "far", "target_x_mm"), "950.500000");
    let said = done.to_string();
    assert!(
        said.contains(
            "5 targets: 1 corrected, refused: 1 orientation, 1 outside, 1 refused_node, 1 tool"
        ),
        "{said}"
    );
    assert!(
        said.contains("node 0 at (600.000, -100.000, 400.000) mm has no value"),
        "{said}"
    );
    let (done, _) = cell
        .csv("target,x_mm,y_mm,z_mm\nfar,950.5,20,450\n")
        .unwrap();
    assert_eq!(done.exit_code(), 1, "none is corrected");
}

#[test]
fn parquet_in_parquet_out_and_no_second_correction() {
    let cell = Cell::new(&SAMPLE);
    let targets = Columns::new(schema::find("targets").unwrap(), 2)
        .column("target", ["Z first", "A second"])
        .group(
            ["x_mm", "y_mm", "z_mm"],
            [[751.0, 20.0, 450.0], [700.0, 20.0, 450.0]],
        )
        .absent(["qx", "qy", "qz", "qw", "configuration", "tool", "table_id"])
        .absent(["joint_names"])
        .column("joints_rad", [Some(vec![0.0; 6]), None])
        .finish()
        .unwrap();
    fs::write(
        cell.path("targets.parquet"),
        table::write(&targets, Vec::new()).unwrap(),
    )
    .unwrap();
    let (done, stdout) = cell
        .compensate("targets.parquet", Some("out.parquet"))
        .unwrap();
    assert_eq!((done.exit_code(), stdout.as_str()), (0, ""));
    assert!(
        done.to_string()
            .contains("joint angles of 1 targets are without effect")
    );
    let out = table::read(
        &cell.path("out.parquet"),
        schema::find("corrected_targets").unwrap(),
    )
    .unwrap();
    assert_eq!(
        out.text("target"),
        &StringArray::from(vec!["Z first", "A second"])
    );
    assert!((out.f64("x_mm").value(0) - (600.0 + 150.0 / 1.002)).abs() < 1e-8);
    assert_eq!(out.text("refused").null_count(), 2);
    // The same bytes again, under another name; nothing is written over.
    cell.compensate("targets.parquet", Some("again.parquet"))
        .unwrap();
    assert_eq!(
        fs::read(cell.path("out.parquet")).unwrap(),
        fs::read(cell.path("again.parquet")).unwrap()
    );
    let error = cell
        .compensate("targets.parquet", Some("out.parquet"))
        .unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("exists already"), "{error}");
    // Commands are no targets.
    let error = cell.compensate("out.parquet", None).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(
        error
            .to_string()
            .contains("row 0: target \"Z first\" is corrected already, with table \"t-1\""),
        "{error}"
    );
    cell.compensate("targets.parquet", Some("out.csv")).unwrap();
    assert!(
        cell.compensate("out.csv", None)
            .unwrap_err()
            .to_string()
            .contains("line 2: target \"Z first\" is corrected already")
    );
}

#[test]
fn a_result_that_cannot_be_written_leaves_nothing() {
    let cell = Cell::new(&SAMPLE);
    fs::write(
        cell.path("targets.csv"),
        "target,x_mm,y_mm,z_mm\nA,751,20,450\n",
    )
    .unwrap();
    let error = cell
        .compensate("targets.csv", Some("missing/out.csv"))
        .unwrap_err();
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("missing/out.csv"), "{error}");
    let error = cell
        .compensate("targets.csv", Some("out.xlsx"))
        .unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert_eq!(
        fs::read_dir(cell.folder.path()).unwrap().count(),
        2,
        "the table and the targets"
    );
}

#[test]
fn a_table_that_does_not_meet_its_tolerance_corrects_and_says_so() {
    let cell = Cell::new(&Sample {
        verdict: "not_met",
        ..SAMPLE
    });
    let (done, _) = cell.csv("target,x_mm,y_mm,z_mm\nA,751,20,450\n").unwrap();
    assert_eq!(done.exit_code(), 3);
    assert!(
        done.to_string()
            .contains("does not meet its pipeline's tolerance"),
        "{done}"
    );
}

#[test]
fn a_published_table_comes_back_whole() {
    let cell = Cell::new(&Sample {
        turn_rad: PI,
        power: Some(2.0),
        ..SAMPLE
    });
    let published = compensation_table::read(&cell.table).unwrap();
    assert_eq!(published.key, RunKey::new("ur10", "monday", "00ff"));
    assert_eq!(published.verdict, TableVerdict::Met);
    let table = &published.table;
    let terms = table.terms();
    assert_eq!((terms.table_id.as_str(), terms.idw_power), ("t-1", 2.0));
    assert_eq!(
        terms.configuration.as_deref(),
        Some("shoulder+ elbow- wrist+")
    );
    assert_eq!(terms.validity.temperature_c, Some([19.25, 21.5]));
    assert_eq!(
        (table.lattice().counts, table.lattice().step),
        (COUNTS, [STEP_MM; 3])
    );
    // The lattice's x is the frame of commands' −x: node 1 lies at (−700, 100, 400), and its error of 1.2 mm points to −x.
    let place = table.position(1);
    assert!(
        (place.point() - Point3::new(-700.0, 100.0, 400.0)).norm() < 1e-9,
        "{place:?}"
    );
    let found = table.error_at(&place).unwrap();
    assert!(
        (found.error - Vector3::new(-1.2, 0.0, -0.5)).norm() < 1e-9,
        "{found:?}"
    );
    assert!((found.covariance[(0, 0)] - 0.0004).abs() < 1e-15);
    assert!(table.nodes()[REFUSED].is_err());
    assert!(
        table
            .error_at(&Position::claim(Point3::new(-600.0, 100.0, 450.0)))
            .is_err()
    );
}

#[test]
fn a_table_with_a_wrong_value_is_refused_by_what_and_where() {
    let cases: [(Sample, &str); 6] = [
        (
            Sample {
                table_id: |node| if node == 7 { "t-2" } else { "t-1" },
                ..SAMPLE
            },
            "column \"table_id\": row 0 has \"t-1\" and row 7 has \"t-2\"",
        ),
        (
            Sample {
                place: |node| node + usize::from(node > 20),
                ..SAMPLE
            },
            "node 21: node and index are [22, 1, 2, 1] where [21, 1, 2, 1] has its place",
        ),
        (
            Sample {
                shift_mm: |node| if node == 30 { 0.001 } else { 0.0 },
                ..SAMPLE
            },
            "node 30: it lies 0.001000 mm off the lattice",
        ),
        (
            Sample {
                shift_mm: |node| -100.0 * (node % 4) as f64,
                ..SAMPLE
            },
            "node 1: it lies 100.000000 mm off the lattice",
        ),
        (
            Sample {
                power: Some(-1.0),
                ..SAMPLE
            },
            "column \"idw_power\"",
        ),
        (
            Sample {
                variance_mm2: -1.0,
                ..SAMPLE
            },
            "node 1: a variance is negative",
        ),
    ];
    for (sample, expected) in cases {
        let cell = Cell::new(&sample);
        let error = cell
            .csv("target,x_mm,y_mm,z_mm\nA,751,20,450\n")
            .unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(expected), "{error}");
    }
    let cell = Cell::new(&SAMPLE);
    fs::write(&cell.table, "target,x_mm\n").unwrap();
    let error = cell
        .csv("target,x_mm,y_mm,z_mm\nA,751,20,450\n")
        .unwrap_err();
    assert!(error.to_string().contains("as a Parquet file"), "{error}");
}
