//! The size of the geometry's prior, found from the offsets themselves where the stated one is too small.
//!
//! The weak prior keeps directions that the poses hardly determine from running away. It is stated as a size that the errors of
//! an arm do not reach (3 mm and 3 mrad). An arm whose errors are larger would be pulled towards its nominal self; there the size
//! follows from the offsets, lengths and angles apart, by `MacKay`'s fixed point on the marginal likelihood:
//! `v ← Σ x² / Σ (1 − C_kk/v)`. It never becomes smaller than stated.

use super::problem::Owner;
use super::{Calibration, Prior};

/// The offsets have to be larger than the prior expects by more than this factor, in variance, before the size changes: below it,
/// the stated size is as good as any.
const TOO_SMALL: f64 = 1.5;
/// The largest factor of a size, as a standard deviation: an arm beyond it is not the one of the robot file.
const LARGEST: f64 = 30.0;

impl Calibration {
    /// The prior's standard deviations of the geometry's lengths (mm) and angles (rad) in this fit; `None` without a prior.
    pub fn geometry_prior(&self) -> Option<(f64, f64)> {
        let own = |angles| self.of_arm(angles).find_map(|place| self.prior_sd[place]);
        Some((own(false)?, own(true)?))
    }

    /// Places of the arm's lengths, or of its angles.
    fn of_arm(&self, angles: bool) -> impl Iterator<Item = usize> {
        let own = self.unknowns.iter().enumerate();
        own.filter(move |(_, unknown)| {
            unknown.owner == Owner::Arm && unknown.parameter.is_angle() == angles
        })
        .map(|(place, _)| place)
    }

    /// The prior with the sizes that the offsets of this fit ask for; `None` where they are not larger than expected, or where there
    /// is none. `stated` is the prior that the settings state.
    pub(super) fn wider_prior(&self, stated: &Prior) -> Option<Prior> {
        let least = stated.geometry?;
        let now = self.geometry_prior()?;
        let sizes = (self.size(false, now.0, least.0), self.size(true, now.1, least.1));
        let is_wider = sizes.0 > now.0 || sizes.1 > now.1;
        is_wider.then(|| Prior { geometry: Some(sizes), ..stated.clone() })
    }

    /// The size of the arm's lengths or angles that the offsets ask for, at least `now`.
    fn size(&self, angles: bool, now: f64, stated: f64) -> f64 {
        let variance = now * now;
        let (mut squares, mut determined) = (0.0, 0.0);
        for place in self.of_arm(angles) {
            squares += self.solution.offsets[place].powi(2) / variance;
            determined += 1.0 - (self.covariance[(place, place)] / variance).clamp(0.0, 1.0);
        }
        let ratio = squares / determined.max(1.0);
        if ratio > TOO_SMALL { (now * ratio.sqrt()).min(stated * LARGEST) } else { now }
    }
}

#[cfg(test)]
mod tests;
