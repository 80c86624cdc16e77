//! Other runs that a run depends on, and their tables that are left.
//!
//! Inputs: the row of `runs` ([`Claim`]), the run's own `stations`, the lake and its [`Register`]. Output: [`Citation`]s of
//! 1. the run that it `replaces`: without its row, the run that *it* replaced counts as current again;
//! 2. the run whose table drove the session (`table_id` in `stations`): its promise is on the page;
//! 3. the plan that the session was measured by (`[report] plan`, or the logs' metadata): its promise is on the page too;
//! 4. the past run that a plan starts from (`[plan.known]`), by the digest of its `calibrations`.

use std::collections::BTreeSet;

use super::altered::{KNOWN_ARM, is_gone};
use super::claim::{Claim, Register};
use crate::io::lake::Lake;
use crate::io::rows::Row as _;
use crate::io::tables::stations::StationRow;
use crate::manifest::{RunKey, Written};

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Citation {
    pub role: Role,
    pub run: String,
    pub left: Left,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    Replaced,
    /// Its table drove the session.
    Drove,
    Planned,
    /// It identified the arm that a plan starts from.
    KnownArm,
}

/// The part of a cited run that is left.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Left {
    /// Everything that is cited; and the run that replaced it, if one did.
    Whole(Option<String>),
    /// Its row in `runs`, without these of its tables, as TABLE/SESSION.
    Without(Vec<String>),
    /// Its row, which differs from the row at the time of the citing run.
    OtherRow,
    /// Not even its row.
    Nothing,
}

/// Tables that correct commands, and the table of their promise.
pub(super) const DRIVING: [&str; 3] = ["accuracy", "calibrations", "compensation"];

impl Role {
    const fn tables(self) -> &'static [&'static str] {
        match self {
            Self::Replaced => &[],
            Self::Drove => &DRIVING,
            Self::Planned => &["sampling_plan"],
            Self::KnownArm => &[KNOWN_ARM],
        }
    }
}

impl Citation {
    pub fn is_lost(&self) -> bool {
        !matches!(self.left, Left::Whole(_))
    }

    pub(super) fn new(role: Role, run: &str, register: &Register, lake: &Lake) -> Self {
        Self { role, run: run.to_owned(), left: left(role, run, register, lake) }
    }
}

fn left(role: Role, run: &str, register: &Register, lake: &Lake) -> Left {
    let Some(cited) = register.run(run) else { return Left::Nothing };
    let of_role = cited.files.iter().filter(|file| role.tables().contains(&&*file.table));
    let gone = of_role.filter(|file| is_gone(&cited.key, file, lake));
    let gone: Vec<String> = gone.map(Written::name).collect();
    if gone.is_empty() {
        Left::Whole(register.superseding(&cited.key))
    } else {
        Left::Without(gone)
    }
}

/// The runs that a run cites, as far as the lake alone shows.
pub(super) fn citations(claim: &Claim, register: &Register, lake: &Lake) -> Vec<Citation> {
    let mut cited: Vec<(Role, String)> = Vec::new();
    cited.extend(claim.run.ending.replaces.iter().map(|run| (Role::Replaced, run.clone())));
    cited.extend(drove(claim, lake).into_iter().map(|run| (Role::Drove, run)));
    cited.extend(planned(claim).map(|run| (Role::Planned, run)));
    let known = known_arm(claim, register);
    cited.extend(known.map(|key| (Role::KnownArm, key.run.clone())));
    let cited = cited.iter();
    cited
        .map(|(role, run)| {
            let mut citation = Citation::new(*role, run, register, lake);
            if *role == Role::Replaced && is_other_row(claim, run, register) {
                citation.left = Left::OtherRow;
            }
            citation
        })
        .collect()
}

/// Whether the row of the replaced run differs from the one whose digest it has.
fn is_other_row(claim: &Claim, run: &str, register: &Register) -> bool {
    let then = claim.run.ending.replaced_row_digest.as_ref();
    let now = register.run(run).map(|replaced| &replaced.found);
    then.zip(now).is_some_and(|(then, now)| then != now)
}

/// The runs whose tables drove the sessions. A table of stations that is missing or unreadable is reported as an output.
fn drove(claim: &Claim, lake: &Lake) -> BTreeSet<String> {
    let files = claim.files.iter().filter(|file| file.table == "stations");
    let keys = files.map(|file| claim.key.of_session(&file.session));
    let tables = keys.filter_map(|key| lake.read_as_it_is("stations", &key).ok());
    let stations = tables.flat_map(|opened| StationRow::read(&opened.table));
    stations.filter_map(|station| station.table_id).map(|id| id.to_string()).collect()
}

/// The plan that the settings name; `None` without one.
fn planned(claim: &Claim) -> Option<String> {
    let settings: serde_json::Value = serde_json::from_str(&claim.run.made.settings).ok()?;
    let plan = settings.pointer("/report/plan")?.as_str()?;
    Some(plan.to_owned())
}

/// The session's key of the run whose `calibrations` a plan starts from, where it is one of the lake.
pub(super) fn known_arm(claim: &Claim, register: &Register) -> Option<RunKey> {
    let input = claim.inputs.iter().find(|input| input.name == KNOWN_ARM)?;
    let (run, file) = register.with_file(KNOWN_ARM, &input.digest)?;
    Some(run.key.of_session(&file.session))
}
