//! Why a file is no table, and why a name is no column.

use std::io;

use thiserror::Error;

use super::{LONGEST_NAME, MOST_CELLS, MOST_COLUMNS};
use crate::at::At;

/// Why a file cannot be read as a table, and the file.
pub type MeasuredTableError = At<MeasuredTableErrorKind>;

/// The fault in a file.
#[derive(Debug, Error)]
pub enum MeasuredTableErrorKind {
    /// It cannot be opened, is no file or is too large.
    #[error("it cannot be read: {0}")]
    Read(io::Error),
    /// Nothing is in it.
    #[error("it holds no table: no values are in it")]
    Empty,
    /// It has a header and no row.
    #[error(
        "it holds no row: every record below the header is empty or has another number of cells"
    )]
    NoRows,
    /// Neither text nor one of the other forms.
    #[error(
        "byte {at} belongs to no text; a table is CSV, TSV, JSON or YAML in UTF-8, UTF-16 or Latin-1, Parquet or XLSX"
    )]
    NoText {
        /// The place of the byte.
        at: usize,
    },
    /// A decimal mark that is none.
    #[error("decimal = {sign:?} is no decimal mark; write decimal = \".\" or decimal = \",\"")]
    Decimal {
        /// The sign that is stated.
        sign: char,
    },
    /// A separator that numbers or quotes are written with.
    #[error(
        "separator = {sign:?} cannot separate cells; write one of \",\", \";\", \"\\t\", \"|\" and \" \""
    )]
    Separator {
        /// The sign that is stated.
        sign: char,
    },
    /// A quote that is never closed.
    #[error(
        "line {line}: a quote opens a cell and is never closed; close it, or double it where it belongs to the cell"
    )]
    OpenQuote {
        /// The line with the quote.
        line: u64,
    },
    /// The stated header is not among the first lines, or is empty.
    #[error("header = {line}: there is no line {line} with values among its first lines")]
    NoHeaderThere {
        /// The line that is stated.
        line: u64,
    },
    /// The header has another number of cells than the rows.
    #[error(
        "line {header} names {names} columns, and line {line} has {cells} cells; give every column its name, or state the line \
         of the header with header = …, or take the line out; numbers with decimal commas need another separator than a comma"
    )]
    HeaderLength {
        /// Line of the header.
        header: u64,
        /// Number of its cells.
        names: usize,
        /// Line of the first row.
        line: u64,
        /// Number of its cells.
        cells: usize,
    },
    /// Commas separate the cells and are decimal marks as well.
    #[error(
        "line {header} names {names} columns, and line {line} has {cells} cells: its numbers are written with decimal commas, and \
         commas separate the cells too; write it with \";\" or tabs between the cells, or with decimal points"
    )]
    DecimalComma {
        /// Line of the header.
        header: u64,
        /// Number of its cells.
        names: usize,
        /// Line of the first row.
        line: u64,
        /// Number of its cells.
        cells: usize,
    },
    /// A number with the other decimal mark than the rest of the file.
    #[error(
        "line {line}, column {column:?}: {text:?} is no number with the decimal mark {mark:?}, which the others have; write all \
         numbers in one way, without separators of thousands, or state decimal = \".\" or decimal = \",\""
    )]
    OtherMark {
        line: u64,
        column: String,
        /// The cell.
        text: String,
        /// The decimal mark of the others.
        mark: char,
    },
    /// A number with separators of thousands.
    #[error(
        "line {line}, column {column:?}: {text:?} has separators of thousands; write its digits without anything between them"
    )]
    Thousands {
        line: u64,
        column: String,
        /// The cell.
        text: String,
    },
    /// A text that is no JSON.
    #[error("line {line}, character {column}: it is no JSON: {problem}")]
    Json {
        line: u64,
        /// The character in it, from 1.
        column: usize,
        /// What is wrong there.
        problem: &'static str,
    },
    /// A text that is no YAML.
    #[error("line {line}, character {column}: it cannot be read as YAML: {problem}")]
    Yaml {
        line: u64,
        /// The character in it, from 1.
        column: usize,
        /// What is wrong there.
        problem: String,
    },
    /// A single number or text where records are wanted.
    #[error(
        "it holds no records; a table is a list of objects or of lists, an object of objects, an object of lists of one length, or \
         an object in each line"
    )]
    NoRecords,
    /// Two lists of records.
    #[error("{first:?} and {second:?} both hold records; keep each table in a file of its own")]
    SeveralTables {
        /// Key of one.
        first: String,
        /// Key of another.
        second: String,
    },
    /// Columns of different lengths.
    #[error(
        "column {first:?} has {first_length} values, and column {other:?} {other_length}; give all columns one length"
    )]
    ColumnLengths {
        /// Name of the first column.
        first: String,
        /// Number of its values.
        first_length: usize,
        /// Name of one of another length.
        other: String,
        /// Number of its values.
        other_length: usize,
    },
    /// A name that a record gives two values.
    #[error("{counted} {line}: {key:?} is given twice; which value is meant is not clear")]
    KeyTwice {
        /// The word of what is counted.
        counted: &'static str,
        /// The line, or the number of the record.
        line: u64,
        /// The name.
        key: String,
    },
    /// A name that no table has.
    #[error("{counted} {line}: a name has more than {LONGEST_NAME} bytes; is it the right file?")]
    LongName {
        /// The word of what is counted.
        counted: &'static str,
        /// The line, or the number of the record.
        line: u64,
    },
    /// A spreadsheet that cannot be read.
    #[error("it cannot be read as a spreadsheet: {0}")]
    Spreadsheet(String),
    /// A workbook that is not read: which kind.
    #[error("it is {0}, which is not read; save it as .xlsx or .csv")]
    OtherBook(&'static str),
    /// A file that is packed and becomes too large.
    #[error("unpacked it has more than {limit} bytes, the limit; {advice}")]
    Unpacked {
        /// Most bytes.
        limit: u64,
        /// What to do.
        advice: &'static str,
    },
    /// A spreadsheet without the sheet.
    #[error("it has no sheet {wanted:?}; its sheets are {}", quoted(found))]
    NoSheet {
        /// The name that is stated.
        wanted: String,
        /// Names of its sheets.
        found: Vec<String>,
    },
    /// Something wrong in a sheet.
    #[error("sheet {name:?}: {problem}")]
    Sheet {
        name: String,
        /// What is wrong.
        problem: Box<MeasuredTableErrorKind>,
    },
    /// A Parquet file that cannot be read.
    #[error("it cannot be read as Parquet: {0}")]
    Parquet(String),
    /// A setting that a file of this form has no use for.
    #[error("{key} is for {wanted}, and this is a file in {form}; take it out")]
    NotOfThisForm {
        key: &'static str,
        /// The files that it is for.
        wanted: &'static str,
        /// The form of this file.
        form: &'static str,
    },
    /// More columns than any table of measured values has.
    #[error("it has {found} columns, more than the limit of {MOST_COLUMNS}; is it the right file?")]
    TooManyColumns {
        /// Number of columns.
        found: usize,
    },
    /// More cells than memory is given to.
    #[error(
        "its cells take more memory than a table may: more than {MOST_CELLS} cells, or half a gigabyte of texts; split it by session"
    )]
    TooManyCells,
}

/// Why a name is no column of a table.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum ColumnError {
    /// No column has this name.
    #[error("there is no column {name:?}; {}", near(nearest))]
    Unknown {
        name: String,
        /// Names of columns that are most like it, the likest first; up to three.
        nearest: Vec<String>,
    },
    /// Several columns have this name.
    #[error(
        "columns {} are all called {name:?}; give each its own name in the file",
        listed(columns)
    )]
    Ambiguous {
        name: String,
        /// Their places, from 0.
        columns: Vec<usize>,
    },
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

/// Places as a person counts them.
fn listed(columns: &[usize]) -> String {
    let places: Vec<String> = columns.iter().map(|place| (place + 1).to_string()).collect();
    places.join(", ")
}

/// The place of the one column of this name.
pub(super) fn find(columns: &[String], name: &str) -> Result<usize, ColumnError> {
    let own = columns.iter().enumerate().filter(|(_, own)| *own == name);
    let own: Vec<usize> = own.map(|(place, _)| place).collect();
    match own.as_slice() {
        [place] => Ok(*place),
        [] => Err(ColumnError::Unknown { name: name.to_owned(), nearest: nearest(columns, name) }),
        _ => Err(ColumnError::Ambiguous { name: name.to_owned(), columns: own }),
    }
}

/// Up to three names that differ from this one in at most half of its letters.
fn nearest(columns: &[String], name: &str) -> Vec<String> {
    let folded = |text: &str| -> Vec<char> { text.to_lowercase().chars().take(64).collect() };
    let wanted = folded(name);
    let mut near: Vec<(usize, usize)> = columns
        .iter()
        .enumerate()
        .map(|(place, column)| (distance(&wanted, &folded(column)), place))
        .filter(|(distance, _)| *distance <= wanted.len().div_ceil(2))
        .collect();
    near.sort_unstable();
    near.into_iter().take(3).map(|(_, place)| columns[place].clone()).collect()
}

/// Letters to add, remove or exchange to make one text of the other (Levenshtein).
fn distance(one: &[char], other: &[char]) -> usize {
    let mut row: Vec<usize> = (0..=other.len()).collect();
    for (above, a) in one.iter().enumerate() {
        let mut diagonal = above;
        row[0] = above + 1;
        for (column, b) in other.iter().enumerate() {
            let exchanged = diagonal + usize::from(a != b);
            diagonal = row[column + 1];
            row[column + 1] = exchanged.min(diagonal + 1).min(row[column] + 1);
        }
    }
    row[other.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_found_or_its_likes_are_told() {
        let columns = ["x", "y", "joint_1", "joint_2", "Temp", "x"].map(str::to_owned);
        assert_eq!(find(&columns, "joint_2"), Ok(3));
        let unknown = find(&columns, "joint1").unwrap_err().to_string();
        assert_eq!(
            unknown,
            "there is no column \"joint1\"; the nearest names are \"joint_1\", \"joint_2\""
        );
        assert!(find(&columns, "temp").unwrap_err().to_string().contains("\"Temp\""));
        assert!(find(&columns, "pressure").unwrap_err().to_string().contains("no name is like it"));
        let twice = find(&columns, "x").unwrap_err();
        assert!(twice.to_string().starts_with("columns 1, 6 are all called \"x\""));
        assert_eq!(
            find(&columns, ""),
            Err(ColumnError::Unknown { name: String::new(), nearest: Vec::new() })
        );
    }
}
