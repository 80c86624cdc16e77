use thiserror::Error;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Lost {
    pub start: u64,
    pub end: u64,
    pub why: Loss,
    /// Earliest and latest log time that a chunk's header states, ns; `None` for other bytes.
    pub times: Option<(u64, u64)>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
pub enum Loss {
    #[error(
        "no sound record begins at byte {0}; reading continued at the next one that can be trusted"
    )]
    Framing(u64),
    #[error("the file ends inside a record: it was cut, or its recorder was stopped hard")]
    Truncated,
    #[error(
        "the file ends without a data end record: it was cut or its recorder was stopped hard, and what is missing \
         cannot be known"
    )]
    NoDataEnd,
    #[error(
        "the log states that its data ends at byte {0}, but data records follow: they were read; readers that trust the log \
         leave them out"
    )]
    EarlyEnd(u64),
    #[error(
        "a record with opcode 0x{0:02x} does not belong here: its opcode is damaged, or another format wrote it"
    )]
    Opcode(u8),
    #[error("the fields of a record with opcode 0x{0:02x} do not fit its length")]
    Malformed(u8),
    #[error(
        "a record is longer than the limit of {0} bytes; if that is right, raise record_bytes in [limits]"
    )]
    TooLong(u64),
}
