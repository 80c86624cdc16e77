//! Sessions that were recorded as a table of stations instead of two logs.

use std::fmt::Write as _;
use std::fs;
use std::sync::OnceLock;

use arrow::array::{Array as _, AsArray as _};
use arrow::datatypes::Float64Type;

use super::cell::{Cell, Ended};

/// The quickstart's pipeline file for tables with the columns of [`Row::text`].
const STATIONS: &str = r#"[stations]
joints = ["A1", "A2", "A3", "A4", "A5", "A6"]
joint_unit = "deg"
temperature = "T"
commanded = { position = ["cx", "cy", "cz"], unit = "mm", orientation = { quaternion_xyzw = ["qx", "qy", "qz", "qw"] } }

[stations.measured]
position = ["x0 + dx", "y", "z"]
unit = "mm"
sd = ["sx", "sy", "sz"]
samples = "n"
"#;

const HEADER: &str = "A1;A2;A3;A4;A5;A6;T;cx;cy;cz;qx;qy;qz;qw;x0;dx;y;z;sx;sy;sz;n;day";

/// A cell whose sessions are tables.
fn cell() -> Cell {
    cell_with(Cell::new(), STATIONS)
}

/// A cell whose sessions are tables with the columns of this section.
pub fn cell_with(cell: Cell, stations: &str) -> Cell {
    let text = fs::read_to_string("pipelines/quickstart.toml").expect("readable");
    let section = |name: &str| {
        let start = text.find(&format!("[{name}]")).expect("a section");
        let end = text[start..].find("\n\n").expect("its end");
        &text[start..start + end]
    };
    cell.with(section("controller"), stations)
        .with("topic = \"/commanded_pose\"\ntime = \"header\"\nunit = \"m\"\n", "")
        .with("topic = \"/tracker/point\"\ntime = \"header\"\nunit = \"m\"\ntemperature = \"/tracker/temperature\"\n", "")
        .with("# sessions", "stations = \"measured.csv\"")
}

/// The rows of the quickstart's measured stations as a person's spreadsheet has them: degrees, decimal commas.
fn rows() -> &'static [String] {
    static ROWS: OnceLock<Vec<String>> = OnceLock::new();
    ROWS.get_or_init(|| {
        let stations = super::cell::undisturbed().table("stations", "mon");
        let numbers = |name: &str| stations.f64(name).clone();
        let names = [
            "temperature_c",
            "command_x_mm",
            "command_y_mm",
            "command_z_mm",
            "command_qx",
            "command_qy",
            "command_qz",
            "command_qw",
        ];
        let before = names.map(numbers);
        let after = ["y_mm", "z_mm", "scatter_x_mm", "scatter_y_mm", "scatter_z_mm"].map(numbers);
        let x = numbers("x_mm");
        let measured =
            (0..stations.rows()).filter(|&row| stations.text("verdict").value(row) == "paired");
        let row = |row: usize| {
            let joints = stations.list("joints_rad").value(row);
            let joints = joints.as_primitive::<Float64Type>().values().iter();
            let mut values: Vec<f64> = joints.map(|angle| angle.to_degrees()).collect();
            values.extend(before.iter().map(|column| column.value(row)));
            values.extend([x.value(row) - 1000.0, 1000.0]);
            values.extend(after.iter().map(|column| column.value(row)));
            let mut text = values.iter().fold(String::new(), |mut text, value| {
                write!(text, "{value};").expect("a string");
                text
            });
            write!(text, "{};mon", stations.i64("readings_kept").value(row)).expect("a string");
            text.replace('.', ",")
        };
        measured.map(row).collect()
    })
}

fn table(rows: &[String]) -> String {
    format!("{HEADER}\n{}\n", rows.join("\n"))
}

/// A cell with one session of this table.
fn with(text: &str) -> Cell {
    let cell = cell();
    fs::create_dir_all(cell.session("mon")).expect("writable");
    fs::write(cell.session("mon").join("measured.csv"), text).expect("writable");
    cell
}

/// Held-out mean of the published accuracy figures, by model, split and angles.
fn means(cell: &Cell) -> Vec<(String, f64)> {
    let accuracy = cell.table("accuracy", "mon");
    let (name_of, value) = (accuracy.text("name"), accuracy.f64("value"));
    let name = |row: usize| {
        let words =
            ["model", "split", "angles"].map(|column| accuracy.text(column).value(row).to_owned());
        words.join(" ")
    };
    let of_means =
        (0..accuracy.rows()).filter(|&row| name_of.value(row) == "mean" && !value.is_null(row));
    of_means.map(|row| (name(row), value.value(row))).collect()
}

#[test]
fn a_table_of_the_stations_gives_what_their_logs_give() {
    let from_table = with(&table(rows()));
    from_table.run(&["--verbose"]).expect(0, &["measured, 0 not", "one table"]);
    let (found, expected) = (means(&from_table), means(super::cell::undisturbed()));
    assert!(found.len() > 5, "{found:?}");
    for ((name, found), (other, expected)) in found.iter().zip(&expected) {
        assert_eq!(name, other);
        assert!((found - expected).abs() < 2e-3, "{name}: {found} and {expected} mm");
    }
    // Once more: the run is there.
    from_table.run(&[]).expect(0, &["done-before"]);
}

#[test]
fn what_cannot_be_used_is_counted_by_line_and_column() {
    let mut rows = rows().to_vec();
    let joint = |row: &mut String, with: &str| {
        *row = format!("{with};{}", row.split_once(';').expect("cells").1);
    };
    let point = |row: &mut String, cells: [&str; 4]| {
        let mut all: Vec<String> = row.split(';').map(str::to_owned).collect();
        for (cell, with) in all[14..18].iter_mut().zip(cells) {
            with.clone_into(cell);
        }
        *row = all.join(";");
    };
    joint(&mut rows[3], "n/a");
    point(&mut rows[5], ["0", "0", "0", "0"]);
    point(&mut rows[6], ["9999", "9999", "9999", "9999"]);
    point(&mut rows[7], ["", "", "", ""]);
    point(&mut rows[8], ["100", "0", "100", "100"]);
    let copy = rows[10].clone();
    rows.push(copy);
    let short = rows[11].rsplit_once(';').expect("cells").0.to_owned();
    rows[11] = short;
    let cell = with(&table(&rows));
    let ended = cell.run(&[]);
    ended.no_defect();
    let rejects = cell.table("rejects", "mon");
    let told: Vec<(i64, String, String, String)> = (0..rejects.rows())
        .filter(|&row| !rejects.i64("line").is_null(row))
        .map(|row| {
            let column = rejects.text("column");
            let column = if column.is_null(row) { "" } else { column.value(row) };
            let text = |name: &str| rejects.text(name).value(row).to_owned();
            (rejects.i64("line").value(row), text("kind"), column.to_owned(), text("reason"))
        })
        .collect();
    let last = i64::try_from(rows.len()).expect("small") + 1;
    let expected = [
        (5, "rows", "A1", "\"n/a\" is no number"),
        (7, "readings", "", "zeros"),
        (8, "readings", "x0", "9999"),
        (9, "readings", "x0", "blank"),
        (10, "readings", "", "from the nominal arm"),
        (13, "rows", "", "cells"),
        (last, "rows", "", "a copy of line 12"),
    ];
    assert_eq!(told.len(), expected.len(), "{told:#?}");
    for ((line, kind, column, reason), wanted) in told.iter().zip(expected) {
        assert_eq!(
            (*line, kind.as_str(), column.as_str()),
            (wanted.0, wanted.1, wanted.2),
            "{reason}"
        );
        assert!(reason.contains(wanted.3), "{reason}");
    }
    // In = kept + rejected, to the row and to the reading.
    let counts = cell.table("runs", "mon");
    let counts = counts.text("counts").value(0);
    let read = rows.len();
    for words in [
        format!("\"of\":\"table rows\",\"read\":{read},\"kept\":{},", read - 3),
        format!("\"of\":\"readings\",\"read\":{},\"kept\":{},", read - 2, read - 3 - 4),
    ] {
        assert!(counts.contains(&words), "{words} is not in {counts}");
    }
}

#[test]
fn rows_of_several_sessions_stand_in_one_table_and_do_not_disturb_each_other() {
    let several = |rows: &[String]| {
        let cell = cell()
            .with("stations = \"measured.csv\"", "stations = \"all.csv\"\nsessions_by = \"column\"")
            .with("joint_unit = \"deg\"\n", "joint_unit = \"deg\"\nsession = \"day\"\n");
        fs::create_dir_all(cell.path("sessions")).expect("writable");
        fs::write(cell.path("sessions/all.csv"), table(rows)).expect("writable");
        cell
    };
    let mon = rows();
    let tue: Vec<String> = mon.iter().map(|row| row.replace(";mon", ";tue")).collect();
    let cell = several(&[mon, &tue].concat());
    cell.run(&[]).expect(0, &["2 of 2 within 0.5 mm"]);
    // A row of Wednesday's changes neither of the others.
    fs::write(
        cell.path("sessions/all.csv"),
        table(&[mon, &tue, &[mon[0].replace(";mon", ";wed")]].concat()),
    )
    .expect("writable");
    let ended = cell.run(&["mon", "tue"]);
    ended.expect(0, &["done-before"]);
    assert_eq!(
        ended.results.matches("done-before").count()
            + ended.messages.matches("done-before").count(),
        2,
        "{}",
        ended.messages
    );
    // Its own session has one station, which is no session to learn from.
    cell.run(&["wed"]).expect(1, &["wed"]);
}

#[test]
fn rows_of_several_robots_stand_in_one_table() {
    let named = |robot: &str, day: &str| -> Vec<String> {
        let of_day = rows().iter();
        let of_day = of_day.map(|row| row.replace(";mon", &format!(";{day}")));
        of_day.map(|row| format!("{row};{robot}")).collect()
    };
    let cell = cell()
        .with(
            "stations = \"measured.csv\"",
            "stations = \"all.csv\"\nsessions_by = \"column\"\nrobots_by = \"column\"",
        )
        .with(
            "joint_unit = \"deg\"\n",
            "joint_unit = \"deg\"\nsession = \"day\"\nrobot = \"arm\"\n",
        )
        .with("name = \"kr210-demo\"\n", "")
        .with(
            "[output]",
            "[[robots]]\nname = \"kr210-demo\"\n\n[[robots]]\nname = \"7\"\n\n[output]",
        );
    let all = [
        named("kr210-demo", "mon"),
        named("stranger", "mon"),
        named("7", "mon"),
        named("stranger", "tue"),
        vec![format!("{};", rows()[0])],
    ];
    let text = format!("{HEADER};arm\n{}\n", all.concat().join("\n"));
    fs::create_dir_all(cell.path("sessions")).expect("writable");
    fs::write(cell.path("sessions/all.csv"), text).expect("writable");
    cell.run(&[]).expect(
        0,
        &[
            "done         kr210-demo/mon: within tolerance",
            "done         7/mon: within tolerance",
            "waits        stranger: no robot of the pipeline file is called so, as rows of tables state",
            "1 of its rows name no robot or no session",
            "2 of 2 within 0.5 mm",
        ],
    );
    // The same work by a pipeline file of the one robot, which reads its rows alone.
    let cell = cell.with("\nrobots_by = \"column\"", "").with(
        "[[robots]]\nname = \"kr210-demo\"\n\n[[robots]]\nname = \"7\"\n\n[output]",
        "[output]",
    );
    cell.run(&[]).expect(2, &["[robot] name", "[stations] robot names the column"]);
    let cell = cell.with("[robot]\n", "[robot]\nname = \"7\"\n");
    cell.run(&[]).expect(0, &["done-before  mon", "1 of 1 within 0.5 mm"]);
}

/// What the command says of a pipeline file with a change.
fn told(from: &str, to: &str) -> Ended {
    let cell = with(&table(rows()));
    let cell = cell.with(from, to);
    cell.run(&[])
}

#[test]
fn a_wrong_section_is_told_with_the_remedy() {
    told("\"A1\", ", "")
        .expect(2, &["[stations] joints", "5 columns", "6, one for each reported joint"]);
    told("\"A1\", ", "\"A7\", ")
        .expect(1, &["[stations] joints", "\"A7\"", "A1", "posegrid inspect"]);
    told("joint_unit = \"deg\"", "joint_unit = \"grad\"").expect(2, &["grad"]);
    told("stations = \"measured.csv\"", "")
        .expect(2, &["needs stations, such as stations = \"measured.csv\""]);
    told("[stations]\n", "[stations]\ntopic = \"/x\"\n").expect(2, &["topic"]);
    // Degrees taken for radians: the same check as with logs names the key.
    told("joint_unit = \"deg\"", "joint_unit = \"rad\"")
        .expect(1, &["contradict the stated set-up", "deg"]);
}

mod references;
