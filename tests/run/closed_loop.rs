//! Arms that another program wrote are measured, identified, corrected and measured again (`tests/readers/independent_arm.py`): the
//! table corrects every target of the measured box, and leaves hardly more than the identified arm does. One of them has three
//! reflectors and a tracker that is knocked (`tests/readers/independent_reflectors.py`).
//!
//! Python is `POSEGRID_PYTHON`, or that of `target/ci-venv`, which `.ci/run` makes; without one that has the packages the test says
//! that it did not run, and fails where `CI` is set. Many arms: `python tests/readers/independent_arm.py posegrid --seed 1 --seed 2 …`.

use std::path::PathBuf;
use std::process::Command;

/// A Python that has what the script needs; `None`, told, where there is none.
fn python() -> Option<PathBuf> {
    let stated = std::env::var_os("POSEGRID_PYTHON").map(PathBuf::from);
    let python = stated.unwrap_or_else(|| "target/ci-venv/bin/python".into());
    let packages = ["-c", "import numpy, mcap_ros2.writer"];
    let has_them = Command::new(&python).args(packages).output();
    if has_them.is_ok_and(|ended| ended.status.success()) {
        return Some(python);
    }
    let what = "no numpy and mcap-ros2-support in POSEGRID_PYTHON or target/ci-venv";
    assert!(std::env::var_os("CI").is_none(), "{what}");
    eprintln!("SKIPPED: {what}: no arm of another program was measured");
    None
}

/// What a script says of one arm of its own; a failure where it finds one.
fn measured(script: &str) {
    let Some(python) = python() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let ended = Command::new(python)
        .arg(format!("tests/readers/{script}"))
        .arg(env!("CARGO_BIN_EXE_posegrid"))
        .arg("--folder")
        .arg(folder.path().join("arms"))
        .args(["--seed", "1"])
        .output()
        .expect("Python starts");
    let told = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    println!("{}", told(&ended.stdout));
    assert!(ended.status.success(), "{}{}", told(&ended.stdout), told(&ended.stderr));
}

#[test]
fn the_table_corrects_every_target_of_the_box_about_as_well_as_the_identified_arm() {
    measured("independent_arm.py");
}

#[test]
fn three_reflectors_and_a_tripod_that_is_knocked_correct_places_and_orientations() {
    measured("independent_reflectors.py");
}
