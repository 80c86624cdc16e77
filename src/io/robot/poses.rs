//! A CSV of joint positions, in columns with the names of the reported joints, degrees or mm → the flange at each in
//! the base frame: mm, and a quaternion whose real part is not negative.

use std::fmt::Write as _;

use thiserror::Error;

use crate::kinematics::{Arm, Joint};

#[derive(Debug, Error)]
pub enum PosesError {
    #[error("{0}")]
    Csv(#[from] csv::Error),
    #[error(
        "the first line names the columns {}, but they have to be the reported joints, each once: {}",
        found.join(", "), joints.join(", ")
    )]
    Columns { found: Vec<String>, joints: Vec<String> },
    #[error(
        "line {line}, column {joint:?}: {found:?} is no finite number; give degrees, or mm for a joint that slides"
    )]
    Number { line: u64, joint: String, found: String },
}

pub fn flanges(arm: &Arm, text: &str) -> Result<String, PosesError> {
    let mut reader = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let places = places(reader.headers()?, arm.joints())?;
    let mut out = "x_mm,y_mm,z_mm,qx,qy,qz,qw\n".to_owned();
    for row in reader.records() {
        let row = row?;
        let reported = arm.joints().iter().zip(&places);
        let reported: Result<Vec<f64>, PosesError> =
            reported.map(|(joint, &place)| position(&row, joint, place)).collect();
        push(&mut out, arm, &reported?);
    }
    Ok(out)
}

fn places(header: &csv::StringRecord, joints: &[Joint]) -> Result<Vec<usize>, PosesError> {
    let place = |joint: &Joint| header.iter().position(|name| name == joint.name);
    let places: Option<Vec<usize>> = joints.iter().map(place).collect();
    let quoted = |name: &str| format!("{name:?}");
    places.filter(|places| places.len() == header.len()).ok_or_else(|| PosesError::Columns {
        found: header.iter().map(quoted).collect(),
        joints: joints.iter().map(|joint| quoted(&joint.name)).collect(),
    })
}

/// A reported position, rad or mm.
fn position(row: &csv::StringRecord, joint: &Joint, place: usize) -> Result<f64, PosesError> {
    let found = row.get(place).unwrap_or_default();
    let number: Option<f64> = found.parse().ok();
    let number = number.filter(|number| number.is_finite());
    let number = number.ok_or_else(|| PosesError::Number {
        line: row.position().map_or(0, csv::Position::line),
        joint: joint.name.clone(),
        found: found.to_owned(),
    })?;
    Ok(if joint.slides { number } else { number.to_radians() })
}

fn push(out: &mut String, arm: &Arm, reported: &[f64]) {
    let flange = *arm.flange(reported).isometry();
    let at = flange.translation.vector;
    let turn = flange.rotation.coords;
    let sign = if turn.w < 0.0 { -1.0 } else { 1.0 };
    let numbers = [at.x, at.y, at.z].into_iter();
    let numbers = numbers.chain([turn.x, turn.y, turn.z, turn.w].map(|part| sign * part));
    // Without a negative zero.
    let numbers: Vec<String> = numbers.map(|number| (number + 0.0).to_string()).collect();
    let _ = writeln!(out, "{}", numbers.join(","));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::RobotFile;
    use crate::robot::ready::ReadyRobot;

    fn arm() -> Arm {
        let text = ReadyRobot::find("kr210-r2700-extra").unwrap().text;
        toml::from_str::<RobotFile>(text).unwrap().arm().unwrap()
    }

    #[test]
    fn the_flange_stands_where_the_data_sheet_draws_it() {
        // Columns in another order; link arm up, forearm level.
        let text = "joint_a2,joint_a1,joint_a3,joint_a4,joint_a5,joint_a6\n-90,0, 90 ,0,0,0\n";
        let out = flanges(&arm(), text).unwrap();
        let rows: Vec<&str> = out.lines().collect();
        assert_eq!(rows[0], "x_mm,y_mm,z_mm,qx,qy,qz,qw");
        let numbers: Vec<f64> = rows[1].split(',').map(|x| x.parse().unwrap()).collect();
        let expected = [1765.0, 0.0, 1784.0];
        for (found, expected) in numbers.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9, "{numbers:?}");
        }
        assert_eq!((rows.len(), numbers.len()), (2, 7));
    }

    #[test]
    fn wrong_columns_and_numbers_are_named() {
        let told = |text: &str| flanges(&arm(), text).unwrap_err().to_string();
        let columns = told("joint_a1,joint_a2\n0,0\n");
        assert!(columns.contains("\"joint_a6\""), "{columns}");
        let header = "joint_a1,joint_a2,joint_a3,joint_a4,joint_a5,joint_a6\n";
        let number = told(&format!("{header}0,0,0,0,0,0\n0,0,nan,0,0,0\n"));
        assert!(number.starts_with("line 3, column \"joint_a3\": \"nan\""), "{number}");
        assert!(told(&format!("{header}0,0\n")).contains("2 fields"));
        assert!(told(&header.replace("joint_a6", "joint_a1")).contains("each once"));
    }
}
