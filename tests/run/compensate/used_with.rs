//! What targets will be run with, held against what the table is valid for: tool "drill", 12.5 kg, 19.25 to 21.5 °C.

use std::fs;

use posegrid::cli::compensate::{OnOff, UsedWithArgs};
use posegrid::compensation::{Exception, Term};

use super::cell::{Cell, SAMPLE, Sample, field};

const TARGETS: &str = "target,x_mm,y_mm,z_mm,tool\nA,751,20,450,\nB,752,20,450,drill\n";

fn cell() -> Cell {
    let cell = Cell::new(&SAMPLE);
    fs::write(cell.path("targets.csv"), TARGETS).unwrap();
    cell
}

fn with(payload_kg: f64, temperature_c: f64) -> UsedWithArgs {
    UsedWithArgs {
        payload_kg: Some(payload_kg),
        temperature_c: Some(temperature_c),
        ..UsedWithArgs::default()
    }
}

#[test]
fn what_is_within_outside_or_not_checked_is_reported() {
    let used = UsedWithArgs {
        base: Some("fixture".to_owned()),
        absolute_accuracy: Some(OnOff::Off),
        ..with(12.5, 20.0)
    };
    let (done, csv) = cell().compensate_with("targets.csv", None, &[], &used).unwrap();
    let said = done.to_string();
    assert!(said.contains("within what the table is valid for: payload, temperature\n"), "{said}");
    assert!(said.contains("as it is not stated for the targets: tool\n"), "{said}");
    assert!(
        said.contains("as the table does not state it: mounting, base, controller model, absolute-accuracy option\n"),
        "{said}"
    );
    assert!(
        said.contains("nodes in arm configuration \"shoulder+ elbow- wrist+\"; measured with joints -28.6° to 14.3°, ")
            && said.contains("the reflector at (25.00, -40.00, 100.00) mm on the flange"),
        "{said}"
    );
    assert_eq!((done.exit_code(), field(&csv, "A", "allowed")), (0, String::new()));
}

#[test]
fn a_table_that_is_not_valid_corrects_nothing_and_says_by_how_much() {
    let refused = |used: &UsedWithArgs, allow: &[Exception]| {
        let cell = cell();
        let error = cell.compensate_with("targets.csv", Some("out.csv"), allow, used).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(!cell.path("out.csv").exists());
        error.to_string()
    };
    let error = refused(&with(30.0, 25.0), &[]);
    assert!(
        error.contains(
            "payload 30 kg, 17.500 kg more than the table's 12.5 kg; temperature 25 °C, 3.50 °C above the 19.25 to 21.50 °C"
        ),
        "{error}"
    );
    // One exception is one: the other still counts.
    let error = refused(&with(30.0, 25.0), &[Exception::Term(Term::Payload)]);
    assert!(!error.contains("payload 30 kg") && error.contains("temperature 25 °C"), "{error}");
    let tool = UsedWithArgs { tool: Some("rivet".to_owned()), ..UsedWithArgs::default() };
    let error = refused(&tool, &[Exception::JointRange]);
    assert!(error.contains("tool \"rivet\", the table is for \"drill\""), "{error}");
}

#[test]
fn what_was_allowed_stands_at_each_target() {
    let cell = cell();
    let (done, csv) = cell
        .compensate_with(
            "targets.csv",
            None,
            &[Exception::Term(Term::Temperature)],
            &with(12.5, 25.0),
        )
        .unwrap();
    assert_eq!(field(&csv, "A", "allowed"), "temperature");
    assert_eq!(field(&csv, "B", "allowed"), "temperature");
    let said = done.to_string();
    assert!(
        said.contains("outside what the table is valid for, and allowed: temperature 25 °C"),
        "{said}"
    );
    assert!(
        said.contains("2 targets were corrected by an exception, temperature allowed"),
        "{said}"
    );
    // Allowed, but not needed.
    let (_, csv) = cell
        .compensate_with(
            "targets.csv",
            None,
            &[Exception::Term(Term::Temperature)],
            &with(12.5, 20.0),
        )
        .unwrap();
    assert_eq!(field(&csv, "A", "allowed"), "");
}

#[test]
fn another_tool_of_a_single_target_can_be_allowed() {
    let cell = cell();
    fs::write(cell.path("other.csv"), TARGETS.replace("450,\n", "450,rivet\n")).unwrap();
    let none = UsedWithArgs::default();
    let (done, csv) = cell.compensate_with("other.csv", None, &[], &none).unwrap();
    assert_eq!((done.exit_code(), field(&csv, "A", "refused")), (3, "tool".to_owned()));
    let (done, csv) =
        cell.compensate_with("other.csv", None, &[Exception::Term(Term::Tool)], &none).unwrap();
    assert_eq!(done.exit_code(), 0);
    assert_eq!(
        (field(&csv, "A", "allowed"), field(&csv, "A", "tool")),
        ("tool".to_owned(), "rivet".to_owned())
    );
    assert_eq!(field(&csv, "B", "allowed"), "");
}

#[test]
fn poses_are_not_taken_for_the_reflectors_unless_that_is_allowed() {
    let cell = Cell::new(&Sample { tool_is_target: Some(true), ..SAMPLE });
    fs::write(cell.path("poses.csv"), TARGETS).unwrap();
    let none = UsedWithArgs::default();
    let told = cell.compensate_with("poses.csv", None, &[], &none).unwrap_err().to_string();
    let at = "those of its reflector at (25.00, -40.00, 100.00) mm on the flange";
    assert!(told.contains(at) && told.contains("flange_from_tool in [stations]"), "{told}");
    let allowed = [Exception::Term(Term::Tool)];
    let (done, csv) = cell.compensate_with("poses.csv", None, &allowed, &none).unwrap();
    assert_eq!((done.exit_code(), field(&csv, "A", "allowed")), (0, "tool".to_owned()));
}
