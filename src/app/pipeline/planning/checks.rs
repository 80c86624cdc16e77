//! Numbers of a `[plan]` section that have to go with the arm and with what is known of it.

use std::path::Path;

use crate::pipeline::configuration::ConfigurationError;
use crate::pipeline::configuration::checks::{told, wrong_unless};
use crate::plan::section::PlanSection;
use crate::plan::session::{LEAST_KNOWN_POSES, LEAST_POSES};

const MOST_POSES: usize = 2000;

/// Finds the first invalid value of the section, for an arm of `joints` joints.
pub(super) fn check(
    path: &Path,
    section: &PlanSection,
    joints: usize,
) -> Result<(), ConfigurationError> {
    let angles = section.home_deg.len();
    let home = wrong_unless(
        angles == joints,
        "[plan] home_deg",
        format!("{angles} angles"),
        format!("one angle for each of the arm's {joints} joints, degrees"),
    );
    let least = if section.known.is_some() { LEAST_KNOWN_POSES } else { LEAST_POSES };
    let sizes = least..=MOST_POSES;
    let poses = wrong_unless(
        section.poses.iter().all(|poses| sizes.contains(poses)),
        "[plan] poses",
        format!("{:?}", section.poses),
        format!("numbers of poses, each from {least} to {MOST_POSES}, for example [25, 50, 100]"),
    );
    home.and(poses).map_err(|wrong| told(path, wrong))
}
