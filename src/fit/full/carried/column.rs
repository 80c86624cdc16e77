//! The columns that are carried over, by what they are: places differ from session to session.

use serde::{Deserialize, Serialize};

use crate::fit::full::layout::Block;
use crate::fit::problem::Unknown;

/// One column.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(super) enum Column {
    /// A parameter of the arm's geometry.
    Unknown(Unknown),
    /// A column of a block that all sessions share.
    Of {
        /// The block.
        block: Block,
        /// The column's place in it.
        place: usize,
    },
    /// A column of the change of a joint's curve in the last session alone.
    Last {
        /// The joint, from 0.
        joint: usize,
        /// The column's place: a constant, then pairs.
        place: usize,
    },
    /// The zero of a joint in the sessions so far relative to now, which is none unless it changed.
    Constant(usize),
}

impl Column {
    /// The joint whose gear it is of.
    pub(super) const fn joint(self) -> Option<usize> {
        match self {
            Self::Unknown(_) => None,
            Self::Of { block, .. } => block.shapes(),
            Self::Last { joint, .. } | Self::Constant(joint) => Some(joint),
        }
    }

    /// Whether it is a change of the last session alone.
    pub(super) const fn is_of_last(self) -> bool {
        matches!(self, Self::Last { .. })
    }
}
