//! Figures of residual sets, with bounds, coverage and verdicts.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::evaluate::mahalanobis_squared;
use super::{Accuracy, Calibrated, Model, Moment, Point, ResidualSet, Split};
use crate::figures::{Figures, upper_tolerance_bound, upper_tolerance_bound_of};
use crate::grid::{Tolerance, Verdict};

/// The 95 % quantile of chi squared with three degrees of freedom.
const CHI_SQUARED_3_95: f64 = 7.814_727_903;

/// The figures of one set; `folds` says in which block a station lies, where blocks were held out.
pub fn accuracy(set: &ResidualSet, tolerance: &Tolerance, guard_mm: f64) -> Accuracy {
    let judged: Vec<_> = set
        .residuals
        .iter()
        .filter(|residual| !residual.used_for_refit)
        .collect();
    let norms: Vec<f64> = judged
        .iter()
        .map(|residual| residual.residual.norm())
        .collect();
    let bound = upper_tolerance_bound(&norms, tolerance.coverage());
    let verdict = match set.subject.split {
        Split::None => Verdict::NotShown("the stations took part in the fit".to_owned()),
        Split::Blocks | Split::Session => tolerance.verdict(bound, norms.len(), guard_mm),
    };
    let moment = match set.subject.model {
        Model::RawCommand | Model::BaseTarget => Moment::Before,
        Model::Geometric | Model::Full => Moment::After,
        // A table has residuals only in a session that it drove.
        Model::Table => Moment::MeasuredAfter,
    };
    let blocks: BTreeSet<_> = judged.iter().filter_map(|residual| residual.fold).collect();
    let distances: Vec<f64> = judged
        .iter()
        .filter_map(|residual| mahalanobis_squared(residual))
        .collect();
    Accuracy {
        subject: set.subject.clone(),
        point: match set.subject.model {
            Model::Table => Point::Tool,
            Model::RawCommand | Model::BaseTarget | Model::Geometric | Model::Full => {
                Point::Measured
            }
        },
        moment,
        driven_by: None,
        figures: Figures::of(&norms),
        bound,
        blocks: (set.subject.split == Split::Blocks).then_some(blocks.len()),
        coverage: calibrated(&distances),
        expanded_uncertainty_mm: guard_mm,
        verdict,
    }
}

/// The same figures with the bound of commands of another day: `moved` is by how much a station's error may have been another
/// on another day, mm, several for each station ([`crate::method::accuracy`]: what a table will do, not what one
/// session did). Never less than the session's own bound.
pub fn of_another_day<'m>(
    own: Accuracy,
    set: &ResidualSet,
    moved: impl Fn(usize) -> &'m [Vector3<f64>],
    tolerance: &Tolerance,
) -> Accuracy {
    let judged = || set.residuals.iter().filter(|r| !r.used_for_refit);
    let norms: Vec<f64> = judged()
        .flat_map(|r| {
            moved(r.station)
                .iter()
                .map(|moved| (r.residual + moved).norm())
        })
        .collect();
    let stations = judged().count();
    let another_day = upper_tolerance_bound_of(&norms, stations, tolerance.coverage());
    let bound = own
        .bound
        .map(|bound| another_day.map_or(bound, |other| bound.max(other)));
    Accuracy {
        verdict: tolerance.verdict(bound, stations, own.expanded_uncertainty_mm),
        bound,
        ..own
    }
}

fn calibrated(distances: &[f64]) -> Option<Calibrated> {
    let n = distances.len() as f64;
    let inside = distances.iter().filter(|&&d| d <= CHI_SQUARED_3_95).count() as f64;
    (!distances.is_empty()).then(|| Calibrated {
        inside: inside / n,
        mean_squared_distance: distances.iter().sum::<f64>() / n,
    })
}
