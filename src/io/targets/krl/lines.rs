//! The lines of a data list: their code without comments, and the lines that belong to the list.

use std::ops::Range;

use super::{InLine, KrlProblem};

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Line {
    /// Its number, from 1.
    pub(super) number: u64,
    /// The bytes of the line, without its end.
    pub(super) whole: Range<usize>,
    /// The bytes before a comment, without blanks around them.
    pub(super) code: Range<usize>,
    pub(super) next: usize,
}

pub(super) const CORRECTED: &str = "corrected by posegrid";
pub(super) const REFUSED: &str = "refused by posegrid";

pub(super) fn all(text: &[u8]) -> Result<Vec<Line>, InLine> {
    let mut lines = Vec::new();
    let mut start = 0;
    for piece in text.split_inclusive(|&byte| byte == b'\n') {
        let next = start + piece.len();
        let whole = start..start + without_end(piece).len();
        let number = lines.len() as u64 + 1;
        if text[whole.clone()].contains(&b'\r') {
            // Some readers take it for the end of a line, others do not: a comment to one is a statement to the other.
            return Err(InLine { line: number, problem: KrlProblem::LoneReturn.into() });
        }
        lines.push(Line { number, code: trimmed(text, code_of(text, whole.clone())), whole, next });
        start = next;
    }
    Ok(lines)
}

fn without_end(piece: &[u8]) -> &[u8] {
    let piece = piece.strip_suffix(b"\n").unwrap_or(piece);
    piece.strip_suffix(b"\r").unwrap_or(piece)
}

/// The bytes before a `;` that is not in a text.
fn code_of(text: &[u8], whole: Range<usize>) -> Range<usize> {
    let mut quoted = false;
    let is_comment = |&byte: &u8| {
        quoted ^= byte == b'"';
        byte == b';' && !quoted
    };
    let comment = text[whole.clone()].iter().position(is_comment);
    whole.start..comment.map_or(whole.end, |place| whole.start + place)
}

/// The range without blanks at either end.
pub(super) fn trimmed(text: &[u8], range: Range<usize>) -> Range<usize> {
    let inside = &text[range.clone()];
    let start = range.start + (inside.len() - inside.trim_ascii_start().len());
    start..start + inside.trim_ascii().len()
}

#[derive(Debug, PartialEq, Eq)]
pub(super) struct Inside<'l> {
    /// First byte after the line of DEFDAT.
    pub(super) head: usize,
    /// The lines between DEFDAT and ENDDAT.
    pub(super) lines: &'l [Line],
    /// First byte of the line of ENDDAT.
    pub(super) end: usize,
}

/// Only lines that begin with `&`, and comments, may come before; only comments after.
pub(super) fn of_list<'l>(text: &[u8], lines: &'l [Line]) -> Result<Inside<'l>, InLine> {
    let at =
        |line: &Line, problem: KrlProblem| InLine { line: line.number, problem: problem.into() };
    let at_end = |problem: KrlProblem| InLine { line: lines.len() as u64, problem: problem.into() };
    if let Some(line) = lines.iter().find(|line| is_ours(text, line)) {
        let comment = String::from_utf8_lossy(&text[line.whole.clone()]);
        let comment = comment.trim().to_owned();
        return Err(at(line, KrlProblem::Corrected { comment }));
    }
    let code = |line: &Line| &text[line.code.clone()];
    let first = lines.iter().position(|line| begins(code(line), "DEFDAT"));
    let first = first.ok_or_else(|| at_end(KrlProblem::NoList))?;
    let is_header = |line: &Line| code(line).is_empty() || code(line).starts_with(b"&");
    if let Some(line) = lines[..first].iter().find(|line| !is_header(line)) {
        return Err(at(line, KrlProblem::Outside));
    }
    let head = &lines[first];
    check_head(&code(head)["DEFDAT".len()..]).map_err(|problem| at(head, problem))?;
    let inside = &lines[first + 1..];
    let length = inside.iter().position(|line| begins(code(line), "ENDDAT"));
    let length = length.ok_or_else(|| at_end(KrlProblem::NoEnd))?;
    let end = &inside[length];
    if code(end).len() > "ENDDAT".len() {
        return Err(at(end, KrlProblem::Outside));
    }
    if let Some(line) = inside[length + 1..].iter().find(|line| !code(line).is_empty()) {
        return Err(at(line, KrlProblem::Outside));
    }
    if let Some(line) = inside[..length].iter().find(|line| begins(code(line), "DEFDAT")) {
        return Err(at(line, KrlProblem::SecondList));
    }
    Ok(Inside { head: head.next, lines: &inside[..length], end: end.whole.start })
}

pub(super) fn begins(code: &[u8], word: &str) -> bool {
    let own = code.get(..word.len());
    let after = code.get(word.len());
    own.is_some_and(|own| own.eq_ignore_ascii_case(word.as_bytes()))
        && after.is_none_or(|byte| !byte.is_ascii_alphanumeric() && !b"_$".contains(byte))
}

/// Checks the text after DEFDAT: a name, and PUBLIC or nothing.
fn check_head(behind: &[u8]) -> Result<(), KrlProblem> {
    let words: Vec<&[u8]> =
        behind.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect();
    let of_name = |byte: &u8| byte.is_ascii_alphanumeric() || b"_$".contains(byte);
    match words[..] {
        [name, ..] if name.starts_with(b"$") => Err(KrlProblem::System),
        [name] if name.iter().all(of_name) => Ok(()),
        [name, public] if name.iter().all(of_name) && public.eq_ignore_ascii_case(b"PUBLIC") => {
            Ok(())
        }
        _ => Err(KrlProblem::Head),
    }
}

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
