//! Everything that is trained: models on all readings, on all but each fold, on all but each session.
//!
//! It follows from the sessions that train, how readings are weighed and what is fitted. Steps, tolerances, figures and sessions that only
//! judge come behind it, so another of them trains nothing: [`Estimate::stored`] is what the lake keeps of it.

use super::flanges::Flanges;
use super::judged::{self, Judged, sessions_left_out, training_settings};
use super::observed::Observed;
use super::{JoinedSession, LengthResidual, Source};
use super::{StageError, StageSettings, checks, lengths, mountings, sizes, suspects};
use crate::fit::camera_size::CameraSize;
use crate::fit::full::stored::StoredFull;
use crate::fit::saved::SavedError;
use crate::fit::stated_size::FoundSize;
use crate::fit::stored::{Restoring, StoredModels};
use crate::fit::{Model, Models};
use crate::geometry::{symmetric, upper};
use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::report::ResidualSet;

/// The sessions of a piece of work, without readings that are wrong, and the models trained on them.
#[derive(Debug)]
pub struct Estimate {
    pub(super) observed: Observed,
    pub(super) trained: Trained,
    /// Errors of the stations that train: in training, and by the models without their fold or their session.
    pub residuals: Vec<ResidualSet>,
    /// The sessions with one reading a station.
    pub(super) flanges: Flanges,
    /// The settings of all later stages: those given, with sizes that the sessions show.
    pub(super) settings: StageSettings,
    pub(super) camera_size: Option<CameraSize>,
    /// The size of the covariances that readings state.
    pub(super) stated_sizes: Vec<FoundSize>,
    pub(super) sources: Vec<Source>,
    pub(super) length_residuals: Vec<LengthResidual>,
}

/// What was trained, for later runs to start from.
#[derive(Debug, Clone)]
pub struct StoredTrainings {
    pub models: StoredModels,
    /// The models of each fold; `None` of a fold that holds no station out.
    pub folds: Vec<Option<StoredModels>>,
    /// Each session of a pool, judged by the models of all others.
    pub sessions_left_out: Vec<ResidualSet>,
    /// The errors of its stations in no special order, where `estimate_residuals` has all of them.
    pub residuals: Option<Vec<ResidualSet>>,
}

/// Models, and residuals of models that nothing else asks for.
#[derive(Debug)]
pub(super) struct Trained {
    pub(super) models: Models,
    pub(super) folds: Vec<Option<Models>>,
    pub(super) sessions_left_out: Vec<ResidualSet>,
}

/// The estimate from joined sessions, those that train and those that judge; what `stored` has is not trained again.
pub fn estimate(
    arm: &Arm,
    (mut training, mut test): (Vec<JoinedSession>, Vec<JoinedSession>),
    stored: Option<StoredTrainings>,
    settings: &StageSettings,
    progress: &dyn Progress,
) -> Result<Estimate, StageError> {
    checks::measured_once(&training, &test)?;
    let Prepared { settings, camera_size, stated_sizes } =
        prepared(arm, &mut training, &mut test, settings)?;
    let mut observed = Observed::new(arm, &training, &settings);
    let Known { models, folds, sessions_left_out: left_out, residuals: known } = match stored {
        Some(stored) => restored(arm, stored, &observed, &settings)?,
        None => trained(arm, &observed, &training, &settings, progress)?,
    };
    let flanges = Flanges::new(arm, training, test, &mut observed, &models, &settings)?;
    let training = &flanges.training;
    let length_residuals = lengths::residuals(&observed, training, &models, &folds, &settings);
    let sources = lengths::sources(&models, &length_residuals, &settings);
    let settings = lengths::settings_behind(&observed, flanges.noise.clone(), &settings);
    let sessions_left_out = match left_out {
        Some(sets) => sets,
        None => sessions_left_out(arm, &models, &observed, training, &settings, progress)?,
    };
    let trained = Trained { models, folds, sessions_left_out };
    let found = known.unwrap_or_else(|| residuals(&observed, &trained, training));
    Ok(Estimate {
        residuals: in_order(found, training),
        observed,
        trained,
        flanges,
        settings,
        camera_size,
        stated_sizes,
        sources,
        length_residuals,
    })
}

/// The settings of a training, with sizes that its sessions show.
struct Prepared {
    settings: StageSettings,
    camera_size: Option<CameraSize>,
    stated_sizes: Vec<FoundSize>,
}

/// Takes wrong readings out of the sessions, and finds the sizes that those which train show.
fn prepared(
    arm: &Arm,
    training: &mut [JoinedSession],
    test: &mut [JoinedSession],
    settings: &StageSettings,
) -> Result<Prepared, StageError> {
    checks::one_source_each(training.iter().chain(&*test))?;
    let settings = &checks::repairs(training, test, settings)?;
    test.iter().try_for_each(checks::check_judge)?;
    suspects::leave_out(arm, training, test, settings)?;
    let (settings, camera_size) = sizes::camera(arm, training, settings)?;
    let stated_sizes = sizes::stated(arm, training, test, &settings)?;
    Ok(Prepared { settings, camera_size, stated_sizes })
}

impl Estimate {
    pub fn observations(&self) -> usize {
        self.observed.all.len()
    }

    /// Root mean square of measured minus predicted position by the identified geometry, per axis, mm.
    pub const fn misfit_mm(&self) -> f64 {
        self.trained.models.geometric.misfit_mm
    }

    pub fn stored(&self) -> StoredTrainings {
        let trained = &self.trained;
        let of_fold = |models: &Option<Models>| models.as_ref().map(StoredModels::of);
        StoredTrainings {
            models: StoredModels::of(&trained.models),
            folds: trained.folds.iter().map(of_fold).collect(),
            sessions_left_out: trained.sessions_left_out.clone(),
            residuals: Some(self.residuals.clone()),
        }
    }
}

/// The errors that models leave of the sessions that train.
fn residuals(
    observed: &Observed,
    trained: &Trained,
    training: &[JoinedSession],
) -> Vec<ResidualSet> {
    let judged = Judged { observed, models: &trained.models, folds: &trained.folds, training };
    let mut residuals = judged.residuals();
    residuals.extend(trained.sessions_left_out.iter().cloned());
    mountings::of_one_mounting(residuals, observed)
}

/// Residual sets by way of judging, session, model and angles, each by station and target, with covariances that are symmetric to the last
/// bit: the same whether they were found now or read back.
fn in_order(mut sets: Vec<ResidualSet>, training: &[JoinedSession]) -> Vec<ResidualSet> {
    let sessions: Vec<&str> = training.iter().map(|own| own.name.as_str()).collect();
    let models: Vec<_> = Model::compared().collect();
    sets.sort_by_cached_key(|set| {
        let own = &set.subject;
        let session = sessions.iter().position(|name| *name == own.of_session);
        let model = models.iter().position(|of| *of == (own.model, own.angles));
        (own.split, session, own.base_refit, model)
    });
    for residual in sets.iter_mut().flat_map(|set| &mut set.residuals) {
        residual.covariance = residual.covariance.as_ref().map(|own| symmetric(upper(own)));
    }
    for set in &mut sets {
        set.residuals.sort_by_key(|residual| (residual.station, residual.target));
    }
    sets
}

/// The models of an estimate, trained now or read back, and the residuals that the lake has.
struct Known {
    models: Models,
    folds: Vec<Option<Models>>,
    sessions_left_out: Option<Vec<ResidualSet>>,
    residuals: Option<Vec<ResidualSet>>,
}

/// Models trained now, which have to be of one arm.
fn trained(
    arm: &Arm,
    observed: &Observed,
    training: &[JoinedSession],
    settings: &StageSettings,
    progress: &dyn Progress,
) -> Result<Known, StageError> {
    let check = |models: &Models| checks::check_pool(arm, observed, models, training, settings);
    let (sessions, train) = (training.len(), &training_settings(settings));
    let (models, folds) = judged::train(arm, observed, sessions, train, check, progress)?;
    Ok(Known { models, folds, sessions_left_out: None, residuals: None })
}

/// The models that were stored; an error where they are not of these observations. Where the residuals are stored too, the models of the
/// folds are asked for predictions alone.
fn restored(
    arm: &Arm,
    stored: StoredTrainings,
    observed: &Observed,
    settings: &StageSettings,
) -> Result<Known, SavedError> {
    let train = training_settings(settings);
    let models = stored.models.models(arm, &observed.all, &train, StoredFull::model)?;
    let has_lengths = observed.all.iter().any(|own| own.measured.length().is_some());
    let residuals = stored.residuals.filter(|_| !has_lengths);
    let of: Restoring =
        if residuals.is_some() { StoredFull::predicting } else { StoredFull::model };
    let folds = stored.folds.into_iter().enumerate().map(|(fold, stored)| {
        stored.map(|stored| stored.models(arm, &observed.without(fold), &train, of)).transpose()
    });
    let folds = folds.collect::<Result<Vec<_>, _>>()?;
    Ok(Known { models, folds, sessions_left_out: Some(stored.sessions_left_out), residuals })
}
