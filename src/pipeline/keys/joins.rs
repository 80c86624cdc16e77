//! The settings that ingest and join read, among all settings of a pipeline file: those that a session as joined follows from.

use serde_json::{Map, Value};

use super::{KeyReference, KeySection};

/// The settings of ingest and join among all settings of a pipeline file, as JSON of the same shape; sections without any are left out.
pub fn join_settings(all: &Value) -> Value {
    let joined = |own: &Map<String, Value>| {
        let sections = own.iter().filter_map(|(name, value)| {
            let section = section(name)?;
            Some((name.clone(), in_section(section, value)?))
        });
        Value::Object(sections.collect())
    };
    all.as_object()
        .map_or_else(|| Value::Object(Map::new()), joined)
}

/// The section of this name.
fn section(name: &str) -> Option<&'static KeySection> {
    let mut sections = KeyReference::pipeline().sections.iter();
    sections.find(|own| own.at.is_empty() && own.name == name)
}

/// The part of a section's value that ingest and join read; `None` where there is none.
fn in_section(section: &KeySection, value: &Value) -> Option<Value> {
    match value {
        Value::Object(keys) => {
            let read = keys.iter().filter_map(|(key, value)| {
                let read = of_key(section, key, value)?;
                Some((key.clone(), read))
            });
            let read: Map<String, Value> = read.collect();
            (!read.is_empty()).then_some(Value::Object(read))
        }
        Value::Array(items) => {
            let read = items.iter().filter_map(|item| in_section(section, item));
            let read: Vec<Value> = read.collect();
            (!read.is_empty()).then_some(Value::Array(read))
        }
        other => section.joins?.then(|| other.clone()),
    }
}

fn of_key(own: &KeySection, key: &str, value: &Value) -> Option<Value> {
    if let (Some(inner), true) = (section(&format!("{}.{key}", own.name)), is_table(value)) {
        return in_section(inner, value);
    }
    let of_key = own.keys.iter().find(|known| known.key == key);
    let joins = of_key.and_then(|known| known.joins).or(own.joins);
    joins?.then(|| value.clone())
}

/// Whether a value is a table, or a list of tables.
fn is_table(value: &Value) -> bool {
    match value {
        Value::Object(_) => true,
        Value::Array(items) => items.iter().all(Value::is_object),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn ingest_and_join_read_how_to_read_and_nothing_of_what_comes_after() {
        let all = json!({
            "robot": {"joints": ["a1"], "up": [0, 0, 1], "valid_for": {"tool": "drill"}},
            "input": {"max_lost_share": 0.01, "max_rejected_share": 0.05},
            "controller": {"topic": "/joints", "fields": {"angles": "q"}},
            "commanded": {"topic": "/command", "target_is_tool": true, "base_from_command": {"xyz_mm": [0, 0, 0]}},
            "tracker": {
                "topic": "/point",
                "tracker_from_base": "fitted",
                "uncertainty": {"range_um": 10},
                "camera": {"mounted": "flange", "noise_px": 0.1},
                "targets": [{"name": "tool", "is": 3}],
            },
            "stations": {
                "lengths": [{"name": "bar", "column": "L", "place": {"xyz_mm": [1, 2, 3]}}],
                "session": null,
            },
            "join": {"min_readings": 3},
            "fit": {
                "loss": {"kind": "squares"},
                "targets": {"A": {"sd_mm": 0.5}},
                "target_distances": [{"between": ["A", "B"], "mm": 1}],
            },
            "tolerance": {"mm": 0.5},
            "output": {"logs": false},
        });
        let expected = json!({
            "robot": {"joints": ["a1"]},
            "input": {"max_lost_share": 0.01},
            "controller": {"topic": "/joints", "fields": {"angles": "q"}},
            "commanded": {"topic": "/command"},
            "tracker": {
                "topic": "/point",
                "camera": {"mounted": "flange"},
                "targets": [{"name": "tool", "is": 3}],
            },
            "stations": {"lengths": [{"name": "bar", "column": "L"}], "session": null},
            "join": {"min_readings": 3},
            // By which readings that do not name their targets are assigned.
            "fit": {
                "targets": {"A": {"sd_mm": 0.5}},
                "target_distances": [{"between": ["A", "B"], "mm": 1}],
            },
        });
        assert_eq!(join_settings(&all), expected);
        assert_eq!(join_settings(&json!({"tolerance": {"mm": 1}})), json!({}));
    }
}
