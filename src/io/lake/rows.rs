//! All rows of `runs` in a lake.

use std::fs;
use std::path::PathBuf;

use super::error::folder_error;
use super::{Lake, LakeError, subfolders};
use crate::io::schema;
use crate::io::table::{self, FileError, Table};

/// The file of a row of `runs`, and the row or why it cannot be read.
pub type RunRow = (PathBuf, Result<Table, FileError>);

impl Lake {
    /// The row of every run, in the order of robot, session and run; one that cannot be read stops no other.
    pub fn runs(&self) -> Result<Vec<RunRow>, LakeError> {
        let schema = schema::find("runs")?;
        let mut rows = Vec::new();
        for robot in subfolders(&self.root.join(&schema.table))? {
            for session in subfolders(&robot)? {
                let entries = fs::read_dir(&session).and_then(Iterator::collect);
                let entries: Vec<fs::DirEntry> = entries.map_err(folder_error("list", &session))?;
                let mut files: Vec<PathBuf> = entries
                    .iter()
                    .filter(|entry| !entry.file_name().to_string_lossy().starts_with('.'))
                    .map(fs::DirEntry::path)
                    .filter(|path| path.extension().is_some_and(|ending| ending == "parquet"))
                    .collect();
                files.sort();
                rows.extend(files.into_iter().map(|path| {
                    let row = table::read(&path, schema);
                    (path, row)
                }));
            }
        }
        Ok(rows)
    }
}
