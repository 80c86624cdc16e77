//! Residuals of every model on every set of stations that judges it.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};

use super::refit::{self, Placed, Refit};
use super::tip::{Turn, without_constant};
use super::{Angles, BaseRefit, Model, Residual, ResidualSet, Split, Subject};
use crate::fit::full::{FullModel, Known, Query};
use crate::fit::{Models, Observation};
use crate::kinematics::Arm;
use crate::units::MM_PER_M;

/// A held-out session or the training session itself, as observations.
#[derive(Debug, Clone, Copy)]
pub struct Stations<'s> {
    /// The session's name.
    pub session: &'s str,
    /// Its paired stations.
    pub observations: &'s [Observation],
}

/// How an unseen session's frames are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RefitSettings {
    /// How many first stations the verdict's base is found from.
    pub first: usize,
    /// Whether the session has a target mounting of its own.
    pub with_target: bool,
}

/// One predicted target in the tracker's frame, with its rows where the model has a covariance.
struct Prediction {
    position: Point3<f64>,
    flange: UnitQuaternion<f64>,
    rows: Option<DMatrix<f64>>,
    /// Covariance by not knowing where joints stand against their command, mm².
    standing: Matrix3<f64>,
    /// How the flange stood and is predicted to, in the tracker's axes, where its orientation was measured.
    turn: Option<Turn>,
}

/// Models with the angles each is given.
const COMPARED: [(Model, Angles); 4] = [
    (Model::BaseTarget, Angles::Reported),
    (Model::Geometric, Angles::Reported),
    (Model::Full, Angles::Blended),
    (Model::Full, Angles::Commanded),
];

/// Residuals of `models` on stations of a session they were trained on: all of them, or those a fold holds out.
pub fn own_session(
    arm: &Arm,
    models: &Models,
    stations: Stations<'_>,
    split: Split,
    fold: Option<usize>,
) -> Vec<ResidualSet> {
    let mut sets = Vec::new();
    for (model, angles) in COMPARED {
        let Some(predictions) =
            predictions(arm, models, model, angles, stations.observations, true)
        else {
            continue;
        };
        let covariances = own_covariances(models, &predictions, stations.observations);
        let base = frames_of(
            models,
            model,
            stations.observations.first().map_or(0, |o| o.session),
        );
        let residual =
            |(place, (observation, prediction)): (usize, (&Observation, &Prediction))| Residual {
                station: observation.station,
                pose: observation.pose,
                fold,
                used_for_refit: false,
                predicted: base.inverse_transform_point(&prediction.position),
                residual: base
                    .inverse_transform_vector(&(observation.position - prediction.position)),
                covariance: covariances.as_ref().map(|c| turned(&c[place], &base)),
                weight: None,
                turn: prediction
                    .turn
                    .map(|turn| turn.seen_from(&base.rotation.inverse())),
            };
        let residuals = stations
            .observations
            .iter()
            .zip(&predictions)
            .enumerate()
            .map(residual)
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

/// Residuals of `models` on a session they never saw, with each way to find its base.
pub fn unseen_session(
    arm: &Arm,
    models: &Models,
    stations: Stations<'_>,
    settings: RefitSettings,
) -> Vec<ResidualSet> {
    let mut sets = Vec::new();
    for (model, angles) in COMPARED {
        let Some(predictions) =
            predictions(arm, models, model, angles, stations.observations, false)
        else {
            continue;
        };
        let to_base = frames_of_arm(models, model);
        let placed: Vec<Placed> = predictions.iter().map(|p| placed(p, &to_base)).collect();
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
            let scale_sd = models.full.as_ref().filter(|_| model == Model::Full);
            let unseen = Unseen {
                models,
                scale_sd: scale_sd.map_or(0.0, FullModel::scale_sd),
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
    sets
}

/// An unseen session's predictions by one model, and which first stations its base is found from.
struct Unseen<'u> {
    models: &'u Models,
    /// Standard deviation of the session's own scale, a share; 0 of a model that knows no scales.
    scale_sd: f64,
    predictions: &'u [Prediction],
    placed: &'u [Placed],
    to_base: &'u Isometry3<f64>,
    settings: RefitSettings,
    used: usize,
    /// Whether only the others judge, however many there are; a base of all its stations is for comparing models.
    judges_rest: bool,
}

impl Unseen<'_> {
    fn residuals(&self, observations: &[Observation]) -> Option<Vec<Residual>> {
        let measured: Vec<Point3<f64>> = observations.iter().map(|o| o.position).collect();
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

    /// The frames of the session: those of training where they are not found from its stations.
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

    /// How the flange stood in the base as it was found, and was predicted to; a mounting of the session's own turns the target
    /// as the stations say that its base is found from.
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

    /// Covariance of what is left on each station: the model's share that the refitted frames do not take up, noise, what
    /// drift and scale the session may have, and what the frames inherit from the stations they were found from.
    fn covariances(
        &self,
        observations: &[Observation],
        found: &Refit,
    ) -> Option<Vec<Matrix3<f64>>> {
        let full = self.models.full.as_ref()?;
        let to_tracker = self.to_base.inverse();
        let noise: Vec<Matrix3<f64>> = self
            .predictions
            .iter()
            .zip(observations)
            .map(|(prediction, o)| turned(&(full.noise(o) + prediction.standing), &to_tracker))
            .collect();
        let mut rows = stacked(self.predictions, self.to_base)?;
        // What a scale moves is one more column of rows.
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
        let drift = Matrix3::identity() * full.drift_variance();
        let own = full.covariances(&rows).into_iter().zip(&noise);
        let own = own.zip(by_scale);
        let own = own.map(|((model, noise), scale)| model + noise + drift + scale);
        Some(match frames.filter(|_| self.used < observations.len()) {
            None => own.collect(),
            Some(frames) => {
                // Where the base stood during the first stations is in the frames, and is not where it stands later.
                let inherited = frames.inherited(&noise[..self.used]);
                own.zip(inherited)
                    .map(|(own, frames)| own + frames + drift)
                    .collect()
            }
        })
    }

    /// Where every station is predicted from the middle of those that the frames are found from, mm, stacked.
    fn levers(&self, found: &Refit) -> DVector<f64> {
        let levers = self.placed.iter().flat_map(|placed| {
            let lever = placed.position - found.middle;
            [lever.x, lever.y, lever.z]
        });
        DVector::from_iterator(3 * self.placed.len(), levers)
    }

    /// The frames' columns at all stations, and how the frames follow from the stations they are found from.
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

/// Refitted frames: their columns at all stations, and how they follow from residuals of the first ones.
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

/// Predictions in the tracker's frame: of the session itself, or with the frames of the first one where it is unseen.
///
/// `None` where the model has none at these angles.
fn predictions(
    arm: &Arm,
    models: &Models,
    model: Model,
    angles: Angles,
    observations: &[Observation],
    own: bool,
) -> Option<Vec<Prediction>> {
    let commanded = |o: &Observation| -> Option<Vec<f64>> {
        Some(
            o.axes
                .iter()
                .zip(o.shortfall.as_ref()?.sent()?)
                .map(|(q, short)| q + short)
                .collect(),
        )
    };
    let of = |o: &Observation| {
        let (axes, known) = match angles {
            Angles::Commanded => (commanded(o)?, Known::Commanded),
            Angles::Reported => (o.axes.clone(), Known::Reported),
            Angles::Blended => (o.axes.clone(), Known::of(o)),
        };
        let session = if own { o.session } else { 0 };
        let query = Query {
            axes: &axes,
            known,
            lever: Vector3::zeros(),
            session,
            own,
            station: Some(o.station),
        };
        let predicted = predict(arm, models, model, &query)?;
        Some(Prediction {
            turn: turn(models, model, &query, &predicted, o),
            ..predicted
        })
    };
    observations.iter().map(of).collect()
}

/// How the flange stood at a station and is predicted to, in the tracker's axes; `None` where no orientation was measured.
fn turn(
    models: &Models,
    model: Model,
    query: &Query<'_>,
    predicted: &Prediction,
    observation: &Observation,
) -> Option<Turn> {
    let (measured, _) = observation.orientation?;
    let (frames, wanted) = match (model, &models.full) {
        (Model::Full, Some(full)) => (full.frames(), full.flange(query)),
        (Model::BaseTarget, _) => (&*models.base_target.frames, predicted.flange),
        _ => (&*models.geometric.frames, predicted.flange),
    };
    let flange_from_target = frames[query.session].flange_from_target.isometry();
    Some(Turn {
        attained: measured * flange_from_target.rotation.inverse(),
        wanted,
    })
}

fn predict(arm: &Arm, models: &Models, model: Model, query: &Query<'_>) -> Option<Prediction> {
    let calibration = match model {
        Model::Full => {
            let predicted = models.full.as_ref()?.predict(query);
            return Some(Prediction {
                position: predicted.position,
                flange: predicted.flange,
                rows: Some(predicted.rows),
                standing: predicted.standing,
                turn: None,
            });
        }
        Model::BaseTarget => &models.base_target,
        Model::Geometric => &models.geometric,
        Model::RawCommand | Model::Table => return None,
    };
    let frames = &calibration.frames[query.session];
    let flange = frames.tracker_from_base.isometry()
        * arm.chain().forward(query.axes, &calibration.geometry);
    let position = flange * frames.flange_from_target.origin().point();
    Some(Prediction {
        position,
        flange: flange.rotation,
        rows: None,
        standing: Matrix3::zeros(),
        turn: None,
    })
}

/// `tracker_from_base` as fitted for a session.
fn frames_of(models: &Models, model: Model, session: usize) -> Isometry3<f64> {
    let calibration = if model == Model::BaseTarget {
        &models.base_target
    } else {
        &models.geometric
    };
    *calibration.frames[session].tracker_from_base.isometry()
}

/// `base_from_tracker` of the frames in which an unseen session is predicted.
fn frames_of_arm(models: &Models, model: Model) -> Isometry3<f64> {
    match (model, &models.full) {
        (Model::Full, Some(full)) => full.frames()[0].tracker_from_base.isometry().inverse(),
        _ => frames_of(models, model, 0).inverse(),
    }
}

fn own_covariances(
    models: &Models,
    predictions: &[Prediction],
    observations: &[Observation],
) -> Option<Vec<Matrix3<f64>>> {
    let full = models.full.as_ref()?;
    let rows = stacked(predictions, &Isometry3::identity())?;
    Some(
        full.covariances(&rows)
            .into_iter()
            .zip(predictions)
            .zip(observations)
            .map(|((model, prediction), o)| model + prediction.standing + full.noise(o))
            .collect(),
    )
}

/// All rows below each other, turned into another frame; `None` where the model has no rows or there are no stations.
fn stacked(predictions: &[Prediction], to: &Isometry3<f64>) -> Option<DMatrix<f64>> {
    let columns = predictions.first()?.rows.as_ref()?.ncols();
    let turn = to.rotation.to_rotation_matrix();
    let mut stacked = DMatrix::zeros(3 * predictions.len(), columns);
    for (place, prediction) in predictions.iter().enumerate() {
        stacked
            .rows_mut(3 * place, 3)
            .copy_from(&(turn.matrix() * prediction.rows.as_ref()?));
    }
    Some(stacked)
}

/// A covariance of the frame `to_from`'s target stated in its source: `Rᵀ C R`.
fn turned(covariance: &Matrix3<f64>, to_from: &Isometry3<f64>) -> Matrix3<f64> {
    let turn = to_from.rotation.to_rotation_matrix();
    turn.transpose() * covariance * turn
}

/// Squared Mahalanobis distance of a residual; `None` without a covariance.
pub fn mahalanobis_squared(residual: &Residual) -> Option<f64> {
    let solved = residual.covariance?.cholesky()?.solve(&residual.residual);
    Some(
        DVector::from_column_slice(residual.residual.as_slice())
            .dot(&DVector::from_column_slice(solved.as_slice())),
    )
}
