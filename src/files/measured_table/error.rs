use std::io;

use strsim::generic_levenshtein;
use thiserror::Error;

use super::{LONGEST_NAME, MOST_CELLS, MOST_COLUMNS, MOST_LEFT_OUT, RowLeftOut};
use crate::at::At;

pub type MeasuredTableError = At<MeasuredTableErrorKind>;

pub(super) type Result<T, E = MeasuredTableErrorKind> = std::result::Result<T, E>;

#[derive(Debug, Error)]
pub enum MeasuredTableErrorKind {
    #[error("it cannot be read: {0}")]
    Read(io::Error),
    #[error("it holds no table: no values are in it")]
    Empty,
    #[error(
        "it holds no row: every record below the header is empty or has another number of cells"
    )]
    NoRows,
    #[error(
        "byte {at} belongs to no text; a table is CSV, TSV, JSON or YAML in UTF-8, UTF-16 or Latin-1, Parquet or XLSX"
    )]
    NoText { at: usize },
    #[error("decimal = {sign:?} is no decimal mark; write decimal = \".\" or decimal = \",\"")]
    Decimal { sign: char },
    #[error(
        "separator = {sign:?} cannot separate cells; write one of \",\", \";\", \"\\t\", \"|\" and \" \""
    )]
    Separator { sign: char },
    #[error(
        "line {line}: a quote opens a cell and is never closed; close it, or double it where it belongs to the cell"
    )]
    OpenQuote { line: u64 },
    #[error("header = {line}: there is no line {line} with values among its first lines")]
    NoHeaderThere { line: u64 },
    #[error(
        "line {header} names {names} columns, and line {line} has {cells} cells; give every column its name, or state the line \
         of the header with header = …, or take the line out; numbers with decimal commas need another separator than a comma"
    )]
    HeaderLength { header: u64, names: usize, line: u64, cells: usize },
    #[error(
        "line {header} names {names} columns, and line {line} has {cells} cells: its numbers are written with decimal commas, and \
         commas separate the cells too; write it with \";\" or tabs between the cells, or with decimal points"
    )]
    DecimalComma { header: u64, names: usize, line: u64, cells: usize },
    #[error(
        "line {line}, column {column:?}: {text:?} is no number with the decimal mark {mark:?}, which the others have; write all \
         numbers in one way, without separators of thousands, or state decimal = \".\" or decimal = \",\""
    )]
    OtherMark { line: u64, column: String, text: String, mark: char },
    #[error(
        "line {line}, column {column:?}: {text:?} has separators of thousands; write {plain:?}, and so every number of the table"
    )]
    Thousands { line: u64, column: String, text: String, plain: String },
    #[error("line {line}, character {column}: it is no JSON: {problem}")]
    Json { line: u64, column: usize, problem: &'static str },
    #[error("line {line}, character {column}: it cannot be read as YAML: {problem}")]
    Yaml { line: u64, column: usize, problem: String },
    #[error(
        "it holds no records; a table is a list of objects or of lists, an object of objects, an object of lists of one length, or \
         an object in each line"
    )]
    NoRecords,
    #[error("{first:?} and {second:?} both hold records; keep each table in a file of its own")]
    SeveralTables { first: String, second: String },
    #[error(
        "column {first:?} has {first_length} values, and column {other:?} {other_length}; give all columns one length"
    )]
    ColumnLengths { first: String, first_length: usize, other: String, other_length: usize },
    #[error("{counted} {line}: {key:?} is given twice; which value is meant is not clear")]
    KeyTwice { counted: &'static str, line: u64, key: String },
    #[error("{counted} {line}: a name has more than {LONGEST_NAME} bytes; is it the right file?")]
    LongName { counted: &'static str, line: u64 },
    #[error("it cannot be read as a spreadsheet: {0}")]
    Spreadsheet(String),
    #[error(
        "no sheet that is shown has a row with two numbers, as numbers or as text; sheet = … reads another one, also a hidden one{}",
        hidden(.0)
    )]
    NoTable(Vec<String>),
    #[error("it is {0}, which is not read; save it as .xlsx or .csv")]
    OtherBook(&'static str),
    #[error("unpacked it has more than {limit} bytes, the limit; {advice}")]
    Unpacked { limit: u64, advice: &'static str },
    #[error("it has no sheet {wanted:?}; its sheets are {}", quoted(found))]
    NoSheet { wanted: String, found: Vec<String> },
    #[error("sheet {name:?}: {problem}")]
    Sheet { name: String, problem: Box<MeasuredTableErrorKind> },
    #[error("it cannot be read as Parquet: {0}")]
    Parquet(String),
    #[error("{key} is for {wanted}, and this is a file in {form}; take it out")]
    NotOfThisForm { key: &'static str, wanted: &'static str, form: &'static str },
    #[error("it has {found} columns, more than the limit of {MOST_COLUMNS}; is it the right file?")]
    TooManyColumns { found: usize },
    #[error(
        "its cells take more memory than a table may: more than {MOST_CELLS} cells, or half a gigabyte of texts; split it by session"
    )]
    TooManyCells,
    #[error("more than {MOST_LEFT_OUT} of its rows are none of the table; the first, line {}: {}", first.line, first.reason)]
    TooManyLeftOut { first: RowLeftOut },
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ColumnError {
    #[error("there is no column {name:?}; {}", near(nearest))]
    Unknown { name: String, nearest: Vec<String> },
}

fn hidden(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!(": {}", names.join(", ")) }
}

fn quoted(names: &[String]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("{name:?}")).collect();
    quoted.join(", ")
}

fn near(nearest: &[String]) -> String {
    if nearest.is_empty() {
        return "no name is like it".to_owned();
    }
    format!("the nearest names are {}", quoted(nearest))
}

pub(super) fn find(columns: &[String], name: &str) -> Result<usize, ColumnError> {
    let own = columns.iter().position(|own| own == name);
    own.ok_or_else(|| ColumnError::Unknown {
        name: name.to_owned(),
        nearest: nearest(columns, name),
    })
}

/// Up to three names that begin with this one, or differ from it in at most half of its letters.
fn nearest(columns: &[String], name: &str) -> Vec<String> {
    let folded = |text: &str| -> Vec<char> { text.to_lowercase().chars().take(64).collect() };
    let wanted = folded(name);
    let mut near: Vec<(usize, usize)> = columns
        .iter()
        .enumerate()
        .map(|(place, column)| {
            let letters = folded(column);
            let begins = !wanted.is_empty() && letters.starts_with(&wanted);
            (if begins { 0 } else { generic_levenshtein(&wanted, &letters) }, place)
        })
        .filter(|(distance, _)| *distance <= wanted.len().div_ceil(2))
        .collect();
    near.sort_unstable();
    near.into_iter().take(3).map(|(_, place)| columns[place].clone()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_found_or_its_likes_are_told() {
        let columns = ["x", "y", "joint_1", "joint_2", "Temp"].map(str::to_owned);
        assert_eq!(find(&columns, "joint_2"), Ok(3));
        let unknown = find(&columns, "joint1").unwrap_err().to_string();
        assert_eq!(
            unknown,
            "there is no column \"joint1\"; the nearest names are \"joint_1\", \"joint_2\""
        );
        assert!(find(&columns, "temp").unwrap_err().to_string().contains("\"Temp\""));
        assert!(find(&columns, "pressure").unwrap_err().to_string().contains("no name is like it"));
        assert_eq!(
            find(&columns, ""),
            Err(ColumnError::Unknown { name: String::new(), nearest: Vec::new() })
        );
    }
}
