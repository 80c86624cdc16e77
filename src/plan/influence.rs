//! What a grid's accuracy depends on besides its step: where its nodes lie, how the tool is turned, mixed arm
//! configurations, and singularities near by.
//!
//! Inputs: as in [`super::steps`], one step. Output: a row for each study and value, source and interpolation.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use rayon::prelude::*;

use super::outcomes::{Outcomes, RobotOutcome};
use super::place::{Placer, posed};
use super::robots::Robot;
use super::settings::PlanSettings;
use super::steps::{Grid, Measured, families, test_poses};
use super::{PlanError, Trial};
use crate::grid::{Interpolation, Lattice, Source};
use crate::kinematics::{Arm, SingularityFactors};
use crate::simulate::{Commanded, Ingredient, Stream, Visit};

/// Shares of a step by which the grid is moved along each axis.
const SHIFTS: [f64; 4] = [0.0, 0.25, 0.5, 0.75];
/// Turns of the tool at fresh poses away from the table's orientation, degrees.
const TURNS_DEG: [f64; 6] = [0.0, 2.0, 5.0, 10.0, 20.0, 30.0];
/// Shares of the nodes that are measured with the wrist flipped.
const FLIPPED: [f64; 4] = [0.0, 0.05, 0.2, 0.5];
/// Edges of the least singularity factor of a fresh pose.
const FACTORS: [f64; 6] = [0.0, 0.1, 0.2, 0.3, 0.5, f64::INFINITY];

/// What is varied.
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
    /// The name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Shift(_) => "grid_shift",
            Self::Turn(_) => "orientation_mismatch",
            Self::Flipped(_) => "mixed_configuration",
            Self::Singularity(..) => "singularity_distance",
        }
    }

    /// Its value in tables: share of a step, degrees, share of nodes, or the lower edge of the factor.
    pub fn value(self) -> f64 {
        match self {
            Self::Shift(share) | Self::Flipped(share) | Self::Singularity(share, _) => share,
            Self::Turn(rad) => rad.to_degrees(),
        }
    }
}

/// What one study and value gives.
#[derive(Debug, Clone)]
pub struct InfluenceRow {
    /// What is varied, and how far.
    pub study: Study,
    /// Step, mm.
    pub step_mm: f64,
    /// Where node values come from.
    pub source: Source,
    /// How values inside a cell follow.
    pub interpolation: Interpolation,
    /// Poses to measure.
    pub poses: usize,
    /// Fresh poses or nodes that a study asked for and the arm does not reach in its way, one robot.
    pub not_reached: usize,
    /// What it gave on the robots.
    pub outcomes: Outcomes,
}

/// One study and value: the grid to measure and the fresh poses that judge it.
struct Case<'c> {
    study: Study,
    grid: std::borrow::Cow<'c, Grid>,
    /// Which of a robot's fresh poses judge.
    suits: Box<dyn Fn(&Commanded) -> bool + Sync + 'c>,
    /// How fresh poses are turned.
    turn_rad: f64,
    not_reached: usize,
}

/// Studies a grid of one step on the plan's robots, at most `robots` of them.
pub fn study(
    trial: &Trial<'_>,
    pool: &[Commanded],
    step_mm: f64,
    robots: usize,
) -> Result<Vec<InfluenceRow>, PlanError> {
    let Trial {
        arm,
        placer,
        settings,
        progress,
    } = *trial;
    let grid = Grid::new(placer, settings, step_mm)?;
    let cases = cases(arm, placer, &grid, settings);
    let robots = robots.min(settings.robots);
    progress.begin("robots × influences", (robots * cases.len()) as u64);
    let of_robot = |number: usize| {
        let mut robot = Robot::draw(arm, settings, number);
        let tests = test_poses(pool, settings, number);
        let of_case = |case: &Case<'_>| {
            let outcomes = on_robot(&mut robot, case, placer, &tests, number, settings);
            progress.advance(1);
            outcomes
        };
        cases.iter().map(of_case).collect::<Vec<_>>()
    };
    let found: Vec<_> = (0..robots).into_par_iter().map(of_robot).collect();
    progress.end();
    Ok(rows(&cases, &found, settings))
}

fn cases<'c>(
    arm: &'c Arm,
    placer: &Placer<'_>,
    grid: &'c Grid,
    settings: &PlanSettings,
) -> Vec<Case<'c>> {
    let mut cases = Vec::new();
    let all = |_: &Commanded| true;
    for share in SHIFTS {
        if let Some(shifted) = shifted(grid, share, placer, settings) {
            let common = Common::of(grid);
            cases.push(Case {
                study: Study::Shift(share),
                grid: std::borrow::Cow::Owned(shifted),
                suits: Box::new(move |pose| common.holds(pose)),
                turn_rad: 0.0,
                not_reached: 0,
            });
        }
    }
    for turn_deg in TURNS_DEG {
        cases.push(Case {
            study: Study::Turn(turn_deg.to_radians()),
            grid: std::borrow::Cow::Borrowed(grid),
            suits: Box::new(all),
            turn_rad: turn_deg.to_radians(),
            not_reached: 0,
        });
    }
    for share in FLIPPED {
        let (flipped, not_reached) = flipped(grid, share, placer);
        cases.push(Case {
            study: Study::Flipped(share),
            grid: std::borrow::Cow::Owned(flipped),
            suits: Box::new(all),
            turn_rad: 0.0,
            not_reached,
        });
    }
    for edges in FACTORS.windows(2) {
        let [low, high] = [edges[0], edges[1]];
        cases.push(Case {
            study: Study::Singularity(low, high),
            grid: std::borrow::Cow::Borrowed(grid),
            suits: Box::new(move |pose| {
                least_factor(arm, &pose.joints).is_some_and(|factor| (low..high).contains(&factor))
            }),
            turn_rad: 0.0,
            not_reached: 0,
        });
    }
    cases
}

/// The part of the box that grids moved by any of [`SHIFTS`] all cover: a step less on the low side.
#[derive(Clone, Copy)]
struct Common {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Common {
    fn of(grid: &Grid) -> Self {
        let lattice = &grid.placed.lattice;
        let last = lattice.position(lattice.node_count() - 1).coords;
        Self {
            low: lattice.origin.coords + Vector3::from(lattice.step),
            high: last - Vector3::from(lattice.step) * 0.25,
        }
    }

    fn holds(&self, pose: &Commanded) -> bool {
        let place = pose.base_from_target.translation.vector;
        (0..3).all(|axis| (self.low[axis]..=self.high[axis]).contains(&place[axis]))
    }
}

/// The grid moved by a share of its step to the low side, a layer of nodes more on the high side.
fn shifted(grid: &Grid, share: f64, placer: &Placer<'_>, settings: &PlanSettings) -> Option<Grid> {
    let whole = grid.placed.lattice;
    if whole.counts.iter().any(|&count| count < 3) {
        return None;
    }
    let lattice = Lattice {
        origin: whole.origin + Vector3::from(whole.step) * share,
        counts: whole
            .counts
            .map(|count| if share > 0.0 { count - 1 } else { count }),
        ..whole
    };
    Some(Grid::of(placer, settings, grid.step_mm, lattice))
}

/// The grid with every so many-th node measured with the wrist flipped, and how many of them the arm cannot reach so.
fn flipped(grid: &Grid, share: f64, placer: &Placer<'_>) -> (Grid, usize) {
    let mut flipped = grid.clone();
    let mut not_reached = 0;
    let is_picked = |place: usize| {
        let before = (place as f64 * share).floor();
        ((place + 1) as f64 * share).floor() > before
    };
    for (_, command) in flipped
        .commands
        .iter_mut()
        .enumerate()
        .filter(|(place, _)| is_picked(*place))
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
    let factors = SingularityFactors::of(arm, &nominal, joints)?;
    Some(
        factors
            .shoulder
            .abs()
            .min(factors.elbow.abs())
            .min(factors.wrist.abs()),
    )
}

fn on_robot(
    robot: &mut Robot<'_>,
    case: &Case<'_>,
    placer: &Placer<'_>,
    tests: &[Commanded],
    number: usize,
    settings: &PlanSettings,
) -> Vec<RobotOutcome> {
    let own: Vec<Commanded> = tests
        .iter()
        .filter(|test| (case.suits)(test))
        .cloned()
        .collect();
    let own = if case.turn_rad > 0.0 {
        turned(&own, case.turn_rad, placer, number, settings)
    } else {
        own
    };
    let visits: Vec<Visit> = robot.session(&own);
    match Measured::new(robot, &case.grid, placer, settings) {
        Ok(measured) => measured.left(&case.grid, &visits, placer, settings),
        Err(error) => vec![RobotOutcome::NoFit(error); families(settings).len()],
    }
}

/// Fresh poses turned by an angle about random axes; those that the arm then cannot reach are left out.
fn turned(
    poses: &[Commanded],
    turn_rad: f64,
    placer: &Placer<'_>,
    number: usize,
    settings: &PlanSettings,
) -> Vec<Commanded> {
    let mut stream = Stream::new(settings.seed ^ (number as u64 + 1), Ingredient::TestPoses);
    let turn = |pose: &Commanded| {
        let axis = nalgebra::Unit::new_normalize(stream.normal3());
        let place: Isometry3<f64> = pose.base_from_target;
        let turned = UnitQuaternion::from_axis_angle(&axis, turn_rad) * place.rotation;
        placer
            .commanded(posed(&place.translation.vector.into(), &turned))
            .ok()
    };
    poses.iter().filter_map(turn).collect()
}

fn rows(
    cases: &[Case<'_>],
    robots: &[Vec<Vec<RobotOutcome>>],
    settings: &PlanSettings,
) -> Vec<InfluenceRow> {
    let mut rows = Vec::new();
    for (place, case) in cases.iter().enumerate() {
        for (family, (source, interpolation)) in families(settings).into_iter().enumerate() {
            let own = robots.iter().map(|robot| &robot[place][family]);
            rows.push(InfluenceRow {
                study: case.study,
                step_mm: case.grid.step_mm,
                source,
                interpolation,
                poses: case.grid.commands.len(),
                not_reached: case.not_reached,
                outcomes: Outcomes::of(own, settings.robots_meet),
            });
        }
    }
    rows
}
