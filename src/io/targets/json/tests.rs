use std::io::Write as _;

use super::super::{Targets, read};
use super::*;

fn targets(text: &str) -> Result<Targets, String> {
    let mut file = tempfile::Builder::new().suffix(".json").tempfile().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    read(file.path()).map_err(|error| error.to_string())
}

#[test]
fn an_array_of_objects_is_read_by_its_keys() {
    let found = targets(
        r#"[{"target": "A \"1\"", "z_mm": 3, "y_mm": -2.5, "x_mm": 1e3, "note": {"deep": [1]}},
            {"target": "B", "q1_deg": 90, "q2_deg": 0, "configuration": null, "tool": "drill"}]"#,
    )
    .unwrap();
    let first = &found.targets[0];
    assert_eq!(first.name, "A \"1\"");
    let place = first.position.unwrap().coords();
    assert_eq!((place.x, place.y, place.z), (1000.0, -2.5, 3.0));
    let joints = found.targets[1].joints.as_ref().unwrap();
    assert!((joints.angles[0] - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
    assert_eq!(found.targets[1].tool.as_deref(), Some("drill"));
    assert_eq!(found.unused, ["note"]);
    assert_eq!(found.units.angle(), AngleUnit::Deg);
}

#[test]
fn targets_may_stand_under_their_key() {
    let found = targets(
        r#"{"part": "wing", "targets": [{"target": "A", "x_mm": 1, "y_mm": 2, "z_mm": 3}]}"#,
    );
    let found = found.unwrap();
    assert_eq!((found.targets.len(), found.unused), (1, vec!["part".to_owned()]));
}

#[test]
fn what_is_wrong_is_reported_by_its_row_or_place() {
    let good = r#"{"target": "A", "x_mm": 1, "y_mm": 2, "z_mm": 3}"#;
    let cases = [
        (
            r#"{"target": "B", "x_mm": "1", "y_mm": 2, "z_mm": 3}"#,
            "row 1: key \"x_mm\" holds a text",
        ),
        (
            r#"{"target": "B", "x_mm": [1], "y_mm": 2, "z_mm": 3}"#,
            "row 1: key \"x_mm\" holds an array",
        ),
        (
            r#"{"target": 7, "x_mm": 1, "y_mm": 2, "z_mm": 3}"#,
            "row 1: key \"target\" holds a number",
        ),
        (r#"{"target": "B", "x_mm": 1, "x_mm": 1, "y_mm": 2}"#, "row 1: \"x_mm\" is given twice"),
        (r#"{"target": "B", "x_mm": 1, "z_mm": 2}"#, "row 1: a position is three numbers"),
        (r#"{"target": "B"}"#, "row 1: target \"B\" has neither a position"),
        (r#"{"x_mm": 1, "y_mm": 2, "z_mm": 3}"#, "row 1: column \"target\" is empty"),
        (good, "row 1: target \"A\" is in row 0 already"),
        (r#"{"target": "B", "q1_deg": 1, "q2_rad": 2}"#, "row 1: some are in radians"),
        (r#"{"target": "B", "q1_deg": 1, "q2_deg": null}"#, "row 1: q2_deg is empty"),
        (
            r#"{"target": "B", "x_mm": 1, "y_mm": 2, "z_mm": 3, "table_id": "t-1"}"#,
            "is corrected already, with table \"t-1\"",
        ),
        (r#"{"target": "B", "x_mm": 1e999}"#, "number out of range at line 1 column"),
        ("[1]", "a target: an object with the keys"),
        ("", "trailing comma at line 1 column"),
    ];
    for (row, expected) in cases {
        let error = targets(&format!("[{good},{row}]")).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn texts_that_hold_no_targets_are_reported_so() {
    let deep = "[".repeat(100_000);
    let cases = [
        ("[]", "holds no target"),
        ("{}", "no key \"targets\""),
        ("{\"targets\": [], \"targets\": []}", "\"targets\" is given twice"),
        ("{\"targets\": {\"targets\": []}}", "expected an array of targets"),
        ("{\"Targets\": []}", "\"targets\" is; write it so"),
        ("{\"part\": 1, \"Part\": 2, \"targets\": []}", "\"part\" and \"Part\" differ"),
        ("3", "expected an array of targets"),
        ("[] x", "trailing characters"),
        (deep.as_str(), "a target: an object"),
    ];
    for (text, expected) in cases {
        let error = targets(text).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
    let nested = format!(r#"[{{"target": "A", "note": {}1"#, "[".repeat(100_000));
    assert!(targets(&nested).unwrap_err().contains("recursion limit exceeded"));
}

#[test]
fn a_mark_is_known_in_any_letters_and_anywhere() {
    let row = |more: &str| format!(r#"{{"target": "B", "x_mm": 1, "y_mm": 2, "z_mm": 3{more}}}"#);
    let marked = [
        format!("[{}]", row(r#", "Table_ID": "t-1""#)),
        format!("[{}]", row(r#", "TABLE_ID": 7"#)),
        format!("[{}]", row(r#", "corrected_by": "compensation""#)),
        format!("[{}]", row(r#", "made": {"by": [{"Table_Id": "t-1"}]}"#)),
        format!(r#"{{"table_id": "t-1", "targets": [{}]}}"#, row("")),
        format!(r#"{{"targets": [{}], "Table_ID": true}}"#, row("")),
        format!(r#"{{"head": {{"table_id": "t-1"}}, "targets": [{}]}}"#, row("")),
    ];
    for text in &marked {
        let error = targets(text).unwrap_err();
        assert!(error.contains("corrected already"), "{text}: {error}");
    }
    let unmarked = format!(
        r#"{{"table_id": null, "targets": [{}]}}"#,
        row(r#", "Table_ID": "", "made": {"table_id": null}"#)
    );
    assert_eq!(targets(&unmarked).unwrap().targets.len(), 1);
}

#[test]
fn keys_in_letters_of_another_size_are_reported_by_name() {
    let cases = [
        (r#"[{"target": "A", "X_mm": 1}]"#, "row 0: \"X_mm\" is no name that is known here"),
        (r#"[{"target": "A", "Q1_deg": 1}]"#, "\"q1_deg\" is; write it so"),
        (r#"[{"target": "A", "x": 1, "X": 2}]"#, "\"x\" and \"X\" differ"),
        (
            r#"[{"target": "A", "table_id": null, "Table_ID": "t"}]"#,
            "\"table_id\" and \"Table_ID\" differ",
        ),
    ];
    for (text, expected) in cases {
        let error = targets(text).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}
