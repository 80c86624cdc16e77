//! Moves of the instrument or the base that no reference tells: stretches of a session whose readings agree with the nominal arm once
//! its base is placed anew, and not before.
//!
//! 1. Readings beyond the gate of the placement that the others share are far.
//! 2. A stretch of far readings that one rigid motion brings back within the gate, of a target in the same place at the flange, is named
//!    with that motion. Its readings have to be spread by more than the gate: readings in one place are brought back by any.
//!
//! A smaller motion, which the model of the arm's errors tells, is a [`Knock`] ([`crate::fit::full::knocks`]).
//!
//! Nothing ties such a stretch to the rest, as its motion is known no better than the nominal arm: its readings stay out.

use nalgebra::{Isometry3, Point3};
use serde::{Deserialize, Serialize};

use super::MIN_PAIRS;
use super::average::centred_rms;
use super::placement::{Placement, ReadingAtFlange};
use super::references::Motion;
use crate::figures::median;
use crate::geometry::align;
use crate::units::{Controller, Stamp, WallTime};

/// Spread of readings that show a motion, in gates.
const SPREAD: f64 = 3.0;
/// So many readings in a row that are far from a stretch end it; fewer are of another reflector.
const ENDS: usize = 3;

/// Share of the readings that a placement by half of them has to explain.
const EXPLAINED: f64 = 0.8;

/// A stretch of stations whose readings show that the instrument or the base stood elsewhere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Elsewhere {
    pub stations: [usize; 2],
    /// Number of readings that agree there.
    pub readings: usize,
    pub shift_mm: f64,
    /// Angle by which the instrument turned against the base, rad.
    pub turn_rad: f64,
    pub left_mm: f64,
}

impl Elsewhere {
    pub fn words(&self) -> String {
        let Self { stations: [first, last], readings, shift_mm, turn_rad, left_mm } = self;
        format!(
            "the instrument or the base was moved: {readings} readings of stations {first} to {last} are {shift_mm:.1} mm away from the \
             arm's place at the others, and agree with it to {left_mm:.1} mm after a turn of {:.2} mrad and a shift; no reference tells the \
             motion, so they are left out (instrument_moved); three references that are not in line, read on both sides, tie the parts \
             together; a reflector in another place at a tool that never turns looks the same",
            1e3 * turn_rad
        )
    }
}

/// A motion of the instrument or the base between two stations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Knock {
    /// The first station behind it.
    pub station: usize,
    /// The beginning of that station.
    pub at: Stamp<Controller>,
    /// Measured stations before and behind it.
    pub stations: [usize; 2],
    pub motion: Motion,
}

impl Knock {
    pub fn shift_mm(&self) -> f64 {
        let Motion { moved, middle, .. } = &self.motion;
        (moved * middle - middle).norm()
    }

    pub fn words(&self) -> String {
        let [before, behind] = self.stations;
        let at = clock_words(self.at);
        format!(
            "the instrument or the base was knocked before station {}{at}: by {:.3} mm and {:.3} mrad in the middle of the readings; the \
             {behind} measured stations behind it are carried to where it stood at the {before} before it",
            self.station,
            self.shift_mm(),
            1e3 * self.motion.moved.rotation.angle(),
        )
    }
}

/// Where a clock has an epoch: ", (time) UTC of the controller's clock".
pub fn clock_words(at: Stamp<Controller>) -> String {
    WallTime::of_clock_ns(at.ns())
        .map_or_else(String::new, |at| format!(", {at} UTC of the controller's clock"))
}

/// A stretch of readings that a motion of the base brings back.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stretch {
    pub first: usize,
    pub last: usize,
    pub readings: Vec<usize>,
    base: Isometry3<f64>,
    left_mm: f64,
}

impl Stretch {
    /// The stretch in numbers of stations.
    pub fn elsewhere(
        &self,
        readings: &[ReadingAtFlange],
        placement: &Placement,
        stations: [usize; 2],
    ) -> Elsewhere {
        let away = self.readings.iter().map(|&own| placement.distance_mm(&readings[own]));
        let by = self.base * placement.tracker_from_base.inverse();
        Elsewhere {
            stations,
            readings: self.readings.len(),
            shift_mm: median(&away.collect::<Vec<f64>>()).unwrap_or(0.0),
            turn_rad: by.rotation.angle(),
            left_mm: self.left_mm,
        }
    }
}

/// The stretches of `readings`, which are in order of time, that a motion of the base brings within `gate_mm` of the nominal arm.
pub(super) fn stretches(
    readings: &[ReadingAtFlange],
    placement: &Placement,
    gate_mm: f64,
) -> Vec<Stretch> {
    let is_far = |own: &usize| placement.distance_mm(&readings[*own]) > gate_mm;
    let far: Vec<usize> = (0..readings.len()).filter(is_far).collect();
    let mut found = Vec::new();
    let mut at = 0;
    while at + MIN_PAIRS <= far.len() {
        match grown(readings, placement, &far[at..], gate_mm) {
            Some((stretch, used)) => {
                found.push(stretch);
                at += used;
            }
            None => at += 1,
        }
    }
    found
}

/// Whether nearly all readings agree with the arm under a placement, or in stretches with the base placed anew.
pub(super) fn explains(readings: &[ReadingAtFlange], placement: &Placement, gate_mm: f64) -> bool {
    let near = readings.iter().filter(|own| placement.distance_mm(own) <= gate_mm).count();
    let moved = stretches(readings, placement, gate_mm);
    let moved: usize = moved.iter().map(|own| own.readings.len()).sum();
    (near + moved) as f64 >= EXPLAINED * readings.len() as f64
}

/// The stretch that begins with the first of `far`, and the number of them up to its end.
fn grown(
    readings: &[ReadingAtFlange],
    placement: &Placement,
    far: &[usize],
    gate_mm: f64,
) -> Option<(Stretch, usize)> {
    let mut own: Vec<usize> = far[..MIN_PAIRS].to_vec();
    let mut base = base_of(readings, placement, &own, gate_mm)?;
    let (mut used, mut missed) = (MIN_PAIRS, 0);
    for (place, next) in far.iter().enumerate().skip(MIN_PAIRS) {
        if away_mm(&readings[*next], placement, &base) <= gate_mm {
            own.push(*next);
            (used, missed) = (place + 1, 0);
            // A motion by few readings is known badly further away.
            base = base_of(readings, placement, &own, gate_mm).unwrap_or(base);
        } else {
            missed += 1;
        }
        if missed == ENDS {
            break;
        }
    }
    let left: Vec<f64> = own.iter().map(|own| away_mm(&readings[*own], placement, &base)).collect();
    let places = own.iter().map(|own| at_base(&readings[*own], placement).coords);
    let is_spread = centred_rms(&places.collect::<Vec<_>>()) > SPREAD * gate_mm;
    let (first, last, left_mm) = (own[0], own[own.len() - 1], median(&left).unwrap_or(0.0));
    is_spread.then_some((Stretch { first, last, readings: own, base, left_mm }, used))
}

/// The base in the tracker's frame by some readings of a target whose place at the flange is known; `None` where they do not agree.
fn base_of(
    readings: &[ReadingAtFlange],
    placement: &Placement,
    own: &[usize],
    gate_mm: f64,
) -> Option<Isometry3<f64>> {
    let own = || own.iter().map(|place| &readings[*place]);
    let to: Vec<Point3<f64>> = own().map(|own| Point3::from(own.attained)).collect();
    let from: Vec<Point3<f64>> = own().map(|own| at_base(own, placement)).collect();
    let base = align(&to, &from, &vec![1.0; to.len()])?;
    let left: Vec<f64> = own().map(|own| away_mm(own, placement, &base)).collect();
    (median(&left)? <= gate_mm).then_some(base)
}

fn at_base(own: &ReadingAtFlange, placement: &Placement) -> Point3<f64> {
    own.flange * Point3::from(placement.target_mm)
}

fn away_mm(own: &ReadingAtFlange, placement: &Placement, base: &Isometry3<f64>) -> f64 {
    (base * at_base(own, placement) - Point3::from(own.attained)).norm()
}
