//! `sampling_plan`: what to measure, in order, and what it promises.

use std::sync::Arc;

use nalgebra::Isometry3;

use super::words::{counted, joint_units, xyzw};
use crate::kinematics::{Arm, SingularityFactors};
use crate::manifest::RunKey;
use crate::plan::session::KIND;
use crate::plan::{Kind, PlanSettings, PlannedVisit, Purpose, SamplingPlan};
use crate::report::promise::{PlanPromise, Promise};
use crate::rows::{row, words};

row! {
    pub struct VisitRow of "sampling_plan" {
        pose: usize,
        target: String,
        purpose: VisitPurpose,
        repeats: Option<usize>,
        joint_names: Arc<[String]>,
        joint_units: Option<Arc<[String]>>,
        joints_rad: Vec<f64>,
        position as [x_mm, y_mm, z_mm]: [f64; 3],
        orientation as [qx, qy, qz, qw]: [f64; 4],
        configuration: Option<String>,
        design: Option<Kind>,
        chosen_as: Option<usize>,
        variance_left_mm2: Option<f64>,
        step_mm: Option<f64>,
        promised_mean_mm: Option<f64>,
        promised_bound_mm: Option<f64>,
        promised_share: f64,
        promised_confidence: f64,
        robots_simulated: usize,
        robots_meet: usize,
        tolerance_mm: f64,
        bound_share: f64,
        bound_confidence: f64,
    }
}

words! {
    /// Purposes of a visit; the visit that a drift check repeats is in a column of its own.
    pub enum VisitPurpose {
        /// The arm is identified on it.
        Identify: "identify",
        /// It takes no part in the fit and verifies the promise.
        Verify: "verify",
        /// The pose of an earlier visit again, for the drift of the base.
        DriftCheck: "drift_check",
    }
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
    let nominal = arm.no_offsets();
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
