//! Commands: which commanded pose was in force during each dwell.
//!
//! Controllers stamp a command when they send it (before the move), when the arm arrives, or when they measure. So
//! three rules are tried: the last command at or before a dwell's end, its middle, or its start. The right rule is the
//! one whose commands lie where the nominal arm was (a placement of command frame and tool point is fitted to each).
//! A dwell whose own command is missing inherits one from elsewhere: it is far from the arm and is left out.

use nalgebra::{Isometry3, Point3, Vector3};

use super::Command;
use super::average::unit;
use super::placement::{Placement, Sighting};
use crate::ingest::CommandSamples;
use crate::units::{Controller, Stamp};

/// A rule has to place commands within this of the arm to be believed at all, mm.
const BELIEVED_MM: f64 = 20.0;
/// Beyond this many median residuals (and beyond [`BELIEVED_MM`]) a command belongs to another station.
const REACH: f64 = 10.0;
/// Nothing is commanded this far away, mm; such numbers would only overflow the fit.
const FARTHEST_MM: f64 = 1e9;

/// What is known of a dwell when its command is looked for.
#[derive(Debug, Clone, Copy)]
pub struct Occasion {
    /// First moment at rest.
    pub start: Stamp<Controller>,
    /// Last moment at rest.
    pub end: Stamp<Controller>,
    /// The nominal flange, mm.
    pub flange: Isometry3<f64>,
}

/// The command of each dwell, in the dwells' order.
pub fn in_force(commands: &CommandSamples, dwells: &[Occasion]) -> Vec<Option<Command>> {
    let by_end = last_before(commands, dwells, |dwell| dwell.end);
    let by_middle = last_before(commands, dwells, |dwell| {
        dwell.start.plus_ns(dwell.end.since_ns(dwell.start) / 2)
    });
    let by_start = last_before(commands, dwells, |dwell| dwell.start);
    // Of like rules the first stays: a wrong one places commands a whole move away.
    let mut best: Option<(f64, Placement, &Vec<Option<usize>>)> = None;
    for rule in [&by_end, &by_middle, &by_start] {
        let placed = placed(commands, dwells, rule);
        if let Some((median_mm, placement)) = placed
            && best
                .as_ref()
                .is_none_or(|(least, ..)| 2.0 * median_mm < *least)
        {
            best = Some((median_mm, placement, rule));
        }
    }
    match best {
        Some((median_mm, placement, rule)) if median_mm <= BELIEVED_MM => {
            let reach_mm = (REACH * median_mm).max(BELIEVED_MM);
            let near = |(dwell, command): (&Occasion, &Option<usize>)| {
                command.filter(|&index| {
                    placement.distance_mm(&sighting(commands, dwell, index)) <= reach_mm
                })
            };
            dwells
                .iter()
                .zip(rule)
                .map(near)
                .map(|index| command(commands, index))
                .collect()
        }
        _ => by_end
            .iter()
            .map(|&index| command(commands, index))
            .collect(),
    }
}

/// Index of the last command at or before `moment` of each dwell.
fn last_before(
    commands: &CommandSamples,
    dwells: &[Occasion],
    moment: impl Fn(&Occasion) -> Stamp<Controller>,
) -> Vec<Option<usize>> {
    // A command that is no number commands nothing.
    let stated = |index: usize| {
        commands.positions[index]
            .iter()
            .all(|x| x.abs() < FARTHEST_MM)
    };
    let last = |dwell: &Occasion| {
        let moment = moment(dwell);
        commands
            .stamps
            .partition_point(|&stamp| stamp <= moment)
            .checked_sub(1)
            .filter(|&index| stated(index))
    };
    dwells.iter().map(last).collect()
}

/// The placement of a rule's commands, with its median distance, mm.
fn placed(
    commands: &CommandSamples,
    dwells: &[Occasion],
    rule: &[Option<usize>],
) -> Option<(f64, Placement)> {
    let sightings: Vec<Sighting> = dwells
        .iter()
        .zip(rule)
        .filter_map(|(dwell, index)| Some(sighting(commands, dwell, (*index)?)))
        .collect();
    if sightings.len() < super::pattern::MIN_PAIRS {
        return None;
    }
    let placement = Placement::fit(&sightings)?;
    Some((placement.median_mm(&sightings), placement))
}

fn sighting(commands: &CommandSamples, dwell: &Occasion, index: usize) -> Sighting {
    Sighting {
        flange: dwell.flange,
        attained: Vector3::from(commands.positions[index]),
    }
}

fn command(commands: &CommandSamples, index: Option<usize>) -> Option<Command> {
    let index = index?;
    let orientation = commands
        .orientations
        .as_ref()
        .and_then(|all| unit(&all[index]));
    Some(Command {
        position: Point3::from(commands.positions[index]),
        orientation,
    })
}
