//! Which dwells went to one pose.
//!
//! Two dwells are visits of one pose when they had one command and stood alike:
//! - commanded positions within 0.01 mm and orientations within 0.01°. A program that goes to a pose again states the same
//!   numbers; controllers show and store commands to about these last digits, and no arm repeats as well, so whatever lies
//!   between is one pose to whoever programmed it;
//! - every reported joint within 1°. One command can be reached in several configurations, or with a joint a turn further on,
//!   which the standard would not count as one pose; a dwell's joints are within milliradians of its command's otherwise.
//!
//! A pose is named by the dwell that was first there; a dwell belongs to the first pose that it is alike to.

use std::collections::BTreeMap;

use crate::fit::commanded::CommandedPose;

/// Commanded positions of one pose are within this, mm.
const ONE_POSITION_MM: f64 = 0.01;
/// Commanded orientations of one pose are within this, rad.
const ONE_ORIENTATION_RAD: f64 = 0.01 / 180.0 * std::f64::consts::PI;
/// Reported joints of one pose are within this, rad.
const ONE_CONFIGURATION_RAD: f64 = std::f64::consts::PI / 180.0;

/// A dwell of the arm, measured or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dwell<'d> {
    /// Its command, where it has one.
    pub command: Option<CommandedPose>,
    /// Reported joint angles, rad.
    pub joints: &'d [f64],
}

/// For each dwell the place of the dwell that first visited its pose; `None` without a command.
pub fn poses(dwells: &[Dwell<'_>]) -> Vec<Option<usize>> {
    // Candidates by slices of the commanded x: only a pose in the same or the next slice can be within reach.
    let mut firsts: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
    let mut poses = Vec::with_capacity(dwells.len());
    for (place, dwell) in dwells.iter().enumerate() {
        let Some(command) = &dwell.command else {
            poses.push(None);
            continue;
        };
        let own = slice(command);
        let near = (own - 1..=own + 1).filter_map(|slice| firsts.get(&slice));
        let alike = near
            .flatten()
            .filter(|first| alike(&dwells[**first], dwell));
        let first = alike.min().copied();
        if first.is_none() {
            firsts.entry(own).or_default().push(place);
        }
        poses.push(Some(first.unwrap_or(place)));
    }
    poses
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "commands are within a thousand kilometres, and a cast saturates"
)]
fn slice(command: &CommandedPose) -> i64 {
    let slice = (command.position.x / ONE_POSITION_MM).floor() as i64;
    // Neighbours of the last slices have to exist.
    slice.clamp(i64::MIN + 1, i64::MAX - 1)
}

fn alike(a: &Dwell<'_>, b: &Dwell<'_>) -> bool {
    let (Some(first), Some(second)) = (&a.command, &b.command) else {
        return false;
    };
    let turned = match (&first.orientation, &second.orientation) {
        (Some(first), Some(second)) => first.angle_to(second),
        (None, None) => 0.0,
        _ => return false,
    };
    let mut joints = a.joints.iter().zip(b.joints);
    (first.position - second.position).norm() <= ONE_POSITION_MM
        && turned <= ONE_ORIENTATION_RAD
        && joints.all(|(a, b)| (a - b).abs() <= ONE_CONFIGURATION_RAD)
}

#[cfg(test)]
mod tests {
    use nalgebra::{Point3, UnitQuaternion, Vector3};

    use super::*;

    fn command(x_mm: f64, turned_rad: f64) -> CommandedPose {
        CommandedPose {
            position: Point3::new(x_mm, 0.0, 500.0),
            orientation: Some(UnitQuaternion::from_scaled_axis(Vector3::x() * turned_rad)),
        }
    }

    fn places(dwells: &[(Option<CommandedPose>, [f64; 2])]) -> Vec<Option<usize>> {
        let dwells: Vec<Dwell<'_>> = dwells
            .iter()
            .map(|(command, joints)| Dwell {
                command: *command,
                joints,
            })
            .collect();
        poses(&dwells)
    }

    #[test]
    fn one_command_and_one_configuration_are_one_pose() {
        let home = command(1000.0, 0.0);
        let found = places(&[
            (Some(home), [0.5, 1.0]),
            // 4 µm and 10 µrad of rounding, and joints 1 mrad off: the same pose.
            (Some(command(1000.004, 1e-5)), [0.501, 1.0]),
            // 0.05 mm away: another pose.
            (Some(command(1000.05, 0.0)), [0.5, 1.0]),
            // Turned by 1 mrad: another.
            (Some(command(1000.0, 1e-3)), [0.5, 1.0]),
            // The same command by another configuration, or a turn further on.
            (Some(home), [-0.5, 2.0]),
            (Some(home), [0.5 + std::f64::consts::TAU, 1.0]),
            (None, [0.5, 1.0]),
            (Some(home), [0.5, 1.0]),
        ]);
        let expected = [0, 0, 2, 3, 4, 5].map(Some);
        assert_eq!(found[..6], expected);
        assert_eq!(found[6..], [None, Some(0)]);
    }

    #[test]
    fn slices_do_not_part_what_is_alike() {
        // −0.001 and 0.004 mm lie in two slices of 0.01 mm; 0.011 is alike to the second alone, and the first counts.
        let joints = [0.0; 2];
        let found = places(&[
            (Some(command(-0.001, 0.0)), joints),
            (Some(command(0.004, 0.0)), joints),
            (Some(command(0.011, 0.0)), joints),
        ]);
        assert_eq!(found, [Some(0), Some(0), Some(2)]);
        // Commands without end are no reason to stop.
        let far = places(&[
            (Some(command(1e300, 0.0)), joints),
            (Some(command(-1e300, 0.0)), joints),
        ]);
        assert_eq!(far, [Some(0), Some(1)]);
    }

    #[test]
    fn a_stated_and_an_unstated_orientation_are_not_one_command() {
        let unstated = CommandedPose {
            orientation: None,
            ..command(0.0, 0.0)
        };
        let found = places(&[
            (Some(command(0.0, 0.0)), [0.0; 2]),
            (Some(unstated), [0.0; 2]),
            (Some(unstated), [0.0; 2]),
        ]);
        assert_eq!(found, [Some(0), Some(1), Some(1)]);
    }
}
