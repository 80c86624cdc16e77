//! `drift`: the changes between sessions, hypothesis by hypothesis, with their sizes.

use super::past::PastSession;
use super::words::Unit;
use crate::history::compare::Shift;
use crate::history::hypotheses::{Asked, Hypothesis, HypothesisVerdict};
use crate::manifest::RunKey;
use crate::table::{row, words};

row! {
    /// The result of a session for one hypothesis: a test, or the shift of a component.
    pub struct DriftRow of "drift" {
        key: RunKey,
        measured_at_ns: i64,
        segment: usize,
        began: Option<String>,
        against: usize,
        hypothesis: HypothesisKind,
        joint: Option<usize>,
        component: Option<String>,
        chi_square: Option<f64>,
        degrees_of_freedom: Option<usize>,
        p_value: Option<f64>,
        remainder_chi_square: Option<f64>,
        remainder_degrees_of_freedom: Option<usize>,
        remainder_p_value: Option<f64>,
        shift: Option<f64>,
        standard_error: Option<f64>,
        unit: Option<Unit>,
        verdict: HypothesisVerdict,
        lasting: Option<bool>,
    }
}

/// Parts that may have moved, without their joints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HypothesisKind {
    Anything,
    /// The base, or the tracker.
    Base,
    Target,
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
    let judged = &session.judged;
    DriftRow {
        key: session.key.clone(),
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
