use super::sum::{Position, position};
use crate::figures::median;
use crate::measured_table::MeasuredTable;

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
