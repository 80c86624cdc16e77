//! Little-endian CDR (XCDR1): values aligned to their size, counted from the end of the encapsulation header.

use super::{LogWriteError, Result};

/// Encapsulation header of little-endian CDR: the representation, then two bytes of options.
const ENCAPSULATION: [u8; 4] = [0, 1, 0, 0];

pub(super) struct Cdr {
    bytes: Vec<u8>,
}

impl Cdr {
    pub(super) fn new() -> Self {
        Self { bytes: ENCAPSULATION.to_vec() }
    }

    /// A number by its bytes, the least significant first.
    pub(super) fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        let behind = (self.bytes.len() - ENCAPSULATION.len()) % N;
        if behind != 0 {
            self.bytes.resize(self.bytes.len() + N - behind, 0);
        }
        self.bytes.extend(bytes);
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.number(value.to_le_bytes());
    }

    /// The number of values that follow.
    pub(super) fn length(&mut self, topic: &str, length: usize) -> Result<()> {
        let counted = u32::try_from(length)
            .map_err(|_| LogWriteError::TooLong { topic: topic.to_owned(), found: length })?;
        self.number(counted.to_le_bytes());
        Ok(())
    }

    /// A string: its length with the closing NUL, then its bytes.
    pub(super) fn string(&mut self, topic: &str, text: &str) -> Result<()> {
        self.length(topic, text.len().saturating_add(1))?;
        self.bytes.extend(text.as_bytes());
        self.bytes.push(0);
        Ok(())
    }

    pub(super) fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}
