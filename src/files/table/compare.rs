//! Two tables of one kind, published and recomputed → their differences, by column and row. Rows are paired by the
//! columns that identify them; numbers, also those within JSON, by their difference, all others exactly.

mod cells;
mod rows;

use super::Table;
use cells::{CellDifference, Numbers};
use rows::{Rows, pair};

/// Largest relative difference of two numbers that count as the same value: rounding on another processor.
pub const CLOSE: f64 = 1e-9;

#[derive(Debug, Clone, PartialEq)]
pub struct Comparison {
    /// Columns with a cell that differs, in the schema's order.
    pub columns: Vec<ColumnDifference>,
    pub only_published: OneSided,
    pub only_computed: OneSided,
}

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct OneSided {
    pub rows: usize,
    /// The first of them, by the columns that identify it.
    pub first: Option<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ColumnDifference {
    pub column: String,
    pub cells: usize,
    pub compared: usize,
    /// The largest differences of numbers; `None` where no number differs.
    pub largest: Option<Largest>,
    /// The first cell that differs other than by a number; `None` without one.
    pub unlike: Option<Unlike>,
}

/// The largest differences of a column's numbers; they may be in different rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Largest {
    /// Absolute, in the column's unit.
    pub absolute: f64,
    pub relative: f64,
    pub row: String,
    pub published: f64,
    pub computed: f64,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unlike {
    pub row: String,
    pub published: String,
    pub computed: String,
}

impl Comparison {
    /// `None` unless only numbers differ, by at most [`CLOSE`]; 0 where nothing differs.
    pub fn same_values(&self) -> Option<f64> {
        let relative = |column: &ColumnDifference| match (&column.largest, &column.unlike) {
            (Some(largest), None) => Some(largest.relative),
            _ => None,
        };
        let all: Option<Vec<f64>> = self.columns.iter().map(relative).collect();
        let largest = all?.into_iter().fold(0.0, f64::max);
        let no_row_missing = self.only_published.rows == 0 && self.only_computed.rows == 0;
        (no_row_missing && largest <= CLOSE).then_some(largest)
    }
}

/// The comparison leaves out the columns `ignored` and those that the published table's version lacks.
pub fn compare(published: &Table, computed: &Table, ignored: &[&str]) -> Comparison {
    let [one, other] = [published, computed].map(|table| &table.schema().table);
    assert_eq!(one, other, "tables of one schema are compared");
    let rows = pair(published, computed, ignored);
    let columns = published.schema().columns.iter();
    let columns = columns.filter(|column| {
        column.is_in(published.version) && !ignored.contains(&column.name.as_str())
    });
    Comparison {
        columns: columns
            .filter_map(|column| difference(&column.name, published, computed, &rows))
            .collect(),
        only_published: one_sided(published, &rows.only_published),
        only_computed: one_sided(computed, &rows.only_computed),
    }
}

fn one_sided(table: &Table, rows: &[usize]) -> OneSided {
    OneSided { rows: rows.len(), first: rows.first().map(|&row| rows::name(table, row)) }
}

fn difference(
    column: &str,
    published: &Table,
    computed: &Table,
    rows: &Rows,
) -> Option<ColumnDifference> {
    let (left, right) = (published.array(column), computed.array(column));
    if rows.in_step && left == right {
        return None;
    }
    let (column, compared) = (column.to_owned(), rows.both.len());
    let mut found = ColumnDifference { column, cells: 0, compared, largest: None, unlike: None };
    for &(own, other) in &rows.both {
        if let Some(difference) = cells::difference(left, own, right, other) {
            found.add(difference, || rows::name(published, own));
        }
    }
    (found.cells > 0).then_some(found)
}

impl ColumnDifference {
    fn add(&mut self, difference: CellDifference, row: impl Fn() -> String) {
        self.cells += 1;
        match difference {
            CellDifference::Number(number) => {
                let (before, relative) = (self.largest.as_ref(), number.relative());
                let absolute = before.map_or(0.0, |own| own.absolute).max(number.absolute());
                if before.is_none_or(|largest| relative > largest.relative) {
                    let Numbers { published, computed } = number;
                    self.largest =
                        Some(Largest { absolute, relative, row: row(), published, computed });
                } else if let Some(largest) = &mut self.largest {
                    largest.absolute = absolute;
                }
            }
            CellDifference::Unlike(published, computed) => {
                self.unlike.get_or_insert_with(|| Unlike { row: row(), published, computed });
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::RunKey;
    use crate::schema;
    use crate::table::Columns;

    /// Joint errors at these angles, with these curve values.
    fn curve<const N: usize>(angles: [f64; N], curve: [f64; N], run: &str) -> Table {
        Columns::new(schema::find("joint_errors").unwrap(), N)
            .key(&RunKey::new("ur10", "grid", run))
            .same("joint", 1_u64)
            .same("joint_name", "shoulder_pan_joint")
            .same("joint_unit", "rad")
            .column("angle_rad", angles)
            .column("error_rad", [2e-4; N])
            .column("curve_rad", curve)
            .same("sd_rad", 1e-5)
            .same("gear_lines_rad", 0.0)
            .same("measured", true)
            .finish()
            .unwrap()
    }

    #[test]
    fn the_same_table_has_no_difference_and_an_ignored_column_does_not_count() {
        let published = curve([-1.0, 1.0], [1e-4, 2e-4], "00ff");
        let same = compare(&published, &published.clone(), &[]);
        assert_eq!(same.same_values(), Some(0.0));
        let computed = curve([-1.0, 1.0], [1e-4, 2e-4], "11ee");
        assert!(compare(&published, &computed, &["run"]).columns.is_empty());
        let told = compare(&published, &computed, &[]);
        let unlike = told.columns[0].unlike.as_ref().unwrap();
        assert_eq!((told.columns[0].column.as_str(), unlike.computed.as_str()), ("run", "11ee"));
        assert_eq!(told.same_values(), None);
    }

    #[test]
    fn of_each_column_the_largest_difference_is_reported() {
        let published = curve([-1.0, 0.0, 1.0], [1e-4, 2e-4, 4e-4], "00ff");
        // Off by 1e-5 of 2e-4, 5 % of the larger of both, and by 1.5e-5 of 4e-4, which is a smaller share.
        let computed = curve([-1.0, 0.0, 1.0], [1e-4, 1.9e-4, 3.85e-4], "00ff");
        let told = compare(&published, &computed, &[]);
        let [column] = &told.columns[..] else { panic!("{told:?}") };
        let largest = column.largest.as_ref().unwrap();
        assert_eq!((column.cells, column.compared), (2, 3));
        assert!((largest.relative - 0.05).abs() < 1e-12, "{largest:?}");
        assert!((largest.absolute - 1.5e-5).abs() < 1e-18, "{largest:?}");
        assert_eq!((largest.published, largest.computed), (2e-4, 1.9e-4));
        assert!(largest.row.contains("angle_rad 0"), "{largest:?}");
        assert_eq!(told.same_values(), None);
    }

    #[test]
    fn rounding_is_the_same_value_and_a_little_more_is_not() {
        let published = curve([1.0], [1e-4], "00ff");
        let off = |share: f64| {
            let computed = curve([1.0], [1e-4 * (1.0 + share)], "00ff");
            compare(&published, &computed, &[]).same_values()
        };
        assert!(off(5e-10).is_some_and(|largest| (largest - 5e-10).abs() < 1e-12));
        assert_eq!(off(2e-9), None);
    }

    #[test]
    fn rows_of_one_side_are_counted_and_the_others_still_paired() {
        // The row at −1 is missing, one at 2 is new; the one at 0 moved by a rounding, and is the same row.
        let published = curve([-1.0, 0.5, 1.0], [1e-4, 2e-4, 3e-4], "00ff");
        let computed = curve([0.5 + 1e-13, 1.0, 2.0], [2e-4, 3e-4, 9e-4], "00ff");
        let told = compare(&published, &computed, &[]);
        assert_eq!((told.only_published.rows, told.only_computed.rows), (1, 1));
        let first = told.only_published.first.unwrap();
        assert!(first.contains("angle_rad -1"), "{first}");
        assert_eq!(told.columns.len(), 1, "the angle alone: {:?}", told.columns);
        assert_eq!(told.columns[0].column, "angle_rad");
    }
}
