//! Losses on a station's whitened residual: the weight of stations that fit badly.

use serde::{Deserialize, Serialize};

use crate::figures::median;
use crate::join::ReadingKind;

/// The decrease of a station's weight with its whitened residual norm over the robust scale.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", tag = "kind")]
pub enum Loss {
    #[default]
    Squares,
    /// Huber's: full weight up to `tuning`, then falling as 1/s.
    Huber { tuning: f64 },
    /// Cauchy's: `1/(1 + (s/tuning)²)`.
    Cauchy { tuning: f64 },
}

impl Loss {
    /// The weight of a station whose whitened residual norm is `s` robust scales.
    pub fn weight(self, s: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber { tuning } => (tuning / s).min(1.0),
            Self::Cauchy { tuning } => (1.0 + (s / tuning).powi(2)).recip(),
        }
    }

    /// The weights of the readings of one source from their whitened residual norms, scaled by their median; `numbers` is the number
    /// of values in a reading, one of a length or three of a place.
    ///
    /// The scale is the median of the norms over the median norm of a unit Gaussian, so that a model whose misfit is far above
    /// the noise does not make all readings outliers.
    pub fn weights(self, norms: &[f64], numbers: Numbers) -> Vec<f64> {
        let scale = median(norms).unwrap_or(0.0) / numbers.median_norm();
        if matches!(self, Self::Squares) || scale <= 0.0 {
            return vec![1.0; norms.len()];
        }
        norms.iter().map(|norm| self.weight(norm / scale)).collect()
    }
}

/// Number of values in a reading, by which its whitened norm is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Numbers {
    One,
    /// A position; a pose counts as its position does, so that a tuning constant has one meaning for both.
    Three,
}

impl Numbers {
    pub const fn of(kind: ReadingKind) -> Self {
        if kind.is_length() { Self::One } else { Self::Three }
    }

    /// Median of the norm of a unit Gaussian in so many dimensions.
    const fn median_norm(self) -> f64 {
        match self {
            Self::One => 0.674_489_750_196,
            Self::Three => 1.538_172_254,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_as_the_formulas_say() {
        assert!((Loss::Huber { tuning: 2.0 }.weight(1.0) - 1.0).abs() < 1e-15);
        assert!((Loss::Huber { tuning: 2.0 }.weight(8.0) - 0.25).abs() < 1e-15);
        assert!((Loss::Cauchy { tuning: 2.0 }.weight(4.0) - 0.2).abs() < 1e-15);
        assert_eq!(Loss::Squares.weights(&[1.0, 100.0], Numbers::Three), [1.0, 1.0]);
    }

    #[test]
    fn one_gross_error_hardly_counts() {
        let mut norms = vec![1.5; 50];
        norms.push(150.0);
        let weights = Loss::Cauchy { tuning: 2.5 }.weights(&norms, Numbers::Three);
        assert!(weights[50] < 1e-3 && weights[0] > 0.7);
    }

    #[test]
    fn lengths_and_places_in_units_of_their_noise_have_the_same_scale() {
        let loss = Loss::Cauchy { tuning: 2.0 };
        // Median norms of unit Gaussians in one and in three dimensions, then one of four standard deviations.
        let of = |numbers, median: f64| loss.weights(&[median, median, 4.0], numbers)[2];
        let [length, place] = [of(Numbers::One, 0.674_49), of(Numbers::Three, 1.538_172)];
        assert!((length - 0.2).abs() < 1e-5 && (place - 0.2).abs() < 1e-5);
    }
}
