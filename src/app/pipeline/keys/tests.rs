//! The reference of keys against what is read: a key, a word or a default that differs is named.

use std::collections::BTreeSet;

use toml::{Table, Value};

use super::*;
use crate::kinematics::RobotFile;
use crate::pipeline::file::PipelineFile;

/// A key that no file has.
const STRANGE: &str = "zz_no_such_key";

/// A kind of file with the struct that reads it.
struct Parity {
    reference: &'static KeyReference,
    read: fn(Value) -> Result<String, String>,
}

const PIPELINE_FILE: fn(Value) -> Result<String, String> = |value| {
    let text = toml::to_string(&value).expect("TOML");
    let file: PipelineFile = value.try_into().map_err(|e: toml::de::Error| e.to_string())?;
    door::check(KeyReference::pipeline(), &text, false).map_err(|faults| faults.to_string())?;
    Ok(format!("{file:?}"))
};
const ROBOT_FILE: fn(Value) -> Result<String, String> = |value| {
    let file: RobotFile = value.try_into().map_err(|e: toml::de::Error| e.to_string())?;
    Ok(format!("{file:?}"))
};

fn both() -> [Parity; 2] {
    [
        Parity { reference: KeyReference::pipeline(), read: PIPELINE_FILE },
        Parity { reference: KeyReference::robot(), read: ROBOT_FILE },
    ]
}

impl Parity {
    /// The section whose keys stand at a path.
    fn section_at(&self, place: &str) -> Option<&'static KeySection> {
        let mut sections = self.reference.sections.iter();
        sections.find(|own| own.places().contains(&place))
    }

    /// The least file that is read: required sections with the examples of their required keys.
    fn least(&self) -> Table {
        let mut file = Table::new();
        for section in &self.reference.sections {
            if section.common.required {
                self.open(&mut file, &section.name);
            }
        }
        file
    }

    /// The table at a path, made with the examples of its required keys where it is not there.
    fn open<'t>(&self, file: &'t mut Table, place: &str) -> &'t mut Table {
        let mut table = file;
        let mut path = String::new();
        if place.is_empty() {
            self.fill(table, "");
        }
        for step in place.split('.').filter(|step| !step.is_empty()) {
            path = if path.is_empty() { step.to_owned() } else { format!("{path}.{step}") };
            let section = self.section_at(&path);
            let repeated = section.is_some_and(|own| own.repeated);
            if !table.get(step).is_some_and(|value| is_open(value, repeated)) {
                let mut new = Table::new();
                self.fill(&mut new, &path);
                let new = Value::Table(new);
                table.insert(step.to_owned(), if repeated { Value::Array(vec![new]) } else { new });
            }
            table = match table.get_mut(step).expect("inserted") {
                Value::Table(table) => table,
                Value::Array(values) => values[0].as_table_mut().expect("a list of tables"),
                _ => unreachable!("a table"),
            };
        }
        table
    }

    /// Puts the required keys of the section at a path into its table.
    fn fill(&self, table: &mut Table, path: &str) {
        let keys = self.section_at(path).into_iter().flat_map(|own| &own.keys);
        for key in keys.filter(|key| key.common.required) {
            let example = key.example.clone().expect("a required key has an example");
            table.entry(key.key.clone()).or_insert(example);
        }
    }

    /// The least file with a change in the section at a path.
    fn with(&self, place: &str, change: impl FnOnce(&mut Table)) -> Result<String, String> {
        let mut file = self.least();
        self.meet(&mut file, place.split('.').next().unwrap_or_default());
        self.meet(&mut file, place);
        change(self.open(&mut file, place));
        for section in self.asked_for(&file) {
            self.meet(&mut file, &section);
        }
        (self.read)(Value::Table(file))
    }

    /// Sections that a key of the file needs and that the file does not have.
    fn asked_for(&self, file: &Table) -> Vec<String> {
        let keys = self.places().flat_map(|(section, place)| {
            let own = section.keys.iter().filter(|key| key.with.is_some());
            own.map(move |key| (place, key))
        });
        let asked = keys.filter(|(place, key)| {
            let own = file.get(*place).and_then(Value::as_table);
            own.is_some_and(|own| own.contains_key(&key.key))
        });
        let sections = asked.filter_map(|(_, key)| key.with.clone());
        sections.filter(|name| !file.contains_key(name)).collect()
    }

    /// Makes a file one with this section: without what it makes needless, and with the keys that need it.
    fn meet(&self, file: &mut Table, name: &str) {
        let needless = |of: &Option<String>| of.as_deref() == Some(name);
        let mut met = false;
        for section in &self.reference.sections {
            if needless(&section.common.unless) {
                file.remove(&section.name);
                met = true;
            } else if let Some(Value::Table(table)) = file.get_mut(&section.name) {
                for key in &section.keys {
                    if needless(&key.common.unless) {
                        table.remove(&key.key);
                    } else if needless(&key.with) {
                        let example = key.example.clone().expect("an example");
                        table.entry(key.key.clone()).or_insert(example);
                    }
                }
            }
        }
        if met {
            self.open(file, name);
        }
    }

    /// Every place of every section that is a table and nothing else.
    fn places(&self) -> impl Iterator<Item = (&'static KeySection, &'static str)> {
        let sections = self.reference.sections.iter();
        sections.flat_map(|section| section.places().into_iter().map(move |place| (section, place)))
    }

    /// The keys that the reference has at a path: those of the section and the sections inside it.
    fn keys_at(&self, section: &KeySection, place: &str) -> BTreeSet<String> {
        let inside = if place.is_empty() { String::new() } else { format!("{place}.") };
        let sections = self.places().filter_map(|(_, other)| {
            let rest = other.strip_prefix(&inside)?;
            let first = rest.split('.').next()?;
            (!first.is_empty()).then(|| first.to_owned())
        });
        let own = section.keys.iter().filter(|key| !key.tag);
        own.map(|key| key.key.clone()).chain(sections).collect()
    }
}

fn is_open(value: &Value, repeated: bool) -> bool {
    match value {
        Value::Table(_) => true,
        Value::Array(values) => repeated && !values.is_empty(),
        _ => false,
    }
}

/// The names in a message of the parser: "unknown field `x`, expected one of `a`, `b`".
fn expected(message: &str) -> BTreeSet<String> {
    let first = message.lines().next().unwrap_or_default();
    let rest = first.split("expected").nth(1).unwrap_or_default();
    let quoted = rest.split('`').skip(1).step_by(2);
    quoted.map(str::to_owned).collect()
}

#[test]
fn every_section_has_the_keys_that_are_read_and_no_other() {
    for parity in both() {
        let file = &parity.reference.file;
        (parity.read)(Value::Table(parity.least())).expect("the least file is read");
        for (section, place) in parity.places().filter(|(own, _)| !own.open) {
            let strange = |table: &mut Table| {
                table.insert(STRANGE.to_owned(), Value::Boolean(true));
            };
            let message = parity.with(place, strange).expect_err("a strange key is refused");
            assert!(message.contains(STRANGE), "{file} file, [{place}]: {message}");
            let (mut known, read) = (parity.keys_at(section, place), expected(&message));
            // Sections that several stages read: the message has the keys of one of them.
            if ["fit", "tracker", "commanded"].contains(&place) {
                known.retain(|key| read.contains(key));
            }
            assert_eq!(
                known, read,
                "{file} file, [{place}]: left the keys of src/pipeline/keys/{file}.toml, right what is read"
            );
        }
    }
}

#[test]
fn required_keys_are_required_and_others_are_not() {
    for parity in both() {
        for (section, place) in parity.places().filter(|(own, _)| !own.open) {
            for key in section.keys.iter().filter(|key| key.common.required) {
                let without = parity.with(place, |table| {
                    table.remove(&key.key);
                });
                assert!(without.is_err(), "[{place}] {} can be left out", key.key);
            }
        }
    }
}

#[test]
fn defaults_and_examples_are_what_is_read() {
    for parity in both() {
        for (section, place) in parity.places() {
            for key in section.keys.iter().filter(|key| !key.common.required) {
                let without = parity.with(place, |table| {
                    table.remove(&key.key);
                });
                let put = |value: &Value| {
                    parity.with(place, |table| {
                        if key.key.starts_with("euler_") {
                            table.remove("quaternion_xyzw");
                        }
                        table.insert(key.key.clone(), value.clone());
                    })
                };
                let place = format!("[{place}] {}", key.key);
                match (&key.default, &key.example, &key.absent) {
                    (Some(default), None, None) => assert_eq!(
                        put(default),
                        without,
                        "{place}: left with its default written, right without"
                    ),
                    (None, Some(example), Some(_)) => {
                        let read = put(example).unwrap_or_else(|e| panic!("{place}: {e}"));
                        let is_empty = example.as_table().is_some_and(Table::is_empty);
                        assert!(is_empty || Ok(read) != without, "{place} has no effect");
                    }
                    _ => panic!("{place} has a default, or an example and what holds without it"),
                }
            }
        }
    }
}

#[test]
fn words_are_those_that_are_read() {
    for parity in both() {
        for (section, place) in parity.places().filter(|(own, _)| !own.open) {
            for key in section.keys.iter().filter(|key| !key.values.is_empty()) {
                if key.kind == "whole number" {
                    continue; // The sign of a joint, whose range the arm checks.
                }
                let put = |word: &str| {
                    let word = Value::String(word.to_owned());
                    let list = key.kind.starts_with("list");
                    let value = if list { Value::Array(vec![word]) } else { word };
                    parity.with(place, |table| {
                        table.insert(key.key.clone(), value);
                    })
                };
                let message = put(STRANGE).expect_err("a strange word is refused");
                let own: BTreeSet<String> = key.values.iter().cloned().collect();
                assert_eq!(own, expected(&message), "[{place}] {}: {message}", key.key);
            }
        }
    }
}

#[test]
fn numbers_have_units_where_their_names_say_so_and_every_key_a_sentence() {
    for parity in both() {
        for key in parity.reference.sections.iter().flat_map(|own| &own.keys) {
            assert!(key.common.about.ends_with('.'), "{}", key.key);
            for (suffix, unit) in [
                ("_mm", "mm"),
                ("_deg", "deg"),
                ("_rad", "rad"),
                ("_s", "s"),
                ("_kg", "kg"),
                ("_bytes", "byte"),
            ] {
                if key.key.ends_with(suffix) {
                    assert_eq!(key.unit.as_deref(), Some(unit), "{}", key.key);
                }
            }
        }
    }
}

#[test]
fn the_json_schemas_of_the_folder_are_those_of_the_keys() {
    for reference in [KeyReference::pipeline(), KeyReference::robot()] {
        let path = format!("../../schemas/json/{}.json", reference.file);
        let text = std::fs::read_to_string(&path).expect("it is there");
        let kept: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let file = &reference.file;
        assert!(
            kept == reference.json_schema(),
            "posegrid schema {file} --format json-schema > schemas/json/{file}.json"
        );
    }
}
