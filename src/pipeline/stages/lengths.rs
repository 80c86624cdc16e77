//! Instruments that read one length: their readings at stations that took no part, and sessions without them for what comes after the
//! fit.
//!
//! They train, and nothing behind the fit is stated by them: errors, grids and figures are of positions. What each model leaves of
//! their held-out readings, along the direction that is read, is in the table `sources`.

use super::observed::Observed;
use super::{StageError, StageSettings};
use crate::fit::model::Query;
use crate::fit::{At, Channel, Frames, Models, Observation, PoseModel, SourceSize};
use crate::io::tables::outcome::{JoinedSession, Source};
use crate::join::SourceId;
use crate::report::Model;

/// The models that have sources.
const OF: [Model; 3] = [Model::BaseTarget, Model::Geometric, Model::Full];

/// The session without readings of one length.
pub(super) fn places_alone(mut session: JoinedSession) -> JoinedSession {
    for station in &mut session.joined.stations {
        let readings = &mut station.readings;
        readings.retain(|reading| !reading.value.kind().is_length());
    }
    session
}

/// Refuses a session that only judges and has lengths alone.
pub(super) fn check_judge(session: &JoinedSession) -> Result<(), StageError> {
    let mut readings = session.joined.stations.iter().flat_map(|own| &own.readings);
    let has_lengths = readings.clone().next().is_some();
    let has_places = readings.any(|reading| !reading.value.kind().is_length());
    if has_lengths && !has_places {
        return Err(StageError::NoPlaces {
            session: session.name.clone(),
        });
    }
    Ok(())
}

/// The sources of all models: base + target, geometry and the full error model.
pub(super) fn sources(
    observed: &Observed,
    models: &Models,
    folds: &[Option<Models>],
    settings: &StageSettings,
) -> Vec<Source> {
    let of = |model: Model| {
        let sizes = match model {
            Model::BaseTarget => &models.base_target.sources,
            _ => &models.geometric.sources,
        };
        let is_there = models.get(model).is_some();
        let sizes = sizes.iter().filter(move |_| is_there);
        sizes.map(move |size| source(model, size, observed, models, folds, settings))
    };
    OF.into_iter().flat_map(of).collect()
}

fn source(
    model: Model,
    size: &SourceSize,
    observed: &Observed,
    models: &Models,
    folds: &[Option<Models>],
    settings: &StageSettings,
) -> Source {
    let names = &settings.fit.source_names;
    let usual = || "tracker".to_owned();
    let full = models.full.as_ref().filter(|_| model == Model::Full);
    let of_full = full.and_then(|full| full.repeatability.lengths.get(size.source.0));
    let of_full = of_full.filter(|_| size.kind.is_length());
    let fitted = model != Model::Full;
    let left = held_out(model, size.source, observed, folds);
    Source {
        model,
        name: names.get(size.source.0).cloned().unwrap_or_else(usual),
        size: size.clone(),
        factor: if fitted {
            Some(size.factor)
        } else {
            of_full.map(|variance| variance.sqrt())
        },
        is_fitted: fitted,
        held_out: left.len(),
        held_out_rms_mm: rms(&left),
    }
}

fn rms(left: &[f64]) -> Option<f64> {
    let squares: f64 = left.iter().map(|own| own * own).sum();
    (!left.is_empty()).then(|| (squares / left.len() as f64).sqrt())
}

/// Measured minus predicted of every held-out length of a source, mm.
fn held_out(
    model: Model,
    source: SourceId,
    observed: &Observed,
    folds: &[Option<Models>],
) -> Vec<f64> {
    let own = observed.all.iter().zip(&observed.folds);
    let own = own.filter(|(o, _)| o.source == source && o.measured.length().is_some());
    let left = own.filter_map(|(o, fold)| {
        let models = folds.get(*fold)?.as_ref()?;
        let it = models.get(model)?;
        left_of(it, &frames(models, model), o)
    });
    left.collect()
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
    let Channel {
        session, source, ..
    } = observation.channel();
    let gauge = frames.get(session)?.gauge(source)?;
    let query = At::Joints(Query::of(observation));
    let place = model.position(&query).ok()?;
    Some(observation.measured.length()?.mm - gauge.reading_mm(&place))
}
