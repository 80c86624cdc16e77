//! `sampling_plan`: what to measure, in order, and what it promises.

use std::sync::Arc;

use nalgebra::Isometry3;

use super::words::{counted, joint_units, xyzw};
use crate::kinematics::{Arm, SingularityFactors};
use crate::manifest::RunKey;
use crate::plan::session::KIND;
use crate::plan::{Kind, PlanSettings, PlannedVisit, Purpose, SamplingPlan};
use crate::report::promise::{PlanPromise, Promise};
use crate::table::{row, words};

row! {
    /// A planned visit, with the promise of the whole plan.
    pub struct VisitRow of "sampling_plan" {
        /// Place in the order of visits, from 0.
        pose: usize,
        /// Name of the visit's target when the plan is used as a file of targets.
        target: String,
        /// Purpose of the visit.
        purpose: VisitPurpose,
        /// The visit whose pose a drift check repeats; `None` for all others.
        repeats: Option<usize>,
        /// The joints in the order of `joints_rad`.
        joint_names: Arc<[String]>,
        /// Unit of each joint, "rad" or "mm"; `None` where all turn.
        joint_units: Option<Arc<[String]>>,
        /// Joint angles of the nominal arm, rad.
        joints_rad: Vec<f64>,
        /// Position of the target in the frame of commands, mm.
        position as [x_mm, y_mm, z_mm]: [f64; 3],
        /// Orientation of the target in the frame of commands, x y z w.
        orientation as [qx, qy, qz, qw]: [f64; 4],
        /// Arm configuration; `None` for arms that are not six-axis ones.
        configuration: Option<String>,
        /// Choice of the pose; never absent, though the table's contract allows it.
        design: Option<Kind>,
        /// Place in the order in which the design chose it, from 0; `None` for poses it did not choose.
        chosen_as: Option<usize>,
        /// Predicted variance that is left over the region once this pose and those before it are measured, mm²; `None` for
        /// poses the design did not choose.
        variance_left_mm2: Option<f64>,
        /// Largest step of a uniform grid that holds, mm; `None` where none does.
        step_mm: Option<f64>,
        /// Bound of the mean error over robots, mm; `None` with too few robots.
        promised_mean_mm: Option<f64>,
        /// Bound of the robots' own bounds, mm; `None` with too few robots.
        promised_bound_mm: Option<f64>,
        /// Share of robots that both promises are of.
        promised_share: f64,
        /// Confidence of both promises.
        promised_confidence: f64,
        /// Robots that the promise was found on.
        robots_simulated: usize,
        /// Robots of these whose bound is within the tolerance.
        robots_meet: usize,
        /// The tolerance, mm.
        tolerance_mm: f64,
        /// Share of errors that each robot's bound covers.
        bound_share: f64,
        /// Confidence of each robot's bound.
        bound_confidence: f64,
    }
}

/// Purposes of a visit; the visit that a drift check repeats is in a column of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VisitPurpose {
    /// The arm is identified on it.
    Identify,
    /// It takes no part in the fit and verifies the promise.
    Verify,
    /// The pose of an earlier visit again, for the drift of the base.
    DriftCheck,
}

words! {
    VisitPurpose { Identify: "identify", Verify: "verify", DriftCheck: "drift_check" }
    Kind {
        UniformGrid: "uniform_grid",
        Random: "random",
        GreedyVariance: "greedy_variance",
        DOptimal: "d_optimal",
    }
}

impl From<Purpose> for VisitPurpose {
    fn from(purpose: Purpose) -> Self {
        match purpose {
            Purpose::Identify => Self::Identify,
            Purpose::Verify => Self::Verify,
            Purpose::DriftCheck { .. } => Self::DriftCheck,
        }
    }
}

/// The planned visits; positions are given in the frame of commands.
pub fn rows(
    plan: &SamplingPlan,
    settings: &PlanSettings,
    arm: &Arm,
    command_from_base: &Isometry3<f64>,
) -> Vec<VisitRow> {
    let names = arm.joints().iter().map(|joint| joint.name.clone());
    let joint_names: Arc<[String]> = names.collect();
    let joint_units = joint_units(arm.joints());
    let visits = plan.session.visits.iter().enumerate();
    let row = |(place, visit): (usize, &PlannedVisit)| {
        let pose = command_from_base * visit.command.base_from_target;
        let joints = &visit.command.joints;
        VisitRow {
            pose: place,
            target: format!("p{place}"),
            purpose: visit.purpose.into(),
            repeats: repeats(visit.purpose),
            joint_names: Arc::clone(&joint_names),
            joint_units: joint_units.clone(),
            joints_rad: joints.clone(),
            position: pose.translation.vector.into(),
            orientation: xyzw(&pose.rotation),
            configuration: configuration(arm, joints),
            design: Some(design(visit.purpose)),
            chosen_as: visit.choice.map(|(place, _)| place),
            variance_left_mm2: visit.choice.map(|(_, left_mm2)| left_mm2),
            step_mm: plan.step.map(|row| plan.steps[row].step_mm),
            promised_mean_mm: plan.promise.mean_bound_mm,
            promised_bound_mm: plan.promise.bound_mm,
            promised_share: settings.robots_meet.share,
            promised_confidence: settings.robots_meet.confidence,
            robots_simulated: plan.promise.robots,
            robots_meet: plan.promise.meet,
            tolerance_mm: settings.tolerance.mm,
            bound_share: settings.tolerance.share,
            bound_confidence: settings.tolerance.confidence,
        }
    };
    visits.map(row).collect()
}

const fn repeats(purpose: Purpose) -> Option<usize> {
    match purpose {
        Purpose::DriftCheck { of } => Some(of),
        Purpose::Identify | Purpose::Verify => None,
    }
}

const fn design(purpose: Purpose) -> Kind {
    match purpose {
        Purpose::Verify => Kind::Random,
        Purpose::Identify | Purpose::DriftCheck { .. } => KIND,
    }
}

fn configuration(arm: &Arm, joints: &[f64]) -> Option<String> {
    let nominal = vec![0.0; arm.chain().parameters().len()];
    let factors = SingularityFactors::of(arm, &nominal, joints)?;
    Some(factors.configuration().to_string())
}

/// The promise of a published plan, which every row states; the first is asked.
pub fn promise(key: &RunKey, visits: Vec<VisitRow>) -> PlanPromise {
    let first = visits.first();
    let units = first.and_then(|row| row.joint_units.as_deref());
    PlanPromise {
        counted: counted(units),
        plan: key.run.clone(),
        promise: Promise {
            mean_mm: first.and_then(|row| row.promised_mean_mm),
            bound_mm: first.and_then(|row| row.promised_bound_mm),
            share: first.map_or(0.0, |row| row.bound_share),
            confidence: first.map_or(0.0, |row| row.bound_confidence),
        },
        verify: visits
            .into_iter()
            .filter(|row| row.purpose == VisitPurpose::Verify)
            .map(|row| row.joints_rad)
            .collect(),
    }
}
