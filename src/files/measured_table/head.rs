//! Finding the header, a line of units and the first row among the first records of a text or a sheet. The length of
//! rows is that of the records with most numbers; the header is the first record of that length with the most texts
//! where rows have numbers. Without a header, a comment of that length above the first row is one; otherwise columns
//! have their numbers as names.

mod block;
mod labels;
mod names;

use std::collections::BTreeMap;

use super::separator::EitherMark;
use super::{MOST_COLUMNS, MeasuredTableErrorKind, Result};
use block::Block;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PieceKind {
    Blank,
    Number,
    Text,
}

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

#[derive(Debug, Clone, PartialEq)]
pub(super) struct SampleRow {
    pub(super) line: u64,
    pub(super) pieces: Vec<Piece>,
    pub(super) is_comment: bool,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Head {
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
    pub(super) remark: Option<String>,
}

impl Head {
    /// The head of records that name their values themselves.
    pub(super) fn of(names: Vec<String>) -> Self {
        Self { names, ..Self::default() }
    }
}

pub(super) fn texts(sample: &[SampleRow]) -> impl Iterator<Item = &str> {
    sample.iter().flat_map(|row| &row.pieces).map(|piece| piece.text.as_str())
}

impl SampleRow {
    fn is_blank(&self) -> bool {
        self.count(PieceKind::Blank) == self.pieces.len()
    }

    fn count(&self, kind: PieceKind) -> usize {
        self.pieces.iter().filter(|piece| piece.kind == kind).count()
    }

    fn length(&self) -> usize {
        let last = self.pieces.iter().rposition(|piece| piece.kind != PieceKind::Blank);
        last.map_or(0, |last| last + 1)
    }

    fn kind(&self, column: usize) -> PieceKind {
        self.pieces.get(column).map_or(PieceKind::Blank, |piece| piece.kind)
    }

    fn fits(&self, width: usize) -> bool {
        !self.is_comment && self.pieces.len() >= width && self.length() <= width && !self.is_blank()
    }

    fn texts(&self) -> Vec<String> {
        self.pieces.iter().map(|piece| piece.text.clone()).collect()
    }
}

/// Finds the head. `stated` is the line of the header, where a person states it, and `is_comma` tells that commas
/// separate.
pub(super) fn find(sample: &[SampleRow], stated: Option<u64>, is_comma: bool) -> Result<Head> {
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
        let head = below(sample, comment, width);
        let remark = Some(format!("the comment in line {} is the header", sample[comment].line));
        return Ok(Head { remark, above: head.above.max(first), ..head });
    }
    block.refuse_other_length(first, is_comma)?;
    Ok(Head {
        above: first,
        remark: Some("it has no header: columns are named by their number, from 1".to_owned()),
        ..Head::of((1..=width).map(|number| number.to_string()).collect())
    })
}

fn at_line(sample: &[SampleRow], line: u64) -> Result<Head> {
    let found = sample.iter().position(|row| row.line == line && !row.is_blank());
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

/// The number of cells of the records that have most numbers, or of most records where there is no number.
fn width(sample: &[SampleRow]) -> Option<usize> {
    // Of the records of each number of cells: numbers in them, and how many there are.
    let mut of_width: BTreeMap<usize, (usize, usize)> = BTreeMap::new();
    let rows = sample.iter().filter(|row| !row.is_comment && !row.is_blank());
    for row in rows {
        let (numbers, rows) = of_width.entry(row.pieces.len()).or_default();
        *numbers += row.count(PieceKind::Number);
        *rows += 1;
    }
    let best = of_width.iter().max_by_key(|&(width, weight)| (weight, width));
    let (&width, best) = best?;
    // Where half as many numbers stand below a record of names with as many cells, those are the rows.
    let named = named(sample)
        .filter(|width| of_width.get(width).is_some_and(|own| own.0 > 0 && 2 * own.0 >= best.0));
    let width = named.unwrap_or(width);
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
