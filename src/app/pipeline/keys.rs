//! Every key of pipeline and robot files: section, type, unit, allowed words, default, and a sentence.
//!
//! The two files under `keys/` are the one source: `posegrid schema pipeline` and `posegrid schema robot` show them, and a file is held
//! against them before it is read, so that all faults are reported at once ([`door`]). What is read is decided by the structs of [`super::file`] and [`crate::kinematics::RobotFile`]; a test holds
//! keys, words and defaults of both against each other.

pub mod door;
mod joins;
mod json_schema;
#[cfg(test)]
mod tests;
mod text;

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

pub use joins::{estimate_settings, grids_settings, join_settings};

/// The names under which the command `schema` knows the two files.
pub const FILES: [&str; 2] = ["pipeline", "robot"];

/// Every key of one kind of file.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KeyReference {
    /// The kind of file, one of [`FILES`].
    pub file: String,
    pub about: String,
    /// The chapter of the guide that explains it.
    pub guide: String,
    /// Its sections, in the order of a file.
    #[serde(rename = "section")]
    pub sections: Vec<KeySection>,
    /// Keys that earlier versions read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub retired: Vec<Retired>,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Retired {
    pub section: String,
    pub key: String,
    /// The value that was retired, a text; absent where it is the key.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<String>,
    pub instead: String,
}

/// What a section and a key state alike.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
pub struct Common {
    /// Whether the file, or the section that it stands in, is not read without it.
    #[serde(default)]
    pub required: bool,
    /// The section or key that takes its place: a file has one of the two.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unless: Option<String>,
    /// Whether ingest and join read it, so that it is a setting of a session as joined; of a key where that differs from its section.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joins: Option<bool>,
    /// Whether training reads it, which reads everything that does not say otherwise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub estimates: Option<bool>,
    /// Whether the grids of an estimate read it, beside what training reads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub grids: Option<bool>,
    pub about: String,
}

/// A section of a file, or the keys inside a value.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct KeySection {
    /// Path of the section, empty for the top of the file; or a name for the values in `at`.
    pub name: String,
    /// The keys whose values have these keys; empty for a section of its own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub at: Vec<String>,
    #[serde(flatten)]
    pub common: Common,
    /// Whether it may stand several times, as `[[name]]`.
    #[serde(default)]
    pub repeated: bool,
    /// Whether the value may be something else than a table with these keys.
    #[serde(default)]
    pub open: bool,
    pub keys: Vec<Key>,
}

#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Key {
    pub key: String,
    /// Type of its value, in words.
    #[serde(rename = "type")]
    pub kind: String,
    /// Unit of a number, `1` without dimension; absent for other values and plain counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The range of a number, or of each in a list, as a person reads it: `0 or more`, `above 0 and at most 180`, `1 to 10`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<String>,
    /// Whether a list has a value at least.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub filled: bool,
    /// The words allowed; empty where there are others.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<String>,
    #[serde(flatten)]
    pub common: Common,
    /// The section that has to be in the file with it, and needs it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with: Option<String>,
    /// Whether its word decides which of the other keys of the section there are.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub tag: bool,
    /// The conventions of links that need it, in a robot file: which keys a link has follows from them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub conventions: Vec<String>,
    /// The value where the key is absent; none for a key that is required, or that means something only where it is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub default: Option<toml::Value>,
    /// What holds where the key is absent and there is no default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub absent: Option<String>,
    /// A value that is allowed, where there is no default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub example: Option<toml::Value>,
}

static PIPELINE: LazyLock<KeyReference> =
    LazyLock::new(|| KeyReference::parse(include_str!("keys/pipeline.toml")));
static ROBOT: LazyLock<KeyReference> =
    LazyLock::new(|| KeyReference::parse(include_str!("keys/robot.toml")));

impl KeyReference {
    pub fn pipeline() -> &'static Self {
        &PIPELINE
    }

    pub fn robot() -> &'static Self {
        &ROBOT
    }

    /// The keys of the file of that name in [`FILES`]; `None` for any other name.
    pub fn find(name: &str) -> Option<&'static Self> {
        [Self::pipeline(), Self::robot()].into_iter().find(|reference| reference.file == name)
    }

    /// The section of that path; `None` where the file has none.
    pub fn section(&self, path: &str) -> Option<&KeySection> {
        self.sections.iter().find(|own| own.at.is_empty() && own.name == path)
    }

    fn parse(text: &str) -> Self {
        toml::from_str(text).expect("a test loads the reference of keys")
    }
}

impl KeySection {
    /// Where these keys stand: the section itself, or each value that has them.
    pub fn places(&self) -> Vec<&str> {
        if self.at.is_empty() {
            vec![self.name.as_str()]
        } else {
            self.at.iter().map(String::as_str).collect()
        }
    }
}
