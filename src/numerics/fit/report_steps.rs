//! Steps of what a joint reports against what is commanded, which stay: an encoder slipped, or the arm no longer goes where it is commanded.
//!
//! Input: the stations of one session in order of time, the arm and the frames of commands. Output: the joint whose commanded less
//! reported angle is another one behind a station than before it; no reading takes part.
//! 1. The angles of each command follow from the reported ones by regularised steps of inverse kinematics (`away`).
//! 2. For each joint the station is found before which a step of the mean explains most.
//! 3. It is a step where the medians on both sides differ by more than servos and rounded models do, and by more than the angles
//!    scatter, and no other joint's differ by half as much.

use std::f64::consts::TAU;

use nalgebra::{DMatrix, DVector, UnitQuaternion};

use super::commanded::{CommandFrames, away};
use crate::figures::median;
use crate::join::moved::clock_words;
use crate::join::placement::{Placement, ReadingAtFlange};
use crate::join::{JoinError, Station, TargetId};
use crate::kinematics::Arm;

/// Fewest stations on each side of a step.
const BESIDE: usize = 20;
/// Least step, rad: sound controllers report up to 2 mrad beside the nominal angles of their commands.
const LEAST_RAD: f64 = 2e-3;
/// Least step in median distances from the medians on both sides.
const SCATTERS: f64 = 6.0;
const ROUNDS: usize = 3;

/// # Errors
///
/// What a joint reports stepped against its commands.
pub fn check(stations: &[Station], arm: &Arm, frames: &CommandFrames) -> Result<(), JoinError> {
    let Some(joints_from_axes) = arm.axes_from_joints().try_inverse() else { return Ok(()) };
    let angles = |station| Some((station, angles_away(station, arm, frames, &joints_from_axes)?));
    let known: Vec<(&Station, DVector<f64>)> = stations.iter().filter_map(angles).collect();
    let joints = arm.joints();
    let steps = joints.iter().enumerate().filter_map(|(joint, own)| {
        // Half a turn away, which a frame may be, is on either side of the reported angles.
        let first = known.first()?.1[joint];
        let whole = |by: f64| if own.slides { 0.0 } else { TAU * (by / TAU).round() };
        let since = |by: f64| by - whole(by);
        let values: Vec<f64> =
            known.iter().map(|(_, angles)| since(angles[joint] - first)).collect();
        Some((joint, step(&values)?, own.counted()))
    });
    let mut steps: Vec<(usize, Step, f64)> = steps.collect();
    let size_rad = |(_, step, counted): &(usize, Step, f64)| step.by.abs() * counted;
    steps.sort_by(|a, b| size_rad(b).total_cmp(&size_rad(a)));
    let Some(first) = steps.first() else { return Ok(()) };
    let next_rad = steps.get(1).map_or(0.0, size_rad);
    let (joint, Step { at, by, scatter }, _) = *first;
    let is_step = size_rad(first) > LEAST_RAD.max(2.0 * next_rad) && by.abs() > SCATTERS * scatter;
    if !is_step {
        return Ok(());
    }
    let (station, own) = (known[at].0, &joints[joint]);
    Err(JoinError::ReportStepped {
        joint: own.name.clone(),
        by: format!("{:+.3}{}", -own.shown(by), own.sign_of_unit()),
        station: station.number,
        at: clock_words(station.start),
    })
}

/// # Errors
///
/// The last joint slipped, as measured orientations show: it moves no target on its axis.
pub fn check_last(stations: &[Station], arm: &Arm) -> Result<(), JoinError> {
    let posed = |own| {
        let station: &Station = own;
        let reading = station.measured().iter().find(|own| own.target == TargetId::MAIN)?;
        let attained = reading.position()?.coords;
        let flange = *arm.flange(&station.joints).isometry();
        Some((station, ReadingAtFlange { flange, attained }, reading.orientation()?))
    };
    let posed: Vec<_> = stations.iter().filter_map(posed).collect();
    let readings: Vec<ReadingAtFlange> = posed.iter().map(|own| own.1).collect();
    let (Some(placed), Some(last)) = (Placement::fit(&readings), arm.joints().last()) else {
        return Ok(());
    };
    let turned = |(_, at, turn): &(&Station, ReadingAtFlange, UnitQuaternion<f64>)| {
        (placed.tracker_from_base.rotation * at.flange.rotation).inverse() * turn
    };
    let first = turned(&posed[0]);
    let (station, at_flange, _) = &posed[0];
    let moving = arm.chain().differential(&arm.axes(&station.joints), &arm.no_offsets());
    let moving = arm.joint_twists(&moving.joints);
    let Some(axis) = moving.last().map(|own| at_flange.flange.rotation.inverse() * own.angular)
    else {
        return Ok(());
    };
    let values: Vec<f64> =
        posed.iter().map(|own| axis.dot(&(turned(own) * first.inverse()).scaled_axis())).collect();
    let Some(Step { at, by, scatter }) = step(&values) else { return Ok(()) };
    if by.abs() <= LEAST_RAD.max(SCATTERS * scatter) {
        return Ok(());
    }
    let (station, sides) = (posed[at].0, [at, posed.len() - at]);
    // A median has 1.2533 times the standard deviation of a mean, and that is 1.4826 times the median distance.
    let sd = 1.86 * scatter * sides.map(|side| 1.0 / side as f64).iter().sum::<f64>().sqrt();
    let from = (station.number, Some(station.start));
    Err(JoinError::slipped(last, (by, sd), from, ", or the target was turned about its axis"))
}

/// Commanded less reported joint angles, rad; mm where a joint slides. `None` without a whole pose as the command.
fn angles_away(
    station: &Station,
    arm: &Arm,
    frames: &CommandFrames,
    joints_from_axes: &DMatrix<f64>,
) -> Option<DVector<f64>> {
    let mut commanded = station.clone();
    for _ in 0..ROUNDS {
        let by = joints_from_axes * DVector::from_vec(away(&commanded, arm, frames)?);
        commanded.joints.iter_mut().zip(&by).for_each(|(joint, by)| *joint += by);
    }
    let reported = DVector::from_column_slice(&station.joints);
    Some(DVector::from_vec(commanded.joints) - reported)
}

#[derive(Debug, Clone, Copy)]
struct Step {
    /// The place of the first value behind it.
    at: usize,
    /// Median behind it less median before it.
    by: f64,
    /// Median distance from the medians on both sides.
    scatter: f64,
}

/// The step that explains most of a row of values; `None` of too few.
fn step(values: &[f64]) -> Option<Step> {
    let (count, all) = (values.len(), values.iter().sum::<f64>());
    let mut before: f64 = values.iter().take(BESIDE).sum();
    let mut best: Option<(f64, usize)> = None;
    let last = (count + 1).saturating_sub(BESIDE);
    for (at, value) in values.iter().enumerate().take(last).skip(BESIDE) {
        let sides = [at as f64, (count - at) as f64];
        let explained =
            (before / sides[0] - (all - before) / sides[1]).powi(2) * sides[0] * sides[1];
        if best.is_none_or(|(most, _)| explained > most) {
            best = Some((explained, at));
        }
        before += value;
    }
    let (_, at) = best?;
    let sides = values.split_at(at);
    let (before, behind) = (median(sides.0)?, median(sides.1)?);
    let apart = sides.0.iter().map(|own| own - before);
    let apart = apart.chain(sides.1.iter().map(|own| own - behind)).map(f64::abs);
    Some(Step { at, by: behind - before, scatter: median(&apart.collect::<Vec<_>>())? })
}

#[cfg(test)]
mod tests {
    use nalgebra::Isometry3;

    use super::*;
    use crate::geometry::isometry_from_rpy;
    use crate::kinematics::RobotFile;
    use crate::simulate::{Poses, SimulateSettings, simulate};

    /// The error of 120 stations of one orientation, before the 41st of which what a joint reports steps by so many degrees.
    fn stepped(joint: usize, by_deg: f64) -> Option<String> {
        told(joint, by_deg, 0.0)
    }

    /// The error of those without a step where the tool is stated as turned about its axis.
    fn turned(by_deg: f64) -> Option<String> {
        told(0, 0.0, by_deg)
    }

    fn told(joint: usize, by_deg: f64, tool_deg: f64) -> Option<String> {
        let text = include_str!("../../../pipelines/robots/kr210-r2700-extra.toml");
        let arm = toml::from_str::<RobotFile>(text).expect("a robot file").arm().expect("an arm");
        let home = [0.0_f64, -75.0, 100.0, 25.0, 55.0, -15.0].map(f64::to_radians).to_vec();
        let orientation_rpy = [0.0, std::f64::consts::FRAC_PI_2, 0.0];
        let poses = Poses::Grid {
            lower_mm: [1500.0, -360.0, 600.0],
            upper_mm: [2000.0, 360.0, 1300.0],
            step_mm: 140.0,
            orientation_rpy,
        };
        let settings = SimulateSettings::realistic(1, home, poses);
        let frames = CommandFrames {
            base_from_command: Isometry3::identity(),
            flange_from_tool: Some(isometry_from_rpy(
                settings.cell.flange_from_target_mm,
                [0.0, 0.0, tool_deg.to_radians()],
            )),
        };
        let mut stations = simulate(&arm, &settings).expect("in reach").stations();
        assert!(stations.len() > 80, "{}", stations.len());
        for station in &mut stations[40..] {
            station.joints[joint] += by_deg.to_radians();
        }
        check(&stations, &arm, &frames).err().map(|error| error.to_string())
    }

    #[test]
    fn a_last_joint_that_slips_under_a_target_on_its_axis_is_named() {
        let text = include_str!("../../../pipelines/robots/ur10.toml");
        let arm = toml::from_str::<RobotFile>(text).expect("a robot file").arm().expect("an arm");
        let home = [10.0_f64, -80.0, 100.0, -60.0, -80.0, 20.0].map(f64::to_radians).to_vec();
        let [lower, upper] = [-0.6, 0.6].map(|by| home.iter().map(|own| own + by).collect());
        let poses = Poses::Joints { count: 70, lower, upper };
        let mut settings = SimulateSettings::realistic(2, home, poses);
        settings.cell.flange_from_target_mm = [0.0, 0.0, 90.0];
        settings.cell.six_dof = true;
        let mut stations = simulate(&arm, &settings).expect("in reach").stations();
        assert_eq!(check_last(&stations, &arm), Ok(()));
        for station in &mut stations[30..] {
            station.joints[5] += 0.5_f64.to_radians();
        }
        let words = check_last(&stations, &arm).expect_err("a slip").to_string();
        assert!(words.contains("joint \"wrist_3_joint\" slipped before station 30"), "{words}");
        let (_, by) = words.split_once("stands ").expect("a size");
        let by: f64 = by.split(' ').next().and_then(|own| own.parse().ok()).expect("a number");
        assert!((by + 0.5).abs() < 0.02, "{words}");
    }

    #[test]
    fn a_joint_whose_report_steps_against_its_commands_is_named() {
        assert_eq!(stepped(0, 0.0), None);
        assert_eq!(turned(180.0), None);
        for (joint, by_deg) in [(0, 0.2), (2, 1.0), (3, -0.5), (4, 1.0), (5, 0.3)] {
            let words = stepped(joint, by_deg).expect("a step");
            let name = format!("joint \"joint_a{}\" reports stepped by ", joint + 1);
            let (_, size) = words.split_once(&name).unwrap_or_else(|| panic!("{words}"));
            let (size, place) = size.split_once("° before station ").expect("degrees");
            let size: f64 = size.parse().expect("a number");
            assert!((size - by_deg).abs() < 0.02 && place.starts_with("40"), "{by_deg}: {words}");
        }
    }
}
