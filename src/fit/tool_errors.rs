//! Errors of the tool point at commands, as a model predicts them.

use nalgebra::{Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::gap::Gap;
use super::gauge::Gauge;
use super::model::{At, Known, PoseModel, Query};

/// Errors of the tool point as a model of the arm predicts them from commanded angles, in a session's gauge.
#[derive(Debug, Clone, Copy)]
pub struct ToolErrors<'m> {
    model: &'m dyn PoseModel,
    /// The session's place in the model.
    session: usize,
    gauge: &'m Gauge<'m>,
}

impl<'m> ToolErrors<'m> {
    /// The errors that `model` sees in the `gauge` of its session `session`.
    pub const fn new(model: &'m dyn PoseModel, session: usize, gauge: &'m Gauge<'m>) -> Self {
        Self {
            model,
            session,
            gauge,
        }
    }

    /// Attained minus commanded position of the tool point in the base frame, mm.
    pub fn error(&self, joints: &[f64]) -> Result<Vector3<f64>, Gap> {
        let axes = self.gauge.arm().axes(joints);
        let tool = self.model.position(&self.at(&axes))?;
        Ok(self.in_gauge(joints, &tool))
    }

    /// [`Self::error`] at many joint angles, on all cores.
    pub fn errors(&self, many: &[&[f64]]) -> Vec<Result<Vector3<f64>, Gap>> {
        let axes: Vec<Vec<f64>> = many.iter().map(|q| self.gauge.arm().axes(q)).collect();
        let at: Vec<At<'_>> = axes.iter().map(|axes| self.at(axes)).collect();
        let tools = self.model.positions(&at);
        let in_gauge =
            |(q, tool): (&&[f64], Result<Point3<f64>, Gap>)| Ok(self.in_gauge(q, &tool?));
        many.par_iter().zip(tools).map(in_gauge).collect()
    }

    /// [`Self::error`] with its covariance for a command of some day, mm².
    pub fn error_with_covariance(
        &self,
        joints: &[f64],
    ) -> Result<(Vector3<f64>, Matrix3<f64>), Gap> {
        let axes = self.gauge.arm().axes(joints);
        let predicted = self.model.predict(&self.at(&axes))?;
        let spread = self
            .model
            .spread(self.session, self.gauge.frames().source, &predicted);
        let base = self.gauge.frames().tracker_from_base.isometry().rotation;
        Ok((
            self.in_gauge(joints, &predicted.position),
            spread.seen_from(&base.inverse()),
        ))
    }

    fn at<'q>(&self, axes: &'q [f64]) -> At<'q> {
        At::Joints(Query {
            axes,
            known: Known::Commanded,
            lever: self.gauge.lever(),
            session: self.session,
            source: self.gauge.frames().source,
            target: self.gauge.frames().target,
            own: true,
            station: None,
        })
    }

    /// A point in the tracker's frame as an error in the gauge.
    fn in_gauge(&self, joints: &[f64], tool: &Point3<f64>) -> Vector3<f64> {
        let base = self.gauge.frames().tracker_from_base.isometry();
        base.inverse_transform_point(tool).coords
            - self.gauge.nominal_tool(joints).translation.vector
    }
}
