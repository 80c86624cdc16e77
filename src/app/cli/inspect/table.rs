pub mod arm;
mod section;

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use nalgebra::Isometry3;

use super::{escaped, shown};
use crate::io::inspect::table::{ColumnSummary, Differs, Guess, TableInspection, Tried, Verdict};

pub use section::{ready, section};

const MOST_PRINTED: usize = 20;
const MOST_TEXTS: usize = 5;
/// Positions whose frame is no further from the base are stated in the base frame, mm and degrees.
const OWN_FRAME_MM: f64 = 20.0;
const OWN_FRAME_DEG: f64 = 2.0;
const TABLES: [&str; 15] = [
    "csv", "tsv", "tab", "txt", "dat", "asc", "json", "jsonl", "ndjson", "yaml", "yml", "parquet",
    "xlsx", "xls", "ods",
];
/// The first bytes of an MCAP, and of a file in zstd.
const LOGS: [&[u8]; 2] = [b"\x89MCAP", b"\x28\xb5\x2f\xfd"];

/// Whether the file at `path` is a table rather than a log: by its ending, unless it begins as a log does.
pub fn is_table(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    TABLES.contains(&ending.as_str()) && !begins_as_a_log(path)
}

fn begins_as_a_log(path: &Path) -> bool {
    let mut bytes = Vec::new();
    let is_file = path.is_file();
    let read =
        File::open(path).ok().filter(|_| is_file).map(|file| file.take(5).read_to_end(&mut bytes));
    matches!(read, Some(Ok(_))) && LOGS.iter().any(|log| bytes.starts_with(log))
}

pub fn describe(path: &Path, found: &TableInspection) -> String {
    let name = escaped(&path.to_string_lossy());
    let mut text = format!("{name}  {} rows, {} columns\n", found.rows, found.columns.len());
    let mut line = |line: &str| text.extend(["  ", line, "\n"]);
    found.remarks.iter().for_each(|remark| line(&escaped(remark)));
    let width = found.columns.iter().map(|own| shown(&own.name).chars().count()).max().unwrap_or(0);
    for column in &found.columns {
        line(&of_column(column, width));
    }
    left_out(found, &mut line);
    match &found.guess {
        Ok(guess) => of_guess(guess).iter().for_each(|own| line(own)),
        Err(lacking) => line(&format!("how it would be read is not told: it has {lacking}")),
    }
    text
}

/// A column: its name, kinds of values and range.
fn of_column(column: &ColumnSummary, width: usize) -> String {
    let mut text = shown(&column.name);
    let gap = width.saturating_sub(text.chars().count());
    text.extend(std::iter::repeat_n(' ', gap + 2));
    let mut parts = Vec::new();
    if let Some((low, high)) = column.range {
        parts.push(format!("{} numbers, {} to {}", column.numbers, number(low), number(high)));
    }
    if column.texts > 0 {
        parts.push(format!("{} texts: {}", column.texts, texts(column)));
    }
    let counts = [
        (column.zeros, "zero"),
        (column.blanks, "blank"),
        (column.not_finite, "not finite"),
        (column.missing, "9999 or −9999"),
    ];
    let counted = counts.iter().filter(|(count, _)| *count > 0);
    parts.extend(counted.map(|(count, word)| format!("{count} {word}")));
    text + &parts.join("; ")
}

/// A number with six digits that count.
fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e9).contains(&size) {
        return format!("{value:.5e}");
    }
    let text = match size {
        size if size >= 1e5 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.3}"),
        _ => format!("{value:.5}"),
    };
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

fn texts(column: &ColumnSummary) -> String {
    let first = column.different.iter().take(MOST_TEXTS);
    let mut words: Vec<String> = first.map(|text| format!("\"{}\"", shown(text))).collect();
    if column.has_more || column.different.len() > MOST_TEXTS {
        words.push("…".to_owned());
    }
    words.join(", ")
}

fn left_out(found: &TableInspection, line: &mut impl FnMut(&str)) {
    let count = found.left_out.len();
    if count == 0 {
        return;
    }
    line(&format!("{count} {} LEFT OUT:", if count == 1 { "row is" } else { "rows are" }));
    for (place, reason) in found.left_out.iter().take(MOST_PRINTED) {
        line(&format!("  {} {place}: {}", found.counted, escaped(reason)));
    }
    if count > MOST_PRINTED {
        line(&format!("  and {} more", count - MOST_PRINTED));
    }
}

/// What the arm says, and what is not used.
fn of_guess(guess: &Guess) -> Vec<String> {
    let mut lines = match &guess.verdict {
        None => vec!["no residual of a nominal arm: see # unsure at [robot] below".to_owned()],
        Some(verdict) => of_verdict(guess, verdict),
    };
    lines.extend(guess.base.as_ref().map(of_base));
    lines.extend(guess.notes.iter().map(|note| escaped(note)));
    lines
}

fn of_base(base: &Isometry3<f64>) -> String {
    let at = base.translation.vector;
    let turn = base.rotation.angle().to_degrees();
    let is_own = at.norm() < OWN_FRAME_MM && turn < OWN_FRAME_DEG;
    let frame = if is_own { ": they are stated in about the arm's own base frame" } else { "" };
    format!(
        "the base lies at [{:.1}, {:.1}, {:.1}] mm in the frame of the positions, turned by {turn:.2}°{frame}",
        at.x, at.y, at.z
    )
}

fn of_verdict(guess: &Guess, verdict: &Verdict) -> Vec<String> {
    let mut lines = vec![format!(
        "median distance between measured position and nominal arm, base and target fitted to {} stations:",
        verdict.stations
    )];
    let best = &verdict.best;
    let order = if best.is_reversed { "reversed" } else { "in the order of the columns" };
    lines.push(residual(
        best,
        &format!(
            "{}, joints in {} and {order}, positions in {}: {}",
            guess.arms[best.arm],
            best.angle.word(),
            best.length,
            guess.choices[best.choice]
        ),
    ));
    let mut others: Vec<&(Differs, Tried)> = verdict.others.iter().collect();
    others.sort_by(|a, b| a.1.median_mm.total_cmp(&b.1.median_mm));
    let runner_up = others.iter().position(|(_, tried)| tried.median_mm >= best.median_mm);
    for (place, (differs, tried)) in others.into_iter().enumerate() {
        let first = if Some(place) == runner_up { "runner-up: " } else { "" };
        lines.push(residual(tried, &format!("{first}{}", difference(guess, *differs, tried))));
    }
    if let Some(finding) = &verdict.finding {
        lines.push(escaped(finding));
    }
    lines
}

fn residual(tried: &Tried, words: &str) -> String {
    let size = if tried.median_mm < 1e6 {
        format!("{:.2}", tried.median_mm)
    } else {
        "over 1 km".to_owned()
    };
    format!("  {size:>10} mm  {}", escaped(words))
}

fn difference(guess: &Guess, differs: Differs, tried: &Tried) -> String {
    match differs {
        Differs::Angle => format!("joints in {}", tried.angle.word()),
        Differs::Slide => format!("joints that slide in {}", tried.slide),
        Differs::Length => format!("positions in {}", tried.length),
        Differs::Order if tried.is_reversed => "joints reversed".to_owned(),
        Differs::Order => "joints in the order of the columns".to_owned(),
        Differs::Arm => format!("another arm: {}", guess.arms[tried.arm]),
        Differs::Columns => guess.choices[tried.choice].clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_that_count() {
        let cases = [
            (0.0, "0"),
            (-2.160_61, "-2.16061"),
            (1687.6095, "1687.61"),
            (20_200_714_164_124.0, "2.02007e13"),
            (1e-7, "1.00000e-7"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_log_with_the_ending_of_a_table_stays_a_log() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).expect("writable");
            path
        };
        assert!(is_table(&at("a.CSV", b"q1;x\n")));
        assert!(!is_table(&at("b.dat", b"\x89MCAP0\r\n")));
        assert!(!is_table(&at("c.mcap", b"q1;x\n")));
    }
}
