//! The full error model as its training leaves it, and back, equal to the last bit on the same processor features.
//!
//! [`super::saved`] is for whoever predicts with a model years later and has nothing else. Here is what follows from the training alone:
//! columns, sizes, weights and coefficients, some hundred kilobytes. The factor of the covariance, some megabytes a model, follows from them
//! and the observations by one more sum of rows, a small part of a training's work, so it is not stored; the coefficients prove that it is
//! that of the training. Leave-one-out residuals are not stored either: nothing after the training reads them.

use nalgebra::{DVector, Point3, Vector3};
use serde::{Deserialize, Serialize};

use super::FullModel;
use super::approach::ApproachOffsets;
use super::layout::Layout;
use super::noise::Repeatability;
use super::regression::few_rows::FewRows;
use super::regression::{Evidence, Posterior};
use super::rows::{Around, State, prior_mean, stations};
use super::settings::FullSettings;
use super::sides::Sides;
use super::student::Tails;
use super::whitening::evidence;
use crate::fit::frames::Frames;
use crate::fit::model::PartEvidence;
use crate::fit::observation::Observation;
use crate::fit::problem::{Prior, Problem};
use crate::fit::saved::{SavedError, same_length};
use crate::fit::scale::ScaleEvidence;
use crate::kinematics::Arm;

/// A trained full error model, without what follows from its arm and prior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StoredFull {
    pub(super) up: Option<Vector3<f64>>,
    /// The frames that the unknowns of each session are relative to.
    pub(super) starts: Vec<Frames>,
    /// Whether the targets' own orientations are unknowns.
    pub(super) turned: bool,
    pub layout: Layout,
    pub(super) offsets: DVector<f64>,
    /// The offsets at which the training's last round evaluated its rows: those of the bases have moved since.
    pub(super) rows_at: DVector<f64>,
    /// Variance per axis of a session's own drift, mm².
    pub(super) drift_variance: f64,
    /// Variance per axis of the warm-up drift that all sessions repeat, mm².
    pub(super) warm_up_variance: f64,
    /// The middle of each session's stations, in the base frame, mm.
    pub(super) middles: Vec<Point3<f64>>,
    /// Standard deviation of a session's own scale, as a share of the distance from the middle of its stations: for commands
    /// used in another session, and for unseen sessions.
    pub scale_sd: f64,
    /// The stations' evidence on lengths and scales; `None` where the model has no scales, or was read from a file.
    pub scale_evidence: Option<ScaleEvidence>,
    pub(super) approach: Option<ApproachOffsets>,
    /// Backlash of which `approach` has the variance.
    pub sides: Option<Sides>,
    pub(super) tails: Tails,
    pub(super) mean: DVector<f64>,
    /// [`Posterior::scale`].
    pub(super) scale: DVector<f64>,
    /// [`Posterior::whitened`].
    pub(super) whitened: DVector<f64>,
    pub(super) span: f64,
    pub repeatability: Repeatability,
    pub weights: Vec<f64>,
    pub parts: Vec<PartEvidence>,
}

/// Largest difference of a whitened coefficient that other processor features explain.
const SAME: f64 = 1e-6;

impl StoredFull {
    /// The model of `arm` that was trained on `observations` with this prior and these settings; an error where the parts do not fit each
    /// other, or are not of these observations.
    pub fn model(
        self,
        arm: &Arm,
        observations: &[Observation],
        prior: &Prior,
        settings: &FullSettings,
    ) -> Result<FullModel, SavedError> {
        let trained = self.problem(arm, observations, prior);
        self.check_lengths(&trained)?;
        let posterior = self.posterior(&trained, settings)?;
        Ok(self.with(posterior, arm, prior))
    }

    /// [`Self::model`] for its predictions alone: its covariances are those before the training, and nothing is summed.
    pub fn predicting(
        self,
        arm: &Arm,
        observations: &[Observation],
        prior: &Prior,
        _: &FullSettings,
    ) -> Result<FullModel, SavedError> {
        self.check_lengths(&self.problem(arm, observations, prior))?;
        let nothing = Evidence::Rows(FewRows::none(self.scale.len()));
        let posterior = nothing.posterior_at(self.scale.clone());
        let posterior = posterior.ok_or(SavedError::Factor { problem: "is not positive" })?;
        Ok(self.with(posterior, arm, prior))
    }

    fn with(self, posterior: Posterior, arm: &Arm, prior: &Prior) -> FullModel {
        let problem = self.problem(arm, &[], prior);
        FullModel::of(self, problem, posterior, Vec::new())
    }

    fn problem<'o>(
        &self,
        arm: &Arm,
        observations: &'o [Observation],
        prior: &Prior,
    ) -> Problem<'o> {
        Problem::of_geometry(observations, arm, &self.starts, prior, self.turned)
    }

    fn check_lengths(&self, problem: &Problem<'_>) -> Result<(), SavedError> {
        let (unknowns, columns) = (problem.unknowns.len(), self.layout.size());
        let (observations, sessions) = (problem.observations.len(), self.starts.len());
        for (what, expected, found) in [
            ("offsets", unknowns, self.offsets.len()),
            ("offsets of the rows", unknowns, self.rows_at.len()),
            ("means", columns, self.mean.len()),
            ("prior deviations", columns, self.scale.len()),
            ("whitened means", columns, self.whitened.len()),
            ("weights", observations, self.weights.len()),
            ("middles", sessions, self.middles.len()),
        ] {
            same_length(what, expected, found)?;
        }
        Ok(())
    }

    /// The posterior of the training's last round, summed again.
    fn posterior(
        &self,
        problem: &Problem<'_>,
        settings: &FullSettings,
    ) -> Result<Posterior, SavedError> {
        let at = self.rows_at.clone();
        let readings = stations(problem.observations).into_iter();
        let state = State {
            layout: self.layout.clone(),
            repeatability: self.repeatability.clone(),
            tails: self.tails,
            weights: readings.map(|own| self.weights[own.start]).collect(),
            span: self.span,
            middles: self.middles.clone(),
            ..State::expected(problem, at, settings, self.up)
        };
        let around = Around::new(problem, &state);
        let evidence = evidence(&around, &prior_mean(problem, &state));
        let posterior = evidence.posterior_at(self.scale.clone());
        let posterior = posterior.ok_or(SavedError::Factor { problem: "is not positive" })?;
        let away = (&posterior.whitened - &self.whitened).amax();
        // Written so that a number that is none is refused too.
        let problem =
            "does not give the stored coefficients: the stations are not those that trained";
        (away <= SAME).then_some(posterior).ok_or(SavedError::Factor { problem })
    }
}
