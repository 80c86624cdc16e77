//! Errors of the tool point at commands, as a model predicts them.

use nalgebra::{Matrix3, Point3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::error_frame::ErrorFrame;
use super::frames::FramePair;
use super::gap::Gap;
use super::model::{At, Known, PoseModel, Prediction, Query, Spread};

/// Number of predictions whose covariances are found together; fixed, so that results do not depend on the number of threads.
const TOGETHER: usize = 64;

/// An error, mm, and its covariance, mm², in the base frame.
pub type ErrorWithCovariance = (Vector3<f64>, Matrix3<f64>);

/// Errors of the tool point as a model of the arm predicts them from commanded angles, in a session's error reference frame.
#[derive(Debug, Clone, Copy)]
pub struct ToolErrors<'m> {
    model: &'m dyn PoseModel,
    /// The session's index in the model.
    session: usize,
    error_frame: &'m ErrorFrame<'m>,
}

impl<'m> ToolErrors<'m> {
    /// The errors by `model` in the `error_frame` of its session `session`.
    pub const fn new(
        model: &'m dyn PoseModel,
        session: usize,
        error_frame: &'m ErrorFrame<'m>,
    ) -> Self {
        Self { model, session, error_frame }
    }

    /// Attained minus commanded position of the tool point in the base frame, mm.
    pub fn error(&self, joints: &[f64]) -> Result<Vector3<f64>, Gap> {
        let tool = self.model.position(&self.at(&self.error_frame.arm.axes(joints)))?;
        Ok(self.in_error_frame(joints, &tool))
    }

    /// [`Self::error`] at many joint angles, on all cores.
    pub fn errors(&self, many: &[&[f64]]) -> Vec<Result<Vector3<f64>, Gap>> {
        let axes: Vec<Vec<f64>> = many.iter().map(|q| self.error_frame.arm.axes(q)).collect();
        let at: Vec<At<'_>> = axes.iter().map(|axes| self.at(axes)).collect();
        let tools = self.model.positions(&at);
        let in_error_frame =
            |(q, tool): (&&[f64], Result<Point3<f64>, Gap>)| Ok(self.in_error_frame(q, &tool?));
        many.par_iter().zip(tools).map(in_error_frame).collect()
    }

    /// [`Self::errors`] with the covariance of what one visit attains by a command used in another session, mm²: that of the error, and
    /// [`Self::visit`]. A model's covariance of some together costs far less.
    pub fn errors_with_covariance(&self, many: &[&[f64]]) -> Vec<Result<ErrorWithCovariance, Gap>> {
        let parts: Vec<Vec<_>> = many.par_chunks(TOGETHER).map(|some| self.some(some)).collect();
        parts.into_iter().flatten().collect()
    }

    fn some(&self, some: &[&[f64]]) -> Vec<Result<ErrorWithCovariance, Gap>> {
        let predict =
            |joints: &&[f64]| self.model.predict(&self.at(&self.error_frame.arm.axes(joints)));
        let predicted: Vec<Result<Prediction, Gap>> = some.iter().map(predict).collect();
        let sound: Vec<&Prediction> =
            predicted.iter().filter_map(|own| own.as_ref().ok()).collect();
        let frames = &self.error_frame.frames;
        let base_from_tracker = frames.tracker_from_base.isometry().rotation.inverse();
        let mut spreads = self.model.spreads(self.session, frames.source, &sound).into_iter();
        let each = some.iter().zip(&predicted).map(|(joints, own)| {
            let own = own.as_ref().map_err(Clone::clone)?;
            let spread = spreads.next().unwrap_or(Spread::Isotropic(f64::INFINITY));
            let covariance = spread.seen_from(&base_from_tracker) + self.visit(joints);
            Ok((self.in_error_frame(joints, &own.position), covariance))
        });
        each.collect()
    }

    /// Covariance of the arm's repeatability at one visit, base frame, mm².
    pub fn visit(&self, joints: &[f64]) -> Matrix3<f64> {
        let axes = self.error_frame.arm.axes(joints);
        let base = self.error_frame.frames.tracker_from_base.isometry();
        Spread::Of(self.model.visit(&self.query(&axes))).seen_from(&base.rotation.inverse())
    }

    /// [`Self::error`] with the rotation about the base's axes from the commanded orientation to the attained one, where the readings show
    /// orientations: `shown` is put behind the model's flange ([`super::flange::turn_behind`]).
    pub fn error_and_turn(
        &self,
        joints: &[f64],
        shown: &UnitQuaternion<f64>,
    ) -> Result<(Vector3<f64>, UnitQuaternion<f64>), Gap> {
        let attained = self.model.pose(&self.query(&self.error_frame.arm.axes(joints)))?;
        let base = self.error_frame.frames.tracker_from_base.isometry();
        let nominal = *self.error_frame.arm.flange(joints).isometry();
        let nominal_tool = nominal * self.error_frame.flange_from_tool;
        let point = base.inverse_transform_point(&attained.translation.vector.into());
        let turn =
            base.rotation.inverse() * (attained.rotation * shown) * nominal.rotation.inverse();
        Ok((point.coords - nominal_tool.translation.vector, turn))
    }

    fn at<'q>(&self, axes: &'q [f64]) -> At<'q> {
        At::Joints(self.query(axes))
    }

    fn query<'q>(&self, axes: &'q [f64]) -> Query<'q> {
        let FramePair { source, target, .. } = self.error_frame.frames;
        let lever = self.error_frame.lever();
        let at = Query::at(axes, self.session, Known::Commanded);
        Query { lever, source, target, ..at }
    }

    /// The error, in the error reference frame, of a point in the tracker frame, mm.
    fn in_error_frame(&self, joints: &[f64], tool: &Point3<f64>) -> Vector3<f64> {
        let base = self.error_frame.frames.tracker_from_base.isometry();
        base.inverse_transform_point(tool).coords
            - self.error_frame.nominal_tool(joints).translation.vector
    }
}
