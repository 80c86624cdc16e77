//! The calibration file of a Universal Robots arm, as its ROS driver extracts it from the controller → a [`RobotFile`].
//!
//! `kinematics` places the frame of each of the six joints in the one before, m and rad, each joint about z; the first stands in
//! the controller's base, and the last is the flange, `tool0`.

use std::path::Path;

use super::urdf::{mm, printable};
use crate::geometry::{EulerOrder, Placement};
use crate::kinematics::{Convention, JointFile, RobotFile};
use crate::measured_table::{self, Cell};

/// Names of the links that the file places, each with the joint that carries it.
const LINKS: [[&str; 2]; 6] = [
    ["shoulder", "shoulder_pan_joint"],
    ["upper_arm", "shoulder_lift_joint"],
    ["forearm", "elbow_joint"],
    ["wrist_1", "wrist_1_joint"],
    ["wrist_2", "wrist_2_joint"],
    ["wrist_3", "wrist_3_joint"],
];

pub(super) fn read(path: &Path, text: &str) -> Result<RobotFile, String> {
    let table = measured_table::of_yaml(text).map_err(|fault| fault.to_string())?;
    let cell = |name: &str| table.column(name).map(|column| table.cell(0, column));
    let number = |link: &str, key: &str| match cell(&format!("{link}.{key}")) {
        // No link of a UR is longer than 50 m, nor turned by more than two turns.
        Some(Cell::Number(number)) if number.abs() < 50.0 => Ok(number),
        _ => Err(format!(
            "kinematics: {link}: {key} is no number in m or rad; YAML is read as the calibration file of a Universal Robots arm, as \
             ur_calibration writes it: give that, a URDF or TOML"
        )),
    };
    let joint = |[link, name]: [&str; 2]| {
        let three = |keys: [&str; 3]| -> Result<[f64; 3], String> {
            let [a, b, c] = keys.map(|key| number(link, key));
            Ok([a?, b?, c?])
        };
        let angles = three(["roll", "pitch", "yaw"])?;
        Ok(JointFile {
            name: name.to_owned(),
            origin: Some(Placement {
                xyz_mm: three(["x", "y", "z"])?.map(mm),
                quaternion_xyzw: None,
                euler_deg: Some(angles.map(f64::to_degrees)),
                euler_order: Some(EulerOrder::FixedXyz),
            }),
            axis: Some([0.0, 0.0, 1.0]),
            limits_deg: Some([-360.0, 360.0]),
            ..JointFile::default()
        })
    };
    let hash = match cell("hash") {
        Some(Cell::Text(hash)) => format!(", {}", printable(hash)),
        _ => String::new(),
    };
    let file = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(RobotFile {
        model: format!("Universal Robots arm with its factory calibration{hash}"),
        source: format!("calibration file of a UR {file:?}{hash}"),
        convention: Convention::Urdf,
        home_deg: None,
        joint_map: None,
        base: None,
        flange: None,
        joint: LINKS.map(joint).into_iter().collect::<Result<_, String>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A UR10 without errors of its links; angles and lengths of the nominal arm.
    fn text() -> String {
        let half = std::f64::consts::FRAC_PI_2;
        let frames = [
            ("shoulder", [0.0, 0.0, 0.1273], 0.0),
            ("upper_arm", [0.0; 3], half),
            ("forearm", [-0.612, 0.0, 0.0], 0.0),
            ("wrist_1", [-0.5723, 0.0, 0.163_941], 0.0),
            ("wrist_2", [0.0, -0.1157, 0.0], half),
            ("wrist_3", [0.0, 0.0922, 0.0], -half),
        ];
        let link = |(name, [x, y, z], roll): (&str, [f64; 3], f64)| {
            format!(
                "  {name}:\n    x: {x}\n    y: {y}\n    z: {z}\n    roll: {roll}\n    pitch: 0\n    yaw: 0\n"
            )
        };
        let links: String = frames.into_iter().map(link).collect();
        format!("kinematics:\n{links}  hash: calib_12\n")
    }

    #[test]
    fn the_calibration_of_a_nominal_arm_is_the_nominal_arm() {
        let file = read(Path::new("my/ur.yaml"), &text()).unwrap();
        assert_eq!(file.source, "calibration file of a UR \"ur.yaml\", calib_12");
        let ready = super::super::ready::ReadyRobot::find("ur10").unwrap();
        let ready: RobotFile = toml::from_str(ready.text).unwrap();
        let joints = [0.3, -1.2, 1.4, -0.7, 0.9, 2.0];
        let [own, nominal] =
            [&file, &ready].map(|file| *file.arm().unwrap().flange(&joints).isometry());
        let off = own.inverse() * nominal;
        assert!(off.translation.vector.norm() < 1e-6 && off.rotation.angle() < 1e-9, "{off}");
    }

    #[test]
    fn other_yaml_is_refused() {
        let refused = read(Path::new("a.yaml"), "a: 1\n").unwrap_err();
        assert!(
            refused.starts_with("kinematics: shoulder: ") && refused.contains("ur_calibration")
        );
        assert!(read(Path::new("a.yaml"), &text().replace("0.1273", "127.3")).is_err());
    }
}
