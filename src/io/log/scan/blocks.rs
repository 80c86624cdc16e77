use super::super::block::{Block, BlockFault, Extent, Outcome, Tally};
use super::super::frames::{Loss, Lost};
use super::super::read_summary::ReadSummary;
use super::{LogReject, LossKind, Visitor, ns};

/// Merges a block that was walked, and adds a reject for one that was not.
pub(super) fn settle<V: Visitor>(
    block: &mut Block<V::Part>,
    visitor: &mut V,
    read_summary: &mut ReadSummary,
) {
    let Extent { start, end, ref chunk } = block.extent;
    let reject = |fault: &BlockFault, tally: &Tally| LogReject {
        time_span_ns: tally.times.map(|(first, last)| (ns(first), ns(last))),
        messages: tally.messages,
        ..read_summary.of_bytes((start, end), LossKind::Bytes, fault.to_string())
    };
    let mut rejects: Vec<_> =
        block.faults.iter().map(|(fault, tally)| reject(fault, tally)).collect();
    if let Outcome::Rejected(fault) = &block.outcome {
        let tally = Tally {
            messages: block.indexed,
            times: chunk.as_ref().map(|chunk| (chunk.start_time, chunk.end_time)),
        };
        rejects.push(reject(fault, &tally));
    } else {
        read_summary.count(chunk.as_ref(), block.messages);
        for (opcode, count) in &block.private_records {
            *read_summary.private_records.entry(*opcode).or_default() += count;
        }
        visitor.merge(&block.extent, &mut block.part, &mut rejects);
    }
    for reject in rejects {
        read_summary.reject(reject);
    }
}

pub(super) struct Run {
    pub start: u64,
    pub end: u64,
    last: (u64, bool),
}

impl Run {
    pub fn grown(run: Option<Self>, start: u64, end: u64, is_message: bool) -> Self {
        Self { start: run.map_or(start, |run| run.start), end, last: (start, is_message) }
    }

    /// The message before lost framing: its own length may be wrong; where it is lost from the last record
    /// on, that record is none.
    pub(super) fn yield_to(&mut self, lost: &mut Lost) {
        let (start, is_message) = self.last;
        let is_framing = matches!(lost.why, Loss::Framing(_));
        let of_message = is_message && lost.start == self.end;
        if is_framing && (of_message || lost.start == start) {
            self.end = start;
            lost.start = start;
        }
    }
}
