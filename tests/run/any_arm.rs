//! Arms of other kinds than six turning joints, from a simulated session to the page: a track, seven axes, coupled joints, a joint that
//! follows another, and two axes alone.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use posegrid::files::schema;
use posegrid::files::table::{self, Table};

/// An arm, and how it is measured.
struct Case {
    /// The robot file.
    robot: &'static str,
    /// Joints at home: degrees, mm.
    home: &'static str,
    /// The joint that slides, from 1; 0 where none does.
    slide: usize,
    /// Lines of `[controller]` beside topic, time and unit.
    controller: &'static str,
    /// Flags of `posegrid simulate`.
    flags: &'static [&'static str],
    /// The box of a plan, mm: low and high corner; `None` for an arm that reaches no box of poses.
    planned: Option<[[i32; 3]; 2]>,
    /// Held-out means of the geometry and of the full error model, at most these shares of that before.
    shares: [f64; 2],
}

/// A cell in a temporary folder.
struct Cell {
    root: tempfile::TempDir,
}

/// A small plan.
const PLAN: &str = r#"
[plan]
tracker_from_base = { xyz_mm = [4200, -900, -650], euler_deg = [0, 0, 149], euler_order = "fixed-xyz" }
poses = [40]
robots = 1
whole_model_robots = 1
test_poses = 30
candidates = 60
verify_poses = 4"#;

/// The end of a command.
struct Ended {
    code: i32,
    told: String,
}

fn posegrid(arguments: &[&str]) -> Ended {
    let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
    let output = command.args(arguments).output().expect("started");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ended {
        code: output.status.code().expect("not ended by a signal"),
        told: format!("{}{}", text(&output.stdout), text(&output.stderr)),
    }
}

impl Ended {
    fn expect(&self, codes: &[i32], texts: &[&str]) -> &Self {
        assert!(codes.contains(&self.code), "{}: {}", self.code, self.told);
        assert!(!self.told.contains("panicked"), "{}", self.told);
        for text in texts {
            assert!(self.told.contains(text), "{text:?} is not in {}", self.told);
        }
        self
    }
}

impl Case {
    fn pipeline(&self) -> String {
        let robot = fs::canonicalize(self.robot).expect("a robot file");
        let robot = robot.display();
        format!(
            r#"[robot]
file = "{robot}"
name = "arm"
up = [0, 0, 1]

[input]
folder = "sessions"

[controller]
topic = "/joint_states"
time = "header"
unit = "rad"
{controller}

[commanded]
topic = "/commanded_pose"
time = "header"
unit = "m"
base_from_command = {{ xyz_mm = [0, 0, 0], quaternion_xyzw = [0, 0, 0, 1] }}
flange_from_tool = {{ xyz_mm = [25, -40, 100], quaternion_xyzw = [0, 0, 0, 1] }}
target_is_tool = true

[tracker]
topic = "/tracker/point"
time = "header"
unit = "m"
temperature = "/tracker/temperature"
uncertainty = {{ range_um = 10, range_um_per_m = 0.3, transverse_um = 15, transverse_um_per_m = 6, divisor = 2 }}

[fit]
target = {{ xyz_mm = [25, -40, 100], sd_mm = 0.2 }}

[fit.full]
harmonics = 20

[grid]
steps_mm = [200, 400]

[tolerance]
mm = 1.0
share = 0.95
confidence = 0.95

[output]
lake = "lake"
"#,
            controller = self.controller
        )
    }

    /// A cell with the pipeline file and one simulated session.
    fn cell(&self) -> Cell {
        let root = tempfile::tempdir().expect("a temporary folder");
        let cell = Cell { root };
        fs::write(cell.path("pipeline.toml"), self.pipeline()).expect("writable");
        let out = cell.named("sessions/mon");
        let mut arguments =
            vec!["simulate", self.robot, "--home", self.home, "--seed", "7", "--out", &out];
        arguments.extend(self.flags);
        posegrid(&arguments).expect(&[0], &["stations of a"]);
        cell
    }

    /// Everything that stands for any arm: run, page, corrections, history, verification.
    fn goes_end_to_end(&self) -> Cell {
        let cell = self.cell();
        let pipeline = cell.named("pipeline.toml");
        posegrid(&["check", &pipeline]).expect(&[0], &[]);
        println!("{}", posegrid(&["run", &pipeline]).expect(&[0, 3], &[]).told);
        cell.is_accurate(self.shares);
        cell.counts_add_up();
        let pages = cell.files("report");
        assert!(!pages.is_empty(), "a page");
        let lake = cell.named("lake");
        posegrid(&["verify", "--pipeline", &pipeline, &lake]).expect(&[0], &["the same"]);
        cell.corrects(self);
        posegrid(&["history", &lake]).expect(&[0, 3], &[]);
        self.is_planned(&cell);
        cell
    }
}

impl Case {
    /// A plan for the arm, whose CSV has the unit of each joint in its name, and a session simulated by it.
    fn is_planned(&self, cell: &Cell) {
        let Some([low, high]) = self.planned else {
            return;
        };
        let box_of =
            format!("steps_mm = [200, 400]\nbox = {{ low_mm = {low:?}, high_mm = {high:?} }}");
        let plan = format!("{PLAN}\nhome_deg = [{}]\n", self.home);
        let text = self.pipeline().replace("steps_mm = [200, 400]", &box_of);
        fs::write(cell.path("planned.toml"), text + &plan).expect("writable");
        let (pipeline, csv) = (cell.named("planned.toml"), cell.named("plan.csv"));
        posegrid(&["plan", &pipeline, "--out", &csv]).expect(&[0, 3], &["40 poses to identify"]);
        let written = fs::read_to_string(&csv).expect("a plan");
        let first = if self.slide == 1 { ",q1_mm,q2_deg," } else { ",q1_deg,q2_deg," };
        assert!(written.contains(first), "{written}");
        if self.slide == 1 {
            let travel_mm = travel(&written);
            assert!(travel_mm > 1000.0, "the plan moves the slide by {travel_mm} mm");
        }
        let out = cell.named("by_plan");
        let arguments =
            ["simulate", self.robot, "--home", self.home, "--poses", &csv, "--out", &out];
        posegrid(&arguments).expect(&[0], &["stations of a"]);
    }
}

/// Largest minus smallest position of the first joint in a plan's CSV, mm.
fn travel(plan: &str) -> f64 {
    let mut lines = plan.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let column = header.iter().position(|name| *name == "q1_mm");
    let column = column.expect("a joint that slides");
    let places = lines.map(|line| line.split(',').nth(column).expect("a cell").parse::<f64>());
    let places: Vec<f64> = places.map(|place| place.expect("a number")).collect();
    let largest = places.iter().copied().fold(f64::MIN, f64::max);
    largest - places.iter().copied().fold(f64::MAX, f64::min)
}

impl Cell {
    fn path(&self, name: &str) -> PathBuf {
        self.root.path().join(name)
    }

    fn named(&self, name: &str) -> String {
        self.path(name).display().to_string()
    }

    /// Files below a folder of the lake.
    fn files(&self, table: &str) -> Vec<PathBuf> {
        fn below(folder: &Path, found: &mut Vec<PathBuf>) {
            let Ok(entries) = fs::read_dir(folder) else {
                return;
            };
            for entry in entries {
                let path = entry.expect("readable").path();
                if path.is_dir() {
                    below(&path, found);
                } else {
                    found.push(path);
                }
            }
        }
        let mut found = Vec::new();
        below(&self.path("lake").join(table), &mut found);
        found
    }

    fn file(&self, table: &str) -> PathBuf {
        let files = self.files(table);
        assert_eq!(files.len(), 1, "{files:?}");
        files[0].clone()
    }

    fn table(&self, name: &str) -> Table {
        let schema = schema::find(name).expect("a published table");
        table::read(&self.file(name), schema).expect("a table by its schema")
    }

    /// Held-out mean of a model's position errors at the measured point, mm.
    fn mean(&self, model: &str) -> f64 {
        let table = self.table("accuracy");
        let text = |name: &str| {
            let column = table.text(name);
            (0..table.rows()).map(|row| column.value(row).to_owned()).collect::<Vec<_>>()
        };
        let wanted = [
            ("model", model),
            ("role", "held_out"),
            ("name", "mean"),
            ("quantity", "position_error"),
        ];
        let columns: Vec<_> = wanted.iter().map(|(name, value)| (text(name), *value)).collect();
        let row = (0..table.rows())
            .find(|row| columns.iter().all(|(column, value)| column[*row] == *value));
        table.f64("value").value(row.unwrap_or_else(|| panic!("no held-out mean of {model}")))
    }

    fn is_accurate(&self, [of_geometry, of_full]: [f64; 2]) {
        let means = ["base_target", "geometric", "full"].map(|model| self.mean(model));
        println!("held-out means, mm: {means:?}");
        let [before, geometric, full] = means;
        assert!(geometric < of_geometry * before, "{means:?}");
        assert!(full < of_full * before && full < geometric, "{means:?}");
    }

    /// In = kept + rejected, by the row of runs.
    fn counts_add_up(&self) {
        let runs = self.table("runs");
        let counts: Vec<serde_json::Value> =
            serde_json::from_str(runs.text("counts").value(0)).expect("JSON");
        for count in &counts {
            let number = |key: &str| count[key].as_u64().expect("a count");
            let rejected = count["rejected"].as_object().expect("by reason").values();
            let rejected: u64 = rejected.map(|n| n.as_u64().expect("a count")).sum();
            assert_eq!(number("read"), number("kept") + rejected, "{count}");
        }
        let stations = self.table("stations").rows();
        assert!(stations > 60 && !counts.is_empty(), "{stations} stations");
    }

    /// The run chose a table, some of whose cells serve, and judged it.
    fn has_a_judged_table(&self) {
        let nodes = self.table("compensation");
        assert!(nodes.rows() >= 8, "{} nodes", nodes.rows());
        let verdict = nodes.text("verdict").value(0).to_owned();
        assert!(["met", "not_met"].contains(&verdict.as_str()), "{verdict}");
        let steps = self.table("grid_steps");
        let judged = |row: &usize| steps.text("judgement").value(*row) == "table";
        let served = |row: usize| steps.i64("held_out").value(row);
        let served: Vec<i64> = (0..steps.rows()).filter(judged).map(served).collect();
        println!("poses judged by tables: {served:?}, table {verdict}");
        assert!(served.iter().any(|&poses| poses > 20), "{served:?}");
    }

    /// Joint angles of its own stations, as targets: nearly all get a command.
    fn corrects(&self, case: &Case) {
        let truth =
            fs::read_to_string(self.path("sessions/mon/truth_stations.csv")).expect("the truth");
        let mut lines = truth.lines();
        let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
        let places: Vec<usize> =
            (0..header.len()).filter(|&place| header[place].starts_with("commanded")).collect();
        let mut targets = String::from("target");
        for joint in 1..=places.len() {
            let unit = if joint == case.slide { "mm" } else { "rad" };
            write!(targets, ",q{joint}_{unit}").expect("to a text");
        }
        for (number, line) in lines.take(40).enumerate() {
            let cells: Vec<&str> = line.split(',').collect();
            let own = places.iter().map(|&place| cells[place]);
            write!(targets, "\nt{number},{}", own.collect::<Vec<_>>().join(","))
                .expect("to a text");
        }
        fs::write(self.path("targets.csv"), targets).expect("writable");
        let (table, file, out) = (
            self.file("calibrations").display().to_string(),
            self.named("targets.csv"),
            self.named("corrected.csv"),
        );
        let ended = posegrid(&["compensate", &table, &file, "--out", &out]);
        println!("{}", ended.told);
        if places.len() < 3 {
            // Two joints cannot move a point in three directions: every target is refused with that reason.
            ended.expect(&[1], &["t0", "the pose is not reached"]);
            return;
        }
        ended.expect(&[0, 3], &["40 targets: "]);
        let corrected = fs::read_to_string(&out).expect("corrected targets");
        let header = corrected.lines().next().expect("a header");
        for joint in 1..=places.len() {
            let own = format!(",q{joint}_mm,");
            assert_eq!(header.contains(&own), joint == case.slide, "{header}");
        }
        assert_eq!(corrected.lines().count(), 41, "{corrected}");
    }
}

#[test]
fn six_axes_on_a_track() {
    let case = Case {
        robot: "tests/robots/track.toml",
        home: "1500,0,20,-10,25,55,-15",
        slide: 1,
        controller: "length_unit = \"m\"",
        flags: &["--random-joints", "140", "--spread-deg", "35", "--spread-mm", "1400"],
        planned: Some([[2300, -500, 1000], [3300, 500, 1900]]),
        shares: [0.5, 0.2],
    };
    let cell = case.goes_end_to_end();
    let told = |text: &str| fs::write(cell.path("pipeline.toml"), text).expect("writable");
    let pipeline = cell.named("pipeline.toml");
    told(&case.pipeline().replace("length_unit = \"m\"", ""));
    posegrid(&["check", &pipeline]).expect(&[2], &["[controller] length_unit", "\"track\" slides"]);
}

#[test]
fn seven_turning_axes() {
    let case = Case {
        robot: "pipelines/robots/lbr-iiwa14-r820.toml",
        home: "10,30,-15,-80,20,60,30",
        slide: 0,
        controller: "",
        flags: &["--random-joints", "120", "--spread-deg", "35"],
        planned: Some([[500, 0, 300], [700, 200, 500]]),
        shares: [0.5, 0.2],
    };
    case.goes_end_to_end();
}

#[test]
fn coupled_joints() {
    let case = Case {
        robot: "pipelines/robots/m20id-25.toml",
        home: "10,10,-10,25,-60,30",
        slide: 0,
        controller: "",
        flags: &["--random-joints", "120", "--spread-deg", "30"],
        planned: None,
        shares: [0.5, 0.2],
    };
    case.goes_end_to_end();
}

#[test]
fn a_joint_that_follows_another() {
    let case = Case {
        robot: "tests/robots/parallelogram.toml",
        home: "10,10,10,25,55,-15",
        slide: 0,
        controller: "",
        flags: &["--random-joints", "120", "--spread-deg", "30"],
        planned: None,
        shares: [0.5, 0.2],
    };
    case.goes_end_to_end();
}

#[test]
fn a_positioner_of_two_axes() {
    let case = Case {
        robot: "tests/robots/turn_and_tilt.toml",
        home: "10,20",
        slide: 0,
        controller: "",
        flags: &["--random-joints", "80", "--spread-deg", "60", "--slow-curve-urad", "800"],
        planned: None,
        // Base and target take all but one of its parameters: what is left is in the curves.
        shares: [1.0, 0.5],
    };
    case.goes_end_to_end();
}

#[test]
fn six_axes_on_a_track_have_a_table() {
    let case = Case {
        robot: "tests/robots/track.toml",
        home: "1500,0,20,-10,25,55,-15",
        slide: 1,
        controller: "length_unit = \"m\"",
        flags: &["--grid-step", "200", "--size", "3000,400,400"],
        planned: None,
        shares: [1.0, 1.0],
    };
    let cell = case.cell();
    posegrid(&["run", &cell.named("pipeline.toml")]).expect(&[0, 3], &[]);
    cell.has_a_judged_table();
}

#[test]
fn a_scara() {
    let case = Case {
        robot: "tests/robots/scara.toml",
        home: "-40,95,200,20",
        slide: 3,
        controller: "length_unit = \"m\"",
        flags: &["--grid-step", "75", "--size", "300,300,300"],
        planned: None,
        shares: [0.9, 0.5],
    };
    let cell = case.goes_end_to_end();
    cell.has_a_judged_table();
}
