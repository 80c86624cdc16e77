//! Files against their digests: those that a run wrote, and those that it read.

use std::collections::BTreeMap;
use std::fs::File;

use super::claim::Claim;
use crate::io::lake::{Lake, LakeError};
use crate::manifest::{Input, RunKey, Written, digest};

/// A file that a run wrote, and what is there today.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Output {
    /// TABLE/SESSION.
    pub name: String,
    /// BLAKE3 by the row of `runs`.
    pub claimed: String,
    /// BLAKE3 of what is there, or why there is none.
    pub found: Result<String, String>,
}

/// An input that is not what the row of `runs` says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ChangedInput {
    /// Its name in the run.
    pub name: String,
    /// Size and BLAKE3 by the row; `None` where the row does not have it.
    pub claimed: Option<(u64, String)>,
    /// Size and BLAKE3 of what is there, or why there is nothing.
    pub found: Result<(u64, String), String>,
}

impl Output {
    /// Whether it is missing or not what the row says.
    pub fn is_altered(&self) -> bool {
        self.found.as_ref() != Ok(&self.claimed)
    }
}

/// The name of a file in the row of `runs`.
pub(super) fn file_name(file: &Written) -> String {
    format!("{}/{}", file.table, file.session)
}

/// A file of a run, open for reading.
pub(super) fn open(lake: &Lake, key: &RunKey, file: &Written) -> Result<File, LakeError> {
    lake.open(&file.table, &key.of_session(&file.session))
}

/// Every file that the row names, digested.
pub(super) fn outputs(claim: &Claim, lake: &Lake) -> Vec<Output> {
    let found = |file: &Written| -> Result<String, String> {
        let opened = open(lake, &claim.key, file).map_err(|error| error.to_string())?;
        let digested = digest(opened).map_err(|error| error.to_string())?;
        Ok(digested.0)
    };
    let output = |file: &Written| Output {
        name: file_name(file),
        claimed: file.digest.clone(),
        found: found(file),
    };
    claim.files.iter().map(output).collect()
}

/// Inputs that differ by name, size or digest.
pub(super) fn inputs(claimed: &[Input], found: &[Input]) -> Vec<ChangedInput> {
    type Sides<'a> = (Option<&'a Input>, Option<&'a Input>);
    let mut names: BTreeMap<&str, Sides<'_>> = BTreeMap::new();
    for input in claimed {
        names.entry(&input.name).or_default().0 = Some(input);
    }
    for input in found {
        names.entry(&input.name).or_default().1 = Some(input);
    }
    let file = |input: &Input| (input.bytes, input.digest.clone());
    let changed = names
        .into_iter()
        .filter(|(_, (claimed, found))| claimed != found);
    changed
        .map(|(name, (claimed, found))| ChangedInput {
            name: name.to_owned(),
            claimed: claimed.map(file),
            found: found
                .map(file)
                .ok_or_else(|| "there is no such file".to_owned()),
        })
        .collect()
}

/// The inputs of a session that is not there as a whole.
pub(super) fn missing(claim: &Claim, session: &str, reason: &str) -> Vec<ChangedInput> {
    let of_session = |input: &&Input| {
        let side = input.name.strip_prefix(session);
        side.is_some_and(|side| side.starts_with('/'))
    };
    let inputs = claim.inputs.iter().filter(of_session);
    inputs
        .map(|input| ChangedInput {
            name: input.name.clone(),
            claimed: Some((input.bytes, input.digest.clone())),
            found: Err(format!(
                "not looked at, as of the session's folder {reason}"
            )),
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(name: &str, digest: &str) -> Input {
        Input {
            name: name.to_owned(),
            bytes: 3,
            digest: digest.to_owned(),
        }
    }

    #[test]
    fn inputs_that_changed_came_or_went_are_told_by_name() {
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
            [
                ("mon/controller", true, false),
                ("mon/tracker", false, true),
                ("robot", true, true)
            ]
        );
    }
}
