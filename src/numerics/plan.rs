//! Plan: before the tracker is set up, the step, the poses, and the accuracy to expect ([`crate::method::planning`]).
//!
//! Inputs: the nominal arm and [`PlanSettings`]: the expected robots, the cell, the region, the tolerance. Output: a
//! [`SamplingPlan`]. Nothing here fits, grids or judges by itself: robots are drawn by [`crate::simulate`] and go through
//! the code of a real run.
//!
//! 1. Poses of the region are placed ([`place`]) and checked against the limits of the cell ([`line_of_sight`]).
//! 2. The uniform grid: accuracy over robots for each step ([`steps`]).
//! 3. Designs by number of poses, with the full error model ([`design`], [`compare`]).
//! 4. The smallest design that meets the tolerance becomes a session: identify, verify, visit again for drift, in an order
//!    of short travel ([`order`], [`session`]).
//! 5. The whole session is tried on robots that took no part in choosing it: their errors give the promise.

pub mod compare;
pub mod design;
pub mod enough;
mod error;
pub mod known;
pub mod line_of_sight;
pub mod locate;
pub mod order;
pub mod outcomes;
pub mod place;
pub mod robots;
pub mod section;
pub mod session;
pub mod settings;
pub mod steps;

use std::ops::Range;

use rayon::prelude::*;

use crate::kinematics::Arm;
use crate::progress::Progress;
use crate::simulate::{Commanded, Ingredient, Stream};

use robots::Robot;

pub use compare::{DesignRow, Designs, Kind};
pub use error::PlanError;
pub use known::KnownArm;
pub use outcomes::Outcomes;
pub use place::{Drawn, Placer};
pub use session::{PlannedVisit, Purpose, Session};
pub use settings::{PlanSettings, Region};
pub use steps::StepRow;

/// Number of fresh poses from which each robot takes its own.
const POOL: usize = 2000;
/// Number of sizes tried between the largest design that does not hold and the smallest that does.
const BISECTIONS: usize = 3;

#[derive(Debug, Clone)]
pub struct SamplingPlan {
    pub steps: Vec<StepRow>,
    /// Index in `steps` of the largest step that holds; `None` where none does.
    pub step: Option<usize>,
    pub designs: Vec<DesignRow>,
    /// Number of random poses that were drawn, and the reasons why some were not taken.
    pub candidates: Drawn,
    pub session: Session,
    pub promise: Outcomes,
}

impl SamplingPlan {
    pub fn is_met(&self) -> bool {
        self.promise.holds()
    }
}

/// The inputs that all robots of a plan share.
#[derive(Clone, Copy)]
pub struct Trial<'t> {
    pub arm: &'t Arm,
    pub placer: &'t Placer<'t>,
    pub settings: &'t PlanSettings,
    pub progress: &'t dyn Progress,
}

impl<'t> Trial<'t> {
    /// The result of `work` for each of the numbered robots, in their order, on all cores.
    fn each_robot<T: Send>(
        &self,
        task: &str,
        robots: Range<usize>,
        work: impl Fn(&mut Robot<'t>, usize) -> T + Sync,
    ) -> Vec<T> {
        self.progress.begin(task, robots.len() as u64);
        let of_robot = |number: usize| {
            let found = work(&mut Robot::draw(self.arm, self.settings, number), number);
            self.progress.advance(1);
            found
        };
        let found = robots.into_par_iter().map(of_robot).collect();
        self.progress.end();
        found
    }
}

pub fn plan(
    arm: &Arm,
    settings: &PlanSettings,
    progress: &dyn Progress,
) -> Result<SamplingPlan, PlanError> {
    let placer = Placer::new(arm, settings)?;
    let trial = Trial { arm, placer: &placer, settings, progress };
    let at_table = Region { cone_rad: 0.0, ..settings.region };
    let pool = fresh_poses(&placer, &at_table, settings)?;
    let steps = steps::judge(&trial, &pool)?;
    let step = steps::largest_that_holds(&steps);
    let pool = fresh_poses(&placer, &settings.region, settings)?;
    let designs = Designs::new(&trial)?;
    let mut rows = compare::judge(&trial, &designs, &pool);
    let poses = sized(&trial, &designs, &pool, &mut rows);
    let session = Session::new(&trial, &designs, poses)?;
    let promise = session::promise(&trial, &session, &pool);
    let candidates = designs.candidates.1;
    Ok(SamplingPlan { steps, step, designs: rows, candidates, session, promise })
}

/// Poses of a region to judge robots by, in random order.
pub fn fresh_poses(
    placer: &Placer<'_>,
    region: &Region,
    settings: &PlanSettings,
) -> Result<Vec<Commanded>, PlanError> {
    let mut stream = Stream::new(settings.seed, Ingredient::TestPoses);
    Ok(placer.random(region, POOL.max(settings.test_poses), &mut stream, &|_| Ok(()))?.0)
}

/// The number of poses of the smallest chosen design that holds: those of the table, then sizes halved between the largest
/// that does not and the smallest that does. The largest of the table where none holds.
fn sized(
    trial: &Trial<'_>,
    designs: &Designs,
    pool: &[Commanded],
    rows: &mut Vec<DesignRow>,
) -> usize {
    let is_known = trial.settings.known.is_some();
    let least = if is_known { session::LEAST_KNOWN_POSES } else { session::LEAST_POSES };
    for _ in 0..BISECTIONS {
        let Some(middle) = between(rows, least) else { break };
        let size = [(session::KIND, middle)];
        rows.extend(compare::judge_sizes(trial, designs, pool, &size));
    }
    let most = trial.settings.poses.iter().copied().max();
    least_that_holds(rows).or(most).unwrap_or(0)
}

fn least_that_holds(rows: &[DesignRow]) -> Option<usize> {
    let holding = rows.iter().filter(|row| row.kind == session::KIND && row.outcomes.holds());
    holding.map(|row| row.poses).min()
}

/// A size halfway between the smallest chosen design that holds and the next smaller one, or the `least` that may be;
/// `None` where nothing lies between.
fn between(rows: &[DesignRow], least: usize) -> Option<usize> {
    let holds = least_that_holds(rows)?;
    let sizes = rows.iter().filter(|row| row.kind == session::KIND);
    let below = sizes.map(|row| row.poses).filter(|&poses| poses < holds).max().unwrap_or(least);
    let middle = below.midpoint(holds);
    (below < middle && middle < holds).then_some(middle)
}
