//! Readings that would make a fit worse: each check fits the sessions robustly and names what the fit contradicts, with the reason
//! ([`super::mislabelled`], [`super::flips`], [`super::wrong_lengths`]).

use super::mislabelled::SwappedThroughout;
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
