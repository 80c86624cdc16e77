use super::super::chain::Element;
use super::super::motion::{Axis, Motion};
use super::super::parameter::LinkQuantity;
use super::Moving;

const ABOUT_Z: Motion = Motion::Rotation(Axis::Z);
const ALONG_Z: Motion = Motion::Translation(Axis::Z);
const ABOUT_Y: Motion = Motion::Rotation(Axis::Y);
const ABOUT_X: Motion = Motion::Rotation(Axis::X);
const ALONG_X: Motion = Motion::Translation(Axis::X);

/// The numbers of one link, mm and rad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TableLink {
    pub theta: f64,
    pub d: f64,
    pub a: f64,
    pub alpha: f64,
    /// The S-model's γ, about z behind the twist.
    pub gamma: f64,
    /// The S-model's b, along z behind the twist.
    pub b: f64,
}

/// Two axes count as parallel when the sine of the twist between them is below this: half a degree.
const PARALLEL_SINE: f64 = 0.0087;
/// Below this they are exactly parallel: a shift along one is a shift along the other.
const EXACT_SINE: f64 = 1e-6;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Parallel {
    No,
    /// β in place of d, whose shift the next d makes as well.
    InPlaceOfD,
    /// β beside d: axes are nearly parallel, as in a table calibrated before, and the two d are two directions.
    BesideD,
}

impl Parallel {
    pub fn of(twist: f64) -> Self {
        match twist.sin().abs() {
            exact if exact < EXACT_SINE => Self::InPlaceOfD,
            near if near < PARALLEL_SINE => Self::BesideD,
            _ => Self::No,
        }
    }

    #[must_use]
    pub const fn keeping_d(self) -> Self {
        match self {
            Self::InPlaceOfD => Self::BesideD,
            other => other,
        }
    }
}

impl TableLink {
    /// `Rot(z,θ+q) Trans(z,d) Trans(x,a) Rot(x,α) Rot(y,β)`.
    pub fn standard(&self, joint: &Moving, next: Parallel) -> Vec<Element> {
        let mut elements = self.turn_and_shift(joint, next);
        elements.push(joint.free(ALONG_X, self.a, LinkQuantity::A));
        elements.push(joint.free(ABOUT_X, self.alpha, LinkQuantity::Alpha));
        if next != Parallel::No {
            elements.push(joint.free(ABOUT_Y, 0.0, LinkQuantity::Beta));
        }
        elements
    }

    /// `Rot(x,α) Trans(x,a) Rot(y,β) Rot(z,θ+q) Trans(z,d)`, α and a of the link before the joint.
    pub fn modified(&self, joint: &Moving, before: Parallel) -> Vec<Element> {
        let mut elements = vec![
            joint.free(ABOUT_X, self.alpha, LinkQuantity::Alpha),
            joint.free(ALONG_X, self.a, LinkQuantity::A),
        ];
        if before != Parallel::No {
            elements.push(joint.free(ABOUT_Y, 0.0, LinkQuantity::Beta));
        }
        elements.extend(self.turn_and_shift(joint, before));
        elements
    }

    /// Standard DH with `Rot(z,γ) Trans(z,b)` behind.
    pub fn s_model(&self, joint: &Moving, next: Parallel) -> Vec<Element> {
        let mut elements = self.standard(joint, next);
        elements.push(joint.free(ABOUT_Z, self.gamma, LinkQuantity::Gamma));
        elements.push(joint.free(ALONG_Z, self.b, LinkQuantity::B));
        elements
    }

    /// The joint's own turn and shift, of which one is its variable.
    fn turn_and_shift(&self, joint: &Moving, parallel: Parallel) -> Vec<Element> {
        let d = if parallel == Parallel::InPlaceOfD {
            Element::Fixed(ALONG_Z.by(self.d))
        } else {
            joint.free(ALONG_Z, self.d, LinkQuantity::D)
        };
        let turn = joint.free(ABOUT_Z, self.theta, LinkQuantity::Theta);
        if joint.slides {
            vec![turn, joint.variable(ALONG_Z), d]
        } else {
            vec![turn, joint.variable(ABOUT_Z), d]
        }
    }
}
