//! Parquet → a table: structs become `a.b`, lists `a[0]`, timestamps their nanoseconds.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use ::parquet::arrow::arrow_reader::{ArrowReaderOptions, ParquetRecordBatchReaderBuilder};
use arrow_array::cast::AsArray as _;
use arrow_array::{Array, ArrayRef, Float64Array, Int64Array, ListArray, RecordBatch, StringArray};
use arrow_schema::{DataType, TimeUnit};
use bytes::Bytes;

use super::fill::Filling;
use super::head::Head;
use super::number::Numbers;
use super::{
    Cell, Counted, Form, LONGEST_NAME, MOST_CELLS, MOST_COLUMNS, MeasuredTable,
    MeasuredTableErrorKind, Result,
};
use crate::input::Bound;
use crate::stated;
use crate::table::values::{numbers, texts};

pub(super) fn read(bytes: Vec<u8>, form: &Form, bound: Bound) -> Result<MeasuredTable> {
    // The reader panics on some damaged pages. It owns only the bytes.
    let read = catch_unwind(AssertUnwindSafe(|| batch(bytes.into(), bound)));
    let batch = read.unwrap_or_else(|_| Err(wrong("it is damaged")))?;
    let mut leaves = Leaves { rows: batch.num_rows(), found: Vec::new(), remarks: Vec::new() };
    let rows: Vec<Place> = (0..batch.num_rows()).map(Place::at).collect();
    for (field, column) in batch.schema().fields().iter().zip(batch.columns()) {
        leaves.add(field.name().clone(), column, rows.clone())?;
    }
    leaves.table(form)
}

#[expect(clippy::needless_pass_by_value, reason = "`map_err` gives errors by value")]
fn wrong(problem: impl ToString) -> MeasuredTableErrorKind {
    let problem = problem.to_string();
    let packed = problem.contains("Disabled feature");
    let advice = if packed { "; write it with snappy, zstd or no compression" } else { "" };
    MeasuredTableErrorKind::Parquet(problem + advice)
}

fn batch(bytes: Bytes, bound: Bound) -> Result<RecordBatch> {
    stated::check_levels(&bytes).map_err(wrong)?;
    let values = bound.of_values();
    let too_large =
        || MeasuredTableErrorKind::Unpacked { limit: values.bytes, advice: values.advice };
    if stated::decoded_bytes(&bytes, bytes.clone(), values.bytes).map_err(wrong)? > values.bytes {
        return Err(too_large());
    }
    let options = ArrowReaderOptions::new().with_skip_arrow_metadata(true);
    let reader =
        ParquetRecordBatchReaderBuilder::try_new_with_options(bytes, options).map_err(wrong)?;
    let stated = reader.metadata().file_metadata().num_rows();
    if usize::try_from(stated).is_ok_and(|rows| rows > MOST_CELLS) {
        return Err(MeasuredTableErrorKind::TooManyCells);
    }
    let schema = Arc::clone(reader.schema());
    let rows = reader.build().map_err(wrong)?;
    stated::batch_within(&schema, rows, values.bytes).map_err(wrong)?.ok_or_else(too_large)
}

enum Values {
    Numbers(Float64Array),
    /// Integers that are multiplied, and the factor.
    Scaled(Int64Array, i64),
    Texts(StringArray),
}

#[derive(Debug, Clone, Copy)]
struct Place(u32);

impl Place {
    const NONE: Self = Self(u32::MAX);

    fn at(place: usize) -> Self {
        u32::try_from(place).map_or(Self::NONE, Self)
    }

    fn of(place: Option<usize>) -> Self {
        place.map_or(Self::NONE, Self::at)
    }

    fn get(self) -> Option<usize> {
        (self.0 != u32::MAX).then_some(self.0 as usize)
    }
}

/// A column: its values, and for each row the place of its value among them.
struct Leaf {
    name: String,
    values: Values,
    places: Vec<Place>,
}

struct Leaves {
    rows: usize,
    found: Vec<Leaf>,
    remarks: Vec<String>,
}

impl Leaves {
    fn add(&mut self, name: String, array: &ArrayRef, places: Vec<Place>) -> Result<()> {
        if name.len() > LONGEST_NAME {
            return Err(MeasuredTableErrorKind::LongName { counted: Counted::Row.word(), line: 1 });
        }
        let valid = |place: Place| place.get().filter(|&place| array.is_valid(place));
        let places: Vec<_> = places.into_iter().map(|place| Place::of(valid(place))).collect();
        match array.data_type() {
            DataType::Struct(fields) => {
                for (field, inner) in fields.iter().zip(array.as_struct().columns()) {
                    self.add(format!("{name}.{}", field.name()), inner, places.clone())?;
                }
                Ok(())
            }
            DataType::List(_) => self.list(&name, array.as_list(), &places),
            _ => self.leaf(name, array, places),
        }
    }

    fn list(&mut self, name: &str, list: &ListArray, places: &[Place]) -> Result<()> {
        let offsets = list.value_offsets();
        let of = |offset: i32| usize::try_from(offset).unwrap_or_default();
        let range = |place: usize| of(offsets[place])..of(offsets[place + 1]);
        let lengths = places.iter().filter_map(|place| Some(range(place.get()?).len()));
        let width = lengths.max().unwrap_or_default();
        self.check(width)?;
        for index in 0..width {
            let inner = |place: &Place| place.get().and_then(|place| range(place).nth(index));
            let inner = places.iter().map(|place| Place::of(inner(place)));
            self.add(format!("{name}[{index}]"), list.values(), inner.collect())?;
        }
        Ok(())
    }

    fn leaf(&mut self, name: String, array: &ArrayRef, places: Vec<Place>) -> Result<()> {
        self.check(1)?;
        match values(array) {
            Some(values) => self.found.push(Leaf { name, values, places }),
            None => self.remarks.push(format!(
                "column {name:?} holds {} and is no column of the table",
                array.data_type()
            )),
        }
        Ok(())
    }

    fn check(&self, more: usize) -> Result<()> {
        let found = self.found.len().saturating_add(more);
        if found > MOST_COLUMNS {
            return Err(MeasuredTableErrorKind::TooManyColumns { found });
        }
        if found.saturating_mul(self.rows) > MOST_CELLS {
            return Err(MeasuredTableErrorKind::TooManyCells);
        }
        Ok(())
    }

    fn table(self, form: &Form) -> Result<MeasuredTable> {
        if self.found.is_empty() {
            return Err(MeasuredTableErrorKind::Empty);
        }
        let names = self.found.iter().map(|leaf| leaf.name.trim().to_owned());
        let head = Head::of(names.collect());
        let mut filling = Filling::new(&head, Numbers::with(form.decimal.unwrap_or('.')));
        for row in 0..self.rows {
            let cells: Vec<Cell> = self.found.iter().map(|leaf| leaf.cell(row)).collect();
            filling.record(row as u64 + 1, &cells)?;
        }
        filling.table(Counted::Row, self.remarks)
    }
}

impl Leaf {
    fn cell(&self, row: usize) -> Cell<'_> {
        let Some(place) = self.places[row].get() else { return Cell::Blank };
        match &self.values {
            Values::Numbers(values) => Cell::Number(values.value(place)),
            Values::Scaled(values, factor) => {
                let number = i128::from(values.value(place)) * i128::from(*factor);
                Cell::Number(number as f64)
            }
            Values::Texts(values) => Cell::Text(values.value(place).trim()),
        }
    }
}

const fn nanoseconds(unit: TimeUnit) -> i64 {
    match unit {
        TimeUnit::Second => 1_000_000_000,
        TimeUnit::Millisecond => 1_000_000,
        TimeUnit::Microsecond => 1_000,
        TimeUnit::Nanosecond => 1,
    }
}

/// The values of an array without inner ones; `None` where they are neither numbers nor texts.
fn values(array: &ArrayRef) -> Option<Values> {
    if let DataType::Timestamp(unit, _) = array.data_type() {
        let integers = array.to_data().into_builder().data_type(DataType::Int64).build().ok()?;
        return Some(Values::Scaled(integers.into(), nanoseconds(*unit)));
    }
    // Decimals are texts: their digits become the nearest double.
    let numbers = numbers(array).map(Values::Numbers);
    numbers.or_else(|| texts(array).map(Values::Texts))
}

#[cfg(test)]
mod tests;
