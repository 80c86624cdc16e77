//! A pipeline file and the robot file it names, read and checked, with the paths in it resolved.

use std::path::{Path, PathBuf};

use toml::Table;

use super::robots::{Robots, StatedRobot};
use super::tree::Tree;
use super::{
    ConfigurationError, ConfigurationErrorKind, Result, checks, folder_of, placed_at, read_arm,
    resolved,
};
use crate::files::input::{self, Bound, toml_problem};
use crate::files::store::Place;
use crate::kinematics::Arm;
use crate::pipeline::file::PipelineFile;
use crate::pipeline::keys::{KeyReference, door};

#[derive(Debug)]
pub struct Files {
    pub file: PipelineFile,
    /// The folder that paths in it are relative to.
    pub base: PathBuf,
    pub robot_file: PathBuf,
    pub arm: Arm,
    pub lake: Place,
}

/// A pipeline file as written: of one robot, or of several.
#[derive(Debug)]
pub struct Source {
    pub path: PathBuf,
    /// The folder that paths in it are relative to.
    base: PathBuf,
    text: String,
    /// Its robots; `None` where it is of one.
    pub robots: Option<Robots>,
}

/// Reads the pipeline file at `path`, of the robot of that name where it has several.
pub fn read(path: &Path, robot: Option<&str>) -> Result<Files> {
    let source = Source::read(path)?;
    match (&source.robots, robot) {
        (None, _) => source.alone(),
        (Some(robots), Some(name)) => source.of(robots, robots.named(path, name)?),
        (Some(robots), None) => {
            let known: Vec<String> = robots.names().map(str::to_owned).collect();
            Err(ConfigurationErrorKind::several_robots(&known).at(path))
        }
    }
}

impl Source {
    pub fn read(path: &Path) -> Result<Self> {
        let text = input::text(path, Bound::SETTINGS)
            .map_err(|source| ConfigurationErrorKind::Read(source).at(path))?;
        let values: Table = toml::from_str(&text).map_err(|source| unread(path, &source))?;
        let base = folder_of(path)?;
        Ok(Self { robots: Robots::of(path, &base, &values)?, path: path.to_owned(), base, text })
    }

    pub fn alone(&self) -> Result<Files> {
        self.keys(&self.text, true)?;
        let file = toml::from_str(&self.text).map_err(|source| unread(&self.path, &source))?;
        self.checked(file)
    }

    pub fn of(&self, robots: &Robots, robot: &StatedRobot) -> Result<Files> {
        let text = robots.file_of(&robot.entry).to_string();
        let file = self.keys(&text, false).and_then(|()| self.made(&text));
        file.and_then(|file| self.checked(file)).map_err(|source| robot.fault(source))
    }

    /// The pipeline file of a robot that stands for all of them: its sessions are those of every robot.
    pub fn of_any(&self, robots: &Robots, robot: &StatedRobot) -> Result<PipelineFile> {
        let file = self.made(&robots.file_of_any(&robot.entry).to_string());
        file.map_err(|source| robot.fault(source))
    }

    /// The pipeline file of a text made from several places, whose lines nobody knows.
    fn made(&self, text: &str) -> Result<PipelineFile> {
        let problem = |source: toml::de::Error| source.message().trim().replace('\n', " ");
        let file = toml::from_str(text).map_err(problem);
        file.map_err(|problem| ConfigurationErrorKind::Fault(problem).at(&self.path))
    }

    /// Checks that no other robot than that of `files` is asked for, as the file is of one.
    pub fn is_of(&self, files: &Files, robots: &[String]) -> Result<()> {
        let own = &files.file.robot.name;
        let Some(other) = robots.iter().find(|name| own.as_ref() != Some(name)) else {
            return Ok(());
        };
        Err(ConfigurationErrorKind::no_robot(other, &[]).at(&self.path))
    }

    /// Checks that the file is sound for a robot at least.
    pub fn sound(&self) -> Result<()> {
        let Some(robots) = &self.robots else { return self.alone().map(drop) };
        let mut each = robots.stated.iter().map(|own| self.of(robots, own));
        let first = each.next().map_or(Ok(()), |own| own.map(drop));
        first.or_else(|error| each.find_map(Result::ok).map(drop).ok_or(error))
    }

    /// Checks keys and ranges of a file with this text, whose lines are told where the text `is_written` by a person.
    fn keys(&self, text: &str, is_written: bool) -> Result<()> {
        let checked = door::check(KeyReference::pipeline(), text, is_written);
        checked.map_err(|faults| ConfigurationErrorKind::Fault(faults.to_string()).at(&self.path))
    }

    fn checked(&self, file: PipelineFile) -> Result<Files> {
        let robot_file = resolved(&self.base, &file.robot.file);
        let arm = read_arm(&self.path, &robot_file, &file.robot.selection())?;
        checks::check(&self.path, &file, arm.joints().len())?;
        checks::length_unit(&self.path, &file, &arm)?;
        let (lake, base) = (placed_at(&self.base, &file.output.lake), self.base.clone());
        Ok(Files { file, base, robot_file, arm, lake })
    }

    /// The place of the sessions that a pipeline file names.
    pub fn sessions(&self, file: &PipelineFile) -> Place {
        placed_at(&self.base, &file.input.folder)
    }
}

impl Files {
    pub fn sessions(&self) -> Place {
        placed_at(&self.base, &self.file.input.folder)
    }

    /// The tree in which the sessions are searched.
    pub fn tree(&self) -> Result<Tree> {
        Ok(Tree::at(&self.sessions())?)
    }
}

fn unread(path: &Path, source: &toml::de::Error) -> ConfigurationError {
    ConfigurationErrorKind::Fault(toml_problem(source)).at(path)
}
