//! The triangular factor R of the stacked Jacobian, so that singular values keep their digits (`JᵀJ` would square them).
//!
//! Rows come in blocks and only R is kept: Householder reflections of R's row k with the block's column k,
//! below which R has only zeros (the update of a QR factorisation by rows; Golub and Van Loan, Matrix Computations, 6.5.3).

use nalgebra::DMatrix;

use crate::fit::observation::rows::{BlockRows, dot};

/// Number of rows processed together: some thirty columns of them fit into the fastest cache.
const AT_ONCE: usize = 96;

/// The factor R of all rows so far.
#[derive(Debug, Clone)]
pub struct Triangle {
    size: usize,
    /// Entries row by row, zeros below the diagonal.
    entries: Vec<f64>,
    /// The current block; its memory is reused.
    block: Vec<Vec<f64>>,
}

impl Triangle {
    /// The factor of no rows: zeros.
    pub fn new(size: usize) -> Self {
        Self { size, entries: vec![0.0; size * size], block: vec![Vec::new(); size] }
    }

    /// Adds a block of whitened rows; the residual takes no part.
    pub fn take(&mut self, rows: &BlockRows) {
        let length = rows.column(0).len();
        let mut block = std::mem::take(&mut self.block);
        for first in (0..length).step_by(AT_ONCE) {
            let part = first..length.min(first + AT_ONCE);
            for column in &mut block {
                column.clear();
                column.resize(part.len(), 0.0);
            }
            for (place, &unknown) in rows.unknowns.iter().enumerate() {
                block[unknown].copy_from_slice(&rows.column(place)[part.clone()]);
            }
            self.take_columns(&mut block);
        }
        self.block = block;
    }

    /// Adds rows given as columns of one length, one for each unknown; their content afterwards is meaningless.
    fn take_columns(&mut self, block: &mut [Vec<f64>]) {
        for (k, row) in self.entries.chunks_exact_mut(self.size).enumerate() {
            let (done, later) = block.split_at_mut(k + 1);
            let below = &done[k];
            let squared = dot(below, below);
            if squared == 0.0 {
                continue;
            }
            let diagonal = row[k];
            let norm = diagonal.hypot(squared.sqrt());
            // Away from zero, so that no digits cancel.
            let reflected = if diagonal > 0.0 { -norm } else { norm };
            let head = diagonal - reflected;
            let scale = 2.0 / (head * head + squared);
            row[k] = reflected;
            for (entry, column) in row[k + 1..].iter_mut().zip(later) {
                let along = scale * (head * *entry + dot(below, column));
                *entry -= along * head;
                for (x, v) in column.iter_mut().zip(below) {
                    *x -= along * v;
                }
            }
        }
    }

    pub fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_row_slice(self.size, self.size, &self.entries)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows without a pattern; their last column is the sum of the two first.
    fn rows(count: usize, size: usize) -> DMatrix<f64> {
        let mut rows =
            DMatrix::from_fn(count, size, |i, j| ((i * 37 + j * 101) as f64 * 0.618).sin());
        let sum = rows.column(0) + rows.column(1);
        rows.set_column(size - 1, &sum);
        rows
    }

    fn columns(rows: &DMatrix<f64>, first: usize, count: usize) -> Vec<Vec<f64>> {
        let part = rows.rows(first, count);
        part.column_iter().map(|column| column.iter().copied().collect()).collect()
    }

    #[test]
    fn blocks_of_rows_leave_the_singular_values_of_all() {
        let rows = rows(60, 7);
        let mut triangle = Triangle::new(7);
        for (first, count) in [(0, 3), (3, 20), (23, 37)] {
            triangle.take_columns(&mut columns(&rows, first, count));
        }
        let found = triangle.matrix();
        assert!((found.tr_mul(&found) - rows.tr_mul(&rows)).amax() < 1e-12);
        let (found, wanted) = (found.singular_values(), rows.singular_values());
        assert!((&found - wanted).amax() < 1e-13);
        // The dependent column leaves a zero to rounding, which the root of an eigenvalue of JᵀJ would not: 1e-8.
        assert!(found.min() < 1e-14);
    }

    #[test]
    fn a_column_of_zeros_stays_one() {
        let mut rows = rows(20, 4);
        rows.column_mut(2).fill(0.0);
        let mut triangle = Triangle::new(4);
        triangle.take_columns(&mut columns(&rows, 0, 20));
        let found = triangle.matrix();
        assert!(found.column(2).amax() == 0.0 && found.row(2).amax() < 1e-14);
    }
}
