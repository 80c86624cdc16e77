use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Three axes that angles turn about one after another, fixed or moving with the body: `fixed-xyz`, `moving-zyz`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct RotationOrder {
    moving: bool,
    axes: [usize; 3],
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "{0:?} is no order of axes: write fixed- or moving- and three axes, no two neighbours alike: \"fixed-xyz\" (URDF roll pitch yaw, \
     Fanuc W P R), \"moving-zyx\" (KUKA A B C), \"moving-xyz\", \"moving-zyz\" (Kawasaki O A T)"
)]
pub struct NoOrder(String);

const AXES: [char; 3] = ['x', 'y', 'z'];

impl RotationOrder {
    pub fn all() -> impl Iterator<Item = Self> {
        let axes = (0..27).map(|number| [number / 9, number / 3 % 3, number % 3]);
        let axes = axes.filter(|[a, b, c]| a != b && b != c);
        axes.flat_map(|axes| [false, true].map(|moving| Self { moving, axes }))
    }

    /// The rotation by these angles, rad, in the order of the axes.
    pub fn rotation(self, angles: [f64; 3]) -> UnitQuaternion<f64> {
        let turns = self.axes.iter().zip(angles).map(|(&axis, angle)| {
            let mut about = Vector3::zeros();
            about[axis] = angle;
            UnitQuaternion::from_scaled_axis(about)
        });
        turns.fold(UnitQuaternion::identity(), |so_far, turn| {
            if self.moving { so_far * turn } else { turn * so_far }
        })
    }

    /// Angles, rad, that make a rotation: the middle one within −90° to 90°, where the first axis is the last too within 0° to 180°.
    pub fn angles(self, rotation: &UnitQuaternion<f64>) -> [f64; 3] {
        let turn = rotation.to_rotation_matrix();
        let [mut i, j, mut last] = self.axes;
        // About fixed axes the same turns follow each other the other way round.
        if !self.moving {
            std::mem::swap(&mut i, &mut last);
        }
        let k = 3 - i - j;
        let sign = if (i + 1) % 3 == j { 1.0 } else { -1.0 };
        let [a, b, c] = if i == last {
            let middle = turn[(j, i)].hypot(turn[(k, i)]).atan2(turn[(i, i)]);
            let first = turn[(j, i)].atan2(-sign * turn[(k, i)]);
            [first, middle, turn[(i, j)].atan2(sign * turn[(i, k)])]
        } else {
            let middle = (sign * turn[(i, k)]).atan2(turn[(i, i)].hypot(turn[(i, j)]));
            let first = (-sign * turn[(j, k)]).atan2(turn[(k, k)]);
            [first, middle, (-sign * turn[(i, j)]).atan2(turn[(i, i)])]
        };
        if self.moving { [a, b, c] } else { [c, b, a] }
    }
}

impl TryFrom<String> for RotationOrder {
    type Error = NoOrder;
    fn try_from(word: String) -> Result<Self, NoOrder> {
        Self::all().find(|order| String::from(*order) == word).ok_or(NoOrder(word))
    }
}

impl From<RotationOrder> for String {
    fn from(order: RotationOrder) -> Self {
        let frame = if order.moving { "moving" } else { "fixed" };
        format!("{frame}-{}", order.axes.iter().map(|&axis| AXES[axis]).collect::<Self>())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angles_of_a_rotation_make_it_again() {
        for order in RotationOrder::all() {
            let middle = if order.axes[0] == order.axes[2] { 1.9 } else { -1.2 };
            let angles = [2.5, middle, -0.4];
            let found = order.angles(&order.rotation(angles));
            for (found, angle) in found.iter().zip(angles) {
                assert!((found - angle).abs() < 1e-12, "{order:?}: {found} {angle}");
            }
        }
    }

    fn order(word: &str) -> RotationOrder {
        RotationOrder::try_from(word.to_owned()).expect("an order")
    }

    #[test]
    fn there_are_twenty_four_orders_and_each_is_read_back() {
        let words: Vec<String> = RotationOrder::all().map(String::from).collect();
        assert_eq!(words.len(), 24);
        for word in &words {
            assert_eq!(&String::from(order(word)), word);
        }
        let told = RotationOrder::try_from("xyz".to_owned()).unwrap_err();
        assert!(told.to_string().contains("moving-zyx"), "{told}");
    }

    #[test]
    fn fixed_axes_are_moving_ones_in_reverse() {
        let fixed = order("fixed-xyz").rotation([0.1, 0.2, 0.3]);
        let moving = order("moving-zyx").rotation([0.3, 0.2, 0.1]);
        assert!(fixed.angle_to(&moving) < 1e-15);
        // Roll, pitch and yaw as nalgebra has them.
        let usual = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
        assert!(fixed.angle_to(&usual) < 1e-15);
    }

    #[test]
    fn an_order_that_placements_know_means_what_it_means_there() {
        for own in crate::geometry::EulerOrder::ALL {
            let placement = crate::geometry::Placement {
                xyz_mm: [0.0; 3],
                quaternion_xyzw: None,
                euler_deg: Some([20.0, -35.0, 50.0]),
                euler_order: Some(own),
            };
            let angles = [20.0_f64, -35.0, 50.0].map(f64::to_radians);
            let turned = order(own.name()).rotation(angles);
            assert!(placement.isometry().unwrap().rotation.angle_to(&turned) < 1e-14);
        }
    }
}
