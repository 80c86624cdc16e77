use std::fmt::Write as _;

use crate::io::robot::ready::READY;
use crate::kinematics::{Arm, RobotFile};

/// Positions that are tried of each joint between its limits.
const TRIED: u32 = 180;
/// Rounds over the joints, after which none goes further in practice.
const ROUNDS: usize = 4;

/// A line for each ready robot: its name, number of axes, reach and model.
pub(super) fn ready() -> String {
    let mut text = format!("{:<22} {:>4} {:>9}  model\n", "name", "axes", "reach_mm");
    for robot in READY {
        let file = toml::from_str::<RobotFile>(robot.text).ok();
        let Some(arm) = file.and_then(|file| file.arm().ok()) else { continue };
        let (name, joints) = (robot.name(), arm.joints().len());
        let (reach, model) = (reach_mm(&arm), arm.model());
        let _ = writeln!(text, "{name:<22} {joints:>4} {reach:>9.0}  {model}");
    }
    text += "\nreach_mm: how far the flange gets from the first axis. posegrid robot NAME prints the robot file.\n";
    text
}

/// Largest distance of the flange from the first axis within the limits, mm: searched joint by joint.
fn reach_mm(arm: &Arm) -> f64 {
    let middle = arm.joints().iter().map(|j| f64::midpoint(j.lower, j.upper));
    let zero = arm.joints().iter().map(|j| 0.0_f64.clamp(j.lower, j.upper));
    let home = arm.home().map(<[f64]>::to_vec);
    let starts = [Some(middle.collect()), Some(zero.collect()), home];
    starts.into_iter().flatten().map(|start| from(arm, start)).fold(0.0, f64::max)
}

fn from(arm: &Arm, mut q: Vec<f64>) -> f64 {
    let offsets = arm.no_offsets();
    let axes = arm.chain().joint_axes(&arm.axes(&q), &offsets);
    let (point, direction) = axes[0];
    let away = |q: &[f64]| {
        let flange = arm.flange(q).isometry().translation.vector;
        direction.cross(&(flange - point.coords)).norm()
    };
    let mut best = away(&q);
    for place in (0..ROUNDS).flat_map(|_| 0..arm.joints().len()) {
        let joint = &arm.joints()[place];
        for step in 0..=TRIED {
            let before = q[place];
            q[place] =
                joint.lower + (joint.upper - joint.lower) * f64::from(step) / f64::from(TRIED);
            let reached = away(&q);
            if reached > best {
                best = reached;
            } else {
                q[place] = before;
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ready_robot_is_a_line_with_a_reach_of_its_data_sheet() {
        let text = ready();
        assert_eq!(text.lines().count(), READY.len() + 3, "{text}");
        let line = |name: &str| text.lines().find(|line| line.starts_with(name)).unwrap();
        // UR10e: stretched out the flange is √(1304.1² + 290.7²) mm away; its lengths but the column add up to 1594.8 mm.
        let words: Vec<&str> = line("ur10e ").split_whitespace().collect();
        assert_eq!(words[1], "6");
        let reach: f64 = words[2].parse().unwrap();
        assert!((1336.0..1594.8).contains(&reach), "{reach}");
    }
}
