use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use calamine::{DataRef, ExcelDateTime, Reader as _, SheetVisible, Xlsx, XlsxError};

use super::sheet::{self, Sheet, SheetCell, wrong};
use super::tree::MOST_NODES;
use super::{Form, MeasuredTable, MeasuredTableErrorKind, Result};
use crate::input::Bound;
use crate::table::panic_message;

pub(super) fn read(bytes: &[u8], form: &Form, bound: Bound) -> Result<MeasuredTable> {
    sheet::check_unpacked(bytes, bound)?;
    // The reader may panic on a damaged file. It owns nothing but its own state.
    let read = catch_unwind(AssertUnwindSafe(|| table(bytes, form)));
    read.unwrap_or_else(|panic| {
        let problem = format!("it is damaged ({})", panic_message(panic.as_ref()));
        Err(MeasuredTableErrorKind::Spreadsheet(problem))
    })
}

fn table(bytes: &[u8], form: &Form) -> Result<MeasuredTable> {
    let mut book: Xlsx<_> = Xlsx::new(Cursor::new(bytes)).map_err(|error| wrong(&error))?;
    let names = book.sheet_names();
    let hidden = book.sheets_metadata().iter().filter(|own| own.visible != SheetVisible::Visible);
    let hidden: Vec<String> = hidden.map(|own| own.name.clone()).collect();
    let chosen = sheet::chosen(&names, &hidden, form)?;
    // Numbers may be typed into cells that are formatted as text; a sheet of numbers goes before one of such.
    let tried = [false, true]
        .into_iter()
        .flat_map(|as_text| chosen.iter().map(move |name| (*name, as_text)));
    for (name, as_text) in tried {
        let rows = match rows(&mut book, name) {
            // A chart has a sheet of its own, without cells.
            Err(XlsxError::NotAWorksheet(_)) if form.sheet.is_none() => continue,
            rows => rows.map_err(|error| wrong(&error))?,
        };
        let rows = rows.ok_or(MeasuredTableErrorKind::TooManyCells)?;
        let sheet = Sheet { name: name.clone(), rows };
        if form.sheet.is_some() || sheet.has_table(as_text) {
            return sheet.table(form, &names);
        }
    }
    Err(MeasuredTableErrorKind::NoTable(hidden))
}

type Rows<'b> = Vec<(u64, Vec<(u32, SheetCell<'b>)>)>;

/// The rows of a sheet; `None` where there are too many cells.
fn rows<'b>(book: &'b mut Xlsx<Cursor<&[u8]>>, name: &str) -> Result<Option<Rows<'b>>, XlsxError> {
    let mut reader = book.worksheet_cells_reader(name)?;
    let mut rows: BTreeMap<u32, Vec<(u32, SheetCell<'b>)>> = BTreeMap::new();
    let mut count = 0;
    while let Some(cell) = reader.next_cell()? {
        let (row, column) = cell.get_position();
        let own = own(cell.get_value());
        if own == SheetCell::Blank {
            continue;
        }
        count += 1;
        if count > MOST_NODES {
            return Ok(None);
        }
        rows.entry(row).or_default().push((column, own));
    }
    let rows = rows.into_iter().map(|(row, cells)| (u64::from(row) + 1, cells));
    Ok(Some(rows.collect()))
}

fn own<'b>(value: &DataRef<'b>) -> SheetCell<'b> {
    let text = |text: String| SheetCell::Text(Cow::Owned(text));
    match value {
        DataRef::Empty => SheetCell::Blank,
        #[expect(clippy::cast_precision_loss, reason = "a cell is a double in any spreadsheet")]
        DataRef::Int(number) => SheetCell::Number(*number as f64),
        DataRef::Float(number) => SheetCell::Number(*number),
        DataRef::String(own) | DataRef::DateTimeIso(own) | DataRef::DurationIso(own) => {
            text(own.clone())
        }
        DataRef::SharedString(own) => SheetCell::Text(Cow::Borrowed(own)),
        DataRef::Bool(own) => text(own.to_string()),
        DataRef::DateTime(own) => text(date(*own)),
        DataRef::Error(own) => text(own.to_string()),
    }
}

/// A date and time by ISO 8601, a time without a date where the cell has none.
fn date(date: ExcelDateTime) -> String {
    let (year, month, day, hour, minute, second, milli) = date.to_ymd_hms_milli();
    let fraction = if milli == 0 { String::new() } else { format!(".{milli:03}") };
    let time = format!("{hour:02}:{minute:02}:{second:02}{fraction}");
    if date.is_duration() || (0.0..1.0).contains(&date.as_f64()) {
        return time;
    }
    format!("{year:04}-{month:02}-{day:02}T{time}")
}
