//! Figures of residual sets, with bounds, coverage and verdicts.

use std::collections::BTreeSet;

use nalgebra::Vector3;

use super::{Accuracy, Calibrated, Moment, Point, ResidualSet, Split};
use crate::figures::{CHI_SQUARED_3_95, Counted, Figures};
use crate::fit::Corrects;
use crate::grid::{Tolerance, Verdict};

/// The figures of one set; `folds` gives the block of each station, where blocks were held out.
pub fn accuracy(set: &ResidualSet, tolerance: &Tolerance, guard_mm: f64) -> Accuracy {
    let judged: Vec<_> = set.judged().collect();
    let norms: Vec<f64> = judged.iter().map(|residual| residual.residual.norm()).collect();
    let by_pose = set.by_pose(|residual| [residual.residual.norm()]);
    let (bound, counted) = (by_pose.bound(tolerance.coverage()), by_pose.counted());
    let verdict = match set.subject.split {
        Split::None => Verdict::NotShown("the stations took part in the fit".to_owned()),
        Split::Blocks | Split::Session => {
            explained(set, counted, tolerance.verdict(bound, counted, guard_mm))
        }
    };
    let (point, moment) = match set.subject.model.about().corrects {
        Corrects::Nothing | Corrects::Frames => (Point::Measured, Moment::Before),
        Corrects::Predicted => (Point::Measured, Moment::After),
        // A table has residuals only in a session that it drove.
        Corrects::Commands => (Point::Tool, Moment::MeasuredAfter),
    };
    let blocks: BTreeSet<_> = judged.iter().filter_map(|residual| residual.fold).collect();
    let distances: Vec<f64> =
        judged.iter().filter_map(|residual| residual.mahalanobis_squared()).collect();
    Accuracy {
        subject: set.subject.clone(),
        point,
        moment,
        driven_by: None,
        figures: Figures::of(&norms),
        bound,
        counted,
        finders: None,
        blocks: (set.subject.split == Split::Blocks).then_some(blocks.len()),
        coverage: calibrated(&distances),
        expanded_uncertainty_mm: guard_mm,
        verdict,
    }
}

/// Figures whose bound includes between-session variation: `moved` are the changes of a station's error that another
/// session may bring, mm, several for each station ([`crate::method::accuracy`]: the errors that a table will leave, not
/// those of one session). The bound is never less than the session's own.
pub fn with_between_session_variation<'m>(
    own: Accuracy,
    set: &ResidualSet,
    moved: impl Fn(usize) -> &'m [Vector3<f64>],
    tolerance: &Tolerance,
) -> Accuracy {
    let by_pose = set.by_pose(|r| {
        let (others, own) = (moved(r.station), r.residual);
        others.iter().map(move |moved| (own + moved).norm())
    });
    let between_sessions = by_pose.bound(tolerance.coverage());
    let bound = own.bound.map(|bound| between_sessions.map_or(bound, |other| bound.max(other)));
    Accuracy {
        verdict: tolerance.verdict(bound, own.counted, own.expanded_uncertainty_mm),
        bound,
        ..own
    }
}

/// A verdict; one that is not shown also states how many stations that could have judged were used for the session's base.
fn explained(set: &ResidualSet, counted: Counted, verdict: Verdict) -> Verdict {
    let Verdict::NotShown(reason) = verdict else { return verdict };
    // A station with readings of several targets counts once.
    let judged: BTreeSet<usize> = set.judged().map(|own| own.station).collect();
    let taken = set.finders();
    let again = judged.len() - counted.visits;
    Verdict::NotShown(match (taken, again) {
        (0, _) => reason,
        (taken, 0) => {
            format!("{reason}; {taken} stations find the base ([report] locate)")
        }
        (taken, again) => format!(
            "{reason}; {taken} stations find the base ([report] locate), and {again} more are visits of their poses"
        ),
    })
}

fn calibrated(distances: &[f64]) -> Option<Calibrated> {
    let n = distances.len() as f64;
    let inside = distances.iter().filter(|&&d| d <= CHI_SQUARED_3_95).count() as f64;
    (!distances.is_empty()).then(|| Calibrated {
        inside: inside / n,
        mean_squared_distance: distances.iter().sum::<f64>() / n,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::report::{Angles, BaseRefit, Model, Residual, Subject};

    const TOLERANCE: Tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };

    /// Visits of `poses` poses, `rounds` times in turn, the first `first` of which find the base; later rounds leave more.
    fn visits(poses: usize, rounds: usize, first: usize) -> ResidualSet {
        let residual = |station: usize| Residual {
            station,
            target: None,
            pose: station % poses,
            fold: None,
            used_for_refit: station < first,
            attained: Point3::origin(),
            residual: Vector3::new(0.1 * (1 + station / poses) as f64, 0.0, 0.0),
            covariance: None,
            weight: None,
            turn: None,
        };
        ResidualSet {
            subject: Subject {
                split: Split::Session,
                of_session: "tue".to_owned(),
                model: Model::Full,
                angles: Angles::Commanded,
                base_refit: BaseRefit::First,
            },
            residuals: (0..poses * rounds).map(residual).collect(),
        }
    }

    #[test]
    fn thirty_poses_show_nothing_however_often_they_are_visited() {
        let of = accuracy(&visits(30, 6, 0), &TOLERANCE, 0.0);
        assert_eq!((of.counted.poses, of.counted.visits), (30, 180));
        assert_eq!((of.bound, of.figures.map(|f| f.n)), (None, Some(180)));
        assert_eq!(
            of.verdict,
            Verdict::NotShown(
                "30 poses in 180 visits held out; 59 poses are needed for 95 % with 95 % confidence"
                    .to_owned()
            )
        );
        // Sixty poses are enough, by the worst of their visits: the third round's 0.3 mm.
        let of = accuracy(&visits(60, 3, 0), &TOLERANCE, 0.0);
        assert!(of.bound.is_some_and(|bound| (bound - 0.3).abs() < 1e-12), "{of:?}");
    }

    #[test]
    fn poses_that_found_the_base_do_not_judge() {
        let of = accuracy(&visits(60, 2, 50), &TOLERANCE, 0.0);
        // Ten poses are left, each visited twice; the figures cover all stations that did not find the base.
        assert_eq!((of.counted.poses, of.counted.visits), (10, 20));
        assert_eq!(of.figures.map(|figures| figures.n), Some(70));
        let Verdict::NotShown(reason) = of.verdict else { panic!("{:?}", of.verdict) };
        let expected =
            "50 stations find the base ([report] locate), and 50 more are visits of their poses";
        assert!(reason.ends_with(expected), "{reason}");
    }
}
