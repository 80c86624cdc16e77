//! The regression where there are fewer rows than columns: the same posterior by a factor of the size of the rows.
//!
//! With `W` the whitened rows and `S = W √v`, the values have the covariance `K = I + S Sᵀ = L Lᵀ`. What is asked of the
//! columns' information `M = I + SᵀS` follows from it (the identities are Woodbury's):
//! - mean `u = Sᵀ K⁻¹ y`, and `ln |M| = ln |K|`;
//! - determined shares `diag (I − M⁻¹)`: the diagonal of `Sᵀ K⁻¹ S`;
//! - a square root of `M⁻¹ = T Tᵀ`: `T = I − Sᵀ L⁻ᵀ (L + I)⁻¹ S` (Andrews 1968), in which nothing cancels;
//! - what the model leaves open of its own rows: `I − S M⁻¹ Sᵀ = K⁻¹`.
//!
//! Most columns are shapes of a joint: what they say follows from products over stations instead of rows ([`ByMotion`]).

mod by_motion;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::{Posterior, Root};
use crate::linalg::{Cholesky, gram, gram_of_columns, transposed};
pub use by_motion::{ByMotion, Shapes};

/// Combinations of columns from which on products with a transpose and an inverse repay what these cost: nalgebra multiplies by a
/// transpose, and solves, one column at a time.
const WIDE: usize = 64;

#[derive(Debug, Clone)]
pub struct FewRows {
    /// `Wᵀ`: a row of the regression in each column.
    pub transposed: DMatrix<f64>,
    /// The columns of `W` by what they move.
    pub columns: Arc<ByMotion>,
    pub values: DVector<f64>,
    /// `Σ ln |N|`.
    pub ln_noise: f64,
}

#[derive(Debug, Clone)]
pub struct FewRoot {
    /// `Sᵀ`: a row of the regression in each column.
    transposed: DMatrix<f64>,
    columns: Arc<ByMotion>,
    pub(super) factor: Cholesky,
}

impl FewRows {
    /// No rows: the posterior is the prior, and takes no room.
    pub fn none(columns: usize) -> Self {
        Self {
            transposed: DMatrix::zeros(columns, 0),
            columns: Arc::new(ByMotion::plain(columns)),
            values: DVector::zeros(0),
            ln_noise: 0.0,
        }
    }

    /// The posterior at prior standard deviations `√v`; `None` if rounding made K indefinite.
    pub(super) fn posterior_at(&self, scale: DVector<f64>) -> Option<Posterior> {
        let mut transposed = self.transposed.clone();
        for mut row in transposed.column_iter_mut() {
            row.component_mul_assign(&scale);
        }
        let mut covariance = self.columns.product(&transposed, &scale);
        (0..self.values.len()).for_each(|row| covariance[(row, row)] += 1.0);
        let factor = Cholesky::new(covariance)?;
        let explained = factor.solve(&self.values);
        let quadratic = self.values.dot(&explained);
        Some(Posterior {
            whitened: &transposed * explained,
            log_evidence: -0.5 * (quadratic + factor.ln_determinant() + self.ln_noise),
            root: Root::Rows(FewRoot { transposed, columns: Arc::clone(&self.columns), factor }),
            scale,
        })
    }
}

impl FewRoot {
    /// `1 − Σ_kk/v_k` of each column, at the prior's standard deviations in its rows.
    pub(super) fn determined(&self, scale: &DVector<f64>, inverse: &DMatrix<f64>) -> DVector<f64> {
        self.columns.squares(&self.transposed, scale, &self.factor, inverse)
    }

    /// `Tᵀ B`.
    pub(super) fn half(&self, right: DMatrix<f64>) -> DMatrix<f64> {
        let shown = if right.ncols() >= WIDE {
            transposed(&self.transposed.as_view()) * &right
        } else {
            self.transposed.tr_mul(&right)
        };
        self.less_explained(right, &shown)
    }

    /// `Tᵀ` at some columns.
    pub(super) fn half_of(&self, columns: &[usize]) -> DMatrix<f64> {
        let shown = self.transposed.select_rows(columns).transpose();
        self.less_explained(super::chosen(self.transposed.nrows(), columns), &shown)
    }

    /// `Tᵀ B` from `B` and `S B`.
    fn less_explained(&self, right: DMatrix<f64>, shown: &DMatrix<f64>) -> DMatrix<f64> {
        let is_wide = right.ncols() >= WIDE;
        let mut shown = self.factor.forward(shown);
        let mut raised = self.factor.lower().clone();
        (0..raised.nrows()).for_each(|row| raised[(row, row)] += 1.0);
        if is_wide {
            let raised = Cholesky::from_lower(raised).expect("a factor's diagonal is positive");
            shown = raised.inverse_upper() * shown;
        } else {
            let solved = raised.tr_solve_lower_triangular_mut(&mut shown);
            assert!(solved, "a factor's diagonal is positive");
        }
        let mut half = right;
        half.gemm(-1.0, &self.transposed, &shown, 1.0);
        half
    }

    /// The block of `M⁻¹` of some columns: `I − ZᵀZ` with `Z = L⁻¹ S`.
    pub(super) fn covariance_of(&self, columns: &[usize]) -> DMatrix<f64> {
        let explained = self.factor.behind(self.transposed.select_rows(columns), 0);
        DMatrix::identity(columns.len(), columns.len()) - gram_of_columns(&explained)
    }

    /// Cholesky factor of M. Rounding cannot make `S` below the identity rank-deficient, so where it makes their sum of squares
    /// indefinite the factor follows from the rows themselves, orthogonalised.
    pub(super) fn of_columns(&self) -> Cholesky {
        let rows = self.transposed.transpose();
        let mut information = gram(&rows.as_view());
        super::add_one(&mut information);
        Cholesky::new(information).unwrap_or_else(|| orthogonalised(&rows))
    }
}

/// Cholesky factor of `I + SᵀS` from the triangular factor of `S` below the identity.
fn orthogonalised(rows: &DMatrix<f64>) -> Cholesky {
    let (count, size) = rows.shape();
    let mut stacked = DMatrix::zeros(size + count, size);
    stacked.fill_diagonal(1.0);
    stacked.rows_mut(size, count).copy_from(rows);
    let mut lower = stacked.qr().unpack_r().transpose();
    for mut column in lower.column_iter_mut() {
        let largest = column.iter().position(|value| *value != 0.0);
        if largest.is_some_and(|pivot| column[pivot] < 0.0) {
            column.neg_mut();
        }
    }
    Cholesky::from_lower(lower).expect("rows below an identity have full rank")
}

#[cfg(test)]
mod tests {
    use super::super::Sums;
    use super::*;

    /// Rows and values without a pattern; the second column of each three is far wider than the others.
    fn few(rows: usize, columns: usize) -> (FewRows, DVector<f64>) {
        let transposed = DMatrix::from_fn(columns, rows, |column, row| {
            ((7 * row + 3 * column) as f64 * 0.37).sin()
        });
        let values = DVector::from_fn(rows, |row, _| (row as f64).cos());
        let scale = DVector::from_fn(columns, |column, _| [0.5, 300.0, 0.0][column % 3]);
        let few = FewRows {
            columns: Arc::new(ByMotion::plain(columns)),
            transposed,
            values,
            ln_noise: 0.7,
        };
        (few, scale)
    }

    /// Rows as of [`few`]: three for each station, and a last one that is of none. Of every five columns the first is a shape of one joint
    /// and the fourth of another.
    fn by_motion(stations: usize, columns: usize) -> (FewRows, DVector<f64>) {
        let (mut few, scale) = few(3 * stations + 1, columns);
        let joint = |joint: usize| {
            let own: Vec<usize> = (0..columns).filter(|own| own % 5 == joint).collect();
            let number = |own: usize, station: usize| ((own * 11 + station * 5) as f64).cos();
            let mut shapes = Shapes {
                numbers: DMatrix::from_fn(own.len(), stations, number),
                motions: DVector::from_fn(3 * stations + 1, |row, _| {
                    ((row * 3 + joint) as f64 * 0.7).sin()
                }),
                columns: own,
            };
            shapes.motions[3 * stations] = 0.0;
            shapes
        };
        let joints = vec![joint(0), joint(3)];
        for own in &joints {
            for (place, &column) in own.columns.iter().enumerate() {
                for row in 0..=3 * stations {
                    let number = own.numbers[(place, (row / 3).min(stations - 1))];
                    few.transposed[(column, row)] = own.motions[row] * number;
                }
            }
        }
        few.columns = Arc::new(ByMotion {
            plain: (0..columns).filter(|own| ![0, 3].contains(&(own % 5))).collect(),
            stations: (0..stations).map(|own| 3 * own..3 * own + 3).collect(),
            joints,
        });
        (few, scale)
    }

    #[test]
    fn products_over_stations_are_those_over_rows() {
        let (few, scale) = by_motion(12, 70);
        both(&few, &scale);
    }

    /// The posterior of rows by themselves and by their sums, which say the same.
    fn both(few: &FewRows, scale: &DVector<f64>) -> [Posterior; 2] {
        let size = few.transposed.shape();
        let by_rows = few.posterior_at(scale.clone()).expect("positive definite");
        let by_columns = summed(few, scale);
        let apart = (by_rows.mean() - by_columns.mean()).amax();
        assert!(apart < 1e-7, "{size:?}: means {apart}");
        let determined = |own: &Posterior| own.determined(&own.inverse());
        let apart = (determined(&by_rows) - determined(&by_columns)).amax();
        assert!(apart < 1e-8, "{size:?}: determined {apart}");
        let apart = by_rows.log_evidence - by_columns.log_evidence;
        assert!(apart.abs() < 1e-6, "{size:?}: evidence {apart}");
        [by_rows, by_columns]
    }

    /// The posterior of the same rows, by their sums.
    fn summed(few: &FewRows, scale: &DVector<f64>) -> Posterior {
        let sums = Sums::new(&few.transposed.transpose(), &few.values, few.ln_noise);
        sums.posterior_at(scale.clone()).expect("positive definite")
    }

    #[test]
    fn a_factor_of_rows_gives_what_a_factor_of_columns_gives() {
        for (rows, columns) in [(1, 3), (7, 30), (70, 150)] {
            let (few, scale) = few(rows, columns);
            let [by_rows, by_columns] = both(&few, &scale);
            for count in [4, WIDE + 3] {
                let shown =
                    DMatrix::from_fn(count, columns, |row, column| ((row + column) as f64).sin());
                let covariance = |posterior: &Posterior| {
                    let half = posterior.half(&shown);
                    half.tr_mul(&half)
                };
                let wanted = covariance(&by_columns);
                let apart = (covariance(&by_rows) - &wanted).amax() / wanted.amax();
                // The squared width of the widest column over the noise, times the rows, is 6e6: as many digits are lost.
                assert!(apart < 1e-7, "{rows} × {columns}: covariance {apart}");
            }
            for chosen in [vec![0], vec![1, 2]] {
                let gain = |posterior: &Posterior| posterior.gain_of(&chosen).expect("definite");
                let apart = gain(&by_rows) - gain(&by_columns);
                assert!(apart.abs() < 1e-6 * (1.0 + gain(&by_columns).abs()), "gain {apart}");
            }
            let factor = (by_rows.factor().lower().lower_triangle()
                - by_columns.factor().lower().lower_triangle())
            .amax();
            assert!(factor < 1e-7, "{rows} × {columns}: factor {factor}");
        }
    }

    #[test]
    fn what_is_open_of_a_row_is_its_noise_less_what_the_columns_explain() {
        let (few, scale) = few(9, 40);
        let posterior = few.posterior_at(scale).expect("positive definite");
        let half = posterior.half(&few.transposed.transpose());
        let open = posterior.open_of_rows(&posterior.inverse()).expect("few rows");
        let explained = DMatrix::identity(9, 9) - open.tr_mul(&open);
        assert!((explained - half.tr_mul(&half)).amax() < 1e-8);
    }

    #[test]
    fn orthogonalised_rows_give_the_factor_of_their_sum() {
        let rows = DMatrix::from_fn(5, 12, |row, column| ((row * 5 + column) as f64).sin());
        let found = orthogonalised(&rows).product();
        let wanted = rows.tr_mul(&rows) + DMatrix::identity(12, 12);
        assert!((found - wanted).amax() < 1e-12);
    }

    #[test]
    fn a_factor_is_found_where_rounding_makes_the_sum_indefinite() {
        let rows = DMatrix::from_fn(3, 8, |row, column| 1e10 * ((row * 3 + column) as f64).cos());
        let mut information = gram(&rows.as_view());
        (0..8).for_each(|column| information[(column, column)] += 1.0);
        assert!(Cholesky::new(information).is_none(), "an easier case");
        let root = FewRoot {
            transposed: rows.transpose(),
            columns: Arc::new(ByMotion::plain(8)),
            factor: Cholesky::new(DMatrix::identity(3, 3)).expect("positive"),
        };
        let diagonal = root.of_columns().lower().diagonal();
        assert!(diagonal.iter().all(|pivot| *pivot > 0.5), "{diagonal}");
    }
}
