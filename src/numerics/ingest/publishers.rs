//! Samples of one topic in order of time → whether one publisher states them.
//!
//! Two publishers show in one of five ways: stamps that are there twice with other contents; messages that repeat the one before them a
//! little later; contents that leave those of the messages around them by far and come back; contents that leave them by little, and
//! always by turns or always soon behind the message before; of poses, each followed soon by one that is moved by always the same.

use crate::units::NS_PER_S;

/// Number and share of the samples that show a second publisher.
const LEAST: u64 = 20;
const SHARE: f64 = 0.01;
/// Share of the changes of content before which a copy of the old one came.
const COPIED: f64 = 0.5;
/// A copy comes after less than this part of the time to the next message.
const SOON: f64 = 0.4;
/// Share of the samples with equal stamps that the next one goes back from, and of the way that it goes back at least.
const HALF: f64 = 0.5;
/// A content that left and came back differs after this part of the way at most: of joints, which are reported in steps, and of readings,
/// which are noisy.
const BACK: f64 = 0.02;
const BACK_OF_READINGS: f64 = 0.5;
/// Readings by turns come within this time of each other: two points that an arm goes to by turns may be read once each.
const TOGETHER_NS: i64 = 250_000_000;
/// Part of a jump that a content leaves by at least: a joint at rest may be reported by turns on both sides of a step of its encoder.
const BEYOND_STEPS: f64 = 0.01;
/// Share of the contents that left and came back which did so by turns or soon: where an encoder flickers it is three quarters of them at
/// most, of noise a seventh.
const BY_TURNS: f64 = 0.9;

#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Publishers {
    samples: u64,
    /// Samples with the stamp of the one before and another content, and those that the next one goes back from: the others may have
    /// coarse stamps.
    equal: u64,
    conflicts: u64,
    changes: u64,
    copies: u64,
    copied_after_ns: i64,
    jumps: u64,
    jumped_to: Vec<f64>,
    /// Samples that the next one goes back from, and those of them that the one before went back from too or that come soon behind it.
    returns: u64,
    turns: u64,
    /// The first difference of a pose from one soon before it, and the samples with the same.
    moved: Option<Vec<f64>>,
    beside: u64,
    /// Contents that were one of both in every conflict so far; `None` before the first.
    constant: Option<Vec<Vec<f64>>>,
}

impl Publishers {
    /// Takes samples in order of time with their content: angles or temperatures, of which one further than `jump` from those around it is
    /// another publisher's, or readings, which jump without bound from reflector to reflector.
    pub fn push<'b>(&mut self, stamps: &[i64], content: impl Fn(usize) -> &'b [f64], jump: f64) {
        let bounded = jump.is_finite();
        let (least, back) =
            if bounded { (BEYOND_STEPS * jump, BACK) } else { (0.0, BACK_OF_READINGS) };
        self.samples += stamps.len() as u64;
        for row in 1..stamps.len().saturating_sub(1) {
            let [before, own, next] = [row - 1, row, row + 1].map(&content);
            let [soon, later] =
                [row, row + 1].map(|own| stamps[own].saturating_sub(stamps[own - 1]));
            let away = apart(before, own);
            let is_lost = |of: &[f64]| !bounded && of.iter().all(|&x| x == 0.0);
            let is_read = !is_lost(before) && !is_lost(own);
            if soon == 0 && before != own && is_read {
                self.equal += 1;
                self.conflicts += u64::from(apart(before, next) < HALF * away);
                let both = || vec![before.to_vec(), own.to_vec()];
                let constant = self.constant.get_or_insert_with(both);
                constant.retain(|known| *known == before || *known == own);
            }
            let follows = (soon as f64) < SOON * later as f64;
            if !bounded && follows && before != own && is_read {
                let by = || own.iter().zip(before).map(|(own, before)| own - before);
                let first = self.moved.get_or_insert_with(|| by().collect());
                let off = first.iter().zip(by()).map(|(first, by)| (first - by).abs());
                self.beside += u64::from(off.fold(0.0, f64::max) < BACK * away);
            }
            // Poses may be stated once more when they are attained.
            let is_soon = bounded && soon > 0 && follows;
            self.changes += u64::from(own != next);
            if before == own && own != next && is_soon {
                self.copies += 1;
                self.copied_after_ns = soon;
            }
            let is_return = away > least && apart(before, next) < back * away;
            if is_return && is_read && (bounded || soon < TOGETHER_NS) {
                self.returns += 1;
                let is_turn = is_soon || row > 1 && apart(content(row - 2), own) < back * away;
                self.turns += u64::from(is_turn);
                self.jumps += u64::from(away > jump);
                if is_turn || away > jump {
                    self.jumped_to = own.to_vec();
                }
            }
        }
    }

    fn is_many(&self, count: u64) -> bool {
        count >= LEAST && count as f64 >= SHARE * self.samples as f64
    }

    fn is_conflict(&self) -> bool {
        self.is_many(self.conflicts) && self.conflicts as f64 >= HALF * self.equal as f64
    }

    /// The content that one of two publishers always states, where that alone distinguishes them.
    pub fn silent(&self) -> Option<&Vec<f64>> {
        match self.constant.as_deref()? {
            [only] if self.is_conflict() => Some(only),
            _ => None,
        }
    }

    /// What distinguishes two publishers; `None` of one.
    pub fn words(&self) -> Option<String> {
        let Self { conflicts, copies, jumps, turns, samples, .. } = self;
        if self.is_conflict() {
            return Some(format!(
                "{conflicts} of {samples} messages have the stamp of another one and state something else"
            ));
        }
        if self.is_many(*copies) && *copies as f64 >= COPIED * self.changes as f64 {
            let after_ms = 1e3 * self.copied_after_ns as f64 / NS_PER_S;
            return Some(format!(
                "{copies} of {samples} messages repeat the one before them {after_ms:.1} ms later"
            ));
        }
        if self.is_many(self.beside) && 2.0 * self.beside as f64 >= BY_TURNS * *samples as f64 {
            let by = self.moved.iter().flatten().map(|own| format!("{own:.4}"));
            let by = by.collect::<Vec<String>>().join(", ");
            return Some(format!(
                "half of the {samples} messages state the one before them moved by {by}"
            ));
        }
        let to: Vec<String> = self.jumped_to.iter().map(|own| format!("{own:.4}")).collect();
        let by_turns = self.is_many(*turns) && *turns as f64 >= BY_TURNS * self.returns as f64;
        (by_turns || self.is_many(*jumps)).then(|| {
            let others = turns.max(jumps);
            format!("{others} of {samples} messages state something else than those before and after them, as {}", to.join(", "))
        })
    }
}

pub(super) fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// What 400 pairs of readings say, the second of each so much later and off in z; an arm that rests for 20 pairs.
    fn of_readings(later_ms: i64, every_ms: i64, off: f64) -> Option<String> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || rng.random_range(-0.01..0.01);
        let at = |k: i64, off: f64, noise: &mut dyn FnMut() -> f64| {
            [100.0 * (k / 20) as f64 + noise(), 300.0 + noise(), off + noise()]
        };
        let rows: Vec<[f64; 3]> =
            (0..400).flat_map(|k| [at(k, 0.0, &mut noise), at(k, off, &mut noise)]).collect();
        let stamps: Vec<i64> = (0..400)
            .flat_map(|k| [every_ms * k, every_ms * k + later_ms].map(|ms| 1_000_000 * ms))
            .collect();
        let mut publishers = Publishers::default();
        publishers.push(&stamps, |row| &rows[row][..], f64::INFINITY);
        publishers.words()
    }

    #[test]
    fn readings_by_turns_are_of_two_publishers_and_noise_is_not() {
        for (later_ms, every_ms) in [(3, 100), (50, 100), (97, 100)] {
            let found = of_readings(later_ms, every_ms, 0.1);
            assert!(found.is_some_and(|what| what.contains("before and after them")));
            assert_eq!(of_readings(later_ms, every_ms, 0.0), None);
        }
        // An arm that goes to and fro between two points, each read once.
        assert_eq!(of_readings(2000, 4000, 250.0), None);
    }

    /// The words on two publishers: one states a hundred poses, 4 s apart, the other each of them `after_ns` later and moved by `by`.
    fn poses(after_ns: i64, by: impl Fn(i32) -> f64) -> Option<String> {
        let place = |k: i32| vec![(0.7 * f64::from(k)).sin(), 0.1 * f64::from(k % 7), 1.0];
        let mut all = Publishers::default();
        let (mut stamps, mut poses) = (Vec::new(), Vec::new());
        for k in 0..100 {
            let moved = place(k).iter().map(|own| own + by(k)).collect();
            let at_ns = 4_000_000_000 * i64::from(k);
            stamps.extend([at_ns, at_ns + after_ns]);
            poses.extend([place(k), moved]);
        }
        all.push(&stamps, |row| &poses[row], f64::INFINITY);
        all.words()
    }

    #[test]
    fn a_second_publisher_of_poses_beside_the_first_is_named() {
        for after_ns in [0, 3_000_000] {
            let named = poses(after_ns, |_| 0.01).expect("two publishers");
            assert!(named.contains("moved by 0.0100, 0.0100, 0.0100"), "{named}");
        }
        // Poses on the way, and those that are stated again.
        assert_eq!(poses(1_000_000_000, |k| 0.01 * f64::from(k % 5)), None);
        assert_eq!(poses(3_000_000, |_| 0.0), None);
    }
}
