//! Whole programs: corrected, and back to their originals byte for byte.

use std::fs;
use std::path::Path;

use posegrid::io::lake::Lake;
use posegrid::io::rows::Word as _;

use super::commands::{Ended, compensate, file_of, lake, text_of};

const PROGRAM: &[u8] = b"&ACCESS RVP\r\nDEF t()\r\n;gr\xfc\xdfe\r\n\
    $BASE = {X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}\r\n$TOOL = {X 25.0, Y -40.0, Z 100.0, A 0.0, B 0.0, C 0.0}\r\n\
    PTP {A1 0.0, A2 -75.0, A3 95.0, A4 25.0, A5 60.0, A6 -15.0}\r\n\
    PTP {A1 5.0, A2 -77.0, A3 97.0, A4 26.0, A5 61.0, A6 -14.0}\r\nEND\r\n";

const MACHINE: &str =
    "DEFDAT $MACHINE PUBLIC\n$ROBROOT={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";

const CELL: &str =
    "[frames]\n\"$ROBROOT\" = { found = \"surveyed\" }\n\"$TOOL\" = { found = \"surveyed\" }\n";

/// A backup with a program and the file of its cell, to be corrected by the quickstart's arm.
fn write_cell(folder: &Path, program: &[u8], cell: &str) {
    fs::create_dir_all(folder.join("backup/R1")).expect("writable");
    fs::write(folder.join("backup/R1/t.src"), program).expect("writable");
    fs::write(folder.join("backup/$machine.dat"), MACHINE).expect("writable");
    fs::write(folder.join("cell.toml"), cell).expect("writable");
}

fn correct(folder: &Path, out: &str, more: &[&str]) -> Ended {
    let arm = text_of(&file_of(lake(), "calibrations"));
    let [backup, cell, out] = ["backup", "cell.toml", out].map(|own| text_of(&folder.join(own)));
    let mut args = vec![arm.as_str(), &backup, "--cell", &cell, "--points", "off-line"];
    args.extend(["--out", &out, "--no-record"]);
    for term in ["tool", "payload", "mounting", "base", "controller-model", "absolute-accuracy"] {
        args.extend(["--allow", term]);
    }
    args.extend(["--allow", "temperature"]);
    args.extend(more);
    compensate(&args)
}

/// The program's folder of a backup, corrected by the quickstart's arm.
fn corrected(folder: &Path) {
    write_cell(folder, PROGRAM, CELL);
    let done = correct(folder, "out", &[]);
    done.expect(0, &[]);
    let told = "between positions the arm leaves the wanted path by 0.0";
    assert!(done.results.contains(told), "{}", done.results);
}

#[test]
fn undo_gives_the_programs_back_byte_for_byte() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    corrected(folder);
    let [out, back, other] = ["out", "back", "other"].map(|own| text_of(&folder.join(own)));
    let written = fs::read(folder.join("out/R1/t.src")).expect("there");
    assert_ne!(written, PROGRAM);
    compensate(&["--undo", &out, "--out", &back]).expect(0, &["1 original files", "kr210-demo"]);
    assert_eq!(fs::read(folder.join("back/R1/t.src")).expect("there"), PROGRAM);
    compensate(&["--undo", &out, "--out", &back]).expect(2, &["exists already"]);
    compensate(&["--undo", &back, "--out", &other]).expect(2, &["no posegrid-corrections.json"]);
    // What was edited since is not undone, and nothing is written.
    fs::write(folder.join("out/R1/t.src"), [&written[..], b"\r\n"].concat()).expect("writable");
    compensate(&["--undo", &out, "--out", &other]).expect(2, &["t.src: it is not as posegrid"]);
    let record = folder.join("out/posegrid-corrections.json");
    let text = fs::read_to_string(&record).expect("there").replace("R1/t.src", "../cell.toml");
    fs::write(&record, text).expect("writable");
    compensate(&["--undo", &out, "--out", &other]).expect(2, &["is no file of the folder"]);
    assert!(!folder.join("other").exists());
    compensate(&["--undo", &out]).expect(2, &["give --out FOLDER"]);
    compensate(&["--undo", &out, "a.src", "--out", &other]).expect(2, &["cannot be used with"]);
}

/// A base that the nominal arm has where three points were touched.
const TOUCHED: &[u8] =
    b"DEF t()\r\n$BASE = {X 1683.000,Y -207.000,Z 961.000,A 15.0,B -2.0,C 1.0}\r\n\
    $TOOL = {X 25.0, Y -40.0, Z 100.0, A 0.0, B 0.0, C 0.0}\r\n\
    PTP {X 20.000,Y 20.000,Z 0.000,A 165.26838,B 11.02218,C -158.23900,S 2,T 34}\r\n\
    LIN {X 240.000,Y 200.000,Z 10.000,A 165.26838,B 11.02218,C -158.23900} C_DIS\r\nEND\r\n";

#[test]
fn a_base_that_was_touched_is_corrected_where_it_really_is() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let taught = |points: &str| {
        let arm = text_of(&file_of(lake(), "calibrations"));
        let tool = "{ xyz_mm = [25, -40, 100], quaternion_xyzw = [0, 0, 0, 1] }";
        format!(
            "{CELL}[frames.\"$BASE\"]\ntaught_with = {arm:?}\ntool = {tool}\npoints = [{points}]\n"
        )
    };
    write_cell(folder, TOUCHED, &taught(""));
    let done = correct(folder, "none", &[]);
    done.expect(1, &[]);
    assert!(
        done.results.contains("$BASE is taught with an arm: give its points"),
        "{}",
        done.results
    );
    let points = "{ joints_deg = [2.103, -78.244, 104.065, 24.911, 53.454, -13.304] }, \
                  { joints_deg = [-0.206, -67.091, 88.902, 24.154, 57.979, -13.616] }, \
                  { joints_deg = [-6.338, -79.497, 105.298, 26.018, 56.746, -21.659] }";
    write_cell(folder, TOUCHED, &taught(points));
    let done = correct(folder, "out", &["--densify", "0.001"]);
    done.expect(0, &[]);
    for told in ["$BASE was touched with the arm: it stands ", " points added before it"] {
        assert!(done.results.contains(told), "{told}: {}", done.results);
    }
    let written = fs::read_to_string(folder.join("out/R1/t.src")).expect("there");
    assert!(written.contains("} C_DIS ; added by posegrid\r\nLIN {X "), "{written}");
    assert!(written.contains("$BASE = {X 1683.000,Y -207.000,Z 961.000,"), "{written}");
    let [out, back] = ["out", "back"].map(|own| text_of(&folder.join(own)));
    compensate(&["--undo", &out, "--out", &back]).expect(0, &["1 original files"]);
    assert_eq!(fs::read(folder.join("back/R1/t.src")).expect("there"), TOUCHED);
    correct(folder, "other", &["--densify", "0"]).expect(2, &["a length in mm, above 0"]);
}

#[test]
fn what_an_offset_leaves_is_stated() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let frames = "$BASE = {X 1683.000,Y -207.000,Z 961.000,A 15.0,B -2.0,C 1.0}\r\n\
        $TOOL = {X 25.0, Y -40.0, Z 100.0, A 0.0, B 0.0, C 0.0}\r\n";
    let beside = "LIN XP1:{X 0.0,Y 0.0,Z 30.0,A 0.0,B 0.0,C 0.0}";
    let program = format!("DEF t()\r\n{frames}PTP XP1\r\n{beside}\r\nEND\r\n");
    let cell = format!("{CELL}\"$BASE\" = {{ found = \"surveyed\" }}\n");
    write_cell(folder, program.as_bytes(), &cell);
    let point = "{X 20.000,Y 20.000,Z 0.000,A 165.26838,B 11.02218,C -158.23900,S 2,T 34}";
    let list = format!("DEFDAT t\r\nDECL E6POS XP1={point}\r\nENDDAT\r\n");
    fs::write(folder.join("backup/R1/t.dat"), list).expect("writable");
    let done = correct(folder, "out", &[]);
    done.expect(0, &[]);
    // The error of an arm with errors of a millimetre changes by a part of it over a tenth of a metre.
    let (_, left) = done.results.split_once("stay as they are and leave at most ").expect("stated");
    let left: f64 = left.split(' ').next().and_then(|own| own.parse().ok()).expect("a number");
    assert!(left > 0.01 && left < 0.5, "{left} mm for each 100 mm");
}

#[test]
fn a_data_list_without_its_routines_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let list = "DEFDAT WING\r\nDECL E6POS XP1={X 751.0,Y 20.0,Z 450.0,A 0.0,B 0.0,C 0.0,S 2,T 2}\r\n\
                DECL FDAT FP1={TOOL_NO 3,BASE_NO 5,IPO_FRAME #BASE}\r\nENDDAT\r\n";
    fs::write(folder.join("wing.dat"), list).expect("writable");
    fs::write(folder.join("$machine.dat"), MACHINE).expect("writable");
    let table = text_of(&file_of(lake(), "compensation"));
    let [wing, machine] = ["wing.dat", "$machine.dat"].map(|own| text_of(&folder.join(own)));
    let told = ["wing.dat is a data list of KUKA", "give the .src of its module too"];
    compensate(&[&table, &wing]).expect(2, &told);
    compensate(&[&table, &machine, &wing]).expect(2, &told);
    // With its routines a tool that is in no given file refuses its positions.
    let source = "DEF wing()\r\nFDAT_ACT=FP1\r\nBAS(#PTP_PARAMS,100)\r\nPTP XP1\r\nEND\r\n";
    write_cell(folder, source.as_bytes(), CELL);
    fs::write(folder.join("backup/R1/t.dat"), list).expect("writable");
    let done = correct(folder, "out", &[]);
    done.expect(1, &[]);
    let told = "TOOL_DATA[3] has no value in the files given; give $config.dat";
    assert!(done.results.contains(told), "{}", done.results);
}

/// A module of RAPID with the joints of [`PROGRAM`].
const MODULE: &str = "MODULE t\r\n  PERS tooldata tip:=[TRUE,[[25,-40,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\r\n  PROC main()\r\n    \
    MoveAbsJ [[0,-75,95,25,60,-15],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tip;\r\n  ENDPROC\r\nENDMODULE\r\n";

/// A circle and a straight motion across joint 1 = 0: their helper and their end state no quarter turns, or others, and are not asked for them.
const ACROSS: &str = "MODULE t\r\n  PERS tooldata tip:=[TRUE,[[25,-40,100],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\r\n  \
    CONST robtarget at:=[[1697.119,-182.514,962.047],[0.10882794,0.01965333,0.97838587,-0.17473213],[0,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n  \
    CONST robtarget by:=[[1697.119,67.486,962.047],[0.10882794,0.01965333,0.97838587,-0.17473213],[9,9,9,9],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n  \
    CONST robtarget to:=[[1697.119,267.486,1062.047],[0.10882794,0.01965333,0.97838587,-0.17473213],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\r\n  \
    PROC main()\r\n    ConfL\\On;\r\n    MoveJ at,v100,fine,tip;\r\n    MoveC by,to,v100,fine,tip;\r\n    MoveJ at,v100,fine,tip;\r\n    \
    ConfL\\Off;\r\n    MoveL by,v100,fine,tip;\r\n  ENDPROC\r\nENDMODULE\r\n";

#[test]
fn motions_that_read_no_quarter_turns_go_on_in_the_arm_configuration_before_them() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    fs::create_dir(folder.join("backup")).expect("writable");
    fs::write(
        folder.join("cell.toml"),
        "[frames]\ntip = { found = \"surveyed\" }\nbase_frame = { found = \"surveyed\", place = { \
        xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] } }\n",
    )
    .expect("writable");
    let done = |module: &str, out: &str| {
        fs::write(folder.join("backup/t.mod"), module).expect("writable");
        correct(folder, out, &[])
    };
    let told = done(ACROSS, "out").results;
    assert!(told.contains("3 corrected, 0 refused, 0 computed"), "{told}");
    // The controller takes the place of a helper alone.
    let turned = ACROSS.replacen(
        "67.486,962.047],[0.10882794,0.01965333,0.97838587,-0.17473213]",
        "67.486,962.047],[1,0,0,0]",
        1,
    );
    let told = done(&turned, "turned").results;
    assert!(told.contains("2 corrected, 1 refused, 0 computed"), "{told}");
    assert!(told.contains("it is the helper point of a circle"), "{told}");
    // Without the quarter turns of the first nothing says how the arm goes on from there.
    let told = done(&ACROSS.replacen("[0,0,-1,0]", "[1,1,1,1]", 1), "other").results;
    assert!(told.contains("1 corrected, 2 refused, 0 computed"), "{told}");
    assert!(
        told.contains(
            "in the arm configuration of AT (t.mod, line 3), which is not known: its cf1"
        ),
        "{told}"
    );
}

#[test]
fn a_corrected_program_without_its_marks_is_known_by_its_lake() {
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let lake = Lake::new(lake());
    let forms = || {
        let records = lake.corrections().expect("records").into_iter();
        let forms = records.map(|(_, _, record)| record.expect("sound").form.word());
        forms.collect::<Vec<_>>()
    };
    let cell = format!("{CELL}tip = {{ found = \"surveyed\" }}\n");
    write_cell(
        folder,
        TOUCHED,
        &cell.replace("$TOOL", "$BASE\" = { found = \"surveyed\" }\n\"$TOOL"),
    );
    fs::write(folder.join("backup/m.mod"), MODULE).expect("writable");
    let done = correct(folder, "out", &[]);
    done.expect(0, &[]);
    assert!(["krl", "rapid"].iter().all(|form| forms().contains(form)), "{:?}", forms());
    for name in ["R1/t.src", "m.mod"] {
        let written = fs::read_to_string(folder.join("out").join(name)).expect("there");
        fs::write(folder.join("backup").join(name), &written).expect("writable");
        let told = [name, "corrected already: the file posegrid wrote"];
        correct(folder, "again", &[]).expect(2, &told);
        let bare = written.lines().filter(|line| !line.to_lowercase().contains("posegrid"));
        let bare: Vec<&str> = bare.collect();
        fs::write(folder.join("backup").join(name), bare.join("\n")).expect("writable");
        correct(folder, "again", &[]).expect(2, &["corrected already: ", "posegrid wrote on 20"]);
        let original = if name == "m.mod" { MODULE.as_bytes() } else { TOUCHED };
        fs::write(folder.join("backup").join(name), original).expect("writable");
    }
    correct(folder, "again", &[]).expect(0, &[]);
}
