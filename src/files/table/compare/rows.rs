//! Rows of two tables, paired by the columns that identify them; numbers among those may differ by rounding.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_schema::DataType;

use super::{CLOSE, cells};
use crate::table::Table;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Rows {
    pub both: Vec<(usize, usize)>,
    pub only_published: Vec<usize>,
    pub only_computed: Vec<usize>,
    /// Whether each row is paired with the one of the same number, and none is unpaired.
    pub in_step: bool,
}

pub(super) fn name(table: &Table, row: usize) -> String {
    let order = table.schema().order.iter();
    let parts: Vec<String> =
        order.map(|column| format!("{column} {}", cells::text(table.array(column), row))).collect();
    if parts.is_empty() { "the only row".to_owned() } else { parts.join(", ") }
}

pub(super) fn pair(published: &Table, computed: &Table, ignored: &[&str]) -> Rows {
    let order = published.schema().order.iter().map(String::as_str);
    let order: Vec<&str> = order.filter(|column| !ignored.contains(column)).collect();
    let is_number = |column: &&str| published.array(column).data_type() == &DataType::Float64;
    let (numbers, words): (Vec<&str>, Vec<&str>) = order.into_iter().partition(is_number);
    let (left, right) = (Named::new(published, &numbers), Named::new(computed, &numbers));
    // Nearly always both tables have the same rows, and names are not needed.
    let alike = |column: &&str| published.array(column) == computed.array(column);
    let in_step = published.rows() == computed.rows()
        && words.iter().all(alike)
        && (0..published.rows()).all(|row| left.order(row, &right, row).is_eq());
    let mut rows = Rows { in_step, ..Rows::default() };
    if in_step {
        rows.both = (0..published.rows()).map(|row| (row, row)).collect();
        return rows;
    }
    for (own, other) in groups(published, computed, &words).into_values() {
        rows.merge(&left, &own, &right, &other);
    }
    rows.both.sort_unstable();
    rows.only_published.sort_unstable();
    rows.only_computed.sort_unstable();
    rows
}

/// Rows of both tables by their exact names.
fn groups(
    published: &Table,
    computed: &Table,
    words: &[&str],
) -> BTreeMap<Vec<String>, (Vec<usize>, Vec<usize>)> {
    let name = |table: &Table, row| words.iter().map(|word| key_cell(table, word, row)).collect();
    let mut groups: BTreeMap<_, (Vec<usize>, Vec<usize>)> = BTreeMap::new();
    for row in 0..published.rows() {
        groups.entry(name(published, row)).or_default().0.push(row);
    }
    for row in 0..computed.rows() {
        groups.entry(name(computed, row)).or_default().1.push(row);
    }
    groups
}

fn key_cell(table: &Table, column: &str, row: usize) -> String {
    let array = table.array(column);
    // A letter before the text distinguishes null from the text "null".
    let sort = if array.is_null(row) { '-' } else { '+' };
    format!("{sort}{}", cells::whole_text(array, row))
}

/// The numbers that identify a table's rows.
struct Named<'a>(Vec<&'a arrow_array::Float64Array>);

impl<'a> Named<'a> {
    fn new(table: &'a Table, columns: &[&str]) -> Self {
        let number = |column: &&str| table.array(column).as_primitive::<Float64Type>();
        Self(columns.iter().map(number).collect())
    }

    /// The order of two rows; equal where all numbers are close. A null comes before any number, as in the tables.
    fn order(&self, row: usize, other: &Self, other_row: usize) -> Ordering {
        let pairs = self.0.iter().zip(&other.0);
        let mut orders = pairs.map(|(left, right)| {
            let value = |array: &arrow_array::Float64Array, row| {
                array.is_valid(row).then(|| array.value(row))
            };
            match (value(left, row), value(right, other_row)) {
                (Some(a), Some(b)) if (a - b).abs() <= CLOSE * a.abs().max(b.abs()) => {
                    Ordering::Equal
                }
                (Some(a), Some(b)) => a.total_cmp(&b),
                (a, b) => a.is_some().cmp(&b.is_some()),
            }
        });
        orders.find(|order| order.is_ne()).unwrap_or(Ordering::Equal)
    }
}

impl Rows {
    /// Merges rows that have equal exact names, each side in the order of its numbers.
    fn merge(&mut self, left: &Named<'_>, own: &[usize], right: &Named<'_>, other: &[usize]) {
        let (mut i, mut j) = (0, 0);
        while let (Some(&a), Some(&b)) = (own.get(i), other.get(j)) {
            match left.order(a, right, b) {
                Ordering::Equal => {
                    self.both.push((a, b));
                    (i, j) = (i + 1, j + 1);
                }
                Ordering::Less => {
                    self.only_published.push(a);
                    i += 1;
                }
                Ordering::Greater => {
                    self.only_computed.push(b);
                    j += 1;
                }
            }
        }
        self.only_published.extend(&own[i..]);
        self.only_computed.extend(&other[j..]);
    }
}
