//! Keys that an incomplete file lacks, all of them at once.
//!
//! A reader of TOML stops at the first missing key. Here a file that was not read is held against the reference: every required
//! key that is missing, by section and line, and every key that nothing reads, since one that is spelt wrongly is both.

use std::fmt;

use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Key, KeyReference, KeySection};

/// A file with several keys that are missing, or that nothing reads.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "{} keys are missing or not known; every key: `posegrid schema {file}`: {}",
    count(lacks),
    told(lacks)
)]
pub struct Incomplete {
    /// The kind of file, as the command `schema` knows it.
    pub file: &'static str,
    /// What each section lacks.
    pub lacks: Vec<Lack>,
}

/// What a section lacks.
#[derive(Debug, Clone, PartialEq)]
pub struct Lack {
    /// The section as it is written, with its number where there are several, and its line where it stands in the file.
    pub place: String,
    /// Required keys that it has not.
    pub missing: Vec<&'static Key>,
    /// Keys that nothing reads.
    pub unknown: Vec<String>,
}

/// A table of the file, with the line where it begins; `None` for the top of the file.
struct Found<'t, 'i> {
    table: &'t DeTable<'i>,
    line: Option<usize>,
    number: Option<usize>,
}

/// Everything that a file which was not read lacks; `None` where that is a single key or none, of which the reader tells more.
pub fn told_at_once(reference: &'static KeyReference, text: &str) -> Option<Incomplete> {
    let lacks = lacks(reference, text);
    (count(&lacks) > 1).then_some(Incomplete { file: &reference.file, lacks })
}

/// The line where the table `joint` of that name begins, from 1; `None` where the file has none.
pub fn line_of_joint(text: &str, name: &str) -> Option<usize> {
    let file = DeTable::parse(text).ok()?;
    let joints = tables(file.get_ref(), &["joint"], text);
    let is_named = |found: &&Found<'_, '_>| {
        let own = found.table.iter().find(|(key, _)| key.get_ref() == "name");
        own.is_some_and(|(_, value)| value.get_ref().as_str() == Some(name))
    };
    joints.iter().rfind(is_named)?.line
}

/// Everything that the file lacks; empty where it lacks nothing, and where it is no TOML.
fn lacks(reference: &'static KeyReference, text: &str) -> Vec<Lack> {
    let Ok(file) = DeTable::parse(text) else {
        return Vec::new();
    };
    let sections = reference.sections.iter();
    let lacks = sections.flat_map(|section| of_section(reference, section, file.get_ref(), text));
    lacks.filter(|lack| !lack.missing.is_empty() || !lack.unknown.is_empty()).collect()
}

/// Number of keys that are missing or unknown.
fn count(lacks: &[Lack]) -> usize {
    lacks.iter().map(|lack| lack.missing.len() + lack.unknown.len()).sum()
}

fn told(lacks: &[Lack]) -> String {
    let lines: Vec<String> = lacks.iter().map(ToString::to_string).collect();
    lines.join("; ")
}

fn of_section(
    reference: &KeyReference,
    section: &'static KeySection,
    file: &DeTable<'_>,
    text: &str,
) -> Vec<Lack> {
    let of_place = |place: &str| {
        let steps: Vec<&str> = place.split('.').filter(|step| !step.is_empty()).collect();
        let found = tables(file, &steps, text);
        if found.is_empty() && section.required && !has_section(file, section.unless.as_ref()) {
            return vec![whole(section)];
        }
        let lack = |found: &Found<'_, '_>| of_table(reference, section, place, file, found);
        found.iter().map(lack).collect()
    };
    section.places().into_iter().flat_map(of_place).collect()
}

/// A required section that is not there at all.
fn whole(section: &'static KeySection) -> Lack {
    Lack {
        place: format!("{}, which is not there,", section.heading()),
        missing: required(section).collect(),
        unknown: Vec::new(),
    }
}

fn required(section: &'static KeySection) -> impl Iterator<Item = &'static Key> {
    section.keys.iter().filter(|key| key.required)
}

/// Whether the file has the section that makes another one needless.
fn has_section(file: &DeTable<'_>, section: Option<&String>) -> bool {
    section.is_some_and(|section| has_path(file, &section.split('.').collect::<Vec<_>>()))
}

/// Whether there is a value at the path of these keys.
fn has_path(table: &DeTable<'_>, steps: &[&str]) -> bool {
    let Some((first, rest)) = steps.split_first() else {
        return true;
    };
    let own = table.iter().find(|(key, _)| key.get_ref() == first);
    own.is_some_and(|(_, value)| {
        let inner = value.get_ref().as_table();
        rest.is_empty() || inner.is_some_and(|inner| has_path(inner, rest))
    })
}

/// Whether a key belongs to every turning joint of the convention that the file names. Other kinds of joint lack some of the keys.
fn is_of_convention(key: &Key, file: &DeTable<'_>, joint: &DeTable<'_>) -> bool {
    let text = |table: &DeTable<'_>, name: &str| {
        let own = table.iter().find(|(key, _)| key.get_ref() == name);
        own.and_then(|(_, value)| value.get_ref().as_str().map(str::to_owned))
    };
    let has = |name: &str| joint.keys().any(|key| key.get_ref() == name);
    let turns = text(joint, "kind").is_none_or(|kind| kind == "revolute") && !has("mimic");
    let convention = text(file, "convention").unwrap_or_else(|| "standard-dh".to_owned());
    turns && key.conventions.contains(&convention)
}

fn of_table(
    reference: &KeyReference,
    section: &'static KeySection,
    place: &str,
    file: &DeTable<'_>,
    found: &Found<'_, '_>,
) -> Lack {
    let has = |name: &str| found.table.keys().any(|key| key.get_ref() == name);
    // Which keys there have to be follows from a tag: the reader tells it.
    let tagged = section.keys.iter().any(|key| key.tag);
    let needed = section.keys.iter();
    let is_required = |key: &Key| key.required && !has_section(file, key.unless.as_ref());
    let needed = needed.filter(|key| is_required(key) || is_of_convention(key, file, found.table));
    let missing = needed.filter(|key| !tagged && !has(&key.key));
    let unknown = found.table.keys().map(|key| key.get_ref().to_string());
    Lack {
        place: heading(section, place, found),
        missing: missing.collect(),
        unknown: unknown.filter(|name| !is_known(reference, section, place, name)).collect(),
    }
}

/// The table as it is written in the file.
fn heading(section: &KeySection, place: &str, found: &Found<'_, '_>) -> String {
    let own = match found.number {
        _ if place.is_empty() => "the top of the file".to_owned(),
        Some(number) if section.repeated => format!("[[{place}]] {number}"),
        _ => format!("[{place}]"),
    };
    let line = found.line.map(|line| format!(" (line {line})"));
    own + &line.unwrap_or_default()
}

/// Whether a key of a section is read: it is one of its keys, or a section inside it.
fn is_known(reference: &KeyReference, section: &KeySection, place: &str, name: &str) -> bool {
    let inside = if place.is_empty() { name.to_owned() } else { format!("{place}.{name}") };
    section.keys.iter().any(|key| key.key == name)
        || reference
            .sections
            .iter()
            .any(|other| other.name == inside || other.name.starts_with(&format!("{inside}.")))
}

/// The tables at a path, several where a step is a list of tables.
fn tables<'t, 'i>(file: &'t DeTable<'i>, steps: &[&str], text: &str) -> Vec<Found<'t, 'i>> {
    let top = Found { table: file, line: None, number: None };
    steps.iter().fold(vec![top], |found, step| {
        let inside = found.iter().flat_map(|own| own.inside(step, text));
        inside.collect()
    })
}

impl<'t, 'i> Found<'t, 'i> {
    /// The tables under a key.
    fn inside(&self, name: &str, text: &str) -> Vec<Found<'t, 'i>> {
        let own = self.table.iter().find(|(key, _)| key.get_ref() == name);
        let Some((key, value)) = own else {
            return Vec::new();
        };
        let table = |value: &'t Spanned<DeValue<'i>>, at: usize, number| match value.get_ref() {
            DeValue::Table(table) => Some(Found { table, line: Some(line(text, at)), number }),
            _ => None,
        };
        match value.get_ref() {
            DeValue::Array(values) => values
                .iter()
                .zip(1..)
                .filter_map(|(value, number)| table(value, value.span().start, Some(number)))
                .collect(),
            _ => table(value, key.span().start, None).into_iter().collect(),
        }
    }
}

/// The line of a byte, from 1.
fn line(text: &str, at: usize) -> usize {
    text.bytes().take(at).filter(|&byte| byte == b'\n').count() + 1
}

impl fmt::Display for Lack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let missing: Vec<String> = self.missing.iter().copied().map(wanted).collect();
        let unknown: Vec<&str> = self.unknown.iter().map(String::as_str).collect();
        let parts = [
            (!missing.is_empty()).then(|| format!("needs {}", missing.join(", "))),
            (!unknown.is_empty())
                .then(|| format!("has {}, which nothing reads", unknown.join(", "))),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        write!(f, "{} {}", self.place, parts.join(" and "))
    }
}

/// A key with the words that it can be, where there are such.
fn wanted(key: &Key) -> String {
    let words: Vec<String> = key.values.iter().map(|word| format!("\"{word}\"")).collect();
    match words.split_last() {
        Some((last, others)) if !others.is_empty() && key.kind == "word" => {
            format!("{} ({} or {last})", key.key, others.join(", "))
        }
        _ => key.key.clone(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(reference: &'static KeyReference, text: &str) -> Vec<String> {
        lacks(reference, text).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn all_missing_keys_are_told_with_their_lines() {
        let text = "model = \"m\"\n\n[[joint]]\nname = \"a\"\nalpha_deg = 0\nd_mm = 1\noffset_deg = 0\nsign = 1\n\
                    limits_deg = [-1, 1]\na_mm = 0\n[[joint]]\nname = \"b\"\nalpha = 0\nd_mm = 1\noffset_deg = 0\nlimits_deg = [-1, 1]\n";
        assert_eq!(
            told(KeyReference::robot(), text),
            [
                "the top of the file needs source, convention (\"standard-dh\", \"md-h\", \"modified-dh\", \"s-model\", \"cpc\", \
                 \"poe\", \"minimal-poe\" or \"urdf\")",
                "[[joint]] 2 (line 11) needs a_mm, alpha_deg, sign and has alpha, which nothing reads",
            ]
        );
    }

    #[test]
    fn a_link_has_the_keys_of_its_convention() {
        let text = "model = \"m\"\nsource = \"s\"\nconvention = \"s-model\"\n[[joint]]\nname = \"a\"\nalpha_deg = 0\n\
                    limits_deg = [-1, 1]\n[[joint]]\nname = \"b\"\nkind = \"fixed\"\n";
        assert_eq!(
            told(KeyReference::robot(), text),
            ["[[joint]] 1 (line 4) needs a_mm, d_mm, offset_deg, gamma_deg, b_mm, sign"]
        );
        assert_eq!(line_of_joint(text, "b"), Some(8));
        assert_eq!(line_of_joint(text, "c"), None);
    }

    #[test]
    fn sections_and_choices_are_told() {
        let text = include_str!("../../../../pipelines/quickstart.toml");
        assert_eq!(told(KeyReference::pipeline(), text), [""; 0]);
        let without = |line: &str| text.replace(line, "");
        let shorter = without("time = \"header\"\nunit = \"m\"\n").replace("[tolerance]", "[toll]");
        let told = told(KeyReference::pipeline(), &shorter);
        assert_eq!(
            told,
            [
                "the top of the file has toll, which nothing reads",
                "[commanded] (line 24) needs time (\"header\", \"publish\" or \"log\"), unit (\"m\" or \"mm\")",
                "[tracker] (line 30) needs time (\"header\", \"publish\" or \"log\"), unit (\"m\" or \"mm\")",
                "[tolerance], which is not there, needs mm, share, confidence",
            ]
        );
        assert_eq!(lacks(KeyReference::pipeline(), "no = [toml").len(), 0);
    }
}
