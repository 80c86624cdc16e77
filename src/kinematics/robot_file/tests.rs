use super::*;

fn file(text: &str) -> RobotFile {
    toml::from_str(text).expect("a robot file")
}
