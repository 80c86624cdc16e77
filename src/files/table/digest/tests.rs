//! The values that change the digest of a table, and those that do not.

use super::column::Runs;
use super::*;
use crate::manifest::RunKey;
use crate::schema;
use crate::table::Columns;

/// Rows with nulls, texts that repeat, truth values, and lists that are absent, empty and of several lengths.
fn parameters(rows: usize, change: impl Fn(usize, &str) -> bool) -> Table {
    let number = |row: usize, name: &str| row as f64 / 7.0 + f64::from(u8::from(change(row, name)));
    let names: Vec<String> = (0..rows)
        .map(|row| if change(row, "parameter") { format!("p{row}x") } else { format!("p{row}") })
        .collect();
    let confounded = (0..rows).map(|row| -> Vec<String> {
        let count = row % 3 + usize::from(change(row, "confounded"));
        (0..count).map(|other| format!("{other}")).collect()
    });
    Columns::new(schema::find("parameters").unwrap(), rows)
        .key(&RunKey::new("ur10", "grid", "00ff"))
        .same("model", "geometric")
        .column("parameter_index", 0..rows)
        .column("parameter", names.iter().map(String::as_str))
        .same("belongs_to", "link")
        .column(
            "of_session",
            (0..rows).map(|row| (row % 2 == 0 || change(row, "of_session")).then_some("grid")),
        )
        .column("joint", (0..rows).map(|row| (row % 5 > 0).then_some(row)))
        .same("quantity", "theta")
        .same("unit", "rad")
        .same("nominal", 0.0)
        .column("identified", (0..rows).map(|row| number(row, "identified")))
        .column("offset", (0..rows).map(|row| number(row, "offset")))
        .column(
            "standard_error",
            (0..rows).map(|row| (row % 4 > 0).then(|| number(row, "standard_error"))),
        )
        .rest_absent()
        .same("identifiability", "identifiable")
        .column("confounded_with", confounded)
        .finish()
        .unwrap()
}

fn in_parts(table: &Table, parts: usize) -> String {
    let mut digest = ContentDigest::new(table.schema, table.version, &[]);
    let rows = table.rows().div_ceil(parts);
    let firsts = (0..table.rows()).step_by(rows);
    let slices = firsts.map(|first| table.batch.slice(first, rows.min(table.rows() - first)));
    let slices: Vec<RecordBatch> = slices.collect();
    let (one, others) = slices.split_first().unwrap();
    digest.add_here(one);
    digest.add(&others.iter().collect::<Vec<_>>());
    digest.finish(&[])
}

#[test]
fn parts_and_threads_leave_no_trace() {
    let table = parameters(61, |_, _| false);
    let whole = of_file(&table, &[]);
    for parts in [1, 2, 3, 7, 61] {
        assert_eq!(in_parts(&table, parts), whole, "{parts} parts");
    }
}

#[test]
fn every_value_length_null_and_entry_counts() {
    let digest = |own: &str| of_file(&parameters(9, |row, name| row == 4 && name == own), &[]);
    let mut seen = vec![digest("nothing")];
    for changed in
        ["parameter", "confounded", "of_session", "identified", "offset", "standard_error"]
    {
        let own = digest(changed);
        // Row 4 has this value in of_session already.
        assert_eq!(
            seen.contains(&own),
            changed == "of_session" || changed == "standard_error",
            "{changed}"
        );
        seen.push(own);
    }
    let odd = of_file(&parameters(9, |row, name| row == 5 && name == "of_session"), &[]);
    assert!(!seen.contains(&odd), "a null less");
    let table = parameters(9, |_, _| false);
    let entry = |key: &str, value: &str| [(key.to_owned(), value.to_owned())];
    let told = of_file(&table, &entry("posegrid.units", "{}"));
    assert_ne!(told, seen[0]);
    assert_ne!(told, of_file(&table, &entry("posegrid.units", "[]")));
    // Entries of other programs, and the digest itself, do not count.
    assert_eq!(of_file(&table, &entry("pandas", "{}")), seen[0]);
    assert_eq!(of_file(&table, &entry(ENTRY, "00")), seen[0]);
    assert_ne!(of_columns(&table, &["offset"]), of_columns(&table, &[]));
}

#[test]
fn neighbours_that_look_alike_in_a_row_are_distinguished() {
    let runs = |values: &[&str]| {
        let mut runs = Runs::default();
        for value in values {
            runs.add(value.as_bytes(), 1);
        }
        runs.finish()
    };
    assert_ne!(runs(&["ab", "c"]), runs(&["a", "bc"]));
    assert_ne!(runs(&["a", "a"]), runs(&["a"]));
    assert_ne!(runs(&[""]), runs(&[]));
    let mut counted = Runs::default();
    counted.add(b"a", 1);
    counted.add(b"a", 2);
    assert_eq!(counted.finish(), runs(&["a", "a", "a"]));
}
