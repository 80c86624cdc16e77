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
    // Of equally good rules that with the most commands near the arm, the first of several: a wrong one places commands a whole move away,
    // of some stations alone where stamps are a little late.
    let mut best: Option<Ruled> = None;
    for rule in [&by_end, &by_middle, &by_start] {
        best = match (best, placed(dwells, rule)) {
            (Some(best), Some(own)) if !own.is_better(&best) => Some(best),
            (best, own) => own.or(best),
        };
    }
    let own = best.filter(|own| own.median_mm <= BELIEVED_MM);
    let stated = own.map_or(by_end, |own| own.near);
    Ok(stated.into_iter().map(|stated| stated.map(Command::from)).collect())
}

/// The commands of a rule.
struct Ruled {
    /// Their median distance from the arm.
    median_mm: f64,
    /// Those that are near it.
    near: Vec<Option<Stated>>,
}

impl Ruled {
    fn is_better(&self, other: &Self) -> bool {
        let [own, others] = [self, other].map(|of| of.near.iter().flatten().count());
        2.0 * self.median_mm < other.median_mm
            || (self.median_mm < 2.0 * other.median_mm && own > others)
    }
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

/// A rule's commands by their placement.
fn placed(dwells: &[Occasion], rule: &[Option<Stated>]) -> Option<Ruled> {
    let stated = dwells.iter().zip(rule);
    let readings = stated.filter_map(|(dwell, stated)| Some(reading(dwell, stated.as_ref()?)));
    let readings: Vec<ReadingAtFlange> = readings.collect();
    if readings.len() < super::MIN_PAIRS {
        return None;
    }
    let placement = Placement::fit(&readings)?;
    let median_mm = placement.median_mm(&readings);
    let reach_mm = (REACH * median_mm).max(BELIEVED_MM);
    let near = |(dwell, stated): (&Occasion, &Option<Stated>)| {
        stated.filter(|stated| placement.distance_mm(&reading(dwell, stated)) <= reach_mm)
    };
    Some(Ruled { median_mm, near: dwells.iter().zip(rule).map(near).collect() })
}

const fn reading(dwell: &Occasion, stated: &Stated) -> ReadingAtFlange {
    ReadingAtFlange { flange: dwell.flange, attained: stated.position }
}
