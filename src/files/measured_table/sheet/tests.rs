//! Small workbooks with one trap each, made here.

use std::io::Write as _;

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::super::{Cell, MeasuredTable, xlsx};
use super::*;
use Cell::{Blank, Number, Text};

const BOUND: Bound = Bound { bytes: 1 << 22, advice: "split it" };

fn packed(parts: &[(&str, String)]) -> Vec<u8> {
    let mut writer = ZipWriter::new(io::Cursor::new(Vec::new()));
    for (name, content) in parts {
        writer.start_file(*name, SimpleFileOptions::default()).unwrap();
        writer.write_all(content.as_bytes()).unwrap();
    }
    writer.finish().unwrap().into_inner()
}

/// A workbook with these sheets: names, and what stands between `<sheetData>` and its end.
fn workbook(sheets: &[(&str, &str)]) -> Vec<u8> {
    const MAIN: &str = "http://schemas.openxmlformats.org/spreadsheetml/2006/main";
    const RELATIONS: &str = "http://schemas.openxmlformats.org/package/2006/relationships";
    const OFFICE: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";
    let numbered = || sheets.iter().enumerate();
    let listed: Vec<String> = numbered()
        .map(|(id, (name, _))| {
            format!("<sheet name=\"{name}\" sheetId=\"{0}\" r:id=\"r{id}\"/>", id + 1)
        })
        .collect();
    let related: Vec<String> = numbered()
        .map(|(id, _)| format!("<Relationship Id=\"r{id}\" Type=\"{OFFICE}/worksheet\" Target=\"worksheets/s{id}.xml\"/>"))
        .collect();
    let (listed, related) = (listed.concat(), related.concat());
    let mut parts = vec![
        (
            "_rels/.rels",
            format!(
                "<Relationships xmlns=\"{RELATIONS}\"><Relationship Id=\"r\" Type=\"{OFFICE}/officeDocument\" Target=\"xl/workbook.xml\"/></Relationships>"
            ),
        ),
        (
            "xl/workbook.xml",
            format!(
                "<workbook xmlns=\"{MAIN}\" xmlns:r=\"{OFFICE}\"><sheets>{listed}</sheets></workbook>"
            ),
        ),
        (
            "xl/_rels/workbook.xml.rels",
            format!("<Relationships xmlns=\"{RELATIONS}\">{related}</Relationships>"),
        ),
        (
            "xl/styles.xml",
            format!(
                "<styleSheet xmlns=\"{MAIN}\"><cellXfs><xf numFmtId=\"0\"/><xf numFmtId=\"22\"/></cellXfs></styleSheet>"
            ),
        ),
    ];
    let names: Vec<String> = numbered().map(|(id, _)| format!("xl/worksheets/s{id}.xml")).collect();
    for (name, (_, rows)) in names.iter().zip(sheets) {
        parts.push((
            name,
            format!("<worksheet xmlns=\"{MAIN}\"><sheetData>{rows}</sheetData></worksheet>"),
        ));
    }
    packed(&parts)
}

/// A row of a sheet: texts, and numbers as they are written.
fn row_of(number: u64, cells: &[&str]) -> String {
    let cells: String = cells
        .iter()
        .zip('A'..)
        .filter(|(cell, _)| !cell.is_empty())
        .map(|(cell, column)| match cell.parse::<f64>() {
            Ok(_) => format!("<c r=\"{column}{number}\"><v>{cell}</v></c>"),
            Err(_) => {
                format!("<c r=\"{column}{number}\" t=\"inlineStr\"><is><t>{cell}</t></is></c>")
            }
        })
        .collect();
    format!("<row r=\"{number}\">{cells}</row>")
}

fn rows_of(rows: &[(u64, &[&str])]) -> String {
    rows.iter().map(|(number, cells)| row_of(*number, cells)).collect()
}

fn row(table: &MeasuredTable, row: usize) -> Vec<Cell<'_>> {
    let columns = 0..table.columns().len();
    columns.map(|column| table.cell(row, column)).collect()
}

fn read(bytes: &[u8], form: &Form) -> Result<MeasuredTable, String> {
    xlsx::read(bytes, form, BOUND).map_err(|error| error.to_string())
}

#[test]
fn the_first_sheet_with_a_table_is_read_below_its_title() {
    let notes = rows_of(&[(1, &["Measured on Monday", "by two people"])]);
    let data = rows_of(&[
        (1, &["Calibration", "", "", "", "", "a note"]),
        (3, &["station", "x", "y", "", "version"]),
        (4, &["", "[mm]", "[mm]"]),
        (5, &["P1", "1.5", "2", "", "5.9"]),
        (7, &["P2", "-1e-3", "", "", "5.9"]),
        (8, &["P3", "n/a", "'7'", "", "6.0"]),
    ]);
    let bytes = workbook(&[("Notes", &notes), ("Data", &data), ("More", &data)]);
    let table = read(&bytes, &Form::default()).unwrap();
    assert_eq!(table.columns(), ["station", "x", "y", "version"]);
    assert_eq!(table.units.as_deref().unwrap(), ["", "mm", "mm", ""]);
    assert_eq!(row(&table, 0), [Text("P1"), Number(1.5), Number(2.0), Number(5.9)]);
    assert_eq!(row(&table, 1), [Text("P2"), Number(-1e-3), Blank, Number(5.9)]);
    assert_eq!(row(&table, 2)[1..3], [Text("n/a"), Text("'7'")]);
    assert_eq!((table.line(1), table.counted), (7, Counted::Row));
    assert_eq!(table.remarks, ["sheet \"Data\"", "it has other sheets: Notes, More"]);
    let records = table.records;
    assert_eq!((records.rows, records.before, records.blank, records.left_out), (3, 3, 2, 0));
}

#[test]
fn a_sheet_and_a_header_are_stated() {
    let data = rows_of(&[(1, &["a", "b"]), (2, &["1", "2"]), (4, &["c", "d"]), (5, &["3", "4"])]);
    let bytes = workbook(&[("One", &data), ("Two", &data)]);
    let form = Form { sheet: Some("Two".to_owned()), header: Some(4), ..Form::default() };
    let table = read(&bytes, &form).unwrap();
    assert_eq!((table.columns()[0].as_str(), table.row_count()), ("c", 1));
    assert_eq!(table.remarks, ["sheet \"Two\""]);
    let form = Form { sheet: Some("Tow".to_owned()), ..Form::default() };
    let told = read(&bytes, &form).unwrap_err();
    assert_eq!(told, "it has no sheet \"Tow\"; its sheets are \"One\", \"Two\"");
    let form = Form { header: Some(3), ..Form::default() };
    let told = read(&bytes, &form).unwrap_err();
    assert!(told.contains("sheet \"One\": header = 3"), "{told}");
}

#[test]
fn dates_formulas_and_numbers_typed_as_text() {
    let data = "<row r=\"1\"><c r=\"A1\" t=\"str\"><v>when</v></c><c r=\"B1\" t=\"str\"><v>x</v></c><c r=\"C1\" t=\"str\"><v>y</v></c></row>\
        <row r=\"2\"><c r=\"A2\" s=\"1\"><v>44026.5</v></c><c r=\"B2\"><f>1+1</f><v>2</v></c><c r=\"C2\" t=\"str\"><v> 1.25 </v></c></row>\
        <row r=\"3\"><c r=\"A3\" s=\"1\"><v>0.25</v></c><c r=\"B3\" t=\"e\"><v>#DIV/0!</v></c><c r=\"C3\" t=\"b\"><v>1</v></c></row>\
        <row r=\"4\"><c r=\"B4\"><v>1</v></c><c r=\"C4\"><v>2</v></c></row>";
    let table = read(&workbook(&[("S", data)]), &Form::default()).unwrap();
    assert_eq!(row(&table, 0), [Text("2020-07-14T12:00:00"), Number(2.0), Number(1.25)]);
    assert_eq!(row(&table, 1), [Text("06:00:00"), Text("#DIV/0!"), Text("true")]);
}

/// Rows of a sheet whose cells are all texts.
fn texts(rows: &[[&str; 3]]) -> String {
    let cell = |text: &&str| format!("<c t=\"str\"><v>{text}</v></c>");
    let row = |cells: &[&str; 3]| {
        ["<row>", &cells.iter().map(cell).collect::<String>(), "</row>"].concat()
    };
    rows.iter().map(row).collect()
}

#[test]
fn numbers_that_are_all_text_are_read_as_those_of_a_csv() {
    let note = texts(&[["3", "rows", "2"]]);
    for [one, other] in [["1.5", "-2e1"], ["1,5", "-20"], ["1.5 ", " -20.0"]] {
        let data = texts(&[["station", "x", "y"], ["P1", one, "7"], ["P2", other, "n/a"]]);
        let table = read(&workbook(&[("S", &data), ("Note", &note)]), &Form::default()).unwrap();
        assert_eq!(row(&table, 0), [Text("P1"), Number(1.5), Number(7.0)], "{one}");
        assert_eq!(row(&table, 1), [Text("P2"), Number(-20.0), Text("n/a")], "{other}");
        // A sheet of numbers goes before.
        let numbers = rows_of(&[(1, &["a", "b"]), (2, &["1", "2"])]);
        let table = read(&workbook(&[("S", &data), ("T", &numbers)]), &Form::default()).unwrap();
        assert_eq!(table.columns(), ["a", "b"]);
    }
    let refused = |cell: &str| {
        let data = texts(&[["station", "x", "y"], ["P1", cell, "1.5"], ["P2", cell, "2.5"]]);
        read(&workbook(&[("S", &data)]), &Form::default()).unwrap_err()
    };
    let thousands = refused("1,234.5");
    assert!(
        thousands.contains("sheet \"S\": line 2, column \"x\": \"1,234.5\" has"),
        "{thousands}"
    );
    let words = read(&workbook(&[("S", &texts(&[["a", "b", "c"]]))]), &Form::default());
    assert!(words.unwrap_err().starts_with("no sheet that is shown has a row with two numbers"));
}

#[test]
fn cells_beyond_the_ends_of_a_sheet_are_refused_before_they_are_read() {
    let refused = |rows: &str| {
        let told = read(&workbook(&[("S", rows)]), &Form::default()).unwrap_err();
        told.contains("where no sheet has any")
    };
    assert!(refused("<row r=\"1\"><c r=\"ZZZZZZZZZZ1\"><v>1</v></c></row>"));
    assert!(refused("<row r=\"1\"><c r=\"A99999999999999999999\"><v>1</v></c></row>"));
    assert!(refused("<row r=\"18446744073709551616\"><c><v>1</v></c></row>"));
    let odd = |reference: &str| odd_reference(format!("<d ref=\"{reference}\"/>").as_bytes());
    assert_eq!(odd("XFD1048576:A1").as_deref(), Some("XFD1048576:A1"));
    assert_eq!([odd("A9:B10"), odd("Z1:AA1"), odd("A1"), odd("$A$1:B2")], [None, None, None, None]);
}

#[test]
fn cells_far_away_and_packed_bombs_take_no_memory() {
    let far = "<row r=\"1\"><c r=\"A1\"><v>1</v></c><c r=\"B1\"><v>2</v></c></row>\
               <row r=\"1048576\"><c r=\"XFD1048576\"><v>1</v></c></row>";
    let table = read(&workbook(&[("S", far)]), &Form::default()).unwrap();
    assert_eq!((table.columns().len(), table.row_count()), (3, 2));
    assert_eq!(table.records.blank, 1_048_574);
    let bomb = workbook(&[("S", &" ".repeat(1 << 23))]);
    assert!(bomb.len() < 1 << 17, "it is packed");
    let told = read(&bomb, &Form::default()).unwrap_err();
    assert!(
        told.contains("unpacked it has more than 4194304 bytes, the limit; split it"),
        "{told}"
    );
    let told = read(b"PK\x03\x04 and so on", &Form::default()).unwrap_err();
    assert!(told.contains("it cannot be read as a spreadsheet"), "{told}");
}
