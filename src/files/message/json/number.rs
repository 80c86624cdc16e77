use super::bytes;
use crate::message::cell::Cell;
use crate::message::{Decoded, MessageFault};

/// Puts the nearest double, or the whole number where it fits, into a cell; returns the number's end.
#[inline]
pub(super) fn take(text: &[u8], start: usize, cell: &mut Cell) -> Decoded<usize> {
    let (end, whole) = end(text, start)?;
    let written = &text[start..end];
    *cell = if whole && let Ok(integer) = lexical_core::parse(written) {
        Cell::Integer(integer)
    } else {
        Cell::Number(lexical_core::parse(written).map_err(|_| MessageFault::Json)?)
    };
    Ok(end)
}

/// The end of the number at `start`, and whether it is written as a whole number.
#[inline]
pub(super) fn end(text: &[u8], start: usize) -> Decoded<(usize, bool)> {
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

#[inline]
fn digits(text: &[u8], start: usize) -> Decoded<usize> {
    let rest = text.get(start..).unwrap_or_default();
    match bytes::digits(rest) {
        0 if rest.is_empty() => Err(MessageFault::Short),
        0 => Err(MessageFault::Json),
        count => Ok(start + count),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn number(written: &str) -> Cell {
        let mut cell = Cell::Absent;
        let end = take(written.as_bytes(), 0, &mut cell).expect("a number");
        assert_eq!(end, written.len(), "{written}");
        cell
    }

    /// `-` or nothing, up to 20 digits, a point among them or none, an exponent or none.
    fn written(seed: u64) -> String {
        let digits = format!("{:020}", seed.wrapping_mul(6_364_136_223_846_793_005));
        let count = 1 + usize::try_from(seed % 20).expect("small");
        let point = usize::try_from(seed / 20 % 12).expect("small");
        let (whole, behind) = digits[..count].split_at(point.min(count - 1).max(1).min(count));
        let whole = whole.trim_start_matches('0');
        let sign = if seed.is_multiple_of(3) { "-" } else { "" };
        let whole = if whole.is_empty() { "0" } else { whole };
        let behind = if behind.is_empty() { String::new() } else { format!(".{behind}") };
        let exponent = match seed % 7 {
            0 => format!("e{}", seed % 330),
            1 => format!("E-{}", seed % 330),
            _ => String::new(),
        };
        format!("{sign}{whole}{behind}{exponent}")
    }

    #[test]
    fn numbers_are_what_rust_reads() {
        for seed in 0..200_000 {
            let text = written(seed);
            let wanted: f64 = text.parse().expect("a number");
            match number(&text) {
                Cell::Number(number) => assert_eq!(number.to_bits(), wanted.to_bits(), "{text}"),
                Cell::Integer(integer) => assert_eq!(Ok(integer), text.parse(), "{text}"),
                other => panic!("{text}: {other:?}"),
            }
        }
    }

    #[test]
    fn whole_numbers_that_fit_are_integers_and_zeros_keep_their_sign() {
        assert_eq!(number("-0"), Cell::Integer(0));
        assert_eq!(number("9223372036854775807"), Cell::Integer(i64::MAX));
        assert_eq!(number("9223372036854775808"), Cell::Number(9_223_372_036_854_775_808.0));
        let Cell::Number(zero) = number("-0.0") else {
            panic!("no number");
        };
        assert_eq!(zero.to_bits(), (-0.0_f64).to_bits());
    }
}
