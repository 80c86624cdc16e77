use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

use super::super::{Targets, read as read_file};
use super::*;
use crate::compensation::{Corrected, Exception, Reason, Refused, Target};
use crate::geometry::Position;

/// A list as a controller writes it: a header line, folds, CR LF, a latin-1 byte, strings with special characters.
const LIST: &[u8] = b"&ACCESS RVP\r\n&REL 12\r\nDEFDAT  LEFT_WING PUBLIC\r\n\
;FOLD EXTERNAL DECLARATIONS;%{PE}%MKUKATPBASIS,%CEXT,%VCOMMON,%P\r\nEXT  BAS (BAS_COMMAND  :IN,REAL  :IN )\r\n;ENDFOLD\r\n\
DECL INT COUNT=3\r\nDECL CHAR NOTE[9]=\"a={X 1;\"\r\n\
DECL E6POS XP1={X 1650.0,Y -120.5,Z 980.25,A 90.0,B 0.0,C 180.0,S 6,T 27,E1 0.0,E2 0.0,E3 0.0,E4 0.0,E5 -1.5,E6 0.0} ; f\xfcr A\r\n\
DECL FDAT FP1={TOOL_NO 3,BASE_NO 1,IPO_FRAME #BASE,POINT2[] \"{},X 9 \",TQ_STATE FALSE}\r\n\
DECL PDAT PPDAT1={VEL 100.0,ACC 100.0,APO_DIST 100.0}\r\n\
decl global e6pos xp2 = { y 2.5E1 , x +1.6e3, z 7 , s 'b010', t 2}\r\n\
DECL FRAME P[4]\r\nP[ 3 ]={X 1600,Y 10.0,Z -0.5,A 10,B 20,C 30}\r\n\
SOME={POS: X 1,Y 2,Z 3,A 0,B 0,C 0,S 18,T 2}\r\n\
DECL E6AXIS XHOME={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\r\nDECL LOAD L1={M 1,CM {X 0,Y 0,Z 1},J {X 0,Y 0,Z 0}}\r\nENDDAT\r\n";

fn list(text: &[u8]) -> (Vec<Target>, DataList) {
    let (rows, list) = read(text.to_vec()).unwrap_or_else(|error| panic!("{error:?}"));
    let target = |(_, row): (Place, Row)| row.target().unwrap();
    (rows.into_iter().map(target).collect(), list)
}

fn problem(text: &[u8]) -> String {
    let error = read(text.to_vec()).unwrap_err();
    error.at(Path::new("wing.dat")).to_string()
}

/// A command that is off by `by` mm from its target.
fn moved(target: &Target, by: [f64; 3]) -> Corrected {
    let place = target.position.unwrap();
    Corrected {
        target: place,
        command: Position::claim(place.point() + Vector3::from(by)),
        orientation: target.orientation,
        joints: None,
        correction: Vector3::from(by),
        covariance: Some(Matrix3::identity()),
        of_frame: Matrix3::zeros(),
        iterations: 2,
        allowed: Vec::new(),
    }
}

fn refused(target: &Target) -> Refused {
    Refused {
        target: target.name.clone(),
        reason: Reason::Tool { wanted: "drill\r\n6° − ü".to_owned(), table: None },
        slip: None,
    }
}

#[test]
fn positions_are_found_and_everything_else_is_counted() {
    let (targets, list) = list(LIST);
    let places: Vec<(&str, [f64; 3])> = targets
        .iter()
        .map(|target| (target.name.as_str(), target.position.unwrap().coords().into()))
        .collect();
    let expected = [
        ("XP1", [1650.0, -120.5, 980.25]),
        ("XP2", [1600.0, 25.0, 7.0]),
        ("P[3]", [1600.0, 10.0, -0.5]),
        ("SOME", [1.0, 2.0, 3.0]),
    ];
    assert_eq!(places, expected);
    // Rz(90°) Ry(0) Rx(180°): x stays in the plane and points along y, z points down.
    let turn = targets[0].orientation.unwrap();
    assert!((turn * Vector3::x() - Vector3::y()).norm() < 1e-12);
    assert!((turn * Vector3::z() + Vector3::z()).norm() < 1e-12);
    assert!(targets[1].orientation.is_none());
    let statuses: Vec<_> = list.statuses().collect();
    let s = |number| Status::of(number);
    assert_eq!(statuses, [s(6), s(2), None, s(18)]);
    let notes = list.notes().join("\n");
    assert!(notes.contains("TOOL_NO 3, BASE_NO 1"), "{notes}");
    assert!(notes.contains("1 positions were taught with"), "{notes}");
    assert!(notes.contains("1 values of type FRAME are taken for positions (line 14)"), "{notes}");
    assert!(notes.contains("1 positions have external axes away from 0"), "{notes}");
    assert!(notes.contains("unchanged: 1 E6AXIS, 1 FDAT, 1 LOAD, 1 PDAT"), "{notes}");
}

#[test]
fn a_turn_is_about_z_then_y_then_x() {
    let (targets, _) = list(LIST);
    let turn = targets[2].orientation.unwrap();
    let about = |axis: nalgebra::Unit<Vector3<f64>>, degrees: f64| {
        UnitQuaternion::from_axis_angle(&axis, degrees.to_radians())
    };
    let expected = about(Vector3::z_axis(), 10.0)
        * about(Vector3::y_axis(), 20.0)
        * about(Vector3::x_axis(), 30.0);
    assert!(turn.angle_to(&expected) < 1e-12);
}

#[test]
fn only_the_numbers_of_x_y_and_z_change() {
    let (targets, own) = list(LIST);
    let outcomes: Vec<_> = targets.iter().map(|t| Ok(moved(t, [0.001, -0.002, 0.5]))).collect();
    let written = own.write(&outcomes, "t-1");
    let text = String::from_utf8_lossy(&written);
    let expected = String::from_utf8_lossy(LIST)
        .replace(
            "PUBLIC\r\n",
            "PUBLIC\r\n; corrected by posegrid table t-1: 4 positions corrected, 0 refused\r\n",
        )
        .replace("\r\nENDDAT", "\r\nDECL CHAR POSEGRID_CORRECTED[3]=\"t-1\"\r\nENDDAT")
        .replace("X 1650.0,Y -120.5,Z 980.25,A 90", "X 1650.001000,Y -120.502000,Z 980.750000,A 90")
        .replace("y 2.5E1 , x +1.6e3, z 7 ,", "y 24.998000 , x 1600.001000, z 7.500000 ,")
        .replace("X 1600,Y 10.0,Z -0.5,", "X 1600.001000,Y 9.998000,Z 0.000000,")
        .replace("POS: X 1,Y 2,Z 3,", "POS: X 1.001000,Y 1.998000,Z 3.500000,");
    assert_eq!(text, expected);
    assert!(written.contains(&0xfc), "a latin-1 letter stays one byte");
    // Corrected once is corrected.
    let again = problem(&written);
    assert!(
        again.contains("line 4: corrected already: \"; corrected by posegrid table t-1"),
        "{again}"
    );
}

#[test]
fn a_refused_target_is_a_comment_that_nothing_breaks_out_of() {
    let (targets, own) = list(LIST);
    let mut outcomes: Vec<_> = targets.iter().map(|t| Ok(moved(t, [0.0; 3]))).collect();
    outcomes[0] = Err(refused(&targets[0]));
    if let Ok(done) = &mut outcomes[1] {
        done.allowed = vec![Exception::JointRange];
    }
    let written = own.write(&outcomes, "t\r\nHALT");
    let text = String::from_utf8_lossy(&written);
    assert!(
        text.contains("; corrected by posegrid table t??HALT: 3 positions corrected, 1 refused, exception joint_range allowed for 1\r\n"),
        "{text}"
    );
    let expected = "\r\n; refused by posegrid table t??HALT: target \"XP1\" is for tool \"drill\\r\\n6 deg - ?\", the table";
    assert!(text.contains(expected), "{text}");
    assert!(text.contains("\r\n;DECL E6POS XP1={X 1650.0,Y -120.5,Z 980.25,A 90.0"), "{text}");
    assert_eq!(
        written.split(|&byte| byte == b'\n').count(),
        LIST.split(|&byte| byte == b'\n').count() + 3
    );
    // Without the head a list with refusals is still known.
    let headless = text.replace("; corrected by posegrid", "; once by posegrid");
    assert!(problem(headless.as_bytes()).contains("corrected already: \"; refused by posegrid"));
}

/// Statements that KRL forbids, and the message for each.
const FORBIDDEN: [(&str, &str); 32] = [
    // A decimal comma: the reader of a controller ends there as well.
    ("DECL E6POS P={X 1575,7,Y 2,Z 3}", "line 2: \"7\" is between the commas"),
    ("DECL E6POS P={X 1575 7,Y 2,Z 3}", "\"X 1575 7\" is between the commas"),
    ("DECL E6POS P={X 1 Y 2,Z 3}", "\"X 1 Y 2\" is between the commas"),
    ("DECL E6POS P={X 1,,Y 2,Z 3}", "\"\" is between the commas"),
    ("DECL E6POS P={X 1,Y 2,Z 3,}", "\"\" is between the commas"),
    ("DECL E6POS P={,X 1,Y 2,Z 3}", "\"\" is between the commas"),
    ("DECL E6POS P={}", "\"\" is between the commas"),
    ("DECL E6POS P={X1,Y 2,Z 3}", "\"X1\" is between the commas"),
    ("DECL E6POS P={X=1,Y 2,Z 3}", "\"X=1\" is between the commas"),
    ("DECL E6POS P={X: 1,Y 2,Z 3}", "\"1\" is between the commas"),
    ("DECL E6POS P={X1 1,X 1,Y 2,Z 3}", "component X1: a value of type E6POS has none"),
    ("DECL POS P={X 1,Y 2,Z 3,E1 0}", "component E1: a value of type POS has none"),
    ("DECL FRAME P={X 1,Y 2,Z 3,S 2}", "component S: a value of type FRAME has none"),
    ("DECL E6POS P={X 1,Y 2,Z 3,T a}", "component T holds \"A\", which is no whole number"),
    ("DECL E6POS P={X 1,Y 2,Z 3,S 'B-1'}", "component S holds \"'B-1'\""),
    ("DECL E6POS P={X {Y 2},Y 2,Z 3}", "component X holds \"{Y 2}\""),
    ("DECL E6POS P={X 1,Y 2,Z 3]", "the braces of the value do not close"),
    ("DECL E6POS P={X 1,Y 2,Z 3} 4", "the braces of the value do not close"),
    ("DECL LOAD L={CM {X 0,X 1}}", "component X is given twice"),
    ("DECL LOAD L={M 1 CM {X 0}}", "\"M 1 CM {X 0}\" is between the commas"),
    ("DECL E6POS P {X 1,Y 2,Z 3}", "line 2: this is neither a declaration"),
    ("X 1,Y 2,Z 3}", "line 2: this is neither a declaration"),
    ("DECL E6POS", "this is neither a declaration"),
    ("P[1]", "this is neither a declaration"),
    ("DECL E6POS P={X 1,Y 2,Z 3}\nP.X=5", "line 3: a value for a component of P"),
    ("P.X=5", "line 2: a value for a component of P"),
    ("P[A]={POS: X 1,Y 2,Z 3}", "P[A] is a position, but its index"),
    ("DECL INT N=1,5", "\"1,5\" is not one value"),
    ("DECL CHAR C[3]=\"ab", "line 2: a text begins with"),
    ("DECL E6POS P\nDECL INT p", "line 3: P is declared in line 2 already"),
    ("DECL E6POS P={AXIS: X 1,Y 2,Z 3}", "the value is of type AXIS, but P is declared as E6POS"),
    ("P={X 1}", "P has X, Y and Z, but neither this list"),
];

#[test]
fn what_is_wrong_is_reported_by_its_line() {
    let cases = [
        ("DECL E6POS P={X 1,Y 2}", "line 2: a position is three numbers"),
        (
            "DECL E6POS P={X 1,Y 2,Z a}",
            "line 2: component Z holds \"a\", which is no finite number",
        ),
        ("DECL E6POS P={X 1,Y 2,Z inf}", "component Z holds \"inf\""),
        ("DECL E6POS P={X 1,Y 2,Z 1e999}", "component Z holds \"1e999\""),
        ("DECL E6POS P={X 1,Y 2,Z }", "\"Z\" is between the commas"),
        ("DECL E6POS P={X 1,Y 2,Z 3,X 4}", "component X is given twice"),
        ("DECL E6POS P={X 1,Y 2,Z 3,A 4}", "an orientation is three angles"),
        ("DECL E6POS P={X 1,Y 2,Z 3,S 32}", "S is 32"),
        ("DECL E6POS P={X 1,Y 2,Z 3,S 'B012'}", "component S holds \"'B012'\""),
        ("DECL E6POS P={X 1,Y 2,Z 3", "the braces of the value do not close"),
        ("DECL E6POS P={X 1,Y 2,Z 3} Q={X 1}", "the braces of the value do not close"),
        ("DECL E6POS P=Q", "P is a position, but its value is no aggregate"),
        ("P[1]={X 1,Y 2,Z 3}", "P[1] has X, Y and Z, but neither this list"),
        ("a b c d={X 1}", "the text before = is no name"),
        (
            "P[1]={POS: X 1,Y 2,Z 3}\np[ 01 ]={POS: X 1,Y 2,Z 3}",
            "line 3: target \"P[1]\" is in line 2 already",
        ),
        (
            "DECL FDAT F1={TOOL_NO 1,BASE_NO 2}\nDECL FDAT F2={TOOL_NO 1,BASE_NO 3}",
            "line 3: TOOL_NO 1, BASE_NO 3, but TOOL_NO 1, BASE_NO 2 in line 2",
        ),
        ("DECL FDAT F1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #tcp}", "line 2: IPO_FRAME #TCP"),
        ("DECL FDAT F1={TOOL_NO x,BASE_NO 2}", "component TOOL_NO holds \"X\""),
        ("; a\rDECL POS P={X 1,Y 2,Z 3}", "line 2: a carriage return without a line feed"),
        (";refused by POSEGRID table", "line 2: corrected already"),
    ];
    for (lines, expected) in cases.into_iter().chain(FORBIDDEN) {
        let text = format!("DEFDAT L\n{lines}\nENDDAT\n");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("l.dat");
        std::fs::write(&path, text).unwrap();
        let error = read_file(&path).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let whole = |text: &str| problem(text.as_bytes());
    assert!(whole("DEFDAT L\nDECL POS P={X 1,Y 2,Z 3}\n").contains("line 2: no line ENDDAT"));
    assert!(whole("DEFDAT L\nDEFDAT M\nENDDAT").contains("line 2: a second DEFDAT"));
    assert!(whole("DEFDAT\nENDDAT").contains("line 1: DEFDAT is followed by a name"));
    assert!(whole("DEFDAT L P Q\nENDDAT").contains("line 1: DEFDAT is followed by a name"));
    let outside = "a statement outside of the list";
    let place = "DECL POS P={X 1,Y 2,Z 3}";
    assert!(whole(&format!("{place}\nDEFDAT L\nENDDAT")).contains(&format!("line 1: {outside}")));
    assert!(whole(&format!("DEFDAT L\nENDDAT\n{place}")).contains(&format!("line 3: {outside}")));
    assert!(whole("DEFDAT L\nENDDAT L\n").contains(&format!("line 2: {outside}")));
    assert!(problem(b"DECL POS P={X 1,Y 2,Z 3}\n").contains("no line DEFDAT up to here"));
    assert!(problem(b"defdat $config public\n").contains("this list belongs to the system"));
}

#[test]
fn what_is_corrected_stays_known_without_its_comments() {
    let (targets, own) = list(LIST);
    let outcomes: Vec<_> = targets.iter().map(|t| Ok(moved(t, [0.1; 3]))).collect();
    let written = own.write(&outcomes, "0a\"1b");
    let text = String::from_utf8_lossy(&written);
    let line = "\r\nDECL CHAR POSEGRID_CORRECTED[5]=\"0a?1b\"\r\nENDDAT\r\n";
    assert!(text.ends_with(line), "{text}");
    assert!(MARK.len() <= 24, "a name of KRL");
    let uncommented: Vec<&str> = text
        .lines()
        .map(|line| line.split_once(';').map_or(line, |(code, _)| code))
        .filter(|line| !line.contains("POINT2") && !line.contains("NOTE"))
        .collect();
    let told = problem(uncommented.join("\n").to_lowercase().as_bytes());
    assert!(told.contains("corrected already, by table \"0a?1b\""), "{told}");
    for mark in ["DECL CHAR POSEGRID_CORRECTED[9]", "posegrid_corrected[]=\"t\""] {
        let told = problem(format!("DEFDAT L\n{mark}\nENDDAT").as_bytes());
        assert!(told.contains("line 2: corrected already"), "{told}");
    }
}

#[test]
fn a_file_is_read_as_what_its_name_says() {
    let mut file = tempfile::Builder::new().suffix(".DAT").tempfile().unwrap();
    std::io::Write::write_all(&mut file, LIST).unwrap();
    let Targets { targets, list, .. } = read_file(file.path()).unwrap();
    assert_eq!((targets.len(), list.is_some()), (4, true));
}

#[test]
fn a_controller_reads_a_micrometre_back() {
    // A controller's REAL is a 32-bit float: at 4 m its steps are 0.24 µm.
    for mm in [0.0, 0.000_4, 1650.001, -3_999.999_4, 12.345_678_9] {
        let text = format!("DEFDAT L\nDECL POS P={{X {mm},Y 0,Z 0}}\nENDDAT\n");
        let (targets, own) = list(text.as_bytes());
        let written = own.write(&[Ok(moved(&targets[0], [0.0; 3]))], "t-1");
        let text = String::from_utf8(written).unwrap();
        let number = text.split("{X ").nth(1).unwrap().split(',').next().unwrap();
        let read: f32 = number.parse().unwrap();
        assert!((f64::from(read) - mm).abs() < 0.000_2, "{mm}: {number}");
    }
}

/// Pieces of data lists, sound and broken.
fn piece() -> impl Strategy<Value = Vec<u8>> {
    prop_oneof![
        (-5000.0..5000.0_f64, -5.0e3..5.0e3_f64, any::<i32>()).prop_map(|(x, y, z)| {
            format!("DECL E6POS XP@={{X {x},Y {y:e} , Z {z},A 1,B 2,C 3,S 2,T 2}} ; note")
                .into_bytes()
        }),
        (any::<u16>(), -5.0..5.0_f64)
            .prop_map(|(n, x)| format!("q[{n}] = {{frame: z 1, y 2,x {x}}}").into_bytes()),
        Just(b";FOLD {X 1,Y 2,Z 3}".to_vec()),
        Just(b"DECL FDAT F@={TOOL_NO 1,BASE_NO 2,POINT2[] \" ;\"}".to_vec()),
        Just(b"DECL LOAD L@={M 1,CM {X 0,Y 0,Z 0}}".to_vec()),
        Just(b"".to_vec()),
        proptest::collection::vec(any::<u8>(), 0..40).prop_map(|bytes| {
            let inside = bytes.into_iter().filter(|byte| !b"\r\n".contains(byte));
            [b";".to_vec(), inside.collect()].concat()
        }),
    ]
}

/// A text without the lines of posegrid, with refused targets restored.
fn without_ours(text: &[u8]) -> Vec<Vec<u8>> {
    let mut lines = Vec::new();
    let mut was_refused = false;
    for line in text.split_inclusive(|&byte| byte == b'\n') {
        let ours = [
            b"; corrected by posegrid".as_slice(),
            b"; refused by posegrid",
            b"DECL CHAR POSEGRID_CORRECTED",
        ];
        if ours.iter().any(|ours| line.starts_with(ours)) {
            was_refused = line.starts_with(ours[1]);
            continue;
        }
        lines.push(if was_refused { line[1..].to_vec() } else { line.to_vec() });
        was_refused = false;
    }
    lines
}

/// A line with each number after an X, Y or Z of its outermost braces left out, and those numbers.
fn blanked(line: &[u8]) -> (Vec<u8>, Vec<f64>) {
    let code = line.split(|&byte| byte == b';').next().unwrap();
    let is_target = code.windows(4).any(|w| w == b" XP{")
        || code.starts_with(b"DECL E6POS")
        || code.starts_with(b"q[");
    if !is_target {
        return (line.to_vec(), Vec::new());
    }
    let (mut left, mut numbers) = (Vec::new(), Vec::new());
    for part in code.split_inclusive(|&byte| b",}".contains(&byte)) {
        let text = std::str::from_utf8(part).unwrap();
        let inside = text.trim_end_matches([',', '}']);
        let (name, number) = inside.trim_end().rsplit_once(' ').unwrap_or((inside, ""));
        let axis = name.trim_end().chars().last().unwrap_or(' ').to_ascii_uppercase();
        match number.parse::<f64>() {
            Ok(number) if "XYZ".contains(axis) => {
                numbers.push(number);
                left.extend(name.bytes());
            }
            _ => left.extend(part),
        }
    }
    left.extend(&line[code.len()..]);
    (left, numbers)
}

proptest! {
    #[test]
    fn nothing_but_x_y_and_z_changes(
        pieces in proptest::collection::vec(piece(), 0..12),
        crlf in any::<bool>(),
        refuse in any::<u16>(),
        by in -2.0..2.0_f64,
    ) {
        let end: &[u8] = if crlf { b"\r\n" } else { b"\n" };
        let mut text = [b"&ACCESS RVP".as_slice(), end, b"DEFDAT L", end].concat();
        for (number, piece) in pieces.iter().enumerate() {
            // Names are declared once.
            let parts = piece.split(|&byte| byte == b'@' && !piece.starts_with(b";"));
            text.extend(parts.collect::<Vec<_>>().join(number.to_string().as_bytes()));
            text.extend(end);
        }
        text.extend(b"ENDDAT");
        text.extend(end);
        // Names that occur twice are refused by all forms alike, above.
        let (rows, own) = read(text.clone()).unwrap();
        let targets: Vec<Target> = rows.into_iter().map(|(_, row)| row.target().unwrap()).collect();
        let is_refused = |place: usize| refuse >> (place % 16) & 1 == 1;
        let outcomes: Vec<_> = targets.iter().enumerate().map(|(place, target)| {
            if is_refused(place) { Err(refused(target)) } else { Ok(moved(target, [by; 3])) }
        }).collect();
        let written = own.write(&outcomes, "t-1");
        let (before, after) = (without_ours(&text), without_ours(&written));
        prop_assert_eq!(before.len(), after.len());
        let mut place = 0;
        for (before, after) in before.iter().zip(&after) {
            let ((before, were), (after, are)) = (blanked(before), blanked(after));
            prop_assert_eq!(before, after);
            prop_assert_eq!(were.len(), are.len());
            if were.is_empty() {
                continue;
            }
            let moved_by = if is_refused(place) { 0.0 } else { by };
            for (was, is) in were.iter().zip(&are) {
                prop_assert!((is - was - moved_by).abs() < 1e-6, "{} {}", was, is);
            }
            place += 1;
        }
        prop_assert_eq!(place, targets.len());
        prop_assert!(targets.is_empty() || read(written).is_err());
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200), head in any::<bool>()) {
        let head: &[u8] = if head { b"DEFDAT L\nDECL POS P={X 1,Y " } else { b"" };
        let _ = read([head, &bytes].concat());
    }

    #[test]
    fn no_broken_statement_makes_it_panic(statement in "(DECL )?(E6)?(POS|FDAT|FRAME)? ?[A-Z]?(\\[[0-9, ]{0,3}\\])? ?=? ?\\{?(POS:)?([XYZABCST] ?[-+0-9.eE'BH]{0,4},? ?){0,6}[\"{}\\[\\]]{0,3}") {
        let _ = read(format!("DEFDAT L\n{statement}\nENDDAT").into_bytes());
    }
}
