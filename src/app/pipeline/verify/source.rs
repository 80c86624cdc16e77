//! The source for recomputing a run: the pipeline file, and the logs that it finds today.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::altered::Lost;
use super::claim::Claim;
use crate::files::input::Bound;
use crate::io::log::read_metadata;
use crate::io::targets::driving;
use crate::manifest::{RunKey, Work};
use crate::pipeline::configuration::{
    Configuration, ConfigurationError, ConfigurationErrorKind, FoundSessions, Overrides, Session,
    SessionFiles, Tree, WorkPiece, files, look,
};
use crate::pipeline::fetch::Fetched;
use crate::pipeline::fleet::FleetPiece;
use crate::pipeline::planning::{self, Planning, PlanningError};
use crate::pipeline::run::{run_piece, work};
use crate::progress::Progress;

#[derive(Debug)]
pub(super) enum Source {
    /// Sessions, with fetched logs, and their work.
    Sessions(Box<Configuration>, Fetched),
    Planning(Box<Planning>),
}

/// The reason why a run's work is not found.
#[derive(Debug)]
pub(super) enum NoSource {
    /// Inputs are missing or incomplete: which, and why.
    Missing(Lost, String),
    Other(String),
}

impl Source {
    /// The work of `claim` by the pipeline file at `pipeline`, for the lake in `lake`. The sessions to learn from and those
    /// that judge are taken from the row, since the command line may have named them; and a plan starts from the table
    /// `known_arm`, where the lake has it.
    pub(super) fn find(
        claim: &Claim,
        pipeline: &Path,
        sought: &mut Sought,
        known_arm: Option<&Path>,
        lake: &Path,
    ) -> Result<Self, NoSource> {
        if claim.key.session == planning::SESSION && claim.run.sessions.is_empty() {
            let planning =
                Planning::reload(pipeline, Some(&claim.key.robot), Some(lake), known_arm);
            let planning = planning.map_err(|error| match error {
                PlanningError::Known(error) => NoSource::Missing(Lost::KnownArm, error.to_string()),
                error => other(error),
            })?;
            return Ok(Self::Planning(Box::new(planning)));
        }
        let overrides = Overrides {
            robot: Some(claim.key.robot.clone()),
            sessions: claim.run.sessions.clone(),
            test: claim.run.test_sessions.clone(),
            lake: Some(lake.to_owned()),
            ..Overrides::default()
        };
        let configuration = sought.load(pipeline, &overrides).map_err(|error| match error {
            ConfigurationError::Session { session, reason, .. } => of_session(&session, &reason),
            ConfigurationError::At { kind: ConfigurationErrorKind::Folder { .. }, .. } => {
                NoSource::Missing(Lost::Sessions, error.to_string())
            }
            error => other(error),
        })?;
        let piece = WorkPiece {
            session: claim.key.session.clone(),
            training: sessions_named(&configuration, &claim.run.sessions)?,
            test: sessions_named(&configuration, &claim.run.test_sessions)?,
        };
        let fetched = Fetched::of(&configuration.tree, &piece).map_err(other)?;
        // Tables that were elsewhere are in this lake now.
        let configuration = Configuration { tree: Tree::Folder, ..configuration };
        Ok(Self::Sessions(Box::new(configuration), fetched))
    }

    /// The plan that the last session's logs name.
    pub(super) fn sampling_plan(&self) -> Option<String> {
        let Self::Sessions(configuration, fetched) = self else { return None };
        let session = fetched.piece.training.last()?;
        let mut metadata =
            read_metadata(session.recorded.logs()?, configuration.file.limits).ok()?;
        metadata.remove("session.plan")
    }

    /// The work as it is today, with its inputs digested. The robot's name is taken from the row, so that no log is read
    /// for it.
    pub(super) fn work(&self, claim: &Claim) -> Result<Work, NoSource> {
        match self {
            Self::Planning(planning) => Ok(planning.work.clone()),
            Self::Sessions(configuration, fetched) => {
                let named = Configuration {
                    robot: Some(claim.key.robot.clone()),
                    ..(**configuration).clone()
                };
                let work = work(&named, &fetched.piece);
                work.map_err(|error| other(fetched.told(&error.to_string())))
            }
        }
    }

    /// The run whose table drove the last session, and with which that session is compared.
    pub(super) fn driven_by(&self) -> Option<RunKey> {
        let Self::Sessions(configuration, fetched) = self else { return None };
        let path = fetched.piece.training.last()?.corrected.as_ref()?;
        // The run itself reports a file that cannot be read.
        Some(driving::read(path, Bound::of(configuration.file.limits)).ok()?.key)
    }

    /// Does the work by the code of `posegrid run`; returns the run in the temporary lake.
    pub(super) fn run(&self, claim: &Claim, progress: &dyn Progress) -> Result<RunKey, NoSource> {
        match self {
            Self::Planning(planning) => Ok(planning.make(progress).map_err(other)?.key),
            Self::Sessions(configuration, fetched) => {
                let piece = &fetched.piece;
                let done =
                    run_piece(FleetPiece { configuration, piece, is_of_several: false }, progress);
                let done = done.map_err(|error| other(fetched.told(&error.to_string())))?;
                Ok(RunKey { robot: claim.key.robot.clone(), ..done.key })
            }
        }
    }
}

/// The files of the sessions with these names.
fn sessions_named(
    configuration: &Configuration,
    names: &[String],
) -> Result<Vec<SessionFiles>, NoSource> {
    let all = configuration.pieces.iter().flat_map(|own| own.training.iter().chain(&own.test));
    let all: BTreeMap<&str, &SessionFiles> =
        all.map(|files| (files.name.as_str(), files)).collect();
    let named = |name: &String| {
        all.get(name.as_str()).map(|&files| files.clone()).ok_or_else(|| {
            let aside = configuration.set_aside.iter().find(|aside| aside.session == *name);
            of_session(name, aside.map_or("it is not there", |aside| aside.why.reason()))
        })
    };
    names.iter().map(named).collect()
}

fn of_session(session: &str, reason: &str) -> NoSource {
    let lost = Lost::Session(session.to_owned());
    NoSource::Missing(lost, format!("session {session}: {reason}"))
}

#[expect(clippy::needless_pass_by_value, reason = "errors are handed over where they end")]
fn other(error: impl ToString) -> NoSource {
    NoSource::Other(error.to_string())
}

/// The pipeline files, and the sessions that they found so far.
#[derive(Debug)]
pub struct Sought {
    pipelines: Vec<PathBuf>,
    /// By the path of the file, and the robot.
    found: BTreeMap<(PathBuf, Option<String>), (Tree, FoundSessions)>,
}

impl Sought {
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
