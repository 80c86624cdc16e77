//! The reference of keys as JSON Schema (draft 2020-12), by which an editor completes a file and underlines what is wrong in it.
//!
//! A fault that it finds is one that [`super::door`] finds. Which keys follow from a word of the same section (`tag`) is left to the reader.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};

use super::{Key, KeyReference, KeySection};

/// A value of the file: the section that it is, if it is one, and what stands inside.
#[derive(Default)]
struct Node<'r> {
    section: Option<&'r KeySection>,
    inside: BTreeMap<&'r str, Node<'r>>,
}

impl KeyReference {
    pub fn json_schema(&self) -> Value {
        let mut root = Node::default();
        for section in &self.sections {
            for place in section.places() {
                let steps = place.split('.').filter(|step| !step.is_empty());
                let node = steps.fold(&mut root, |node, step| node.inside.entry(step).or_default());
                node.section = Some(section);
            }
        }
        let mut schema = root.table();
        schema["$schema"] = json!("https://json-schema.org/draft/2020-12/schema");
        schema["title"] = json!(format!("A {} file of posegrid", self.file));
        schema["description"] = json!(self.about);
        let rules: Vec<Value> = self.instead().chain(self.conventions()).collect();
        schema["allOf"] = json!(rules);
        schema
    }

    /// What has to be there with or without another section: rules of the whole file.
    fn instead(&self) -> impl Iterator<Item = Value> {
        self.sections.iter().filter(|own| own.at.is_empty()).flat_map(|section| {
            let name = section.name.as_str();
            let taken = section.common.unless.as_deref().filter(|_| !name.contains('.'));
            let own = taken.map(|other| {
                let beside = json!({ "not": { "required": [name] } });
                let alone =
                    if section.common.required { json!({ "required": [name] }) } else { json!({}) };
                rule(other, &beside, &alone)
            });
            let keys = section.keys.iter().flat_map(move |key| {
                let is = |wanted: bool| {
                    let there = json!({ "required": [key.key] });
                    let asked = if wanted { there } else { json!({ "not": there }) };
                    json!({ "properties": { name: asked } })
                };
                let unless = key.common.unless.as_deref().filter(|other| !other.contains('.'));
                let unless = unless.map(|other| rule(other, &is(false), &is(true)));
                let with = key.with.as_deref().map(|other| rule(other, &is(true), &is(false)));
                unless.into_iter().chain(with)
            });
            own.into_iter().chain(keys)
        })
    }

    /// The keys that the turning joints of a convention need.
    fn conventions(&self) -> impl Iterator<Item = Value> {
        let section = self.section("").filter(|own| !own.keys.is_empty());
        let key = section.and_then(|own| own.keys.iter().find(|key| key.key == "convention"));
        key.into_iter().flat_map(|key| &key.values).map(|convention| {
            let joints = self.section("joint").into_iter().flat_map(|own| &own.keys);
            let needed = joints.filter(|key| key.conventions.contains(convention));
            let needed: Vec<&str> = needed.map(|key| key.key.as_str()).collect();
            let turns = json!({
                "not": { "required": ["mimic"] },
                "properties": { "kind": { "const": "revolute" } },
            });
            let joint = json!({ "if": turns, "then": { "required": needed } });
            json!({
                "if": { "properties": { "convention": { "const": convention } } },
                "then": { "properties": { "joint": { "items": joint } } },
            })
        })
    }
}

fn rule(other: &str, beside: &Value, alone: &Value) -> Value {
    json!({ "if": { "required": [other] }, "then": beside, "else": alone })
}

impl Node<'_> {
    /// The schema of the value: a table, or a list of them.
    fn schema(&self) -> Value {
        if self.section.is_some_and(|own| own.repeated) {
            json!({ "type": "array", "items": self.table() })
        } else {
            self.table()
        }
    }

    fn table(&self) -> Value {
        let keys = || self.section.into_iter().flat_map(|own| &own.keys);
        let named = self.inside.iter().filter(|(name, _)| **name != "NAME");
        let mut properties: Map<String, Value> =
            named.map(|(name, node)| ((*name).to_owned(), node.schema())).collect();
        for key in keys() {
            let own = self.inside.get(key.key.as_str());
            properties.insert(key.key.clone(), key.schema(own));
        }
        let tagged = keys().any(|key| key.tag);
        let is_needed = |key: &&Key| key.common.required && key.common.unless.is_none() && !tagged;
        let mut required: Vec<&str> =
            keys().filter(is_needed).map(|key| key.key.as_str()).collect();
        let sections = self.inside.iter().filter(|(_, node)| {
            let common = node.section.map(|own| &own.common);
            common.is_some_and(|own| own.required && own.unless.is_none())
        });
        required.extend(sections.map(|(name, _)| *name));
        let others = self.inside.get("NAME").map_or(json!(false), Node::schema);
        let is_open = properties.is_empty() && self.section.is_none();
        let others = if is_open && others == json!(false) { json!(true) } else { others };
        let about = self.section.map(|own| own.common.about.as_str()).unwrap_or_default();
        json!({
            "type": "object",
            "description": about,
            "properties": properties,
            "required": required,
            "additionalProperties": others,
        })
    }
}

impl Key {
    fn schema(&self, inside: Option<&Node<'_>>) -> Value {
        let mut schema = self.of_kind(&self.kind, inside);
        let unit = self.unit.as_deref().filter(|unit| *unit != "1");
        let unit = unit.map(|unit| format!(" In {unit}.")).unwrap_or_default();
        let without = self.absent.as_ref().map(|own| format!(" Without it: {own}."));
        let about = [&self.common.about, &unit, &without.unwrap_or_default()];
        schema["description"] = json!(about.map(String::as_str).concat());
        if let Some(value) = &self.default {
            schema["default"] = json!(value);
        }
        if let Some(value) = &self.example {
            schema["examples"] = json!([value]);
        }
        schema
    }

    /// The schema of a type in words.
    fn of_kind(&self, kind: &str, inside: Option<&Node<'_>>) -> Value {
        match kind {
            "number" => self.within("number"),
            "whole number" if !self.values.is_empty() => {
                let words = self.values.iter().filter_map(|word| word.parse::<i64>().ok());
                json!({ "enum": words.collect::<Vec<_>>() })
            }
            "whole number" => self.within("integer"),
            "true or false" => json!({ "type": "boolean" }),
            "word" => json!({ "enum": self.values }),
            "text" | "path" | "path or address" | "path of a field" => json!({ "type": "string" }),
            "one character" => json!({ "type": "string", "minLength": 1, "maxLength": 1 }),
            "table" | "placement" => {
                inside.map_or_else(|| json!({ "type": "object" }), Node::schema)
            }
            _ => self.of_several(kind, inside),
        }
    }

    fn of_several(&self, kind: &str, inside: Option<&Node<'_>>) -> Value {
        if let Some((one, other)) = kind.split_once(" or ") {
            let kinds = [one, other].map(|own| own.trim_end_matches(',').trim_start_matches("a "));
            return json!({ "anyOf": kinds.map(|own| self.of_kind(own, inside)) });
        }
        if kind == "\"fitted\"" {
            return json!({ "enum": self.values });
        }
        let (count, of) = kind.split_once(' ').unwrap_or_default();
        if of == "of tables"
            && inside.is_some_and(|own| own.section.is_some_and(|own| own.repeated))
        {
            return inside.map(Node::schema).unwrap_or_default();
        }
        let one = of.trim_start_matches("of ").replace("them", "path of a field");
        let items = self.of_kind(one.trim_end_matches('s'), inside);
        let mut list = json!({ "type": "array", "items": items });
        if let Ok(count) = count.parse::<usize>() {
            list["minItems"] = json!(count);
            list["maxItems"] = json!(count);
        } else if self.filled {
            list["minItems"] = json!(1);
        }
        list
    }

    fn within(&self, kind: &str) -> Value {
        let mut schema = json!({ "type": kind });
        for bound in self.range.iter().flat_map(|own| super::door::bounds(own)) {
            let word = match (bound.is_lower, bound.is_strict) {
                (true, true) => "exclusiveMinimum",
                (true, false) => "minimum",
                (false, true) => "exclusiveMaximum",
                (false, false) => "maximum",
            };
            schema[word] = json!(bound.value);
        }
        schema
    }
}
