//! An arm as JSON: everything that its kinematics need, and no home.

use nalgebra::Isometry3;
use serde::{Deserialize, Serialize};

use super::{Arm, Joint, rows};
use crate::geometry::saved;
use crate::kinematics::{ArmError, Chain, Convention, Element, Motion, Parameter, named};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ArmText {
    model: String,
    #[serde(default = "standard_dh", skip_serializing_if = "is_standard_dh")]
    convention: Convention,
    joints: Vec<Joint>,
    /// Row i gives axis variable i as a linear combination of the reported joint angles.
    axes_from_joints: Vec<Vec<f64>>,
    elements: Vec<Listed>,
}

#[derive(Serialize, Deserialize)]
#[serde(transparent)]
struct Listed(#[serde(with = "ElementText")] Element);

/// A motion is `x`, `y`, `z` (mm) or `rx`, `ry`, `rz` (rad).
#[derive(Serialize, Deserialize)]
#[serde(remote = "Element", deny_unknown_fields, rename_all = "snake_case")]
enum ElementText {
    Fixed(#[serde(with = "saved")] Isometry3<f64>),
    Joint {
        #[serde(with = "named")]
        motion: Motion,
        joint: usize,
        sign: f64,
    },
    Free {
        #[serde(with = "named")]
        motion: Motion,
        nominal: f64,
        #[serde(with = "named")]
        parameter: Parameter,
    },
}

const fn standard_dh() -> Convention {
    Convention::StandardDh
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_standard_dh(convention: &Convention) -> bool {
    *convention == Convention::StandardDh
}

impl From<Arm> for ArmText {
    fn from(arm: Arm) -> Self {
        Self {
            model: arm.model().to_owned(),
            convention: arm.convention(),
            joints: arm.joints().to_vec(),
            axes_from_joints: rows(&arm.axes_from_joints()),
            elements: arm.chain().elements().iter().cloned().map(Listed).collect(),
        }
    }
}

impl TryFrom<ArmText> for Arm {
    type Error = ArmError;

    fn try_from(text: ArmText) -> Result<Self, ArmError> {
        let elements: Vec<Element> = text.elements.into_iter().map(|own| own.0).collect();
        let (joints, moving) = (text.joints.len(), elements.iter().filter_map(Element::joint));
        let found = moving.max().map_or(0, |last| last.saturating_add(1));
        if found != joints {
            return Err(ArmError::Variables { joints, found });
        }
        let chain = Chain::new(elements);
        Self::new(text.model, text.convention, text.joints, &text.axes_from_joints, chain)
    }
}
