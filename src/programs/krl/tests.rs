use crate::tests::{only_lines, undone};
use crate::write::{Command, applied, edits, marks};
use crate::{Asked, Branch, Cell, File, Further, Programs, Wanted, Way, read};

const CONFIG: &str = "DEFDAT $CONFIG\nBASE_DATA[1]={X 1000.0,Y 0.0,Z 500.0,A 90.0,B 0.0,C 0.0}\n\
BASE_DATA[2]={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nTOOL_DATA[3]={X 0.0,Y 0.0,Z 200.0,A 0.0,B 0.0,C 0.0}\n\
DECL GLOBAL E6AXIS XHOME={A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}\nENDDAT\n";
const MACHINE: &str =
    "DEFDAT $MACHINE PUBLIC\n$ROBROOT={X 0.0,Y 0.0,Z 100.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";

fn file(name: &str, text: impl AsRef<[u8]>) -> File {
    File { name: name.to_owned(), bytes: text.as_ref().to_vec() }
}

pub(crate) fn cell() -> Cell {
    let text = "[frames]\n\"$ROBROOT\" = { found = \"surveyed\" }\n\"BASE_DATA[1]\" = { found = \"surveyed\" }\n\
                \"BASE_DATA[2]\" = { found = \"surveyed\" }\n\"TOOL_DATA[3]\" = { found = \"surveyed\" }\n\
                \"$BASE\" = { found = \"surveyed\" }\n\"$TOOL\" = { found = \"taught\" }\n";
    toml::from_str(text).unwrap()
}

fn programs(source: &str, data: &str) -> Programs {
    let files = vec![
        file("$config.dat", CONFIG),
        file("$machine.dat", MACHINE),
        file("p.src", format!("&ACCESS RVP\r\nDEF P( )\r\n{source}\r\nEND\r\n")),
        file("p.dat", format!("DEFDAT P\r\n{data}\r\nENDDAT\r\n")),
    ];
    read(files, &cell())
}

/// What becomes of each position, in their order: "ok" or the reason.
fn verdicts(source: &str, data: &str) -> Vec<String> {
    let programs = programs(source, data);
    let told = |index| {
        programs.ask(index, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    (0..programs.positions.len()).map(told).collect()
}

fn only(source: &str, data: &str) -> String {
    let all = verdicts(source, data);
    assert_eq!(all.len(), 1, "{all:?}");
    all[0].clone()
}

fn asked(source: &str, data: &str) -> Asked {
    programs(source, data).ask(0, &cell()).unwrap()
}

const POINT: &str = "DECL E6POS XP1={X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 180.0,S 2,T 35,E1 0.0,E2 0.0}\r\n\
DECL FDAT FP1={TOOL_NO 3,BASE_NO 1,IPO_FRAME #BASE,POINT2[] \" \"}";
const INLINE: &str = ";FOLD PTP P1 Vel=100 % PDAT1 Tool[3] Base[1];%{PE}\r\n$BWDSTART=FALSE\r\nPDAT_ACT=PPDAT1\r\nFDAT_ACT=FP1\r\n\
BAS(#PTP_PARAMS,100)\r\nPTP XP1\r\n;ENDFOLD";

#[test]
fn an_inline_form_has_the_frames_of_its_fdat_up_to_the_arms_base() {
    let asked = asked(INLINE, POINT);
    let Wanted::Pose { base_from_tool, branches, .. } = asked.wanted else { panic!("a pose") };
    // Base 1 is turned by 90° about z: (10, 20) becomes (−20, 10). ROBROOT is 100 mm up.
    let expected = [1000.0 - 20.0, 10.0, 500.0 + 30.0 - 100.0];
    for (found, expected) in base_from_tool.translation.vector.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-9, "{base_from_tool}");
    }
    assert!((asked.flange_from_tool.translation.vector.z - 200.0).abs() < 1e-12);
    assert_eq!(branches, [Branch::Status { status: 2, turn: Some(35) }]);
}

#[test]
fn what_is_passed_on_or_worked_out_in_a_call_is_not_known() {
    let after = |before: &str, routines: &str| {
        let source =
            format!("BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\n{before}\r\nPTP XP1\r\nEND\r\n{routines}");
        only(&source, POINT)
    };
    let sets = "DEFFCT REAL F()\r\nBAS(#TOOL,4)\r\nRETURN 1.0\r\nENDFCT\r\nDEF T()";
    let change = "DEF CHANGE(F:OUT)\r\nDECL FDAT F\r\nF.BASE_NO=2";
    let waits = "BAS(#PTP_PARAMS,100)";
    for (before, routines) in [
        ("BAS(#VEL_PTP,F())", sets),
        ("TRIGGER WHEN DISTANCE=0 DELAY=F() DO $OUT[1]=TRUE", sets),
        (&*format!("FDAT_ACT=FP1\r\nCHANGE(FDAT_ACT)\r\n{waits}"), change),
        ("SETI($IPO_MODE)", "DEF SETI(M:OUT)\r\nM=#TCP"),
        (
            &*format!("SETF(FP1)\r\n{waits}"),
            "DEF SETF(F:IN)\r\nDECL FDAT F\r\nIF $IN[1] THEN\r\nF={TOOL_NO 3,BASE_NO 1,IPO_FRAME #BASE}\r\nENDIF\r\nFDAT_ACT=F",
        ),
    ] {
        assert_ne!(after(before, routines), "ok", "{before}");
    }
}

#[test]
fn new_inline_forms_have_their_frames_behind_with() {
    let source = "SPTP XP1 WITH $VEL_AXIS[1]=SVEL_JOINT(100.0), $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO), \
                  $IPO_MODE=SIPO_MODE(FP1.IPO_FRAME), $LOAD=SLOAD(FP1.TOOL_NO)";
    assert_eq!(only(source, POINT), "ok");
    let more = "SPTP XP1 WITH $TOOL = STOOL2(FP1), $COLLMON_TOL_PRO[1] = USE_CM_PRO_VALUES(0), $BASE=BASE_DATA[1] C_SPL\r\n\
                TRIGGER WHEN PATH = GETPATH(#OFF) DELAY = 0 DO ARC(#OFF) PRIO = -1\r\n\
                SLIN {X 1,Y 2,Z 3,A 0,B 0,C 0} WITH $VEL = SVEL_CP(2.0, , LCPDAT1), $TOOL = STOOL2(FP1), $BASE = SBASE(FP1.BASE_NO) C_SPL";
    assert_eq!(verdicts(more, POINT), ["ok", "ok"]);
    let other = POINT.replace("#BASE", "#TCP");
    assert!(only(source, &other).contains("the tool stands in the cell"));
}

#[test]
fn frames_that_are_set_before_all_jumps_hold_at_labels() {
    let jumps = "IF N==1 THEN\r\nGOTO M\r\nENDIF\r\nPTP XP1\r\nM:\r\nPTP XP1";
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\n";
    assert_eq!(only(&format!("{set}{jumps}"), POINT), "ok");
    let late = only(&format!("GOTO M\r\n{set}{jumps}"), POINT);
    assert!(late.contains("the tool is another by the way"), "{late}");
}

#[test]
fn a_linear_motion_goes_on_in_the_configuration_that_a_ptp_stated() {
    let lin = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}\r\n\
               LIN {X 1.5,Y 2,Z 3,A 0,B 0,C 0} C_DIS";
    let programs = programs(lin, "");
    let asked = programs.ask(1, &cell()).unwrap();
    let Wanted::Pose { branches, .. } = asked.wanted else { panic!("a pose") };
    assert_eq!(branches, [Branch::Joints(vec![0.0, -90.0, 90.0, 0.0, 45.0, 0.0])]);
    let alone = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nLIN {X 1.5,Y 2,Z 3,A 0,B 0,C 0} C_DIS";
    assert!(
        only(alone, "").contains("no motion before it states an arm configuration in routine P")
    );
}

#[test]
fn one_status_on_all_ways_is_one_arm_configuration() {
    let value = "{X 1,Y 2,Z 3,A 0,B 0,C 180,S 2,T 2}";
    let data =
        format!("{POINT}\r\nDECL POS Q[2]\r\nQ[1]={value}\r\nQ[2]={value}\r\nDECL POS R={value}");
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\n";
    for ways in ["IF N==1 THEN\r\nPTP XP1\r\nELSE\r\nPTP Q[1]\r\nENDIF", "PTP Q[N]"] {
        let found = programs(&format!("{set}{ways}\r\nLIN R"), &data);
        let last = found.ask(found.positions.len() - 1, &cell()).unwrap();
        assert_eq!(last.branches(), [Branch::Status { status: 2, turn: None }], "{ways}");
        let other = data.replacen("S 2,T 2", "S 6,T 2", 1);
        let found = programs(&format!("{set}{ways}\r\nLIN R"), &other);
        assert!(found.ask(found.positions.len() - 1, &cell()).is_err(), "{ways}");
    }
}

#[test]
fn what_is_not_known_is_refused_by_name() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\n";
    let ptp = "PTP XP1";
    let cases = [
        (ptp.to_owned(), "nothing sets the tool before this motion in routine P"),
        (format!("{set}BAS(#INITMOV,0)\r\n{ptp}"), "is worked out at run time"),
        (
            format!("BAS(#BASE,7)\r\nBAS(#TOOL,3)\r\n{ptp}"),
            "BASE_DATA[7] has no value in the files given; give $config.dat",
        ),
        (format!("BAS(#BASE,N)\r\nBAS(#TOOL,3)\r\n{ptp}"), "the base by BAS(#BASE) is worked out"),
        (format!("{set}FOO()\r\n{ptp}"), "the call of FOO (p.src, line 5) may change"),
        (
            format!("{set}IF N==1 THEN\r\nBAS(#BASE,2)\r\nENDIF\r\n{ptp}"),
            "the base is another by the way",
        ),
        (
            format!("{set}LOOP\r\n{ptp}\r\nBAS(#BASE,2)\r\nENDLOOP"),
            "the base is another by the way",
        ),
        (
            format!("{set}GOTO M\r\nBAS(#BASE,2)\r\nBAS(#BASE,1)\r\nM:\r\n{ptp}"),
            "the base is another by the way",
        ),
        (format!("{set}$BASE.X=5\r\n{ptp}"), "$BASE is worked out at run time"),
        (format!("{set}$BASE=EK(MACHINE_DEF[2].ROOT)\r\n{ptp}"), "moves with an external axis"),
        (format!("{set}$BASE=BASE_DATA[1]:SHIFT\r\n{ptp}"), "SHIFT has no value"),
        (format!("{set}$TOOL={{X 1,Y 0,Z 0,A 0,B 0,C 0}}\r\n{ptp}"), "$TOOL is taught with an arm"),
        (format!("{set}$IPO_MODE=#TCP\r\n{ptp}"), "the tool stands in the cell"),
        (format!("{set}XP1.X=XP1.X+1\r\n{ptp}"), "XP1 is worked out at run time (p.src, line 5)"),
        (
            format!("{set}MOVE_TO(XP1)\r\nBAS(#BASE,1)\r\nBAS(#TOOL,3)\r\n{ptp}"),
            "XP1 is worked out at run time",
        ),
        (
            format!("{set}INVERSE($BASE)\r\n{ptp}\r\nEND\r\nDEF INVERSE(F:OUT)\r\nF.X=5"),
            "$BASE is worked out at run time",
        ),
        (format!("{set}Q=XP1\r\n{ptp}"), "it is also read in p.src, line 5"),
        (
            format!("{set}{ptp}\r\nBAS(#BASE,2)\r\n{ptp}"),
            "it is used under base BASE_DATA[1] with tool TOOL_DATA[3] in line 5",
        ),
        (format!("{set}IF N==1 THEN\r\n{ptp}"), "the blocks of routine P do not close"),
        (
            format!("{set}FIRST()\r\nBAS(#BASE,2)\r\nFIRST()\r\nEND\r\nDEF FIRST()\r\n{ptp}"),
            "the base is another by the way",
        ),
        (format!("{set}FIRST()\r\nEND\r\nGLOBAL DEF FIRST()\r\n{ptp}"), "in routine FIRST"),
        (format!("{set}FIRST()\r\nEND\r\nDEF FIRST()\r\n{ptp}\r\nFIRST()"), "in routine FIRST"),
        (
            format!(
                "INTERRUPT DECL 3 WHEN $IN[1] DO IR()\r\n{set}{ptp}\r\nEND\r\nDEF IR()\r\nBAS(#BASE,2)"
            ),
            "IR, which an interrupt, a trigger or a thread runs at any time (p.src, line 3), changes the base",
        ),
        (format!("{set}BASE_DATA[1].X=5\r\n{ptp}"), "BASE_DATA[1] is worked out at run time"),
        (
            format!(
                "BAS(#BASE,2)\r\nFIRST()\r\n{ptp}\r\nEND\r\nDEF FIRST()\r\nIF N==1 THEN\r\nRETURN\r\nENDIF\r\n{set}"
            ),
            "the tool is another by the way",
        ),
    ];
    for (source, expected) in cases {
        let told = only(&source, POINT);
        assert!(told.contains(expected), "{source}\n{told}");
    }
}

#[test]
fn what_a_routine_assigns_is_known_wherever_its_list_stands() {
    let source = "DEF A()\nBASE_DATA[1]={X 1,Y 0,Z 0,A 0,B 0,C 0}\nBAS(#BASE,1)\nBAS(#TOOL,3)\n\
                  PTP {X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 2}\nEND\n";
    let files = vec![
        file("a/a.src", source),
        file("b/$config.dat", CONFIG),
        file("b/$machine.dat", MACHINE),
    ];
    let told = read(files, &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("BASE_DATA[1] has two values"), "{told}");
}

#[test]
fn a_frame_that_two_files_write_alike_is_known() {
    let set = "BASE_DATA[1]={X 1000,Y 0,Z 500.00,A 90,B 0,C 0}\r\nBAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1";
    assert_eq!(only(set, POINT), "ok");
    let list = format!("{POINT}\r\nXP1={{X 10,Y 20,Z 30,A 0,B 0,C 180,S 2,T 35,E1 0,E2 0}}");
    let told = only("BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1", &list);
    assert!(told.starts_with("XP1 has two values"), "{told}");
}

#[test]
fn an_element_that_changes_leaves_the_others_known() {
    let set = "BASE_DATA[2].Z=BASE_DATA[2].Z+155\r\nBAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1";
    assert_eq!(only(set, POINT), "ok");
    for change in ["BASE_DATA[1].Z=5", "BASE_DATA[N].Z=5", "BASE_DATA[1]=$NULLFRAME"] {
        let told = only(&set.replacen("BASE_DATA[2].Z=BASE_DATA[2].Z+155", change, 1), POINT);
        assert!(told.starts_with("BASE_DATA[1] is worked out at run time"), "{change}\n{told}");
    }
}

#[test]
fn inline_forms_in_a_loop_leave_the_tool_on_the_arm() {
    let data = format!("{POINT}\r\nDECL E6POS XP2={{X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 2}}");
    let source = |form: &str| {
        format!(
            "LOOP\r\nBAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP2\r\nFDAT_ACT={form}\r\nBAS(#PTP_PARAMS,9)\r\nPTP XP1\r\nENDLOOP"
        )
    };
    assert_eq!(verdicts(&source("FP1"), &data), ["ok", "ok"]);
    let told = &verdicts(&source("FP9"), &data)[0];
    assert!(told.starts_with("the interpolation mode is another by the way"), "{told}");
}

#[test]
fn what_holds_on_every_way_is_known() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\n";
    let sources = [
        format!("{set}IF N==1 THEN\r\nBAS(#BASE,1)\r\nELSE\r\nBAS(#TOOL,3)\r\nENDIF\r\nPTP XP1"),
        format!("IF N==1 THEN\r\n{set}ELSE\r\n{set}ENDIF\r\nPTP XP1"),
        format!("SWITCH N\r\nCASE 1\r\n{set}DEFAULT\r\n{set}ENDSWITCH\r\nPTP XP1"),
        format!("{set}LOOP\r\nPTP XP1\r\nBAS(#BASE,1)\r\nENDLOOP"),
        format!("{set}WAIT FOR $IN[1]\r\n$VEL.CP=0.5\r\nOUT($OUT[1])\r\n{set}PTP XP1"),
        format!("{set}LOCAL()\r\nPTP XP1\r\nEND\r\nDEF LOCAL()\r\nBAS(#BASE,1)\r\n$OUT[1]=TRUE"),
        format!("{set}$BASE={{X 5,Y 0,Z 0,A 0,B 0,C 0}}\r\nPTP XP1"),
        format!(
            "{set}FIRST()\r\n{set}SECOND()\r\nEND\r\nDEF FIRST()\r\nSECOND()\r\nEND\r\nDEF SECOND()\r\nPTP XP1"
        ),
        format!("{set}PTP XP1:{{X 0,Y 0,Z -50,A 0,B 0,C 0}}"),
        format!(
            "FIRST()\r\nPTP XP1\r\nEND\r\nDEF FIRST()\r\nSECOND()\r\nEND\r\nDEF SECOND()\r\n{set}"
        ),
        format!("{set}ArcMainNG(#ArcOnBeforeMoveStd,WDAT1,WP1)\r\nPTP XP1"),
    ];
    for source in sources {
        assert_eq!(only(&source, POINT), "ok", "{source}");
    }
}

#[test]
fn a_spline_has_the_frames_that_follow_its_with() {
    let source = "BAS(#BASE,2)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\nSPLINE WITH $BASE=SBASE(1)\r\nSPL {X 1,Y 2,Z 3,A 0,B 0,C 0}\r\n\
                  SCIRC XP2, {X 4,Y 5,Z 6,A 0,B 0,C 0}\r\nENDSPLINE\r\nLIN XP3";
    let data = format!(
        "{POINT}\r\nDECL POS XP2={{X 1,Y 1,Z 1,A 0,B 0,C 0}}\r\nDECL FRAME XP3={{X 1,Y 1,Z 1,A 0,B 0,C 0}}"
    );
    let programs = programs(source, &data);
    let bases: Vec<String> = programs
        .positions
        .iter()
        .map(|position| {
            format!("{position} {:?}", position.uses[0].base).contains("BASE_DATA[1]").to_string()
        })
        .collect();
    assert_eq!(bases, ["false", "true", "true", "true", "false"]);
    for index in 0..5 {
        assert!(programs.ask(index, &cell()).is_ok(), "{index}");
    }
}

#[test]
fn the_sum_is_what_motions_use() {
    let source = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XHOME\r\nPTP $AXIS_ACT\r\nLIN_REL {X 10}\r\nPTP P[1]\r\nPTP P[I]\r\n\
                  LIN NOWHERE\r\nPTP F(1)\r\nCIRC P[2], P[1], CA 90\r\nPTP {X 5}\r\nLIN {X A1,Y 1,Z 1,A 0,B 0,C 0}";
    let data = "DECL POS P[2]\r\nP[1]={X 1,Y 1,Z 1,A 0,B 0,C 0,S 2,T 2}\r\nP[2]={X 2,Y 1,Z 1,A 0,B 0,C 0,S 2,T 2}\r\n\
                P[3]={X 2,Y 1,Z 1,A 0,B 0,C 0,S 2,T 2,E1 5.0}";
    let programs = programs(source, data);
    let names: Vec<&str> = programs.positions.iter().map(|own| own.name.as_str()).collect();
    assert_eq!(names, ["XHOME", "P[1]", "P[2]", "P[3]", "NOWHERE", "PTP", "LIN"]);
    let computed: Vec<&str> = programs.computed.iter().map(|own| own.text.as_str()).collect();
    assert_eq!(computed, ["$AXIS_ACT", "{X 10}", "F(1)"]);
    let told = verdicts(source, data);
    assert!(told[0].contains("stands in $config.dat"), "{}", told[0]);
    assert!(told[3].contains("E1 is at 5"), "{}", told[3]);
    assert!(told[5].contains("it states no X, Y and Z"), "{}", told[5]);
    assert!(told[6].contains("its X is worked out when the program runs"), "{}", told[6]);
}

#[test]
fn only_numbers_and_marks_change_and_both_are_taken_out_again() {
    let data = b"DEFDAT P PUBLIC\r\n;FOLD \xfc {X 1}\r\ndecl e6pos xp1 = { y 20.0 ,\tX 1.0e1, z 30,A 0.0,B 0.0,C 180.0,S 2,T 'B100011' } ; f\xfcr\r\n\
                 DECL FDAT FP1={TOOL_NO 3,BASE_NO 1,IPO_FRAME #BASE}\r\nENDDAT\r\n";
    let files = vec![
        file("$config.dat", CONFIG),
        file("$machine.dat", MACHINE),
        file("p.src", format!("DEF P( )\r\n{INLINE}\r\nEND\r\n")),
        file("p.dat", data),
    ];
    let programs = read(files, &cell());
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Pose { base_from_frame, base_from_tool, .. } = &asked.wanted else {
        panic!("a pose")
    };
    let mut to = base_from_frame.inverse() * base_from_tool;
    to.translation.vector += nalgebra::Vector3::new(-10.000_01, 0.5, 0.0);
    let command = Command {
        base_from_tool: Some(base_from_frame * to),
        // A1 and A6 cross 0, and only A1 and A2 agree with T before.
        joints: Some([
            vec![-0.001, -1.0, 1.0, 1.0, 1.0, 1.0],
            vec![0.002, -1.0, 1.0, 1.0, 1.0, -1.0],
        ]),
    };
    let mut edits = edits(&programs.positions[0], &asked, &command);
    assert_eq!(edits.crossed, 1);
    edits.all.extend(marks(&programs.files[3], "table t-1\r\nHALT", "t-1", &[]));
    let written = applied(data, &edits.all);
    let text = String::from_utf8_lossy(&written);
    assert!(text.contains("PUBLIC\r\n; corrected by posegrid table t-1??HALT\r\n;FOLD"), "{text}");
    assert!(
        text.contains("{ y 20.5000 ,\tX 0.0000, z 30,A 0.0,B 0.0,C 180.0,S 2,T 34 }"),
        "{text}"
    );
    let constant =
        "\r\nDECL CHAR POSEGRID_CORRECTED[3]\r\nPOSEGRID_CORRECTED[]=\"t-1\"\r\nENDDAT\r\n";
    assert!(text.contains(constant), "{text}");
    assert_eq!(undone(&written, data, &edits.all), data);
    let mut again = programs.files.clone();
    again[3].bytes = written;
    let told = read(again, &cell()).ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("corrected already by posegrid (p.dat, line 2)"), "{told}");
}

#[test]
fn what_may_change_a_frame_without_its_list_is_refused() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\n";
    let cases = [
        ("BASE_DATA[1].X=5\r\n", "BASE_DATA[1] is worked out at run time"),
        (
            "IF N==1 THEN\r\nBASE_DATA[1]={X 1,Y 0,Z 5,A 0,B 0,C 0}\r\nENDIF\r\n",
            "BASE_DATA[1] is written in p.src, line 3, and what it is before that is in no file given; give $config.dat",
        ),
        ("FIT(BASE_DATA[1])\r\n", "BASE_DATA[1] is worked out at run time"),
        ("CREAD(H,S,M,O,\"%r\",BASE_DATA[1].X)\r\n", "BASE_DATA[1] is worked out at run time"),
        ("INTERRUPT DECL 4 WHEN $IN[3] DO UNSEEN()\r\n", "the call of UNSEEN (p.src, line 2)"),
        ("INTERRUPT DECL 6 WHEN $CYCFLAG[3]==FALSE DO A20(TECH_STOP2)\r\n", "ok"),
        ("INTERRUPT DECL 4 WHEN $IN[3] DO $OUT[1]=TRUE\r\n", "ok"),
        ("N=RSI_ON(#RELATIVE)\r\n", "a sensor: RSI"),
        ("BASE_CORR_ON=TRUE\r\n", "(BASE_CORR_ON"),
        ("BASE_CORR_ON=FALSE\r\nP00(#EXT_ERR,0)\r\n", "ok"),
        ("N=RSI_ON(#RELATIVE)\r\nN=RSI_OFF()\r\n", "ok"),
        ("H70(6,CD1)\r\n", "a sensor: RSI"),
        ("H70 (1,CD0)\r\n", "ok"),
    ];
    for (begin, expected) in cases {
        let source = format!("DEF P( )\r\n{begin}{set}END\r\n");
        let list = format!("DEFDAT P\r\n{POINT}\r\nENDDAT\r\n");
        let files = vec![file("p.src", source), file("p.dat", list)];
        let mut cell = cell();
        let place = posegrid_arm::geometry::Placement::of(&nalgebra::Isometry3::identity());
        for (name, frame) in &mut cell.frames {
            frame.place = (!name.starts_with("$T")).then_some(place);
        }
        let told = read(files, &cell).ask(0, &cell);
        let told = told.map_or_else(|why| why.to_string(), |_| "ok".to_owned());
        assert!(told.contains(expected), "{begin}{told}");
    }
}

#[test]
fn files_of_a_whole_backup_that_state_two_things_are_not_believed_and_those_of_the_system_not_followed()
 {
    let told = |more: &[(&str, &str)]| {
        let list = format!("DEFDAT P\r\n{POINT}\r\nENDDAT\r\n");
        let own = [
            ("$config.dat", CONFIG),
            ("$machine.dat", MACHINE),
            ("p.src", "DEF P( )\r\nBAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\nEND\r\n"),
            ("p.dat", &list),
        ];
        let files = own.iter().chain(more).map(|(name, text)| file(name, text)).collect();
        read(files, &cell()).ask(0, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
    };
    assert_eq!(told(&[]), "ok");
    let kinematics = |word: &str| {
        format!("DEFDAT $MACHINE PUBLIC\r\n$EX_KIN={{ET1 {word},ET2 #NONE}}\r\nENDDAT\r\n")
    };
    let (none, unit) = (kinematics("#NONE"), kinematics("#ERSYS"));
    assert_eq!(told(&[("KRC/R1/Mada/$machine.dat", &none)]), "ok");
    let unit_told = told(&[("KRC/R1/Mada/$machine.dat", &unit)]);
    assert!(unit_told.contains("moves with an external axis"), "{unit_told}");
    let both = [("KRC/R1/Mada/$machine.dat", &*none), ("old/$machine.dat", &*unit)];
    assert!(told(&both).contains("$EX_KIN has two values"), "{}", told(&both));
    let frame = |index: u8| {
        format!(
            "DEFDAT $CONFIG\r\nMACHINE_FRAME_DAT[1]={{MACH_DEF_INDEX {index},PARENT[] \"WORLD\"}}\r\nENDDAT\r\n"
        )
    };
    let (fixed, moved) = (frame(0), frame(1));
    let both = [("KRC/R1/System/$config.dat", &*fixed), ("old/$config.dat", &*moved)];
    assert!(told(&both).contains("MACHINE_FRAME_DAT[1] has two values"), "{}", told(&both));

    let bas = "DEF BAS(COMMAND :IN,NUMBER :IN)\r\nSWITCH COMMAND\r\nCASE #FRAMES\r\n$IPO_MODE=IPO_FRAME\r\nENDSWITCH\r\nEND\r\n";
    assert_eq!(told(&[("KRC/R1/System/bas.src", bas)]), "ok");
}

#[test]
fn positions_passed_to_a_routine_of_no_file_are_counted() {
    let source =
        "MOVE_TO(XP1)\r\nIR_STOPM(XP1)\r\nOWN(XP1)\r\nEND\r\nDEF OWN(X :IN)\r\nDECL E6POS X";
    let found = programs(source, POINT);
    let computed: Vec<&str> = found.computed.iter().map(|own| own.word.as_str()).collect();
    assert_eq!(computed, ["MOVE_TO"]);
}

#[test]
fn every_position_of_every_motion_is_counted() {
    let source = "PTP C_ONE\r\nLIN C_ONE C_DIS\r\nCIRC_REL {X 1},{Y 2}\r\nLIN\r\nPTP XP2:{X 1} #TOOL\r\nEND\r\nDEF Q()\r\nENDIF\r\nR()\r\nEND\r\nDEF R()\r\nPTP XP1";
    let value = "{X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 2}";
    let data = format!("{POINT}\r\nDECL E6POS C_ONE={value}\r\nDECL E6POS XP2={value}");
    let found = programs(source, &data);
    let uses: Vec<usize> = found.positions.iter().map(|own| own.uses.len()).collect();
    assert_eq!((uses, found.computed.len()), (vec![2, 1], 4));
    let told = found.ask(1, &cell()).unwrap_err().to_string();
    assert!(told.contains("the blocks of routine Q do not close"), "{told}");
    let open = programs("BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\nENDLOOP\r\nLIN XP1", POINT);
    assert_eq!((open.paths.len(), open.positions[0].uses.len()), (2, 2));
    let told = open.ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("the blocks of routine P do not close"), "{told}");
    let labelled = programs("A1:\r\nB1: C1 :PTP XP1", POINT);
    assert_eq!((labelled.paths.len(), labelled.positions.len()), (1, 1));
    let outside = read(vec![file("p.src", "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\n")], &cell());
    let told = outside.ask(0, &cell()).unwrap_err().to_string();
    assert!(told.contains("stands in no routine"), "{told}");
}

#[test]
fn a_number_that_its_sign_parts_from_its_name_stays_apart() {
    let programs = programs("BAS(#TOOL,3)\r\nPTP {A1-0.005,A2-90,A3 90,A4 0,A5-0.001,A6.5}", "");
    let asked = programs.ask(0, &cell()).unwrap();
    let Wanted::Joints(from) = asked.wanted.clone() else { panic!("joints") };
    let to = from.iter().map(|joint| joint + 0.01).collect();
    let command = Command { base_from_tool: None, joints: Some([from, to]) };
    let edits = edits(&programs.positions[0], &asked, &command);
    let written = applied(&programs.files[2].bytes, &edits.all);
    let text = String::from_utf8_lossy(&written);
    assert!(
        text.contains("{A1 0.00500,A2-89.99000,A3 90.01000,A4 0.01000,A5 0.00900,A6 0.51000}"),
        "{text}"
    );
}

/// Each motion: how it leads, the lines where it begins and ends, and whether its corner is blended.
fn courses(programs: &Programs) -> Vec<(Way, Option<u32>, Option<u32>, bool)> {
    let line = |position: usize| programs.positions[position].line;
    let of = |path: &crate::Path| {
        let end = path.through.as_ref().and_then(|through| through.last());
        (path.way, path.from.map(line), end.map(|end| line(*end)), path.is_blended)
    };
    programs.paths.iter().map(of).collect()
}

#[test]
fn a_motion_begins_where_the_one_before_it_ended() {
    let point = "{X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 0.0}";
    let source = format!(
        "PTP {{A1 0,A2 -90,A3 90,A4 0,A5 10,A6 0}}\r\nLIN {point} C_DIS\r\nCIRC {point}, {point}\r\n\
         CIRC {point}, {point}, CA 90.0\r\nLIN XP9:{{Z 50}}\r\nLIN {point}\r\n\
         IF $IN[1] THEN\r\nLIN {point}\r\nENDIF\r\nLIN {point}\r\nOTHER()\r\nSLIN {point}"
    );
    let expected = [
        (Way::Joints, None, Some(3), false),
        (Way::Straight, Some(3), Some(4), true),
        (Way::Circle, Some(4), Some(5), false),
        (Way::Other, Some(5), Some(6), false),
        (Way::Straight, None, None, false),
        (Way::Straight, None, Some(8), false),
        (Way::Straight, Some(8), Some(10), false),
        // Two ways lead here.
        (Way::Straight, None, Some(12), false),
        // The routine is in no given file.
        (Way::Straight, None, Some(14), false),
    ];
    let data = "DECL E6POS XP9={X 10.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 180.0,S 2,T 35}";
    assert_eq!(courses(&programs(&source, data)), expected);
}

#[test]
fn further_points_are_lines_before_a_straight_motion_with_its_own_text() {
    let source = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\n  LIN XP2 C_DIS ; weld\r\n\
                  TRIGGER WHEN DISTANCE=1 DELAY=0 DO FOO=TRUE\r\nLIN XP1\r\nCIRC XP1,XP2\r\nSLIN XP2";
    let second = "DECL E6POS XP2={X 400.0,Y 20.0,Z 30.0,A 170.0,B 0.0,C 180.0,S 2,T 35,E1 0.0}";
    let programs = programs(source, &format!("{POINT}\r\n{second}"));
    let told: Vec<_> = programs.paths.iter().map(|path| programs.may_split(path)).collect();
    let trigger = "a TRIGGER before it is for its begin or its end";
    let other = crate::reading::NOT_SPLIT;
    let helper = "its helper point is used by another motion too";
    assert_eq!(told, [Err(other), Ok(()), Err(trigger), Err(helper), Err(other)]);
    let at = |x: f64| Further {
        frame_from_tool: nalgebra::Isometry3::from_parts(
            [x, 20.25, 30.0].into(),
            crate::krl::abc([-175.0, 0.0, 180.0]),
        ),
        joints: vec![0.0; 6],
    };
    let edit = only_lines(&programs, &[at(100.0), at(200.0)]);
    let source = &programs.files[2];
    let written = applied(&source.bytes, std::slice::from_ref(&edit));
    let line = |x: u32| {
        format!("  LIN {{X {x},Y 20.2500,Z 30,A -175,B 0,C 180}} C_DIS ; added by posegrid\r\n")
    };
    let text = String::from_utf8(written.clone()).unwrap();
    let expected = format!("PTP XP1\r\n{}{}  LIN XP2 C_DIS ; weld\r\n", line(100), line(200));
    assert!(text.replace(".00000", "").replace(".0000", "").contains(&expected), "{text}");
    assert_eq!(undone(&written, &source.bytes, &[edit]), source.bytes);
}

#[test]
fn further_points_of_a_circle_are_circles_before_it() {
    let source = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\nCIRC XP2 , {X 400,Y 20,Z 30,A 0,B 0,C 180} C_DIS\r\n\
                  CIRC XP1,XP3,CA 90\r\nCIRC XP3,XP1";
    let data = "DECL E6POS XP2={X 200.0,Y 90.0,Z 30.0,A 0.0,B 0.0,C 180.0,S 2,T 35,E1 0.0}\r\n\
                DECL E6POS XP3={X 200.0,Y 90.0,Z 30.0,A 0.0,B 0.0,C 180.0,S 2,T 35,E1 0.0}";
    let programs = programs(source, &format!("{POINT}\r\n{data}"));
    let told: Vec<_> = programs.paths.iter().map(|path| programs.may_split(path)).collect();
    assert_eq!(told[1..3], [Ok(()), Err("it has settings of its own")]);
    assert_eq!(told[3], Err("where it begins is not known"));
    let at = |x: f64, y: f64| Further {
        frame_from_tool: nalgebra::Isometry3::from_parts(
            [x, y, 30.0].into(),
            crate::krl::abc([0.0, 0.0, 180.0]),
        ),
        joints: vec![0.0; 6],
    };
    let points = [at(50.0, 50.0), at(100.0, 70.0), at(150.0, 85.0), at(200.0, 90.0)];
    let edit = only_lines(&programs, &points);
    let point = |x: u32, y: u32| format!("{{X {x},Y {y},Z 30,A 0,B 0,C 180}}");
    let line = |helper: String, end: String| {
        format!("CIRC {helper} , {end} C_DIS ; added by posegrid\r\n")
    };
    let expected = line(point(50, 50), point(100, 70)) + &line(point(150, 85), point(200, 90));
    assert_eq!(edit.text.replace(".00000", "").replace(".0000", ""), expected);
    let source = &programs.files[2].bytes;
    assert_eq!(edit.span.start, source.windows(4).position(|own| own == b"CIRC").unwrap());
}

/// What becomes of a motion behind a call of a routine that moves under base 2 and ends under base 1, with these lines before the call.
fn behind_a_search(before: &str, interrupt: &str) -> String {
    let search = "BAS(#BASE,2)\r\nPTP XHOME\r\nBAS(#BASE,1)\r\nEND";
    let source = format!(
        "BAS(#TOOL,3)\r\n{before}\r\nSEARCH( )\r\nPTP XP1\r\nEND\r\nDEF SEARCH( )\r\n{search}\r\nDEF STOPPED( )\r\n{interrupt}"
    );
    let programs = programs(&source, POINT);
    let place = programs.positions.iter().position(|own| own.name == "XP1").unwrap();
    programs.ask(place, &cell()).map_or_else(|why| why.to_string(), |_| "ok".to_owned())
}

#[test]
fn a_routine_that_an_interrupt_leaves_ends_anywhere() {
    let declared = "INTERRUPT DECL 10 WHEN $IN[1]==TRUE DO STOPPED( )\r\nINTERRUPT ON 10";
    assert_eq!(behind_a_search(declared, "BRAKE"), "ok");
    assert_eq!(behind_a_search("", "BRAKE\r\nRESUME"), "ok");
    let resumed = behind_a_search(declared, "BRAKE\r\nRESUME");
    assert!(resumed.contains("the base is another by the way"), "{resumed}");
}

#[test]
fn what_an_interrupt_or_a_trigger_assigns_is_known_at_no_motion() {
    let triggered = |own: &str| {
        let trigger = format!("TRIGGER WHEN DISTANCE=0 DELAY=0 DO {own}");
        behind_a_search(&trigger, "BRAKE")
    };
    assert_eq!(triggered("$OUT[1]=TRUE"), "ok");
    let tool = triggered("$TOOL=TOOL_DATA[1]");
    assert!(tool.contains("DO $TOOL, which an interrupt, a trigger or a thread runs"), "{tool}");
    for own in ["XP1.Z=5", "XP1={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"] {
        assert_ne!(triggered(own), "ok", "{own}");
    }
}

#[test]
fn a_frame_that_the_statement_before_wrote_is_known() {
    let write = "BASE_DATA[1]={FRAME: X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}";
    let of = |between: &str| {
        only(&format!("BAS(#TOOL,3)\r\n{write}\r\n{between}$BASE=BASE_DATA[1]\r\nPTP XP1"), POINT)
    };
    assert_eq!(of("; set\r\n"), "ok");
    assert!(of("FOO=1\r\n").contains("BASE_DATA[1] has two values"));
    // A trigger writes it later.
    let later = format!("TRIGGER WHEN DISTANCE=0 DELAY=0 DO {write}");
    let late = only(&format!("BAS(#TOOL,3)\r\n{later}\r\n$BASE=BASE_DATA[1]\r\nPTP XP1"), POINT);
    assert!(late.contains("BASE_DATA[1] has two values"), "{late}");
}

#[test]
fn a_tool_that_keeps_its_orientation_has_none_of_its_position() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\n";
    let lin = "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}";
    let data = format!(
        "{POINT}\r\nDECL LDAT LC={{VEL 2.0,ACC 100.0,ORI_TYP #CONSTANT}}\r\nDECL LDAT LV={{VEL 2.0,ACC 100.0,ORI_TYP #VAR}}"
    );
    let told = |source: &str| verdicts(&format!("{set}{source}"), &data);
    for own in [
        "$ORI_TYPE=#CONSTANT",
        "$ORI_TYPE=#IGNORE",
        "LDAT_ACT=LC\r\nFDAT_ACT=FP1\r\nBAS(#CP_PARAMS,2)",
        "$ORI_TYPE=NOWHERE",
        "$ORI_TYPE=#CONSTANT\r\nLDAT_ACT.VEL=0.5",
        "$ORI_TYPE=#CONSTANT\r\nLDAT_ACT=LV",
        "LV.ORI_TYP=#CONSTANT\r\nLDAT_ACT=LV\r\nFDAT_ACT=FP1\r\nBAS(#CP_PARAMS,2)",
    ] {
        let all = told(&format!("{own}\r\nPTP XP1\r\n{lin}"));
        assert!(
            all[0] == "ok"
                && all[1].contains("$ORI_TYPE may be #CONSTANT or #IGNORE (p.src, line "),
            "{own}: {all:?}"
        );
        assert_eq!(told(&format!("{own}\r\n$ORI_TYPE=#VAR\r\n{lin}")), ["ok", "ok"]);
    }
    assert_eq!(
        told(&format!("LDAT_ACT=LV\r\nFDAT_ACT=FP1\r\nBAS(#CP_PARAMS,2)\r\n{lin}")),
        ["ok", "ok"]
    );
    let with = |own: &str| told(&format!("S{lin} WITH $ORI_TYPE={own}")).pop().unwrap();
    assert!(with("#CONSTANT").contains("$ORI_TYPE") && with("SORI_TYP(LC)").contains("$ORI_TYPE"));
    assert_eq!([with("#VAR"), with("SORI_TYP(LV)")], ["ok", "ok"]);
}

#[test]
fn what_writes_by_reference_is_not_known_behind_it() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\n";
    let ends = [
        "R=EKI_GETFRAME(\"C\",\"S\",$BASE)\r\n",
        "ANIN ON BASE_DATA[1].Z = 1.0*ABC+0.0\r\n",
        "INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO UPD(BASE_DATA[1])\r\n",
        "PTP_REL {A4 170,A5 -110}\r\n",
        "IMPORT FRAME GG IS /R1/P..F1\r\n",
    ];
    for end in ends {
        let all = verdicts(&format!("{set}{end}LIN {{X 1,Y 2,Z 3,A 0,B 0,C 0}}"), POINT);
        assert_ne!(all.last().unwrap(), "ok", "{end}: {all:?}");
    }
    let jump =
        "BASE_DATA[2]={X 5,Y 0,Z 0,A 0,B 0,C 0}\r\nM: $BASE=BASE_DATA[2]\r\nPTP XP1\r\nGOTO M";
    assert_ne!(only(&format!("BAS(#TOOL,3)\r\n{jump}"), POINT), "ok");
}

#[test]
fn an_axis_that_a_position_does_not_state_stays_where_another_left_it() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\n";
    let lin = "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0";
    let left = "E1 is at the last value that it got, and nothing says";
    for end in ["ASYPTP {E1 10}\r\n", "XP2.E1=N\r\n", "LIN {E1 -250.5}\r\n"] {
        let all = verdicts(&format!("{set}{end}{lin}}}"), POINT);
        assert!(all.last().unwrap().contains(left), "{end}: {all:?}");
        let all = verdicts(&format!("{set}{end}{lin},E1 0.0}}"), POINT);
        assert_eq!(all.last().unwrap(), "ok", "{end}");
    }
    let end = "E1=2\r\nN=STRCOMP(E1,2)\r\nPTP {A1 0,A2 0,A3 90,A4 0,A5 30,A6 0,E1 -0.0}\r\n";
    assert_eq!(verdicts(&format!("{set}{end}{lin}}}"), POINT), ["ok"; 3]);
}

#[test]
fn of_several_names_the_last_gets_the_value() {
    let data = format!("{POINT}\r\nDECL E6POS XA,XB={{X 1,Y 2,Z 3,A 0,B 0,C 0,S 2,T 35}}");
    let told = verdicts("BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XA\r\nPTP XB", &data);
    assert!(told[0].contains("XA has no value") && told[1] == "ok", "{told:?}");
}

#[test]
fn what_a_trigger_starts_stays_at_its_motion() {
    let set = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nPTP XP1\r\n";
    let trigger = "TRIGGER WHEN DISTANCE=1 DELAY=0 DO FOO=TRUE\r\n";
    let lin = "LIN {X 1,Y 2,Z 3,A 0,B 0,C 0}\r\n";
    let other = "LIN {X 2,Y 2,Z 3,A 0,B 0,C 0}\r\n";
    let sub = format!("END\r\nDEF SUB()\r\n{other}");
    for (source, expected) in [
        (format!("{set}{lin}SUB()\r\n{sub}"), [true; 2]),
        (format!("{set}{trigger}{lin}{other}"), [false, true]),
        (format!("{set}{trigger}SUB()\r\n{lin}{sub}"), [false; 2]),
        (format!("{set}SUB()\r\n{lin}{sub}{trigger}END\r\n"), [false; 2]),
        (format!("{set}LOOP\r\n{other}{trigger}ENDLOOP\r\n{lin}"), [false; 2]),
        (format!("{set}$OUT_C[3]=TRUE\r\n{other}{lin}"), [false, true]),
    ] {
        let programs = programs(&source, POINT);
        let of_other = programs.paths.iter().filter(|own| own.word == "LIN");
        let all: Vec<_> = of_other.map(|own| own.split.is_ok()).collect();
        assert_eq!(all, expected, "{source}");
    }
}

#[test]
fn how_a_point_was_taught_makes_no_other_arm_configuration() {
    let source = "BAS(#BASE,1)\r\nBAS(#TOOL,3)\r\nIF A THEN\r\nPTP XP1\r\nELSE\r\nPTP XP2\r\nENDIF\r\nLIN {X 1,Y 2,Z 3,A 0,B 0,C 180}";
    let data = format!(
        "{POINT}\r\nDECL E6POS XP2={{X 9.0,Y 20.0,Z 30.0,A 0.0,B 0.0,C 180.0,S 18,T 35,E1 0.0}}"
    );
    assert_eq!(verdicts(source, &data), ["ok", "ok", "ok"]);
}
