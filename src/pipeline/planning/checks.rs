//! Counts, angles, sizes and shares of a `[plan]` section that cannot be: each a key, its value and what would do.

use std::path::Path;

use crate::pipeline::plan::PlanError;
use crate::plan::section::{Expect, PlanSection};
use crate::plan::session::LEAST_POSES;

/// More robots or poses than this are a slip of the pen.
const MOST: usize = 100_000;
/// More poses than this are no session.
const MOST_POSES: usize = 2000;

/// The first value of the section that cannot be, for an arm of `joints` joints.
pub(super) fn check(path: &Path, section: &PlanSection, joints: usize) -> Result<(), PlanError> {
    let found = home(section, joints)
        .or_else(|| counts(section))
        .or_else(|| poses(section))
        .or_else(|| angles(section))
        .or_else(|| sizes(&section.expect))
        .or_else(|| shares(section));
    found.map_or(Ok(()), |wrong| {
        Err(PlanError::Setting {
            path: path.to_owned(),
            key: format!("[plan] {}", wrong.key),
            found: wrong.found,
            wanted: wrong.wanted,
        })
    })
}

struct Wrong {
    key: &'static str,
    found: String,
    wanted: String,
}

fn wrong(key: &'static str, found: &impl ToString, wanted: &str) -> Wrong {
    Wrong {
        key,
        found: found.to_string(),
        wanted: wanted.to_owned(),
    }
}

/// The first of `values` that does not hold.
fn first<T: ToString + Copy>(
    values: &[(&'static str, T)],
    holds: impl Fn(T) -> bool,
    wanted: &str,
) -> Option<Wrong> {
    let bad = values.iter().find(|(_, value)| !holds(*value))?;
    Some(wrong(bad.0, &bad.1, wanted))
}

fn home(section: &PlanSection, joints: usize) -> Option<Wrong> {
    let found = section.home_deg.len();
    let wanted = format!("one angle for each of the arm's {joints} joints, degrees");
    (found != joints).then(|| wrong("home_deg", &format!("{found} angles"), &wanted))
}

fn counts(section: &PlanSection) -> Option<Wrong> {
    let counts = [
        ("robots", section.robots),
        ("whole_model_robots", section.whole_model_robots),
        ("test_poses", section.test_poses),
        ("candidates", section.candidates),
    ];
    let extras = [
        ("drift_check_every", section.drift_check_every),
        ("verify_poses", section.verify_poses),
    ];
    first(&counts, |n| (1..=MOST).contains(&n), "1 to 100000")
        .or_else(|| first(&extras, |n| n <= MOST_POSES, "0 to 2000"))
}

fn poses(section: &PlanSection) -> Option<Wrong> {
    let sizes = LEAST_POSES..=MOST_POSES;
    let good = !section.poses.is_empty() && section.poses.iter().all(|n| sizes.contains(n));
    let wanted = "one number of poses or more, each from 10 to 2000, for example [25, 50, 100]";
    (!good).then(|| wrong("poses", &format!("{:?}", section.poses), wanted))
}

fn angles(section: &PlanSection) -> Option<Wrong> {
    let angles = [
        ("cone_deg", section.cone_deg),
        ("candidate_cone_deg", section.candidate_cone_deg),
    ];
    let holds = |deg: f64| (0.0..=180.0).contains(&deg);
    first(&angles, holds, "0 to 180 degrees")
}

fn sizes(expect: &Expect) -> Option<Wrong> {
    let sizes = [
        ("expect.length_sd_mm", expect.length_sd_mm),
        ("expect.angle_sd_deg", expect.angle_sd_deg),
        ("expect.slow_curve_urad", expect.slow_curve_urad),
        ("expect.fast_curve_urad", expect.fast_curve_urad),
        ("expect.gear_line_urad", expect.gear_line_urad),
        ("expect.backlash_urad", expect.backlash_urad),
        ("expect.stops_short_urad", expect.stops_short_urad),
        ("expect.repeatability_urad", expect.repeatability_urad),
        ("expect.sag_urad", expect.sag_urad),
        ("expect.target_sd_mm", expect.target_sd_mm),
        ("expect.base_drift_mm", expect.base_drift_mm),
    ];
    first(&sizes, |size| size >= 0.0, "0 or more")
}

fn shares(section: &PlanSection) -> Option<Wrong> {
    let shares = [
        ("robots_meet.share", section.robots_meet.share),
        ("robots_meet.confidence", section.robots_meet.confidence),
    ];
    let lost = [("expect.lost_share", section.expect.lost_share)];
    let between = |share: f64| share > 0.0 && share < 1.0;
    first(&shares, between, "between 0 and 1, for example 0.95").or_else(|| {
        first(
            &lost,
            |share| (0.0..1.0).contains(&share),
            "0 or more and below 1",
        )
    })
}
