//! Kernels on the circle as variances of Fourier coefficients.
//!
//! A stationary kernel on the chord distance `2 sin(Δq/2)` repeats after a turn, so it is a cosine series: the k-th pair
//! `cos kq, sin kq` has prior variance `c_k`, the kernel's k-th cosine coefficient. Length scales and amplitudes change
//! only these variances, never the features, so hyper-parameter steps cost nothing in the number of stations.

use std::f64::consts::{SQRT_2, TAU};

/// Number of angles at which a kernel is sampled for its series; far more than twice any number of harmonics in use.
const SAMPLES: usize = 2048;

/// A kernel of unit variance on the chord distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kernel {
    /// Matérn 5/2 with a length, rad: twice differentiable, for the errors of gears.
    Matern52(f64),
    /// Squared exponential with a length, rad: smooth, for errors over a whole turn.
    SquaredExponential(f64),
}

impl Kernel {
    fn at(self, chord: f64) -> f64 {
        match self {
            Self::Matern52(length) => {
                let a = 5.0f64.sqrt() * chord / length;
                (1.0 + a + a * a / 3.0) * (-a).exp()
            }
            Self::SquaredExponential(length) => (-(chord / (SQRT_2 * length)).powi(2)).exp(),
        }
    }

    /// Variances of the constant and of the pairs `cos kq, sin kq` for k = 1 … `harmonics`; never negative.
    pub fn variances(self, harmonics: usize) -> Vec<f64> {
        let step = TAU / SAMPLES as f64;
        let mut sums = vec![0.0; harmonics + 1];
        // The k-th cosine at the i-th angle equals the first cosine at the (i k)-th.
        let cosines: Vec<f64> = (0..SAMPLES).map(|i| (step * i as f64).cos()).collect();
        for i in 0..SAMPLES {
            let value = self.at(2.0 * (0.5 * step * i as f64).sin().abs());
            for (k, sum) in sums.iter_mut().enumerate() {
                *sum += value * cosines[i * k % SAMPLES];
            }
        }
        let share = |k: usize| if k == 0 { 1.0 } else { 2.0 };
        let means = sums.iter().enumerate();
        means.map(|(k, sum)| (share(k) * (sum / SAMPLES as f64)).max(0.0)).collect()
    }
}

/// The series of kernels that several joints share, each computed once.
#[derive(Debug, Default)]
pub(super) struct Spectra {
    found: Vec<(Kernel, Vec<f64>)>,
}

impl Spectra {
    pub(super) fn variances(&mut self, kernel: Kernel, harmonics: usize) -> Vec<f64> {
        let mut known = self.found.iter();
        let known = known.find(|(own, series)| *own == kernel && series.len() > harmonics);
        if let Some((_, series)) = known {
            return series[..=harmonics].to_vec();
        }
        let series = kernel.variances(harmonics);
        self.found.push((kernel, series.clone()));
        series
    }
}

/// Variances of a smooth function on `[0, span]` in the basis `cos(π k t / span)`, k = 1 … `count`, of unit total.
///
/// The spectral density of a Matérn 3/2 of `length`, sampled at the basis' frequencies: a slow function whose faster parts
/// are small but not ruled out, as a squared exponential's would be.
pub(super) fn smooth_variances(span: f64, length: f64, count: usize) -> Vec<f64> {
    let density = |k: usize| {
        let turn = std::f64::consts::PI * k as f64 / span * length;
        (1.0 + turn * turn / 3.0).powi(-2)
    };
    // The constant, which the base frame owns, takes half a share.
    let total = 0.5 + (1..=count).map(density).sum::<f64>();
    (1..=count).map(|k| density(k) / total).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_gives_the_kernel_back() {
        let kernel = Kernel::SquaredExponential(50.0f64.to_radians());
        let variances = kernel.variances(30);
        for angle in [0.0, 0.3, 1.0, 3.0] {
            let series: f64 =
                variances.iter().enumerate().map(|(k, c)| c * (k as f64 * angle).cos()).sum();
            assert!((series - kernel.at(2.0 * (angle / 2.0).sin())).abs() < 1e-9);
        }
    }

    #[test]
    fn a_series_that_is_known_is_the_one_that_would_be_computed() {
        let kernel = Kernel::Matern52(6.0f64.to_radians());
        let mut spectra = Spectra::default();
        for harmonics in [20, 12, 30, 30] {
            assert_eq!(spectra.variances(kernel, harmonics), kernel.variances(harmonics));
        }
        let other = Kernel::Matern52(7.0f64.to_radians());
        assert_eq!(spectra.variances(other, 5), other.variances(5));
    }

    #[test]
    fn sixty_harmonics_hold_nearly_all_of_six_degrees() {
        let total: f64 = Kernel::Matern52(6.0f64.to_radians()).variances(60).iter().sum();
        assert!(total > 0.98 && total < 1.0 + 1e-9, "{total}");
    }
}
