use std::borrow::Cow;
use std::collections::HashMap;

use super::cells::Cells;
use super::head::Head;
use super::number::{Contrary, Numbers};
use super::separator::Marks;
use super::split::comment;
use super::{
    Cell, Counted, LeftOutFor, MOST_LEFT_OUT, MeasuredTable, MeasuredTableErrorKind, Records,
    Result, RowLeftOut,
};

pub(super) trait Written {
    fn is_blank(&self) -> bool;
    fn number(&self, numbers: &Numbers) -> Option<f64>;
    fn text(&self) -> Cow<'_, str>;
}

impl Written for Cell<'_> {
    fn is_blank(&self) -> bool {
        matches!(self, Self::Blank | Self::Text(""))
    }

    fn number(&self, numbers: &Numbers) -> Option<f64> {
        match self {
            Self::Blank => None,
            Self::Number(number) => Some(*number),
            // People type numbers into cells that are formatted as text.
            Self::Text(text) => numbers.parse(text.trim().as_bytes()),
        }
    }

    fn text(&self) -> Cow<'_, str> {
        match self {
            Self::Blank => Cow::Borrowed(""),
            Self::Number(number) => Cow::Owned(number.to_string()),
            Self::Text(text) => Cow::Borrowed(text.trim()),
        }
    }
}

/// The first number of a column in another way of writing.
#[derive(Debug, Clone, PartialEq)]
struct Found {
    line: u64,
    text: String,
    kind: Contrary,
}

/// The rows by the decimal mark that is stated, otherwise by that of most numbers of the sample of texts, or where these have none by
/// that of a later row.
pub(super) fn filled<'h, 's>(
    stated: Option<char>,
    sample: impl Iterator<Item = &'s str>,
    fill: impl Fn(Numbers) -> Result<Filling<'h>>,
) -> Result<Filling<'h>> {
    let decimal = stated.or_else(|| Marks::count(sample).decimal());
    let numbers = Numbers::with(decimal.unwrap_or('.'));
    let filled = fill(numbers.clone())?;
    let is_other = decimal.is_none() && filled.has_other_mark();
    if is_other { fill(numbers.other()) } else { Ok(filled) }
}

pub(super) struct Filling<'h> {
    head: &'h Head,
    pub(super) numbers: Numbers,
    width: usize,
    cells: Cells,
    lines: Vec<u64>,
    left_out: Vec<RowLeftOut>,
    records: Records,
    contrary: Vec<Option<Found>>,
}

impl<'h> Filling<'h> {
    pub(super) fn new(head: &'h Head, numbers: Numbers) -> Self {
        let width = head.names.len();
        Self {
            head,
            numbers,
            width,
            cells: Cells::default(),
            lines: Vec::new(),
            left_out: Vec::new(),
            records: Records::default(),
            contrary: vec![None; width],
        }
    }

    pub(super) fn above(&mut self, cells: &[impl Written]) {
        let is_blank = cells.iter().all(Written::is_blank);
        self.records.blank += usize::from(is_blank);
        self.records.before += usize::from(!is_blank);
    }

    pub(super) fn blank(&mut self, count: usize) {
        self.records.blank += count;
    }

    pub(super) fn leave_out(&mut self, line: u64, reason: LeftOutFor) -> Result<()> {
        if let Some(first) = self.left_out.first().filter(|_| self.left_out.len() >= MOST_LEFT_OUT)
        {
            return Err(MeasuredTableErrorKind::TooManyLeftOut { first: *first });
        }
        self.left_out.push(RowLeftOut { line, reason });
        Ok(())
    }

    pub(super) fn record(&mut self, line: u64, cells: &[impl Written]) -> Result<()> {
        if cells.iter().all(Written::is_blank) {
            self.blank(1);
            return Ok(());
        }
        match self.left_out_for(cells) {
            Some(reason) => self.leave_out(line, reason),
            None => self.row(line, cells),
        }
    }

    fn left_out_for(&self, cells: &[impl Written]) -> Option<LeftOutFor> {
        let repeats = |written: &[String]| {
            let same = |(cell, text): (_, &String)| Written::text(cell) == text.as_str();
            !written.is_empty() && cells.iter().zip(written).all(same)
        };
        // Cells may be empty behind the last column.
        let behind = cells.get(self.width..);
        if !behind.is_some_and(|behind| behind.iter().all(Written::is_blank)) {
            let first = cells.first().map_or_else(Default::default, Written::text);
            let misfit = LeftOutFor::Cells { found: cells.len(), wanted: self.width };
            let is_comment = comment(first.as_bytes()).is_some();
            return Some(if is_comment { LeftOutFor::Comment } else { misfit });
        }
        let is_header = repeats(&self.head.written) || repeats(&self.head.units_written);
        is_header.then_some(LeftOutFor::Header)
    }

    fn row(&mut self, line: u64, cells: &[impl Written]) -> Result<()> {
        for (column, cell) in cells[..self.width].iter().enumerate() {
            if cell.is_blank() {
                self.cells.blank();
            } else if let Some(number) = cell.number(&self.numbers) {
                self.cells.number(number);
            } else {
                self.text_cell(line, column, &cell.text())?;
            }
        }
        self.lines.push(line);
        self.cells.check()
    }

    fn text_cell(&mut self, line: u64, column: usize, text: &str) -> Result<()> {
        if self.contrary[column].is_none()
            && let Some(kind) = self.numbers.contrary(text)
        {
            let text = text.to_owned();
            self.contrary[column] = Some(Found { line, text, kind });
        }
        self.cells.text(text)
    }

    /// Whether a cell is a number with the other decimal mark.
    fn has_other_mark(&self) -> bool {
        let found = self.contrary.iter().flatten();
        found.into_iter().any(|found| found.kind == Contrary::OtherMark)
    }

    /// An error where a column has numbers in two ways of writing, or with separators of thousands.
    fn refuse_contrary(&self) -> Result<()> {
        for (place, found) in self.contrary.iter().enumerate() {
            let Some(Found { line, text, kind }) = found.clone() else { continue };
            // A column without any number is one of texts, whatever they look like.
            if kind != Contrary::Thousands && !self.has_numbers(place) {
                continue;
            }
            let column = self.head.names[place].clone();
            let mark = self.numbers.mark();
            return Err(match kind {
                Contrary::OtherMark => {
                    MeasuredTableErrorKind::OtherMark { line, column, text, mark }
                }
                Contrary::Thousands | Contrary::Grouped => {
                    let plain = self.numbers.ungrouped(&text, kind);
                    MeasuredTableErrorKind::Thousands { line, column, text, plain }
                }
            });
        }
        Ok(())
    }

    fn has_numbers(&self, column: usize) -> bool {
        let mut places = (0..self.lines.len()).map(|row| row * self.width + column);
        places.any(|place| self.cells.is_number(place))
    }

    /// The table; an error where there is no row, or numbers are written in several ways.
    pub(super) fn table(self, counted: Counted, remarks: Vec<String>) -> Result<MeasuredTable> {
        if self.lines.is_empty() {
            return Err(MeasuredTableErrorKind::NoRows);
        }
        self.refuse_contrary()?;
        let records =
            Records { rows: self.lines.len(), left_out: self.left_out.len(), ..self.records };
        Ok(MeasuredTable {
            columns: unlike(&self.head.names),
            units: self.head.units.clone(),
            cells: self.cells,
            lines: self.lines,
            counted,
            left_out: self.left_out,
            records,
            remarks,
        })
    }
}

/// Names, each of those that stand several times with its own number: `x #1`, `x #2`.
fn unlike(names: &[String]) -> Vec<String> {
    let mut places = HashMap::<&str, Vec<usize>>::new();
    names.iter().enumerate().for_each(|(place, own)| places.entry(own).or_default().push(place));
    let unlike = |(place, own): (usize, &String)| match &places[own.as_str()][..] {
        [_] => own.clone(),
        all => format!("{own} #{}", 1 + all.partition_point(|before| *before < place)),
    };
    names.iter().enumerate().map(unlike).collect()
}
