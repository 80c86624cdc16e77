//! Keys of pipeline files that were retired: what to do instead.

use thiserror::Error;
use toml::{Table, Value};

/// A key that earlier versions read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error("{} was retired: {instead}", self.written())]
pub struct Retired {
    /// Section and key, joined by points.
    key: &'static str,
    /// The value that was retired; `None` where it is the key.
    value: Option<&'static str>,
    /// What to do instead.
    instead: &'static str,
}

/// Every retired key, with what to do instead.
const RETIRED: &[Retired] = &[
    Retired { key: "report.rivals", value: None, instead: RIVALS },
    Retired { key: "grid.rivals", value: None, instead: RIVALS },
    Retired {
        key: "input.pool",
        value: Some("growing"),
        instead: "write pool = \"until\", and pool_latest = 12 so that a night costs the same in every year",
    },
    Retired {
        key: "tracker.targets_by_geometry",
        value: None,
        instead: "log each reflector on a topic of its own, or with its name in each message (of motion capture its labelled markers, as \
                  tf2_msgs/TFMessage has them), and list them in [[tracker.targets]]",
    },
    Retired {
        key: "stations.targets_by_geometry",
        value: None,
        instead: "name the reflector of each reading: by a column, which `target` names, beside `targets`, or by the `name` of each \
                  [[stations.measured]]",
    },
    Retired { key: "plan.instruments", value: None, instead: PLANNED },
    Retired { key: "plan.reflectors_mm", value: None, instead: PLANNED },
];
/// Instruments and reflectors beside those of a plan.
const PLANNED: &str =
    "leave it out: a plan is of one tracker and the main reflector, and the session may have more";
/// Kriging, inverse distances and the neural network as error models.
const RIVALS: &str =
    "leave it out, and judge other error models with pipelines/benchmarks/benchmark.py";

/// The first retired key of a pipeline file with these values, robots' settings included.
pub fn retired(values: &Table) -> Option<Retired> {
    let robots = values.get("robots").and_then(Value::as_array).into_iter().flatten();
    let mut tables = std::iter::once(values).chain(robots.filter_map(Value::as_table));
    tables.find_map(|table| {
        let is_in = |own: &&Retired| {
            let steps: Vec<&str> = own.key.split('.').collect();
            own.is_at(&steps, table)
        };
        RETIRED.iter().find(is_in).copied()
    })
}

impl Retired {
    /// Whether it stands in a table at the path of these steps, each of which may be a list of tables.
    fn is_at(&self, steps: &[&str], table: &Table) -> bool {
        let Some((first, rest)) = steps.split_first() else {
            return false;
        };
        let is_in = |value: &Value| value.as_table().is_some_and(|inner| self.is_at(rest, inner));
        match table.get(*first) {
            None => false,
            Some(value) if rest.is_empty() => {
                self.value.is_none_or(|retired| value.as_str() == Some(retired))
            }
            Some(Value::Array(values)) => values.iter().any(is_in),
            Some(value) => is_in(value),
        }
    }

    /// The key as a file has it.
    fn written(&self) -> String {
        let (section, key) = self.key.rsplit_once('.').unwrap_or(("", self.key));
        let value = self.value.map(|value| format!(" = {value:?}")).unwrap_or_default();
        if section.is_empty() {
            format!("[{key}]{value}")
        } else {
            format!("[{section}] {key}{value}")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_retired_key_is_found_in_lists_and_robots() {
        let own = Retired { key: "tracker.lengths.slips", value: None, instead: "leave it out" };
        let table = |text: &str| toml::from_str::<Table>(text).expect("TOML");
        let is_at = |own: Retired, text: &str| {
            let steps: Vec<&str> = own.key.split('.').collect();
            own.is_at(&steps, &table(text))
        };
        assert!(is_at(own, "[[tracker.lengths]]\n[[tracker.lengths]]\nslips = true"));
        assert!(!is_at(own, "[tracker]\nslips = true"));
        assert_eq!(own.to_string(), "[tracker.lengths] slips was retired: leave it out");
        let word = Retired { key: "input.pool", value: Some("growing"), instead: "leave it out" };
        assert!(is_at(word, "[input]\npool = \"growing\""));
        assert!(!is_at(word, "[input]\npool = \"joint\""));
        assert_eq!(word.to_string(), "[input] pool = \"growing\" was retired: leave it out");
    }
}
