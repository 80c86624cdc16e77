//! `posegrid plan`: before measuring, which step, which poses, and what accuracy to expect. Exit codes: 0 the plan is
//! shown to meet the tolerance; 3 it is not, and the best one is there; 1 there is no plan, or it cannot be written; 2
//! the pipeline file is bad. Of the plans of several robots (`fleet`) 1 outranks 3.

mod fleet;
mod locate;

use std::io;
use std::path::PathBuf;

use clap::{Args, value_parser};
use thiserror::Error;

use super::compensate::WriteCause;
use super::messages::{self, Printable};
use super::progress::Bars;
use super::run::near;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET};
use crate::files::whole_file::write_whole;
use crate::ingest::AngleUnit;
use crate::io::lake::{Lake, LakeError};
use crate::io::rows::Word as _;
use crate::io::targets::{JointUnits, write_csv};
use crate::pipeline::planning::{Planned, Planning, PlanningError, SoFar};
use crate::plan::{Outcomes, PlanSettings, Purpose, SamplingPlan, StepRow};

/// Plan a session before measuring: which step, which poses, in which order, and what accuracy to expect.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
The section [plan] of the pipeline file states what robot to expect and where the tracker will stand. Robots are drawn from
that, measured, fitted and compensated by the code that runs at night, on every step of [grid] and on poses chosen by the
error model. The plan goes into the lake as the tables sampling_plan and plan_figures, and a page.

Example: a KR 210 in a cube of one metre, and its poses for the robot programmer
  posegrid plan pipelines/plan-kr210.toml --out poses.csv

Every robot of a pipeline file with several, each with its own [plan]; what is wrong with one stays with it
  posegrid plan fleet.toml --out 'poses-{robot}.csv'

While the session is measured, with its logs so far in [input]: is that enough?
  posegrid plan pipelines/plan-kr210.toml --measured monday

After a remount, when only base and reflector are new: twelve poses that find them for the arm of the robot's current run
  posegrid plan pipelines/plan-kr210.toml --locate 12 --out poses.csv

Exit codes: 0 the plan is shown to meet the tolerance, what is measured is enough, or errors after --locate are expected within
the tolerance; 3 it is not, and the best one is there; 1 no plan, or it cannot be written; 2 bad usage or bad pipeline file.
Of several robots 1 outranks 3.")]
pub struct PlanArgs {
    /// The pipeline file
    pub pipeline: PathBuf,
    /// The robot, where the pipeline file has several and not all of them are meant
    #[arg(long, value_name = "NAME")]
    pub robot: Option<String>,
    /// The folder of the published tables, instead of the pipeline file's
    #[arg(long, value_name = "DIR")]
    pub lake: Option<PathBuf>,
    /// Write the poses as CSV too, joint angles in degrees: a new file; {robot} in its name stands for the robot
    #[arg(long, alias = "csv", value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// A session, by its folder's name, while it is being measured: whether its stations so far are enough, or
    /// which planned poses to measure next
    #[arg(long, value_name = "SESSION", conflicts_with = "out")]
    pub measured: Option<String>,
    /// After a remount: this many poses that find base and reflector best, for the arm of [plan.known] or of the
    /// robot's current run in the lake, and the accuracy that follows; nothing is published
    #[arg(long, value_name = "POSES", conflicts_with = "measured", value_parser = value_parser!(u16).range(4..=500))]
    pub locate: Option<u16>,
}

#[derive(Debug, Error)]
enum PlanCommandError {
    #[error(transparent)]
    Planning(#[from] Box<PlanningError>),
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
    #[error("--out {} is one file for several robots: put {{robot}} into its name, or name one robot with --robot", .0.display())]
    OneFile(PathBuf),
    #[error(transparent)]
    Lake(#[from] LakeError),
    #[error("{}: {}", path.display(), source.told())]
    Write { path: PathBuf, source: WriteCause },
}

impl PlanCommandError {
    fn exit_code(&self) -> u8 {
        match self {
            Self::Exists(_) | Self::OneFile(_) => BAD_USAGE,
            Self::Planning(error) => match **error {
                PlanningError::File(_) | PlanningError::Known(_) => BAD_USAGE,
                _ => NO_RESULT,
            },
            Self::Lake(_) | Self::Write { .. } => NO_RESULT,
        }
    }
}

fn load(args: &PlanArgs) -> Result<Planning, PlanCommandError> {
    let (robot, lake) = (args.robot.as_deref(), args.lake.as_deref());
    Ok(Planning::load(&args.pipeline, robot, lake).map_err(Box::new)?)
}

pub fn run(args: &PlanArgs, bars: &Bars) -> u8 {
    let ended = match (&args.measured, args.locate) {
        (Some(session), _) => so_far(args, session, bars),
        (None, Some(count)) => locate::located(args, usize::from(count)),
        (None, None) => match fleet::robots(args) {
            Ok(robots) if robots.is_empty() => made(args, bars),
            Ok(robots) => return fleet::all(args, &robots, bars),
            Err(error) => Err(error),
        },
    };
    match ended {
        Ok((is_met, words)) => {
            messages::last_result(words, if is_met { DONE } else { NOT_MET }, bars)
        }
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            error.exit_code()
        }
    }
}

/// Makes the plan of one robot; whether it meets the tolerance, and a text that says so.
fn made(args: &PlanArgs, bars: &Bars) -> Result<(bool, String), PlanCommandError> {
    new_csv(args)?;
    let planning = load(args)?;
    let planned = planning.make(&bars.of("plan")).map_err(Box::new)?;
    if let Some(path) = &args.out {
        let table = Lake::at(&planning.lake)?.read("sampling_plan", &planned.key)?;
        let write = |sink: &mut io::BufWriter<&std::fs::File>| -> Result<(), WriteCause> {
            let units = JointUnits::of(&planning.arm, AngleUnit::Deg);
            Ok(write_csv(&table, units, sink)?)
        };
        write_whole(path, write)
            .map_err(|source| PlanCommandError::Write { path: path.clone(), source })?;
    }
    let words = words(&planned, &planning, args);
    Ok((planned.is_met, words))
}

fn new_csv(args: &PlanArgs) -> Result<(), PlanCommandError> {
    match args.out.as_ref().filter(|csv| csv.exists()) {
        Some(csv) => Err(PlanCommandError::Exists(csv.clone())),
        None => Ok(()),
    }
}

/// Whether the session so far is enough, and a text that says so.
fn so_far(args: &PlanArgs, session: &str, bars: &Bars) -> Result<(bool, String), PlanCommandError> {
    let planning = load(args)?;
    let progress = bars.of("plan");
    let found = planning.so_far(&args.pipeline, session, &progress).map_err(Box::new)?;
    let SoFar { identify, verify, unmeasured, planned, .. } = found;
    let mut lines = vec![format!(
        "plan {}, session {session} so far: {identify} stations to identify ({planned} poses are planned), {verify} to \
         verify, {unmeasured} without a measurement",
        found.plan.run
    )];
    let (promise, settings) = (&found.promise, &planning.settings);
    if let (Some(mean), Some(bound)) = (promise.mean_bound_mm, promise.bound_mm) {
        lines.push(format!(
            "promised with these: mean error below {mean:.3} mm and bound below {bound:.3} mm for {} % of the arms \
             that agree with them, with {} % confidence",
            100.0 * settings.robots_meet.share,
            100.0 * settings.robots_meet.confidence
        ));
    }
    lines.push(next(&found, settings.tolerance.mm));
    Ok((promise.holds(), lines.join("\n") + "\n"))
}

fn next(found: &SoFar, tolerance_mm: f64) -> String {
    let names = found.next.join(" ");
    let count = found.next.len();
    if found.promise.holds() {
        format!("enough: {tolerance_mm} mm will be met; measure the verification poses, then stop")
    } else if found.next.is_empty() {
        format!(
            "not enough for {tolerance_mm} mm, and no planned pose is left: plan with more poses"
        )
    } else if found.next_are_enough {
        format!(
            "not enough for {tolerance_mm} mm yet: about {count} more, most informative first: {names}"
        )
    } else {
        format!(
            "not enough for {tolerance_mm} mm, and the {count} planned poses that are left are not expected to be enough: \
             {names}"
        )
    }
}

fn words(planned: &Planned, planning: &Planning, args: &PlanArgs) -> String {
    let settings = &planning.settings;
    let there =
        "the lake has this plan already: same file, same robot, same version; nothing was done";
    let mut lines = match &planned.plan {
        Some(plan) => [steps(plan, settings), designs(plan), session(plan, settings)].concat(),
        None => vec![there.to_owned()],
    };
    let verdict = if planned.is_met { "shown to be met" } else { "not shown to be met" };
    lines.push(format!("tolerance {} mm: {verdict}", settings.tolerance.mm));
    lines.push(format!("plan {}", planned.key.run));
    lines.extend(planned.page.as_ref().map(|page| format!("page: {}", near(page).display())));
    lines.push(format!("tables: {}", near(&planning.lake).display()));
    lines.extend(args.out.as_ref().map(|csv| format!("poses: {}", csv.display())));
    lines.join("\n") + "\n"
}

const HEADER: &str = "mean mm   p95 mm   bound mm   robots that meet it";

/// One line under [`HEADER`].
fn line(name: &str, poses: usize, outcomes: &Outcomes) -> String {
    let mm = |value: Option<f64>| value.map_or("–".to_owned(), |mm| format!("{mm:.3}"));
    format!(
        "  {name:<17} {poses:>5}  {:>7}  {:>7}  {:>9}   {} of {}, at least {:.1} %",
        mm(outcomes.mean.map(|figures| figures.mean)),
        mm(outcomes.mean.map(|figures| figures.p95)),
        mm(outcomes.bound_mm),
        outcomes.meet,
        outcomes.robots,
        100.0 * outcomes.share_at_least
    )
}

fn steps(plan: &SamplingPlan, settings: &PlanSettings) -> Vec<String> {
    let mut lines = vec![format!("uniform grid        poses  {HEADER}")];
    for &step_mm in &settings.grid.steps_mm {
        let own = |row: &&StepRow| row.step_mm.total_cmp(&step_mm).is_eq();
        // The best way to use the nodes; plan_figures has all of them.
        let best = plan.steps.iter().filter(own).min_by(|a, b| {
            let p95 = |row: &StepRow| row.outcomes.mean.map_or(f64::INFINITY, |f| f.p95);
            p95(a).total_cmp(&p95(b))
        });
        if let Some(row) = best {
            let name = format!("{} mm, {}", row.step_mm, row.source.name());
            lines.push(line(&name, row.poses, &row.outcomes));
        } else {
            let same = "comes to the same pitches as a smaller one, which is judged";
            lines.push(format!("  {:<17} {same}", format!("{step_mm} mm")));
        }
    }
    lines.push(match plan.step.map(|row| &plan.steps[row]) {
        Some(row) => format!(
            "largest step that holds: {} mm, nodes {}, {}: {} poses",
            row.step_mm,
            row.source.name(),
            row.interpolation.name(),
            row.poses
        ),
        None => "no step holds for the asked share of robots".to_owned(),
    });
    lines.push(String::new());
    lines
}

fn designs(plan: &SamplingPlan) -> Vec<String> {
    let mut rows: Vec<_> = plan.designs.iter().collect();
    rows.sort_by_key(|row| (row.kind, row.poses));
    let mut lines = vec![format!("identified arm      poses  {HEADER}")];
    lines.extend(rows.iter().map(|row| {
        let name = row.kind.word().replace('_', " ");
        line(&name, row.poses, &row.outcomes)
    }));
    lines.push(String::new());
    lines
}

fn session(plan: &SamplingPlan, settings: &PlanSettings) -> Vec<String> {
    let count = |purpose| plan.session.count(|own| own == purpose);
    let (identify, verify) = (count(Purpose::Identify), count(Purpose::Verify));
    let checks = plan.session.visits.len() - identify - verify;
    let (promise, robots) = (&plan.promise, plan.promise.robots);
    let asked = 100.0 * settings.robots_meet.share;
    let confidence = 100.0 * settings.robots_meet.confidence;
    let words = match (promise.mean_bound_mm, promise.bound_mm) {
        (Some(mean), Some(bound)) => format!(
            "promise: mean error below {mean:.3} mm and bound below {bound:.3} mm for {asked} % of robots, with {confidence} % \
             confidence ({robots} robots that took no part in choosing poses)"
        ),
        _ => format!(
            "promise: none: {robots} robots are too few for {asked} % with {confidence} % confidence; raise whole_model_robots"
        ),
    };
    let visits = format!(
        "session: {identify} poses to identify, {verify} to verify, {checks} visits again for drift"
    );
    vec![visits, words]
}
