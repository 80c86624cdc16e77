//! Reference reflectors in a table: drift and bump of the instrument are taken out of the readings, and told.

use arrow::array::Array as _;
use nalgebra::{Isometry3, Point3, Rotation3, Vector3};

use super::{HEADER, STATIONS, cell, means, rows};
use crate::cell::Cell;
use crate::joined::assert_two_steps_as_one;

const REFERENCES: &str = r#"
[[stations.references]]
name = "F1"
on = "floor"
position = ["F1_x", "F1_y", "F1_z"]
unit = "mm"

[[stations.references]]
name = "F2"
on = "floor"
position = ["F2_x", "F2_y", "F2_z"]
unit = "mm"

[[stations.references]]
name = "F3"
on = "floor"
position = ["F3_x", "F3_y", "F3_z"]
unit = "mm"
"#;

/// Columns of x0, y and z in a row.
const POSITION: [usize; 3] = [14, 16, 17];
/// The station before which the tripod is bumped.
const BUMPED: usize = 70;

/// A small generator of numbers from −1 to 1.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 =
            self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// The motion of everything in the instrument's frame at a station: a slow drift, and a bump of millimetres.
fn motion(station: usize) -> Isometry3<f64> {
    let share = station as f64 / 100.0;
    let bump = if station < BUMPED { 0.0 } else { 1.0 };
    let shift = Vector3::new(0.5 * share + 3.0 * bump, -0.2 * share - bump, 0.3 * share);
    let turn = Vector3::new(1e-4 * share, 0.0, 1e-4 * share + 1e-3 * bump);
    Isometry3::from_parts(shift.into(), Rotation3::new(turn).into())
}

/// The table of the quickstart's stations as a moving instrument measures them, with the readings of `count` references.
fn moved(count: usize) -> String {
    let number = |cell: &str| cell.replace(',', ".").parse::<f64>().expect("a number");
    let mut noise = Noise(7);
    let places = [[900.0, -700.0, -200.0], [1600.0, 300.0, -250.0], [400.0, 600.0, 300.0]];
    let mut text = format!("{HEADER};F1_x;F1_y;F1_z;F2_x;F2_y;F2_z;F3_x;F3_y;F3_z\n");
    for (station, row) in rows().iter().enumerate() {
        let now = motion(station);
        let mut cells: Vec<String> = row.split(';').map(str::to_owned).collect();
        let dx = number(&cells[15]);
        let at = Point3::from(POSITION.map(|column| number(&cells[column]))) + Vector3::x() * dx;
        let at = now * at - Vector3::x() * dx;
        for (axis, column) in POSITION.into_iter().enumerate() {
            cells[column] = at[axis].to_string().replace('.', ",");
        }
        for (place, at) in places.iter().enumerate() {
            // The third is read at every second station, and once wrongly.
            let is_read = place < count && (place < 2 || station % 2 == 0);
            let mut seen = now * Point3::from(*at);
            if (place, station) == (1, 33) {
                seen.x += 2.5;
            }
            if (place, station) == (0, 40) {
                seen.y = 1e12;
            }
            for axis in 0..3 {
                let value = seen[axis] + 0.03 * noise.next();
                cells.push(if is_read {
                    value.to_string().replace('.', ",")
                } else {
                    String::new()
                });
            }
        }
        text.push_str(&cells.join(";"));
        text.push('\n');
    }
    text
}

fn session(text: &str, references: &str) -> Cell {
    let cell = cell().with(STATIONS, &format!("{STATIONS}{references}"));
    std::fs::create_dir_all(cell.session("mon")).expect("writable");
    std::fs::write(cell.session("mon").join("measured.csv"), text).expect("writable");
    cell
}

fn mean(cell: &Cell, model: &str) -> f64 {
    let all = means(cell);
    let own = all.iter().find(|(name, _)| name.starts_with(model) && name.contains("blocks"));
    own.unwrap_or_else(|| panic!("{model} in {all:?}")).1
}

#[test]
fn drift_and_bump_are_taken_out_and_told() {
    let still = super::with(&super::table(rows()));
    still.run(&[]).expect(0, &[]);
    let text = moved(3);
    let followed = session(&text, REFERENCES);
    followed.run(&["--verbose"]).expect(
        0,
        &[
            "the instrument was bumped between station 69 (line 71) and station 70 (line 72)",
            "3 references on the floor, which tell rotations",
            "1 stray readings",
            "taken out of the readings",
        ],
    );
    let blind = session(&text, "");
    // Without references the arm tells the bump, but not all of the drift.
    let told = blind.run(&[]).results;
    assert!(told.contains("was knocked before station 70"), "{told}");
    for model in ["geometric", "full"] {
        let [of_still, of_followed, of_blind] =
            [&still, &followed, &blind].map(|cell| mean(cell, model));
        println!("{model}: {of_still} mm still, {of_followed} mm followed, {of_blind} mm blind");
        assert!(
            of_followed < 1.1 * of_still + 0.01 && of_blind > 1.1 * of_followed,
            "{model}: {of_still} mm still, {of_followed} mm followed, {of_blind} mm blind"
        );
    }
    let motion = followed.table("reference_motion", "mon");
    let (event, taken) = (motion.text("event"), motion.text("stands_on"));
    let bumps: Vec<usize> = (0..motion.rows()).filter(|&row| event.is_valid(row)).collect();
    assert_eq!(bumps, [BUMPED]);
    assert_eq!((motion.rows(), taken.value(0)), (rows().len(), "floor"));
    let places = followed.table("references", "mon");
    assert_eq!(places.rows(), 3);
    let rejects = followed.table("rejects", "mon");
    let kinds = rejects.text("kind");
    let own: Vec<usize> =
        (0..rejects.rows()).filter(|&row| kinds.value(row) == "references").collect();
    assert_eq!(own.len(), 2);
    let reason = rejects.text("reason").value(own[1]);
    assert!(reason.contains("beyond the reach of any arm or instrument"), "{reason}");
    assert!(rejects.text("reason").value(own[0]).contains("reference \"F2\" is 2."));
    crate::verify::verify(&followed, &[]).expect(0, &[]);
}

#[test]
fn two_references_keep_the_larger_part() {
    let two =
        REFERENCES.split("\n[[stations.references]]\nname = \"F3\"").next().expect("the first two");
    let cell = session(&moved(2), two);
    cell.run(&[]).expect(0, &["only the larger is used"]);
    let stations = cell.table("stations", "mon");
    let (verdict, reason) = (stations.text("verdict"), stations.text("reason"));
    let unmeasured: Vec<usize> =
        (0..stations.rows()).filter(|&row| verdict.value(row) != "paired").collect();
    let smaller: Vec<usize> = if 2 * BUMPED > stations.rows() {
        (BUMPED..stations.rows()).collect()
    } else {
        (0..BUMPED).collect()
    };
    assert_eq!(unmeasured, smaller);
    assert!(unmeasured.iter().all(|&row| reason.value(row) == "instrument_moved"));
    assert_two_steps_as_one(&cell, 0);
}

#[test]
fn a_wrong_section_of_references_is_told() {
    let text = moved(3);
    let told = |from: &str, to: &str| session(&text, &REFERENCES.replace(from, to)).run(&[]);
    told("name = \"F2\"", "name = \"F1\"")
        .expect(2, &["[[stations.references]] name", "\"F1\" twice"]);
    told("\nposition = [\"F2_x\", \"F2_y\", \"F2_z\"]", "")
        .expect(2, &["[[stations.references]] position", "three columns"]);
    told("on = \"floor\"", "on = \"wall\"").expect(2, &["wall"]);
    // A wire whose anchor is on the floor, beside references on a base that may move.
    let wire = "\n[[stations.lengths]]\nname = \"wire\"\nreads = \"distance\"\ncolumn = \"L\"\nunit = \"mm\"\nsd_mm = 0.1\n";
    let on_base = REFERENCES.replace("on = \"floor\"", "on = \"base\"") + wire;
    session(&text, &on_base)
        .run(&[])
        .expect(2, &["[[stations.lengths]] on", "\"wire\" beside references on the base"]);
    told("\"F3_z\"", "\"F4_z\"").expect(1, &["F4_z"]);
}

/// A session that `posegrid simulate --table` wrote, by the section in the table's head.
#[test]
fn a_simulated_table_has_the_drift_of_its_base() {
    let flags =
        ["--grid-step", "240", "--size", "720,960,480", "--table", "--base-drift-mm", "0.5"];
    let references =
        ["--reference", "300,300,100", "--reference", "-300,250,90", "--reference", "100,-380,400"];
    let flags: Vec<&str> = flags.into_iter().chain(references).collect();
    let made = cell().with_simulated("mon", &flags);
    let text = std::fs::read_to_string(made.session("mon").join("stations.csv")).expect("written");
    let head = text.lines().skip(1).map_while(|line| line.strip_prefix("# "));
    let section: Vec<&str> = head.collect();
    let cell = made
        .with(STATIONS, &format!("{}\n", section.join("\n")))
        .with("stations = \"measured.csv\"", "stations = \"stations.csv\"");
    cell.run(&["--verbose"]).expect(0, &["3 references on the base, which tell rotations"]);
    let motion = cell.table("reference_motion", "mon");
    let shift = ["shift_x_mm", "shift_y_mm", "shift_z_mm"].map(|name| motion.f64(name).clone());
    let size = |row: usize| Vector3::from([0, 1, 2].map(|axis| shift[axis].value(row))).norm();
    let largest = (0..motion.rows()).map(size).fold(0.0, f64::max);
    assert!((0.2..2.0).contains(&largest), "{largest} mm");
    // A drift is no bump.
    assert_eq!(motion.text("event").null_count(), motion.rows());
}

/// What `posegrid inspect` makes of positions that stand still while the arm moves.
#[test]
fn inspect_takes_positions_that_stand_still_for_references() {
    // The quickstart's x is a sum of columns, which no name tells: a constant away it is one column.
    let cell = session(&moved(3).replace("x0;dx;", "x;more;").replace(";F", ";B"), "");
    let table = cell.session("mon").join("measured.csv");
    let mut inspect = crate::cell::posegrid();
    inspect.arg("inspect").arg(&table).args(["--robot", "kr210-r2700-extra"]);
    crate::cell::ended(&mut inspect).expect(
        0,
        &[
            "[[stations.references]]\nname = \"B1\"\non = \"base\"  # unsure: it does not move with the arm",
            "position = [\"B3_x\", \"B3_y\", \"B3_z\"]",
        ],
    );
}

/// A table of a 6-DoF target that `posegrid simulate` wrote has its orientations, as the log has.
#[test]
fn a_simulated_table_has_the_orientations_of_its_target() {
    let made = cell().with_simulated("mon", &["--random-joints", "30", "--table", "--six-dof"]);
    let text = std::fs::read_to_string(made.session("mon").join("stations.csv")).expect("written");
    let head = text.lines().skip(1).map_while(|line| line.strip_prefix("# "));
    let section: Vec<&str> = head.collect();
    let cell = made
        .with(STATIONS, &format!("{}\n", section.join("\n")))
        .with("stations = \"measured.csv\"", "stations = \"stations.csv\"");
    let ended = cell.run(&[]);
    assert!([0, 3].contains(&ended.code), "{}", ended.messages);
    let stations = cell.table("stations", "mon");
    let (component, scatter) = (stations.f64("qw"), stations.f64("scatter_orientation_rad"));
    assert_eq!((stations.rows(), component.null_count()), (30, 0));
    assert!((0..30).all(|row| (1e-6..1e-3).contains(&scatter.value(row))));
}
