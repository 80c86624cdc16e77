//! The threshold, found from the number of stretches at each rung of a ladder of thresholds.

use crate::join::MIN_PAIRS;

/// Ratio of neighbouring thresholds on the ladder.
const LADDER_RATIO: f64 = 1.5;
/// Number of rungs: from the resolution of an encoder (1e-7 rad) to a million turns, and beyond the reach of a tracker.
const RUNGS: usize = 80;
/// Counts of stretches within this share of each other belong to one plateau: some tiny moves may be lost.
const PLATEAU_TOLERANCE: f64 = 0.02;
/// Least width of a good plateau, rungs (a factor of 3.4).
const PLATEAU_RUNGS: usize = 4;
/// Factor from the largest motion to the ladder's end: where samples were taken only while stationary, breaks in time alone
/// end the stretches, and that is a plateau too.
const ABOVE_ALL: f64 = 10.0;
/// Factor from the start of a wide plateau to the threshold.
const ABOVE_PLATEAU_START: f64 = 6.0;
/// Quanta below the ladder's start: a quantised value of a stationary joint flickers between neighbours, noise may add one.
const FLICKER: f64 = 2.5;

#[derive(Debug, Clone)]
pub struct Ladder(Vec<f64>);

impl Ladder {
    pub fn from(floor: f64) -> Self {
        let rungs = std::iter::successors(Some(floor), |rung| Some(rung * LADDER_RATIO));
        Self(rungs.take(RUNGS).collect())
    }

    pub(super) fn rungs(&self) -> &[f64] {
        &self.0
    }

    /// Every threshold that may be chosen, sorted.
    pub(super) fn thresholds(&self) -> Vec<f64> {
        let between = self.0.windows(2).map(|pair| (pair[0] * pair[1]).sqrt());
        let above = self.0.iter().map(|rung| rung * ABOVE_PLATEAU_START);
        let mut all: Vec<f64> = self.0.iter().copied().chain(between).chain(above).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    /// The threshold from the plateau of `count`, the number of stretches at a rung; the ladder's first rung above the
    /// flicker of `quantum` where nothing ever moves. `top` is the largest motion.
    pub fn choose(&self, quantum: f64, top: f64, count: impl Fn(usize) -> usize) -> f64 {
        let flicker = FLICKER * quantum;
        let begin = self.0.partition_point(|&rung| rung < flicker).min(self.0.len() - 1);
        let end = ABOVE_ALL * top.max(self.0[begin]);
        let ladder: Vec<f64> =
            self.0[begin..].iter().copied().take_while(|&rung| rung < end).collect();
        let counts: Vec<usize> = (0..ladder.len()).map(|rung| count(begin + rung)).collect();
        chosen_plateau(&counts).map_or(self.0[begin], |(first, last)| {
            let (low, high) = (usize::midpoint(first, last), (first + last).div_ceil(2));
            let middle =
                if low == high { ladder[low] } else { (ladder[low] * ladder[high]).sqrt() };
            // Where the steps of the values hide the noise, six times as much would be the slow ends of motions.
            let is_hidden = first == 0 && quantum > 0.0;
            middle.min(ladder[first] * if is_hidden { 1.0 } else { ABOVE_PLATEAU_START })
        })
    }
}

/// First and last rung of the plateau to use: the lowest of those at least [`PLATEAU_RUNGS`] wide that have the
/// dwells of a session and at least half of those of the widest; otherwise the widest. Turning points of moves make plateaus of
/// their own above the right one, columns frozen for a while below it.
fn chosen_plateau(counts: &[usize]) -> Option<(usize, usize)> {
    let plateaus = (0..counts.len()).filter(|&first| counts[first] >= 2);
    let plateaus = plateaus.map(|first| (first, plateau_end(counts, first)));
    let plateaus: Vec<(usize, usize)> = plateaus.collect();
    let width = |&(first, last): &(usize, usize)| last - first;
    // `max_by_key` would take the last of equals; the lowest is the stricter one.
    let widest = plateaus.iter().rev().max_by_key(|plateau| width(plateau))?;
    let enough = (counts[widest.0] / 2).max(MIN_PAIRS);
    let good = |plateau: &&(usize, usize)| {
        width(plateau) + 1 >= PLATEAU_RUNGS && counts[plateau.0] >= enough
    };
    Some(*plateaus.iter().find(good).unwrap_or(widest))
}

/// The last rung from `first` on with similar counts.
fn plateau_end(counts: &[usize], first: usize) -> usize {
    let allowed = (counts[first] as f64 * PLATEAU_TOLERANCE).max(1.0);
    let alike = |&&count: &&usize| count >= 2 && (count.abs_diff(counts[first]) as f64) <= allowed;
    first + counts[first..].iter().take_while(alike).count() - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_threshold_that_is_chosen_is_among_those_followed() {
        let ladder = Ladder::from(1e-3);
        let thresholds = ladder.thresholds();
        assert!(thresholds.is_sorted());
        for first in 0..60 {
            for last in first..70 {
                // Twenty stretches on a plateau, none elsewhere.
                let count = |rung: usize| {
                    if (first..=last).contains(&rung) { 20 } else { 0 }
                };
                let chosen = ladder.choose(0.0, f64::MAX / 100.0, count);
                assert!(thresholds.contains(&chosen), "{first} {last}");
                assert!(chosen >= ladder.0[first] && chosen <= ladder.0[last]);
            }
        }
    }

    #[test]
    fn the_ladder_begins_above_the_flicker() {
        let ladder = Ladder::from(1e-3);
        // Everywhere six stretches: the plateau begins where the ladder does, at the rung above 2.5 quanta of 0.01.
        let chosen = ladder.choose(0.01, 1.0, |_| 6);
        assert!((0.025..0.025 * 1.5 + 1e-9).contains(&chosen), "{chosen}");
    }
}
