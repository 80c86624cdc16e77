//! Every file of `pipelines/robots`, part of the program: each is a line in [`READY`].

use crate::kinematics::RobotFile;
use crate::setup::KnownArm;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadyRobot {
    pub file: &'static str,
    pub text: &'static str,
}

/// The arm of every ready robot, with the name of its file; a test reads every file.
pub fn arms() -> Vec<KnownArm> {
    let arm = |robot: &ReadyRobot| {
        let arm = toml::from_str::<RobotFile>(robot.text).ok()?.arm().ok()?;
        Some(KnownArm { file: robot.file.to_owned(), arm })
    };
    READY.iter().filter_map(arm).collect()
}

macro_rules! ready {
    ($($file:literal,)*) => {
        &[$(ReadyRobot {
            file: $file,
            text: include_str!(concat!("../../../pipelines/robots/", $file)),
        },)*]
    };
}

pub const READY: &[ReadyRobot] = ready![
    "fr3.toml",
    "gp25.toml",
    "irb120.toml",
    "irb1200-5-90.toml",
    "irb4600-40-255.toml",
    "irb4600-60-205.toml",
    "irb6700-200-260.toml",
    "kr10-r1100-sixx.toml",
    "kr210-r2700-extra.toml",
    "kr210-r3100-2.toml",
    "kr210-r3100-ultra.toml",
    "kr6-r700-sixx.toml",
    "kr6-r900-sixx.toml",
    "lbr-iiwa14-r820.toml",
    "m20ia.toml",
    "m20id-25.toml",
    "ma1400.toml",
    "meca500.toml",
    "panda.toml",
    "r2000ic-165f.toml",
    "r2000ic-210f.toml",
    "tx2-60.toml",
    "tx2-90.toml",
    "ur10.toml",
    "ur10e.toml",
    "ur12e.toml",
    "ur15.toml",
    "ur16e.toml",
    "ur18.toml",
    "ur20.toml",
    "ur3.toml",
    "ur30.toml",
    "ur3e.toml",
    "ur5.toml",
    "ur5e.toml",
    "ur7e.toml",
    "ur8-long.toml",
    "wam.toml",
];

impl ReadyRobot {
    /// The robot's name: the file's without its ending.
    pub fn name(&self) -> &'static str {
        self.file.trim_end_matches(".toml")
    }

    /// Its file as it stands anywhere: without the first line, which names a schema beside it.
    pub fn printed(&self) -> &'static str {
        let is_schema = self.text.starts_with("#:schema");
        self.text.split_once('\n').filter(|_| is_schema).map_or(self.text, |(_, rest)| rest)
    }

    /// The ready robot of that name; `None` where there is none.
    pub fn find(name: &str) -> Option<&'static Self> {
        READY.iter().find(|robot| robot.name() == name || robot.file == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_listed_in_order() {
        let folder = std::fs::read_dir("../../pipelines/robots").unwrap();
        let names = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> =
            names.filter(|name| name.strip_suffix(".toml").is_some()).collect();
        names.sort();
        let listed: Vec<&str> = READY.iter().map(|robot| robot.file).collect();
        assert_eq!(names, listed);
        assert_eq!(ReadyRobot::find("ur10e"), ReadyRobot::find("ur10e.toml"), "either name");
        assert!(ReadyRobot::find("ur1").is_none());
    }
    #[test]
    fn every_file_is_an_arm() {
        assert_eq!(arms().len(), READY.len());
    }
}
