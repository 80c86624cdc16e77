//! What is known only at the end of a log: its checksum, how it ends, what could not be decompressed.

use super::super::packed::Packed;
use super::super::summary::{self, Ending};
use super::{FileError, LogReject, Scan, SpanClock, Visitor};

const AFTER_DATA_CUT: &str = "the file ends behind its data, without the closing mark: it was cut, or its recorder was \
     stopped hard; no message is lost, but readers that need the summary will refuse it";
const SUMMARY_DAMAGED: &str =
    "the summary at the end is damaged: no message is lost, but readers that need it may fail";

impl<V, E> Scan<'_, V>
where
    V: Visitor<Error = E>,
    E: From<FileError>,
{
    /// Messages outside chunks have no checksum of their own, only the data section as a whole has one.
    pub(super) fn check_unchunked(&mut self) -> Result<(), E> {
        let Some((data_end, stated)) = self.frames.data_crc() else {
            return Ok(());
        };
        // Where bytes are lost the checksum is wrong anyway. A message that cannot be used is no reason for that.
        let damaged = self.account.rejects.iter().any(LogReject::is_damage);
        if self.account.messages_outside_chunks == 0 || damaged {
            return Ok(());
        }
        let found = self.frames.source().checksum(0..data_end);
        let found = found.map_err(|source| self.io(source))?;
        if found != stated {
            let reject = LogReject {
                file: self.account.file.clone(),
                topic: None,
                byte_start: 0,
                byte_end: data_end,
                time_span_ns: None,
                clock: SpanClock::Log,
                messages: None,
                reason: format!(
                    "the checksum of all records is {found:08x} where the log says {stated:08x}: bytes are damaged, and \
                     in messages outside chunks it cannot be told which; they were kept"
                ),
            };
            self.account.reject(reject);
        }
        Ok(())
    }

    /// How the log ends: a summary that is damaged or cut off costs no message here, but other readers need it.
    pub(super) fn judge_end(&mut self) -> Result<(), E> {
        let ending = summary::ending(self.frames.source()).map_err(|source| self.io(source))?;
        self.account.ending = ending.0;
        let end = self.account.bytes;
        let data_end = self.frames.data_end();
        match (data_end, ending.0) {
            (Some(from), Ending::Cut) => self.note((from, end), AFTER_DATA_CUT.to_owned()),
            (Some(from), Ending::Damaged) => self.note((from, end), SUMMARY_DAMAGED.to_owned()),
            _ => {}
        }
        self.account_for_packing();
        Ok(())
    }

    /// What could not be decompressed lies behind everything else; how much it is cannot be known, but a byte of the
    /// compressed file stands for one at least.
    fn account_for_packing(&mut self) {
        let Some(
            packed @ Packed {
                fault: Some(fault), ..
            },
        ) = &self.account.packed
        else {
            return;
        };
        let (bytes, lost) = (self.account.bytes, packed.bytes.saturating_sub(fault.at));
        let (start, reach) = if fault.anywhere {
            (
                0,
                "the damage is somewhere before it; what was decompressed was kept",
            )
        } else {
            (bytes, "what follows cannot be decompressed")
        };
        let reject = LogReject {
            file: self.account.file.clone(),
            topic: None,
            byte_start: start,
            byte_end: bytes.saturating_add(lost),
            time_span_ns: None,
            clock: SpanClock::Log,
            messages: None,
            reason: format!(
                "the zstd file is unsound at its byte {} of {}: {}; {reach}; places are counted in the decompressed log",
                fault.at, packed.bytes, fault.why
            ),
        };
        self.account.bytes = bytes.saturating_add(lost);
        self.account.reject(reject);
    }
}
