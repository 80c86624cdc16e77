//! Which run of a session is the current one: the one that no other says it replaces.

use std::collections::BTreeSet;

use super::{Lake, LakeError, session_key};
use crate::manifest::RunKey;

impl Lake {
    /// The current run of the robot and session of `key`, or `None` where there is none yet.
    ///
    /// Where several are replaced by none, which two machines writing at once can leave, it is the last by name.
    pub fn current(&self, key: &RunKey) -> Result<Option<String>, LakeError> {
        let rows = self.rows(&session_key("runs", key)?, 0)?;
        let (mut runs, mut replaced) = (BTreeSet::new(), BTreeSet::new());
        for (_, row) in rows {
            let row = row?;
            let text = |column: &str| row.text(column).iter().flatten().next().map(str::to_owned);
            runs.extend(text("run"));
            replaced.extend(text("replaces"));
        }
        Ok(runs.difference(&replaced).last().cloned())
    }
}
