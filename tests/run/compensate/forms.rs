//! Targets in each form, and back in the same: nothing lost on the way, and nothing corrected twice.

use std::fs;

use posegrid::cli::compensate::CompensateCommandError;
use posegrid::io::schema;
use posegrid::io::table;
use posegrid::io::targets;

use super::cell::{Cell, SAMPLE, Sample, field};

/// The table's arm configuration, "shoulder+ elbow- wrist+", is S 5 of a KUKA arm: over itself, A3 below, A5 negative.
const KUKA: Sample = Sample { joints: [0.1, 0.1, -0.5, 0.1, -0.5, 0.1], ..SAMPLE };
const ZERO: Sample = Sample { error: |_| [0.0; 3], ..KUKA };

/// Three targets in each form; 749.7005994 mm has no end in binary.
const FILES: [(&str, &str); 3] = [
    (
        "targets.csv",
        "target,x_mm,y_mm,z_mm\nA,749.7005994,20,450\n\"b \"\"2\"\"\",652.5,-20.25,555.125\nC,800,0,401.0000004\n",
    ),
    (
        "targets.json",
        "{\"part\": 7, \"targets\": [{\"target\": \"A\", \"x_mm\": 749.7005994, \"y_mm\": 20, \"z_mm\": 450},\n\
         {\"target\": \"b \\\"2\\\"\", \"x_mm\": 652.5, \"y_mm\": -20.25, \"z_mm\": 555.125},\n\
         {\"target\": \"C\", \"x_mm\": 800, \"y_mm\": 0, \"z_mm\": 401.0000004, \"note\": \"late\"}]}",
    ),
    (
        "targets.dat",
        "DEFDAT  WING\r\nDECL E6POS A={X 749.7005994,Y 20,Z 450,S 5}\r\nDECL E6POS XP2={X 652.5,Y -20.25,Z 555.125}\r\n\
         DECL POS C={X 800,Y 0.0,Z 401.0000004}\r\nENDDAT\r\n",
    ),
];

fn places(path: &std::path::Path) -> Vec<[f64; 3]> {
    let found = targets::read(path).unwrap().targets;
    let place = |target: posegrid::compensation::Target| target.position.unwrap().coords().into();
    found.into_iter().map(place).collect()
}

#[test]
fn a_table_without_errors_gives_every_form_back_as_it_was() {
    for (name, text) in FILES {
        let cell = Cell::new(&ZERO);
        fs::write(cell.path(name), text).unwrap();
        let before = places(&cell.path(name));
        let out = format!("out-{name}");
        let (done, stdout) = cell.compensate(name, Some(&out)).unwrap();
        assert_eq!((done.exit_code(), stdout.as_str()), (0, ""), "{done}");
        let written = fs::read_to_string(cell.path(&out)).unwrap();
        assert!(written.contains("t-1"), "the table's id is in it: {written}");
        // What was corrected is refused; without its marks it is the targets again, to the nanometre.
        let error = cell.compensate(&out, None).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        assert!(error.to_string().contains("corrected already"), "{error}");
        let unmarked = written
            .replace("\"t-1\"", "null")
            .replace(",t-1,", ",,")
            .replace("\"compensation\"", "null")
            .replace(",compensation,", ",,")
            .replace("; corrected by", "; once by")
            .replace("POSEGRID_CORRECTED", "ONCE");
        fs::write(cell.path(&format!("un{name}")), unmarked).unwrap();
        for (was, is) in before.iter().zip(places(&cell.path(&format!("un{name}")))) {
            let apart = (0..3).map(|axis| (was[axis] - is[axis]).abs()).fold(0.0, f64::max);
            assert!(apart < 0.51e-6, "{name}: {was:?} {is:?}");
        }
    }
}

#[test]
fn every_form_has_the_same_commands() {
    let cell = Cell::new(&KUKA);
    let mut commands = Vec::new();
    for (name, text) in FILES {
        fs::write(cell.path(name), text).unwrap();
        let (_, text) = cell.compensate(name, None).unwrap();
        if name != "targets.json" {
            assert_eq!(field(&text, "A", "x_mm"), "748.403792", "{name}");
        }
        let out = format!("{name}.parquet");
        cell.compensate(name, Some(&out)).unwrap();
        let out =
            table::read(&cell.path(&out), schema::find("corrected_targets").unwrap()).unwrap();
        let rows = 0..out.rows();
        commands.push(
            rows.map(|row| ["x_mm", "y_mm", "z_mm"].map(|c| out.f64(c).value(row)))
                .collect::<Vec<_>>(),
        );
    }
    assert_eq!(commands[0], commands[1]);
    assert_eq!(commands[0], commands[2]);
}

#[test]
fn json_in_json_out() {
    let cell = Cell::new(&SAMPLE);
    let text = "[{\"target\": \"A\", \"x_mm\": 751, \"y_mm\": 20, \"z_mm\": 450, \"q1_deg\": 3, \"batch\": \"x\"},\n\
                {\"target\": \"far \\\"\\n\", \"x_mm\": 1951, \"y_mm\": 20, \"z_mm\": 450}]";
    fs::write(cell.path("targets.json"), text).unwrap();
    let (done, stdout) = cell.compensate("targets.json", None).unwrap();
    assert_eq!(done.exit_code(), 3);
    let rows: serde_json::Value = serde_json::from_str(&stdout).unwrap();
    let [first, second] = [&rows[0], &rows[1]];
    // c + 1 + 0.002 (c − 600) = 751 has c = 600 + 150 / 1.002 = 749.700599 mm.
    assert_eq!(first["x_mm"].as_f64(), Some(749.700_599));
    assert_eq!(first["correction_x_mm"].as_f64(), Some(-1.299_401));
    assert_eq!(first["table_id"], "t-1");
    assert!(first["refused"].is_null() && second["x_mm"].is_null());
    assert_eq!(
        (second["target"].as_str(), second["refused"].as_str()),
        (Some("far \"\n"), Some("outside"))
    );
    assert!(stdout.contains("\"x_mm\": 749.700599, "), "{stdout}");
    // The columns of the table, each once in each row.
    let keys = first.as_object().unwrap().keys();
    let names: Vec<&str> = schema::find("corrected_targets")
        .unwrap()
        .columns
        .iter()
        .map(|c| c.name.as_str())
        .collect();
    assert!(keys.clone().count() > 30 && keys.into_iter().all(|key| names.contains(&key.as_str())));
    let said = done.to_string();
    assert!(said.contains("columns without effect on a correction: batch"), "{said}");
}

const WING: &str = "&ACCESS RVP\r\nDEFDAT WING PUBLIC\r\n\
DECL E6POS XP1={X 751.0,Y 20.0,Z 450.0,A 0.0,B 0.0,C 0.0,S 5,T 27,E1 0.0} ; left\r\n\
DECL FDAT FP1={TOOL_NO 0,BASE_NO 0,IPO_FRAME #BASE,POINT2[] \" \"}\r\n\
DECL E6POS XP2={X 751.0,Y 20.0,Z 450.0,A 0.0,B 0.0,C 0.0,S 2,T 2}\r\n\
DECL E6POS XP3={X 951.0,Y 20.0,Z 450.0,A 0.0,B 0.0,C 0.0}\r\n\
DECL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}\r\nENDDAT\r\n";

#[test]
fn a_data_list_comes_back_with_commands_and_its_corrections_beside_it() {
    let cell = Cell::new(&KUKA);
    fs::write(cell.path("wing.dat"), WING).unwrap();
    let (done, stdout) = cell.compensate("wing.dat", Some("out.dat")).unwrap();
    assert_eq!((done.exit_code(), stdout.as_str()), (3, ""));
    let written = fs::read_to_string(cell.path("out.dat")).unwrap();
    let lines: Vec<&str> = written.split("\r\n").collect();
    assert_eq!(lines[2], "; corrected by posegrid table t-1: 1 positions corrected, 2 refused");
    assert_eq!(
        lines[3],
        "DECL E6POS XP1={X 749.700599,Y 20.000000,Z 450.500000,A 0.0,B 0.0,C 0.0,S 5,T 27,E1 0.0} ; left"
    );
    assert!(
        lines[5].starts_with("; refused by posegrid table t-1: target \"XP2\" asks for arm configuration \"shoulder- elbow+ wrist-\""),
        "{}",
        lines[5]
    );
    assert!(lines[6].starts_with(";DECL E6POS XP2={X 751.0,"), "{}", lines[6]);
    assert!(
        lines[7].contains("XP3") && lines[7].contains("51.0000 mm along +x beyond the table's box"),
        "{}",
        lines[7]
    );
    let csv = fs::read_to_string(cell.path("out.dat.corrections.csv")).unwrap();
    assert_eq!(field(&csv, "XP1", "correction_x_mm"), "-1.299401");
    // The surveyed base counts: tests/run/compensate.rs has the sum.
    assert_eq!(field(&csv, "XP1", "correction_sd_x_mm"), "0.029357");
    assert_eq!(field(&csv, "XP2", "refused"), "configuration");
    assert!(field(&csv, "XP3", "reason").contains("beyond the table's box"));
    let said = done.to_string();
    assert!(said.contains("TOOL_NO 0, BASE_NO 0"), "{said}");
    assert!(said.contains("unchanged: 1 E6AXIS, 1 FDAT"), "{said}");
    // Neither is written over.
    fs::remove_file(cell.path("out.dat")).unwrap();
    let error = cell.compensate("wing.dat", Some("out.dat")).unwrap_err();
    assert!(error.to_string().contains("out.dat.corrections.csv exists already"), "{error}");
    let error = cell.compensate("wing.dat", Some("missing/out.dat")).unwrap_err();
    assert_eq!(error.exit_code(), 1);
}

#[test]
fn a_data_list_of_a_base_that_nobody_names_is_refused() {
    let cell = Cell::new(&KUKA);
    fs::write(cell.path("wing.dat"), WING.replace("BASE_NO 0", "BASE_NO 5")).unwrap();
    let error = cell.compensate("wing.dat", Some("out.dat")).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("TOOL_NO 0, BASE_NO 5"), "{error}");
}

#[test]
fn a_data_list_is_made_only_from_one() {
    let cell = Cell::new(&KUKA);
    fs::write(cell.path("targets.csv"), "target,x_mm,y_mm,z_mm\nA,751,20,450\n").unwrap();
    let error = cell.compensate("targets.csv", Some("out.dat")).unwrap_err();
    assert!(matches!(*error, CompensateCommandError::OnlyFromKrl { .. }), "{error}");
    assert_eq!(error.exit_code(), 2);
    // As the other forms it can be written.
    fs::write(cell.path("wing.dat"), WING).unwrap();
    for out in ["out.json", "out.csv", "out.parquet"] {
        cell.compensate("wing.dat", Some(out)).unwrap();
    }
}

#[test]
fn s_of_another_kind_of_arm_is_refused() {
    // The sample's A5 is positive where its configuration says it is not.
    let cell = Cell::new(&SAMPLE);
    fs::write(cell.path("wing.dat"), WING).unwrap();
    let error = cell.compensate("wing.dat", None).unwrap_err();
    assert_eq!(error.exit_code(), 2);
    assert!(error.to_string().contains("the targets state S"), "{error}");
}
