//! `drift`: the changes between sessions, hypothesis by hypothesis, with their sizes.

use super::past::PastSession;
use super::words::Unit;
use crate::history::compare::{ChiSquare, Shift};
use crate::history::hypotheses::{Asked, Hypothesis, HypothesisVerdict};
use crate::manifest::RunKey;
use crate::rows::{row, words};

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

words! {
    /// Parts that may have moved, without their joints.
    pub enum HypothesisKind {
        Anything: "anything",
        /// The base, or the tracker.
        Base: "base",
        Target: "target",
        JointOffset: "joint_offset",
        /// A joint's offset and error curve.
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
    let row = |hypothesis, verdict, asked: Option<&Asked>, shift: Option<&Shift>| {
        row(session, lasting, (hypothesis, verdict), asked, shift)
    };
    if judged.asked.is_empty() {
        let hypothesis = Hypothesis::Anything;
        let is_anew = judged.set_up_anew.contains(&hypothesis);
        let verdict =
            if is_anew { HypothesisVerdict::SetUpAnew } else { HypothesisVerdict::NotShown };
        return vec![row(hypothesis, verdict, None, None)];
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
    let of = |asked: &Asked| row(asked.hypothesis, verdict(asked.hypothesis), Some(asked), None);
    let tests = judged.asked.iter().map(of);
    let named = judged.finding.named();
    let shifts = judged.moved.iter().filter_map(|shift| {
        let hypothesis = *named.iter().find(|hypothesis| hypothesis.has(&shift.column))?;
        Some(row(hypothesis, verdict(hypothesis), None, Some(shift)))
    });
    let is_asked = |hypothesis: &&Hypothesis| {
        !judged.asked.iter().any(|asked| asked.hypothesis == **hypothesis)
    };
    let anew = judged.set_up_anew.iter().filter(is_asked);
    let anew = anew.map(|own| row(*own, HypothesisVerdict::SetUpAnew, None, None));
    tests.chain(shifts).chain(anew).collect()
}

/// The row of a verdict on a hypothesis, with the test of it or the shift of a component of it.
fn row(
    session: &PastSession,
    lasting: Option<bool>,
    (hypothesis, verdict): (Hypothesis, HypothesisVerdict),
    asked: Option<&Asked>,
    shift: Option<&Shift>,
) -> DriftRow {
    let judged = &session.judged;
    let (alone, remainder) = asked.map(|own| (own.alone, own.remainder)).unzip();
    DriftRow {
        key: session.key.clone(),
        measured_at_ns: session.measured_at_ns,
        segment: judged.segment,
        began: Some(judged.began.join("; ")).filter(|words| !words.is_empty()),
        against: judged.against,
        hypothesis: hypothesis.into(),
        joint: hypothesis.joint(),
        component: shift.map(|own| own.column.to_string()),
        chi_square: alone.map(|own| own.statistic),
        degrees_of_freedom: alone.map(|own| own.freedom),
        p_value: alone.map(ChiSquare::p_value),
        remainder_chi_square: remainder.map(|own| own.statistic),
        remainder_degrees_of_freedom: remainder.map(|own| own.freedom),
        remainder_p_value: remainder.map(ChiSquare::p_value),
        shift: shift.map(|own| own.value),
        standard_error: shift.map(|own| own.sd),
        unit: shift.map(|own| Unit::named(own.column.unit_name())),
        verdict,
        lasting,
    }
}
