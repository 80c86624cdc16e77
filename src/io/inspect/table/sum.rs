use crate::figures::median;
use crate::ingest::MISSING;
use crate::measured_table::MeasuredTable;
use crate::station_table::{Sum, Value};

/// A position as a table has it: x, y and z.
pub type Position = [Sum; 3];

/// The unit is that of the columns; `None` where a cell has no number, or all three are 0, which instruments write
/// where they measured nothing.
pub fn position(sums: &Position, table: &MeasuredTable, row: usize) -> Option<[f64; 3]> {
    let number = |sum: &Sum| match sum.value(table, row, &MISSING) {
        Value::Number(number) => Some(number),
        Value::Missing(_) | Value::Text(..) => None,
    };
    let [x, y, z] = sums;
    let at = [number(x)?, number(y)?, number(z)?];
    at.iter().any(|value| *value != 0.0).then_some(at)
}

/// Median distance from the median position, in the unit of the columns; 0 of nothing. Missing readings are left out.
pub fn spread(table: &MeasuredTable, sums: &Position) -> f64 {
    let points: Vec<[f64; 3]> =
        (0..table.row_count()).filter_map(|row| position(sums, table, row)).collect();
    let middle = [0, 1, 2].map(|axis| {
        median(&points.iter().map(|point| point[axis]).collect::<Vec<_>>()).unwrap_or(0.0)
    });
    let apart = |point: &[f64; 3]| {
        point.iter().zip(middle).map(|(own, middle)| (own - middle).powi(2)).sum::<f64>().sqrt()
    };
    median(&points.iter().map(apart).collect::<Vec<_>>()).unwrap_or(0.0)
}
