//! Small texts with one trap each.

use super::super::{Cell, LeftOutFor, RowLeftOut};
use super::*;
use Cell::{Blank, Number, Text};

fn form(text: &str, form: &Form) -> Result<MeasuredTable, String> {
    read(text.as_bytes(), form).map_err(|error| error.to_string())
}

/// A table, with every line of its text counted.
fn table(text: &str) -> MeasuredTable {
    let table = form(text, &Form::default()).unwrap();
    let records = table.records;
    assert_eq!(records.rows, table.row_count());
    assert_eq!(records.left_out, table.left_out.len());
    let all = records.rows + records.left_out + records.before + records.blank;
    assert_eq!(all, text.lines().count());
    table
}

fn error(text: &str) -> String {
    form(text, &Form::default()).unwrap_err()
}

fn row(table: &MeasuredTable, row: usize) -> Vec<Cell<'_>> {
    let columns = 0..table.columns().len();
    columns.map(|column| table.cell(row, column)).collect()
}

#[test]
fn a_table_of_a_spreadsheet_with_decimal_commas() {
    let table = table(
        "\u{feff}Time;Goal x; y [mm] ;note\r\n2,02011E+13;-0,8;;ok\r\n1;+,5;\"-1,5\";\"a; b\"\r\n",
    );
    assert_eq!(table.columns(), ["Time", "Goal x", "y [mm]", "note"]);
    assert_eq!(row(&table, 0), [Number(2.020_11e13), Number(-0.8), Blank, Text("ok")]);
    assert_eq!(row(&table, 1), [Number(1.0), Number(0.5), Number(-1.5), Text("a; b")]);
    assert_eq!((table.line(0), table.line(1)), (2, 3));
    assert_eq!(table.remarks, ["separator ';', decimal comma"]);
    assert_eq!(table.units.as_deref(), None);
}

#[test]
fn a_title_units_repeated_headers_and_wrong_rows() {
    let table = table(
        "Calibration of an arm;;;\nTemperature;21,5;;\n\nstation;x;y;z\n;[mm];[mm];(mm)\nP1;1,5;2;3\nP2;1;2\n\
         station;x;y;z\n;[mm];[mm];(mm)\nP3;1;2;3;4\n// a remark\nP4;N/A;nan;-\n;;;\nMean;1,5\n",
    );
    assert_eq!(table.columns(), ["station", "x", "y", "z"]);
    assert_eq!(table.units.as_deref().unwrap(), ["", "mm", "mm", "mm"]);
    assert_eq!(table.row_count(), 2);
    assert_eq!(row(&table, 0), [Text("P1"), Number(1.5), Number(2.0), Number(3.0)]);
    let [Text("P4"), Text("N/A"), Number(nan), Text("-")] = row(&table, 1)[..] else {
        panic!("{:?}", row(&table, 1));
    };
    assert!(nan.is_nan());
    let cells = |found| LeftOutFor::Cells { found, wanted: 4 };
    let left_out = [
        (7, cells(3)),
        (8, LeftOutFor::Header),
        (9, LeftOutFor::Header),
        (10, cells(5)),
        (11, LeftOutFor::Comment),
        (14, cells(2)),
    ];
    let left_out = left_out.map(|(line, reason)| RowLeftOut { line, reason });
    assert_eq!(table.left_out, left_out);
    assert_eq!(table.left_out[0].reason.to_string(), "it has 3 cells, and the table 4 columns");
    assert_eq!((table.records.before, table.records.blank), (4, 2));
}

#[test]
fn one_cell_too_few_in_row_734() {
    let mut text = "x,y,z\n".to_owned();
    for row in 2..2000 {
        text += if row == 734 { "1.5,2.5\n" } else { "1.5,2.5,3.5\n" };
    }
    let table = table(&text);
    assert_eq!(table.row_count(), 1997);
    assert_eq!(table.left_out.len(), 1);
    assert_eq!(table.left_out[0].line, 734);
    assert_eq!((table.line(731), table.line(732)), (733, 735));
}

#[test]
fn headers_in_comments_absent_and_stated() {
    let commented = table("# measured on Monday\n# station x y z\n1 1.5 2.5 3.5\n2 1 2 3\n");
    assert_eq!(commented.columns(), ["station", "x", "y", "z"]);
    assert_eq!(commented.remarks[1], "the comment in line 2 is the header");
    let absent = table("// SA export\nA::p1, 1.0, 2.0, 3.0\nA::p2, 1.5, 2.0, 2.5\n");
    assert_eq!(absent.columns(), ["1", "2", "3", "4"]);
    assert!(absent.remarks[1].contains("it has no header"));
    assert_eq!(row(&absent, 1)[..2], [Text("A::p2"), Number(1.5)]);
    let numbered = table("station;1;2;3;x;y\n1;.1;.2;.3;4;5\n");
    assert_eq!(numbered.columns(), ["station", "1", "2", "3", "x", "y"]);
    let first = table("name;x;y\nP0;N/A;N/A\nP1;1;2\n");
    assert_eq!((first.columns()[0].as_str(), first.row_count()), ("name", 2));
    let sign = table("#;x\n1;2\n2;3\n");
    assert_eq!(sign.columns(), ["#", "x"]);
    let units = table("m;s\n1;2\n");
    assert_eq!(
        (units.columns(), units.units.as_deref()),
        (&["m".to_owned(), "s".to_owned()][..], None)
    );
}

#[test]
fn a_stated_header_holds() {
    let texts = "a;b\n1;2\nc;d\n3;4\n";
    let stated = |line| Form { header: Some(line), ..Form::default() };
    let found = form(texts, &stated(3)).unwrap();
    assert_eq!((found.columns()[0].as_str(), found.row_count()), ("c", 1));
    let told = form(texts, &stated(9)).unwrap_err();
    assert!(told.contains("there is no line 9"), "{told}");
    let told = form("a;b\n1;2;3\n", &stated(1)).unwrap_err();
    assert!(told.contains("line 1 names 2 columns, and line 2 has 3 cells"), "{told}");
}

#[test]
fn a_separator_line_a_separator_at_the_end_and_unnamed_columns() {
    let stated = table("sep=|\na|b\n1|2\n");
    assert_eq!((stated.columns().len(), stated.line(0)), (2, 3));
    let end = table("x,y,z\n1,2,3,\n4,5,6,\n");
    assert_eq!((end.columns().len(), end.row_count()), (3, 2));
    let unnamed = table(",x,y\n0,1.5,2\n1,2.5,3\n");
    assert_eq!(unnamed.columns(), ["1", "x", "y"]);
    let twice = table("x,x,y\n1,2,3\n");
    assert_eq!(twice.columns(), ["x #1", "x #2", "y"]);
    assert!(twice.find("x").unwrap_err().to_string().contains("\"x #1\""));
}

#[test]
fn commas_that_separate_and_are_decimal_marks() {
    let told = error("x,y,z\n0,8,0,6,1,57\n0,7,0,5,1,25\n1,0,5,1,2\n");
    assert!(told.contains("line 1 names 3 columns, and line 2 has 6 cells"), "{told}");
    assert!(told.contains("decimal commas, and commas separate"), "{told}");
    let told = error("x,y,z\n1,2,3,4\n4,5,6,7\n");
    assert!(told.contains("line 1 names 3 columns, and line 2 has 4 cells; give"), "{told}");
    let quoted = table("x,y\n\"1,5\",\"2,5\"\n\"3,5\",\"4\"\n");
    assert_eq!(row(&quoted, 1), [Number(3.5), Number(4.0)]);
    let one = table("x,y\n1,2\n1,2,3\n");
    assert_eq!((one.row_count(), one.left_out.len()), (1, 1));
}

#[test]
fn numbers_in_two_ways_of_writing_are_refused_by_their_cell() {
    let told = error("a;b\n1.234,5;2\n1,5;3\n");
    assert!(
        told.contains(
            "line 2, column \"a\": \"1.234,5\" has separators of thousands; write \"1234,5\","
        ),
        "{told}"
    );
    let told = error("a;b\n1;2\n1,5;3\n4.5;1\n1.5;2\n");
    assert!(
        told.contains("line 3, column \"a\": \"1,5\" is no number with the decimal mark '.'"),
        "{told}"
    );
    let told = error("a;b\n1.5;2\n1'234.5;3\n");
    assert!(told.contains("line 3") && told.contains("thousands"), "{told}");
    let told = error("a,b\n1.5,2\n\"1,234\",3\n2.5,3\n");
    assert!(told.contains("line 3, column \"a\": \"1,234\""), "{told}");
    // A column of texts is one, whatever they look like.
    let version = table("version;x\n5.9;1,5\n5.9;2,5\n5.9;2,5\n");
    assert_eq!(row(&version, 0).len(), 2);
    let stated = Form { decimal: Some('.'), ..Form::default() };
    let told = form("a;b\n1,5;2\n2;3\n", &stated).unwrap_err();
    assert!(told.contains("decimal mark '.'"), "{told}");
}

#[test]
fn the_decimal_mark_is_found_below_the_first_rows_too() {
    let rows: Vec<String> = (0..3000).map(|row| format!("{row};{row}\n")).collect();
    let text = format!("a;b\n{}", rows.concat());
    let found = table(&(text.clone() + "1,5;2\n"));
    assert_eq!(row(&found, 3000), [Number(1.5), Number(2.0)]);
    let told = error(&(text + "1,5;2\n2;1.5\n"));
    assert!(told.contains("line 3003, column \"b\": \"1.5\""), "{told}");
}

#[test]
fn what_holds_no_table_is_reported() {
    for (text, wanted) in [
        ("", "no values are in it"),
        ("\n \n\t\n", "no values are in it"),
        ("# a comment\n", "no values are in it"),
        ("a,b\n", "it holds no row"),
        ("a;b\n1;\"2\n3;4\n", "line 2: a quote opens a cell"),
        ("a;b\n1;\0\n", "byte 6 belongs to no text"),
    ] {
        let told = error(text);
        assert!(told.contains(wanted), "{text:?}: {told}");
    }
    let told = error(&format!("{}\n", ",1".repeat(5000)));
    assert!(told.contains("5001 columns"), "{told}");
}

#[test]
fn signs_that_are_stated_hold() {
    let stated =
        |separator, decimal| Form { separator: Some(separator), decimal, ..Form::default() };
    let found = form("x:y\n1,5:2\n", &stated(':', Some(','))).unwrap();
    assert_eq!(row(&found, 0), [Number(1.5), Number(2.0)]);
    let one = form("x,y\n1.5,2\n", &stated(';', None)).unwrap();
    assert_eq!(one.columns(), ["x,y"]);
    assert!(stated('5', None).check().is_err() && stated('"', None).check().is_err());
    assert!(stated(';', Some(';')).check().is_err());
}

#[test]
fn labels_above_the_header_tell_columns_of_one_name_apart() {
    let merged = table(
        "Three reflectors;;;;;;;\n;SMR 1;;;SMR 2;;;\nstation;x;y;z;x;y;z;T\n1;1,5;2;3;4;5;6;20\n2;1;2;3;4;5;6;20\n",
    );
    let names = ["station", "SMR 1 x", "SMR 1 y", "SMR 1 z", "SMR 2 x", "SMR 2 y", "SMR 2 z", "T"];
    assert_eq!(merged.columns(), names);
    // As a motion capture writes it: type, name, number, kind of each column.
    let captured = table(
        "Format Version,1.23,Take Name,T1,Rotation Type,Quaternion\n\n,,Rigid Body,Rigid Body,Rigid Body,Rigid Body\n\
         ,,Hand,Hand,Base,Base\n,,1A,1A,2B,2B\n,,Rotation,Position,Rotation,Position\nFrame,Time (Seconds),X,X,X,X\n\
         0,0.0,0.5,1.5,0.25,3.5\n1,0.1,0.5,1.5,,\n",
    );
    let names = ["Hand Rotation X", "Hand Position X", "Base Rotation X", "Base Position X"];
    assert_eq!(captured.columns()[2..], names);
    assert_eq!(captured.row_count(), 2);
    // Labels that tell nothing apart are no part of a name.
    assert_eq!(table("a;a\nx;x\n1;2\n").columns(), ["a #1", "a #2"]);
}
