//! Reference reflectors in a tracker's log: their motion is that of a table of the same session, and a bump is found.

use std::fs;

use arrow::array::Array as _;

use crate::cell::Cell;
use crate::joined::assert_two_steps_as_one;
use crate::tabled::cell_with;

/// The references on the base, as `posegrid simulate` logs them.
const REFERENCES: &str = r#"[tracker.fields]
target = "child_frame_id"

[[tracker.references]]
name = "B1"
on = "base"
topic = "/tracker/references"
is = "B1"

[[tracker.references]]
name = "B2"
on = "base"
topic = "/tracker/references"
is = "B2"

[[tracker.references]]
name = "B3"
on = "base"
topic = "/tracker/references"
is = "B3"

[fit]
"#;

/// A session with a drift and a bump of the base.
const BUMPED: [&str; 15] = [
    "--grid-step",
    "240",
    "--size",
    "720,960,480",
    "--table",
    "--base-drift-mm",
    "0.3",
    "--bump-mm",
    "2",
    "--reference",
    "300,300,100",
    "--reference",
    "-300,250,90",
    "--reference",
    "100,-380,400",
];

fn logged(flags: &[&str]) -> Cell {
    let cell = Cell::new().with_simulated("mon", flags);
    cell.with("[fit]\n", REFERENCES)
}

/// The same session as a table, with the section in its head.
fn tabled() -> Cell {
    cell_of_table(&BUMPED)
}

/// A session with these flags as a table, with the section in its head.
fn cell_of_table(flags: &[&str]) -> Cell {
    let made = Cell::new().with_simulated("mon", flags);
    let text = fs::read_to_string(made.session("mon").join("stations.csv")).expect("written");
    let head = text.lines().skip(1);
    let section: Vec<&str> = head.map_while(|line| line.strip_prefix("# ")).collect();
    cell_with(made, &format!("{}\n", section.join("\n")))
        .with("stations = \"measured.csv\"", "stations = \"stations.csv\"")
}

/// Shift and rotation of each station's look, mm and rad, and whether something happened there.
fn motions(cell: &Cell) -> Vec<(Vec<f64>, bool)> {
    let motion = cell.table("reference_motion", "mon");
    let names =
        ["shift_x_mm", "shift_y_mm", "shift_z_mm", "turn_x_rad", "turn_y_rad", "turn_z_rad"];
    let columns = names.map(|name| motion.f64(name).clone());
    let event = motion.text("event");
    let station = motion.i64("station");
    let row = |row: usize| {
        let values = columns.iter().map(|own| own.value(row));
        (values.collect(), event.is_valid(row))
    };
    let rows = (0..motion.rows()).filter(|row| station.is_valid(*row));
    rows.map(row).collect()
}

#[test]
fn log_and_table_of_a_session_give_the_same_course_and_the_bump() {
    let logs = logged(&BUMPED);
    logs.run(&["--verbose"]).expect(
        0,
        &[
            "the base or the instrument was bumped between station",
            "3 references on the base, which tell rotations",
        ],
    );
    let table = tabled();
    table.run(&[]).expect(0, &["was bumped between station"]);
    let (of_logs, of_table) = (motions(&logs), motions(&table));
    assert_eq!(of_logs.len(), of_table.len());
    let bumps = of_logs.iter().filter(|(_, happened)| *happened).count();
    assert_eq!(bumps, 1);
    for (look, (own, other)) in of_logs.iter().zip(&of_table).enumerate() {
        assert_eq!(own.1, other.1, "look {look}");
        let off = own.0.iter().zip(&other.0).map(|(a, b)| (a - b).abs());
        let [x, y, z, turns @ ..] = &off.collect::<Vec<f64>>()[..] else {
            panic!("six numbers");
        };
        // References are read to some 0.02 mm in the table, at half a metre from their middle.
        let shift_mm = x.max(*y).max(*z);
        assert!(shift_mm < 0.06, "look {look}: {shift_mm} mm");
        assert!(turns.iter().all(|turn| *turn < 2e-4), "look {look}: {turns:?}");
    }
    crate::verify::verify(&logs, &[]).expect(0, &[]);
}

#[test]
fn a_bump_larger_than_the_gate_of_the_join_is_carried_across() {
    let bumped = logged(&BUMPED.map(|flag| if flag == "2" { "200" } else { flag }));
    bumped.run(&[]).expect(
        0,
        &[
            "the base or the instrument was bumped between station",
            "the references tie both parts of the session together",
        ],
    );
    let motion = motions(&bumped);
    let shift_mm =
        |(own, _): &(Vec<f64>, bool)| own[..3].iter().map(|own| own * own).sum::<f64>().sqrt();
    let (first, last) = (shift_mm(&motion[0]), shift_mm(&motion[motion.len() - 1]));
    assert!(first < 1.0 && (last - 200.0).abs() < 1.0, "{first} {last}");
    let verdicts = bumped.table("stations", "mon");
    let paired = verdicts.text("verdict");
    let unpaired = (0..verdicts.rows()).filter(|row| paired.value(*row) != "paired");
    let (before, of) = (unpaired.count(), verdicts.rows());
    assert!(before <= 2, "{before} of {of} stations are not paired");
}

#[test]
fn a_silent_reference_is_told() {
    let cell = logged(&BUMPED).with("is = \"B3\"", "is = \"B9\"");
    let said = "reference \"B3\" on the base has no reading in this session: the other 2 tell no rotations";
    // Two references cannot tie the parts before and after the bump together: half of the session is left, too few to judge.
    cell.run(&[]).expect(3, &[said, "only the larger is used", "59 poses are needed"]);
}

#[test]
fn a_run_from_the_session_as_joined_has_the_same_bytes() {
    assert_two_steps_as_one(&logged(&BUMPED), 0);
}

#[test]
fn a_wrong_section_of_references_is_explained() {
    let cell = || logged(&BUMPED);
    cell()
        .with("name = \"B2\"", "name = \"B1\"")
        .run(&[])
        .expect(2, &["[tracker] targets", "\"B1\" twice"]);
    cell()
        .with("topic = \"/tracker/references\"\nis = \"B3\"", "is = \"B3\"")
        .run(&[])
        .expect(2, &["\"B3\" on the topic of another"]);
    cell()
        .with("topic = \"/tracker/references\"", "topic = \"/nothing\"")
        .run(&[])
        .expect(1, &["no topic \"/nothing\""]);
}

/// The reflectors on the floor, as `posegrid simulate` logs them.
fn on_floor() -> String {
    let references = (1..=3).map(|number| {
        format!(
            "[[tracker.references]]\nname = \"F{number}\"\non = \"floor\"\ntopic = \"/tracker/references\"\nis = \"F{number}\"\n\n"
        )
    });
    let references: String = references.collect();
    format!("[tracker.fields]\ntarget = \"child_frame_id\"\n\n{references}[fit]\n")
}

/// A session whose tracker drifts and is bumped on its stand.
const MOVED: [&str; 15] = [
    "--grid-step",
    "240",
    "--size",
    "720,960,480",
    "--table",
    "--tracker-drift-mm",
    "0.3",
    "--tracker-bump-mm",
    "1.5",
    "--floor-reference",
    "1500,1200,-600",
    "--floor-reference",
    "800,-1500,-590",
    "--floor-reference",
    "2600,-200,-610",
];

/// Mean held-out error of the full error model, mm.
fn held_out_mm(cell: &Cell) -> f64 {
    let table = cell.table("accuracy", "mon");
    let is = |row: usize, column: &str, word: &str| table.text(column).value(row) == word;
    let mut rows = (0..table.rows()).filter(|&row| {
        is(row, "name", "mean") && is(row, "model", "full") && is(row, "role", "held_out")
    });
    table.f64("value").value(rows.next().expect("a held-out mean"))
}

#[test]
fn motion_of_the_tracker_is_taken_out_by_references_on_the_floor() {
    let followed = Cell::new().with_simulated("mon", &MOVED).with("[fit]\n", &on_floor());
    followed.run(&[]).expect(0, &["was bumped between station"]);
    let still = Cell::new().with_simulated("mon", &MOVED[..5]);
    still.run(&[]).expect(0, &[]);
    let alone = Cell::new().with_simulated("mon", &MOVED);
    let ended = alone.run(&[]);
    assert!([0, 1, 3].contains(&ended.code), "{}", ended.messages);
    let (followed_mm, still_mm) = (held_out_mm(&followed), held_out_mm(&still));
    println!("held-out mean: tracker still {still_mm}, followed {followed_mm} mm");
    // Three references are read to some 0.03 mm each, at two metres from the targets.
    assert!(followed_mm < 1.5 * still_mm, "{followed_mm} {still_mm}");
    if ended.code != 1 {
        let alone_mm = held_out_mm(&alone);
        assert!(alone_mm > 2.0 * still_mm, "{alone_mm} {still_mm}");
    }
    let table = cell_of_table(&MOVED);
    table.run(&[]).expect(0, &["was bumped between station"]);
    let (of_logs, of_table) = (motions(&followed), motions(&table));
    assert_eq!(of_logs.len(), of_table.len());
    for (look, (own, other)) in of_logs.iter().zip(&of_table).enumerate() {
        assert_eq!(own.1, other.1, "look {look}");
        let off = own.0[..3].iter().zip(&other.0).map(|(a, b)| (a - b).abs());
        let off_mm = off.fold(0.0, f64::max);
        assert!(off_mm < 0.3, "look {look}: {off_mm} mm");
    }
}
