//! `posegrid inspect` of tables as people have them: the section it prints, read back and run.

use std::fs;
use std::path::{Path, PathBuf};

use posegrid::files::schema;
use posegrid::files::table;

use super::cell::{Ended, ended, posegrid};

/// The two-axis positioner of `positioner.yaml`.
const POSITIONER: &str = "\
model = \"two-axis positioner\"
source = \"robot_cal_tools\"
convention = \"standard-dh\"
joint = [
  { name = \"j1\", a_mm = 0.0, alpha_deg = -90.0, d_mm = 0.0, offset_deg = 0.0, sign = 1, limits_deg = [-180.0, 180.0] },
  { name = \"j2\", a_mm = 0.0, alpha_deg = 0.0, d_mm = -475.0, offset_deg = -90.0, sign = 1, limits_deg = [-180.0, 180.0] },
]
";

/// What a pipeline file needs beside the printed sections: geometry alone is fitted, to be quick.
const REST: &str = "
[fit.full]
enabled = false

[grid]
steps_mm = [200]

[tolerance]
mm = 0.5
share = 0.95
confidence = 0.95

[output]
lake = \"lake\"
";

/// A table of the recordings beside the project; `None`, said loudly, where it is absent.
fn shared(name: &str) -> Option<PathBuf> {
    let file = Path::new("../shared/stations").join(name);
    if file.exists() {
        return Some(file);
    }
    assert!(
        std::env::var_os("CI").is_none(),
        "{} is absent: CI must have the tables",
        file.display()
    );
    eprintln!("SKIPPED: {} is absent, so this test has shown nothing", file.display());
    None
}

/// The table in a folder of its own, inspected there.
fn inspected(folder: &Path, file: &Path, robot: Option<&Path>) -> Ended {
    let name = file.file_name().expect("a file");
    fs::copy(file, folder.join(name)).expect("copied");
    let mut command = posegrid();
    command.current_dir(folder).arg("inspect").arg(name);
    if let Some(robot) = robot {
        command.arg("--robot").arg(robot);
    }
    ended(&mut command)
}

/// The sections that were printed.
fn section(results: &str) -> &str {
    let start = results.find("[robot]").expect("a section");
    &results[start..]
}

/// Stations in the lake that the printed section gives of a session.
fn stations(folder: &Path, printed: &str, robot: &str, session: &str) -> usize {
    let own = format!("file = \"{robot}.toml\"");
    let text = section(printed)
        .replacen(&own, &format!("name = \"arm\"\n{own}"), 1)
        .replace("# uncertainty", "uncertainty");
    fs::write(folder.join("pipeline.toml"), text + REST).expect("writable");
    let ready = Path::new("pipelines/robots").join(format!("{robot}.toml"));
    if ready.exists() {
        fs::copy(ready, folder.join(format!("{robot}.toml"))).expect("copied");
    }
    let mut command = posegrid();
    let ran = ended(command.arg("run").arg(folder.join("pipeline.toml")));
    assert!([0, 3].contains(&ran.code), "{}{}", ran.results, ran.messages);
    ran.no_defect();
    let files = fs::read_dir(folder.join("lake/stations/arm").join(session))
        .expect("stations of the session");
    let file = files.flatten().next().expect("a file").path();
    let schema = schema::find("stations").expect("a published table");
    table::read(&file, schema).expect("a table by its schema").rows()
}

/// One file of the six: what its inspection has to say, and its number of rows.
fn comes_in(name: &str, robot: &str, told: &[&str], rows: usize) {
    let Some(file) = shared(name) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let named = (robot == "positioner").then(|| {
        let path = folder.path().join("positioner.toml");
        fs::write(&path, POSITIONER).expect("writable");
        PathBuf::from("positioner.toml")
    });
    let found = inspected(folder.path(), &file, named.as_deref());
    found.expect(0, told);
    let session = file.file_stem().expect("a name").to_string_lossy().into_owned();
    assert_eq!(stations(folder.path(), &found.results, robot, &session), rows, "{name}");
}

const UR10: [&str; 6] = [
    "decimal comma",
    "ur10.toml, joints in rad and in the order of the columns, positions in mm",
    "joints = [\"shoulder_pan_joint\", \"shoulder_lift_joint\", \"elbow_joint\", \"wrist_1_joint\", \"wrist_2_joint\", \"wrist_3_joint\"]",
    "position = [\"measurement_x\", \"measurement_y\", \"measurement_z\"]",
    "position = [\"Goal x\", \"Goal y\", \"Goal z\"]\nunit = \"m\"",
    "order = \"fixed-xyz\", unit = \"rad\" }",
];

#[test]
fn the_ur10s_tables_come_in_by_the_printed_section() {
    comes_in("ur10-grid.csv", "ur10", &UR10, 615);
    let turned = "order = \"moving-xyz\", unit = \"deg\", sd = [\"measurement_std_rx\"";
    for name in ["ur10-random-a.csv", "ur10-random-b.csv"] {
        comes_in(name, "ur10", &[&UR10[..], &[turned]].concat(), rows_of(name));
    }
}

/// Number of rows of a CSV file beside the project; 0 where it is absent.
fn rows_of(name: &str) -> usize {
    let text = shared(name).map(|file| fs::read_to_string(file).expect("readable"));
    text.map_or(0, |text| {
        text.lines().filter(|line| !line.trim().is_empty()).count().saturating_sub(1)
    })
}

#[test]
fn the_wams_tables_come_in_as_target_and_difference() {
    let told = [
        "wam.toml, joints in deg and in the order of the columns, positions in mm",
        "position = [\"x_t + x_dif\", \"y_t + y_dif\", \"z_t + z_dif\"]  # unsure: taken as target and difference",
    ];
    comes_in("wam-grid.csv", "wam", &told, 216);
    comes_in("wam-random20.csv", "wam", &told, 20);
}

#[test]
fn the_positioners_poses_come_in_with_their_quaternions() {
    let told = [
        "positioner.toml, joints in rad and in the order of the columns, positions in m",
        "quaternion_xyzw = ",
    ];
    comes_in("positioner.yaml", "positioner", &told, 205);
}

#[test]
fn names_of_columns_are_harmless_and_rows_that_are_left_out_are_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("bad.csv");
    let mut text = "q1,q2,q3,q4,q5,q6,x,y,z,no\u{1b}[2Jte\n".to_owned();
    for number in 0..12 {
        let t = f64::from(number);
        let values = [
            t.sin(),
            t.cos(),
            t / 9.0,
            0.2 * t,
            t.cos(),
            t.sin(),
            100.0 * t,
            7.0 * t * t,
            300.0 * t.cos(),
        ];
        let texts = values.map(|value| value.to_string());
        text.extend([&texts.join(","), ",a\n"]);
    }
    text += "1,2,3\n";
    fs::write(&path, text).expect("writable");
    let found = ended(posegrid().arg("inspect").arg(&path));
    found.expect(3, &["1 row is LEFT OUT", "line 14", "no\\u{1b}[2Jte"]);
    assert!(!found.results.contains('\u{1b}'));
    ended(posegrid().arg("inspect").arg(&path).args(["--robot", "nosuch"]))
        .expect(2, &["nosuch", "posegrid robot --list"]);
    ended(posegrid().arg("inspect").arg(folder.path().join("absent.csv")))
        .expect(1, &["absent.csv"]);
}
