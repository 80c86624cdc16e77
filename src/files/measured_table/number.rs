use lexical_core::{ParseFloatOptions, format::STANDARD};

#[derive(Debug, Clone)]
pub(super) struct Numbers {
    mark: u8,
    options: ParseFloatOptions,
}

/// A text that is a number only in another way of writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Contrary {
    OtherMark,
    /// With separators of thousands that nothing else can be: behind them stands a decimal mark.
    Thousands,
    /// With what may be separators of thousands.
    Grouped,
}

impl Default for Numbers {
    fn default() -> Self {
        Self::with('.')
    }
}

impl Numbers {
    pub(super) fn with(mark: char) -> Self {
        let mark = if mark == ',' { b',' } else { b'.' };
        let options = ParseFloatOptions::builder()
            .decimal_point(mark)
            .nan_string(None)
            .inf_string(None)
            .infinity_string(None)
            .build()
            .unwrap_or_default();
        Self { mark, options }
    }

    pub(super) fn mark(&self) -> char {
        char::from(self.mark)
    }

    pub(super) fn other(&self) -> Self {
        Self::with(if self.mark == b',' { '.' } else { ',' })
    }

    /// NaN for `nan` and `inf`; `None` for any other text, and for a number that no double holds.
    #[inline]
    pub(super) fn parse(&self, text: &[u8]) -> Option<f64> {
        match text.first()? {
            b'0'..=b'9' | b'+' | b'-' | b'.' | b',' => {}
            _ => return self.spelled(text),
        }
        match lexical_core::parse_with_options::<f64, STANDARD>(text, &self.options) {
            Ok(number) if number.is_finite() => Some(number),
            Ok(_) => None,
            Err(_) => self.spelled(text),
        }
    }

    /// A text in the spelling of another program: not-a-number, or a number with another minus sign or exponent.
    fn spelled(&self, text: &[u8]) -> Option<f64> {
        not_a_number(text).or_else(|| {
            let plain = plain(std::str::from_utf8(text).ok()?)?;
            let number = lexical_core::parse_with_options::<f64, STANDARD>(&plain, &self.options);
            number.ok().filter(|number| number.is_finite())
        })
    }

    /// Whether a text that is no number is one in another way of writing.
    pub(super) fn contrary(&self, text: &str) -> Option<Contrary> {
        if !is_short_with_digits(text) {
            return None;
        }
        if let Some(group) = grouped(text) {
            return Some(group);
        }
        self.other().parse(text.as_bytes())?;
        text.contains([',', '.']).then_some(Contrary::OtherMark)
    }

    /// A number with separators of thousands as it is written without them, with this decimal mark.
    pub(super) fn ungrouped(&self, text: &str, kind: Contrary) -> String {
        let digits = |own: &str| own.replace(|c: char| !matches!(c, '0'..='9' | '+' | '-'), "");
        match text.rsplit_once(['.', ',']) {
            Some((whole, fraction)) if kind == Contrary::Thousands => {
                format!("{}{}{fraction}", digits(whole), self.mark())
            }
            _ => digits(text),
        }
    }
}

/// NaN for the spellings of not-a-number and infinity, those of old C libraries included.
fn not_a_number(text: &[u8]) -> Option<f64> {
    const SPELLED: [&str; 7] = ["nan", "inf", "infinity", "1.#qnan", "1.#ind", "1.#inf", "1.#snan"];
    let bare = text.strip_prefix(b"-").or(text.strip_prefix(b"+")).unwrap_or(text);
    let is = |word: &&str| bare.eq_ignore_ascii_case(word.as_bytes());
    SPELLED.iter().any(is).then_some(f64::NAN)
}

/// Whether a text may be a number at all.
fn is_short_with_digits(text: &str) -> bool {
    text.len() <= 32 && text.contains(|c: char| c.is_ascii_digit())
}

/// The text with `-` for a minus sign or a dash (`−1.5`), before digits that it follows (`1.5-`), and with `e` for Fortran's exponent
/// (`1.5D+02`); `None` where nothing is rewritten. Without a decimal mark `12-` and `1D3` may be names.
fn plain(text: &str) -> Option<Vec<u8>> {
    if !is_short_with_digits(text) {
        return None;
    }
    let mut plain = text.replace(['−', '–'], "-");
    if text.contains(['.', ',']) {
        plain = plain.replace(['D', 'd'], "e");
        if let Some(digits) = plain.strip_suffix('-').filter(|own| !own.starts_with(['-', '+'])) {
            plain = format!("-{digits}");
        }
    }
    (plain != text).then(|| plain.into_bytes())
}

/// Digits in groups of three with a sign between them: `1.234,5`, `1 234`, `1'234'567`.
fn grouped(text: &str) -> Option<Contrary> {
    let digits = text.trim_start_matches(['+', '-']);
    let sign = digits.chars().find(|c| !c.is_ascii_digit())?;
    if !matches!(sign, '.' | ',' | ' ' | '\'' | '’' | '\u{a0}' | '\u{202f}') {
        return None;
    }
    let parts: Vec<&str> = digits.split(sign).collect();
    let [first, between @ .., last] = &parts[..] else { return None };
    let (last, behind) = last.split_at(last.find(['.', ',']).unwrap_or(last.len()));
    let is = |part: &str| part.bytes().all(|byte| byte.is_ascii_digit());
    let three = |part: &str| part.len() == 3 && is(part);
    let right = (1..=3).contains(&first.len()) && between.iter().all(|part| three(part));
    if !right || !three(last) || !is(behind.get(1..).unwrap_or_default()) {
        return None;
    }
    match behind {
        // One group behind a point or a comma is as well a fraction.
        "" if between.is_empty() && matches!(sign, '.' | ',') => None,
        "" => Some(Contrary::Grouped),
        _ => Some(Contrary::Thousands),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_the_nearest_doubles() {
        let point = Numbers::with('.');
        for text in [
            "1.1284299999999998",
            "2.02011E+13",
            "+1.5",
            ".5",
            "5.",
            "-0",
            "1e22",
            "9007199254740993",
            "0.1e-320",
            "179769313486231570000000000000000000000",
            "2.2250738585072011e-308",
            "0001.50",
        ] {
            let wanted: f64 = text.parse().unwrap();
            assert_eq!(
                point.parse(text.as_bytes()).map(f64::to_bits),
                Some(wanted.to_bits()),
                "{text}"
            );
            let comma = text.replace('.', ",");
            let found = Numbers::with(',').parse(comma.as_bytes());
            assert_eq!(found.map(f64::to_bits), Some(wanted.to_bits()), "{comma}");
        }
        for (text, wanted) in [
            ("−1.5", -1.5),
            ("–90", -90.0),
            ("1.5-", -1.5),
            ("1.5D+02", 150.0),
            ("-2.5d-1", -0.25),
            ("1.5e−2", 0.015),
        ] {
            assert_eq!(point.parse(text.as_bytes()), Some(wanted), "{text}");
            let comma = text.replace('.', ",");
            assert_eq!(Numbers::with(',').parse(comma.as_bytes()), Some(wanted), "{comma}");
        }
        for text in ["nan", "NaN", "-nan", "inf", "-Infinity", "+INF", "1.#QNAN", "-1.#IND"] {
            assert!(point.parse(text.as_bytes()).unwrap().is_nan(), "{text}");
        }
        for text in [
            "",
            "-",
            "+",
            ".",
            "e5",
            "12-",
            "1D3",
            "-1.5-",
            "1.5–2.5",
            "1e999",
            "1.5 mm",
            "0x10",
            "1_000",
            "1,5",
            "1.2.3",
            "N/A",
            "--1",
            "1e",
            "1e+",
        ] {
            assert_eq!(point.parse(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn other_ways_of_writing_are_told() {
        let point = Numbers::with('.');
        let comma = Numbers::with(',');
        for (text, wanted) in [
            ("1,5", Some(Contrary::OtherMark)),
            ("1,234", Some(Contrary::OtherMark)),
            ("1,234.5", Some(Contrary::Thousands)),
            ("-1 234.5", Some(Contrary::Thousands)),
            ("1,234,567", Some(Contrary::Grouped)),
            ("1'234", Some(Contrary::Grouped)),
            ("1\u{202f}234", Some(Contrary::Grouped)),
            ("14.07.2020", None),
            ("A 123", None),
            ("5 mm", None),
            ("12:30", None),
        ] {
            assert_eq!(point.contrary(text), wanted, "{text}");
        }
        for (text, wanted) in
            [("1.575,0", "1575,0"), ("-1,234.5", "-1234,5"), ("1'234'567", "1234567")]
        {
            let kind = comma.contrary(text).unwrap();
            assert_eq!(comma.ungrouped(text, kind), wanted);
            assert!(comma.parse(wanted.as_bytes()).is_some(), "{wanted}");
        }
        assert_eq!(comma.contrary("1.5"), Some(Contrary::OtherMark));
        assert_eq!(comma.contrary("1.234,5"), Some(Contrary::Thousands));
        assert_eq!(comma.contrary("1.234.567"), Some(Contrary::Grouped));
    }
}
