//! A joint's own errors: a smooth random curve and a gear's weak sine, both of the reported angle.

use std::f64::consts::TAU;

use serde::Serialize;

use super::random::Stream;

/// Harmonics of an error curve: enough for its fast part, correlated over 6°.
const HARMONICS: usize = 60;
/// Correlation length of the slow part, rad (50°).
const SLOW: f64 = 0.872_664_625_997_164_8;
/// Correlation length of the fast part, rad (6°).
const FAST: f64 = 0.104_719_755_119_659_77;
/// A joint error curve `Σ_k a_k cos kq + b_k sin kq`, rad; it repeats after a full turn and has no constant part.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct JointCurve {
    /// `a_k`, from k = 1, rad.
    pub cosines: Vec<f64>,
    /// `b_k`, from k = 1, rad.
    pub sines: Vec<f64>,
}

/// A gear's error: a sine of the unwrapped reported angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GearLine {
    /// Cycles per turn, a multiple of one half.
    pub cycles: f64,
    pub amplitude_rad: f64,
    /// Phase at angle 0, rad.
    pub phase_rad: f64,
}

impl JointCurve {
    pub(super) fn draw(stream: &mut Stream, slow_rad: f64, fast_rad: f64) -> Self {
        // Amplitudes are the square roots of the kernels' spectral densities: squared exponential and Matérn 3/2.
        let slow = |k: f64| (-(k * SLOW).powi(2) / 4.0).exp();
        let fast = |k: f64| 1.0 / (1.0 + (k * FAST).powi(2) / 3.0);
        let order = |k: usize| (k + 1) as f64;
        let power = |shape: &dyn Fn(f64) -> f64| -> f64 {
            (0..HARMONICS).map(|k| shape(order(k)).powi(2)).sum::<f64>().sqrt()
        };
        let (slow_norm, fast_norm) = (power(&slow), power(&fast));
        let mut amplitudes = || {
            (0..HARMONICS)
                .map(|k| {
                    let slow = slow_rad * slow(order(k)) / slow_norm * stream.normal();
                    slow + fast_rad * fast(order(k)) / fast_norm * stream.normal()
                })
                .collect()
        };
        Self { cosines: amplitudes(), sines: amplitudes() }
    }

    /// The error at the joint angle `q` (rad), rad.
    pub fn at(&self, q: f64) -> f64 {
        let (sine, cosine) = q.sin_cos();
        let (mut s, mut c) = (sine, cosine);
        let mut error = 0.0;
        for (a, b) in self.cosines.iter().zip(&self.sines) {
            error += a * c + b * s;
            (s, c) = (s * cosine + c * sine, c * cosine - s * sine);
        }
        error
    }
}

impl GearLine {
    /// The line `cos_rad · cos(cycles q) + sin_rad · sin(cycles q)`.
    pub fn of(cycles: f64, cos_rad: f64, sin_rad: f64) -> Self {
        Self { cycles, amplitude_rad: cos_rad.hypot(sin_rad), phase_rad: cos_rad.atan2(sin_rad) }
    }

    pub(super) fn draw(stream: &mut Stream, amplitude_rad: f64) -> Self {
        Self {
            cycles: stream.between(120.0, 800.0).round() / 2.0,
            amplitude_rad: amplitude_rad * stream.between(0.5, 1.5),
            phase_rad: stream.between(0.0, TAU),
        }
    }

    /// The error at the joint angle `q` (rad), rad.
    pub fn at(&self, q: f64) -> f64 {
        self.amplitude_rad * (self.cycles * q + self.phase_rad).sin()
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::Ingredient;
    use super::*;

    #[test]
    fn a_curve_has_the_size_asked_for_and_repeats_after_a_turn() {
        let mut stream = Stream::new(11, Ingredient::JointCurves);
        let mut power = 0.0;
        for _ in 0..200 {
            let curve = JointCurve::draw(&mut stream, 1e-4, 0.0);
            power +=
                (0..360).map(|d| curve.at(f64::from(d).to_radians()).powi(2)).sum::<f64>() / 360.0;
            assert!((curve.at(0.3) - curve.at(0.3 + TAU)).abs() < 1e-15);
        }
        // Mean power of 200 curves of a few harmonics each: 1e-8 within 15 %.
        assert!((power / 200.0 / 1e-8 - 1.0).abs() < 0.15, "{power}");
    }

    #[test]
    fn the_recurrence_is_the_fourier_sum() {
        let mut stream = Stream::new(5, Ingredient::JointCurves);
        let curve = JointCurve::draw(&mut stream, 1e-4, 1e-4);
        let q = 2.1_f64;
        let direct: f64 = (0..HARMONICS)
            .map(|k| {
                let angle = (k + 1) as f64 * q;
                curve.cosines[k] * angle.cos() + curve.sines[k] * angle.sin()
            })
            .sum();
        assert!((curve.at(q) - direct).abs() < 1e-15);
    }
}
