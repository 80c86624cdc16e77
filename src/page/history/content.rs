//! What the trend page tells.

/// The history of one robot.
#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    /// The robot.
    pub robot: String,
    /// Version of the program.
    pub version: String,
    /// Probability of a false alarm in one session.
    pub false_alarm: f64,
    /// Runs in all.
    pub runs: usize,
    /// Sessions in order.
    pub sessions: Vec<Session>,
    /// Charted figures.
    pub series: Vec<Series>,
    /// Joint curves.
    pub curves: Vec<Curve>,
    /// Parameters of the arm.
    pub parameters: Vec<Parameter>,
    /// Runs left out: which, and why.
    pub left_out: Vec<(String, String)>,
}

/// One session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Session {
    /// Its name.
    pub name: String,
    /// Its run.
    pub run: String,
    /// Its segment, from 1.
    pub segment: usize,
    /// What began the segment.
    pub began: Vec<String>,
    /// Sessions that it was held against.
    pub against: usize,
    /// What moved, in words.
    pub moved: Option<String>,
    /// Whether that lasts.
    pub lasting: Option<bool>,
    /// Figures out of control.
    pub out_of_control: Vec<String>,
}

/// A charted figure over the sessions.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// `mm` or `rad`.
    pub unit: &'static str,
    /// Whether it is an accuracy figure.
    pub is_accuracy: bool,
    /// Its values.
    pub points: Vec<Point>,
}

/// A figure in one session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The session, from 1.
    pub session: usize,
    /// The value, mm or rad.
    pub value: f64,
    /// Its standard deviation.
    pub sd: Option<f64>,
    /// The moving average over its limit.
    pub average: Option<f64>,
}

/// The error curve of a joint: angle, error and standard deviation, rad.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// The joint, from 1.
    pub joint: usize,
    /// In the first session.
    pub first: Vec<[f64; 3]>,
    /// In the newest.
    pub newest: Vec<[f64; 3]>,
}

/// A parameter of the arm: value and standard error.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// `mm` or `rad`.
    pub unit: &'static str,
    /// In the first session.
    pub first: Option<(f64, f64)>,
    /// In the newest.
    pub newest: Option<(f64, f64)>,
}
