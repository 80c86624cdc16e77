//! A table of measured values as people have it: CSV, TSV, Parquet, JSON, YAML or a spreadsheet → named columns of
//! cells. The form of the file follows from its first bytes, then from its extension; separator, decimal mark, header
//! and units are found in its rows. Rows of another length are left out, with the reason. Nothing here knows stations,
//! joints or units.

mod cells;
mod decoded;
mod error;
mod fill;
mod head;
mod json;
mod number;
mod parquet;
mod separator;
mod sheet;
mod split;
mod text;
mod tree;
mod xlsx;
mod yaml;

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::input::{self, Bound};
use crate::at::At;
use cells::Cells;
pub use decoded::decode;
use error::Result;
pub use error::{ColumnError, MeasuredTableError, MeasuredTableErrorKind};

/// Settings for a file that does not state them itself; each absent one is found in the file.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Form {
    /// The sign between two cells of a text; a space stands for any number of spaces and tabs.
    pub separator: Option<char>,
    /// The decimal mark of numbers that are written as text, `.` or `,`.
    pub decimal: Option<char>,
    pub sheet: Option<String>,
    /// Line of the header, from 1, in a text or a sheet.
    pub header: Option<u64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cell<'a> {
    Blank,
    /// The double nearest to the number that is written there; NaN where the file writes `nan` or `inf` in any
    /// spelling.
    Number(f64),
    Text(&'a str),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowLeftOut {
    /// Its line, as [`MeasuredTable::line`] counts.
    pub line: u64,
    pub reason: LeftOutFor,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum LeftOutFor {
    #[error("it has {found} cells, and the table {wanted} columns")]
    Cells { found: usize, wanted: usize },
    #[error("it repeats the header")]
    Header,
    #[error("it is a comment")]
    Comment,
    #[error("it is no object with names")]
    NoObject,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Records {
    pub rows: usize,
    /// Rows left out, each with its reason in [`MeasuredTable::left_out`].
    pub left_out: usize,
    /// Title, comments, header and units.
    pub before: usize,
    pub blank: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counted {
    Line,
    Row,
    Record,
}

impl Counted {
    /// Its word, as in `line 734`.
    pub const fn word(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Row => "row",
            Self::Record => "record",
        }
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredTable {
    columns: Vec<String>,
    /// The line of units, without brackets; empty for a column without. `None` without such a line.
    pub units: Option<Vec<String>>,
    cells: Cells,
    lines: Vec<u64>,
    /// What [`Self::line`] counts.
    pub counted: Counted,
    pub left_out: Vec<RowLeftOut>,
    /// What became of the records of the file.
    pub records: Records,
    /// What was found in the file and is not written in it: separator and decimal mark, encoding, sheet, absent header.
    pub remarks: Vec<String>,
}

impl MeasuredTable {
    /// Names in the order of the file, without spaces at their ends; a column without a name has its number, from 1.
    /// Of a name that stands several times each has its own: `x #1`, `x #2`.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    pub fn column(&self, name: &str) -> Option<usize> {
        self.find(name).ok()
    }

    pub fn find(&self, name: &str) -> Result<usize, ColumnError> {
        error::find(&self.columns, name)
    }

    pub fn row_count(&self) -> usize {
        self.lines.len()
    }

    /// The line of a text, row of a sheet or number of a record, from 1, as a person would look it up.
    pub fn line(&self, row: usize) -> u64 {
        self.lines[row]
    }

    /// The value in a row and column, both from 0.
    pub fn cell(&self, row: usize, column: usize) -> Cell<'_> {
        assert!(column < self.columns.len(), "column {column} of a row");
        self.cells.get(row * self.columns.len() + column)
    }
}

const MOST_COLUMNS: usize = 4096;
const LONGEST_NAME: usize = 1024;
/// Most cells of a table: half a gigabyte of them.
const MOST_CELLS: usize = 1 << 26;
const MOST_LEFT_OUT: usize = 1 << 20;

/// Errors name the file and, wherever there is one, line and column.
pub fn read(path: &Path, bound: Bound, form: &Form) -> Result<MeasuredTable, MeasuredTableError> {
    let read = || {
        form.check()?;
        let bytes = input::bytes(path, bound).map_err(MeasuredTableErrorKind::Read)?;
        let kind = FileKind::of(path, &bytes);
        form.check_for(kind)?;
        match kind {
            FileKind::Text => text::read(&bytes, form),
            FileKind::Json => json::read(&bytes, form),
            FileKind::Yaml => yaml::read(&bytes, form),
            FileKind::Parquet => parquet::read(bytes, form, bound),
            FileKind::Xlsx => xlsx::read(&bytes, form, bound),
            FileKind::OtherBook(which) => Err(MeasuredTableErrorKind::OtherBook(which)),
        }
    };
    read().map_err(|kind: MeasuredTableErrorKind| At::new(path.display(), kind))
}

pub fn of_yaml(text: &str) -> Result<MeasuredTable> {
    yaml::read(text.as_bytes(), &Form::default())
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    Text,
    Json,
    Yaml,
    Parquet,
    Xlsx,
    OtherBook(&'static str),
}

/// What a document of ODF states in its first entry, which is not packed.
const ODF: &[u8] = b"application/vnd.oasis.opendocument.spreadsheet";

impl FileKind {
    const ODS: Self = Self::OtherBook("a spreadsheet of ODF (.ods)");
    const XLS: Self = Self::OtherBook("a workbook of Excel up to 2003 (.xls)");

    /// The form that the first bytes of a file show; of a text that its name says, where lines of cells may begin so.
    fn of(path: &Path, bytes: &[u8]) -> Self {
        let extension = path.extension().unwrap_or_default();
        let extension = extension.to_string_lossy().to_lowercase();
        match extension.as_str() {
            "ods" if bytes.starts_with(b"PK") => Self::ODS,
            _ => Self::of_start(bytes).unwrap_or_else(|| Self::of_text(bytes, &extension)),
        }
    }

    fn of_text(bytes: &[u8], extension: &str) -> Self {
        let first = bytes.iter().find(|byte| !byte.is_ascii_whitespace());
        match extension {
            "yaml" | "yml" => Self::Yaml,
            "json" | "jsonl" | "ndjson" | "geojson" => Self::Json,
            "csv" | "tsv" | "tab" => Self::Text,
            _ if matches!(first, Some(b'{' | b'[')) => Self::Json,
            _ if bytes.starts_with(b"---\n") || bytes.starts_with(b"%YAML") => Self::Yaml,
            _ => Self::Text,
        }
    }

    /// The form that only its own files begin with.
    fn of_start(bytes: &[u8]) -> Option<Self> {
        match bytes {
            [b'P', b'A', b'R', b'1', ..] => Some(Self::Parquet),
            [0xd0, 0xcf, 0x11, 0xe0, ..] => Some(Self::XLS),
            [b'P', b'K', 3, 4, ..] => {
                let start = &bytes[..bytes.len().min(256)];
                let is_odf = start.windows(ODF.len()).any(|part| part == ODF);
                Some(if is_odf { Self::ODS } else { Self::Xlsx })
            }
            _ => None,
        }
    }

    const fn is_sheet(self) -> bool {
        matches!(self, Self::Xlsx | Self::OtherBook(_))
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Text => "lines of cells",
            Self::Json => "JSON",
            Self::Yaml => "YAML",
            Self::Parquet => "Parquet",
            Self::Xlsx | Self::OtherBook(_) => "a spreadsheet",
        }
    }
}

impl Form {
    fn check_for(&self, kind: FileKind) -> Result<()> {
        let is_text = kind == FileKind::Text;
        let is_sheet = kind.is_sheet();
        let given = [
            ("separator", "lines of cells", self.separator.is_some() && !is_text),
            ("sheet", "a spreadsheet", self.sheet.is_some() && !is_sheet),
            ("header", "lines of cells and sheets", self.header.is_some() && !is_text && !is_sheet),
        ];
        given.into_iter().find(|(_, _, wrong)| *wrong).map_or(Ok(()), |(key, wanted, _)| {
            Err(MeasuredTableErrorKind::NotOfThisForm { key, wanted, form: kind.name() })
        })
    }

    /// Checks that the signs can be told from each other and from numbers.
    fn check(&self) -> Result<()> {
        if let Some(sign) = self.decimal.filter(|sign| !matches!(sign, '.' | ',')) {
            return Err(MeasuredTableErrorKind::Decimal { sign });
        }
        let no_separator = |sign: &char| {
            !sign.is_ascii() || sign.is_ascii_alphanumeric() || "\"'\r\n\0.+-".contains(*sign)
        };
        if let Some(sign) = self.separator.filter(no_separator) {
            return Err(MeasuredTableErrorKind::Separator { sign });
        }
        Ok(())
    }
}
