//! Whether an instrument's length unit agrees with the arm's lengths: each session's scale against nominal lengths.
//!
//! Measured positions that are all too long by one share have the same effect as links that are too long by it: with a weak
//! prior on lengths no residual remains, and every held-out station is predicted to the micrometre in the wrong unit. The
//! evidence is that an arm's links are not all wrong by one share, nor by more than their tolerance. Steps:
//! 1. the stations' evidence on lengths (`a`, `d`) and on each session's scale, without priors ([`ScaleEvidence`]);
//! 2. lengths right within a stated standard deviation (or the length errors found beside the scale, if larger), scales
//!    free: the scale of each session and its standard deviation;
//! 3. a scale beyond [`SIGMAS`] of them is named. The least scale that would have been named is published beside it.
//!
//! Nominal lengths cannot distinguish a wrong scale from a warm arm, whose links are all longer by one share too
//! ([`EXPANSION_PPM_PER_K`]); known distances can.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::problem::Problem;
use crate::figures::expanded;
use crate::kinematics::{LinkQuantity, Parameter};

/// A scale beyond this number of its standard deviations is named.
pub const SIGMAS: f64 = 3.0;
/// Thermal expansion of the materials of arms, from cast iron to aluminium, ppm per kelvin.
pub const EXPANSION_PPM_PER_K: [f64; 2] = [11.0, 24.0];
/// Standard deviation of a scale that only the lengths constrain: 1 %.
const FREE: f64 = 1e-2;
pub(super) const PPM: f64 = 1e6;

/// The stations' evidence on an arm's lengths and each session's scale, without a prior on either; all else integrated out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScaleEvidence {
    /// Number of lengths, which come before the scales.
    lengths: usize,
    /// Information on length offsets, mm⁻², and scales, as shares.
    information: DMatrix<f64>,
    /// The information times the estimate from the stations alone.
    moment: DVector<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FreeScale {
    /// Scale of the instrument relative to the arm's lengths, ppm; positive when it measures too long.
    pub ppm: f64,
    /// Its standard deviation, ppm; nearly all from the lengths, whose found errors count where they exceed the tolerance.
    pub sd_ppm: f64,
    pub length_rms_mm: f64,
}

impl FreeScale {
    /// Whether the scale is larger than lengths within their tolerance explain.
    pub fn is_named(&self) -> bool {
        self.ppm.abs() > self.detectable_ppm()
    }

    pub fn detectable_ppm(&self) -> f64 {
        SIGMAS * self.sd_ppm
    }

    /// Temperature above that of the nominal lengths, K, at which an arm would have the same effect as this scale: least
    /// and largest size, by material. Negative for a colder arm.
    pub fn kelvins(&self) -> [f64; 2] {
        kelvins(self.ppm)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FittedScale {
    /// Scale relative to the arm that all sessions share, ppm; positive when the session measures longer.
    pub ppm: f64,
    pub sd_ppm: f64,
    /// Whether the evidence kept scales in the model; without them both are 0.
    pub kept: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ScaleVerdict {
    Named,
    NotNamed,
    NotShown,
}

#[derive(Debug, Clone, PartialEq)]
pub struct SessionScale {
    pub session: String,
    pub stations: usize,
    /// Names of the instruments of one length that it was measured with too: one of a wrong scale moves that of positions.
    pub lengths: Vec<String>,
    /// Standard deviation of its scale before any measurement, ppm.
    pub prior_sd_ppm: f64,
    /// The scale in the full error model; `None` where it has none.
    pub fitted: Option<FittedScale>,
    pub length_sd_mm: f64,
    /// The scale by the arm's lengths alone; `None` without a full error model, or where rounding made it indefinite.
    pub free: Option<FreeScale>,
}

impl SessionScale {
    pub fn verdict(&self) -> ScaleVerdict {
        match (self.is_named(), self.free) {
            (true, _) => ScaleVerdict::Named,
            (false, Some(_)) => ScaleVerdict::NotNamed,
            (false, None) => ScaleVerdict::NotShown,
        }
    }

    /// The reason for the verdict; `None` where none is needed.
    pub fn reason(&self) -> Option<String> {
        let not_shown = || {
            let reason = if self.fitted.is_some() {
                "the evidence of the stations on lengths and scale could not be distinguished from rounding"
            } else {
                "a full error model with scales is needed ([fit.full] enabled, session_scale_ppm above 0): geometry alone absorbs \
                 gravity and joint curves in the lengths"
            };
            self.free.is_none().then(|| reason.to_owned())
        };
        self.named().or_else(not_shown)
    }

    fn is_named(&self) -> bool {
        self.free.is_some_and(|free| free.is_named()) || self.beside_others().is_some()
    }

    /// A scale relative to the other sessions of its pool that is larger than usual between sessions.
    fn beside_others(&self) -> Option<FittedScale> {
        self.fitted.filter(|fitted| fitted.ppm.abs() > SIGMAS * self.prior_sd_ppm)
    }

    /// The statement about a named scale; `None` where none is named.
    pub fn named(&self) -> Option<String> {
        let of = |ppm: f64, sd_ppm: f64, against: &str| {
            let [least, most] = kelvins(ppm).map(f64::abs);
            let (sense, warmth) = if ppm > 0.0 { ("long", "warmer") } else { ("short", "colder") };
            let [and, or] = ["and the lengths of", "or that of"].map(|words| {
                let names = self.lengths.join(", ");
                if names.is_empty() { names } else { format!(" {words} {names}") }
            });
            format!(
                "session {}: positions are measured {:.0} ± {:.0} ppm too {sense} against {against}{and}, which is beyond {SIGMAS:.0} \
                 standard deviations: the tracker's scale{or} is wrong by that, or the arm is {least:.0} to {most:.0} K {warmth} than its \
                 lengths are stated for ({:.0} to {:.0} µm/m/K), or its lengths are; nominal lengths cannot distinguish these, a known \
                 distance measured with the same instruments can",
                self.session,
                ppm.abs(),
                expanded(sd_ppm),
                EXPANSION_PPM_PER_K[0],
                EXPANSION_PPM_PER_K[1],
            )
        };
        let lengths = format!("nominal lengths that are right within {} mm", self.length_sd_mm);
        let free = self.free.filter(FreeScale::is_named);
        free.map(|free| of(free.ppm, free.sd_ppm, &lengths)).or_else(|| {
            Some(of(self.beside_others()?.ppm, self.prior_sd_ppm, "the other sessions of the pool"))
        })
    }
}

/// Temperature rise with the same effect as a scale, K, for aluminium and for cast iron.
fn kelvins(ppm: f64) -> [f64; 2] {
    // Links that are longer than nominal are measured as a positive scale.
    let [iron, aluminium] = EXPANSION_PPM_PER_K;
    [ppm / aluminium, ppm / iron]
}

impl ScaleEvidence {
    /// The evidence from the posterior of length offsets (mm, from nominal) and scales, in this order, with zero-mean priors of
    /// these precisions; `None` where rounding made the covariance indefinite.
    pub fn of(
        lengths: usize,
        covariance: &DMatrix<f64>,
        mean: &DVector<f64>,
        precisions: &DVector<f64>,
    ) -> Option<Self> {
        let mut information = inverse(covariance)?;
        let moment = &information * mean;
        for (place, precision) in precisions.iter().enumerate() {
            information[(place, place)] -= precision;
        }
        Some(Self { lengths, information, moment })
    }

    /// Each session's scale if every length is right within `length_sd_mm` (a standard deviation) and scales are free; `None`
    /// where rounding made the information indefinite.
    pub fn free_scales(&self, length_sd_mm: f64) -> Option<Vec<FreeScale>> {
        let mut information = self.information.clone();
        for place in 0..information.nrows() {
            let sd = if place < self.lengths { length_sd_mm } else { FREE };
            information[(place, place)] += sd.powi(-2);
        }
        let covariance = inverse(&information)?;
        let mean = &covariance * &self.moment;
        // Lengths that no station determines keep their prior mean and have no weight.
        let determined = |place: usize| 1.0 - covariance[(place, place)] / length_sd_mm.powi(2);
        let determined: f64 = (0..self.lengths).map(determined).sum();
        let off: f64 = (0..self.lengths).map(|place| mean[place].powi(2)).sum();
        let length_rms_mm = if determined > 0.0 { (off / determined).sqrt() } else { 0.0 };
        let wider = (length_rms_mm / length_sd_mm).max(1.0);
        let free = |place: usize| FreeScale {
            ppm: PPM * mean[place],
            sd_ppm: PPM * wider * covariance[(place, place)].sqrt(),
            length_rms_mm,
        };
        let scales: Vec<FreeScale> = (self.lengths..mean.len()).map(free).collect();
        scales.iter().all(|free| free.ppm.is_finite() && free.sd_ppm.is_finite()).then_some(scales)
    }
}

/// Indices of the arm's lengths among a problem's unknowns.
pub(super) fn lengths(problem: &Problem<'_>) -> Vec<usize> {
    let is_length = |parameter: Parameter| {
        matches!(parameter, Parameter::Link { quantity: LinkQuantity::A | LinkQuantity::D, .. })
    };
    let unknowns = problem.unknowns.iter().enumerate();
    unknowns.filter(|(_, unknown)| is_length(unknown.parameter)).map(|(place, _)| place).collect()
}

/// The inverse of a positive definite matrix, computed with rows and columns scaled to a diagonal of ones.
fn inverse(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scales = matrix.diagonal().map(|d| d.sqrt().recip());
    let scale = |matrix: DMatrix<f64>| {
        let size = scales.len();
        DMatrix::from_fn(size, size, |i, j| matrix[(i, j)] * scales[i] * scales[j])
    };
    Some(scale(scale(matrix.clone()).cholesky()?.inverse()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Stations that determine only each length plus its share of the scale: `x_i + L_i s` to a micrometre.
    fn evidence(lengths_mm: &[f64], found_mm: &[f64]) -> ScaleEvidence {
        let n = lengths_mm.len();
        let rows = DMatrix::from_fn(n, n + 1, |i, j| {
            if j == n { 1e3 * lengths_mm[i] } else { 1e3 * f64::from(i == j) }
        });
        let values = DVector::from_fn(n, |i, _| 1e3 * found_mm[i]);
        ScaleEvidence { lengths: n, information: rows.tr_mul(&rows), moment: rows.tr_mul(&values) }
    }

    #[test]
    fn lengths_that_are_wrong_by_one_share_are_a_scale() {
        // KR 210: sd 0.3/√(350² + 1150² + 41² + 1200²) = 176.6 ppm. All links too long by 0.1 %.
        let lengths = [350.0, 1150.0, 41.0, 1200.0];
        let found = evidence(&lengths, &lengths.map(|l| 1e-3 * l));
        let free = found.free_scales(0.3).expect("positive definite")[0];
        assert!((free.sd_ppm - 176.6).abs() < 0.1, "{free:?}");
        assert!((free.ppm - 1000.0).abs() < 1.0 && free.is_named());
        // 1000 ppm are 42 to 91 K.
        let [least, most] = free.kelvins();
        assert!((least - 41.7).abs() < 0.1 && (most - 90.9).abs() < 0.1);
        // One link that is too long by its tolerance is no scale.
        let free = evidence(&lengths, &[0.0, 0.3, 0.0, 0.0]).free_scales(0.3);
        assert!(!free.expect("positive definite")[0].is_named());
        // Lengths that are off by ten times their tolerance show in `length_rms_mm`, and the scale is less certain.
        let free = evidence(&lengths, &[3.0, 1.0, -3.0, 3.0]).free_scales(0.3);
        let free = free.expect("positive definite")[0];
        assert!((1.5..3.5).contains(&free.length_rms_mm), "{free:?}");
        assert!(free.sd_ppm > 800.0 && !free.is_named(), "{free:?}");
    }

    #[test]
    fn instruments_of_one_length_are_named_beside_the_tracker() {
        let named = |lengths: &[&str]| {
            let scale = SessionScale {
                session: "monday".to_owned(),
                stations: 80,
                lengths: lengths.iter().map(|&name| name.to_owned()).collect(),
                prior_sd_ppm: 50.0,
                fitted: None,
                length_sd_mm: 0.3,
                free: Some(FreeScale { ppm: -997.0, sd_ppm: 14.0, length_rms_mm: 0.2 }),
            };
            scale.named().expect("beyond three of its standard deviations")
        };
        let both = named(&["bar", "wire"]);
        assert!(both.contains("within 0.3 mm and the lengths of bar, wire, which"), "{both}");
        assert!(
            both.contains("the tracker's scale or that of bar, wire is wrong by that"),
            "{both}"
        );
        let alone = named(&[]);
        assert!(alone.contains("the tracker's scale is wrong by that"), "{alone}");
    }

    #[test]
    fn priors_in_a_posterior_are_removed() {
        let lengths = [350.0, 1150.0, 41.0, 1200.0];
        let stations = evidence(&lengths, &[0.1, -0.2, 0.3, 0.4]);
        let precisions = DVector::from_vec(vec![1.0 / 9.0, 1.0 / 9.0, 1.0 / 9.0, 1.0 / 9.0, 4e8]);
        let with_prior = &stations.information + DMatrix::from_diagonal(&precisions);
        let covariance = with_prior.try_inverse().expect("positive definite");
        let mean = &covariance * &stations.moment;
        let found = ScaleEvidence::of(4, &covariance, &mean, &precisions).expect("positive");
        let (a, b) = (found.free_scales(0.3), stations.free_scales(0.3));
        let (a, b) = (a.expect("positive")[0], b.expect("positive")[0]);
        assert!((a.ppm - b.ppm).abs() < 0.01 && (a.sd_ppm - b.sd_ppm).abs() < 0.01, "{a:?} {b:?}");
    }
}
