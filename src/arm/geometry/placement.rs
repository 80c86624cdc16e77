//! A rigid placement as a pipeline file states it: translation in mm and a rotation whose convention is named.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    pub xyz_mm: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quaternion_xyzw: Option<[f64; 4]>,
    /// Rotation as three angles, degrees; `euler_order` names their axes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler_deg: Option<[f64; 3]>,
    /// The axes of the three angles, in order; it has no default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub euler_order: Option<EulerOrder>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum EulerOrder {
    /// Roll, pitch, yaw about the fixed x, y, z axes (URDF, Fanuc W P R).
    FixedXyz,
    /// A, B, C about the moving z, y, x axes (KUKA).
    MovingZyx,
    /// About the moving z, y, z axes (Kawasaki O A T).
    MovingZyz,
}

#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlacementError {
    #[error(
        "euler_deg needs euler_order, which has no default: \"fixed-xyz\" (URDF roll pitch yaw, Fanuc), \
         \"moving-zyx\" (KUKA A B C) or \"moving-zyz\" (Kawasaki O A T)"
    )]
    NoOrder,
    #[error(
        "a placement states its rotation once: either quaternion_xyzw, or euler_deg with euler_order"
    )]
    OneRotation,
    #[error("quaternion_xyzw has norm {norm}; a rotation has norm 1")]
    NotUnit { norm: f64 },
}

impl Placement {
    pub fn isometry(&self) -> Result<Isometry3<f64>, PlacementError> {
        Ok(Isometry3::from_parts(Translation3::from(self.xyz_mm), self.rotation()?))
    }

    pub fn of(isometry: &Isometry3<f64>) -> Self {
        Self {
            // No negative zero.
            xyz_mm: isometry.translation.vector.map(|x| x + 0.0).into(),
            quaternion_xyzw: Some(isometry.rotation.coords.map(|x| x + 0.0).into()),
            euler_deg: None,
            euler_order: None,
        }
    }

    /// Placements with these numbers under the other conventions they may have been written in, each with its words:
    /// another order, radians, scalar first. Those that make no rotation are left out.
    pub fn other_conventions(&self) -> Vec<(String, Isometry3<f64>)> {
        let mut all = Vec::new();
        let mut add = |words: String, placement: Self| {
            if let Ok(isometry) = placement.isometry() {
                all.push((words, isometry));
            }
        };
        if let Some([x, y, z, w]) = self.quaternion_xyzw {
            let scalar_first = Self { quaternion_xyzw: Some([y, z, w, x]), ..*self };
            add("the quaternion as w x y z".to_owned(), scalar_first);
        }
        if let (Some(angles), Some(order)) = (self.euler_deg, self.euler_order) {
            for other in EulerOrder::ALL.into_iter().filter(|&other| other != order) {
                let words = format!("euler_order = \"{}\"", other.name());
                add(words, Self { euler_order: Some(other), ..*self });
            }
            let degrees = Some(angles.map(f64::to_degrees));
            add("the angles in radians".to_owned(), Self { euler_deg: degrees, ..*self });
        }
        all
    }

    fn rotation(&self) -> Result<UnitQuaternion<f64>, PlacementError> {
        match (self.quaternion_xyzw, self.euler_deg, self.euler_order) {
            (Some([x, y, z, w]), None, None) => {
                let quaternion = Quaternion::new(w, x, y, z);
                let norm = quaternion.norm();
                let is_unit = (norm - 1.0).abs() < 1e-3;
                is_unit
                    .then(|| UnitQuaternion::from_quaternion(quaternion))
                    .ok_or(PlacementError::NotUnit { norm })
            }
            (None, Some(degrees), Some(order)) => Ok(order.rotation(degrees.map(f64::to_radians))),
            (None, Some(_), None) => Err(PlacementError::NoOrder),
            _ => Err(PlacementError::OneRotation),
        }
    }
}

impl EulerOrder {
    pub const ALL: [Self; 3] = [Self::FixedXyz, Self::MovingZyx, Self::MovingZyz];

    pub const fn name(self) -> &'static str {
        match self {
            Self::FixedXyz => "fixed-xyz",
            Self::MovingZyx => "moving-zyx",
            Self::MovingZyz => "moving-zyz",
        }
    }

    fn rotation(self, [a, b, c]: [f64; 3]) -> UnitQuaternion<f64> {
        let about = |axis: nalgebra::Unit<Vector3<f64>>, angle| {
            UnitQuaternion::from_axis_angle(&axis, angle)
        };
        let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
        match self {
            Self::FixedXyz => about(z, c) * about(y, b) * about(x, a),
            Self::MovingZyx => about(z, a) * about(y, b) * about(x, c),
            Self::MovingZyz => about(z, a) * about(y, b) * about(z, c),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(euler_deg: [f64; 3], euler_order: Option<EulerOrder>) -> Placement {
        Placement {
            xyz_mm: [1.0, 2.0, 3.0],
            quaternion_xyzw: None,
            euler_deg: Some(euler_deg),
            euler_order,
        }
    }

    #[test]
    fn kuka_and_urdf_angles_state_the_same_rotation_in_reverse_order() {
        let kuka =
            turned([30.0, 20.0, 10.0], Some(EulerOrder::MovingZyx)).isometry().expect("complete");
        let urdf =
            turned([10.0, 20.0, 30.0], Some(EulerOrder::FixedXyz)).isometry().expect("complete");
        assert!(kuka.rotation.angle_to(&urdf.rotation) < 1e-12);
    }

    #[test]
    fn angles_without_an_order_are_refused_with_the_choices() {
        let error = turned([0.0; 3], None).isometry().expect_err("no order");
        assert!(error.to_string().contains("moving-zyx"));
    }
}
