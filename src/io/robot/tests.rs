use std::path::Path;

use super::ready::READY;
use super::*;

const TOML: &str = include_str!("../../../pipelines/robots/ur10e.toml");

fn named(names: &[&str]) -> Selection {
    Selection {
        joints: Some(names.iter().map(|name| (*name).to_owned()).collect()),
        ..Selection::default()
    }
}

fn robot(text: &str, selection: &Selection) -> Result<Read, RobotFault> {
    read(Path::new("robot.toml"), text, selection)
}

#[test]
fn toml_is_read_as_it_is_and_its_joints_take_other_names() {
    let own = robot(TOML, &Selection::default()).unwrap();
    assert_eq!(own.file, toml::from_str(TOML).unwrap());
    assert_eq!(own.left_out, None);
    let other = robot(TOML, &named(&["a", "b", "c", "d", "e", "f"])).unwrap();
    let names: Vec<&str> = other.file.joint.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["a", "b", "c", "d", "e", "f"]);
}

#[test]
fn other_names_than_joints_and_links_of_toml_are_refused() {
    let told = |selection: &Selection| robot(TOML, selection).unwrap_err().to_string();
    let names = told(&named(&["a"]));
    assert!(
        names.starts_with("joints names 1 joint, but the controller reports 6 joints"),
        "{names}"
    );
    assert!(names.contains("\"wrist_3_joint\""), "{names}");
    let tip = Selection { tip: Some("tool0".to_owned()), ..Selection::default() };
    assert!(told(&tip).contains("the chain of this robot file is the arm"));
}

#[test]
fn a_robot_file_is_written_as_it_is_read() {
    for ready in READY {
        let file: RobotFile = toml::from_str(ready.text).unwrap();
        let text = written::toml(&file).unwrap();
        let back: RobotFile = toml::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
        assert_eq!(back, file, "{text}");
    }
    let file: RobotFile = toml::from_str(TOML).unwrap();
    for convention in crate::kinematics::Convention::ALL {
        let restated = file.restated(convention).unwrap();
        let text = written::toml(&restated).unwrap();
        assert_eq!(toml::from_str::<RobotFile>(&text).unwrap(), restated, "{text}");
    }
}

#[test]
fn a_name_cannot_leave_its_comment() {
    let left_out = LeftOut {
        base: "a\nmodel = \"b\"".to_owned(),
        tip: "c".to_owned(),
        elements: vec![("visual", 2)],
        joints: 1,
        remarks: Vec::new(),
    };
    let text = written::comment("x\r\n.urdf", &left_out);
    assert!(text.lines().all(|line| line.starts_with('#')), "{text}");
    assert!(text.contains("# Left out: 2 visual, 1 joints beside the chain."), "{text}");
}
