//! The records of one length, among which the header and the first row are.

use super::{Piece, PieceKind, SampleRow, names};
use crate::measured_table::{MeasuredTableErrorKind, Result};

/// The records of the sample, and the columns that hold numbers in most rows.
pub(super) struct Block<'s> {
    sample: &'s [SampleRow],
    width: usize,
    is_number: Vec<bool>,
}

impl<'s> Block<'s> {
    pub(super) fn new(sample: &'s [SampleRow], width: usize) -> Self {
        // A title, a header and units have none.
        let has_numbers = |row: &&SampleRow| row.fits(width) && row.count(PieceKind::Number) > 0;
        let rows: Vec<&SampleRow> = sample.iter().filter(has_numbers).collect();
        let is_number = (0..width).map(|column| {
            let count = |kind| rows.iter().filter(|row| row.kind(column) == kind).count();
            let numbers = count(PieceKind::Number);
            numbers > 0 && numbers >= count(PieceKind::Text)
        });
        Self { sample, width, is_number: is_number.collect() }
    }

    /// Cells of this kind in the columns of numbers.
    fn in_numbers(&self, row: &SampleRow, kind: PieceKind) -> usize {
        let columns = self.is_number.iter().enumerate();
        columns.filter(|&(column, &is)| is && row.kind(column) == kind).count()
    }

    /// Whether half of the columns of numbers hold numbers.
    fn is_row(&self, row: &SampleRow) -> bool {
        let numbers = self.in_numbers(row, PieceKind::Number);
        numbers > 0 && 2 * numbers >= self.is_number.iter().filter(|&&is| is).count()
    }

    /// Whether names may stand there: no numbers, or among several texts different small whole numbers.
    fn is_header(&self, row: &SampleRow) -> bool {
        let (texts, numbers) =
            (self.in_numbers(row, PieceKind::Text), row.count(PieceKind::Number));
        let all_text = !self.is_number.contains(&true);
        let is_name =
            if numbers == 0 { texts > 0 || all_text } else { texts > 1 && names::are_counts(row) };
        row.fits(self.width) && is_name
    }

    /// The record of names above the first row: of several the first with most of them. Units are names only where
    /// there are no others.
    pub(super) fn header(&self) -> Option<usize> {
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

    pub(super) fn first_row(&self) -> usize {
        let is_row = |row: &SampleRow| row.fits(self.width) && self.is_row(row);
        let first = self.sample.iter().position(is_row);
        first
            .or_else(|| self.sample.iter().position(|row| row.fits(self.width)))
            .unwrap_or_default()
    }

    /// The nearest comment above the first row with as many cells as rows have.
    pub(super) fn comment_above(&self, first: usize) -> Option<usize> {
        let is_header = |row: &SampleRow| {
            row.is_comment
                && self.width > 1
                && row.length() == self.width
                && row.count(PieceKind::Number) == 0
        };
        self.sample[..first].iter().rposition(is_header)
    }

    /// An error where a record of names stands above the first row, of another length than rows have.
    pub(super) fn refuse_other_length(&self, first: usize, is_comma: bool) -> Result<()> {
        let is_text = |row: &SampleRow| {
            !row.is_comment && row.length() > 1 && row.count(PieceKind::Number) == 0
        };
        let header = self.sample[..first].iter().rfind(|row| is_text(row));
        let Some(header) = header else { return Ok(()) };
        let (header, names) = (header.line, header.length());
        let row = &self.sample[first];
        let (line, cells) = (row.line, row.length());
        if is_comma && self.are_halves(first, names) {
            return Err(MeasuredTableErrorKind::DecimalComma { header, names, line, cells });
        }
        // Fewer names than half of the cells are a title.
        if 2 * names <= self.width {
            return Ok(());
        }
        Err(MeasuredTableErrorKind::HeaderLength { header, names, line, cells })
    }

    /// Whether rows look like numbers split at their decimal commas: up to twice as many cells as names.
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
        let (Some(&least), Some(&most)) = (least, most) else { return false };
        // One cell more in every row is as well a forgotten name.
        names <= least && most <= 2 * names && (most > least || most > names + 1 || names == 1)
    }
}
