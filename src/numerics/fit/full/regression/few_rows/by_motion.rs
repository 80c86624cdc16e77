//! Columns of few rows by what they move, and products that follow from it.
//!
//! A column of a joint's curve or gear line moves the rows of a station by the joint's motion times a number, so the shapes of joint j say of
//! the rows of stations a and b `m_a m_bᵀ Σ_k v_k s_k(a) s_k(b)`: products over stations instead of rows, a ninth of the work for places.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::linalg::{Cholesky, gram, gram_of_upper, row_squares, transposed};

/// The columns of few rows: shapes of joints, which every station sees through the joint's motion, and others.
#[derive(Debug, Clone, Default)]
pub struct ByMotion {
    pub plain: Vec<usize>,
    pub joints: Vec<Shapes>,
    pub stations: Vec<Range<usize>>,
}

/// The columns of one joint's shapes: the entry of a row is the station's number times the row's motion.
#[derive(Debug, Clone)]
pub struct Shapes {
    pub columns: Vec<usize>,
    /// The numbers: a row for each of `columns`, a column for each station.
    pub numbers: DMatrix<f64>,
    pub motions: DVector<f64>,
}

impl ByMotion {
    /// All of `columns` columns as no shapes.
    pub fn plain(columns: usize) -> Self {
        Self { plain: (0..columns).collect(), ..Self::default() }
    }

    /// `S Sᵀ`, of which the lower triangle is right, for `Sᵀ` and the scale in it.
    pub(super) fn product(&self, of_rows: &DMatrix<f64>, scale: &DVector<f64>) -> DMatrix<f64> {
        let mut product = gram(&of_rows.select_rows(&self.plain).as_view());
        let alike = self.joints.par_iter().map(|own| gram(&own.scaled(scale).as_view()));
        let mut along = Vec::new();
        for (own, alike) in self.joints.iter().zip(alike.collect::<Vec<_>>()) {
            let motions = own.motions.as_slice();
            for (station, columns) in self.stations.iter().enumerate() {
                along.clear();
                let alike = alike.column(station);
                for (rows, share) in self.stations.iter().zip(&alike).skip(station) {
                    along.extend(motions[rows.clone()].iter().map(|motion| share * motion));
                }
                let rows = columns.start..columns.start + along.len();
                for column in columns.clone() {
                    let mut column_of = product.column_mut(column);
                    let into = &mut column_of.as_mut_slice()[rows.clone()];
                    let by = motions[column];
                    into.iter_mut().zip(&along).for_each(|(entry, along)| *entry += by * along);
                }
            }
        }
        product
    }

    /// The diagonal of `Sᵀ K⁻¹ S`, for `Sᵀ`, the scale in it, the factor of K and that one's `L⁻ᵀ`.
    pub(super) fn squares(
        &self,
        of_rows: &DMatrix<f64>,
        scale: &DVector<f64>,
        factor: &Cholesky,
        inverse: &DMatrix<f64>,
    ) -> DVector<f64> {
        let mut squares = DVector::zeros(scale.len());
        // Where a base is hardly expected somewhere its column is far longer than one; its square is the norm of `L⁻¹ S`.
        let plain = row_squares(&factor.behind(of_rows.select_rows(&self.plain), 0));
        for (&column, square) in self.plain.iter().zip(&plain) {
            squares[column] = *square;
        }
        if self.joints.is_empty() {
            return squares;
        }
        let covariance = gram_of_upper(inverse);
        let of_joint = |own: &Shapes| {
            let count = self.stations.len();
            let across = DMatrix::from_fn(count, count, |station, other| {
                let (rows, columns) = (&self.stations[station], &self.stations[other]);
                let block = columns.clone().map(|column| {
                    let rows = rows.clone();
                    let along = rows.map(|row| own.motions[row] * covariance[(row, column)]);
                    own.motions[column] * along.sum::<f64>()
                });
                block.sum::<f64>()
            });
            let scaled = transposed(&own.scaled(scale).as_view());
            let onto = across * &scaled;
            let columns = scaled.column_iter().zip(onto.column_iter());
            let squares: Vec<f64> = columns.map(|(own, onto)| own.dot(&onto)).collect();
            squares
        };
        let of_joints: Vec<Vec<f64>> = self.joints.par_iter().map(of_joint).collect();
        for (own, found) in self.joints.iter().zip(of_joints) {
            for (&column, square) in own.columns.iter().zip(found) {
                squares[column] = square;
            }
        }
        squares
    }
}

impl Shapes {
    fn scaled(&self, scale: &DVector<f64>) -> DMatrix<f64> {
        let own = scale.select_rows(&self.columns);
        let mut scaled = self.numbers.clone();
        for mut station in scaled.column_iter_mut() {
            station.component_mul_assign(&own);
        }
        scaled
    }
}
