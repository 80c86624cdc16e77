//! `[[tracker.targets]]` and `[[tracker.references]]`: several targets in one tracker's or camera's log, references beside them, and how
//! each is told from the others.
//!
//! A target is told by the topic of its readings, by a name or number in each message (`fields.target`), or by that of an element of an
//! array of poses, as cameras state the markers that they see.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::{StandsOn, TrackerSettings, WrongFields};

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoggedTarget {
    pub name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub is: Option<TargetName>,
}

/// A reference reflector in a log: it stands on floor or base and should not move.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoggedReference {
    pub name: String,
    pub on: StandsOn,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub is: Option<TargetName>,
}

/// Something that readings are of, a target or a reference: its name, its topic and what messages call it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Seen<'s> {
    pub name: &'s str,
    pub topic: &'s str,
    /// Its name or number in messages; `None` where every message of its topic is of it.
    pub is: Option<&'s TargetName>,
}

/// The name or number of a target in messages.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "is has to be the target's name in messages, or its number: \"SMR 1\", 3"
)]
pub enum TargetName {
    Number(i64),
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
    pub fn target_count(&self) -> usize {
        self.targets.len().max(1)
    }

    /// The targets' names, the main one's first; empty where a single one has none.
    pub fn target_names(&self) -> Vec<String> {
        self.targets.iter().map(|own| own.name.clone()).collect()
    }

    /// Places of the instruments of one length whose readings are on a topic.
    pub fn lengths_on(&self, topic: &str) -> Vec<usize> {
        let own = self.lengths.iter().enumerate().filter(|(_, own)| own.topic == topic);
        own.map(|(place, _)| place).collect()
    }

    pub fn length_topics(&self) -> Vec<&str> {
        distinct(self.lengths.iter().map(|own| own.topic.as_str()))
    }

    /// Everything that readings are of: the targets, the main one first, then the references.
    pub fn seen<'s>(&'s self) -> Vec<Seen<'s>> {
        let unnamed =
            self.targets.is_empty().then_some(Seen { name: "", topic: &self.topic, is: None });
        let seen = |name, topic: &'s Option<String>, is: &'s Option<TargetName>| Seen {
            name,
            topic: topic.as_ref().unwrap_or(&self.topic),
            is: is.as_ref(),
        };
        let targets = self.targets.iter().map(|own| seen(&own.name, &own.topic, &own.is));
        let references = self.references.iter().map(|own| seen(&own.name, &own.topic, &own.is));
        unnamed.into_iter().chain(targets).chain(references).collect()
    }

    /// The topics of the readings, each once, the main target's first.
    pub fn topics(&self) -> Vec<&str> {
        distinct(self.seen().into_iter().map(|own| own.topic))
    }

    /// Whether messages of a topic name what they are of, at `fields.target`.
    pub fn names_on(&self, topic: &str) -> bool {
        let mut seen = self.seen().into_iter();
        seen.any(|own| own.topic == topic && own.is.is_some())
    }

    /// Checks that each target can be told from the others.
    pub fn check_targets(&self) -> Result<(), WrongFields> {
        let wrong = |found: String, wanted: &str| {
            Err(WrongFields { key: "targets", found, wanted: wanted.to_owned() })
        };
        let seen = self.seen();
        for (place, own) in seen.iter().enumerate() {
            let before = &seen[..place];
            if before.iter().any(|other| other.name == own.name) {
                return wrong(
                    format!("{:?} twice", own.name),
                    "a name of its own for each, references included",
                );
            }
            let same_topic = |other: &&Seen<'_>| other.topic == own.topic;
            let clashes =
                |other: &Seen<'_>| other.is.is_none() || own.is.is_none() || other.is == own.is;
            if before.iter().filter(same_topic).any(clashes) {
                return wrong(
                    format!("{:?} on the topic of another", own.name),
                    "a topic of its own, or `is`: its own name or number in messages",
                );
            }
        }
        let is_named = seen.iter().any(|own| own.is.is_some());
        if self.fields.target.is_some() && !self.targets.is_empty() && !is_named {
            return wrong(
                "fields.target, and a target without `is`".to_owned(),
                "`is` of each: its name or number at fields.target",
            );
        }
        if self.fields.target.is_some() && !is_named {
            return wrong(
                "fields.target without targets".to_owned(),
                "[[tracker.targets]] or [[tracker.references]] with name and `is`",
            );
        }
        Ok(())
    }
}

/// Each topic once, in their order.
fn distinct<'t>(all: impl Iterator<Item = &'t str>) -> Vec<&'t str> {
    let mut topics: Vec<&str> = Vec::new();
    for topic in all {
        if !topics.contains(&topic) {
            topics.push(topic);
        }
    }
    topics
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
        let beside = read("references = [{ name = \"F1\", on = \"floor\", topic = \"/f1\" }]");
        assert_eq!(beside.topics(), ["/t", "/f1"]);
        assert!(beside.check_targets().is_ok());
        for clash in [
            "targets = [{ name = \"a\" }, { name = \"b\" }]",
            "targets = [{ name = \"a\", is = 1 }, { name = \"b\", is = 1 }]\nfields = { target = \"name\" }",
            "targets = [{ name = \"a\", is = 1 }, { name = \"a\", is = 2 }]\nfields = { target = \"name\" }",
            "targets = [{ name = \"a\" }]\nfields = { target = \"name\" }",
            "fields = { target = \"name\" }",
            "references = [{ name = \"F1\", on = \"floor\" }]",
            "targets = [{ name = \"a\", topic = \"/a\" }]\nreferences = [{ name = \"a\", on = \"base\" }]",
        ] {
            assert!(read(clash).check_targets().is_err(), "{clash}");
        }
    }
}
