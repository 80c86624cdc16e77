//! A robot of a pipeline file with several: its name, its folder, and the settings in which it differs.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};
use toml::{Table, Value};

use super::keys::KeyReference;

#[derive(Debug, Clone, PartialEq)]
pub struct RobotEntry {
    pub name: String,
    /// Its folder in that of `[input]`, where that is not named after it.
    pub folder: Option<String>,
    /// Sections with the keys that take the place of those of the file.
    pub settings: Table,
}

impl RobotEntry {
    /// The robot of a table with its keys.
    ///
    /// # Errors
    /// The key that is missing, not known or no text, in words.
    pub fn of(mut table: Table) -> Result<Self, String> {
        let keys = KeyReference::pipeline().section("robots").map_or(&[][..], |own| &own.keys);
        if let Some(strange) = table.keys().find(|own| keys.iter().all(|key| key.key != **own)) {
            let keys: Vec<String> = keys.iter().map(|key| format!("`{}`", key.key)).collect();
            return Err(format!("unknown field `{strange}`, expected one of {}", keys.join(", ")));
        }
        let name = text(&mut table, "name")?.ok_or("missing field `name`")?;
        let folder = text(&mut table, "folder")?;
        let no_section = |(_, value): &(&String, &Value)| !value.is_table();
        if let Some((key, value)) = table.iter().find(no_section) {
            let found = value.type_str();
            return Err(format!("`{key}` is a section, and here it is {found}"));
        }
        Ok(Self { name, folder, settings: table })
    }
}

impl<'de> Deserialize<'de> for RobotEntry {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Self::of(Table::deserialize(from)?).map_err(D::Error::custom)
    }
}

fn text(table: &mut Table, key: &str) -> Result<Option<String>, String> {
    match table.remove(key) {
        None => Ok(None),
        Some(Value::String(text)) => Ok(Some(text)),
        Some(other) => Err(format!("`{key}` is a text, and here it is {}", other.type_str())),
    }
}

/// Puts the settings of a robot into those of the file: a key takes the place of that key of its section, and a section inside a section
/// is such a section too.
/// `place` is the path of the section that they are of, empty for the top of the file.
pub fn put(place: &str, settings: &Table, into: &mut Table) {
    for (key, value) in settings {
        let own = if place.is_empty() { key.clone() } else { format!("{place}.{key}") };
        match (value, into.get_mut(key)) {
            (Value::Table(inner), Some(Value::Table(there))) if is_section(&own) => {
                put(&own, inner, there);
            }
            _ => {
                into.insert(key.clone(), value.clone());
            }
        }
    }
}

/// Whether a table at this path is a section with keys of its own, and no value: one of the file itself, or one without required keys.
fn is_section(place: &str) -> bool {
    let section = KeyReference::pipeline().section(place);
    section
        .is_some_and(|own| !place.contains('.') || own.keys.iter().all(|key| !key.common.required))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        text.parse().expect("TOML")
    }

    #[test]
    fn keys_take_the_place_of_the_files_own_and_values_of_several_keys_as_a_whole() {
        let mut file = table(
            "[robot]\nfile = 'a.toml'\nvalid_for = { tool = 'drill', base = 'floor' }\n\
             [tracker]\ntracker_from_base = { surveyed = { xyz_mm = [1, 2, 3], euler_deg = [0, 0, 0] } }\n\
             [fit]\ntarget = { xyz_mm = [1, 2, 3], sd_mm = 0.2 }\n[tolerance]\nmm = 0.5\nshare = 0.9\n",
        );
        let own = table(
            "[robot]\nfile = 'b.toml'\nvalid_for = { tool = 'rivet' }\n\
             [tracker]\ntracker_from_base = { surveyed = { xyz_mm = [4, 5, 6], quaternion_xyzw = [0, 0, 0, 1] } }\n\
             [fit]\ntarget = { xyz_mm = [7, 8, 9], sd_mm = 1.0 }\nfull = { sd_mm = 0.3 }\n[tolerance]\nmm = 0.3\n",
        );
        put("", &own, &mut file);
        let wanted = table(
            "[robot]\nfile = 'b.toml'\nvalid_for = { tool = 'rivet', base = 'floor' }\n\
             [tracker]\ntracker_from_base = { surveyed = { xyz_mm = [4, 5, 6], quaternion_xyzw = [0, 0, 0, 1] } }\n\
             [fit]\ntarget = { xyz_mm = [7, 8, 9], sd_mm = 1.0 }\nfull = { sd_mm = 0.3 }\n[tolerance]\nmm = 0.3\nshare = 0.9\n",
        );
        assert_eq!(file, wanted);
    }

    #[test]
    fn a_robot_has_a_name_and_no_key_that_nothing_reads() {
        for (text, words) in [
            ("folder = 'a'", "missing field `name`"),
            ("name = 7", "`name` is a text, and here it is integer"),
            ("name = 'a'\nmm = 0.5", "unknown field `mm`"),
            ("name = 'a'\ninput = {}", "unknown field `input`"),
            ("name = 'a'\ntolerance = 0.5", "`tolerance` is a section, and here it is float"),
        ] {
            let found = RobotEntry::of(table(text)).expect_err(text);
            assert!(found.starts_with(words), "{text}: {found}");
        }
    }
}
