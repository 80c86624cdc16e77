//! Files compared with their digests: those that a run wrote, and those that it read.

use std::collections::BTreeMap;

use super::claim::Claim;
use crate::io::lake::Lake;
use crate::manifest::{Input, RunKey, Written, digest};

/// A file that a run wrote, and its present state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Output {
    /// TABLE/SESSION.
    pub name: String,
    /// BLAKE3 in the row of `runs`.
    pub claimed: String,
    pub found: Found,
}

/// The present state of a file that a run wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// A file with this BLAKE3.
    Digest(String),
    Missing,
    Unreadable(String),
}

/// An input that differs from the row of `runs`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangedInput {
    pub name: String,
    /// Size and BLAKE3 in the row; `None` where the row does not have it.
    pub claimed: Option<(u64, String)>,
    /// Size and BLAKE3 of the present file, or why there is none.
    pub found: Result<(u64, String), String>,
}

impl Output {
    pub fn is_sound(&self) -> bool {
        self.digest() == Some(&self.claimed)
    }

    pub fn is_missing(&self) -> bool {
        self.found == Found::Missing
    }

    /// BLAKE3 of the present file; `None` where it cannot be read.
    pub const fn digest(&self) -> Option<&String> {
        match &self.found {
            Found::Digest(digest) => Some(digest),
            Found::Missing | Found::Unreadable(_) => None,
        }
    }
}

/// Every file that the row names, digested.
pub(super) fn outputs(claim: &Claim, lake: &Lake) -> Vec<Output> {
    let output = |file: &Written| Output {
        name: file.name(),
        claimed: file.digest.clone(),
        found: found(claim, file, lake),
    };
    claim.files.iter().map(output).collect()
}

fn found(claim: &Claim, file: &Written, lake: &Lake) -> Found {
    let digested = || -> Result<String, String> {
        let opened = lake.open(&file.table, &claim.key.of_session(&file.session));
        let digested = digest(opened.map_err(|error| error.to_string())?);
        let digested = digested.map_err(|error| error.to_string())?;
        Ok(digested.0)
    };
    match digested() {
        Ok(digest) => Found::Digest(digest),
        Err(_) if is_gone(&claim.key, file, lake) => Found::Missing,
        Err(reason) => Found::Unreadable(reason),
    }
}

/// Whether a file of a run is certainly missing; a file that cannot be asked for does not count.
pub(in crate::pipeline) fn is_gone(key: &RunKey, file: &Written, lake: &Lake) -> bool {
    matches!(lake.has(&file.table, &key.of_session(&file.session)), Ok(false))
}

/// Inputs that differ by name, size or digest.
pub(super) fn inputs(claimed: &[Input], found: &[Input]) -> Vec<ChangedInput> {
    let file = |input: &Input| (input.bytes, input.digest.clone());
    let names = by_name(claimed, found, |input| input.name.clone());
    let changed = names.into_iter().filter(|(_, (claimed, found))| claimed != found);
    changed
        .map(|(name, (claimed, found))| ChangedInput {
            name,
            claimed: claimed.map(file),
            found: found.map(file).ok_or_else(|| "there is no such file".to_owned()),
        })
        .collect()
}

/// The files of the row and those found, or computed, by name.
pub(super) fn by_name<'f, T>(
    claimed: &'f [T],
    found: &'f [T],
    name: impl Fn(&T) -> String,
) -> BTreeMap<String, (Option<&'f T>, Option<&'f T>)> {
    let mut files: BTreeMap<_, (Option<&T>, Option<&T>)> = BTreeMap::new();
    for file in claimed {
        files.entry(name(file)).or_default().0 = Some(file);
    }
    for file in found {
        files.entry(name(file)).or_default().1 = Some(file);
    }
    files
}

/// The inputs of a whole session or run that is missing.
pub(super) fn missing(claim: &Claim, lost: &Lost) -> Vec<ChangedInput> {
    let inputs = claim.inputs.iter().filter(|input| lost.has(&input.name));
    inputs
        .map(|input| ChangedInput {
            name: input.name.clone(),
            claimed: Some((input.bytes, input.digest.clone())),
            found: Err("gone, or not looked for without the others".to_owned()),
        })
        .collect()
}

/// The inputs that are missing as a whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Lost {
    Session(String),
    Sessions,
    /// The past run that a plan starts from.
    KnownArm,
}

/// Name of the input with the known arm of a plan.
pub(super) const KNOWN_ARM: &str = "calibrations";

impl Lost {
    fn has(&self, input: &str) -> bool {
        match self {
            Self::Session(session) => {
                input.strip_prefix(&**session).is_some_and(|side| side.starts_with('/'))
            }
            Self::Sessions => input.contains('/'),
            Self::KnownArm => input == KNOWN_ARM,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(name: &str, digest: &str) -> Input {
        Input { name: name.to_owned(), bytes: 3, digest: digest.to_owned() }
    }

    #[test]
    fn what_is_lost_as_a_whole_is_reported_by_its_inputs() {
        let names = ["robot", "mon/controller", "mon2/controller", KNOWN_ARM];
        let of = |lost: &Lost| -> Vec<&str> {
            let lost_ones = names.iter().filter(|name| lost.has(name));
            lost_ones.copied().collect()
        };
        assert_eq!(of(&Lost::Session("mon".to_owned())), ["mon/controller"]);
        assert_eq!(of(&Lost::Sessions), ["mon/controller", "mon2/controller"]);
        assert_eq!(of(&Lost::KnownArm), [KNOWN_ARM]);
    }

    #[test]
    fn inputs_that_changed_came_or_went_are_reported_by_name() {
        let claimed = [input("robot", "aa"), input("mon/controller", "bb")];
        assert!(inputs(&claimed, &claimed).is_empty());
        let found = [input("robot", "ab"), input("mon/tracker", "cc")];
        let changed = inputs(&claimed, &found);
        let told: Vec<_> = changed
            .iter()
            .map(|input| (&*input.name, input.claimed.is_some(), input.found.is_ok()))
            .collect();
        assert_eq!(
            told,
            [("mon/controller", true, false), ("mon/tracker", false, true), ("robot", true, true)]
        );
    }
}
