//! Report: predictions held against measurements → residuals and accuracy figures, with what each is a figure of.
//!
//! A figure says by which model, at which angles, with which base, on which stations and of which evidence it is
//! ([`crate::method::accuracy`]): *training* or *held out*, *measured*, *predicted* or *measured after*, *before* or
//! *after*. [`crate::page`] tells them to people, with the charts of [`chart`].

pub mod accuracy;
pub mod chart;
pub mod driven;
pub mod evaluate;
pub mod frame;
pub mod iso_9283;
pub mod promise;
pub mod refit;
pub mod tip;
pub mod verdict;

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Point3, Vector3};

use crate::figures::{Counted, Figures, PoseErrors};
pub use crate::fit::{Angles, Model};
use crate::grid::Verdict;
use tip::Turn;

/// How stations that judge were kept from training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Split {
    /// They were not: training figures.
    None,
    /// Whole blocks of the work space held out, every block once.
    Blocks,
    /// A whole session held out.
    Session,
}

/// Where the base of a held-out session comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum BaseRefit {
    /// From training.
    None,
    /// From the session's first stations, judged on the rest.
    First,
    /// From all its stations: for comparing models only.
    All,
}

/// What a set of residuals is of.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Subject {
    /// How the stations were kept from training.
    pub split: Split,
    /// The session the stations are of.
    pub of_session: String,
    /// Which model predicts.
    pub model: Model,
    /// At which angles.
    pub angles: Angles,
    /// With which base.
    pub base_refit: BaseRefit,
}

/// Measured minus predicted target at one station, base frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Residual {
    /// The station's number in its session.
    pub station: usize,
    /// The number of the station that its pose is named by: visits of one pose have one.
    pub pose: usize,
    /// The fold that held it out, where blocks were.
    pub fold: Option<usize>,
    /// Whether the base was refitted on it.
    pub used_for_refit: bool,
    /// Predicted position of the target, mm.
    pub predicted: Point3<f64>,
    /// Measured minus predicted, mm.
    pub residual: Vector3<f64>,
    /// Covariance of measured minus predicted, mm², where the model has one.
    pub covariance: Option<Matrix3<f64>>,
    /// The station's robust weight, in training.
    pub weight: Option<f64>,
    /// How the flange stood and was predicted or commanded to stand, where its orientation was measured.
    pub turn: Option<Turn>,
}

impl Residual {
    /// Squared Mahalanobis distance, `rᵀ Σ⁻¹ r`; `None` without a covariance, or with one that is not positive definite.
    pub fn mahalanobis_squared(&self) -> Option<f64> {
        let factor = self.covariance?.cholesky()?;
        Some(self.residual.dot(&factor.solve(&self.residual)))
    }
}

/// Residuals of one model on one set of stations.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualSet {
    /// What they are of.
    pub subject: Subject,
    /// In station order.
    pub residuals: Vec<Residual>,
}

impl ResidualSet {
    /// Residuals of the stations that judge: all but those that the base was refitted on.
    pub fn judged(&self) -> impl Iterator<Item = &Residual> {
        self.residuals.iter().filter(|r| !r.used_for_refit)
    }

    /// Errors of the stations that judge, by pose; several of a station (`errors`, mm) are samples of it. Poses that the base was
    /// refitted on take no part: another visit of one would be judged by what it was fitted to.
    pub fn by_pose<E: IntoIterator<Item = f64>>(
        &self,
        errors: impl Fn(&Residual) -> E,
    ) -> PoseErrors {
        let fitted = self.residuals.iter().filter(|r| r.used_for_refit);
        let fitted: BTreeSet<usize> = fitted.map(|r| r.pose).collect();
        let mut by_pose = PoseErrors::default();
        for residual in self.judged().filter(|r| !fitted.contains(&r.pose)) {
            for (sample, error_mm) in errors(residual).into_iter().enumerate() {
                by_pose.add(residual.pose, residual.station, sample, error_mm);
            }
        }
        by_pose
    }
}

/// Accuracy of one model on one set of stations.
#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    /// What it is of.
    pub subject: Subject,
    /// The point that the errors are of.
    pub point: Point,
    /// Before compensation (an error as it is) or after (what a prediction would leave, or a table left).
    pub moment: Moment,
    /// The run whose table drove the stations, where one did.
    pub driven_by: Option<String>,
    /// Figures of the error norms, mm; `None` with a reason in the verdict.
    pub figures: Option<Figures>,
    /// Distribution-free upper tolerance bound, mm.
    pub bound: Option<f64>,
    /// Poses and visits that the bound counts.
    pub counted: Counted,
    /// Distinct blocks the stations lie in: those of one block are not independent.
    pub blocks: Option<usize>,
    /// Share of stations inside their 95 % ellipsoids and mean squared Mahalanobis distance (3 expected).
    pub coverage: Option<Calibrated>,
    /// Expanded uncertainty (k = 2) of one measured error, mm.
    pub expanded_uncertainty_mm: f64,
    /// Bound plus uncertainty held against the tolerance.
    pub verdict: Verdict,
}

/// The point that an error is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Point {
    /// The target that the tracker saw.
    Measured,
    /// The controller's own tool point.
    Tool,
    /// The tool tip that the pipeline file states, by lever arm.
    Tip,
}

/// Before or after compensation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Moment {
    /// The error as it is.
    Before,
    /// What a prediction leaves of errors measured without it.
    After,
    /// What a table left in a session that it drove.
    MeasuredAfter,
}

/// How well stated covariances fit what was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibrated {
    /// Share of stations inside their 95 % ellipsoid.
    pub inside: f64,
    /// Mean squared Mahalanobis distance; 3 is expected.
    pub mean_squared_distance: f64,
}
