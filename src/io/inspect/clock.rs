//! One clock of one channel: span, gaps, steps back; summarised block by block.

/// One clock's times on one channel, ns.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ClockSummary {
    pub count: u64,
    pub first: i64,
    pub last: i64,
    pub backward: u64,
    /// Largest step back, ns.
    pub largest_step_back: i64,
    pub duplicate: u64,
    /// Largest step forward, ns.
    pub largest_gap: i64,
    /// Time at which the largest step forward began.
    pub gap_start: i64,
    begin: i64,
    end: i64,
}

impl ClockSummary {
    pub fn add(&mut self, time: i64) {
        let one =
            Self { count: 1, first: time, last: time, begin: time, end: time, ..Self::default() };
        self.append(&one);
    }

    pub fn append(&mut self, later: &Self) {
        if self.count == 0 || later.count == 0 {
            if self.count == 0 {
                *self = *later;
            }
            return;
        }
        let step = later.begin.saturating_sub(self.end);
        self.backward += u64::from(step < 0) + later.backward;
        self.duplicate += u64::from(step == 0) + later.duplicate;
        self.largest_step_back =
            self.largest_step_back.max(later.largest_step_back).max(step.saturating_neg());
        for (gap, start) in [(step, self.end), (later.largest_gap, later.gap_start)] {
            if gap > self.largest_gap {
                (self.largest_gap, self.gap_start) = (gap, start);
            }
        }
        self.first = self.first.min(later.first);
        self.last = self.last.max(later.last);
        self.end = later.end;
        self.count += later.count;
    }

    /// The span from the earliest to the latest time, s.
    pub fn span_s(&self) -> f64 {
        self.last.saturating_sub(self.first) as f64 * 1e-9
    }

    /// Times per second; `None` with fewer than two distinct times.
    pub fn rate_hz(&self) -> Option<f64> {
        let span = self.span_s();
        (span > 0.0).then(|| (self.count - 1) as f64 / span)
    }
}

/// The smallest and the largest of some differences of two clocks, ns; `None` without any.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Differences(pub Option<(i64, i64)>);

impl Differences {
    pub fn add(&mut self, difference: i64) {
        self.append(Self(Some((difference, difference))));
    }

    pub fn append(&mut self, others: Self) {
        self.0 = match (self.0, others.0) {
            (Some((a, b)), Some((c, d))) => Some((a.min(c), b.max(d))),
            (one, other) => one.or(other),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_put_together_are_as_one() {
        let times = [10, 20, 20, 15, 60, 61, 5];
        let of = |times: &[i64]| {
            let mut clock = ClockSummary::default();
            for &time in times {
                clock.add(time);
            }
            clock
        };
        let whole = of(&times);
        assert_eq!((whole.count, whole.first, whole.last), (7, 5, 61));
        // 20 → 15 and 61 → 5; 20 twice; 15 → 60.
        assert_eq!((whole.backward, whole.largest_step_back, whole.duplicate), (2, 56, 1));
        assert_eq!((whole.largest_gap, whole.gap_start), (45, 15));
        for cut in 0..=times.len() {
            let mut parts = of(&times[..cut]);
            parts.append(&of(&times[cut..]));
            assert_eq!(parts, whole, "cut at {cut}");
        }
    }
}
