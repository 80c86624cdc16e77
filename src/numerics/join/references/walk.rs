//! The motion of a rigid set of references over a session, as a random walk with shocks: filter, smoother and the tests of what
//! is not a walk.
//!
//! The state is `(t, ρ ω)`: shift of the references' middle, and rotation times their radius ρ, so that all six are mm. At each
//! look the set is where the walk is plus a shock of its own, and every reading adds its noise:
//!
//! ```text
//! s(i+1) = s(i) + N(0, q Δt)        u(i) = s(i) + N(0, W)        y(i) = H(i) u(i) + N(0, σ²)
//! ```
//!
//! The filter is Kalman's and the smoother de Jong's (Durbin and Koopman 2012, sections 4.4 and 4.5), which needs no inverse of
//! a covariance: a state whose rotation is held at zero is not a special case. The scores of the backward pass are the tests of
//! a jump between two looks, and of a shock at one, against the alternative that there was none (de Jong and Penzer 1998).

use nalgebra::{Matrix6, Vector6};

/// Variances of the walk and its shocks in multiples of the noise's variance, per mm².
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ratios {
    /// Walk of the shift and of the rotation, per second.
    pub walk: [f64; 2],
    pub shock: [f64; 2],
}

/// What the readings of one look say of the state there, in units of the noise.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Look {
    pub at_s: f64,
    /// `Hᵀ H`.
    pub information: Matrix6<f64>,
    /// `Hᵀ y`.
    pub score: Vector6<f64>,
    /// `yᵀ y`, mm².
    pub squares: f64,
    pub rows: usize,
    /// Number of looks that it is the mean of, each with a shock of its own.
    pub looks: f64,
    pub jumps: bool,
    /// Whether it has a shock of unknown size.
    pub shaken: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Course {
    /// The state at each look, its shock included, and its covariance in units of the noise's variance.
    pub states: Vec<(Vector6<f64>, Matrix6<f64>)>,
    /// For each look the test of a jump before it, in units of the noise's variance: χ² of as many degrees of freedom.
    pub jumps: Vec<(f64, usize)>,
    /// For each look the test of a shock at it.
    pub shocks: Vec<(f64, usize)>,
    /// The noise's variance by the innovations, mm².
    pub noise_mm2: f64,
}

/// What the filter keeps of a look.
#[derive(Debug)]
pub(super) struct Step {
    predicted: Matrix6<f64>,
    mean: Vector6<f64>,
    /// Score of the look's innovation, and its variance.
    gain: Vector6<f64>,
    precision: Matrix6<f64>,
    shock: Vector6<f64>,
}

/// Which of the six may move at all: rotations only where the references tell them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Moves {
    Shifts,
    ShiftsAndTurns,
}

/// Variance of a state of which nothing is known, in units of the noise's variance: a thousand times its size, so that a single
/// reading decides all but a millionth of it.
const UNKNOWN: f64 = 1e6;

impl Moves {
    /// A diagonal with one number for shifts and another for rotations.
    fn diagonal(self, [shift, turn]: [f64; 2]) -> Matrix6<f64> {
        let turn = match self {
            Self::Shifts => 0.0,
            Self::ShiftsAndTurns => turn,
        };
        Matrix6::from_diagonal(&Vector6::new(shift, shift, shift, turn, turn, turn))
    }

    /// Number of the state's components that may move.
    pub const fn freedom(self) -> usize {
        match self {
            Self::Shifts => 3,
            Self::ShiftsAndTurns => 6,
        }
    }
}

/// The course of the walk through `looks`, in order of time. `steps` is room for the filter's steps, which is used again and again.
pub(super) fn course(
    looks: &[Look],
    ratios: Ratios,
    moves: Moves,
    steps: &mut Vec<Step>,
) -> Course {
    steps.clear();
    let (_, noise_mm2) = filtered(looks, ratios, moves, |step| steps.push(step));
    let mut course = Course {
        states: vec![(Vector6::zeros(), Matrix6::zeros()); looks.len()],
        jumps: vec![(0.0, 0); looks.len()],
        shocks: vec![(0.0, 0); looks.len()],
        noise_mm2,
    };
    // Score of everything from the next look on, and its variance.
    let (mut later, mut spread) = (Vector6::zeros(), Matrix6::zeros());
    for (i, step) in steps.iter().enumerate().rev() {
        let Step { predicted: p, precision: b, .. } = step;
        let w = Matrix6::from_diagonal(&step.shock);
        let left = Matrix6::identity() - p * b;
        let of_shock = step.gain - b * (p * later);
        let of_shock_spread = b + b * p * spread * p * b;
        course.shocks[i] = chi_squared(&of_shock, &of_shock_spread, moves);
        let across = p * (b - left.transpose() * spread * (p * b)) * w;
        later = step.gain + left.transpose() * later;
        spread = b + left.transpose() * spread * left;
        course.jumps[i] = chi_squared(&later, &spread, moves);
        let state = step.mean + p * later + w * of_shock;
        let covariance =
            p - p * spread * p + w - w * of_shock_spread * w - across - across.transpose();
        course.states[i] = (state, symmetric(&covariance));
    }
    course
}

/// The states of [`course`] alone.
pub(super) fn states(
    looks: &[Look],
    ratios: Ratios,
    moves: Moves,
    steps: &mut Vec<Step>,
) -> Vec<Vector6<f64>> {
    steps.clear();
    filtered(looks, ratios, moves, |step| steps.push(step));
    let mut states = vec![Vector6::zeros(); looks.len()];
    let mut later = Vector6::zeros();
    for (i, step) in steps.iter().enumerate().rev() {
        let (p, b) = (&step.predicted, &step.precision);
        let of_shock = step.gain - b * (p * later);
        let left = Matrix6::identity() - p * b;
        later = step.gain + left.transpose() * later;
        states[i] = step.mean + p * later + step.shock.component_mul(&of_shock);
    }
    states
}

/// `−2 log` of the likelihood with the noise at its own best size, but for a constant.
pub(super) fn deviance(looks: &[Look], ratios: Ratios, moves: Moves) -> f64 {
    filtered(looks, ratios, moves, |_| {}).0
}

/// The deviance, and the noise's variance, mm²; each step of the filter is passed to `keep`.
fn filtered(
    looks: &[Look],
    ratios: Ratios,
    moves: Moves,
    mut keep: impl FnMut(Step),
) -> (f64, f64) {
    let unknown = moves.diagonal([UNKNOWN; 2]);
    let (mut mean, mut covariance) = (Vector6::zeros(), unknown);
    let (mut squares, mut log_determinant) = (0.0, 0.0);
    let (mut rows, mut free) = (0, moves.freedom());
    let mut before_s = looks.first().map_or(0.0, |look| look.at_s);
    for look in looks {
        covariance += moves.diagonal(ratios.walk.map(|own| own * (look.at_s - before_s)));
        before_s = look.at_s;
        if look.jumps {
            covariance += unknown;
            free += moves.freedom();
        }
        let mut shock = moves.diagonal(ratios.shock.map(|own| own / look.looks));
        if look.shaken {
            shock += unknown;
            free += moves.freedom();
        }
        let whole = covariance + shock;
        let away = look.score - look.information * mean;
        let system = Matrix6::identity() + look.information * whole;
        let solved = system.lu();
        let inverse = solved.try_inverse().unwrap_or_else(Matrix6::zeros);
        let gain = inverse * away;
        let precision = symmetric(&(inverse * look.information));
        // |y − H m|² − hᵀ U g
        let apart =
            look.squares - 2.0 * mean.dot(&look.score) + mean.dot(&(look.information * mean));
        squares += apart - away.dot(&(whole * gain));
        log_determinant += solved.determinant().max(f64::MIN_POSITIVE).ln();
        rows += look.rows;
        keep(Step { predicted: covariance, mean, gain, precision, shock: shock.diagonal() });
        mean += covariance * gain;
        covariance = symmetric(&(covariance - covariance * precision * covariance));
    }
    let left = rows.saturating_sub(free).max(1) as f64;
    let noise_mm2 = (squares / left).max(f64::MIN_POSITIVE);
    (left * noise_mm2.ln() + log_determinant, noise_mm2)
}

/// `rᵀ N⁻¹ r` over the directions that N knows, and their number.
fn chi_squared(score: &Vector6<f64>, spread: &Matrix6<f64>, moves: Moves) -> (f64, usize) {
    const KNOWN: f64 = 1e-9;
    if let Some(whole) = of_known(score, spread, moves.freedom()) {
        return (whole, moves.freedom());
    }
    let eigen = spread.symmetric_eigen();
    let largest = eigen.eigenvalues.max();
    let known = (0..6).filter(|&i| eigen.eigenvalues[i] > KNOWN * largest && largest > 0.0);
    known.fold((0.0, 0), |(sum, count), i| {
        let along = eigen.eigenvectors.column(i).dot(score);
        (sum + along * along / eigen.eigenvalues[i], count + 1)
    })
}

/// `rᵀ N⁻¹ r` by elimination, ten times faster than by eigenvalues; `None` where N may lack one of the first `freedom` directions.
fn of_known(score: &Vector6<f64>, spread: &Matrix6<f64>, freedom: usize) -> Option<f64> {
    const SURELY_KNOWN: f64 = 1e-6;
    let (mut left, mut lower) = (*score, *spread);
    let least = SURELY_KNOWN * spread.diagonal().max();
    let mut sum = 0.0;
    for k in 0..freedom {
        let pivot = lower[(k, k)];
        if pivot <= least || pivot.is_nan() {
            return None;
        }
        sum += left[k] * left[k] / pivot;
        for i in k + 1..freedom {
            let share = lower[(i, k)] / pivot;
            left[i] -= share * left[k];
            for j in k + 1..=i {
                lower[(i, j)] -= share * lower[(j, k)];
            }
        }
    }
    Some(sum)
}

fn symmetric(matrix: &Matrix6<f64>) -> Matrix6<f64> {
    (matrix + matrix.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector, SMatrix};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Looks at a walk with partial readings, some looks without any.
    fn looks(
        count: usize,
        rng: &mut ChaCha8Rng,
    ) -> Vec<(SMatrix<f64, 4, 6>, SMatrix<f64, 4, 1>, f64)> {
        let mut number = || rng.random_range(-1.0..1.0);
        (0..count)
            .map(|i| {
                let blank = if i % 4 == 2 { 0.0 } else { 1.0 };
                let h = SMatrix::<f64, 4, 6>::from_fn(|_, _| blank * number());
                let y = SMatrix::<f64, 4, 1>::from_fn(|_, _| blank * number());
                (h, y, i as f64 * 0.7)
            })
            .collect()
    }

    /// The course agrees with a dense Gaussian conditioned at once: means, covariances and every test.
    #[test]
    fn the_course_is_the_dense_conditional() {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let ratios = Ratios { walk: [0.3, 0.1], shock: [0.05, 0.2] };
        let moves = Moves::ShiftsAndTurns;
        let seen = looks(7, &mut rng);
        let n = seen.len();
        let made: Vec<Look> = seen
            .iter()
            .map(|(h, y, at_s)| Look {
                at_s: *at_s,
                information: h.transpose() * h,
                score: h.transpose() * y,
                squares: y.norm_squared(),
                rows: 4,
                looks: 1.0,
                jumps: false,
                shaken: false,
            })
            .collect();
        let found = course(&made, ratios, moves, &mut Vec::new());
        // Dense: u = all states with shocks; prior covariance of s: unknown start + walk up to the earlier of two.
        let diagonal = |own: [f64; 2]| moves.diagonal(own);
        let mut prior = DMatrix::zeros(6 * n, 6 * n);
        for i in 0..n {
            for j in 0..n {
                let until = seen[i.min(j)].2;
                let mut block = diagonal([UNKNOWN; 2]) + diagonal(ratios.walk) * until;
                if i == j {
                    block += diagonal(ratios.shock);
                }
                prior.view_mut((6 * i, 6 * j), (6, 6)).copy_from(&block);
            }
        }
        let mut h = DMatrix::zeros(4 * n, 6 * n);
        let mut y = DVector::zeros(4 * n);
        for (i, (own, reading, _)) in seen.iter().enumerate() {
            h.view_mut((4 * i, 6 * i), (4, 6)).copy_from(own);
            y.rows_mut(4 * i, 4).copy_from(reading);
        }
        let s = &h * &prior * h.transpose() + DMatrix::identity(4 * n, 4 * n);
        let solved = s.clone().try_inverse().unwrap();
        let mean = &prior * h.transpose() * &solved * &y;
        let covariance = &prior - &prior * h.transpose() * &solved * &h * &prior;
        for i in 0..n {
            let (state, own) = &found.states[i];
            assert!(
                (state - mean.rows(6 * i, 6)).amax() < 2e-3,
                "mean of look {i}: {state} {}",
                mean.rows(6 * i, 6)
            );
            let dense = covariance.view((6 * i, 6 * i), (6, 6));
            assert!(
                (own - dense).amax() < 2e-2 * dense.amax().max(1.0),
                "covariance of look {i}: {own} {dense}"
            );
        }
        // Tests: a jump before look i adds to all later states, a shock to one.
        for i in 1..n {
            let mut jump = DMatrix::zeros(6 * n, 6);
            (i..n).for_each(|later| jump.view_mut((6 * later, 0), (6, 6)).fill_with_identity());
            let mut shock = DMatrix::zeros(6 * n, 6);
            shock.view_mut((6 * i, 0), (6, 6)).fill_with_identity();
            for (name, effect, own) in
                [("jump", jump, found.jumps[i]), ("shock", shock, found.shocks[i])]
            {
                let x = &h * effect;
                let score = x.transpose() * &solved * &y;
                let spread = x.transpose() * &solved * &x;
                let spread = Matrix6::from_fn(|a, b| spread[(a, b)]);
                let dense = chi_squared(&Vector6::from_fn(|a, _| score[a]), &spread, moves);
                assert_eq!(own.1, dense.1, "{name} {i}");
                assert!(
                    (own.0 - dense.0).abs() < 1e-2 * (1.0 + dense.0),
                    "{name} {i}: {own:?} {dense:?}"
                );
            }
        }
    }
}
