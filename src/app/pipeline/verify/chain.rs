//! The results of stages that a run states it started from, held against those that follow from its own inputs and settings.

use serde_json::Value;

use super::claim::Claim;
use crate::io::tables::{estimates, grids, joined_sessions};
use crate::manifest::{Input, ROBOT, RunKey, VERSION, canonical};
use crate::pipeline::keys::{estimate_settings, grids_settings, join_settings};
use crate::pipeline::run::is_of_session;

/// Contradictions between a run and the results that it names; which settings stages of other versions read is not known.
pub(super) fn contradictions(claim: &Claim) -> Vec<String> {
    let Some(made_of) = claim.run.ending.made_of.as_ref().filter(|_| claim.run.made.version == VERSION) else {
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
    let stated = sessions.chain([claim.run.ending.estimate.as_ref(), claim.run.ending.grids.as_ref()]);
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
