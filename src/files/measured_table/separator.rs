//! The separator and the decimal mark of a text, by its first rows: the right separator makes rows of one length that
//! are full of numbers.

use std::collections::BTreeMap;

use super::MeasuredTableErrorKind;
use super::fill::Written;
use super::number::Numbers;
use super::split::{Rows, Separator, comment};

pub(super) const SAMPLE: usize = 1000;

pub(super) struct EitherMark {
    point: Numbers,
    comma: Numbers,
}

impl EitherMark {
    pub(super) fn new() -> Self {
        let point = Numbers::with('.');
        let comma = point.other();
        Self { point, comma }
    }

    /// Whether a cell is a number with a decimal point, or with a comma between two digits.
    pub(super) fn is_number(&self, cell: &[u8]) -> bool {
        self.point.parse(cell).is_some() || self.has_comma(cell)
    }

    fn has_comma(&self, cell: &[u8]) -> bool {
        let comma = cell.iter().position(|&byte| byte == b',');
        let digit =
            |at: Option<usize>| at.and_then(|at| cell.get(at)).is_some_and(u8::is_ascii_digit);
        comma.is_some_and(|at| digit(at.checked_sub(1)) && digit(Some(at + 1)))
            && self.comma.parse(cell).is_some()
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Marks {
    points: usize,
    commas: usize,
}

impl Marks {
    pub(super) fn count<'c>(cells: impl Iterator<Item = &'c str>) -> Self {
        let either = EitherMark::new();
        let mut marks = Self::default();
        for cell in cells {
            let cell = cell.as_bytes();
            marks.commas += usize::from(either.has_comma(cell));
            marks.points += usize::from(cell.contains(&b'.') && either.point.parse(cell).is_some());
        }
        marks
    }

    /// The mark of most numbers; `None` where no number has one.
    pub(super) fn decimal(self) -> Option<char> {
        let is_comma = self.commas > self.points;
        (self != Self::default()).then_some(if is_comma { ',' } else { '.' })
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
struct Fit {
    /// Numbers in the rows of the length that has most of them.
    numbers: usize,
    /// Rows of one length, of two cells or more.
    rows: usize,
}

/// The separator that fits best; spaces where none does, so that a row is a cell or some.
pub(super) fn choose(text: &str) -> Separator {
    // Of two that fit alike the first.
    const SIGNS: [u8; 4] = [b'\t', b';', b'|', b','];
    let spaces = fit(text, Separator::Spaces);
    let mut best = (Separator::Spaces, spaces);
    for sign in SIGNS.into_iter().rev() {
        let separator = Separator::Sign(sign);
        let own = fit(text, separator);
        let other = match best {
            (Separator::Spaces, spaces) if sign == b'\t' => {
                Fit { numbers: spaces.numbers / 2, ..spaces }
            }
            // Where commas are decimal marks, two numbers with a space between look like three cells.
            (Separator::Spaces, spaces) if sign == b',' && own == spaces => continue,
            (_, other) => other,
        };
        if own.rows > 0 && own >= other {
            best = (separator, own);
        }
    }
    best.0
}

fn fit(text: &str, separator: Separator) -> Fit {
    let either = EitherMark::new();
    let mut of_length: BTreeMap<usize, Fit> = BTreeMap::new();
    let mut rows = Rows::new(text, separator);
    let mut cells = Vec::new();
    for _ in 0..SAMPLE {
        match rows.next(&mut cells) {
            Ok(Some(_)) => {}
            // It is the right sign, and the reader says what is wrong.
            Err(MeasuredTableErrorKind::TooManyColumns { .. })
                if separator != Separator::Spaces =>
            {
                return Fit { numbers: usize::MAX, rows: 1 };
            }
            _ => break,
        }
        let first = cells.first().map_or_else(Default::default, Written::text);
        if cells.len() < 2 || comment(first.as_bytes()).is_some() {
            continue;
        }
        let numbers = cells.iter().filter(|cell| either.is_number(cell.text().as_bytes()));
        let fit = of_length.entry(cells.len()).or_default();
        fit.numbers += numbers.count();
        fit.rows += usize::from(cells.iter().any(|cell| !cell.is_blank()));
    }
    of_length.into_values().max().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_separator_is_the_one_that_makes_numbers() {
        for (text, wanted) in [
            ("a,b\n1.5,2\n", Separator::Sign(b',')),
            ("a, b\n1.5, 2\n", Separator::Sign(b',')),
            ("a;b\n1,5;2,5\n", Separator::Sign(b';')),
            ("a;b\n1.5;2.5\n", Separator::Sign(b';')),
            ("x y\tz\nP 1\t2.5\t1\n", Separator::Sign(b'\t')),
            ("a\tb\n1,5\t2,5\n", Separator::Sign(b'\t')),
            ("a|b\n1|2\n", Separator::Sign(b'|')),
            ("a b\n1.5 2.5\n", Separator::Spaces),
            ("a b\n1,5 2,5\n", Separator::Spaces),
            ("1,5   2,5  -3,5\n", Separator::Spaces),
            ("Tool, of 5, with 3\na;b\n1;2\n3;4\n", Separator::Sign(b';')),
            ("# a;b;c\n# 1;2;3\na,b\n1,2\n", Separator::Sign(b',')),
            ("name;note\nA;this, that\nB;more, or less\n", Separator::Sign(b';')),
            ("x\n1.5\n2.5\n", Separator::Spaces),
            ("", Separator::Spaces),
            (
                &format!("a b{}\n1{}\n", ",c".repeat(70_000), ",1".repeat(70_000)),
                Separator::Sign(b','),
            ),
        ] {
            assert_eq!(choose(text), wanted, "{text:?}");
        }
    }

    #[test]
    fn the_decimal_mark_is_that_of_most_numbers() {
        let decimal = |cells: &[&str]| Marks::count(cells.iter().copied()).decimal();
        assert_eq!(decimal(&["1", "2", "x"]), None);
        assert_eq!(decimal(&["1,5", "2", "x"]), Some(','));
        assert_eq!(decimal(&["1.5", "2,5", "3.5"]), Some('.'));
        assert_eq!(decimal(&["2,02011E+13"]), Some(','));
        assert_eq!(decimal(&["a,b", "1,", ",5"]), None);
    }
}
