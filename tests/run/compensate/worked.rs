//! Numbers and commands of the README, the guide and the method, held against a run of the quickstart.
//!
//! Where a text has grown stale, the test names the file and prints what has to stand there.

use std::collections::BTreeMap;
use std::fs;

use nalgebra::Vector3;
use posegrid::files::schema;
use posegrid::files::table;

use super::cell::field;
use super::quickstart::{quickstart, sh};

/// A section of a document, from the line below its heading to the next heading of the same level.
fn section(file: &str, heading: &str) -> String {
    let text = fs::read_to_string(file).expect("part of the project");
    let (_, below) = text
        .split_once(&format!("\n{heading}\n"))
        .unwrap_or_else(|| panic!("{file} has no section {heading:?}"));
    let level = heading.split(' ').next().expect("its marks");
    let end = below.find(&format!("\n{level} "));
    below[..end.unwrap_or(below.len())].to_owned()
}

/// The first fenced text of a language in a section.
fn fenced<'a>(section: &'a str, language: &str) -> &'a str {
    let start = section.split_once(&format!("```{language}\n"));
    let (_, text) = start.unwrap_or_else(|| panic!("no text in {language:?} in {section}"));
    text.split("```").next().expect("fenced")
}

/// The words of a text, whatever its lines are.
fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Asserts that a section says something.
fn says(file: &str, section: &str, wanted: &str) {
    assert!(
        words(section).contains(&words(wanted)),
        "{file} is stale; it has to say\n\n{wanted}\n\nand says\n{section}"
    );
}

/// A point or vector, mm, with so many digits.
fn written(vector: Vector3<f64>, digits: usize) -> String {
    let [x, y, z] = vector.into();
    format!("({x:.digits$}, {y:.digits$}, {z:.digits$})").replace('-', "−")
}

/// Three columns of a target's row in a CSV.
fn vector(csv: &str, target: &str, columns: [&str; 3]) -> Vector3<f64> {
    let number = |column| field(csv, target, column).parse().expect("a number");
    columns.map(number).into()
}

const POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
const CORRECTION: [&str; 3] = ["correction_x_mm", "correction_y_mm", "correction_z_mm"];
const SD: [&str; 3] = ["correction_sd_x_mm", "correction_sd_y_mm", "correction_sd_z_mm"];

#[test]
fn the_readme_shows_what_the_quickstart_prints() {
    let done = quickstart();
    let readme = section("README.md", "## Two commands");
    let printed = done.printed.replace(&done.run(), "RUN");
    let shown = fenced(&readme, "text");
    assert_eq!(shown.trim(), printed.trim(), "README.md is stale: this is printed\n\n{printed}");
}

#[test]
fn the_commands_of_the_readme_give_what_it_says() {
    let done = quickstart();
    let apply = section("README.md", "## Apply it");
    fs::write(done.folder.join("targets.csv"), fenced(&apply, "csv")).expect("writable");
    done.sh(fenced(&apply, "sh"));
    let corrected = fs::read_to_string(done.folder.join("corrected.csv")).expect("written");
    let wanted = format!(
        "The command for it is {} mm. The correction is {} mm, with standard deviations of {} mm.",
        written(vector(&corrected, "A", POSITION), 3),
        written(vector(&corrected, "A", CORRECTION), 3),
        written(vector(&corrected, "A", SD), 3),
    );
    says("README.md", &apply, &wanted);
    let guide = fs::read_to_string("src/guide/compensate.md").expect("part of the project");
    done.sh(fenced(&guide, "sh"));
    let by_name = fs::read_to_string(done.folder.join("by-name.csv")).expect("written");
    assert_eq!(vector(&by_name, "A", POSITION), vector(&corrected, "A", POSITION));
    let night = done.sh(fenced(&section("README.md", "## Every night"), "sh"));
    assert!(night.contains("done-before  quickstart"), "{night}");
}

/// The quickstart's table as `posegrid export --format csv` writes it.
struct Exported {
    /// What holds for the whole table, from the lines before the nodes.
    terms: BTreeMap<String, String>,
    /// Place and error of each node, mm.
    nodes: Vec<(Vector3<f64>, Vector3<f64>)>,
}

fn exported() -> Exported {
    let done = quickstart();
    let table = done.table("compensation");
    let csv = done.sh(&format!("posegrid export {table} --format csv"));
    let term = |line: &str| {
        let (name, value) = line.strip_prefix("# ")?.split_once(": ")?;
        Some((name.to_owned(), value.trim_matches('"').to_owned()))
    };
    let mut reader = csv::ReaderBuilder::new();
    let mut reader = reader.comment(Some(b'#')).from_reader(csv.as_bytes());
    let headers = reader.headers().expect("a first line").clone();
    let nodes = reader.records().map(|row| {
        let row = row.expect("a row");
        let number = |name: String| -> f64 {
            let place = headers.iter().position(|header| header == name);
            let cell = &row[place.expect("a column")];
            cell.parse().expect("a number")
        };
        let axes = ["x", "y", "z"];
        let place = axes.map(|axis| number(format!("{axis}_mm")));
        let error = axes.map(|axis| number(format!("error_{axis}_mm")));
        (place.into(), error.into())
    });
    Exported { nodes: nodes.collect(), terms: csv.lines().filter_map(term).collect() }
}

impl Exported {
    /// Distance of neighbouring nodes along each axis, mm.
    fn pitch(&self) -> Vector3<f64> {
        let number = |axis| self.terms[&format!("step_{axis}_mm")].parse::<f64>();
        ["x", "y", "z"].map(|axis| number(axis).expect("a number")).into()
    }
}

/// The method's worked example: interpolation as a reader does it with a calculator, from the printed digits.
fn by_hand(target: Vector3<f64>, table: &Exported, commanded: Vector3<f64>) -> String {
    let pitch = table.pitch();
    let weight = |place: &Vector3<f64>| {
        let shares = (target - place).abs().component_div(&pitch);
        shares.map(|share| (1.0 - share).max(0.0)).product()
    };
    let nodes = table.nodes.iter().map(|(place, error)| (place, error, weight(place)));
    let around: Vec<_> = nodes.filter(|(_, _, weight)| *weight > 0.0).collect();
    assert_eq!(around.len(), 8, "the target lies inside a cell");
    let rows = around.iter().map(|(place, error, weight)| {
        format!(
            "| {} | {} | {} | {weight:.6} | {:.6} | {:.6} | {:.6} |\n",
            place.x, place.y, place.z, error.x, error.y, error.z
        )
    });
    let rows = rows.collect::<String>().replace('-', "−");
    let error_there: Vector3<f64> = around.iter().map(|(_, error, weight)| *error * *weight).sum();
    let first = target - error_there;
    let further_um = (commanded - first).norm() * 1000.0;
    // The step that the calculator leaves out is there, and it is small.
    let least_um = 0.01;
    let most_um = 2e-3 * error_there.norm() * 1000.0;
    assert!(further_um > least_um && further_um < most_um, "{further_um}");
    format!(
        "The target of the README is at {} mm. `posegrid export … --format csv` has the eight nodes around it. Each counts by the \
         product, over the three axes, of 1 − distance / pitch, with the pitches ({}, {}, {}) mm:\n\n\
         | x mm | y mm | z mm | weight | error x mm | error y mm | error z mm |\n|---|---|---|---|---|---|---|\n{rows}\n\
         Weights times errors add up to the error at the target, {} mm. Target minus error is the first command, {} mm. The error \
         there is a little different. `posegrid compensate` repeats the step until nothing changes, and says {} mm, which is \
         {further_um:.1} µm further on.\n",
        written(target, 0),
        pitch.x,
        pitch.y,
        pitch.z,
        written(error_there, 6),
        written(first, 6),
        written(commanded, 6),
    )
}

#[test]
fn the_target_worked_by_hand_is_the_programs() {
    let done = quickstart();
    let targets = fenced(&section("README.md", "## Apply it"), "csv").to_owned();
    fs::write(done.folder.join("by_hand.csv"), &targets).expect("writable");
    let table = done.table("compensation");
    let corrected = done.sh(&format!("posegrid compensate {table} by_hand.csv --no-record"));
    let exported = exported();
    assert_eq!(exported.terms["interpolation"], "trilinear", "the example's weights are those");
    let example =
        by_hand(vector(&targets, "A", POSITION), &exported, vector(&corrected, "A", POSITION));
    let method = "src/numerics/method/compensation.md";
    says(method, &section(method, "# A target by hand"), &example);
}

#[test]
fn the_figures_to_expect_are_those_of_the_run() {
    let done = quickstart();
    let path = done.folder.join(done.table("accuracy"));
    let schema = schema::find("accuracy").expect("published");
    let table = table::read(&path, schema).expect("readable");
    let mean = |model: &str, angles: &str| {
        let is = |row: &usize, column: &str, word: &str| table.text(column).value(*row) == word;
        let mut rows = (0..table.rows()).filter(|row| {
            is(row, "split", "blocks")
                && is(row, "quantity", "position_error")
                && is(row, "name", "mean")
                && is(row, "model", model)
                && is(row, "angles", angles)
        });
        let row = rows.next().expect("a mean of held-out blocks");
        assert_eq!(rows.next(), None, "one of {model}");
        table.f64("value").value(row)
    };
    let wanted = format!(
        "| KR 210, simulated, blocks held out | {:.3} | {:.3} | {:.3} | {:.3} | {:.3} ({} mm step) |",
        mean("base_target", "reported"),
        mean("geometric", "reported"),
        mean("full", "weighted"),
        mean("full", "commanded"),
        mean("table", "commanded"),
        exported().pitch().x,
    );
    let guide = "src/guide/figures.md";
    says(guide, &section(guide, "# What to expect"), &wanted);
}

/// Runs the commands of a tutorial in their order, in a folder with the files that it shows; what they print on stdout.
fn tutorial(chapter: &str) -> String {
    let folder = tempfile::tempdir().expect("a folder");
    let text = fs::read_to_string(chapter).expect("part of the project");
    let mut printed = String::new();
    for piece in text.split("\n```").skip(1).step_by(2) {
        let (language, lines) = piece.split_once('\n').expect("a language");
        match (language, lines.lines().next()) {
            ("sh", _) => printed += &sh(folder.path(), lines),
            (_, Some("MODULE Part")) => {
                fs::write(folder.path().join("part.mod"), lines).expect("writable");
            }
            (_, Some("# cell.toml")) => {
                fs::write(folder.path().join("cell.toml"), lines).expect("writable");
            }
            _ => {}
        }
    }
    let [given, back] = ["part.mod", "original/part.mod"].map(|file| folder.path().join(file));
    if given.exists() {
        assert_eq!(fs::read(given).expect("there"), fs::read(back).expect("given back"));
    }
    printed
}

#[test]
fn the_commands_of_a_spreadsheet_and_an_abb_run_as_they_stand() {
    let printed = tutorial("src/guide/spreadsheet_abb.md");
    for told in ["within tolerance by the identified arm", "2 corrected, 0 refused, 0 computed"] {
        assert!(printed.contains(told), "{told}: {printed}");
    }
}

#[test]
fn the_commands_of_the_first_night_run_as_they_stand() {
    let printed = tutorial("src/guide/first_night.md");
    for told in ["2 of 2 within 0.5 mm, 0 without a result", "newest: nothing moved"] {
        assert!(printed.contains(told), "{told}: {printed}");
    }
}

#[test]
fn the_commands_of_other_chapters_run_as_they_stand() {
    let done = quickstart();
    for chapter in ["pipeline_file", "simulate"] {
        let text = fs::read_to_string(format!("src/guide/{chapter}.md")).expect("part of it");
        let pieces: Vec<&str> = text.split("```sh\n").skip(1).collect();
        assert!(!pieces.is_empty(), "{chapter} has commands");
        for piece in pieces {
            done.sh(piece.split("```").next().expect("fenced"));
        }
    }
}
