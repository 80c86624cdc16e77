//! Observation: the content of the logs → the dwells of both sides, checked.

use super::MIN_PAIRS;
use super::dwell::{ArmDwell, TargetDwell, arm_dwells, target_dwells};
use super::pattern::Dwells;
use super::readings::Readings;
use super::stationary::Stationary;
use super::{JoinError, JoinSettings, Thresholds};
use crate::ingest::TemperatureSamples;
use crate::kinematics::Arm;
use crate::units::{NS_PER_S, Stamp, Tracker};

#[derive(Debug, Clone)]
pub struct Observation {
    pub first_measured: Stamp<Tracker>,
    pub sampling_s: [f64; 2],
    pub stationary_rad: f64,
    pub stationary_mm: f64,
    pub arm: Vec<ArmDwell>,
    pub target: Vec<TargetDwell>,
}

pub(super) fn observe(
    readings: &Readings<'_>,
    arm_stationary: &Stationary,
    arm: &Arm,
    settings: &JoinSettings,
) -> Result<Observation, JoinError> {
    enough("controller", arm_stationary, "rad", "stationary_rad", settings)?;
    let arm_dwells = arm_dwells(arm_stationary, arm);
    let stationary = &readings.stationary;
    enough("tracker", stationary, "mm", "stationary_mm", settings)?;
    Ok(Observation {
        first_measured: Stamp::from_ns(stationary.span_ns.0),
        sampling_s: [arm_stationary, stationary].map(|own| own.interval_ns as f64 / NS_PER_S),
        stationary_rad: arm_stationary.threshold,
        stationary_mm: stationary.threshold,
        arm: arm_dwells,
        target: target_dwells(readings)?,
    })
}

impl Observation {
    pub fn dwells(&self) -> Dwells<'_> {
        Dwells { arm: &self.arm, target: &self.target }
    }

    pub(super) fn thresholds(&self, settle_s: f64) -> Thresholds {
        let Self { stationary_rad, stationary_mm, .. } = *self;
        Thresholds { stationary_rad, stationary_mm, settle_s }
    }
}

/// The usual standard deviation of a stationary reading per axis in these dwells, mm.
pub(super) fn usual_scatter_mm(dwells: &[TargetDwell]) -> [f64; 3] {
    std::array::from_fn(|axis| {
        let scatters = dwells.iter().map(|dwell| dwell.scatter_mm[axis]);
        super::average::median(&mut scatters.collect::<Vec<f64>>())
    })
}

/// Checks that the stretches are of this arm's joints and that their means are finite.
pub fn check_joints(stationary: &Stationary, arm: &Arm) -> Result<(), JoinError> {
    if stationary.columns != arm.joints().len() {
        return Err(JoinError::JointCount {
            model: arm.model().to_owned(),
            found: stationary.columns,
            expected: arm.joints().len(),
        });
    }
    for stretch in &stationary.stretches {
        if let Some(joint) = stretch.means.iter().position(|angle| !angle.is_finite()) {
            return Err(JoinError::AngleNotFinite {
                joint: arm.joints()[joint].name.clone(),
                sample: stretch.stretch.first,
            });
        }
    }
    Ok(())
}

pub(super) fn check_temperatures(temperatures: &TemperatureSamples) -> Result<(), JoinError> {
    let samples = "temperatures";
    let mut pairs = temperatures.stamps.windows(2);
    let before = pairs.position(|pair| pair[1] < pair[0]);
    before.map_or(Ok(()), |before| Err(JoinError::OutOfOrder { samples, row: before + 1 }))
}

/// Nothing is sampled as fast as this, ns.
const AT_ONCE_NS: i64 = 100_000;

fn enough(
    side: &'static str,
    found: &Stationary,
    unit: &'static str,
    key: &'static str,
    settings: &JoinSettings,
) -> Result<(), JoinError> {
    if found.stretches.len() >= MIN_PAIRS {
        return Ok(());
    }
    let (first_ns, last_ns) = found.span_ns;
    let advice = if found.interval_ns < AT_ONCE_NS && found.samples > MIN_PAIRS {
        "most stamps are nearly that of the message before, so they count whole seconds, or their nanoseconds something else: write \
         time = \"log\", the time of recording"
            .to_owned()
    } else {
        format!("check the topic and its unit, or set {key} in [join]")
    };
    Err(JoinError::TooFewDwells {
        side,
        found: found.stretches.len(),
        needed: MIN_PAIRS,
        samples: found.samples,
        span_s: last_ns.saturating_sub(first_ns) as f64 / NS_PER_S,
        threshold: found.threshold,
        unit,
        window_s: settings.window_s,
        advice,
    })
}
