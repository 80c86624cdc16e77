//! Report: predictions compared with measurements → residuals and accuracy figures, each with its subject.
//!
//! A figure states the model, the angles, the base, the stations and the evidence that it belongs to
//! ([`crate::method::accuracy`]): *training* or *held out*, *measured*, *predicted* or *measured after*, *before* or
//! *after*. `posegrid::page` shows the figures to people, with the charts of [`chart`].

pub mod accuracy;
pub mod chart;
pub mod compared;
pub mod driven;
pub mod evaluate;
pub mod frame;
pub mod iso_9283;
pub mod limit;
pub mod locate;
pub mod next;
pub mod promise;
pub mod refit;
pub mod symbols;
pub mod tip;
pub mod unseen;
pub mod verdict;

use std::collections::BTreeSet;

use nalgebra::{Matrix3, Point3, Vector3};

use crate::figures::{Counted, Figures, PoseErrors};
pub use crate::fit::{Angles, Model};
use crate::grid::Verdict;
use crate::join::TargetId;
pub use locate::Finders;
use serde::{Deserialize, Serialize};
use tip::Turn;

/// The way in which the stations that judge were kept from training.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Split {
    None,
    Blocks,
    Session,
}

/// The source of the base of a held-out session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum BaseRefit {
    None,
    First,
    /// From stations of the session that were chosen by their poses, judged on the rest.
    Chosen,
    /// From all its stations: for comparing models only.
    All,
}

impl BaseRefit {
    /// Whether some stations of the session find its base, and the others judge.
    pub const fn judges(self) -> bool {
        matches!(self, Self::First | Self::Chosen)
    }
}

/// The subject of a set of residuals: model, angles, stations and base.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Subject {
    pub split: Split,
    pub of_session: String,
    pub model: Model,
    pub angles: Angles,
    pub base_refit: BaseRefit,
}

/// Measured minus predicted target at one station, base frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Residual {
    pub station: usize,
    /// The target that was read; `None` where the session has one, and for errors of the tool point.
    pub target: Option<TargetId>,
    /// Number of the station that names its pose; all visits of one pose share it.
    pub pose: usize,
    /// The fold that held it out; `None` unless blocks were held out.
    pub fold: Option<usize>,
    pub used_for_refit: bool,
    pub attained: Point3<f64>,
    pub residual: Vector3<f64>,
    /// Covariance of measured minus predicted, mm²; `None` where the model has none.
    pub covariance: Option<Matrix3<f64>>,
    /// Robust weight of the station in training; `None` for a station that did not train.
    pub weight: Option<f64>,
    /// Attained and wanted orientation of the flange; `None` where its orientation was not measured.
    pub turn: Option<Turn>,
}

impl Subject {
    pub fn new(
        (split, of_session): (Split, &str),
        model: Model,
        angles: Angles,
        base_refit: BaseRefit,
    ) -> Self {
        Self { split, of_session: of_session.to_owned(), model, angles, base_refit }
    }
}

impl Residual {
    /// Predicted position of the target, mm, base frame.
    pub fn predicted(&self) -> Point3<f64> {
        self.attained - self.residual
    }

    /// Whether it is of the main target, or of the only one: one residual a station.
    pub fn is_of_main(&self) -> bool {
        self.target.is_none_or(|target| target == TargetId::MAIN)
    }

    /// Squared Mahalanobis distance, `rᵀ Σ⁻¹ r`; `None` without a covariance, or with one that is not positive definite.
    pub fn mahalanobis_squared(&self) -> Option<f64> {
        Some(self.residual.dot(&self.covariance?.cholesky()?.solve(&self.residual)))
    }
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualSet {
    pub subject: Subject,
    pub residuals: Vec<Residual>,
}

impl ResidualSet {
    /// Residuals of the stations that judge: all except those that the base was refitted on.
    pub fn judged(&self) -> impl Iterator<Item = &Residual> {
        self.residuals.iter().filter(|r| !r.used_for_refit)
    }

    pub fn finders(&self) -> usize {
        let finders = self.residuals.iter().filter(|r| r.used_for_refit);
        let finders: BTreeSet<usize> = finders.map(|r| r.station).collect();
        finders.len()
    }

    /// Errors of the stations that judge, by pose; several values for a station (`errors`, mm) are samples of its error.
    /// Poses that the base was refitted on take no part: another visit of one would be judged by a base fitted to it.
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

#[derive(Debug, Clone, PartialEq)]
pub struct Accuracy {
    pub subject: Subject,
    pub point: Point,
    /// Before compensation (the error without it) or after (the error that a prediction would leave, or a table left).
    pub moment: Moment,
    /// The run whose table drove the stations; `None` where none did.
    pub driven_by: Option<String>,
    /// Figures of the error norms, mm; where `None`, the verdict states the reason.
    pub figures: Option<Figures>,
    /// Distribution-free upper tolerance bound, mm; `None` where there are too few poses.
    pub bound: Option<f64>,
    pub counted: Counted,
    /// The stations that base and target of a session that took no part were found from; `None` where they were not found from
    /// stations that do not judge.
    pub finders: Option<Finders>,
    /// Number of distinct blocks of the stations: those of one block are not independent. `None` where there are no blocks.
    pub blocks: Option<usize>,
    /// Share of stations inside their 95 % ellipsoids and mean squared Mahalanobis distance (3 expected); `None` without
    /// covariances.
    pub coverage: Option<Calibrated>,
    pub expanded_uncertainty_mm: f64,
    pub verdict: Verdict,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Point {
    /// The target that the tracker measured.
    Measured,
    /// The controller's own tool point.
    Tool,
    /// The tool tip that the pipeline file states, computed by lever arm.
    Tip,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Moment {
    /// The error without compensation.
    Before,
    /// The error that a prediction leaves of errors measured without it.
    After,
    /// The error that a table left in a session that it drove.
    MeasuredAfter,
}

/// The agreement of stated covariances with the errors found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Calibrated {
    /// Share of stations inside their 95 % ellipsoid.
    pub inside: f64,
    /// Mean squared Mahalanobis distance; 3 is expected.
    pub mean_squared_distance: f64,
}
