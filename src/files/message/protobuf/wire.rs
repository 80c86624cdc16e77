//! Protobuf's wire format: varints, tags, lengths, and the skipping of values.

use crate::message::{Decoded, MessageFault};

const MOST_LEVELS: usize = 64;

pub(super) mod wire_type {
    pub const VARINT: u8 = 0;
    pub const FIXED_64: u8 = 1;
    pub const LENGTH: u8 = 2;
    pub const GROUP: u8 = 3;
    pub const GROUP_END: u8 = 4;
    pub const FIXED_32: u8 = 5;
}

pub(super) struct Wire<'m> {
    /// The bytes up to the end of the message that is read.
    pub(super) bytes: &'m [u8],
    pub(super) at: usize,
}

impl<'m> Wire<'m> {
    pub(super) const fn new(bytes: &'m [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The next field's number and wire type; `None` at the end.
    #[inline]
    pub(super) fn tag(&mut self) -> Decoded<Option<(u32, u8)>> {
        if self.at >= self.bytes.len() {
            return Ok(None);
        }
        let tag = u32::try_from(self.varint()?).map_err(|_| MessageFault::Wire)?;
        let wire_type = (tag & 7).to_le_bytes()[0];
        if tag >> 3 == 0 || wire_type > wire_type::FIXED_32 {
            return Err(MessageFault::Wire);
        }
        Ok(Some((tag >> 3, wire_type)))
    }

    /// A number of up to ten bytes of seven bits each.
    #[inline]
    pub(super) fn varint(&mut self) -> Decoded<u64> {
        let first = *self.bytes.get(self.at).ok_or(MessageFault::Short)?;
        self.at += 1;
        if first < 0x80 {
            return Ok(first.into());
        }
        self.long_varint(first)
    }

    /// Most numbers have one byte: the others are kept out of their way, in a function of its own.
    #[cold]
    fn long_varint(&mut self, first: u8) -> Decoded<u64> {
        let mut number = u64::from(first & 0x7F);
        for shift in (7..70).step_by(7) {
            let byte = *self.bytes.get(self.at).ok_or(MessageFault::Short)?;
            self.at += 1;
            // Only the lowest bit of the tenth byte fits; official readers drop the other bits.
            number |= u64::from(byte & 0x7F) << shift;
            if byte < 0x80 {
                return Ok(number);
            }
        }
        Err(MessageFault::Wire)
    }

    #[inline]
    pub(super) fn fixed<const N: usize>(&mut self) -> Decoded<[u8; N]> {
        let rest = self.bytes.get(self.at..);
        let bytes = rest.and_then(|rest| rest.first_chunk::<N>());
        self.at += N;
        bytes.copied().ok_or(MessageFault::Short)
    }

    /// The end of the bytes of a string, a packed array or a nested message, which begin here.
    #[inline]
    pub(super) fn length(&mut self) -> Decoded<usize> {
        let length = usize::try_from(self.varint()?).map_err(|_| MessageFault::Short)?;
        let end = self.at.checked_add(length);
        end.filter(|&end| end <= self.bytes.len()).ok_or(MessageFault::Short)
    }

    #[inline]
    pub(super) fn skip(&mut self, number: u32, wire_type: u8) -> Decoded<()> {
        match wire_type {
            wire_type::VARINT => self.varint().map(drop),
            wire_type::FIXED_64 => self.fixed::<8>().map(drop),
            _ => self.skip_within(number, wire_type, MOST_LEVELS),
        }
    }

    fn skip_within(&mut self, number: u32, kind: u8, levels: usize) -> Decoded<()> {
        match kind {
            wire_type::VARINT => self.varint().map(drop),
            wire_type::FIXED_64 => self.fixed::<8>().map(drop),
            wire_type::FIXED_32 => self.fixed::<4>().map(drop),
            wire_type::LENGTH => self.length().map(|end| self.at = end),
            wire_type::GROUP => {
                let levels = levels.checked_sub(1).ok_or(MessageFault::Deep)?;
                loop {
                    match self.tag()?.ok_or(MessageFault::Short)? {
                        (end, wire_type::GROUP_END) if end == number => return Ok(()),
                        (inner, kind) => self.skip_within(inner, kind, levels)?,
                    }
                }
            }
            _ => Err(MessageFault::Wire),
        }
    }
}
