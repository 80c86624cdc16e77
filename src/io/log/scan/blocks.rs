//! Runs of records outside chunks, and what becomes of a block once it was worked on.

use super::super::account::Account;
use super::super::block::{Block, BlockFault, Extent, Outcome, Tally};
use super::super::frames::{Loss, Lost};
use super::{LogReject, SpanClock, Visitor, ns};

/// Merges a block that was walked, accounts for one that was not.
pub(super) fn settle<V: Visitor>(
    block: &mut Block<V::Part>,
    visitor: &mut V,
    account: &mut Account,
) {
    let Extent {
        start,
        end,
        ref chunk,
        indexed,
    } = block.extent;
    let reject = |fault: &BlockFault, tally: &Tally| LogReject {
        file: account.file.clone(),
        topic: None,
        byte_start: start,
        byte_end: end,
        time_span_ns: tally.times.map(|(first, last)| (ns(first), ns(last))),
        clock: SpanClock::Log,
        messages: tally.messages,
        reason: fault.to_string(),
    };
    let mut rejects: Vec<_> = block
        .faults
        .iter()
        .map(|(fault, tally)| reject(fault, tally))
        .collect();
    if let Outcome::Rejected(fault) = &block.outcome {
        let tally = Tally {
            messages: indexed,
            times: chunk
                .as_ref()
                .map(|chunk| (chunk.start_time, chunk.end_time)),
        };
        rejects.push(reject(fault, &tally));
    } else {
        account.count(chunk.as_ref(), block.messages);
        visitor.merge(&block.extent, &mut block.part, &mut rejects);
    }
    for reject in rejects {
        account.reject(reject);
    }
}

/// Records outside chunks, one after another.
pub(super) struct Run {
    pub start: u64,
    pub end: u64,
    /// Where the last record begins, if it is a message.
    last_message: Option<u64>,
}

impl Run {
    pub fn grown(run: Option<Self>, start: u64, end: u64, is_message: bool) -> Self {
        Self {
            start: run.map_or(start, |run| run.start),
            end,
            last_message: is_message.then_some(start),
        }
    }

    /// Where framing is lost right behind a message, its own length may be what is wrong.
    pub fn yield_to(&mut self, lost: &mut Lost) {
        if let (Loss::Framing(_), Some(start), true) =
            (lost.why, self.last_message, lost.start == self.end)
        {
            self.end = start;
            lost.start = start;
        }
    }
}
