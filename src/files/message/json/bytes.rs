//! Searches in a text, eight bytes at once: the end of a string, the length of a number.

const ONES: u64 = 0x0101_0101_0101_0101;
const HIGH_BITS: u64 = 0x80 * ONES;
const UPPER_HALVES: u64 = 0xF0 * ONES;

#[inline]
pub(super) fn quote_or_backslash(bytes: &[u8]) -> Option<usize> {
    let zeros = |word: u64| word.wrapping_sub(ONES) & !word & HIGH_BITS;
    let mut at = 0;
    while let Some(eight) = bytes.get(at..).and_then(|rest| rest.first_chunk()) {
        let word = u64::from_le_bytes(*eight);
        // Correct up to the first hit; a borrow can only change the bytes after it.
        let hits = zeros(word ^ (u64::from(b'"') * ONES)) | zeros(word ^ (u64::from(b'\\') * ONES));
        if hits != 0 {
            return Some(at + place(hits));
        }
        at += 8;
    }
    let rest = bytes.get(at..).unwrap_or_default();
    let found = rest.iter().position(|byte| matches!(byte, b'"' | b'\\'));
    found.map(|found| at + found)
}

#[inline]
pub(super) fn digits(bytes: &[u8]) -> usize {
    let mut at = 0;
    while let Some(eight) = bytes.get(at..).and_then(|rest| rest.first_chunk()) {
        let word = u64::from_le_bytes(*eight);
        // The upper half of a digit is 3, and still is when 6 is added. A carry reaches only bytes after one that is no
        // digit.
        let raised = word.wrapping_add(6 * ONES);
        let others = ((word ^ (0x30 * ONES)) | (raised ^ (0x30 * ONES))) & UPPER_HALVES;
        if others != 0 {
            return at + place(others);
        }
        at += 8;
    }
    let rest = bytes.get(at..).unwrap_or_default();
    let other = rest.iter().position(|byte| !byte.is_ascii_digit());
    at + other.unwrap_or(rest.len())
}

#[inline]
const fn place(bits: u64) -> usize {
    bits.trailing_zeros() as usize / 8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_those_found_byte_by_byte() {
        // Every byte at every place of a text of digits and of letters, short and long.
        for length in 0..20 {
            for at in 0..length {
                for byte in 0..=255_u8 {
                    for (fill, then) in [(b'7', b'x'), (b'x', b'"'), (0xFF, b'\\'), (0x21, 0x23)] {
                        let mut text = vec![fill; length];
                        text[at] = byte;
                        text.push(then);
                        let stop = text.iter().position(|b| matches!(b, b'"' | b'\\'));
                        assert_eq!(quote_or_backslash(&text), stop, "{text:?}");
                        let other = text.iter().position(|b| !b.is_ascii_digit());
                        assert_eq!(digits(&text), other.unwrap_or(text.len()), "{text:?}");
                    }
                }
            }
        }
    }
}
