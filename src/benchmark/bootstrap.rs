//! Intervals of figures by drawing whole blocks of stations: neighbours share their errors, so single stations would promise too
//! much (the block bootstrap: Künsch 1989; Davison and Hinkley 1997, §8.3).
//!
//! Stations of one block of the work space ([`crate::fit::Blocks::cells`]) are drawn together, as many blocks as there are, with
//! replacement. An interval is from the percentiles of a figure over the draws. All models of a split are judged on the same draws.

use std::collections::BTreeMap;

use rand_chacha::ChaCha12Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::figures::{LEAST_BLOCKS, percentile_of};

/// `[bootstrap]` of a suite.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct BootstrapSettings {
    /// Number of draws.
    pub draws: usize,
    /// The seed: the same one gives the same intervals.
    pub seed: u64,
    /// Confidence of the intervals.
    pub confidence: f64,
}

impl Default for BootstrapSettings {
    fn default() -> Self {
        Self { draws: 2000, seed: 1, confidence: 0.95 }
    }
}

/// The stations of every draw.
#[derive(Debug, Clone)]
pub struct Draws {
    draws: Vec<Vec<usize>>,
    confidence: f64,
}

impl Draws {
    /// Draws of stations by the block of each; `None` of fewer than [`LEAST_BLOCKS`].
    pub fn new(blocks: &[usize], settings: &BootstrapSettings) -> Option<Self> {
        let members = members(blocks);
        if members.len() < LEAST_BLOCKS {
            return None;
        }
        let mut key = [0; 32];
        key[..8].copy_from_slice(&settings.seed.to_le_bytes());
        let mut generator = ChaCha12Rng::from_seed(key);
        let mut draw = || {
            let mut drawn = Vec::with_capacity(blocks.len());
            for _ in 0..members.len() {
                let block = below(generator.next_u64(), members.len());
                drawn.extend_from_slice(&members[block]);
            }
            drawn
        };
        Some(Self {
            draws: (0..settings.draws).map(|_| draw()).collect(),
            confidence: settings.confidence,
        })
    }

    /// Interval of each figure that `figures` gives of the places of drawn stations, always the same number of them.
    pub fn intervals<const N: usize>(
        &self,
        figures: impl Fn(&[usize]) -> [f64; N] + Sync,
    ) -> [[f64; 2]; N] {
        let drawn: Vec<[f64; N]> = self.draws.par_iter().map(|draw| figures(draw)).collect();
        let tail = (1.0 - self.confidence) / 2.0;
        std::array::from_fn(|figure| {
            let values: Vec<f64> = drawn.iter().map(|own| own[figure]).collect();
            [tail, 1.0 - tail].map(|share| percentile_of(&values, share).unwrap_or(f64::NAN))
        })
    }
}

/// Number of distinct blocks.
pub fn count(blocks: &[usize]) -> usize {
    members(blocks).len()
}

/// The places of the stations of each block, in the order of the blocks.
fn members(blocks: &[usize]) -> Vec<Vec<usize>> {
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (place, block) in blocks.iter().enumerate() {
        members.entry(*block).or_default().push(place);
    }
    members.into_values().collect()
}

/// A number below `count` from 64 random bits: their high bits as a share, uneven by less than 2⁻⁴⁰ for any number of blocks here.
fn below(bits: u64, count: usize) -> usize {
    let place = (u128::from(bits) * count as u128) >> 64;
    usize::try_from(place).expect("less than the count")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Means over drawn blocks of equal size have the variance of the blocks' means over the number of blocks: the closed form.
    #[test]
    fn the_spread_of_a_mean_is_that_of_the_means_of_blocks() {
        let blocks: Vec<usize> = (0..120).map(|place| place / 6).collect();
        let values: Vec<f64> = (0..120)
            .map(|place| f64::from(place / 6 * 37 % 20) + 0.01 * f64::from(place % 6))
            .collect();
        let settings = BootstrapSettings { draws: 20_000, ..BootstrapSettings::default() };
        let draws = Draws::new(&blocks, &settings).unwrap();
        let mean = |own: &[usize]| own.iter().map(|&p| values[p]).sum::<f64>() / own.len() as f64;
        let [[low, high]] = draws.intervals(|own| [mean(own)]);
        // Means of blocks are 0, 1, … 19 and 0.025: variance (20² − 1)/12, of their mean a twentieth.
        let sd = (399.0_f64 / 12.0 / 20.0).sqrt();
        let all = mean(&(0..120).collect::<Vec<_>>());
        assert!((low - (all - 1.96 * sd)).abs() < 0.06 * sd, "{low}");
        assert!((high - (all + 1.96 * sd)).abs() < 0.06 * sd, "{high}");
        // Single stations would promise far less.
        assert!(high - low > 2.0 * 1.96 * (399.0_f64 / 12.0 / 120.0).sqrt() * 2.0);
    }

    #[test]
    fn draws_follow_from_the_seed_and_few_blocks_give_none() {
        let blocks: Vec<usize> = (0..40).map(|place| place / 4).collect();
        let of = |seed| {
            let settings = BootstrapSettings { draws: 50, seed, confidence: 0.9 };
            Draws::new(&blocks, &settings).unwrap().draws
        };
        assert_eq!(of(1), of(1));
        assert_ne!(of(1), of(2));
        let few: Vec<usize> = (0..40).map(|place| place % 7).collect();
        assert!(Draws::new(&few, &BootstrapSettings::default()).is_none());
        assert_eq!((count(&blocks), count(&few)), (10, 7));
    }
}
