//! Residuals of models on a session they never saw, with each way to find its base.
//!
//! Inputs: trained models, the session's observations, the stations that find its frames ([`Locator`]). Output: residual sets.
//! Base and target come from stations that do not judge. By the full error model they are estimated by generalised least squares, and
//! the covariance of what remains includes everything that may differ in another session ([`crate::fit::full::elsewhere`]). Other
//! models count all stations alike and state no covariance.

use nalgebra::{Isometry3, Matrix3, Point3, Vector3};

use super::evaluate::{Predicted, Stations, known_ones, placed, predictions, target_read, turned};
use super::locate::{Located, Locator};
use super::refit::{self, Placed, Refit};
use super::tip::{Turn, without_constant};
use super::{BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::fit::locate::{Estimator, Poses};
use crate::fit::{Models, Observation, PoseModel, TargetId};
use crate::join::SeveralSources;

/// Residuals of `models` on a session they never saw, whose frames are found as `located` says; refused where the models know several
/// sources, for a base is found with one.
pub fn unseen_session(
    models: &Models,
    stations: Stations<'_>,
    locator: &Locator,
    located: &Located,
) -> Result<Vec<ResidualSet>, SeveralSources> {
    let mut sets = Vec::new();
    let with_target = located.with_target();
    // A session with a mounting of its own has no base without a refit.
    let refits = [BaseRefit::None, locator.locate.base_refit(), BaseRefit::All];
    for (model, angles) in Model::compared() {
        let observations = &*known_ones(stations.observations, angles);
        let place = |finder: &usize| {
            let own = &stations.observations[*finder];
            let is_it = |other: &Observation| {
                (other.station, other.channel()) == (own.station, own.channel())
            };
            observations.iter().position(is_it)
        };
        let finders: Option<Vec<usize>> = located.finders.iter().map(place).collect();
        let found = predictions(models, model, angles, observations, false).zip(finders);
        let Some(((it, predictions), finders)) = found else { continue };
        let trained = it.frames()[models.latest()].main()?;
        let to_base = trained.tracker_from_base.isometry().inverse();
        let placed: Vec<Placed> = predictions.iter().map(|p| placed(&p.target, &to_base)).collect();
        let noise = noise(it, &predictions, observations, models.latest(), &to_base);
        let own_target = located.target_sd_mm;
        let poses = match model {
            Model::Full => locator.poses(observations, angles, &placed, own_target, noise),
            _ => None,
        };
        let unseen = Unseen {
            targets: observations.iter().map(|o| target_read(models, o)).collect(),
            model: it,
            predictions: &predictions,
            placed: &placed,
            to_base: &to_base,
            with_target,
            poses,
        };
        for &base_refit in &refits[usize::from(with_target)..] {
            let of = (Split::Session, stations.session);
            let subject = Subject::new(of, model, angles, base_refit);
            if let Some(found) = unseen.found(observations, base_refit, &finders) {
                let residuals = unseen.residuals(observations, &found);
                sets.push(ResidualSet { subject, residuals });
            }
        }
    }
    Ok(sets)
}

/// Noise of each measured position and of unknown settling errors, in the base's axes, mm²; by the frames of a session that trained.
fn noise(
    model: &dyn PoseModel,
    predictions: &[Predicted],
    observations: &[Observation],
    session: usize,
    to_base: &Isometry3<f64>,
) -> Vec<Matrix3<f64>> {
    let to_tracker = to_base.inverse();
    let own = predictions.iter().zip(observations);
    own.map(|(predicted, o)| turned(&(model.noise(o, session) + predicted.alone()), &to_tracker))
        .collect()
}

struct Unseen<'u> {
    model: &'u dyn PoseModel,
    predictions: &'u [Predicted],
    /// The target of each observation; `None` in a session with one.
    targets: Vec<Option<TargetId>>,
    placed: &'u [Placed],
    to_base: &'u Isometry3<f64>,
    with_target: bool,
    /// The errors that the model may make there; `None` for a model without a covariance.
    poses: Option<Poses>,
}

struct SessionFrames {
    refit: Refit,
    /// Whether each station took part in finding them and does not judge.
    taken: Vec<bool>,
    /// The stations that the frames are found from, all of them for comparing models.
    used: Vec<usize>,
    /// Their dependence on the stations; `None` for frames of the training.
    by: Option<Estimator>,
}

impl Unseen<'_> {
    /// The frames of the session; `None` where stations do not span space.
    fn found(
        &self,
        observations: &[Observation],
        base_refit: BaseRefit,
        finders: &[usize],
    ) -> Option<SessionFrames> {
        let count = observations.len();
        let mut taken = vec![false; count];
        let used: Vec<usize> = match base_refit {
            BaseRefit::None => Vec::new(),
            BaseRefit::First | BaseRefit::Chosen => {
                for &finder in finders {
                    taken[finder] = true;
                }
                finders.to_vec()
            }
            BaseRefit::All => (0..count).collect(),
        };
        let by = match (&self.poses, base_refit) {
            (None, _) | (_, BaseRefit::None) => None,
            (Some(poses), BaseRefit::All) => poses.unweighted(&used, refit::RIDGE),
            (Some(poses), BaseRefit::First | BaseRefit::Chosen) => poses.estimator(&used),
        };
        let refit = self.refit(observations, base_refit, &used, by.as_ref())?;
        Some(SessionFrames { refit, taken, used, by })
    }

    fn refit(
        &self,
        observations: &[Observation],
        base_refit: BaseRefit,
        used: &[usize],
        by: Option<&Estimator>,
    ) -> Option<Refit> {
        if base_refit == BaseRefit::None {
            return Some(Refit {
                base_from_tracker: *self.to_base,
                target_shift: Vector3::zeros(),
                scale: 0.0,
                middle: refit::middle(self.placed),
            });
        }
        let measured = used.iter().map(|&place| Some(observations[place].point()?.position));
        let measured: Vec<Point3<f64>> = measured.collect::<Option<_>>()?;
        let placed: Vec<Placed> = used.iter().map(|&p| self.placed[p].clone()).collect();
        let sd = self.model.scale_sd();
        match (by, base_refit) {
            (Some(by), BaseRefit::First | BaseRefit::Chosen) => {
                let middle = refit::middle(self.placed);
                refit::generalised(&measured, &placed, self.with_target, middle, sd, by)
            }
            _ => refit::refit_with_scale(&measured, &placed, self.with_target, sd),
        }
    }

    fn residuals(&self, observations: &[Observation], found: &SessionFrames) -> Vec<Residual> {
        // None for frames of the training: nothing says how far a base moves between sessions.
        let poses = self.poses.as_ref().zip(found.by.as_ref());
        let covariances = poses.map(|(poses, by)| poses.left(by));
        let turns = self.turns(found);
        let residual = |(place, (observation, placed)): (usize, (&Observation, &Placed))| {
            let predicted = found.refit.predicted(placed);
            let attained = found.refit.base_from_tracker * observation.point()?.position;
            Some(Residual {
                station: observation.station,
                target: self.targets[place],
                pose: observation.pose,
                used_for_refit: found.taken[place],
                attained,
                residual: attained - predicted,
                covariance: covariances.as_ref().map(|c| c[place]),
                turn: turns[place],
                ..Residual::default()
            })
        };
        observations.iter().zip(self.placed).enumerate().filter_map(residual).collect()
    }

    /// The measured orientations of the flange in the base that was found, and the predicted ones; where the session has
    /// its own mounting, the target is turned as the stations that the base is found from show.
    fn turns(&self, found: &SessionFrames) -> Vec<Option<Turn>> {
        let (own, trained) = (found.refit.base_from_tracker.rotation, self.to_base.rotation);
        let turn =
            |turn: &Turn| Turn { attained: own * turn.attained, wanted: trained * turn.wanted };
        let turns: Vec<_> = self.predictions.iter().map(|p| p.turn.as_ref().map(turn)).collect();
        if self.with_target && !found.used.is_empty() {
            without_constant(&turns, |place| found.used.contains(&place))
        } else {
            turns
        }
    }
}
