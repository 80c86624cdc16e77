//! A row of `runs` compared with itself, its file, its place, later rows, and the results of stages that it names.

use std::io::Read as _;

use serde_json::Value;

use super::claim::{Claim, Register};
use super::selection::PastRun;
use crate::files::schema;
use crate::files::store::Place;
use crate::files::table::{self, Seal};
use crate::io::lake::{Lake, LakeError};
use crate::io::tables::{estimates, grids, joined_sessions};
use crate::manifest::{Input, ROBOT, RunKey, VERSION, canonical};
use crate::pipeline::keys::{estimate_settings, grids_settings, join_settings};
use crate::pipeline::run::is_of_session;

/// Contradictions of a row with itself, its place, its file or a later row, as text.
pub fn contradictions(
    run: &PastRun,
    claim: &Claim,
    register: &Register,
    lake: &Lake,
) -> Vec<String> {
    let mut found = of_digests(run, claim);
    found.extend(of_later(claim, register));
    found.extend(of_names(claim));
    found.extend(of_stages(claim));
    let own = lake.place("runs", &claim.key);
    if own.as_ref().ok() == Some(&run.place) {
        // A row that already differs needs no other proof that its file was rewritten.
        if found.is_empty() {
            found.extend(of_bytes(claim, &run.place, lake));
        }
    } else {
        found.push(format!(
            "it is at {}, which is not the place of run {} of robot {:?} and session {:?}",
            run.place.display(),
            claim.key.run,
            claim.key.robot,
            claim.key.session
        ));
    }
    found
}

/// Compares the digests that the row and its file state with its content.
fn of_digests(run: &PastRun, claim: &Claim) -> Vec<String> {
    let mut told = Vec::new();
    let (found, is_due) = (&claim.found, claim.is_digest_due());
    match &claim.run.row_digest {
        Some(stated) if stated != found => told.push(format!(
            "its content has the digest {found}, and it states {stated}: it was changed"
        )),
        None if is_due => told.push("it has no digest of itself: it was changed".to_owned()),
        Some(_) | None => {}
    }
    match &run.seal {
        Some(Seal::Broken { stated, found }) => told.push(format!(
            "the content of its file has the digest {found}, and its metadata states {stated}: it was damaged or changed"
        )),
        Some(Seal::Absent) if is_due => {
            told.push("the metadata of its file has no digest of its content".to_owned());
        }
        Some(Seal::Absent | Seal::Holds) | None => {}
    }
    if is_due
        && claim.run.ending.replaces.is_some() != claim.run.ending.replaced_row_digest.is_some()
    {
        told.push(
            "it has one of `replaces` and `replaced_row_digest`, which belong together".to_owned(),
        );
    }
    told
}

/// Compares the row with the runs that replaced it.
fn of_later(claim: &Claim, register: &Register) -> Vec<String> {
    let later = register.later(&claim.key);
    let other = later.filter_map(|later| {
        let then = later.run.ending.replaced_row_digest.as_ref()?;
        (*then != claim.found).then(|| {
            format!(
                "run {}, which took its place, states that it had the digest {then}, and it has {}: one of the two was changed",
                later.key.run, claim.found
            )
        })
    });
    other.collect()
}

/// Compares its name with the one that follows from its inputs, and its settings with their digest.
fn of_names(claim: &Claim) -> Vec<String> {
    let mut told = Vec::new();
    let RunKey { run, .. } = claim.work().key_by_version(&claim.run.made.version);
    if run != claim.key.run {
        told.push(format!(
            "its name is {}, and from its inputs, settings and version follows {run}",
            claim.key.run
        ));
    }
    let digest = blake3::hash(claim.run.made.settings.as_bytes()).to_hex().to_string();
    if digest != claim.run.made.settings_digest {
        told.push(format!(
            "its settings have the digest {digest}, and it states {}",
            claim.run.made.settings_digest
        ));
    }
    told
}

/// Compares its file with the bytes in which its content is written. No digest covers those bytes, since the row cannot
/// hold it; but the same version writes the same content as the same bytes, so damage that spares the content, and may keep
/// other programs from reading the file, is also found. For bytes of other versions only the name of the writer is known.
fn of_bytes(claim: &Claim, place: &Place, lake: &Lake) -> Option<String> {
    let read = || -> Result<Option<String>, LakeError> {
        let opened = lake.read_as_it_is("runs", &claim.key)?;
        let named = place.named();
        if claim.run.made.version != VERSION || claim.table_version != schema::find("runs")?.version
        {
            let head = table::head_of(&lake.open("runs", &claim.key)?, &named)?;
            let expected = format!("posegrid version {}", claim.run.made.version);
            let is_other = head.created_by.as_ref() != Some(&expected);
            return Ok(is_other.then(|| {
                let by = head.created_by.unwrap_or_else(|| "nobody".to_owned());
                format!("its file was written by {by:?}, and the row by {expected:?}")
            }));
        }
        let Ok(written) = table::write(&opened.table, Vec::new()) else {
            return Ok(Some("its content cannot be rewritten".to_owned()));
        };
        let mut bytes = Vec::new();
        let file = lake.open("runs", &claim.key)?;
        // A longer file differs in length alone, however long it is.
        let length = written.len() as u64 + 1;
        if let Err(error) = file.take(length).read_to_end(&mut bytes) {
            return Ok(Some(error.to_string()));
        }
        let differs = bytes.iter().zip(&written).position(|(own, other)| own != other);
        let differs = differs
            .or_else(|| (bytes.len() != written.len()).then(|| bytes.len().min(written.len())));
        Ok(differs.map(|byte| {
            format!(
                "its file is not what posegrid writes for this content, from byte {byte} on: it was damaged, or rewritten by \
                 another program"
            )
        }))
    };
    read().unwrap_or_else(|error| Some(error.to_string()))
}

/// Contradictions between a run and the results that it names; which settings stages of other versions read is not known.
fn of_stages(claim: &Claim) -> Vec<String> {
    let Some(made_of) =
        claim.run.ending.made_of.as_ref().filter(|_| claim.run.made.version == VERSION)
    else {
        return Vec::new();
    };
    let RunKey { robot, session, .. } = &claim.key;
    let all: Value = serde_json::from_str(&claim.run.made.settings).unwrap_or_default();
    let settings = |read: fn(&Value) -> Value| canonical(&read(&all)).unwrap_or_default();
    let joined = |session: &String| {
        let is_own = |input: &&Input| input.name == ROBOT || is_of_session(&input.name, session);
        let inputs = claim.inputs.iter().filter(is_own).cloned().collect();
        joined_sessions::work(robot, session, inputs, settings(join_settings)).key()
    };
    let joined: Vec<RunKey> =
        claim.run.sessions.iter().chain(&claim.run.test_sessions).map(joined).collect();
    let training = joined.iter().take(claim.run.sessions.len()).map(|key| (&key.session, &key.run));
    let file = claim.inputs.iter().find(|input| input.name == ROBOT);
    let inputs = estimates::inputs(file.map_or("", |file| &file.digest), training);
    let estimate = estimates::work(robot, session, inputs, settings(estimate_settings)).key();
    let grids = grids::work(robot, session, &estimate.run, settings(grids_settings)).key();
    let of_session = |key: &RunKey| format!("{}/{}", key.session, key.run);
    let follow = joined.iter().map(of_session).chain([estimate.run, grids.run]);
    let sessions = made_of.iter().map(Some).chain(vec![None; joined.len()]).take(joined.len());
    let stated =
        sessions.chain([claim.run.ending.estimate.as_ref(), claim.run.ending.grids.as_ref()]);
    let differ = stated.zip(follow).filter_map(|(stated, follows)| {
        let stated = stated.filter(|stated| **stated != follows)?;
        Some(format!(
            "it states that it started from {stated}, and from its inputs and settings follows {follows}"
        ))
    });
    let others = made_of.len() != joined.len();
    let others = others
        .then(|| "the sessions as joined that it names are not those that it reads".to_owned());
    others.into_iter().chain(differ).collect()
}
