//! Dense factorisations, blocked so that the work is matrix products, on all cores with the same bytes at any count.
//!
//! Only operations that the error model needs and that nalgebra does not block: Cholesky, and products with `L⁻¹`.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector};
use rayon::prelude::*;

/// Width of a block: three of them fit into a core's fast cache.
const BLOCK: usize = 64;
/// Width of what is worked on at once: a product packs its factors anew, which a few columns would not repay.
const WIDE: usize = 4 * BLOCK;

/// The lower triangular L of `L Lᵀ = A`, with the inverses of its diagonal blocks.
#[derive(Debug, Clone)]
pub struct Cholesky {
    lower: DMatrix<f64>,
    /// Inverse of each diagonal block, in order.
    diagonal_inverses: Vec<DMatrix<f64>>,
}

impl Cholesky {
    /// Factors a symmetric matrix, of which only the lower triangle is read; `None` if it is not positive definite.
    pub fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let size = matrix.nrows();
        let mut diagonal_inverses = Vec::with_capacity(size.div_ceil(BLOCK));
        for first in (0..size).step_by(BLOCK) {
            let end = (first + BLOCK).min(size);
            let width = end - first;
            let block = small_cholesky(matrix.view((first, first), (width, width)).into_owned())?;
            let inverse = small_inverse(&block);
            matrix
                .view_mut((first, first), (width, width))
                .copy_from(&block);
            let panel = matrix.view((end, first), (size - end, width)) * inverse.transpose();
            matrix
                .view_mut((end, first), (size - end, width))
                .copy_from(&panel);
            subtract_outer(&mut matrix, end, &panel);
            diagonal_inverses.push(inverse);
        }
        Some(Self {
            lower: matrix,
            diagonal_inverses,
        })
    }

    /// The factorisation whose factor is `lower`, as [`Self::lower`] returns it; only the lower triangle is read. `None`
    /// unless the diagonal is positive.
    pub fn from_lower(lower: DMatrix<f64>) -> Option<Self> {
        let size = lower.nrows();
        if lower
            .diagonal()
            .iter()
            .any(|pivot| pivot.is_nan() || *pivot <= 0.0)
        {
            return None;
        }
        let block = |first: usize| {
            let width = BLOCK.min(size - first);
            small_inverse(&lower.view((first, first), (width, width)).into_owned())
        };
        Some(Self {
            diagonal_inverses: (0..size).step_by(BLOCK).map(block).collect(),
            lower,
        })
    }

    /// The factor L; entries above its diagonal are meaningless.
    pub const fn lower(&self) -> &DMatrix<f64> {
        &self.lower
    }

    /// Number of rows, which is that of columns.
    pub fn size(&self) -> usize {
        self.lower.nrows()
    }

    /// `ln |A|`.
    pub fn ln_determinant(&self) -> f64 {
        2.0 * (0..self.size())
            .map(|i| self.lower[(i, i)].ln())
            .sum::<f64>()
    }

    /// `A = L Lᵀ`, computed from the factor.
    pub fn product(&self) -> DMatrix<f64> {
        gram(&self.lower.lower_triangle().transpose().as_view())
    }

    /// `A⁻¹ b`.
    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let columns = DMatrix::from_column_slice(right.len(), 1, right.as_slice());
        let half = self.forward(&columns, 0);
        self.backward(half.column(0).into_owned())
    }

    /// `L⁻¹ B`.
    pub fn forward(&self, right: &DMatrix<f64>, first: usize) -> DMatrix<f64> {
        let size = self.size();
        let mut solved = DMatrix::zeros(size - first, right.ncols());
        for top in (first..size).step_by(WIDE) {
            let height = WIDE.min(size - top);
            let mut rest = right.rows(top - first, height).into_owned();
            let before = self.lower.view((top, first), (height, top - first));
            rest.gemm(-1.0, &before, &solved.rows(0, top - first), 1.0);
            for row in (top..top + height).step_by(BLOCK) {
                let inverse = &self.diagonal_inverses[row / BLOCK];
                let width = inverse.nrows();
                let mut own = rest.rows(row - top, width).into_owned();
                let before = self.lower.view((row, top), (width, row - top));
                let done = solved.rows(top - first, row - top);
                own.gemm(-1.0, &before, &done, 1.0);
                solved
                    .rows_mut(row - first, width)
                    .copy_from(&(inverse * own));
            }
        }
        solved
    }

    /// `L⁻¹`, for variances: the diagonal of `A⁻¹` is the squared norms of its columns.
    pub fn inverse_lower(&self) -> DMatrix<f64> {
        let size = self.size();
        let mut inverse = DMatrix::zeros(size, size);
        inverse
            .as_mut_slice()
            .par_chunks_mut(size * WIDE)
            .enumerate()
            .for_each(|(block, columns)| {
                let first = block * WIDE;
                let width = columns.len() / size;
                let mut right = DMatrix::zeros(size - first, width);
                right.fill_diagonal(1.0);
                let solved = self.forward(&right, first);
                let mut view = DMatrixViewMut::from_slice(columns, size, width);
                view.rows_mut(first, size - first).copy_from(&solved);
            });
        inverse
    }

    /// `L⁻ᵀ b`.
    pub fn backward(&self, mut solved: DVector<f64>) -> DVector<f64> {
        let size = self.size();
        for (block, inverse) in self.diagonal_inverses.iter().enumerate().rev() {
            let row = block * BLOCK;
            let width = inverse.nrows();
            let below = row + width;
            let later = solved.rows(below, size - below).into_owned();
            let mut rest = solved.rows(row, width).into_owned();
            rest.gemv_tr(
                -1.0,
                &self.lower.view((below, row), (size - below, width)),
                &later,
                1.0,
            );
            solved
                .rows_mut(row, width)
                .copy_from(&inverse.tr_mul(&rest));
        }
        solved
    }
}

/// Matrices of `columns` columns, one below the other.
pub fn stacked<'m>(
    parts: impl Iterator<Item = &'m DMatrix<f64>> + Clone,
    columns: usize,
) -> DMatrix<f64> {
    let count = parts.clone().map(DMatrix::nrows).sum();
    let mut stacked = DMatrix::zeros(count, columns);
    let mut first = 0;
    for part in parts {
        let height = part.nrows();
        stacked.rows_mut(first, height).copy_from(part);
        first += height;
    }
    stacked
}

/// `A_22 −= P Pᵀ` on and below the diagonal and somewhat above, in panels of columns that start at whole blocks.
fn subtract_outer(matrix: &mut DMatrix<f64>, end: usize, panel: &DMatrix<f64>) {
    let size = matrix.nrows();
    if end >= size {
        return;
    }
    let transposed = panel.transpose();
    matrix.as_mut_slice()[end * size..]
        .par_chunks_mut(size * WIDE)
        .enumerate()
        .for_each(|(block, columns)| {
            let width = columns.len() / size;
            let first = block * WIDE;
            let below = size - end - first;
            let mut view = DMatrixViewMut::from_slice(columns, size, width);
            let right = transposed.columns(first, width);
            view.rows_mut(end + first, below)
                .gemm(-1.0, &panel.rows(first, below), &right, 1.0);
        });
}

/// The lower Cholesky factor of one block, zeros above the diagonal.
fn small_cholesky(mut block: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size = block.nrows();
    for j in 0..size {
        let mut pivot = block[(j, j)];
        for k in 0..j {
            pivot -= block[(j, k)] * block[(j, k)];
        }
        if !pivot.is_finite() || pivot <= 0.0 {
            return None;
        }
        let pivot = pivot.sqrt();
        block[(j, j)] = pivot;
        for i in j + 1..size {
            let dot: f64 = (0..j).map(|k| block[(i, k)] * block[(j, k)]).sum();
            block[(i, j)] = (block[(i, j)] - dot) / pivot;
            block[(j, i)] = 0.0;
        }
    }
    Some(block)
}

fn small_inverse(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let size = lower.nrows();
    let mut inverse = DMatrix::zeros(size, size);
    for column in 0..size {
        inverse[(column, column)] = lower[(column, column)].recip();
        for row in column + 1..size {
            let dot: f64 = (column..row)
                .map(|k| lower[(row, k)] * inverse[(k, column)])
                .sum();
            inverse[(row, column)] = -dot / lower[(row, row)];
        }
    }
    inverse
}

/// `Σ_rows Hᵀ H` of stacked rows, lower and upper triangle, panels of columns in parallel.
pub fn gram(rows: &DMatrixView<'_, f64>) -> DMatrix<f64> {
    let size = rows.ncols();
    let transposed = rows.transpose();
    let mut gram = DMatrix::zeros(size, size);
    gram.as_mut_slice()
        .par_chunks_mut((size * WIDE).max(1))
        .enumerate()
        .for_each(|(block, columns)| {
            let first = block * WIDE;
            let width = columns.len() / size;
            let mut view = DMatrixViewMut::from_slice(columns, size, width);
            let mut put = |left: Range<usize>, right: Range<usize>| {
                let own = (left.start, right.start - first);
                view.view_mut(own, (left.len(), right.len())).gemm(
                    1.0,
                    &transposed.rows(left.start, left.len()),
                    &rows.columns(right.start, right.len()),
                    0.0,
                );
            };
            let end = first + width;
            for own in (first..end).step_by(BLOCK) {
                put(own..end, own..(own + BLOCK).min(end));
            }
            if end < size {
                put(end..size, first..end);
            }
        });
    gram.fill_upper_triangle_with_lower_triangle();
    gram
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite matrix of more than two blocks, without randomness.
    fn matrix(size: usize) -> DMatrix<f64> {
        let rows = DMatrix::from_fn(size + 10, size, |i, j| {
            ((i * 37 + j * 101) as f64 * 0.618).sin()
        });
        gram(&rows.as_view()) + DMatrix::identity(size, size)
    }

    #[test]
    fn gram_is_the_plain_product() {
        let rows = DMatrix::from_fn(70, 350, |i, j| ((i * 13 + j * 7) as f64).cos());
        assert!(
            (gram(&rows.as_view()) - rows.transpose() * &rows)
                .abs()
                .max()
                < 1e-10
        );
    }

    #[test]
    fn factor_solves_as_nalgebra_does() {
        for size in [1, 63, 64, 65, 200, 257, 600] {
            let matrix = matrix(size);
            let right = DVector::from_fn(size, |i, _| (i as f64).sin());
            let ours = Cholesky::new(matrix.clone()).expect("positive definite");
            let theirs = matrix.clone().cholesky().expect("positive definite");
            let apart = (ours.solve(&right) - theirs.solve(&right)).norm();
            assert!(apart < 1e-9 * (1.0 + right.norm()), "size {size}: {apart}");
            let ln_determinant = 2.0 * theirs.l().diagonal().map(f64::ln).sum();
            assert!((ours.ln_determinant() - ln_determinant).abs() < 1e-9 * size as f64);
            let inverse = ours.inverse_lower();
            assert!(
                (inverse.transpose() * &inverse * matrix - DMatrix::identity(size, size))
                    .abs()
                    .max()
                    < 1e-8
            );
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut matrix = matrix(100);
        matrix[(80, 80)] = -1.0;
        assert!(Cholesky::new(matrix).is_none());
    }
}
