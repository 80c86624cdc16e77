//! Plans before measuring as tasks: one for each robot of a pipeline file with a `[plan]`.
//!
//! A plan is named by its run, which follows from the pipeline file, the robot file and the version, so listing draws no robot.

use std::path::Path;

use super::{Ended, How, Task, failed, no_such};
use crate::io::lake::Lake;
use crate::manifest::VERSION;
use crate::pipeline::planning::{self, Planning, PlanningError};
use crate::progress::Progress;

/// Seconds of one core that a plan takes for each robot that it draws, about: with joint curves and all other parts, and for steps alone.
const SECONDS_A_ROBOT: [f64; 2] = [0.3, 0.2];
/// Megabytes of memory that a plan takes, about.
const MEGABYTES: f64 = 600.0;

/// A robot's plan, or why there is none.
pub type OfRobot = (Option<String>, Result<Planning, PlanningError>);

/// The plans of the pipeline file at `path`: of these robots, of all where none is named.
pub fn all(
    path: &Path,
    robots: &[String],
    lake: Option<&Path>,
) -> Result<Vec<OfRobot>, PlanningError> {
    let known = Planning::robots(path)?;
    let named: Vec<Option<String>> = match (known.is_empty(), robots.is_empty()) {
        (true, true) => vec![None],
        (_, false) => robots.iter().cloned().map(Some).collect(),
        (false, true) => known.into_iter().map(Some).collect(),
    };
    let of = |robot: Option<String>| {
        let planning = Planning::load(path, robot.as_deref(), lake);
        (robot, planning)
    };
    Ok(named.into_iter().map(of).collect())
}

/// The task of a plan; `None` where the lake has it as the current one.
pub fn open(planning: &Planning) -> Result<Option<Task>, PlanningError> {
    let key = planning.key();
    let current = Lake::at(&planning.lake)?.current(&key)?;
    if current.is_some_and(|current| current.run == key.run) {
        return Ok(None);
    }
    let settings = &planning.settings;
    let drawn = [settings.whole_model_robots, settings.robots];
    let seconds = drawn.iter().zip(SECONDS_A_ROBOT);
    let seconds: f64 = seconds.map(|(&robots, each)| robots as f64 * each).sum();
    Ok(Some(Task {
        id: key.run,
        version: VERSION.to_owned(),
        robot: Some(key.robot),
        session: key.session,
        learns_from: Vec::new(),
        judged_on: Vec::new(),
        bytes: 0,
        expected_s: seconds.ceil(),
        expected_mb: MEGABYTES,
    }))
}

/// Makes the plan of that id, unless the lake has it.
pub fn work(plans: Vec<OfRobot>, id: &str, progress: &dyn Progress) -> Ended {
    let mut plans = plans.into_iter().filter_map(|(_, planning)| planning.ok());
    let planning = plans.find(|planning| planning.key().run == id);
    let Some(planning) = planning else { return no_such(id) };
    let key = planning.key();
    let (robot, session) = (Some(key.robot.clone()), Some(planning::SESSION.to_owned()));
    let own = Ended { robot, session, ..no_such(id) };
    match planning.make(progress) {
        Ok(planned) => Ended {
            ended: if planned.plan.is_some() { How::Done } else { How::DoneBefore },
            run: Some(key.run),
            met: Some(planned.is_met),
            reason: None,
            ..own
        },
        Err(error) => {
            let how = if error.is_fault() { How::Fault } else { How::Failed };
            let failed = failed(id, None, how, error.to_string());
            Ended { robot: own.robot, session: own.session, ..failed }
        }
    }
}
