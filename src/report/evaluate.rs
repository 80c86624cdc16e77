//! Residuals of every model on every set of stations that judges it.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Vector3};

use super::refit::{self, Placed, Refit};
use super::tip::{Turn, without_constant};
use super::{Angles, BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::fit::model::{Known, Query};
use crate::fit::{At, Corrects, Gap, Models, Observation, PoseModel, Prediction};
use crate::join::Several;
use crate::units::MM_PER_M;

/// A held-out session or the training session itself, as observations.
#[derive(Debug, Clone, Copy)]
pub struct Stations<'s> {
    /// Name of the session.
    pub session: &'s str,
    /// Paired stations of the session.
    pub observations: &'s [Observation],
}

/// Settings for finding an unseen session's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RefitSettings {
    /// Number of first stations that the verdict's base is found from.
    pub first: usize,
    /// Whether the session has a target mounting of its own.
    pub with_target: bool,
}

/// A target as predicted by a model at a station, in the tracker's frame.
struct Predicted {
    /// The model's prediction.
    target: Prediction,
    /// Measured and predicted orientation of the flange, in the tracker's axes; `None` where its orientation was not
    /// measured.
    turn: Option<Turn>,
}

/// Residuals of `models` on stations of a session they were trained on: all of them, or those a fold holds out.
pub fn own_session(
    models: &Models,
    stations: Stations<'_>,
    split: Split,
    fold: Option<usize>,
) -> Vec<ResidualSet> {
    let mut sets = Vec::new();
    for (model, angles) in Model::compared() {
        let Some((it, predictions)) =
            predictions(models, model, angles, stations.observations, true)
        else {
            continue;
        };
        let covariances = own_covariances(it, &predictions, stations.observations);
        let residual = |(place, (observation, predicted)): (usize, (&Observation, &Predicted))| {
            let target = predicted.target.position;
            let base = stated_in(models, model, observation);
            Some(Residual {
                station: observation.station,
                pose: observation.pose,
                fold,
                used_for_refit: false,
                predicted: base.inverse_transform_point(&target),
                residual: base.inverse_transform_vector(&(observation.point()?.position - target)),
                covariance: covariances.as_ref().map(|c| turned(&c[place], &base)),
                weight: None,
                turn: predicted
                    .turn
                    .map(|turn| turn.seen_from(&base.rotation.inverse())),
            })
        };
        let residuals = stations
            .observations
            .iter()
            .zip(&predictions)
            .enumerate()
            .filter_map(residual)
            .collect();
        let subject = Subject {
            split,
            of_session: stations.session.to_owned(),
            model,
            angles,
            base_refit: BaseRefit::None,
        };
        sets.push(ResidualSet { subject, residuals });
    }
    sets
}

/// Residuals of `models` on a session they never saw, with each way to find its base; refused where the models know several
/// sources or targets, for a base is found with one.
pub fn unseen_session(
    models: &Models,
    stations: Stations<'_>,
    settings: RefitSettings,
) -> Result<Vec<ResidualSet>, Several> {
    let mut sets = Vec::new();
    for (model, angles) in Model::compared() {
        let Some((it, predictions)) =
            predictions(models, model, angles, stations.observations, false)
        else {
            continue;
        };
        // An unseen session is predicted with the frames of the first session.
        let trained = it.frames()[0].one()?;
        let to_base = trained.tracker_from_base.isometry().inverse();
        let placed = predictions.iter().map(|p| placed(&p.target, &to_base));
        let placed: Vec<Placed> = placed.collect();
        // A session with a mounting of its own has no base without a refit.
        let refits = [BaseRefit::None, BaseRefit::First, BaseRefit::All];
        for &base_refit in &refits[usize::from(settings.with_target)..] {
            let subject = Subject {
                split: Split::Session,
                of_session: stations.session.to_owned(),
                model,
                angles,
                base_refit,
            };
            let used = match base_refit {
                BaseRefit::None => 0,
                BaseRefit::First => settings.first.min(stations.observations.len()),
                BaseRefit::All => stations.observations.len(),
            };
            let unseen = Unseen {
                model: it,
                scale_sd: it.scale_sd(),
                predictions: &predictions,
                placed: &placed,
                to_base: &to_base,
                settings,
                used,
                judges_rest: base_refit == BaseRefit::First,
            };
            if let Some(residuals) = unseen.residuals(stations.observations) {
                sets.push(ResidualSet { subject, residuals });
            }
        }
    }
    Ok(sets)
}

/// An unseen session's predictions by one model, and the number of first stations that its base is found from.
struct Unseen<'u> {
    model: &'u dyn PoseModel,
    /// Standard deviation of the session's own scale, a share; 0 for a model without scales.
    scale_sd: f64,
    predictions: &'u [Predicted],
    placed: &'u [Placed],
    to_base: &'u Isometry3<f64>,
    settings: RefitSettings,
    used: usize,
    /// Whether only the other stations judge, however many there are; a base from all stations is for comparing models.
    judges_rest: bool,
}

impl Unseen<'_> {
    fn residuals(&self, observations: &[Observation]) -> Option<Vec<Residual>> {
        let measured = observations.iter().map(|o| Some(o.point()?.position));
        let measured: Vec<Point3<f64>> = measured.collect::<Option<_>>()?;
        let found = self.found(&measured)?;
        let covariances = self.covariances(observations, &found);
        let turns = self.turns(&found.base_from_tracker);
        let residual = |(place, (measured, placed)): (usize, (&Point3<f64>, &Placed))| {
            let predicted = found.predicted(placed);
            Residual {
                station: observations[place].station,
                pose: observations[place].pose,
                fold: None,
                used_for_refit: place < self.used && self.judges_rest,
                predicted,
                residual: found.base_from_tracker * measured - predicted,
                covariance: covariances.as_ref().map(|c| c[place]),
                weight: None,
                turn: turns[place],
            }
        };
        Some(
            measured
                .iter()
                .zip(self.placed)
                .enumerate()
                .map(residual)
                .collect(),
        )
    }

    /// The frames of the session; those of training where they are not found from its stations.
    fn found(&self, measured: &[Point3<f64>]) -> Option<Refit> {
        if self.used == 0 {
            return Some(Refit {
                base_from_tracker: *self.to_base,
                target_shift: Vector3::zeros(),
                scale: 0.0,
                scale_ridge_mm2: 0.0,
                middle: refit::middle(self.placed),
            });
        }
        refit::refit_with_scale(
            &measured[..self.used],
            &self.placed[..self.used],
            self.settings.with_target,
            self.scale_sd,
        )
    }

    /// The measured orientations of the flange in the base that was found, and the predicted ones; where the session has
    /// its own mounting, the target is turned as the stations that the base is found from show.
    fn turns(&self, base_from_tracker: &Isometry3<f64>) -> Vec<Option<Turn>> {
        let (found, trained) = (base_from_tracker.rotation, self.to_base.rotation);
        let turn = |turn: &Turn| Turn {
            attained: found * turn.attained,
            wanted: trained * turn.wanted,
        };
        let turns = self.predictions.iter().map(|p| p.turn.as_ref().map(turn));
        let turns: Vec<_> = turns.collect();
        if self.settings.with_target && self.used > 0 {
            without_constant(&turns, |place| place < self.used)
        } else {
            turns
        }
    }

    /// Covariance of the remaining error at each station: the model's share that the refitted frames do not absorb, noise,
    /// drift and scale of the session, and the share that the frames inherit from the stations they were found from.
    fn covariances(
        &self,
        observations: &[Observation],
        found: &Refit,
    ) -> Option<Vec<Matrix3<f64>>> {
        let to_tracker = self.to_base.inverse();
        let mut rows = stacked(self.predictions, self.to_base)?;
        let noise: Vec<Matrix3<f64>> = self
            .predictions
            .iter()
            .zip(observations)
            .map(|(predicted, o)| turned(&(self.model.noise(o) + predicted.alone()), &to_tracker))
            .collect();
        // The effect of scale is one more column.
        let last = rows.ncols();
        rows = rows.insert_column(last, 0.0);
        rows.set_column(last, &(self.levers(found) * self.scale_sd));
        let frames = (self.used > 0).then(|| self.frames(found));
        if let Some(frames) = &frames {
            rows -= &frames.columns * (&frames.from_first * rows.rows(0, 3 * self.used));
        }
        let by_scale = |place: usize| {
            let column = rows.fixed_view::<3, 1>(3 * place, last);
            column * column.transpose()
        };
        let by_scale: Vec<Matrix3<f64>> = (0..observations.len()).map(by_scale).collect();
        let rows = rows.remove_column(last);
        let drift = Matrix3::identity() * self.model.drift_variance();
        let own = self.model.covariances(&rows).into_iter().zip(&noise);
        let own = own.zip(by_scale);
        let own = own.map(|((model, noise), scale)| model + noise + drift + scale);
        Some(match frames.filter(|_| self.used < observations.len()) {
            None => own.collect(),
            Some(frames) => {
                // The base's place during the first stations is in the frames, and differs from its later place.
                let inherited = frames.inherited(&noise[..self.used]);
                own.zip(inherited)
                    .map(|(own, frames)| own + frames + drift)
                    .collect()
            }
        })
    }

    /// Each station's predicted position relative to the middle of those that the frames are found from, mm, stacked.
    fn levers(&self, found: &Refit) -> DVector<f64> {
        let levers = self.placed.iter().flat_map(|placed| {
            let lever = placed.position - found.middle;
            [lever.x, lever.y, lever.z]
        });
        DVector::from_iterator(3 * self.placed.len(), levers)
    }

    /// The frames' columns at all stations, and the dependence of the frames on the stations that they are found from.
    fn frames(&self, found: &Refit) -> RefittedFrames {
        let positions: Vec<_> = self.placed.iter().map(|p| p.position).collect();
        let flanges: Vec<_> = self.placed.iter().map(|p| p.flange).collect();
        let mut columns = refit::columns(&positions, &flanges, self.settings.with_target);
        let last = columns.ncols();
        let mut ridge = DVector::from_element(last, refit::RIDGE);
        if found.scale_ridge_mm2 > 0.0 {
            columns = columns.insert_column(last, 0.0);
            columns.set_column(last, &(self.levers(found) / MM_PER_M));
            ridge = ridge.push(found.scale_ridge_mm2 / (MM_PER_M * MM_PER_M));
        }
        let first = columns.rows(0, 3 * self.used);
        let normal = first.tr_mul(&first) + DMatrix::from_diagonal(&ridge);
        let factor = normal
            .cholesky()
            .expect("a ridge makes it positive definite");
        RefittedFrames {
            from_first: factor.solve(&first.transpose()),
            columns,
        }
    }
}

/// Refitted frames: their columns at all stations, and their dependence on residuals of the first ones.
struct RefittedFrames {
    columns: DMatrix<f64>,
    from_first: DMatrix<f64>,
}

impl RefittedFrames {
    /// Covariance at each station by the noise of the first stations, mm².
    fn inherited(&self, noise: &[Matrix3<f64>]) -> Vec<Matrix3<f64>> {
        let size = self.from_first.nrows();
        let mut covariance = DMatrix::zeros(size, size);
        for (place, noise) in noise.iter().enumerate() {
            let own = self.from_first.columns(3 * place, 3);
            covariance += own * noise * own.transpose();
        }
        let at = |place: usize| {
            let own = self.columns.rows(3 * place, 3);
            let inherited = own * &covariance * own.transpose();
            Matrix3::from_fn(|row, column| inherited[(row, column)])
        };
        (0..self.columns.nrows() / 3).map(at).collect()
    }
}

fn placed(prediction: &Prediction, base_from_tracker: &Isometry3<f64>) -> Placed {
    Placed {
        position: base_from_tracker * prediction.position,
        flange: base_from_tracker.rotation * prediction.flange,
    }
}

/// A model with its predictions in the tracker's frame: with the session's own frames, or with those of the first session
/// where it is unseen.
///
/// `None` where there is no such model, or it has no prediction at these angles: figures of other stations would not be
/// comparable.
fn predictions<'m>(
    models: &'m Models,
    model: Model,
    angles: Angles,
    observations: &[Observation],
    own: bool,
) -> Option<(&'m dyn PoseModel, Vec<Predicted>)> {
    let model = models.get(model)?;
    let commanded = |o: &Observation| -> Option<Vec<f64>> {
        Some(
            o.axes
                .iter()
                .zip(o.settling_error.as_ref()?.sent()?)
                .map(|(q, short)| q + short)
                .collect(),
        )
    };
    let of = |o: &Observation| {
        let (axes, known) = match angles {
            Angles::Commanded => (commanded(o)?, Known::Commanded),
            Angles::Reported => (o.axes.clone(), Known::Reported),
            Angles::Weighted => (o.axes.clone(), Known::of(o)),
        };
        let session = if own { o.session } else { 0 };
        let query = Query {
            axes: &axes,
            known,
            lever: Vector3::zeros(),
            session,
            source: o.source,
            target: o.target,
            own,
            station: Some(o.station),
        };
        Some(Predicted {
            target: model.predict(&At::Joints(query)).ok()?,
            turn: turn(model, &query, o).ok()?,
        })
    };
    let predicted: Option<Vec<Predicted>> = observations.iter().map(of).collect();
    Some((model, predicted?))
}

/// The measured and predicted orientation of the flange at a station, in the tracker's axes; `None` where none was
/// measured.
fn turn(
    model: &dyn PoseModel,
    query: &Query<'_>,
    observation: &Observation,
) -> Result<Option<Turn>, Gap> {
    let Some(measured) = observation.measured.turn() else {
        return Ok(None);
    };
    let flange_from_target = model.frames()[query.session].flange_from_target(query.target);
    Ok(Some(Turn {
        attained: measured.orientation * flange_from_target.isometry().rotation.inverse(),
        wanted: model.flange(query)?,
    }))
}

/// `tracker_from_base` in which a model's residual of an observation of a training session is stated: that of base + target
/// for its own, and the geometry's for all others, so that these can be compared.
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
    Some(
        model
            .covariances(&rows)
            .into_iter()
            .zip(predictions)
            .zip(observations)
            .map(|((open, predicted), o)| open + predicted.alone() + model.noise(o))
            .collect(),
    )
}

impl Predicted {
    /// Covariance of this point's independent part, mm².
    fn alone(&self) -> Matrix3<f64> {
        let open = self.target.open.as_ref();
        open.map_or_else(Matrix3::zeros, |open| open.alone)
    }

    /// Derivatives of the point with respect to the model's unknowns; `None` where the model has no covariance.
    fn rows(&self) -> Option<&DMatrix<f64>> {
        Some(&self.target.open.as_ref()?.rows)
    }
}

/// All rows stacked, rotated into another frame; `None` where the model has no rows or there are no stations.
fn stacked(predictions: &[Predicted], to: &Isometry3<f64>) -> Option<DMatrix<f64>> {
    let columns = predictions.first()?.rows()?.ncols();
    let turn = to.rotation.to_rotation_matrix();
    let mut stacked = DMatrix::zeros(3 * predictions.len(), columns);
    for (place, prediction) in predictions.iter().enumerate() {
        stacked
            .rows_mut(3 * place, 3)
            .copy_from(&(turn.matrix() * prediction.rows()?));
    }
    Some(stacked)
}

/// A covariance stated in the target frame of `to_from`, converted to its source frame: `Rᵀ C R`.
fn turned(covariance: &Matrix3<f64>, to_from: &Isometry3<f64>) -> Matrix3<f64> {
    let turn = to_from.rotation.to_rotation_matrix();
    turn.transpose() * covariance * turn
}
