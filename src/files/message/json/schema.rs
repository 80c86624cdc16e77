//! JSON Schema, as far as it shows which fields messages have.

use serde_json::Value;

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
        let mut leaves = Vec::new();
        if let Ok(schema) = serde_json::from_slice::<Value>(bytes) {
            collect(&schema, "", MOST_LEVELS, &mut leaves);
        }
        Self::of(leaves)
    }

    /// The fields of one message, where no schema gives them.
    pub fn of_message(bytes: &[u8]) -> Self {
        let mut leaves = Vec::new();
        if let Ok(message) = serde_json::from_slice::<Value>(bytes) {
            collect_values(&message, "", MOST_LEVELS, &mut leaves);
        }
        Self::of(leaves)
    }

    fn of(mut leaves: Vec<String>) -> Self {
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

fn collect(schema: &Value, path: &str, levels: usize, leaves: &mut Vec<String>) {
    if levels == 0 || leaves.len() > MOST_LEAVES {
        return;
    }
    if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
        for (name, inner) in properties {
            let dot = if path.is_empty() { "" } else { "." };
            collect(inner, &format!("{path}{dot}{name}"), levels - 1, leaves);
        }
    } else if let Some(items) =
        schema.get("items").filter(|items| items.get("properties").is_some())
    {
        collect(items, &format!("{path}[]"), levels - 1, leaves);
    } else if !path.is_empty() {
        leaves.push(path.to_owned());
    }
}

fn collect_values(value: &Value, path: &str, levels: usize, leaves: &mut Vec<String>) {
    if levels == 0 || leaves.len() > MOST_LEAVES {
        return;
    }
    let first = value.as_array().and_then(|elements| elements.first());
    if let Some(members) = value.as_object() {
        for (name, inner) in members {
            let dot = if path.is_empty() { "" } else { "." };
            collect_values(inner, &format!("{path}{dot}{name}"), levels - 1, leaves);
        }
    } else if let Some(first) = first.filter(|first| first.is_object()) {
        collect_values(first, &format!("{path}[]"), levels - 1, leaves);
    } else if !path.is_empty() {
        leaves.push(path.to_owned());
    }
}
