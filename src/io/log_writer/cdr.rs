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

    pub(super) fn i32(&mut self, value: i32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(super) fn f32(&mut self, value: f32) {
        self.align(4);
        self.bytes.extend(value.to_le_bytes());
    }

    pub(super) fn f64(&mut self, value: f64) {
        self.align(8);
        self.bytes.extend(value.to_le_bytes());
    }

    /// The number of values that follow.
    pub(super) fn length(&mut self, topic: &str, length: usize) -> Result<()> {
        let counted = u32::try_from(length)
            .map_err(|_| LogWriteError::TooLong { topic: topic.to_owned(), found: length })?;
        self.u32(counted);
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

    fn align(&mut self, size: usize) {
        let behind = (self.bytes.len() - ENCAPSULATION.len()) % size;
        if behind != 0 {
            self.bytes.resize(self.bytes.len() + size - behind, 0);
        }
    }
}
