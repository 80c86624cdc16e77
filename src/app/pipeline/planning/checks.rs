//! Invalid counts, angles, sizes and shares of a `[plan]` section.

use std::path::Path;

use crate::pipeline::configuration::ConfigurationError;
use crate::pipeline::configuration::checks::{Check, each, not_negative, told, wrong_unless};
use crate::plan::section::{Expect, PlanSection};
use crate::plan::session::{LEAST_KNOWN_POSES, LEAST_POSES};

/// Most robots or poses: a larger number is a mistake.
const MOST: usize = 100_000;
/// Most poses of a session.
const MOST_POSES: usize = 2000;

/// Finds the first invalid value of the section, for an arm of `joints` joints.
pub(super) fn check(
    path: &Path,
    section: &PlanSection,
    joints: usize,
) -> Result<(), ConfigurationError> {
    home(section, joints)
        .and_then(|()| counts(section))
        .and_then(|()| poses(section))
        .and_then(|()| angles(section))
        .and_then(|()| sizes(&section.expect))
        .and_then(|()| shares(section))
        .map_err(|wrong| told(path, wrong))
}

fn home(section: &PlanSection, joints: usize) -> Check {
    let found = section.home_deg.len();
    wrong_unless(
        found == joints,
        "[plan] home_deg",
        format!("{found} angles"),
        format!("one angle for each of the arm's {joints} joints, degrees"),
    )
}

fn counts(section: &PlanSection) -> Check {
    let counts = [
        ("robots", section.robots),
        ("whole_model_robots", section.whole_model_robots),
        ("test_poses", section.test_poses),
        ("candidates", section.candidates),
    ];
    each(counts, |(key, count)| {
        let holds = (1..=MOST).contains(&count);
        wrong_unless(holds, format!("[plan] {key}"), count, "1 to 100000")
    })?;
    let extras =
        [("drift_check_every", section.drift_check_every), ("verify_poses", section.verify_poses)];
    each(extras, |(key, count)| {
        let holds = count <= MOST_POSES;
        wrong_unless(holds, format!("[plan] {key}"), count, "0 to 2000")
    })
}

fn poses(section: &PlanSection) -> Check {
    let least = if section.known.is_some() { LEAST_KNOWN_POSES } else { LEAST_POSES };
    let sizes = least..=MOST_POSES;
    let holds = !section.poses.is_empty() && section.poses.iter().all(|n| sizes.contains(n));
    wrong_unless(
        holds,
        "[plan] poses",
        format!("{:?}", section.poses),
        format!(
            "one number of poses or more, each from {least} to 2000, for example [25, 50, 100]"
        ),
    )
}

fn angles(section: &PlanSection) -> Check {
    let angles =
        [("cone_deg", section.cone_deg), ("candidate_cone_deg", section.candidate_cone_deg)];
    each(angles, |(key, deg)| {
        let holds = (0.0..=180.0).contains(&deg);
        wrong_unless(holds, format!("[plan] {key}"), deg, "0 to 180 degrees")
    })
}

fn sizes(expect: &Expect) -> Check {
    let sizes = [
        ("length_sd_mm", expect.length_sd_mm),
        ("angle_sd_deg", expect.angle_sd_deg),
        ("slow_curve_urad", expect.slow_curve_urad),
        ("fast_curve_urad", expect.fast_curve_urad),
        ("gear_line_urad", expect.gear_line_urad),
        ("backlash_urad", expect.backlash_urad),
        ("stops_short_urad", expect.stops_short_urad),
        ("repeatability_urad", expect.repeatability_urad),
        ("sag_urad", expect.sag_urad),
        ("target_sd_mm", expect.target_sd_mm),
        ("base_drift_mm", expect.base_drift_mm),
    ];
    each(sizes, |(key, size)| not_negative(format!("[plan] expect.{key}"), size))
}

fn shares(section: &PlanSection) -> Check {
    let shares =
        [("share", section.robots_meet.share), ("confidence", section.robots_meet.confidence)];
    each(shares, |(key, share)| {
        let holds = share > 0.0 && share < 1.0;
        let wanted = "between 0 and 1, for example 0.95";
        wrong_unless(holds, format!("[plan] robots_meet.{key}"), share, wanted)
    })?;
    let lost = section.expect.lost_share;
    wrong_unless(
        (0.0..1.0).contains(&lost),
        "[plan] expect.lost_share",
        lost,
        "0 or more and below 1",
    )
}
