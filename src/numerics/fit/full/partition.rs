//! Which columns belong to one session alone, and which all sessions share.
//!
//! A station moves by the columns of its own session and by those that all share. So the information of a pool is an arrow: a block for
//! each session's own columns, the shared block, and what each session's own have across to the shared; no two sessions meet
//! elsewhere. The cost of a pool grows with its sessions, not with their square or cube ([`super::regression::sessions`]).

use std::ops::Range;

use super::layout::{Block, Layout};
use super::shapes::{JointShapes, Run, runs};
use crate::fit::problem::Unknown;

#[derive(Debug, Clone, PartialEq)]
pub struct Partition {
    /// The columns of each session alone, ascending; none where there is only one session.
    pub own: Vec<Vec<usize>>,
    pub common: Vec<usize>,
}

impl Partition {
    /// The partition of a model of `sessions` sessions.
    pub fn of(layout: &Layout, unknowns: &[Unknown], sessions: usize) -> Self {
        let mut partition = Self { own: vec![Vec::new(); sessions], common: Vec::new() };
        for (block, columns) in layout.blocks() {
            let first = columns.start;
            for column in columns {
                let owner = match block {
                    Block::Unknowns => unknowns[column - first].session(),
                    _ => block.belongs_to().1,
                };
                match owner.filter(|_| sessions > 1) {
                    Some(session) => partition.own[session].push(column),
                    None => partition.common.push(column),
                }
            }
        }
        partition
    }

    pub fn size(&self) -> usize {
        self.common.len() + self.own.iter().map(Vec::len).sum::<usize>()
    }
}

/// The columns that the stations of one session see, by what moves their target.
///
/// A column of a joint's curve or gear line moves the target by the joint's motion times a number that depends on the joint alone. So
/// the rows of a station are the motions of few joints and a list of numbers for each ([`JointShapes`]), and sums over stations are
/// products of these lists: a third of the work for a place, a sixth for a pose.
#[derive(Debug, Clone)]
pub struct Seen {
    /// The columns among those of the model: the session's own, then the shared ones.
    pub columns: Vec<usize>,
    /// The shapes of each joint, with places in `columns`.
    pub of_joints: Vec<JointShapes>,
    /// Places in `columns` of all others.
    pub plain: Vec<usize>,
    /// `plain` as runs of places that follow each other, in the same order.
    pub plain_runs: Vec<Run>,
    /// The blocks of the latter that are not another session's.
    pub(super) blocks: Vec<(Block, Range<usize>)>,
    /// Place in `plain` of each column of the model that is there.
    pub(super) places: Vec<usize>,
}

impl Block {
    /// The joint whose motion the block's columns scale.
    pub(super) const fn shapes(self) -> Option<usize> {
        match self {
            Self::Curve(joint)
            | Self::Earlier { joint, .. }
            | Self::SessionCurve { joint, .. }
            | Self::Ageing { joint, .. }
            | Self::Line { joint, .. } => Some(joint),
            _ => None,
        }
    }
}

impl Layout {
    pub(super) fn blocks_in(&self, session: usize) -> impl Iterator<Item = (Block, Range<usize>)> {
        let is_seen = move |block: Block| block.belongs_to().1.is_none_or(|own| own == session);
        self.blocks().filter(move |(block, _)| is_seen(*block))
    }
}

impl Seen {
    /// What the stations of a session see, for an arm of `joints` joints.
    pub fn of(layout: &Layout, partition: &Partition, session: usize, joints: usize) -> Self {
        let own = partition.own[session].iter();
        let columns: Vec<usize> = own.chain(&partition.common).copied().collect();
        let mut in_columns = vec![None; layout.size()];
        for (place, &column) in columns.iter().enumerate() {
            in_columns[column] = Some(place);
        }
        let (shapes, blocks): (Vec<_>, Vec<_>) =
            layout.blocks_in(session).partition(|(block, _)| block.shapes().is_some());
        let place =
            |column: usize| in_columns[column].expect("a shape is of all or of one session");
        let of_joint = |joint| JointShapes::of(&shapes, layout, session, joint, place);
        let (mut plain, mut places) = (Vec::new(), vec![usize::MAX; layout.size()]);
        for column in blocks.iter().flat_map(|(_, columns)| columns.clone()) {
            if let Some(place) = in_columns[column] {
                places[column] = plain.len();
                plain.push(place);
            }
        }
        Self {
            columns,
            of_joints: (0..joints).map(of_joint).collect(),
            plain_runs: runs(&plain, partition.own[session].len()),
            plain,
            blocks,
            places,
        }
    }
}
