//! Influences on a grid's accuracy other than its step: the place of its nodes, the turn of the tool, mixed arm
//! configurations, and near singularities.
//!
//! Inputs: as in [`super::steps`], one step. Output: a row for each study and value, source and interpolation.

use std::borrow::Cow;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use super::outcomes::{Outcomes, RobotOutcome};
use super::place::{Placer, posed};
use super::settings::{PlanSettings, Region};
use super::steps::{Grid, by_family, on_robot, test_poses};
use super::{PlanError, Trial};
use crate::grid::{Interpolation, Lattice, Source, WorkBox};
use crate::kinematics::{Arm, SingularityFactors};
use crate::simulate::{Commanded, Ingredient, Stream};

/// Shares of a step by which the grid is moved along each axis.
const SHIFTS: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Turns of the tool at fresh poses away from the table's orientation, degrees.
const TURNS_DEG: [f64; 6] = [0.0, 2.0, 5.0, 10.0, 20.0, 30.0];
/// Shares of the nodes that are measured with the wrist flipped.
const FLIPPED: [f64; 4] = [0.0, 0.05, 0.2, 0.5];
/// Edges of the least singularity factor of a fresh pose.
const FACTORS: [f64; 6] = [0.0, 0.1, 0.2, 0.3, 0.5, f64::INFINITY];

/// Number of fresh poses for grids moved by a share of their step; each robot takes its own from them.
const INFLUENCE_POOL: usize = 2000;

/// The variable of a study.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Study {
    /// The grid moved along each axis by this share of its step; fresh poses are those inside all such grids.
    Shift(f64),
    /// Fresh poses turned away from the table's orientation by this angle, rad.
    Turn(f64),
    /// This share of the nodes measured with the wrist flipped.
    Flipped(f64),
    /// Fresh poses whose least singularity factor is between these.
    Singularity(f64, f64),
}

impl Study {
    /// Its value in tables: share of a step, degrees, share of nodes, or the lower edge of the factor.
    pub fn value(self) -> f64 {
        match self {
            Self::Shift(share) | Self::Flipped(share) | Self::Singularity(share, _) => share,
            Self::Turn(rad) => rad.to_degrees(),
        }
    }
}

/// The results of one study and value.
#[derive(Debug, Clone)]
pub struct InfluenceRow {
    /// The variable and its value.
    pub study: Study,
    /// Step, mm.
    pub step_mm: f64,
    /// Source of node values.
    pub source: Source,
    /// Interpolation inside a cell.
    pub interpolation: Interpolation,
    /// Number of poses to measure.
    pub poses: usize,
    /// Number of fresh poses or nodes that a study needed and the arm cannot reach in its way, for one robot.
    pub not_reached: usize,
    /// The outcomes on the robots.
    pub outcomes: Outcomes,
}

/// One study and value: the grid to measure and the fresh poses that judge it.
struct Case<'c> {
    study: Study,
    grid: Cow<'c, Grid>,
    fresh: Fresh<'c>,
    not_reached: usize,
}

/// The fresh poses that judge a robot.
enum Fresh<'c> {
    /// The robot's share of the plan's poses.
    Plans,
    /// The robot's share of other poses.
    Of(&'c [Commanded]),
    /// The plan's poses, turned by this angle, rad.
    Turned(f64),
    /// The plan's poses whose least singularity factor is between these.
    Factor(f64, f64),
}

/// Studies a grid of one step on the plan's robots, at most `robots` of them.
pub fn study(
    trial: &Trial<'_>,
    pool: &[Commanded],
    step_mm: f64,
    robots: usize,
) -> Result<Vec<InfluenceRow>, PlanError> {
    let (placer, settings) = (trial.placer, trial.settings);
    let grid = Grid::new(placer, settings, step_mm)?;
    let common = in_all_shifts(&grid, placer, settings)?;
    let mut cases = shifts(&grid, &common, placer, settings);
    cases.extend(of_one_grid(&grid, placer));
    let robots = robots.min(settings.robots);
    let found = trial.each_robot("robots × influences", 0..robots, |robot, number| {
        let tests = test_poses(pool, settings, number);
        let of_case = |case: &Case<'_>| {
            let visits = robot.session(&case.fresh.poses(trial, &tests, number));
            on_robot(robot, &case.grid, &visits, settings)
        };
        cases.iter().map(of_case).collect()
    });
    Ok(rows(&cases, &found, settings))
}

/// The grid moved by each of [`SHIFTS`], judged at `common`, which all of them cover; empty where there are fewer than
/// three nodes along an axis.
fn shifts<'c>(
    grid: &Grid,
    common: &'c [Commanded],
    placer: &Placer<'_>,
    settings: &PlanSettings,
) -> Vec<Case<'c>> {
    let case = |share: f64| {
        Some(Case {
            study: Study::Shift(share),
            grid: Cow::Owned(shifted(grid, share, placer, settings)?),
            fresh: Fresh::Of(common),
            not_reached: 0,
        })
    };
    SHIFTS.into_iter().filter_map(case).collect()
}

/// Turned fresh poses, flipped wrists and singularities, on the grid at its own place.
fn of_one_grid<'c>(grid: &'c Grid, placer: &Placer<'_>) -> Vec<Case<'c>> {
    let as_it_is = |study, fresh| Case { study, grid: Cow::Borrowed(grid), fresh, not_reached: 0 };
    let turned = TURNS_DEG.map(f64::to_radians);
    let turned = turned.map(|turn_rad| as_it_is(Study::Turn(turn_rad), Fresh::Turned(turn_rad)));
    let flipped = FLIPPED.map(|share| {
        let (flipped, not_reached) = flipped(grid, share, placer);
        Case {
            study: Study::Flipped(share),
            grid: Cow::Owned(flipped),
            fresh: Fresh::Plans,
            not_reached,
        }
    });
    let factors = FACTORS.windows(2).map(|edges| {
        let [low, high] = [edges[0], edges[1]];
        as_it_is(Study::Singularity(low, high), Fresh::Factor(low, high))
    });
    turned.into_iter().chain(flipped).chain(factors).collect()
}

/// Fresh poses in the part of the box that the grids of all [`SHIFTS`] cover.
fn in_all_shifts(
    grid: &Grid,
    placer: &Placer<'_>,
    settings: &PlanSettings,
) -> Result<Vec<Commanded>, PlanError> {
    let lattice = &grid.placed.lattice;
    let furthest = SHIFTS.into_iter().fold(0.0, f64::max);
    let least = SHIFTS.into_iter().filter(|&share| share > 0.0).fold(1.0, f64::min);
    let edge = |axis: usize, steps: f64| lattice.origin[axis] + steps * lattice.step[axis];
    let last = |axis: usize| lattice.counts[axis] as f64 - 2.0;
    let bounds = WorkBox {
        low_mm: [0, 1, 2].map(|axis| edge(axis, furthest)),
        high_mm: [0, 1, 2].map(|axis| edge(axis, last(axis) + least)),
    };
    if (0..3).any(|axis| bounds.size(axis) <= 0.0) {
        return Ok(Vec::new());
    }
    let region = Region { bounds, cone_rad: 0.0, ..settings.region };
    let mut stream = Stream::new(settings.seed, Ingredient::TestPoses);
    let count = INFLUENCE_POOL.max(settings.test_poses);
    Ok(placer.random(&region, count, &mut stream, &|_| Ok(()))?.0)
}

impl Fresh<'_> {
    /// The poses of one robot, `tests` being those of the plan.
    fn poses(&self, trial: &Trial<'_>, tests: &[Commanded], number: usize) -> Vec<Commanded> {
        match *self {
            Self::Plans => tests.to_vec(),
            Self::Of(others) => test_poses(others, trial.settings, number),
            Self::Turned(turn_rad) => turned(tests, turn_rad, trial, number),
            Self::Factor(low, high) => {
                let factor = |test: &Commanded| least_factor(trial.arm, &test.joints);
                let between = |test: &&Commanded| {
                    factor(test).is_some_and(|factor| (low..high).contains(&factor))
                };
                tests.iter().filter(between).cloned().collect()
            }
        }
    }
}

/// The grid moved by a share of its step to the low side, with one more layer of nodes on the high side.
fn shifted(grid: &Grid, share: f64, placer: &Placer<'_>, settings: &PlanSettings) -> Option<Grid> {
    let whole = grid.placed.lattice;
    if whole.counts.iter().any(|&count| count < 3) {
        return None;
    }
    let lattice = Lattice {
        origin: whole.origin + Vector3::from(whole.step) * share,
        counts: whole.counts.map(|count| if share > 0.0 { count - 1 } else { count }),
        ..whole
    };
    Some(Grid::of(placer, settings, grid.step_mm, lattice))
}

/// The grid with a regular share of its nodes measured with the wrist flipped, and the number of those that the arm cannot
/// reach so.
fn flipped(grid: &Grid, share: f64, placer: &Placer<'_>) -> (Grid, usize) {
    let mut flipped = grid.clone();
    let mut not_reached = 0;
    let is_picked = |place: usize| {
        let before = (place as f64 * share).floor();
        ((place + 1) as f64 * share).floor() > before
    };
    for (_, command) in
        flipped.commands.iter_mut().enumerate().filter(|(place, _)| is_picked(*place))
    {
        match placer.flipped(command) {
            Some(joints) => command.joints = joints,
            None => not_reached += 1,
        }
    }
    (flipped, not_reached)
}

fn least_factor(arm: &Arm, joints: &[f64]) -> Option<f64> {
    let nominal = vec![0.0; arm.chain().parameters().len()];
    Some(SingularityFactors::of(arm, &nominal, joints)?.smallest())
}

/// Fresh poses turned by an angle about random axes; those that the arm cannot reach then are left out.
fn turned(poses: &[Commanded], turn_rad: f64, trial: &Trial<'_>, number: usize) -> Vec<Commanded> {
    let seed = trial.settings.seed ^ (number as u64 + 1);
    let mut stream = Stream::new(seed, Ingredient::TestPoses);
    let turn = |pose: &Commanded| {
        let axis = nalgebra::Unit::new_normalize(stream.normal3());
        let place: Isometry3<f64> = pose.base_from_target;
        let turned = UnitQuaternion::from_axis_angle(&axis, turn_rad) * place.rotation;
        trial.placer.commanded(posed(&place.translation.vector.into(), &turned)).ok()
    };
    poses.iter().filter_map(turn).collect()
}

fn rows(
    cases: &[Case<'_>],
    robots: &[Vec<Vec<RobotOutcome>>],
    settings: &PlanSettings,
) -> Vec<InfluenceRow> {
    let of_case = |(place, case): (usize, &Case<'_>)| {
        let row = |(source, interpolation, outcomes)| InfluenceRow {
            study: case.study,
            step_mm: case.grid.step_mm,
            source,
            interpolation,
            poses: case.grid.commands.len(),
            not_reached: case.not_reached,
            outcomes,
        };
        by_family(robots, place, settings).map(row).collect::<Vec<_>>()
    };
    cases.iter().enumerate().flat_map(of_case).collect()
}
