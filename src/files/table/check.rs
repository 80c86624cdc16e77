//! Columns checked against the contract of their table: types, lengths, nulls, numbers, words, the order of rows.

use std::cmp::Ordering;
use std::sync::Arc;

use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_array::{Array, ArrayRef, RecordBatch, StringArray, UInt64Array};
use arrow_cmp::make_comparator;
use arrow_schema::{ArrowError, SortOptions};
use arrow_select::take::take_record_batch;

use super::{Table, TableError, same};
use crate::manifest::RunKey;
use crate::schema::{ColumnSchema, ColumnType, KEY_COLUMNS, Role, TableSchema};

/// The table with each row's place in the order given (`None` where the order is the same); columns that are not given
/// are taken from `like`, a checked table.
pub(super) fn table(
    schema: &'static TableSchema,
    key: Option<RunKey>,
    rows: usize,
    arrays: Vec<Option<ArrayRef>>,
    like: Option<&Table>,
) -> Result<(Table, Option<Vec<usize>>), TableError> {
    let given: Vec<bool> = arrays.iter().map(Option::is_some).collect();
    let arrays = all(schema, arrays, like)?;
    let columns = schema.columns.iter().zip(&arrays).zip(given);
    for ((column, array), _) in columns.filter(|(_, given)| *given) {
        check_column(schema, column, rows, array)?;
    }
    let arrow = |source: ArrowError| TableError::of(schema, source);
    let batch = RecordBatch::try_new(Arc::new(schema.arrow()), arrays).map_err(arrow)?;
    let names = row_names(schema, key.as_ref(), &batch);
    let compared = by_names(&names).map_err(arrow)?;
    // Nearly always the rows are in order, and each is compared only with the one before it.
    let (batch, order) = if (1..rows).all(|row| compared(row - 1, row).is_lt()) {
        (batch, None)
    } else {
        in_order(schema, batch, compared)?
    };
    let table = Table { schema, key, batch, version: schema.version };
    Ok((table, order))
}

/// All columns, given or from the table `like`.
fn all(
    schema: &TableSchema,
    arrays: Vec<Option<ArrayRef>>,
    like: Option<&Table>,
) -> Result<Vec<ArrayRef>, TableError> {
    let known = |place: usize| like.map(|table| Arc::clone(table.batch.column(place)));
    let arrays = arrays.into_iter().enumerate();
    let arrays: Vec<_> = arrays.map(|(place, array)| array.or_else(|| known(place))).collect();
    let missing = schema.columns.iter().zip(&arrays).filter(|(_, array)| array.is_none());
    let missing: Vec<&str> = missing.map(|(column, _)| column.name.as_str()).collect();
    if missing.is_empty() {
        return Ok(arrays.into_iter().flatten().collect());
    }
    let missing = missing.join(", ");
    Err(TableError::of(
        schema,
        format_args!(
            "missing columns {missing}; a column without values still has to be there, all null"
        ),
    ))
}

/// The rows in the schema's order, if no two have the same name.
fn in_order(
    schema: &TableSchema,
    batch: RecordBatch,
    compared: impl Fn(usize, usize) -> Ordering,
) -> Result<(RecordBatch, Option<Vec<usize>>), TableError> {
    let mut order: Vec<usize> = (0..batch.num_rows()).collect();
    order.sort_by(|&a, &b| compared(a, b));
    if let Some(pair) = order.windows(2).find(|pair| compared(pair[0], pair[1]).is_eq()) {
        return Err(same_name(schema, pair[0], pair[1]));
    }
    // A table from another program keeps its order: that of targets is the order of the program that visits them.
    if schema.role == Role::Accepted {
        return Ok((batch, None));
    }
    let rows: UInt64Array = order.iter().map(|&row| row as u64).collect();
    let batch = take_record_batch(&batch, &rows);
    Ok((batch.map_err(|source| TableError::of(schema, source))?, Some(order)))
}

fn same_name(schema: &TableSchema, first: usize, second: usize) -> TableError {
    let names = schema.order.join(", ");
    let same = if names.is_empty() { "file" } else { &names };
    let place = format_args!(", rows {first} and {second}");
    let one = &schema.one_row_per;
    let problem = format_args!("the same {same}; a table has one row per {one}");
    TableError::at(schema, place, problem)
}

fn check_column(
    schema: &TableSchema,
    column: &ColumnSchema,
    rows: usize,
    array: &ArrayRef,
) -> Result<(), TableError> {
    let broken = |problem| Err(TableError::column(schema, &column.name, problem));
    let (found, expected) = (array.data_type(), column.kind);
    if found != &expected.arrow() {
        return broken(format!("found {found}, the schema states {}", expected.name()));
    }
    if array.len() != rows {
        return broken(format!("{} values for {rows} rows", array.len()));
    }
    match unexpected_null(column, array).or_else(|| broken_value(column, array)) {
        None => Ok(()),
        Some((row, problem)) => {
            let place = format_args!(", column {:?}, row {row}", column.name);
            Err(TableError::at(schema, place, problem))
        }
    }
}

fn unexpected_null(column: &ColumnSchema, array: &ArrayRef) -> Option<(usize, String)> {
    if column.nullable || array.null_count() == 0 {
        return None;
    }
    let row = (0..array.len()).find(|&row| array.is_null(row))?;
    Some((row, "null, and the column always has a value".to_owned()))
}

fn broken_value(column: &ColumnSchema, array: &ArrayRef) -> Option<(usize, String)> {
    match (column.kind, &column.values) {
        (ColumnType::Float64, _) => not_finite(array),
        (ColumnType::ListFloat64, _) => {
            let lists = array.as_list::<i32>();
            // Nearly always all are finite: one check of all elements is enough.
            not_finite(lists.values())?;
            let wrong = |row| Some((row, not_finite(&lists.value(row))?.1));
            (0..lists.len()).filter(|&row| lists.is_valid(row)).find_map(wrong)
        }
        (ColumnType::String, Some(words)) => not_allowed(words, array.as_string()),
        _ => None,
    }
}

fn not_finite(array: &ArrayRef) -> Option<(usize, String)> {
    let numbers = array.as_primitive::<Float64Type>();
    // Nearly always all are finite: combining the bits of a block is faster than testing each.
    let all_finite = |block: &[f64]| block.iter().fold(true, |all, x| all & x.is_finite());
    let absent = numbers.null_count() == numbers.len();
    if absent || numbers.values().chunks(1024).all(all_finite) {
        return None;
    }
    let wrong = |(row, x): (usize, Option<f64>)| Some((row, x.filter(|x| !x.is_finite())?));
    let (row, x) = numbers.iter().enumerate().find_map(wrong)?;
    Some((row, format!("{x} is not a finite number; what is absent is null")))
}

fn not_allowed(words: &[String], array: &StringArray) -> Option<(usize, String)> {
    let known = |word: &str| words.iter().any(|w| w == word);
    if same::text(array).is_some_and(known) {
        return None;
    }
    let wrong =
        |(row, word): (usize, Option<&str>)| Some((row, word.filter(|w| !known(w))?.to_owned()));
    let (row, word) = array.iter().enumerate().find_map(wrong)?;
    Some((row, format!("{word:?} is none of the words allowed: {}", words.join(", "))))
}

/// The columns that identify a row, enumerations as the positions of their words. Robot, session and run come first.
fn row_names(schema: &TableSchema, key: Option<&RunKey>, batch: &RecordBatch) -> Vec<ArrayRef> {
    let order = || schema.order.iter().map(String::as_str);
    let of_several = key.is_none() && schema.role == Role::Published;
    let keys = KEY_COLUMNS.into_iter().filter(|_| of_several);
    let keys = keys.filter(|own| !order().any(|name| name == *own));
    keys.chain(order()).filter_map(|name| sort_key(schema, batch, name)).collect()
}

fn sort_key(schema: &TableSchema, batch: &RecordBatch, name: &str) -> Option<ArrayRef> {
    let (place, column) = schema.column(name).expect("a schema's order names its own columns");
    let array = batch.column(place);
    let Some(words) = &column.values else { return Some(Arc::clone(array)) };
    let texts = array.as_string::<i32>();
    let rank = |word: &str| words.iter().position(|w| w == word).map(|rank| rank as u64);
    if same::text(texts).is_some() {
        return None;
    }
    let ranks: UInt64Array = texts.iter().map(|word| rank(word?)).collect();
    Some(Arc::new(ranks))
}

/// Which of two rows comes first: nulls do, and enumerations in the order of their words.
fn by_names(names: &[ArrayRef]) -> Result<impl Fn(usize, usize) -> Ordering, ArrowError> {
    let column = |of: &ArrayRef| make_comparator(of, of, SortOptions::default());
    let columns = names.iter().map(column).collect::<Result<Vec<_>, _>>()?;
    let of = move |a, b| columns.iter().map(|column| column(a, b)).find(|order| order.is_ne());
    Ok(move |a, b| of(a, b).unwrap_or(Ordering::Equal))
}
