//! Names of columns, and words of units.

use super::{PieceKind, SampleRow};

/// Names of `width` columns: what the header writes, in one line; without that, their number from 1.
pub(super) fn columns(written: &[String], width: usize) -> Vec<String> {
    let name = |column: usize| {
        let text = written.get(column).map_or("", String::as_str);
        let words: Vec<&str> = text.split_whitespace().collect();
        if words.is_empty() { (column + 1).to_string() } else { words.join(" ") }
    };
    (0..width).map(name).collect()
}

/// The units that a record writes, without brackets; empty for a blank cell.
pub(super) fn units(row: &SampleRow, width: usize) -> Vec<String> {
    let unit = |column: usize| {
        let text = row.pieces.get(column).map_or("", |piece| piece.text.trim());
        bare(text).unwrap_or(text).trim().to_owned()
    };
    (0..width).map(unit).collect()
}

pub(super) fn are_units(row: &SampleRow, width: usize) -> bool {
    let mut units = 0;
    for piece in row.pieces.iter().filter(|piece| piece.kind != PieceKind::Blank) {
        let text = piece.text.trim();
        match bare(text) {
            Some(inside) if inside.len() <= 16 => units += 1,
            _ if is_unit(text) => units += 1,
            _ if matches!(text, "-" | "–" | "1") => {}
            _ => return false,
        }
    }
    units > 0 && !row.is_comment && row.length() <= width
}

/// The inside of the brackets around a text.
fn bare(text: &str) -> Option<&str> {
    let inside = |open, close| text.strip_prefix(open)?.strip_suffix(close);
    inside('[', ']').or_else(|| inside('(', ')')).or_else(|| inside('<', '>'))
}

fn is_unit(text: &str) -> bool {
    const UNITS: [&str; 41] = [
        "mm", "cm", "dm", "m", "um", "µm", "μm", "nm", "in", "inch", "inches", "\"", "ft", "km",
        "deg", "degree", "degrees", "°", "rad", "mrad", "gon", "grad", "s", "sec", "ms", "us",
        "ns", "min", "h", "hz", "°c", "degc", "celsius", "°f", "k", "mm²", "mm^2", "mm2", "m²",
        "m^2", "ppm",
    ];
    UNITS.contains(&text.to_lowercase().as_str())
}

/// Whether the numbers of a record are different whole numbers of up to three digits, as columns are numbered.
pub(super) fn are_counts(row: &SampleRow) -> bool {
    let numbers = row.pieces.iter().filter(|piece| piece.kind == PieceKind::Number);
    let mut found: Vec<&str> = numbers.map(|piece| piece.text.trim()).collect();
    let is_count = |text: &&str| text.len() <= 3 && text.bytes().all(|byte| byte.is_ascii_digit());
    let all = found.iter().all(is_count);
    let count = found.len();
    found.sort_unstable();
    found.dedup();
    all && found.len() == count
}
