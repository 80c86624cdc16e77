//! `MOC.cfg` → the arm's base in the world: `-base_frame_pos_x` and so on of its only robot, metres, and a quaternion.

use nalgebra::{Isometry3, Translation3};

use super::motion::quaternion;
use crate::frame::{Chain, not_given};
use crate::program::File;
use crate::refusal::Refusal;

const NAME: &str = "base_frame";

pub(super) fn read(files: &[File]) -> Chain {
    let mut configurations = files.iter().filter(|file| is_configuration(file));
    let missing = || not_given(NAME, "MOC.cfg, or its place in the file of the cell");
    let place = match (configurations.next(), configurations.next()) {
        (Some(only), None) => of(only).unwrap_or_else(missing),
        (Some(first), Some(second)) => Err(Refusal::TwoValues {
            name: NAME.to_owned(),
            first: first.at(1),
            second: second.at(1),
        }),
        (None, _) => missing(),
    };
    Chain::one(NAME, place)
}

pub(crate) fn is_configuration(file: &File) -> bool {
    file.base_name().eq_ignore_ascii_case("MOC.cfg")
}

/// The base frame of the only robot of a file; `None` where it has another number of them.
fn of(file: &File) -> Option<Result<Isometry3<f64>, Refusal>> {
    let text = String::from_utf8_lossy(&file.bytes);
    let mut robots = Vec::new();
    let mut inside = false;
    for line in text.lines() {
        let line = line.trim();
        if line.starts_with('#') {
            inside = false;
        } else if line.trim_end_matches(':') == "ROBOT" && line.ends_with(':') {
            inside = true;
        } else if inside && !line.is_empty() {
            if line.starts_with("-name") {
                robots.push(String::new());
            }
            let robot = robots.last_mut()?;
            robot.push_str(line.trim_end_matches('\\'));
            robot.push(' ');
        }
    }
    let [robot] = robots.as_slice() else {
        return None;
    };
    Some(frame(file, robot))
}

fn frame(file: &File, robot: &str) -> Result<Isometry3<f64>, Refusal> {
    let words: Vec<&str> = robot.split_ascii_whitespace().collect();
    let stated =
        |key: &str| words.iter().position(|word| *word == key).and_then(|at| words.get(at + 1));
    if stated("-base_frame_coordinated").is_some_and(|word| *word != "\"\"") {
        return Err(Refusal::Moving { name: NAME.to_owned(), at: file.at(1) });
    }
    let wrong = || Refusal::NoFrame { name: NAME.to_owned(), at: file.at(1) };
    // What stands at its default is left out of the file.
    let number = |key: &str, default: f64| match stated(key) {
        Some(word) => word.parse::<f64>().map_err(|_| wrong()),
        None => Ok(default),
    };
    let metres = |axis: &str| number(&format!("-base_frame_pos_{axis}"), 0.0);
    let part = |part: &str, default| number(&format!("-base_frame_orient_{part}"), default);
    let at = [metres("x")?, metres("y")?, metres("z")?].map(|metres| metres * 1000.0);
    let turn = quaternion([part("u0", 1.0)?, part("u1", 0.0)?, part("u2", 0.0)?, part("u3", 0.0)?]);
    Ok(Isometry3::from_parts(Translation3::from(at), turn.ok_or_else(wrong)?))
}
