//! A pipeline file and the robot file it names, read and checked, with the paths in it resolved.

use std::path::{Path, PathBuf};

use super::{ConfigurationError, checks, folder_of, placed_at, read_arm, resolved};
use crate::io::store::Place;
use crate::kinematics::Arm;
use crate::pipeline::file::PipelineFile;

/// The contents of the files.
#[derive(Debug)]
pub struct Files {
    /// The pipeline file.
    pub file: PipelineFile,
    /// The folder that paths in it are relative to.
    pub base: PathBuf,
    /// The robot file.
    pub robot_file: PathBuf,
    /// The nominal arm.
    pub arm: Arm,
    /// Where the published tables are.
    pub lake: Place,
}

/// Reads the pipeline file at `path`.
pub fn read(path: &Path) -> Result<Files, ConfigurationError> {
    let file = super::read(path)?;
    let base = folder_of(path)?;
    let robot_file = resolved(&base, &file.robot.file);
    let arm = read_arm(path, &robot_file, &file.robot.selection())?;
    checks::check(path, &file, arm.joints().len())?;
    checks::length_unit(path, &file, &arm)?;
    Ok(Files {
        lake: placed_at(&base, &file.output.lake),
        file,
        base,
        robot_file,
        arm,
    })
}
