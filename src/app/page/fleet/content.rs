use crate::io::tables::words::TableVerdict;
use crate::units::WallTime;

/// Microseconds of a day.
pub(crate) const DAY_US: f64 = 86_400e6;

#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// The time that the page is of: the start of the newest session, or a stated one; `None` where no session has a date.
    pub as_of: Option<WallTime>,
    pub is_stated: bool,
    pub robots: Vec<Robot>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Robot {
    pub name: String,
    /// File name of its page, next to this one.
    pub page: String,
    pub sessions: usize,
    /// The newest of them; `None` where none could be used.
    pub newest: Option<Newest>,
    pub unreadable: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Newest {
    pub session: String,
    /// Its start; `None` where no clock has an epoch.
    pub started: Option<WallTime>,
    /// The middle of the times between sessions, days; `None` of fewer than three with a date.
    pub usual_days: Option<f64>,
    pub verdict: TableVerdict,
    /// The bound that it rests on, mm.
    pub bound_mm: Option<f64>,
    pub tolerance_mm: Option<f64>,
    /// Mean error before correction, mm.
    pub before_mm: Option<f64>,
    /// Mean error after correction, mm.
    pub after_mm: Option<f64>,
    /// What moved, as text; `None` where nothing did.
    pub moved: Option<String>,
    pub out_of_control: Vec<String>,
}

impl Content {
    pub(super) fn as_of_text(&self) -> String {
        self.as_of.map_or_else(|| "a time that is not known".to_owned(), |time| time.to_string())
    }

    pub(super) fn measured(&self) -> impl Iterator<Item = (&Robot, &Newest)> {
        self.robots.iter().filter_map(|robot| Some((robot, robot.newest.as_ref()?)))
    }

    /// Days from the start of a session to the time that the page is of, none of them negative; `None` where one is not known.
    pub(super) fn days_since(&self, newest: &Newest) -> Option<f64> {
        let (from, to) = (newest.started?, self.as_of?);
        Some(((to.us() - from.us()) as f64 / DAY_US).max(0.0))
    }

    /// Whether a session was measured in the 24 hours up to the time that the page is of.
    pub(super) fn is_last_night(&self, newest: &Newest) -> bool {
        self.days_since(newest).is_some_and(|days| days < 1.0)
    }
}

impl Newest {
    /// The bound over the tolerance; `None` where one is not known.
    pub(super) fn ratio(&self) -> Option<f64> {
        let tolerance = self.tolerance_mm.filter(|own| *own > 0.0)?;
        Some(self.bound_mm? / tolerance)
    }

    pub(super) fn is_changed(&self) -> bool {
        self.moved.is_some() || !self.out_of_control.is_empty()
    }
}

pub(super) fn how_many(robots: usize) -> String {
    if robots == 1 { "1 robot".to_owned() } else { format!("{robots} robots") }
}
