//! Residuals of every model on every set of stations that judges it.

use std::borrow::Cow;

use nalgebra::{DMatrix, Isometry3, Matrix3};

use super::refit::Placed;
use super::tip::Turn;
use super::{Angles, BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::fit::model::{Known, Query};
use crate::fit::{At, Corrects, Gap, Models, Observation, PoseModel, Prediction, TargetId};

/// A held-out session or the training session itself, as observations.
#[derive(Debug, Clone, Copy)]
pub struct Stations<'s> {
    pub session: &'s str,
    pub observations: &'s [Observation],
}

pub(super) struct Predicted {
    pub(super) target: Prediction,
    /// Measured and predicted orientation of the flange, in the tracker's axes; `None` where its orientation was not
    /// measured, and of several targets at all but the main one.
    pub(super) turn: Option<Turn>,
}

pub fn own_session(
    models: &Models,
    stations: Stations<'_>,
    split: Split,
    fold: Option<usize>,
) -> Vec<ResidualSet> {
    let mut sets = Vec::new();
    for (model, angles) in Model::compared() {
        let observations = &*known_ones(stations.observations, angles);
        let Some((it, predictions)) = predictions(models, model, angles, observations, true) else {
            continue;
        };
        let covariances = own_covariances(it, &predictions, observations);
        let residual = |(place, (observation, predicted)): (usize, (&Observation, &Predicted))| {
            let target = predicted.target.position;
            let base = stated_in(models, model, observation);
            let measured = observation.point()?.position;
            let residual = base.inverse_transform_vector(&(measured - target));
            Some(Residual {
                station: observation.station,
                target: target_read(models, observation),
                pose: observation.pose,
                fold,
                attained: base.inverse_transform_point(&target) + residual,
                residual,
                covariance: covariances.as_ref().map(|c| turned(&c[place], &base)),
                turn: predicted.turn.map(|turn| turn.seen_from(&base.rotation.inverse())),
                ..Residual::default()
            })
        };
        let residuals = observations.iter().zip(&predictions).enumerate();
        let residuals = residuals.filter_map(residual).collect();
        let subject = Subject::new((split, stations.session), model, angles, BaseRefit::None);
        sets.push(ResidualSet { subject, residuals });
    }
    sets
}

pub(super) fn placed(prediction: &Prediction, base_from_tracker: &Isometry3<f64>) -> Placed {
    Placed {
        position: base_from_tracker * prediction.position,
        flange: base_from_tracker.rotation * prediction.flange,
    }
}

/// A model with its predictions in the tracker's frame: with the session's own frames, or with those of the latest session
/// that trained where it is unseen.
///
/// `None` without such a model, without observations, or without a prediction at these angles.
pub(super) fn predictions<'m>(
    models: &'m Models,
    model: Model,
    angles: Angles,
    observations: &[Observation],
    own: bool,
) -> Option<(&'m dyn PoseModel, Vec<Predicted>)> {
    let (model, latest) = (models.get(model)?, models.latest());
    observations.first()?;
    let of = |o: &Observation| {
        let axes = axes_at(o, angles)?;
        let known = known_at(o, angles);
        let session = if own { o.session } else { latest };
        // Of a target that was left out of the training whole nothing is predicted.
        model.frames()[session].targets().get(o.target.0)?;
        let query = Query { axes: &axes, known, session, own, ..Query::of(o) };
        Some(Predicted {
            target: model.predict(&At::Joints(query)).ok()?,
            turn: turn(model, &query, o).ok()?,
        })
    };
    let predicted: Option<Vec<Predicted>> = observations.iter().map(of).collect();
    Some((model, predicted?))
}

/// The observations whose axis variables are known at these angles: without its command a station judges no commands.
pub(super) fn known_ones(observations: &[Observation], angles: Angles) -> Cow<'_, [Observation]> {
    let is_known = |own: &Observation| axes_at(own, angles).is_some();
    if observations.iter().all(is_known) {
        return Cow::Borrowed(observations);
    }
    observations.iter().filter(|own| is_known(own)).cloned().collect()
}

/// Axis variables of a station at these angles, rad; `None` where its command is not known.
pub(super) fn axes_at(observation: &Observation, angles: Angles) -> Option<Vec<f64>> {
    let reported = &observation.axes;
    Some(match angles {
        Angles::Reported | Angles::Weighted => reported.clone(),
        Angles::Commanded => {
            let short = observation.settling_error.as_ref()?.sent()?;
            reported.iter().zip(short).map(|(q, s)| q + s).collect()
        }
    })
}

/// The origin of a station's axis variables at these angles.
pub(super) fn known_at(observation: &Observation, angles: Angles) -> Known<'_> {
    match angles {
        Angles::Commanded => Known::Commanded,
        Angles::Reported => Known::Reported,
        Angles::Weighted => Known::of(observation),
    }
}

/// The flange's measured and predicted orientation at a station, in the tracker's axes; `None` where not measured.
fn turn(
    model: &dyn PoseModel,
    query: &Query<'_>,
    observation: &Observation,
) -> Result<Option<Turn>, Gap> {
    let frames = || &model.frames()[query.session];
    let of_target = observation.measured.turn().map(|measured| {
        let flange_from_target = frames().flange_from_target(query.target).isometry();
        measured.orientation * flange_from_target.rotation.inverse()
    });
    let of_several = observation.flange.as_ref();
    let attained = of_target.or_else(|| Some(of_several?.by_places(frames())));
    let Some(attained) = attained else { return Ok(None) };
    let wanted = model.pose(query)?.rotation;
    Ok(Some(Turn { attained, wanted }))
}

/// The target of an observation; `None` where its session has only one. An unseen session has those of the latest that trained.
pub(super) fn target_read(models: &Models, observation: &Observation) -> Option<TargetId> {
    let frames = &models.base_target.frames;
    let own = frames.get(observation.session).or_else(|| frames.last())?;
    own.has_several_targets().then_some(observation.target)
}

/// `tracker_from_base` in which a model's residual of an observation of a training session is stated: that of base + target for its own, and the
/// geometry's for all others, so that they stand side by side.
fn stated_in(models: &Models, model: Model, observation: &Observation) -> Isometry3<f64> {
    let calibration = match model.about().corrects {
        Corrects::Frames => &models.base_target,
        Corrects::Nothing | Corrects::Predicted | Corrects::Commands => &models.geometric,
    };
    let frames = &calibration.frames[observation.session];
    *frames.tracker_from_base(observation.source).isometry()
}

fn own_covariances(
    model: &dyn PoseModel,
    predictions: &[Predicted],
    observations: &[Observation],
) -> Option<Vec<Matrix3<f64>>> {
    let rows = stacked(predictions, &Isometry3::identity())?;
    let open = model.covariances(&rows).into_iter().zip(predictions).zip(observations);
    let whole = open.map(|((own, p), o)| own + p.alone() + model.noise(o, o.session));
    Some(whole.collect())
}

impl Predicted {
    /// Covariance of this point's independent part, mm².
    pub(super) fn alone(&self) -> Matrix3<f64> {
        let open = self.target.open.as_ref();
        open.map_or_else(Matrix3::zeros, |open| open.alone)
    }

    /// Derivatives of the point with respect to the model's unknowns; `None` where the model has no covariance.
    fn rows(&self) -> Option<&DMatrix<f64>> {
        Some(&self.target.open.as_ref()?.rows)
    }
}

/// All rows stacked, rotated into another frame; `None` where the model has no rows or there are no stations.
pub(super) fn stacked(predictions: &[Predicted], to: &Isometry3<f64>) -> Option<DMatrix<f64>> {
    let columns = predictions.first()?.rows()?.ncols();
    let turn = to.rotation.to_rotation_matrix();
    let mut stacked = DMatrix::zeros(3 * predictions.len(), columns);
    for (place, prediction) in predictions.iter().enumerate() {
        stacked.rows_mut(3 * place, 3).copy_from(&(turn.matrix() * prediction.rows()?));
    }
    Some(stacked)
}

/// A covariance stated in the target frame of `to_from`, converted to its source frame: `Rᵀ C R`.
pub(super) fn turned(covariance: &Matrix3<f64>, to_from: &Isometry3<f64>) -> Matrix3<f64> {
    let turn = to_from.rotation.to_rotation_matrix();
    turn.transpose() * covariance * turn
}
