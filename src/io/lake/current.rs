//! Which run of a session is the current one: the one that no other says it replaces.

use std::collections::BTreeSet;
use std::fs;
use std::io;

use super::error::folder_error;
use super::{Lake, LakeError};
use crate::io::schema;
use crate::io::table;
use crate::manifest::RunKey;

impl Lake {
    /// The current run of the robot and session of `key`, or `None` where there is none yet.
    ///
    /// Where several are replaced by none, which two machines writing at once can leave, it is the last by name.
    pub fn current(&self, key: &RunKey) -> Result<Option<String>, LakeError> {
        let schema = schema::find("runs")?;
        let file = self.path(schema, key)?;
        let folder = file
            .parent()
            .expect("a run's file stands in its session's folder");
        let entries = match fs::read_dir(folder) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            entries => entries.and_then(Iterator::collect::<io::Result<Vec<_>>>),
        };
        let (mut runs, mut replaced) = (BTreeSet::new(), BTreeSet::new());
        for entry in entries.map_err(folder_error("list", folder))? {
            let path = entry.path();
            let is_temporary = entry.file_name().to_string_lossy().starts_with('.');
            if is_temporary || path.extension().is_none_or(|ending| ending != "parquet") {
                continue;
            }
            let row = table::read(&path, schema)?;
            let text = |column: &str| row.text(column).iter().flatten().next().map(str::to_owned);
            runs.extend(text("run"));
            replaced.extend(text("replaces"));
        }
        Ok(runs.difference(&replaced).last().cloned())
    }
}
