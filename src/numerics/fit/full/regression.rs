//! Bayesian linear regression on a fixed Gram matrix: `y = Φ δ + noise`, `δ ~ N(0, diag v)`.
//!
//! With `u = δ/√v` the posterior information is `M = I + √v A √v`, `A = Φᵀ N⁻¹ Φ`: well scaled for any `v`, and a
//! column of variance zero drops out. Where rows are few beside columns, the same follows from the rows alone
//! ([`few_rows`]); of several sessions, each one's own columns are eliminated first ([`sessions`]).

pub mod few_rows;
pub mod sessions;

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector};

use crate::linalg::{Cholesky, gram, gram_of_upper, row_squares, transposed};
use few_rows::{FewRoot, FewRows};
use sessions::{Arrow, SessionSums};

/// Columns of a part of a pool that are few: their covariance costs a twentieth of another posterior.
const SMALL_PART: usize = 100;

#[derive(Debug, Clone)]
pub enum Evidence {
    Rows(FewRows),
    Sums(Sums),
    Sessions(SessionSums),
}

#[derive(Debug, Clone, PartialEq)]
pub struct Sums {
    /// `Φᵀ N⁻¹ Φ`.
    pub information: DMatrix<f64>,
    /// `Φᵀ N⁻¹ y`.
    pub moment: DVector<f64>,
    /// `yᵀ N⁻¹ y`.
    pub square: f64,
    /// `Σ ln |N|`.
    pub ln_noise: f64,
}

#[derive(Debug, Clone)]
pub struct Posterior {
    /// Prior standard deviation of each column, `√v`, found by the session's own likelihood.
    pub scale: DVector<f64>,
    pub(super) root: Root,
    /// `u`, the mean over `√v`.
    pub whitened: DVector<f64>,
    /// Log marginal likelihood, nats, up to the constant of the rows.
    pub log_evidence: f64,
}

#[derive(Debug, Clone)]
pub(super) enum Root {
    Columns(Cholesky),
    /// The rows that it follows from, where they are few.
    Rows(FewRoot),
    Sessions(Arrow),
}

impl Root {
    /// `Rᵀ B`, where `R Rᵀ = M⁻¹`.
    fn half(&self, right: DMatrix<f64>) -> DMatrix<f64> {
        match self {
            Self::Columns(factor) => factor.forward(&right),
            Self::Rows(rows) => rows.half(right),
            Self::Sessions(arrow) => arrow.half(&right),
        }
    }

    /// `Rᵀ` at some columns.
    fn half_of(&self, columns: &[usize]) -> DMatrix<f64> {
        match self {
            Self::Columns(factor) => factor.forward(&chosen(factor.size(), columns)),
            Self::Rows(rows) => rows.half_of(columns),
            Self::Sessions(arrow) => arrow.half_of(columns),
        }
    }

    fn covariance_of(&self, columns: &[usize]) -> DMatrix<f64> {
        match self {
            Self::Rows(rows) => rows.covariance_of(columns),
            Self::Columns(_) | Self::Sessions(_) => gram(&self.half_of(columns).as_view()),
        }
    }
}

impl Evidence {
    /// The posterior at prior standard deviations `√v`; `None` if rounding made a matrix indefinite.
    pub(super) fn posterior_at(&self, scale: DVector<f64>) -> Option<Posterior> {
        match self {
            Self::Rows(rows) => rows.posterior_at(scale),
            Self::Sums(sums) => sums.posterior_at(scale),
            Self::Sessions(sums) => sums.posterior_at(scale),
        }
    }

    /// Log evidence with `columns` minus without them, nats, at the prior of `posterior`; `None` if a matrix became indefinite.
    ///
    /// A small part's follows from the covariance of its own columns. A pool may have thousands of columns of one part, and there the
    /// posterior without them costs less.
    pub(super) fn gain_of(&self, posterior: &Posterior, columns: &[usize]) -> Option<f64> {
        if columns.len() <= SMALL_PART || !matches!(self, Self::Sessions(_)) {
            return posterior.gain_of(columns);
        }
        let without = self.posterior_at(posterior.scale_without(columns))?;
        Some(posterior.log_evidence - without.log_evidence)
    }
}

impl Sums {
    pub fn new(whitened: &DMatrix<f64>, values: &DVector<f64>, ln_noise: f64) -> Self {
        Self {
            information: gram(&whitened.as_view()),
            moment: whitened.tr_mul(values),
            square: values.norm_squared(),
            ln_noise,
        }
    }

    /// The sums of no rows, for `columns` columns.
    pub fn zero(columns: usize) -> Self {
        Self {
            information: DMatrix::zeros(columns, columns),
            moment: DVector::zeros(columns),
            square: 0.0,
            ln_noise: 0.0,
        }
    }

    #[cfg(test)]
    pub fn add(&mut self, other: &Self) {
        self.information += &other.information;
        self.moment += &other.moment;
        self.square += other.square;
        self.ln_noise += other.ln_noise;
    }

    /// The posterior at prior standard deviations `√v`; `None` if rounding made M indefinite.
    pub fn posterior_at(&self, scale: DVector<f64>) -> Option<Posterior> {
        let mut matrix = self.scaled(&scale);
        add_one(&mut matrix);
        self.at(scale, matrix, 0.0)
    }

    /// The posterior with `before`, the posterior of other rows, as prior; the values are relative to its means. `None` if
    /// rounding made M indefinite.
    pub(super) fn posterior_after(&self, before: &Posterior) -> Option<Posterior> {
        let factor = before.factor();
        let matrix = self.scaled(&before.scale) + factor.product();
        self.at(before.scale.clone(), matrix, factor.ln_determinant())
    }

    /// `√v A √v`: its lower triangle.
    fn scaled(&self, scale: &DVector<f64>) -> DMatrix<f64> {
        let size = scale.len();
        let mut matrix = self.information.clone();
        for column in 0..size {
            for row in column..size {
                matrix[(row, column)] *= scale[row] * scale[column];
            }
        }
        matrix
    }

    /// The posterior of information `matrix`, `ln_before` being the logarithm of the prior's determinant.
    fn at(&self, scale: DVector<f64>, matrix: DMatrix<f64>, ln_before: f64) -> Option<Posterior> {
        let factor = Cholesky::new(matrix)?;
        let right = self.moment.component_mul(&scale);
        let whitened = factor.solve(&right);
        let quadratic = self.square - right.dot(&whitened);
        let ln_gained = factor.ln_determinant() - ln_before;
        let log_evidence = -0.5 * (quadratic + ln_gained + self.ln_noise);
        Some(Posterior { scale, root: Root::Columns(factor), whitened, log_evidence })
    }
}

impl Posterior {
    pub fn mean(&self) -> DVector<f64> {
        self.whitened.component_mul(&self.scale)
    }

    pub(super) fn inverse(&self) -> Inverse {
        match &self.root {
            Root::Columns(factor) => Inverse::of(factor),
            Root::Rows(rows) => Inverse::of(&rows.factor),
            Root::Sessions(arrow) => arrow.inverse(),
        }
    }

    /// `1 − Σ_kk/v_k`: the share of each column that the rows determined.
    pub(super) fn determined(&self, inverse: &Inverse) -> DVector<f64> {
        match &self.root {
            Root::Columns(_) => row_squares(&inverse.shared).map(|own| 1.0 - own),
            Root::Rows(rows) => rows.determined(&self.scale, &inverse.shared),
            Root::Sessions(arrow) => arrow.determined(inverse),
        }
    }

    /// Cholesky factor of M, of the size of the columns.
    pub fn factor(&self) -> Cow<'_, Cholesky> {
        match &self.root {
            Root::Columns(factor) => Cow::Borrowed(factor),
            Root::Rows(rows) => Cow::Owned(rows.of_columns()),
            Root::Sessions(arrow) => Cow::Owned(arrow.of_columns()),
        }
    }

    /// Covariances of what each session sees; of rows that were summed.
    pub(super) fn by_session(&self, mut inverse: Inverse) -> BySession<'_> {
        if !matches!(self.root, Root::Sessions(_)) {
            // With the prior's standard deviations in its rows, the square is the covariance itself.
            for mut column in inverse.shared.column_iter_mut() {
                column.component_mul_assign(&self.scale);
            }
        }
        BySession { posterior: self, shared: gram_of_upper(&inverse.shared), inverse }
    }

    /// The prior standard deviations with those of `columns` at zero.
    pub(super) fn scale_without(&self, columns: &[usize]) -> DVector<f64> {
        let mut scale = self.scale.clone();
        for &column in columns {
            scale[column] = 0.0;
        }
        scale
    }

    /// A square root `OᵀO` of the covariance that the model leaves open of its own whitened rows, a column for each row: of the rows as
    /// shares of their noise it is `L⁻¹`. `None` where the rows were summed.
    pub(super) fn open_of_rows(&self, inverse: &Inverse) -> Option<DMatrix<f64>> {
        match &self.root {
            Root::Columns(_) | Root::Sessions(_) => None,
            Root::Rows(_) => Some(transposed(&inverse.shared.as_view())),
        }
    }

    /// `R z` with `R Rᵀ` the posterior covariance over the prior's standard deviations.
    pub(super) fn backward(&self, z: DVector<f64>) -> DVector<f64> {
        match &self.root {
            Root::Columns(factor) => factor.backward(z),
            Root::Rows(rows) => rows.of_columns().backward(z),
            Root::Sessions(arrow) => arrow.backward(&z),
        }
    }

    /// Posterior covariance of the columns at `places`.
    pub fn covariance_of(&self, places: &[usize]) -> DMatrix<f64> {
        gram(&self.half_of(places).as_view())
    }

    /// A square root `HᵀH` of the posterior covariance of the columns at `places`, a column for each.
    pub fn half_of(&self, places: &[usize]) -> DMatrix<f64> {
        let mut half = self.root.half_of(places);
        for (mut column, &place) in half.column_iter_mut().zip(places) {
            column *= self.scale[place];
        }
        half
    }

    /// Log evidence with `columns` in the model minus without them, nats: `½ ln |C| + ½ uᵀ C⁻¹ u` with their own mean u and
    /// covariance C, over their prior's standard deviations. `None` if rounding made C indefinite.
    pub(super) fn gain_of(&self, columns: &[usize]) -> Option<f64> {
        let factor = self.root.covariance_of(columns).cholesky()?;
        let mean = self.whitened.select_rows(columns);
        let ln_determinant = 2.0 * factor.l_dirty().diagonal().map(f64::ln).sum();
        Some(0.5 * (ln_determinant + mean.dot(&factor.solve(&mean))))
    }

    /// A square root `HᵀH` of the posterior covariance of `rows · δ`, a column for each row.
    pub fn half(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        self.root.half(self.prior_half(rows))
    }

    /// A square root `HᵀH` of the prior covariance of `rows · δ`, a column for each row.
    pub(crate) fn prior_half(&self, rows: &DMatrix<f64>) -> DMatrix<f64> {
        let mut half = transposed(&rows.as_view());
        for mut row in half.column_iter_mut() {
            row.component_mul_assign(&self.scale);
        }
        half
    }
}

/// The inverse of a posterior's factor, which both sizes and leave-one-out residuals follow from.
pub(super) struct Inverse {
    /// `L_s⁻ᵀ` of each session's own columns, where there are several.
    own: Vec<DMatrix<f64>>,
    /// `L⁻ᵀ` of all columns, or of those that sessions share; of the rows where they are few.
    shared: DMatrix<f64>,
}

impl Inverse {
    fn of(factor: &Cholesky) -> Self {
        Self { own: Vec::new(), shared: factor.inverse_upper() }
    }
}

pub(super) struct BySession<'p> {
    posterior: &'p Posterior,
    inverse: Inverse,
    /// The covariance of the shared columns: over their prior's standard deviations where there are several sessions.
    shared: DMatrix<f64>,
}

impl BySession<'_> {
    /// The covariance of `columns`, which are the own ones of `session` and then the shared ones.
    pub(super) fn of(&self, session: usize, columns: &[usize]) -> Cow<'_, DMatrix<f64>> {
        let Root::Sessions(arrow) = &self.posterior.root else {
            return Cow::Borrowed(&self.shared);
        };
        let mut covariance = arrow.of_session(session, &self.inverse.own[session], &self.shared);
        let scale = self.posterior.scale.select_rows(columns);
        for (mut column, own) in covariance.column_iter_mut().zip(&scale) {
            column.component_mul_assign(&scale);
            column *= *own;
        }
        Cow::Owned(covariance)
    }
}

fn add_one(matrix: &mut DMatrix<f64>) {
    (0..matrix.nrows()).for_each(|column| matrix[(column, column)] += 1.0);
}

/// The columns of the identity of this size at `places`.
fn chosen(size: usize, places: &[usize]) -> DMatrix<f64> {
    let mut chosen = DMatrix::zeros(size, places.len());
    for (column, &place) in places.iter().enumerate() {
        chosen[(place, column)] = 1.0;
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn posterior_and_evidence_are_those_of_the_closed_form() {
        // y = Φ δ + e, e ~ N(0, I), δ ~ N(0, V): y ~ N(0, Φ V Φᵀ + I), δ | y ~ N(V Φᵀ S⁻¹ y, V − V Φᵀ S⁻¹ Φ V).
        let rows = DMatrix::from_fn(7, 3, |i, j| ((3 * i + 5 * j) as f64).sin());
        let values = DVector::from_fn(7, |i, _| (i as f64).cos());
        let variances = DVector::from_vec(vec![0.5, 2.0, 0.0]);
        let v = DMatrix::from_diagonal(&variances);
        let s = &rows * &v * rows.transpose() + DMatrix::identity(7, 7);
        let s_inverse = s.clone().try_inverse().expect("positive definite");
        let posterior = Sums::new(&rows, &values, 0.0)
            .posterior_at(variances.map(f64::sqrt))
            .expect("positive definite");
        let mean = &v * rows.transpose() * &s_inverse * &values;
        assert!((posterior.mean() - mean).norm() < 1e-12);
        let evidence = -0.5 * (values.dot(&(&s_inverse * &values)) + s.determinant().ln());
        assert!((posterior.log_evidence - evidence).abs() < 1e-10);
        let half = posterior.half(&rows);
        for columns in [vec![0], vec![1], vec![0, 1]] {
            let mut without = variances.clone();
            for &column in &columns {
                without[column] = 0.0;
            }
            let without = Sums::new(&rows, &values, 0.0)
                .posterior_at(without.map(f64::sqrt))
                .expect("positive definite");
            let gain = posterior.gain_of(&columns).expect("positive definite");
            assert!((gain - posterior.log_evidence + without.log_evidence).abs() < 1e-12);
        }
        let covariance =
            &rows * (&v - &v * rows.transpose() * s_inverse * &rows * &v) * rows.transpose();
        assert!((half.transpose() * half - covariance).abs().max() < 1e-12);
    }
}
