//! JSON Schema, as far as it shows which fields messages have.

use serde_json::{Map, Value};

use crate::message::FieldPath;

/// The fields in a schema; messages may have others.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct JsonSchema {
    /// Paths of numbers, strings and arrays; not all of a very large type.
    pub leaves: Vec<String>,
}

const MOST_LEAVES: usize = 40;
const MOST_LEVELS: usize = 8;

impl JsonSchema {
    pub fn read(bytes: &[u8]) -> Self {
        Self::of(bytes, |schema| {
            let items = schema.get("items").filter(|items| items.get("properties").is_some());
            (schema.get("properties").and_then(Value::as_object), items)
        })
    }

    /// The fields of one message, where no schema gives them.
    pub fn of_message(bytes: &[u8]) -> Self {
        Self::of(bytes, |value| {
            let first = value.as_array().and_then(|elements| elements.first());
            (value.as_object(), first.filter(|first| first.is_object()))
        })
    }

    fn of(bytes: &[u8], parts: Parts) -> Self {
        let mut leaves = Vec::new();
        if let Ok(root) = serde_json::from_slice(bytes) {
            collect(&root, parts, "", MOST_LEVELS, &mut leaves);
        }
        leaves.sort();
        if leaves.len() > MOST_LEAVES {
            leaves.truncate(MOST_LEAVES);
            leaves.push("…".to_owned());
        }
        Self { leaves }
    }

    pub fn has(&self, path: &FieldPath) -> bool {
        let mut leaves = self.leaves.iter().filter_map(|leaf| FieldPath::parse(leaf).ok());
        leaves.any(|leaf| path.may_be(&leaf))
    }
}

/// The members of an object, or else what each element of an array is.
type Parts = fn(&Value) -> (Option<&Map<String, Value>>, Option<&Value>);

fn collect(value: &Value, parts: Parts, path: &str, levels: usize, leaves: &mut Vec<String>) {
    if levels == 0 || leaves.len() > MOST_LEAVES {
        return;
    }
    match parts(value) {
        (Some(members), _) => {
            for (name, inner) in members {
                let dot = if path.is_empty() { "" } else { "." };
                collect(inner, parts, &format!("{path}{dot}{name}"), levels - 1, leaves);
            }
        }
        (None, Some(element)) => {
            collect(element, parts, &format!("{path}[]"), levels - 1, leaves);
        }
        (None, None) if path.is_empty() => {}
        (None, None) => leaves.push(path.to_owned()),
    }
}
