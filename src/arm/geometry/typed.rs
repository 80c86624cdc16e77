use nalgebra::Isometry3;

use super::rpy;
use crate::units::MM_PER_M;

pub type Typed = (&'static str, String);

/// The frame at `isometry` (mm) as KUKA, UR and ABB take it, and as a matrix.
pub fn forms(isometry: &Isometry3<f64>) -> [Typed; 4] {
    [
        ("KUKA, mm and degrees", kuka(isometry)),
        ("UR pose, m and rad", ur(isometry)),
        ("ABB pose, mm and q1 to q4", abb(isometry)),
        ("matrix, rows, mm", matrix(isometry)),
    ]
}

/// `{X …, Y …, Z …, A …, B …, C …}`: A, B and C about the moving z, y and x axes, degrees.
fn kuka(isometry: &Isometry3<f64>) -> String {
    let at = isometry.translation.vector;
    let [c, b, a] = rpy(&isometry.rotation);
    let [a, b, c] = [a, b, c].map(f64::to_degrees);
    let [x, y, z] = [at.x, at.y, at.z].map(mm);
    let [a, b, c] = [a, b, c].map(|angle| number(angle, 5));
    format!("{{X {x}, Y {y}, Z {z}, A {a}, B {b}, C {c}}}")
}

/// `p[x, y, z, rx, ry, rz]`: m, and a rotation vector, rad.
fn ur(isometry: &Isometry3<f64>) -> String {
    let at = (isometry.translation.vector / MM_PER_M).data.0[0].map(|m| number(m, 6));
    let turn = isometry.rotation.scaled_axis().data.0[0].map(|rad| number(rad, 8));
    format!("p[{}, {}]", at.join(", "), turn.join(", "))
}

/// `[[x, y, z], [q1, q2, q3, q4]]`: mm, and a unit quaternion with its real part first.
fn abb(isometry: &Isometry3<f64>) -> String {
    let at = isometry.translation.vector.data.0[0].map(mm);
    let q = isometry.rotation.quaternion();
    // A controller takes either sign; the real part is not negative, so that one frame has one form.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    let q = [q.w, q.i, q.j, q.k].map(|part| number(sign * part, 8));
    format!("[[{}], [{}]]", at.join(", "), q.join(", "))
}

fn matrix(isometry: &Isometry3<f64>) -> String {
    let matrix = isometry.to_homogeneous();
    let row = |row: usize| {
        let turn = (0..3).map(|column| number(matrix[(row, column)], 8));
        let at = if row < 3 { mm(matrix[(row, 3)]) } else { "1".to_owned() };
        format!("[{}, {at}]", turn.collect::<Vec<_>>().join(", "))
    };
    format!("[{}]", (0..4).map(row).collect::<Vec<_>>().join(", "))
}

fn mm(value: f64) -> String {
    number(value, 3)
}

/// A number with a given count of decimals, without a negative zero.
pub fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    let is_zero = text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.'));
    if is_zero { text.replace('-', "") } else { text }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    use super::*;
    use crate::geometry::{EulerOrder, Placement};

    /// A frame turned by 30°, 20° and 10° about the moving z, y and x axes.
    fn frame() -> Isometry3<f64> {
        let placement = Placement {
            xyz_mm: [4200.5, -900.0, -650.25],
            quaternion_xyzw: None,
            euler_deg: Some([30.0, 20.0, 10.0]),
            euler_order: Some(EulerOrder::MovingZyx),
        };
        placement.isometry().expect("complete")
    }

    #[test]
    fn kuka_gets_back_the_angles_that_were_typed() {
        let wanted = "{X 4200.500, Y -900.000, Z -650.250, A 30.00000, B 20.00000, C 10.00000}";
        assert_eq!(forms(&frame())[0].1, wanted);
    }

    #[test]
    fn a_quarter_turn_about_z_reads_as_each_controller_has_it() {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        let forms = forms(&Isometry3::from_parts(Translation3::new(1.0, 2.0, 3.0), turn));
        let texts = forms.map(|(_, text)| text);
        let wanted = [
            "{X 1.000, Y 2.000, Z 3.000, A 90.00000, B 0.00000, C 0.00000}",
            "p[0.001000, 0.002000, 0.003000, 0.00000000, 0.00000000, 1.57079633]",
            "[[1.000, 2.000, 3.000], [0.70710678, 0.00000000, 0.00000000, 0.70710678]]",
            "[[0.00000000, -1.00000000, 0.00000000, 1.000], [1.00000000, 0.00000000, 0.00000000, 2.000], \
             [0.00000000, 0.00000000, 1.00000000, 3.000], [0.00000000, 0.00000000, 0.00000000, 1]]",
        ];
        assert_eq!(texts, wanted);
    }
}
