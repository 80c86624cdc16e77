//! Finding the header, a line of units and the first row among the first records of a text or a sheet.
//!
//! 1. The length of rows is that of the records with most numbers.
//! 2. The header is the first record of that length which has the most texts where rows have numbers. A title that a spreadsheet
//!    filled up with empty cells has fewer.
//! 3. A record of units may follow it.
//! 4. Without a header, a comment of that length above the first row is one; otherwise columns have their numbers as names.

mod labels;
mod names;

use std::collections::BTreeMap;

use super::separator::EitherMark;
use super::{MOST_COLUMNS, MeasuredTableErrorKind};

/// What a cell of the sample is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PieceKind {
    Blank,
    Number,
    Text,
}

/// A cell of the sample.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    pub(super) kind: PieceKind,
    pub(super) text: String,
}

impl Piece {
    pub(super) fn new(text: &str, either: &EitherMark) -> Self {
        let kind = if text.is_empty() {
            PieceKind::Blank
        } else if either.is_number(text.as_bytes()) {
            PieceKind::Number
        } else {
            PieceKind::Text
        };
        let text = text.to_owned();
        Self { kind, text }
    }
}

/// A record of the sample.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SampleRow {
    pub(super) line: u64,
    pub(super) pieces: Vec<Piece>,
    pub(super) is_comment: bool,
}

/// What stands above the rows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Head {
    /// Names of the columns.
    pub(super) names: Vec<String>,
    /// What the header's cells hold, by which it is known again; empty where there is no header.
    pub(super) written: Vec<String>,
    pub(super) units: Option<Vec<String>>,
    /// What the cells of the units hold; empty where there are none.
    pub(super) units_written: Vec<String>,
    /// The record of the sample that is the header; `None` where there is none.
    pub(super) header: Option<usize>,
    /// Records of the sample above the first row.
    pub(super) above: usize,
    /// What a person would want to know about the header.
    pub(super) remark: Option<String>,
}

impl Head {
    /// The head of records that name their values themselves.
    pub(super) fn of(names: Vec<String>) -> Self {
        Self {
            names,
            written: Vec::new(),
            units: None,
            units_written: Vec::new(),
            header: None,
            above: 0,
            remark: None,
        }
    }
}

impl SampleRow {
    fn is_blank(&self) -> bool {
        self.count(PieceKind::Blank) == self.pieces.len()
    }

    fn count(&self, kind: PieceKind) -> usize {
        self.pieces
            .iter()
            .filter(|piece| piece.kind == kind)
            .count()
    }

    /// Number of cells without blank ones at the end.
    fn length(&self) -> usize {
        let last = self
            .pieces
            .iter()
            .rposition(|piece| piece.kind != PieceKind::Blank);
        last.map_or(0, |last| last + 1)
    }

    fn kind(&self, column: usize) -> PieceKind {
        self.pieces
            .get(column)
            .map_or(PieceKind::Blank, |piece| piece.kind)
    }

    /// Whether it has `width` cells, apart from blank ones at the end.
    fn fits(&self, width: usize) -> bool {
        !self.is_comment && self.pieces.len() >= width && self.length() <= width && !self.is_blank()
    }

    fn texts(&self) -> Vec<String> {
        self.pieces.iter().map(|piece| piece.text.clone()).collect()
    }
}

/// Finds the head. `stated` is the line of the header, where a person states it, and `is_comma` tells that commas separate.
pub(super) fn find(
    sample: &[SampleRow],
    stated: Option<u64>,
    is_comma: bool,
) -> Result<Head, MeasuredTableErrorKind> {
    if let Some(line) = stated {
        return at_line(sample, line);
    }
    let width = width(sample).ok_or(MeasuredTableErrorKind::Empty)?;
    if width > MOST_COLUMNS {
        return Err(MeasuredTableErrorKind::TooManyColumns { found: width });
    }
    let block = Block::new(sample, width);
    if let Some(header) = block.header() {
        return Ok(below(sample, header, width));
    }
    let first = block.first_row();
    if let Some(comment) = block.comment_above(first) {
        let head = Head {
            remark: Some(format!(
                "the comment in line {} is the header",
                sample[comment].line
            )),
            ..below(sample, comment, width)
        };
        return Ok(Head {
            above: head.above.max(first),
            ..head
        });
    }
    block.refuse_other_length(first, is_comma)?;
    Ok(Head {
        above: first,
        remark: Some("it has no header: columns are named by their number, from 1".to_owned()),
        ..Head::of((1..=width).map(|number| number.to_string()).collect())
    })
}

/// The head whose header stands in this line.
fn at_line(sample: &[SampleRow], line: u64) -> Result<Head, MeasuredTableErrorKind> {
    let found = sample
        .iter()
        .position(|row| row.line == line && !row.is_blank());
    let header = found.ok_or(MeasuredTableErrorKind::NoHeaderThere { line })?;
    let width = sample[header].length();
    if width > MOST_COLUMNS {
        return Err(MeasuredTableErrorKind::TooManyColumns { found: width });
    }
    let rows = &sample[header + 1..];
    if rows.iter().any(|row| row.fits(width)) {
        return Ok(below(sample, header, width));
    }
    match rows.iter().find(|row| row.length() > 1 && !row.is_comment) {
        Some(row) => Err(MeasuredTableErrorKind::HeaderLength {
            header: line,
            names: width,
            line: row.line,
            cells: row.length(),
        }),
        None => Err(MeasuredTableErrorKind::NoRows),
    }
}

/// The head with this record as its header.
fn below(sample: &[SampleRow], header: usize, width: usize) -> Head {
    let row = &sample[header];
    let texts = row.texts();
    let names = names::columns(&texts, width);
    let next = (header + 1..sample.len()).find(|&place| !sample[place].is_blank());
    let next = next.filter(|&place| names::are_units(&sample[place], width));
    Head {
        names: labels::labelled(names, &sample[..header]),
        written: if row.is_comment { Vec::new() } else { texts },
        units: next.map(|place| names::units(&sample[place], width)),
        units_written: next.map_or_else(Vec::new, |place| sample[place].texts()),
        header: Some(header),
        above: next.unwrap_or(header) + 1,
        remark: None,
    }
}

/// Records of one number of cells: numbers in them, and how many there are.
type Weight = (usize, usize);

/// The number of cells of the records that have most numbers, or of most records where there is no number.
fn width(sample: &[SampleRow]) -> Option<usize> {
    let mut of_width: BTreeMap<usize, Weight> = BTreeMap::new();
    let rows = sample
        .iter()
        .filter(|row| !row.is_comment && !row.is_blank());
    for row in rows {
        let (numbers, rows) = of_width.entry(row.pieces.len()).or_default();
        *numbers += row.count(PieceKind::Number);
        *rows += 1;
    }
    let best = of_width
        .iter()
        .max_by_key(|&(width, weight)| (weight, width));
    let (&width, best) = best?;
    // Where half as many numbers stand below a record of names with as many cells, those are the rows.
    let named = named(sample).filter(|width| {
        of_width
            .get(width)
            .is_some_and(|own| own.0 > 0 && 2 * own.0 >= best.0)
    });
    let width = named.unwrap_or(width);
    // A separator may end each row, and nothing ever stands behind it.
    let rows = sample.iter().filter(|row| row.fits(width));
    rows.map(SampleRow::length).max()
}

/// The number of cells of the last record above the first number that has a text in each of several cells.
fn named(sample: &[SampleRow]) -> Option<usize> {
    let rows = sample.iter().filter(|row| !row.is_comment);
    let above = rows.take_while(|row| row.count(PieceKind::Number) == 0);
    let named =
        above.filter(|row| row.length() > 1 && row.count(PieceKind::Text) == row.pieces.len());
    named.last().map(|row| row.pieces.len())
}

/// The records of the sample, and the columns that hold numbers in most rows.
struct Block<'s> {
    sample: &'s [SampleRow],
    width: usize,
    is_number: Vec<bool>,
}

impl<'s> Block<'s> {
    fn new(sample: &'s [SampleRow], width: usize) -> Self {
        // A title, a header and units have none.
        let has_numbers = |row: &&SampleRow| row.fits(width) && row.count(PieceKind::Number) > 0;
        let rows: Vec<&SampleRow> = sample.iter().filter(has_numbers).collect();
        let is_number = (0..width).map(|column| {
            let count = |kind| rows.iter().filter(|row| row.kind(column) == kind).count();
            let numbers = count(PieceKind::Number);
            numbers > 0 && numbers >= count(PieceKind::Text)
        });
        Self {
            sample,
            width,
            is_number: is_number.collect(),
        }
    }

    /// Cells of this kind in the columns of numbers.
    fn in_numbers(&self, row: &SampleRow, kind: PieceKind) -> usize {
        let columns = self.is_number.iter().enumerate();
        columns
            .filter(|&(column, &is)| is && row.kind(column) == kind)
            .count()
    }

    /// Whether half of the columns of numbers hold numbers.
    fn is_row(&self, row: &SampleRow) -> bool {
        let numbers = self.in_numbers(row, PieceKind::Number);
        numbers > 0 && 2 * numbers >= self.is_number.iter().filter(|&&is| is).count()
    }

    /// Whether names may stand there: no numbers, or among several texts different small whole numbers.
    fn is_header(&self, row: &SampleRow) -> bool {
        let (texts, numbers) = (
            self.in_numbers(row, PieceKind::Text),
            row.count(PieceKind::Number),
        );
        let all_text = !self.is_number.contains(&true);
        let is_name = if numbers == 0 {
            texts > 0 || all_text
        } else {
            texts > 1 && names::are_counts(row)
        };
        row.fits(self.width) && is_name
    }

    /// The record of names above the first row: of several the one with most of them, of those the first. Units are names only
    /// where there are no others.
    fn header(&self) -> Option<usize> {
        let rows = self.sample.iter().enumerate();
        let above = rows.take_while(|(_, row)| {
            !row.fits(self.width) || self.is_header(row) || !self.is_row(row)
        });
        let headers = above.filter(|(_, row)| self.is_header(row));
        let named = headers.map(|(place, row)| {
            let blank = row.pieces[..self.width].iter();
            let blank = blank.filter(|piece| piece.kind == PieceKind::Blank).count();
            let are_units = names::are_units(row, self.width);
            (are_units, blank, place)
        });
        named.min().map(|(_, _, place)| place)
    }

    fn first_row(&self) -> usize {
        let is_row = |row: &SampleRow| row.fits(self.width) && self.is_row(row);
        let first = self.sample.iter().position(is_row);
        first
            .or_else(|| self.sample.iter().position(|row| row.fits(self.width)))
            .unwrap_or_default()
    }

    /// The nearest comment above the first row with as many cells as rows have.
    fn comment_above(&self, first: usize) -> Option<usize> {
        let is_header = |row: &SampleRow| {
            row.is_comment
                && self.width > 1
                && row.length() == self.width
                && row.count(PieceKind::Number) == 0
        };
        self.sample[..first].iter().rposition(is_header)
    }

    /// An error where a record of names stands above the first row, of another length than rows have.
    fn refuse_other_length(
        &self,
        first: usize,
        is_comma: bool,
    ) -> Result<(), MeasuredTableErrorKind> {
        let is_text = |row: &SampleRow| {
            !row.is_comment && row.length() > 1 && row.count(PieceKind::Number) == 0
        };
        let Some(header) = self.sample[..first].iter().rfind(|row| is_text(row)) else {
            return Ok(());
        };
        let names = header.length();
        let row = &self.sample[first];
        let (line, cells) = (row.line, row.length());
        if is_comma && self.are_halves(first, names) {
            return Err(MeasuredTableErrorKind::DecimalComma {
                header: header.line,
                names,
                line,
                cells,
            });
        }
        // Fewer names than half of the cells are a title.
        if 2 * names <= self.width {
            return Ok(());
        }
        Err(MeasuredTableErrorKind::HeaderLength {
            header: header.line,
            names,
            line,
            cells,
        })
    }

    /// Whether rows look like numbers with decimal commas that were split at them: up to twice as many cells as names, none
    /// with a point.
    fn are_halves(&self, first: usize, names: usize) -> bool {
        let rows = self.sample[first..].iter();
        let rows = rows.filter(|row| !row.is_blank() && !row.is_comment);
        let has_point = |piece: &Piece| piece.kind == PieceKind::Number && piece.text.contains('.');
        let mut lengths: Vec<usize> = Vec::new();
        for row in rows {
            if row.pieces.iter().any(has_point) {
                return false;
            }
            lengths.push(row.length());
        }
        let (least, most) = (lengths.iter().min(), lengths.iter().max());
        let (Some(&least), Some(&most)) = (least, most) else {
            return false;
        };
        // One cell more in every row is as well a forgotten name.
        names <= least && most <= 2 * names && (most > least || most > names + 1 || names == 1)
    }
}
