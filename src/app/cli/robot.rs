//! `posegrid robot FILE`: a robot file from a URDF, in any convention, or its flange at joint positions; `--list`: the
//! ready robots.

mod list;

use std::io;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use thiserror::Error;

use crate::at::At;
use crate::files::input::{self, Bound};
use crate::io::robot::poses::{self, PosesError};
use crate::io::robot::ready::{READY, ReadyRobot};
use crate::io::robot::{self, LeftOut, Selection, written};
use crate::kinematics::{Arm, Convention, RestateError, RobotFile};
use crate::nearest::did_you_mean;
use crate::pipeline::robot_file::{self, NoRobotFile};

/// Make a robot file: from a URDF, in any convention, or one of the ready ones
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid robot --list                      # the ready robots
  posegrid robot ur10e > robot.toml
  posegrid robot my.urdf --base base_link --tip tool0 > robot.toml
  posegrid robot my.urdf --base base_link --tip tool0 --joints joint_1,joint_2,joint_3,joint_4,joint_5,joint_6
  posegrid robot robot.toml --convention modified-dh
  posegrid robot robot.toml --at poses.csv   # is it right? The flange there, to compare with the pendant

A xacro file is expanded first: xacro my.urdf.xacro > my.urdf. Meshes, inertias and transmissions of a URDF are left out; a joint
that mimics another follows it. poses.csv has a column for each joint that the controller reports, by its name, in degrees, or mm
for a joint that slides; the flange is in the base frame, in mm, its rotation as a quaternion.

Exit codes: 0 done; 1 it could not be written to stdout; 2 bad usage, or the file is no robot file.")]
pub struct RobotArgs {
    /// A robot file, a URDF, or the name of a ready robot
    #[arg(required_unless_present = "list")]
    pub file: Option<PathBuf>,
    /// List the ready robots
    #[arg(long, conflicts_with_all = ["file", "base", "tip", "joints", "convention", "at"])]
    pub list: bool,
    /// The arm in the file
    #[command(flatten)]
    pub arm: ArmFlags,
    /// State the arm in this convention
    #[arg(long, value_name = "WORD", value_parser = conventions())]
    pub convention: Option<Convention>,
    /// Print the nominal flange at the joint positions of this CSV instead
    #[arg(long, value_name = "CSV")]
    pub at: Option<PathBuf>,
}

/// The arm in a file that may hold more, and the names of its joints.
#[derive(Debug, Clone, Default, Args)]
#[group(skip)]
pub struct ArmFlags {
    /// The link of a URDF that is the base; its root without it
    #[arg(long, value_name = "LINK")]
    pub base: Option<String>,
    /// The link of a URDF that is the flange; needed where several links end a chain
    #[arg(long, value_name = "LINK")]
    pub tip: Option<String>,
    /// The controller's names of the reported joints, from base to flange, with commas between
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub joints: Option<Vec<String>>,
}

impl ArmFlags {
    pub fn selection(&self) -> Selection {
        Selection { base: self.base.clone(), tip: self.tip.clone(), joints: self.joints.clone() }
    }
}

fn conventions() -> impl TypedValueParser<Value = Convention> {
    let words = PossibleValuesParser::new(Convention::ALL.map(Convention::word));
    words.try_map(|word| Convention::of_word(&word).ok_or("no convention"))
}

#[derive(Debug, Error)]
pub enum RobotCommandError {
    #[error(
        "there is no file {}, and no ready robot has that name{}: {}",
        .0.display(), did_you_mean(&.0.to_string_lossy(), READY.iter().map(ReadyRobot::name)),
        READY.iter().map(ReadyRobot::name).collect::<Vec<_>>().join(", ")
    )]
    Nothing(PathBuf),
    #[error(transparent)]
    File(#[from] At<RobotProblem>),
}

#[derive(Debug, Error)]
pub enum RobotProblem {
    #[error("{0}")]
    Read(#[from] io::Error),
    #[error(transparent)]
    NoRobot(#[from] NoRobotFile),
    #[error(transparent)]
    Restate(#[from] RestateError),
    #[error("{0}")]
    Toml(#[from] toml::ser::Error),
    #[error(transparent)]
    Poses(#[from] PosesError),
}

impl RobotProblem {
    fn at(self, path: &Path) -> RobotCommandError {
        RobotCommandError::File(match self {
            Self::NoRobot(fault) => fault.at(path),
            other => At::new(path.display(), other),
        })
    }
}

pub fn show(args: &RobotArgs) -> Result<String, RobotCommandError> {
    let Some(path) = args.file.as_deref().filter(|_| !args.list) else { return Ok(list::ready()) };
    let (_, text) = file_or_ready(path).map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => RobotCommandError::Nothing(path.to_owned()),
        _ => RobotProblem::Read(error).at(path),
    })?;
    let stated = args.stated(path, &text).map_err(|kind| kind.at(path))?;
    let Some(poses) = &args.at else {
        return args.printed(path, text, &stated).map_err(|kind| kind.at(path));
    };
    let positions = input::text(poses, Bound::TARGETS);
    let positions = positions.map_err(|source| RobotProblem::Read(source).at(poses))?;
    poses::flanges(&stated.arm, &positions).map_err(|source| RobotProblem::Poses(source).at(poses))
}

/// Name and text of a robot file, or of the ready robot of that name where there is no such file.
pub fn file_or_ready(path: &Path) -> io::Result<(String, String)> {
    match (robot::text(path), path.to_str().and_then(ReadyRobot::find)) {
        (Err(error), Some(robot)) if error.kind() == io::ErrorKind::NotFound => {
            Ok((robot.file.to_owned(), robot.printed().to_owned()))
        }
        (text, _) => Ok((path.display().to_string(), text?)),
    }
}

struct Stated {
    file: RobotFile,
    arm: Arm,
    left_out: Option<LeftOut>,
}

impl RobotArgs {
    fn stated(&self, path: &Path, text: &str) -> Result<Stated, RobotProblem> {
        let selection = self.arm.selection();
        let robot::Read { file, left_out } = robot_file::read(path, text, &selection)?;
        let mut stated = Stated { arm: robot_file::arm_of(&file, text)?, file, left_out };
        if let Some(convention) = self.convention {
            stated.file = stated.file.restated(convention)?;
            stated.arm = stated.file.arm().map_err(RestateError::from)?;
        }
        Ok(stated)
    }

    /// The robot file as TOML: its own text where that is TOML and nothing is changed.
    fn printed(&self, path: &Path, text: String, stated: &Stated) -> Result<String, RobotProblem> {
        let is_changed = self.arm.joints.is_some()
            || self.convention.is_some()
            || text.parse::<toml::Table>().is_err();
        let Some(left_out) = &stated.left_out else {
            return Ok(if is_changed { written::toml(&stated.file)? } else { text });
        };
        let source = path.file_name().unwrap_or_default().to_string_lossy();
        Ok(written::comment(&source, left_out) + &written::toml(&stated.file)?)
    }
}
