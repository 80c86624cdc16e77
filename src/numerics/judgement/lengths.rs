//! Instruments that read one length: their readings at stations that took no part, and sessions without them for what comes after the fit.
//!
//! They train, and nothing behind the fit is stated by them: errors, grids and figures are of positions. What each model leaves of
//! their readings, along the direction read, is in the table `length_residuals`; its size where held out is in `sources`.

use nalgebra::{Matrix3, Vector3};

use super::StageSettings;
use super::judged::TestSession;
use super::observed::Observed;
use super::{JoinedSession, LengthResidual, Source};
use crate::fit::model::Query;
use crate::fit::{
    At, Channel, Frames, MeasuredPoint, Models, Noise, Observation, PoseModel, SourceSize,
};
use crate::grid::{Choice, Grids, Verdict};
use crate::report::Model;

const OF: [Model; 3] = [Model::BaseTarget, Model::Geometric, Model::Full];

/// The settings behind the fit of a training without positions: no survey is of its frame, which is the base's itself.
pub(super) fn settings_behind(
    observed: &Observed,
    noise: Noise,
    settings: &StageSettings,
) -> StageSettings {
    let base = settings.base.filter(|_| reads_places(observed));
    StageSettings { noise, base, ..settings.clone() }
}

/// Whether any session has positions to train on.
pub(super) fn reads_places(observed: &Observed) -> bool {
    observed.all.iter().any(|own| own.point().is_some())
}

/// No grids, where the session that they are for has no positions. The expanded uncertainty is that of the sessions that judge.
pub(super) fn no_grids(tests: &[TestSession<'_>], settings: &StageSettings) -> Grids {
    let guards = tests.iter().map(|test| guard_mm(&test.observations, settings));
    Grids {
        answers: Vec::new(),
        judged: Vec::new(),
        table: None,
        choice: Choice {
            row: None,
            verdict: Verdict::NotShown(NO_POSITIONS.to_owned()),
            words: NO_POSITIONS.to_owned(),
            within: None,
            fewest_nodes: None,
        },
        configuration: None,
        idw_power: settings.grid.idw_power,
        guard_mm: guards.fold(0.0, f64::max),
    }
}

const NO_POSITIONS: &str = "no table: the session that trained has readings of one length alone, and nodes are of positions";

/// Expanded uncertainty (k = 2) of a position of these observations, mm: along the instrument's worst direction, and by the scale at the
/// one that is furthest from their middle.
fn guard_mm(observations: &[Observation], settings: &StageSettings) -> f64 {
    let points: Vec<_> = observations.iter().filter_map(Observation::point).collect();
    let sum: Vector3<f64> = points.iter().map(|own| own.position.coords).sum();
    let middle = sum / points.len().max(1) as f64;
    let of = |own: &&MeasuredPoint| {
        let away_mm = (own.position.coords - middle).norm();
        (worst_sd_mm(&own.instrument), 1e-6 * settings.full.session_scale_ppm * away_mm)
    };
    let worst =
        points.iter().map(of).fold((0.0, 0.0), |(a, b): (f64, f64), (c, d)| (a.max(c), b.max(d)));
    2.0 * worst.0.hypot(worst.1)
}

/// Standard deviation along the worst direction of a position's covariance, mm.
pub(super) fn worst_sd_mm(covariance: &Matrix3<f64>) -> f64 {
    covariance.symmetric_eigenvalues().max().max(0.0).sqrt()
}

/// The sources of all models: base + target, geometry and the full error model; `left` are the residuals of their lengths.
pub(super) fn sources(
    models: &Models,
    left: &[LengthResidual],
    settings: &StageSettings,
) -> Vec<Source> {
    let of = |model: Model| {
        let sizes = match model {
            Model::BaseTarget => &models.base_target.sources,
            _ => &models.geometric.sources,
        };
        let is_there = models.get(model).is_some();
        let sizes = sizes.iter().filter(move |_| is_there);
        sizes.map(move |size| source(model, size, models, left, settings))
    };
    OF.into_iter().flat_map(of).collect()
}

fn source(
    model: Model,
    size: &SourceSize,
    models: &Models,
    left: &[LengthResidual],
    settings: &StageSettings,
) -> Source {
    let full = models.full.as_ref().filter(|_| model == Model::Full);
    let of_full = full.and_then(|full| full.trained.repeatability.lengths.get(size.source.0));
    let of_full = of_full.filter(|_| size.kind.is_length());
    let fitted = model != Model::Full;
    let is_own = |own: &&LengthResidual| (own.model, own.source) == (model, size.source);
    let left = left.iter().filter(is_own).filter(|own| own.fold.is_some());
    let left: Vec<f64> = left.map(LengthResidual::residual_mm).collect();
    let gauge = frames(models, model).last().and_then(|own| own.gauge(size.source).copied());
    Source {
        model,
        name: settings.fit.source_name(size.source),
        size: size.clone(),
        factor: if fitted { Some(size.factor) } else { of_full.map(|variance| variance.sqrt()) },
        is_fitted: fitted,
        gauge,
        held_out: left.len(),
        held_out_rms_mm: rms(&left),
    }
}

fn rms(left: &[f64]) -> Option<f64> {
    let squares: f64 = left.iter().map(|own| own * own).sum();
    (!left.is_empty()).then(|| (squares / left.len() as f64).sqrt())
}

/// Measured minus predicted of every length by each model, in training and held out; `sessions` are those that trained.
pub(super) fn residuals(
    observed: &Observed,
    sessions: &[JoinedSession],
    models: &Models,
    folds: &[Option<Models>],
    settings: &StageSettings,
) -> Vec<LengthResidual> {
    let of = |model: Model| {
        let trained = left_by(models, None, model, observed, sessions, settings);
        let held_out = folds.iter().enumerate().flat_map(move |(fold, models)| {
            let own = models.as_ref();
            own.map_or_else(Vec::new, |own| {
                left_by(own, Some(fold), model, observed, sessions, settings)
            })
        });
        trained.into_iter().chain(held_out)
    };
    OF.into_iter().flat_map(of).collect()
}

/// What a model of a training leaves of the lengths: of all, or of those that `fold` held out of it.
fn left_by(
    models: &Models,
    fold: Option<usize>,
    model: Model,
    observed: &Observed,
    sessions: &[JoinedSession],
    settings: &StageSettings,
) -> Vec<LengthResidual> {
    let Some(it) = models.get(model) else { return Vec::new() };
    let frames = frames(models, model);
    let full = models.full.as_ref().filter(|_| model == Model::Full);
    let of = |(place, (o, own)): (usize, (&Observation, &usize))| {
        let is_judged = fold.is_none_or(|fold| fold == *own);
        let measured_mm = o.measured.length().filter(|_| is_judged)?.mm;
        let left_mm = left_of(it, &frames, o)?;
        let several = frames[o.session].has_several_targets();
        let weights = it.weights();
        Some(LengthResidual {
            model,
            fold,
            session: sessions[o.session].name.clone(),
            station: o.station,
            pose: o.pose,
            source: o.source,
            name: settings.fit.source_name(o.source),
            kind: o.measured.kind(),
            target: several.then_some(o.target),
            measured_mm,
            predicted_mm: measured_mm - left_mm,
            sd_mm: full
                .filter(|_| fold.is_some())
                .and_then(|full| full.length_variance(o))
                .map(f64::sqrt),
            weight: weights.get(place).copied().filter(|_| fold.is_none()),
        })
    };
    observed.all.iter().zip(&observed.folds).enumerate().filter_map(of).collect()
}

/// The frames of each session at the model's best estimate.
fn frames(models: &Models, model: Model) -> Vec<Frames> {
    match (model, &models.full) {
        (Model::Full, Some(full)) => full.fitted_frames(),
        (Model::BaseTarget, _) => models.base_target.frames.clone(),
        _ => models.geometric.frames.clone(),
    }
}

/// Measured minus predicted length, mm; `None` where the model has no prediction.
fn left_of(model: &dyn PoseModel, frames: &[Frames], observation: &Observation) -> Option<f64> {
    let Channel { session, source, .. } = observation.channel();
    let gauge = frames.get(session)?.gauge(source)?;
    let place = model.position(&At::Joints(Query::of(observation))).ok()?;
    Some(observation.measured.length()?.mm - gauge.reading_mm(&place))
}
