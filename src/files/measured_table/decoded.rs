use std::borrow::Cow;

use super::{MeasuredTableErrorKind, Result};

/// A text, and what was found about its encoding where it is not UTF-8 without a mark.
pub struct Decoded<'b> {
    pub text: Cow<'b, str>,
    pub remark: Option<&'static str>,
}

/// Decodes UTF-8, UTF-16 with or without a byte-order mark, and otherwise Latin-1, which has a character for every
/// byte.
pub fn decode(bytes: &[u8]) -> Result<Decoded<'_>> {
    let (little, big) = (u16::from_le_bytes, u16::from_be_bytes);
    match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => eight(rest),
        [0xff, 0xfe, 0, 0, ..] | [0, 0, 0xfe, 0xff, ..] => Err(no_text(0)),
        [0xff, 0xfe, rest @ ..] => sixteen(rest, little, 2),
        [0xfe, 0xff, rest @ ..] => sixteen(rest, big, 2),
        // The first character of a table is ASCII, nearly always.
        [1..=255, 0, 1..=255, 0, ..] => sixteen(bytes, little, 0),
        [0, 1..=255, 0, 1..=255, ..] => sixteen(bytes, big, 0),
        _ => eight(bytes),
    }
}

fn no_text(at: usize) -> MeasuredTableErrorKind {
    MeasuredTableErrorKind::NoText { at }
}

fn eight(bytes: &[u8]) -> Result<Decoded<'_>> {
    if let Some(at) = bytes.iter().position(|&byte| byte == 0) {
        return Err(no_text(at));
    }
    Ok(match str::from_utf8(bytes) {
        Ok(text) => Decoded { text: Cow::Borrowed(text), remark: None },
        Err(_) => Decoded {
            text: bytes.iter().copied().map(char::from).collect(),
            remark: Some("it is no UTF-8 and read as Latin-1"),
        },
    })
}

fn sixteen(bytes: &[u8], unit: fn([u8; 2]) -> u16, start: usize) -> Result<Decoded<'static>> {
    let (units, rest) = bytes.as_chunks::<2>();
    let mut text = String::with_capacity(units.len());
    let mut at = start;
    for character in char::decode_utf16(units.iter().copied().map(unit)) {
        match character {
            Ok('\0') | Err(_) => return Err(no_text(at)),
            Ok(character) => {
                at += 2 * character.len_utf16();
                text.push(character);
            }
        }
    }
    if !rest.is_empty() {
        return Err(no_text(at));
    }
    Ok(Decoded { text: Cow::Owned(text), remark: Some("it is UTF-16") })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(bytes: &[u8]) -> String {
        decode(bytes).ok().unwrap().text.into_owned()
    }

    #[test]
    fn the_encodings_of_spreadsheets_are_read() {
        let wanted = "x [µm];°\r\n1;2";
        let utf_16: Vec<u16> = wanted.encode_utf16().collect();
        let little: Vec<u8> = utf_16.iter().flat_map(|unit| unit.to_le_bytes()).collect();
        let big: Vec<u8> = utf_16.iter().flat_map(|unit| unit.to_be_bytes()).collect();
        assert_eq!(text(wanted.as_bytes()), wanted);
        assert_eq!(text(format!("\u{feff}{wanted}").as_bytes()), wanted);
        assert_eq!(text(&little), wanted);
        assert_eq!(text(&big), wanted);
        assert_eq!(text(&[&[0xff, 0xfe], little.as_slice()].concat()), wanted);
        assert_eq!(text(&[&[0xfe, 0xff], big.as_slice()].concat()), wanted);
        assert_eq!(text(b"x [\xb5m];\xb0\r\n1;2"), wanted);
    }

    #[test]
    fn what_is_no_text_is_reported_with_its_place() {
        let at = |bytes: &[u8]| match decode(bytes) {
            Err(MeasuredTableErrorKind::NoText { at }) => at,
            _ => panic!("a text"),
        };
        assert_eq!(at(b"x;y\n1\0;2"), 5);
        assert_eq!(at(b"\xff\xfea\0\0\xd8b\0"), 4, "half a pair");
        assert_eq!(at(b"\xff\xfea\0b"), 4, "half a unit");
        assert_eq!(at(b"\xff\xfe\0\0a\0\0\0"), 0, "UTF-32");
    }
}
