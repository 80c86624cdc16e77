//! CSV, TSV and other texts of lines and cells → a table.

use super::cells::Cells;
use super::head::{self, Head, Piece, PieceKind, SampleRow};
use super::number::{Contrary, Numbers};
use super::separator::{self, EitherMark, Marks, SAMPLE};
use super::split::{Rows, Separator, Span, comment};
use super::{
    Counted, Form, LeftOutFor, MeasuredTable, MeasuredTableErrorKind, Records, RowLeftOut, decoded,
};

/// Reads the bytes of a text.
pub(super) fn read(bytes: &[u8], form: &Form) -> Result<MeasuredTable, MeasuredTableErrorKind> {
    let decoded = decoded::decode(bytes)?;
    let text = decoded.text.as_ref();
    let stated = form.separator.or_else(|| separator_line(text));
    let separator = stated.map_or_else(|| separator::choose(text), Separator::stated);
    let sample = sample(text, separator)?;
    let mut head = head::find(&sample, form.header, separator == Separator::Sign(b','))?;
    let cells = sample.iter().flat_map(|row| row.pieces.iter());
    let found = Marks::count(cells.map(|piece| piece.text.as_str())).decimal();
    let decimal = form.decimal.or(found);
    let numbers = Numbers::with(decimal.unwrap_or('.'));
    let mut remarks: Vec<String> = decoded.remark.map(str::to_owned).into_iter().collect();
    remarks.extend(head.remark.take());
    let filled = match fill(text, separator, &head, numbers.clone())? {
        // The rows of the sample have no decimal mark, and a later one has.
        other if decimal.is_none() && other.contrary.iter().flatten().any(Found::is_mark) => {
            fill(text, separator, &head, numbers.other())?
        }
        filled => filled,
    };
    filled.refuse_contrary(&head)?;
    let comma = filled.numbers.mark() == ',';
    let mark = if comma {
        "decimal comma"
    } else {
        "decimal point"
    };
    remarks.insert(0, format!("separator {}, {mark}", separator.name()));
    filled.table(head, remarks)
}

/// The separator that a spreadsheet states in the first line: `sep=;`.
fn separator_line(text: &str) -> Option<char> {
    let line = text.lines().next()?.trim_end_matches('\r');
    let (key, sign) = line.split_at_checked(4)?;
    let mut signs = sign.chars();
    let sign = signs.next().filter(|_| key.eq_ignore_ascii_case("sep="))?;
    let is_sign = sign.is_ascii() && !sign.is_ascii_alphanumeric() && sign != '"';
    (is_sign && signs.next().is_none()).then_some(sign)
}

/// The first rows of a text.
fn sample(text: &str, separator: Separator) -> Result<Vec<SampleRow>, MeasuredTableErrorKind> {
    let either = EitherMark::new();
    let mut rows = Rows::new(text, separator);
    let (mut cells, mut sample) = (Vec::new(), Vec::new());
    while sample.len() < SAMPLE
        && let Some(line) = rows.next(&mut cells)?
    {
        let pieces = cells
            .iter()
            .map(|cell| piece(cell.text(text).as_ref(), &either))
            .collect();
        sample.push(row(line, pieces, separator));
    }
    Ok(sample)
}

fn piece(text: &str, either: &EitherMark) -> Piece {
    let kind = if text.is_empty() {
        PieceKind::Blank
    } else if either.is_number(text.as_bytes()) {
        PieceKind::Number
    } else {
        PieceKind::Text
    };
    Piece {
        kind,
        text: text.to_owned(),
    }
}

/// A row of the sample; the sign of a comment is taken off its first cell.
fn row(line: u64, mut pieces: Vec<Piece>, separator: Separator) -> SampleRow {
    let first = pieces
        .first()
        .and_then(|piece| comment(piece.text.as_bytes()));
    let is_comment = first.is_some();
    if let Some(rest) = first {
        let rest = String::from_utf8_lossy(rest.trim_ascii()).into_owned();
        if rest.is_empty() && separator == Separator::Spaces {
            pieces.remove(0);
        } else {
            // A column of numbers is often called `#`.
            pieces[0].text = if rest.is_empty() {
                "#".to_owned()
            } else {
                rest
            };
        }
    }
    let is_separator_line = line == 1
        && pieces.len() < 3
        && pieces[..]
            .first()
            .is_some_and(|p| p.text.eq_ignore_ascii_case("sep="));
    SampleRow {
        line,
        pieces,
        is_comment: is_comment || is_separator_line,
    }
}

/// The first number of a column in another way of writing.
#[derive(Debug, Clone, PartialEq)]
struct Found {
    line: u64,
    text: String,
    kind: Contrary,
}

impl Found {
    fn is_mark(&self) -> bool {
        self.kind == Contrary::OtherMark
    }
}

/// The table while its rows are read.
struct Filling<'t> {
    text: &'t str,
    numbers: Numbers,
    width: usize,
    cells: Cells,
    lines: Vec<u64>,
    left_out: Vec<RowLeftOut>,
    records: Records,
    /// For each column.
    contrary: Vec<Option<Found>>,
}

fn fill<'t>(
    text: &'t str,
    separator: Separator,
    head: &Head,
    numbers: Numbers,
) -> Result<Filling<'t>, MeasuredTableErrorKind> {
    let width = head.names.len();
    let mut filling = Filling {
        text,
        numbers,
        width,
        cells: Cells::default(),
        lines: Vec::new(),
        left_out: Vec::new(),
        records: Records::default(),
        contrary: vec![None; width],
    };
    let mut rows = Rows::new(text, separator);
    let mut cells = Vec::new();
    for _ in 0..head.above {
        rows.next(&mut cells)?;
        let is_blank = cells.iter().all(|cell| cell.is_empty());
        filling.records.blank += usize::from(is_blank);
        filling.records.before += usize::from(!is_blank);
    }
    while let Some(line) = rows.next(&mut cells)? {
        filling.record(line, &cells, head)?;
    }
    Ok(filling)
}

impl Filling<'_> {
    fn record(
        &mut self,
        line: u64,
        cells: &[Span],
        head: &Head,
    ) -> Result<(), MeasuredTableErrorKind> {
        let reason = if cells.iter().all(|cell| cell.is_empty()) {
            self.records.blank += 1;
            return Ok(());
        } else if !self.fits(cells) {
            Some(self.misfit(cells))
        } else if self.repeats(cells, &head.written)
            || head
                .units
                .as_ref()
                .is_some_and(|units| self.repeats_units(cells, units))
        {
            Some(LeftOutFor::Header)
        } else {
            None
        };
        match reason {
            Some(reason) => {
                self.left_out.push(RowLeftOut { line, reason });
                Ok(())
            }
            None => self.row(line, cells),
        }
    }

    /// Whether a record has as many cells as columns, apart from empty ones at its end.
    fn fits(&self, cells: &[Span]) -> bool {
        let behind = cells.get(self.width..);
        behind.is_some_and(|behind| behind.iter().all(|cell| cell.is_empty()))
    }

    fn misfit(&self, cells: &[Span]) -> LeftOutFor {
        let first = cells.first().map_or(&[][..], |cell| cell.bytes(self.text));
        if comment(first).is_some() {
            return LeftOutFor::Comment;
        }
        LeftOutFor::Cells {
            found: cells.len(),
            wanted: self.width,
        }
    }

    fn repeats(&self, cells: &[Span], written: &[String]) -> bool {
        let same = |(cell, text): (&Span, &String)| cell.text(self.text) == text.as_str();
        !written.is_empty() && cells.iter().zip(written).all(same)
    }

    fn repeats_units(&self, cells: &[Span], units: &[String]) -> bool {
        let bare = |cell: &Span| {
            let text = cell.text(self.text);
            text.trim_matches(['[', ']', '(', ')', '<', '>'])
                .trim()
                .to_owned()
        };
        cells
            .iter()
            .zip(units)
            .all(|(cell, unit)| bare(cell) == *unit)
    }

    fn row(&mut self, line: u64, cells: &[Span]) -> Result<(), MeasuredTableErrorKind> {
        for (column, cell) in cells[..self.width].iter().enumerate() {
            if cell.is_empty() {
                self.cells.blank();
            } else if let Some(number) = self.numbers.parse(cell.bytes(self.text)) {
                self.cells.number(number);
            } else {
                self.text_cell(line, column, *cell);
            }
        }
        self.lines.push(line);
        self.cells.check()
    }

    fn text_cell(&mut self, line: u64, column: usize, cell: Span) {
        let text = cell.text(self.text);
        if self.contrary[column].is_none()
            && let Some(kind) = self.numbers.contrary(&text)
        {
            let text = text.clone().into_owned();
            self.contrary[column] = Some(Found { line, text, kind });
        }
        self.cells.text(&text);
    }

    /// An error where a column has numbers in two ways of writing, or with separators of thousands.
    fn refuse_contrary(&self, head: &Head) -> Result<(), MeasuredTableErrorKind> {
        for (column, found) in self.contrary.iter().enumerate() {
            let Some(Found { line, text, kind }) = found.clone() else {
                continue;
            };
            let mut places = (0..self.lines.len()).map(|row| row * self.width + column);
            let has_numbers = places.any(|place| self.cells.is_number(place));
            let column = head.names[column].clone();
            let mark = self.numbers.mark();
            match kind {
                Contrary::Thousands => {}
                _ if !has_numbers => continue,
                Contrary::OtherMark => {
                    return Err(MeasuredTableErrorKind::OtherMark {
                        line,
                        column,
                        text,
                        mark,
                    });
                }
                Contrary::Grouped => {}
            }
            return Err(MeasuredTableErrorKind::Thousands { line, column, text });
        }
        Ok(())
    }

    fn table(
        self,
        head: Head,
        remarks: Vec<String>,
    ) -> Result<MeasuredTable, MeasuredTableErrorKind> {
        if self.lines.is_empty() {
            return Err(MeasuredTableErrorKind::NoRows { header: None });
        }
        let records = Records {
            rows: self.lines.len(),
            left_out: self.left_out.len(),
            ..self.records
        };
        Ok(MeasuredTable {
            columns: head.names,
            units: head.units,
            cells: self.cells,
            lines: self.lines,
            counted: Counted::Line,
            left_out: self.left_out,
            records,
            remarks,
        })
    }
}
