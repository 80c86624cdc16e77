//! Bytes of a log that cannot be read, and why.

use thiserror::Error;

/// Bytes that cannot be read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    pub start: u64,
    pub end: u64,
    pub why: Loss,
    /// Earliest and latest log time that a chunk's header states, ns; `None` for other bytes.
    pub times: Option<(u64, u64)>,
}

/// The reason why bytes are lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Loss {
    /// No record begins here.
    #[error(
        "no sound record begins at byte {0}; reading continued at the next one that can be trusted"
    )]
    Framing(u64),
    /// The file ends inside a record.
    #[error("the file ends inside a record: it was cut, or its recorder was stopped hard")]
    Truncated,
    /// The file ends between two records, without the mark that data is complete.
    #[error(
        "the file ends without a data end record: it was cut or its recorder was stopped hard, and what is missing \
         cannot be known"
    )]
    NoDataEnd,
    /// The mark that data is complete, or the log's closing mark, before the last records of data.
    #[error(
        "the log states that its data ends at byte {0}, but data records follow: they were read; readers that trust the log \
         leave them out"
    )]
    EarlyEnd(u64),
    /// A record whose opcode is unknown or does not belong in the data section.
    #[error(
        "a record with opcode 0x{0:02x} does not belong here: its opcode is damaged, or another format wrote it"
    )]
    Opcode(u8),
    /// A record whose own fields do not fit its length.
    #[error("the fields of a record with opcode 0x{0:02x} do not fit its length")]
    Malformed(u8),
    /// Longer than the limit.
    #[error(
        "a record is longer than the limit of {0} bytes; if that is right, raise record_bytes in [limits]"
    )]
    TooLong(u64),
}
