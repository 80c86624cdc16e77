//! ODS → a table. A few bytes of it repeat cells and rows a million times, so it is read here with bounds of our own.

use std::borrow::Cow;
use std::io::{Cursor, Read as _};

use roxmltree::{Document, Node};
use zip::ZipArchive;
use zip::result::ZipError;

use super::number::Numbers;
use super::sheet::{self, Sheet, SheetCell};
use super::tree::MOST_NODES;
use super::{Form, MeasuredTable, MeasuredTableErrorKind};
use crate::io::input::Bound;

const TABLE: &str = "urn:oasis:names:tc:opendocument:xmlns:table:1.0";
const OFFICE: &str = "urn:oasis:names:tc:opendocument:xmlns:office:1.0";

/// Whether a packed file is a spreadsheet of ODF: it states so in its first entry.
pub(super) fn is(bytes: &[u8]) -> bool {
    const STATED: &[u8] = b"application/vnd.oasis.opendocument.spreadsheet";
    let start = &bytes[..bytes.len().min(256)];
    start.windows(STATED.len()).any(|part| part == STATED)
}

/// Reads the bytes of a spreadsheet of ODF.
pub(super) fn read(
    bytes: &[u8],
    form: &Form,
    bound: Bound,
) -> Result<MeasuredTable, MeasuredTableErrorKind> {
    sheet::check_unpacked(bytes, bound)?;
    let text = content(bytes)?;
    let document = Document::parse(&text);
    let document =
        document.map_err(|error| MeasuredTableErrorKind::Spreadsheet(error.to_string()))?;
    let sheets = document.descendants().filter(|node| node.has_tag_name((TABLE, "table")));
    let sheets: Vec<Node> = sheets.collect();
    let names: Vec<String> = sheets.iter().copied().map(name).collect();
    for wanted in sheet::chosen(&names, form)? {
        let Some(own) = sheets.iter().find(|sheet| name(**sheet) == *wanted) else {
            continue;
        };
        let sheet = Sheet {
            name: wanted.clone(),
            rows: rows(*own).ok_or(MeasuredTableErrorKind::TooManyCells)?,
        };
        if form.sheet.is_some() || sheet.has_table() {
            return sheet.table(form, &names);
        }
    }
    Err(MeasuredTableErrorKind::Empty)
}

/// The part of the file that holds its cells.
fn content(bytes: &[u8]) -> Result<String, MeasuredTableErrorKind> {
    let packed = |error: ZipError| sheet::packed(&error);
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(packed)?;
    let mut content = archive.by_name("content.xml").map_err(packed)?;
    let mut text = String::new();
    let read = content.read_to_string(&mut text);
    read.map_err(|error| MeasuredTableErrorKind::Spreadsheet(error.to_string()))?;
    Ok(text)
}

fn name(sheet: Node) -> String {
    sheet.attribute((TABLE, "name")).unwrap_or_default().to_owned()
}

/// The number of times that an element stands for itself.
fn repeated(node: Node, key: &str) -> u64 {
    let stated = node.attribute((TABLE, key));
    stated.and_then(|stated| stated.parse().ok()).unwrap_or(1)
}

type Rows<'d> = Vec<(u64, Vec<(u32, SheetCell<'d>)>)>;

/// The rows of a sheet that hold something; `None` where there are too many cells.
fn rows<'d>(sheet: Node<'d, '_>) -> Option<Rows<'d>> {
    let numbers = Numbers::with('.');
    let (mut rows, mut line, mut count) = (Vec::new(), 0_u64, 0_usize);
    for row in sheet.descendants().filter(|node| node.has_tag_name((TABLE, "table-row"))) {
        let times = repeated(row, "number-rows-repeated");
        let cells = cells(row, &numbers)?;
        if cells.is_empty() {
            line = line.saturating_add(times);
            continue;
        }
        for _ in 0..times {
            line += 1;
            count += cells.len();
            if count > MOST_NODES {
                return None;
            }
            rows.push((line, cells.clone()));
        }
    }
    Some(rows)
}

/// The cells of a row that hold something; `None` where there are too many.
fn cells<'d>(row: Node<'d, '_>, numbers: &Numbers) -> Option<Vec<(u32, SheetCell<'d>)>> {
    const MOST: usize = 1 << 14;
    let is_cell = |node: &Node| {
        node.has_tag_name((TABLE, "table-cell")) || node.has_tag_name((TABLE, "covered-table-cell"))
    };
    let (mut cells, mut column) = (Vec::new(), 0_u32);
    for cell in row.children().filter(is_cell) {
        let times = repeated(cell, "number-columns-repeated");
        let times = u32::try_from(times).unwrap_or(u32::MAX);
        let own = own(cell, numbers);
        if own == SheetCell::Blank {
            column = column.saturating_add(times);
            continue;
        }
        for _ in 0..times {
            if cells.len() == MOST {
                return None;
            }
            cells.push((column, own.clone()));
            column = column.saturating_add(1);
        }
    }
    Some(cells)
}

fn own<'d>(cell: Node<'d, '_>, numbers: &Numbers) -> SheetCell<'d> {
    let stated = |key| cell.attribute((OFFICE, key));
    let text = |text: &str| match text.trim() {
        "" => SheetCell::Blank,
        text => SheetCell::Text(Cow::Owned(text.to_owned())),
    };
    match stated("value-type") {
        Some("float" | "percentage" | "currency") => {
            let value = stated("value").unwrap_or_default();
            let number = numbers.parse(value.trim().as_bytes());
            number.map_or_else(|| text(value), SheetCell::Number)
        }
        Some("date") => text(stated("date-value").unwrap_or_default()),
        Some("time") => text(stated("time-value").unwrap_or_default()),
        Some("boolean") => text(stated("boolean-value").unwrap_or_default()),
        Some(_) => match stated("string-value") {
            Some(own) => text(own),
            None => text(&paragraphs(cell)),
        },
        None => SheetCell::Blank,
    }
}

/// The text that a cell shows, without comments on it.
fn paragraphs(cell: Node) -> String {
    let paragraphs = cell.children().filter(|node| node.tag_name().name() == "p");
    let texts = paragraphs.map(|paragraph| {
        let texts =
            paragraph.descendants().filter_map(|node| node.text().filter(|_| node.is_text()));
        texts.collect::<String>()
    });
    let texts: Vec<String> = texts.collect();
    texts.join("\n")
}
