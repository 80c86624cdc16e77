//! Cells in eight bytes each: numbers as they are, blanks and texts as NaNs of their own.

use super::{Cell, MOST_CELLS, MeasuredTableErrorKind, Result};

/// The bits of a blank: a NaN that no number becomes, since every NaN among numbers is [`f64::NAN`].
const BLANK: u64 = 0xfff8_0000_0000_0001;
/// A text: these bits, and its place among the texts below them.
const TEXT: u64 = 0xfffc_0000_0000_0000;
const PLACE: u64 = 0x0003_ffff_ffff_ffff;

const MOST_TEXT: usize = 1 << 29;

#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Cells {
    bits: Vec<u64>,
    texts: String,
    ends: Vec<usize>,
}

impl Cells {
    pub(super) fn number(&mut self, number: f64) {
        let number = if number.is_finite() { number } else { f64::NAN };
        self.bits.push(number.to_bits());
    }

    pub(super) fn blank(&mut self) {
        self.bits.push(BLANK);
    }

    /// Takes a text; an error where there are too many. A short file may have one long text in many cells.
    pub(super) fn text(&mut self, text: &str) -> Result<()> {
        if self.texts.len() + text.len() > MOST_TEXT {
            return Err(MeasuredTableErrorKind::TooManyCells);
        }
        self.bits.push(TEXT | self.ends.len() as u64);
        self.texts.push_str(text);
        self.ends.push(self.texts.len());
        Ok(())
    }

    pub(super) fn check(&self) -> Result<()> {
        if self.bits.len() > MOST_CELLS {
            return Err(MeasuredTableErrorKind::TooManyCells);
        }
        Ok(())
    }

    pub(super) fn is_number(&self, place: usize) -> bool {
        let bits = self.bits[place];
        bits != BLANK && bits & TEXT != TEXT
    }

    pub(super) fn get(&self, place: usize) -> Cell<'_> {
        let bits = self.bits[place];
        if bits == BLANK {
            return Cell::Blank;
        }
        if bits & TEXT != TEXT {
            return Cell::Number(f64::from_bits(bits));
        }
        let text = usize::try_from(bits & PLACE).expect("a place in memory");
        let start = text.checked_sub(1).map_or(0, |before| self.ends[before]);
        Cell::Text(&self.texts[start..self.ends[text]])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_come_back_as_they_were() {
        let mut cells = Cells::default();
        let numbers = [0.0, -0.0, f64::MAX, f64::MIN_POSITIVE / 8.0, -1.5];
        for number in numbers {
            cells.number(number);
        }
        for number in [f64::NAN, -f64::NAN, f64::INFINITY, f64::from_bits(BLANK)] {
            cells.number(number);
        }
        cells.blank();
        cells.text("a").unwrap();
        cells.text("").unwrap();
        cells.text("ß°").unwrap();
        for (place, number) in numbers.into_iter().enumerate() {
            let Cell::Number(found) = cells.get(place) else {
                panic!("{number}");
            };
            assert_eq!(found.to_bits(), number.to_bits());
        }
        for place in 5..9 {
            assert!(matches!(cells.get(place), Cell::Number(number) if number.is_nan()));
            assert!(cells.is_number(place));
        }
        let rest: Vec<Cell> = (9..13).map(|place| cells.get(place)).collect();
        assert_eq!(rest, [Cell::Blank, Cell::Text("a"), Cell::Text(""), Cell::Text("ß°")]);
    }
}
