//! A folder in the place of a file: what is told of it.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use crate::pipeline::some_of;

const FILES_NAMED: usize = 5;
/// Folders below a folder that are looked into for files to give: robot, session and their files, below a table.
const DEPTH: usize = 3;

/// A folder that was given in the place of a file, with the files in it that can be given.
#[derive(Debug)]
pub struct FolderGiven {
    path: PathBuf,
    wanted: &'static str,
    /// `None` where a new file is wanted.
    files: Option<Vec<PathBuf>>,
}

impl FolderGiven {
    /// The folder, the file that is needed in words, and the files that can be given: those that [`files_in`] finds.
    pub(super) fn new(
        path: &Path,
        wanted: &'static str,
        levels: usize,
        can_be_given: &dyn Fn(&Path) -> bool,
    ) -> Self {
        let files = files_in(path, levels, can_be_given);
        Self { path: path.to_owned(), wanted, files: Some(files) }
    }

    /// A folder in the place of a table of a run.
    pub(super) fn for_table(path: &Path, wanted: &'static str) -> Self {
        let is_table = |file: &Path| file.extension().is_some_and(|ending| ending == "parquet");
        Self::new(path, wanted, DEPTH, &is_table)
    }

    pub(super) fn for_new_file(path: &Path, wanted: &'static str) -> Self {
        Self { path: path.to_owned(), wanted, files: None }
    }
}

impl std::error::Error for FolderGiven {}

impl fmt::Display for FolderGiven {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} is a folder; give {}", self.path.display(), self.wanted)?;
        let Some(files) = &self.files else { return Ok(()) };
        if files.is_empty() {
            return f.write_str("; none is in it");
        }
        let files = files.iter().map(|file| file.display().to_string());
        write!(f, "; in it: {}", some_of(files, FILES_NAMED, "more"))
    }
}

/// The files in a folder and so many levels of folders below it that are as wanted, in order.
pub(super) fn files_in(
    folder: &Path,
    levels: usize,
    is_wanted: &dyn Fn(&Path) -> bool,
) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in entries(folder) {
        if path.is_dir() {
            if levels > 0 {
                found.extend(files_in(&path, levels - 1, is_wanted));
            }
        } else if is_wanted(&path) {
            found.push(path);
        }
    }
    found
}

/// What stands in a folder, in order; nothing where it cannot be read.
pub(super) fn entries(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths
}
