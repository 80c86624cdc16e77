//! The lines of a data list: their code, apart from comments, and which of them are its own.

use std::ops::Range;

use super::{InLine, KrlProblem};

/// One line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line {
    /// From 1.
    pub(super) number: u64,
    /// Without its end.
    pub(super) whole: Range<usize>,
    /// As far as a comment, without blanks around it.
    pub(super) code: Range<usize>,
    /// After its end.
    pub(super) next: usize,
}

/// What a program that writes these lines begins them with.
pub(super) const CORRECTED: &str = "corrected by posegrid";
pub(super) const REFUSED: &str = "refused by posegrid";

/// All lines of a text.
pub(super) fn all(text: &[u8]) -> Result<Vec<Line>, InLine> {
    let mut lines = Vec::new();
    let mut start = 0;
    for piece in text.split_inclusive(|&byte| byte == b'\n') {
        let next = start + piece.len();
        let whole = start..start + without_end(piece).len();
        let number = lines.len() as u64 + 1;
        if text[whole.clone()].contains(&b'\r') {
            // Some readers take it for the end of a line, some do not: what is a comment to one is a statement to another.
            return Err(InLine {
                line: number,
                problem: KrlProblem::LoneReturn.into(),
            });
        }
        lines.push(Line {
            number,
            code: trimmed(text, code_of(text, whole.clone())),
            whole,
            next,
        });
        start = next;
    }
    Ok(lines)
}

fn without_end(piece: &[u8]) -> &[u8] {
    let piece = piece.strip_suffix(b"\n").unwrap_or(piece);
    piece.strip_suffix(b"\r").unwrap_or(piece)
}

/// As far as a `;` that does not stand in a text.
fn code_of(text: &[u8], whole: Range<usize>) -> Range<usize> {
    let mut quoted = false;
    let is_comment = |&byte: &u8| {
        quoted ^= byte == b'"';
        byte == b';' && !quoted
    };
    let comment = text[whole.clone()].iter().position(is_comment);
    whole.start..comment.map_or(whole.end, |place| whole.start + place)
}

/// Without blanks at either end.
pub(super) fn trimmed(text: &[u8], range: Range<usize>) -> Range<usize> {
    let inside = &text[range.clone()];
    let start = range.start + (inside.len() - inside.trim_ascii_start().len());
    start..start + inside.trim_ascii().len()
}

/// Where the list's own statements begin, and its lines: those after DEFDAT and before ENDDAT.
pub(super) fn of_list<'l>(text: &[u8], lines: &'l [Line]) -> Result<(usize, &'l [Line]), InLine> {
    let at = |line: &Line, problem: KrlProblem| InLine {
        line: line.number,
        problem: problem.into(),
    };
    if let Some(line) = lines.iter().find(|line| is_ours(text, line)) {
        let comment = String::from_utf8_lossy(&text[line.whole.clone()]);
        let comment = comment.trim().to_owned();
        return Err(at(line, KrlProblem::Corrected { comment }));
    }
    let begins = |line: &Line, word: &str| {
        let code = &text[line.code.clone()];
        let words = code.get(..word.len());
        let after = code.get(word.len());
        words.is_some_and(|own| own.eq_ignore_ascii_case(word.as_bytes()))
            && after.is_none_or(|byte| !byte.is_ascii_alphanumeric() && *byte != b'_')
    };
    let Some(first) = lines.iter().position(|line| begins(line, "DEFDAT")) else {
        return Err(InLine {
            line: lines.len() as u64,
            problem: KrlProblem::NoList.into(),
        });
    };
    let head = &lines[first];
    let name = text[head.code.clone()]["DEFDAT".len()..].trim_ascii_start();
    if name.starts_with(b"$") {
        return Err(at(head, KrlProblem::System));
    }
    let inside = &lines[first + 1..];
    let end = inside.iter().position(|line| begins(line, "ENDDAT"));
    Ok((head.next, &inside[..end.unwrap_or(inside.len())]))
}

/// Whether a line is a comment that corrected lists have.
fn is_ours(text: &[u8], line: &Line) -> bool {
    let comment = &text[line.code.end..line.whole.end];
    let comment = comment.strip_prefix(b";").unwrap_or_default();
    let words = comment.trim_ascii_start();
    line.code.is_empty()
        && [CORRECTED, REFUSED].iter().any(|ours| {
            let own = words.get(..ours.len());
            own.is_some_and(|own| own.eq_ignore_ascii_case(ours.as_bytes()))
        })
}
