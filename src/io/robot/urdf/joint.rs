//! The numbers of a joint, in the file's m and rad.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Quaternion, UnitQuaternion, Vector3};
use roxmltree::Node;

use super::error::{Result, UrdfError};
use super::tree::{Joint, expanded};
use super::{attribute, children, line};
use crate::geometry::{EulerOrder, Placement};
use crate::kinematics::JointKind;
use crate::nearest::did_you_mean;
use crate::units::MM_PER_M;

/// A coordinate of an origin further away than this, m, is one in mm.
const FAR_M: f64 = 50.0;
/// An angle larger than two turns, rad, is one in degrees.
const TWO_TURNS_RAD: f64 = 12.6;
/// A limit beyond this, five turns, rad, is one in degrees.
const MANY_TURNS_RAD: f64 = 31.5;
/// An angle as near to a right one as this, rad, and not nearer than [`EXACT_RAD`], is one whose digits were cut off.
const CUT_OFF_RAD: f64 = 5e-3;
const EXACT_RAD: f64 = 1e-7;
/// The elements of a joint that place it.
const ELEMENTS: [&str; 6] = ["origin", "axis", "limit", "mimic", "parent", "child"];
/// The first version whose origins may state quaternions.
const WITH_QUATERNIONS: (u32, u32) = (1, 1);

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Origin {
    xyz_m: [f64; 3],
    turn: Turn,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Turn {
    /// Roll, pitch, yaw, rad.
    Rpy([f64; 3]),
    Quaternion(UnitQuaternion<f64>),
}

/// A joint that follows another: `multiplier · other + offset`, in m and rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Following<'a> {
    pub(crate) joint: &'a str,
    pub(crate) multiplier: f64,
    pub(crate) offset: f64,
}

/// A length in m, mm: the decimal point of its shortest text moved by three, so that no digit is made up.
pub(crate) fn mm(metres: f64) -> f64 {
    let text = format!("{metres:e}");
    let moved = text.split_once('e').and_then(|(digits, power)| {
        let power: i32 = power.parse().ok()?;
        format!("{digits}e{}", power + 3).parse().ok()
    });
    moved.unwrap_or(metres * MM_PER_M)
}

impl Origin {
    const NOWHERE: Self = Self { xyz_m: [0.0; 3], turn: Turn::Rpy([0.0; 3]) };

    pub(crate) fn placement(&self) -> Placement {
        let (euler_deg, quaternion_xyzw) = match self.turn {
            Turn::Rpy(angles) => (Some(angles.map(f64::to_degrees)), None),
            Turn::Quaternion(turn) => (None, Some(turn.coords.into())),
        };
        let euler_order = euler_deg.map(|_| EulerOrder::FixedXyz);
        Placement { xyz_mm: self.xyz_m.map(mm), quaternion_xyzw, euler_deg, euler_order }
    }

    /// Its distance from the origin of the parent, mm.
    pub(crate) fn length_mm(&self) -> f64 {
        Vector3::from(self.xyz_m).norm() * MM_PER_M
    }

    /// An angle of few digits that is nearly a right one, or two, and by how much it misses, rad.
    pub(crate) fn cut_off(&self) -> Option<(f64, f64)> {
        let Turn::Rpy(angles) = self.turn else { return None };
        let missed = angles.map(|angle| {
            let right = (angle / FRAC_PI_2).round() * FRAC_PI_2;
            let is_short = ((angle * 1e5).round() - angle * 1e5).abs() < 1e-6;
            (angle, if is_short && right != 0.0 { (angle - right).abs() } else { 0.0 })
        });
        let largest = missed.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        largest.filter(|(_, missed)| (EXACT_RAD..CUT_OFF_RAD).contains(missed))
    }

    /// The placement as an isometry, mm.
    pub(crate) fn isometry(&self) -> Isometry3<f64> {
        let turn = match self.turn {
            Turn::Rpy([roll, pitch, yaw]) => UnitQuaternion::from_euler_angles(roll, pitch, yaw),
            Turn::Quaternion(turn) => turn,
        };
        Isometry3::from_parts(self.xyz_m.map(mm).into(), turn)
    }
}

impl<'a, 'i> Joint<'a, 'i> {
    /// Its kind; an error where an arm has none such.
    pub(crate) fn kind(&self) -> Result<JointKind> {
        let found = attribute(self.node, "type").unwrap_or_default();
        match expanded(self.node, found)? {
            "revolute" => Ok(JointKind::Revolute),
            "continuous" => Ok(JointKind::Continuous),
            "prismatic" => Ok(JointKind::Prismatic),
            "fixed" => Ok(JointKind::Fixed),
            _ => Err(UrdfError::Kind {
                line: self.line(),
                joint: self.name.to_owned(),
                found: found.to_owned(),
            }),
        }
    }

    /// Its origin; that of its parent link where it states none.
    pub(crate) fn origin(&self) -> Result<Origin> {
        if let Some(pose) = children(self.node, "pose").next() {
            let (line, joint) = (line(pose), self.name.to_owned());
            let problem = "it has <pose>, as an SDF has, which no URDF has; write <origin xyz=\"…\" rpy=\"…\"/>, xyz in m and rpy in rad";
            return Err(UrdfError::Form { line, joint, problem });
        }
        let Some(origin) = self.part("origin", &["xyz", "rpy", "quat_xyzw"])? else {
            return Ok(Origin::NOWHERE);
        };
        let xyz_m = self.numbers(origin, "xyz", "three numbers in m")?;
        if let Some(found) = xyz_m.filter(|xyz| xyz.iter().any(|m| m.abs() > FAR_M)) {
            let wanted = "three numbers in m, and this is too far away for an arm; is it in mm?";
            return Err(self.number(origin, "xyz", format!("{found:?}"), wanted));
        }
        Ok(Origin { xyz_m: xyz_m.unwrap_or_default(), turn: self.turn(origin)? })
    }

    fn turn(&self, origin: Node<'_, '_>) -> Result<Turn> {
        let angles = self.numbers::<3>(origin, "rpy", "three numbers in rad")?;
        let too_large = |angles: &[f64; 3]| angles.iter().any(|rad| rad.abs() > TWO_TURNS_RAD);
        if let Some(found) = angles.filter(too_large) {
            let wanted = "three numbers in rad, and this is more than two turns; is it in degrees?";
            return Err(self.number(origin, "rpy", format!("{found:?}"), wanted));
        }
        let quaternion = self.numbers(origin, "quat_xyzw", "four numbers")?;
        let Some([x, y, z, w]) = quaternion else {
            return Ok(Turn::Rpy(angles.unwrap_or_default()));
        };
        let problem = if angles.is_some() {
            Some("its origin has both rpy and quat_xyzw; take one of them out")
        } else if self.version() < WITH_QUATERNIONS {
            Some(
                "its origin has quat_xyzw, which URDF has since version 1.1: write <robot version=\"1.1\">, or rpy instead",
            )
        } else {
            None
        };
        let quaternion = Quaternion::new(w, x, y, z);
        let unit = UnitQuaternion::try_new(quaternion, 1e-9);
        match (problem, unit) {
            (None, Some(unit)) => Ok(Turn::Quaternion(unit)),
            (problem, _) => Err(UrdfError::Form {
                line: line(origin),
                joint: self.name.to_owned(),
                problem: problem.unwrap_or("quat_xyzw is zero; give a rotation"),
            }),
        }
    }

    /// The version of the URDF; 1.0 where it states none.
    fn version(&self) -> (u32, u32) {
        let stated = attribute(self.node.document().root_element(), "version");
        let parts = stated.and_then(|version| {
            let (major, minor) = version.trim().split_once('.')?;
            Some((major.parse().ok()?, minor.parse().ok()?))
        });
        parts.unwrap_or((1, 0))
    }

    /// Direction of its axis in its own frame; x where it states none.
    pub(crate) fn axis(&self) -> Result<Vector3<f64>> {
        let Some(axis) = self.part("axis", &["xyz"])? else { return Ok(Vector3::x()) };
        let wanted = "three numbers that are not all zero";
        let xyz = self.numbers(axis, "xyz", wanted)?.ok_or_else(|| self.without(axis, "xyz"))?;
        let direction = Vector3::from(xyz);
        let norm = direction.norm();
        if norm.is_finite() && norm > 1e-9 {
            Ok(direction)
        } else {
            Err(self.number(axis, "xyz", format!("{xyz:?}"), wanted))
        }
    }

    /// Its limits, m or rad; `None` where it states none: an absent one is 0, and none is between 0 and 0.
    pub(crate) fn limits(&self) -> Result<Option<[f64; 2]>> {
        let Some(limit) = self.part("limit", &["lower", "upper"])? else { return Ok(None) };
        let wanted = "a finite number, in rad or m";
        let [lower] = self.numbers(limit, "lower", wanted)?.unwrap_or_default();
        let [upper] = self.numbers(limit, "upper", wanted)?.unwrap_or_default();
        if lower == 0.0 && upper == 0.0 {
            return Ok(None);
        }
        let many_turns = lower.abs().max(upper.abs()) > MANY_TURNS_RAD;
        let remedy = if lower >= upper {
            "the lower one comes first, and they differ; a joint that does not move is fixed"
        } else if many_turns && self.kind()? == JointKind::Revolute {
            "a URDF has them in rad, and these are many turns: write degrees as rad; a joint that turns without end is continuous"
        } else {
            return Ok(Some([lower, upper]));
        };
        let (line, joint) = (line(limit), self.name.to_owned());
        let found = format!("limits from {lower} to {upper}");
        Err(UrdfError::Has { line, joint, found, remedy })
    }

    fn without(&self, node: Node<'_, '_>, wanted: &'static str) -> UrdfError {
        let element = format!("<{}> of joint {:?}", node.tag_name().name(), self.name);
        UrdfError::Incomplete { line: line(node), element, wanted }
    }

    /// An error where an element has nearly the name of one that places the joint: it would be passed over. Those of simulators and
    /// drives have other names.
    pub(super) fn refuse_misspelled(&self) -> Result<()> {
        let own = self.node.tag_name().namespace();
        let elements = self.node.children().filter(Node::is_element);
        let elements = elements.filter(|node| node.tag_name().namespace() == own);
        elements
            .map(|node| (node, node.tag_name().name()))
            .try_for_each(|(node, name)| self.refuse_near(node, "", name, &ELEMENTS))
    }

    /// An error where a name in an element is none of the known ones, and near to one of them.
    fn refuse_near(&self, node: Node<'_, '_>, of: &str, name: &str, known: &[&str]) -> Result<()> {
        let meant = did_you_mean(name, known.iter().copied());
        if known.contains(&name) || meant.is_empty() {
            return Ok(());
        }
        Err(UrdfError::Has {
            line: line(node),
            joint: self.name.to_owned(),
            found: format!("<{of}{name}>, which is unknown{meant}"),
            remedy: "write it so, in small letters, or take it out",
        })
    }

    /// Its element of that name with these attributes; an error where there are two, or where it may say something that is not read.
    fn part(&self, name: &str, keys: &[&str]) -> Result<Option<Node<'a, 'i>>> {
        let mut alike = children(self.node, name);
        let (Some(node), second) = (alike.next(), alike.next()) else { return Ok(None) };
        for own in node.attributes().filter(|own| own.namespace().is_none()) {
            self.refuse_near(node, &format!("{name} "), own.name(), keys)?;
        }
        let (at, problem) = if let Some(second) = second {
            let problem = match name {
                "origin" => "its <origin> is there twice; take one of the two out",
                "axis" => "its <axis> is there twice; take one of the two out",
                _ => {
                    "it has two such elements, and a URDF has one of each; take one of the two out"
                }
            };
            (second, problem)
        } else if node.children().any(|inner| {
            inner.is_element() || inner.text().is_some_and(|text| !text.trim().is_empty())
        }) {
            (
                node,
                "a URDF writes numbers as attributes, as in <axis xyz=\"0 0 1\"/>, and not inside the element",
            )
        } else {
            return Ok(Some(node));
        };
        Err(UrdfError::Form { line: line(at), joint: self.name.to_owned(), problem })
    }

    /// The joint that it follows; `None` for one that is driven.
    pub(crate) fn following(&self) -> Result<Option<Following<'a>>> {
        let Some(mimic) = self.part("mimic", &["joint", "multiplier", "offset"])? else {
            return Ok(None);
        };
        let joint = attribute(mimic, "joint").ok_or_else(|| self.without(mimic, "joint"))?;
        let [multiplier] = self.numbers(mimic, "multiplier", "a number")?.unwrap_or([1.0]);
        let [offset] = self.numbers(mimic, "offset", "a number")?.unwrap_or_default();
        Ok(Some(Following { joint: expanded(mimic, joint)?, multiplier, offset }))
    }

    /// The finite numbers of an attribute; `None` where it is not there.
    fn numbers<const N: usize>(
        &self,
        node: Node<'_, '_>,
        key: &str,
        wanted: &'static str,
    ) -> Result<Option<[f64; N]>> {
        let Some(text) = attribute(node, key) else { return Ok(None) };
        expanded(node, text)?;
        let parsed: Option<Vec<f64>> = text
            .split_whitespace()
            .map(|number| number.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        let numbers = parsed.and_then(|all| <[f64; N]>::try_from(all).ok());
        match numbers {
            Some(numbers) => Ok(Some(numbers)),
            None => Err(self.number(node, key, text.to_owned(), wanted)),
        }
    }

    fn number(
        &self,
        node: Node<'_, '_>,
        key: &str,
        found: String,
        wanted: &'static str,
    ) -> UrdfError {
        let (line, joint) = (line(node), self.name.to_owned());
        let key = format!("<{} {key}>", node.tag_name().name());
        UrdfError::Number { line, joint, key, found, wanted }
    }
}
