//! Units and clocks: lengths are mm, angles rad, times ns, everywhere inside the crate. A [`Stamp`] belongs to one
//! clock; a [`ClockModel`] converts between two.

use std::fmt;
use std::marker::PhantomData;
use std::time::Duration;

use serde::{Deserialize, Serialize};

pub const MM_PER_M: f64 = 1000.0;

/// Millimetres of a sliding joint that count as one radian of a turning one: a turn of 1 mrad moves a point 1 m from
/// the axis, the usual distance of a tool, by 1 mm.
pub const SLIDE_MM_PER_RAD: f64 = 1000.0;

/// Units of a joint's variable that count as one radian: 1 rad where it turns, 1000 mm where it slides.
pub const fn per_radian(slides: bool) -> f64 {
    if slides { SLIDE_MM_PER_RAD } else { 1.0 }
}

/// Separation of two joint values, rad: the chord `2 sin(Δq/2)`, or of a sliding one the distance, a mm as a mrad.
pub fn chord(difference: f64, slides: bool) -> f64 {
    if slides { difference / SLIDE_MM_PER_RAD } else { 2.0 * (0.5 * difference).sin() }
}

pub const NS_PER_S: f64 = 1e9;

/// `value` rounded to whole steps, for display: zero has no sign.
pub fn to_step(value: f64, step: f64) -> f64 {
    (value / step).round() * step + 0.0
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Controller {}
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tracker {}

/// A moment of wall time: microseconds since 1970, UTC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct WallTime {
    us: i64,
}

impl WallTime {
    pub const fn of_us(us: i64) -> Self {
        Self { us }
    }

    /// A clock's nanoseconds as wall time; `None` where the clock has no epoch: one that lost its battery begins in
    /// 1970, 1980 or 2000, others are centuries away.
    pub fn of_clock_ns(ns: i64) -> Option<Self> {
        const YEAR_2001_S: i64 = 978_307_200;
        const YEAR_2100_S: i64 = 4_102_444_800;
        let has_epoch = (YEAR_2001_S..YEAR_2100_S).contains(&ns.div_euclid(1_000_000_000));
        has_epoch.then(|| Self::of_us(ns.div_euclid(1000)))
    }

    /// A moment as people write it, UTC: `2026-05-14`, `2026-05-14 14:30` or `2026-05-14T14:30:00`; else `None`.
    pub fn stated(text: &str) -> Option<Self> {
        let text = text.trim().replace('T', " ");
        let date = chrono::NaiveDate::parse_from_str(&text, "%Y-%m-%d").ok();
        let mut times = ["%Y-%m-%d %H:%M", "%Y-%m-%d %H:%M:%S"]
            .into_iter()
            .filter_map(|form| chrono::NaiveDateTime::parse_from_str(&text, form).ok());
        let time = date.and_then(|date| date.and_hms_opt(0, 0, 0)).or_else(|| times.next())?;
        Some(Self::of_us(time.and_utc().timestamp_micros()))
    }

    /// Microseconds since 1970, UTC.
    pub const fn us(self) -> i64 {
        self.us
    }

    /// Days since 1970, UTC.
    pub const fn day(self) -> f64 {
        const US_PER_DAY: f64 = 86_400e6;
        self.us as f64 / US_PER_DAY
    }
}

/// Date and time to the second, UTC: `2020-11-09 12:34:56`.
impl fmt::Display for WallTime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match chrono::DateTime::from_timestamp_micros(self.us) {
            Some(time) => write!(f, "{}", time.format("%Y-%m-%d %H:%M:%S")),
            None => write!(f, "{} µs after 1970", self.us),
        }
    }
}

/// A moment in the clock `C`, in nanoseconds of that clock.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub struct Stamp<C> {
    ns: i64,
    clock: PhantomData<C>,
}

impl<C: Copy> Stamp<C> {
    pub const fn from_ns(ns: i64) -> Self {
        Self { ns, clock: PhantomData }
    }

    pub const fn ns(self) -> i64 {
        self.ns
    }

    /// Nanoseconds from `earlier` to `self`; negative when `self` comes first, saturating at the ends of `i64`.
    pub const fn since_ns(self, earlier: Self) -> i64 {
        self.ns.saturating_sub(earlier.ns)
    }

    pub fn since_s(self, earlier: Self) -> f64 {
        self.since_ns(earlier) as f64 / NS_PER_S
    }

    #[must_use]
    pub const fn plus_ns(self, ns: i64) -> Self {
        Self::from_ns(self.ns.saturating_add(ns))
    }
}

impl<C> fmt::Debug for Stamp<C> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ns", self.ns)
    }
}

/// The relation between the two clocks of a session, usable in both directions.
///
/// ```
/// use posegrid_base::units::{ClockModel, Stamp};
///
/// let clocks = ClockModel { origin: Stamp::from_ns(1_000), offset_ns: 2.5e9, drift: 12e-6 };
/// let an_hour_later = clocks.origin.plus_ns(3_600_000_000_000);
/// let seen = clocks.to_tracker(an_hour_later);
/// assert_eq!(seen.ns() - an_hour_later.ns(), 2_500_000_000 + 43_200_000); // offset and 43.2 ms of drift
/// assert_eq!(clocks.to_controller(seen), an_hour_later);
/// ```
///
/// The equation: `tracker − t₀ = (1 + drift)(controller − t₀) + offset`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockModel {
    /// t₀, the first stamp of the controller's log.
    pub origin: Stamp<Controller>,
    /// Offset of the tracker's clock from the controller's at t₀, ns; positive when the tracker's is ahead.
    pub offset_ns: f64,
    /// Rate of the tracker's clock relative to the controller's, minus 1 (12e-6 is 12 ppm fast).
    pub drift: f64,
}

impl ClockModel {
    pub fn to_tracker(&self, stamp: Stamp<Controller>) -> Stamp<Tracker> {
        let elapsed = stamp.since_ns(self.origin);
        let correction = self.drift.mul_add(elapsed as f64, self.offset_ns);
        Stamp::from_ns(
            self.origin.ns().saturating_add(elapsed).saturating_add(round_ns(correction)),
        )
    }

    pub fn to_controller(&self, stamp: Stamp<Tracker>) -> Stamp<Controller> {
        let elapsed = stamp.ns().saturating_sub(self.origin.ns());
        let correction = (self.drift * elapsed as f64 + self.offset_ns) / (1.0 + self.drift);
        self.origin.plus_ns(elapsed.saturating_sub(round_ns(correction)))
    }
}

/// The whole nanosecond nearest to `ns`, saturating.
#[expect(
    clippy::cast_possible_truncation,
    reason = "float to integer casts saturate, which is what is wanted"
)]
pub fn round_ns(ns: f64) -> i64 {
    ns.round() as i64
}

/// The whole part of a number: 0 where it is negative or not a number, the largest count where it is larger.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "float to integer casts saturate, which is what is wanted"
)]
pub const fn whole(number: f64) -> usize {
    number as usize
}

/// A duration as text in whole seconds, minutes, hours or days: `"12 min"`.
pub fn span(time: Duration) -> String {
    const MINUTE: u64 = 60;
    const HOUR: u64 = 60 * MINUTE;
    const DAY: u64 = 24 * HOUR;
    match time.as_secs() {
        s @ ..MINUTE => format!("{s} s"),
        s @ MINUTE..HOUR => format!("{} min", s / MINUTE),
        s @ HOUR..DAY => format!("{} h", s / HOUR),
        s => format!("{} d", s / DAY),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_is_reported_in_its_own_unit() {
        let told = [0, 59, 60, 3599, 3600, 86_399, 86_400].map(|s| span(Duration::from_secs(s)));
        assert_eq!(told, ["0 s", "59 s", "1 min", "59 min", "1 h", "23 h", "1 d"]);
    }

    #[test]
    fn only_a_clock_with_an_epoch_tells_the_day() {
        let told = |ns| WallTime::of_clock_ns(ns).map(|time| time.to_string());
        assert_eq!(told(1_604_923_200_123_456_789).as_deref(), Some("2020-11-09 12:00:00"));
        assert_eq!(
            WallTime::of_clock_ns(1_604_923_200_123_456_789),
            Some(WallTime::of_us(1_604_923_200_123_456))
        );
        // Since its start, in microseconds; an hour into 2000; before 1970, before 2001 and after 2099.
        for ns in [
            0,
            86_400_000_000_000,
            1_604_923_200_123_456,
            -1,
            946_688_400_000_000_000,
            978_307_199_999_999_999,
        ] {
            assert_eq!(told(ns), None, "{ns}");
        }
        assert_eq!(told(978_307_200_000_000_000).as_deref(), Some("2001-01-01 00:00:00"));
        assert_eq!(told(4_102_444_800_000_000_000), None);
    }

    #[test]
    fn clock_model_maps_there_and_back_to_the_nanosecond() {
        let origin = Stamp::from_ns(1_605_000_000_000_200_000);
        let clock = ClockModel { origin, offset_ns: -4.131e9, drift: -25e-6 };
        // An hour after t₀ the tracker has lost 25 µs/s · 3600 s = 90 ms.
        let controller = origin.plus_ns(3_600_000_000_000);
        let tracker = clock.to_tracker(controller);
        assert_eq!(tracker.ns() - controller.ns(), -4_131_000_000 - 90_000_000);
        assert!((clock.to_controller(tracker).since_ns(controller)).abs() <= 1);
    }

    #[test]
    fn stamps_at_the_ends_of_the_clock_saturate() {
        let first = Stamp::<Controller>::from_ns(i64::MIN);
        let last = Stamp::<Controller>::from_ns(i64::MAX);
        assert_eq!(last.since_ns(first), i64::MAX);
        assert_eq!(last.plus_ns(1), last);
    }
}
