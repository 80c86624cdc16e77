//! Samples of one topic in order of time → whether one publisher states them.
//!
//! Two publishers show in one of four ways: stamps that are there twice with other contents; messages that repeat the one before them a
//! little later; contents that leave those of the messages around them by far and come back; contents that leave them by little, and
//! always by turns or always soon behind the message before.

use crate::units::NS_PER_S;

/// Number and share of the samples that show a second publisher.
const LEAST: u64 = 20;
const SHARE: f64 = 0.03;
/// Share of the changes of content before which a copy of the old one came.
const COPIED: f64 = 0.5;
/// A copy comes after less than this part of the time to the next message.
const SOON: f64 = 0.4;
/// Share of the samples with equal stamps that the next one goes back from, and of the way that it goes back at least.
const HALF: f64 = 0.5;
/// A content that left and came back differs after this part of the way at most.
const BACK: f64 = 0.02;
/// Part of a jump that a content leaves by at least: a joint at rest may be reported by turns on both sides of a step of its encoder.
const BEYOND_STEPS: f64 = 0.01;
/// Share of the contents that left and came back which did so by turns or soon: where an encoder flickers it is half of them at most.
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
    /// Contents that were one of both in every conflict so far; `None` before the first.
    constant: Option<Vec<Vec<f64>>>,
}

impl Publishers {
    /// Takes samples in order of time with their content; one further than `jump` from those around it is another publisher's.
    pub fn push<'b>(&mut self, stamps: &[i64], content: impl Fn(usize) -> &'b [f64], jump: f64) {
        self.samples += stamps.len() as u64;
        for row in 1..stamps.len().saturating_sub(1) {
            let [before, own, next] = [row - 1, row, row + 1].map(&content);
            let [soon, later] =
                [row, row + 1].map(|own| stamps[own].saturating_sub(stamps[own - 1]));
            let away = apart(before, own);
            let is_read = |of: &[f64]| jump.is_finite() || of.iter().any(|&x| x != 0.0);
            if soon == 0 && before != own && is_read(before) && is_read(own) {
                self.equal += 1;
                self.conflicts += u64::from(apart(before, next) < HALF * away);
                let both = || vec![before.to_vec(), own.to_vec()];
                let constant = self.constant.get_or_insert_with(both);
                constant.retain(|known| *known == before || *known == own);
            }
            // Poses may be stated once more when they are attained, and readings jump to another reflector.
            if !jump.is_finite() {
                continue;
            }
            self.changes += u64::from(own != next);
            if before == own && own != next && soon > 0 && (soon as f64) < SOON * later as f64 {
                self.copies += 1;
                self.copied_after_ns = soon;
            }
            if away > BEYOND_STEPS * jump && apart(before, next) < BACK * away {
                self.returns += 1;
                let is_soon = soon > 0 && (soon as f64) < SOON * later as f64;
                let is_turn = is_soon || row > 1 && apart(content(row - 2), own) < BACK * away;
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
        let to: Vec<String> = self.jumped_to.iter().map(|own| format!("{own:.4}")).collect();
        let by_turns = self.is_many(*turns) && *turns as f64 >= BY_TURNS * self.returns as f64;
        (by_turns || self.is_many(*jumps)).then(|| {
            let others = turns.max(jumps);
            format!("{others} of {samples} messages state something else than those before and after them, as {}", to.join(", "))
        })
    }
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |largest, (a, b)| largest.max((a - b).abs()))
}
