//! The ready robots: every file of `pipelines/robots`, part of the program.
//!
//! A new file there is a line in [`READY`]; a test holds the list against the folder.

/// A ready robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReadyRobot {
    /// The file in `pipelines/robots`.
    pub file: &'static str,
    /// The file's text.
    pub text: &'static str,
}

/// The files by their names.
macro_rules! ready {
    ($($file:literal,)*) => {
        &[$(ReadyRobot {
            file: $file,
            text: include_str!(concat!("../../../pipelines/robots/", $file)),
        },)*]
    };
}

/// Every ready robot, in the order of the files' names.
pub const READY: &[ReadyRobot] = ready![
    "irb120.toml",
    "kr210-r2700-extra.toml",
    "ur10.toml",
    "ur10e.toml",
    "ur5.toml",
    "ur5e.toml",
];

impl ReadyRobot {
    /// The robot's name: the file's without its ending.
    pub fn name(&self) -> &'static str {
        self.file.trim_end_matches(".toml")
    }

    /// The ready robot of that name; `None` where there is none.
    pub fn find(name: &str) -> Option<&'static Self> {
        READY
            .iter()
            .find(|robot| robot.name() == name || robot.file == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_the_folder_is_listed_in_order() {
        let folder = std::fs::read_dir("pipelines/robots").unwrap();
        let names = folder.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|name| name.ends_with(".toml")).collect();
        names.sort();
        let listed: Vec<&str> = READY.iter().map(|robot| robot.file).collect();
        assert_eq!(names, listed);
        assert_eq!(
            ReadyRobot::find("ur10e"),
            ReadyRobot::find("ur10e.toml"),
            "either name"
        );
        assert!(ReadyRobot::find("ur1").is_none());
    }
}
