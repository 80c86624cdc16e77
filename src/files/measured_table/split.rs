//! A text → rows of cells: lines end with LF, CRLF or CR; a cell in quotes may hold separators, line ends and doubled
//! quotes.

use std::borrow::Cow;

use super::fill::Written;
use super::number::Numbers;
use super::{MeasuredTableErrorKind, Result};

const MOST_IN_ROW: usize = 1 << 16;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Separator {
    Sign(u8),
    Spaces,
}

impl Separator {
    /// The separator that a person states by one sign of ASCII.
    pub(super) fn stated(sign: char) -> Self {
        match u8::try_from(sign) {
            Ok(b' ') | Err(_) => Self::Spaces,
            Ok(sign) => Self::Sign(sign),
        }
    }

    pub(super) fn name(self) -> String {
        match self {
            Self::Spaces => "spaces".to_owned(),
            Self::Sign(b'\t') => "tab".to_owned(),
            Self::Sign(sign) => format!("{:?}", char::from(sign)),
        }
    }
}

/// A cell of a text without the spaces and quotes around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Span<'t> {
    inside: &'t str,
    quoted: bool,
}

impl Written for Span<'_> {
    #[inline]
    fn is_blank(&self) -> bool {
        self.inside.is_empty()
    }

    #[inline]
    fn number(&self, numbers: &Numbers) -> Option<f64> {
        numbers.parse(self.inside.as_bytes())
    }

    fn text(&self) -> Cow<'_, str> {
        if self.quoted && self.inside.contains('"') {
            return Cow::Owned(self.inside.replace("\"\"", "\""));
        }
        Cow::Borrowed(self.inside)
    }
}

#[derive(Debug, Clone)]
pub(super) struct Rows<'t> {
    whole: &'t str,
    text: &'t [u8],
    separator: Separator,
    at: usize,
    line: u64,
}

impl<'t> Rows<'t> {
    pub(super) fn new(text: &'t str, separator: Separator) -> Self {
        Self { whole: text, text: text.as_bytes(), separator, at: 0, line: 1 }
    }

    /// The cells of the next row, and the line that it begins in; `None` at the end of the text.
    pub(super) fn next(&mut self, cells: &mut Vec<Span<'t>>) -> Result<Option<u64>> {
        cells.clear();
        if self.at >= self.text.len() {
            return Ok(None);
        }
        let line = self.line;
        // A quote in a comment begins nothing.
        let quotes = !is_comment(&self.text[self.at..]);
        while cells.len() <= MOST_IN_ROW {
            let ends = match self.separator {
                Separator::Sign(sign) => self.cell(sign, quotes, cells)?,
                Separator::Spaces => self.word(quotes, cells)?,
            };
            if ends {
                return Ok(Some(line));
            }
        }
        Err(MeasuredTableErrorKind::TooManyColumns { found: cells.len() })
    }

    /// Reads a cell up to the next separator or line end, and tells whether the row ends there.
    #[inline]
    fn cell(&mut self, sign: u8, quotes: bool, cells: &mut Vec<Span<'t>>) -> Result<bool> {
        let start = self.skip(self.at, |byte| is_space(byte) && byte != sign);
        if quotes
            && self.text.get(start) == Some(&b'"')
            && let Some((span, after)) = self.quoted(start)?
        {
            let after = self.skip(after, |byte| is_space(byte) && byte != sign);
            if self.text.get(after).is_none_or(|&byte| byte == sign || is_end(byte)) {
                return Ok(self.close(span, after, cells));
            }
        }
        let stop = self.skip(start, |byte| byte != sign && !is_end(byte));
        let blanks = self.text[start..stop].iter().rev().take_while(|byte| is_space(**byte));
        let span = self.span(start, stop - blanks.count(), false);
        Ok(self.close(span, stop, cells))
    }

    /// The same where spaces separate: spaces at the end of a line begin no cell.
    fn word(&mut self, quotes: bool, cells: &mut Vec<Span<'t>>) -> Result<bool> {
        let start = self.skip(self.at, is_space);
        if self.text.get(start).is_none_or(|&byte| is_end(byte)) {
            self.at = self.end_line(start);
            return Ok(true);
        }
        if quotes
            && self.text[start] == b'"'
            && let Some((span, after)) = self.quoted(start)?
            && self.text.get(after).is_none_or(|&byte| is_space(byte) || is_end(byte))
        {
            return Ok(self.close_word(span, after, cells));
        }
        let end = self.skip(start, |byte| !is_space(byte) && !is_end(byte));
        let span = self.span(start, end, false);
        Ok(self.close_word(span, end, cells))
    }

    /// Takes a cell that ends before the byte at `stop`, a separator or the end of the row.
    #[inline]
    fn close(&mut self, span: Span<'t>, stop: usize, cells: &mut Vec<Span<'t>>) -> bool {
        cells.push(span);
        self.count_lines(span);
        match self.text.get(stop) {
            Some(&byte) if !is_end(byte) => {
                self.at = stop + 1;
                false
            }
            _ => {
                self.at = self.end_line(stop);
                true
            }
        }
    }

    fn close_word(&mut self, span: Span<'t>, stop: usize, cells: &mut Vec<Span<'t>>) -> bool {
        cells.push(span);
        self.count_lines(span);
        self.at = stop;
        false
    }

    /// A cell between two places, which are at signs of ASCII, so that no character is cut.
    #[inline]
    fn span(&self, start: usize, end: usize, quoted: bool) -> Span<'t> {
        let inside = self.whole.get(start..end).unwrap_or_default();
        Span { inside, quoted }
    }

    /// Lines that end inside a cell in quotes.
    #[inline]
    fn count_lines(&mut self, span: Span<'t>) {
        if span.quoted {
            let mut before = 0;
            for byte in span.inside.bytes() {
                let ends = byte == b'\r' || byte == b'\n' && before != b'\r';
                self.line += u64::from(ends);
                before = byte;
            }
        }
    }

    /// The inside of the quotes that open at `open`, and the place behind them; an error where they are never closed.
    fn quoted(&self, open: usize) -> Result<Option<(Span<'t>, usize)>> {
        let mut close = open + 1;
        loop {
            close = self.skip(close, |byte| byte != b'"');
            if close >= self.text.len() {
                return Err(MeasuredTableErrorKind::OpenQuote { line: self.line });
            }
            if self.text.get(close + 1) != Some(&b'"') {
                break;
            }
            close += 2;
        }
        let (mut start, mut end) = (open + 1, close);
        while start < end && is_space(self.text[start]) {
            start += 1;
        }
        while start < end && is_space(self.text[end - 1]) {
            end -= 1;
        }
        let span = self.span(start, end, true);
        Ok(Some((span, close + 1)))
    }

    #[inline]
    fn skip(&self, at: usize, goes_on: impl Fn(u8) -> bool) -> usize {
        let rest = self.text.get(at..).unwrap_or_default();
        let stop = rest.iter().position(|&byte| !goes_on(byte));
        stop.map_or(self.text.len(), |stop| at + stop)
    }

    #[inline]
    fn end_line(&mut self, stop: usize) -> usize {
        self.line += 1;
        match self.text.get(stop..) {
            Some([b'\r', b'\n', ..]) => stop + 2,
            _ => stop + 1,
        }
    }
}

#[inline]
const fn is_space(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t')
}

#[inline]
const fn is_end(byte: u8) -> bool {
    matches!(byte, b'\n' | b'\r')
}

/// The text of a line behind the sign of a comment, `#`, `%` or `//`; `None` where it is none.
pub(super) fn comment(line: &[u8]) -> Option<&[u8]> {
    let line = line.trim_ascii_start();
    let rest = line.strip_prefix(b"//");
    rest.or_else(|| line.strip_prefix(b"#")).or_else(|| line.strip_prefix(b"%"))
}

fn is_comment(rest: &[u8]) -> bool {
    let start = rest.iter().position(|&byte| !is_space(byte));
    start.is_some_and(|start| comment(&rest[start..rest.len().min(start + 2)]).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(text: &str, sign: char) -> Vec<(u64, Vec<String>)> {
        let mut rows = Rows::new(text, Separator::stated(sign));
        let (mut cells, mut found) = (Vec::new(), Vec::new());
        while let Some(line) = rows.next(&mut cells).unwrap() {
            let cells = cells.iter().map(|cell| cell.text().into_owned());
            found.push((line, cells.collect()));
        }
        found
    }

    fn row(line: u64, cells: &[&str]) -> (u64, Vec<String>) {
        (line, cells.iter().map(|&cell| cell.to_owned()).collect())
    }

    #[test]
    fn lines_are_counted_however_they_end() {
        for end in ["\n", "\r\n", "\r"] {
            let text = ["a;b", "", " 1 ;\t2 ", "3;"].join(end);
            let wanted =
                [row(1, &["a", "b"]), row(2, &[""]), row(3, &["1", "2"]), row(4, &["3", ""])];
            assert_eq!(rows(&text, ';'), wanted, "{end:?}");
            assert_eq!(rows(&(text + end), ';'), wanted, "{end:?} at the end");
        }
    }

    #[test]
    fn quotes_hold_separators_line_ends_and_quotes() {
        let text =
            "\"a;b\";\" c \"\r\n\"d\r\ne\"\"f\";2\r\n5\" ball;\"x\"y\r\n# it's \";\"\r\n;\"\"";
        let wanted = [
            row(1, &["a;b", "c"]),
            row(2, &["d\r\ne\"f", "2"]),
            row(4, &["5\" ball", "\"x\"y"]),
            row(5, &["# it's \"", "\""]),
            row(6, &["", ""]),
        ];
        assert_eq!(rows(text, ';'), wanted);
        let mut open = Rows::new("a;b\n1;\"2\n3;4\n", Separator::Sign(b';'));
        let mut cells = Vec::new();
        assert!(open.next(&mut cells).is_ok());
        assert!(matches!(
            open.next(&mut cells),
            Err(MeasuredTableErrorKind::OpenQuote { line: 2 })
        ));
    }

    #[test]
    fn spaces_and_tabs_separate_in_any_number() {
        let text = "  a \t b\n\n\"c d\"  2 \n3";
        let wanted = [row(1, &["a", "b"]), row(2, &[]), row(3, &["c d", "2"]), row(4, &["3"])];
        assert_eq!(rows(text, ' '), wanted);
    }
}
