//! Readings that would make a fit worse: each check fits the sessions robustly and names what the fit contradicts, with the reason
//! ([`super::mislabelled`], [`super::wrong_orientations`], [`super::wrong_lengths`]).

use std::fmt;

use super::observation::{Noise, Observation};
use super::{FitSettings, SourceId, TargetId};
use crate::join::{Joined, Unmeasured};
use crate::kinematics::Arm;

/// Looks for suspects of one kind among the observations of so many sessions; finds none where they cannot be fitted.
pub type Check = fn(
    &Arm,
    &[Observation],
    usize,
    &FitSettings,
    &Noise,
) -> Result<Vec<Suspect>, SwappedThroughout>;

/// Readings of a station that are left out of all fits.
#[derive(Debug, Clone, PartialEq)]
pub struct Suspect {
    pub session: usize,
    pub station: usize,
    /// `None`: the readings of every source.
    pub source: Option<SourceId>,
    /// `None`: the readings of every target.
    pub target: Option<TargetId>,
    pub reason: String,
    /// The verdict on the station where it has no other reading.
    pub otherwise: Unmeasured,
}

impl Suspect {
    /// One reading alone.
    pub(super) fn of(own: &Observation, reason: String, otherwise: Unmeasured) -> Self {
        Self {
            session: own.session,
            station: own.station,
            source: Some(own.source),
            target: Some(own.target),
            reason,
            otherwise,
        }
    }

    /// Takes the readings out of their session.
    pub fn take_out(&self, joined: &mut Joined) {
        let is_wrong = |source, target| {
            self.source.is_none_or(|own| own == source)
                && self.target.is_none_or(|own| own == target)
        };
        joined.take_out(self.station, self.otherwise, &self.reason, |own| {
            is_wrong(own.source, own.target)
        });
    }
}

#[derive(Debug, Clone, PartialEq)]
pub struct Swap {
    /// The target that is named, and the one that was read, where the two differ.
    pub read: Vec<(TargetId, TargetId)>,
    pub given_mm: f64,
    pub swapped_mm: f64,
    /// Misfit of the next best assignment but the given one, mm; `None` where there is no other.
    pub runner_up_mm: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct SwappedThroughout {
    pub session: usize,
    pub swap: Swap,
    pub against: Against,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Against {
    Places,
    Distances,
    FirstSession,
}

impl fmt::Display for Against {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Places => "the places in [fit.targets]",
            Self::Distances => "[fit] target_distances",
            Self::FirstSession => "the places in the first session",
        })
    }
}

impl Swap {
    pub fn words(&self, name: impl Fn(TargetId) -> String) -> String {
        let read = self.read.iter();
        let read: Vec<String> = read
            .map(|(named, read)| format!("what is named {} is {}", name(*named), name(*read)))
            .collect();
        let runner_up =
            self.runner_up_mm.map_or_else(String::new, |mm| format!(", next best {mm:.2} mm"));
        format!(
            "{}: {:.2} mm as named, {:.2} mm so{runner_up}",
            read.join(", "),
            self.given_mm,
            self.swapped_mm
        )
    }
}
