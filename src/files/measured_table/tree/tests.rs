//! Small JSON and YAML texts with one trap each.

use super::super::{Cell, LeftOutFor, MeasuredTable, RowLeftOut, json, yaml};
use super::*;
use Cell::{Blank, Number, Text};

fn json(text: &str) -> Result<MeasuredTable, String> {
    json::read(text.as_bytes(), &Form::default()).map_err(|error| error.to_string())
}

fn yaml(text: &str) -> Result<MeasuredTable, String> {
    yaml::read(text.as_bytes(), &Form::default()).map_err(|error| error.to_string())
}

fn row(table: &MeasuredTable, row: usize) -> Vec<Cell<'_>> {
    let columns = 0..table.columns().len();
    columns.map(|column| table.cell(row, column)).collect()
}

#[test]
fn records_are_flattened_in_every_order_that_people_write_them() {
    let list =
        r#"[{"pose": {"x": 1.5, "y": null}, "q": [1, 2]}, {"q": [3, 4], "pose": {"x": -1e3}}]"#;
    let lines = "{\"pose\": {\"x\": 1.5, \"y\": null}, \"q\": [1, 2]}\n{\"q\": [3, 4], \"pose\": {\"x\": -1e3}}\n";
    let wrapped = format!("{{\"robot\": \"a\", \"stations\": {list}}}");
    let written = "- pose: {x: 1.5, y: ~}\n  q: [1, 2]\n- q:\n  - 3\n  - 4\n  pose:\n    x: -1e3\n";
    let documents = "pose: {x: 1.5, y: }\nq: [1, 2]\n---\nq: [3, 4]\npose: {x: -1000}\n";
    for table in
        [json(list), json(lines), json(&wrapped), yaml(list), yaml(written), yaml(documents)]
    {
        let table = table.unwrap();
        assert_eq!(table.columns(), ["pose.x", "pose.y", "q[0]", "q[1]"]);
        assert_eq!(row(&table, 0), [Number(1.5), Blank, Number(1.0), Number(2.0)]);
        assert_eq!(row(&table, 1), [Number(-1000.0), Blank, Number(3.0), Number(4.0)]);
    }
    let wrapped = json(&wrapped).unwrap();
    assert_eq!(wrapped.remarks, ["its records are those of \"stations\""]);
}

#[test]
fn rows_are_told_by_line_or_by_number() {
    let lines = json("{\"a\": 1}\n\n{\"a\": 2}\n").unwrap();
    assert_eq!((lines.counted, lines.line(1)), (Counted::Line, 3));
    let records = json("[{\"a\": 1},\n {\"a\": 2}]").unwrap();
    assert_eq!((records.counted, records.line(1)), (Counted::Record, 2));
    let keyed = yaml("'7':\n  a: 1\n# between\n'8':\n  a: 2\n").unwrap();
    assert_eq!((keyed.counted, keyed.line(0), keyed.line(1)), (Counted::Line, 1, 4));
    assert_eq!(keyed.columns(), ["key", "a"]);
    assert_eq!(row(&keyed, 1), [Number(8.0), Number(2.0)]);
    let documents = yaml("a: 1\n---\na: 2\n").unwrap();
    assert_eq!((documents.line(0), documents.line(1)), (1, 3));
}

#[test]
fn columns_one_after_the_other_are_turned() {
    let lists = json(r#"{"x": [1, 2], "q": [[1, 2], [3, 4]]}"#).unwrap();
    assert_eq!(lists.columns(), ["x", "q[0]", "q[1]"]);
    assert_eq!(row(&lists, 1), [Number(2.0), Number(3.0), Number(4.0)]);
    let pandas = json(r#"{"x": {"0": 1, "1": 2}, "y": {"0": 3, "1": null}}"#).unwrap();
    assert_eq!(pandas.columns(), ["x", "y"]);
    assert_eq!(row(&pandas, 1), [Number(2.0), Blank]);
    let told = json(r#"{"x": [1, 2], "y": [1]}"#).unwrap_err();
    assert!(told.contains("\"x\" has 2 values, and column \"y\" 1"), "{told}");
}

#[test]
fn lists_of_lists_have_their_names_in_the_first_or_beside_them() {
    let first = json(r#"[["a", "q"], [1, [2, 3]], [4]]"#).unwrap();
    assert_eq!(first.columns(), ["a", "q[0]", "q[1]"]);
    assert_eq!(row(&first, 1), [Number(4.0), Blank, Blank]);
    let split = r#"{"columns": ["a", "b"], "index": [0, 1], "data": [[1, 2], [3, null]]}"#;
    let split = json(split).unwrap();
    assert_eq!((split.columns().len(), split.row_count()), (2, 2));
    assert_eq!(row(&split, 1), [Number(3.0), Blank]);
    let bare = yaml("- [1.5, 2]\n- [3, 4]\n").unwrap();
    assert_eq!(bare.columns(), ["1", "2"]);
    assert_eq!(bare.remarks, ["its records are lists"]);
}

#[test]
fn values_keep_their_kind() {
    let table = json(
        "[{\"a\": 0.30000000000000004, \"b\": NaN, \"c\": -Infinity, \"d\": true, \"e\": \"1.5\", \"f\": \"\\u00b0\\ud83d\\ude00\\n\", \
         \"g\": 1e999, \"h\": 1593701755123456789}]",
    )
    .unwrap();
    let [
        Number(a),
        Number(b),
        Number(c),
        Text("true"),
        Number(e),
        Text("°😀"),
        Text("1e999"),
        Number(h),
    ] = row(&table, 0)[..]
    else {
        panic!("{:?}", row(&table, 0));
    };
    assert_eq!((a, e, h), (0.300_000_000_000_000_04, 1.5, 1.593_701_755_123_456_8e18));
    assert!(b.is_nan() && c.is_nan());
    let table = yaml("- {a: .nan, b: -.inf, c: yes, d: '1.5', e: 0x1F, f: null}\n").unwrap();
    let [Number(a), Number(b), Text("yes"), Number(d), Text("0x1F"), Blank] = row(&table, 0)[..]
    else {
        panic!("{:?}", row(&table, 0));
    };
    assert!(a.is_nan() && b.is_nan());
    assert_eq!(Number(d), Number(1.5));
}

#[test]
fn numbers_that_are_text_are_read_as_those_of_a_csv() {
    let table = json(r#"[{"a": "P1", "x": "1,5", "y": 2.5}, {"a": "P2", "x": "3", "y": "-0,5"}]"#);
    let table = table.unwrap();
    assert_eq!(row(&table, 0), [Text("P1"), Number(1.5), Number(2.5)]);
    assert_eq!(row(&table, 1), [Text("P2"), Number(3.0), Number(-0.5)]);
}

#[test]
fn records_that_are_none_are_left_out_and_empty_ones_counted() {
    let table = json(r#"[{"a": 1}, 5, null, {"a": null}, [1], {"a": 2}]"#).unwrap();
    let left_out: Vec<u64> = table.left_out.iter().map(|row| row.line).collect();
    assert_eq!(left_out, [2, 3, 5]);
    let reason = LeftOutFor::NoObject;
    assert_eq!(table.left_out[0], RowLeftOut { line: 2, reason });
    let records = table.records;
    assert_eq!((records.rows, records.left_out, records.blank, records.before), (2, 3, 1, 0));
    assert_eq!(table.line(1), 6);
}

#[test]
fn what_holds_no_table_is_reported() {
    for (text, wanted) in [
        ("", "holds no table"),
        ("[[], []]", "holds no table"),
        ("[]", "holds no table"),
        ("5", "it holds no records"),
        ("[{\"a\": 1, \"a\": 2}]", "record 1: \"a\" is given twice"),
        ("{\"a\": [{\"x\": 1}], \"b\": [{\"x\": 1}]}", "\"a\" and \"b\" both hold records"),
        ("[{\"a\": 1},\n {\"a\" 2}]", "line 2, character 7: it is no JSON: a colon is missing"),
        ("[{\"a\": 1]", "line 1, character 9: it is no JSON: a comma or a brace"),
        ("[{\"a\": \"x}]", "a string is never closed"),
        ("[{\"a\": tru}]", "no value of JSON"),
        ("[{\"a\": \"\\x\"}]", "a backslash"),
        ("[{\"a\": \"\\u12\"}]", "four hexadecimal digits"),
        ("[{\"a\": 1}", "a comma or a bracket is missing"),
    ] {
        let told = json(text).unwrap_err();
        assert!(told.contains(wanted), "{text:?}: {told}");
    }
    for (text, wanted) in [
        ("a: [1, 2\n", "it cannot be read as YAML"),
        ("- a: 1\n  a: 2\n", "line 1: \"a\" is given twice"),
        ("? [1]\n: 2\n", "a key is a list"),
        ("- a: *b\n", "it cannot be read as YAML"),
    ] {
        let told = yaml(text).unwrap_err();
        assert!(told.contains(wanted), "{text:?}: {told}");
    }
}

#[test]
fn aliases_are_read_and_bombs_refused() {
    let text = "a: &a {x: 1, q: [1, 2]}\nb: *a\nc:\n  <<: *a\n  x: 3\n";
    let table = yaml(text).unwrap();
    assert_eq!(table.columns(), ["key", "x", "q[0]", "q[1]"]);
    assert_eq!(row(&table, 1), [Text("b"), Number(1.0), Number(1.0), Number(2.0)]);
    let mut bomb = "a: &a [x,x,x,x,x,x,x,x,x,x]\n".to_owned();
    for (from, to) in ('a'..'k').zip('b'..='k') {
        bomb +=
            &[format!("{to}: &{to} ["), vec![format!("*{from}"); 10].join(","), "]\n".to_owned()]
                .concat();
    }
    let told = yaml(&bomb).unwrap_err();
    assert!(told.contains("more memory than a table may"), "{told}");
    for deep in ["[".repeat(100_000), "{a: ".repeat(100_000), "- ".repeat(100_000)] {
        assert!(yaml(&deep).is_err());
        assert!(json(&deep).is_err());
    }
    let told = json(&"[".repeat(100_000)).unwrap_err();
    assert!(told.contains("nested too deeply"), "{told}");
}

#[test]
fn columns_are_bounded_in_number_and_name() {
    let many: Vec<String> = (0..5000).map(|key| format!("{{\"k{key}\": 1}}")).collect();
    let told = json(&format!("[{}]", many.join(","))).unwrap_err();
    assert!(told.contains("more than the limit of 4096"), "{told}");
    let long = json(&format!("[{{\"{}\": 1}}]", "k".repeat(2000))).unwrap_err();
    assert!(long.contains("a name has more than 1024 bytes"), "{long}");
}
