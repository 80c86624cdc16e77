//! Wrong numbers among readings of one length: a slip of the pen, a slipped wire, a beam on something else. They are named, not fitted.
//!
//! Inputs: the observations of all sessions. Output: readings that are too far from what all others predict. Steps:
//! 1. geometry, frames, anchors and planes are fitted with Cauchy's loss, so that wrong numbers do not pull them;
//! 2. the residuals of each instrument in each session have a scale by their median, as Student's t with four degrees of freedom: errors
//!    of an arm have such tails ([`crate::method::error_model`]);
//! 3. a reading is wrong where its residual is so rare that a session without wrong numbers has one once in a hundred;
//! 4. everything again without them, until no further one is found.
//!
//! The smallest wrong number that is found depends on what the geometry leaves: with a hundred readings it is about eighteen medians
//! of their residuals. Smaller ones stay, and the robust weights of the models have them.

use std::collections::BTreeMap;

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::observation::{Noise, Observation};
use super::suspects::{Suspect, SwappedThroughout};
use super::{Calibration, FitSettings, Freedom, Loss, SourceId, identify};
use crate::figures::median;
use crate::join::Unmeasured;
use crate::kinematics::Arm;

/// Chance of a reading that is named though nothing is wrong, in a session and instrument.
const CHANCE: f64 = 0.01;
const FREEDOM: f64 = 4.0;
const MEDIAN_T: f64 = 0.740_697;
/// An instrument whose readings exceed what they find by fewer than these is not checked: their residuals say nothing of their size.
const LEAST_REDUNDANCY: f64 = 8.0;
const ROUNDS: usize = 4;
/// Residuals below this are rounding, mm.
const LEAST_MM: f64 = 1e-6;

/// A wrong number, by the place of its observation.
struct WrongLength {
    place: usize,
    away_mm: f64,
    /// Scale of the instrument's residuals: their median over that of Student's t, mm.
    scale_mm: f64,
    readings: usize,
}

impl WrongLength {
    /// The reason for which the reading is left out; `instrument` is its name.
    fn reason(&self, instrument: &str, station: usize) -> String {
        let Self { away_mm, scale_mm, readings, .. } = self;
        format!(
            "wrong length: the reading of {instrument} at station {station} is {away_mm:+.2} mm from what the arm and all other readings \
             predict, {:.0} times the usual size of the {readings} residuals of this instrument ({scale_mm:.3} mm): a wrong number, or the \
             wire or beam was elsewhere",
            away_mm.abs() / scale_mm
        )
    }
}

/// Wrong numbers among readings of one length, in order of the observations.
pub fn check(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &FitSettings,
    _: &Noise,
) -> Result<Vec<Suspect>, SwappedThroughout> {
    if observations.iter().all(|own| own.measured.length().is_none()) {
        return Ok(Vec::new());
    }
    let robust = FitSettings { loss: Loss::Cauchy { tuning: 2.0 }, ..settings.clone() };
    let mut wrong: BTreeMap<usize, WrongLength> = BTreeMap::new();
    for _ in 0..ROUNDS {
        let places = (0..observations.len()).filter(|place| !wrong.contains_key(place));
        let places: Vec<usize> = places.collect();
        let kept: Vec<Observation> = places.iter().map(|&at| observations[at].clone()).collect();
        let fitted = identify(arm, &kept, sessions, Freedom::Geometry, &robust);
        let Ok(fitted) = fitted else { break };
        let found = far(&kept, &fitted);
        if found.is_empty() {
            break;
        }
        let found = found.into_iter().map(|own| WrongLength { place: places[own.place], ..own });
        wrong.extend(found.map(|own| (own.place, own)));
    }
    let suspects = wrong.values().map(|own| {
        let reading = &observations[own.place];
        let reason = own.reason(&settings.source_name(reading.source), reading.station);
        Suspect::of(reading, reason, Unmeasured::WrongTarget)
    });
    Ok(suspects.collect())
}

fn far(observations: &[Observation], fitted: &Calibration) -> Vec<WrongLength> {
    let mut left: BTreeMap<(usize, SourceId), Vec<(usize, f64)>> = BTreeMap::new();
    for (place, own) in observations.iter().enumerate() {
        if let Some(away_mm) = left_mm(own, fitted) {
            left.entry((own.session, own.source)).or_default().push((place, away_mm));
        }
    }
    let far = left
        .iter()
        .filter_map(|((_, source), own)| Some(far_of_one(own, shrunk(fitted, *source)?)));
    far.flatten().collect()
}

/// The readings of one instrument in one session that are too far; `shrunk` is what the fit made of the size of residuals.
fn far_of_one(left: &[(usize, f64)], shrunk: f64) -> Vec<WrongLength> {
    let sizes: Vec<f64> = left.iter().map(|(_, away_mm)| away_mm.abs()).collect();
    let middle = median(&sizes).unwrap_or(0.0);
    let scale_mm = (middle / MEDIAN_T / shrunk).max(LEAST_MM);
    let is_wrong = |away_mm: f64| chance(away_mm.abs() / scale_mm) * (left.len() as f64) < CHANCE;
    let wrong = left.iter().filter(|(_, away_mm)| is_wrong(*away_mm));
    let found = wrong.map(|&(place, away_mm)| WrongLength {
        place,
        away_mm,
        scale_mm,
        readings: left.len(),
    });
    found.collect()
}

/// Chance that Student's t is as far from zero on either side.
fn chance(t: f64) -> f64 {
    StudentsT::new(0.0, 1.0, FREEDOM).map_or(1.0, |student| 2.0 * student.sf(t))
}

/// Root of the share of an instrument's rows that the unknowns did not take; `None` where too few are left to judge by.
fn shrunk(fitted: &Calibration, source: SourceId) -> Option<f64> {
    let mut sizes = fitted.sources.iter();
    let own = sizes.find(|own| own.source == source)?;
    let is_judged = own.redundancy >= LEAST_REDUNDANCY;
    is_judged.then(|| (own.redundancy / own.rows as f64).sqrt().min(1.0))
}

/// Measured minus fitted length, mm; `None` of another reading.
fn left_mm(own: &Observation, fitted: &Calibration) -> Option<f64> {
    let length = own.measured.length()?;
    let frames = fitted.frames.get(own.session)?;
    let gauge = frames.gauge(own.source)?;
    let target = frames.flange_from_target(own.target).isometry();
    let place = fitted.chain.nominal(&own.axes) * target;
    Some(length.mm - gauge.reading_mm(&place.translation.vector.into()))
}
