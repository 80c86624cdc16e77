use super::fill::{self, Filling, Written as _};
use super::head::{self, Head, Piece, SampleRow};
use super::number::Numbers;
use super::separator::{self, EitherMark, SAMPLE};
use super::split::{Rows, Separator, comment};
use super::{Counted, Form, MeasuredTable, Result, decoded};

pub(super) fn read(bytes: &[u8], form: &Form) -> Result<MeasuredTable> {
    let decoded = decoded::decode(bytes)?;
    let text = decoded.text.as_ref();
    let stated = form.separator.or_else(|| separator_line(text));
    let separator = stated.map_or_else(|| separator::choose(text), Separator::stated);
    let sample = sample(text, separator)?;
    let head = head::find(&sample, form.header, separator == Separator::Sign(b','))?;
    let fill = |numbers| fill(text, separator, &head, numbers);
    let filled = fill::filled(form.decimal, head::texts(&sample), fill)?;
    let mark = if filled.numbers.mark() == ',' { "comma" } else { "point" };
    let mut remarks = vec![format!("separator {}, decimal {mark}", separator.name())];
    remarks.extend(decoded.remark.map(str::to_owned));
    remarks.extend(head.remark.clone());
    filled.table(Counted::Line, remarks)
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

fn sample(text: &str, separator: Separator) -> Result<Vec<SampleRow>> {
    let either = EitherMark::new();
    let mut rows = Rows::new(text, separator);
    let (mut cells, mut sample) = (Vec::new(), Vec::new());
    while sample.len() < SAMPLE
        && let Some(line) = rows.next(&mut cells)?
    {
        let pieces = cells.iter().map(|cell| Piece::new(cell.text().as_ref(), &either)).collect();
        sample.push(row(line, pieces, separator));
    }
    Ok(sample)
}

/// A row of the sample; the sign of a comment is taken off its first cell.
fn row(line: u64, mut pieces: Vec<Piece>, separator: Separator) -> SampleRow {
    let first = pieces.first().and_then(|piece| comment(piece.text.as_bytes()));
    let is_comment = first.is_some();
    if let Some(rest) = first {
        let rest = String::from_utf8_lossy(rest.trim_ascii()).into_owned();
        if rest.is_empty() && separator == Separator::Spaces {
            pieces.remove(0);
        } else {
            // A column of numbers is often called `#`.
            pieces[0].text = if rest.is_empty() { "#".to_owned() } else { rest };
        }
    }
    let first = pieces.first().map_or("", |piece| piece.text.as_str());
    let is_separator_line = line == 1 && pieces.len() < 3 && first.eq_ignore_ascii_case("sep=");
    SampleRow { line, pieces, is_comment: is_comment || is_separator_line }
}

fn fill<'h>(text: &str, by: Separator, head: &'h Head, numbers: Numbers) -> Result<Filling<'h>> {
    let mut filling = Filling::new(head, numbers);
    let mut rows = Rows::new(text, by);
    let mut cells = Vec::new();
    for _ in 0..head.above {
        rows.next(&mut cells)?;
        filling.above(&cells);
    }
    while let Some(line) = rows.next(&mut cells)? {
        filling.record(line, &cells)?;
    }
    Ok(filling)
}

#[cfg(test)]
mod tests;
