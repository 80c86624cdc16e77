//! Joint angles for poses of any arm: success on random reachable poses from the pose alone and from a near seed, and time.
//!
//! `cargo test --features s3 --test inverse -- --ignored --nocapture` takes 10,000 poses of each arm and prints what it counts;
//! 300 of each are in the usual tests.

#[path = "inverse/arms.rs"]
mod arms;

use std::time::{Duration, Instant};

use arms::{Drawn, arms};
use nalgebra::{DMatrix, Isometry3};
use posegrid::geometry::isometry_from_rpy;
use posegrid::kinematics::{Anywhere, Arm, InverseError, InverseSettings, inverse};

/// Poses count as away from singularities from this smallest singular value of the Jacobian, with lengths over 500 mm: the
/// end moves by 10 mm, or turns by 20 mrad, a radian of the joints in the direction in which it moves least.
const AWAY: f64 = 0.02;
const LEVER_MM: f64 = 500.0;

/// What became of random poses of one arm.
#[derive(Default)]
struct Counts {
    away: usize,
    reached: usize,
    near: usize,
    reached_near: usize,
    from_seed: usize,
    any: Duration,
    seeded: Duration,
    refused: Vec<InverseError>,
}

fn tool() -> Isometry3<f64> {
    isometry_from_rpy([20.0, -30.0, 140.0], [0.2, -0.1, 0.4])
}

/// The smallest singular value of the Jacobian by another way than the search's: central differences of the end's pose.
fn conditioning(drawn: &Drawn, joints: &[f64]) -> f64 {
    let arm = &drawn.arm;
    let columns: Vec<[f64; 6]> = (0..joints.len())
        .map(|joint| {
            let half = 1e-5 * drawn.unit(joint, LEVER_MM);
            let at = |shift: f64| {
                let mut moved = joints.to_vec();
                moved[joint] += shift;
                *arm.flange(&moved).isometry()
            };
            let (plus, minus) = (at(half), at(-half));
            let linear = (plus.translation.vector - minus.translation.vector) / 2e-5 / LEVER_MM;
            let angular = (plus.rotation * minus.rotation.inverse()).scaled_axis() / 2e-5;
            [
                linear.x, linear.y, linear.z, angular.x, angular.y, angular.z,
            ]
        })
        .collect();
    let jacobian = DMatrix::from_fn(6, columns.len(), |row, column| columns[column][row]);
    jacobian.singular_values().min()
}

fn nominal(arm: &Arm) -> Vec<f64> {
    vec![0.0; arm.chain().parameters().len()]
}

fn assert_reaches(drawn: &Drawn, target: &Isometry3<f64>, found: &[f64]) {
    let reached = drawn.arm.flange(found).isometry() * tool();
    let off_mm = (reached.translation.vector - target.translation.vector).norm();
    let off_rad = reached.rotation.angle_to(&target.rotation);
    assert!(
        off_mm < 1e-8 && off_rad < 1e-7,
        "{}: {off_mm} mm, {off_rad} rad",
        drawn.name
    );
    assert!(
        drawn.arm.within_limits_or_rounding(found),
        "{}: {found:?}",
        drawn.name
    );
}

trait Rounded {
    fn within_limits_or_rounding(&self, joints: &[f64]) -> bool;
}

impl Rounded for Arm {
    fn within_limits_or_rounding(&self, joints: &[f64]) -> bool {
        let mut pairs = self.joints().iter().zip(joints);
        pairs.all(|(joint, q)| *q > joint.lower - 1e-8 && *q < joint.upper + 1e-8)
    }
}

fn count(drawn: &Drawn, poses: u32) -> Counts {
    let nominal = nominal(&drawn.arm);
    let tool = tool();
    let settings = InverseSettings::default();
    let anywhere = Anywhere::new(&drawn.arm, &nominal, tool, settings);
    let mut counts = Counts::default();
    for number in 0..poses {
        let truth = drawn.joints(number);
        let target = drawn.arm.flange(&truth).isometry() * tool;
        let away = conditioning(drawn, &truth) >= AWAY;
        let began = Instant::now();
        let found = anywhere.joints(&target, None);
        counts.any += began.elapsed();
        if let Ok(found) = &found {
            assert_reaches(drawn, &target, found);
        }
        let reached = usize::from(found.is_ok());
        if away {
            counts.away += 1;
            counts.reached += reached;
            counts.refused.extend(found.err());
        } else {
            counts.near += 1;
            counts.reached_near += reached;
        }
        let seed = drawn.beside(&truth, number);
        let began = Instant::now();
        let found = inverse(&drawn.arm, &nominal, &target, &tool, &seed, &settings);
        counts.seeded += began.elapsed();
        counts.from_seed += usize::from(away && found.is_ok());
    }
    counts
}

fn print(drawn: &Drawn, counts: &Counts) {
    let poses = counts.away + counts.near;
    let share = |part: usize, of: usize| 100.0 * part as f64 / of.max(1) as f64;
    let micros = |time: Duration| time.as_secs_f64() * 1e6 / poses as f64;
    println!(
        "{:<22} {:>6} {:>8.3} % {:>6} {:>8.2} % {:>8.2} % {:>9.1} {:>9.1}",
        drawn.name,
        counts.away,
        share(counts.reached, counts.away),
        counts.near,
        share(counts.reached_near, counts.near),
        share(counts.from_seed, counts.away),
        micros(counts.any),
        micros(counts.seeded)
    );
    for refused in counts.refused.iter().take(3) {
        println!("    {refused}");
    }
}

fn check(poses: u32) {
    println!(
        "{:<22} {:>6} {:>10} {:>6} {:>10} {:>10} {:>9} {:>9}",
        "arm", "away", "reached", "near", "reached", "from seed", "µs", "µs seeded"
    );
    for drawn in arms() {
        let counts = count(&drawn, poses);
        print(&drawn, &counts);
        let failed = counts.away - counts.reached;
        assert!(1000 * failed <= counts.away, "{}", drawn.name);
    }
}

#[test]
fn random_poses_of_every_arm_are_reached_from_the_pose_alone() {
    check(300);
}

#[test]
#[ignore = "10,000 poses of each arm take minutes"]
fn ten_thousand_random_poses_of_every_arm_are_reached_from_the_pose_alone() {
    check(10_000);
}
