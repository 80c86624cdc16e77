//! Instruments that read one length, in tables of stations: beside a tracker, alone, and as judges.

use std::fs;

use super::cell::{Cell, Ended, ended, posegrid};
use super::joined::assert_two_steps_as_one;
use super::tabled;

/// Anchors with their offsets and standard deviations, and a plane, mm.
const DISTANCES: [[f64; 5]; 2] =
    [[2600.0, 1500.0, 300.0, 20.0, 0.05], [900.0, -2400.0, 500.0, -15.0, 0.02]];
const HEIGHT: [f64; 5] = [0.0, 0.0, 1.0, -400.0, 0.03];

/// A simulated session of the arm with this seed: the text of its table of stations.
fn simulated(cell: &Cell, seed: &str) -> String {
    let out = cell.path(&format!("simulated-{seed}"));
    let list = |numbers: &[f64; 5]| numbers.map(|number| number.to_string()).join(",");
    let mut command = posegrid();
    command
        .args(["simulate", "pipelines/robots/kr210-r2700-extra.toml"])
        .args(["--arm", "3", "--seed", seed])
        .args(["--home", "0,-75,100,25,55,-15", "--random-joints", "120"])
        .args(["--table", "--height-above", &list(&HEIGHT)]);
    for distance in &DISTANCES {
        command.args(["--distance-from", &list(distance)]);
    }
    let made = ended(command.arg("--out").arg(&out));
    assert_eq!(made.code, 0, "{}", made.messages);
    fs::read_to_string(out.join("stations.csv")).expect("written")
}

/// The section that the head of a table shows.
pub fn section(table: &str) -> String {
    let head = table.lines().skip(1).map_while(|line| line.strip_prefix("# "));
    head.fold(String::new(), |text, line| text + line + "\n")
}

/// The rows of a table with the cells blank whose columns `is_blank` names.
pub fn blanked(table: &str, is_blank: impl Fn(&str) -> bool) -> String {
    let rows = table.lines().filter(|line| !line.starts_with('#'));
    let rows: Vec<Vec<&str>> = rows.map(|line| line.split(',').collect()).collect();
    let blank: Vec<bool> = rows[0].iter().map(|name| is_blank(name)).collect();
    let line = |(place, row): (usize, &Vec<&str>)| {
        let cells = row.iter().zip(&blank);
        let cells = cells.map(|(cell, blank)| if *blank && place > 0 { "" } else { cell });
        cells.collect::<Vec<&str>>().join(",")
    };
    let lines: Vec<String> = rows.iter().enumerate().map(line).collect();
    lines.join("\n") + "\n"
}

/// Columns of the tracker's readings.
pub fn of_tracker(name: &str) -> bool {
    name.starts_with("T1_")
}

/// Columns of the instruments of one length.
fn of_lengths(name: &str) -> bool {
    name.starts_with('L')
}

/// A cell that learns from Monday's table and is judged by Tuesday's, each with these columns blank.
fn judged(monday: impl Fn(&str) -> bool, tuesday: impl Fn(&str) -> bool) -> (Cell, Ended) {
    let cell = Cell::new();
    let tables = [simulated(&cell, "3"), simulated(&cell, "4")];
    let cell = tabled::cell_with(cell, &section(&tables[0]));
    let cell = cell.with(
        "folder = \"sessions\"",
        "folder = \"sessions\"\nsessions = [\"mon\"]\ntest = [\"tue\"]",
    );
    let blanked = [blanked(&tables[0], monday), blanked(&tables[1], tuesday)];
    for (name, text) in ["mon", "tue"].into_iter().zip(blanked) {
        fs::create_dir_all(cell.session(name)).expect("writable");
        fs::write(cell.session(name).join("measured.csv"), text).expect("writable");
    }
    let run = cell.run(&[]);
    (cell, run)
}

/// A row of `sources`: its name, what it reads, factor, share and root mean square of held-out lengths.
#[derive(Debug)]
struct Row {
    model: String,
    source: String,
    reads: String,
    readings: i64,
    factor: Option<f64>,
    share: Option<f64>,
    held_out_mm: Option<f64>,
}

fn sources(cell: &Cell) -> Vec<Row> {
    let table = cell.table("sources", "mon");
    let number = |name: &str, row: usize| {
        let column = table.f64(name);
        arrow::array::Array::is_valid(column, row).then(|| column.value(row))
    };
    let row = |row: usize| Row {
        model: table.text("model").value(row).to_owned(),
        source: table.text("source").value(row).to_owned(),
        reads: table.text("reads").value(row).to_owned(),
        readings: table.i64("readings").value(row),
        factor: number("noise_factor", row),
        share: number("information_share", row),
        held_out_mm: number("held_out_rms_mm", row),
    };
    (0..table.rows()).map(row).collect()
}

/// Anchors with their offsets by the full error model, in the order of the instruments, mm.
fn anchors(cell: &Cell) -> Vec<[f64; 4]> {
    let table = cell.table("sources", "mon");
    let own = (0..table.rows()).filter(|&row| {
        table.text("model").value(row) == "full" && table.text("reads").value(row) == "distance"
    });
    let names = ["anchor_x_mm", "anchor_y_mm", "anchor_z_mm", "anchor_offset_mm"];
    own.map(|row| names.map(|name| table.f64(name).value(row))).collect()
}

/// Every reading of one length has a row in training and one held out for each model, and those held out have the size that `sources`
/// states; by the full error model they are as large as it states itself.
fn assert_left_row_by_row(cell: &Cell, sources: &[Row]) {
    let table = cell.table("length_residuals", "mon");
    let word = |name: &str, row: usize| table.text(name).value(row).to_owned();
    let residual = |row: usize| table.f64("residual_mm").value(row);
    for own in sources.iter().filter(|own| own.held_out_mm.is_some()) {
        let is_own = |row: &usize| {
            (word("model", *row), word("source", *row)) == (own.model.clone(), own.source.clone())
        };
        let all: Vec<usize> = (0..table.rows()).filter(is_own).collect();
        let (held_out, trained): (Vec<usize>, Vec<usize>) =
            all.into_iter().partition(|&row| word("role", row) == "held_out");
        assert_eq!(held_out.len(), trained.len(), "{own:?}");
        assert_eq!(i64::try_from(trained.len()), Ok(own.readings), "{own:?}");
        let squares = |of: &dyn Fn(usize) -> f64| -> f64 {
            let own = held_out.iter().map(|&row| of(row).powi(2));
            own.sum::<f64>() / held_out.len() as f64
        };
        let rms_mm = squares(&residual).sqrt();
        assert!((rms_mm - own.held_out_mm.expect("held out")).abs() < 1e-9);
        let sd = table.f64("predicted_sd_mm");
        if own.model == "full" {
            let size = squares(&|row| residual(row) / sd.value(row)).sqrt();
            assert!((0.5..1.6).contains(&size), "{own:?}: {size} standard deviations");
            println!("{}: {rms_mm} mm, {size} standard deviations", own.source);
        } else {
            assert_eq!(arrow::array::Array::null_count(sd), sd.len() - full_held_out(&table));
        }
    }
}

/// Rows of the full error model that are held out: the only ones with a standard deviation.
fn full_held_out(table: &posegrid::files::table::Table) -> usize {
    let is = |row: &usize| {
        table.text("model").value(*row) == "full" && table.text("role").value(*row) == "held_out"
    };
    (0..table.rows()).filter(is).count()
}

#[test]
fn a_tracker_and_three_instruments_of_lengths_train_together() {
    let (cell, run) = judged(|_| false, |_| false);
    assert!(run.code == 0 || run.code == 1, "{}{}", run.results, run.messages);
    let sources = sources(&cell);
    let names: Vec<(&str, &str)> = sources
        .iter()
        .filter(|own| own.model == "geometric")
        .map(|own| (own.source.as_str(), own.reads.as_str()))
        .collect();
    assert_eq!(
        names,
        [("tracker", "point"), ("L1", "distance"), ("L2", "distance"), ("L3", "height")]
    );
    assert_two_steps_as_one(&cell, run.code);
    let shares: f64 =
        sources.iter().filter(|own| own.model == "geometric").filter_map(|own| own.share).sum();
    assert!(shares > 0.5 && shares <= 1.0, "{sources:?}");
    for own in sources.iter().filter(|own| own.model == "full" && own.source != "tracker") {
        let held_out_mm = own.held_out_mm.expect("held out");
        assert!(own.factor.is_some() && held_out_mm < 0.3, "{own:?}");
    }
    assert_left_row_by_row(&cell, &sources);
    // Anchors are near where they were put: a turn of the first joint's zero and the height of the base move them with the arm.
    let found = anchors(&cell);
    assert_eq!(found.len(), 2);
    for (found, wanted) in found.iter().zip(&DISTANCES) {
        for (found, wanted) in found.iter().zip(&wanted[..4]) {
            assert!((found - wanted).abs() < 8.0, "{found} for {wanted}");
        }
        let offset = found[3] - wanted[3];
        assert!(offset.abs() < 0.5, "{offset} mm");
    }
    let named = "source L2: ";
    assert!(run.results.contains("judged by tue"), "{}", run.results);
    let page = fs::read_dir(cell.path("lake/report/kr210-demo/mon")).expect("a page");
    let page = page.map(|file| fs::read_to_string(file.expect("a page").path()).expect("text"));
    assert!(page.collect::<String>().contains(named), "the page names the sources");
}

#[test]
fn lengths_alone_train_and_a_tracker_judges() {
    let (cell, run) = judged(of_tracker, of_lengths);
    assert!(run.results.contains("judged by tue: 120 stations"), "{}{}", run.results, run.messages);
    let sources = sources(&cell);
    assert!(sources.iter().all(|own| own.source != "tracker"), "{sources:?}");
    let full = sources.iter().filter(|own| own.model == "full");
    for own in full {
        assert!(own.held_out_mm.expect("held out") < 0.5, "{own:?}");
    }
}

#[test]
fn lengths_alone_judge_nothing() {
    let (_, run) = judged(|_| false, of_tracker);
    assert_eq!(run.code, 1, "{}{}", run.results, run.messages);
    assert!(
        run.messages.contains("tue judges, but its stations have readings of one length alone"),
        "{}",
        run.messages
    );
}

/// The sections that read the simulated instruments from the tracker's log.
fn logged_sections() -> String {
    let distance = DISTANCES.iter().map(|own| ("distance", own[4]));
    let all = (1..).zip(distance.chain([("height", HEIGHT[4])]));
    let section = |(number, (reads, sd_mm)): (usize, _)| {
        format!(
            "[[tracker.lengths]]\nname = \"L{number}\"\nreads = \"{reads}\"\ntopic = \"/lengths/L{number}\"\nunit = \"m\"\nsd_mm = {sd_mm}\n\n"
        )
    };
    all.map(section).collect::<Vec<_>>().concat()
}

/// A cell that reads the logs of the session of [`simulated`].
fn logged() -> Cell {
    let cell = Cell::new();
    simulated(&cell, "3");
    fs::create_dir_all(cell.path("sessions")).expect("writable");
    fs::rename(cell.path("simulated-3"), cell.session("mon")).expect("writable");
    cell.with("[fit]\n", &format!("{}[fit]\n", logged_sections()))
}

#[test]
fn lengths_in_a_log_are_those_of_the_table_of_the_session() {
    let logs = logged();
    let run = logs.run(&["--verbose"]);
    assert_eq!(run.code, 0, "{}{}", run.results, run.messages);
    let cell = Cell::new();
    let table = simulated(&cell, "3");
    let cell = tabled::cell_with(cell, &section(&table));
    fs::create_dir_all(cell.session("mon")).expect("writable");
    fs::write(cell.session("mon").join("measured.csv"), &table).expect("writable");
    assert_eq!(cell.run(&[]).code, 0);
    let (of_logs, of_table) = (sources(&logs), sources(&cell));
    assert_eq!(of_logs.len(), of_table.len());
    for (own, other) in of_logs.iter().zip(&of_table) {
        assert_eq!((&own.source, &own.reads), (&other.source, &other.reads));
        // A log has no lost station that its table has not.
        assert!(own.readings.abs_diff(other.readings) <= 1, "{own:?} {other:?}");
        let (Some(own_mm), Some(other_mm)) = (own.held_out_mm, other.held_out_mm) else {
            continue;
        };
        // The samples of a dwell scatter by a fifth of the standard deviation about the table's reading.
        assert!((own_mm / other_mm - 1.0).abs() < 0.2, "{own:?} {other:?}");
    }
    for (own, other) in anchors(&logs).iter().zip(anchors(&cell)) {
        for (own, other) in own.iter().zip(other) {
            assert!((own - other).abs() < 1.0, "{own} {other}");
        }
    }
    logs.assert_every_reading_has_a_class("mon");
    assert!(logs.counts("mon")["length messages"][1] > 1000);
    crate::verify::verify(&logs, &[]).expect(0, &[]);
    assert_two_steps_as_one(&logs, 0);
}

#[test]
fn sections_of_lengths_that_cannot_be_are_refused() {
    let told = |from: &str, to: &str| {
        let ended = logged().with(from, to).run(&[]);
        assert_eq!(ended.code, 2, "{}{}", ended.results, ended.messages);
        ended.messages
    };
    for (from, to, words) in [
        ("/lengths/L2", "/lengths/L1", "a `field` of each where several share a topic"),
        ("/lengths/L2", "/tracker/point", "which is read for positions or temperatures"),
        ("name = \"L2\"", "name = \"L1\"", "\"L1\" twice"),
        ("unit = \"m\"\nsd_mm = 0.05", "unit = \"m\"\nsd_mm = 0", "sd_mm = 0, but it has to be"),
        ("sd_mm = 0.03", "sd_mm = 0.03\ntarget = \"tip\"", "the log has one target"),
        (
            "sd_mm = 0.03",
            "sd_mm = 0.03\noffset = { mm = 1, sd_mm = 1 }",
            "only distances have an anchor",
        ),
        ("sd_mm = 0.03", "sd_mm = 0.03\ncolumn = \"x\"", "column"),
    ] {
        let told = told(from, to);
        assert!(told.contains(words), "{from:?} -> {to:?}: {told}");
    }
}
