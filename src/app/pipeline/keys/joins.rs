//! The settings that a stage reads, among all settings of a pipeline file: those of ingest and join, which a session as joined follows from,
//! those of training, which an estimate follows from, and those of its grids.

use serde_json::{Map, Value};

use super::{Common, KeyReference, KeySection};

/// A stage as a reader of settings.
struct Stage {
    /// Whether it reads a section or a key; `None` where that does not say so itself.
    reads: fn(&Common) -> Option<bool>,
    /// Whether it reads a section that does not say so: training does, so that a new key never gives one name to two estimates.
    otherwise: bool,
}

/// The settings of ingest and join among all settings of a pipeline file, as JSON of the same shape; sections without any are left out.
pub fn join_settings(all: &Value) -> Value {
    Stage { reads: |own| own.joins, otherwise: false }.settings(all)
}

/// The settings of training, likewise.
pub fn estimate_settings(all: &Value) -> Value {
    Stage { reads: |own| own.estimates, otherwise: true }.settings(all)
}

/// The settings of grids, likewise: what training reads, and sections and keys that say so.
pub fn grids_settings(all: &Value) -> Value {
    Stage { reads: |own| own.grids.or(own.estimates), otherwise: true }.settings(all)
}

impl Stage {
    fn settings(&self, all: &Value) -> Value {
        let sections = all.as_object().into_iter().flatten().filter_map(|(name, value)| {
            let section = KeyReference::pipeline().section(name)?;
            Some((name.clone(), self.in_section(section, value)?))
        });
        Value::Object(sections.collect())
    }

    /// The part of a section's value that the stage reads; `None` where there is none.
    fn in_section(&self, section: &KeySection, value: &Value) -> Option<Value> {
        match value {
            Value::Object(keys) => {
                let read = keys.iter().filter_map(|(key, value)| {
                    Some((key.clone(), self.of_key(section, key, value)?))
                });
                let read: Map<String, Value> = read.collect();
                (!read.is_empty()).then_some(Value::Object(read))
            }
            Value::Array(items) => {
                let read = items.iter().filter_map(|item| self.in_section(section, item));
                let read: Vec<Value> = read.collect();
                (!read.is_empty()).then_some(Value::Array(read))
            }
            other => self.reads_of(section).then(|| other.clone()),
        }
    }

    fn of_key(&self, section: &KeySection, key: &str, value: &Value) -> Option<Value> {
        let inner = KeyReference::pipeline().section(&format!("{}.{key}", section.name));
        if let Some(inner) = inner.filter(|_| is_table(value)) {
            return self.in_section(inner, value);
        }
        let key = section.keys.iter().find(|own| own.key == key);
        let read = key.and_then(|key| (self.reads)(&key.common));
        read.unwrap_or_else(|| self.reads_of(section)).then(|| value.clone())
    }

    fn reads_of(&self, section: &KeySection) -> bool {
        (self.reads)(&section.common).unwrap_or(self.otherwise)
    }
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
            "fit": {"loss": {"kind": "squares"}},
            "tolerance": {"mm": 0.5},
            "output": {"logs": false},
        });
        let expected = json!({
            "robot": {"joints": ["a1"], "up": [0, 0, 1]},
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
        });
        assert_eq!(join_settings(&all), expected);
        assert_eq!(join_settings(&json!({"tolerance": {"mm": 1}})), json!({}));
    }

    #[test]
    fn training_reads_all_but_what_comes_after_it() {
        let all = json!({
            "robot": {"file": "a.toml", "name": "cell-1", "up": [0, 0, 1], "valid_for": {"tool": "drill"}},
            "input": {"folder": "logs", "max_rejected_share": 0.05},
            "commanded": {"target_is_tool": true},
            "tracker": {"uncertainty": {"range_um": 10}},
            "fit": {"loss": {"kind": "squares"}, "full": {"enabled": true}},
            "similarity": {"bins": 15},
            "grid": {"steps_mm": [50], "box": {"low_mm": [0, 0, 0]}, "choose": "within"},
            "tolerance": {"mm": 0.5},
            "report": {
                "locate": {"by": "first", "stations": 50, "target": "known"},
                "leave_sessions_out": true,
                "tool_tip": {"frame": "tool", "xyz_mm": [0, 0, 1]},
            },
            "plan": {"robots": 200, "known": {"lake": "lake"}},
            "output": {"lake": "lake"},
        });
        let expected = json!({
            "robot": {"up": [0, 0, 1]},
            "commanded": {"target_is_tool": true},
            "tracker": {"uncertainty": {"range_um": 10}},
            "fit": {"loss": {"kind": "squares"}, "full": {"enabled": true}},
            // By which sessions that are left out of a pool are judged.
            "report": {
                "locate": {"by": "first", "stations": 50, "target": "known"},
                "leave_sessions_out": true,
            },
        });
        assert_eq!(estimate_settings(&all), expected);
        // Grids read their steps too, and not the rule that chooses among them.
        let mut expected = expected;
        expected["grid"] = json!({"steps_mm": [50], "box": {"low_mm": [0, 0, 0]}});
        assert_eq!(grids_settings(&all), expected);
    }
}
