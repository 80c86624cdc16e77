//! `posegrid compensate` from files to files: a table as a run publishes it, targets as somebody else writes them.

mod cell;
mod commands;
mod damaged;
mod forms;
mod fuzz;
mod programs;
mod quickstart;
mod recorded;
mod used_with;
mod worked;

use std::f64::consts::PI;
use std::fs;

use arrow::array::{Array as _, StringArray};
use nalgebra::{Point3, Vector3};
use posegrid::cli::compensate::UsedWithArgs;
use posegrid::compensation::{Exception, Term};
use posegrid::files::schema;
use posegrid::files::table::{self, Columns};
use posegrid::geometry::Position;
use posegrid::io::compensation_table::{self, TableVerdict};
use posegrid::manifest::RunKey;

use cell::{COUNTS, Cell, REFUSED, SAMPLE, STEP_MM, Sample, field};

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
    // 0.02 mm of the nodes, 0.02 mm of the surveyed base and its 0.001° at 450.4 mm from the x axis, 0.0079 mm; along y at 875.5 mm.
    assert_eq!(field(&csv, "wing, left", "correction_sd_x_mm"), "0.029357");
    assert_eq!(field(&csv, "wing, left", "correction_sd_y_mm"), "0.032148");
    assert_eq!(field(&csv, "A", "target_y_mm"), "-20.250000");
    assert_eq!(field(&csv, "A", "table_id"), "t-1");
    assert_eq!(field(&csv, "A", "run"), "00ff");
    assert_eq!(field(&csv, "A", "refused"), "");
    let order: Vec<_> = csv.lines().skip(1).map(|line| line.contains("wing")).collect();
    assert_eq!(order, [true, false], "rows stay in the order of the program");
    let said = done.to_string();
    assert!(said.contains("tool \"drill\", payload 12.5 kg, 19.2 to 21.5 °C"), "{said}");
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
        assert_eq!(field(&csv, target, "x_mm").is_empty(), !word.is_empty(), "{target}");
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
    assert!(said.contains("node 0 at (600.000, -100.000, 400.000) mm has no value"), "{said}");
    let (done, _) = cell.csv("target,x_mm,y_mm,z_mm\nfar,950.5,20,450\n").unwrap();
    assert_eq!(done.exit_code(), 1, "none is corrected");
}

#[test]
fn parquet_in_parquet_out_and_no_second_correction() {
    let cell = Cell::new(&SAMPLE);
    let targets = Columns::new(schema::find("targets").unwrap(), 2)
        .column("target", ["Z first", "A second"])
        .group(["x_mm", "y_mm", "z_mm"], [[751.0, 20.0, 450.0], [700.0, 20.0, 450.0]])
        .column("joints_rad", [Some(vec![0.0; 6]), None])
        .rest_absent()
        .finish()
        .unwrap();
    fs::write(cell.path("targets.parquet"), table::write(&targets, Vec::new()).unwrap()).unwrap();
    let (done, stdout) = cell.compensate("targets.parquet", Some("out.parquet")).unwrap();
    assert_eq!((done.exit_code(), stdout.as_str()), (0, ""));
    assert!(done.to_string().contains("joint angles of 1 targets are without effect"));
    let out =
        table::read(&cell.path("out.parquet"), schema::find("corrected_targets").unwrap()).unwrap();
    assert_eq!(out.text("target"), &StringArray::from(vec!["Z first", "A second"]));
    assert!((out.f64("x_mm").value(0) - (600.0 + 150.0 / 1.002)).abs() < 1e-8);
    assert_eq!(out.text("refused").null_count(), 2);
    // The same bytes again, under another name; nothing is written over.
    cell.compensate("targets.parquet", Some("again.parquet")).unwrap();
    assert_eq!(
        fs::read(cell.path("out.parquet")).unwrap(),
        fs::read(cell.path("again.parquet")).unwrap()
    );
    let error = cell.compensate("targets.parquet", Some("out.parquet")).unwrap_err();
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
    fs::write(cell.path("targets.csv"), "target,x_mm,y_mm,z_mm\nA,751,20,450\n").unwrap();
    let error = cell.compensate("targets.csv", Some("missing/out.csv")).unwrap_err();
    assert_eq!(error.exit_code(), 1);
    assert!(error.to_string().contains("missing/out.csv"), "{error}");
    let error = cell.compensate("targets.csv", Some("out.xlsx")).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert_eq!(fs::read_dir(cell.folder.path()).unwrap().count(), 2, "the table and the targets");
}

#[test]
fn a_table_that_is_not_met_or_not_shown_corrects_only_where_that_is_allowed() {
    let none = UsedWithArgs::default();
    for (verdict, own, other, told) in [
        (
            "not_met",
            Exception::NotMet,
            Exception::NotShown,
            "does not meet its pipeline's tolerance",
        ),
        (
            "not_shown",
            Exception::NotShown,
            Exception::NotMet,
            "was not shown to meet its pipeline's tolerance",
        ),
    ] {
        let cell = Cell::new(&Sample { verdict, ..SAMPLE });
        fs::write(
            cell.path("targets.csv"),
            "target,x_mm,y_mm,z_mm,tool\nA,751,20,450,\nB,751,20,450,rivet\n",
        )
        .unwrap();
        for allow in [&[][..], &[other]] {
            let error =
                cell.compensate_with("targets.csv", Some("out.csv"), allow, &none).unwrap_err();
            let option = format!("--allow {}", verdict.replace('_', "-"));
            assert_eq!(error.exit_code(), 2);
            let error = error.to_string();
            assert!(error.contains(told) && error.contains(&option), "{error}");
            assert!(!cell.path("out.csv").exists());
        }
        let (done, csv) = cell.compensate_with("targets.csv", None, &[own], &none).unwrap();
        assert_eq!(done.exit_code(), 3);
        assert!(done.to_string().contains(told), "{done}");
        assert_eq!(field(&csv, "A", "allowed"), verdict);
        let tool = Exception::Term(Term::Tool);
        let (_, csv) = cell.compensate_with("targets.csv", None, &[tool, own], &none).unwrap();
        assert_eq!(field(&csv, "B", "allowed"), format!("{verdict} tool"));
        assert_eq!(field(&csv, "A", "allowed"), verdict);
    }
}

#[test]
fn no_correction_is_larger_than_one_and_a_half_times_what_the_run_saw() {
    // The error is 1 to 1.6 mm in x and 0.5 mm in z: at x = 751 mm, (1.2994, 0, −0.5) mm, 1.392 mm.
    let targets = "target,x_mm,y_mm,z_mm\nA,751,20,450\nB,610,20,450\n";
    let within = Cell::new(&Sample { largest_error_mm: Some(1.392 / 1.5 + 0.01), ..SAMPLE });
    let (done, csv) = within.csv(targets).unwrap();
    assert_eq!(done.exit_code(), 0, "{}", field(&csv, "A", "reason"));
    let cell = Cell::new(&Sample { largest_error_mm: Some(0.9), ..SAMPLE });
    let (done, csv) = cell.csv(targets).unwrap();
    assert_eq!(done.exit_code(), 3, "{done}");
    assert_eq!(field(&csv, "A", "refused"), "too_large");
    assert_eq!(field(&csv, "A", "x_mm"), "");
    let reason = field(&csv, "A", "reason");
    for part in ["by 1.39", "was 0.900 mm", "flange_from_tool"] {
        assert!(reason.contains(part), "{part}: {reason}");
    }
    // (1.02, 0, −0.5) mm is 1.13 mm, within 1.35 mm.
    assert_eq!(field(&csv, "B", "refused"), "");
}

#[test]
fn a_published_table_comes_back_whole() {
    let cell = Cell::new(&Sample { turn_rad: PI, power: Some(2.0), ..SAMPLE });
    let published = compensation_table::read(&cell.table).unwrap();
    assert_eq!(published.key, RunKey::new("ur10", "monday", "00ff"));
    assert_eq!(published.verdict, TableVerdict::Met);
    let table = &published.table;
    let terms = table.terms();
    assert_eq!((terms.table_id.as_str(), terms.idw_power), ("t-1", 2.0));
    assert_eq!(terms.configuration.as_deref(), Some("shoulder+ elbow- wrist+"));
    assert_eq!(terms.validity.temperature_c, Some([19.25, 21.5]));
    assert_eq!((table.lattice().counts, table.lattice().step), (COUNTS, [STEP_MM; 3]));
    // The lattice's x is the frame of commands' −x: node 1 lies at (−700, 100, 400), and its error of 1.2 mm points to −x.
    let place = table.position(1);
    assert!((place.point() - Point3::new(-700.0, 100.0, 400.0)).norm() < 1e-9, "{place:?}");
    let found = table.error_at(&place).unwrap();
    assert!((found.error - Vector3::new(-1.2, 0.0, -0.5)).norm() < 1e-9, "{found:?}");
    assert!((found.covariance[(0, 0)] - 0.0004).abs() < 1e-15);
    assert!(table.nodes()[REFUSED].is_err());
    assert!(table.error_at(&Position::claim(Point3::new(-600.0, 100.0, 450.0))).is_err());
}

#[test]
fn a_table_with_a_wrong_value_is_refused_by_what_and_where() {
    let cases: [(Sample, &str); 6] = [
        (
            Sample { table_id: |node| if node == 7 { "t-2" } else { "t-1" }, ..SAMPLE },
            "column \"table_id\": row 0 has t-1 and row 7 has t-2",
        ),
        (
            Sample { place: |node| node + usize::from(node > 20), ..SAMPLE },
            "node 21: node and index are [22, 1, 2, 1] where [21, 1, 2, 1] has its place",
        ),
        (
            Sample { shift_mm: |node| if node == 30 { 0.001 } else { 0.0 }, ..SAMPLE },
            "node 30: it lies 0.001000 mm off the lattice",
        ),
        (
            Sample { shift_mm: |node| -100.0 * (node % 4) as f64, ..SAMPLE },
            "node 1: it lies 100.000000 mm off the lattice",
        ),
        (Sample { power: Some(-1.0), ..SAMPLE }, "column \"idw_power\""),
        (Sample { variance_mm2: -1.0, ..SAMPLE }, "node 1: a variance is negative"),
    ];
    for (sample, expected) in cases {
        let cell = Cell::new(&sample);
        let error = cell.csv("target,x_mm,y_mm,z_mm\nA,751,20,450\n").unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains(expected), "{error}");
    }
    let cell = Cell::new(&SAMPLE);
    fs::write(&cell.table, "target,x_mm\n").unwrap();
    let error = cell.csv("target,x_mm,y_mm,z_mm\nA,751,20,450\n").unwrap_err();
    assert!(error.to_string().contains("as a Parquet file"), "{error}");
}
