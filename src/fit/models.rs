//! The models that are held side by side, trained on the same observations.

use nalgebra::{Isometry3, Matrix3, Point3, UnitVector3, Vector3};

use super::full::{FullModel, FullSettings, Known, Query};
use super::gauge::{ErrorModel, Gauge};
use super::observation::Observation;
use super::{Calibration, FitError, FitSettings, Freedom, identify_from, start};
use crate::kinematics::Arm;

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

/// Errors of the tool point as one of the models predicts them, from commanded angles, in a session's gauge.
#[derive(Debug)]
pub struct ToolErrors<'m> {
    models: &'m Models,
    gauge: &'m Gauge<'m>,
    session: usize,
}

impl<'m> ToolErrors<'m> {
    /// The errors of `session` in its `gauge`.
    pub const fn new(models: &'m Models, gauge: &'m Gauge<'m>, session: usize) -> Self {
        Self {
            models,
            gauge,
            session,
        }
    }

    fn query<'q>(&self, axes: &'q [f64]) -> Query<'q> {
        let session = self.session;
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

    fn geometric_tool(&self, axes: &[f64]) -> Point3<f64> {
        let calibration = &self.models.geometric;
        let frames = &calibration.frames[self.session];
        let flange: Isometry3<f64> = self
            .gauge
            .arm()
            .chain()
            .forward(axes, &calibration.geometry);
        let target = frames.flange_from_target.isometry().translation.vector;
        frames.tracker_from_base.isometry() * flange * Point3::from(target + self.gauge.lever())
    }
}

impl ErrorModel for ToolErrors<'_> {
    fn error(&self, joints: &[f64]) -> Vector3<f64> {
        let axes = self.gauge.arm().axes(joints);
        let tool = match &self.models.full {
            Some(full) => full.position(&self.query(&axes)),
            None => self.geometric_tool(&axes),
        };
        self.in_gauge(joints, &tool)
    }

    fn error_with_covariance(&self, joints: &[f64]) -> (Vector3<f64>, Matrix3<f64>) {
        let axes = self.gauge.arm().axes(joints);
        let Some(full) = &self.models.full else {
            // What the geometry cannot explain is its error's variance: s² times the noise it was whitened with.
            return (
                self.error(joints),
                self.models.geometric.misfit_covariance(),
            );
        };
        let predicted = full.predict(&self.query(&axes));
        let rotation = self
            .gauge
            .frames()
            .tracker_from_base
            .isometry()
            .rotation
            .to_rotation_matrix();
        let covariance = full.covariances(&predicted.rows)[0] + predicted.standing;
        (
            self.in_gauge(joints, &predicted.position),
            rotation.transpose() * covariance * rotation,
        )
    }
}
