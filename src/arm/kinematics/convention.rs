//! Conventions of a robot file: each becomes elementary motions of one chain ([`super::chain`]), whose nominal amounts
//! are stated and whose free parameters may be wrong. Which directions belong to the arm follows from the rank of the
//! fit, not from the convention. Formulas: `posegrid::method::kinematics`.

use serde::{Deserialize, Serialize};

use super::chain::Element;
use super::motion::Motion;
use super::parameter::{LinkQuantity, Parameter};

pub(super) mod lines;
pub(super) mod table;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Convention {
    /// Standard (distal) Denavit–Hartenberg: `Rot(z,θ) Trans(z,d) Trans(x,a) Rot(x,α)`; Hayati's `Rot(y,β)` in place of
    /// d where the next axis is parallel.
    StandardDh,
    /// Standard DH whose every d stays free beside β: the 25 parameters of the literature's MD-H on a six-axis arm with
    /// one pair of parallel axes.
    MdH,
    /// Modified (proximal) DH of Craig: `Rot(x,α) Trans(x,a) Rot(z,θ) Trans(z,d)`; Hayati's `Rot(y,β)` in place of d
    /// where the axis before is parallel.
    ModifiedDh,
    /// Stone's S-model: standard DH with `Rot(z,γ) Trans(z,b)` behind, six numbers a link.
    SModel,
    /// Zhuang and Roth's complete and parametrically continuous model: the next axis' direction, a turn γ and a shift.
    Cpc,
    /// Product of exponentials: the axes as lines in the base frame at zero, and the flange there.
    Poe,
    /// Product of exponentials with the least parameters: an axis' line alone.
    MinimalPoe,
    /// An origin in the frame of the joint before, and an axis, as in a URDF.
    Urdf,
}

impl Convention {
    pub const ALL: [Self; 8] = [
        Self::StandardDh,
        Self::MdH,
        Self::ModifiedDh,
        Self::SModel,
        Self::Cpc,
        Self::Poe,
        Self::MinimalPoe,
        Self::Urdf,
    ];

    pub const fn word(self) -> &'static str {
        match self {
            Self::StandardDh => "standard-dh",
            Self::MdH => "md-h",
            Self::ModifiedDh => "modified-dh",
            Self::SModel => "s-model",
            Self::Cpc => "cpc",
            Self::Poe => "poe",
            Self::MinimalPoe => "minimal-poe",
            Self::Urdf => "urdf",
        }
    }

    pub const fn name(self) -> &'static str {
        match self {
            Self::StandardDh => "standard DH",
            Self::MdH => "standard DH with every d free (MD-H)",
            Self::ModifiedDh => "modified DH",
            Self::SModel => "S-model",
            Self::Cpc => "CPC",
            Self::Poe => "product of exponentials",
            Self::MinimalPoe => "minimal product of exponentials",
            Self::Urdf => "URDF",
        }
    }

    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|convention| convention.word() == word)
    }
}

#[derive(Debug, Clone, Copy)]
pub(super) struct Moving {
    /// The joint's number in parameters, from 1: that of its axis variable, or one after those where it follows.
    pub(super) number: usize,
    pub(super) variable: usize,
    pub(super) factor: f64,
    pub(super) slides: bool,
    pub(super) shift: f64,
}

impl Moving {
    const fn variable(&self, motion: Motion) -> Element {
        Element::Joint { motion, joint: self.variable, sign: self.factor }
    }

    const fn free(&self, motion: Motion, nominal: f64, quantity: LinkQuantity) -> Element {
        Element::Free {
            motion,
            nominal,
            parameter: Parameter::Link { joint: self.number, quantity },
        }
    }
}
