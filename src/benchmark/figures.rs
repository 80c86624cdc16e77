//! Figures of the errors of one model on the stations of a split.

use serde::{Deserialize, Serialize};

use super::{Draws, PredictionError};
use crate::figures::Figures;
use crate::report::accuracy::is_inside;

/// The figures of a benchmark.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FigureName {
    /// Mean error, mm.
    Mean,
    /// Root mean square error, mm.
    Rms,
    /// 95th percentile of the errors, mm.
    P95,
    /// Largest error, mm.
    Max,
    /// Share of stations inside the 95 % ellipsoid of their prediction.
    Coverage,
    /// One minus the mean error over that of base + target.
    Improvement,
    /// The mean error minus that of the full error model, mm.
    Difference,
}

/// The errors of models that others are held against, at the same stations.
#[derive(Debug, Clone, Copy, Default)]
pub struct References<'r> {
    /// Errors of the nominal arm with base and target fitted.
    pub base_target: Option<&'r [PredictionError]>,
    /// Errors of the full error model.
    pub full: Option<&'r [PredictionError]>,
}

/// A figure with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// Its name.
    pub name: FigureName,
    /// Its value.
    pub value: f64,
    /// Its bootstrap interval; `None` of too few blocks.
    pub interval: Option<[f64; 2]>,
}

impl FigureName {
    /// All, in the order of display.
    pub const ALL: [Self; 7] = [
        Self::Mean,
        Self::Rms,
        Self::P95,
        Self::Max,
        Self::Coverage,
        Self::Improvement,
        Self::Difference,
    ];

    /// Whether it is a length in mm, otherwise a share.
    pub const fn is_length(self) -> bool {
        !matches!(self, Self::Coverage | Self::Improvement)
    }

    /// Its name for people.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Mean => "mean",
            Self::Rms => "rms",
            Self::P95 => "p95",
            Self::Max => "max",
            Self::Coverage => "coverage",
            Self::Improvement => "improvement",
            Self::Difference => "difference",
        }
    }
}

/// The figures of `errors`. Coverage needs a covariance of every prediction, improvement and difference a reference.
pub fn figures(
    errors: &[PredictionError],
    references: References<'_>,
    draws: Option<&Draws>,
) -> Vec<Figure> {
    let of = |places: &[usize]| values(errors, references, places);
    let all: Vec<usize> = (0..errors.len()).collect();
    let intervals = draws.map(|draws| draws.intervals(of));
    let has_covariances =
        !errors.is_empty() && errors.iter().all(|own| own.mahalanobis_squared.is_some());
    let is_there = |name: FigureName| match name {
        FigureName::Coverage => has_covariances,
        FigureName::Improvement => references.base_target.is_some(),
        FigureName::Difference => references.full.is_some(),
        _ => !errors.is_empty(),
    };
    let named = FigureName::ALL.into_iter().zip(of(&all)).enumerate();
    let figure = |(place, (name, value)): (usize, (FigureName, f64))| Figure {
        name,
        value,
        interval: intervals.map(|own| own[place]),
    };
    named.map(figure).filter(|own| is_there(own.name)).collect()
}

/// Every figure of the stations at `places`, in the order of [`FigureName::ALL`]; zeros where there is nothing.
fn values(errors: &[PredictionError], references: References<'_>, places: &[usize]) -> [f64; 7] {
    let distances = |of: &[PredictionError]| -> Vec<f64> {
        places.iter().map(|&place| of[place].distance_mm).collect()
    };
    let Some(own) = Figures::of(&distances(errors)) else {
        return [0.0; 7];
    };
    let inside = places.iter().filter_map(|&place| errors[place].mahalanobis_squared);
    let inside = inside.filter(|&squared| is_inside(squared)).count();
    let mean = |of: Option<&[PredictionError]>| Some(Figures::of(&distances(of?))?.mean);
    let improvement = mean(references.base_target).map_or(0.0, |before| 1.0 - own.mean / before);
    let difference = mean(references.full).map_or(0.0, |full| own.mean - full);
    let coverage = inside as f64 / places.len() as f64;
    [own.mean, own.rms, own.p95, own.max, coverage, improvement, difference]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(of: impl Fn(usize) -> (f64, Option<f64>)) -> Vec<PredictionError> {
        let error = |place| {
            let (distance_mm, mahalanobis_squared) = of(place);
            PredictionError { distance_mm, mahalanobis_squared }
        };
        (0..20).map(error).collect()
    }

    #[test]
    fn figures_of_plain_errors_are_as_by_hand() {
        // 0.1, 0.2, … 2.0 mm: mean 1.05; rms √((21·41)/6)/10 = 1.1979; p95 at rank 18.05: 1.905.
        let own =
            errors(|place| (0.1 * (place + 1) as f64, Some(if place < 19 { 1.0 } else { 9.0 })));
        let before = errors(|_| (2.1, None));
        let full = errors(|_| (1.0, None));
        let references = References { base_target: Some(&before), full: Some(&full) };
        let found = figures(&own, references, None);
        let values: Vec<f64> = found.iter().map(|own| own.value).collect();
        let expected = [1.05, 1.197_915, 1.905, 2.0, 0.95, 0.5, 0.05];
        assert_eq!(values.len(), expected.len());
        for (value, expected) in values.iter().zip(expected) {
            assert!((value - expected).abs() < 1e-6, "{values:?}");
        }
        let without = figures(&before, References::default(), None);
        assert_eq!(
            without.len(),
            4,
            "no coverage without covariances, no improvement or difference alone"
        );
    }
}
