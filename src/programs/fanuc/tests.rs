use crate::tests::undone;
use crate::write::{Command, applied, edits, mark, marks};
use crate::{Branch, Cell, File, Further, Letters, Programs, Wanted, Way, read};

fn cell() -> Cell {
    let text = "[frames]\nbase_frame = { found = \"surveyed\", place = { xyz_mm = [0.0, 0.0, 100.0], quaternion_xyzw = [0.0, 0.0, 0.0, 1.0] } }\n\
                \"UFRAME[1]\" = { found = \"surveyed\", place = { xyz_mm = [1000.0, 0.0, 500.0], euler_deg = [0.0, 0.0, 90.0], euler_order = \"fixed-xyz\" } }\n\
                \"UTOOL[2]\" = { found = \"surveyed\", place = { xyz_mm = [0.0, 0.0, 200.0], quaternion_xyzw = [0.0, 0.0, 0.0, 1.0] } }\n";
    toml::from_str(text).unwrap()
}

/// Entries of `/POS` as a controller prints them: 1 and 2 under frame 1 and tool 2, 3 in joints, 4 under those that are set, 5 in the world.
const POSITIONS: &str = "P[1:\"over [A] part)\"]{\r\n   GP1:\r\n\tUF : 1, UT : 2,\t\tCONFIG : 'N U T, 0, 0, -1',\r\n\
\tX =    10.000  mm,\tY =    20.000  mm,\tZ =     -.500  mm,\r\n\tW =   180.000 deg,\tP =      .000 deg,\tR =    30.000 deg\r\n};\r\n\
P[2]{\r\n   GP1:\r\n\tUF : 1, UT : 2,\t\tCONFIG : 'F D B, 0, 0, 0',\r\n\tX = 1.000 mm, Y = 2.000 mm, Z = 3.000 mm,\r\n\
\tW = 0.000 deg, P = 0.000 deg, R = 0.000 deg\r\n};\r\n\
P[3]{\r\n   GP1:\r\n\tUF : 1, UT : 2,\t\r\n\tJ1=     0.000 deg,\tJ2=    10.000 deg,\tJ3=   -20.000 deg,\r\n\
\tJ4=     0.000 deg,\tJ5=   -60.000 deg,\tJ6=     0.000 deg\r\n};\r\n\
P[4]{\r\n   GP1:\r\n\tUF : F, UT : F,\t\tCONFIG : 'N U T, 0, 0, 0',\r\n\tX = 1.000 mm, Y = 2.000 mm, Z = 3.000 mm,\r\n\
\tW = 0.000 deg, P = 0.000 deg, R = 0.000 deg\r\n};\r\n\
P[5]{\r\n   GP1:\r\n\tUF : 0, UT : 0,\t\tCONFIG : 'N U T, 0, 0, 0',\r\n\tX = 1.000 mm, Y = 2.000 mm, Z = 3.000 mm,\r\n\
\tW = 0.000 deg, P = 0.000 deg, R = 0.000 deg\r\n};\r\n";

fn listing(statements: &str, more: &str) -> File {
    let numbered =
        statements.lines().zip(1..).map(|(own, number)| format!("{number:>4}:{own} ;\r\n"));
    let statements: String = numbered.collect::<Vec<_>>().concat();
    let text = format!(
        "/PROG  PART\r\n/ATTR\r\nLINE_COUNT\t= 9;\r\n/APPL\r\n/MN\r\n{statements}/POS\r\n{POSITIONS}{more}/END\r\n"
    );
    File { name: "PART.LS".to_owned(), bytes: text.into_bytes() }
}

fn programs(statements: &str, more: &str) -> Programs {
    read(vec![listing(statements, more)], &cell())
}

fn verdicts(statements: &str, more: &str) -> Vec<String> {
    let programs = programs(statements, more);
    let told = |index| {
        programs.ask(index, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    (0..programs.positions.len()).map(told).collect()
}

fn letters(flip: bool, down: bool, back: bool) -> Letters {
    Letters { flip, down, back }
}

#[test]
fn a_position_stands_in_its_user_frame_and_that_in_the_world() {
    let programs = programs("J P[1:over part] 100% FINE", "");
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Pose { base_from_tool, branches, .. } = asked.wanted else { panic!("a pose") };
    // UFRAME[1] is turned by 90° about z, and the arm's base is 100 mm above the world.
    let expected = [1000.0 - 20.0, 10.0, 500.0 - 0.5 - 100.0];
    for (found, expected) in base_from_tool.translation.vector.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{base_from_tool}");
    }
    // R = Rz(90° + 30°) Rx(180°): x of the tool is turned by 120°, z points down.
    let x = base_from_tool.rotation * nalgebra::Vector3::x();
    assert!((x - nalgebra::Vector3::new(-0.5, 0.75_f64.sqrt(), 0.0)).norm() < 1e-9, "{x}");
    assert!((asked.flange_from_tool.translation.vector.z - 200.0).abs() < 1e-12);
    let turns = Some([0, 0, -1]);
    assert_eq!(branches, [Branch::Config { letters: letters(false, false, false), turns }]);
}

#[test]
fn every_form_of_a_motion_is_read() {
    let cases = [
        ("L P[1] 100mm/sec CNT50 ACC80", Way::Straight),
        ("L P[1] R[5:speed]mm/sec CNT R[6] ACC R[7:a b]", Way::Straight),
        ("  L  P[1]  WELD_SPEED FINE Arc Start[1] PTH", Way::Straight),
        ("L P[1] 100mm/sec CNT100 AP_LD50 RT_LD30 PSPD80", Way::Straight),
        ("L P[1:pick (left {\"] R[1:v [x]mm/sec CNTR[7:a)b] ACC80", Way::Straight),
        ("J P[1] 100% CNT100 TB .10sec,CALL GRIP(1,2)", Way::Joints),
        ("J P[1] 5% FINE Ind.EV5% DB 5mm,DO[1]=ON", Way::Joints),
        ("L P[1] 9mm/sec FINE Skip,LBL[1],PR[4]=LPOS", Way::Other),
        ("L P[1] 9mm/sec CNT5 Wjnt", Way::Other),
        ("A P[1] 9mm/sec CNT5", Way::Other),
        ("L P[1] 9mm/sec FINE PS0.0,DO[1]=ON", Way::Straight),
        ("L P[1] 9mm/sec CNT5 PS-5.0,CALL GRIP", Way::Straight),
        ("L P[1] 9mm/sec CR20mm ALIM50", Way::Straight),
        ("J P[1] 5% CNT10 Offset,PR[43:a)b] Tool_Offset,PR[5]", Way::Joints),
        ("C P[1]    ;\r\n    :  P[1] 9mm/sec FINE", Way::Circle),
    ];
    for (own, way) in cases {
        let text = format!("J P[3] 100% FINE\n{}", own.replace("    ;\r\n", "\r\n"));
        let text = text.replace("\r\n    :", "\u{1}");
        let file = listing(&text, "");
        let bytes =
            String::from_utf8(file.bytes).unwrap().replace('\u{1}', "\r\n    :").into_bytes();
        let programs = read(vec![File { bytes, ..file }], &cell());
        assert!(programs.computed.is_empty(), "{own}");
        assert_eq!(programs.positions.len(), 2, "{own}");
        assert_eq!(programs.paths[1].way, way, "{own}");
        let told = programs.ask(1, &cell());
        assert!(told.is_ok(), "{own}: {told:?}");
        assert_eq!(programs.positions[1].uses[0].is_beside, own.contains("Offset"), "{own}");
    }
}

#[test]
fn what_carries_a_remark_on_is_one_too() {
    let text = "J P[3] 5% FINE\n//C P[2] ;X    :  P[1] 9mm/sec FINE\nJ P[1] 5% FINE";
    let file = listing(text, "");
    let text = String::from_utf8(file.bytes).unwrap().replace(" ;X", "\r\n");
    let programs = read(vec![File { bytes: text.into_bytes(), ..file }], &cell());
    assert_eq!(programs.positions.len(), 2);
    assert!(programs.ask(1, &cell()).is_ok());
}

#[test]
fn what_is_not_known_is_refused_by_name() {
    let cases = [
        ("J P[1] 5% FINE TB .1sec,DO[1]=ON INC", "J with INC is not followed (PART.LS, line 6)"),
        ("J P[1] 5% FINE COORD", "J with COORD is not followed"),
        ("J P[1] 5% FINE VOFFSET,VR[1]", "J with VOFFSET is not followed"),
        ("J P[1] 5% FINE NEWOPT", "J with NEWOPT is not followed"),
        ("J P[1] 5%", "J without FINE or CNT is not followed"),
        ("J P[9] 5% FINE", "P[9] has no value in the files given; give it under /POS"),
        ("J P[4] 5% FINE", "nothing sets the tool before this motion in routine PART"),
        (
            "  UFRAME_NUM=2\nJ P[1] 5% FINE",
            "it stands under UFRAME[1], and UFRAME[2] is set before the motion",
        ),
        ("  UTOOL_NUM=0\nJ P[1] 5% FINE", "it stands under UTOOL[2], and none is set"),
        (
            "  UTOOL_NUM=2\n  UFRAME_NUM=R[1]\nJ P[4] 5% FINE",
            "UFRAME_NUM is worked out at run time",
        ),
        (
            "  UFRAME_NUM=3\n  UTOOL_NUM=2\nJ P[4] 5% FINE",
            "UFRAME[3] has no value in the files given",
        ),
        ("  UFRAME[1]=PR[1]\nJ P[1] 5% FINE", "UFRAME[1] is worked out at run time"),
        (
            "  UTOOL_NUM=2\n  IF R[1]=1 THEN\n  UFRAME_NUM=1\n  ELSE\n  UFRAME_NUM=2\n  ENDIF\nJ P[4] 5% FINE",
            "the base is another by the way",
        ),
        (
            "  UTOOL_NUM=2\n  UFRAME_NUM=1\nJ P[4] 5% CNT50 TB .10sec,CALL GRIP\nJ P[4] 5% FINE",
            "the call of GRIP (PART.LS, line 8) may change",
        ),
        ("  PR[1]=P[1]\nJ P[1] 5% FINE", "it is also read in PART.LS, line 6"),
        ("  P[1]=LPOS\nJ P[1] 5% FINE", "P[1]=LPOS is worked out at run time"),
        ("  PR[1]=P[R[3]]\nJ P[1] 5% FINE", "it is also read in PART.LS, line 6"),
        ("L P[1] 5mm/sec FINE", "no motion before it states an arm configuration"),
        ("  Touch Offset PR[1]\nJ P[1] 5% FINE", "a displacement may be on (Touch Offset"),
        ("  IF R[1]=1 THEN\nJ P[1] 5% FINE", "the blocks of routine PART"),
        ("J P[11] 5% FINE", "J1 of GP2 is at 100, and nothing says"),
        ("J P[12] 5% FINE", "its X has no value; teach it"),
        ("J P[13] 5% FINE", "has no group GP1"),
        ("J P[14] 5% FINE", "E1 is at 5.5, and nothing says"),
        ("J P[15] 5% FINE", "its GP2 is of a second arm"),
        ("J P[16] 5% FINE", "it states no arm configuration that its motion reads"),
        ("J P[17] 5% FINE", "P[17] has two values (PART.LS, line "),
    ];
    let pose = "X = 1.000 mm, Y = 2.000 mm, Z = 3.000 mm, W = 0 deg, P = 0 deg, R = 0 deg";
    let head = "UF : 0, UT : 0, CONFIG : 'N U T, 0, 0, 0',";
    let blank = pose.replace("1.000", "********");
    let more = format!(
        "P[11]{{\n GP1:\n {head} {pose}\n GP2:\n UF : 0, UT : 0,\n J1= 100.000 mm\n}};\nP[12]{{\n GP1:\n {head} {blank}\n}};\n\
         P[13]{{\n GP2:\n {head} {pose}\n}};\nP[14]{{\n GP1:\n {head} {pose},\n E1= 5.500 mm\n}};\n\
         P[15]{{\n GP1:\n {head} {pose}\n GP2:\n {head} {pose}\n}};\nP[16]{{\n GP1:\n UF : 0, UT : 0, CONFIG : '', {pose}\n}};\n\
         P[17]{{\n GP1:\n {head} {pose}\n}};\nP[17]{{\n GP1:\n {head} {pose}\n}};\n"
    );
    for (statements, expected) in cases {
        let told = verdicts(statements, &more);
        assert_eq!(told.len(), 1, "{statements}: {told:?}");
        assert!(told[0].contains(expected), "{statements}: {}", told[0]);
    }
}

#[test]
fn what_is_worked_out_is_named_and_what_no_motion_uses_stays() {
    let programs = programs(
        "J PR[1:home] 5% FINE\nJ P[R[1]] 5% FINE\n  L PAL_1[BTM] 5mm/sec FINE\nJ @P[1] 5% FINE\n  !J P[1] 5% FINE\n//J P[1] 5% FINE",
        "",
    );
    let computed: Vec<&str> = programs.computed.iter().map(|own| own.text.as_str()).collect();
    assert_eq!(computed, ["PR[1:home]", "P[R[1]]", "PAL_1[BTM]", ""]);
    assert!(programs.positions.is_empty());
}

#[test]
fn a_position_moves_only_under_the_numbers_that_it_states() {
    for set in
        ["  UFRAME_NUM=R[1]", "  UTOOL_NUM=AR[2]", "  IF R[1]=1 THEN\n  UTOOL_NUM=1\n  ENDIF"]
    {
        assert_eq!(verdicts(&format!("{set}\nJ P[1] 5% FINE"), ""), ["ok"], "{set}");
    }
}

#[test]
fn numbers_that_are_set_hold_at_labels_behind_them() {
    let body = "  UFRAME_NUM=1\n  UTOOL_NUM=2\nJ P[4] 5% FINE\n  LBL[1]\nL P[1] 5mm/sec FINE\n  IF R[1]<3,JMP LBL[1]\nL P[4] 5mm/sec FINE";
    assert_eq!(verdicts(body, ""), ["ok", "ok"]);
    let jumps = format!("  IF R[1]=1,JMP LBL[1]\n{body}");
    assert!(verdicts(&jumps, "")[0].contains("is another by the way"));
    let file = listing("  CALL OTHER\nL P[1] 5mm/sec FINE\nL P[4] 5mm/sec FINE", "");
    let other = listing("J P[5] 5% FINE\n  UFRAME_NUM=1\n  UTOOL_NUM=2\n  Weave End", "");
    let text = String::from_utf8(other.bytes).unwrap().replace("PART", "OTHER");
    let other = File { name: "OTHER.LS".to_owned(), bytes: text.into_bytes() };
    let both = read(vec![file, other], &cell());
    assert!(
        (0..3).all(|index| both.ask(index, &cell()).is_ok()),
        "what OTHER sets holds behind it"
    );
    let called = "J P[5] 5% FINE\n  CALL OTHER\nL P[1] 5mm/sec FINE";
    let told = verdicts(called, "");
    assert!(told[1].contains("the call of OTHER (PART.LS, line 7) may change the arm"), "{told:?}");
    let macro_call = verdicts(&called.replace("CALL OTHER", "Open hand 1"), "");
    assert!(macro_call[1].contains("the call of OPEN HAND 1"), "{macro_call:?}");
}

#[test]
fn a_linear_motion_goes_on_in_the_letters_of_the_last_joint_motion() {
    let body =
        "  IF R[1]=1 THEN\nJ P[5] 5% FINE\n  ELSE\nJ P[1] 5% FINE\n  ENDIF\nL P[2] 5mm/sec FINE";
    let programs = programs(body, "");
    let Wanted::Pose { branches, .. } = programs.ask(2, &cell()).unwrap().wanted else {
        panic!("a pose")
    };
    assert_eq!(branches, [Branch::Config { letters: letters(false, false, false), turns: None }]);
}

#[test]
fn numbers_turns_and_marks_alone_are_written() {
    let programs = programs("J P[1] 5% FINE\n  R[1]=2", "");
    let file = &programs.files[0];
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Pose { base_from_frame, programmed, .. } = asked.wanted.clone() else {
        panic!("a pose")
    };
    let mut to = base_from_frame.inverse() * programmed;
    to.translation.vector.x += 0.123_45;
    to.rotation *= nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.001, 0.0);
    let joints =
        [vec![0.0, 0.0, 0.0, 179.9, -90.0, -180.2], vec![0.0, 0.0, 0.0, 180.1, -90.0, -180.1]];
    let command = Command { base_from_tool: Some(base_from_frame * to), joints: Some(joints) };
    let mut edits = edits(&programs.positions[0], &asked, &command);
    edits.all.extend(marks(file, "run r; date", "t-1", &[]));
    let written = applied(&file.bytes, &edits.all);
    let text = String::from_utf8_lossy(&written);
    assert!(text.contains("CONFIG : 'N U T, 0, 1, -1'"), "{text}");
    assert!(
        text.contains("\tX =    10.123  mm,\tY =    20.000  mm,\tZ =     -.500  mm,"),
        "{text}"
    );
    assert!(
        text.contains("\tW =   180.000 deg,\tP =      0.057 deg,\tR =    30.000 deg")
            || text.contains("P =      -0.057 deg"),
        "{text}"
    );
    assert!(text.contains("LINE_COUNT\t= 11;"), "{text}");
    let mark_lines = "  10:  !corrected by posegrid ;\r\n  11:  !run r, date ;\r\n/POS\r\n";
    assert!(text.contains(mark_lines), "{text}");
    assert_eq!(edits.crossed, 1);
    assert_eq!(undone(&written, &file.bytes, &edits.all), file.bytes);
    let again = File { bytes: written, ..file.clone() };
    assert_eq!(mark(&again), Some(8));
    let told = read(vec![again], &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("corrected already by posegrid (PART.LS, line 8)"), "{told}");
}

#[test]
fn a_circle_has_two_positions_however_its_lines_are_written() {
    let head = "J P[3] 5% FINE\nC P[1]";
    for between in
        [" ;X", " Tool_Offset,PR[2]", " Tool_Offset,PR[2:a] ;X   :", " 9mm/sec CNT5 ;X:", " ;X   :"]
    {
        let file = listing(&format!("{head}{between} P[2] 9mm/sec FINE"), "");
        let text = String::from_utf8(file.bytes).unwrap().replace(" ;X", "\r\n");
        let programs = read(vec![File { bytes: text.into_bytes(), ..file }], &cell());
        assert_eq!(programs.positions.len(), 3, "{between}");
        assert!(programs.computed.is_empty(), "{between}");
        let told = programs.ask(1, &cell());
        assert_eq!(told.is_ok(), !between.contains("CNT"), "{between}: {told:?}");
    }
}

#[test]
fn a_motion_behind_a_condition_uses_its_position_and_may_not_happen() {
    let told = verdicts("J P[1] 5% FINE\nIF R[1]=1,L P[4] 9mm/sec FINE", "");
    assert_eq!(told.len(), 2);
    assert!(told[1].contains("nothing sets the"), "{told:?}");
    let programs = programs("J P[3] 5% FINE\nIF R[1]=1,J P[2] 5% FINE\nL P[1] 9mm/sec FINE", "");
    assert_eq!(programs.positions.len(), 3);
    let told = programs.ask(2, &cell()).unwrap_err().to_string();
    assert!(
        told.contains("two arm configurations"),
        "P[1] follows P[3], or P[2] where the condition holds: {told}"
    );
}

#[test]
fn positions_of_a_conveyor_are_refused() {
    let file = listing("J P[1] 5% FINE", "");
    let text = String::from_utf8(file.bytes).unwrap();
    let text = text
        .replace("/APPL\r\n", "/APPL\r\nLINE_TRACK;\r\n  LINE_TRACK_SCHEDULE_NUMBER      : 1;\r\n");
    let programs = read(vec![File { bytes: text.into_bytes(), ..file }], &cell());
    let told = programs.ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("moves with an external axis or a conveyor (PART.LS, line 6)"), "{told}");
}

#[test]
fn joint_positions_need_an_arm_that_counts_joint_3_against_the_horizontal() {
    let arm =
        |text: &str| toml::from_str::<crate::kinematics::RobotFile>(text).unwrap().arm().unwrap();
    let mut programs = programs("J P[3] 5% FINE\nL P[1] 5mm/sec FINE", "");
    programs.hold_joints(&arm(include_str!("../../../pipelines/robots/r2000ic-165f.toml")));
    assert!((0..2).all(|index| programs.ask(index, &cell()).is_ok()));
    programs.hold_joints(&arm(include_str!("../../../pipelines/robots/kr210-r2700-extra.toml")));
    for index in 0..2 {
        let told = programs.ask(index, &cell()).unwrap_err().to_string();
        assert!(told.contains("FANUC counts joint 3 against the horizontal"), "{told}");
    }
}

#[test]
fn of_two_programs_of_one_name_none_is_called() {
    let other = |folder: &str, statement: &str| {
        let text = format!("/PROG  OTHER\r\n/MN\r\n   1:  {statement} ;\r\n/POS\r\n/END\r\n");
        File { name: format!("{folder}/other.ls"), bytes: text.into_bytes() }
    };
    let body = "  UFRAME_NUM=1\n  UTOOL_NUM=2\nJ P[1] 5% FINE\n  CALL OTHER\nJ P[4] 5% FINE";
    let told = |others: &[File]| {
        let files = [&[listing(body, "")], others].concat();
        let found = read(files, &cell()).ask(1, &cell());
        found.map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    let [sets, waits] = [other("a", "UFRAME_NUM=0"), other("b", "WAIT 1.00(sec)")];
    assert_eq!(told(std::slice::from_ref(&waits)), "ok");
    let twice = told(&[sets, waits]);
    assert!(twice.contains("the call of OTHER (PART.LS, line 9) may change the"), "{twice}");
}

#[test]
fn further_points_are_statements_with_positions_behind_all_others_and_later_ones_get_other_numbers()
{
    let body = "J P[1] 5% FINE\nL P[2] 100mm/sec CNT50 ACC80\nC P[4] @ P[2:way (] 100mm/sec FINE\n\
                L P[1] 2sec FINE\nL P[2] 9mm/sec FINE TB .5sec,CALL A\nL P[1] R[1]mm/sec CNT100 Offset";
    let more = "P[17]{\r\n   GP1:\r\n\tUF : 1, UT : 2,\tJ1= 0 deg\r\n};\r\n";
    let text = String::from_utf8(listing(body, more).bytes).unwrap();
    let bytes = text.replace(" @ ", "\r\n    :  ").into_bytes();
    let programs = read(vec![File { name: "PART.LS".to_owned(), bytes }], &cell());
    let told: Vec<_> = programs.paths.iter().map(|path| programs.may_split(path)).collect();
    let alone = "its time or an option is for it alone";
    assert_eq!(told[1..], [Ok(()), Ok(()), Err(alone), Err(alone), Err(alone)]);
    let at = |x: f64| Further {
        frame_from_tool: nalgebra::Isometry3::translation(x, 2.5, 3.0),
        joints: vec![0.0, 0.0, 0.0, -190.0, 0.0, 540.0],
    };
    let added = [(2, vec![at(7.0), at(8.0)]), (1, vec![at(5.0), at(6.0)])];
    let added = added.map(|(path, points)| programs.added(&programs.paths[path], &points).unwrap());
    let mut edits = programs.lines(added.iter()).remove(0);
    let file = &programs.files[0];
    edits.extend(marks(file, "run r", "t-1", &edits));
    let written = applied(&file.bytes, &edits);
    let text = String::from_utf8_lossy(&written);
    let statements = "   1:J P[1] 5% FINE ;\r\n   2:L P[18:posegrid] 100mm/sec CNT50 ACC80    ;\r\n\
                      \x20  3:L P[19:posegrid] 100mm/sec CNT50 ACC80    ;\r\n   4:L P[2] 100mm/sec CNT50 ACC80 ;\r\n\
                      \x20  5:C P[20:posegrid]\r\n    :  P[21:posegrid] 100mm/sec FINE    ;\r\n\
                      \x20  6:C P[4]\r\n    :  P[2:way (] 100mm/sec FINE ;\r\n   7:L P[1] 2sec FINE ;\r\n";
    assert!(text.contains(statements), "{text}");
    let last = "  10:  !corrected by posegrid ;\r\n";
    assert!(
        text.contains("   9:L P[1] R[1]mm/sec CNT100 Offset ;\r\n") && !text.contains(last),
        "{text}"
    );
    assert!(
        text.contains("LINE_COUNT\t= 14;")
            && text.contains("  13:  !corrected by posegrid ;\r\n  14:  !run r ;")
    );
    let entry = "P[18:\"posegrid\"]{\r\n   GP1:\r\n\tUF : 1, UT : 2,\t\tCONFIG : 'F D B, 0, -1, 2',\r\n\
                 \tX = 5.000 mm, Y = 2.500 mm, Z = 3.000 mm,\r\n\tW = 0.000 deg, P = 0.000 deg, R = 0.000 deg\r\n};\r\nP[19:";
    assert!(
        text.contains(&(more.to_owned() + entry)) && text.ends_with("};\r\n/END\r\n"),
        "{text}"
    );
    assert_eq!(undone(&written, &file.bytes, &edits), file.bytes);
    let again = read(vec![File { bytes: written, ..file.clone() }], &cell());
    assert_eq!(again.paths.len(), programs.paths.len() + 3);
}

#[test]
fn what_a_plc_does_along_a_motion_keeps_its_numbers_and_marks_stand_behind_the_greatest() {
    let body = "J P[1] 5% FINE\nL P[2] 100mm/sec FINE\nL P[1] 100mm/sec FINE";
    let text = String::from_utf8(listing(body, "").bytes).unwrap();
    let within =
        "      1:  TC_ONLINE (ON) ;\r\n     41:  DO[23]=OFF ;\r\n       ------ ;\r\n   2:L";
    let text = text.replacen("   2:L", within, 1).replace("LINE_COUNT\t= 9", "LINE_COUNT\t= 2");
    let programs = read(vec![File { name: "PART.LS".to_owned(), bytes: text.into() }], &cell());
    let point = Further {
        frame_from_tool: nalgebra::Isometry3::translation(5.0, 2.5, 3.0),
        joints: vec![0.0; 6],
    };
    let added = programs.added(&programs.paths[1], &[point]).unwrap();
    let mut edits = programs.lines([&added].into_iter()).remove(0);
    edits.extend(marks(&programs.files[0], "run r", "t-1", &edits));
    let text = String::from_utf8(applied(&programs.files[0].bytes, &edits)).unwrap();
    let numbers = text.lines().filter_map(|line| line.split_once(':')?.0.trim().parse().ok());
    assert_eq!(numbers.collect::<Vec<u32>>(), [1, 1, 41, 2, 3, 4, 5, 6], "{text}");
    assert!(text.contains("LINE_COUNT\t= 6;"), "{text}");
}

#[test]
fn a_statement_is_known_by_its_form_and_any_words_may_be_a_macro() {
    let under =
        |own: &str| format!("  UFRAME_NUM=1\n  UTOOL_NUM=2\nJ P[1] 5% FINE\n{own}\nJ P[4] 5% FINE");
    for own in [
        "GO TO HOME POS",
        "END OF ARM TOOL",
        "WAIT TOOL CHANGE",
        "PAYLOAD CHANGE",
        "C TOOL CHANGE",
        "ARC START TORCH",
        "TRACK HOME POS",
        "PR GET OFFSET",
        "RUN CLEANER",
    ] {
        let told = verdicts(&under(own), "").pop().unwrap();
        assert!(told.contains(&format!("the call of {own}")), "{own}: {told}");
        let text = cell();
        let cell = Cell { harmless: vec![own.to_lowercase()], ..text };
        let programs = read(vec![listing(&under(own), "")], &cell);
        assert!(programs.ask(1, &cell).is_ok(), "{own}");
    }
    for own in [
        "WAIT DI[1]=ON TIMEOUT,LBL[1]\nLBL[1]",
        "WAIT   .50(sec)",
        "WAIT (DI[1] AND DI[2])",
        "Arc Start[1,2]",
        "Weave Figure 8[1]",
        "Weave End",
        "OFFSET CONDITION PR[1]",
        "PAYLOAD[2]",
        "OVERRIDE=50%",
        "COL DETECT ON",
        "VISION RUN_FIND 'A'",
        "MESSAGE[part in]",
        "$SHELL_CFG.$NUM=1",
    ] {
        assert_eq!(verdicts(&under(own), "").pop().unwrap(), "ok", "{own}");
    }
}

#[test]
fn a_position_without_frames_of_its_own_may_be_one_that_is_worked_out() {
    let frames = "  UTOOL_NUM=2\n  UFRAME_NUM=1\n";
    let told = verdicts(&format!("{frames}J P[1] 5% FINE\nJ P[4] 5% FINE\nJ P[R[1]] 5% FINE"), "");
    assert_eq!(told[0], "ok");
    assert!(told[1].contains("it is also read in PART.LS, line 10"), "{told:?}");
}

#[test]
fn a_refused_motion_states_no_arm_configuration() {
    for own in ["J P[3] 5% FINE\nJ P[2] 5% FINE INC", "P[2]=JPOS\nJ P[2] 5% FINE"] {
        let told = verdicts(&format!("{own}\nL P[1] 9mm/sec FINE"), "").pop().unwrap();
        assert!(
            told.contains("is not known, and with it") || told.contains("worked out"),
            "{own}: {told}"
        );
    }
}
