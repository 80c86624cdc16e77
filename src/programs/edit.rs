//! Bytes of a file to replace, and whole lines to insert.

use std::ops::Range;

use crate::lex::after_mark;

/// The words that begin the comment of a corrected file.
pub const CORRECTED: &str = "corrected by posegrid";

/// Bytes of a file to replace.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Edit {
    pub span: Range<usize>,
    pub text: String,
}

/// An insertion of whole lines at a place; a line is ended first where the place is inside one.
pub(crate) fn insert(bytes: &[u8], place: usize, line: String, end: &str) -> Edit {
    let is_line_start = place == after_mark(bytes) || matches!(bytes[place - 1], b'\n' | b'\r');
    let text = if is_line_start { line } else { format!("{end}{line}") };
    Edit { span: place..place, text }
}

/// The ends of a file's lines: those of its first.
pub(crate) fn line_end(bytes: &[u8]) -> &'static str {
    match bytes.iter().position(|byte| *byte == b'\n') {
        Some(place) if place > 0 && bytes[place - 1] == b'\r' => "\r\n",
        Some(_) => "\n",
        None if bytes.contains(&b'\r') => "\r",
        None => "\r\n",
    }
}

#[cfg(test)]
mod tests {
    use super::line_end;

    #[test]
    fn lines_end_as_the_first_one_does() {
        let texts: [&[u8]; 4] = [b"a\r\nb\n", b"a\nb\r\n", b"a\rb\r", b"a"];
        assert_eq!(texts.map(line_end), ["\r\n", "\n", "\r", "\r\n"]);
    }
}
