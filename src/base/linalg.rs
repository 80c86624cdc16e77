//! Dense factorisations that nalgebra does not block: matrix products, on all cores, with the same bytes at any count.

use std::ops::Range;

use nalgebra::{DMatrix, DMatrixView, DMatrixViewMut, DVector, Dyn};
use rayon::prelude::*;

/// Width of a block: three of them fit into a core's fast cache.
const BLOCK: usize = 64;
const TILE: usize = 8;
/// Width of what is worked on at once: a product packs its factors anew, which a few columns would not repay.
const WIDE: usize = 4 * BLOCK;

/// The lower triangular L of `L Lᵀ = A`, with the inverses of its diagonal blocks.
#[derive(Debug, Clone)]
pub struct Cholesky {
    lower: DMatrix<f64>,
    diagonal_inverses: Vec<DMatrix<f64>>,
}

impl Cholesky {
    /// Factors a symmetric matrix, of which only the lower triangle is read; `None` if it is not positive definite.
    pub fn new(mut matrix: DMatrix<f64>) -> Option<Self> {
        let size = matrix.nrows();
        let mut diagonal_inverses = Vec::with_capacity(size.div_ceil(BLOCK));
        for first in (0..size).step_by(WIDE) {
            let width = WIDE.min(size - first);
            let end = first + width;
            let corner = matrix.view((first, first), (width, width)).into_owned();
            let corner = Self::of_few_blocks(corner)?;
            let panel = corner.panel(&matrix.view((end, first), (size - end, width)));
            matrix.view_mut((first, first), (width, width)).copy_from(&corner.lower);
            for (place, part) in panel.iter().enumerate() {
                matrix.view_mut((end + place * WIDE, first), part.shape()).copy_from(part);
            }
            subtract_outer(&mut matrix, end, &panel);
            diagonal_inverses.extend(corner.diagonal_inverses);
        }
        Some(Self { lower: matrix, diagonal_inverses })
    }

    fn of_few_blocks(mut matrix: DMatrix<f64>) -> Option<Self> {
        let size = matrix.nrows();
        let mut diagonal_inverses = Vec::new();
        for first in (0..size).step_by(BLOCK) {
            let width = BLOCK.min(size - first);
            let end = first + width;
            let block = small_cholesky(matrix.view((first, first), (width, width)).into_owned())?;
            let inverse = small_inverse(&block);
            let below = matrix.view((end, first), (size - end, width)) * turned(&inverse);
            matrix.view_mut((first, first), (width, width)).copy_from(&block);
            matrix.view_mut((end, first), (size - end, width)).copy_from(&below);
            let mut rest = matrix.view_mut((end, end), (size - end, size - end));
            rest.gemm(-1.0, &below, &turned(&below), 1.0);
            diagonal_inverses.push(inverse);
        }
        Some(Self { lower: matrix, diagonal_inverses })
    }

    /// `P L⁻ᵀ`, [`WIDE`] rows after each other.
    fn panel(&self, columns: &DMatrixView<'_, f64>) -> Vec<DMatrix<f64>> {
        let tops: Vec<usize> = (0..columns.nrows()).step_by(WIDE).collect();
        let of_rows = |&top: &usize| {
            let height = WIDE.min(columns.nrows() - top);
            self.behind(columns.rows(top, height).into_owned(), 0)
        };
        tops.par_iter().map(of_rows).collect()
    }

    /// The factorisation with this factor, of which the lower triangle is read; `None` unless the diagonal is positive.
    pub fn from_lower(lower: DMatrix<f64>) -> Option<Self> {
        let size = lower.nrows();
        if lower.diagonal().iter().any(|pivot| pivot.is_nan() || *pivot <= 0.0) {
            return None;
        }
        let block = |first: usize| {
            let width = BLOCK.min(size - first);
            small_inverse(&lower.view((first, first), (width, width)).into_owned())
        };
        Some(Self { diagonal_inverses: (0..size).step_by(BLOCK).map(block).collect(), lower })
    }

    /// The factor L; entries above its diagonal are meaningless.
    pub const fn lower(&self) -> &DMatrix<f64> {
        &self.lower
    }

    pub fn size(&self) -> usize {
        self.lower.nrows()
    }

    pub fn ln_determinant(&self) -> f64 {
        2.0 * (0..self.size()).map(|i| self.lower[(i, i)].ln()).sum::<f64>()
    }

    /// `A = L Lᵀ`, computed from the factor.
    pub fn product(&self) -> DMatrix<f64> {
        gram(&self.lower.lower_triangle().transpose().as_view())
    }

    pub fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let half = self.lower.solve_lower_triangular(right);
        self.backward(half.expect("a factor has no zero pivot"))
    }

    /// `L⁻¹ B`.
    pub fn forward(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        transposed(&self.behind(transposed(&right.as_view()), 0).as_view())
    }

    /// `P L⁻ᵀ`, L without its rows and columns before `first`, which is the first of a block.
    pub fn behind(&self, mut rows: DMatrix<f64>, first: usize) -> DMatrix<f64> {
        let size = self.size();
        for left in (first..size).step_by(WIDE) {
            let right = (left + WIDE).min(size);
            self.subtract_before(&mut rows, first, first..left, left..right);
            for column in (left..right).step_by(BLOCK) {
                let inverse = &self.diagonal_inverses[column / BLOCK];
                let width = inverse.nrows();
                self.subtract_before(&mut rows, first, left..column, column..column + width);
                let mut own = rows.columns_mut(column - first, width);
                own.copy_from(&(&own * turned(inverse)));
            }
        }
        rows
    }

    /// Subtracts from columns `own` of rows from column `first` on what those of `before`, divided, explain.
    fn subtract_before(
        &self,
        rows: &mut DMatrix<f64>,
        first: usize,
        before: Range<usize>,
        own: Range<usize>,
    ) {
        if before.is_empty() {
            return;
        }
        let place = (own.start, before.start);
        let lower = turned_block(&self.lower, place, (own.len(), before.len()));
        let (done, mut rest) = rows.columns_range_pair_mut(
            before.start - first..before.end - first,
            own.start - first..own.end - first,
        );
        rest.gemm(-1.0, &done, &lower, 1.0);
    }

    /// `L⁻ᵀ`, an upper triangle, for variances: the diagonal of `A⁻¹` is the squared norms of its rows.
    pub fn inverse_upper(&self) -> DMatrix<f64> {
        let size = self.size();
        let firsts: Vec<usize> = (0..size).step_by(WIDE).collect();
        let of_rows = |&first: &usize| {
            let mut identity = DMatrix::zeros(WIDE.min(size - first), size - first);
            identity.fill_diagonal(1.0);
            self.behind(identity, first)
        };
        let parts: Vec<_> = firsts.par_iter().map(of_rows).collect();
        let mut inverse = DMatrix::zeros(size, size);
        for (first, part) in firsts.into_iter().zip(parts) {
            inverse.view_mut((first, first), part.shape()).copy_from(&part);
        }
        inverse
    }

    pub fn backward(&self, mut solved: DVector<f64>) -> DVector<f64> {
        let size = self.size();
        for (block, inverse) in self.diagonal_inverses.iter().enumerate().rev() {
            let row = block * BLOCK;
            let width = inverse.nrows();
            let below = row + width;
            let later = solved.rows(below, size - below).into_owned();
            let mut rest = solved.rows(row, width).into_owned();
            rest.gemv_tr(-1.0, &self.lower.view((below, row), (size - below, width)), &later, 1.0);
            solved.rows_mut(row, width).copy_from(&inverse.tr_mul(&rest));
        }
        solved
    }
}

pub fn stacked<'m>(
    parts: impl Iterator<Item = &'m DMatrix<f64>> + Clone,
    columns: usize,
) -> DMatrix<f64> {
    let mut stacked = DMatrix::zeros(parts.clone().map(DMatrix::nrows).sum(), columns);
    let mut first = 0;
    for part in parts {
        let height = part.nrows();
        stacked.rows_mut(first, height).copy_from(part);
        first += height;
    }
    stacked
}

/// A matrix transposed where it stands: as the second factor of a product it is packed faster than with its entries in order. The first it
/// must not be: nalgebra 0.35 writes beyond a small product of one.
pub fn turned(matrix: &DMatrix<f64>) -> DMatrixView<'_, f64, Dyn, Dyn> {
    turned_block(matrix, (0, 0), matrix.shape())
}

fn turned_block(
    matrix: &DMatrix<f64>,
    (row, column): (usize, usize),
    (height, width): (usize, usize),
) -> DMatrixView<'_, f64, Dyn, Dyn> {
    let stride = matrix.nrows();
    let own = &matrix.as_slice()[stride * column + row..];
    let strides = (Dyn(stride), Dyn(1));
    DMatrixView::from_slice_with_strides_generic(own, Dyn(width), Dyn(height), strides.0, strides.1)
}

/// `A_22 −= P Pᵀ` on and below the diagonal and somewhat above, for P in parts of [`WIDE`] rows.
fn subtract_outer(matrix: &mut DMatrix<f64>, end: usize, panel: &[DMatrix<f64>]) {
    let size = matrix.nrows();
    if end >= size {
        return;
    }
    matrix.as_mut_slice()[end * size..].par_chunks_mut(size * WIDE).enumerate().for_each(
        |(block, columns)| {
            let mut view = DMatrixViewMut::from_slice(columns, size, columns.len() / size);
            let right = turned(&panel[block]);
            for (place, part) in panel.iter().enumerate().skip(block) {
                view.rows_mut(end + place * WIDE, part.nrows()).gemm(-1.0, part, &right, 1.0);
            }
        },
    );
}

/// Inverts a small definite matrix in place, without exchanging rows; `false`, and no inverse, where a pivot is zero or
/// not a number.
pub fn invert_small(matrix: &mut DMatrix<f64>) -> bool {
    let size = matrix.nrows();
    for pivot in 0..size {
        let own = matrix[(pivot, pivot)].recip();
        if !own.is_finite() {
            return false;
        }
        for column in (0..size).filter(|&column| column != pivot) {
            let share = matrix[(pivot, column)] * own;
            for row in 0..size {
                let taken = matrix[(row, pivot)] * share;
                matrix[(row, column)] -= taken;
            }
            matrix[(pivot, column)] = share;
        }
        matrix.column_mut(pivot).scale_mut(-own);
        matrix[(pivot, pivot)] = own;
    }
    true
}

fn small_cholesky(mut block: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size = block.nrows();
    for (pivot, column) in (0..size).zip(1..) {
        let (done, rest) = block.as_mut_slice().split_at_mut(column * size);
        let own = &mut done[pivot * size..];
        let root = own[pivot].sqrt();
        // The root of a negative number is none.
        if !root.is_finite() || root <= 0.0 {
            return None;
        }
        own[..pivot].fill(0.0);
        own[pivot] = root;
        own[column..].iter_mut().for_each(|entry| *entry /= root);
        for (row, later) in (column..size).zip(rest.chunks_exact_mut(size)) {
            subtract(&mut later[row..], own[row], &own[row..]);
        }
    }
    Some(block)
}

fn small_inverse(lower: &DMatrix<f64>) -> DMatrix<f64> {
    let size = lower.nrows();
    let mut inverse = DMatrix::zeros(size, size);
    for (first, solved) in inverse.as_mut_slice().chunks_exact_mut(size).enumerate() {
        solved[first] = 1.0;
        for (row, column) in lower.as_slice().chunks_exact(size).enumerate().skip(first) {
            let entry = solved[row] / column[row];
            solved[row] = entry;
            subtract(&mut solved[row + 1..], entry, &column[row + 1..]);
        }
    }
    inverse
}

fn subtract(from: &mut [f64], share: f64, taken: &[f64]) {
    for (own, taken) in from.iter_mut().zip(taken) {
        *own -= share * taken;
    }
}

/// `Σ_rows Hᵀ H` of stacked rows, lower and upper triangle, panels of columns in parallel.
pub fn gram(rows: &DMatrixView<'_, f64>) -> DMatrix<f64> {
    gram_of_columns(&transposed(rows))
}

/// [`gram`] of rows that stand as columns.
pub fn gram_of_columns(columns: &DMatrix<f64>) -> DMatrix<f64> {
    let size = columns.nrows();
    let mut gram = DMatrix::zeros(size, size);
    add_products(&mut gram, 1.0, columns, size, |_| 0);
    mirror(&mut gram);
    gram
}

/// Subtracts `Hᵀ H` of stacked rows from a symmetric matrix, of which only the lower triangle is then right.
pub fn subtract_gram(matrix: &mut DMatrix<f64>, rows: &DMatrix<f64>) {
    add_products(matrix, -1.0, &transposed(&rows.as_view()), rows.ncols(), |_| 0);
}

/// `U Uᵀ` of an upper triangular matrix, whose entries below the diagonal are zero.
pub fn gram_of_upper(upper: &DMatrix<f64>) -> DMatrix<f64> {
    let mut gram = DMatrix::zeros(upper.nrows(), upper.nrows());
    add_products(&mut gram, 1.0, upper, WIDE, |row| row);
    mirror(&mut gram);
    gram
}

/// Matrices of `rows` rows beside each other.
pub fn beside(rows: usize, parts: &[DMatrix<f64>]) -> DMatrix<f64> {
    let columns = parts.iter().map(DMatrix::ncols).sum();
    let entries: Vec<&[f64]> = parts.iter().map(DMatrix::as_slice).collect();
    DMatrix::from_vec(rows, columns, entries.concat())
}

/// The squared norm of each row.
pub fn row_squares(matrix: &DMatrix<f64>) -> DVector<f64> {
    let mut squares = DVector::zeros(matrix.nrows());
    for column in matrix.column_iter() {
        squares.zip_apply(&column, |sum, entry| *sum += entry * entry);
    }
    squares
}

/// Adds `share` times `H Hᵀ` to the lower triangle of `sum`, for H whose rows from one on have no entry before its
/// `first_column`; below the diagonal at most `tall` rows at once.
fn add_products(
    sum: &mut DMatrix<f64>,
    share: f64,
    rows: &DMatrix<f64>,
    tall: usize,
    first_column: impl Fn(usize) -> usize + Sync,
) {
    let (size, length) = rows.shape();
    if length == 0 {
        return;
    }
    sum.as_mut_slice().par_chunks_mut((size * WIDE).max(1)).enumerate().for_each(
        |(block, columns)| {
            let first = block * WIDE;
            let width = columns.len() / size;
            let mut view = DMatrixViewMut::from_slice(columns, size, width);
            let mut put = |left: Range<usize>, right: Range<usize>| {
                let own = (left.start, right.start - first);
                let from = first_column(left.start);
                let count = length - from;
                view.view_mut(own, (left.len(), right.len())).gemm(
                    share,
                    &rows.view((left.start, from), (left.len(), count)),
                    &turned_block(rows, (right.start, from), (right.len(), count)),
                    1.0,
                );
            };
            let end = first + width;
            for own in (first..end).step_by(BLOCK) {
                put(own..end, own..(own + BLOCK).min(end));
            }
            for below in (end..size).step_by(tall.max(1)) {
                put(below..(below + tall).min(size), first..end);
            }
        },
    );
}

/// The transpose, some columns at a time, so that a line of the cache is written at once.
pub fn transposed(matrix: &DMatrixView<'_, f64>) -> DMatrix<f64> {
    let mut transposed = DMatrix::default();
    transpose(matrix, &mut transposed);
    transposed
}

/// Writes the [`transposed`] matrix into another, whose memory is kept where it has the shape.
pub fn transpose(matrix: &DMatrixView<'_, f64>, transposed: &mut DMatrix<f64>) {
    let (height, width) = matrix.shape();
    if transposed.shape() != (width, height) {
        *transposed = DMatrix::zeros(width, height);
    }
    let into = transposed.as_mut_slice();
    for first in (0..width).step_by(TILE) {
        let count = TILE.min(width - first);
        // Of a last tile that is narrower the last column is read again.
        let columns: [_; TILE] =
            std::array::from_fn(|own| matrix.column(first + own.min(count - 1)));
        let columns = columns.each_ref().map(|own| &own.as_slice()[..height]);
        for row in 0..height {
            let into = &mut into[row * width + first..][..count];
            into.iter_mut().zip(columns).for_each(|(into, column)| *into = column[row]);
        }
    }
}

/// Copies the lower triangle into the upper one, block by block, so that what is read and written stays in the cache.
pub fn mirror(matrix: &mut DMatrix<f64>) {
    let size = matrix.nrows();
    for first in (0..size).step_by(BLOCK) {
        let width = BLOCK.min(size - first);
        let mut corner = matrix.view_mut((first, first), (width, width));
        corner.fill_upper_triangle_with_lower_triangle();
        for below in (first + width..size).step_by(BLOCK) {
            let height = BLOCK.min(size - below);
            let block = transposed(&matrix.view((below, first), (height, width)));
            matrix.view_mut((first, below), (width, height)).copy_from(&block);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A positive definite matrix of more than two blocks, without randomness.
    fn matrix(size: usize) -> DMatrix<f64> {
        let rows =
            DMatrix::from_fn(size + 10, size, |i, j| ((i * 37 + j * 101) as f64 * 0.618).sin());
        gram(&rows.as_view()) + DMatrix::identity(size, size)
    }

    #[test]
    fn gram_is_the_plain_product() {
        let rows = DMatrix::from_fn(70, 350, |i, j| ((i * 13 + j * 7) as f64).cos());
        assert!((gram(&rows.as_view()) - rows.transpose() * &rows).abs().max() < 1e-10);
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
            let inverse = ours.inverse_upper().transpose();
            assert!(
                (inverse.transpose() * &inverse * matrix - DMatrix::identity(size, size))
                    .abs()
                    .max()
                    < 1e-8
            );
        }
    }

    #[test]
    fn a_small_inverse_is_that_of_nalgebra() {
        for size in [1, 3, 6, 11] {
            let mut own = matrix(size);
            let theirs = own.clone().try_inverse().expect("positive definite");
            assert!(invert_small(&mut own));
            assert!((own - theirs).norm() < 1e-12, "size {size}");
        }
        assert!(!invert_small(&mut DMatrix::zeros(3, 3)));
    }

    #[test]
    fn products_of_a_triangle_are_the_plain_ones() {
        for size in [5, 64, 300, 600] {
            let lower = matrix(size).lower_triangle();
            let apart = gram_of_upper(&lower.transpose()) - gram(&lower.as_view());
            assert!(apart.norm() < 1e-9 * lower.norm_squared(), "size {size}");
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut matrix = matrix(100);
        matrix[(80, 80)] = -1.0;
        assert!(Cholesky::new(matrix).is_none());
    }
}
