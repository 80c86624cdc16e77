//! `sampling_plan`: what to measure, in order, and what it promises; and `plan_figures`: what the plan follows from.

use arrow::array::AsArray;
use arrow::datatypes::Float64Type;
use nalgebra::Isometry3;

use super::PublishError;
use crate::io::schema;
use crate::io::table::{Columns, Table};
use crate::kinematics::{Arm, SingularityFactors};
use crate::manifest::RunKey;
use crate::plan::outcomes::RobotFigures;
use crate::plan::session::KIND;
use crate::plan::{Kind, Outcomes, PlanSettings, PlannedVisit, Purpose, SamplingPlan};
use crate::report::promise::Promise;

/// The table of planned visits; positions are given in the frame of commands.
pub fn sampling_plan(
    plan: &SamplingPlan,
    settings: &PlanSettings,
    arm: &Arm,
    command_from_base: &Isometry3<f64>,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let visits = &plan.session.visits;
    let pose = |visit: &PlannedVisit| command_from_base * visit.command.base_from_target;
    let repeats = |visit: &PlannedVisit| match visit.purpose {
        Purpose::DriftCheck { of } => Some(of),
        Purpose::Identify | Purpose::Verify => None,
    };
    let design = |visit: &PlannedVisit| match visit.purpose {
        Purpose::Verify => Kind::Random.name(),
        Purpose::Identify | Purpose::DriftCheck { .. } => KIND.name(),
    };
    let names: Vec<&str> = arm
        .joints()
        .iter()
        .map(|joint| joint.name.as_str())
        .collect();
    let all = || visits.iter();
    let table = Columns::new(schema::find("sampling_plan")?, visits.len())
        .key(key)
        .column("pose", 0..visits.len())
        .column("target", (0..visits.len()).map(|place| format!("p{place}")))
        .column("purpose", all().map(|visit| visit.purpose.name()))
        .column("repeats", all().map(repeats))
        .same("joint_names", names)
        .column(
            "joints_rad",
            all().map(|visit| visit.command.joints.clone()),
        )
        .group(
            ["x_mm", "y_mm", "z_mm"],
            all().map(|visit| <[f64; 3]>::from(pose(visit).translation.vector)),
        )
        .group(
            ["qx", "qy", "qz", "qw"],
            all().map(|visit| {
                let rotation = pose(visit).rotation;
                [rotation.i, rotation.j, rotation.k, rotation.w]
            }),
        )
        .column(
            "configuration",
            all().map(|visit| configuration(arm, &visit.command.joints)),
        )
        .column("design", all().map(design))
        .column("chosen_as", all().map(|visit| Some(visit.choice?.0)))
        .column(
            "variance_left_mm2",
            all().map(|visit| Some(visit.choice?.1)),
        );
    Ok(promised(table, plan, settings).finish()?)
}

fn promised(table: Columns, plan: &SamplingPlan, settings: &PlanSettings) -> Columns {
    let promise = &plan.promise;
    table
        .same("step_mm", plan.step.map(|row| plan.steps[row].step_mm))
        .same("promised_mean_mm", promise.mean_bound_mm)
        .same("promised_bound_mm", promise.bound_mm)
        .same("promised_share", settings.robots_meet.share)
        .same("promised_confidence", settings.robots_meet.confidence)
        .same("robots_simulated", promise.robots)
        .same("robots_meet", promise.meet)
        .same("tolerance_mm", settings.tolerance.mm)
        .same("bound_share", settings.tolerance.share)
        .same("bound_confidence", settings.tolerance.confidence)
}

/// One planned pose of a published plan.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedPose {
    /// Its name.
    pub target: String,
    /// What it is for.
    pub purpose: String,
    /// Joint angles, rad.
    pub joints: Vec<f64>,
}

/// The poses of a published plan, in order.
pub fn planned(table: &Table) -> Vec<PlannedPose> {
    let names = table.text("target").iter().zip(table.text("purpose"));
    let joints = table.list("joints_rad").iter();
    let pose = |((target, purpose), joints): ((Option<&str>, Option<&str>), Option<_>)| {
        let joints: arrow::array::ArrayRef = joints?;
        Some(PlannedPose {
            target: target?.to_owned(),
            purpose: purpose?.to_owned(),
            joints: joints.as_primitive::<Float64Type>().values().to_vec(),
        })
    };
    names.zip(joints).filter_map(pose).collect()
}

/// What a published plan promised.
pub fn promise(table: &Table) -> Promise {
    let number = |column: &str| table.f64(column).iter().next().flatten();
    let purposes = table.text("purpose").iter();
    let joints = table.list("joints_rad").iter();
    let verify = purposes.zip(joints).filter_map(|(purpose, joints)| {
        let is_verify = purpose == Some(Purpose::Verify.name());
        let joints = joints.filter(|_| is_verify)?;
        Some(joints.as_primitive::<Float64Type>().values().to_vec())
    });
    let plan = table.key().map_or_else(String::new, |key| key.run.clone());
    Promise {
        plan,
        verify: verify.collect(),
        mean_mm: number("promised_mean_mm"),
        bound_mm: number("promised_bound_mm"),
        share: number("bound_share").unwrap_or(0.0),
        confidence: number("bound_confidence").unwrap_or(0.0),
    }
}

fn configuration(arm: &Arm, joints: &[f64]) -> Option<String> {
    let nominal = vec![0.0; arm.chain().parameters().len()];
    let factors = SingularityFactors::of(arm, &nominal, joints)?;
    Some(factors.configuration().to_string())
}

/// One row of `plan_figures`.
struct Row<'p> {
    study: &'static str,
    value: Option<f64>,
    design: Kind,
    source: &'static str,
    interpolation: Option<&'static str>,
    step_mm: Option<f64>,
    poses: usize,
    not_reached: usize,
    expected: Option<crate::plan::compare::Expected>,
    outcomes: &'p Outcomes,
    chosen: bool,
}

/// The table of everything that a plan found.
pub fn plan_figures(
    plan: &SamplingPlan,
    settings: &PlanSettings,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let rows = rows(plan);
    let all = || rows.iter();
    let figure =
        |of: fn(&RobotFigures) -> f64| all().map(move |row| row.outcomes.mean.as_ref().map(of));
    let table = Columns::new(schema::find("plan_figures")?, rows.len())
        .key(key)
        .column("study", all().map(|row| row.study))
        .column("value", all().map(|row| row.value))
        .column("design", all().map(|row| row.design.name()))
        .column("source", all().map(|row| row.source))
        .column("interpolation", all().map(|row| row.interpolation))
        .column("step_mm", all().map(|row| row.step_mm))
        .column("poses", all().map(|row| row.poses))
        .column("not_reached", all().map(|row| row.not_reached))
        .column("mean_mm", figure(|f| f.mean))
        .column("p95_mm", figure(|f| f.p95))
        .column("p99_mm", figure(|f| f.p99))
        .column("max_mm", figure(|f| f.max))
        .column(
            "expected_mean_mm",
            all().map(|row| Some(row.expected?.mean_mm)),
        )
        .column(
            "expected_share_mm",
            all().map(|row| Some(row.expected?.share_mm)),
        )
        .same("confidence", settings.robots_meet.confidence)
        .same("tolerance_mm", settings.tolerance.mm)
        .column("chosen", all().map(|row| row.chosen));
    Ok(over_robots(table, &rows).finish()?)
}

fn over_robots(table: Columns, rows: &[Row<'_>]) -> Columns {
    let all = || rows.iter().map(|row| row.outcomes);
    table
        .column("robots", all().map(|o| o.robots))
        .column("no_fit", all().map(|o| o.no_fit))
        .column("judged", all().map(|o| o.judged))
        .column("refused", all().map(|o| o.refused.values().sum::<usize>()))
        .column("outside", all().map(|o| o.outside))
        .column("mean_bound_mm", all().map(|o| o.mean_bound_mm))
        .column("bound_mm", all().map(|o| o.bound_mm))
        .column("meet", all().map(|o| o.meet))
        .column("share_at_least", all().map(|o| o.share_at_least))
        .column("share_asked", all().map(|o| o.share_asked))
}

fn rows(plan: &SamplingPlan) -> Vec<Row<'_>> {
    let steps = plan.steps.iter().enumerate().map(|(place, row)| Row {
        study: "step",
        value: None,
        design: Kind::UniformGrid,
        source: row.source.name(),
        interpolation: Some(row.interpolation.name()),
        step_mm: Some(row.step_mm),
        poses: row.poses,
        not_reached: row.refused_nodes.values().sum(),
        expected: None,
        outcomes: &row.outcomes,
        chosen: plan.step == Some(place),
    });
    let influences = plan.influences.iter().map(|row| Row {
        study: row.study.name(),
        value: Some(row.study.value()),
        design: Kind::UniformGrid,
        source: row.source.name(),
        interpolation: Some(row.interpolation.name()),
        step_mm: Some(row.step_mm),
        poses: row.poses,
        not_reached: row.not_reached,
        expected: None,
        outcomes: &row.outcomes,
        chosen: false,
    });
    let identified = |study, poses, design, expected, outcomes, chosen| Row {
        study,
        value: None,
        design,
        source: "identified_arm",
        interpolation: None,
        step_mm: None,
        poses,
        not_reached: 0,
        expected,
        outcomes,
        chosen,
    };
    let chosen = plan.session.count(|purpose| purpose == Purpose::Identify);
    let designs = plan.designs.iter().map(|row| {
        let is_plan = row.kind == KIND && row.poses == chosen;
        identified(
            "design",
            row.poses,
            row.kind,
            row.expected,
            &row.outcomes,
            is_plan,
        )
    });
    let measured = plan.session.count(|purpose| purpose != Purpose::Verify);
    let promise = identified("promise", measured, KIND, None, &plan.promise, true);
    steps
        .chain(influences)
        .chain(designs)
        .chain([promise])
        .collect()
}
