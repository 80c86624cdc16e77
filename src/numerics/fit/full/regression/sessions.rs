//! The regression of a pool: each session's own columns are eliminated by themselves, so the cost is linear in sessions.
//!
//! With `u_s` the whitened coefficients of session s alone and `u_c` the shared ones, the information of all is an arrow:
//!
//! ```text
//!     ⎡ D_1           B_1 ⎤          D_s = L_s L_sᵀ          W_s = L_s⁻¹ B_s
//! M = ⎢      ⋱         ⋮  ⎥          S   = C − Σ_s W_sᵀ W_s = L L ᵀ            (Schur's complement)
//!     ⎢          D_n  B_n ⎥
//!     ⎣ B_1ᵀ  ⋯  B_nᵀ  C  ⎦          ln|M| = Σ_s ln|D_s| + ln|S|
//! ```
//!
//! and everything follows from `L_s`, `W_s` and `L`, session by session: nothing is approximated. Sums are taken in the order of
//! sessions, whatever the number of threads.

use nalgebra::{DMatrix, DMatrixView, DVector};
use rayon::prelude::*;

use super::{Inverse, Posterior, Root, Sums, add_one};
use crate::fit::full::partition::Partition;
use crate::fit::full::shapes::{Run, runs};
use crate::linalg::{
    Cholesky, gram, gram_of_upper, mirror, row_squares, subtract_gram, transposed,
};

#[derive(Debug, Clone)]
pub struct SessionSums {
    pub partition: Partition,
    pub own: Vec<OwnSums>,
    /// What all say of the shared columns, with squares, rows and noise of all.
    pub common: Sums,
}

#[derive(Debug, Clone)]
pub struct OwnSums {
    /// `Φ_sᵀ N⁻¹ Φ_s`.
    pub information: DMatrix<f64>,
    /// `Φ_sᵀ N⁻¹ Φ_c`.
    pub across: DMatrix<f64>,
    /// `Φ_sᵀ N⁻¹ y`.
    pub moment: DVector<f64>,
}

/// Sums that rows of one session are added to: of symmetric matrices the lower triangle.
#[derive(Debug)]
pub struct Adding<'s> {
    /// The session's own columns come first.
    own: &'s mut OwnSums,
    common: &'s mut Sums,
}

#[derive(Debug, Clone)]
pub struct Arrow {
    pub(in crate::fit::full) partition: Partition,
    pub(in crate::fit::full) own: Vec<OwnRoot>,
    pub(in crate::fit::full) common: Cholesky,
}

#[derive(Debug, Clone)]
pub struct OwnRoot {
    pub(in crate::fit::full) factor: Cholesky,
    pub(in crate::fit::full) across: DMatrix<f64>,
}

impl SessionSums {
    /// The sums of no rows.
    pub fn zero(partition: &Partition) -> Self {
        let shared = partition.common.len();
        let own = partition.own.iter().map(|own| OwnSums {
            information: DMatrix::zeros(own.len(), own.len()),
            across: DMatrix::zeros(own.len(), shared),
            moment: DVector::zeros(own.len()),
        });
        Self { own: own.collect(), common: Sums::zero(shared), partition: partition.clone() }
    }

    pub fn adding(&mut self, session: usize) -> Adding<'_> {
        Adding { own: &mut self.own[session], common: &mut self.common }
    }

    /// The sums without those of some of their rows: of symmetric matrices the lower triangles.
    #[must_use]
    pub fn without(&self, some: &Self) -> Self {
        let own = self.own.iter().zip(&some.own).map(|(own, some)| OwnSums {
            information: &own.information - &some.information,
            across: &own.across - &some.across,
            moment: &own.moment - &some.moment,
        });
        let common = Sums {
            information: &self.common.information - &some.common.information,
            moment: &self.common.moment - &some.common.moment,
            square: self.common.square - some.common.square,
            ln_noise: self.common.ln_noise - some.common.ln_noise,
        };
        Self { own: own.collect(), common, partition: self.partition.clone() }
    }

    pub fn mirror(&mut self) {
        for own in &mut self.own {
            mirror(&mut own.information);
        }
        mirror(&mut self.common.information);
    }

    /// Adds the sums of rows of one session, over its own columns, then the shared ones: the lower triangles.
    pub fn add(&mut self, session: usize, sums: &Sums) {
        let all: Vec<usize> = (0..sums.moment.len()).collect();
        let columns = runs(&all, self.own[session].moment.len());
        let mut adding = self.adding(session);
        adding.block(&columns, &columns, &sums.information);
        adding.values(&columns, &sums.moment);
        adding.squares(sums.square, sums.ln_noise);
    }

    /// The posterior at prior standard deviations `√v`; `None` if rounding made M indefinite.
    pub(super) fn posterior_at(&self, scale: DVector<f64>) -> Option<Posterior> {
        let of_shared = scale.select_rows(&self.partition.common);
        let places = self.own.par_iter().zip(&self.partition.own);
        let own = places.map(|(sums, own)| sums.root(&scale.select_rows(own), &of_shared));
        let own = own.collect::<Option<Vec<OwnRoot>>>()?;
        let mut matrix = self.common.scaled(&of_shared);
        add_one(&mut matrix);
        for root in &own {
            subtract_gram(&mut matrix, &root.across);
        }
        let arrow =
            Arrow { common: Cholesky::new(matrix)?, own, partition: self.partition.clone() };
        let right = self.moment().component_mul(&scale);
        let whitened = arrow.solve(&right);
        let quadratic = self.common.square - right.dot(&whitened);
        Some(Posterior {
            log_evidence: -0.5 * (quadratic + arrow.ln_determinant() + self.common.ln_noise),
            whitened,
            scale,
            root: Root::Sessions(arrow),
        })
    }

    fn moment(&self) -> DVector<f64> {
        let own: Vec<_> = self.own.iter().map(|own| own.moment.clone()).collect();
        self.partition.gathered(&own, &self.common.moment)
    }
}

impl Adding<'_> {
    /// Adds the products of these rows and columns, from those of their shapes. Of two lists each product is of either order, of a list
    /// with itself of both.
    pub fn block(&mut self, rows: &[Run], columns: &[Run], products: &DMatrix<f64>) {
        let is_one = rows == columns;
        for column in columns {
            for row in rows {
                if is_one && row.place < column.place {
                    continue;
                }
                let own = products.view((row.shape, column.shape), (row.count, column.count));
                self.run(row, column, &own);
            }
        }
    }

    fn run(&mut self, row: &Run, column: &Run, products: &DMatrixView<'_, f64>) {
        let share = row.share * column.share;
        let first_shared = self.first_shared();
        let is_own = |run: &Run| run.place < first_shared;
        let is_turned = match (is_own(row), is_own(column)) {
            (true, false) => false,
            (false, true) => true,
            // The lower triangle.
            _ => row.place < column.place,
        };
        let (down, across) = if is_turned { (column, row) } else { (row, column) };
        let (into, place) = if is_own(across) {
            (&mut self.own.information, (down.place, across.place))
        } else if is_own(down) {
            (&mut self.own.across, (down.place, across.place - first_shared))
        } else {
            let [down, across] = [down, across].map(|run| run.place - first_shared);
            (&mut self.common.information, (down, across))
        };
        let mut add = |products: &DMatrixView<'_, f64>| {
            let mut into = into.view_mut(place, products.shape());
            into.zip_apply(products, |entry, product| *entry += share * product);
        };
        if is_turned {
            add(&transposed(products).as_view());
        } else {
            add(products);
        }
    }

    /// Place of the first column that all sessions share.
    fn first_shared(&self) -> usize {
        self.own.moment.len()
    }

    pub fn values(&mut self, columns: &[Run], moments: &DVector<f64>) {
        let first_shared = self.first_shared();
        for run in columns {
            let (into, place) = if run.place < first_shared {
                (&mut self.own.moment, run.place)
            } else {
                (&mut self.common.moment, run.place - first_shared)
            };
            let moments = moments.rows(run.shape, run.count);
            into.rows_mut(place, run.count).axpy(run.share, &moments, 1.0);
        }
    }

    /// Adds what is of no column.
    pub fn squares(&mut self, square: f64, ln_noise: f64) {
        self.common.square += square;
        self.common.ln_noise += ln_noise;
    }
}

impl OwnSums {
    /// The factor at prior standard deviations of own and shared columns.
    fn root(&self, own: &DVector<f64>, shared: &DVector<f64>) -> Option<OwnRoot> {
        let size = own.len();
        let mut matrix = DMatrix::from_fn(size, size, |row, column| {
            own[row] * self.information[(row, column)] * own[column]
        });
        add_one(&mut matrix);
        let factor = Cholesky::new(matrix)?;
        let mut across = self.across.clone();
        for (mut column, shared) in across.column_iter_mut().zip(shared) {
            column.component_mul_assign(own);
            column *= *shared;
        }
        let across = factor.forward(&across);
        Some(OwnRoot { factor, across })
    }
}

impl Partition {
    /// One vector in the order of the model from those of the sessions and the shared one.
    fn gathered(&self, own: &[DVector<f64>], shared: &DVector<f64>) -> DVector<f64> {
        let mut all = DVector::zeros(self.size());
        for (places, values) in self.own.iter().zip(own).chain([(&self.common, shared)]) {
            for (&place, value) in places.iter().zip(values) {
                all[place] = *value;
            }
        }
        all
    }
}

impl Arrow {
    pub(super) fn ln_determinant(&self) -> f64 {
        let own = self.own.iter().map(|own| own.factor.ln_determinant());
        own.sum::<f64>() + self.common.ln_determinant()
    }

    /// `M⁻¹ b`, in the order of the model.
    fn solve(&self, right: &DVector<f64>) -> DVector<f64> {
        let half = self.half(&DMatrix::from_column_slice(right.len(), 1, right.as_slice()));
        self.backward(&half.column(0).into_owned())
    }

    /// `Rᵀ B` with `R Rᵀ = M⁻¹`: of each session `L_s⁻¹ B_s`, in the places of its columns, then of the shared ones.
    pub(super) fn half(&self, right: &DMatrix<f64>) -> DMatrix<f64> {
        let mut half = DMatrix::zeros(right.nrows(), right.ncols());
        let mut shared = right.select_rows(&self.partition.common);
        for (root, places) in self.own.iter().zip(&self.partition.own) {
            let own = right.select_rows(places);
            // A prediction in one session has no columns of another.
            if own.iter().all(|entry| *entry == 0.0) {
                continue;
            }
            let own = root.factor.forward(&own);
            shared.gemm(-1.0, &transposed(&root.across.as_view()), &own, 1.0);
            put_rows(&mut half, places, &own);
        }
        put_rows(&mut half, &self.partition.common, &self.common.forward(&shared));
        half
    }

    /// `R b`.
    pub(in crate::fit::full) fn backward(&self, half: &DVector<f64>) -> DVector<f64> {
        let shared = self.common.backward(half.select_rows(&self.partition.common));
        let own = self.own.iter().zip(&self.partition.own).map(|(root, places)| {
            root.factor.backward(half.select_rows(places) - &root.across * &shared)
        });
        let own: Vec<DVector<f64>> = own.collect();
        self.partition.gathered(&own, &shared)
    }

    /// `Rᵀ` at some columns, where `R Rᵀ = M⁻¹`.
    pub(super) fn half_of(&self, columns: &[usize]) -> DMatrix<f64> {
        self.half(&super::chosen(self.partition.size(), columns))
    }

    /// `1 − Σ_kk/v_k` of each column: with `K = L_s⁻¹` the variances of a session are those of `Kᵀ K + Kᵀ W S⁻¹ Wᵀ K`.
    pub(super) fn determined(&self, inverse: &Inverse) -> DVector<f64> {
        let own = self.own.par_iter().zip(&inverse.own).map(|(root, inverse)| {
            let shared = self.common.behind(inverse * &root.across, 0);
            (row_squares(inverse) + row_squares(&shared)).map(|own| 1.0 - own)
        });
        let own: Vec<DVector<f64>> = own.collect();
        self.partition.gathered(&own, &row_squares(&inverse.shared).map(|own| 1.0 - own))
    }

    pub(super) fn inverse(&self) -> Inverse {
        let own = self.own.par_iter().map(|root| root.factor.inverse_upper());
        Inverse { own: own.collect(), shared: self.common.inverse_upper() }
    }

    /// The covariance of a session's own columns, then the shared ones, from that of the shared ones and the own ones' `L_s⁻ᵀ`.
    pub(super) fn of_session(
        &self,
        session: usize,
        inverse: &DMatrix<f64>,
        shared: &DMatrix<f64>,
    ) -> DMatrix<f64> {
        let root = &self.own[session];
        let (own, common) = root.across.shape();
        let onto = inverse * &root.across;
        let across = -(&onto * shared);
        let mut covariance = DMatrix::zeros(own + common, own + common);
        let of_own = gram_of_upper(inverse) - &across * transposed(&onto.as_view());
        covariance.view_mut((0, 0), (own, own)).copy_from(&of_own);
        covariance.view_mut((0, own), (own, common)).copy_from(&across);
        covariance.view_mut((own, 0), (common, own)).copy_from(&transposed(&across.as_view()));
        covariance.view_mut((own, own), (common, common)).copy_from(shared);
        covariance
    }

    /// Cholesky factor of M with all columns in the order of the model, which is as large as the square of its columns.
    pub(super) fn of_columns(&self) -> Cholesky {
        let size = self.partition.size();
        let shared = &self.partition.common;
        let mut information = DMatrix::zeros(size, size);
        let mut put = |rows: &[usize], columns: &[usize], block: &DMatrix<f64>| {
            for (column, &into) in columns.iter().enumerate() {
                for (row, &place) in rows.iter().enumerate() {
                    information[(place, into)] = block[(row, column)];
                    information[(into, place)] = block[(row, column)];
                }
            }
        };
        let mut of_shared = self.common.product();
        for root in &self.own {
            of_shared += gram(&root.across.as_view());
        }
        put(shared, shared, &of_shared);
        for (root, places) in self.own.iter().zip(&self.partition.own) {
            put(places, places, &root.factor.product());
            put(places, shared, &(root.factor.lower().lower_triangle() * &root.across));
        }
        Cholesky::new(information).expect("an arrow that was factored is positive")
    }
}

fn put_rows(all: &mut DMatrix<f64>, places: &[usize], rows: &DMatrix<f64>) {
    for (row, &place) in places.iter().enumerate() {
        all.row_mut(place).copy_from(&rows.row(row));
    }
}

#[cfg(test)]
mod tests;
