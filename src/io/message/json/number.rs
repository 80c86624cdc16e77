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
    if bytes::take_short_number(written, whole, cell) {
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
