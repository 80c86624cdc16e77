//! Past sessions and their figures, the content of the tables `history` and `drift`.

use super::words::Unit;
use crate::history::Judged;
use crate::history::control::Charted;
use crate::manifest::RunKey;
use crate::rows::words;

#[derive(Debug, Clone)]
pub struct PastSession {
    pub key: RunKey,
    /// First stamp of its controller's log.
    pub measured_at_ns: i64,
    pub judged: Judged,
}

impl PastSession {
    /// Whether the change in each of a robot's sessions lasts, judged by the session after it; `None` for the last.
    pub fn lasting(sessions: &[Self]) -> Vec<Option<bool>> {
        let next = sessions.iter().skip(1).map(|next| next.judged.settles);
        next.chain([None]).take(sessions.len()).collect()
    }
}

#[derive(Debug, Clone)]
pub struct Figure {
    pub kind: Kind,
    pub name: String,
    /// The joint, from 1.
    pub joint: Option<usize>,
    pub angle_rad: Option<f64>,
    pub value: f64,
    pub sd: Option<f64>,
    pub unit: Unit,
    /// Its values on its control chart; `None` where it has none.
    pub charted: Option<Charted>,
}

words! {
    pub enum Kind {
        Accuracy: "accuracy",
        /// The change of base, target or a joint's offset since the first session.
        SinceFirst: "since_first",
        Parameter: "parameter",
        JointCurve: "joint_curve",
        /// Distance of a reference from its place in the base frame at the segment's first session that has it.
        Reference: "reference",
    }
}
