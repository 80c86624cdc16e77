//! The part that moved: for each hypothesis, a test of what its change alone explains.
//!
//! 1. Hypotheses are the base, the target, each joint's offset, each joint's offset and curve together, each link, and
//!    everything. The last link acts like the target and the first joint's offset like the base at any poses, so these two are
//!    not tested. The alarm is the smallest p-value times their number (Bonferroni) against `FALSE_ALARM`.
//! 2. A hypothesis suffices if no other one (nor everything) explains significantly more together with it than it does alone.
//!    Of those that suffice, the likeliest is a candidate, and so is each that is less likely by a factor of twenty at most;
//!    the chi-square that noise adds per degree of freedom is subtracted. Of candidates that contain each other the smallest
//!    stays. Several that stay cannot be distinguished.
//! 3. Without a candidate, several parts moved: the one that explains most is taken as moved, and the
//!    tests are repeated with it, up to four parts.

mod test_of_all;

use serde::{Deserialize, Serialize};

use super::FALSE_ALARM;
use super::compare::{ChiSquare, Comparison};
use super::estimate::Column;
use crate::kinematics::{LinkQuantity, Parameter};
use test_of_all::TestOfAll;

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Hypothesis {
    Base,
    Target,
    JointOffset(usize),
    JointCurve(usize),
    Link(usize),
    Anything,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HypothesisVerdict {
    /// It did not change by more than the covariances allow.
    NoChange,
    /// It moved, by less than counts.
    Small,
    Moved,
    /// One of several moved, which cannot be distinguished.
    OneOfSeveral,
    SetUpAnew,
    NotShown,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    pub hypothesis: Hypothesis,
    pub alone: ChiSquare,
    /// Chi-square that remains when this part changed.
    pub remainder: ChiSquare,
}

#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Finding {
    #[default]
    Nothing,
    Moved {
        surely: Vec<Hypothesis>,
        /// Further parts of which one moved; they cannot be distinguished.
        one_of: Vec<Hypothesis>,
    },
}

impl Hypothesis {
    pub const fn has(self, column: &Column) -> bool {
        match (self, column) {
            (Self::Anything, _)
            | (Self::Base, Column::Chain(Parameter::Base(_)))
            | (Self::Target, Column::Chain(Parameter::Target(_))) => true,
            (
                Self::Link(own),
                Column::Chain(Parameter::Link { joint, quantity })
                | Column::Slide(Parameter::Link { joint, quantity }),
            ) => {
                let is_base = own == 1 && matches!(quantity, LinkQuantity::D);
                own == *joint && column.zero_of().is_none() && !is_base
            }
            (
                Self::JointCurve(own),
                Column::Curve { joint, .. } | Column::SlideCurve { joint, .. },
            ) => own == *joint,
            (Self::JointOffset(own) | Self::JointCurve(own), _) => {
                matches!(column.zero_of(), Some(joint) if joint == own)
            }
            _ => false,
        }
    }

    /// The joint of the part, from 1; `None` for base, target and anything.
    pub const fn joint(self) -> Option<usize> {
        match self {
            Self::JointOffset(joint) | Self::JointCurve(joint) | Self::Link(joint) => Some(joint),
            Self::Base | Self::Target | Self::Anything => None,
        }
    }

    pub const fn word(self) -> &'static str {
        match self {
            Self::Base => "base",
            Self::Target => "target",
            Self::JointOffset(_) => "joint_offset",
            Self::JointCurve(_) => "joint_curve",
            Self::Link(_) => "link",
            Self::Anything => "anything",
        }
    }
}

impl std::fmt::Display for Hypothesis {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Base => f.write_str("base"),
            Self::Target => f.write_str("target"),
            Self::JointOffset(joint) => write!(f, "offset of joint {joint}"),
            Self::JointCurve(joint) => write!(f, "error curve of joint {joint}"),
            Self::Link(joint) => write!(f, "link {joint}"),
            Self::Anything => f.write_str("more than can be distinguished"),
        }
    }
}

impl Finding {
    pub fn parts(&self) -> Vec<Hypothesis> {
        match self {
            Self::Nothing => Vec::new(),
            Self::Moved { surely, one_of } => surely.iter().chain(one_of).copied().collect(),
        }
    }

    pub fn verdict_of(&self, part: Hypothesis) -> HypothesisVerdict {
        match self {
            Self::Moved { .. } if part == Hypothesis::Anything => HypothesisVerdict::Moved,
            // More than can be distinguished: each part may have moved.
            Self::Moved { one_of, .. } if one_of.contains(&Hypothesis::Anything) => {
                HypothesisVerdict::OneOfSeveral
            }
            Self::Moved { surely, .. } if surely.contains(&part) => HypothesisVerdict::Moved,
            Self::Moved { one_of, .. } if one_of.contains(&part) && one_of.len() == 1 => {
                HypothesisVerdict::Moved
            }
            Self::Moved { one_of, .. } if one_of.contains(&part) => HypothesisVerdict::OneOfSeveral,
            _ => HypothesisVerdict::NoChange,
        }
    }

    /// What is left without the parts that are small, of those that cannot be distinguished by the first; and these.
    pub(super) fn without(self, is_small: impl Fn(Hypothesis) -> bool) -> (Self, Vec<Hypothesis>) {
        let Self::Moved { surely, one_of } = self else { return (self, Vec::new()) };
        let (mut small, surely): (Vec<_>, Vec<_>) =
            surely.into_iter().partition(|part| is_small(*part));
        let are_small = one_of.first().is_some_and(|first| is_small(*first));
        let (gone, one_of) = if are_small { (one_of, Vec::new()) } else { (Vec::new(), one_of) };
        small.extend(gone);
        if surely.is_empty() && one_of.is_empty() {
            return (Self::Nothing, small);
        }
        (Self::Moved { surely, one_of }, small)
    }

    /// The parts that moved, the first of those that cannot be distinguished among them.
    pub fn named(&self) -> Vec<Hypothesis> {
        match self {
            Self::Nothing => Vec::new(),
            Self::Moved { surely, one_of } => {
                surely.iter().chain(one_of.first()).copied().collect()
            }
        }
    }
}

/// The hypotheses that have a column among `columns`, in the order of the tables.
pub fn hypotheses(columns: &[Column]) -> Vec<Hypothesis> {
    let joints = columns.iter().filter_map(Column::joint).max().unwrap_or(0);
    let of_joints = |hypothesis: fn(usize) -> Hypothesis| (1..=joints).map(hypothesis);
    [Hypothesis::Base, Hypothesis::Target]
        .into_iter()
        .chain(of_joints(Hypothesis::JointOffset))
        .chain(of_joints(Hypothesis::JointCurve))
        .chain((1..joints).map(Hypothesis::Link))
        .filter(|hypothesis| columns.iter().any(|column| hypothesis.has(column)))
        .filter(|hypothesis| match hypothesis {
            // Without curve columns it would repeat the offset.
            Hypothesis::JointCurve(_) => {
                let is_of_curve =
                    |own: &Column| matches!(own, Column::Curve { .. } | Column::SlideCurve { .. });
                columns.iter().any(|column| is_of_curve(column) && hypothesis.has(column))
            }
            _ => true,
        })
        .chain([Hypothesis::Anything])
        .collect()
}

/// The test of each hypothesis, and the parts that moved.
pub fn find(comparison: &Comparison, hypotheses: &[Hypothesis]) -> (Vec<Asked>, Finding) {
    let test_of_all = TestOfAll { comparison, hypotheses };
    let all = test_of_all.explains(&[Hypothesis::Anything]);
    let asked = |&hypothesis: &Hypothesis| {
        let alone = test_of_all.explains(&[hypothesis]);
        Asked { hypothesis, alone, remainder: alone.remainder(all) }
    };
    let asked: Vec<Asked> = hypotheses.iter().map(asked).collect();
    let least = asked.iter().map(|asked| asked.alone.p_value()).fold(1.0, f64::min);
    if least * hypotheses.len() as f64 >= FALSE_ALARM {
        return (asked, Finding::Nothing);
    }
    (asked, test_of_all.moved())
}
