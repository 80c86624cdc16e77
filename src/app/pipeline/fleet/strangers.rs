//! Folders and files among the sessions of a fleet that are of no known robot.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use crate::pipeline::configuration::{
    ConfigurationError, ConfigurationErrorKind, Robots, Tree, Why, logs,
};
use crate::pipeline::file::{PipelineFile, ROBOT_PLACE, SESSION_PLACE, SessionsBy};

/// The place of the sessions of all robots.
#[derive(Clone, Copy)]
pub struct Within<'a> {
    /// The pipeline file.
    pub path: &'a Path,
    /// The tree that they are in.
    pub tree: &'a Tree,
    pub folder: &'a Path,
    /// The pipeline file with the sessions of every robot.
    pub file: &'a PipelineFile,
    pub robots: &'a Robots,
}

impl Within<'_> {
    /// Folders that are no robot's.
    pub fn folders_of_no_robot(&self) -> Result<Vec<(String, Why)>, ConfigurationError> {
        let entries = self.tree.entries(self.folder);
        let entries = entries.map_err(|source| self.unread(source))?;
        let known = self.robots.stated.iter().map(|stated| {
            let folder = stated.entry.folder.as_ref().unwrap_or(&stated.entry.name);
            folder.split('/').next().unwrap_or_default()
        });
        let known: BTreeSet<&str> = known.collect();
        let folders = entries.iter().filter(|path| self.tree.is_dir(path));
        let names = folders.map(|path| path.file_name().unwrap_or_default().to_string_lossy());
        let strange = names.filter(|name| !known.contains(&**name) && !name.starts_with('.'));
        let told = |name| {
            let reason = "no robot of the pipeline file has this folder: add it to the robots, or state its `folder`";
            (name, Why::Waits(reason.to_owned()))
        };
        Ok(strange.map(|name| told(name.into_owned())).collect())
    }

    /// Files whose names have a robot in the place of `{robot}` that is not known, by what stands there.
    pub fn files_of_no_robot(&self) -> Result<Vec<(String, Why)>, ConfigurationError> {
        let mut strange: BTreeMap<String, BTreeSet<PathBuf>> = BTreeMap::new();
        let known: BTreeSet<&str> = self.robots.names().collect();
        for folder in self.folders().map_err(|source| self.unread(source))? {
            for pattern in self.robots.patterns() {
                let pattern = pattern.replace(SESSION_PLACE, "*");
                let named = logs::named(self.tree, &folder, &pattern, ROBOT_PLACE);
                let named = named.map_err(|source| self.unread(source))?;
                for (robot, path) in named {
                    if !known.contains(robot.as_str())
                        && !self.is_of_known(&folder, &pattern, &path)
                    {
                        strange.entry(robot).or_default().insert(path);
                    }
                }
            }
        }
        Ok(strange.into_iter().map(of_files).collect())
    }

    /// The folders in which files are looked for.
    fn folders(&self) -> io::Result<Vec<PathBuf>> {
        if self.file.input.sessions_by != SessionsBy::Folder {
            return Ok(vec![self.folder.to_owned()]);
        }
        let entries = self.tree.entries(self.folder)?.into_iter();
        Ok(entries.filter(|path| self.tree.is_dir(path)).collect())
    }

    /// Whether a file's name has a known robot in its place.
    fn is_of_known(&self, folder: &Path, pattern: &str, path: &Path) -> bool {
        let name = path.to_string_lossy();
        let mut named = self.robots.names().filter(|robot| name.contains(robot));
        named.any(|robot| logs::is_matched(folder, &pattern.replace(ROBOT_PLACE, robot), path))
    }

    fn unread(&self, source: io::Error) -> ConfigurationError {
        let folder = self.folder.to_owned();
        ConfigurationErrorKind::Folder { folder, source }.at(self.path)
    }
}

/// What is told of the files of a robot that is not known.
fn of_files((robot, files): (String, BTreeSet<PathBuf>)) -> (String, Why) {
    let first = files.iter().next().and_then(|path| path.file_name());
    let first = first.unwrap_or_default().to_string_lossy();
    let others = match files.len() {
        0 | 1 => String::new(),
        2 => " and another file".to_owned(),
        several => format!(" and {} other files", several - 1),
    };
    let reason = format!(
        "no robot of the pipeline file is called so, as {first}{others} state: add it to the robots"
    );
    (robot, Why::Waits(reason))
}
