//! Targets in each form, and back in the same: nothing lost on the way, and nothing corrected twice.

use std::fs;

use posegrid::files::schema;
use posegrid::files::table;
use posegrid::io::targets;

use super::cell::{Cell, SAMPLE, Sample, field};

/// Three targets in each form; 749.7005994 mm has no end in binary.
const FILES: [(&str, &str); 2] = [
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
];

fn places(path: &std::path::Path) -> Vec<[f64; 3]> {
    let found = targets::read(path).unwrap().targets;
    let place = |target: posegrid::compensation::Target| target.position.unwrap().coords().into();
    found.into_iter().map(place).collect()
}

#[test]
fn a_table_without_errors_gives_every_form_back_as_it_was() {
    for (name, text) in FILES {
        let cell = Cell::new(&Sample { error: |_| [0.0; 3], ..SAMPLE });
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
            .replace(",compensation,", ",,");
        fs::write(cell.path(&format!("un{name}")), unmarked).unwrap();
        for (was, is) in before.iter().zip(places(&cell.path(&format!("un{name}")))) {
            let apart = (0..3).map(|axis| (was[axis] - is[axis]).abs()).fold(0.0, f64::max);
            assert!(apart < 0.51e-6, "{name}: {was:?} {is:?}");
        }
    }
}

#[test]
fn every_form_has_the_same_commands() {
    let cell = Cell::new(&SAMPLE);
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
