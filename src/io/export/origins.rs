//! The identified geometry as the joint origins of a chain that states its nominal arm as a URDF does.
//!
//! 1. The chain has to be the run's nominal arm ([`OriginsError::OtherArm`]).
//! 2. The identified errors are carried into the least small motions of the chain's own frames
//!    ([`crate::fit::conversion`]).
//! 3. A frame that moved is a new origin; axes and joint angles stay. Motions of the base are part of the first
//!    joint's, those of the flange of the first fixed joint behind the last link. Without one, what turns about and
//!    slides along the last axis is part of the last joint's origin, and the rest is given back.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, UnitVector3, Vector3};
use thiserror::Error;

use super::controller_base::InControllerBase;
use crate::fit::conversion::{Errors, converted, measured, spread_joints};
use crate::geometry::Placement;
use crate::kinematics::{
    Arm, ArmError, Chain, Convention, Element, Joint, JointFile, JointKind, RobotFile,
};

const POSES: u32 = 50;
/// A chain this near to the run's nominal arm is that arm: angles that are written as 1.5708 are off by less.
const SAME_MM: f64 = 0.05;
const SAME_RAD: f64 = 5e-5;

#[derive(Debug, Clone, PartialEq)]
pub(super) struct ChainJoint {
    pub name: String,
    pub origin: Isometry3<f64>,
    /// Its motion; `None` for a joint that does not move.
    pub moves: Option<Moves>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moves {
    pub axis: UnitVector3<f64>,
    /// Whether it slides along it instead of turning about it.
    pub slides: bool,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Origins {
    /// The new origin of each joint of the chain, mm; `None` for one that stays as it is.
    pub joints: Vec<Option<Isometry3<f64>>>,
    /// The flange in the chain's last frame, as far as no origin can hold it, mm; `None` where the origins hold it all.
    pub rest: Option<Isometry3<f64>>,
}

#[derive(Debug, Error)]
pub enum OriginsError {
    #[error("the arm has coupled joints, and origins of joints cannot say how")]
    Coupled,
    #[error("the chain has {found} joints that move ({chain}), the run's arm {wanted} ({arm})")]
    Count { found: usize, chain: String, wanted: usize, arm: String },
    #[error(
        "joint {chain:?} of the chain turns where joint {arm:?} of the run slides, or the other way round"
    )]
    OtherMotion { chain: String, arm: String },
    #[error("the chain makes no arm: {0}")]
    Arm(#[from] ArmError),
    #[error(
        "the chain is not the nominal arm of the run: its flange is up to {mm:.4} mm and {rad:.6} rad away from that arm's, with joints as \
         {names}{constant}"
    )]
    OtherArm { mm: f64, rad: f64, names: String, constant: &'static str },
    #[error(
        "the chain's origins leave {mm:.1e} mm of the identified geometry; this is a defect of posegrid, please report it"
    )]
    Left { mm: f64 },
}

impl Origins {
    pub fn of(own: &InControllerBase, chain: &[ChainJoint]) -> Result<Self, OriginsError> {
        Self::carrying(&own.published.arm.arm, &own.flange_errors(), chain)
    }

    /// The origins with which the chain is `from` with those errors of its links, its base and its flange.
    fn carrying(from: &Arm, errors: &Errors, chain: &[ChainJoint]) -> Result<Self, OriginsError> {
        let to = nominal(from, chain)?;
        same_arm(from, &to, chain)?;
        let found = converted(from, errors, &to, &Isometry3::identity());
        if found.left_mm > 1e-7 {
            return Err(OriginsError::Left { mm: found.left_mm });
        }
        let whole = measured(to.chain(), &Isometry3::identity());
        let moved = AtZero::of(&whole.with_offsets(found.errors.offsets.as_slice()));
        Ok(Self::cut(chain, &AtZero::of(&whole), &moved))
    }

    fn cut(chain: &[ChainJoint], plain: &AtZero, moved: &AtZero) -> Self {
        let mut frames = plain.axes.iter().zip(&moved.axes);
        let (mut nominal, mut before) = (Isometry3::identity(), Isometry3::identity());
        let mut joints = Vec::with_capacity(chain.len());
        for joint in chain {
            nominal *= joint.origin;
            let Some((plain, moved)) = joint.moves.and_then(|_| frames.next()) else {
                joints.push(None);
                before *= joint.origin;
                continue;
            };
            // A frame of the chain stands on its axis' frame as it did.
            let frame = moved * plain.inverse() * nominal;
            joints.push(Some(before.inverse() * frame));
            before = frame;
        }
        let rest = before.inverse() * moved.end;
        Self { joints, rest: None }.with_rest(chain, rest)
    }

    /// Brings what the flange moved on the last link into an origin that can hold it.
    fn with_rest(mut self, chain: &[ChainJoint], rest: Isometry3<f64>) -> Self {
        let Some(last) = chain.iter().rposition(|joint| joint.moves.is_some()) else { return self };
        if let Some(fixed) = chain.get(last + 1) {
            let behind = chain[last + 2..].iter();
            let behind: Isometry3<f64> =
                behind.fold(Isometry3::identity(), |end, joint| end * joint.origin);
            self.joints[last + 1] = Some(fixed.origin * behind * rest * behind.inverse());
            return self;
        }
        if let (Some(origin), Some(moves)) = (&mut self.joints[last], chain[last].moves) {
            let along = along(&rest, &moves.axis);
            *origin *= along;
            self.rest = Some(along.inverse() * rest);
        }
        self
    }
}

/// The part of a motion that turns about and slides along an axis.
fn along(motion: &Isometry3<f64>, axis: &UnitVector3<f64>) -> Isometry3<f64> {
    let quaternion = motion.rotation.quaternion();
    let angle = 2.0 * quaternion.imag().dot(axis).atan2(quaternion.scalar());
    let slide = axis.scale(axis.dot(&motion.translation.vector));
    Isometry3::from_parts(Translation3::from(slide), UnitQuaternion::from_axis_angle(axis, angle))
}

struct AtZero {
    /// The frame that each axis moves in.
    axes: Vec<Isometry3<f64>>,
    end: Isometry3<f64>,
}

impl AtZero {
    fn of(chain: &Chain) -> Self {
        let (mut axes, mut end) = (Vec::new(), Isometry3::identity());
        for element in chain.elements() {
            match element {
                Element::Fixed(placement) => end *= placement,
                Element::Free { motion, nominal, .. } => end *= motion.by(*nominal),
                Element::Joint { .. } => axes.push(end),
            }
        }
        Self { axes, end }
    }
}

fn nominal(run: &Arm, chain: &[ChainJoint]) -> Result<Arm, OriginsError> {
    let count = run.joints().len();
    if run.axes_from_joints() != nalgebra::DMatrix::identity(count, count) {
        return Err(OriginsError::Coupled);
    }
    let moving: Vec<&ChainJoint> = chain.iter().filter(|joint| joint.moves.is_some()).collect();
    if moving.len() != count {
        return Err(OriginsError::Count {
            found: moving.len(),
            chain: names(moving.iter().map(|joint| joint.name.as_str())),
            wanted: count,
            arm: names(run.joints().iter().map(|joint| joint.name.as_str())),
        });
    }
    let mut own = run.joints().iter();
    let joint = chain.iter().enumerate().map(|(place, joint)| match joint.moves {
        None => Ok(fixed(place, joint)),
        Some(moves) => moving_joint(joint, moves, own.next()),
    });
    let file = RobotFile {
        model: run.model().to_owned(),
        source: "a chain of joint origins".to_owned(),
        convention: Convention::Urdf,
        home_deg: None,
        joint_map: None,
        base: None,
        flange: None,
        joint: joint.collect::<Result<_, _>>()?,
    };
    Ok(file.arm()?)
}

fn fixed(place: usize, joint: &ChainJoint) -> JointFile {
    JointFile {
        name: format!("fixed {place}"),
        kind: JointKind::Fixed,
        origin: Some(Placement::of(&joint.origin)),
        ..JointFile::default()
    }
}

fn moving_joint(
    joint: &ChainJoint,
    moves: Moves,
    run: Option<&Joint>,
) -> Result<JointFile, OriginsError> {
    let Some(run) = run.filter(|run| run.slides == moves.slides) else {
        return Err(OriginsError::OtherMotion {
            chain: joint.name.clone(),
            arm: run.map_or_else(String::new, |run| run.name.clone()),
        });
    };
    let limits = [run.lower, run.upper];
    Ok(JointFile {
        name: run.name.clone(),
        kind: if moves.slides { JointKind::Prismatic } else { JointKind::Revolute },
        origin: Some(Placement::of(&joint.origin)),
        axis: Some(moves.axis.into_inner().into()),
        limits_deg: (!moves.slides).then(|| limits.map(f64::to_degrees)),
        limits_mm: moves.slides.then_some(limits),
        ..JointFile::default()
    })
}

fn same_arm(run: &Arm, chain: &Arm, joints: &[ChainJoint]) -> Result<(), OriginsError> {
    let pairs: Vec<[Isometry3<f64>; 2]> = (0..POSES)
        .map(|place| spread_joints(run, place))
        .map(|q| [run, chain].map(|arm| *arm.flange(&q).isometry()))
        .collect();
    let (mm, rad) = apart(pairs.iter().map(|[own, other]| (*own, *other)));
    if mm < SAME_MM && rad < SAME_RAD {
        return Ok(());
    }
    let moving = joints.iter().filter(|joint| joint.moves.is_some());
    let named = moving.zip(run.joints());
    let pair = |(chain, run): (&ChainJoint, &Joint)| format!("{} = {}", chain.name, run.name);
    let names = named.map(pair).collect::<Vec<_>>().join(", ");
    Err(OriginsError::OtherArm { mm, rad, names, constant: constant(&pairs) })
}

/// The largest distance, mm, and the largest angle, rad, between poses.
fn apart(pairs: impl Iterator<Item = (Isometry3<f64>, Isometry3<f64>)>) -> (f64, f64) {
    pairs.fold((0.0, 0.0), |(mm, rad): (f64, f64), (one, other)| {
        let distance = (one.translation.vector - other.translation.vector).norm();
        (mm.max(distance), rad.max(one.rotation.angle_to(&other.rotation)))
    })
}

/// Advice where another base, or another flange, is the whole difference; empty elsewhere.
fn constant(pairs: &[[Isometry3<f64>; 2]]) -> &'static str {
    let is_one = |of: fn(&[Isometry3<f64>; 2]) -> Isometry3<f64>| {
        let (mm, rad) = apart(pairs.iter().map(|pair| (of(&pairs[0]), of(pair))));
        mm < SAME_MM && rad < SAME_RAD
    };
    if is_one(|[own, other]| own * other.inverse()) {
        "; all of that is another base: give as --base the link that is the controller's base"
    } else if is_one(|[own, other]| own.inverse() * other) {
        "; all of that is another flange: give as --tip the link that is the controller's flange"
    } else {
        ""
    }
}

fn names<'a>(all: impl Iterator<Item = &'a str>) -> String {
    all.collect::<Vec<_>>().join(", ")
}

/// The z axis, which joints of UR's description turn about.
pub(super) fn about_z() -> Moves {
    Moves { axis: Vector3::z_axis(), slides: false }
}

#[cfg(test)]
mod tests;
