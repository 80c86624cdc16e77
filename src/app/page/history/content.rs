use crate::io::tables::words::TableVerdict;
use crate::units::WallTime;

#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    pub robot: String,
    /// Probability of a false alarm in one session.
    pub false_alarm: f64,
    pub runs: usize,
    /// Sessions in the order of their logs.
    pub sessions: Vec<Session>,
    pub series: Vec<Series>,
    pub curves: Vec<Curve>,
    pub parameters: Vec<Parameter>,
    /// Runs left out: name and reason.
    pub left_out: Vec<(String, String)>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Session {
    pub name: String,
    /// Address of the page of its run, relative to this one; `None` where this one stands outside the lake.
    pub page: Option<String>,
    /// Its start; `None` where no clock has an epoch.
    pub started: Option<WallTime>,
    pub verdict: TableVerdict,
    /// The bound that the verdict rests on, mm.
    pub bound_mm: Option<f64>,
    pub tolerance_mm: Option<f64>,
    /// Mean errors before and after correction, mm.
    pub means_mm: [Option<f64>; 2],
    /// Segment of the session, from 1.
    pub segment: usize,
    /// Changes that began the segment; empty where the session began none.
    pub began: Vec<String>,
    /// Number of earlier sessions that it was compared with.
    pub against: usize,
    /// Mean errors before and after, as text; `None` where the run does not state them.
    pub means: Option<String>,
    /// The part that moved and by how much, as text; `None` where nothing moved.
    pub moved: Option<String>,
    /// Whether the next session agrees with the change; `None` where there is none yet.
    pub lasting: Option<bool>,
    pub out_of_control: Vec<String>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    pub name: String,
    pub is_accuracy: bool,
    pub points: Vec<Point>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Number of the session, from 1.
    pub session: usize,
    /// The value, mm or rad.
    pub value: f64,
    /// Standard deviation of the value; `None` where it has none.
    pub sd: Option<f64>,
    /// The moving average divided by its control limit; `None` for a session without a score.
    pub average: Option<f64>,
}

/// The error curve of a joint: angle, error and standard deviation, rad.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Number of the joint, from 1.
    pub joint: usize,
    /// Whether it slides: then its points are in mm over mm, and not in rad.
    pub slides: bool,
    pub first: Vec<[f64; 3]>,
    pub newest: Vec<[f64; 3]>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    pub name: String,
    /// `mm` or `rad`.
    pub unit: &'static str,
    /// Value in the first session; `None` where it has none.
    pub first: Option<(f64, f64)>,
    /// Value in the newest session; `None` where it has none.
    pub newest: Option<(f64, f64)>,
}
