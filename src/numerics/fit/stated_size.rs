//! The size of the covariances that readings state of themselves, by likelihood: factors on the standard deviations, for each session and
//! source, of positions and of orientations.
//!
//! What a publisher states is often wrong by a factor: of one sample where the reading is a mean of many, of the fit of a reflector's image
//! without its calibration, or a number that nobody has measured. Inputs: the observations of all sessions, what each of them states, and
//! the geometric calibration that they gave. The residual of a reading has the covariance `D C D + B + s² I`: C is what it states, D has
//! the factors, B is what is known beside it (scatter of the mean, motion of references), and s² is what the arm adds to each coordinate of
//! the position. All follow by Fisher's scoring, as the size of a camera's noise does ([`super::camera_size`]); unknowns of the fit count by
//! the share of rows that they take.
//!
//! Positions whose stated covariances are all alike say only how large `D C D + s² I` is: no factor is found for them, and what they are off
//! by is counted to the arm's repeatability. Covariances that differ from reading to reading, or along one reading's axes, tell the two apart;
//! so do orientations, to which the arm's repeatability adds nothing here.

use nalgebra::{DMatrix, DVector};

use super::Calibration;
use super::geometry_left::Residuals;
use super::observation::{Observation, StatedSize};
use crate::join::SourceId;
use crate::kinematics::Arm;

const STEPS: usize = 100;
/// Change of all parameters at which it has converged: of logarithms, and relative of the arm's variance.
const CONVERGED: f64 = 1e-8;
const LARGEST_CHANGE: f64 = 1.0;
/// The least variance of the arm, mm²: a nanometre.
const LEAST_MM2: f64 = 1e-12;
/// A factor whose logarithm is known no better than this is not determined: it may as well be 1.
const DETERMINED: f64 = 0.25;
const LEAST_READINGS: usize = 10;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundSize {
    pub session: usize,
    pub source: SourceId,
    pub size: StatedSize,
    pub standard_error: StatedSize,
    /// Whether the orientation's factor is its own; otherwise both are one.
    pub is_apart: bool,
    pub has_orientations: bool,
    /// Standard deviation of what the arm adds, per coordinate of the position, mm.
    pub beside_mm: f64,
    pub readings: usize,
}

/// A reading's residual with the parts of its covariance, mm and rad.
#[derive(Debug, Clone)]
struct Row {
    residual: DVector<f64>,
    /// Covariance that it states, mm² and rad².
    stated: DMatrix<f64>,
    /// Covariance that is known beside it, mm² and rad².
    beside: DMatrix<f64>,
    weight: f64,
}

/// Parameters of the likelihood: logarithms of the factors, then the arm's variance, mm².
#[derive(Debug, Clone, Copy, PartialEq)]
struct At {
    /// Whether the orientation's factor is its own; otherwise the first is of both.
    is_apart: bool,
    logarithms: [f64; 2],
    arm_mm2: f64,
}

/// The sizes of each session and source of `observations` that state a covariance of their own; `stated` gives it, in mm and rad with as many
/// rows as the reading has, for factors of 1; `applied` are the factors that the observations have already. Sources whose readings do not determine a factor have none.
pub fn found(
    arm: &Arm,
    observations: &[Observation],
    calibration: &Calibration,
    stated: impl Fn(&Observation) -> Option<DMatrix<f64>>,
    applied: impl Fn(&Observation) -> StatedSize,
) -> Vec<FoundSize> {
    let left = Residuals::of(arm, observations, calibration);
    let row = |(own, weight): (&Observation, &f64)| {
        let whole = own.measured.instrument();
        let stated = stated(own).filter(|own| own.nrows() == whole.nrows())?;
        let row = Row {
            residual: left.residual(own),
            beside: whole - with_factors(&stated, applied(own)),
            stated,
            weight: weight * left.counted,
        };
        Some(((own.session, own.source), row))
    };
    let rows = observations.iter().zip(&calibration.solution.weights);
    let rows: Vec<_> = rows.filter_map(row).collect();
    let mut channels: Vec<(usize, SourceId)> = rows.iter().map(|(own, _)| *own).collect();
    channels.sort_unstable();
    channels.dedup();
    let of = |(session, source): (usize, SourceId)| {
        let own = rows.iter().filter(|(own, _)| *own == (session, source));
        let own: Vec<Row> = own.map(|(_, row)| row.clone()).collect();
        Some(FoundSize { session, source, ..sized(&own)? })
    };
    channels.into_iter().filter_map(of).collect()
}

/// Mean size of one source over sessions, by what each tells: for sessions of the same instrument that do not determine one.
pub fn mean(found: &[FoundSize], source: SourceId) -> Option<StatedSize> {
    let own: Vec<&FoundSize> = found.iter().filter(|own| own.source == source).collect();
    let of = |part: fn(&StatedSize) -> f64| {
        let (mut sum, mut weights) = (0.0, 0.0);
        for own in &own {
            let weight = (part(&own.size) / part(&own.standard_error)).powi(2);
            sum += weight * part(&own.size).ln();
            weights += weight;
        }
        (sum / weights).exp()
    };
    (!own.is_empty()).then(|| StatedSize {
        position: of(|own| own.position),
        orientation: of(|own| own.orientation),
    })
}

/// The size of these readings: of positions and orientations apart where both are determined, otherwise one of both.
fn sized(rows: &[Row]) -> Option<FoundSize> {
    if rows.len() < LEAST_READINGS {
        return None;
    }
    let has_orientations =
        rows.iter().any(|row| row.stated.nrows() == 6 && row.stated[(3, 3)] > 0.0);
    let apart = has_orientations.then(|| scored(rows, true)).flatten();
    let (at, errors) = match apart.filter(|own| own.1.iter().all(|error| *error <= DETERMINED)) {
        Some(apart) => apart,
        None => scored(rows, false).filter(|own| own.1[0] <= DETERMINED)?,
    };
    let [position, orientation] = at.factors();
    Some(FoundSize {
        session: 0,
        source: SourceId::ONLY,
        size: StatedSize { position, orientation },
        standard_error: StatedSize {
            position: position * errors[0],
            orientation: orientation * errors[1],
        },
        is_apart: at.is_apart,
        has_orientations,
        beside_mm: at.arm_mm2.sqrt(),
        readings: rows.len(),
    })
}

/// Fisher's scoring; with the standard errors of the logarithms. `None` where it does not converge, or where nothing tells the parameters
/// apart.
fn scored(rows: &[Row], is_apart: bool) -> Option<(At, [f64; 2])> {
    let mut at = At { is_apart, logarithms: [0.0; 2], arm_mm2: 1e-4 };
    for _ in 0..STEPS {
        let (gradient, information) = at.score(rows)?;
        let last = gradient.len() - 1;
        let at_zero = at.arm_mm2 <= LEAST_MM2 && gradient[last] <= 0.0;
        let free = if at_zero { last } else { last + 1 };
        let inverse = conditioned(&information.view((0, 0), (free, free)).into_owned())?;
        let step = &inverse * gradient.rows(0, free);
        let moved = at.moved(&step);
        if moved < CONVERGED {
            let error = |place: usize| inverse[(place, place)].sqrt();
            return Some((at, [error(0), error(at.count() - 1)]));
        }
    }
    None
}

/// The inverse of an information matrix on scaled columns; `None` where parameters are confounded.
fn conditioned(information: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scales = information.diagonal().map(f64::sqrt);
    if scales.iter().any(|scale| *scale <= 0.0) {
        return None;
    }
    let scaled = DMatrix::from_fn(scales.len(), scales.len(), |i, j| {
        information[(i, j)] / (scales[i] * scales[j])
    });
    let inverse = scaled.cholesky()?.inverse();
    let found = DMatrix::from_fn(scales.len(), scales.len(), |i, j| {
        inverse[(i, j)] / (scales[i] * scales[j])
    });
    found.iter().all(|entry| entry.is_finite()).then_some(found)
}

/// `D C D`: a stated covariance with factors.
fn with_factors(stated: &DMatrix<f64>, size: StatedSize) -> DMatrix<f64> {
    let factors = [size.position, size.orientation];
    let (rows, of) = (stated.nrows(), |place: usize| factors[place / 3]);
    DMatrix::from_fn(rows, rows, |i, j| of(i) * of(j) * stated[(i, j)])
}

impl At {
    /// Number of factors.
    fn count(&self) -> usize {
        1 + usize::from(self.is_apart)
    }

    fn factors(&self) -> [f64; 2] {
        [self.logarithms[0], self.logarithms[self.count() - 1]].map(f64::exp)
    }

    fn covariance(&self, row: &Row) -> DMatrix<f64> {
        let mut covariance = self.sized(row) + &row.beside;
        (0..3).for_each(|axis| covariance[(axis, axis)] += self.arm_mm2);
        covariance
    }

    fn sized(&self, row: &Row) -> DMatrix<f64> {
        let [position, orientation] = self.factors();
        with_factors(&row.stated, StatedSize { position, orientation })
    }

    fn derivatives(&self, row: &Row) -> Vec<DMatrix<f64>> {
        let (sized, size) = (self.sized(row), row.stated.nrows());
        // The logarithm of a factor is in each entry as often as the entry is of its rows and columns.
        let by = |kind: usize| {
            DMatrix::from_fn(size, size, |i, j| {
                let times = [i, j].into_iter().filter(|place| place / 3 == kind).count();
                times as f64 * sized[(i, j)]
            })
        };
        let mut derivatives = if self.is_apart { vec![by(0), by(1)] } else { vec![&sized * 2.0] };
        derivatives.push(DMatrix::from_fn(size, size, |i, j| f64::from(u8::from(i == j && i < 3))));
        derivatives
    }

    /// Gradient and information of the likelihood; `None` where a covariance is indefinite.
    fn score(&self, rows: &[Row]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let size = self.count() + 1;
        let (mut gradient, mut information) = (DVector::zeros(size), DMatrix::zeros(size, size));
        for row in rows {
            let inverse = self.covariance(row).cholesky()?.inverse();
            let white = &inverse * &row.residual;
            let derivatives = self.derivatives(row);
            let parts: Vec<DMatrix<f64>> = derivatives.iter().map(|own| &inverse * own).collect();
            for (a, (part, derivative)) in parts.iter().zip(&derivatives).enumerate() {
                let square = row.weight * (derivative * &white).dot(&white);
                gradient[a] += 0.5 * (square - part.trace());
                for (b, other) in parts.iter().enumerate() {
                    information[(a, b)] += 0.5 * part.component_mul(&other.transpose()).sum();
                }
            }
        }
        Some((gradient, information))
    }

    /// Moves by a step; returns the largest change.
    fn moved(&mut self, step: &DVector<f64>) -> f64 {
        let logarithms = self.count();
        let mut largest: f64 = 0.0;
        for (own, step) in self.logarithms.iter_mut().zip(step.iter()).take(logarithms) {
            let change = step.clamp(-LARGEST_CHANGE, LARGEST_CHANGE);
            *own += change;
            largest = largest.max(change.abs());
        }
        if let Some(change) = step.get(logarithms) {
            let before = self.arm_mm2;
            self.arm_mm2 = (before + change).max(0.1 * before).max(LEAST_MM2);
            largest = largest.max((self.arm_mm2 - before).abs() / before);
        }
        largest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Standard normal numbers from a generator that a test may have.
    struct Noise(u64);

    impl Noise {
        fn uniform(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
        }

        fn normal(&mut self) -> f64 {
            let (u, v) = (self.uniform(), self.uniform());
            (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
        }
    }

    /// Readings with noise `true_size` times what they state, and `arm_mm` of the arm on each coordinate; their covariances differ.
    fn rows(noise: &mut Noise, count: usize, true_size: [f64; 2], arm_mm: f64) -> Vec<Row> {
        let row = |place: usize| {
            let far = 1.0 + (place % 7) as f64 / 2.0;
            let root = DMatrix::from_fn(6, 6, |i, j| {
                let size = if i < 3 { 0.02 * far } else { 1e-4 };
                size * if i == j { 1.0 } else { 0.3 * ((i + 2 * j + place) as f64).sin() }
            });
            let white = DVector::from_fn(6, |_, _| noise.normal());
            let mut residual = &root * white;
            for axis in 0..6 {
                residual[axis] *= true_size[axis / 3];
                if axis < 3 {
                    residual[axis] += arm_mm * noise.normal();
                }
            }
            Row {
                residual,
                stated: &root * root.transpose(),
                beside: DMatrix::zeros(6, 6),
                weight: 1.0,
            }
        };
        (0..count).map(row).collect()
    }

    #[test]
    fn factors_are_found_with_their_stated_errors() {
        let mut noise = Noise(11);
        let (mut off, mut count) = ([0.0; 2], 0.0);
        for _ in 0..60 {
            let found = sized(&rows(&mut noise, 150, [3.0, 0.5], 0.05)).expect("determined");
            assert!(found.is_apart);
            let (size, error) = (found.size, found.standard_error);
            off[0] += ((size.position - 3.0) / error.position).powi(2);
            off[1] += ((size.orientation - 0.5) / error.orientation).powi(2);
            count += 1.0;
        }
        // Mean squares of standardised errors of 60 sessions: 1 ± 0.18.
        assert!(off.iter().all(|own| (own / count - 1.0).abs() < 0.5), "{off:?}");
    }

    #[test]
    fn the_score_is_the_derivative_of_the_likelihood() {
        let mut noise = Noise(5);
        let rows = rows(&mut noise, 20, [1.5, 1.5], 0.02);
        let minus_log = |at: &At| -> f64 {
            let of = |row: &Row| {
                let factor = at.covariance(row).cholesky().expect("positive");
                let log: f64 = factor.l().diagonal().iter().map(|own| own.ln()).sum();
                log + 0.5 * row.residual.dot(&factor.solve(&row.residual))
            };
            rows.iter().map(of).sum()
        };
        let at = At { is_apart: true, logarithms: [0.2, -0.1], arm_mm2: 4e-4 };
        let (gradient, _) = at.score(&rows).expect("positive");
        for place in 0..3 {
            let step = if place < 2 { 1e-6 } else { 1e-9 };
            let moved = |by: f64| {
                let mut at = at;
                match place {
                    2 => at.arm_mm2 += by,
                    _ => at.logarithms[place] += by,
                }
                minus_log(&at)
            };
            let numeric = -(moved(step) - moved(-step)) / (2.0 * step);
            assert!((gradient[place] - numeric).abs() < 1e-4 * numeric.abs().max(1.0));
        }
    }

    #[test]
    fn positions_stated_all_alike_have_no_factor() {
        let mut noise = Noise(3);
        let of = |noise: &mut Noise| Row {
            residual: DVector::from_fn(3, |_, _| 0.06 * noise.normal()),
            stated: DMatrix::identity(3, 3) * 0.02_f64.powi(2),
            beside: DMatrix::zeros(3, 3),
            weight: 1.0,
        };
        let rows: Vec<Row> = (0..200).map(|_| of(&mut noise)).collect();
        assert_eq!(sized(&rows), None);
    }
}
