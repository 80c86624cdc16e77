use arrow_array::Array;
use arrow_array::cast::AsArray;
use arrow_array::types::Float64Type;
use arrow_schema::DataType;
use serde_json::Value;

use crate::table::values;

const SHOWN: usize = 120;

#[derive(Debug, Clone, PartialEq)]
pub(super) enum CellDifference {
    /// Only numbers differ; of several in one cell, the pair that differs most.
    Number(Numbers),
    Unlike(String, String),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Numbers {
    pub published: f64,
    pub computed: f64,
}

impl Numbers {
    pub(super) fn absolute(self) -> f64 {
        (self.published - self.computed).abs()
    }

    /// The difference relative to the larger of both, which is not zero where they differ.
    pub(super) fn relative(self) -> f64 {
        self.absolute() / self.published.abs().max(self.computed.abs())
    }
}

/// The difference of the cell `own` of a column from the cell `other` of the computed one; `None` where they are the
/// same.
pub(super) fn difference(
    published: &dyn Array,
    own: usize,
    computed: &dyn Array,
    other: usize,
) -> Option<CellDifference> {
    if published.is_null(own) || computed.is_null(other) {
        let both = published.is_null(own) && computed.is_null(other);
        return (!both).then(|| unlike(published, own, computed, other));
    }
    match published.data_type() {
        DataType::Float64 => {
            let value = |array: &dyn Array, row| array.as_primitive::<Float64Type>().value(row);
            number(value(published, own), value(computed, other))
        }
        DataType::List(_) => {
            let list = |array: &dyn Array, row| array.as_list::<i32>().value(row);
            let (left, right) = (list(published, own), list(computed, other));
            if left.len() != right.len() {
                return Some(unlike(published, own, computed, other));
            }
            (0..left.len())
                .fold(None, |most, place| larger(most, difference(&left, place, &right, place)))
        }
        DataType::Utf8 => {
            let text = |array: &dyn Array, row| array.as_string::<i32>().value(row).to_owned();
            texts(&text(published, own), &text(computed, other))
        }
        _ if published.slice(own, 1).to_data() == computed.slice(other, 1).to_data() => None,
        _ => Some(unlike(published, own, computed, other)),
    }
}

#[expect(
    clippy::float_cmp,
    reason = "equal numbers are no difference, all others are compared by their size"
)]
fn number(published: f64, computed: f64) -> Option<CellDifference> {
    (published != computed).then_some(CellDifference::Number(Numbers { published, computed }))
}

/// The more important of two differences: unlike texts before numbers, then the larger relative difference.
fn larger(a: Option<CellDifference>, b: Option<CellDifference>) -> Option<CellDifference> {
    match (a, b) {
        (None, found) | (found, None) => found,
        (Some(CellDifference::Number(a)), Some(CellDifference::Number(b))) => {
            let larger = if b.relative() > a.relative() { b } else { a };
            Some(CellDifference::Number(larger))
        }
        (Some(unlike @ CellDifference::Unlike(..)), _) | (_, Some(unlike)) => Some(unlike),
    }
}

/// Texts are compared exactly, unless both are JSON: a model's numbers are numbers also there.
fn texts(published: &str, computed: &str) -> Option<CellDifference> {
    if published == computed {
        return None;
    }
    let parsed = |text: &str| {
        let value: Option<Value> = serde_json::from_str(text).ok();
        value.filter(|value| value.is_object() || value.is_array())
    };
    if let (Some(left), Some(right)) = (parsed(published), parsed(computed)) {
        return json("", &left, &right);
    }
    Some(CellDifference::Unlike(short(published), short(computed)))
}

fn json(at: &str, published: &Value, computed: &Value) -> Option<CellDifference> {
    let shown = |value: &Value| short(&format!("{at}: {value}"));
    match (published, computed) {
        (Value::Number(a), Value::Number(b)) if a.is_f64() || b.is_f64() => {
            number(a.as_f64()?, b.as_f64()?)
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            let each = a.iter().zip(b).enumerate();
            each.fold(None, |most, (place, (a, b))| {
                larger(most, json(&format!("{at}[{place}]"), a, b))
            })
        }
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            let each = a.iter().zip(b.values());
            each.fold(None, |most, ((key, a), b)| larger(most, json(&format!("{at}.{key}"), a, b)))
        }
        (a, b) if a == b => None,
        (a, b) => Some(CellDifference::Unlike(shown(a), shown(b))),
    }
}

fn unlike(published: &dyn Array, own: usize, computed: &dyn Array, other: usize) -> CellDifference {
    CellDifference::Unlike(text(published, own), text(computed, other))
}

/// A cell as text for a person, cut where it is long.
pub(super) fn text(array: &dyn Array, row: usize) -> String {
    short(&whole_text(array, row))
}

pub(super) fn whole_text(array: &dyn Array, row: usize) -> String {
    if array.is_null(row) {
        return "null".to_owned();
    }
    values::text(array, row).unwrap_or_else(|| "a value without words".to_owned())
}

fn short(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_within_json_are_numbers_and_all_else_is_exact() {
        let a = r#"{"blocks":[{"name":"sag","sd":[1.0,2.0]}],"n":3}"#;
        assert_eq!(texts(a, a), None);
        let rounded = a.replace("2.0", "2.000000000002");
        let Some(CellDifference::Number(numbers)) = texts(a, &rounded) else {
            panic!("a number differs")
        };
        assert!((numbers.relative() - 1e-12).abs() < 1e-15, "{numbers:?}");
        for (from, to) in [("sag", "drift"), ("3", "4"), (",2.0", ""), ("\"n\"", "\"m\"")] {
            let other = a.replace(from, to);
            let found = texts(a, &other);
            assert!(matches!(found, Some(CellDifference::Unlike(..))), "{from} → {to}: {found:?}");
        }
        // Numbers that stand alone in a text column are texts: "60" is no measured value.
        assert!(matches!(texts("60", "61"), Some(CellDifference::Unlike(..))));
    }

    #[test]
    fn what_is_unlike_outranks_any_number() {
        let found = texts(r#"[1.0, "a"]"#, r#"[9.0, "b"]"#);
        assert_eq!(
            found,
            Some(CellDifference::Unlike("[1]: \"a\"".to_owned(), "[1]: \"b\"".to_owned()))
        );
    }

    #[test]
    fn a_long_text_is_cut_between_letters() {
        let long = "ü".repeat(500);
        assert_eq!(short(&long).chars().count(), SHOWN + 1);
    }
}
