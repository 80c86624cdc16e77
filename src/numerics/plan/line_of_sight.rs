//! Whether a pose may be measured: the arm's own limits, keep-out boxes, and the tracker's line of sight to the target.
//!
//! Inputs: an arm, reported angles, constraints on a pose. Output: nothing or the first reason against it, in order:
//! 1. joint limits, arm configuration, distance to singularities;
//! 2. keep-out boxes, for the straight lines between consecutive joint origins, the flange and the target;
//! 3. range, the angle at which the tracker's beam meets the target, and whether a link is in the beam.
//!
//! A link is a straight line with a radius (a capsule): coarse, and conservative where the radius is that of its widest
//! part. All is in the base frame, mm and rad, of the nominal arm: plans are made before an arm is identified.

use nalgebra::{Isometry3, Point3, UnitVector3};
use thiserror::Error;

use crate::kinematics::{Arm, Configuration, SingularityFactors};

mod segment;

use segment::Segment;

#[derive(Debug, Clone, PartialEq)]
pub struct Constraints {
    /// The arm configuration, where only one is allowed; needs a six-axis arm.
    pub configuration: Option<Configuration>,
    pub least_singularity_factor: f64,
    pub limit_margin_rad: f64,
    pub flange_from_target: Isometry3<f64>,
    pub keep_out: Vec<KeepOut>,
    /// Distance that the lines between joint origins keep from a box, mm: half of the arm's thickness, and a margin.
    pub keep_out_margin_mm: f64,
    /// The tracker, where the target has to be visible; otherwise `None`.
    pub tracker: Option<LineOfSight>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct KeepOut {
    pub name: String,
    pub least_mm: [f64; 3],
    pub most_mm: [f64; 3],
}

#[derive(Debug, Clone, PartialEq)]
pub struct LineOfSight {
    pub tracker: Point3<f64>,
    pub facing: UnitVector3<f64>,
    /// Largest angle between that direction and the direction to the tracker, rad.
    pub acceptance_rad: f64,
    pub range_mm: [f64; 2],
    /// Distance that the beam keeps from the lines between joint origins, mm: half of the arm's thickness.
    pub link_radius_mm: f64,
}

/// A part of the arm, by the joints it lies between.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// From this joint's origin (counted from 1) to the next one's.
    Link(usize),
    /// From the last joint's origin to the flange.
    Flange,
    /// From the flange to the target.
    Target,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum Unsuitable {
    #[error(
        "joint {joint:?} is at {angle_deg:.3}{unit}, allowed are {lower_deg:.3}{unit} to {upper_deg:.3}{unit}"
    )]
    BeyondLimit {
        joint: String,
        angle_deg: f64,
        lower_deg: f64,
        upper_deg: f64,
        unit: &'static str,
    },
    #[error(
        "arm configuration and distance to singularities are known for arms of six axes with upper arm and forearm, this one \
         has {axes}: leave both out"
    )]
    NoConfiguration { axes: usize },
    #[error("the arm is in configuration {found}, wanted is {wanted}")]
    OtherConfiguration { found: Configuration, wanted: Configuration },
    #[error("the pose is {factor:.4} from a singularity, allowed is {least:.4} or more")]
    NearSingularity { factor: f64, least: f64 },
    #[error("{part} comes nearer than {margin_mm} mm to keep-out box {keep_out:?}")]
    InKeepOut {
        keep_out: String,
        /// The part that does; of several the one nearest to the base.
        part: Part,
        margin_mm: f64,
    },
    #[error(
        "the target is {range_mm:.0} mm from the tracker, allowed are {least_mm:.0} to {most_mm:.0} mm"
    )]
    OutOfRange { range_mm: f64, least_mm: f64, most_mm: f64 },
    #[error(
        "the beam meets the target {angle_deg:.1}° off its axis, accepted are {acceptance_deg:.1}°"
    )]
    TurnedAway { angle_deg: f64, acceptance_deg: f64 },
    #[error("{part} is in the beam: {distance_mm:.0} mm from it, {clearance_mm:.0} mm are needed")]
    BeamBlocked {
        /// The part that does; of several the one nearest to the base.
        part: Part,
        distance_mm: f64,
        clearance_mm: f64,
    },
}

impl Unsuitable {
    pub const fn name(&self) -> &'static str {
        match self {
            Self::BeyondLimit { .. } => "beyond_limit",
            Self::NoConfiguration { .. } => "no_configuration",
            Self::OtherConfiguration { .. } => "other_configuration",
            Self::NearSingularity { .. } => "near_singularity",
            Self::InKeepOut { .. } => "in_keep_out",
            Self::OutOfRange { .. } => "out_of_range",
            Self::TurnedAway { .. } => "turned_away",
            Self::BeamBlocked { .. } => "beam_blocked",
        }
    }
}

/// Checks that the pose at these reported joint angles may be measured.
/// Panics when the number of angles is not the number of joints.
pub fn verdict(arm: &Arm, joints: &[f64], constraints: &Constraints) -> Result<(), Unsuitable> {
    within_limits(arm, joints, constraints.limit_margin_rad)?;
    in_configuration(arm, joints, constraints)?;
    let parts = parts(arm, joints, constraints);
    outside_boxes(&parts, constraints)?;
    if let Some(line_of_sight) = &constraints.tracker {
        let base_from_target = *arm.flange(joints).isometry() * constraints.flange_from_target;
        seen(&base_from_target, line_of_sight)?;
        beam_is_free(&parts, &base_from_target, line_of_sight)?;
    }
    Ok(())
}

fn within_limits(arm: &Arm, joints: &[f64], margin_rad: f64) -> Result<(), Unsuitable> {
    for (joint, &angle) in arm.joints().iter().zip(joints) {
        // A mm of sliding counts as a mrad.
        let margin = margin_rad * joint.per_radian();
        let (lower, upper) = (joint.lower + margin, joint.upper - margin);
        if !(lower..=upper).contains(&angle) {
            return Err(Unsuitable::BeyondLimit {
                joint: joint.name.clone(),
                angle_deg: joint.shown(angle),
                lower_deg: joint.shown(lower),
                upper_deg: joint.shown(upper),
                unit: joint.sign_of_unit(),
            });
        }
    }
    Ok(())
}

fn in_configuration(arm: &Arm, joints: &[f64], asked: &Constraints) -> Result<(), Unsuitable> {
    let least = asked.least_singularity_factor;
    if asked.configuration.is_none() && least <= 0.0 {
        return Ok(());
    }
    let nominal = arm.no_offsets();
    let axes = arm.joints().len();
    let factors = SingularityFactors::of(arm, &nominal, joints)
        .ok_or(Unsuitable::NoConfiguration { axes })?;
    let found = factors.configuration();
    if let Some(wanted) = asked.configuration.filter(|wanted| *wanted != found) {
        return Err(Unsuitable::OtherConfiguration { found, wanted });
    }
    let factor = factors.smallest();
    if factor < least {
        return Err(Unsuitable::NearSingularity { factor, least });
    }
    Ok(())
}

/// The parts of the arm that its joints move, from base to target.
fn parts(arm: &Arm, joints: &[f64], constraints: &Constraints) -> Vec<(Part, Segment)> {
    let axes = arm.chain().joint_axes(&arm.axes(joints), &arm.no_offsets());
    let flange = *arm.flange(joints).isometry();
    let target = flange * constraints.flange_from_target;
    let mut points: Vec<Point3<f64>> = axes.iter().map(|(origin, _)| *origin).collect();
    points.extend([flange, target].map(|end| Point3::from(end.translation.vector)));
    let name = |place: usize| match place {
        flange if flange + 1 == axes.len() => Part::Flange,
        target if target == axes.len() => Part::Target,
        link => Part::Link(link + 1),
    };
    let (first, along) = axes[0];
    // No joint moves points on the first axis: a box under the base may reach up to it.
    let is_moved = |point: &Point3<f64>| along.cross(&(point - first)).norm() > 1e-6;
    let pairs = points.windows(2).enumerate();
    pairs
        .map(|(place, ends)| (name(place), Segment::new(ends[0], ends[1])))
        .filter(|(_, segment)| is_moved(&segment.from) || is_moved(&segment.to))
        .collect()
}

fn outside_boxes(parts: &[(Part, Segment)], asked: &Constraints) -> Result<(), Unsuitable> {
    let margin_mm = asked.keep_out_margin_mm;
    for keep_out in &asked.keep_out {
        let least = keep_out.least_mm.map(|x| x - margin_mm);
        let most = keep_out.most_mm.map(|x| x + margin_mm);
        if let Some((part, _)) = parts.iter().find(|(_, s)| s.meets_box(least, most)) {
            return Err(Unsuitable::InKeepOut {
                keep_out: keep_out.name.clone(),
                part: *part,
                margin_mm,
            });
        }
    }
    Ok(())
}

fn seen(base_from_target: &Isometry3<f64>, line_of_sight: &LineOfSight) -> Result<(), Unsuitable> {
    let way = line_of_sight.tracker.coords - base_from_target.translation.vector;
    let (range_mm, [least_mm, most_mm]) = (way.norm(), line_of_sight.range_mm);
    if !(least_mm..=most_mm).contains(&range_mm) {
        return Err(Unsuitable::OutOfRange { range_mm, least_mm, most_mm });
    }
    let facing = base_from_target.rotation * line_of_sight.facing.into_inner();
    let angle = facing.angle(&way);
    if angle > line_of_sight.acceptance_rad {
        return Err(Unsuitable::TurnedAway {
            angle_deg: angle.to_degrees(),
            acceptance_deg: line_of_sight.acceptance_rad.to_degrees(),
        });
    }
    Ok(())
}

/// Parts next to the target, nearer than their radius, are covered by the acceptance angle.
fn beam_is_free(
    parts: &[(Part, Segment)],
    base_from_target: &Isometry3<f64>,
    line_of_sight: &LineOfSight,
) -> Result<(), Unsuitable> {
    let target = Point3::from(base_from_target.translation.vector);
    let beam = Segment::new(line_of_sight.tracker, target);
    let clearance_mm = line_of_sight.link_radius_mm;
    for (part, segment) in parts {
        let carries = *part == Part::Target || segment.distance_to(&target) < clearance_mm;
        let distance_mm = segment.distance(&beam);
        if !carries && distance_mm < clearance_mm {
            return Err(Unsuitable::BeamBlocked { part: *part, distance_mm, clearance_mm });
        }
    }
    Ok(())
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Link(joint) => write!(f, "the link from joint {joint} to joint {}", joint + 1),
            Self::Flange => f.write_str("the flange"),
            Self::Target => f.write_str("the target"),
        }
    }
}

#[cfg(test)]
mod tests;
