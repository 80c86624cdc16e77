//! The models that are held side by side, trained on the same observations.

use nalgebra::{Matrix3, Point3, UnitVector3, Vector3};

use super::full::{FullModel, FullSettings, Known, Query};
use super::gauge::{ErrorModel, Gauge};
use super::observation::Observation;
use super::{Calibration, FitError, FitSettings, Frames, Freedom, identify_from, start};
use crate::kinematics::{Arm, Chain};

/// What a training is set to.
#[derive(Debug, Clone, Copy)]
pub struct TrainingSettings<'s> {
    /// The geometric fit.
    pub fit: &'s FitSettings,
    /// The whole error model.
    pub full: &'s FullSettings,
    /// Against gravity, in the base frame; `None` where the mounting is not known.
    pub up: Option<UnitVector3<f64>>,
}

/// Base + target, geometry and the whole error model of the same observations.
#[derive(Debug)]
pub struct Models {
    /// The nominal arm, base and target fitted: the gauge of errors.
    pub base_target: Calibration,
    /// The identified geometry.
    pub geometric: Calibration,
    /// The whole error model, unless it is switched off or could not be factored.
    pub full: Option<FullModel>,
}

/// Trains all models on the observations of `sessions` sessions.
pub fn train(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &TrainingSettings<'_>,
) -> Result<Models, FitError> {
    let starts = start::frames(arm, observations, sessions, settings.fit)?;
    let identified = |freedom| identify_from(arm, observations, &starts, freedom, settings.fit);
    let (base_target, geometric) = (
        identified(Freedom::BaseAndTarget),
        identified(Freedom::Geometry),
    );
    let train_full = || {
        let (frames, geometry) = (&geometric.frames, &geometric.geometry);
        FullModel::train(
            arm,
            observations,
            frames,
            geometry,
            settings.fit.prior(),
            settings.full,
            settings.up,
        )
    };
    let full = if settings.full.enabled {
        train_full()
    } else {
        None
    };
    Ok(Models {
        base_target,
        geometric,
        full,
    })
}

/// The geometry that one session identified, in its own frames.
#[derive(Debug, Clone)]
pub struct IdentifiedGeometry {
    /// The identified chain from base to flange.
    pub chain: Chain,
    /// The frames that belong to it.
    pub frames: Frames,
    /// Root mean square of measured minus predicted, per axis, mm.
    pub misfit_mm: f64,
}

/// What predicts where the target is attained in one session, from commanded angles.
#[derive(Debug)]
pub enum Predictor<'m> {
    /// The whole error model.
    Full {
        /// The model.
        model: &'m FullModel,
        /// The session's place in it.
        session: usize,
    },
    /// The identified geometry, where there is no whole model.
    Geometric(IdentifiedGeometry),
}

impl<'m> Predictor<'m> {
    /// The best of `models` for `session`.
    pub fn of(models: &'m Models, arm: &Arm, session: usize) -> Self {
        let geometric = &models.geometric;
        models.full.as_ref().map_or_else(
            || {
                Self::Geometric(IdentifiedGeometry {
                    chain: geometric.chain(arm),
                    frames: geometric.frames[session],
                    misfit_mm: geometric.misfit_mm,
                })
            },
            |model| Self::Full { model, session },
        )
    }
}

/// Errors of the tool point as a model predicts them, from commanded angles, in a session's gauge.
#[derive(Debug)]
pub struct ToolErrors<'m> {
    predictor: Predictor<'m>,
    gauge: &'m Gauge<'m>,
}

impl<'m> ToolErrors<'m> {
    /// The errors that `predictor` sees in its session's `gauge`.
    pub const fn new(predictor: Predictor<'m>, gauge: &'m Gauge<'m>) -> Self {
        Self { predictor, gauge }
    }

    fn query<'q>(&self, axes: &'q [f64], session: usize) -> Query<'q> {
        Query {
            axes,
            known: Known::Commanded,
            lever: self.gauge.lever(),
            session,
            own: true,
            station: None,
        }
    }

    /// A point in the tracker's frame as an error in the gauge.
    fn in_gauge(&self, joints: &[f64], tool: &Point3<f64>) -> Vector3<f64> {
        let base = self.gauge.frames().tracker_from_base.isometry();
        base.inverse_transform_point(tool).coords
            - self.gauge.nominal_tool(joints).translation.vector
    }

    /// The predicted tool point in the tracker's frame.
    fn tool(&self, axes: &[f64]) -> Point3<f64> {
        match &self.predictor {
            Predictor::Full { model, session } => model.position(&self.query(axes, *session)),
            Predictor::Geometric(arm) => {
                let target = arm.frames.flange_from_target.isometry().translation.vector;
                let at_flange = Point3::from(target + self.gauge.lever());
                arm.frames.tracker_from_base.isometry() * arm.chain.nominal(axes) * at_flange
            }
        }
    }
}

impl ErrorModel for ToolErrors<'_> {
    fn error(&self, joints: &[f64]) -> Vector3<f64> {
        self.in_gauge(joints, &self.tool(&self.gauge.arm().axes(joints)))
    }

    fn error_with_covariance(&self, joints: &[f64]) -> (Vector3<f64>, Matrix3<f64>) {
        let (model, session) = match &self.predictor {
            Predictor::Full { model, session } => (model, *session),
            // What the geometry cannot explain is its error's variance, the same along each axis.
            Predictor::Geometric(arm) => {
                let variance = Matrix3::identity() * arm.misfit_mm.powi(2);
                return (self.error(joints), variance);
            }
        };
        let axes = self.gauge.arm().axes(joints);
        let predicted = model.predict(&self.query(&axes, session));
        let base = self.gauge.frames().tracker_from_base.isometry().rotation;
        let rotation = base.to_rotation_matrix();
        // A command is given some day: where the base then stands is not known.
        let drift = Matrix3::identity() * model.any_time_variance();
        // And by which scale it was told: corrections are those of the mean scale of all sessions.
        let scale = model.any_scale_covariance(session, &predicted.position);
        let covariance = model.covariances(&predicted.rows)[0] + predicted.standing + drift + scale;
        (
            self.in_gauge(joints, &predicted.position),
            rotation.transpose() * covariance * rotation,
        )
    }
}
