//! Stamps of one topic in the order of a file, beside the recorder's times → stamps that are no times, and steps of the clock.
//!
//! 1. Successive stamps are one run while they go on as the recorder's times do, within [`SLACK_NS`]. Where a stamp goes back, or on by
//!    more than the recorder's times, another run begins.
//! 2. A run of few stamps that is away from the longest one by more than [`FAR_NS`] is no time: the header was not set, or is damaged. So
//!    are stamps behind which the run before them goes on, however often.
//! 3. A later run that is ahead by another time than the run before it begins with a step of the clock. Where the recorder's times stepped
//!    too, a step back shows in stamps that cover a time for the second time; messages that are only late cover it once.
//! 4. A run whose messages were logged before, with equal stamps and content, is a recording that stands in the file for the second time.
//!
//! The logs are then read again with these [`Amendments`], and steps are taken out of the stamps that follow them: what is left of a step
//! the join finds on the dwells ([`crate::join`]).

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;

use super::{LogReject, SpanClock};
use crate::units::{NS_PER_S, WallTime};

/// Times of recording scatter by less than this around the stamps.
const SLACK_NS: i64 = 200_000_000;
/// A stamp this far from the others, by the recorder's times, is none.
const FAR_NS: i64 = 600_000_000_000;
/// A run with no more than this share of a file's stamps may be no times; a longer one follows a step.
const FEW: f64 = 0.05;
/// More runs than this are disorder, and say nothing of the clock.
const MOST_RUNS: usize = 64;
/// More places at which a few stamps are no times are disorder too.
const MOST_STRAYS: usize = 1 << 12;
/// Latest stamps that are kept to see which of them a step back covers again.
const LATEST: usize = 1 << 16;
/// Share of a file's rows that steps which undo each other have between them at most: those are late messages.
const UNDONE: f64 = 0.05;
/// Share of a run's rows from which on it repeats earlier ones.
const REPEATED: f64 = 0.5;
/// The most rows of a file by which repeated ones are found.
const MOST_SEEN: usize = 1 << 15;
/// Rows at the start of a run that tell how far its stamps are ahead of the recorder's times.
const OPENING: u64 = 100;
/// What a message's place in the run makes its time on the way count less, ns: a clock drifts.
const LEAK_NS: i64 = 100_000;
/// Stamps on each side that show a step back that both clocks made, and one by the recorder's times.
const LEAST_ROWS: u64 = 3;
const LEAST_BY_LOG: u64 = 20;
/// The recorder's times say nothing of the stamps' clock where they go on at another rate than this much.
const RATE: f64 = 0.1;
/// Times that a step back makes the usual number of stamps in the time covered twice; late messages leave it at one.
const COVERED: f64 = 1.5;

/// A step of a clock in the middle of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ClockStep {
    pub file: String,
    pub topic: String,
    pub clock: SpanClock,
    /// The first row of the topic in the file that is stamped by the stepped clock.
    row: u64,
    /// First byte of the block with that row, and its recorder's time, ns.
    block: u64,
    logged: i64,
    /// The last stamp before the step, ns.
    pub at_ns: i64,
    /// Step of the clock, ns; positive forwards.
    pub by_ns: i64,
}

impl ClockStep {
    fn reject(&self) -> LogReject {
        let at = WallTime::of_clock_ns(self.at_ns).map_or_else(
            || format!("{:.3} s", self.at_ns as f64 / NS_PER_S),
            |at| format!("{at} UTC"),
        );
        let reason = format!(
            "the {} clock stepped by {:+.3} s behind its time {at}: later stamps are read as those of the clock before",
            self.clock.name(),
            self.by_ns as f64 / NS_PER_S
        );
        LogReject {
            file: self.file.clone(),
            topic: Some(self.topic.clone()),
            byte_start: self.block,
            byte_end: self.block,
            time_span_ns: Some((self.at_ns, self.at_ns.saturating_add(self.by_ns))),
            clock: self.clock,
            ..LogReject::of_stamps(reason)
        }
    }
}

/// What a second reading of the logs changes in the stamps.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Amendments {
    pub steps: Vec<ClockStep>,
    /// Rows whose stamps are no times: file, topic, rows of the topic in the file.
    pub no_times: Vec<(String, String, Range<u64>)>,
    /// Publishers that always state the same beside one that does not: topic and content.
    pub silent: Vec<(String, Vec<f64>)>,
    /// Topics of instruments that are slower than their stream, and the time within which an equal message states a reading again, ns.
    pub held: BTreeMap<String, i64>,
    /// Joints that are reported in (−π, π] and go beyond its ends.
    pub wrapped: Vec<usize>,
}

impl Amendments {
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    pub fn extend(&mut self, more: Self) {
        // The streams of a clock step together: the first that shows a step, joints before commands, places it.
        let known = |own: &ClockStep| {
            self.steps.iter().any(|known| {
                (known.file == own.file && known.clock == own.clock) && known.topic != own.topic
            })
        };
        let new: Vec<ClockStep> = more.steps.into_iter().filter(|own| !known(own)).collect();
        self.steps.extend(new);
        self.no_times.extend(more.no_times);
        self.silent.extend(more.silent);
        self.held.extend(more.held);
        self.wrapped.extend(more.wrapped);
    }

    /// A row of the table of rejects for each step, each publisher that says nothing and each topic whose readings are held.
    pub fn rejects(&self) -> impl Iterator<Item = LogReject> {
        let steps = self.steps.iter().map(ClockStep::reject);
        let silent = self.silent.iter().map(|(topic, content)| {
            let content: Vec<String> = content.iter().map(|own| format!("{own:.3}")).collect();
            let reason = format!(
                "a second publisher on the topic always states ({}) at the stamps of the first: its messages are left out",
                content.join(", ")
            );
            LogReject { topic: Some(topic.clone()), ..LogReject::of_stamps(reason) }
        });
        let held = self.held.iter().map(|(topic, for_ns)| {
            let reason = format!(
                "each reading is stated again in the next messages, up to {:.3} s later: the instrument is slower than its stream; \
                 only the first message of each is a reading, the others are left out",
                *for_ns as f64 / NS_PER_S
            );
            LogReject { topic: Some(topic.clone()), ..LogReject::of_stamps(reason) }
        });
        steps.chain(silent).chain(held)
    }

    /// Changes the stamps of a block's rows: `first` is its first row's number in the file. Rows without a time get `i64::MIN`.
    pub(super) fn amend(
        &self,
        (file, topic, clock): (&str, &str, SpanClock),
        (first, block): (u64, u64),
        stamps: &mut [i64],
        logged: &[i64],
    ) {
        let steps = self.steps.iter().filter(|own| own.file == file && own.clock == clock);
        for step in steps.filter(|own| block >= own.block) {
            let from = if step.topic == topic {
                usize::try_from(step.row.saturating_sub(first)).unwrap_or(usize::MAX)
            } else if block > step.block {
                0
            } else {
                // Behind the last row that was logged before the step.
                let back = (1..stamps.len()).find(|&row| logged[row] < logged[row - 1]);
                let later = || logged.iter().position(|&at| at >= step.logged);
                back.or_else(later).unwrap_or(stamps.len())
            };
            for stamp in stamps.iter_mut().skip(from) {
                *stamp = stamp.saturating_sub(step.by_ns);
            }
        }
        for (_, _, rows) in self.no_times.iter().filter(|own| own.0 == file && own.1 == topic) {
            for (row, stamp) in (first..).zip(stamps.iter_mut()) {
                if rows.contains(&row) {
                    *stamp = i64::MIN;
                }
            }
        }
    }
}

/// Stamps that go on as the recorder's times do.
#[derive(Debug, Clone, Copy)]
struct Run {
    rows: (u64, u64),
    block: u64,
    /// Recorder's times of its first and its last row, ns.
    logged: (i64, i64),
    first: i64,
    last: i64,
    /// The most by which a stamp is ahead of the recorder's time at the start and at the end of the run, which is that of the message on
    /// its way for the shortest time, ns.
    ahead: (i64, i64),
    /// Stamps of the run before it from its first one on, and its own stamps up to the last of that run.
    covered: (u64, u64),
    /// Rows that were logged before with equal stamp and content.
    repeated: u64,
}

/// A sample of rows, by hashes: those whose stamp's begins with so many zeros.
#[derive(Debug, Default)]
struct Sample {
    /// Hashes of the stamp, and of the content.
    rows: BTreeSet<(u64, u64)>,
    zeros: u32,
}

impl Sample {
    /// 2⁶⁴ over the golden ratio, odd: products of stamps in equal steps spread evenly.
    const SPREAD: u64 = 0x9e37_79b9_7f4a_7c15;

    /// For how many rows this one stands if one of equal stamp and content came before; 0 if none did, and of a row outside the sample.
    fn repeated(&mut self, stamp: i64, content: &[f64]) -> u64 {
        // Each row of a log comes here, so a stamp costs a product.
        let of_stamp = stamp.cast_unsigned().wrapping_mul(Self::SPREAD);
        if of_stamp.leading_zeros() < self.zeros {
            return 0;
        }
        let mut hasher = DefaultHasher::new();
        for own in content {
            own.to_bits().hash(&mut hasher);
        }
        if !self.rows.insert((of_stamp, hasher.finish())) {
            return 1 << self.zeros;
        }
        if self.rows.len() == MOST_SEEN {
            self.zeros += 1;
            self.rows.retain(|own| own.0.leading_zeros() >= self.zeros);
        }
        0
    }
}

/// The runs of one topic in one file.
#[derive(Debug, Default)]
pub(super) struct Runs {
    all: Vec<Run>,
    last_logged: i64,
    latest: VecDeque<i64>,
    sample: Sample,
    pub(super) rows: u64,
    /// Rows with stamps far from those before and behind them.
    strays: Vec<Range<u64>>,
    is_disordered: bool,
}

impl Runs {
    pub(super) fn push(&mut self, block: u64, stamps: &[i64], logged: &[i64]) {
        for (&stamp, &at) in stamps.iter().zip(logged) {
            if stamp != i64::MIN && !self.is_disordered {
                self.push_row(block, stamp, at);
            }
            self.rows += 1;
        }
    }

    /// Takes a row with its content; its stamp was pushed before.
    pub(super) fn see(&mut self, stamp: i64, content: &[f64]) {
        let repeated = self.sample.repeated(stamp, content);
        if repeated > 0 {
            let mut runs = self.all.iter_mut().rev();
            if let Some(run) = runs.find(|run| (run.first..=run.last).contains(&stamp)) {
                run.repeated += repeated;
            }
        }
    }

    /// Takes the last run out where it has few stamps, far from those before, and the run before it goes on with this row.
    fn take_stray_out(&mut self, stamp: i64, logged: i64) {
        let [.., before, last] = &self.all[..] else { return };
        let away = last.ahead.0.saturating_sub(before.ahead.1).saturating_abs();
        let is_clock = before.last != 0 && before.count() > last.count();
        let goes_on = before.is_followed(stamp, logged.saturating_sub(before.logged.1));
        if last.count() <= OPENING && away > FAR_NS && is_clock && goes_on {
            self.strays.push(last.rows.0..last.rows.1);
            self.last_logged = before.logged.1;
            self.all.pop();
            self.is_disordered = self.strays.len() == MOST_STRAYS;
        }
    }

    fn push_row(&mut self, block: u64, stamp: i64, logged: i64) {
        self.take_stray_out(stamp, logged);
        let before = self.all.iter().rev().nth(1).map(|run| run.last);
        let ahead = stamp.saturating_sub(logged);
        match self.all.last_mut() {
            Some(run) if run.is_followed(stamp, logged.saturating_sub(self.last_logged)) => {
                run.rows.1 = self.rows + 1;
                (run.last, run.logged.1) = (run.last.max(stamp), logged);
                if run.count() <= OPENING {
                    run.ahead.0 = run.ahead.0.max(ahead);
                }
                run.ahead.1 = run.ahead.1.saturating_sub(LEAK_NS).max(ahead);
                run.covered.1 += u64::from(before.is_some_and(|before| stamp <= before));
            }
            last => {
                let again = self.latest.iter().filter(|&&own| own >= stamp).count() as u64;
                let covered = last.map_or((0, 0), |run| (again, u64::from(stamp <= run.last)));
                let rows = (self.rows, self.rows + 1);
                self.is_disordered = self.all.len() == MOST_RUNS;
                self.latest.clear();
                let (first, last, ahead) = (stamp, stamp, (ahead, ahead));
                let logged = (logged, logged);
                self.all.push(Run {
                    rows,
                    block,
                    logged,
                    first,
                    last,
                    ahead,
                    covered,
                    repeated: 0,
                });
            }
        }
        self.last_logged = logged;
        if self.latest.len() == LATEST {
            self.latest.pop_front();
        }
        self.latest.push_back(stamp);
    }

    /// The steps and the rows without times of this file.
    pub(super) fn found(&self, file: &str, topic: &str, clock: SpanClock) -> Amendments {
        let mut found = Amendments::default();
        let longest = self.all.iter().max_by_key(|run| run.count());
        let Some(longest) = longest.filter(|_| !self.is_disordered) else { return found };
        let interval = longest.interval();
        let few = FEW * self.rows as f64;
        let is_timed = longest.is_timed();
        let is_far = |run: &&Run| {
            let away = run.ahead.0.saturating_sub(longest.ahead.0).saturating_abs();
            away > FAR_NS && run.count() as f64 <= few && (is_timed || run.last == 0)
        };
        let (far, times): (Vec<&Run>, Vec<&Run>) = self.all.iter().partition(is_far);
        let rows = far.into_iter().map(|run| run.rows.0..run.rows.1);
        let rows = rows.chain(self.strays.iter().cloned());
        found.no_times = rows.map(|rows| (file.to_owned(), topic.to_owned(), rows)).collect();
        let times: Vec<&Run> = times.into_iter().filter(|run| !run.is_repeated()).collect();
        for pair in times.windows(2) {
            if let Some(by_ns) = pair[1].step_after(pair[0], interval, is_timed) {
                found.steps.push(ClockStep {
                    file: file.to_owned(),
                    topic: topic.to_owned(),
                    clock,
                    row: pair[1].rows.0,
                    block: pair[1].block,
                    logged: pair[1].logged.0,
                    at_ns: pair[0].last,
                    by_ns,
                });
            }
        }
        for together in 2..=4 {
            let is_undone = |own: &[ClockStep]| {
                let rows = own[together - 1].row - own[0].row;
                let by = own.iter().fold(0_i64, |sum, own| sum.saturating_add(own.by_ns));
                by.saturating_abs() <= SLACK_NS && rows as f64 <= UNDONE * self.rows as f64
            };
            while let Some(place) = found.steps.windows(together).position(is_undone) {
                found.steps.drain(place..place + together);
            }
        }
        found
    }
}

impl Run {
    const fn count(&self) -> u64 {
        self.rows.1 - self.rows.0
    }

    /// Whether a stamp goes on from the last as the recorder's times do, which are `later_ns` apart; where they go back alone, theirs
    /// is the clock that was set, or will be followed by the stamps'.
    fn is_followed(&self, stamp: i64, later_ns: i64) -> bool {
        let on = stamp.saturating_sub(self.last);
        on >= -SLACK_NS && on.saturating_sub(later_ns.max(0)) <= SLACK_NS
    }

    /// Whether the recorder's times go on as the stamps do.
    fn is_timed(&self) -> bool {
        let stamps = self.last.saturating_sub(self.first) as f64;
        let logged = self.logged.1.saturating_sub(self.logged.0) as f64;
        (stamps - logged).abs() <= RATE * stamps + SLACK_NS as f64
    }

    fn is_repeated(&self) -> bool {
        self.repeated as f64 > REPEATED * self.count() as f64
    }

    fn interval(&self) -> i64 {
        let steps = i64::try_from(self.count()).unwrap_or(i64::MAX).saturating_sub(1).max(1);
        self.last.saturating_sub(self.first) / steps
    }

    /// The step of the clock between two runs, ns; `None` without one.
    fn step_after(&self, before: &Self, interval: i64, is_timed: bool) -> Option<i64> {
        let by_log = self.ahead.0.saturating_sub(before.ahead.1);
        if is_timed && by_log.saturating_abs() > SLACK_NS {
            return (self.count().min(before.count()) >= LEAST_BY_LOG).then_some(by_log);
        }
        let twice = before.last.saturating_sub(self.first.max(before.first));
        let usual = twice as f64 / interval.max(1) as f64;
        let (again, own) = self.covered;
        let covers = again.min(own) >= LEAST_ROWS && (again + own) as f64 >= COVERED * usual;
        let back = self.first.saturating_sub(before.last.saturating_add(interval));
        (twice > SLACK_NS && covers).then_some(back)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;

    /// Stamps and times of recording of 50 Hz, by the number of the message.
    fn found(of: impl Fn(i64) -> (i64, i64)) -> Amendments {
        let mut runs = Runs::default();
        for row in 0..2000 {
            let (stamp, logged) = of(row);
            runs.push(7, &[stamp], &[logged]);
        }
        runs.found("f", "/t", SpanClock::Tracker)
    }

    #[test]
    fn stamps_that_are_no_times_are_found_wherever_they_are() {
        let at = |row: i64| 1_700_000_000 * S + row * S / 50;
        let one = found(|row| (if row == 900 { 0 } else { at(row) }, at(row) + 5));
        assert_eq!((one.steps.len(), &one.no_times[0].2), (0, &(900..901)));
        let first = found(|row| (if row < 60 { 0 } else { at(row) }, at(row) + 5));
        assert_eq!((first.steps.len(), &first.no_times[0].2), (0, &(0..60)));
        // One message of ten, the first one too.
        let often = found(|row| (if row % 10 == 0 { 0 } else { at(row) }, at(row) + 5));
        assert_eq!((often.steps.len(), often.no_times.len()), (0, 200));
        assert!(often.no_times.iter().all(|(_, _, rows)| rows.start % 10 == 0));
    }

    #[test]
    fn a_step_is_found_with_and_without_the_recorders_times() {
        let at = |row: i64| 1_700_000_000 * S + row * S / 50;
        for by in [-S, -30 * S, 37 * S] {
            let stepped = |row: i64| at(row) + if row >= 1000 { by } else { 0 };
            let alone = found(|row| (stepped(row), at(row)));
            assert_eq!((alone.steps[0].row, alone.steps[0].by_ns), (1000, by));
            let both = found(|row| (stepped(row), stepped(row)));
            // A jump on is like a pause for both.
            assert_eq!(
                both.steps.iter().map(|own| own.by_ns).collect::<Vec<_>>(),
                if by < 0 { vec![by] } else { vec![] }
            );
            // A message that was stamped before both stepped back, and logged behind it; and the recorder's clock alone.
            let on_its_way = |row: i64| stepped(if row == 999 { 1000 } else { row }) + 5;
            let steps = found(|row| (stepped(row), on_its_way(row))).steps;
            assert!(
                by > 0 || (steps.len() == 1 && (steps[0].by_ns - by).abs() < S / 10),
                "{steps:?}"
            );
            assert!(by > 0 || found(|row| (at(row), stepped(row))).steps.is_empty());
            let mut stamps: Vec<i64> = (0..2000).map(stepped).collect();
            let logged: Vec<i64> = (0..2000).map(at).collect();
            alone.amend(("f", "/t", SpanClock::Tracker), (0, 7), &mut stamps, &logged);
            assert_eq!(stamps, logged);
        }
    }

    #[test]
    fn a_recording_that_stands_in_a_file_twice_is_no_step() {
        let found = |rows: i64, content: fn(i64, i64) -> f64| {
            let mut runs = Runs::default();
            for row in 0..2 * rows {
                let (stamp, logged) = (row % rows * S / 50, row * S / 50);
                runs.push(7, &[stamp], &[logged]);
                runs.see(stamp, &[content(row, rows)]);
            }
            runs.found("f", "/t", SpanClock::Tracker)
        };
        // So many that few of them are kept to be compared, too.
        for rows in [1000, 200_000] {
            assert!(found(rows, |row, rows| (row % rows) as f64).is_empty());
            assert_eq!(found(rows, |row, _| row as f64).steps.len(), 1);
        }
    }

    #[test]
    fn late_messages_and_jitter_are_no_steps() {
        let at = |row: i64| 1_700_000_000 * S + row * S / 50;
        // Two chunks of a recorder in the wrong order, and single messages 0.4 s late.
        let swapped = |row: i64| match row {
            800..1000 => at(row + 200),
            1000..1200 => at(row - 200),
            _ => at(row),
        };
        assert!(found(|row| (swapped(row), swapped(row))).is_empty());
        let late = |row: i64| at(if row % 300 == 299 { row - 20 } else { row });
        assert!(found(|row| (late(row), late(row))).is_empty());
        // Messages that wait for each other on their way.
        assert!(found(|row| (at(row), at(row - row % 40 + 40))).is_empty());
    }
}
