//! A robot file: a nominal arm as its maker states it, in one of the [conventions](super::convention). Which keys a
//! joint has to have follows from convention and kind of joint (`keys`); numbers in other units are refused (`checks`).

mod checks;
mod keys;

use nalgebra::{DMatrix, Isometry3, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::arm::{Arm, Joint};
use super::chain::{Chain, Element};
use super::convention::table::{Parallel, TableLink};
use super::convention::{Convention, Moving, lines};
use crate::geometry::Placement;

pub use super::arm_error::{ArmError, WrongKeys};

/// A nominal arm as `pipelines/robots/*.toml` states it. TOML leaves out what is absent.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct RobotFile {
    pub model: String,
    /// The source of the numbers: a data sheet or drawing.
    pub source: String,
    pub convention: Convention,
    /// A pose that can be checked at the cell, degrees or mm: `posegrid check` prints the nominal flange there.
    pub home_deg: Option<Vec<f64>>,
    /// Coupling of axes: row i is axis i as a linear combination of reported joint angles. Identity when absent.
    pub joint_map: Option<Vec<Vec<f64>>>,
    /// The frame of the first link in the base frame; the base frame itself when absent.
    pub base: Option<Placement>,
    /// The flange in the frame of the last link, or in the base frame at zero for products of exponentials.
    pub flange: Option<Placement>,
    pub joint: Vec<JointFile>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum JointKind {
    #[default]
    Revolute,
    Continuous,
    /// Slides along its axis: a track, a lift.
    Prismatic,
    /// Does not move: a constant link.
    Fixed,
}

#[derive(Debug, Clone, PartialEq, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct JointFile {
    pub name: String,
    #[serde(default, skip_serializing_if = "is_revolute")]
    pub kind: JointKind,
    /// Link length a, mm.
    pub a_mm: Option<f64>,
    /// Link twist α, degrees.
    pub alpha_deg: Option<f64>,
    /// Link offset d, mm.
    pub d_mm: Option<f64>,
    /// Joint offset, degrees: θ at a reported angle of zero.
    pub offset_deg: Option<f64>,
    /// Shift added to the reported position of a joint that slides, mm, where d is not part of the convention.
    pub offset_mm: Option<f64>,
    /// Turn about z behind the twist: γ of the S-model, β of CPC, degrees.
    pub gamma_deg: Option<f64>,
    /// The S-model's shift along z behind the twist, mm.
    pub b_mm: Option<f64>,
    /// CPC: direction of the next joint's axis in this joint's frame.
    pub direction: Option<[f64; 3]>,
    /// CPC: shift to the next joint's frame, in that frame's axes, mm.
    pub shift_mm: Option<[f64; 3]>,
    /// Direction of the axis in the base frame at zero (product of exponentials), or in the joint's frame (URDF).
    pub axis: Option<[f64; 3]>,
    /// A point of the joint's axis in the base frame at zero, mm.
    pub point_mm: Option<[f64; 3]>,
    /// URDF: the joint's frame in that of the joint before.
    pub origin: Option<Placement>,
    /// +1 or −1: which way the controller counts.
    pub sign: Option<i8>,
    /// Lower and upper limit of the reported angle, degrees.
    pub limits_deg: Option<[f64; 2]>,
    /// Lower and upper limit of the reported position of a joint that slides, mm.
    pub limits_mm: Option<[f64; 2]>,
    /// The joint that this one follows; it is not reported itself.
    pub mimic: Option<Mimic>,
}

/// A passive joint as a linear function of another: `multiplier · other + offset`, in the units of the two.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Mimic {
    pub joint: String,
    pub multiplier: f64,
    /// Its angle where the other is at zero, degrees.
    pub offset_deg: Option<f64>,
    /// Its position where the other is at zero, mm.
    pub offset_mm: Option<f64>,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_revolute(kind: &JointKind) -> bool {
    *kind == JointKind::Revolute
}

impl RobotFile {
    pub fn arm(&self) -> Result<Arm, ArmError> {
        self.check()?;
        let reported: Vec<&JointFile> = self.joint.iter().filter(|j| j.is_reported()).collect();
        let parallel = self.parallel_joints();
        let base = placement("base", self.base.as_ref())?;
        let mut elements = base.map(Element::Fixed).into_iter().collect();
        self.push_links(&reported, &parallel, &mut elements)?;
        Ok(Arm {
            model: self.model.clone(),
            convention: self.convention,
            joints: reported.iter().map(|joint| joint.joint()).collect(),
            home: self.home(&reported)?,
            map: self.map(reported.len())?,
            chain: Chain::new(elements),
        })
    }

    fn push_links(
        &self,
        reported: &[&JointFile],
        parallel: &[Parallel],
        elements: &mut Vec<Element>,
    ) -> Result<(), ArmError> {
        let mut followers = reported.len();
        let mut before = Isometry3::identity();
        for (place, file) in self.joint.iter().enumerate() {
            let Some(joint) = Self::moving(file, reported, &mut followers) else {
                elements.push(self.constant(file)?);
                continue;
            };
            let before_it = place.checked_sub(1).map(|before| parallel[before]);
            let beside =
                Beside { before: before_it.unwrap_or(Parallel::No), next: parallel[place] };
            elements.extend(self.link(file, &joint, beside, &mut before)?);
        }
        let flange = placement("flange", self.flange.as_ref())?;
        let behind = match self.convention {
            Convention::Poe | Convention::MinimalPoe => {
                Some(before.inverse() * flange.unwrap_or_else(Isometry3::identity))
            }
            _ => flange,
        };
        elements.extend(behind.map(Element::Fixed));
        Ok(())
    }

    /// The joint with its number and the variable that moves it; `None` for one that does not move.
    fn moving(file: &JointFile, reported: &[&JointFile], followers: &mut usize) -> Option<Moving> {
        let sign = f64::from(file.sign.unwrap_or(1));
        let (moved_by, follower, factor, shift) = match (&file.mimic, file.kind) {
            (_, JointKind::Fixed) => return None,
            (None, _) => (&file.name, None, sign, 0.0),
            (Some(mimic), kind) => {
                let is_slide = kind == JointKind::Prismatic;
                let radians = mimic.offset_deg.map(f64::to_radians);
                let offset = if is_slide { mimic.offset_mm } else { radians };
                *followers += 1;
                let shift = sign * offset.unwrap_or(0.0);
                (&mimic.joint, Some(*followers), sign * mimic.multiplier, shift)
            }
        };
        let variable = reported.iter().position(|joint| joint.name == *moved_by)?;
        let (number, slides) = (follower.unwrap_or(variable + 1), file.slides());
        Some(Moving { number, variable, factor, slides, shift })
    }

    /// Elements of a joint's link; `before`: the frame of the joint before in the base's, for products of exponentials.
    fn link(
        &self,
        file: &JointFile,
        joint: &Moving,
        beside: Beside,
        before: &mut Isometry3<f64>,
    ) -> Result<Vec<Element>, ArmError> {
        let zero = file.zero() + joint.shift;
        Ok(match self.convention {
            Convention::StandardDh => file.table(joint).standard(joint, beside.next),
            Convention::MdH => file.table(joint).standard(joint, beside.next.keeping_d()),
            Convention::ModifiedDh => file.table(joint).modified(joint, beside.before),
            Convention::SModel => file.table(joint).s_model(joint, beside.next),
            Convention::Cpc => lines::cpc(
                joint,
                &unit(file.direction),
                file.gamma_deg.unwrap_or(0.0).to_radians(),
                file.shift_mm.unwrap_or_default(),
                zero,
            ),
            Convention::Poe | Convention::MinimalPoe => {
                let point = file.point_mm.map_or(before.translation.vector, Vector3::from);
                let frame = lines::frame_along(point, &unit(file.axis));
                let nominal = before.inverse() * frame;
                *before = frame;
                if self.convention == Convention::Poe {
                    lines::placed(joint, nominal, zero)
                } else {
                    lines::line(joint, nominal, zero)
                }
            }
            Convention::Urdf => {
                let along = Isometry3::from_parts(
                    nalgebra::Translation3::identity(),
                    lines::z_to(&unit(file.axis)),
                );
                let mut elements = lines::placed(joint, file.origin()? * along, zero);
                elements.push(Element::Fixed(along.inverse()));
                elements
            }
        })
    }

    fn constant(&self, file: &JointFile) -> Result<Element, ArmError> {
        let joint = Moving { number: 0, variable: 0, factor: 0.0, slides: false, shift: 0.0 };
        let elements = match self.convention {
            Convention::Urdf => return Ok(Element::Fixed(file.origin()?)),
            Convention::ModifiedDh => file.table(&joint).modified(&joint, Parallel::No),
            _ => file.table(&joint).s_model(&joint, Parallel::No),
        };
        Ok(Element::Fixed(Chain::new(elements).nominal(&[0.0])))
    }

    /// For each joint of the file, how its axis lies to the next one's, as far as a table of twists says so.
    fn parallel_joints(&self) -> Vec<Parallel> {
        let count = self.joint.len();
        let twist = |place: usize| match self.convention {
            Convention::ModifiedDh => self.joint.get(place + 1)?.alpha_deg,
            _ => self.joint[place].alpha_deg,
        };
        let both_move = |place: usize| {
            let kinds = [place, place + 1].map(|place| self.joint[place].kind);
            !kinds.contains(&JointKind::Fixed)
        };
        let own = |place: usize| {
            let twist = twist(place).filter(|_| place + 1 < count && both_move(place));
            twist.map_or(Parallel::No, |degrees| Parallel::of(degrees.to_radians()))
        };
        (0..count).map(own).collect()
    }

    /// The home pose, rad or mm; an error unless it has a finite value for each reported joint.
    fn home(&self, reported: &[&JointFile]) -> Result<Option<Box<[f64]>>, ArmError> {
        let Some(home) = &self.home_deg else { return Ok(None) };
        if home.len() != reported.len() || home.iter().any(|angle| !angle.is_finite()) {
            return Err(ArmError::Home { found: home.clone(), joints: reported.len() });
        }
        let own = |(value, joint): (&f64, &&JointFile)| match joint.kind {
            JointKind::Prismatic => *value,
            _ => value.to_radians(),
        };
        Ok(Some(home.iter().zip(reported).map(own).collect()))
    }

    fn map(&self, joints: usize) -> Result<Option<DMatrix<f64>>, ArmError> {
        let rows = self.joint_map.as_deref();
        rows.map_or(Ok(None), |rows| super::arm::joint_map(rows, joints))
    }
}

/// Whether the axes before and after a joint are parallel to its own.
#[derive(Debug, Clone, Copy)]
struct Beside {
    before: Parallel,
    next: Parallel,
}

/// A stated direction; the z axis where there is none, which a check has refused before.
fn unit(direction: Option<[f64; 3]>) -> UnitVector3<f64> {
    let direction = Vector3::from(direction.unwrap_or([0.0, 0.0, 1.0]));
    UnitVector3::new_normalize(direction)
}

fn placement(place: &str, stated: Option<&Placement>) -> Result<Option<Isometry3<f64>>, ArmError> {
    let isometry = stated.map(Placement::isometry).transpose();
    isometry.map_err(|source| ArmError::Placement { place: place.to_owned(), source })
}

impl JointFile {
    /// Whether the controller reports the joint: it moves, and follows no other.
    pub fn is_reported(&self) -> bool {
        self.kind != JointKind::Fixed && self.mimic.is_none()
    }

    fn slides(&self) -> bool {
        self.kind == JointKind::Prismatic
    }

    /// Zero added to the reported angle or position, rad or mm, where the convention has no table.
    fn zero(&self) -> f64 {
        if self.slides() {
            self.offset_mm.unwrap_or(0.0)
        } else {
            self.offset_deg.unwrap_or(0.0).to_radians()
        }
    }

    /// The joint with its limits, rad or mm. A continuous joint without limits is taken to go a whole turn either way.
    fn joint(&self) -> Joint {
        let slides = self.slides();
        let [lower, upper] = if slides {
            self.limits_mm.unwrap_or([0.0, 0.0])
        } else {
            let turn = [-360.0, 360.0];
            self.limits_deg.unwrap_or(turn).map(f64::to_radians)
        };
        Joint { name: self.name.clone(), lower, upper, slides }
    }

    fn table(&self, joint: &Moving) -> TableLink {
        let angle = |degrees: Option<f64>| degrees.unwrap_or(0.0).to_radians();
        let (turned, slid) = if joint.slides { (0.0, joint.shift) } else { (joint.shift, 0.0) };
        TableLink {
            theta: angle(self.offset_deg) + turned,
            d: self.d_mm.unwrap_or(0.0) + slid,
            a: self.a_mm.unwrap_or(0.0),
            alpha: angle(self.alpha_deg),
            gamma: angle(self.gamma_deg),
            b: self.b_mm.unwrap_or(0.0),
        }
    }

    fn origin(&self) -> Result<Isometry3<f64>, ArmError> {
        let place = format!("origin of joint {:?}", self.name);
        Ok(placement(&place, self.origin.as_ref())?.unwrap_or_else(Isometry3::identity))
    }
}

#[cfg(test)]
mod tests;
