//! Determination of the parameters by the poses: structural rank, identifiable directions at the solution, observability.
//!
//! The method is in [`crate::method::identification`]. Zero columns are removed first; the structural rank is found on the
//! column-scaled Jacobian of the nominal arm, whose geometry is exact, so that its zero singular values are zeros to
//! rounding. At the solution a parameter is *identifiable* when its standard error is below half its prior's.

use nalgebra::{DMatrix, DVector};

use super::problem::Problem;

mod triangle;

use serde::{Deserialize, Serialize};
use triangle::Triangle;

/// A singular value below this share of the largest is a structural zero. Exact geometry leaves 1e-15; a target 0.3 mm
/// off the last axis leaves 2e-5.
const STRUCTURAL_ZERO: f64 = 1e-10;
/// A parameter takes part in a null direction when its share of the null space exceeds this.
const TAKES_PART: f64 = 1e-2;
/// Two parameters of a null space are partners when their entries in it correlate at least this much.
const BELONGS: f64 = 0.1;

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Structure {
    pub singular_values: Vec<f64>,
    /// Number of singular values that are not structural zeros.
    pub rank: usize,
    /// Unknowns whose column is zero: no pose moves with them.
    pub zero_columns: Vec<usize>,
    /// For each unknown, the others with which it is confounded at any noise; empty where it is identifiable.
    pub indistinguishable: Vec<Vec<usize>>,
}

/// Observability of the pose set on the scaled, whitened Jacobian; m is the number of poses, L the rank.
///
/// Sources: O1 Borm and Menq 1989, O2 Driels and Pathre 1990, O3 and O4 Nahvi and Hollerbach 1994 and 1996, O5 Sun and
/// Hollerbach 2008.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observability {
    /// `(Π σ)^{1/L} / √m`.
    pub o1: f64,
    /// `σ_L / σ_1`, the inverse condition number.
    pub o2: f64,
    /// `σ_L`.
    pub o3: f64,
    /// `σ_L² / σ_1`.
    pub o4: f64,
    /// `1 / Σ (1/σ_i)`.
    pub o5: f64,
}

impl Structure {
    /// The structure of `problem`'s Jacobian at `offsets`.
    pub fn of(problem: &Problem<'_>, offsets: &DVector<f64>) -> Self {
        let size = problem.unknowns.len();
        let mut triangle = Triangle::new(size);
        problem.each_block(offsets, |rows| triangle.take(rows));
        let stacked = triangle.matrix();
        let norms: Vec<f64> = stacked.column_iter().map(|column| column.norm()).collect();
        let largest = norms.iter().copied().fold(0.0, f64::max);
        let (kept, zero_columns): (Vec<usize>, Vec<usize>) =
            (0..size).partition(|&column| norms[column] > STRUCTURAL_ZERO * largest);
        let scaled = DMatrix::from_fn(stacked.nrows(), kept.len(), |row, place| {
            stacked[(row, kept[place])] / norms[kept[place]]
        });
        let svd = scaled.svd(false, true);
        let v_t = svd.v_t.expect("the right singular vectors were asked for");
        let mut order: Vec<usize> = (0..svd.singular_values.len()).collect();
        order.sort_by(|&a, &b| svd.singular_values[b].total_cmp(&svd.singular_values[a]));
        let singular_values: Vec<f64> = order.iter().map(|&i| svd.singular_values[i]).collect();
        let floor = STRUCTURAL_ZERO * singular_values.first().copied().unwrap_or(0.0);
        let rank = singular_values.iter().filter(|&&value| value > floor).count();
        let null_rows: Vec<_> = order[rank..].iter().map(|&i| v_t.row(i).transpose()).collect();
        let mut indistinguishable = vec![Vec::new(); size];
        for (place, others) in partners(&null_rows, kept.len()).into_iter().enumerate() {
            indistinguishable[kept[place]] = others.into_iter().map(|other| kept[other]).collect();
        }
        Self { singular_values, rank, zero_columns, indistinguishable }
    }

    /// `σ_1 / σ_L` over the structural rank; infinite without any column.
    pub fn condition(&self) -> f64 {
        self.observable().map_or(f64::INFINITY, |(first, last)| first / last)
    }

    /// The observability indices for `poses` poses; `None` without any column.
    pub fn observability(&self, poses: usize) -> Option<Observability> {
        let (first, last) = self.observable()?;
        let values = &self.singular_values[..self.rank];
        let mean_log = values.iter().map(|value| value.ln()).sum::<f64>() / self.rank as f64;
        Some(Observability {
            o1: mean_log.exp() / (poses as f64).sqrt(),
            o2: last / first,
            o3: last,
            o4: last * last / first,
            o5: values.iter().map(|value| value.recip()).sum::<f64>().recip(),
        })
    }

    fn observable(&self) -> Option<(f64, f64)> {
        Some((
            *self.singular_values.first()?,
            *self.singular_values.get(self.rank.checked_sub(1)?)?,
        ))
    }
}

/// For each column, the others that share a null direction with it (itself excluded; empty when it takes no part).
fn partners(null_rows: &[DVector<f64>], columns: usize) -> Vec<Vec<usize>> {
    let entry = |i: usize, j: usize| null_rows.iter().map(|v| v[i] * v[j]).sum::<f64>();
    let share: Vec<f64> = (0..columns).map(|i| entry(i, i)).collect();
    let belongs = |i: usize, j: usize| {
        i != j
            && share[j] > TAKES_PART
            && entry(i, j).abs() > BELONGS * (share[i] * share[j]).sqrt()
    };
    let partners_of = |i: usize| {
        if share[i] > TAKES_PART {
            (0..columns).filter(|&j| belongs(i, j)).collect()
        } else {
            Vec::new()
        }
    };
    (0..columns).map(partners_of).collect()
}
