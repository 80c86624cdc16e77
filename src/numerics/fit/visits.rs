//! Dwells of the arm that are visits of one pose.
//!
//! Inputs: commands and reported joints of dwells. Output: for each dwell the one that stands for its pose. All code that
//! counts poses rather than dwells uses it: distribution-free bounds, held-out blocks, ISO 9283.
//!
//! Two dwells are visits of one pose when their commands and joint angles agree:
//! - commanded positions within 0.01 mm and orientations within 0.01°. A program that revisits a pose states the same
//!   numbers; controllers show and store commands to about these last digits, and no arm repeats as well, so commands this
//!   near are one pose to the programmer;
//! - every reported joint within 1°. One command can be reached in several configurations, or with a joint a turn further on,
//!   which the standard would not count as one pose; a dwell's joints are within milliradians of its command's otherwise.
//!
//! A dwell without a command is a visit of the pose of its joint angles: every reported joint within 0.1°. Servo errors of a
//! stationary joint are a tenth of that, and no two poses of a program are so near.
//!
//! A pose is named by its first dwell, of those with a command where there is one; a dwell belongs to the first
//! pose that it agrees with.

use std::collections::BTreeMap;

use nalgebra::{Point3, UnitQuaternion};

/// Commanded positions of one pose are within this, mm.
const ONE_POSITION_MM: f64 = 0.01;
/// Commanded orientations of one pose are within this, rad.
const ONE_ORIENTATION_RAD: f64 = 0.01 / 180.0 * std::f64::consts::PI;
/// Reported joints of one pose are within this, rad.
const ONE_CONFIGURATION_RAD: f64 = std::f64::consts::PI / 180.0;

/// Reported joints of one pose are within this without a command, rad.
const ONE_STAND_RAD: f64 = 0.1 / 180.0 * std::f64::consts::PI;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CommandedPose {
    pub position: Point3<f64>,
    pub orientation: Option<UnitQuaternion<f64>>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dwell<'d> {
    pub command: Option<CommandedPose>,
    /// Reported joint angles, rad; mm where a joint slides.
    pub joints: &'d [f64],
    /// Radians that one unit of each joint's variable counts as; 1 beyond its end.
    pub counted: &'d [f64],
}

impl Dwell<'_> {
    /// The joints as angles: a mm of sliding counts as a mrad.
    fn angles(&self) -> impl Iterator<Item = f64> {
        let counted = self.counted.iter().copied().chain(std::iter::repeat(1.0));
        self.joints.iter().zip(counted).map(|(q, own)| q * own)
    }
}

/// For each dwell, the index of the dwell that names its pose.
pub fn poses(dwells: &[Dwell<'_>]) -> Vec<usize> {
    let mut poses: Vec<usize> = (0..dwells.len()).collect();
    let commanded = |place: &usize| dwells[*place].command.is_some();
    let (with, without): (Vec<usize>, Vec<usize>) = (0..dwells.len()).partition(commanded);
    let mut by_command = Firsts::new(ONE_POSITION_MM, |dwell| Some(dwell.command?.position.x));
    let mut by_joints = Firsts::new(ONE_STAND_RAD, |dwell| dwell.angles().next());
    for place in with {
        poses[place] = by_command.of(dwells, place, alike);
        if poses[place] == place {
            by_joints.add(dwells, place);
        }
    }
    for place in without {
        poses[place] = by_joints.of(dwells, place, |a, b| stand_within(a, b, ONE_STAND_RAD));
    }
    poses
}

/// The first dwells of poses, by slices of a coordinate: only those in the same or a neighbouring slice can agree.
struct Firsts {
    slice: f64,
    coordinate: fn(&Dwell<'_>) -> Option<f64>,
    found: BTreeMap<i64, Vec<usize>>,
}

impl Firsts {
    const fn new(slice: f64, coordinate: fn(&Dwell<'_>) -> Option<f64>) -> Self {
        Self { slice, coordinate, found: BTreeMap::new() }
    }

    /// The first of those found so far for which `is_alike` is true with the dwell at `place`; the dwell itself where none is.
    fn of(
        &mut self,
        dwells: &[Dwell<'_>],
        place: usize,
        is_alike: impl Fn(&Dwell<'_>, &Dwell<'_>) -> bool,
    ) -> usize {
        let dwell = &dwells[place];
        let own = self.slice(dwell);
        let near = (own - 1..=own + 1).filter_map(|slice| self.found.get(&slice));
        let alike = near.flatten().filter(|first| is_alike(&dwells[**first], dwell));
        alike.min().copied().unwrap_or_else(|| {
            self.add(dwells, place);
            place
        })
    }

    fn add(&mut self, dwells: &[Dwell<'_>], place: usize) {
        self.found.entry(self.slice(&dwells[place])).or_default().push(place);
    }

    #[expect(
        clippy::cast_possible_truncation,
        reason = "commands are within a thousand kilometres, and a cast saturates"
    )]
    fn slice(&self, dwell: &Dwell<'_>) -> i64 {
        let coordinate = (self.coordinate)(dwell).unwrap_or(0.0);
        let slice = (coordinate / self.slice).floor() as i64;
        // Neighbours of the last slices have to exist.
        slice.clamp(i64::MIN + 1, i64::MAX - 1)
    }
}

fn alike(a: &Dwell<'_>, b: &Dwell<'_>) -> bool {
    let (Some(first), Some(second)) = (&a.command, &b.command) else { return false };
    let turned = match (&first.orientation, &second.orientation) {
        (Some(first), Some(second)) => first.angle_to(second),
        (None, None) => 0.0,
        _ => return false,
    };
    (first.position - second.position).norm() <= ONE_POSITION_MM
        && turned <= ONE_ORIENTATION_RAD
        && stand_within(a, b, ONE_CONFIGURATION_RAD)
}

/// Whether no joint of two dwells differs by more than `rad`.
fn stand_within(a: &Dwell<'_>, b: &Dwell<'_>, rad: f64) -> bool {
    let mut joints = a.angles().zip(b.angles());
    a.joints.len() == b.joints.len() && joints.all(|(a, b)| (a - b).abs() <= rad)
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

    fn places(dwells: &[(Option<CommandedPose>, [f64; 2])]) -> Vec<usize> {
        let dwells: Vec<Dwell<'_>> = dwells
            .iter()
            .map(|(command, joints)| Dwell { command: *command, joints, counted: &[] })
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
            (Some(home), [0.5, 1.0]),
        ]);
        assert_eq!(found, [0, 0, 2, 3, 4, 5, 0]);
    }

    #[test]
    fn a_dwell_without_a_command_is_of_the_pose_of_its_joint_angles() {
        let home = command(1000.0, 0.0);
        let found = places(&[
            // Before the first command: it was at the pose of the second dwell, with a servo error of 0.1 mrad.
            (None, [0.5001, 1.0]),
            (Some(home), [0.5, 1.0]),
            // 1 mrad is within 0.1° = 1.75 mrad, 3 mrad is not; the next agrees with that one.
            (None, [0.501, 1.0]),
            (None, [0.503, 1.0]),
            (None, [0.503, 1.0005]),
            // Another command near to their joint angles is a pose of its own.
            (Some(command(1000.5, 0.0)), [0.5005, 1.0]),
        ]);
        assert_eq!(found, [1, 1, 1, 3, 3, 5]);
    }

    #[test]
    fn slices_do_not_separate_dwells_of_one_pose() {
        // −0.001 and 0.004 mm lie in two slices of 0.01 mm; 0.011 is alike to the second alone, and the first counts.
        let joints = [0.0; 2];
        let found = places(&[
            (Some(command(-0.001, 0.0)), joints),
            (Some(command(0.004, 0.0)), joints),
            (Some(command(0.011, 0.0)), joints),
        ]);
        assert_eq!(found, [0, 0, 2]);
        // Commands without end are no reason to stop.
        let far =
            places(&[(Some(command(1e300, 0.0)), joints), (Some(command(-1e300, 0.0)), joints)]);
        assert_eq!(far, [0, 1]);
    }

    #[test]
    fn a_stated_and_an_unstated_orientation_are_not_one_command() {
        let unstated = CommandedPose { orientation: None, ..command(0.0, 0.0) };
        let found = places(&[
            (Some(command(0.0, 0.0)), [0.0; 2]),
            (Some(unstated), [0.0; 2]),
            (Some(unstated), [0.0; 2]),
        ]);
        assert_eq!(found, [0, 1, 1]);
    }
}
