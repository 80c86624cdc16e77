//! One column of a row group: an Arrow array → its pages in memory.

use std::iter::{once, repeat_n};
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::{Float64Type, Int64Type, TimestampMicrosecondType};
use arrow_array::{Array, ArrayRef, BooleanArray, StringArray};
use arrow_buffer::ArrowNativeType;
use arrow_schema::ArrowError;
use arrow_select::filter::filter;
use bytes::Bytes;
use parquet::column::writer::{ColumnCloseResult, ColumnWriter, get_column_writer};
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterPropertiesPtr;
use parquet::file::writer::{SerializedPageWriter, TrackedWrite};
use parquet::schema::types::ColumnDescPtr;

use super::lists;

pub(super) struct EncodedColumn {
    pub(super) bytes: Bytes,
    pub(super) close: ColumnCloseResult,
}

pub(super) fn encode(
    column: ColumnDescPtr,
    properties: WriterPropertiesPtr,
    array: &ArrayRef,
) -> Result<EncodedColumn, ParquetError> {
    if let Some(encoded) = lists::encode(&column, &properties, array) {
        return encoded;
    }
    let levels = levels(column.max_def_level(), array);
    let values = present(array)?;
    let plain = values.to_data().get_slice_memory_size()?;
    // The bytes before the values take little.
    let mut pages = TrackedWrite::new(Vec::with_capacity(plain + plain / 32));
    let sink = Box::new(SerializedPageWriter::new(&mut pages));
    let close = write(get_column_writer(column, properties, sink), &values, &levels)?;
    Ok(EncodedColumn { bytes: pages.into_inner()?.into(), close })
}

/// The values that are present, one after another: without nulls and without the bounds of lists.
fn present(array: &ArrayRef) -> Result<ArrayRef, ArrowError> {
    let array = match array.nulls().filter(|nulls| nulls.null_count() > 0) {
        None => Arc::clone(array),
        Some(nulls) => filter(array, &BooleanArray::new(nulls.inner().clone(), None))?,
    };
    Ok(match array.as_list_opt::<i32>() {
        None => array,
        Some(lists) => {
            let bounds = lists.value_offsets();
            let (first, end) = (bounds[0].as_usize(), bounds[lists.len()].as_usize());
            lists.values().slice(first, end - first)
        }
    })
}

/// Parquet's levels of a column. Definition: its largest where there is a value, less where there is none; `None` where nothing can be
/// absent. Repetition: 0 for the first value of a list, 1 for the others; `None` where there are no lists.
type Levels = (Option<Vec<i16>>, Option<Vec<i16>>);

/// The levels of a column whose values have the definition level `there`.
fn levels(there: i16, array: &ArrayRef) -> Levels {
    let Some(lists) = array.as_list_opt::<i32>() else {
        let level = |row| there - i16::from(array.is_null(row));
        let levels = || match array.null_count() {
            0 => vec![there; array.len()],
            _ => (0..array.len()).map(level).collect(),
        };
        return ((there > 0).then(levels), None);
    };
    let places = lists.values().len() + lists.len();
    let (mut definition, mut repetition) = (Vec::with_capacity(places), Vec::with_capacity(places));
    for (row, length) in lists.offsets().lengths().enumerate() {
        // An empty list and an absent one take a place each.
        let (level, places) = match length {
            _ if lists.is_null(row) => (there - 2, 1),
            0 => (there - 1, 1),
            length => (there, length),
        };
        definition.extend(repeat_n(level, places));
        repetition.extend(once(0).chain(repeat_n(1, places - 1)));
    }
    (Some(definition), Some(repetition))
}

fn write(
    writer: ColumnWriter<'_>,
    values: &ArrayRef,
    (definition, repetition): &Levels,
) -> Result<ColumnCloseResult, ParquetError> {
    let (definition, repetition) = (definition.as_deref(), repetition.as_deref());
    macro_rules! write {
        ($writer:ident, $values:expr) => {{
            let mut writer = $writer;
            writer.write_batch($values, definition, repetition)?;
            writer.close()
        }};
    }
    match writer {
        ColumnWriter::DoubleColumnWriter(w) => {
            write!(w, values.as_primitive::<Float64Type>().values())
        }
        ColumnWriter::Int64ColumnWriter(w) => {
            if let Some(stamps) = values.as_primitive_opt::<TimestampMicrosecondType>() {
                write!(w, stamps.values())
            } else {
                write!(w, values.as_primitive::<Int64Type>().values())
            }
        }
        ColumnWriter::BoolColumnWriter(w) => {
            write!(w, &values.as_boolean().values().iter().collect::<Vec<_>>())
        }
        ColumnWriter::ByteArrayColumnWriter(w) => write!(w, &texts(values.as_string())),
        _ => unreachable!("the types of columns are these four and lists of them"),
    }
}

/// Texts without a copy of each.
fn texts(array: &StringArray) -> Vec<ByteArray> {
    let all = Bytes::copy_from_slice(array.value_data());
    let bounds = array.value_offsets().windows(2);
    bounds.map(|pair| all.slice(pair[0].as_usize()..pair[1].as_usize()).into()).collect()
}
