use proptest::prelude::*;

use super::*;
use crate::edit::Edit;
use crate::program::Shape;
use crate::write::{Command, applied, edits, mark, marks};

/// Pieces of programs of all dialects, sound and broken.
const PIECES: [&str; 96] = [
    "def P():\n",
    "end\n",
    "movel(p[.1,.2,.3,0,3.1,0], a=1.2, r=0.01)\n",
    "movej([0,1,2,3,4,5])\n",
    "movec(P1,P2)\n",
    "get_inverse_kin(P1, qnear=[0,1,2,3,4,5])",
    "pose_trans(P1,",
    "global P1=p[.1,.2,.3,0,0,0]\n",
    "set_tcp(p[0,0,0,0,0,0])\n",
    "while (True):\n",
    "if x: end\n",
    "elif y:\n",
    "thread t(a):\n",
    "p[",
    "DEF P()\r\n",
    "END\n",
    "DEFDAT P\n",
    "ENDDAT\n",
    "LIN ",
    "PTP ",
    "CIRC ",
    "XP1",
    "P[1]",
    "P[i]",
    "{X 1.5,Y 2,Z -3,A 0,B 0,C 0,S 2,T 2}",
    "{A1 0,A2 1,A3 2,A4 3,A5 4,A6 5}",
    "=",
    ",",
    "DECL E6POS XP1=",
    "BAS(#BASE,1)\n",
    "$BASE=",
    "$NULLFRAME",
    "$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}\n",
    "IF a THEN\n",
    "ENDIF\n",
    "ELSE\n",
    "LOOP\n",
    "ENDLOOP\n",
    "SWITCH n\n",
    "CASE 1\n",
    "ENDSWITCH\n",
    "L:\n",
    "SPLINE WITH $BASE=SBASE(1)\n",
    "ENDSPLINE\n",
    "FOO(XP1)\n",
    "\"open\n",
    "; {X 1}\n",
    "\u{fc}",
    "\r",
    "\n",
    " ",
    "MODULE M\n",
    "ENDMODULE\n",
    "PROC p(robtarget q)\n",
    "ENDPROC\n",
    "MoveL p10,v1,z1,tool0;",
    "MoveJ\\Conc,[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1,z1,tool0\\WObj:=wobj0;",
    "CONST robtarget p10:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];",
    "VAR robtarget a{2,2}:=",
    "[[",
    "]]",
    ";",
    "IF a MoveL p10,v1,z1,tool0;",
    "TEST a CASE 1:",
    "ENDTEST",
    "p10:=",
    "Offs(p10,1,2,3)",
    "ConfL\\Off;",
    "PDispOff;",
    "!",
    "%%%\n",
    "ERROR\n",
    "/PROG P\n",
    "/ATTR\nLINE_COUNT = 2;\n",
    "/MN\n",
    "/POS\n",
    "/END\n",
    "   1:J P[1] 100% FINE ;\n",
    "   2:L P[2:a b] 5mm/sec CNT50 ACC80",
    "    :  P[3] 5mm/sec CNT10 ;\r\n",
    "   3:C P[1]\n",
    " Wjnt Offset,PR[1] ;\n",
    "UFRAME_NUM=1 ;\n",
    "   4:  UTOOL_NUM=0 ;\n",
    "   5:  LBL[1] ;\n",
    "   6:  IF R[1]=1,JMP LBL[1] ;\n",
    "  =2,CALL P ;\n",
    "   7:  !",
    "P[1:\"x\"]{\n   GP1:\n\tUF : 0, UT : 0,",
    "\tCONFIG : 'N U T, 0, 0, 0',\n",
    "\tX = 900.5 mm,\tY = -.131 mm,\tZ = 3.000 mm,\n\tW = 179.9 deg,\tP = .000 deg,\tR = 1 deg\n",
    "\tJ1= .000 deg,\tJ2= 1.000 deg,\tJ3= 2.000 deg,\tJ4= 3 deg,\tJ5= 4 deg,\tJ6= 5 deg\n",
    "};\n",
    "P[2]{\n   GP1:\n\tUF : F, UT : 0,",
    "PR[1]=P[1] ;\n",
    "   GP2:\n\tJ1= 1.000 mm\n",
];

fn text() -> impl Strategy<Value = Vec<u8>> {
    let piece = prop_oneof![
        9 => (0..PIECES.len()).prop_map(|place| PIECES[place].as_bytes().to_vec()),
        1 => proptest::collection::vec(any::<u8>(), 0..4),
    ];
    proptest::collection::vec(piece, 0..60).prop_map(|pieces| pieces.concat())
}

/// A cell that knows where an arm's base is.
fn cell() -> Cell {
    let place = posegrid_arm::geometry::Placement::of(&nalgebra::Isometry3::identity());
    let frame =
        CellFrame { found: Some(Found::Surveyed), place: Some(place), ..CellFrame::default() };
    let names =
        ["$ROBROOT", "base_frame", "base", "tcp"].map(|name| (name.to_owned(), frame.clone()));
    Cell { frames: names.into_iter().collect(), ..Cell::default() }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn any_bytes_are_read_and_only_numbers_are_replaced(source in text(), data in text(), module in text(), listing in text(), script in text()) {
        let named = [("p.src", source), ("p.dat", data), ("m.mod", module), ("l.LS", listing), ("u.script", script)];
        let files = named.map(|(name, bytes)| File { name: name.to_owned(), bytes });
        let programs = read(files.to_vec(), &cell());
        let mut all = vec![Vec::new(); files.len()];
        for index in 0..programs.positions.len() {
            let Ok(asked) = programs.ask(index, &cell()) else { continue };
            let position = &programs.positions[index];
            prop_assert!(!position.uses.is_empty());
            let command = match (&asked.wanted, &position.shape) {
                (Wanted::Pose { base_from_tool, .. }, _) => {
                    let mut to = *base_from_tool;
                    to.translation.vector.x += 0.123_456;
                    Command { base_from_tool: Some(to), joints: None }
                }
                (Wanted::Joints(joints), Ok(Shape::Joints(_))) => {
                    let to = joints.iter().map(|joint| joint + 0.01).collect();
                    Command { base_from_tool: None, joints: Some([joints.clone(), to]) }
                }
                _ => continue,
            };
            all[position.file].extend(edits(position, &asked, &command).all);
        }
        let point = Further { frame_from_tool: nalgebra::Isometry3::identity(), joints: vec![0.0; 6] };
        let paths = programs.paths.iter().filter(|path| programs.may_split(path).is_ok());
        let added = paths.filter_map(|path| programs.added(path, &[point.clone(), point.clone()]));
        let added: Vec<_> = added.collect();
        for (own, lines) in all.iter_mut().zip(programs.lines(added.iter())) {
            own.extend(lines);
        }
        for (file, edits) in files.iter().zip(&all) {
            let mut edits = edits.clone();
            let own = marks(file, "table t", "t", &edits);
            edits.extend(own);
            let written = applied(&file.bytes, &edits);
            prop_assert_eq!(undone(&written, &file.bytes, &edits), file.bytes.clone());
            let changed = record::Changed::of(file, &written, &edits);
            prop_assert_eq!(changed.original(&written), Ok(file.bytes.clone()));
            let is_marked = mark(&File { bytes: written, ..file.clone() }).is_some();
            prop_assert!(is_marked || edits.is_empty() || mark(file).is_some());
        }
    }
}

#[test]
fn a_hundred_thousand_positions_take_a_linear_time() {
    let each = |count: u32, line: &dyn Fn(u32) -> String| -> String {
        (0..count).map(line).collect::<Vec<_>>().concat()
    };
    let lines = each(100_000, &|n| format!("LIN {{X {n}.5,Y 2,Z -3,A 0,B 0,C 0}} C_DIS\r\n"));
    let module = each(20_000, &|n| {
        format!("CONST robtarget p{n}:=[[{n},2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]; ")
    });
    // All of them in one line.
    let moves = each(20_000, &|n| format!("MoveL p{n},v1,z1,tool0; "));
    let statements = each(50_000, &|n| format!("{n:>4}:J P[{n}] 5% FINE ;\n"));
    let statements = statements + &"   1:  PR[1]=P[7] ;\n".repeat(20_000);
    let entries = each(50_000, &|n| {
        format!(
            "P[{n}]{{\n   GP1:\n\tUF : 0, UT : 0,\t\tCONFIG : 'N U T, 0, 0, 0',\n\tX = {n}.000 mm, Y = 0 mm, Z = 0 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n}};\n"
        )
    });
    let mut files = vec![
        File {
            name: "p.src".to_owned(),
            bytes: format!("DEF P()\nPTP {{A1 0,A2 0,A3 0,A4 0,A5 9,A6 0}}\n{lines}END\n")
                .into_bytes(),
        },
        File {
            name: "m.mod".to_owned(),
            bytes: format!("MODULE M\n{module}PROC main()\n{moves}ENDPROC\nENDMODULE").into_bytes(),
        },
        File {
            name: "l.ls".to_owned(),
            bytes: format!("/PROG L\n/MN\n{statements}/POS\n{entries}/END\n").into_bytes(),
        },
    ];
    let moves = each(50_000, &|n| format!("  movel(p[0.{n},0.2,0.3,0,3.1,0], a=1.2, v=0.25)\n"));
    let nested = "if f(".repeat(20_000) + &"get_inverse_kin(".repeat(20_000);
    files.push(File {
        name: "u.script".to_owned(),
        bytes: format!("def p():\n  movej([0,1,1,0,1,0])\n{moves}end\n{nested}").into_bytes(),
    });
    let begun = std::time::Instant::now();
    let programs = read(files, &cell());
    assert_eq!(programs.positions.len(), 220_002);
    let asked = (0..programs.positions.len()).filter(|index| programs.ask(*index, &cell()).is_ok());
    assert_eq!(asked.count(), 120_000);
    // A time that grows with the square would be many minutes.
    assert!(begun.elapsed().as_secs() < 90, "{:?}", begun.elapsed());
}

/// The inverse of edits: places in the written bytes with the old text, which need not be UTF-8.
pub(crate) fn undone(written: &[u8], before: &[u8], edits: &[Edit]) -> Vec<u8> {
    let mut sorted: Vec<&Edit> = edits.iter().collect();
    sorted.sort_by_key(|edit| edit.span.start);
    let mut out = Vec::with_capacity(before.len());
    let (mut at, mut copied) = (0, 0);
    for edit in sorted {
        let kept = edit.span.start - copied;
        out.extend(&written[at..at + kept]);
        out.extend(&before[edit.span.clone()]);
        at += kept + edit.text.len();
        copied = edit.span.end;
    }
    out.extend(&written[at..]);
    out
}

/// The lines of further points before the second motion.
pub(crate) fn only_lines(programs: &Programs, points: &[Further]) -> Edit {
    let added = programs.added(&programs.paths[1], points).expect("its text is understood");
    let mut all = programs.lines(std::iter::once(&added)).concat();
    assert_eq!(all.len(), 1);
    all.remove(0)
}
