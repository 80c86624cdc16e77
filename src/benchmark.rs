//! Benchmark: predictions of any program for stations that it did not learn from → figures by one code, with intervals.
//!
//! Inputs: a [`suite`] of open data with fixed splits, and predicted positions beside measured ones ([`Compared`]). Output: figures
//! with bootstrap intervals ([`figures()`]), and whether a split leaks ([`leak`]). Steps for a split ([`crate::method::accuracy`] has the
//! reasons):
//! 1. the frame of the predictions is that of the training, or is aligned with stations that the split names ([`placed`]);
//! 2. predictions that are in another unit or frame are recognised ([`unlike()`]) and refused;
//! 3. figures of the errors, and intervals by drawing whole blocks of the work space ([`bootstrap`]);
//! 4. a split whose test stations stand among the training ones is named so.

pub mod bootstrap;
pub mod figures;
pub mod leak;
pub mod numbers;
pub mod suite;
pub mod unlike;

use nalgebra::{Matrix3, Point3};

use crate::geometry::align;
use crate::report::{Residual, mahalanobis_squared};

pub use bootstrap::{BootstrapSettings, Draws};
pub use figures::{Figure, FigureName, References, figures};
pub use leak::{Mixed, mixed};
pub use numbers::Numbers;
pub use suite::{Suite, SuiteError};
pub use unlike::{Unlike, unlike};

/// A measured and a predicted position of one station, in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Compared {
    /// The measured position, mm.
    pub measured: Point3<f64>,
    /// The predicted position, mm.
    pub predicted: Point3<f64>,
    /// Covariance of measured minus predicted, mm²; `None` where none is stated.
    pub covariance: Option<Matrix3<f64>>,
}

/// The error of a prediction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictionError {
    /// Distance of measured and predicted position, mm.
    pub distance_mm: f64,
    /// Squared Mahalanobis distance; `None` without a covariance.
    pub mahalanobis_squared: Option<f64>,
}

impl From<&Residual> for Compared {
    fn from(residual: &Residual) -> Self {
        Self {
            measured: residual.attained,
            predicted: residual.predicted(),
            covariance: residual.covariance,
        }
    }
}

impl Compared {
    /// Its error.
    pub fn error(&self) -> PredictionError {
        let away = self.measured - self.predicted;
        let covariance = self.covariance.as_ref();
        PredictionError {
            distance_mm: away.norm(),
            mahalanobis_squared: covariance.and_then(|own| mahalanobis_squared(&away, own)),
        }
    }
}

/// Predictions moved as one rigid body onto the measured positions of the stations at `finders`; `None` where these do not span
/// space. What is moved so states no covariance: that of the frame found is not known.
pub fn placed(compared: &[Compared], finders: &[usize]) -> Option<Vec<Compared>> {
    let of = |part: fn(&Compared) -> Point3<f64>| -> Vec<Point3<f64>> {
        finders.iter().map(|&place| part(&compared[place])).collect()
    };
    let moved =
        align(&of(|own| own.measured), &of(|own| own.predicted), &vec![1.0; finders.len()])?;
    let place =
        |own: &Compared| Compared { predicted: moved * own.predicted, covariance: None, ..*own };
    Some(compared.iter().map(place).collect())
}
