//! Sessions of the past and their figures, as the tables `history` and `drift` are made of them.

use super::words::Unit;
use crate::history::Judged;
use crate::history::control::Charted;
use crate::manifest::RunKey;

/// A session in the history.
#[derive(Debug, Clone)]
pub struct PastSession {
    /// Its current run.
    pub key: RunKey,
    /// First stamp of its controller's log.
    pub measured_at_ns: i64,
    /// What the history says of it.
    pub judged: Judged,
}

impl PastSession {
    /// Whether the change that each of a robot's sessions showed lasts, as the session after it tells; `None` of the last.
    pub fn lasting(sessions: &[Self]) -> Vec<Option<bool>> {
        let next = sessions.iter().skip(1).map(|next| next.judged.settles);
        next.chain([None]).take(sessions.len()).collect()
    }
}

/// One figure of a session.
#[derive(Debug, Clone)]
pub struct Figure {
    /// What it is.
    pub kind: Kind,
    /// Its name.
    pub name: String,
    /// The joint, from 1.
    pub joint: Option<usize>,
    /// The joint's angle, rad.
    pub angle_rad: Option<f64>,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sd: Option<f64>,
    /// Its unit.
    pub unit: Unit,
    /// Where it stands on its chart, if it has one.
    pub charted: Option<Charted>,
}

/// What a figure is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// An accuracy figure.
    Accuracy,
    /// How far base, target or a joint's offset stands from the first session.
    SinceFirst,
    /// An identified parameter.
    Parameter,
    /// A point of a joint's error curve.
    JointCurve,
}
