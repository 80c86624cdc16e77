//! The columns of the error model, block by block.

use std::ops::Range;

/// One part of the model that owns a run of columns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Block {
    /// Geometry, bases and targets: the unknowns of the identification problem.
    Unknowns,
    /// Joints giving way under the torque on them, one coefficient per joint and later point mass.
    Gravity,
    /// Share of the way from reported to commanded angle, one per joint.
    CommandWeight,
    /// Stopping short of the command on the side the joint came from, one per joint: it saturates at small settling errors.
    ApproachOffset,
    /// The command–feedback weight as one session differs from all.
    SessionCommandWeight(usize),
    /// The command–feedback weight of a session whose commanded orientations are not what was sent.
    OwnCommandWeight(usize),
    /// Slow translation of the base that every session repeats: warming up.
    WarmUp,
    /// Slow translation of the base in one session alone.
    Drift(usize),
    /// Scale of one session, its instrument's length unit against the arm's lengths: how far a target moves from the middle of the
    /// session's stations as a share of how far it lies from there.
    Scale(usize),
    /// Error curve of one joint (from 0): pairs `cos, sin` of k q over [`Layout::period_turns`].
    Curve(usize),
    /// How the curve of one joint changed in one session.
    SessionCurve {
        /// The session.
        session: usize,
        /// The joint, from 0.
        joint: usize,
    },
    /// A sine of fixed cycles per turn on the raw angle of one joint.
    Line {
        /// The joint, from 0.
        joint: usize,
        /// Cycles per turn.
        cycles: f64,
    },
}

impl Block {
    /// Whether it is a joint's smooth error curve, of all sessions or of one.
    pub(super) const fn is_curve(self) -> bool {
        matches!(self, Self::Curve(_) | Self::SessionCurve { .. })
    }

    /// Whether it is the arm's own in whatever session: beyond geometry, which shares its block with the sessions' frames.
    pub(super) const fn is_of_arm(self) -> bool {
        matches!(
            self,
            Self::Gravity
                | Self::CommandWeight
                | Self::ApproachOffset
                | Self::Curve(_)
                | Self::Line { .. }
        )
    }
}

/// Blocks in column order.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    blocks: Vec<(Block, Range<usize>)>,
    size: usize,
    period_turns: u32,
}

impl Layout {
    /// No blocks yet; joint curves repeat after `period_turns` turns.
    ///
    /// # Panics
    /// When that is no turn at all.
    pub fn new(period_turns: u32) -> Self {
        assert!(period_turns > 0, "a curve repeats after a turn or more");
        Self {
            blocks: Vec::new(),
            size: 0,
            period_turns,
        }
    }

    /// After how many turns joint curves repeat: the k-th pair of a curve is `cos, sin` of `k q` over this.
    pub const fn period_turns(&self) -> u32 {
        self.period_turns
    }

    /// Puts a block of `columns` behind the others.
    pub fn push(&mut self, block: Block, columns: usize) {
        self.blocks.push((block, self.size..self.size + columns));
        self.size += columns;
    }

    /// Columns in all.
    pub const fn size(&self) -> usize {
        self.size
    }

    /// The blocks with their columns.
    pub fn blocks(&self) -> impl Iterator<Item = (Block, Range<usize>)> {
        self.blocks.iter().cloned()
    }

    /// The columns of one block; `None` where the model has no such part.
    pub fn columns(&self, block: Block) -> Option<Range<usize>> {
        self.blocks
            .iter()
            .find(|(own, _)| *own == block)
            .map(|(_, columns)| columns.clone())
    }

    /// Cycles per turn of the gear lines of one joint.
    pub fn lines(&self, joint: usize) -> Vec<f64> {
        let cycles = |(block, _): &(Block, Range<usize>)| match block {
            Block::Line { joint: own, cycles } if *own == joint => Some(*cycles),
            _ => None,
        };
        self.blocks.iter().filter_map(cycles).collect()
    }
}
