//! `drift`: the changes between sessions, hypothesis by hypothesis, with their sizes.

use super::past::PastSession;
use super::words::Unit;
use crate::history::compare::Shift;
use crate::history::hypotheses::{Asked, Hypothesis, HypothesisVerdict};
use crate::table::{row, words};

row! {
    /// The result of a session for one hypothesis: a test, or the shift of a component.
    pub struct DriftRow of "drift" {
        /// The robot.
        robot: String,
        /// The session.
        session: String,
        /// Its run.
        run: String,
        /// First stamp of its controller's log, ns.
        measured_at_ns: i64,
        /// Number of its segment: the sessions since the last change of the basis.
        segment: usize,
        /// Why a segment begins, as text; `None` where none does.
        began: Option<String>,
        /// Number of sessions that it is compared with.
        against: usize,
        /// The part that may have moved.
        hypothesis: HypothesisKind,
        /// Its joint, from 1.
        joint: Option<usize>,
        /// The component whose shift this is.
        component: Option<String>,
        /// Chi-square of the hypothesis's change against none.
        chi_square: Option<f64>,
        /// Its degrees of freedom.
        degrees_of_freedom: Option<usize>,
        /// Its p-value.
        p_value: Option<f64>,
        /// Chi-square of the remainder when the hypothesis is true.
        remainder_chi_square: Option<f64>,
        /// Its degrees of freedom.
        remainder_degrees_of_freedom: Option<usize>,
        /// Its p-value.
        remainder_p_value: Option<f64>,
        /// The shift of the component, in its unit.
        shift: Option<f64>,
        /// The shift's standard error.
        standard_error: Option<f64>,
        /// The shift's unit.
        unit: Option<Unit>,
        /// The verdict on the hypothesis.
        verdict: HypothesisVerdict,
        /// Whether the next session has the change too; `None` where there is none.
        lasting: Option<bool>,
    }
}

/// Parts that may have moved, without their joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HypothesisKind {
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
    HypothesisKind {
        Anything: "anything",
        Base: "base",
        Target: "target",
        JointOffset: "joint_offset",
        JointCurve: "joint_curve",
        Link: "link",
    }
    HypothesisVerdict {
        NoChange: "no_change",
        Small: "small",
        Moved: "moved",
        OneOfSeveral: "one_of_several",
        SetUpAnew: "set_up_anew",
        NotShown: "not_shown",
    }
}

impl From<Hypothesis> for HypothesisKind {
    fn from(hypothesis: Hypothesis) -> Self {
        match hypothesis {
            Hypothesis::Anything => Self::Anything,
            Hypothesis::Base => Self::Base,
            Hypothesis::Target => Self::Target,
            Hypothesis::JointOffset(_) => Self::JointOffset,
            Hypothesis::JointCurve(_) => Self::JointCurve,
            Hypothesis::Link(_) => Self::Link,
        }
    }
}

/// The rows of one robot's sessions, which are in order.
pub fn rows(sessions: &[PastSession]) -> Vec<DriftRow> {
    let each = sessions.iter().zip(PastSession::lasting(sessions));
    each.flat_map(|(session, lasting)| of_session(session, lasting)).collect()
}

fn of_session(session: &PastSession, lasting: Option<bool>) -> Vec<DriftRow> {
    let judged = &session.judged;
    let row = |hypothesis, verdict| row(session, lasting, hypothesis, verdict);
    if judged.asked.is_empty() {
        let hypothesis = Hypothesis::Anything;
        let is_anew = judged.set_up_anew.contains(&hypothesis);
        let verdict =
            if is_anew { HypothesisVerdict::SetUpAnew } else { HypothesisVerdict::NotShown };
        return vec![row(hypothesis, verdict)];
    }
    let verdict = |hypothesis: Hypothesis| {
        if judged.set_up_anew.contains(&hypothesis) {
            HypothesisVerdict::SetUpAnew
        } else if judged.small.contains(&hypothesis) {
            HypothesisVerdict::Small
        } else {
            judged.finding.verdict_of(hypothesis)
        }
    };
    let tests = judged
        .asked
        .iter()
        .map(|asked| with_test(row(asked.hypothesis, verdict(asked.hypothesis)), asked));
    let named = judged.finding.named();
    let shifts = judged.moved.iter().filter_map(|shift| {
        let hypothesis = *named.iter().find(|hypothesis| hypothesis.has(&shift.column))?;
        Some(with_shift(row(hypothesis, verdict(hypothesis)), shift))
    });
    let is_asked = |hypothesis: &&Hypothesis| {
        !judged.asked.iter().any(|asked| asked.hypothesis == **hypothesis)
    };
    let anew = judged.set_up_anew.iter().filter(is_asked);
    let anew = anew.map(|hypothesis| row(*hypothesis, HypothesisVerdict::SetUpAnew));
    tests.chain(shifts).chain(anew).collect()
}

/// The row of a verdict on a hypothesis, without a test or a shift.
fn row(
    session: &PastSession,
    lasting: Option<bool>,
    hypothesis: Hypothesis,
    verdict: HypothesisVerdict,
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
        hypothesis: hypothesis.into(),
        joint: hypothesis.joint(),
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
