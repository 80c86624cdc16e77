//! Optional parts of the model, kept or dropped by their evidence.

use super::components::Part;
use super::layout::Block;
use super::train::Settled;
use crate::fit::model::PartEvidence;

/// A part that can be left out as a whole: its name, and the blocks it consists of.
type Optional = (&'static str, fn(Block) -> bool);

const OPTIONAL: [Optional; 7] = [
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
    ("drift", |block| matches!(block, Block::WarmUp | Block::Drift(_))),
    ("session_scale", |block| matches!(block, Block::Scale(_))),
    ("gear_lines", |block| matches!(block, Block::Line { .. })),
    ("ageing", |block| matches!(block, Block::Ageing { .. })),
    ("session_changes", |block| matches!(block, Block::SessionCurve { .. })),
];

impl Settled {
    /// Compares the model with the one without each optional part, and drops those whose absence the evidence prefers.
    ///
    /// The ratio of both evidences is that of posterior and prior density where all of the part's coefficients are zero (Savage and
    /// Dickey; Dickey 1971), so nothing is trained anew unless a part is dropped.
    pub(super) fn weigh_parts(&mut self) -> Vec<PartEvidence> {
        let mut found = Vec::new();
        for (name, is_of) in OPTIONAL {
            let own = self.state.layout.blocks().filter(|(block, _)| is_of(*block));
            let columns: Vec<usize> = own.flat_map(|(_, columns)| columns).collect();
            if columns.is_empty() {
                continue;
            }
            let Some(gain) = self.evidence.gain_of(&self.posterior, &columns) else { continue };
            let kept = gain > 0.0;
            if !kept {
                let scale = self.posterior.scale_without(&columns);
                let Some(without) = self.evidence.posterior_at(scale) else { continue };
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
            Self::Ageing => name == "ageing",
            Self::Line { .. } => name == "gear_lines",
            Self::ShortCurve(_) | Self::LongCurve(_) => false,
        }
    }
}
