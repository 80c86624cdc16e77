//! The stages after the join, in order: fit, residuals, similarity, grid, accuracy. Pure: what is read comes in, what is
//! published goes out.

use nalgebra::{Isometry3, Point3, UnitVector3};
use rayon::prelude::*;
use thiserror::Error;

use super::outcome::{JoinedSession, Outcome};
use crate::fit::full::FullSettings;
use crate::fit::{
    self, ErrorModel, FitError, FitSettings, Gauge, Models, Noise, Observation, ToolErrors,
    TrainingSettings, holdout,
};
use crate::grid::{self, GridError, GridInput, GridSettings, GridStation, Reach, Tolerance};
use crate::join::{Pairing, Station};
use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::report::evaluate::{self, RefitSettings, Stations};
use crate::report::{
    Accuracy, Angles, BaseRefit, Model, Moment, Residual, ResidualSet, Split, Subject, accuracy,
};
use crate::similarity::{self, ErrorSample, SimilaritySettings};

/// What the stages are set to.
#[derive(Debug, Clone)]
pub struct StageSettings {
    /// What is known of the measurement.
    pub noise: Noise,
    /// The geometric fit.
    pub fit: FitSettings,
    /// The whole error model.
    pub full: FullSettings,
    /// Against gravity in the base frame, where the mounting is known.
    pub up: Option<UnitVector3<f64>>,
    /// The controller's own tool at the flange, where it is not the target itself.
    pub flange_from_tool: Option<Isometry3<f64>>,
    /// Where errors against the raw command can be given: the base they are given in.
    pub raw_command: Option<RawCommandBase>,
    /// Semivariograms.
    pub similarity: SimilaritySettings,
    /// Steps and nodes.
    pub grid: GridSettings,
    /// What has to be met.
    pub tolerance: Tolerance,
    /// How an unseen session's frames are found.
    pub refit: RefitSettings,
}

/// The base in which an error against the raw command is given; command and target are one point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RawCommandBase {
    /// Surveyed: `tracker_from_base`.
    Surveyed(Isometry3<f64>),
    /// Said to be fitted: that of base + target.
    Fitted,
}

/// Why a stage has no result.
#[derive(Debug, Error)]
pub enum StageError {
    /// The fit.
    #[error("fit: {0}")]
    Fit(#[from] FitError),
    /// The grids.
    #[error("grid: {0}")]
    Grid(#[from] GridError),
}

/// Everything that follows from joined sessions.
pub fn run<'a>(
    arm: &'a Arm,
    training: Vec<JoinedSession>,
    test: Vec<JoinedSession>,
    settings: &StageSettings,
    progress: &dyn Progress,
) -> Result<Outcome<'a>, StageError> {
    let observed = Observed::new(arm, &training, settings);
    let train = TrainingSettings {
        fit: &settings.fit,
        full: &settings.full,
        up: settings.up,
    };
    let models = fit::models::train(arm, &observed.all, training.len(), &train)?;
    let folds = train_folds(arm, &observed, training.len(), &train, progress)?;
    let judged = Judged {
        arm,
        observed: &observed,
        models: &models,
        folds: &folds,
    };
    let mut residuals = judged.training(&training);
    residuals.extend(judged.blocks(&training));
    for session in &test {
        let own = observations(arm, 0, session, settings);
        let stations = Stations {
            session: &session.name,
            observations: &own,
        };
        residuals.extend(evaluate::unseen_session(
            arm,
            &models,
            stations,
            settings.refit,
        ));
    }
    let last = training.len() - 1;
    let frames = models.base_target.frames[last];
    let gauge = Gauge::new(
        arm,
        frames,
        settings.flange_from_tool,
        settings.noise.orientations,
    );
    residuals.extend(raw_command(&training[last], &gauge, settings.raw_command));
    let semivariograms = semivariograms(&training[last], &residuals, &settings.similarity);
    let stations = grid_stations(&training[last], &gauge, &observed.folds_of(last));
    let grids = grids(&stations, &gauge, &models, &folds, last, settings, progress)?;
    let accuracy = figures(
        &residuals,
        &grids,
        &stations,
        &training[last].name,
        settings,
    );
    let Models {
        base_target,
        geometric,
        full,
    } = models;
    let calibrations = vec![
        (Model::BaseTarget, base_target),
        (Model::Geometric, geometric),
    ];
    Ok(Outcome {
        training,
        test,
        calibrations,
        full,
        gauge,
        residuals,
        semivariograms,
        grids,
        accuracy,
    })
}

/// Observations of all training sessions, with the fold that holds each out.
struct Observed {
    all: Vec<Observation>,
    folds: Vec<usize>,
}

impl Observed {
    fn new(arm: &Arm, training: &[JoinedSession], settings: &StageSettings) -> Self {
        let own =
            |(place, session): (usize, &JoinedSession)| observations(arm, place, session, settings);
        let all: Vec<Observation> = training.iter().enumerate().flat_map(own).collect();
        let positions: Vec<Point3<f64>> = all.iter().map(|o| flange_position(arm, o)).collect();
        let folds = settings.fit.blocks.folds(&positions);
        Self { all, folds }
    }

    fn of_session(&self, session: usize) -> impl Iterator<Item = (&Observation, usize)> {
        self.all
            .iter()
            .zip(self.folds.iter().copied())
            .filter(move |(o, _)| o.session == session)
    }

    fn folds_of(&self, session: usize) -> Vec<usize> {
        self.of_session(session).map(|(_, fold)| fold).collect()
    }

    fn without(&self, fold: usize) -> Vec<Observation> {
        let kept = self
            .all
            .iter()
            .zip(&self.folds)
            .filter(|(_, own)| **own != fold);
        kept.map(|(observation, _)| observation.clone()).collect()
    }
}

fn observations(
    arm: &Arm,
    place: usize,
    session: &JoinedSession,
    settings: &StageSettings,
) -> Vec<Observation> {
    let stations = &session.joined.stations;
    let mut observations = fit::observations(place, stations, arm, &settings.noise);
    fit::add_shortfalls(&mut observations, stations, &session.commanded);
    observations
}

/// Where the nominal flange is: blocks are cut on it.
fn flange_position(arm: &Arm, observation: &Observation) -> Point3<f64> {
    Point3::from(arm.chain().nominal(&observation.axes).translation.vector)
}

/// The models of every fold that holds a station out, in fold order.
fn train_folds(
    arm: &Arm,
    observed: &Observed,
    sessions: usize,
    settings: &TrainingSettings<'_>,
    progress: &dyn Progress,
) -> Result<Vec<Option<Models>>, FitError> {
    progress.begin("folds", holdout::FOLDS as u64);
    let train = |fold: usize| {
        let held_out = observed.folds.contains(&fold);
        let models =
            held_out.then(|| fit::models::train(arm, &observed.without(fold), sessions, settings));
        progress.advance(1);
        models.transpose()
    };
    let folds = (0..holdout::FOLDS).into_par_iter().map(train).collect();
    progress.end();
    folds
}

/// Models and what judges them.
struct Judged<'j> {
    arm: &'j Arm,
    observed: &'j Observed,
    models: &'j Models,
    folds: &'j [Option<Models>],
}

impl Judged<'_> {
    fn training(&self, training: &[JoinedSession]) -> Vec<ResidualSet> {
        let of = |(place, session): (usize, &JoinedSession)| {
            let own: Vec<_> = self
                .observed
                .of_session(place)
                .map(|(o, _)| o.clone())
                .collect();
            let stations = Stations {
                session: &session.name,
                observations: &own,
            };
            evaluate::own_session(self.arm, self.models, stations, Split::None, None)
        };
        training.iter().enumerate().flat_map(of).collect()
    }

    /// Every station judged once, by the models of the fold that held it out.
    fn blocks(&self, training: &[JoinedSession]) -> Vec<ResidualSet> {
        let mut sets: Vec<ResidualSet> = Vec::new();
        for (place, session) in training.iter().enumerate() {
            for (fold, models) in self.folds.iter().enumerate() {
                let Some(models) = models else { continue };
                let held_out = self
                    .observed
                    .of_session(place)
                    .filter(|(_, own)| *own == fold);
                let own: Vec<_> = held_out.map(|(o, _)| o.clone()).collect();
                let stations = Stations {
                    session: &session.name,
                    observations: &own,
                };
                for set in
                    evaluate::own_session(self.arm, models, stations, Split::Blocks, Some(fold))
                {
                    merge(&mut sets, set);
                }
            }
        }
        sets
    }
}

/// Adds residuals to the set of their subject, in station order.
fn merge(sets: &mut Vec<ResidualSet>, set: ResidualSet) {
    match sets.iter_mut().find(|own| own.subject == set.subject) {
        None => sets.push(set),
        Some(own) => {
            own.residuals.extend(set.residuals);
            own.residuals.sort_by_key(|residual| residual.station);
        }
    }
}

/// Errors against the raw command, where command and target are one point and the base is known or said to be fitted.
fn raw_command(
    session: &JoinedSession,
    gauge: &Gauge<'_>,
    base: Option<RawCommandBase>,
) -> Option<ResidualSet> {
    let tracker_from_base = match base? {
        RawCommandBase::Surveyed(tracker_from_base) => tracker_from_base,
        RawCommandBase::Fitted => *gauge.frames().tracker_from_base.isometry(),
    };
    let residual = |(station, pose): (&Station, &Option<fit::commanded::CommandedPose>)| {
        let commanded = pose.as_ref()?.position;
        let attained = station
            .attained
            .as_ref()
            .filter(|_| station.pairing == Pairing::Paired)?;
        Some(Residual {
            station: station.number,
            fold: None,
            used_for_refit: false,
            predicted: commanded,
            residual: tracker_from_base.inverse_transform_point(&attained.position) - commanded,
            covariance: None,
            weight: None,
        })
    };
    let residuals = session
        .joined
        .stations
        .iter()
        .zip(&session.commanded.poses)
        .filter_map(residual)
        .collect();
    let subject = Subject {
        split: Split::None,
        of_session: session.name.clone(),
        model: Model::RawCommand,
        angles: Angles::Commanded,
        base_refit: BaseRefit::None,
    };
    Some(ResidualSet { subject, residuals })
}

/// Semivariograms of what each model leaves on the session it was trained on.
fn semivariograms(
    session: &JoinedSession,
    residuals: &[ResidualSet],
    settings: &SimilaritySettings,
) -> Vec<(Model, Vec<similarity::Semivariogram>)> {
    let joints = |number: usize| {
        session
            .joined
            .stations
            .iter()
            .find(|station| station.number == number)
            .map(|station| station.joints.clone())
    };
    let of = |model: Model, angles: Angles| {
        let set = residuals.iter().find(|set| {
            let subject = &set.subject;
            (subject.model, subject.angles, subject.split) == (model, angles, Split::None)
                && subject.of_session == session.name
        })?;
        let sample = |r: &Residual| {
            Some(ErrorSample {
                joints: joints(r.station)?,
                position: r.predicted,
                error: r.residual,
            })
        };
        let samples: Vec<_> = set.residuals.iter().filter_map(sample).collect();
        Some((model, similarity::semivariograms(&samples, settings)))
    };
    [
        (Model::BaseTarget, Angles::Reported),
        (Model::Geometric, Angles::Reported),
        (Model::Full, Angles::Blended),
    ]
    .into_iter()
    .filter_map(|(model, angles)| of(model, angles))
    .collect()
}

/// The session's paired stations as grids see them: commanded tool poses, and what was attained against them.
fn grid_stations(session: &JoinedSession, gauge: &Gauge<'_>, folds: &[usize]) -> Vec<GridStation> {
    let reach = Reach::new(gauge.arm(), *gauge.flange_from_tool());
    let paired = session
        .joined
        .stations
        .iter()
        .zip(&session.commanded.poses)
        .filter(|(station, _)| station.pairing == Pairing::Paired && station.attained.is_some());
    let station =
        |((station, pose), &fold): ((&Station, &Option<fit::commanded::CommandedPose>), &usize)| {
            let nominal = gauge.nominal_tool(&station.joints);
            let position = pose.map_or_else(
                || Point3::from(nominal.translation.vector),
                |pose| pose.position,
            );
            let attained = gauge.attained_tool(&station.joints, station.attained.as_ref()?);
            Some(GridStation {
                number: station.number,
                position,
                orientation: nominal.rotation,
                configuration: reach.configuration(&station.joints),
                joints: station.joints.clone(),
                error: attained - position,
                fold,
            })
        };
    paired.zip(folds).filter_map(station).collect()
}

fn grids(
    stations: &[GridStation],
    gauge: &Gauge<'_>,
    models: &Models,
    folds: &[Option<Models>],
    session: usize,
    settings: &StageSettings,
    progress: &dyn Progress,
) -> Result<grid::Grids, GridError> {
    let own = ToolErrors::new(models, gauge, session);
    // A fold that holds nothing out is never asked.
    let of_folds: Vec<ToolErrors<'_>> = folds
        .iter()
        .map(|fold| ToolErrors::new(fold.as_ref().unwrap_or(models), gauge, session))
        .collect();
    let folds: Vec<&dyn ErrorModel> = of_folds
        .iter()
        .map(|errors| errors as &dyn ErrorModel)
        .collect();
    let guard_mm = guard_mm(stations, gauge, &settings.noise);
    let input = GridInput {
        stations,
        folds: &folds,
        model: &own,
        guard_mm,
    };
    let reach = Reach::new(gauge.arm(), *gauge.flange_from_tool());
    grid::grids(
        &input,
        &reach,
        &settings.grid,
        &settings.tolerance,
        progress,
    )
}

/// Expanded uncertainty (k = 2) of a measured error along the instrument's worst direction, mm, at the stations' middle.
fn guard_mm(stations: &[GridStation], gauge: &Gauge<'_>, noise: &Noise) -> f64 {
    let sum = stations
        .iter()
        .fold(nalgebra::Vector3::zeros(), |sum, station| {
            sum + station.position.coords
        });
    let middle = Point3::from(sum / stations.len().max(1) as f64);
    let in_tracker = gauge.frames().tracker_from_base.isometry() * middle;
    2.0 * noise
        .tracker
        .covariance(&in_tracker)
        .symmetric_eigenvalues()
        .max()
        .max(0.0)
        .sqrt()
}

fn figures(
    residuals: &[ResidualSet],
    grids: &grid::Grids,
    stations: &[GridStation],
    session: &str,
    settings: &StageSettings,
) -> Vec<Accuracy> {
    let chosen = &grids.judged[grids.choice.row];
    let guard_mm = grids.guard_mm;
    let mut figures: Vec<Accuracy> = residuals
        .iter()
        .map(|set| accuracy::accuracy(set, &settings.tolerance, guard_mm))
        .collect();
    let mut folds: Vec<usize> = stations.iter().map(|station| station.fold).collect();
    folds.sort_unstable();
    folds.dedup();
    figures.push(Accuracy {
        subject: Subject {
            split: Split::Blocks,
            of_session: session.to_owned(),
            model: Model::Table,
            angles: Angles::Commanded,
            base_refit: BaseRefit::None,
        },
        moment: Moment::After,
        figures: chosen.figures,
        bound: chosen.bound,
        blocks: Some(folds.len()),
        coverage: None,
        expanded_uncertainty_mm: guard_mm,
        verdict: grids.choice.verdict.clone(),
    });
    figures
}
