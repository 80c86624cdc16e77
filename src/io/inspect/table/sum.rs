use super::columns::number;
use crate::measured_table::MeasuredTable;

/// Columns, each with its sign.
#[derive(Debug, Clone, PartialEq)]
pub struct Sum(Vec<(f64, usize)>);

impl Sum {
    pub fn of(column: usize) -> Self {
        Self(vec![(1.0, column)])
    }

    /// This with one column more, added or (−1) taken away.
    #[must_use]
    pub fn with(&self, sign: f64, column: usize) -> Self {
        Self([&self.0[..], &[(sign, column)]].concat())
    }

    pub fn columns(&self) -> impl Iterator<Item = usize> + '_ {
        self.0.iter().map(|(_, column)| *column)
    }

    /// Its value in a row; `None` where a cell has no number.
    pub fn value(&self, table: &MeasuredTable, row: usize) -> Option<f64> {
        self.0
            .iter()
            .try_fold(0.0, |sum, &(sign, column)| Some(sum + sign * number(table, row, column)?))
    }

    /// As `[stations]` writes it.
    pub fn text(&self, names: &[String]) -> String {
        let mut text = String::new();
        for (place, &(sign, column)) in self.0.iter().enumerate() {
            let operator = if sign < 0.0 { " - " } else { " + " };
            text += if place == 0 { "" } else { operator };
            text += &names[column];
        }
        text
    }
}

/// A position as a table has it: x, y and z.
pub type Position = [Sum; 3];

/// The unit is that of the columns; `None` where a cell has no number, or all three are 0, which instruments write
/// where they measured nothing.
pub fn position(sums: &Position, table: &MeasuredTable, row: usize) -> Option<[f64; 3]> {
    let [x, y, z] = sums;
    let at = [x.value(table, row)?, y.value(table, row)?, z.value(table, row)?];
    at.iter().any(|value| *value != 0.0).then_some(at)
}
