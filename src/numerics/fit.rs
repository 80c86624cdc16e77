//! Fit: joined stations → an identified arm, with its covariance and its parameters that are not identifiable.
//!
//! Inputs are the paired stations of one or more sessions of one arm; output is a [`Calibration`]. Steps
//! ([`crate::method::identification`]):
//! 1. stations become [`Observation`]s with a covariance each ([`observation`]);
//! 2. starting frames from a closed-form alignment, then bases and targets alone ([`start`]);
//! 3. the structural rank on the nominal arm ([`rank`]);
//! 4. Levenberg–Marquardt on the whitened residuals ([`problem`], [`solve`], [`loss`]);
//! 5. covariance and observability at the solution.
//!
//! Every error model implements one trait ([`model`]), and all models are in one list ([`registry`]).
//!
//! Beyond geometry: the full error model ([`full`]), the check that pooled sessions are of one arm ([`same_arm`]), visits of
//! one pose ([`visits`]), base and target of a session that took no part ([`locate`]), and the test of the instrument's length unit against the arm's lengths ([`scale`]).

pub mod camera_size;
pub mod commanded;
pub mod conversion;
pub mod error_frame;
pub mod flange;
pub mod frames;
pub mod full;
mod gap;
pub mod gauge;
mod geometry_left;
pub mod holdout;
pub mod identifiability;
#[cfg(test)]
mod lengths;
pub mod locate;
pub mod loss;
pub mod mislabelled;
pub mod model;
pub mod models;
pub mod observation;
mod prior_size;
pub mod problem;
pub mod rank;
#[cfg(test)]
mod reflectors;
pub mod registry;
pub mod report_steps;
pub mod same_arm;
pub mod saved;
pub mod scale;
#[cfg(test)]
mod several;
pub mod solve;
pub mod sources;
pub mod start;
pub mod stated_size;
pub mod stored;
pub mod suspects;
mod tool_errors;
pub mod visits;
pub mod wrong_lengths;
pub mod wrong_orientations;

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use error_frame::{ErrorBase, ErrorFrame, FrameUncertainty, SurveyedBase};
pub use frames::{Channel, FramePair, Frames, SourceId, TargetId};
pub use full::Purpose;
pub use gap::{Gap, Refusal};
pub use gauge::{Anchor, Gauge, Plane, Sees};
pub use holdout::Blocks;
pub use identifiability::Identifiability;
pub use loss::Loss;
pub use model::{Angles, At, PoseModel, Prediction};
pub use models::{Models, TrainingSettings};
pub use observation::{
    CameraUncertainty, Measured, MeasuredLength, MeasuredOrientation, MeasuredPoint, Mounted,
    Noise, Observation, Source, StatedSize, TrackerUncertainty, Uncertainty, add_commands,
    observations,
};
pub use problem::{
    Freedom, KnownDistance, KnownGauge, KnownTarget, Owner, Prior, Problem, TargetDistance, Unknown,
};
pub use rank::{Observability, Structure};
pub use registry::{Corrects, IdentifiedGeometry, Model};
pub use solve::{Convergence, Solution};
pub use sources::SourceSize;
pub use tool_errors::ToolErrors;

use crate::join::SeveralSources;
use crate::kinematics::{Arm, Chain, Motion, Parameter};
use sources::Factors;

/// Above this condition number the identification is ill posed (Schröer's rule; [`crate::method::identification`]).
pub const CONDITION_LIMIT: f64 = 100.0;
/// Fits with a prior whose size follows from the fit before, at most.
const WIDENINGS: usize = 4;
pub const WEIGHTED_DOWN: f64 = 0.5;

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct FitSettings {
    pub repeatability_mm: f64,
    pub loss: Loss,
    /// Standard deviation that the weak prior gives to length offsets, mm; zero for no prior.
    pub prior_length_mm: f64,
    /// Standard deviation that the weak prior gives to angle offsets, mrad; zero for no prior.
    pub prior_angle_mrad: f64,
    /// Manufacturing tolerance of the arm's lengths, a standard deviation, mm: a scale of the instrument is named where
    /// lengths within it do not explain the scale. The fit's own prior is wider, so that worse lengths are found.
    pub length_tolerance_mm: f64,
    /// Whether orientations are fitted where the log has them.
    pub orientations: bool,
    /// Position of the measured target on the flange, where known. With one tool orientation nothing else tells it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<KnownTarget>,
    /// Known positions of targets on the flange by their names, where there are several.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub targets: BTreeMap<String, KnownTarget>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub target_distances: Vec<KnownDistance>,
    /// Names of targets in order of [`TargetId`]; empty for one without a name. The input states them, not this section.
    #[serde(skip)]
    pub target_names: Vec<String>,
    /// Names of the sources in the order of [`SourceId`]; empty for one without a name. The input states them, not this section.
    #[serde(skip)]
    pub source_names: Vec<String>,
    /// Stated places and offsets of the sources that read lengths, in the order of [`SourceId`]. The input states them, not this section.
    #[serde(skip)]
    pub gauges: Vec<KnownGauge>,
    pub blocks: Blocks,
}

impl Default for FitSettings {
    fn default() -> Self {
        Self {
            repeatability_mm: 0.03,
            loss: Loss::Squares,
            prior_length_mm: 3.0,
            prior_angle_mrad: 3.0,
            length_tolerance_mm: 0.3,
            orientations: false,
            target: None,
            targets: BTreeMap::new(),
            target_distances: Vec::new(),
            target_names: Vec::new(),
            source_names: Vec::new(),
            gauges: Vec::new(),
            blocks: Blocks::default(),
        }
    }
}

impl FitSettings {
    /// The prior of geometry and measured targets that the settings state; places and distances of targets that
    /// [`Self::target_names`] does not name have no part in it.
    pub fn prior(&self) -> Prior {
        let sizes = (self.prior_length_mm, self.prior_angle_mrad * 1e-3);
        Prior {
            geometry: (sizes.0 > 0.0 && sizes.1 > 0.0).then_some(sizes),
            targets: self.known_targets(),
            distances: self.target_distances.iter().filter_map(|own| self.distance(own)).collect(),
            gauges: self.gauges.clone(),
        }
    }

    fn known_targets(&self) -> Vec<Option<KnownTarget>> {
        match &self.target_names[..] {
            [] => vec![self.target],
            [only] => vec![self.targets.get(only).copied().or(self.target)],
            names => names.iter().map(|name| self.targets.get(name).copied()).collect(),
        }
    }

    fn distance(&self, known: &KnownDistance) -> Option<TargetDistance> {
        let [a, b] = &known.between;
        Some(TargetDistance {
            between: [self.target_of(a)?, self.target_of(b)?],
            mm: known.mm,
            sd_mm: known.sd_mm,
        })
    }

    fn target_of(&self, name: &str) -> Option<TargetId> {
        let mut names = self.target_names.iter();
        names.position(|own| own == name).map(TargetId)
    }

    /// The name of a source; `tracker` where it has none.
    pub fn source_name(&self, source: SourceId) -> String {
        self.source_names.get(source.0).cloned().unwrap_or_else(|| "tracker".to_owned())
    }

    /// Refuses places and distances of targets that have no readings: their names are not among [`Self::target_names`].
    pub fn check_targets(&self) -> Result<(), FitError> {
        let distances = self.target_distances.iter();
        let mut stated = self.targets.keys().chain(distances.flat_map(|known| &known.between));
        stated.find(|name| self.target_of(name).is_none()).map_or(Ok(()), |name| {
            Err(FitError::UnknownTarget { name: name.clone(), known: self.target_names.join(", ") })
        })
    }
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    #[error(
        "{stations} measured stations in session {session}, but base and target alone need at least {needed}: \
         measure more poses, or look at the rejects for what was left out"
    )]
    TooFewStations { session: usize, stations: usize, needed: usize },
    #[error(
        "{readings} readings of instrument {instrument} of session {session} (the first of each is 0), which reads one length, but its place \
         and the target's need at least {needed}: measure more poses, or leave the instrument out"
    )]
    TooFewLengths { session: usize, instrument: usize, readings: usize, needed: usize },
    #[error(
        "the lengths of {name:?} lie {off_mm:.1} mm off the arm, {factor:.0} times what is stated of them: look at their unit, their column, \
         what they read (a distance, or a height), the place that is stated and the sign of an offset; its scale may be wrong, or that of the \
         other instruments: where nothing else is, leave out the one that a known distance shows to be wrong"
    )]
    OtherLengths { name: String, off_mm: f64, factor: f64 },
    #[error(
        "no reading of session {session} (the first is 0) is of target {target}, though others name later targets: number targets \
         without gaps"
    )]
    UnseenTarget { session: usize, target: usize },
    #[error(
        "[fit] states something of the target {name:?}, but the input has no target of that name (it has: {known}): correct the name in \
         [fit.targets] or target_distances"
    )]
    UnknownTarget { name: String, known: String },
    #[error(
        "[fit] target says where one target sits, but session {session} (the first is 0) has {targets}: leave it out, or say which it \
         is, as [fit.targets.NAME]"
    )]
    KnownTargetOfSeveral { session: usize, targets: usize },
    #[error(transparent)]
    SeveralSources(#[from] SeveralSources),
    #[error(
        "the measured stations of session {session} (the first is 0) lie in one place or on a line (spread {spread_mm:.3} mm across \
         the longest direction's normal): the base frame cannot be found, spread the poses"
    )]
    Degenerate { session: usize, spread_mm: f64 },
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Calibration {
    pub freedom: Freedom,
    /// The unknowns in the order of the offsets and the covariance.
    pub unknowns: Vec<Unknown>,
    /// Prior standard deviation of each unknown, where it has one.
    pub prior_sd: Vec<Option<f64>>,
    pub covariance: DMatrix<f64>,
    /// Offsets of the arm's own chain, in its order.
    pub geometry: Vec<f64>,
    /// The identified chain from base to flange: the arm's own with these offsets.
    pub chain: Chain,
    pub frames: Vec<Frames>,
    pub nominal_structure: Structure,
    pub structure: Structure,
    pub poses: usize,
    pub stations: usize,
    pub misfit_mm: f64,
    pub solution: Solution,
    /// The part that each source had: its noise's size and its share of the information.
    pub sources: Vec<SourceSize>,
}

impl Calibration {
    /// Standard deviations of the base of a session with one source as this fit found it: of each coordinate of its origin, mm, and of
    /// its rotation about each axis, rad; root mean squares of those of the three axes.
    pub fn base_standard_errors(&self, session: usize) -> (f64, f64) {
        let mut variances = [0.0; 2];
        for (place, unknown) in self.unknowns.iter().enumerate() {
            let variance = self.standard_error(place).powi(2);
            match unknown.parameter {
                _ if unknown.session() != Some(session) => {}
                Parameter::Base(Motion::Translation(_)) => variances[0] += variance,
                Parameter::Base(Motion::Rotation(_)) => variances[1] += variance,
                Parameter::Link { .. } | Parameter::Target(_) | Parameter::Gauge(_) => {}
            }
        }
        variances.map(|sum| (sum / 3.0).sqrt()).into()
    }

    /// Largest standard error of a coordinate of the places at the flange of a session's targets, mm, where the poses hardly tell them from
    /// the base's place: it is that of confounded parameters. `None` where they do, and where the place of a target is stated.
    pub fn open_target_mm(&self, session: usize) -> Option<f64> {
        // With a known base each station measures each coordinate once.
        let alone = self.misfit_mm / (self.stations as f64).sqrt();
        let mut largest: f64 = 0.0;
        for (place, unknown) in self.unknowns.iter().enumerate() {
            let is_place = matches!(unknown.parameter, Parameter::Target(Motion::Translation(_)));
            if is_place && unknown.session() == Some(session) {
                if self.prior_sd[place].is_some() {
                    return None;
                }
                largest = largest.max(self.standard_error(place));
            }
        }
        (largest > identifiability::CONFOUNDED_ERRORS * alone).then_some(largest)
    }

    /// The standard error of the unknown at `place`, mm or rad.
    pub fn standard_error(&self, place: usize) -> f64 {
        self.covariance[(place, place)].max(0.0).sqrt()
    }

    pub fn observability(&self) -> Option<Observability> {
        self.structure.observability(self.poses)
    }
}

/// Identifies the parameters that `freedom` allows from the observations of `sessions` sessions.
pub fn identify(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    freedom: Freedom,
    settings: &FitSettings,
) -> Result<Calibration, FitError> {
    let starts = start::frames(arm, observations, sessions, settings)?;
    Ok(identify_from(arm, observations, &starts, freedom, settings))
}

/// [`identify`] from given starting frames, one a session. Sizes of noise of several sources are estimated ([`sources`]).
pub fn identify_from(
    arm: &Arm,
    observations: &[Observation],
    starts: &[Frames],
    freedom: Freedom,
    settings: &FitSettings,
) -> Calibration {
    let Some(mut factors) = Factors::of(observations) else {
        return identify_sized(arm, observations, starts, freedom, settings, None);
    };
    let mut found = identify_sized(arm, observations, starts, freedom, settings, Some(&factors));
    for _ in 0..sources::ITERATIONS {
        if factors.updated(&found.sources) {
            break;
        }
        let sized = factors.applied(observations);
        found = identify_sized(arm, &sized, starts, freedom, settings, Some(&factors));
    }
    found
}

/// [`identify_from`] with the sources' noise as it is in the observations.
fn identify_sized(
    arm: &Arm,
    observations: &[Observation],
    starts: &[Frames],
    freedom: Freedom,
    settings: &FitSettings,
    factors: Option<&Factors>,
) -> Calibration {
    let stated = settings.prior();
    let fit = |prior: &Prior, before: Option<&Calibration>| {
        let problem = Problem::new(observations, arm.chain(), starts, freedom, prior);
        identify_with(arm, &problem, freedom, settings.loss, factors, before)
    };
    let mut found = fit(&stated, None);
    for _ in 0..WIDENINGS {
        let Some(wider) = found.wider_prior(&stated) else { break };
        found = fit(&wider, Some(&found));
    }
    found
}

/// The solution of `problem`, beginning where `before` ended: the same with another prior.
fn identify_with(
    arm: &Arm,
    problem: &Problem<'_>,
    freedom: Freedom,
    loss: Loss,
    factors: Option<&Factors>,
    before: Option<&Calibration>,
) -> Calibration {
    let nominal = DVector::zeros(problem.unknowns.len());
    let nominal_structure = before.map_or_else(
        || Structure::of(problem, &nominal),
        |before| before.nominal_structure.clone(),
    );
    let start = before.map_or(nominal, |before| before.solution.offsets.clone());
    let mut solution = solve::solve(problem, start, loss, nominal_structure.rank);
    if let Some(before) = before {
        solution.cost[0] = before.solution.cost[0];
    }
    let structure = Structure::of(problem, &solution.offsets);
    let geometry = problem.geometry(&solution.offsets);
    let stations: BTreeSet<_> =
        problem.observations.iter().map(|own| (own.session, own.station)).collect();
    let covariance = covariance(problem, &solution, nominal_structure.rank);
    Calibration {
        sources: sources::sizes(problem, &solution, &covariance, factors),
        freedom,
        unknowns: problem.unknowns.clone(),
        prior_sd: problem.precision.iter().map(|&p| (p > 0.0).then(|| p.sqrt().recip())).collect(),
        covariance,
        chain: arm.chain().with_offsets(&geometry),
        geometry,
        frames: problem.frames(&solution.offsets),
        nominal_structure,
        structure,
        poses: problem.observations.len(),
        stations: stations.len(),
        misfit_mm: problem.misfit_mm(&solution.offsets),
        solution,
    }
}

/// `(s⁻² JᵀWJ + P)⁻¹` on scaled columns; without a prior its pseudo-inverse of rank `rank`.
fn covariance(problem: &Problem<'_>, solution: &Solution, rank: usize) -> DMatrix<f64> {
    let factor = solution.variance_factor;
    let matrix = problem.posterior_information(&solution.information, &solution.offsets, factor);
    let scales = matrix.diagonal().map(|d| if d > 0.0 { d.sqrt().recip() } else { 1.0 });
    let size = scales.len();
    let scaled = DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] * scales[i] * scales[j]);
    let eigen = scaled.symmetric_eigen();
    let mut order: Vec<usize> = (0..size).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let directions = if problem.precision.iter().any(|&p| p > 0.0) { size } else { rank };
    let mut inverse = DMatrix::zeros(size, size);
    for &direction in order.iter().take(directions).filter(|&&i| eigen.eigenvalues[i] > 0.0) {
        let vector = eigen.eigenvectors.column(direction);
        inverse.ger(eigen.eigenvalues[direction].recip(), &vector, &vector, 1.0);
    }
    DMatrix::from_fn(size, size, |i, j| inverse[(i, j)] * scales[i] * scales[j])
}
