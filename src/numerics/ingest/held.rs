//! Readings of one topic in order of time → how long each is stated again, where the instrument is slower than its stream.
//!
//! 1. Successive messages with equal readings are a run. The way from a run to the next counts for the shorter of both: where the target
//!    moves, readings of an instrument that keeps up differ from message to message, however many are equal where it rests, where they
//!    are rounded or where the beam is lost.
//! 2. Nearly all of the way lies between runs of nearly the same number of messages: so long each reading is held. Only its first message
//!    is a reading, as its stamp is the nearest to when it was read.

use std::collections::BTreeMap;

use super::publishers::apart;

/// Ways between runs that show how long readings are held.
const LEAST: u64 = 20;
/// Share of the way that lies between runs of nearly the same number of messages.
const NEARLY_ALL: f64 = 0.9;
/// Messages further apart than this are not of one motion, ns.
const APART_NS: i64 = 250_000_000;

#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Held {
    /// Number of ways, and their sum by the messages of the shorter run.
    ways: u64,
    by_messages: BTreeMap<usize, f64>,
    /// Number and sum of the intervals between messages, ns.
    intervals: (i64, i64),
}

impl Held {
    /// Takes the next readings; zeros, where nothing was read, break them off.
    pub fn push<'b>(&mut self, stamps: &[i64], content: impl Fn(usize) -> &'b [f64]) {
        let is_lost = |row: usize| content(row).iter().all(|&x| x == 0.0);
        let rows: Vec<usize> = (0..stamps.len()).collect();
        for motion in rows.chunk_by(|&a, &b| {
            stamps[b].saturating_sub(stamps[a]) < APART_NS && is_lost(a) == is_lost(b)
        }) {
            for pair in motion.windows(2) {
                self.intervals.0 += 1;
                self.intervals.1 += stamps[pair[1]] - stamps[pair[0]];
            }
            let runs: Vec<&[usize]> = motion.chunk_by(|&a, &b| content(a) == content(b)).collect();
            for pair in runs.windows(2) {
                let shorter = pair[0].len().min(pair[1].len());
                self.ways += 1;
                *self.by_messages.entry(shorter).or_default() +=
                    apart(content(pair[0][0]), content(pair[1][0]));
            }
        }
    }

    /// The time from a reading's first message within which an equal one states it again, ns; `None` where readings are not held.
    pub fn for_ns(&self) -> Option<i64> {
        let all: f64 = self.by_messages.values().sum();
        let (&usual, _) = self.by_messages.iter().max_by(|a, b| a.1.total_cmp(b.1))?;
        let near = self.by_messages.range(usual.saturating_sub(1).max(2)..=usual + 1);
        let near: f64 = near.map(|(_, way)| way).sum();
        // One message more than usual, where the clocks of instrument and publisher beat, and less than two.
        let half_intervals = i64::try_from(2 * usual + 1).unwrap_or(1);
        let (intervals, sum_ns) = self.intervals;
        (self.ways >= LEAST && near >= NEARLY_ALL * all)
            .then(|| (sum_ns / intervals.max(1)).saturating_mul(half_intervals) / 2)
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// How long readings of a target are held that moves for 1 s and rests for 2 s, 20 messages a second: `noise_mm`, rounded to
    /// `step_mm`, each stated in as many messages as `messages` tells for its number; only those that `is_logged` of the second in a
    /// cycle.
    fn held(
        noise_mm: f64,
        step_mm: f64,
        messages: impl Fn(usize) -> usize,
        is_logged: impl Fn(f64) -> bool,
    ) -> Option<i64> {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut held, mut left, mut number) = (Held::default(), 0, 0);
        let (mut stamps, mut rows, mut last) = (Vec::new(), Vec::new(), vec![0.0; 3]);
        for k in 0..6000 {
            let (cycle, second) = (k / 60, f64::from(k % 60) / 20.0);
            let share = second.min(1.0);
            let share = share * share * (3.0 - 2.0 * share);
            let place = |k: i32| [(0.7 * f64::from(k)).sin(), (1.1 * f64::from(k)).cos(), 2.0];
            if left == 0 {
                let ends = place(cycle).into_iter().zip(place(cycle + 1));
                let own = ends.map(|(from, to)| {
                    let mm = 1000.0 * (from + share * (to - from))
                        + noise_mm * rng.random_range(-1.0..1.0);
                    (mm / step_mm).round() * step_mm
                });
                (last, left) = (own.collect(), messages(number));
                number += 1;
            }
            left -= 1;
            if is_logged(second) {
                stamps.push(50_000_000 * i64::from(k));
                rows.push(last.clone());
            }
        }
        for (stamps, rows) in stamps.chunks(777).zip(rows.chunks(777)) {
            held.push(stamps, |row| &rows[row]);
        }
        held.for_ns()
    }

    #[test]
    fn readings_of_an_instrument_slower_than_its_stream_are_held() {
        let always = |_: f64| true;
        for (messages, ms) in [(2, 125), (3, 175), (4, 225), (5, 275), (10, 525)] {
            for (noise_mm, step_mm) in [(0.02, 1e-6), (0.02, 0.1), (0.0, 1e-6)] {
                assert_eq!(held(noise_mm, step_mm, |_| messages, always), Some(1_000_000 * ms));
            }
        }
        // 8 readings a second: by turns in two messages and in three. 5 a second by a clock that beats with the publisher's.
        assert_eq!(held(0.02, 1e-6, |k| 2 + k % 2, always), Some(125_000_000));
        let beats = |k: usize| [4, 4, 5, 4, 4, 3][k % 6];
        assert!(held(0.02, 1e-6, beats, always).is_some());
    }

    #[test]
    fn readings_that_are_equal_at_rest_are_not_held() {
        let (always, at_rest) = (|_: f64| true, |second: f64| second > 1.2);
        for (noise_mm, step_mm) in [(0.02, 1e-6), (0.0, 1e-6), (0.02, 0.05), (0.1, 0.1), (0.0, 0.1)]
        {
            for is_logged in [always, at_rest] {
                assert_eq!(
                    held(noise_mm, step_mm, |_| 1, is_logged),
                    None,
                    "{noise_mm}, {step_mm}"
                );
            }
        }
        // A beam that is lost now and then: the last reading stays for a second or more.
        let lost = |k: usize| if k % 97 == 50 { 20 + k % 31 } else { 1 };
        assert_eq!(held(0.02, 1e-6, lost, always), None);
    }
}
