//! Errors of a session in the base of another mounting say nothing: they are how far the arm or the tracker was moved.

use super::lengths::reads_places;
use super::observed::Observed;
use crate::figures::median;
use crate::report::{BaseRefit, Model, ResidualSet, Split};

/// A base that is further than this from where training had it was mounted anew, mm: drift and settling are tenths of a millimetre.
const MOVED_MM: f64 = 10.0;

/// The residuals without those of sessions in a base that is another mounting's. Of a training without positions its own sessions have none.
pub(super) fn of_one_mounting(
    mut residuals: Vec<ResidualSet>,
    observed: &Observed,
) -> Vec<ResidualSet> {
    if !reads_places(observed) {
        residuals.retain(|set| !set.residuals.is_empty());
    }
    without_moved(residuals)
}

fn without_moved(residuals: Vec<ResidualSet>) -> Vec<ResidualSet> {
    let moved: Vec<String> = residuals
        .iter()
        .filter(|set| set.subject.model == Model::BaseTarget && is_of_training(set))
        .filter(|set| is_moved(set, &residuals))
        .map(|set| set.subject.of_session.clone())
        .collect();
    let means_something =
        |set: &ResidualSet| !(is_of_training(set) && moved.contains(&set.subject.of_session));
    residuals.into_iter().filter(means_something).collect()
}

/// Whether the errors are of a session that took no part, in the base of training.
fn is_of_training(set: &ResidualSet) -> bool {
    (set.subject.split, set.subject.base_refit) == (Split::Session, BaseRefit::None)
}

/// Whether the session's own base leaves so much less that training's must be another one.
fn is_moved(set: &ResidualSet, residuals: &[ResidualSet]) -> bool {
    let own = &set.subject;
    let is_own_base = |other: &&ResidualSet| {
        let other = &other.subject;
        (other.model, other.split, other.angles) == (own.model, own.split, own.angles)
            && other.of_session == own.of_session
            && other.base_refit != BaseRefit::None
    };
    let median_mm = |set: &ResidualSet| {
        median(&set.residuals.iter().map(|own| own.residual.norm()).collect::<Vec<f64>>())
    };
    let in_own_base = residuals.iter().find(is_own_base).and_then(median_mm);
    in_own_base.zip(median_mm(set)).is_some_and(|(own_mm, mm)| mm - own_mm > MOVED_MM)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Angles, Residual, Subject};
    use nalgebra::{Point3, Vector3};

    fn set(model: Model, session: &str, base_refit: BaseRefit, mm: f64) -> ResidualSet {
        let residual = Residual {
            station: 1,
            target: None,
            pose: 1,
            fold: None,
            used_for_refit: false,
            attained: Point3::origin(),
            residual: Vector3::new(mm, 0.0, 0.0),
            covariance: None,
            weight: None,
            turn: None,
        };
        ResidualSet {
            subject: Subject {
                split: Split::Session,
                of_session: session.to_owned(),
                model,
                angles: Angles::Reported,
                base_refit,
            },
            residuals: vec![residual],
        }
    }

    #[test]
    fn errors_in_the_base_of_another_mounting_are_left_out() {
        let of = |session, mm| {
            [Model::BaseTarget, Model::Full].map(|model| {
                [BaseRefit::None, BaseRefit::First].map(|refit| {
                    set(model, session, refit, if refit == BaseRefit::None { mm } else { 0.7 })
                })
            })
        };
        // Tuesday drifted by two millimetres, Friday's tracker stands somewhere else.
        let all = [of("tue", 2.7), of("fri", 3350.0)];
        let kept = without_moved(all.concat().concat());
        let of_training = |set: &&ResidualSet| set.subject.base_refit == BaseRefit::None;
        let kept_none: Vec<&str> =
            kept.iter().filter(of_training).map(|set| &*set.subject.of_session).collect();
        assert_eq!(kept_none, ["tue", "tue"]);
        assert_eq!(kept.len(), 6, "bases of their own stay");
    }
}
