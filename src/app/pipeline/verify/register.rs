//! The rows of `runs` → every run of a lake, by the names and digests that others cite.

use super::claim::Claim;
use crate::manifest::{RunKey, Written};

/// Every run that the lake has a readable row of.
#[derive(Debug, Clone, Default)]
pub struct Register {
    runs: Vec<Registered>,
}

/// A run of the lake, with the parts that others cite.
#[derive(Debug, Clone)]
pub(super) struct Registered {
    /// Robot, session and name.
    pub(super) key: RunKey,
    pub(super) files: Vec<Written>,
    replaces: Option<String>,
    /// The digest of the row of that run, as its own row states it.
    pub(super) replaced: Option<String>,
    /// The digest of its row.
    pub(super) found: String,
}

impl Register {
    /// The runs of these rows.
    pub(super) fn of<'a>(claims: impl Iterator<Item = &'a Claim>) -> Self {
        let registered = |claim: &Claim| Registered {
            key: claim.key.clone(),
            files: claim.files.clone(),
            replaces: claim.run.ending.replaces.clone(),
            replaced: claim.run.ending.replaced_row_digest.clone(),
            found: claim.found.clone(),
        };
        Self { runs: claims.map(registered).collect() }
    }

    /// Every run.
    pub(super) fn all(&self) -> impl Iterator<Item = &Registered> {
        self.runs.iter()
    }

    /// The run of this name; no two runs have one.
    pub(super) fn run(&self, name: &str) -> Option<&Registered> {
        self.runs.iter().find(|own| own.key.run == name)
    }

    /// A run that wrote this table with this digest, and the file.
    pub(super) fn with_file(&self, table: &str, digest: &str) -> Option<(&Registered, &Written)> {
        let is_it = |file: &&Written| file.table == table && file.digest == digest;
        self.runs.iter().find_map(|own| Some((own, own.files.iter().find(is_it)?)))
    }

    /// The name of the run that replaced another; `None` without one.
    pub(super) fn superseding(&self, key: &RunKey) -> Option<&str> {
        let later = self.runs.iter().find(|own| own.took_the_place_of(key))?;
        Some(&later.key.run)
    }

    /// The runs that replaced another: two where two machines wrote at once.
    pub(super) fn later<'r>(&'r self, key: &'r RunKey) -> impl Iterator<Item = &'r Registered> {
        let runs = self.runs.iter();
        runs.filter(|own| own.took_the_place_of(key))
    }
}

impl Registered {
    fn took_the_place_of(&self, key: &RunKey) -> bool {
        let of_session = (&self.key.robot, &self.key.session) == (&key.robot, &key.session);
        of_session && self.replaces.as_ref() == Some(&key.run)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(session: &str, name: &str, replaces: Option<&str>) -> Registered {
        Registered {
            key: RunKey::new("r", session, name),
            files: vec![Written {
                table: "calibrations".to_owned(),
                session: session.to_owned(),
                rows: 1,
                digest: format!("digest of {name}"),
            }],
            replaces: replaces.map(str::to_owned),
            replaced: None,
            found: String::new(),
        }
    }

    #[test]
    fn a_run_is_superseded_by_one_of_its_own_session() {
        let runs =
            vec![run("mon", "a", None), run("mon", "b", Some("a")), run("tue", "c", Some("b"))];
        let register = Register { runs };
        let by = |session, name| register.superseding(&RunKey::new("r", session, name));
        assert_eq!(by("mon", "a"), Some("b"));
        assert_eq!(by("mon", "b"), None, "c is of another session");
        let known = register.with_file("calibrations", "digest of b");
        assert_eq!(known.expect("there").0.key.run, "b");
        assert!(register.with_file("accuracy", "digest of b").is_none());
        assert!(register.run("c").is_some() && register.run("d").is_none());
    }
}
