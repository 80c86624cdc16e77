//! When a session was measured, by the stamps of its own logs.
//!
//! A controller's clock may count from its own start, or may never have been set: then the tracker's says when. Where neither clock
//! can be one that tells the date, the session has none. No clock of this machine takes part.

use std::fmt;

use crate::units::{ClockModel, WallTime};

/// The beginning of a session, and the clock that tells it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Began {
    pub at: WallTime,
    /// Whether the tracker's clock tells it, because the controller's cannot.
    pub by_tracker: bool,
}

/// The beginning of a session: the first stamp of its controller's log, or that moment by the tracker's clock where the controller's
/// has no epoch; `None` where neither has one.
pub fn began(clock: &ClockModel) -> Option<Began> {
    let of = |ns: i64, by_tracker: bool| {
        let at = WallTime::of_clock_ns(ns)?;
        Some(Began { at, by_tracker })
    };
    of(clock.origin.ns(), false).or_else(|| of(clock.to_tracker(clock.origin).ns(), true))
}

impl Began {
    pub fn day(&self) -> String {
        self.at.to_string().chars().take("2026-11-22".len()).collect()
    }
}

impl fmt::Display for Began {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let clock = if self.by_tracker { ", by the tracker's clock" } else { "" };
        let to_the_minute: String =
            self.at.to_string().chars().take("2026-11-22 08:30".len()).collect();
        write!(f, "{to_the_minute} UTC{clock}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Stamp;

    /// 2026-11-22 08:30:00.25 UTC.
    const MORNING_NS: i64 = 1_795_336_200_250_000_000;

    fn clock(origin_ns: i64, offset_ns: f64) -> ClockModel {
        ClockModel { origin: Stamp::from_ns(origin_ns), offset_ns, drift: 0.0 }
    }

    #[test]
    fn the_controllers_clock_tells_the_date_where_it_has_one() {
        let found = began(&clock(MORNING_NS, 3.7e12)).expect("a date");
        assert_eq!(found.to_string(), "2026-11-22 08:30 UTC");
        assert!(!found.by_tracker);
    }

    #[test]
    fn the_trackers_clock_tells_it_where_the_controllers_counts_from_its_start() {
        // 42 s after the controller was switched on.
        let found = began(&clock(42_000_000_000, MORNING_NS as f64)).expect("a date");
        assert_eq!(found.to_string(), "2026-11-22 08:30 UTC, by the tracker's clock");
        assert_eq!(found.day(), "2026-11-22");
    }

    #[test]
    fn clocks_without_an_epoch_tell_no_date() {
        assert_eq!(began(&clock(42_000_000_000, 5e9)), None);
        // A clock that lost its battery: an hour into the year 2000.
        assert_eq!(began(&clock(946_688_400_000_000_000, 0.0)), None);
        // One that counts in another unit is centuries away.
        assert_eq!(began(&clock(i64::MAX, 1e18)), None);
    }
}
