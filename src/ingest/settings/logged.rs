//! `[[tracker.targets]]`: several targets in one tracker's or camera's log, and how each is told from the others.
//!
//! A target is told by the topic of its readings, by a name or number in each message (`fields.target`), or by that of an element of an
//! array of poses, as cameras state the markers that they see.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{TrackerSettings, WrongFields};

/// A target in a log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoggedTarget {
    /// Its name in tables and pages.
    pub name: String,
    /// Topic of its readings. Absent: that of `[tracker]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Its name or number in messages, at the path `fields.target`. Absent: every message of its topic is of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub is: Option<TargetName>,
}

/// The name or number of a target in messages.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "is has to be the target's name in messages, or its number: \"SMR 1\", 3"
)]
pub enum TargetName {
    /// A number.
    Number(i64),
    /// A text.
    Text(String),
}

impl fmt::Display for TargetName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Text(text) => write!(f, "{text:?}"),
        }
    }
}

impl TrackerSettings {
    /// Number of targets.
    pub fn target_count(&self) -> usize {
        self.targets.len().max(1)
    }

    /// The topic of a target.
    pub fn topic_of<'s>(&'s self, target: &'s LoggedTarget) -> &'s str {
        target.topic.as_ref().unwrap_or(&self.topic)
    }

    /// The topics of the readings, each once, the main target's first.
    pub fn topics(&self) -> Vec<&str> {
        let mut topics: Vec<&str> = Vec::new();
        for target in &self.targets {
            if !topics.contains(&self.topic_of(target)) {
                topics.push(self.topic_of(target));
            }
        }
        if topics.is_empty() {
            topics.push(&self.topic);
        }
        topics
    }

    /// Checks that each target can be told from the others.
    pub fn check_targets(&self) -> Result<(), WrongFields> {
        let wrong = |found: String, wanted: &str| {
            Err(WrongFields {
                key: "targets",
                found,
                wanted: wanted.to_owned(),
            })
        };
        if !self.targets_by_geometry.is_empty()
            && (!self.targets.is_empty() || self.fields.target.is_some())
        {
            return wrong(
                "beside targets_by_geometry".to_owned(),
                "left out, as fields.target: readings of one topic that do not name their targets, or that do",
            );
        }
        for (place, target) in self.targets.iter().enumerate() {
            let before = &self.targets[..place];
            if before.iter().any(|other| other.name == target.name) {
                return wrong(
                    format!("{:?} twice", target.name),
                    "a name of its own for each",
                );
            }
            let same_topic = |other: &&LoggedTarget| self.topic_of(other) == self.topic_of(target);
            let clashes = |other: &LoggedTarget| {
                other.is.is_none() || target.is.is_none() || other.is == target.is
            };
            if before.iter().filter(same_topic).any(clashes) {
                return wrong(
                    format!("{:?} on the topic of another", target.name),
                    "a topic of its own, or `is`: its own name or number in messages",
                );
            }
        }
        if self.fields.target.is_some() && self.targets.iter().any(|own| own.is.is_none()) {
            return wrong(
                "fields.target, and a target without `is`".to_owned(),
                "`is` of each target: its name or number at fields.target",
            );
        }
        if self.fields.target.is_some() && self.targets.is_empty() {
            return wrong(
                "fields.target without targets".to_owned(),
                "[[tracker.targets]] with name and `is`",
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> TrackerSettings {
        let least = "topic = \"/t\"\ntime = \"header\"\nunit = \"m\"\n";
        toml::from_str(&format!("{least}{text}")).expect("read")
    }

    #[test]
    fn targets_are_told_by_topic_name_or_number() {
        let by_topic = read("targets = [{ name = \"a\" }, { name = \"b\", topic = \"/b\" }]");
        assert_eq!(by_topic.topics(), ["/t", "/b"]);
        assert!(by_topic.check_targets().is_ok());
        let by_name = read(
            "targets = [{ name = \"a\", is = \"SMR 1\" }, { name = \"b\", is = 2 }]\nfields = { target = \"name\" }",
        );
        assert_eq!(by_name.topics(), ["/t"]);
        assert!(by_name.check_targets().is_ok());
        assert_eq!(read("").topics(), ["/t"]);
        for clash in [
            "targets = [{ name = \"a\" }, { name = \"b\" }]",
            "targets = [{ name = \"a\", is = 1 }, { name = \"b\", is = 1 }]\nfields = { target = \"name\" }",
            "targets = [{ name = \"a\", is = 1 }, { name = \"a\", is = 2 }]\nfields = { target = \"name\" }",
            "targets = [{ name = \"a\" }]\nfields = { target = \"name\" }",
            "fields = { target = \"name\" }",
        ] {
            assert!(read(clash).check_targets().is_err(), "{clash}");
        }
    }
}
