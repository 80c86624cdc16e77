//! Joint curves as tables of value and slope, so that a prediction reads two entries instead of summing every harmonic.
//!
//! Between entries a cubic takes value and slope of both: with 90 harmonics and 4096 entries a turn it is within
//! `h⁴/384 · k⁴`, 10⁻⁶ of the last harmonic's amplitude.

use crate::units::whole;
use std::array::from_fn;
use std::f64::consts::TAU;

use nalgebra::DVector;

use super::layout::{Block, Layout};

const ENTRIES: usize = 4096;
const LANES: usize = 8;

/// The curves of all joints: those common to all sessions, and those of each session of the training.
#[derive(Debug, Clone)]
pub struct Tabulated {
    common: Vec<Curve>,
    own: Vec<Vec<Curve>>,
    /// Period of each joint's curve, rad; mm where it slides.
    periods: Vec<f64>,
}

#[derive(Debug, Clone)]
struct Curve {
    /// Value, and slope times the distance of entries, rad.
    entries: Vec<[f64; 2]>,
}

impl Tabulated {
    /// The curves of `sessions` sessions with the coefficients `mean`.
    pub fn new(layout: &Layout, mean: &DVector<f64>, sessions: usize) -> Self {
        let joint = |block| match block {
            Block::Curve(joint)
            | Block::Earlier { joint, .. }
            | Block::SessionCurve { joint, .. }
            | Block::Ageing { joint, .. } => joint + 1,
            _ => 0,
        };
        let joints = layout.blocks().map(|(block, _)| joint(block)).max();
        let mut common = vec![Curve::zero(); joints.unwrap_or(0)];
        for (block, columns) in layout.blocks() {
            if let Block::Curve(joint) = block {
                common[joint].add(&mean.as_slice()[columns]);
            }
        }
        let mut own = vec![common.clone(); sessions];
        for (session, curves) in own.iter_mut().enumerate() {
            let of_joints = curves.iter_mut().enumerate();
            of_joints
                .filter(|(joint, _)| !layout.is_now(Some(session), *joint))
                .for_each(|(_, curve)| *curve = Curve::zero());
        }
        for (block, columns) in layout.blocks() {
            let coefficients = &mean.as_slice()[columns];
            match block {
                Block::SessionCurve { session, joint } => {
                    own[session][joint].add_change(coefficients);
                }
                Block::Earlier { joint, to_come } => {
                    let curves = own.iter_mut().enumerate();
                    curves
                        .filter(|(session, _)| layout.to_come(Some(*session), joint) == to_come)
                        .for_each(|(_, curves)| curves[joint].add_change(coefficients));
                }
                Block::Ageing { joint, step } => {
                    for (session, curves) in own.iter_mut().enumerate() {
                        let share = layout.ageing(session, joint, step);
                        let aged = coefficients.iter().map(|c| share * c);
                        curves[joint].add_change(&aged.collect::<Vec<f64>>());
                    }
                }
                _ => {}
            }
        }
        Self {
            own,
            periods: (0..common.len()).map(|joint| TAU * layout.curve_unit(joint)).collect(),
            common,
        }
    }

    /// The error of each joint at `angles` (axis variables), both rad, mm where a joint slides; in one session or common to all.
    pub fn at<'t>(
        &'t self,
        session: Option<usize>,
        angles: &'t [f64],
    ) -> impl Iterator<Item = f64> + 't {
        let curves = session.map_or(&self.common, |session| &self.own[session]);
        curves
            .iter()
            .zip(angles.iter().zip(&self.periods))
            .map(|(curve, (angle, period))| curve.at(angle / period))
    }
}

impl Curve {
    fn zero() -> Self {
        Self { entries: vec![[0.0; 2]; ENTRIES] }
    }

    fn add_change(&mut self, coefficients: &[f64]) {
        if let [constant, harmonics @ ..] = coefficients {
            self.entries.iter_mut().for_each(|entry| entry[0] += constant);
            self.add(harmonics);
        }
    }

    fn add(&mut self, coefficients: &[f64]) {
        if coefficients.iter().all(|c| *c == 0.0) {
            return;
        }
        let step = TAU / ENTRIES as f64;
        for first in (0..=ENTRIES / 4).step_by(LANES) {
            let angles: [f64; LANES] = from_fn(|lane| step * (first + lane) as f64);
            let (sin, cos) = (angles.map(f64::sin), angles.map(f64::cos));
            let (mut sin_k, mut cos_k) = (sin, cos);
            let mut sums = [[[0.0; LANES]; 4]; 2];
            for (k, pair) in (1_u32..).zip(coefficients.chunks_exact(2)) {
                let step_k = step * f64::from(k);
                // The slope is a curve too.
                let pairs = [[pair[0], pair[1]], [step_k * pair[1], -step_k * pair[0]]];
                let odd = usize::from(k % 2 == 1);
                for (sums, [of_cos, of_sin]) in sums.iter_mut().zip(pairs) {
                    for lane in 0..LANES {
                        sums[odd][lane] += of_cos * cos_k[lane];
                        sums[2 + odd][lane] += of_sin * sin_k[lane];
                    }
                }
                for lane in 0..LANES {
                    let (s, c) = (sin_k[lane], cos_k[lane]);
                    sin_k[lane] = s * cos[lane] + c * sin[lane];
                    cos_k[lane] = c * cos[lane] - s * sin[lane];
                }
            }
            for place in first..(first + LANES).min(ENTRIES / 4 + 1) {
                self.add_mirrored(place, sums.map(|sums| sums.map(|sum| sum[place - first])));
            }
        }
    }

    /// Adds, at a place of the first quarter and at its three mirror images, the sums there of even and odd cosines, then of even and odd
    /// sines: half a period away the odd ones are opposite, mirrored the sines.
    fn add_mirrored(&mut self, place: usize, sums: [[f64; 4]; 2]) {
        let half = ENTRIES / 2;
        // Where the quarters meet, two of the places are one.
        let images = [
            (place, 1.0, 1.0, true),
            (half - place, -1.0, -1.0, place != half - place),
            (half + place, -1.0, 1.0, place != 0),
            (ENTRIES - place, 1.0, -1.0, place != 0 && place != half - place),
        ];
        for (image, of_odd, of_sines, is_new) in images {
            if !is_new {
                continue;
            }
            for (entry, [even, odd, even_sine, odd_sine]) in
                self.entries[image].iter_mut().zip(sums)
            {
                *entry += even + of_odd * odd + of_sines * (even_sine + of_odd * odd_sine);
            }
        }
    }

    /// The value at a share of the period, rad.
    fn at(&self, share: f64) -> f64 {
        let place = share.rem_euclid(1.0) * ENTRIES as f64;
        // A share just below zero rounds to a whole period.
        let first = whole(place) % ENTRIES;
        let t = place - place.floor();
        let ([v0, s0], [v1, s1]) = (self.entries[first], self.entries[(first + 1) % ENTRIES]);
        let (square, cube) = (t * t, t * t * t);
        v0 * (2.0 * cube - 3.0 * square + 1.0)
            + v1 * (3.0 * square - 2.0 * cube)
            + s0 * (cube - 2.0 * square + t)
            + s1 * (cube - square)
    }
}
