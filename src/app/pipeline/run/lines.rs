//! Indexes of a lake as lines of JSON, each under a name of its own.

use std::collections::BTreeMap;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// The lines of an index by their names; those that cannot be read are left out.
pub(super) fn parsed<T: DeserializeOwned>(
    text: &str,
    name: impl Fn(&T) -> &String,
) -> BTreeMap<String, T> {
    let lines = text.lines().filter_map(|line| serde_json::from_str(line).ok());
    lines.map(|line: T| (name(&line).clone(), line)).collect()
}

/// The text of an index.
pub(super) fn text<T: Serialize>(lines: &BTreeMap<String, T>) -> String {
    let lines = lines.values();
    let lines = lines.filter_map(|line| serde_json::to_string(line).ok());
    lines.flat_map(|line| [line, "\n".to_owned()]).collect()
}
