//! Eight bytes of a text at once: where a string ends, how long a number is, what a short one says.

use crate::io::message::cell::Cell;

const ONES: u64 = 0x0101_0101_0101_0101;
const HIGH_BITS: u64 = 0x80 * ONES;
const UPPER_HALVES: u64 = 0xF0 * ONES;

/// Where the first quote or backslash is.
#[inline]
pub(super) fn quote_or_backslash(bytes: &[u8]) -> Option<usize> {
    let zeros = |word: u64| word.wrapping_sub(ONES) & !word & HIGH_BITS;
    let mut at = 0;
    while let Some(eight) = bytes.get(at..).and_then(|rest| rest.first_chunk()) {
        let word = u64::from_le_bytes(*eight);
        // Right up to the first hit; what a borrow makes of the bytes behind it does not matter.
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

/// How many digits there are before anything else.
#[inline]
pub(super) fn digits(bytes: &[u8]) -> usize {
    let mut at = 0;
    while let Some(eight) = bytes.get(at..).and_then(|rest| rest.first_chunk()) {
        let word = u64::from_le_bytes(*eight);
        // The upper half of a digit is 3, and still is when 6 is added. A carry reaches only what stands behind
        // a byte that is no digit.
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

/// Which byte has the lowest bit that is set.
#[inline]
const fn place(bits: u64) -> usize {
    bits.trailing_zeros() as usize / 8
}

/// Digits that a number between 0 and 2^53 has at most, whatever they are.
const EXACT_DIGITS: usize = 15;
/// Powers of ten up to the last one that is a number without rounding.
const POWERS: [f64; EXACT_DIGITS + 1] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
];

/// A number of few digits and without an exponent: digits and power of ten are exact, so their quotient is rounded once,
/// as it has to be (W. D. Clinger, "How to read floating point numbers accurately"). False: not so short.
#[inline]
pub(super) fn take_short_number(written: &[u8], whole: bool, cell: &mut Cell) -> bool {
    let (negative, unsigned) = match written {
        [b'-', rest @ ..] => (true, rest),
        rest => (false, rest),
    };
    if unsigned.len() > EXACT_DIGITS + 1 {
        return false;
    }
    let (mut digits, mut behind_point, mut fraction) = (0_u32, 0, 0_i64);
    let mut pointed = false;
    for &byte in unsigned {
        match byte {
            b'0'..=b'9' => {
                fraction = fraction * 10 + i64::from(byte - b'0');
                digits += 1;
                behind_point += usize::from(pointed);
            }
            b'.' => pointed = true,
            _ => return false,
        }
    }
    if digits as usize > EXACT_DIGITS {
        return false;
    }
    *cell = if whole {
        Cell::Integer(if negative { -fraction } else { fraction })
    } else {
        let number = fraction as f64 / POWERS[behind_point];
        Cell::Number(if negative { -number } else { number })
    };
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn short_number(written: &[u8], whole: bool) -> Option<Cell> {
        let mut cell = Cell::Absent;
        take_short_number(written, whole, &mut cell).then_some(cell)
    }

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

    #[test]
    fn short_numbers_are_what_rust_reads() {
        let mut seed = 1_u64;
        for _ in 0..200_000 {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let (digits, point) = (seed >> 40, (seed >> 30) % 14);
            let whole = digits.to_string();
            let point = usize::try_from(point).expect("small").min(whole.len() - 1);
            let sign = if seed & (1 << 29) == 0 { "-" } else { "" };
            let text = match point {
                0 => format!("{sign}{whole}"),
                _ => format!("{sign}{}.{}", &whole[..point], &whole[point..]),
            };
            let wanted: f64 = text.parse().expect("a number");
            match short_number(text.as_bytes(), point == 0) {
                Some(Cell::Number(number)) => {
                    assert_eq!(number.to_bits(), wanted.to_bits(), "{text}");
                }
                Some(Cell::Integer(integer)) => assert_eq!(Ok(integer), text.parse(), "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }

    #[test]
    fn zeros_keep_their_sign_and_long_numbers_are_left_to_others() {
        let bits = |text: &str| match short_number(text.as_bytes(), false) {
            Some(Cell::Number(number)) => Some(number.to_bits()),
            _ => None,
        };
        assert_eq!(bits("-0.0"), Some((-0.0_f64).to_bits()));
        assert_eq!(bits("0.000000000000001"), None); // 16 digits
        assert_eq!(bits("0.00000000000001"), Some(1e-14_f64.to_bits()));
        assert_eq!(bits("1e3"), None);
        assert_eq!(short_number(b"-0", true), Some(Cell::Integer(0)));
    }
}
