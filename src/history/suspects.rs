//! Which part moved: each suspect is asked what its change alone explains.
//!
//! 1. Suspects are the base, the target, each joint's offset, each joint's offset and curve together, each link, and everything.
//!    The last link moves the target and the first link's offset the base, whatever the poses, so these are not asked again.
//!    The alarm is the smallest p-value times their number (Bonferroni) against `FALSE_ALARM`.
//! 2. A suspect suffices if no other (nor everything) explains significantly more together with it than it does alone. Of
//!    those that suffice the likeliest is a candidate, and each that is less likely by a factor of twenty at most, the chi-square
//!    that noise would add by degrees of freedom taken off. Of candidates within each other the smallest stays. Several
//!    that stay cannot be told apart.
//! 3. Where there is no candidate several parts moved: the one that explains most is taken for sure, and the
//!    question is asked again beside it, up to four parts.

mod inquiry;

use serde::{Deserialize, Serialize};

use super::FALSE_ALARM;
use super::compare::{ChiSquare, Comparison};
use super::estimate::Column;
use crate::kinematics::{LinkQuantity, Parameter};
use inquiry::Inquiry;

/// A part that may have moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Suspect {
    /// The base, or the tracker.
    Base,
    /// The target at the flange, or the tool that carries it.
    Target,
    /// A joint's offset.
    JointOffset(usize),
    /// A joint's offset and error curve.
    JointCurve(usize),
    /// A link's lengths and angles.
    Link(usize),
    /// Anything at all.
    Anything,
}

/// The verdict on a suspect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SuspectVerdict {
    /// It did not change, as far as the covariances show.
    NoChange,
    /// It moved.
    Moved,
    /// One of several moved, which cannot be told apart.
    OneOfSeveral,
    /// It was set up anew and was not asked.
    SetUpAnew,
    /// There is nothing to hold it against.
    NotShown,
}

/// What a suspect explains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Asked {
    /// The suspect.
    pub suspect: Suspect,
    /// That it alone changed, against no change.
    pub alone: ChiSquare,
    /// What remains beside it.
    pub remainder: ChiSquare,
}

/// What moved.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Finding {
    /// Nothing that the covariances would show.
    #[default]
    Nothing,
    /// These parts.
    Moved {
        /// Each of these.
        surely: Vec<Suspect>,
        /// And one of these, which cannot be told apart.
        one_of: Vec<Suspect>,
    },
}

impl Suspect {
    /// Whether a column is of the part.
    pub const fn has(self, column: &Column) -> bool {
        match (self, column) {
            (Self::Anything, _)
            | (Self::Base, Column::Chain(Parameter::Base(_)))
            | (Self::Target, Column::Chain(Parameter::Target(_))) => true,
            (Self::Link(own), Column::Chain(Parameter::Link { joint, quantity })) => {
                let is_base = own == 1 && matches!(quantity, LinkQuantity::D);
                own == *joint && !matches!(quantity, LinkQuantity::Theta) && !is_base
            }
            (
                Self::JointOffset(own) | Self::JointCurve(own),
                Column::Chain(Parameter::Link { joint, quantity }),
            ) => own == *joint && matches!(quantity, LinkQuantity::Theta),
            (Self::JointCurve(own), Column::Curve { joint, .. }) => own == *joint,
            _ => false,
        }
    }

    /// The joint, from 1.
    pub const fn joint(self) -> Option<usize> {
        match self {
            Self::JointOffset(joint) | Self::JointCurve(joint) | Self::Link(joint) => Some(joint),
            Self::Base | Self::Target | Self::Anything => None,
        }
    }

    /// The word of the table.
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

impl std::fmt::Display for Suspect {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Base => f.write_str("base"),
            Self::Target => f.write_str("target"),
            Self::JointOffset(joint) => write!(f, "offset of joint {joint}"),
            Self::JointCurve(joint) => write!(f, "error curve of joint {joint}"),
            Self::Link(joint) => write!(f, "link {joint}"),
            Self::Anything => f.write_str("more than can be told apart"),
        }
    }
}

impl Finding {
    /// Every part that may have moved.
    pub fn parts(&self) -> Vec<Suspect> {
        match self {
            Self::Nothing => Vec::new(),
            Self::Moved { surely, one_of } => surely.iter().chain(one_of).copied().collect(),
        }
    }

    /// What it says of one part, in the word of the table.
    pub fn verdict_of(&self, part: Suspect) -> SuspectVerdict {
        match self {
            Self::Moved { .. } if part == Suspect::Anything => SuspectVerdict::Moved,
            // More than can be told apart: each part may have.
            Self::Moved { one_of, .. } if one_of.contains(&Suspect::Anything) => {
                SuspectVerdict::OneOfSeveral
            }
            Self::Moved { surely, .. } if surely.contains(&part) => SuspectVerdict::Moved,
            Self::Moved { one_of, .. } if one_of.contains(&part) && one_of.len() == 1 => {
                SuspectVerdict::Moved
            }
            Self::Moved { one_of, .. } if one_of.contains(&part) => SuspectVerdict::OneOfSeveral,
            _ => SuspectVerdict::NoChange,
        }
    }

    /// The parts that moved, the first of those that cannot be told apart among them.
    pub fn named(&self) -> Vec<Suspect> {
        match self {
            Self::Nothing => Vec::new(),
            Self::Moved { surely, one_of } => {
                surely.iter().chain(one_of.first()).copied().collect()
            }
        }
    }
}

/// The suspects that have a column among `columns`, in the order in which they are named.
pub fn suspects(columns: &[Column]) -> Vec<Suspect> {
    let joints = columns.iter().filter_map(Column::joint).max().unwrap_or(0);
    let of_joints = |suspect: fn(usize) -> Suspect| (1..=joints).map(suspect);
    [Suspect::Base, Suspect::Target]
        .into_iter()
        .chain(of_joints(Suspect::JointOffset))
        .chain(of_joints(Suspect::JointCurve))
        .chain((1..joints).map(Suspect::Link))
        .filter(|suspect| columns.iter().any(|column| suspect.has(column)))
        .filter(|suspect| match suspect {
            // Without a curve it is the offset again.
            Suspect::JointCurve(_) => columns
                .iter()
                .any(|column| matches!(column, Column::Curve { .. }) && suspect.has(column)),
            _ => true,
        })
        .chain([Suspect::Anything])
        .collect()
}

/// What each suspect explains, and what moved.
pub fn find(comparison: &Comparison, suspects: &[Suspect]) -> (Vec<Asked>, Finding) {
    let inquiry = Inquiry::new(comparison, suspects);
    let all = inquiry.explains(&[Suspect::Anything]);
    let asked = |&suspect: &Suspect| {
        let alone = inquiry.explains(&[suspect]);
        Asked {
            suspect,
            alone,
            remainder: alone.remainder(all),
        }
    };
    let asked: Vec<Asked> = suspects.iter().map(asked).collect();
    let least = asked.iter().map(|asked| asked.alone.p_value());
    let least = least.fold(1.0, f64::min);
    if least * suspects.len() as f64 >= FALSE_ALARM {
        return (asked, Finding::Nothing);
    }
    let finding = inquiry.moved();
    (asked, finding)
}
