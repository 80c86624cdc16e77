//! Pipeline files that find the work of results, the sessions of each searched once for each robot.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::pipeline::configuration::{
    Configuration, ConfigurationError, FoundSessions, Overrides, Session, Tree, files, look,
};

/// The pipeline files, and the sessions that they found so far.
#[derive(Debug)]
pub struct Sought {
    pipelines: Vec<PathBuf>,
    /// By the path of the file, and the robot.
    found: BTreeMap<(PathBuf, Option<String>), (Tree, FoundSessions)>,
}

impl Sought {
    /// The pipeline files at these paths.
    pub fn new(pipelines: &[PathBuf]) -> Self {
        Self { pipelines: pipelines.to_vec(), found: BTreeMap::new() }
    }

    /// The first configuration, with the sessions that its file finds, that has what is `wanted`.
    pub(super) fn find<T>(
        &mut self,
        overrides: &Overrides,
        wanted: impl Fn(&Configuration) -> Option<T>,
    ) -> Option<(Configuration, T)> {
        let pipelines = self.pipelines.clone();
        pipelines.iter().find_map(|path| {
            let configuration = self.load(path, overrides).ok()?;
            let found = wanted(&configuration)?;
            Some((configuration, found))
        })
    }

    /// The first configuration of a robot, with these sessions instead of those that its file finds, that is as `wanted`; none judges.
    pub(super) fn with_sessions(
        &self,
        robot: &str,
        sessions: &[Session],
        wanted: impl Fn(&Configuration) -> bool,
    ) -> Option<Configuration> {
        let overrides = Overrides {
            sessions: sessions.iter().map(|own| own.name.clone()).collect(),
            ..Overrides::default()
        };
        self.pipelines.iter().find_map(|path| {
            let mut files = files::read(path, Some(robot)).ok()?;
            files.file.input.test.clear();
            let found = FoundSessions::of(sessions.to_vec());
            let configuration =
                Configuration::of(path, files, Tree::Folder, Some(found), &overrides).ok()?;
            wanted(&configuration).then_some(configuration)
        })
    }

    /// The configuration by the pipeline file at `path`, as [`Configuration::load`] gives it.
    pub(super) fn load(
        &mut self,
        path: &Path,
        overrides: &Overrides,
    ) -> Result<Configuration, ConfigurationError> {
        let files = files::read(path, overrides.robot.as_deref())?;
        let key = (path.to_owned(), overrides.robot.clone());
        if !self.found.contains_key(&key) {
            let tree = files.tree()?;
            let found = look(path, &tree, &files.sessions().named(), &files.file)?;
            self.found.insert(key.clone(), (tree, found));
        }
        let (tree, found) = self.found[&key].clone();
        Configuration::of(path, files, tree, Some(found), overrides)
    }
}
