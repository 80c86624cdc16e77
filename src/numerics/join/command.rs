//! Commands: the commanded pose in force during each dwell.
//!
//! Controllers stamp a command when they send it (before the move), when the arm arrives, or when they measure. So
//! three rules are tried: the last command at or before a dwell's end, its middle, or its start. The right rule is the
//! one whose commands agree with the nominal arm's poses (a placement of command frame and tool point is fitted to each).
//! A dwell whose own command is missing gets another pose's command, which is far from the arm and is left out.

use nalgebra::{Isometry3, Point3, Vector3};

use super::Command;
use super::average::unit;
use super::placement::{Placement, ReadingAtFlange};
use crate::ingest::{Poses, PosesError};
use crate::units::{Controller, Stamp};

/// The largest median distance of a rule's commands from the arm with which the rule is accepted, mm.
const BELIEVED_MM: f64 = 20.0;
/// Beyond this many median residuals (and beyond [`BELIEVED_MM`]) a command belongs to another station.
const REACH: f64 = 10.0;
/// Largest coordinate of a command, mm; larger numbers would only overflow the fit.
const FARTHEST_MM: f64 = 1e9;

/// The data of a dwell with which its command is searched for.
#[derive(Debug, Clone, Copy)]
pub struct Occasion {
    pub start: Stamp<Controller>,
    pub end: Stamp<Controller>,
    pub flange: Isometry3<f64>,
}

#[derive(Debug, Clone, Copy)]
struct Stated {
    position: Vector3<f64>,
    orientation: Option<[f64; 4]>,
}

pub(super) fn in_force(
    commands: &dyn Poses<Controller>,
    dwells: &[Occasion],
) -> Result<Vec<Option<Command>>, PosesError> {
    let by_end = last_before(commands, dwells, |dwell| dwell.end)?;
    let by_middle = last_before(commands, dwells, |dwell| {
        dwell.start.plus_ns(dwell.end.since_ns(dwell.start) / 2)
    })?;
    let by_start = last_before(commands, dwells, |dwell| dwell.start)?;
    // Of equally good rules the first is kept: a wrong one places commands a whole move away.
    let mut best: Option<(f64, Placement, &Vec<Option<Stated>>)> = None;
    for rule in [&by_end, &by_middle, &by_start] {
        if let Some((median_mm, placement)) = placed(dwells, rule)
            && best.as_ref().is_none_or(|(least, ..)| 2.0 * median_mm < *least)
        {
            best = Some((median_mm, placement, rule));
        }
    }
    Ok(match best {
        Some((median_mm, placement, rule)) if median_mm <= BELIEVED_MM => {
            let reach_mm = (REACH * median_mm).max(BELIEVED_MM);
            let near = |(dwell, stated): (&Occasion, &Option<Stated>)| {
                stated.filter(|stated| placement.distance_mm(&reading(dwell, stated)) <= reach_mm)
            };
            dwells.iter().zip(rule).map(near).map(|stated| stated.map(Command::from)).collect()
        }
        _ => by_end.into_iter().map(|stated| stated.map(Command::from)).collect(),
    })
}

/// The last command at or before `moment` of each dwell.
fn last_before(
    commands: &dyn Poses<Controller>,
    dwells: &[Occasion],
    moment: impl Fn(&Occasion) -> Stamp<Controller>,
) -> Result<Vec<Option<Stated>>, PosesError> {
    let last = |dwell: &Occasion| {
        let moment = moment(dwell);
        let row = commands.count_while(&|stamp| stamp <= moment)?.checked_sub(1);
        let Some(row) = row else { return Ok(None) };
        let read = commands.read(row..row + 1)?;
        let position = Vector3::from(read.positions[0]);
        let orientation = read.orientations.map(|all| all[0]);
        // A command with NaN or huge coordinates is ignored.
        let is_sound = position.iter().all(|x| x.abs() < FARTHEST_MM);
        Ok(is_sound.then_some(Stated { position, orientation }))
    };
    dwells.iter().map(last).collect()
}

impl From<Stated> for Command {
    fn from(stated: Stated) -> Self {
        Self {
            position: Point3::from(stated.position),
            orientation: stated.orientation.as_ref().and_then(unit),
        }
    }
}

/// The placement of a rule's commands, with its median distance, mm.
fn placed(dwells: &[Occasion], rule: &[Option<Stated>]) -> Option<(f64, Placement)> {
    let stated = dwells.iter().zip(rule);
    let readings = stated.filter_map(|(dwell, stated)| Some(reading(dwell, stated.as_ref()?)));
    let readings: Vec<ReadingAtFlange> = readings.collect();
    if readings.len() < super::MIN_PAIRS {
        return None;
    }
    let placement = Placement::fit(&readings)?;
    Some((placement.median_mm(&readings), placement))
}

const fn reading(dwell: &Occasion, stated: &Stated) -> ReadingAtFlange {
    ReadingAtFlange { flange: dwell.flange, attained: stated.position }
}
