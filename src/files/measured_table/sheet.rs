use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::io::{self, Read as _};

use zip::ZipArchive;

use super::fill::{self, Filling, Written};
use super::head::{self, Head, Piece, PieceKind, SampleRow};
use super::number::Numbers;
use super::separator::{EitherMark, SAMPLE};
use super::{Cell, Counted, Form, MOST_COLUMNS, MeasuredTable, MeasuredTableErrorKind, Result};
use crate::input::Bound;

const LETTERS: usize = 256;

#[derive(Debug, Clone, PartialEq)]
pub(super) enum SheetCell<'s> {
    Blank,
    Number(f64),
    Text(Cow<'s, str>),
}

/// Rows of a sheet that hold something, each with its number from 1, and their cells with their columns from 0.
#[derive(Debug, Clone, Default)]
pub(super) struct Sheet<'s> {
    pub(super) name: String,
    pub(super) rows: Vec<(u64, Vec<(u32, SheetCell<'s>)>)>,
}

impl SheetCell<'_> {
    /// Its number, or its text without spaces at the ends.
    fn cell(&self) -> Cell<'_> {
        match self {
            Self::Blank => Cell::Blank,
            Self::Number(number) => Cell::Number(*number),
            Self::Text(text) => Cell::Text(text.trim()),
        }
    }
}

impl Sheet<'_> {
    /// Whether a row has two numbers, or where `as_text` two cells that are numbers as a text of any way of writing.
    pub(super) fn has_table(&self, as_text: bool) -> bool {
        let point = Numbers::with('.');
        let is_number = |cell: Cell| match cell {
            Cell::Number(_) => true,
            _ => {
                as_text && (cell.number(&point).is_some() || point.contrary(&cell.text()).is_some())
            }
        };
        let numbers =
            |row: &[(u32, SheetCell)]| row.iter().filter(|(_, own)| is_number(own.cell())).count();
        self.rows.iter().any(|(_, row)| numbers(row) > 1)
    }

    /// The table in the sheet, in a file with sheets of these names.
    pub(super) fn table(&self, form: &Form, names: &[String]) -> Result<MeasuredTable> {
        self.own_table(form, names).map_err(|problem| MeasuredTableErrorKind::Sheet {
            name: self.name.clone(),
            problem: Box::new(problem),
        })
    }

    fn own_table(&self, form: &Form, names: &[String]) -> Result<MeasuredTable> {
        let all = self.columns(0);
        let head = head::find(&self.sample(&all)?, form.header, false)?;
        // A note beside the title makes no column.
        let columns = self.columns(head.header.unwrap_or(head.above));
        let sample = self.sample(&columns)?;
        let head = head::find(&sample, form.header, false)?;
        let fill = |numbers| self.fill(&head, &columns, numbers);
        let mut filling = fill::filled(form.decimal, head::texts(&sample), fill)?;
        filling.blank(self.absent());
        let mut remarks = self.remarks(form, names);
        remarks.extend(head.remark.clone());
        filling.table(Counted::Row, remarks)
    }

    fn fill<'h>(&self, head: &'h Head, columns: &[u32], numbers: Numbers) -> Result<Filling<'h>> {
        let mut filling = Filling::new(head, numbers);
        for (place, (line, row)) in self.rows.iter().enumerate() {
            let cells = dense(row, columns);
            if place < head.above {
                filling.above(&cells);
            } else {
                filling.record(*line, &cells)?;
            }
        }
        Ok(filling)
    }

    /// Number of rows above the last that hold nothing.
    fn absent(&self) -> usize {
        let last = self.rows.last().map_or(0, |(line, _)| *line);
        let absent = last.saturating_sub(self.rows.len() as u64);
        usize::try_from(absent).unwrap_or(usize::MAX)
    }

    /// What a person did not state: which of several sheets this is.
    fn remarks(&self, form: &Form, names: &[String]) -> Vec<String> {
        let mut remarks = vec![format!("sheet {:?}", self.name)];
        let others = names.iter().filter(|name| **name != self.name);
        let others: Vec<&str> = others.map(String::as_str).collect();
        if form.sheet.is_none() && !others.is_empty() {
            remarks.push(format!("it has other sheets: {}", others.join(", ")));
        }
        remarks
    }

    /// The columns that hold something in the rows from this one on.
    fn columns(&self, start: usize) -> Vec<u32> {
        let rows = self.rows.iter().skip(start);
        let cells = rows.flat_map(|(_, row)| row.iter());
        let filled = cells.filter(|(_, own)| !own.cell().is_blank());
        let columns: BTreeSet<u32> = filled.map(|(column, _)| *column).collect();
        columns.into_iter().collect()
    }

    fn sample(&self, columns: &[u32]) -> Result<Vec<SampleRow>> {
        if columns.len() > MOST_COLUMNS {
            return Err(MeasuredTableErrorKind::TooManyColumns { found: columns.len() });
        }
        let either = EitherMark::new();
        let rows = self.rows.iter().take(SAMPLE);
        let sample = rows.map(|(line, row)| SampleRow {
            line: *line,
            pieces: dense(row, columns).iter().map(|cell| piece(cell, &either)).collect(),
            is_comment: false,
        });
        Ok(sample.collect())
    }
}

fn piece(cell: &Cell<'_>, either: &EitherMark) -> Piece {
    let text = cell.text();
    if let Cell::Number(_) = cell {
        return Piece { kind: PieceKind::Number, text: text.into_owned() };
    }
    let end = text.char_indices().nth(LETTERS).map_or(text.len(), |(end, _)| end);
    Piece::new(&text[..end], either)
}

fn dense<'c>(row: &'c [(u32, SheetCell<'_>)], columns: &[u32]) -> Vec<Cell<'c>> {
    let mut cells = vec![Cell::Blank; columns.len()];
    for (column, own) in row {
        if let Ok(place) = columns.binary_search(column) {
            cells[place] = own.cell();
        }
    }
    cells
}

/// The sheet that a person names, or each that is shown until one has a table; an error where there is none of that name.
pub(super) fn chosen<'n>(
    names: &'n [String],
    hidden: &[String],
    form: &Form,
) -> Result<Vec<&'n String>> {
    let Some(wanted) = &form.sheet else {
        return Ok(names.iter().filter(|name| !hidden.contains(name)).collect());
    };
    match names.iter().find(|name| *name == wanted) {
        Some(name) => Ok(vec![name]),
        None => {
            Err(MeasuredTableErrorKind::NoSheet { wanted: wanted.clone(), found: names.to_vec() })
        }
    }
}

/// Most bytes of the styles of a workbook: each of its 65,490 cell formats takes some hundred.
const MOST_STYLES: u64 = 8 << 20;

/// Checks that a packed file is not larger than the bound when it is unpacked, and holds as many texts as it states.
pub(super) fn check_unpacked(bytes: &[u8], bound: Bound) -> Result<()> {
    let mut archive = ZipArchive::new(io::Cursor::new(bytes)).map_err(|error| wrong(&error))?;
    let (mut rest, mut unpacked) = (bound.bytes, Vec::new());
    for entry in 0..archive.len() {
        let entry = archive.by_index(entry).map_err(|error| wrong(&error))?;
        let name = entry.name().unwrap_or_default().to_lowercase();
        unpacked.clear();
        let found = entry.take(rest.saturating_add(1)).read_to_end(&mut unpacked);
        rest = rest
            .checked_sub(found.map_err(|error| wrong(&error))? as u64)
            .ok_or(MeasuredTableErrorKind::Unpacked { limit: bound.bytes, advice: bound.advice })?;
        check_part(&name, &unpacked)?;
    }
    Ok(())
}

/// Refuses parts of a spreadsheet that would take far more memory than their bytes.
fn check_part(name: &str, unpacked: &[u8]) -> Result<()> {
    let found = unpacked.len() as u64;
    if name.ends_with("styles.xml") && found > MOST_STYLES {
        let (limit, advice) = (MOST_STYLES, "its styles alone; save it without formats");
        return Err(MeasuredTableErrorKind::Unpacked { limit, advice });
    }
    let stated = || stated_texts(unpacked).is_some_and(|stated| stated > found);
    if name.ends_with("sharedstrings.xml") && stated() {
        let problem = "it states more texts than it has bytes for; save it anew";
        return Err(MeasuredTableErrorKind::Spreadsheet(problem.to_owned()));
    }
    if name.contains("worksheets/")
        && let Some(odd) = odd_reference(unpacked)
    {
        let problem = format!("it has cells at {odd:?}, where no sheet has any; save it anew");
        return Err(MeasuredTableErrorKind::Spreadsheet(problem));
    }
    Ok(())
}

/// The first reference of a cell, row or block that no sheet has: of more letters or digits than XFD1048576, or from an end to a start.
fn odd_reference(part: &[u8]) -> Option<String> {
    let after = |key: &'static [u8]| {
        let places = part.windows(key.len()).enumerate().filter(move |(_, own)| *own == key);
        places.map(move |(at, _)| &part[at + key.len()..])
    };
    let value = |rest: &[u8]| -> Vec<u8> {
        rest.iter().copied().take(64).take_while(|byte| *byte != b'"').collect()
    };
    let mut references = after(b" r=\"").chain(after(b" ref=\"")).map(value);
    let odd = references.find(|reference| {
        let ends: Option<Vec<_>> = reference.split(|byte| *byte == b':').map(corner).collect();
        ends.is_none_or(|ends| {
            ends.windows(2).any(|own| own[0].0 > own[1].0 || own[0].1 > own[1].1)
        })
    });
    odd.map(|odd| String::from_utf8_lossy(&odd).into_owned())
}

/// Column and row of a reference, to be compared; `None` beyond the ends of any sheet.
fn corner(reference: &[u8]) -> Option<((usize, &[u8]), u32)> {
    let letters = reference.iter().take_while(|byte| byte.is_ascii_alphabetic()).count();
    let (column, row) = reference.split_at(letters);
    let row = str::from_utf8(row).ok()?;
    let is_within = letters <= 3 && row.len() <= 7;
    is_within.then(|| ((letters, column), row.parse().unwrap_or(0)))
}

/// The largest number of texts that a part of a workbook states; room for so many is made before they are read.
fn stated_texts(part: &[u8]) -> Option<u64> {
    const KEY: &[u8] = b"uniqueCount";
    let keys = part.windows(KEY.len()).enumerate().filter(|(_, own)| *own == KEY);
    let stated = keys.map(|(at, _)| {
        let behind = part[at + KEY.len()..].iter().take(64);
        let digits = behind.skip_while(|byte| !byte.is_ascii_digit());
        digits.take_while(|byte| byte.is_ascii_digit()).fold(0_u64, |number, byte| {
            number.saturating_mul(10).saturating_add(u64::from(byte - b'0'))
        })
    });
    stated.max()
}

pub(super) fn wrong(error: &dyn Display) -> MeasuredTableErrorKind {
    MeasuredTableErrorKind::Spreadsheet(error.to_string())
}

#[cfg(test)]
mod tests;
