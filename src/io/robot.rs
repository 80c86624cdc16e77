//! A robot file of any kind → [`RobotFile`]: TOML as it is written, a chain of a URDF, which begins with `<` ([`urdf`]), or
//! the calibration file of a UR in YAML (`ur_calibration`). [`written`] states a robot file as TOML, [`poses`] reads joint
//! positions, and [`ready`] holds the robot files of the program.

pub mod poses;
pub mod ready;
mod ur_calibration;
pub mod urdf;
pub mod written;

use std::io;
use std::path::Path;

use thiserror::Error;

use crate::input::{self, Bound, toml_problem};
use crate::kinematics::RobotFile;
use crate::measured_table::decode;
use urdf::UrdfError;

pub use urdf::LeftOut;

#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Selection {
    /// The link of a URDF that is the base; its root where absent.
    pub base: Option<String>,
    /// The link of a URDF that is the flange; the last one where absent, if there is one only.
    pub tip: Option<String>,
    /// The controller's names of the reported joints, from base to flange; the file's own where absent.
    pub joints: Option<Vec<String>>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Read {
    pub file: RobotFile,
    /// The chosen chain of a URDF and its other contents; `None` for TOML, which has no others.
    pub left_out: Option<LeftOut>,
}

#[derive(Debug, Error)]
pub enum RobotFault {
    #[error("{}", toml_problem(.0))]
    Toml(Box<toml::de::Error>),
    #[error(transparent)]
    Urdf(#[from] Box<UrdfError>),
    #[error("{0}")]
    Calibration(String),
    #[error(
        "base and tip name links of a URDF, and the chain of this robot file is the arm: take them out"
    )]
    NoLinks,
    #[error(
        "joints names {}, but the controller reports {}, from base to flange: {}; name each of them",
        counted(*.found), counted(.joints.len()), .joints.join(", ")
    )]
    Names { found: usize, joints: Vec<String> },
}

fn counted(count: usize) -> String {
    match count {
        1 => "1 joint".to_owned(),
        _ => format!("{count} joints"),
    }
}

pub fn text(path: &Path) -> io::Result<String> {
    if path.extension().is_some_and(|ending| ending == "toml") {
        return input::text(path, Bound::SETTINGS);
    }
    // XML may state another encoding than UTF-8.
    let bytes = input::bytes(path, Bound::URDF)?;
    let decoded = decode(&bytes).map_err(|fault| io::Error::other(fault.to_string()))?;
    Ok(decoded.text.into_owned())
}

pub fn read(path: &Path, text: &str, selection: &Selection) -> Result<Read, RobotFault> {
    let mut read = if is_urdf(path, text) {
        let (file, left_out) = urdf::read(path, text, selection)?;
        Read { file, left_out: Some(left_out) }
    } else {
        let file = if has_ending(path, &["yaml", "yml"]) {
            ur_calibration::read(path, text).map_err(RobotFault::Calibration)?
        } else {
            toml::from_str(text).map_err(|source| RobotFault::Toml(Box::new(source)))?
        };
        if selection.base.is_some() || selection.tip.is_some() {
            return Err(RobotFault::NoLinks);
        }
        Read { file, left_out: None }
    };
    if let Some(names) = &selection.joints {
        rename(&mut read.file, names)?;
    }
    Ok(read)
}

fn is_urdf(path: &Path, text: &str) -> bool {
    let begins = text.trim_start_matches('\u{feff}').trim_start();
    begins.starts_with('<') || has_ending(path, &["urdf", "xacro", "xml"])
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|own| endings.contains(&own))
}

fn rename(file: &mut RobotFile, names: &[String]) -> Result<(), RobotFault> {
    let reported = || file.joint.iter().filter(|joint| joint.is_reported());
    let own: Vec<String> = reported().map(|joint| joint.name.clone()).collect();
    if own.len() != names.len() {
        return Err(RobotFault::Names {
            found: names.len(),
            joints: own.iter().map(|name| format!("{name:?}")).collect(),
        });
    }
    let renamed = |name: &str| {
        let place = own.iter().position(|own| own == name);
        place.map(|place| names[place].clone())
    };
    for joint in &mut file.joint {
        let name = joint.mimic.as_mut().map_or(&mut joint.name, |mimic| &mut mimic.joint);
        if let Some(renamed) = renamed(name) {
            *name = renamed;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
