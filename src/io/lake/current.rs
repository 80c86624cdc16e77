//! The current run of a session: the one that no other run replaces.

use std::collections::{BTreeMap, BTreeSet};

use super::{Lake, LakeError, RUNS, session_key};
use crate::io::tables::runs::row_digest;
use crate::manifest::{Replaced, RunKey};

impl Lake {
    /// The current run of the robot and session of `key`, with the digest of its row; `None` where there is none yet.
    ///
    /// Where several runs are replaced by none, which two machines writing at once can leave, it is the last by name. A
    /// file that is not at the place of its row is not read as a row.
    pub fn current(&self, key: &RunKey) -> Result<Option<Replaced>, LakeError> {
        let rows = self.rows(RUNS, &session_key(RUNS, key)?, 0)?;
        let (mut runs, mut replaced) = (BTreeMap::new(), BTreeSet::new());
        for (place, row) in rows {
            let row = row?.believed(&place.named())?;
            let text = |column: &str| row.text(column).iter().flatten().next().map(str::to_owned);
            let Some(run) = text("run") else {
                continue;
            };
            let own = RunKey::new(&key.robot, &key.session, &run);
            if row.key() != Some(&own) || self.place(RUNS, &own)? != place {
                continue;
            }
            runs.insert(run, row_digest(&row));
            replaced.extend(text("replaces"));
        }
        let mut current = runs.into_iter().filter(|(run, _)| !replaced.contains(run));
        let current = current.next_back();
        Ok(current.map(|(run, row_digest)| Replaced { run, row_digest }))
    }
}
