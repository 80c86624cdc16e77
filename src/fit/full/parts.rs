//! Optional parts of the model, kept or dropped by their evidence.

use super::components::Part;
use super::layout::Block;
use super::train::Settled;

/// A part that can be left out as a whole, with its evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct PartEvidence {
    /// The part's name.
    pub name: &'static str,
    /// Log evidence with it minus without it, nats.
    pub gain: f64,
    /// Whether it was kept in the model.
    pub kept: bool,
}

/// A part that can be left out as a whole: its name, and the blocks it consists of.
type Optional = (&'static str, fn(Block) -> bool);

const OPTIONAL: [Optional; 6] = [
    ("gravity", |block| block == Block::Gravity),
    ("command_weight", |block| {
        matches!(
            block,
            Block::CommandWeight
                | Block::ApproachOffset
                | Block::SessionCommandWeight(_)
                | Block::OwnCommandWeight(_)
        )
    }),
    ("drift", |block| {
        matches!(block, Block::WarmUp | Block::Drift(_))
    }),
    ("session_scale", |block| matches!(block, Block::Scale(_))),
    ("gear_lines", |block| matches!(block, Block::Line { .. })),
    ("session_changes", |block| {
        matches!(block, Block::SessionCurve { .. })
    }),
];

impl Settled {
    /// Tries the model without each optional part, and drops those whose absence the evidence prefers.
    pub(super) fn weigh_parts(&mut self) -> Vec<PartEvidence> {
        let mut found = Vec::new();
        for (name, is_of) in OPTIONAL {
            let mut variances = self.posterior.scale.map(|scale| scale * scale);
            let mut columns = 0;
            for (_, own) in self
                .state
                .layout
                .blocks()
                .filter(|(block, _)| is_of(*block))
            {
                columns += own.len();
                variances.rows_mut(own.start, own.len()).fill(0.0);
            }
            if columns == 0 {
                continue;
            }
            let Some(without) = self.evidence.posterior(&variances) else {
                continue;
            };
            let gain = self.posterior.log_evidence - without.log_evidence;
            let kept = gain > 0.0;
            if !kept {
                self.posterior = without;
                self.state.components.drop_parts(|part| part.is_of(name));
            }
            found.push(PartEvidence { name, gain, kept });
        }
        found
    }
}

impl Part {
    fn is_of(self, name: &str) -> bool {
        match self {
            Self::Gravity => name == "gravity",
            Self::WarmUp | Self::Drift => name == "drift",
            Self::SessionCommandWeight | Self::ApproachOffset => name == "command_weight",
            Self::SessionCurve => name == "session_changes",
            Self::Line { .. } => name == "gear_lines",
            Self::ShortCurve(_) | Self::LongCurve(_) => false,
        }
    }
}
