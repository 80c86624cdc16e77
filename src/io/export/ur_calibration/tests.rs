use super::*;
use crate::geometry::Placement;
use crate::kinematics::RobotFile;

/// A ready robot whose base is turned about z.
fn robot(name: &str, turned_rad: f64) -> Arm {
    let path = format!("../../pipelines/robots/{name}");
    let text = std::fs::read_to_string(path).unwrap();
    let mut file = toml::from_str::<RobotFile>(&text).unwrap();
    file.base = Some(Placement::of(&isometry_from_rpy([0.0; 3], [0.0, 0.0, turned_rad])));
    file.arm().unwrap()
}

#[test]
fn every_ready_ur_has_the_six_frames_of_its_description() {
    let mut seen = 0;
    for entry in std::fs::read_dir("../../pipelines/robots").unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if !name.starts_with("ur") {
            continue;
        }
        seen += 1;
        let q = [0.3, -1.1, 1.7, -0.4, 0.9, -2.2];
        // The controller's base, and `base_link` of the description.
        for turned_rad in [0.0, PI] {
            let arm = robot(&name, turned_rad);
            let chain = chain(&arm).unwrap();
            let base = chain[0].origin;
            let flange = chain[1..].iter().zip(q).fold(base, |frame, (joint, q)| {
                frame * joint.origin * isometry_from_rpy([0.0; 3], [0.0, 0.0, q])
            });
            let apart = flange.to_homogeneous() - arm.flange(&q).isometry().to_homogeneous();
            assert!(apart.abs().max() < 1e-9, "{name}: {apart}");
            assert!(chain[3].origin.translation.x < 0.0, "{name}");
        }
    }
    assert!(seen >= 10, "{seen}");
}

#[test]
fn lengths_of_a_ur30_are_those_of_its_published_file() {
    // config/ur30/default_kinematics.yaml of Universal_Robots_ROS2_Description, in mm.
    let published = [
        [0.0, 0.0, 236.3],
        [0.0, 0.0, 0.0],
        [-637.0, 0.0, 0.0],
        [-503.7, 0.0, 201.0],
        [0.0, -159.3, 0.0],
        [0.0, 154.3, 0.0],
    ];
    for (joint, xyz) in chain(&robot("ur30.toml", 0.0)).unwrap()[1..].iter().zip(published) {
        let apart = joint.origin.translation.vector - nalgebra::Vector3::from(xyz);
        assert!(apart.norm() < 1e-9, "{}: {apart}", joint.name);
    }
}
