use nalgebra::{Rotation3, Translation3, UnitQuaternion, Vector3};

use super::motion::vector_near;
use crate::tests::{only_lines, undone};
use crate::write::{Command, applied, edits, mark, marks};
use crate::{Branch, Cell, File, Further, Programs, Wanted, Way, read};

fn cell() -> Cell {
    let zeros = "place = { xyz_mm = [0.0, 0.0, 0.0], quaternion_xyzw = [0.0, 0.0, 0.0, 1.0] }";
    let text = format!(
        "[frames]\nbase = {{ found = \"surveyed\", {zeros} }}\ntcp = {{ found = \"surveyed\", {zeros} }}\nPlane_1 = {{ found = \"surveyed\" }}\n\
         ref_frame = {{ found = \"surveyed\" }}\n"
    );
    toml::from_str(&text).unwrap()
}

/// As `PolyScope` saves a program.
fn script(statements: &str) -> File {
    let lines = statements.lines().map(|own| format!("    {own}\r\n"));
    let body = lines.collect::<Vec<_>>().concat();
    let text = format!(
        "def Part():\r\n  set_tcp(p[0.0,0.0,0.15,0.0,0.0,0.0])\r\n  set_payload(0.5)\r\n\
         \u{20} global Plane_1=p[0.5, 0.0, 0.1, 0.0, 0.0, 1.5707963267948966]\r\n\
         \u{20} global Over_p=p[.3, -.2, .4, 3.1, 0.0, 0.1]\r\n  global Over_q=[-1.6, -1.7, -2.2, -0.8, 1.6, 0.0]\r\n\
         \u{20} global Part_p=p[.01, .02, .03, 0.0, 3.1, 0.0]\r\n  while (True):\r\n    $ 4 \"Part\"\r\n{body}  end\r\nend\r\n"
    );
    File { name: "part.script".to_owned(), bytes: text.into_bytes() }
}

const BEGIN: &str = "movej(get_inverse_kin(Over_p, qnear=Over_q), a=1.4, v=1.05)";

fn programs(statements: &str) -> Programs {
    read(vec![script(statements)], &cell())
}

fn verdicts(programs: &Programs) -> Vec<String> {
    let told = |index| {
        programs.ask(index, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    (0..programs.positions.len()).map(told).collect()
}

#[test]
fn a_pose_is_in_metres_and_a_rotation_vector_under_its_feature_and_tool() {
    let programs =
        programs(&format!("{BEGIN}\noptimovel(pose_trans(Plane_1, Part_p), a=0.3, v=0.3, r=0.01)"));
    let names: Vec<&str> = programs.positions.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["OVER_P", "PART_P"]);
    assert_eq!(verdicts(&programs), ["ok", "ok"]);
    let guided =
        format!("freedrive_mode()\nsleep(5)\nend_freedrive_mode()\n{BEGIN}\nmovel(Part_p)");
    assert_eq!(verdicts(&self::programs(&guided)), ["ok", "ok"]);
    let named = "movej(a=1.4, q=get_inverse_kin(qnear=Over_q, x=Over_p))\n\
                 movel(r=0.01, pose=pose_trans(p_from_to=Part_p, p_from=Plane_1))";
    assert_eq!(self::programs(named).ask(1, &cell()), programs.ask(1, &cell()));
    let asked = programs.ask(1, &cell()).unwrap();
    let Wanted::Pose { base_from_tool, branches, .. } = asked.wanted else { panic!("a pose") };
    let expected = Vector3::new(500.0 - 20.0, 10.0, 130.0);
    assert!((base_from_tool.translation.vector - expected).norm() < 1e-9, "{base_from_tool}");
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2)
        * Rotation3::from_axis_angle(&Vector3::y_axis(), 3.1);
    let apart = base_from_tool.rotation.to_rotation_matrix().matrix() - turn.matrix();
    assert!(apart.norm() < 1e-9, "{apart}");
    assert!((asked.flange_from_tool.translation.vector.z - 150.0).abs() < 1e-9);
    // The movel goes on where the movej ended: near Over_q.
    let near: Vec<f64> =
        [-1.6_f64, -1.7, -2.2, -0.8, 1.6, 0.0].iter().map(|own| own.to_degrees()).collect();
    let [Branch::Joints(own)] = &branches[..] else { panic!("{branches:?}") };
    assert!(own.iter().zip(&near).all(|(own, near)| (own - near).abs() < 1e-9), "{own:?}");
    let ways: Vec<_> = programs.paths.iter().map(|own| (own.way, own.is_blended)).collect();
    assert_eq!(ways, [(Way::Joints, false), (Way::Straight, true)]);
}

#[test]
fn joint_angles_are_radians_and_only_their_numbers_change() {
    let file = script("movej([0, -1.57, 1.570000000, 0.1, .2, 0], a=1.4, v=1.05, t=0, r=0)");
    let programs = read(vec![file.clone()], &cell());
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Joints(joints) = &asked.wanted else { panic!("joint angles") };
    assert!((joints[1] - (-1.57_f64).to_degrees()).abs() < 1e-12);
    let mut to = joints.clone();
    to[1] += 0.01_f64.to_degrees();
    let command = Command { base_from_tool: None, joints: Some([joints.clone(), to]) };
    let mut all = edits(&programs.positions[0], &asked, &command).all;
    assert_eq!(all.len(), 1, "{all:?}");
    assert_eq!(all[0].text, "-1.5600000");
    all.extend(marks(&file, "run 1", "id", &[]));
    let written = File { bytes: applied(&file.bytes, &all), ..file.clone() };
    assert!(written.bytes.starts_with(b"# corrected by posegrid run 1\r\ndef Part():"));
    assert_eq!(mark(&written), Some(1));
    assert_eq!(undone(&written.bytes, &file.bytes, &all), file.bytes);
}

#[test]
fn a_pose_gets_metres_and_the_nearest_rotation_vector() {
    let programs = programs(BEGIN);
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Pose { base_from_tool, .. } = &asked.wanted else { panic!("a pose") };
    let to = Translation3::new(0.5, 0.0, 0.0) * base_from_tool;
    let command = Command { base_from_tool: Some(to), joints: None };
    let all = edits(&programs.positions[0], &asked, &command).all;
    let texts: Vec<&str> = all.iter().map(|own| own.text.as_str()).collect();
    assert_eq!(texts, ["0.3005000"]);
    // Beyond half a turn the vector goes on, as a controller writes it.
    let near = [3.1, 0.0, 0.0];
    let to = UnitQuaternion::from_scaled_axis(Vector3::new(3.2, 0.0, 0.0));
    assert!((vector_near(&to, near)[0] - 3.2).abs() < 1e-12);
    let none = vector_near(&UnitQuaternion::identity(), [0.0; 3]);
    assert!(none.iter().all(|own| own.abs() < 1e-12), "{none:?}");
}

#[test]
fn what_is_not_known_is_refused_by_name_or_computed() {
    let cases = [
        ("movel(Part_p, v=0.1)", "no motion before it states an arm configuration"),
        (
            &format!("{BEGIN}\nforce_mode(p[0,0,0,0,0,0], [0], [0], 2, [0])\nmovel(Part_p)"),
            "a displacement may be on",
        ),
        (&format!("{BEGIN}\nurcap_function(1)\nmovel(Part_p)"), "the call of URCAP_FUNCTION"),
        (
            &format!("{BEGIN}\nset_tcp(tool_now())\nmovel(Part_p)"),
            "set_tcp is worked out at run time",
        ),
        (
            &format!("{BEGIN}\nPart_p = pose_add(Part_p, Part_p)\nmovel(Part_p)"),
            "PART_P is worked out at run time",
        ),
        (
            &format!("{BEGIN}\nnear = point_dist(Part_p, Over_p)\nmovel(Part_p)"),
            "it is also read in part.script",
        ),
        ("x = later()\nmovel(x)", "X is worked out at run time"),
        (&format!("{BEGIN}\nset_gripper_tool(2)\nmovel(Part_p)"), "the call of SET_GRIPPER_TOOL"),
        (
            &format!("{BEGIN}\nmovec(pose_trans(Plane_1, Part_p), p[0.1,0,0.1,0,0,0])"),
            "its motion stand in two features",
        ),
        (&format!("{BEGIN}\nservoj([0,0,0,0,0,0])"), "servoj is not followed"),
        (
            &format!("{BEGIN}\nspeedl([0,0,-0.05,0,0,0], 0.5, 1)\nmovel(Part_p)"),
            "nothing says where speedl leads the arm (part.script, line 11)",
        ),
        (
            &format!("{BEGIN}\nif x > 1:\n  set_tcp(p[0,0,0.2,0,0,0])\nend\nmovel(Part_p)"),
            "the tool is another by the way",
        ),
        (
            &format!("{BEGIN}\nif x > 1: Part_p = p[0,0,0,0,0,0.1] end\nmovel(Part_p)"),
            "PART_P has two values (part.script, line 7; part.script, line 11)",
        ),
    ];
    for (statements, expected) in cases {
        let found = verdicts(&programs(statements));
        let last = found.last().unwrap();
        assert!(last.contains(expected), "{statements}: {found:?}");
    }
    for computed in [
        "movel(pose_add(Part_p, p[0,0,0.1,0,0,0]))",
        "movej(get_inverse_kin(Over_p, qnear=get_actual_joint_positions()))",
        "movel(pose_trans(get_actual_tcp_pose(), p[0,0,-0.05,0,0,0]))",
        "path = [p[0,0,0,0,0,0], p[0,0,0.1,0,0,0]]\nmovel(path[0])",
        "movel(v=0.1)",
    ] {
        let programs = programs(computed);
        assert_eq!(programs.computed.len(), 1, "{computed}: {:?}", programs.computed);
    }
}

#[test]
fn blocks_of_one_line_are_those_of_several() {
    let block = "if x > 1: movel(Part_p) elif x: set_tcp(p[0,0,0.15,0,0,0]) else: movel(Part_p) end movel(Part_p)";
    let programs = programs(&format!("{BEGIN}\nwhile (x): {block} end"));
    assert_eq!(verdicts(&programs), ["ok", "ok"]);
    assert_eq!(programs.positions[1].uses.len(), 3);
    assert!(programs.computed.is_empty());
}

#[test]
fn a_loop_that_is_begun_anew_from_within_begins_with_any_tool() {
    let other = "set_tcp(p[0,0,0.3,0,0,0])";
    let tool = "set_tcp(p[0,0,0.15,0,0,0])";
    let pass = |skips: &str| {
        let body = format!("{tool}\nwhile (x):\nmovel(Part_p)\n{other}\n{skips}\n{tool}\nend");
        verdicts(&programs(&format!("{BEGIN}\n{body}"))).remove(1)
    };
    assert_eq!(pass(""), "ok");
    for skips in ["if y:\ncontinue\nend", "if y:\nreturn 0\nend"] {
        assert!(pass(skips).contains("the tool"), "{skips}: {}", pass(skips));
    }
}

#[test]
fn statements_outside_all_functions_are_a_program_too() {
    let text = "set_tcp(p[0,0,0.15,0,0,0])\ncamera.grab(1)\nmovej([0,-1,1,0,1,0]); movel(p[0.1,0,0.1,0,0,0], a=1)\n";
    let file = File { name: "a.script".to_owned(), bytes: text.into() };
    let programs = read(vec![file], &cell());
    assert_eq!(
        (verdicts(&programs).as_slice(), programs.computed.len()),
        (&["ok".to_owned(), "ok".to_owned()][..], 0)
    );
}

#[test]
fn a_position_that_another_stands_in_is_not_corrected() {
    let programs = programs(&format!("{BEGIN}\nmovel(pose_trans(Over_p, p[0,0,-0.05,0,0,0]))"));
    let found = verdicts(&programs);
    assert!(found[0].contains("it is also read in part.script"), "{found:?}");
    assert!(found[1].contains("nothing says how OVER_P was found"), "{found:?}");
}

#[test]
fn functions_are_followed_and_a_frame_of_the_cell_is_asked_for() {
    let text = "def Part():\n  def go(to):\n    movel(to, a=1)\n    movel(p[0.1,0,0.1,0,0,0])\n  end\n  movej([0,-1,1,0,1,0])\n  go(p[0,0,0,0,0,0])\nend\nPart()\n";
    let file = File { name: "a.script".to_owned(), bytes: text.into() };
    let programs = read(vec![file.clone()], &cell());
    // The movel inside goes on in the arm configuration of the movej before the call, with the tool of the cell.
    assert_eq!(programs.computed.len(), 1);
    assert_eq!(verdicts(&programs), ["ok", "ok"]);
    let told = read(vec![file], &Cell::default()).ask(0, &Cell::default()).unwrap_err();
    assert!(
        told.to_string().contains("[frames.tcp]") || told.to_string().contains("[frames.base]"),
        "{told}"
    );
}

#[test]
fn poses_need_the_calibration_of_the_controller() {
    use crate::kinematics::RobotFile;
    let text = include_str!("../../../pipelines/robots/ur10.toml");
    let drawn = toml::from_str::<RobotFile>(text).unwrap().arm().unwrap();
    let mut programs = programs(&format!("{BEGIN}\nmovej([0,-1,1,0,1,0])"));
    programs.hold(&drawn);
    let found = verdicts(&programs);
    assert!(found[0].contains("ur_calibration"), "{found:?}");
    assert_eq!(found[1], "ok");
}

#[test]
fn a_function_is_that_of_its_own_file_and_names_alike_but_in_capitals_are_refused() {
    let with = |name: &str, body: &str| {
        let text = format!(
            "def {name}():\n  def hold():\n    {body}\n  end\n  movej([0,-1,1,0,1,0])\n  hold()\n  movel(p[0.1,0,0.1,0,0,0])\nend\n"
        );
        File { name: format!("{name}.script"), bytes: text.into() }
    };
    let files = vec![with("a", "if k > 0: set_tcp(p[0,0,0.9,0,0,0]) end"), with("b", "sync()")];
    let both = read(files, &cell());
    let found = verdicts(&both);
    assert!(found[1].contains("the tool is another by the way"), "{found:?}");
    assert_eq!(found[3], "ok");
    let text = "def Part():\n  def Hold():\n    if k > 0:\n      set_tcp(p[0,0,0.9,0,0,0])\n    end\n  end\n  def hold():\n    sync()\n  end\n  movej([0,-1,1,0,1,0])\n  Hold()\n  movel(p[0.1,0,0.1,0,0,0])\nend\n";
    let file = File { name: "a.script".to_owned(), bytes: text.into() };
    let found = verdicts(&read(vec![file], &cell()));
    assert!(
        found[1].contains("a name hold (a.script, line 7), which is not Hold; rename it"),
        "{found:?}"
    );
}

#[test]
fn a_function_sees_the_parameters_of_the_one_that_it_stands_in() {
    let text = "def Main():\n  set_tcp(p[0,0,0.15,0,0,0])\n  global P1=[0,-1,1,0,1,0]\n  def Outer(P1):\n    def Inner():\n      movej(P1)\n    end\n    Inner()\n  end\n  movej(P1)\n  Outer([0,-1,1,0,1,1])\nend\n";
    let read = read(vec![File { name: "a.script".to_owned(), bytes: text.into() }], &cell());
    assert!(read.computed.iter().any(|own| own.line == 6), "{:?}", read.computed);
}

#[test]
fn further_points_stand_in_the_feature_of_their_motion() {
    let body = format!(
        "{BEGIN}\nmovel(pose_trans(Plane_1, Part_p), a=1.2, v=0.25, r=0.0) # weld\nmovec(p[.02,.1,.03,0,3.1,0],Part_p,a=1,v=1)\n\
         movel(Over_p, a=1.2, v=0.25, t=2)\nmovel(p[.01,.02,.03,0,3.1,0], 1.2, 0.25, 0, 0.01)\nmovel(Over_p)\n\
         movel(get_inverse_kin(Part_p, qnear=Over_q))\nmovep(Over_p, a=1.2, v=0.25)"
    );
    let programs = programs(&body);
    let told: Vec<_> = programs.paths.iter().map(|path| programs.may_split(path)).collect();
    let [time, blend] = ["its time is for the whole of it", super::motion::BLENDED];
    assert_eq!(told[1..5], [Ok(()), Ok(()), Err(time), Err(blend)]);
    let near = "it states joint angles near it";
    assert_eq!(told[5..], [Err(blend), Err(near), Err(crate::reading::NOT_SPLIT)]);
    let point = Further {
        frame_from_tool: nalgebra::Isometry3::new(Vector3::new(10.5, -20.0, 30.0), Vector3::x()),
        joints: vec![0.0; 6],
    };
    let edit = only_lines(&programs, &[point]);
    let expected = "    movel(pose_trans(Plane_1, p[0.0105000, -0.0200000, 0.0300000, 1.0000000, 0.0000000, 0.0000000]), \
                    a=1.2, v=0.25, r=0.0) # added by posegrid\r\n";
    assert_eq!(edit.text, expected);
}

#[test]
fn a_feature_that_is_assigned_anew_is_followed_where_it_is_global() {
    let places = |script: &str| {
        let file = File { name: "p.script".to_owned(), bytes: script.as_bytes().to_vec() };
        let programs = read(vec![file], &cell());
        let place = |index| {
            let asked = programs.ask(index, &cell()).ok()?;
            let Wanted::Pose { base_from_tool, .. } = asked.wanted else { return None };
            Some(base_from_tool.translation.vector.x.round())
        };
        (0..programs.positions.len()).map(place).collect::<Vec<_>>()
    };
    let text = "def Part():\n  global ref_frame = p[0,0,0,0,0,0]\n  def Sub():\n    movel(pose_trans(ref_frame,p[.1,.2,.3,0,3.1,0]),1,1)\n  end\n\
                \x20 ref_frame = p[.5,0,0,0,0,0]\n  movej([0,-1.5,1.5,0,.2,0])\n  movel(pose_trans(ref_frame,p[.1,.2,.3,0,3.1,0]),1,1)\n  Sub()\n\
                \x20 ref_frame = p[.7,0,0,0,0,0]\n  movel(pose_trans(ref_frame,p[.1,.2,.3,0,3.1,0]),1,1)\n  movel(p[.1,.2,.3,0,3.1,0],1,1)\nend\nPart()\n";
    // That of the function, of the first place, joint angles, of the second, of the base.
    assert_eq!(places(text), [Some(600.0), None, Some(600.0), Some(800.0), Some(100.0)]);
    // Which of two holds is not known behind a condition, and local ones are not followed.
    let may = text.replace(
        "  ref_frame = p[.7,0,0,0,0,0]\n",
        "  if a:\n    ref_frame = p[.7,0,0,0,0,0]\n  end\n",
    );
    assert_eq!(places(&may), [Some(600.0), None, Some(600.0), None, Some(100.0)]);
    assert_eq!(places(&text.replace("global ", "")).iter().flatten().count(), 1);
}

#[test]
fn a_motion_by_joints_to_an_unknown_place_leaves_no_arm_configuration() {
    let unknown = [
        "movej([d2r(-17), d2r(-57), d2r(120), d2r(107), d2r(99), d2r(158)])",
        "q = later()\nmovej(q)",
        "movej(qs[0])",
        "movej(get_inverse_kin(Over_p, Over_q, 1e-10, 1e-10))",
        "servoj(q)",
    ];
    for own in unknown {
        let told = verdicts(&programs(&format!("{BEGIN}\n{own}\nmovel(Part_p)")));
        assert!(told.last().unwrap() != "ok", "{own}: {told:?}");
    }
    for own in [
        "movej(Over_p)",
        "movej(pose_add(Over_p, p[0,0,0.1,0,0,0]))",
        "movel(pose_add(Over_p, Over_p))",
    ] {
        let told = verdicts(&programs(&format!("{BEGIN}\n{own}\nmovel(Part_p)")));
        assert_eq!(told.last().unwrap(), "ok", "{own}: {told:?}");
    }
}

#[test]
fn what_a_thread_does_may_have_happened_and_leads_the_arm_on() {
    let with = |thread: &str, start: &str| {
        let own = format!("thread t():\n  {thread}\nend\n{start}\nmovel(Part_p)");
        verdicts(&programs(&format!("{BEGIN}\n{own}"))).pop().unwrap()
    };
    let told = with("set_tcp(p[0,0,0.4,0,0,0])", "h = run t()");
    assert!(told.contains("changes the tool"), "{told}");
    let told = with("movej([-0.3,-1.0,2.1,1.87,1.73,2.77])", "run t()");
    assert!(told.contains("changes the arm configuration"), "{told}");
    assert_eq!(with("set_digital_out(1, True)", "run t()"), "ok");
}

#[test]
fn names_that_differ_from_the_controllers_in_capitals_are_refused() {
    for (own, name) in
        [("MoveL(Part_p)", "MoveL"), ("Set_tcp(Part_p)", "Set_tcp"), ("End = 1", "End")]
    {
        let told = verdicts(&programs(&format!("{BEGIN}\n{own}\nmovel(Part_p)"))).pop().unwrap();
        assert!(told.contains(&format!("has a name {name} (part.script, line ")), "{own}: {told}");
    }
    assert_eq!(verdicts(&programs(&format!("{BEGIN}\nSpeed = 1\nmovel(Part_p)"))), ["ok", "ok"]);
}

#[test]
fn a_circle_along_its_tangent_keeps_no_orientation_of_its_end() {
    let circle = |mode: &str| {
        let told = verdicts(&programs(&format!(
            "{BEGIN}\nmovec(Over_p, Part_p, a=1.2, v=0.2, r=0{mode})"
        )));
        told.last().unwrap().clone()
    };
    assert_eq!([circle(""), circle(", mode=0")], ["ok", "ok"]);
    assert!(
        circle(", mode=1").contains("movec with mode 1 is not followed"),
        "{}",
        circle(", mode=1")
    );
    assert!(circle(", 1").contains("movec with mode 1"));
}

#[test]
fn what_a_condition_behind_elif_calls_holds_on_the_ways_behind_it() {
    let other = "def f():\n  set_tcp(p[0,0,0.4,0,0,0])\nend\n";
    for way in
        ["elif f():\n  movel(Part_p)\nend", "elif f():\n  sleep(1)\nelse:\n  movel(Part_p)\nend"]
    {
        let told = programs(&format!("{other}{BEGIN}\nif Over_p[0] > 1:\n  sleep(1)\n{way}"));
        let place = told.positions.iter().position(|own| own.name == "PART_P").unwrap();
        let tool = told.ask(place, &cell()).unwrap().flange_from_tool;
        assert!((tool.translation.vector.z - 400.0).abs() < 1e-9, "{way}: {tool}");
    }
}

#[test]
fn a_pose_whose_arm_configuration_is_worked_out_is_counted_once() {
    for pose in ["p[0.1,0,0.1,0,0,0]", "pick"] {
        let text = format!(
            "pick = p[0.1,0,0.1,0,0,0]\nmovej(get_inverse_kin({pose}, qnear=get_actual_joint_positions()))"
        );
        let programs = programs(&text);
        assert_eq!((programs.positions.len(), programs.computed.len()), (0, 1), "{pose}");
    }
    let named = programs(&format!("def P():\n  sleep(1)\nend\nP()\n{BEGIN}"));
    assert_eq!(verdicts(&named), ["ok"]);
}
