use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use crate::kinematics::JointKind;

/// A lift, an arm of two joints with a passive one between, and a finger beside it.
const URDF: &str = r#"<?xml version="1.0"?>
<robot name="lifted" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <link name="base"><visual/><inertial/></link>
  <link name="carriage"/>
  <link name="upper"/>
  <link name="middle"/>
  <link name="lower"/>
  <link name="tool"/>
  <link name="finger"/>
  <joint name="lift" type="prismatic">
    <parent link="base"/> <child link="carriage"/>
    <origin xyz="0.1 0 0.5"/>
    <axis xyz="0 0 2"/>
    <limit lower="0" upper="0.3"/>
  </joint>
  <joint name="shoulder" type="revolute">
    <parent link="carriage"/> <child link="upper"/>
    <origin xyz="0 0 0.089159" rpy="0 1.5707963267948966 0"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1.5" upper="1.5" effort="1" velocity="1"/>
  </joint>
  <joint name="passive" type="revolute">
    <mimic joint="shoulder" multiplier="-0.5" offset="0.25"/>
    <parent link="upper"/> <child link="middle"/>
    <origin xyz="0.4 0 0" rpy="0.1 -0.2 0.3"/>
    <axis xyz="0.6 0 0.8"/>
    <limit lower="-1.5" upper="1.5"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="middle"/> <child link="lower"/>
    <origin xyz="0.35 0.02 0"/>
    <limit effort="1" velocity="1"/>
  </joint>
  <joint name="flange" type="fixed">
    <parent link="lower"/> <child link="tool"/>
    <origin xyz="0 0 0.1" rpy="0.5 0 0"/>
  </joint>
  <joint name="finger_joint" type="floating">
    <parent link="tool"/> <child link="finger"/>
  </joint>
  <transmission name="t"><joint name="not_a_joint"/></transmission>
</robot>
"#;

fn ends(base: &str, tip: &str) -> Selection {
    Selection { base: Some(base.to_owned()), tip: Some(tip.to_owned()), joints: None }
}

fn of(text: &str, selection: &Selection) -> Result<(RobotFile, LeftOut), Box<UrdfError>> {
    read(Path::new("a/lifted.urdf"), text, selection)
}

fn told(text: &str, selection: &Selection) -> String {
    match of(text, selection) {
        Ok((file, _)) => panic!("read: {file:?}"),
        Err(error) => error.to_string(),
    }
}

/// The fault of the sample with a change, from base to tool.
fn changed(from: &str, to: &str) -> String {
    assert!(URDF.contains(from), "{from}");
    told(&URDF.replacen(from, to, 1), &ends("base", "tool"))
}

fn about(axis: [f64; 3], angle: f64) -> Isometry3<f64> {
    let axis = nalgebra::Unit::new_normalize(Vector3::from(axis));
    Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&axis, angle))
}

fn at(x: f64, y: f64, z: f64) -> Isometry3<f64> {
    Translation3::new(x, y, z).into()
}

/// Fixed axes x, y, z by roll, pitch and yaw.
fn rpy(roll: f64, pitch: f64, yaw: f64) -> Isometry3<f64> {
    about([0.0, 0.0, 1.0], yaw) * about([0.0, 1.0, 0.0], pitch) * about([1.0, 0.0, 0.0], roll)
}

#[test]
fn a_chain_is_the_product_of_origins_and_motions() {
    let (file, left_out) = of(URDF, &ends("base", "tool")).unwrap();
    let arm = file.arm().unwrap();
    let names: Vec<&str> = arm.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["lift", "shoulder", "elbow"], "those that are driven");
    let (lift, shoulder, elbow) = (120.0, 0.7, -0.4);
    let expected = at(100.0, 0.0, 500.0)
        * at(0.0, 0.0, lift)
        * at(0.0, 0.0, 89.159)
        * rpy(0.0, std::f64::consts::FRAC_PI_2, 0.0)
        * about([0.0, 0.0, 1.0], shoulder)
        * at(400.0, 0.0, 0.0)
        * rpy(0.1, -0.2, 0.3)
        * about([0.6, 0.0, 0.8], -0.5 * shoulder + 0.25)
        * at(350.0, 20.0, 0.0)
        * about([1.0, 0.0, 0.0], elbow)
        * at(0.0, 0.0, 100.0)
        * rpy(0.5, 0.0, 0.0);
    let found = *arm.flange(&[lift, shoulder, elbow]).isometry();
    assert!((found.translation.vector - expected.translation.vector).norm() < 1e-9);
    assert!(found.rotation.angle_to(&expected.rotation) < 1e-12);
    let xyz_mm = file.joint[1].origin.unwrap().xyz_mm;
    assert_eq!(format!("{xyz_mm:?}"), "[0.0, 0.0, 89.159]", "no digit made up");
    assert_eq!(file.joint[0].limits_mm, Some([0.0, 300.0]));
    assert_eq!(file.joint[3].kind, JointKind::Continuous, "it states no limits");
    assert_eq!(
        left_out,
        LeftOut {
            base: "base".to_owned(),
            tip: "tool".to_owned(),
            elements: vec![("inertial", 1), ("visual", 1), ("transmission", 1)],
            joints: 1,
            remarks: vec![
                "joint \"elbow\" states no limits (line 29) and was taken for one that turns without"
                    .to_owned()
            ],
        }
    );
}

#[test]
fn a_chain_with_right_angles_but_for_rounding_is_one_arm_in_every_convention() {
    // Axes along −z and a flange with a pitch of 90°, each with the digits that a URDF has of π.
    let text = URDF
        .replace("rpy=\"0.1 -0.2 0.3\"", "rpy=\"3.14159265358979 0 0.3\"")
        .replace("<axis xyz=\"0.6 0 0.8\"/>", "<axis xyz=\"0 0 1\"/>")
        .replace("rpy=\"0.5 0 0\"", "rpy=\"0.5 1.5707963268 0.2\"");
    let file = of(&text, &ends("base", "tool")).unwrap().0;
    let arm = file.arm().unwrap();
    for convention in crate::kinematics::Convention::ALL {
        let restated = file.restated(convention).unwrap().arm().unwrap();
        for q in [[0.0, 0.0, 0.0], [250.0, 1.1, -0.6], [10.0, -0.9, 2.0]] {
            let (one, other) = (*arm.flange(&q).isometry(), *restated.flange(&q).isometry());
            let apart = (one.translation.vector - other.translation.vector).norm();
            assert!(apart < 1e-9, "{convention:?}: {apart} mm");
            let turned = one.rotation.angle_to(&other.rotation);
            assert!(turned < 1e-11, "{convention:?}: {turned} rad");
        }
    }
}

#[test]
fn a_chain_that_goes_up_is_the_inverse() {
    let down = of(URDF, &ends("base", "tool")).unwrap().0.arm().unwrap();
    let up = of(URDF, &ends("tool", "base")).unwrap().0.arm().unwrap();
    let names: Vec<&str> = up.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["elbow", "shoulder", "lift"]);
    for (lift, shoulder, elbow) in [(0.0, 0.0, 0.0), (250.0, 1.1, -0.6), (10.0, -0.9, 2.0)] {
        let there = *down.flange(&[lift, shoulder, elbow]).isometry();
        let back = *up.flange(&[elbow, shoulder, lift]).isometry();
        let nothing = there * back;
        assert!(nothing.translation.vector.norm() < 1e-9, "{nothing}");
        assert!(nothing.rotation.angle() < 1e-12, "{nothing}");
    }
}

#[test]
fn a_chain_over_the_tree_goes_up_and_down() {
    let twin = URDF.replace(
        "  <transmission",
        "  <link name=\"left\"/>\n  <joint name=\"other\" type=\"revolute\">\n    <parent link=\"carriage\"/> <child link=\"left\"/>\n    \
         <origin xyz=\"0 0.2 0\" rpy=\"0 0 0.4\"/>\n    <axis xyz=\"0 1 0\"/>\n    <limit lower=\"-1\" upper=\"1\"/>\n  </joint>\n  \
         <transmission",
    );
    let arm = of(&twin, &ends("left", "upper")).unwrap().0.arm().unwrap();
    let names: Vec<&str> = arm.joints().iter().map(|j| j.name.as_str()).collect();
    assert_eq!(names, ["other", "shoulder"], "the lift carries both");
    let expected = (at(0.0, 200.0, 0.0) * rpy(0.0, 0.0, 0.4) * about([0.0, 1.0, 0.0], 0.3))
        .inverse()
        * at(0.0, 0.0, 89.159)
        * rpy(0.0, std::f64::consts::FRAC_PI_2, 0.0)
        * about([0.0, 0.0, 1.0], 0.7);
    let found = *arm.flange(&[0.3, 0.7]).isometry();
    assert!((found.translation.vector - expected.translation.vector).norm() < 1e-9);
    assert!(found.rotation.angle_to(&expected.rotation) < 1e-12);
}

#[test]
fn base_and_tip_follow_where_there_is_one_root_and_one_leaf() {
    let alone = URDF.replace("floating", "fixed");
    let (_, left_out) = of(&alone, &Selection::default()).unwrap();
    assert_eq!((left_out.base.as_str(), left_out.tip.as_str()), ("base", "finger"));
    let from = Selection { base: Some("carriage".to_owned()), ..Selection::default() };
    let (file, _) = of(&alone, &from).unwrap();
    assert_eq!(file.joint[0].name, "shoulder");
}

#[test]
fn a_joint_follows_another_over_one_that_follows() {
    let text = URDF
        .replace(
            "joint=\"shoulder\" multiplier=\"-0.5\" offset=\"0.25\"",
            "joint=\"lift\" multiplier=\"-2\" offset=\"0.25\"",
        )
        .replace(
            "<limit effort=\"1\" velocity=\"1\"/>",
            "<mimic joint=\"passive\" multiplier=\"3\" offset=\"0.5\"/>",
        );
    let (file, _) = of(&text, &ends("base", "tool")).unwrap();
    let elbow = file.joint[3].mimic.as_ref().unwrap();
    // 3 (−2 lift + 0.25) + 0.5, in rad by m; the file's is rad by mm.
    assert_eq!(elbow.joint, "lift");
    assert!((elbow.multiplier + 0.006).abs() < 1e-15);
    assert!((elbow.offset_deg.unwrap() - 1.25_f64.to_degrees()).abs() < 1e-12);
    let slides = text.replacen(
        "  <joint name=\"elbow\" type=\"revolute\">",
        "  <joint name=\"elbow\" type=\"prismatic\">",
        1,
    );
    let (file, _) = of(&slides, &ends("base", "tool")).unwrap();
    let elbow = file.joint[3].mimic.as_ref().unwrap();
    assert_eq!((elbow.multiplier, elbow.offset_mm), (-6.0, Some(1250.0)));
}

#[test]
fn joints_that_no_arm_has_are_refused_with_their_line() {
    let floating = told(URDF, &ends("base", "finger"));
    assert!(floating.starts_with("line 38: joint \"finger_joint\" is \"floating\""), "{floating}");
    let planar = changed("name=\"elbow\" type=\"revolute\"", "name=\"elbow\" type=\"planar\"");
    assert!(planar.contains("line 29: joint \"elbow\" is \"planar\""), "{planar}");
    let none = changed("name=\"elbow\" type=\"revolute\"", "name=\"elbow\"");
    assert!(none.contains("joint \"elbow\" is \"\""), "{none}");
}

#[test]
fn ends_that_are_not_there_are_told_with_the_links_that_are() {
    let tip = told(URDF, &ends("base", "tool0"));
    assert!(
        tip.starts_with(
            "tip = \"tool0\" is no link of the URDF. Its links: \"base\", \"carriage\""
        ),
        "{tip}"
    );
    assert!(told(URDF, &ends("base_link", "tool")).starts_with("base = \"base_link\" is no link"));
    assert!(told(URDF, &ends("tool", "tool")).starts_with("base and tip are one link, \"tool\""));
    let two_leaves = URDF.replace("<parent link=\"tool\"/>", "<parent link=\"lower\"/>");
    let several = told(&two_leaves, &Selection::default());
    assert!(several.contains("behind \"base\": \"tool\", \"finger\"; choose the tip"), "{several}");
}

#[test]
fn what_is_no_tree_is_refused_with_line_and_joint() {
    let cases = [
        // (change, what is told)
        (
            (
                "<parent link=\"base\"/> <child link=\"carriage\"/>",
                "<parent link=\"finger\"/> <child link=\"carriage\"/>",
            ),
            "line 38: joint \"finger_joint\" closes a circle of 6 joints",
        ),
        (
            (
                "<parent link=\"base\"/> <child link=\"carriage\"/>",
                "<parent link=\"carriage\"/> <child link=\"carriage\"/>",
            ),
            "line 10: joint \"lift\" closes a circle of 1 joints",
        ),
        (
            ("<child link=\"finger\"/>", "<child link=\"lower\"/>"),
            "line 38: joint \"finger_joint\" has the child link \"lower\", which joint \"elbow\" in line 29 has already",
        ),
        (
            ("<parent link=\"upper\"/>", "<parent link=\"uper\"/>"),
            "line 22: joint \"passive\" has the parent link \"uper\", which is not in the file",
        ),
        (
            ("<link name=\"finger\"/>", "<link name=\"finger\"/><link name=\"loose\"/>"),
            "the URDF has 2 root links, \"base\" (line 3), \"loose\" (line 9)",
        ),
        (
            ("<link name=\"finger\"/>", "<link name=\"finger\"/><link name=\"tool\"/>"),
            "line 9: link \"tool\" is there already, in line 8",
        ),
        (
            ("name=\"elbow\"", "name=\"lift\""),
            "line 29: joint \"lift\" is there already, in line 10",
        ),
        (("<link name=\"finger\"/>", "<link/>"), "line 9: a <link> has no name"),
        (("<parent link=\"upper\"/> ", ""), "line 22: joint \"passive\" has no <parent link"),
    ];
    for ((from, to), expected) in cases {
        let found = changed(from, to);
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn numbers_that_are_none_are_refused_with_line_and_joint() {
    let cases = [
        (
            ("0 0 0.089159", "0 0 nan"),
            "line 18: joint \"shoulder\": <origin xyz> = \"0 0 nan\", but it has to be three numbers in m",
        ),
        (("0 0 0.089159", "0 0"), "line 18: joint \"shoulder\": <origin xyz> = \"0 0\""),
        (("0 0 0.089159", "0,0,1"), "line 18: joint \"shoulder\": <origin xyz> = \"0,0,1\""),
        (
            ("0 0 0.089159", "0 0 89.159"),
            "line 18: joint \"shoulder\": <origin xyz> = \"[0.0, 0.0, 89.159]\"",
        ),
        (("0 1.5707963267948966 0", "0 90 0"), "line 18: joint \"shoulder\": <origin rpy>"),
        (
            ("rpy=\"0 1.5707963267948966", "RPY=\"0 1.5707963267948966"),
            "line 18: joint \"shoulder\" has <origin RPY>, which is unknown (did you mean \"rpy\"?)",
        ),
        (("0.6 0 0.8", "0 0 0"), "line 26: joint \"passive\": <axis xyz>"),
        (("upper=\"0.3\"", "upper=\"-0.3\""), "line 14: joint \"lift\" has limits from 0 to -0.3"),
        (
            ("<limit lower=\"0\" upper=\"0.3\"/>", ""),
            "line 10: joint \"lift\" has no limits; a joint that slides needs",
        ),
        (
            ("multiplier=\"-0.5\"", "multiplier=\"x\""),
            "line 23: joint \"passive\": <mimic multiplier> = \"x\"",
        ),
        (("lower=\"-1.5\"", "lower=\"-inf\""), "line 20: joint \"shoulder\": <limit lower>"),
    ];
    for ((from, to), expected) in cases {
        let found = changed(from, to);
        assert!(found.starts_with(expected), "{found}");
    }
}

#[test]
fn a_joint_that_follows_none_of_the_chain_is_refused() {
    let cases = [
        ("joint=\"nobody\"", "which is no joint of the URDF"),
        ("joint=\"passive\"", "which follows it in turn"),
        ("joint=\"flange\"", "which is fixed"),
    ];
    for (to, expected) in cases {
        let found = changed("joint=\"shoulder\"", to);
        assert!(found.contains("line 22: joint \"passive\" follows"), "{found}");
        assert!(found.contains(expected), "{found}");
    }
    let beside = told(URDF, &ends("upper", "tool"));
    assert!(beside.contains("follows \"shoulder\", which is not between base and tip"), "{beside}");
}

#[test]
fn quaternions_are_read_from_version_1_1() {
    let text = URDF.replace(
        "rpy=\"0 1.5707963267948966 0\"",
        "quat_xyzw=\"0 0.7071067811865476 0 0.7071067811865476\"",
    );
    let old = told(&text, &ends("base", "tool"));
    assert!(
        old.contains("line 18: joint \"shoulder\": its origin has quat_xyzw, which URDF has since"),
        "{old}"
    );
    let new = text.replace("name=\"lifted\"", "name=\"lifted\" version=\"1.1\"");
    let (turned, _) = of(&new, &ends("base", "tool")).unwrap();
    let (angles, _) = of(URDF, &ends("base", "tool")).unwrap();
    let flange = |file: &RobotFile| *file.arm().unwrap().flange(&[1.0, 0.2, 0.3]).isometry();
    assert!(
        (flange(&turned).translation.vector - flange(&angles).translation.vector).norm() < 1e-9
    );
    let both = new.replace("quat_xyzw", "rpy=\"0 0 0\" quat_xyzw");
    assert!(told(&both, &ends("base", "tool")).contains("both rpy and quat_xyzw"));
}

#[test]
fn xacro_is_told_to_be_expanded() {
    let expand = "`xacro my.urdf.xacro > my.urdf`";
    let cases = [
        ("<link name=\"finger\"/>", "<xacro:arm prefix=\"left\"/>", "line 9: \"xacro:arm\""),
        ("<mimic joint", "<xacro:limits/><mimic joint", "line 23: \"xacro:limits\""),
        ("0 0 0.089159", "0 0 ${height}", "line 18: \"0 0 ${height}\""),
        ("name=\"elbow\"", "name=\"$(arg prefix)elbow\"", "line 29: \"$(arg prefix)elbow\""),
        (
            "<link name=\"finger\"/>",
            "<link name=\"${prefix}finger\"/>",
            "line 9: \"${prefix}finger\"",
        ),
    ];
    for (from, to, expected) in cases {
        let found = changed(from, to);
        assert!(found.starts_with(expected) && found.contains(expand), "{found}");
    }
    // Its prefix without a declaration.
    let found = told(
        "<robot name=\"a\">\n<xacro:include filename=\"$(find b)\"/></robot>",
        &Selection::default(),
    );
    assert!(found.starts_with("line 2: \"xacro:include\"") && found.contains(expand), "{found}");
}

#[test]
fn what_stands_beside_the_chain_does_not_matter() {
    let plain = of(URDF, &ends("base", "tool")).unwrap().0;
    let beside = "<xacro:usb name=\"c\"/><gazebo><sensor:ray a:b=\"1\"/></gazebo></robot>";
    let (file, left_out) = of(&URDF.replace("</robot>", beside), &ends("base", "tool")).unwrap();
    assert_eq!(file, plain);
    assert!(left_out.elements.contains(&("xacro", 1)), "{:?}", left_out.elements);
}

#[test]
fn parts_of_a_joint_that_a_reader_would_pass_over_are_refused() {
    let cases = [
        (
            "<axis xyz=\"0 0 2\"/>",
            "<axis><xyz>0 0 2</xyz></axis>",
            "line 13: joint \"lift\": a URDF writes numbers",
        ),
        (
            "<axis xyz=\"0 0 2\"/>",
            "<axis>0 0 2</axis>",
            "line 13: joint \"lift\": a URDF writes numbers",
        ),
        (
            "<origin xyz=\"0.1 0 0.5\"/>",
            "<Origin xyz=\"0.1 0 0.5\"/>",
            "line 12: joint \"lift\" has <Origin>, which is unknown (did you mean \"origin\"?); write it so",
        ),
        ("<origin xyz=\"0.1", "<orgin xyz=\"0.1", "line 12: joint \"lift\" has <orgin>, which"),
        (
            "<origin xyz=\"0.1 0 0.5\"/>",
            "<pose>0.1 0 0.5 0 0 0</pose>",
            "line 12: joint \"lift\": it has <pose>, as an SDF has",
        ),
        ("rpy=\"0 1.57", "rpyy=\"0 1.57", "line 18: joint \"shoulder\" has <origin rpyy>, which"),
        ("<axis xyz=\"0 0 2", "<axis xzy=\"0 0 2", "line 13: joint \"lift\" has <axis xzy>, which"),
        (
            "<axis xyz=\"0 0 2\"/>",
            "<axis/>",
            "line 13: <axis> of joint \"lift\" has no xyz; a URDF needs it",
        ),
        ("lower=\"-1.5", "low=\"-1.5", "line 20: joint \"shoulder\" has <limit low>, which"),
        ("multiplier=", "multiplyer=", "line 23: joint \"passive\" has <mimic multiplyer>, which"),
        (
            "<origin xyz=\"0.1 0 0.5\"/>",
            "<origin/>\n<origin xyz=\"0.1 0 0.5\"/>",
            "line 13: joint \"lift\": its <origin> is there twice",
        ),
        (
            "upper=\"1.5\" effort",
            "upper=\"170\" effort",
            "line 20: joint \"shoulder\" has limits from -1.5 to 170; a URDF has them in rad",
        ),
    ];
    for (from, to, expected) in cases {
        let found = changed(from, to);
        assert!(found.starts_with(expected), "{found}");
    }
    // Those of drives and simulators are no misspelled ones.
    let own = "<gear ratio=\"50\"/>\n<limit current=\"3\" gear_velocity=\"9\" lower=\"0\" upper=\"0.3\"/>";
    let with = URDF.replacen("<limit lower=\"0\" upper=\"0.3\"/>", own, 1);
    assert!(with != URDF && of(&with, &ends("base", "tool")).is_ok());
}

#[test]
fn a_right_angle_of_few_digits_is_told_with_its_effect() {
    let remarks = |angle: &str| {
        let text = URDF.replace("1.5707963267948966", angle);
        of(&text, &ends("base", "tool")).unwrap().1.remarks
    };
    let rough = remarks("1.57");
    // 0.4 m, 0.3506 m and 0.1 m behind it, and 0.796 mrad.
    let told = "joint \"shoulder\" (line 16): an angle of 1.57 rad misses a right one by 8.0e-4 rad, which is up to 0.68 mm at the tip";
    assert!(rough.iter().any(|own| own.starts_with(told)), "{rough:?}");
    assert_eq!(remarks("1.5707963267948966"), remarks("1.5707963"));
    assert_eq!(remarks("1.3"), remarks("1.5707963"), "an angle that is meant");
}

#[test]
fn an_element_of_many_attributes_is_refused_in_time() {
    let many: String = (0..100_000).fold(String::new(), |text, n| text + &format!(" a{n}=\"\""));
    let found = told(&format!("<robot name=\"a\">\n<link{many}/></robot>"), &Selection::default());
    assert!(
        found.starts_with("line 2, column 1") && found.contains("more than 1000 attributes"),
        "{found}"
    );
}

#[test]
fn what_is_no_urdf_is_refused_with_its_place() {
    let told = |text: &str| told(text, &Selection::default());
    assert!(
        told("<robot name=\"a\">\n  <link name=\"b\">\n</robot>")
            .starts_with("line 3, column 1: it is no XML")
    );
    assert!(told("model = \"a\"").starts_with("line 1, column 1: it is no XML"));
    assert!(told("").contains("it is no XML"));
    assert!(
        told("<sdf version=\"1.7\"><model/></sdf>")
            .contains("begins with <sdf>; a URDF begins with <robot")
    );
    assert!(told("<robot name=\"a\"/>").starts_with("the URDF has no <link>"));
    let entities = "<!DOCTYPE r [<!ENTITY a \"aaaa\"><!ENTITY b \"&a;&a;\">]><robot name=\"&b;\"/>";
    assert!(told(entities).contains("it is no XML that can be read"), "{}", told(entities));
    let control = told("<robot name=\"a\u{1b}[2J\"/>");
    assert!(!control.contains('\u{1b}'), "{control}");
}

#[test]
fn a_name_of_the_file_cannot_move_the_cursor() {
    let text = URDF.replace("\"tool\"", "\"to&#10;ol\"");
    let found = told(&text, &ends("base", "tool"));
    assert!(found.contains("\"to\\nol\""), "{found}");
    assert!(!found.contains('\n'), "{found}");
}

#[test]
fn a_way_of_many_joints_and_deep_files_are_refused_in_time() {
    let mut text = String::from("<robot name=\"long\"><link name=\"l0\"/>");
    for link in 1..=50_000 {
        let _ = write!(
            text,
            "<link name=\"l{link}\"/><joint name=\"j{link}\" type=\"fixed\"><parent link=\"l{}\"/><child link=\"l{link}\"/></joint>",
            link - 1
        );
    }
    text += "</robot>";
    let found = told(&text, &Selection::default());
    assert!(found.contains("has 50000 joints; a robot file has 64 at most"), "{found}");
    let deep = format!("<robot name=\"a\">{}", "<link>".repeat(200_000));
    assert!(told(&deep, &Selection::default()).contains("it is no XML"));
}

proptest! {
    #[test]
    fn a_damaged_file_is_read_or_refused(
        cuts in proptest::collection::vec((0..URDF.len(), 0..40_usize, "[ -~]{0,12}"), 1..4)
    ) {
        let mut text = URDF.to_owned();
        for (at, length, put) in cuts {
            let at = at.min(text.len());
            let end = (at + length).min(text.len());
            text.replace_range(at..end, &put);
        }
        if let Ok((file, _)) = of(&text, &ends("base", "tool")) {
            let _ = file.arm();
        }
    }
}
