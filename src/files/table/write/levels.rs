//! Parquet's levels of a column: which rows have a value, and where the lists begin.

use std::iter::{once, repeat_n};

use arrow_array::cast::AsArray;
use arrow_array::{Array, ArrayRef, ListArray};
use parquet::schema::types::ColumnDescPtr;

pub(super) struct Levels {
    /// The column's largest level where there is a value, less where there is none; `None` where nothing can be absent.
    pub(super) definition: Option<Vec<i16>>,
    /// 0 for the first value of a list, 1 for the others; `None` where there are no lists.
    pub(super) repetition: Option<Vec<i16>>,
}

impl Levels {
    pub(super) fn of(column: &ColumnDescPtr, array: &ArrayRef) -> Self {
        let there = column.max_def_level();
        match array.as_list_opt::<i32>() {
            Some(lists) => Self::of_lists(there, lists),
            None => {
                Self { definition: (there > 0).then(|| of_values(there, array)), repetition: None }
            }
        }
    }

    /// An empty list and an absent one take a place each.
    fn of_lists(there: i16, lists: &ListArray) -> Self {
        let places = lists.values().len() + lists.len();
        let (mut definition, mut repetition) =
            (Vec::with_capacity(places), Vec::with_capacity(places));
        for (row, length) in lists.offsets().lengths().enumerate() {
            let (level, places) = match length {
                _ if lists.is_null(row) => (there - 2, 1),
                0 => (there - 1, 1),
                length => (there, length),
            };
            definition.extend(repeat_n(level, places));
            repetition.extend(once(0).chain(repeat_n(1, places - 1)));
        }
        Self { definition: Some(definition), repetition: Some(repetition) }
    }
}

fn of_values(there: i16, array: &ArrayRef) -> Vec<i16> {
    match array.null_count() {
        0 => vec![there; array.len()],
        _ => (0..array.len()).map(|row| there - i16::from(array.is_null(row))).collect(),
    }
}
