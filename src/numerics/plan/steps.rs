//! The uniform grid, the seed paper's design: for each step, the number of poses and the accuracy.
//!
//! Inputs: the nominal arm and the expected robots. Output: a row for each step, node source and interpolation.
//! 1. For each step, the lattice in the box, every node placed at the table's orientation and visited in serpentines.
//! 2. Each robot measures the nodes of each step; base, target and geometry are fitted on them.
//! 3. Node errors, measured or of the geometric model, are interpolated at fresh poses and compared with the true ones.
//! 4. A step holds for a robot when the bound of [`crate::figures`] on its fresh poses is within the tolerance; it holds
//!    for the population when the share of such robots is, with the confidence asked for, at least the share asked for.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{Point3, Vector3};

use super::outcomes::{Outcomes, RobotOutcome};
use super::place::{Placer, posed};
use super::robots::{Fitted, Robot, stations};
use super::settings::PlanSettings;
use super::{PlanError, Trial};
use crate::fit::full::FullSettings;
use crate::fit::{FitError, ToolErrors};
use crate::grid::judge::{by_nodes, node_errors};
use crate::grid::node::NodeError;
use crate::grid::{Interpolation, Lattice, PlacedGrid, Refusal, Source};
use crate::simulate::{Commanded, Visit};

#[derive(Debug, Clone)]
pub struct Grid {
    pub step_mm: f64,
    pub placed: PlacedGrid,
    /// The nodes that can be measured, in the order of visits.
    pub visited: Vec<usize>,
    pub commands: Vec<Commanded>,
}

#[derive(Debug, Clone)]
pub struct StepRow {
    pub step_mm: f64,
    pub source: Source,
    pub interpolation: Interpolation,
    pub poses: usize,
    pub refused_nodes: BTreeMap<Refusal, usize>,
    pub outcomes: Outcomes,
}

impl Grid {
    /// The lattice of a step over the whole of the plan's box.
    pub fn new(
        placer: &Placer<'_>,
        settings: &PlanSettings,
        step_mm: f64,
    ) -> Result<Self, PlanError> {
        Ok(Self::of(placer, settings, step_mm, Lattice::new(&settings.region.bounds, step_mm)?))
    }

    /// A lattice with its nodes placed and the order in which they are visited.
    pub fn of(
        placer: &Placer<'_>,
        settings: &PlanSettings,
        step_mm: f64,
        lattice: Lattice,
    ) -> Self {
        let orientation = settings.region.orientation;
        let placed = placer.grid(lattice, orientation);
        let visited: Vec<usize> = serpentine(lattice.counts)
            .map(|index| lattice.number(index))
            .filter(|&node| placed.nodes[node].joints.is_ok())
            .collect();
        let command = |&node: &usize| Commanded {
            base_from_target: posed(&lattice.position(node), &orientation),
            joints: placed.nodes[node].joints.clone().expect("only nodes in reach are visited"),
        };
        Self { step_mm, commands: visited.iter().map(command).collect(), visited, placed }
    }
}

/// Nodes with x fastest, each line and layer in the opposite direction to the one before.
fn serpentine([nx, ny, nz]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    let back = |turn: usize, i: usize, n: usize| if turn % 2 == 1 { n - 1 - i } else { i };
    (0..nz).flat_map(move |z| {
        (0..ny).flat_map(move |row| {
            (0..nx).map(move |column| [back(z * ny + row, column, nx), back(z, row, ny), z])
        })
    })
}

/// The steps that are judged, mm, in the order of the settings: of steps with the same pitches, the smallest.
pub fn judged_steps(settings: &PlanSettings) -> Result<Vec<f64>, PlanError> {
    let steps = &settings.grid.steps_mm;
    let lattice = |&step_mm: &f64| Lattice::new(&settings.region.bounds, step_mm);
    let lattices: Vec<Lattice> = steps.iter().map(lattice).collect::<Result<_, _>>()?;
    let is_smallest = |&place: &usize| {
        let others = steps.iter().zip(&lattices);
        let mut alike = others.filter(|(_, lattice)| **lattice == lattices[place]);
        alike.all(|(step_mm, _)| steps[place] <= *step_mm)
    };
    let places = (0..steps.len()).filter(is_smallest);
    Ok(places.map(|place| steps[place]).collect())
}

/// Judges every step of the settings on the plan's robots, steps with the same pitches once.
pub fn judge(trial: &Trial<'_>, pool: &[Commanded]) -> Result<Vec<StepRow>, PlanError> {
    let (placer, settings) = (trial.placer, trial.settings);
    let grids: Vec<Grid> = judged_steps(settings)?
        .into_iter()
        .map(|step_mm| Grid::new(placer, settings, step_mm))
        .collect::<Result<_, _>>()?;
    let robots = trial.each_robot("robots × steps", 0..settings.robots, |robot, number| {
        let tests = robot.session(&test_poses(pool, settings, number));
        grids.iter().map(|grid| on_robot(robot, grid, &tests, settings)).collect()
    });
    Ok(rows(&grids, &robots, settings))
}

/// The fresh poses that judge a robot: its own share of the pool, which is in random order.
pub fn test_poses(pool: &[Commanded], settings: &PlanSettings, number: usize) -> Vec<Commanded> {
    let from = number * settings.test_poses;
    (from..from + settings.test_poses).map(|place| pool[place % pool.len()].clone()).collect()
}

/// Sources and interpolations in the order of the rows.
pub fn families(settings: &PlanSettings) -> Vec<(Source, Interpolation)> {
    let grid = &settings.grid;
    grid.sources
        .iter()
        .flat_map(|&source| grid.interpolations.iter().map(move |&i| (source, i)))
        .collect()
}

#[derive(Debug)]
pub struct Measured<'a> {
    fitted: Fitted<'a>,
    /// Errors at the nodes, by source; zero at refused nodes, which no usable cell touches.
    by_model: Vec<NodeError>,
    at_stations: Vec<NodeError>,
}

impl<'a> Measured<'a> {
    /// Visits the grid's commands, fits base, target and geometry, and takes the error at every node.
    pub fn new(
        robot: &mut Robot<'a>,
        grid: &Grid,
        settings: &PlanSettings,
    ) -> Result<Self, FitError> {
        let geometric = FullSettings { enabled: false, ..settings.full.clone() };
        let stations = stations(robot.session(&grid.commands));
        let fitted = robot.fit(&stations, settings, &geometric)?;
        let model = ToolErrors::new(fitted.models.best().1, 0, &fitted.error_frame);
        let by_model = node_errors(&grid.placed, &model);
        let mut at_stations = vec![Ok(Vector3::zeros()); grid.placed.nodes.len()];
        for (number, error) in fitted.errors(&stations) {
            at_stations[grid.visited[number]] = Ok(error);
        }
        Ok(Self { fitted, by_model, at_stations })
    }

    /// The errors that each source and interpolation leaves at fresh visits.
    pub fn left(&self, grid: &Grid, tests: &[Visit], settings: &PlanSettings) -> Vec<RobotOutcome> {
        let errors = self.fitted.true_errors(tests, settings);
        let left = |(source, interpolation): (Source, Interpolation)| {
            let values = match source {
                Source::Model => &self.by_model,
                Source::Measured => &self.at_stations,
            };
            let left = tests.iter().zip(&errors).map(|(visit, error)| {
                let command = Point3::from(visit.truth.command.translation.vector);
                let power = settings.grid.idw_power;
                let value = |node: usize| values[node];
                let there = by_nodes(&grid.placed, value, &command, interpolation, power);
                there.map(|found| found.map(|interpolated| (error - interpolated).norm()))
            });
            RobotOutcome::of(left, &settings.tolerance)
        };
        families(settings).into_iter().map(left).collect()
    }
}

/// One robot measured on one grid: the errors that each source and interpolation leaves on fresh poses.
fn on_robot(
    robot: &mut Robot<'_>,
    grid: &Grid,
    tests: &[Visit],
    settings: &PlanSettings,
) -> Vec<RobotOutcome> {
    match Measured::new(robot, grid, settings) {
        Ok(measured) => measured.left(grid, tests, settings),
        Err(error) => vec![RobotOutcome::NoFit(error); families(settings).len()],
    }
}

/// The rows of all steps, from the outcomes of each robot on each grid.
fn rows(
    grids: &[Grid],
    robots: &[Vec<Vec<RobotOutcome>>],
    settings: &PlanSettings,
) -> Vec<StepRow> {
    let of_grid = |(place, grid): (usize, &Grid)| {
        let row = |(source, interpolation, outcomes)| StepRow {
            step_mm: grid.step_mm,
            source,
            interpolation,
            poses: grid.commands.len(),
            refused_nodes: grid.placed.refused_nodes(),
            outcomes,
        };
        by_family(robots, place, settings).map(row).collect::<Vec<_>>()
    };
    grids.iter().enumerate().flat_map(of_grid).collect()
}

/// The outcomes of each source and interpolation on the robots, `place` being the index of each robot's grid.
fn by_family(
    robots: &[Vec<Vec<RobotOutcome>>],
    place: usize,
    settings: &PlanSettings,
) -> impl Iterator<Item = (Source, Interpolation, Outcomes)> {
    families(settings).into_iter().enumerate().map(move |(family, (source, interpolation))| {
        let own = robots.iter().map(|robot| &robot[place][family]);
        (source, interpolation, Outcomes::of(own, settings.robots_meet))
    })
}

/// The index of the row with the largest step, of any source and interpolation, that holds together with all smaller ones
/// of its own; `None` without one.
pub fn largest_that_holds(rows: &[StepRow]) -> Option<usize> {
    let families: BTreeSet<(Source, Interpolation)> =
        rows.iter().map(|row| (row.source, row.interpolation)).collect();
    let step = |row: &usize| rows[*row].step_mm;
    let largest = |family: &(Source, Interpolation)| {
        let is_own = |row: &usize| (rows[*row].source, rows[*row].interpolation) == *family;
        let mut own: Vec<usize> = (0..rows.len()).filter(is_own).collect();
        own.sort_by(|a, b| step(a).total_cmp(&step(b)));
        own.into_iter().take_while(|&row| rows[row].outcomes.holds()).last()
    };
    families.iter().filter_map(largest).max_by(|a, b| step(a).total_cmp(&step(b)))
}
