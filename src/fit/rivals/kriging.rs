//! Kriging: errors as a Gaussian process with one kernel of all joints.
//!
//! `cov(e(q), e(q')) = σ² k(s)`, `s² = Σ_j (2 sin(Δq_j/2)/ℓ_j)²`, plus a nugget `λσ²` of every station. `k` has one of three shapes
//! ([`Shape`]). The axes of the base are independent: each has its size σ², and shape, lengths and nugget are common. Steps:
//! 1. shape, lengths ℓ and nugget λ by marginal likelihood, from some of the stations ([`LEARNT_FROM`]), with the sizes at their optimum
//!    `σ² = eᵀC⁻¹e/n` (`C = R + λI`), by quasi-Newton steps from short and from long lengths (`Likelihood`);
//! 2. the weights `C⁻¹e` of all stations;
//! 3. at a place, the mean `rᵀC⁻¹e` and the kriging variance `σ² (1 − rᵀC⁻¹r)`, with the nugget beyond a measurement's own variance.
//!
//! Far from all stations the mean is zero and the variance is the whole size. Source: Rasmussen and Williams, Gaussian Processes for
//! Machine Learning, equations 2.25, 2.26, 4.17 and 5.9.

use nalgebra::{DMatrix, DVector, Vector3};
use rayon::prelude::*;

use super::{ErrorMap, Estimate, Place, Sample, mean_measured_variance, spread_evenly};
use crate::linalg::{Cholesky, gram};
use crate::units::chord;

/// Most stations that shape, lengths and nugget are learnt from.
pub const LEARNT_FROM: usize = 500;
/// Most stations in the weights: their matrix has this many squared numbers.
pub const MOST_STATIONS: usize = 4000;
/// Lengths that the search starts from, rad.
const STARTS: [f64; 2] = [0.6, 2.0];
/// Nugget that it starts from, a share of the size.
const START_NUGGET: f64 = 0.1;
/// Most quasi-Newton steps from each start.
const STEPS: usize = 60;
/// Logarithms of lengths and nugget stay within this: beyond, a chord of 2 rad is nothing or a station is noise alone.
const LARGEST_LOGARITHM: f64 = 12.0;
/// The search ends where a step gains less than this, nats.
const WORTH: f64 = 1e-4;

/// The shape of a kernel, as a function of the separation in lengths; each is positive definite on chords, which are distances in the plane
/// of sine and cosine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// `exp(−s²/2)`, smooth.
    SquaredExponential,
    /// Matérn 3/2, `(1 + √3 s) exp(−√3 s)`.
    Matern,
    /// `exp(−s)`, rough.
    Exponential,
}

/// The kernel of all joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Kernel {
    /// Its shape.
    pub shape: Shape,
    /// Length of each axis variable, rad; a mm of sliding counts as a mrad.
    pub lengths: Vec<f64>,
    /// Nugget, a share of the size.
    pub nugget: f64,
    /// Whether each axis variable slides.
    pub slides: Vec<bool>,
}

/// Stations, their weights and the kernel between them.
#[derive(Debug)]
pub struct Kriging {
    kernel: Kernel,
    axes: Vec<Vec<f64>>,
    factor: Cholesky,
    /// `C⁻¹e`, a column for each axis of the base.
    weights: DMatrix<f64>,
    /// Size of each axis of the base, mm².
    size: Vector3<f64>,
    /// Variance of the nugget beyond a measurement's, mm².
    beyond: Vector3<f64>,
}

impl Kriging {
    /// Kriging with the kernel that is most likely; `None` where no kernel is (fewer than two stations, or no errors).
    pub fn new(samples: &[Sample<'_>], slides: &[bool]) -> Option<Self> {
        let learnt = spread_evenly(samples, LEARNT_FROM);
        let found = Shape::ALL
            .iter()
            .filter_map(|shape| Likelihood::new(&learnt, slides, *shape)?.most_likely());
        let best = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Self::with_kernel(samples, best.1)
    }

    /// Kriging with a given kernel; `None` where its matrix is not positive definite.
    pub fn with_kernel(samples: &[Sample<'_>], kernel: Kernel) -> Option<Self> {
        let samples = spread_evenly(samples, MOST_STATIONS);
        let axes: Vec<Vec<f64>> = samples.iter().map(|own| own.place.axes.to_vec()).collect();
        let factor = Cholesky::new(kernel.matrix(&axes))?;
        let (weights, size) = weighed(&factor, &errors(&samples))?;
        let measured = mean_measured_variance(&samples);
        let beyond = size.map(|own| kernel.nugget.mul_add(own, -measured).max(0.0));
        Some(Self { kernel, axes, factor, weights, size, beyond })
    }

    /// The kernel.
    pub const fn kernel(&self) -> &Kernel {
        &self.kernel
    }
}

impl ErrorMap for Kriging {
    fn at(&self, place: &Place<'_>) -> Estimate {
        let near = |own: &Vec<f64>| self.kernel.correlation(place.axes, own);
        let row = DMatrix::from_iterator(self.axes.len(), 1, self.axes.iter().map(near));
        let mean = self.weights.tr_mul(&row);
        let explained = self.factor.forward(row, 0).norm_squared();
        Estimate {
            error: Vector3::new(mean[0], mean[1], mean[2]),
            variance: self.size * (1.0 - explained).max(0.0) + self.beyond,
        }
    }
}

impl Shape {
    /// All shapes.
    pub const ALL: [Self; 3] = [Self::SquaredExponential, Self::Matern, Self::Exponential];

    /// The correlation at a squared separation `s²`, and `−2 dk/d(s²)`.
    fn at(self, square: f64) -> (f64, f64) {
        let s = square.sqrt();
        match self {
            Self::SquaredExponential => {
                let own = (-0.5 * square).exp();
                (own, own)
            }
            Self::Matern => {
                let s = 3.0_f64.sqrt() * s;
                let own = (-s).exp();
                ((1.0 + s) * own, 3.0 * own)
            }
            // Infinitely steep at separation zero, which no length changes.
            Self::Exponential => ((-s).exp(), (-s).exp() / s.max(f64::MIN_POSITIVE.sqrt())),
        }
    }
}

impl Kernel {
    /// The correlation of the errors at two places, without the nugget.
    fn correlation(&self, a: &[f64], b: &[f64]) -> f64 {
        let each = a.iter().zip(b).zip(self.lengths.iter().zip(&self.slides));
        let square = |((a, b), (length, slides)): ((&f64, &f64), (&f64, &bool))| {
            (chord(a - b, *slides) / length).powi(2)
        };
        self.shape.at(each.map(square).sum::<f64>()).0
    }

    /// `C`, its lower triangle.
    fn matrix(&self, axes: &[Vec<f64>]) -> DMatrix<f64> {
        let size = axes.len();
        let column = |column: usize| {
            let own = move |row: usize| match row {
                _ if row < column => 0.0,
                _ if row == column => 1.0 + self.nugget,
                _ => self.correlation(&axes[row], &axes[column]),
            };
            (0..size).map(own).collect::<Vec<f64>>()
        };
        let columns: Vec<Vec<f64>> = (0..size).into_par_iter().map(column).collect();
        DMatrix::from_vec(size, size, columns.concat())
    }
}

/// Errors, a column for each axis of the base, mm.
fn errors(samples: &[Sample<'_>]) -> DMatrix<f64> {
    DMatrix::from_fn(samples.len(), 3, |row, axis| samples[row].error[axis])
}

/// `C⁻¹e` and the sizes `eᵀC⁻¹e/n`; `None` where a size is not positive.
fn weighed(factor: &Cholesky, errors: &DMatrix<f64>) -> Option<(DMatrix<f64>, Vector3<f64>)> {
    let columns: Vec<DVector<f64>> =
        errors.column_iter().map(|own| factor.solve(&own.into_owned())).collect();
    let weights = DMatrix::from_columns(&columns);
    let size = Vector3::from_fn(|axis, _| {
        weights.column(axis).dot(&errors.column(axis)) / errors.nrows() as f64
    });
    size.iter().all(|own| *own > 0.0).then_some((weights, size))
}

/// The marginal likelihood of some stations, as a function of the logarithms of lengths and nugget.
struct Likelihood {
    shape: Shape,
    slides: Vec<bool>,
    errors: DMatrix<f64>,
    /// Squared chords of each axis variable between stations, the lower triangle column by column.
    squares: Vec<Vec<f64>>,
}

/// A value of the likelihood, nats up to a constant, and its gradient.
struct Valued {
    value: f64,
    gradient: DVector<f64>,
}

impl Likelihood {
    fn new(samples: &[Sample<'_>], slides: &[bool], shape: Shape) -> Option<Self> {
        let squares = |(axis, slides): (usize, &bool)| {
            let at = |own: usize| samples[own].place.axes[axis];
            let pairs = pairs(samples.len());
            pairs.map(|(row, column)| chord(at(row) - at(column), *slides).powi(2)).collect()
        };
        (samples.len() > 1).then(|| Self {
            shape,
            slides: slides.to_vec(),
            errors: errors(samples),
            squares: slides.iter().enumerate().map(squares).collect(),
        })
    }

    /// The kernel at the best of the optima that the starts lead to, with its value.
    fn most_likely(&self) -> Option<(f64, Kernel)> {
        let found = STARTS.iter().filter_map(|start| {
            let mut logarithms = DVector::repeat(self.slides.len() + 1, start.ln());
            logarithms[self.slides.len()] = START_NUGGET.ln();
            self.climbed(logarithms)
        });
        let (value, at) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((value, self.kernel(&at)))
    }

    fn kernel(&self, logarithms: &DVector<f64>) -> Kernel {
        let axes = self.slides.len();
        Kernel {
            shape: self.shape,
            lengths: logarithms.iter().take(axes).map(|own| own.exp()).collect(),
            nugget: logarithms[axes].exp(),
            slides: self.slides.clone(),
        }
    }

    /// The optimum that quasi-Newton steps (Broyden, Fletcher, Goldfarb, Shanno) lead to, with its value.
    fn climbed(&self, mut at: DVector<f64>) -> Option<(f64, DVector<f64>)> {
        let mut own = self.at(&at)?;
        let mut inverse = DMatrix::identity(at.len(), at.len());
        for _ in 0..STEPS {
            let direction = &inverse * &own.gradient;
            let Some((step, next)) = self.step(&at, &own, &direction) else {
                break;
            };
            let gain = next.value - own.value;
            // Of the negative logarithm, which falls.
            update(&mut inverse, &step, &(&own.gradient - &next.gradient));
            at += step;
            own = next;
            if gain < WORTH {
                break;
            }
        }
        Some((own.value, at))
    }

    /// The longest of the halved steps along a direction that gains enough; `None` where none does.
    fn step(
        &self,
        at: &DVector<f64>,
        own: &Valued,
        direction: &DVector<f64>,
    ) -> Option<(DVector<f64>, Valued)> {
        let slope = own.gradient.dot(direction);
        let longest = direction.amax().max(1.0).recip();
        (0..20).find_map(|halved| {
            let share = longest * 0.5_f64.powi(halved);
            let step = direction * share;
            let next = self.at(&(at + &step))?;
            (next.value >= own.value + 1e-4 * share * slope).then_some((step, next))
        })
    }

    /// `−½ Σ_axes n ln σ² − 3/2 ln |C|`; `None` out of bounds and where a factorisation fails.
    fn at(&self, logarithms: &DVector<f64>) -> Option<Valued> {
        if logarithms.amax() > LARGEST_LOGARITHM {
            return None;
        }
        let kernel = self.kernel(logarithms);
        let (stations, axes) = (self.errors.nrows(), self.slides.len());
        let correlations = self.correlations(&kernel);
        let mut matrix = DMatrix::identity(stations, stations) * (1.0 + kernel.nugget);
        for ((row, column), own) in pairs(stations).zip(&correlations) {
            matrix[(row, column)] = own.0;
        }
        let factor = Cholesky::new(matrix)?;
        let (weights, size) = weighed(&factor, &self.errors)?;
        let inverse = gram(&factor.inverse_lower().as_view());
        // The derivative by each element of C: ½ (Σ ααᵀ/σ² − 3 C⁻¹).
        let by = |row: usize, column: usize| {
            let outer = |axis: usize| weights[(row, axis)] * weights[(column, axis)] / size[axis];
            0.5 * ((0..3).map(outer).sum::<f64>() - 3.0 * inverse[(row, column)])
        };
        let shares: Vec<f64> = pairs(stations)
            .zip(&correlations)
            .map(|((row, column), own)| 2.0 * by(row, column) * own.1)
            .collect();
        let mut gradient = DVector::zeros(axes + 1);
        for (axis, squares) in self.squares.iter().enumerate() {
            let sum: f64 = shares.iter().zip(squares).map(|(a, b)| a * b).sum();
            gradient[axis] = sum / kernel.lengths[axis].powi(2);
        }
        gradient[axes] = kernel.nugget * (0..stations).map(|own| by(own, own)).sum::<f64>();
        let sizes: f64 = size.iter().map(|own| own.ln()).sum();
        Some(Valued {
            value: -0.5 * (stations as f64).mul_add(sizes, 3.0 * factor.ln_determinant()),
            gradient,
        })
    }

    /// The correlation of each pair of stations, and its slope ([`Shape::at`]).
    fn correlations(&self, kernel: &Kernel) -> Vec<(f64, f64)> {
        let mut sums = vec![0.0; self.squares.first().map_or(0, Vec::len)];
        for (squares, length) in self.squares.iter().zip(&kernel.lengths) {
            let share = length.powi(-2);
            for (sum, own) in sums.iter_mut().zip(squares) {
                *sum += share * own;
            }
        }
        sums.into_iter().map(|own| self.shape.at(own)).collect()
    }
}

/// Rows and columns below the diagonal, column by column.
fn pairs(size: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..size).flat_map(move |column| (column + 1..size).map(move |row| (row, column)))
}

/// The update of an inverse Hessian by a step and the change of the gradient; left alone where the curvature is not positive.
fn update(inverse: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>) {
    let along = step.dot(change);
    if along <= 1e-12 {
        return;
    }
    let size = step.len();
    let left = DMatrix::identity(size, size) - step * change.transpose() / along;
    *inverse = &left * &*inverse * left.transpose() + step * step.transpose() / along;
}

#[cfg(test)]
mod tests;
