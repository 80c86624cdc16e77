//! The requests that changed current runs: each of a run that has a row, in the place of the run of the request before it.

use rayon::prelude::*;

use super::files::Scope;
use crate::io::lake::{ASKED, Lake, LakeError, request_key};

/// Faults of the requests in scope, a sentence each.
pub(super) fn problems(lake: &Lake, scope: &Scope) -> Result<Vec<String>, LakeError> {
    let mut files = lake.requests(ASKED)?;
    files.retain(|file| scope.has_session(&file.key));
    let problem = |key: &String| match problem(lake, key) {
        Ok(words) => words.map(|words| format!("{}: {words}", lake.place_of(key))),
        Err(error) => Some(error.to_string()),
    };
    let keys = files.par_iter().map(|file| &file.key);
    Ok(lake.read_with(|| keys.filter_map(problem).collect()))
}

fn problem(lake: &Lake, key: &str) -> Result<Option<String>, LakeError> {
    let (key, row) = lake.request(key)?;
    let number = row.number.saturating_sub(1);
    let before = request_key(&key, number)?;
    let follows = |before| lake.request(before).is_ok_and(|(own, _)| Some(own.run) == row.replaced);
    Ok(if !lake.exists(&key)? {
        Some(format!("its run {} has no row in runs", key.run))
    } else if number == 0 {
        None
    } else if !lake.has_key(&before)? {
        Some(format!("the request before it, number {number}, was removed"))
    } else {
        (!follows(&before)).then(|| format!("it does not replace the run of request {number}"))
    })
}
