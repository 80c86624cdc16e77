//! The values of columns of other types as those a table has: numbers, whole numbers, texts.

use std::sync::Arc;

use arrow_array::cast::AsArray as _;
use arrow_array::types::{
    Date32Type, Decimal128Type, Decimal256Type, Float16Type, Float32Type, Float64Type, Int64Type,
    Time32MillisecondType, Time64MicrosecondType, Time64NanosecondType, TimestampMicrosecondType,
};
use arrow_array::{
    Array, ArrayRef, Float64Array, Int64Array, ListArray, StringArray, downcast_integer,
};
use arrow_schema::{DataType, FieldRef, TimeUnit};
use chrono::SecondsFormat;
use num_traits::AsPrimitive;

/// Whole numbers beyond 2⁵³ become the nearest; `None` where the type is not that of a number.
pub fn numbers(array: &dyn Array) -> Option<Float64Array> {
    macro_rules! number {
        ($of:ty) => {
            Some(array.as_primitive::<$of>().unary(AsPrimitive::<f64>::as_))
        };
    }
    downcast_integer! {
        array.data_type() => (number),
        DataType::Float16 => number!(Float16Type),
        DataType::Float32 => number!(Float32Type),
        DataType::Float64 => number!(Float64Type),
        _ => None
    }
}

/// `None` also where a value is beyond the range.
pub fn integers(array: &dyn Array) -> Option<Int64Array> {
    macro_rules! integer {
        ($of:ty) => {
            array.as_primitive::<$of>().try_unary::<_, Int64Type, _>(i64::try_from).ok()
        };
    }
    downcast_integer! { array.data_type() => (integer), _ => None }
}

/// Each value in words; `None` where there are none for its type.
pub fn texts(array: &dyn Array) -> Option<StringArray> {
    let text = |row| if array.is_null(row) { Some(None) } else { text(array, row).map(Some) };
    (0..array.len()).map(text).collect()
}

/// Of a value that is not null; dates and times by ISO 8601.
pub fn text(array: &dyn Array, row: usize) -> Option<String> {
    match array.data_type() {
        DataType::Utf8 => Some(array.as_string::<i32>().value(row).to_owned()),
        DataType::Boolean => Some(array.as_boolean().value(row).to_string()),
        DataType::Int64 => Some(array.as_primitive::<Int64Type>().value(row).to_string()),
        DataType::Float64 => Some(array.as_primitive::<Float64Type>().value(row).to_string()),
        DataType::Decimal128(..) => {
            Some(array.as_primitive::<Decimal128Type>().value_as_string(row))
        }
        DataType::Decimal256(..) => {
            Some(array.as_primitive::<Decimal256Type>().value_as_string(row))
        }
        DataType::List(_) => {
            let values = array.as_list::<i32>().value(row);
            let texts: Option<Vec<_>> = (0..values.len()).map(|at| text(&values, at)).collect();
            Some(format!("[{}]", texts?.join(", ")))
        }
        _ => moment(array, row),
    }
}

fn moment(array: &dyn Array, row: usize) -> Option<String> {
    let time = match array.data_type() {
        DataType::Date32 => {
            return Some(array.as_primitive::<Date32Type>().value_as_date(row)?.to_string());
        }
        DataType::Timestamp(TimeUnit::Microsecond, _) => {
            let moments = array.as_primitive::<TimestampMicrosecondType>();
            let moment = moments.value_as_datetime(row)?.and_utc();
            return Some(moment.to_rfc3339_opts(SecondsFormat::AutoSi, true));
        }
        DataType::Time32(TimeUnit::Millisecond) => {
            array.as_primitive::<Time32MillisecondType>().value_as_time(row)
        }
        DataType::Time64(TimeUnit::Microsecond) => {
            array.as_primitive::<Time64MicrosecondType>().value_as_time(row)
        }
        DataType::Time64(TimeUnit::Nanosecond) => {
            array.as_primitive::<Time64NanosecondType>().value_as_time(row)
        }
        _ => None,
    };
    Some(time?.to_string())
}

/// The array as `wanted` where the values are unchanged; otherwise as found, and the check that follows reports its
/// type.
pub(super) fn widened(array: &ArrayRef, wanted: &DataType) -> ArrayRef {
    let as_wanted: Option<ArrayRef> = match (array.data_type(), wanted) {
        (_, DataType::Float64) => numbers(array).map(|numbers| Arc::new(numbers) as _),
        (_, DataType::Int64) => integers(array).map(|integers| Arc::new(integers) as _),
        (DataType::List(_), DataType::List(of)) => {
            list(array.as_list(), of).map(|l| Arc::new(l) as _)
        }
        _ => None,
    };
    as_wanted.unwrap_or_else(|| Arc::clone(array))
}

fn list(array: &ListArray, of: &FieldRef) -> Option<ListArray> {
    let values = widened(array.values(), of.data_type());
    let (bounds, nulls) = (array.offsets().clone(), array.nulls().cloned());
    ListArray::try_new(Arc::clone(of), bounds, values, nulls).ok()
}
