//! Facts known only at the end of a log: its checksum, its end, and the bytes that could not be decompressed.

use super::super::packed::Packed;
use super::super::summary::{self, Ending};
use super::{FileError, LogReject, LossKind, Scan, Visitor};

const AFTER_DATA_CUT: &str = "the file ends after its data, without the closing mark: it was cut, or its recorder was \
     stopped hard; no message is lost, but readers that need the summary will refuse it";
const SUMMARY_DAMAGED: &str =
    "the summary at the end is damaged: no message is lost, but readers that need it may fail";
const NO_RECORDS: &str =
    "bytes after the closing mark that are no records: nothing in them was read";

impl<V: Visitor<Error = E>, E: From<FileError>> Scan<'_, V> {
    /// Judges what is known only at the end of a log, which is at byte `end`.
    pub(super) fn end_log(&mut self, end: u64) -> Result<(), E> {
        self.flush()?;
        let log = self.frames.log.start..end;
        let ending = summary::ending(self.frames.source, log.clone());
        let (ending, range) = ending.map_err(|source| self.io(source))?;
        self.check_records()?;
        if end < self.read_summary.bytes {
            // The definitions in the summary were searched at the end of the file.
            self.summary = None;
        }
        self.compare(end, range.filter(|_| ending == Ending::Sound))?;
        match (self.frames.log.data_end, ending) {
            (Some(from), Ending::Cut) => self.note((from, end), AFTER_DATA_CUT.to_owned()),
            (Some(from), Ending::Damaged) => self.note((from, end), SUMMARY_DAMAGED.to_owned()),
            _ => {}
        }
        // A log that was cut is reported, whatever follows it.
        if self.read_summary.logs == 1 || self.read_summary.ending != Ending::Cut {
            self.read_summary.ending = ending;
        }
        self.read_summary.channels.extend(self.registry.end_log());
        Ok(())
    }

    /// Messages and application-specific records outside chunks have only the checksum of the data section.
    fn check_records(&mut self) -> Result<(), E> {
        let Some((data_end, stated)) = self.frames.log.data_crc else { return Ok(()) };
        // Where bytes are lost the checksum is wrong anyway. A message that cannot be used does not make it wrong.
        let rejects = self.read_summary.rejects.get(self.rejects..);
        let damaged = rejects.is_none_or(|of_log| of_log.iter().any(LogReject::is_damage));
        let outside = self.read_summary.messages_outside_chunks > self.outside_chunks;
        let unchecked = outside || !self.private.is_empty();
        if damaged || !unchecked {
            return Ok(());
        }
        let start = self.frames.log.start;
        let found = self.frames.source.checksum(start..data_end);
        let found = found.map_err(|source| self.io(source))?;
        if found == stated {
            return Ok(());
        }
        let (places, what) = if outside {
            (vec![(start, data_end)], "in messages outside chunks")
        } else {
            let places = std::mem::take(&mut self.private);
            (places, "where chunks are sound, in application-specific records")
        };
        let reason = format!(
            "the checksum of all records is {found:08x} where the log states {stated:08x}: bytes are damaged, and \
             {what} it is not known which; they were kept"
        );
        for place in places {
            let reject = self.read_summary.of_bytes(place, LossKind::Bytes, reason.clone());
            self.read_summary.reject(reject);
        }
        Ok(())
    }

    /// Adds a note for bytes after the closing mark of the last log that are no records.
    pub(super) fn note_what_follows(&mut self, log_end: Option<u64>) {
        let bytes = self.read_summary.bytes;
        if let Some(end) = log_end.filter(|&end| end < bytes) {
            self.note((end, bytes), NO_RECORDS.to_owned());
        }
    }

    /// Comes after all other rejects; each byte of the compressed file is counted as one byte, the least that it can
    /// be.
    pub(super) fn reject_undecompressed(&mut self) {
        let Some(packed @ Packed { fault: Some(fault), .. }) = &self.read_summary.packed else {
            return;
        };
        let (bytes, lost) = (self.read_summary.bytes, packed.bytes.saturating_sub(fault.at));
        let (start, reach) = if fault.anywhere {
            (0, "the damage is somewhere before it; what was decompressed was kept")
        } else {
            (bytes, "what follows cannot be decompressed")
        };
        let reason = format!(
            "the zstd file is unsound at its byte {} of {}: {}; {reach}; places are counted in the decompressed log",
            fault.at, packed.bytes, fault.why
        );
        let end = bytes.saturating_add(lost);
        let reject = self.read_summary.of_bytes((start, end), LossKind::Bytes, reason);
        self.read_summary.bytes = end;
        self.read_summary.reject(reject);
    }
}
