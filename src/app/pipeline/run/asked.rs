//! A run that has its row → the current run of its session, and in words what that changed.

use std::collections::{BTreeMap, BTreeSet};

use super::Done;
use crate::io::lake::{Lake, LakeError};
use crate::io::rows::{Row as _, Word as _};
use crate::io::tables::runs::RunRow;
use crate::manifest::{ROBOT, RunKey};
use crate::pipeline::verify::changed_settings;

/// Most settings and files that are named.
const MOST_NAMED: usize = 6;

impl Done {
    /// Makes its run the current one of its session, and says which run it took the place of and how the two differ.
    pub(super) fn asked_for(mut self, lake: &Lake) -> Result<Self, LakeError> {
        let asked = lake.ask(&self.key)?;
        self.asked = asked.number;
        let Some(before) = asked.replaced else { return Ok(self) };
        let again = "is current again, in place of";
        let how = if self.already_there { again } else { "takes the place of" };
        let RunKey { robot, session, run } = &self.key;
        let row = |run: &str| {
            let row = lake.read(RunRow::TABLE, &RunKey::new(robot, session, run));
            RunRow::read(&row.ok()?).pop()
        };
        let rows = row(&before).zip(row(run));
        let changes = rows.map_or_else(Vec::new, |(before, now)| changes(&before, &now)).join("; ");
        self.took_place = Some(format!("run {run} {how} run {before}: {changes}"));
        Ok(self)
    }
}

/// The settings, files and versions in which two runs differ, and both verdicts, in words.
fn changes(before: &RunRow, now: &RunRow) -> Vec<String> {
    let settings = changed_settings(&before.made.settings, &now.made.settings).into_iter();
    let settings = settings.map(|own| {
        let value = |value: Option<String>| value.unwrap_or_else(|| "nothing".to_owned());
        format!("{} {} → {}", own.key, value(own.claimed), value(own.found))
    });
    let [was, is] = [before, now].map(|row| {
        let names = row.inputs.names.iter();
        names.zip(&row.inputs.digests).collect::<BTreeMap<_, _>>()
    });
    let mut names: BTreeSet<&String> = was.keys().chain(is.keys()).copied().collect();
    names.retain(|name| was.get(name) != is.get(name));
    let files = names.into_iter().map(|name| match was.get(name).zip(is.get(name)) {
        _ if name == ROBOT => "another robot file".to_owned(),
        Some(_) => format!("another {name}"),
        None if is.contains_key(name) => format!("{name} added"),
        None => format!("{name} left out"),
    });
    let mut all: Vec<String> = settings.chain(files).collect();
    let more = all.split_off(all.len().min(MOST_NAMED)).len();
    all.extend((more > 0).then(|| format!("{more} more settings and files")));
    if before.made.version != now.made.version {
        all.push(format!("version {} → {}", before.made.version, now.made.version));
    }
    let [was, is] = [before, now].map(|row| row.ending.verdict.word().replace('_', " "));
    all.push(format!("verdict {was} → {is}"));
    all
}
