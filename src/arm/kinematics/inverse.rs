//! Inverse kinematics of any chain: reported joint angles that bring the end to a pose, or why there are none.
//!
//! 1. Newton's method damped as Levenberg and Marquardt do, on the six-row residual (mm; rotation times a lever).
//!    Damping proportional to the squared residual keeps convergence quadratic (Yamashita and Fukushima 2001).
//! 2. Where that fails or ends in another configuration, the pose is approached from the seed's in small steps.
//! 3. The result is checked against the limits, the seed's arm configuration and the nearest singularity; an arm
//!    without configurations keeps the sign of its determinant.
//! 4. An arm with more than six joints takes the joint angles closest to the seed; one with fewer the nearest
//!    orientation, where the settings allow it to differ.
//! 5. Without a seed ([`Anywhere`]): from joint angles spread over the limits, the nearest to the pose first.

use nalgebra::Isometry3;
use thiserror::Error;

use super::arm::{Arm, Joint};
use super::configuration::{Configuration, SingularityFactors};

mod anywhere;
mod few;
mod redundancy;
mod search;
mod variables;

pub use anywhere::Anywhere;
use search::Search;
pub use variables::{JointVariable, spread};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InverseSettings {
    pub position_tolerance_mm: f64,
    pub orientation_tolerance_rad: f64,
    /// Length that makes a turn of the end comparable with its position, mm. It changes the path, not the result.
    pub lever_mm: f64,
    pub iterations: usize,
    /// Refuse solutions with a smaller singularity factor, or [conditioning](super::configuration) of an arm without
    /// such factors; 0 refuses none.
    pub least_singularity_factor: f64,
    /// Largest difference of the orientation where an arm with fewer than six joints cannot have it, rad.
    pub orientation_slack_rad: f64,
}

impl Default for InverseSettings {
    fn default() -> Self {
        Self {
            position_tolerance_mm: 1e-9,
            orientation_tolerance_rad: 1e-12,
            lever_mm: 500.0,
            iterations: 30,
            least_singularity_factor: 0.0,
            orientation_slack_rad: 0.0,
        }
    }
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum InverseError {
    #[error(
        "the pose is not reached, the nearest that is found is off by {position_mm:.3} mm and {orientation_rad:.6} rad; check that it lies in the \
         working space, and the frame and the tool that it is stated in"
    )]
    NotReachable { position_mm: f64, orientation_rad: f64 },
    #[error(
        "an arm with {joints} joints reaches the position with another orientation only, {off_deg:.3}° off at the least; an \
         orientation cannot be chosen freely with fewer than six joints: give joint angles, or a pose that the arm has"
    )]
    Orientation { joints: usize, off_deg: f64 },
    #[error(
        "joint {joint:?} would have to {} {value:.3}{unit}, its limits are {lower}{unit} and {upper}{unit}; \
         move the pose, or correct the joint's limits in the robot file",
        if *unit == "°" { "turn to" } else { "move to" }
    )]
    LimitReached { joint: String, value: f64, lower: f64, upper: f64, unit: &'static str },
    #[error(
        "the pose is reached only in arm configuration {found}, and {seed} is asked for; move the pose, or ask for the other"
    )]
    ConfigurationChanged { seed: Configuration, found: Configuration },
    #[error(
        "the pose is reached only across a singularity or far from the joint angles asked for, on another branch; give joint angles nearer \
         to it"
    )]
    BranchChanged,
    #[error(
        "the pose is {factor:.4} from a singularity{}, refused below {least:.4}; \
         turn or move the pose away from it",
        configuration.map_or_else(String::new, |own| format!(" ({own})"))
    )]
    NearSingularity { factor: f64, least: f64, configuration: Option<Configuration> },
}

impl InverseError {
    /// Whether a solution in the arm configuration asked for was refused: there is no other in it.
    const fn is_of_configuration(&self) -> bool {
        matches!(self, Self::LimitReached { .. } | Self::NearSingularity { .. })
    }

    pub fn beyond(joint: &Joint, value: f64) -> Self {
        // A limit of −120° has come by radians.
        let limit = |value| (joint.shown(value) * 1e9).round() / 1e9;
        Self::LimitReached {
            joint: joint.name.clone(),
            value: joint.shown(value),
            lower: limit(joint.lower),
            upper: limit(joint.upper),
            unit: joint.sign_of_unit(),
        }
    }
}

const APPROACHES: [u32; 3] = [1, 8, SMALLEST];
/// The steps of the approach that stays on its branch, being the smallest.
const SMALLEST: u32 = 64;

/// Reported joint angles (rad) at which `arm(q) · flange_from_end` is `base_from_end`: the solution that the search
/// reaches from `seed`, in the arm configuration of `seed`.
///
/// `offsets` are those of the arm's free parameters, in [`super::Chain::parameters`]' order; zeros for the nominal arm.
/// Angles of coupled axes are the reported ones, as everywhere.
///
/// ```
/// use nalgebra::Isometry3;
/// use posegrid_arm::kinematics::{InverseSettings, RobotFile, inverse};
///
/// let file: RobotFile = toml::from_str(&std::fs::read_to_string("../../pipelines/robots/ur10.toml")?)?;
/// let arm = file.arm()?;
/// let joints = [0.3, -1.2, 1.5, -1.8, -1.5, 0.4];
/// let base_from_flange = *arm.flange(&joints).isometry();
/// let near = joints.map(|angle| angle + 0.1);
/// let nominal = arm.no_offsets();
/// let (at_flange, settings) = (Isometry3::identity(), InverseSettings::default());
/// let found = inverse(&arm, &nominal, &base_from_flange, &at_flange, &near, &settings)?;
/// assert!(found.iter().zip(joints).all(|(a, b)| (a - b).abs() < 1e-6));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Panics
/// When the length of `seed` or `offsets` does not fit the arm.
pub fn inverse(
    arm: &Arm,
    offsets: &[f64],
    base_from_end: &Isometry3<f64>,
    flange_from_end: &Isometry3<f64>,
    seed: &[f64],
    settings: &InverseSettings,
) -> Result<Vec<f64>, InverseError> {
    Inverse::new(arm, offsets, *flange_from_end, *settings).joints(base_from_end, seed)
}

/// [`inverse`] of one arm for many poses: what follows from the arm is made once.
#[derive(Debug)]
pub struct Inverse<'a> {
    search: Search<'a>,
    /// With the linear axes of a redundant arm held.
    held: Option<Search<'a>>,
}

impl<'a> Inverse<'a> {
    pub fn new(
        arm: &'a Arm,
        offsets: &[f64],
        flange_from_end: Isometry3<f64>,
        settings: InverseSettings,
    ) -> Self {
        let search = Search::new(arm, offsets, flange_from_end, settings);
        Self { held: search.with_lengths_held(), search }
    }

    /// Reported joint angles (rad) of a pose, as [`inverse`] finds them.
    pub fn joints(
        &self,
        base_from_end: &Isometry3<f64>,
        seed: &[f64],
    ) -> Result<Vec<f64>, InverseError> {
        let search = &self.search;
        search.within_links(base_from_end)?;
        let held = self.held.as_ref();
        let held = held.and_then(|held| by_approaches(held, base_from_end, seed).ok());
        match held.map_or_else(|| by_approaches(search, base_from_end, seed), Ok) {
            Err(InverseError::NotReachable { .. }) if seed.len() < 6 => search
                .nearest_orientation(base_from_end, seed)
                .and_then(|joints| search.checked(seed, joints, false)),
            outcome => outcome,
        }
    }

    /// Refuses a pose that the links of the arm together do not reach, whatever the joint angles.
    pub fn within_links(&self, base_from_end: &Isometry3<f64>) -> Result<(), InverseError> {
        self.search.within_links(base_from_end)
    }

    /// Singularity factors at reported joint angles (rad); `None` for an arm that has none.
    pub fn factors(&self, joints: &[f64]) -> Option<SingularityFactors> {
        self.search.factors(joints)
    }
}

fn by_approaches(
    search: &Search<'_>,
    base_from_end: &Isometry3<f64>,
    seed: &[f64],
) -> Result<Vec<f64>, InverseError> {
    let approached = |steps: u32| {
        search
            .approach(base_from_end, seed, steps)
            .map(|joints| search.closest(base_from_end, seed, joints))
            .map(|joints| search.within_limits(base_from_end, joints))
            .and_then(|joints| search.checked(seed, joints, steps == SMALLEST))
    };
    let [first, others @ ..] = APPROACHES;
    let tried = |outcome: Result<_, InverseError>, steps| match outcome {
        Err(refused) if refused.is_of_configuration() && search.factors(seed).is_some() => {
            Err(refused)
        }
        Err(_) => approached(steps),
        found => found,
    };
    others.into_iter().fold(approached(first), tried)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::isometry_from_rpy;
    use crate::kinematics::RobotFile;

    fn arm(file: &str) -> Arm {
        let file: RobotFile = toml::from_str(file).expect("a robot file of this repository");
        file.arm().expect("a valid arm")
    }

    fn kr210() -> Arm {
        arm(include_str!("../../../pipelines/robots/kr210-r2700-extra.toml"))
    }

    fn radians(degrees: [f64; 6]) -> Vec<f64> {
        degrees.map(f64::to_radians).to_vec()
    }

    const HOME: [f64; 6] = [0.0, -90.0, 90.0, 0.0, 45.0, 0.0];

    #[test]
    fn converges_quadratically() {
        // Each Newton step squares the residual: from 1e-2 to rounding takes three at most.
        let arm = kr210();
        let offsets = arm.no_offsets();
        let tool = isometry_from_rpy([30.0, -20.0, 150.0], [0.1, 0.2, 0.3]);
        let settings = InverseSettings::default();
        let search = Search::new(&arm, &offsets, tool, settings);
        let truth = radians([33.0, -72.0, 101.0, -58.0, 44.0, 127.0]);
        let target = search.end(&truth);
        let mut joints: Vec<f64> = truth.iter().map(|q| q + 0.02).collect();
        let mut norms = vec![search.residual(&target, &search.end(&joints)).norm()];
        for _ in 0..4 {
            let residual = search.residual(&target, &search.end(&joints));
            let step = search.step(&joints, &residual, 1e-3);
            for (q, d) in joints.iter_mut().zip(step.iter()) {
                *q += d;
            }
            norms.push(search.residual(&target, &search.end(&joints)).norm());
        }
        // r ← c r² with c of order 1 / (arm's length in mm): 0.01 bounds it here.
        for pair in norms.windows(2) {
            assert!(pair[1] <= 0.01 * pair[0].powi(2) + 1e-9, "{norms:?}");
        }
    }

    #[test]
    fn an_identified_arm_is_inverted_with_its_offsets() {
        let arm = kr210();
        let offsets: Vec<f64> = arm
            .chain()
            .parameters()
            .iter()
            .map(|parameter| if parameter.is_angle() { 3e-4 } else { 0.4 })
            .collect();
        let tool = isometry_from_rpy([10.0, 5.0, 200.0], [0.0, 0.0, 0.5]);
        let target = isometry_from_rpy([1700.0, 300.0, 1200.0], [0.2, 2.4, -0.1]);
        let settings = InverseSettings::default();
        let joints = inverse(&arm, &offsets, &target, &tool, &radians(HOME), &settings)
            .expect("in the middle of the working space");
        let reached = arm.chain().forward(&joints, &offsets) * tool;
        assert!((reached.translation.vector - target.translation.vector).norm() < 1e-9);
        assert!(reached.rotation.angle_to(&target.rotation) < 1e-7);
        // The offsets matter: the nominal arm at the same angles is a millimetre or more away.
        let nominal = arm.chain().nominal(&joints) * tool;
        assert!((nominal.translation.vector - target.translation.vector).norm() > 0.5);
    }

    #[test]
    fn coupled_axes_get_reported_angles() {
        let mut file: RobotFile =
            toml::from_str(include_str!("../../../pipelines/robots/kr210-r2700-extra.toml"))
                .expect("a robot file");
        // Axis 3 turns by what joints 2 and 3 report together.
        let mut map: Vec<Vec<f64>> = (0..6)
            .map(|row| (0..6).map(|column| f64::from(u8::from(row == column))).collect())
            .collect();
        map[2][1] = 1.0;
        file.joint_map = Some(map);
        let arm = file.arm().expect("a valid arm");
        let truth = radians([10.0, -80.0, 150.0, 20.0, 50.0, 5.0]);
        let target = *arm.flange(&truth).isometry();
        let seed: Vec<f64> = truth.iter().map(|q| q + 0.05).collect();
        let found = inverse(
            &arm,
            &arm.no_offsets(),
            &target,
            &Isometry3::identity(),
            &seed,
            &InverseSettings::default(),
        )
        .expect("near the seed");
        for (found, truth) in found.iter().zip(&truth) {
            assert!((found - truth).abs() < 1e-9);
        }
    }

    #[test]
    fn out_of_reach_states_the_remaining_error() {
        let arm = kr210();
        // The stretched arm reaches 350 + 1150 + 1200.7 + 215 mm from axis 1: 2916 mm. 3500 mm is beyond.
        let target =
            isometry_from_rpy([3500.0, 0.0, 675.0], [0.0, std::f64::consts::FRAC_PI_2, 0.0]);
        let refused = inverse(
            &arm,
            &arm.no_offsets(),
            &target,
            &Isometry3::identity(),
            &radians(HOME),
            &InverseSettings::default(),
        );
        match refused {
            Err(InverseError::NotReachable { position_mm, .. }) => assert!(position_mm > 100.0),
            other => panic!("expected NotReachable, got {other:?}"),
        }
    }

    #[test]
    fn links_fall_short_of_no_pose_that_an_arm_has() {
        for file in [
            include_str!("../../../pipelines/robots/kr210-r2700-extra.toml"),
            include_str!("../../../pipelines/robots/r2000ic-165f.toml"),
            include_str!("../../../pipelines/robots/ur10e.toml"),
            include_str!("../../../pipelines/robots/lbr-iiwa14-r820.toml"),
        ] {
            let arm = arm(file);
            let tool = isometry_from_rpy([30.0, -20.0, 150.0], [0.1, 0.2, 0.3]);
            let settings = InverseSettings::default();
            let search = Search::new(&arm, &arm.no_offsets(), tool, settings);
            let limits = arm.joints().iter().map(|joint| [joint.lower, joint.upper]);
            let limits: Vec<[f64; 2]> = limits.collect();
            for number in 0..500 {
                assert_eq!(search.within_links(&search.end(&spread(number, &limits))), Ok(()));
            }
            let far = isometry_from_rpy([9000.0, 0.0, 0.0], [0.0; 3]);
            assert!(search.within_links(&far).is_err());
        }
    }

    #[test]
    fn a_limit_is_named() {
        let arm = kr210();
        // Joint 5 goes to ±125°: ask for 130°.
        let beyond = radians([0.0, -90.0, 90.0, 0.0, 130.0, 0.0]);
        let refused = inverse(
            &arm,
            &arm.no_offsets(),
            arm.flange(&beyond).isometry(),
            &Isometry3::identity(),
            &radians([0.0, -90.0, 90.0, 0.0, 120.0, 0.0]),
            &InverseSettings::default(),
        );
        let message = refused.expect_err("beyond a limit").to_string();
        assert!(message.contains("joint_a5") && message.contains("130.000°"), "{message}");
    }

    #[test]
    fn another_configuration_is_refused() {
        let arm = kr210();
        let seed = radians([0.0, -90.0, 90.0, 0.0, 1.0, 0.0]);
        // Across the wrist singularity: the solution reached from a seed with q5 > 0 has q5 < 0.
        let target = *arm.flange(&radians([0.0, -90.0, 90.0, 0.0, -1.0, 0.0])).isometry();
        let refused = inverse(
            &arm,
            &arm.no_offsets(),
            &target,
            &Isometry3::identity(),
            &seed,
            &InverseSettings::default(),
        );
        assert!(matches!(refused, Err(InverseError::ConfigurationChanged { .. })), "{refused:?}");
    }

    #[test]
    fn a_singular_target_is_refused_where_asked() {
        let arm = kr210();
        let target = *arm.flange(&radians([0.0, -90.0, 90.0, 0.0, 2.0, 0.0])).isometry();
        let settings = InverseSettings {
            // sin 2° = 0.035 is below sin 5° = 0.087.
            least_singularity_factor: 0.087,
            ..InverseSettings::default()
        };
        let seed = radians([0.0, -90.0, 90.0, 0.0, 20.0, 0.0]);
        let refused =
            inverse(&arm, &arm.no_offsets(), &target, &Isometry3::identity(), &seed, &settings);
        match refused {
            Err(InverseError::NearSingularity { factor, .. }) => {
                assert!((factor - 2.0_f64.to_radians().sin()).abs() < 1e-6);
            }
            other => panic!("expected NearSingularity, got {other:?}"),
        }
    }
}
