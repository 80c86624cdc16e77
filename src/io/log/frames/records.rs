//! The records in a sound run of frames, such as a chunk's.

pub struct Records<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Records<'a> {
    pub const fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }
}

impl<'a> Iterator for Records<'a> {
    /// Place of the frame, opcode, body; or the place where a frame does not fit.
    type Item = Result<(usize, u8, &'a [u8]), usize>;

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        let start = self.at;
        let rest = self.bytes.get(start..).filter(|rest| !rest.is_empty())?;
        // An unsound frame is always the last one.
        self.at = self.bytes.len();
        let body = rest.get(1..9).and_then(|length| {
            let length = usize::try_from(u64::from_le_bytes(*length.first_chunk()?)).ok()?;
            rest.get(9..length.checked_add(9)?)
        });
        let Some(body) = body else { return Some(Err(start)) };
        self.at = start + 9 + body.len();
        Some(Ok((start, rest[0], body)))
    }
}
