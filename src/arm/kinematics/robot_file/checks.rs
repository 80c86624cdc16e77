//! Checks of a robot file's values, before an arm is made of them.

use super::super::convention::Convention;
use super::keys;
use super::{ArmError, JointFile, JointKind, RobotFile, WrongKeys};

const MOST_JOINTS: usize = 16;
/// The most [[joint]] tables of a file, those that do not move included.
const MOST_TABLES: usize = 64;
/// An arm whose lengths add up to less, mm, is stated in metres.
const LEAST_LENGTHS_MM: f64 = 20.0;
/// An angle this near to a right angle in radians is one, as far as somebody typed it.
const RADIANS: f64 = 2e-4;

impl RobotFile {
    pub(super) fn check(&self) -> Result<(), ArmError> {
        let moving = self.joint.iter().filter(|joint| joint.is_reported()).count();
        let all = self.joint.iter().filter(|j| j.kind != JointKind::Fixed).count();
        if moving == 0 || all > MOST_JOINTS || self.joint.len() > MOST_TABLES {
            return Err(ArmError::JointCount { found: all });
        }
        for (index, joint) in self.joint.iter().enumerate() {
            joint.check(self.convention)?;
            if self.joint[..index].iter().any(|other| other.name == joint.name) {
                return Err(ArmError::DuplicateJoint { joint: joint.name.clone() });
            }
            self.check_mimic(joint)?;
        }
        let is_exponential = matches!(self.convention, Convention::Poe | Convention::MinimalPoe);
        if is_exponential && self.flange.is_none() {
            return Err(ArmError::NoFlange { convention: self.convention.word() });
        }
        self.check_lengths()
    }

    fn check_mimic(&self, joint: &JointFile) -> Result<(), ArmError> {
        let Some(mimic) = &joint.mimic else { return Ok(()) };
        let followed = |other: &JointFile| other.is_reported() && other.name == mimic.joint;
        if !mimic.multiplier.is_finite() {
            return Err(joint.not_finite("mimic.multiplier"));
        }
        if self.joint.iter().any(followed) {
            Ok(())
        } else {
            Err(ArmError::Mimic { joint: joint.name.clone(), found: mimic.joint.clone() })
        }
    }

    fn check_lengths(&self) -> Result<(), ArmError> {
        let lengths = || {
            let own = |joint| JointFile::lengths(joint).into_iter().map(move |l| (joint, l));
            self.joint.iter().flat_map(own)
        };
        let largest = lengths().max_by(|a, b| a.1.1.abs().total_cmp(&b.1.1.abs()));
        let total: f64 = lengths().map(|(_, (_, length))| length.abs()).sum();
        match largest {
            Some((joint, (key, found))) if total > 0.0 && total < LEAST_LENGTHS_MM => {
                Err(ArmError::Metres { joint: joint.name.clone(), key, found, total })
            }
            _ => Ok(()),
        }
    }
}

impl JointFile {
    fn check(&self, convention: Convention) -> Result<(), ArmError> {
        use Convention::{Cpc, MinimalPoe, Poe};
        if self.kind == JointKind::Fixed && matches!(convention, Cpc | Poe | MinimalPoe) {
            let (joint, convention) = (self.name.clone(), convention.word());
            return Err(ArmError::FixedJoint { joint, convention });
        }
        let (missing, unread) = keys::wrong(self, convention);
        if !missing.is_empty() || !unread.is_empty() {
            let (joint, convention) = (self.name.clone(), convention.word());
            return Err(ArmError::Keys(Box::new(WrongKeys { joint, convention, missing, unread })));
        }
        if let Some(found) = self.sign.filter(|sign| sign.abs() != 1) {
            return Err(ArmError::Sign { joint: self.name.clone(), found });
        }
        self.check_limits()?;
        self.check_numbers()?;
        self.check_directions()
    }

    fn check_limits(&self) -> Result<(), ArmError> {
        for (key, limits) in [("limits_deg", self.limits_deg), ("limits_mm", self.limits_mm)] {
            let Some([lower, upper]) = limits else { continue };
            if !(lower.is_finite() && upper.is_finite() && lower < upper) {
                return Err(ArmError::Limits { joint: self.name.clone(), key, lower, upper });
            }
        }
        Ok(())
    }

    fn check_numbers(&self) -> Result<(), ArmError> {
        let lengths = self.lengths();
        let angles = self.angles();
        let mut all = lengths.iter().chain(&angles);
        if let Some((quantity, _)) = all.find(|(_, value)| !value.is_finite()) {
            return Err(self.not_finite(quantity));
        }
        let [lower, upper] = self.limits_deg.unwrap_or_default();
        let mut angles = angles.into_iter().chain([("limits_deg", lower), ("limits_deg", upper)]);
        match angles.find_map(|(key, found)| Some((key, found, in_radians(found)?))) {
            Some((key, found, degrees)) => {
                Err(ArmError::Radians { joint: self.name.clone(), key, found, degrees })
            }
            None => Ok(()),
        }
    }

    fn check_directions(&self) -> Result<(), ArmError> {
        for (key, direction) in [("direction", self.direction), ("axis", self.axis)] {
            let Some(found) = direction else { continue };
            let norm = nalgebra::Vector3::from(found).norm();
            if !(norm.is_finite() && norm > 1e-9) {
                return Err(ArmError::NoDirection { joint: self.name.clone(), key, found });
            }
        }
        Ok(())
    }

    fn not_finite(&self, quantity: &'static str) -> ArmError {
        ArmError::NotFinite { joint: self.name.clone(), quantity }
    }

    /// Every length with its key, mm.
    fn lengths(&self) -> Vec<(&'static str, f64)> {
        let mimic = self.mimic.as_ref();
        let single = [
            ("a_mm", self.a_mm),
            ("d_mm", self.d_mm),
            ("b_mm", self.b_mm),
            ("offset_mm", self.offset_mm),
            ("mimic.offset_mm", mimic.and_then(|mimic| mimic.offset_mm)),
        ];
        let triple = [
            ("shift_mm", self.shift_mm),
            ("point_mm", self.point_mm),
            ("origin.xyz_mm", self.origin.map(|origin| origin.xyz_mm)),
        ];
        let single = single.into_iter().filter_map(|(key, value)| Some((key, value?)));
        let triple = triple.into_iter().filter_map(|(key, value)| Some((key, value?)));
        single.chain(triple.flat_map(|(key, values)| values.map(|value| (key, value)))).collect()
    }

    /// Every angle with its key, degrees; limits apart.
    fn angles(&self) -> Vec<(&'static str, f64)> {
        let mimic = self.mimic.as_ref();
        let all = [
            ("alpha_deg", self.alpha_deg),
            ("offset_deg", self.offset_deg),
            ("gamma_deg", self.gamma_deg),
            ("mimic.offset_deg", mimic.and_then(|mimic| mimic.offset_deg)),
        ];
        all.into_iter().filter_map(|(key, value)| Some((key, value?))).collect()
    }
}

/// The right angle in degrees that a number is in radians; `None` for any other number.
fn in_radians(found: f64) -> Option<f64> {
    let degrees = [90.0_f64, 180.0, 270.0, 360.0];
    let is = |degrees: &f64| (found.abs() - degrees.to_radians()).abs() < RADIANS;
    Some(degrees.into_iter().find(is)?.copysign(found))
}
