use crate::tests::{only_lines, undone};
use crate::write::{Command, applied, edits, marks};
use crate::{Branch, Cell, File, Further, Programs, Wanted, Way, read};

fn cell() -> Cell {
    let text = "[frames]\nbase_frame = { found = \"surveyed\", place = { xyz_mm = [0.0, 0.0, 100.0], quaternion_xyzw = [0.0, 0.0, 0.0, 1.0] } }\n\
                \"wobj1.uframe\" = { found = \"surveyed\" }\ntool1 = { found = \"surveyed\" }\n[motions]\nMyMoveL = \"MoveL\"\n";
    toml::from_str(text).unwrap()
}

const DATA: &str = "MODULE M1\r\n  PERS tooldata tool1:=[TRUE,[[0,0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\r\n\
  TASK PERS wobjdata wobj1:=[FALSE,TRUE,\"\",[[1000,0,500],[0.707106781,0,0,0.707106781]],[[0,0,0],[1,0,0,0]]];\r\n\
  PERS wobjdata held:=[TRUE,TRUE,\"\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\r\n\
  PERS wobjdata moved:=[FALSE,FALSE,\"STN1\",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\r\n\
  CONST robtarget p10:=[[10,20,30],[0,0,1,0],[0,-1,2,0],[9E9,9E+09,9E9,9E9,9E9,9E9]];\r\n";

fn programs(body: &str, more: &str) -> Programs {
    let text = format!(
        "%%%\r\nVERSION:1\r\n%%%\r\n{DATA}{more}\r\n  PROC main()\r\n{body}\r\n  ENDPROC\r\nENDMODULE\r\n"
    );
    let text = text.replacen("%%%\r\nVERSION:1\r\n%%%\r\n", "", 1);
    read(vec![File { name: "m1.mod".to_owned(), bytes: text.into_bytes() }], &cell())
}

fn verdicts(body: &str, more: &str) -> Vec<String> {
    let programs = programs(body, more);
    let told = |index| {
        programs.ask(index, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    (0..programs.positions.len()).map(told).collect()
}

fn only(body: &str, more: &str) -> String {
    let all = verdicts(body, more);
    assert_eq!(all.len(), 1, "{body}: {all:?}");
    all[0].clone()
}

#[test]
fn a_position_stands_in_its_work_object_and_that_in_the_world() {
    let programs = programs("MoveL p10,v100,fine,tool1\\WObj:=wobj1;", "");
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Pose { base_from_tool, branches, .. } = asked.wanted else { panic!("a pose") };
    let expected = [1000.0 - 20.0, 10.0, 500.0 + 30.0 - 100.0];
    for (found, expected) in base_from_tool.translation.vector.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-6, "{base_from_tool}");
    }
    assert_eq!(branches, [Branch::Quadrants([0, -1, 2, 0])]);
}

#[test]
fn a_tool_that_is_set_to_what_its_declaration_states_is_known() {
    let set = |x: &str| {
        let tool = format!("[TRUE,[[{x},0,200],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]]");
        only(&format!("tool1:={tool}; MoveL p10,v100,fine,tool1\\WObj:=wobj1;"), "")
    };
    assert_eq!(set("0.000"), "ok");
    assert!(set("0.001").contains("TOOL1 is worked out at run time"), "{}", set("0.001"));
}

#[test]
fn what_a_function_or_a_trap_in_no_file_may_change_is_not_known() {
    let behind =
        |statement: &str| only(&format!("{statement} MoveJ p10,v100,fine,tool1\\WObj:=wobj1;"), "");
    for unknown in ["b:=fSet(wobj1);", "IF fSet(wobj1) THEN ENDIF", "WaitUntil fSet(wobj1);"] {
        let told = behind(unknown);
        assert!(told.contains("the call of FSET (m1.mod, line "), "{unknown}: {told}");
        let told = behind(&format!("{unknown} PDispOff;"));
        assert!(told.contains("WOBJ1 is worked out at run time"), "{unknown}: {told}");
    }
    for known in
        ["p:=CRobT(\\Tool:=tool1\\WObj:=wobj1);", "IF NOT (n=1) AND (n<Dim(a,1)) THEN ENDIF"]
    {
        assert_eq!(behind(known), "ok", "{known}");
    }
    let trapped = only(
        "CONNECT i1 WITH tUnseen; MoveJ p10,v100,fine,tool1\\WObj:=wobj1; MoveL p10,v100,fine,tool1\\WObj:=wobj1;",
        "",
    );
    assert!(trapped.contains("TUNSEEN"), "{trapped}");
}

#[test]
fn every_form_of_a_motion_is_read() {
    let bodies = [
        "MoveJ p10,v100,fine,tool1;",
        "MoveL\\Conc,p10,v100\\V:=5,z10\\Inpos:=inpos20,tool1\\WObj:=wobj1\\TLoad:=load1;",
        "movel p10 , v100 , z10 , tool1 \\wobj:= wobj1 ;",
        "MoveLDO p10,v100,z10,tool1\\WObj:=wobj1,do1,1;",
        "TriggL p10,v100,trig1\\T2:=trig2,z10,tool1;",
        "ArcL p10,v100,seam1,weld1\\Weave:=weave1,z1,tool1\\WObj:=wobj1;",
        "SpotL p10,v100,gun1,spot1,tool1;",
        "DispL\\On,p10,v100,bead1,z10,tool1\\WObj:=wobj1;",
        "MyMoveL p10,v100,z10,tool1;",
        "IF a=1 MoveL p10,v100,z10,tool1;",
        "IF (a=1 AND b) OR c>2 THEN MoveL p10,v100,z10,tool1; ELSEIF d THEN stop; ENDIF",
        "TEST a CASE 1,2: MoveL p10,v100,z10,tool1; DEFAULT: Stop; ENDTEST",
        "FOR i FROM 1 TO 3 DO MoveL Offs(p10,0,0,i),v100,z10,tool1; ENDFOR",
        "MoveL RelTool(p10,0,0,-5\\Rx:=2),v100,z10,tool1;",
        "MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\\NoEOffs,v100,fine,tool1;",
        "MoveC p10,[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z10,tool1;",
    ];
    for body in bodies {
        let programs = programs(body, "");
        assert!(programs.computed.is_empty(), "{body}");
        let last = programs.positions.len() - 1;
        let told = programs.ask(last, &cell());
        assert!(told.is_ok(), "{body}: {told:?}");
    }
}

#[test]
fn what_is_not_known_is_refused_by_name() {
    let cases = [
        ("MoveL p10,v100,z10,tool9;", "TOOL9 has no value in the files given"),
        ("MoveL p10,v100,z10,tools{i};", "tools{i} is worked out"),
        ("MoveL p10,v100,z10,tool1\\WObj:=held;", "the tool stands in the cell"),
        ("MoveL p10,v100,z10,tool1\\WObj:=moved;", "MOVED moves with an external axis"),
        (
            "wobj1.oframe:=f1; MoveL p10,v100,z10,tool1\\WObj:=wobj1;",
            "WOBJ1 is worked out at run time",
        ),
        (
            "Other; MoveL p10,v100,z10,tool1;",
            "the call of OTHER (m1.mod, line 9) may change the displacement",
        ),
        (
            "Calibrate wobj1; PDispOff; MoveL p10,v100,z10,tool1\\WObj:=wobj1;",
            "WOBJ1 is worked out at run time",
        ),
        ("PDispOn p5,tool1; MoveL p10,v100,z10,tool1;", "a displacement may be on (PDisp)"),
        ("PDispSet pose1; MoveL p10,v100,z10,tool1;", "POSE1"),
        ("EOffsOn p1; MoveL p10,v100,z10,tool1;", "a displacement may be on (EOffs)"),
        ("MoveL p10\\ID:=5,v100,z10,tool1;", "MOVEL with \\ID is not followed"),
        ("SearchL di1,ps,p10,v100,tool1;", "SEARCHL is not followed"),
        ("p10.trans.x:=5; MoveL p10,v100,z10,tool1;", "P10 is worked out at run time"),
        ("p20:=p10; MoveL p10,v100,z10,tool1;", "it is also read in m1.mod"),
        (
            "MoveL p10,v100,z10,tool1; MoveL p10,v100,z10,tool1\\WObj:=wobj1;",
            "it is used under base none with tool TOOL1",
        ),
        (
            "ConfL\\Off; MoveL p10,v100,z10,tool1;",
            "no motion before it states an arm configuration",
        ),
        (
            "%\"any\"%;\n%stName%; PDispOff; ConfL\\Off; MoveL p10,v100,z10,tool1;",
            "the call of %…% (m1.mod, line 10) may change the arm",
        ),
        ("MoveL p10,v100,z10,tool1; ERROR PDispSet pose1; RETRY;", "a displacement may be on"),
        (
            "MoveL p10,v100,z10,tool1; ENDPROC TRAP t1 PDispSet pose1; ENDTRAP PROC q()",
            "a displacement may be on",
        ),
        ("IF a THEN MoveL p10,v100,z10,tool1;", "the blocks of routine"),
    ];
    for (body, expected) in cases {
        let told = only(body, "");
        assert!(told.contains(expected), "{body}\n{told}");
    }
}

#[test]
fn a_displacement_by_constant_data_stands_behind_the_work_object() {
    let pose = "  PERS pose up:=[[0,50,0],[1,0,0,0]];\r\n";
    let programs = |body: &str| programs(body, pose);
    let mut cell = cell();
    cell.frames.insert("up".to_owned(), cell.frames["tool1"].clone());
    let place = |body: &str| {
        let programs = programs(body);
        let last = programs.positions.len() - 1;
        programs.ask(last, &cell).map(|asked| match asked.wanted {
            Wanted::Pose { base_from_tool, .. } => {
                base_from_tool.translation.vector.as_slice().to_vec()
            }
            Wanted::Joints(joints) => joints,
        })
    };
    let moves = "MoveL p10,v100,fine,tool1\\WObj:=wobj1;";
    let near = |own: &[f64], x: f64| (own[0] - x).abs() < 1e-6 && (own[1] - 10.0).abs() < 1e-6;
    // The work object is turned by a quarter: its y leads along −x.
    assert!(near(&place(moves).unwrap(), 980.0));
    assert!(near(&place(&format!("PDispSet up; {moves}")).unwrap(), 930.0));
    assert!(near(&place(&format!("PDispSet up; PDispOff; {moves}")).unwrap(), 980.0));
    let joints = "MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool1;";
    assert!((place(&format!("PDispSet up; {joints}")).unwrap()[4] - 30.0).abs() < 1e-9);
    let same = format!("up:=[[0,50.0,0],[1,0,0,0]]; PDispSet up; {moves}");
    assert!(near(&place(&same).unwrap(), 930.0));
    let told = place(&format!("up.trans.x:=5; PDispSet up; {moves}")).unwrap_err().to_string();
    assert!(told.contains("UP is worked out at run time"), "{told}");
    assert!(
        only(&format!("PDispSet up; {moves}"), pose).contains("UP"),
        "how it was found is not said"
    );
}

#[test]
fn a_part_on_the_arm_is_moved_to_a_tool_that_stands() {
    let fixed = "  PERS tooldata torch:=[FALSE,[[1000,0,600],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\r\n\
                 PERS wobjdata part:=[TRUE,TRUE,\"\",[[0,0,50],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\r\n";
    let mut cell = cell();
    for name in ["torch", "part.uframe"] {
        cell.frames.insert(name.to_owned(), cell.frames["tool1"].clone());
    }
    let programs = programs("MoveL p10,v100,fine,torch\\WObj:=part;", fixed);
    let asked = programs.ask(0, &cell).unwrap();
    let Wanted::Pose { base_from_tool, .. } = &asked.wanted else { panic!("a pose") };
    // The torch is at (10, 20, 30) of the part, which is turned by half a turn about y; the base stands at z = 100.
    let place = base_from_tool.translation.vector;
    let expected = nalgebra::Vector3::new(1000.0 + 10.0, -20.0, 600.0 - 100.0 + 30.0);
    assert!((place - expected).norm() < 1e-6, "{place}");
    assert!((asked.flange_from_tool.translation.vector.z - 50.0).abs() < 1e-9);
    // The part is moved by 1 mm along the base's x: the torch, seen from it, by 1 mm along its x.
    let mut to = *base_from_tool;
    to.translation.vector.x += 1.0;
    let command = Command { base_from_tool: Some(to), joints: None };
    let edits = edits(&programs.positions[0], &asked, &command);
    let texts: Vec<&str> = edits.all.iter().map(|edit| edit.text.as_str()).collect();
    assert_eq!(texts, ["11.0000"], "x of p10");
    let up = format!("{fixed}PERS pose up:=[[0,0,7],[1,0,0,0]];\r\n");
    let moved = self::programs("PDispSet up; MoveL p10,v100,fine,torch\\WObj:=part;", &up);
    cell.frames.insert("up".to_owned(), cell.frames["tool1"].clone());
    let moved = moved.ask(0, &cell).unwrap();
    assert!((moved.flange_from_tool.translation.vector.z - 57.0).abs() < 1e-9, "behind the part");
    for refused in [
        "MoveL p10,v100,fine,tool1\\WObj:=part;",
        "MoveL p10,v100,fine,torch\\WObj:=wobj1;",
        "MoveL p10,v100,fine,torch;",
        "MoveC p10,p10,v100,fine,torch\\WObj:=part;",
    ] {
        let told = self::programs(refused, fixed).ask(0, &cell).unwrap_err().to_string();
        assert!(told.contains("in RAPID alone"), "{refused}: {told}");
    }
}

#[test]
fn main_begins_without_what_no_cycle_leaves_on() {
    let moves = "MoveL p10,v100,z10,tool1;";
    let pair = "PROC sub() PDispOn p5,tool1; PDispOff; ENDPROC ";
    assert_eq!(only(&format!("{moves} sub;"), pair), "ok");
    assert_eq!(only(&format!("{moves} IF a THEN ConfL\\Off; ConfL\\On; ENDIF"), ""), "ok");
    let on = "PROC sub() PDispOn p5,tool1; ENDPROC ";
    let lefts =
        ["sub;", "IF a THEN sub; ENDIF", "IF a RETURN;", "PDispOn p5,tool1; ExitCycle; PDispOff;"];
    let more = [
        // What nothing calls the controller may call at its events; who calls `main` begins it with what holds there.
        ("", "PROC atStart() sub; ENDPROC PROC sub() PDispOn p5,tool1; ENDPROC "),
        ("sub; PDispOff;", "PROC sub() PDispOn p5,tool1; main; ENDPROC "),
    ];
    for (left, more) in lefts.map(|left| (left, on)).into_iter().chain(more) {
        assert!(only(&format!("{moves} {left}"), more).contains("(PDisp)"), "{left}");
    }
    for unseen in ["Other;", "Other; PDispOff;"] {
        let told = only(&format!("{moves} {unseen}"), "");
        assert!(
            told.contains("the call of OTHER (m1.mod, line 9) may change the displacement"),
            "{told}"
        );
    }
}

#[test]
fn a_loop_begins_each_pass_with_what_none_leaves_otherwise() {
    let moves = "MoveL p10,v100,z10,tool1;";
    let pass = |rest: &str| only(&format!("WHILE TRUE DO {moves} {rest} ENDWHILE"), "");
    assert_eq!(pass("PDispOn p5,tool1; PDispOff;"), "ok");
    assert_eq!(pass("FOR i FROM 1 TO 3 DO PDispOn p5,tool1; ENDFOR PDispOff;"), "ok");
    for left in [
        "PDispOn p5,tool1;",
        "PDispOn p5,tool1; IF a THEN PDispOff; ENDIF",
        "IF a RETURN; PDispOn p5,tool1;",
    ] {
        assert!(pass(left).contains("displacement"), "{left}: {}", pass(left));
    }
    assert_eq!(only(&format!("WHILE a DO PDispOn p5,tool1; PDispOff; ENDWHILE {moves}"), ""), "ok");
}

#[test]
fn a_displacement_that_is_off_again_is_off() {
    assert_eq!(only("PDispOn p5,tool1; PDispOff; MoveL p10,v100,z10,tool1;", ""), "ok");
    // Where a routine begins it is known by its calls, which all stand in the files where `main` does.
    let moves = "PROC there()\r\nMoveL p10,v100,z10,tool1;\r\nENDPROC\r\n";
    let other = format!("{moves}PROC other()\r\nPDispOn p5,tool1;\r\nENDPROC\r\n");
    assert_eq!(only("PDispOff; there;", &other), "ok");
    let mut file = programs("PDispOff; there;", &other).files.remove(0);
    let text = String::from_utf8(file.bytes).unwrap().replace("PROC main()", "PROC part()");
    file.bytes = text.into_bytes();
    assert!(read(vec![file], &cell()).ask(0, &cell()).is_err());
    for set in [
        "PDispOn p5,tool1; there;",
        "there; PDispOn p5,tool1; there;",
        "PDispOn p5,tool1; %\"there\"%;",
    ] {
        assert!(only(set, moves).contains("(PDisp)"), "{set}");
    }
    let function = "FUNC bool there()\r\nMoveL p10,v100,z10,tool1;\r\nENDFUNC\r\n";
    assert!(only("PDispOn p5,tool1; b:=there();", function).contains("(PDisp)"));
    let body = "EOffsSet [N,0,0,0,0,0]; MoveL p10,v100,z10,tool1;";
    assert!(only(body, "").contains("(EOffs)"));
    let apart = Cell { external_axes: Some(crate::ExternalAxes::Apart), ..cell() };
    let programs = read(programs(body, "").files, &apart);
    assert!(programs.ask(0, &apart).is_ok(), "external axes carry neither the arm nor the part");
}

#[test]
fn linear_motions_go_on_in_the_configuration_where_confl_is_off() {
    let programs = programs(
        "ConfL\\Off; MoveJ p10,v100,z10,tool1; MoveL [[1,2,3],[1,0,0,0],[9,9,9,9],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,z10,tool1;",
        "",
    );
    let Ok(asked) = programs.ask(1, &cell()) else { panic!("asked") };
    let Wanted::Pose { branches, .. } = asked.wanted else { panic!("a pose") };
    assert_eq!(branches, [Branch::Of(0)]);
}

#[test]
fn each_task_of_a_backup_has_its_own_names_and_only_one_may_move() {
    let task = |number: u32, body: &str| File {
        name: format!("RAPID/TASK{number}/PROGMOD/m.mod"),
        bytes: format!("{DATA}PROC main()\n{body}\nENDPROC\nENDMODULE").into_bytes(),
    };
    let moves = "MoveL p10,v100,fine,tool1;";
    let told = |second: &str| {
        let programs = read(vec![task(1, moves), task(2, second)], &cell());
        programs.ask(0, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    assert_eq!(told("Stop;"), "ok");
    assert!(told("tool1.tframe.trans.z:=5;").contains("TOOL1 is worked out at run time"));
    assert!(told(moves).contains("motions stand in the tasks TASK1, TASK2"));
}

#[test]
fn a_module_of_a_backup_that_no_task_has_is_refused_and_hinders_none() {
    let file = |name: &str| File {
        name: name.to_owned(),
        bytes: format!("{DATA}PROC main()\nMoveL p10,v1,z1,tool1;\nENDPROC\nENDMODULE")
            .into_bytes(),
    };
    let files = ["HOME/T_ROB2/m.mod", "RAPID/TASK1/PROGMOD/m_T_ROB1.mod"].map(file);
    let programs = read(files.to_vec(), &cell());
    let told = programs.ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("outside the folders of the tasks"), "{told}");
    assert!(programs.ask(1, &cell()).is_ok());
}

#[test]
fn a_tool_that_a_routine_only_moves_is_known() {
    let moves = "PDispOff; MoveL p10,v100,fine,tool1;";
    let own = |inside: &str| {
        format!(
            "{moves} Go tool1; ENDPROC PROC Go(PERS tooldata t) {inside} ENDPROC PROC Deep(PERS tooldata u) u.tframe.trans.z:=1;"
        )
    };
    assert_eq!(verdicts(&own("MoveL CRobT(),v100,fine,t;"), ""), ["ok"]);
    for inside in ["Deep t;", "IF a Deep t;", "t.tload.mass:=2;", "CalibTool t;", "%name% t;"] {
        let told = &verdicts(&own(inside), "")[0];
        assert!(told.starts_with("TOOL1 is worked out at run time"), "{inside}\n{told}");
    }
}

#[test]
fn instructions_of_the_controller_change_what_they_write_alone() {
    let source = |more: &str| {
        format!("ConfL\\Off; MoveJ p10,v1,fine,tool1; {more} MoveL p10,v1,fine,tool1;")
    };
    for more in ["SkipWarn;", "TPReadNum n,\"?\";", "WZDOSet\\Stat,w\\Inside,s,do1,1;"] {
        assert_eq!(only(&source(more), ""), "ok", "{more}");
    }
    for more in
        ["GetDataVal \"t\",tool1;", "SetDataVal \"t\"+n,t2;", "SetAllDataVal \"tooldata\",t;"]
    {
        let told = only(&source(more), "");
        assert!(told.contains(" is worked out at run time"), "{more}\n{told}");
    }
    let passed = programs(
        "Go(p10); Go (p10),[1,2]; Go(Offs(p10,1,2,3)); Go 5\\At:=p10; %nm% p10; b:=f(p10);",
        "",
    );
    let computed: Vec<&str> = passed.computed.iter().map(|own| own.text.as_str()).collect();
    assert_eq!(computed, ["p10", "p10", "Offs(p10,1,2,3)", "p10", "p10", "p10"]);
}

#[test]
fn statements_end_where_a_sign_is_missing() {
    let missing = "MoveL p10,v1,z1,tool1 MoveL p10,v1,z1,tool1; IF a MoveL p10,v1,z1,tool1;; MoveL p10,v1,z1,tool1; TEST n; MoveL p10,v1,z1,tool1;";
    let programs = programs(missing, "");
    assert_eq!((programs.paths.len(), programs.computed.len()), (5, 0));
    let told = programs.ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("the blocks of routine MAIN do not close"), "{told}");
}

#[test]
fn arrays_and_what_is_passed_on_are_counted() {
    let more = "CONST robtarget a{2}:=[[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],\r\n\
                [[4,2,3],[1,0,0,0],[0,0,0,0],[1000,9E9,9E9,9E9,9E9,9E9]]]; PERS robtarget b{2};";
    let body = "MoveL a{1},v100,z10,tool1; MoveJ a{i},v100,z10,tool1; Weld p10,Offs(p10,0,0,5); Weld b{i},[[0,0,0,0,9,0],[9E9,9E9,9E9,9E9,9E9,9E9]],b{1}.trans.x; MoveL CRobT(),v100,z10,tool1; MoveL *,v1,z1,tool1;";
    let programs = programs(body, more);
    let names: Vec<&str> = programs.positions.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["A[1]", "A[2]"]);
    assert_eq!(programs.positions[1].line, programs.positions[0].line + 1);
    let computed: Vec<String> =
        programs.computed.iter().map(|own| format!("{} {}", own.word, own.text)).collect();
    let passed = ["WELD p10", "WELD Offs(p10,0,0,5)", "WELD b{i}"];
    assert_eq!(computed[..3], passed);
    assert!(computed[3].starts_with("WELD [[0,0,0,0,9,0]"), "{computed:?}");
    assert_eq!(computed[4..], ["MOVEL CRobT()", "MOVEL *"]);
    assert!(programs.ask(1, &cell()).unwrap_err().to_string().contains("eax_a is at 1000"));
}

#[test]
fn only_numbers_and_marks_change_and_both_are_taken_out_again() {
    let programs = programs("MoveL p10,v100,fine,tool1\\WObj:=wobj1;", "");
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Pose { base_from_frame, base_from_tool, .. } = &asked.wanted else {
        panic!("a pose")
    };
    let mut to = base_from_frame.inverse() * base_from_tool;
    to.translation.vector.x += 0.25;
    to.rotation *= nalgebra::UnitQuaternion::from_euler_angles(0.001, 0.0, 0.0);
    let command = Command {
        base_from_tool: Some(base_from_frame * to),
        joints: Some([
            vec![1.0, 0.0, 0.0, -0.001, 0.0, 200.0],
            vec![1.0, 0.0, 0.0, 0.002, 0.0, 200.0],
        ]),
    };
    let mut edits = edits(&programs.positions[0], &asked, &command);
    edits.all.extend(marks(&programs.files[0], "table t-1", "t-1", &[]));
    let written = applied(&programs.files[0].bytes, &edits.all);
    let text = String::from_utf8_lossy(&written);
    assert!(
        text.starts_with("MODULE M1\r\n! corrected by posegrid table t-1\r\nLOCAL CONST string posegrid_corrected:=\"t-1\";\r\n  PERS"),
        "{text}"
    );
    assert!(
        text.contains("p10:=[[10.2500,20,30],[0,0,0.99999987,-0.00050000],[0,0,2,0],[9E9,9E+09,"),
        "{text}"
    );
    assert_eq!(edits.crossed, 1);
    assert_eq!(undone(&written, &programs.files[0].bytes, &edits.all), programs.files[0].bytes);
    let again = File { name: "m1.mod".to_owned(), bytes: written };
    let told = read(vec![again], &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("corrected already by posegrid (m1.mod, line 2)"), "{told}");
}

#[test]
fn the_arms_base_is_that_of_the_only_robot_of_moc() {
    let text = "MOC:CFG_1.0:5:0::\r\n#\r\nROBOT:\r\n\r\n      -name \"ROB_1\" -use_robot_type \"IRB\" \\\r\n      -base_frame_pos_z 0.5\r\n#\r\n";
    let module = format!("{DATA}PROC main()\r\nMoveL p10,v100,fine,tool1;\r\nENDPROC\r\nENDMODULE");
    let files = vec![
        File { name: "SYSPAR/MOC.cfg".to_owned(), bytes: text.as_bytes().to_vec() },
        File { name: "m.mod".to_owned(), bytes: module.into_bytes() },
    ];
    let programs = read(files, &cell());
    let told = programs.ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("base_frame has another place"), "{told}");
    let mut cell = cell();
    cell.frames.get_mut("base_frame").unwrap().place = None;
    let asked = programs.ask(0, &cell).unwrap();
    let Wanted::Pose { base_from_tool, .. } = asked.wanted else { panic!("a pose") };
    assert!((base_from_tool.translation.vector.z - (30.0 - 500.0)).abs() < 1e-9);
}

#[test]
fn marks_stand_behind_the_head_of_a_module_wherever_that_ends() {
    let marked = |text: &str| {
        let file = File { name: "m.mod".to_owned(), bytes: text.as_bytes().to_vec() };
        String::from_utf8(applied(&file.bytes, &marks(&file, "t", "t", &[]))).unwrap()
    };
    let mark = "! corrected by posegrid t\nLOCAL CONST string posegrid_corrected:=\"t\";\n";
    assert_eq!(
        marked("MODULE M(SYSMODULE,\n  NOVIEW) ! note\nENDMODULE\n"),
        format!("MODULE M(SYSMODULE,\n  NOVIEW) ! note\n{mark}ENDMODULE\n")
    );
    assert_eq!(
        marked("MODULE M PROC main() ENDPROC\nENDMODULE\n"),
        format!("MODULE M\n{mark} PROC main() ENDPROC\nENDMODULE\n")
    );
    assert_eq!(marked("MODULE 1_T\nENDMODULE\n"), format!("MODULE 1_T\n{mark}ENDMODULE\n"));
    assert_eq!(marked("PROC p()\n"), "! corrected by posegrid t\nPROC p()\n");
}

#[test]
fn what_a_compact_if_or_a_search_changes_is_not_corrected() {
    let begin = "MoveL p20,v100,fine,tool1\\WObj:=wobj1;";
    let point = "PERS robtarget p20:=[[10,20,30],[0,0,1,0],[0,-1,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];";
    let cases = [
        ("IF di1=1 p20:=CRobT();", "P20 is worked out at run time"),
        ("IF a GetPos p20;", "P20 is worked out at run time"),
        ("IF a wobj1.uframe.trans.x:=5;", "WOBJ1 is worked out at run time"),
        ("PDispOff; IF a %\"disp\"+b%; ENDPROC PROC disp() PDispOn q,tool1;", "displacement"),
        (
            "a:=Fit(wobj1); ENDPROC FUNC bool Fit(PERS wobjdata w) w.uframe.trans.x:=5; RETURN TRUE; ENDFUNC PROC q()",
            "WOBJ1 is worked out at run time",
        ),
        ("SearchL\\Stop,di1,p20,p10,v100,tool1;", "P20 is worked out at run time"),
        ("ArcL p20,v1,seam1,weld1,fine,tool1\\WObj:=wobj1\\Track:=track1;", "ARCL with \\TRACK"),
    ];
    for (more, expected) in cases {
        let (first, rest) = more.split_once(" ENDPROC").unwrap_or((more, ""));
        let rest = if rest.is_empty() { String::new() } else { format!("\r\nENDPROC{rest}") };
        let programs = programs(&format!("{first}{begin}{rest}"), point);
        let index = programs.positions.iter().position(|own| own.name == "P20").unwrap();
        let told = programs.ask(index, &cell()).unwrap_err().to_string();
        assert!(told.contains(expected), "{more}\n{told}");
    }
}

#[test]
fn motions_of_two_arms_or_of_no_routine_are_refused() {
    let body = format!("{DATA}PROC main()\r\nMoveL p10,v1,z1,tool1;\r\nENDPROC\r\nENDMODULE\r\n");
    let other = body.replace("p10", "p11").replace("tool1", "tool2").replace("wobj1", "wobj2");
    let part = vec![
        File { name: "b_T_ROB1.mod".to_owned(), bytes: body.clone().into_bytes() },
        File { name: "b_T_ROB1_003.mod".to_owned(), bytes: other.clone().into_bytes() },
    ];
    assert!(read(part, &cell()).ask(0, &cell()).is_ok(), "one arm's program of two parts");
    let files = [("T_ROB1/a.mod", body), ("b_T_ROB2.mod", other)];
    let files = files.map(|(name, text)| File { name: name.to_owned(), bytes: text.into_bytes() });
    let told = read(files.to_vec(), &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("in the tasks T_ROB1, T_ROB2"), "{told}");
    let text = format!("{DATA}MoveL p10,v1,z1,tool1;");
    let alone = vec![File { name: "m.mod".to_owned(), bytes: text.into_bytes() }];
    let told = read(alone, &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("stands in no routine"), "{told}");
}

#[test]
fn the_constant_of_a_mark_stands_behind_types() {
    let text = "MODULE M\n LOCAL RECORD r\n num x;\n ENDRECORD ! r\n CONST num a:=1;\nENDMODULE\n";
    let file = File { name: "m.mod".to_owned(), bytes: text.as_bytes().to_vec() };
    let marked = String::from_utf8(applied(&file.bytes, &marks(&file, "t", "t", &[]))).unwrap();
    let head = "MODULE M\n! corrected by posegrid t\n LOCAL RECORD r\n num x;\n ENDRECORD ! r\n";
    assert!(
        marked.starts_with(&format!("{head}LOCAL CONST string posegrid_corrected:=\"t\";\n CONST")),
        "{marked}"
    );
}

#[test]
fn a_motion_leads_as_its_instruction_and_its_zone_say() {
    let other = "[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]";
    let body = format!(
        "MoveJ p10,v100,fine,tool1; MoveL {other},v100,z10,tool1; MoveC p10,{other},v100\\V:=5,FINE,tool1;\r\n\
         MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine\\Inpos:=inpos20,tool1;\r\n\
         TriggL p10,v100,trig1,fine,tool1; ArcL p10,v100,seam1,weld1,z1,tool1;"
    );
    let programs = programs(&body, "");
    let found: Vec<_> = programs.paths.iter().map(|path| (path.way, path.is_blended)).collect();
    let expected = [
        (Way::Joints, false),
        (Way::Straight, true),
        (Way::Circle, false),
        (Way::Joints, false),
        (Way::Straight, false),
        (Way::Straight, true),
    ];
    assert_eq!(found, expected);
    assert!(programs.paths[1..].iter().all(|path| path.from.is_some()));
}

#[test]
fn further_points_have_the_turns_of_their_joints_and_the_axes_of_the_end() {
    let other = "[[400,20,30],[0,0,1,0],[0,0,2,1],[9E9,9E+09,9E9,9E9,9E9,9E9]]";
    let body = format!(
        "MoveJ p10,v100,fine,tool1\\WObj:=wobj1;\r\n    MoveL {},v100\\V:=5,z10,tool1\\WObj:=wobj1; ! weld\r\n\
         IF a\r\n MoveL p10,v100,z10,tool1\\WObj:=wobj1;\r\nMoveL p10\\ID:=5,v100,z10,tool1\\WObj:=wobj1;\r\n\
         MoveL {other},v100,z10,tool1\\WObj:=wobj1;\r\nMoveL p10,v100,z10,tool1\\WObj:=wobj1;",
        other.replace(",1],[9E9", ",0],[9E9")
    );
    let programs = programs(&body, "");
    let told: Vec<_> = programs.paths.iter().map(|path| programs.may_split(path)).collect();
    let options = "it has options that are for it alone";
    assert_eq!(told[1..4], [Ok(()), Err("an IF decides on it"), Err(options)]);
    assert_eq!(told[5], Err("cfx is another at its begin"));
    let point = Further {
        frame_from_tool: nalgebra::Isometry3::from_parts(
            [200.0, 20.5, 30.0].into(),
            crate::rapid::quaternion([0.0, 0.0, 1.0, 0.0]).unwrap(),
        ),
        joints: vec![1.0, 0.0, 0.0, -0.5, 0.0, 200.0],
    };
    let edit = only_lines(&programs, &[point]);
    let expected = "    MoveL [[200.0000,20.5000,30.0000],[0.00000000,0.00000000,1.00000000,0.00000000],[0,-1,2,0],\
                    [9E9,9E+09,9E9,9E9,9E9,9E9]],v100\\V:=5,z10,tool1\\WObj:=wobj1; ! added by posegrid\r\n";
    assert_eq!(edit.text, expected);
    let written = applied(&programs.files[0].bytes, std::slice::from_ref(&edit));
    assert_eq!(undone(&written, &programs.files[0].bytes, &[edit]), programs.files[0].bytes);
}

#[test]
fn further_points_of_a_circle_are_circles_before_it() {
    let [helper, end] = [[200, 90], [400, 20]]
        .map(|[x, y]| format!("[[{x},{y},30],[0,0,1,0],[0,0,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"));
    let body = format!(
        "MoveJ p10,v100,fine,tool1\\WObj:=wobj1;\r\n MoveC {helper}, {end},v100\\V:=5,z10,tool1\\WObj:=wobj1;\r\n\
         MoveC {helper},{end},v100\\T:=5,z10,tool1\\WObj:=wobj1;"
    );
    let programs = programs(&body, "");
    let told: Vec<_> = programs.paths.iter().map(|path| programs.may_split(path)).collect();
    assert_eq!(told[1..], [Ok(()), Err("it has options that are for it alone")]);
    let point = |x: f64| Further {
        frame_from_tool: nalgebra::Isometry3::from_parts(
            [x, 20.5, 30.0].into(),
            crate::rapid::quaternion([0.0, 0.0, 1.0, 0.0]).unwrap(),
        ),
        joints: vec![1.0, 0.0, 0.0, -0.5, 0.0, 200.0],
    };
    let edit = only_lines(&programs, &[point(100.0), point(200.0)]);
    let value = |x: u32| {
        format!(
            "[[{x}.0000,20.5000,30.0000],[0.00000000,0.00000000,1.00000000,0.00000000],[0,-1,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]]"
        )
    };
    let expected = format!(
        " MoveC {}, {},v100\\V:=5,z10,tool1\\WObj:=wobj1; ! added by posegrid\r\n",
        value(100),
        value(200)
    );
    assert_eq!(edit.text, expected);
}

#[test]
fn names_of_latin_1_are_not_each_other() {
    // Ä of this module and Ö of all: a motion under Ö stands in Ö.
    let local = DATA.replace("TASK PERS wobjdata wobj1", "LOCAL PERS wobjdata w\u{c4}");
    let body = format!(
        "{local}  PROC main()\r\n    MoveL p10,v100,fine,tool1\\WObj:=w\u{d6};\r\n  ENDPROC\r\nENDMODULE\r\n"
    );
    let shared = "MODULE M2\r\n  PERS wobjdata w\u{d6}:=[FALSE,TRUE,\"\",[[7,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\r\nENDMODULE\r\n";
    let latin =
        |text: &str| text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect();
    let files = [("m1.mod", body.as_str()), ("m2.mod", shared)];
    let files =
        files.map(|(name, text)| File { name: name.to_owned(), bytes: latin(text) }).to_vec();
    let told = read(files, &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("[frames.\"W\u{d6}.UFRAME\"]"), "{told}");
}

#[test]
fn what_is_set_before_all_jumps_holds_at_labels() {
    let routine = "PROC again()\r\nConfJ\\On;\r\nl1:\r\nMoveJ p10,v100,fine,tool1;\r\nIF n<3 GOTO l1;\r\nENDPROC\r\n";
    assert_eq!(only("ConfJ\\Off;\r\nagain;", routine), "ok");
}

#[test]
fn a_routine_whose_error_its_caller_handles_ends_anywhere() {
    let sub = "ENDPROC PROC sub() PDispSet pose1; reg1:=1/reg2; PDispOff;";
    let body = |handler: &str| {
        only(&format!("sub; MoveL p10,v100,z10,tool1\\WObj:=wobj1; {handler} {sub}"), "")
    };
    assert_eq!(body(""), "ok");
    let handled = body("ERROR TRYNEXT;");
    assert!(handled.contains("displacement"), "{handled}");
    assert_eq!(body("ERROR RETRY;"), "ok");
    // RETRY begins the call again.
    let again = "PDispOff; sub; ERROR RETRY; ENDPROC PROC sub() MoveL p10,v100,z10,tool1\\WObj:=wobj1; PDispSet pose1; reg1:=1/reg2; PDispOff;";
    let again = again.replacen("PROC sub", "LOCAL PROC sub", 1);
    assert!(only(&again, "").contains("displacement"));
}

#[test]
fn behind_a_routine_holds_what_holds_wherever_it_returns() {
    let behind = |sub: &str, more: &str| {
        let body =
            format!("PDispOn p5,tool1; sub; MoveL p10,v100,z10,tool1; ENDPROC PROC sub() {sub}");
        only(&body, more)
    };
    let on = "FUNC bool f()\r\nPDispOn p5,tool1;\r\nRETURN TRUE;\r\nENDFUNC\r\nPROC off()\r\nPDispOff;\r\nENDPROC\r\n";
    assert_eq!(behind("PDispOff; IF a RETURN; Set do1;", ""), "ok");
    assert_eq!(behind("PDispOff; WHILE a DO RETURN; ENDWHILE", ""), "ok");
    for left in [
        "IF a RETURN; PDispOff;",
        "PDispOff; IF a THEN PDispOn p5,tool1; RETURN; ENDIF PDispOff;",
        "PDispOff; IF a RETURN f(); PDispOff;",
        "IF a off;",
    ] {
        assert!(behind(left, on).contains("displacement"), "{left}: {}", behind(left, on));
    }
}

#[test]
fn functions_of_the_files_do_what_they_do_wherever_they_stand() {
    let own = "FUNC bool f()\r\nPDispSet pose1;\r\nRETURN TRUE;\r\nENDFUNC\r\n";
    let calls = [
        "b:=f();",
        "IF f() THEN ENDIF",
        "IF b THEN ELSEIF f() THEN Stop; ENDIF",
        "WHILE f() DO ENDWHILE",
        "WHILE f() DO PDispOff; ENDWHILE",
        "IF f() Stop;",
        "TEST f() CASE TRUE: Stop; ENDTEST",
        "TPWrite \"\"\\Bool:=f();",
    ];
    for call in calls {
        let told = only(&format!("PDispOff; {call} MoveL p10,v100,z10,tool1;"), own);
        assert!(told != "ok", "{call}");
    }
    let off = "FUNC bool f()\r\nPDispOff;\r\nRETURN TRUE;\r\nENDFUNC\r\n";
    let told = only("PDispSet pose1; IF b ok:=f(); MoveL p10,v100,z10,tool1;", off);
    assert_ne!(told, "ok");
    let behind = "IF b THEN Stop; ELSEIF f() THEN Stop; ELSE MoveL p10,v100,z10,tool1; ENDIF";
    assert_ne!(only(behind, own), "ok");
    let moves = "PROC GlueL(robtarget p,speeddata v)\r\nPDispSet pose1;\r\nENDPROC\r\n";
    let all = verdicts("PDispOff; GlueL p10,v100; MoveL p10,v100,z10,tool1;", moves);
    assert!(all.iter().all(|own| own != "ok"), "{all:?}");
}

#[test]
fn what_writes_its_arguments_makes_them_unknown() {
    let add = "PROC upd(INOUT num n)\r\nAdd n,5;\r\nENDPROC\r\n";
    for call in [
        "ok:=StrToVal(s,wobj1);",
        "IF StrToVal(s,wobj1.uframe.trans.x) THEN ENDIF",
        "Clear wobj1.uframe.trans.z;",
        "Incr wobj1.uframe.trans.z;",
        "upd wobj1.uframe.trans.z;",
    ] {
        let told = only(&format!("{call} MoveL p10,v100,z10,tool1\\WObj:=wobj1;"), add);
        assert!(told.contains("WOBJ1 is worked out"), "{call}: {told}");
    }
}

#[test]
fn main_begins_with_what_its_last_cycle_and_its_callers_leave() {
    let body = "MoveL p10,v100,z10,tool1; ConfL\\Off;";
    assert!(
        only(body, "").contains("CONFL may be on or off")
            || only(body, "").contains("ConfL may be"),
        "{}",
        only(body, "")
    );
    assert_eq!(only(&format!("ConfL\\On; {body}"), ""), "ok");
    let caller = "PROC rStart()\r\nMoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool1;\r\nmain;\r\nENDPROC\r\n";
    let all = verdicts("ConfL\\Off; MoveL p10,v100,z10,tool1;", caller);
    assert!(
        all.iter().any(|own| own.contains("no motion before it states an arm configuration")),
        "{all:?}"
    );
}

#[test]
fn a_procedure_that_a_motion_names_is_called() {
    let shift = "PERS pose sh:=[[0,0,50],[1,0,0,0]];";
    let sync = |name: &str, called: &str| {
        let body = format!(
            "PDispOff;\r\nMoveLSync p10,v100,z10,tool1\\WObj:=wobj1,\"{name}\";\r\nMoveL p20,v100,fine,tool1\\WObj:=wobj1;\r\n\
             ENDPROC\r\nPROC pr()\r\n{called}"
        );
        let p20 =
            "CONST robtarget p20:=[[10,20,30],[0,0,1,0],[0,-1,2,0],[9E9,9E9,9E9,9E9,9E9,9E9]];";
        verdicts(&body, &format!("{shift}{p20}")).pop().unwrap()
    };
    assert_eq!(sync("pr", "SetDO do1,1;"), "ok");
    assert!(sync("pr", "PDispOn p10,tool1;").contains("the displacement is another"));
    assert!(sync("foreign", "SetDO do1,1;").contains("the call of FOREIGN"));
}

#[test]
fn a_motion_that_may_be_cleared_gets_no_further_points() {
    let split = |own: &str| {
        let body = format!(
            "MoveL p10,v100,fine,tool1\\WObj:=wobj1;\r\nENDPROC\r\nTRAP t1\r\nStopMove;\r\n{own}\r\nStartMove;\r\nENDTRAP\r\nPROC pr()"
        );
        programs(&body, "").paths[0].split.is_ok()
    };
    assert_eq!([split(""), split("ClearPath;")], [true, false]);
}

#[test]
fn an_if_in_an_if_is_not_followed() {
    let motion = "MoveL p10,v100,fine,tool1\\WObj:=wobj1;";
    assert!(
        only(&format!("IF a=1 IF b=2 {motion}"), "").contains("an IF in an IF is not followed")
    );
    assert_ne!(only(&format!("IF a=1 IF b=2 PDispSet sh;\r\n{motion}"), ""), "ok");
    let joints = "TriggAbsJ [[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,t1,fine,tool1;";
    assert_eq!(only(joints, ""), "ok");
}

#[test]
fn a_frame_that_file_and_cell_state_apart_is_refused() {
    let programs = programs("MoveL p10,v100,fine,tool1;", "");
    let placed = |z: &str| {
        let text = format!(
            "[frames]\nbase_frame = {{ found = \"surveyed\", place = {{ xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }} }}\n\
             tool1 = {{ found = \"surveyed\", place = {{ xyz_mm = [0, 0, {z}], quaternion_xyzw = [0, 0, 0, 1] }} }}\n"
        );
        programs.ask(0, &toml::from_str(&text).unwrap()).map(|_| ())
    };
    assert_eq!(placed("200"), Ok(()));
    assert!(placed("220").unwrap_err().to_string().contains("TOOL1 has another place"));
}
