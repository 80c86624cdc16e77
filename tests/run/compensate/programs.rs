//! Whole programs: corrected, and back to their originals byte for byte.

use std::fs;
use std::path::Path;

use super::commands::{compensate, file_of, lake, text_of};

const PROGRAM: &[u8] = b"&ACCESS RVP\r\nDEF t()\r\n;gr\xfc\xdfe\r\n\
    $BASE = {X 0.0, Y 0.0, Z 0.0, A 0.0, B 0.0, C 0.0}\r\n$TOOL = {X 25.0, Y -40.0, Z 100.0, A 0.0, B 0.0, C 0.0}\r\n\
    PTP {A1 0.0, A2 -75.0, A3 95.0, A4 25.0, A5 60.0, A6 -15.0}\r\n\
    PTP {A1 5.0, A2 -77.0, A3 97.0, A4 26.0, A5 61.0, A6 -14.0}\r\nEND\r\n";

const MACHINE: &str =
    "DEFDAT $MACHINE PUBLIC\n$ROBROOT={X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n";

const CELL: &str =
    "[frames]\n\"$ROBROOT\" = { found = \"surveyed\" }\n\"$TOOL\" = { found = \"surveyed\" }\n";

/// The program's folder of a backup, corrected by the quickstart's arm.
fn corrected(folder: &Path) {
    fs::create_dir_all(folder.join("backup/R1")).expect("writable");
    fs::write(folder.join("backup/R1/t.src"), PROGRAM).expect("writable");
    fs::write(folder.join("backup/$machine.dat"), MACHINE).expect("writable");
    fs::write(folder.join("cell.toml"), CELL).expect("writable");
    let arm = text_of(&file_of(lake(), "calibrations"));
    let [backup, cell, out] = ["backup", "cell.toml", "out"].map(|own| text_of(&folder.join(own)));
    let mut args = vec![arm.as_str(), &backup, "--cell", &cell, "--points", "off-line"];
    args.extend(["--out", &out, "--no-record"]);
    for term in ["tool", "payload", "mounting", "base", "controller-model", "absolute-accuracy"] {
        args.extend(["--allow", term]);
    }
    args.extend(["--allow", "temperature"]);
    let done = compensate(&args);
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
