//! Backlash that no settling error shows: a joint stops beside where it reports, on the side that it came from.
//!
//! Where the settling error tells the side, the approach-direction offset is a part of the model. Here the side s is the direction in
//! which the joint came from the station before. Columns `B = J_j s_j` beside those of the model have the score `z = Bᵀ N⁻¹ e` and the
//! information `K = Bᵀ N⁻¹ B − Bᵀ N⁻¹ Φ C Φᵀ N⁻¹ B`, with the model's rows Φ, their covariance C and residuals e: the offsets c of the
//! joints are `N(P z, P)`, `P = (K + I/τ²)⁻¹`, and τ is found by `MacKay`'s fixed point. From which side a target is approached is not
//! known: where the evidence rises, a prediction has the variance `E c² (1 + s̄²)` as well, s̄ the mean side of the stations, whose offset
//! the model has as the joint's own.

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::regression::Posterior;
use super::rows::{Around, stations};
use super::whitening::whitened;
use crate::fit::commanded::SettlingError;
use crate::fit::model::PartEvidence;
use crate::fit::observation::Observation;
use crate::units::per_radian;

/// A joint that moves less than this keeps its side, rad; mm where it slides.
const LEAST_MOVE: f64 = 1e-4;
/// Least gain in log evidence of the sides, nats.
const GAIN: f64 = 5.0;
/// Agreement with the settling errors from which on those tell the side.
const AGREE: f64 = 0.5;
/// Expected offset, rad.
const EXPECTED_RAD: f64 = 30e-6;
const STEPS: usize = 100;

/// The offset of each joint on the side of its approach.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sides {
    /// True minus reported axis variables where the joints came in the positive direction, rad; mm where they slide.
    offsets: Vec<f64>,
    /// Variance of true minus reported axis variables over both sides, rad²; mm² where they slide.
    pub(super) variances: Vec<f64>,
    gain: f64,
}

impl Sides {
    /// The offsets that the stations of a model show; `None` where the evidence is not for any.
    pub(super) fn of(
        around: &Around<'_>,
        prior_mean: &DVector<f64>,
        posterior: &Posterior,
    ) -> Option<Self> {
        let observations = around.problem.observations;
        let stations = stations(observations).into_iter();
        let firsts: Vec<_> = stations.map(|own| &observations[own.start]).collect();
        let came = firsts.iter().map(|own| (own.session, &own.axes[..]));
        let mut sides: Vec<_> = sides(came).collect();
        if agreement(&firsts, &sides) > AGREE {
            return None;
        }
        let slides = around.problem.slides();
        let units: Vec<f64> =
            sides.first()?.iter().zip(slides).map(|(_, own)| per_radian(own)).collect();
        for side in &mut sides {
            side.iter_mut().zip(&units).for_each(|(side, unit)| *side *= unit);
        }
        let (information, score) = score(&sides, around, prior_mean, posterior);
        let (offsets, covariance, gain) = estimated(&information, &score)?;
        let mean_side =
            |joint: usize| sides.iter().map(|own| own[joint]).sum::<f64>() / sides.len() as f64;
        let variance = |joint: usize| {
            let square = offsets[joint].powi(2) + covariance[(joint, joint)];
            square * (units[joint].powi(2) + mean_side(joint).powi(2))
        };
        (gain > GAIN).then(|| Self {
            offsets: offsets.iter().zip(&units).map(|(own, unit)| own * unit).collect(),
            variances: (0..offsets.len()).map(variance).collect(),
            gain,
        })
    }

    /// True minus reported axis variables on these sides, each 1, −1, or 0 in the middle.
    pub fn on(&self, sides: &[f64]) -> Vec<f64> {
        sides.iter().zip(&self.offsets).map(|(side, offset)| side * offset).collect()
    }

    pub(super) const fn evidence(&self) -> PartEvidence {
        PartEvidence { name: "backlash", gain: self.gain, kept: true }
    }
}

/// Share of joints at stations where the settling error has the sign of the side, or always the other, less the share of the others.
fn agreement(stations: &[&Observation], sides: &[Vec<f64>]) -> f64 {
    let (mut agree, mut all) = (0.0, 0.0);
    for (own, sides) in stations.iter().zip(sides) {
        let settling_errors = own.settling_error.as_ref().and_then(SettlingError::sent);
        for (side, settling_error) in sides.iter().zip(settling_errors.unwrap_or_default()) {
            agree += side * settling_error.signum();
            all += side.abs();
        }
    }
    if all > 0.0 { f64::abs(agree) / all } else { 0.0 }
}

/// `K` and `z` of the columns of the sides, each in the unit of its axis variable.
fn score(
    sides: &[Vec<f64>],
    around: &Around<'_>,
    prior_mean: &DVector<f64>,
    posterior: &Posterior,
) -> (DMatrix<f64>, DVector<f64>) {
    let mean = posterior.mean();
    let joints = sides.first().map_or(0, Vec::len);
    let mut along = DMatrix::zeros(mean.len(), joints);
    let (mut information, mut score) = (DMatrix::zeros(joints, joints), DVector::zeros(joints));
    for (session, places) in around.batches() {
        let rows = around.rows(&places);
        let whitened = whitened(around, session, &places, &rows, prior_mean);
        for ((row, own), place) in rows.iter().zip(&whitened).zip(places) {
            let moved =
                &own.joints * DMatrix::from_diagonal(&DVector::from_column_slice(&sides[place]));
            let mut transposed = DMatrix::zeros(mean.len(), own.values.len());
            own.spread(row, around.seen(session), &mut transposed.as_view_mut());
            score += moved.tr_mul(&(&own.values - transposed.tr_mul(&mean)));
            along += transposed * &moved;
            information += moved.tr_mul(&moved);
        }
    }
    let half = posterior.half(&along.transpose());
    (information - half.tr_mul(&half), score)
}

/// The direction in which each joint came to each station from that before, by session and axes: 1, −1, or 0 until it moved.
pub fn sides<'o>(
    stations: impl Iterator<Item = (usize, &'o [f64])>,
) -> impl Iterator<Item = Vec<f64>> {
    let mut before: Option<(usize, &[f64])> = None;
    let mut sides = Vec::new();
    stations.map(move |(session, axes)| {
        match before.replace((session, axes)).filter(|(before, _)| *before == session) {
            Some((_, before)) => {
                for (side, (now, before)) in sides.iter_mut().zip(axes.iter().zip(before)) {
                    if (now - before).abs() > LEAST_MOVE {
                        *side = (now - before).signum();
                    }
                }
            }
            None => sides = vec![0.0; axes.len()],
        }
        sides.clone()
    })
}

/// Mean and covariance of the offsets, rad and rad², and what they gain in log evidence, nats.
fn estimated(
    information: &DMatrix<f64>,
    score: &DVector<f64>,
) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
    let joints = score.len();
    let identity = DMatrix::<f64>::identity(joints, joints);
    let posterior = |size: f64| {
        let factor = (information + &identity / size).cholesky()?;
        let mean = factor.solve(score);
        let gain = 0.5 * (mean.dot(score) - factor.ln_determinant() - joints as f64 * size.ln());
        Some((mean, factor.inverse(), gain))
    };
    let mut size = EXPECTED_RAD.powi(2);
    for _ in 0..STEPS {
        let (mean, covariance, _) = posterior(size)?;
        size = (mean.norm_squared() + covariance.trace()) / joints as f64;
    }
    posterior(size)
}
