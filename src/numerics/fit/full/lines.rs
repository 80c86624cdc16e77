//! Gear lines: weak sines at fixed cycles per turn, found by a periodogram of each joint on leave-one-out residuals.
//!
//! The power at a frequency is the gain in log likelihood of a sine and a cosine on the raw joint angle, seen through
//! the joint's column, with the leave-one-out covariances as weights (a generalised Lomb–Scargle periodogram).

use crate::units::whole;
use std::array::from_fn;

use nalgebra::{DMatrix, DVector, DVectorView};
use rayon::prelude::*;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundLine {
    pub joint: usize,
    pub cycles: f64,
    /// Gain in log likelihood, nats.
    pub gain: f64,
}

/// The evidence of one station on one joint's error: `J·K·J` and `J·K·r` with the leave-one-out residual r and information K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointEvidence {
    pub angle: f64,
    /// `Jᵀ K J`, rad⁻².
    pub information: f64,
    /// `Jᵀ K r`, rad⁻¹.
    pub pull: f64,
}

/// Frequencies searched, cycles per turn: above those of the curves, up to the ratios of harmonic drives.
const LOWEST: f64 = 12.0;
const HIGHEST: f64 = 520.0;
const STEP: f64 = 0.25;
/// Lines of one joint nearer than this in one round are side lobes of each other.
const SIDE_LOBES: f64 = 5.0;
/// A line nearer than this to a known one is the same line, cycles per turn.
const SAME: f64 = 0.6;

pub fn evidence(
    column: &DVectorView<'_, f64>,
    residual: &DVector<f64>,
    information: &DMatrix<f64>,
    angle: f64,
) -> JointEvidence {
    let weighted = information * column;
    JointEvidence { angle, information: weighted.dot(column), pull: weighted.dot(residual) }
}

/// Up to `most` new lines of one joint above `threshold`, strongest first, in addition to those already `known`.
pub fn find(
    joint: usize,
    stations: &[JointEvidence],
    known: &[f64],
    threshold: f64,
    most: usize,
) -> Vec<FoundLine> {
    let power = periodogram(stations);
    let mut order: Vec<usize> = (0..power.len()).filter(|&i| power[i] >= threshold).collect();
    order.sort_by(|&a, &b| power[b].total_cmp(&power[a]));
    let mut found: Vec<FoundLine> = Vec::new();
    for index in order {
        let cycles = frequency(index);
        let side_lobe = found.iter().any(|line| (line.cycles - cycles).abs() <= SIDE_LOBES);
        let repeated = known.iter().any(|known| (known - cycles).abs() <= SAME);
        if found.len() < most && !side_lobe && !repeated {
            found.push(FoundLine { joint, cycles, gain: power[index] });
        }
    }
    found
}

fn frequency(index: usize) -> f64 {
    STEP.mul_add(index as f64, LOWEST)
}

/// Frequencies in a row whose phases follow from each other.
const BAND: usize = 128;
const LANES: usize = 4;

fn periodogram(stations: &[JointEvidence]) -> Vec<f64> {
    let count = whole((HIGHEST - LOWEST) / STEP);
    let firsts: Vec<usize> = (0..count).step_by(LANES * BAND).collect();
    let bands = firsts.par_iter().flat_map_iter(|&first| {
        powers(stations, from_fn(|lane| first + lane * BAND)).into_iter().flatten()
    });
    let mut powers: Vec<f64> = bands.collect();
    powers.truncate(count);
    powers
}

struct Phases {
    sin: [f64; LANES],
    cos: [f64; LANES],
    step: (f64, f64),
}

impl Phases {
    fn at(angle: f64, bands: [usize; LANES]) -> Self {
        let phases = bands.map(|first| (frequency(first) * angle).sin_cos());
        Self {
            sin: phases.map(|(sin, _)| sin),
            cos: phases.map(|(_, cos)| cos),
            step: (STEP * angle).sin_cos(),
        }
    }

    /// Phases advance by a fixed turn per frequency: one complex product instead of a sine.
    fn advance(&mut self) {
        let (step_sin, step_cos) = self.step;
        for lane in 0..LANES {
            let (sin, cos) = (self.sin[lane], self.cos[lane]);
            self.sin[lane] = sin * step_cos + cos * step_sin;
            self.cos[lane] = cos * step_cos - sin * step_sin;
        }
    }
}

fn powers(stations: &[JointEvidence], bands: [usize; LANES]) -> [Vec<f64>; LANES] {
    let mut phases: Vec<Phases> =
        stations.iter().map(|station| Phases::at(station.angle, bands)).collect();
    let mut powers = from_fn(|_| Vec::with_capacity(BAND));
    for _ in 0..BAND {
        powers.iter_mut().zip(gains(stations, &phases)).for_each(|(own, gain)| own.push(gain));
        phases.iter_mut().for_each(Phases::advance);
    }
    powers
}

/// `½ bᵀ A⁻¹ b` of the two-column regression on sine and cosine, in each band.
fn gains(stations: &[JointEvidence], phases: &[Phases]) -> [f64; LANES] {
    let [mut cc, mut ss, mut cs, mut bc, mut bs] = [[0.0; LANES]; 5];
    for (station, Phases { sin, cos, .. }) in stations.iter().zip(phases) {
        for lane in 0..LANES {
            let (sin, cos) = (sin[lane], cos[lane]);
            cc[lane] += cos * cos * station.information;
            ss[lane] += sin * sin * station.information;
            cs[lane] += sin * cos * station.information;
            bc[lane] += cos * station.pull;
            bs[lane] += sin * station.pull;
        }
    }
    from_fn(|lane| {
        let ([cc, ss, cs], [bc, bs]) = ([cc[lane], ss[lane], cs[lane]], [bc[lane], bs[lane]]);
        let determinant = (cc * ss - cs * cs).max(1e-9 * cc * ss);
        if determinant > 0.0 {
            0.5 * (bc * bc * ss - 2.0 * bc * bs * cs + bs * bs * cc) / determinant
        } else {
            0.0
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_at_its_frequency_and_only_there() {
        // 300 angles over a third of a turn, noise-free 20 µrad at 127.5 cycles, 10 µrad of noise assumed.
        let station = |i: u32| {
            let angle = 2.0 * (f64::from(i) * 0.754_877_666).fract();
            let error = 20e-6 * (127.5 * angle + 0.3).cos();
            JointEvidence { angle, information: 1e10, pull: 1e10 * error }
        };
        let stations: Vec<_> = (0..300).map(station).collect();
        let found = find(0, &stations, &[], 8.0, 3);
        assert!((found[0].cycles - 127.5).abs() < 0.26, "{found:?}");
        // ½ · n · A²/2 / σ² = ½ · 300 · 2e-10 / 1e-10 = 300 nats.
        assert!((found[0].gain - 300.0).abs() < 15.0, "{found:?}");
        // A line that is known already is not found again.
        let again = find(0, &stations, &[127.5], 8.0, 3);
        assert!(again.iter().all(|line| (line.cycles - 127.5).abs() > SAME), "{again:?}");
    }
}
