//! A file held against the reference of its keys: what is missing, what nothing reads, and values outside their range, all of it with lines.
//!
//! A reader of TOML stops at its first fault, and knows no ranges; a key that is spelt wrongly is a missing and an unknown one.

use std::cmp::Ordering;

use thiserror::Error;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::{Key, KeyReference, KeySection, Retired};
use crate::nearest::did_you_mean;

#[derive(Debug, Clone, PartialEq, Error)]
#[error("{}; every key: `posegrid schema {file}`", faults.join("; "))]
pub struct Faults {
    /// The kind of file, as the command `schema` knows it.
    pub file: &'static str,
    /// One message for each wrong table or value, with the section, the key and the line.
    pub faults: Vec<String>,
}

/// A table of the file, with the byte where it begins; `None` for the top of the file.
#[derive(Clone, Copy)]
struct Place<'t, 'i> {
    table: &'t DeTable<'i>,
    at: Option<usize>,
    number: Option<usize>,
}

/// A file before the reference of its keys.
struct Door<'t, 'i> {
    reference: &'static KeyReference,
    file: &'t DeTable<'i>,
    /// The file's text; absent where its lines are not those of a file that a person wrote.
    text: Option<&'t str>,
}

/// Checks a file with this text, which is TOML; messages have lines where the text `is_written` by a person.
pub fn check(reference: &'static KeyReference, text: &str, is_written: bool) -> Result<(), Faults> {
    let Ok(file) = DeTable::parse(text) else { return Ok(()) };
    let door = Door { reference, file: file.get_ref(), text: is_written.then_some(text) };
    let mut faults: Vec<String> =
        reference.retired.iter().flat_map(|own| door.of_retired(own)).collect();
    if faults.is_empty() {
        let sections = reference.sections.iter();
        faults = sections.flat_map(|section| door.of_section(section)).collect();
    }
    if faults.is_empty() { Ok(()) } else { Err(Faults { file: &reference.file, faults }) }
}

/// The line where the table `joint` of that name begins, from 1; `None` where the file has none.
pub fn line_of_joint(text: &str, name: &str) -> Option<usize> {
    let file = DeTable::parse(text).ok()?;
    let joints = tables(file.get_ref(), "joint");
    let is_named = |found: &&Place<'_, '_>| text_of(found.table, "name") == Some(name);
    joints.iter().rfind(is_named)?.at.map(|at| line(text, at))
}

impl Door<'_, '_> {
    fn of_retired(&self, own: &Retired) -> Vec<String> {
        let Retired { section, key, value: word, instead } = own;
        let found = tables(self.file, section).into_iter();
        let found = found.filter_map(|place| value_of(place.table, key));
        let found = found.filter(|(_, value)| word.is_none() || value.as_str() == word.as_deref());
        let word = word.as_ref().map(|word| format!(" = {word:?}")).unwrap_or_default();
        found
            .map(|(at, _)| {
                format!("[{section}] {key}{word}{} was retired: {instead}", self.line(at))
            })
            .collect()
    }

    fn of_section(&self, section: &'static KeySection) -> Vec<String> {
        let instead = self.instead(section.common.unless.as_deref());
        let of_place = |place: &str| {
            let found = tables(self.file, place);
            let heading = section.heading();
            match (found.first(), instead) {
                (None, None) if section.common.required => {
                    let keys: Vec<&Key> =
                        section.keys.iter().filter(|key| key.common.required).collect();
                    vec![format!("{heading} is not there, and needs {}", needed(&keys))]
                }
                (Some(_), Some(other)) => {
                    vec![format!("{heading} is beside [{other}]: keep one of the two")]
                }
                _ => found.iter().flat_map(|own| self.of_table(section, place, *own)).collect(),
            }
        };
        section.places().into_iter().flat_map(of_place).collect()
    }

    fn of_table(
        &self,
        section: &'static KeySection,
        place: &str,
        found: Place<'_, '_>,
    ) -> Vec<String> {
        let heading = heading(section, place, found);
        // Which keys there have to be follows from a tag: the reader tells it.
        let tagged = section.keys.iter().any(|key| key.tag);
        let (mut missing, mut faults) = (Vec::new(), Vec::new());
        for key in &section.keys {
            let name = &key.key;
            let instead = self.instead(key.common.unless.as_deref());
            let beside = key.with.as_deref();
            let Some((at, value)) = value_of(found.table, name) else {
                let is_needed = (key.common.required && instead.is_none() && !tagged)
                    || beside.is_some_and(|other| self.has(other))
                    || self.is_of_convention(key, found.table);
                missing.extend(is_needed.then_some(key));
                continue;
            };
            let line = self.line(at);
            if let Some(other) = instead {
                faults.push(format!(
                    "{heading} {name}{line} is beside [{other}]: keep one of the two"
                ));
            } else if let Some(other) = beside.filter(|other| !self.has(other)) {
                faults.push(format!("{heading} {name}{line} needs the section [{other}]"));
            } else if let Some((found, wanted)) = wrong(key, value) {
                faults.push(format!("{heading} {name} = {found}, but it has to be {wanted}{line}"));
            }
        }
        if !missing.is_empty() {
            let line = found.at.map(|at| self.line(at)).unwrap_or_default();
            faults.push(format!("{heading}{line} needs {}", needed(&missing)));
        }
        let is_known = |name: &str| self.known(section, place).any(|known| known == name);
        let names = found.table.keys().filter(|key| !is_known(key.get_ref()));
        let keys: Vec<&str> = section.keys.iter().map(|key| key.key.as_str()).collect();
        let keys = if keys.is_empty() {
            String::new()
        } else {
            format!("; its keys are {}", keys.join(", "))
        };
        faults.extend(names.map(|name| {
            let (line, name) = (self.line(name.span().start), name.get_ref());
            let meant = did_you_mean(name, self.known(section, place));
            format!("{heading} has {name}{line}, which nothing reads{meant}{keys}")
        }));
        faults
    }

    /// The section or key that takes the place of one that says `unless`, where the file has it.
    fn instead<'o>(&self, unless: Option<&'o str>) -> Option<&'o str> {
        unless.filter(|other| self.has(other))
    }

    fn has(&self, path: &str) -> bool {
        let (place, name) = path.rsplit_once('.').unwrap_or(("", path));
        tables(self.file, place).iter().any(|own| own.table.contains_key(name))
    }

    /// Whether a key belongs to every turning joint of the convention that the file names. Other kinds of joint lack some of the keys.
    fn is_of_convention(&self, key: &Key, joint: &DeTable<'_>) -> bool {
        let turns = text_of(joint, "kind").is_none_or(|kind| kind == "revolute")
            && !joint.contains_key("mimic");
        let convention = text_of(self.file, "convention").unwrap_or("standard-dh");
        turns && key.conventions.iter().any(|own| own == convention)
    }

    /// The names that a section may have: its keys, and the sections inside it.
    fn known<'o>(
        &'o self,
        section: &'o KeySection,
        place: &'o str,
    ) -> impl Iterator<Item = &'o str> {
        let places = self.reference.sections.iter().flat_map(KeySection::places);
        let inside = places.filter_map(move |own| {
            let rest = own.strip_prefix(place)?;
            let rest = if place.is_empty() { rest } else { rest.strip_prefix('.')? };
            rest.split('.').next().filter(|step| !step.is_empty())
        });
        section.keys.iter().map(|key| key.key.as_str()).chain(inside)
    }

    fn line(&self, at: usize) -> String {
        self.text.map_or_else(String::new, |text| format!(" (line {})", line(text, at)))
    }
}

/// The section as it is written in the file.
fn heading(section: &KeySection, place: &str, found: Place<'_, '_>) -> String {
    match found.number {
        _ if place.is_empty() => "the top of the file".to_owned(),
        Some(number) if section.repeated => format!("[[{place}]] {number}"),
        _ => format!("[{place}]"),
    }
}

/// The tables at a path, several where a step is a list of tables or any `NAME`.
fn tables<'t, 'i>(file: &'t DeTable<'i>, path: &str) -> Vec<Place<'t, 'i>> {
    let steps = path.split('.').filter(|step| !step.is_empty());
    steps.fold(vec![Place { table: file, at: None, number: None }], |found, step| {
        let inside = found.iter().flat_map(|own| own.table.iter());
        let named = inside.filter(|(key, _)| step == "NAME" || key.get_ref() == step);
        named.flat_map(|(key, value)| places(key.span().start, value)).collect()
    })
}

/// The table that a value is, or those in a list.
fn places<'t, 'i>(at: usize, value: &'t Spanned<DeValue<'i>>) -> Vec<Place<'t, 'i>> {
    match value.get_ref() {
        DeValue::Table(table) => vec![Place { table, at: Some(at), number: None }],
        DeValue::Array(values) => {
            let numbered = values.iter().zip(1..);
            let place = |(value, number): (&'t Spanned<DeValue<'i>>, usize)| {
                let table = value.get_ref().as_table()?;
                Some(Place { table, at: Some(value.span().start), number: Some(number) })
            };
            numbered.filter_map(place).collect()
        }
        _ => Vec::new(),
    }
}

/// The byte where a key begins, and its value.
fn value_of<'t, 'i>(table: &'t DeTable<'i>, name: &str) -> Option<(usize, &'t DeValue<'i>)> {
    table.get_key_value(name).map(|(key, value)| (key.span().start, value.get_ref()))
}

fn text_of<'t>(table: &'t DeTable<'_>, name: &str) -> Option<&'t str> {
    value_of(table, name)?.1.as_str()
}

/// The line of a byte, from 1.
fn line(text: &str, at: usize) -> usize {
    text.bytes().take(at).filter(|&byte| byte == b'\n').count() + 1
}

/// A value, or one in a list, that is not what its key has to be, and what that is; `None` where all are.
fn wrong(key: &Key, value: &DeValue<'_>) -> Option<(String, String)> {
    let shown = match value {
        DeValue::Array(values) if values.is_empty() => {
            return key.filled.then(|| ("[]".to_owned(), "one value or more".to_owned()));
        }
        DeValue::Array(values) => return values.iter().find_map(|own| wrong(key, own.get_ref())),
        DeValue::String(text) => format!("{text:?}"),
        DeValue::Integer(number) => number.to_string(),
        DeValue::Float(number) => number.to_string(),
        DeValue::Boolean(value) => value.to_string(),
        DeValue::Table(_) => "a table".to_owned(),
        DeValue::Datetime(_) => return None,
    };
    let number = number(value);
    let kind = key.kind.as_str();
    let wanted = match kind {
        "number" if number.is_none() => "a number".to_owned(),
        "whole number" if !matches!(value, DeValue::Integer(_)) => "a whole number".to_owned(),
        "true or false" if !matches!(value, DeValue::Boolean(_)) => kind.to_owned(),
        "text" | "path" if value.as_str().is_none() => format!("a {kind}"),
        "table" if !matches!(value, DeValue::Table(_)) => {
            let is_filled = |own: &&toml::Value| own.as_table().is_some_and(|own| !own.is_empty());
            let such = key.example.as_ref().filter(is_filled);
            such.map_or_else(|| "a table".to_owned(), |own| format!("a table, such as {own}"))
        }
        "word" | "list of words"
            if !key.values.iter().any(|own| Some(own.as_str()) == value.as_str()) =>
        {
            words(&key.values)
        }
        _ if number.is_some_and(|own| !own.is_finite()) => "a finite number".to_owned(),
        _ => {
            let range = key.range.as_ref()?;
            let is_outside = number.is_some_and(|own| !holds(range, own));
            return is_outside.then(|| (shown, range.clone()));
        }
    };
    Some((shown, wanted))
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    match value {
        DeValue::Integer(own) => {
            i64::from_str_radix(own.as_str(), own.radix()).ok().map(|own| own as f64)
        }
        DeValue::Float(own) => own.as_str().parse().ok(),
        _ => None,
    }
}

/// A side of a range.
pub(super) struct Bound {
    pub value: f64,
    /// Whether the value itself is outside.
    pub is_strict: bool,
    pub is_lower: bool,
}

/// The bounds of a range as the reference has it: "0 or more", "above 0 and at most 180", "1 to 10".
pub(super) fn bounds(range: &str) -> Vec<Bound> {
    let range = range.replace(" to ", " and ");
    let sides = range.split(" and ").zip([true, false]);
    let bound = |(text, is_lower): (&str, bool)| {
        let strict = text.strip_prefix("above ").or_else(|| text.strip_prefix("below "));
        let at_most = text.trim_start_matches("at most ").trim_end_matches(" or more");
        // What is no number holds for none.
        let value = strict.unwrap_or(at_most).parse().unwrap_or(f64::NAN);
        Bound { value, is_strict: strict.is_some(), is_lower }
    };
    sides.map(bound).collect()
}

fn holds(range: &str, number: f64) -> bool {
    bounds(range).iter().all(|bound| {
        let side = if bound.is_lower { Ordering::Greater } else { Ordering::Less };
        let order = number.partial_cmp(&bound.value);
        order == Some(side) || (order == Some(Ordering::Equal) && !bound.is_strict)
    })
}

/// Keys that are missing: each with the words that it can be, and one alone with what it means.
fn needed(keys: &[&Key]) -> String {
    let name = |key: &&Key| match key.kind.as_str() {
        "word" => format!("{} ({})", key.key, words(&key.values)),
        _ => key.key.clone(),
    };
    let names: Vec<String> = keys.iter().map(name).collect();
    let meaning = match (keys, &keys.first().and_then(|key| key.example.as_ref())) {
        ([key], Some(example)) => {
            let about = key.common.about.trim_end_matches('.');
            format!(", such as {} = {example} ({about})", key.key)
        }
        _ => String::new(),
    };
    names.join(", ") + &meaning
}

/// Words in quotes, as a choice.
fn words(words: &[String]) -> String {
    let quoted: Vec<String> = words.iter().map(|word| format!("{word:?}")).collect();
    match quoted.split_last() {
        Some((last, others)) if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        _ => quoted.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(reference: &'static KeyReference, text: &str) -> Vec<String> {
        check(reference, text, true).map_or_else(|found| found.faults, |()| Vec::new())
    }

    #[test]
    fn all_missing_keys_are_told_with_their_lines() {
        let text = "model = \"m\"\n\n[[joint]]\nname = \"a\"\nalpha_deg = 0\nd_mm = 1\noffset_deg = 0\nsign = 1\n\
                    limits_deg = [-1, 1]\na_mm = 0\n[[joint]]\nname = \"b\"\nalpha = 0\nd_mm = 1\noffset_deg = 0\nlimits_deg = [-1, 1]\n";
        let found = told(KeyReference::robot(), text);
        assert_eq!(
            found[..2],
            [
                "the top of the file needs source, convention (\"standard-dh\", \"md-h\", \"modified-dh\", \"s-model\", \"cpc\", \
                 \"poe\", \"minimal-poe\" or \"urdf\")",
                "[[joint]] 2 (line 11) needs a_mm, alpha_deg, sign",
            ]
        );
        assert!(found[2].starts_with(
            "[[joint]] 2 has alpha (line 13), which nothing reads (did you mean \"alpha_deg\"?); "
        ));
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
    fn sections_choices_and_ranges_are_told() {
        let text = include_str!("../../../../pipelines/quickstart.toml");
        assert_eq!(told(KeyReference::pipeline(), text), [""; 0]);
        let without = |line: &str| text.replace(line, "");
        let shorter = without("time = \"header\"\nunit = \"m\"\n").replace("[tolerance]", "[toll]");
        assert_eq!(
            told(KeyReference::pipeline(), &shorter),
            [
                "the top of the file has toll (line 44), which nothing reads",
                "[commanded] (line 25) needs time (\"header\", \"publish\" or \"log\"), unit (\"m\", \"mm\", \"cm\", \"inch\", \"ft\" or \"um\")",
                "[tracker] (line 31) needs time (\"header\", \"publish\" or \"log\"), unit (\"m\", \"mm\", \"cm\", \"inch\", \"ft\" or \"um\")",
                "[tolerance] is not there, and needs mm, share, confidence",
            ]
        );
        let wrong =
            text.replace("[tolerance]", "[stations]\nheader = \"a\"\n[tolerance]\nmn = inf");
        let found = told(KeyReference::pipeline(), &wrong);
        for part in
            ["[controller] is beside [stations]", "header = \"a\", but it has to be a whole number"]
        {
            assert!(found.iter().any(|own| own.contains(part)), "{part}: {found:?}");
        }
        let tiny = told(KeyReference::pipeline(), &text.replace("mm = 0.5", "mm = 1e-300"));
        assert!(tiny.concat().contains("it has to be 1e-6 to 1000000"), "{tiny:?}");
        assert!(check(KeyReference::pipeline(), "no = [toml", true).is_ok());
    }

    #[test]
    fn a_retired_key_or_word_is_answered_with_what_to_do_instead() {
        let text = include_str!("../../../../pipelines/quickstart.toml");
        let text = text.replace("sessions =", "pool = \"growing\"\nsessions =");
        let found = told(KeyReference::pipeline(), &text.replace("[grid]", "[grid]\nrivals = 1"));
        assert!(
            found[0].starts_with("[grid] rivals (line 47) was retired: leave it out"),
            "{found:?}"
        );
        assert!(found[1].starts_with("[input] pool = \"growing\" (line 18) was retired: write"));
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn a_range_is_read_as_a_person_reads_it() {
        for (range, inside, outside) in [
            ("above 0", 1e-9, 0.0),
            ("0 or more", 0.0, -1e-9),
            ("1 to 1000", 1000.0, 1001.0),
            ("0 to 1", 0.0, f64::NAN),
            ("above 0 and at most 180", 180.0, 0.0),
            ("0 or more and below 1", 0.0, 1.0),
            ("above 0 and below 1", 0.5, 1.0),
        ] {
            assert!(holds(range, inside) && !holds(range, outside), "{range}");
        }
        assert!(!holds("none", 1.0));
    }
}
