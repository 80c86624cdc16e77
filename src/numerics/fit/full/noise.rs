//! The noise between model and measurement: the instrument's covariance, the arm's repeatability as a whole, and the
//! repeatability of each joint seen through the arm.
//!
//! Readings of one station are of one pose that the arm attained: its repeatability is common to them, the instrument's noise is
//! each reading's own. With the rows of all readings of a station one below the other,
//! `N = blockdiag(instrument + o² I) + s₀² E Eᵀ + Σ_j s_j² J_j J_jᵀ`, over the station's weight: E is what the readings show of a
//! translation of the flange, `J_j` of a turn of joint j, and o what readings of several targets have of their own beyond the
//! instrument's statement. The sizes follow from leave-one-out residuals:
//! `s_k² ← s_k² (s_k² Σ αᵀ T_k α + ν₀ min(1, a_k/s_k²)) / (s_k² Σ tr(K T_k) + ν₀ min(1, s_k²/a_k))`, repeated until it converges. Its
//! prior pulls to the expected size `a_k` with no more than ν₀ observations, from below and from above: none falls to
//! zero. The stated variance of a source that reads a length has a factor of its own, found by the same rule.

use nalgebra::{DMatrix, DVector, DVectorView, Matrix3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::CHUNK;
use super::settings::FullSettings;
use crate::fit::observation::Observation;
use crate::fit::observation::measured::{Shown, moved};
use crate::kinematics::Twist;
use crate::linalg::invert_small;
use crate::units::per_radian;

/// Variances of the repeatability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Repeatability {
    /// Variance of the arm as a whole, per axis, mm².
    pub position: f64,
    /// Variance of measured orientations beyond the instrument's, per axis, rad².
    pub orientation: f64,
    /// Variance of each joint, rad²; mm² where it slides.
    pub joints: Vec<f64>,
    /// Variance of each reading of a place beyond the instrument's, per axis, mm²; `None` where no station has readings of several
    /// targets, which alone distinguish it from the arm's.
    pub own: Option<f64>,
    /// Factor of the stated variance of each source that reads a length, by its index; sources after the last have 1.
    pub lengths: Vec<f64>,
}

/// A variance changes by no more than this factor in a step.
const LARGEST_CHANGE: f64 = 3.0;
/// Steps on the same residuals: with only a few the sizes stay near their start.
const PASSES: usize = 12;
/// Weight of the expected sizes, in squared residuals: equal to that of the model's other parts. Without it a size
/// that a session hardly determines falls to zero, and the stated widths with it.
const PRIOR: f64 = 2.0;

impl Repeatability {
    /// The expected sizes for the joints of `slides`: a joint that slides repeats a mm as another repeats a mrad.
    pub fn expected(settings: &FullSettings, slides: &[bool]) -> Self {
        let size = |slides: &bool| settings.joint_noise_rad * per_radian(*slides);
        Self {
            position: settings.noise_mm.powi(2),
            orientation: (2.0 * settings.joint_noise_rad).powi(2),
            joints: slides.iter().map(|own| size(own).powi(2)).collect(),
            own: None,
            lengths: Vec::new(),
        }
    }

    /// Takes what the geometry leaves per axis (mm) for repeatability of the arm as a whole, until leave-one-out residuals say how
    /// much of it the other parts explain.
    ///
    /// From a small start the parts grow until they explain what no part of the arm repeats, and the noise is then never found: on a
    /// cable-driven arm (even rows and odd rows judged by each other) ellipsoids of 95 % held 7 and 20 % of the stations, and from
    /// this start 94 and 96 %.
    pub fn start_from(&mut self, misfit_mm: f64) {
        self.position = self.position.max(misfit_mm.powi(2));
    }

    /// `share` times the covariance of a station's residual at weight 1.
    pub fn covariance(&self, station: &StationNoise, share: f64) -> DMatrix<f64> {
        let size = station.common.nrows();
        let mut covariance = DMatrix::zeros(size, size);
        self.add_to(station, share, &mut covariance);
        covariance
    }

    /// Adds [`Self::covariance`].
    fn add_to(&self, station: &StationNoise, share: f64, sum: &mut DMatrix<f64>) {
        self.add_readings(station, share, sum);
        for axis in station.common.column_iter() {
            sum.ger(share * self.position, &axis, &axis, 1.0);
        }
        for (column, variance) in station.joints.column_iter().zip(&self.joints) {
            sum.ger(share * variance, &column, &column, 1.0);
        }
    }

    /// Factor of an instrument's stated variance; 1 of one that reads places.
    fn factor(&self, of_length: Option<usize>) -> f64 {
        of_length.and_then(|source| self.lengths.get(source)).copied().unwrap_or(1.0)
    }

    /// Adds `share` times the part of a station's covariance that is each reading's own.
    fn add_readings(&self, station: &StationNoise, share: f64, sum: &mut DMatrix<f64>) {
        for (first, reading) in station.firsts() {
            let (rows, factor) = (reading.rows(), share * self.factor(reading.of_length));
            let mut own = sum.view_mut((first, first), (rows, rows));
            own.zip_apply(&reading.instrument, |sum, stated| *sum += factor * stated);
            if let (Some(own), true) = (self.own, reading.is_place()) {
                (first..first + 3).for_each(|row| sum[(row, row)] += share * own);
            }
            let turns = first + 3..first + rows;
            turns.for_each(|row| sum[(row, row)] += share * self.orientation);
        }
    }

    /// Moves the sizes to values at which the leave-one-out residuals have their expected size; `before` holds the sizes
    /// expected before any residual.
    pub fn update(&mut self, evidence: &[&NoiseEvidence], before: &Self) {
        for _ in 0..PASSES {
            let lengths = Term::lengths(self);
            let size = lengths + self.lengths.len();
            let chunks = evidence.par_chunks(CHUNK).map(|stations| {
                let mut sums = (DVector::zeros(size), DVector::zeros(size));
                let (found, expected) = &mut sums;
                for own in stations {
                    own.add_to(self, found, expected);
                }
                sums
            });
            let (mut found, mut expected) = (DVector::zeros(size), DVector::zeros(size));
            for (own_found, own_expected) in chunks.collect::<Vec<_>>() {
                found += own_found;
                expected += own_expected;
            }
            let step = |variance: &mut f64, term: usize, before: f64| {
                let found = *variance * found[term] + PRIOR * (before / *variance).min(1.0);
                let expected = *variance * expected[term] + PRIOR * (*variance / before).min(1.0);
                *variance *= (found / expected).clamp(LARGEST_CHANGE.recip(), LARGEST_CHANGE);
            };
            step(&mut self.position, Term::POSITION, before.position);
            step(&mut self.orientation, Term::ORIENTATION, before.orientation);
            if let (Some(own), Some(before)) = (&mut self.own, before.own) {
                step(own, Term::OWN, before);
            }
            for (joint, variance) in self.joints.iter_mut().enumerate() {
                step(variance, Term::JOINTS + joint, before.joints[joint]);
            }
            for (source, factor) in self.lengths.iter_mut().enumerate() {
                step(factor, lengths + source, 1.0);
            }
        }
    }
}

/// Places of the sizes in their sums.
struct Term;

impl Term {
    const POSITION: usize = 0;
    const ORIENTATION: usize = 1;
    const OWN: usize = 2;
    const JOINTS: usize = 3;

    /// The place of the first source's factor.
    fn lengths(sizes: &Repeatability) -> usize {
        Self::JOINTS + sizes.joints.len()
    }
}

/// The noise of the readings of one station at the sizes of one: their rows are one below the other.
#[derive(Debug, Clone, PartialEq)]
pub struct StationNoise {
    /// The readings, in the order of their rows.
    pub readings: Vec<ReadingNoise>,
    /// The change of the rows by a translation of the flange along each axis of the first reading's frame.
    pub common: DMatrix<f64>,
    /// The change of the rows by a unit of each joint, a column for each.
    pub joints: DMatrix<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct ReadingNoise {
    /// Covariance of the instrument, mm² and rad².
    pub instrument: DMatrix<f64>,
    /// The source, where it reads a length.
    pub of_length: Option<usize>,
}

/// A reading as its station's noise is made from it.
pub struct NoisyReading<'r> {
    pub observation: &'r Observation,
    /// The part of the target's motion that it shows.
    pub shown: &'r Shown,
    /// Motion of its target per unit of each joint, in its source's frame.
    pub joints: &'r [Twist],
    /// Rotation from the base's axes to its source's.
    pub base: Matrix3<f64>,
}

impl ReadingNoise {
    pub fn rows(&self) -> usize {
        self.instrument.nrows()
    }

    const fn is_place(&self) -> bool {
        self.of_length.is_none()
    }
}

impl StationNoise {
    /// The noise of a station with these readings.
    pub fn of(readings: &[NoisyReading<'_>]) -> Self {
        let own = readings.iter().map(|reading| ReadingNoise {
            instrument: reading.observation.measured.instrument(),
            of_length: of_length(reading.observation),
        });
        let joints = readings.first().map_or(0, |reading| reading.joints.len());
        let size = readings.iter().map(|reading| reading.shown.rows()).sum();
        let mut common = DMatrix::zeros(size, 3);
        let mut columns = DMatrix::zeros(common.nrows(), joints);
        let mut first = 0;
        for reading in readings {
            let rows = reading.shown.rows();
            let mut part = common.rows_mut(first, rows);
            part.copy_from(&of_translation(reading, &readings[0]));
            for (mut own, twist) in columns.column_iter_mut().zip(reading.joints) {
                moved(reading.shown, twist, 1.0, &mut own.as_mut_slice()[first..first + rows]);
            }
            first += rows;
        }
        Self { readings: own.collect(), common, joints: columns }
    }

    /// The first row of each reading, and the reading.
    pub fn firsts(&self) -> impl Iterator<Item = (usize, &ReadingNoise)> {
        self.readings.iter().scan(0, |next, reading| {
            let first = *next;
            *next += reading.rows();
            Some((first, reading))
        })
    }
}

/// The change of a reading's rows by a translation along each axis of the frame of `first`.
fn of_translation(reading: &NoisyReading<'_>, first: &NoisyReading<'_>) -> DMatrix<f64> {
    let turn = if reading.observation.source == first.observation.source {
        Matrix3::identity()
    } else {
        reading.base * first.base.transpose()
    };
    let mut rows = DMatrix::zeros(reading.shown.rows(), 3);
    for (axis, along) in turn.column_iter().enumerate() {
        let twist = Twist { linear: along.into_owned(), angular: nalgebra::Vector3::zeros() };
        let mut column = rows.column_mut(axis);
        moved(reading.shown, &twist, 1.0, column.as_mut_slice());
    }
    rows
}

#[derive(Debug, Clone, PartialEq)]
pub struct NoiseEvidence {
    /// Its leave-one-out residual.
    pub residual: DVector<f64>,
    /// Covariance of its prediction from all other stations.
    pub open: DMatrix<f64>,
    pub station: StationNoise,
    pub weight: f64,
    /// Its Fisher information as a share of its weight.
    pub information: f64,
}

/// The source of an observation that is a length.
pub(super) fn of_length(observation: &Observation) -> Option<usize> {
    observation.measured.length().map(|_| observation.source.0)
}

impl NoiseEvidence {
    /// Adds `αᵀ T α` and `tr(K T)` of every size, `K = (open + N / (weight · information))⁻¹`, `α = K r`.
    ///
    /// A size converges where `w r²` has its expected size: the weight is the residual's, not the share of information.
    fn add_to(&self, sizes: &Repeatability, found: &mut DVector<f64>, expected: &mut DVector<f64>) {
        let counted = self.weight * self.information;
        let mut k = self.open.clone();
        sizes.add_to(&self.station, counted.recip(), &mut k);
        assert!(invert_small(&mut k), "a positive definite covariance");
        let alpha = &k * &self.residual;
        let mut add = |term: usize, square: f64, trace: f64| {
            found[term] += square / (counted * self.information);
            expected[term] += trace / counted;
        };
        for axis in self.station.common.column_iter() {
            add(Term::POSITION, axis.dot(&alpha).powi(2), quadratic(&k, &axis));
        }
        for (joint, column) in self.station.joints.column_iter().enumerate() {
            add(Term::JOINTS + joint, alpha.dot(&column).powi(2), quadratic(&k, &column));
        }
        for (first, reading) in self.station.firsts() {
            let last = first + reading.rows();
            for row in first..last {
                let term = match row - first {
                    3.. => Term::ORIENTATION,
                    _ if reading.is_place() => Term::OWN,
                    _ => continue,
                };
                add(term, alpha[row] * alpha[row], k[(row, row)]);
            }
            if let Some(source) = reading.of_length.filter(|own| *own < sizes.lengths.len()) {
                let variance = reading.instrument[(0, 0)];
                let square = variance * alpha[first] * alpha[first];
                let trace = k[(first, first)] * variance;
                add(Term::lengths(sizes) + source, square, trace);
            }
        }
    }
}

/// `vᵀ A v` for a few rows.
fn quadratic(matrix: &DMatrix<f64>, vector: &DVectorView<'_, f64>) -> f64 {
    matrix.column_iter().zip(vector.iter()).map(|(column, own)| own * column.dot(vector)).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Residuals of `count` points of an exact instrument whose arm repeats with this standard deviation per axis, mm.
    fn residuals(count: usize, sd_mm: f64) -> Vec<NoiseEvidence> {
        let one = |place: usize| NoiseEvidence {
            // Squares of mean 1: one of three axes, in turn, is off by √3 of the standard deviation.
            residual: DVector::from_fn(3, |row, _| {
                if row == place % 3 { 3.0_f64.sqrt() * sd_mm } else { 0.0 }
            }),
            open: DMatrix::zeros(3, 3),
            station: StationNoise {
                readings: vec![ReadingNoise {
                    instrument: DMatrix::identity(3, 3) * 1e-12,
                    of_length: None,
                }],
                common: DMatrix::identity(3, 3),
                joints: DMatrix::zeros(3, 0),
            },
            weight: 1.0,
            information: 1.0,
        };
        (0..count).map(one).collect()
    }

    fn found_mm(count: usize, sd_mm: f64) -> f64 {
        let expected = Repeatability::expected(&FullSettings::default(), &[]);
        let mut sizes = expected.clone();
        let residuals = residuals(count, sd_mm);
        sizes.update(&residuals.iter().collect::<Vec<_>>(), &expected);
        sizes.position.sqrt()
    }

    #[test]
    fn a_repeatability_far_from_the_expected_one_is_found() {
        // Two observations of 0.02 mm beside the squares of 3 × 100: 1 mm is found but for a thousandth or so.
        for sd_mm in [0.02, 0.2, 1.0] {
            let found = found_mm(100, sd_mm);
            assert!((found / sd_mm - 1.0).abs() < 0.01, "{found} of {sd_mm}");
        }
        // Smaller ones are drawn up, not to zero.
        let found = found_mm(100, 0.002);
        assert!((0.002..0.004).contains(&found), "{found}");
    }
}
