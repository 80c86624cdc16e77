use super::*;

const TRACK: &str = r#"
model = "arm on a track"
source = "a drawing"
convention = "urdf"

[[joint]]
name = "track"
kind = "prismatic"
origin = { xyz_mm = [0, 0, 100], euler_deg = [0, 0, 0], euler_order = "fixed-xyz" }
axis = [1, 0, 0]
limits_mm = [0, 3000]

[[joint]]
name = "post"
kind = "fixed"
origin = { xyz_mm = [0, 0, 400], euler_deg = [0, 0, 90], euler_order = "fixed-xyz" }

[[joint]]
name = "shoulder"
origin = { xyz_mm = [50, 0, 0], euler_deg = [90, 0, 0], euler_order = "fixed-xyz" }
axis = [0, 1, 0]
limits_deg = [-180, 180]

[[joint]]
name = "elbow"
kind = "continuous"
origin = { xyz_mm = [0, 600, 0], euler_deg = [0, 0, 0], euler_order = "fixed-xyz" }
axis = [0.6, 0, 0.8]

[[joint]]
name = "parallelogram"
origin = { xyz_mm = [300, 0, 0], euler_deg = [0, 0, 0], euler_order = "fixed-xyz" }
axis = [0.6, 0, 0.8]
mimic = { joint = "elbow", multiplier = -1.0, offset_deg = 30.0 }
"#;

fn file(text: &str) -> RobotFile {
    toml::from_str(text).expect("a robot file")
}

/// The error of the file with a text in another's place.
fn error(from: &str, to: &str) -> String {
    assert!(TRACK.contains(from), "{from}");
    file(&TRACK.replacen(from, to, 1)).arm().expect_err("a fault").to_string()
}

#[test]
fn tracks_passive_and_fixed_joints_are_one_chain() {
    let arm = file(TRACK).arm().expect("an arm");
    let joints = arm.joints();
    let names: Vec<&str> = joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["track", "shoulder", "elbow"]);
    assert!(joints[0].slides && !joints[1].slides);
    assert!((joints[0].upper - 3000.0).abs() < 1e-12);
    // By hand: base, slide, post, then turns about the stated axes; the parallelogram turns back and by 30° more.
    let (slide, shoulder, elbow) = (1200.0, 0.4, -0.7);
    let about = |axis: [f64; 3], angle: f64| {
        let axis = UnitVector3::new_normalize(Vector3::from(axis));
        Isometry3::from_parts(
            nalgebra::Translation3::identity(),
            nalgebra::UnitQuaternion::from_axis_angle(&axis, angle),
        )
    };
    let right = std::f64::consts::FRAC_PI_2;
    let tilted = [0.6, 0.0, 0.8];
    let by_hand = Isometry3::translation(slide, 0.0, 100.0)
        * Isometry3::translation(0.0, 0.0, 400.0)
        * about([0.0, 0.0, 1.0], right)
        * Isometry3::translation(50.0, 0.0, 0.0)
        * about([1.0, 0.0, 0.0], right)
        * about([0.0, 1.0, 0.0], shoulder)
        * Isometry3::translation(0.0, 600.0, 0.0)
        * about(tilted, elbow)
        * Isometry3::translation(300.0, 0.0, 0.0)
        * about(tilted, -elbow + 30.0_f64.to_radians());
    let flange = *arm.flange(&[slide, shoulder, elbow]).isometry();
    let apart = (flange.to_homogeneous() - by_hand.to_homogeneous()).abs().max();
    assert!(apart < 1e-10, "{apart:e}");
    // The elbow's own twist is that of both its joints: the numerical derivative says so.
    let offsets = arm.no_offsets();
    let at = arm.chain().differential(&[slide, shoulder, elbow], &offsets);
    let step = 1e-6;
    let ahead = arm.flange(&[slide, shoulder, elbow + step]);
    let slope = (ahead.isometry().translation.vector - flange.translation.vector) / step;
    assert!((slope - at.joints[2].linear).norm() < 1e-3);
}

#[test]
fn a_fault_names_joint_key_and_remedy() {
    let told = error("limits_mm = [0, 3000]", "limits_deg = [0, 30]");
    assert_eq!(
        told,
        "joint \"track\", convention \"urdf\": needs limits_mm and has limits_deg, which nothing reads there"
    );
    let told = error("joint = \"elbow\"", "joint = \"post\"");
    assert!(told.contains("\"parallelogram\" follows \"post\""), "{told}");
    let told = error("axis = [1, 0, 0]", "axis = [0, 0, 0]");
    assert!(told.contains("\"track\": axis = [0.0, 0.0, 0.0] has no direction"), "{told}");
    let told = error("offset_deg = 30.0", "offset_deg = 1.5708");
    assert!(told.contains("1.5708 is 90° in radians"), "{told}");
    let told = error("limits_deg = [-180, 180]", "limits_deg = [-3.1416, 3.1416]");
    assert!(told.contains("\"shoulder\": limits_deg = -3.1416 is -180° in radians"), "{told}");
}

#[test]
fn an_arm_in_metres_is_named() {
    let mut metres = file(TRACK);
    for joint in &mut metres.joint {
        if let Some(origin) = &mut joint.origin {
            origin.xyz_mm = origin.xyz_mm.map(|length| length / 1000.0);
        }
    }
    let told = metres.arm().expect_err("metres").to_string();
    assert!(told.contains("joint \"elbow\"") && told.contains("origin.xyz_mm = 0.6"), "{told}");
}

#[test]
fn a_file_without_joints_that_move_is_no_arm() {
    let mut still = file(TRACK);
    for joint in &mut still.joint {
        joint.kind = JointKind::Fixed;
    }
    assert!(matches!(still.arm(), Err(ArmError::JointCount { found: 0 })));
}
