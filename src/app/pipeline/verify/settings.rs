//! Two settings as JSON → the keys in which they differ.

use std::collections::BTreeMap;

use serde_json::Value;

/// A setting that differs from the row of `runs`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangedSetting {
    /// Its key, as `grid.steps_mm`.
    pub key: String,
    /// Value in the row; `None` where it has no such key.
    pub claimed: Option<String>,
    /// Value in the pipeline file today; `None` where it has no such key.
    pub found: Option<String>,
}

impl ChangedSetting {
    /// Whether only one side has the key: between versions, a setting that one of them does not know.
    pub(super) const fn is_one_sided(&self) -> bool {
        self.claimed.is_none() != self.found.is_none()
    }
}

pub(in crate::pipeline) fn changed(claimed: &str, found: &str) -> Vec<ChangedSetting> {
    if claimed == found {
        return Vec::new();
    }
    let (claimed, found) = (leaves(claimed), leaves(found));
    let mut keys: Vec<&String> = claimed.keys().chain(found.keys()).collect();
    keys.sort();
    keys.dedup();
    let differ = keys.into_iter().filter(|&key| claimed.get(key) != found.get(key));
    differ
        .map(|key| ChangedSetting {
            key: key.clone(),
            claimed: claimed.get(key).cloned(),
            found: found.get(key).cloned(),
        })
        .collect()
}

/// Every value by its key; a list without sections is one value. A text that is no JSON is one value as a whole.
fn leaves(settings: &str) -> BTreeMap<String, String> {
    let mut leaves = BTreeMap::new();
    match serde_json::from_str(settings) {
        // A plan's settings are those of the file and, in addition, its section [plan].
        Ok(Value::Array(sections)) if sections.len() == 2 => {
            collect("", &sections[0], &mut leaves);
            collect("plan", &sections[1], &mut leaves);
        }
        Ok(value) => collect("", &value, &mut leaves),
        Err(_) => {
            leaves.insert("settings".to_owned(), settings.to_owned());
        }
    }
    leaves
}

fn collect(key: &str, value: &Value, leaves: &mut BTreeMap<String, String>) {
    let below = |name: &str| {
        if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") }
    };
    match value {
        Value::Object(section) if !section.is_empty() => {
            for (name, value) in section {
                collect(&below(name), value, leaves);
            }
        }
        Value::Array(list) if list.iter().any(Value::is_object) => {
            for (place, value) in list.iter().enumerate() {
                collect(&format!("{key}[{place}]"), value, leaves);
            }
        }
        value => {
            leaves.insert(key.to_owned(), value.to_string());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_that_differ_are_reported_by_key_with_both_values() {
        let claimed = r#"{"fit":{"prior_mm":3.0},"grid":{"steps_mm":[60.0,90.0]},"up":null}"#;
        let found = r#"{"fit":{"prior_mm":3.0,"new":1},"grid":{"steps_mm":[60.0]},"up":null}"#;
        let setting = |key: &str, claimed: Option<&str>, found: Option<&str>| ChangedSetting {
            key: key.to_owned(),
            claimed: claimed.map(str::to_owned),
            found: found.map(str::to_owned),
        };
        let told = changed(claimed, found);
        assert_eq!(
            told,
            [
                setting("fit.new", None, Some("1")),
                setting("grid.steps_mm", Some("[60.0,90.0]"), Some("[60.0]")),
            ]
        );
        assert!(told[0].is_one_sided() && !told[1].is_one_sided());
        assert!(changed(claimed, claimed).is_empty());
    }

    #[test]
    fn settings_are_never_the_same_in_silence() {
        let told = changed("no JSON", r#"{"a":1}"#);
        assert_eq!(told.len(), 2, "{told:?}");
        // Sections within a list have keys of their own, and the second of a plan's two is [plan].
        let told = changed(r#"{"a":[{"b":1},{"b":2}]}"#, r#"{"a":[{"b":1},{"b":3}]}"#);
        assert_eq!(told[0].key, "a[1].b");
        let told = changed(r#"[{"a":1},{"b":2}]"#, r#"[{"a":1},{"b":3}]"#);
        assert_eq!(told[0].key, "plan.b");
    }
}
