//! `drift`: what moved between sessions, suspect by suspect, and how far.

use super::past::PastSession;
use super::words::Unit;
use crate::history::compare::Shift;
use crate::history::suspects::{Asked, Suspect, SuspectVerdict};
use crate::io::table::{row, words};

row! {
    /// What a session says of one suspect: a test, or how far a component moved.
    pub struct DriftRow of "drift" {
        /// The robot.
        robot: String,
        /// The session.
        session: String,
        /// Its run.
        run: String,
        /// First stamp of its controller's log, ns.
        measured_at_ns: i64,
        /// Its segment: those since the last change of the basis.
        segment: usize,
        /// Why a segment begins, in words, where one does.
        began: Option<String>,
        /// Sessions that it is held against.
        against: usize,
        /// The part that may have moved.
        suspect: SuspectKind,
        /// Its joint, from 1.
        joint: Option<usize>,
        /// The component whose shift this is.
        component: Option<String>,
        /// Chi-square of the suspect's change against none.
        chi_square: Option<f64>,
        /// Its degrees of freedom.
        degrees_of_freedom: Option<usize>,
        /// Its p-value.
        p_value: Option<f64>,
        /// Chi-square of what remains beside it.
        remainder_chi_square: Option<f64>,
        /// Its degrees of freedom.
        remainder_degrees_of_freedom: Option<usize>,
        /// Its p-value.
        remainder_p_value: Option<f64>,
        /// How far the component moved.
        shift: Option<f64>,
        /// The shift's standard error.
        standard_error: Option<f64>,
        /// The shift's unit.
        unit: Option<Unit>,
        /// The verdict on the suspect.
        verdict: SuspectVerdict,
        /// Whether the next session has the change too; `None` where there is none.
        lasting: Option<bool>,
    }
}

/// Parts that may have moved, without their joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SuspectKind {
    /// Anything at all.
    Anything,
    /// The base, or the tracker.
    Base,
    /// The target at the flange.
    Target,
    /// A joint's offset.
    JointOffset,
    /// A joint's offset and error curve.
    JointCurve,
    /// A link's lengths and angles.
    Link,
}

words! {
    SuspectKind {
        Anything: "anything",
        Base: "base",
        Target: "target",
        JointOffset: "joint_offset",
        JointCurve: "joint_curve",
        Link: "link",
    }
    SuspectVerdict {
        NoChange: "no_change",
        Moved: "moved",
        OneOfSeveral: "one_of_several",
        SetUpAnew: "set_up_anew",
        NotShown: "not_shown",
    }
}

impl From<Suspect> for SuspectKind {
    fn from(suspect: Suspect) -> Self {
        match suspect {
            Suspect::Anything => Self::Anything,
            Suspect::Base => Self::Base,
            Suspect::Target => Self::Target,
            Suspect::JointOffset(_) => Self::JointOffset,
            Suspect::JointCurve(_) => Self::JointCurve,
            Suspect::Link(_) => Self::Link,
        }
    }
}

/// The rows of one robot's sessions, which are in order.
pub fn rows(sessions: &[PastSession]) -> Vec<DriftRow> {
    let each = sessions.iter().zip(PastSession::lasting(sessions));
    each.flat_map(|(session, lasting)| of_session(session, lasting))
        .collect()
}

fn of_session(session: &PastSession, lasting: Option<bool>) -> Vec<DriftRow> {
    let judged = &session.judged;
    let row = |suspect, verdict| row(session, lasting, suspect, verdict);
    if judged.asked.is_empty() {
        let suspect = Suspect::Anything;
        let is_anew = judged.set_up_anew.contains(&suspect);
        let verdict = if is_anew {
            SuspectVerdict::SetUpAnew
        } else {
            SuspectVerdict::NotShown
        };
        return vec![row(suspect, verdict)];
    }
    let verdict = |suspect: Suspect| {
        if judged.set_up_anew.contains(&suspect) {
            SuspectVerdict::SetUpAnew
        } else {
            judged.finding.verdict_of(suspect)
        }
    };
    let tests = judged
        .asked
        .iter()
        .map(|asked| with_test(row(asked.suspect, verdict(asked.suspect)), asked));
    let named = judged.finding.named();
    let shifts = judged.moved.iter().filter_map(|shift| {
        let suspect = *named.iter().find(|suspect| suspect.has(&shift.column))?;
        Some(with_shift(row(suspect, verdict(suspect)), shift))
    });
    let is_asked =
        |suspect: &&Suspect| !judged.asked.iter().any(|asked| asked.suspect == **suspect);
    let anew = judged.set_up_anew.iter().filter(is_asked);
    let anew = anew.map(|suspect| row(*suspect, SuspectVerdict::SetUpAnew));
    tests.chain(shifts).chain(anew).collect()
}

/// The row of a verdict on a suspect, without a test or a shift.
fn row(
    session: &PastSession,
    lasting: Option<bool>,
    suspect: Suspect,
    verdict: SuspectVerdict,
) -> DriftRow {
    let (key, judged) = (&session.key, &session.judged);
    DriftRow {
        robot: key.robot.clone(),
        session: key.session.clone(),
        run: key.run.clone(),
        measured_at_ns: session.measured_at_ns,
        segment: judged.segment,
        began: Some(judged.began.join("; ")).filter(|words| !words.is_empty()),
        against: judged.against,
        suspect: suspect.into(),
        joint: suspect.joint(),
        component: None,
        chi_square: None,
        degrees_of_freedom: None,
        p_value: None,
        remainder_chi_square: None,
        remainder_degrees_of_freedom: None,
        remainder_p_value: None,
        shift: None,
        standard_error: None,
        unit: None,
        verdict,
        lasting,
    }
}

fn with_test(row: DriftRow, asked: &Asked) -> DriftRow {
    let (alone, remainder) = (asked.alone, asked.remainder);
    DriftRow {
        chi_square: Some(alone.statistic),
        degrees_of_freedom: Some(alone.freedom),
        p_value: Some(alone.p_value()),
        remainder_chi_square: Some(remainder.statistic),
        remainder_degrees_of_freedom: Some(remainder.freedom),
        remainder_p_value: Some(remainder.p_value()),
        ..row
    }
}

fn with_shift(row: DriftRow, shift: &Shift) -> DriftRow {
    DriftRow {
        component: Some(shift.column.to_string()),
        shift: Some(shift.value),
        standard_error: Some(shift.sd),
        unit: Some(Unit::named(shift.column.unit_name())),
        ..row
    }
}
