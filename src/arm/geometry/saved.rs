//! An isometry (mm) as models are saved: every digit of its origin and its quaternion.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::placement::PlacementError;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SavedPlacement {
    pub xyz_mm: [f64; 3],
    pub quaternion_xyzw: [f64; 4],
}

impl From<&Isometry3<f64>> for SavedPlacement {
    fn from(placement: &Isometry3<f64>) -> Self {
        Self {
            xyz_mm: placement.translation.vector.into(),
            quaternion_xyzw: placement.rotation.coords.into(),
        }
    }
}

impl TryFrom<SavedPlacement> for Isometry3<f64> {
    type Error = PlacementError;

    fn try_from(saved: SavedPlacement) -> Result<Self, PlacementError> {
        let quaternion = Quaternion::from_vector(saved.quaternion_xyzw.into());
        let norm = quaternion.norm();
        if (norm - 1.0).abs() > 1e-9 {
            return Err(PlacementError::NotUnit { norm });
        }
        let rotation = UnitQuaternion::from_quaternion(quaternion);
        Ok(Self::from_parts(Translation3::from(saved.xyz_mm), rotation))
    }
}

pub fn serialize<S: Serializer>(placement: &Isometry3<f64>, to: S) -> Result<S::Ok, S::Error> {
    SavedPlacement::from(placement).serialize(to)
}

pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Isometry3<f64>, D::Error> {
    SavedPlacement::deserialize(from)?.try_into().map_err(D::Error::custom)
}
