//! Numbers: where one ends, what it says.

use super::bytes;
use crate::io::message::MessageFault;
use crate::io::message::cell::Cell;

/// Puts the nearest number to what is written at `start` into a cell, tells where it ends; a whole one that fits is an
/// integer.
#[inline]
pub(super) fn take(text: &[u8], start: usize, cell: &mut Cell) -> Result<usize, MessageFault> {
    let (end, whole) = end(text, start)?;
    let written = &text[start..end];
    if take_short_number(written, whole, cell) {
        return Ok(end);
    }
    let written = str::from_utf8(written).map_err(|_| MessageFault::Json)?;
    if whole && let Ok(integer) = written.parse() {
        *cell = Cell::Integer(integer);
    } else {
        *cell = Cell::Number(written.parse().map_err(|_| MessageFault::Json)?);
    }
    Ok(end)
}

/// Where the number at `start` ends, and whether it is written as a whole one.
#[inline]
pub(super) fn end(text: &[u8], start: usize) -> Result<(usize, bool), MessageFault> {
    let sign = |at: usize| text.get(at).copied();
    let first = start + usize::from(sign(start) == Some(b'-'));
    let mut end = digits(text, first)?;
    if sign(first) == Some(b'0') && end > first + 1 {
        return Err(MessageFault::Json);
    }
    let mut whole = true;
    if sign(end) == Some(b'.') {
        end = digits(text, end + 1)?;
        whole = false;
    }
    if let Some(b'e' | b'E') = sign(end) {
        let signed = matches!(sign(end + 1), Some(b'+' | b'-'));
        end = digits(text, end + 1 + usize::from(signed))?;
        whole = false;
    }
    Ok((end, whole))
}

/// Where one digit or more end.
#[inline]
fn digits(text: &[u8], start: usize) -> Result<usize, MessageFault> {
    let rest = text.get(start..).unwrap_or_default();
    match bytes::digits(rest) {
        0 if rest.is_empty() => Err(MessageFault::Short),
        0 => Err(MessageFault::Json),
        count => Ok(start + count),
    }
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
fn take_short_number(written: &[u8], whole: bool, cell: &mut Cell) -> bool {
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
