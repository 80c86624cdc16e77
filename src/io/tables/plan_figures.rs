//! `plan_figures`: accuracy over simulated robots, from which a plan follows.

use crate::grid::{Interpolation, Source};
use crate::plan::compare::Expected;
use crate::plan::outcomes::RobotFigures;
use crate::plan::session::KIND;
use crate::plan::{Kind, Outcomes, PlanSettings, Purpose, SamplingPlan};
use crate::rows::{row, words};

row! {
    /// Accuracy after compensation over many simulated robots, for one setting of one study.
    pub struct FigureRow of "plan_figures" {
        study: FigureStudy,
        design: Kind,
        source: CorrectedBy,
        interpolation: Option<Interpolation>,
        step_mm: Option<f64>,
        poses: usize,
        not_reached: usize,
        robots: usize,
        no_fit: usize,
        judged: usize,
        refused: usize,
        outside: usize,
        mean_mm: Option<f64>,
        p95_mm: Option<f64>,
        p99_mm: Option<f64>,
        max_mm: Option<f64>,
        expected_mean_mm: Option<f64>,
        expected_share_mm: Option<f64>,
        mean_bound_mm: Option<f64>,
        bound_mm: Option<f64>,
        meet: usize,
        share_at_least: f64,
        share_asked: f64,
        confidence: f64,
        tolerance_mm: f64,
        chosen: bool,
    }
}

words! {
    pub enum FigureStudy {
        /// The step of a uniform grid.
        Step: "step",
        /// The design and its number of poses.
        Design: "design",
        /// The plan itself, on robots that took no part in choosing it.
        Promise: "promise",
    }

    /// The correction of commands in a study.
    pub enum CorrectedBy {
        Measured: "measured",
        Model: "model",
        /// Predictions of the identified arm, without a grid.
        IdentifiedArm: "identified_arm",
    }
}

impl From<Source> for CorrectedBy {
    fn from(source: Source) -> Self {
        match source {
            Source::Measured => Self::Measured,
            Source::Model => Self::Model,
        }
    }
}

impl FigureRow {
    /// Whether the asked share of robots is shown to meet the tolerance.
    pub fn holds(&self) -> bool {
        self.share_at_least >= self.share_asked
    }
}

/// The figures of every step and design, and of the plan itself.
pub fn rows(plan: &SamplingPlan, settings: &PlanSettings) -> Vec<FigureRow> {
    let steps = plan.steps.iter().enumerate().map(|(place, row)| FigureRow {
        source: row.source.into(),
        interpolation: Some(row.interpolation),
        step_mm: Some(row.step_mm),
        not_reached: row.refused_nodes.values().sum(),
        chosen: plan.step == Some(place),
        ..figures(FigureStudy::Step, Kind::UniformGrid, row.poses, &row.outcomes, settings)
    });
    let chosen = plan.session.count(|purpose| purpose == Purpose::Identify);
    let designs = plan.designs.iter().map(|row| FigureRow {
        expected_mean_mm: row.expected.map(|Expected { mean_mm, .. }| mean_mm),
        expected_share_mm: row.expected.map(|Expected { share_mm, .. }| share_mm),
        chosen: row.kind == KIND && row.poses == chosen,
        ..figures(FigureStudy::Design, row.kind, row.poses, &row.outcomes, settings)
    });
    let measured = plan.session.count(|purpose| purpose != Purpose::Verify);
    let promise = FigureRow {
        chosen: true,
        ..figures(FigureStudy::Promise, KIND, measured, &plan.promise, settings)
    };
    steps.chain(designs).chain([promise]).collect()
}

/// Figures over robots that were corrected by the identified arm, without a grid.
fn figures(
    study: FigureStudy,
    design: Kind,
    poses: usize,
    outcomes: &Outcomes,
    settings: &PlanSettings,
) -> FigureRow {
    let mean = |of: fn(&RobotFigures) -> f64| outcomes.mean.as_ref().map(of);
    FigureRow {
        study,
        design,
        source: CorrectedBy::IdentifiedArm,
        interpolation: None,
        step_mm: None,
        poses,
        not_reached: 0,
        robots: outcomes.robots,
        no_fit: outcomes.no_fit,
        judged: outcomes.judged,
        refused: outcomes.refused.values().sum(),
        outside: outcomes.outside,
        mean_mm: mean(|own| own.mean),
        p95_mm: mean(|own| own.p95),
        p99_mm: mean(|own| own.p99),
        max_mm: mean(|own| own.max),
        expected_mean_mm: None,
        expected_share_mm: None,
        mean_bound_mm: outcomes.mean_bound_mm,
        bound_mm: outcomes.bound_mm,
        meet: outcomes.meet,
        share_at_least: outcomes.share_at_least,
        share_asked: outcomes.share_asked,
        confidence: settings.robots_meet.confidence,
        tolerance_mm: settings.tolerance.mm,
        chosen: false,
    }
}
