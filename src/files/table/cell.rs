use std::iter::repeat_n;
use std::sync::Arc;

use arrow_array::builder::{Float64Builder, Int64Builder, ListBuilder, StringBuilder};
use arrow_array::{
    ArrayRef, BooleanArray, Float64Array, ListArray, StringArray, TimestampMicrosecondArray,
    new_null_array,
};
use arrow_buffer::OffsetBuffer;
use arrow_schema::{DataType, Field, FieldRef};

use crate::schema::{ColumnType, UTC};
use crate::units::WallTime;

/// A value or an absent one: `f64`, `Option<f64>`, `&str`, `Option<Vec<f64>>` and the like.
pub trait Cell {
    type Value: Value;
    /// The value, or `None` for null.
    fn value(self) -> Option<Self::Value>;
}

/// The values of a whole column. One function of each type makes its array, not one of each caller's iterator.
pub type Values<'v, V> = &'v mut dyn Iterator<Item = Option<V>>;

pub trait Value: Sized {
    const KIND: ColumnType;
    /// The array of a whole column; an error has the first row whose value does not fit, and the value.
    fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)>;
    /// The array of a column with the same value in each row.
    fn same(value: Option<Self>, rows: usize) -> Result<ArrayRef, (usize, String)>
    where
        Self: Clone,
    {
        Self::array(&mut repeat_n(value, rows))
    }
}

impl<V: Value> Cell for V {
    type Value = V;
    fn value(self) -> Option<V> {
        Some(self)
    }
}

impl<V: Value> Cell for Option<V> {
    type Value = V;
    fn value(self) -> Self {
        self
    }
}

impl Value for f64 {
    const KIND: ColumnType = ColumnType::Float64;
    fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)> {
        let mut column = Float64Builder::with_capacity(values.size_hint().0);
        values.for_each(|value| column.append_option(value));
        Ok(Arc::new(column.finish()))
    }
}

impl Value for WallTime {
    const KIND: ColumnType = ColumnType::Timestamp;
    fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)> {
        let micros = values.map(|value| value.map(Self::us));
        Ok(Arc::new(micros.collect::<TimestampMicrosecondArray>().with_timezone(UTC)))
    }
}

impl Value for bool {
    const KIND: ColumnType = ColumnType::Bool;
    fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)> {
        Ok(Arc::new(values.collect::<BooleanArray>()))
    }
}

macro_rules! whole_numbers {
    ($($number:ty),+) => {$(
        impl Value for $number {
            const KIND: ColumnType = ColumnType::Int64;
            fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)> {
                let mut column = Int64Builder::with_capacity(values.size_hint().0);
                for (row, value) in values.enumerate() {
                    column.append_option(value.map(|value| signed(row, value)).transpose()?);
                }
                Ok(Arc::new(column.finish()))
            }
        }
    )+};
}
whole_numbers!(i64, u32, u64, usize);

fn signed<T: TryInto<i64> + ToString + Copy>(row: usize, value: T) -> Result<i64, (usize, String)> {
    value.try_into().map_err(|_| (row, value.to_string()))
}

macro_rules! texts {
    ($($text:ty),+) => {$(
        impl Value for $text {
            const KIND: ColumnType = ColumnType::String;
            fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)> {
                Ok(Arc::new(values.collect::<StringArray>()))
            }
            fn same(value: Option<Self>, rows: usize) -> Result<ArrayRef, (usize, String)> {
                Ok(match value {
                    Some(text) => Arc::new(StringArray::new_repeated(text, rows)),
                    None => new_null_array(&DataType::Utf8, rows),
                })
            }
        }
    )+};
}
texts!(&str, String, &String);

macro_rules! lists {
    ($builder:ident, $kind:ident, $arrow:ident, $into:expr; $($list:ty),+) => {$(
        impl Value for $list {
            const KIND: ColumnType = ColumnType::$kind;
            fn array(values: Values<'_, Self>) -> Result<ArrayRef, (usize, String)> {
                let mut list = ListBuilder::new($builder::new()).with_field(element(DataType::$arrow));
                for (row, value) in values.enumerate() {
                    for element in value.iter().flat_map(|list| list.iter()) {
                        list.values().append_value($into(row, element)?);
                    }
                    list.append(value.is_some());
                }
                Ok(Arc::new(list.finish()))
            }
        }
    )+};
}
lists!(Float64Builder, ListFloat64, Float64, |_, x: &f64| Ok(*x); &[f64], &Vec<f64>, Vec<f64>);
lists!(Int64Builder, ListInt64, Int64, |row, x: &i64| signed(row, *x); &[i64], Vec<i64>);
lists!(Int64Builder, ListInt64, Int64, |row, x: &u64| signed(row, *x); &[u64], Vec<u64>);
lists!(StringBuilder, ListString, Utf8, same_text; &[String], &Vec<String>, Vec<String>, &[&str], Vec<&str>);

#[expect(clippy::unnecessary_wraps, reason = "the lists of numbers can fail")]
fn same_text<T: AsRef<str>>(_row: usize, text: &T) -> Result<&str, (usize, String)> {
    Ok(text.as_ref())
}

fn element(of: DataType) -> FieldRef {
    Arc::new(Field::new("element", of, false))
}

/// Lists of one length, their values one after another.
pub(super) fn lists_alike(values: &[f64], rows: usize) -> ArrayRef {
    let length = values.len().checked_div(rows).unwrap_or(0);
    assert_eq!(values.len(), length * rows, "values of {rows} lists");
    let offsets = OffsetBuffer::from_repeated_length(length, rows);
    let values = Arc::new(Float64Array::from(values.to_vec()));
    Arc::new(ListArray::new(element(DataType::Float64), offsets, values, None))
}
