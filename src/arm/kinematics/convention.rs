//! Conventions that a robot file may be written in, each a way to state the constant link between two joints.
//!
//! Every convention becomes elementary motions of one chain ([`super::chain`]): what is stated is a motion's nominal amount, and
//! what may be wrong with the arm is a free parameter of the motion. Which directions belong to the arm and which only to the
//! convention follows from the rank of the fit, not from the convention. Sources and formulas: `posegrid::method::kinematics`.
//!
//! - `table`: four or six numbers a joint: standard and modified DH, Hayati's β, Stone's S-model.
//! - `lines`: the joints' axes as lines: CPC, product of exponentials, URDF.

use serde::{Deserialize, Serialize};

use super::chain::Element;
use super::motion::Motion;
use super::parameter::{LinkQuantity, Parameter};

pub(super) mod lines;
pub(super) mod table;

/// Conventions a robot file may be written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Convention {
    /// Standard (distal) Denavit–Hartenberg: `Rot(z,θ) Trans(z,d) Trans(x,a) Rot(x,α)`; Hayati's `Rot(y,β)` in place of d
    /// where the next axis is parallel.
    StandardDh,
    /// Standard DH whose every d stays free beside β: the 25 parameters of the literature's MD-H on a six-axis arm with one
    /// pair of parallel axes.
    MdH,
    /// Modified (proximal) DH of Craig: `Rot(x,α) Trans(x,a) Rot(z,θ) Trans(z,d)`; Hayati's `Rot(y,β)` in place of d where
    /// the axis before is parallel.
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
    /// Every convention.
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

    /// The convention's word in robot files.
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

    /// The convention's name in sentences.
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

    /// The convention with this word; `None` when no convention has it.
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|convention| convention.word() == word)
    }
}

/// A joint that moves, as the elements of its link need it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moving {
    /// The joint's number in parameters, from 1: that of its axis variable, or one after those for a joint that follows.
    pub(super) number: usize,
    /// Index of the axis variable that moves it, from 0.
    pub(super) variable: usize,
    /// Its motion per unit of that variable.
    pub(super) factor: f64,
    /// Whether it slides along its axis instead of turning about it.
    pub(super) slides: bool,
    /// Its motion where that variable is zero, rad or mm.
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
