//! The sections of a pipeline file that would read a table of stations, with what is unsure beside each line.

use std::ffi::OsStr;
use std::path::Path;

use nalgebra::Isometry3;

use crate::cli::inspect::{Form, escaped, toml_text};
use crate::geometry::rpy;
use crate::ingest::{
    OrientationColumns, OrientationForm, PoseColumns, ReadingColumns, ReferenceColumns,
    StationsSettings,
};
use crate::io::inspect::table::{Commands, Guess, Key};
use crate::io::robot::Selection;

struct Lines<'g> {
    guess: &'g Guess,
    text: String,
}

/// The sections that read the tables at `paths`, which are all of one guess.
pub fn section(paths: &[&Path], guess: &Guess, selection: &Selection, form: Form) -> String {
    let mut lines = Lines { guess, text: String::new() };
    lines.robot(selection, form);
    lines.input(paths);
    lines.stations(&guess.settings);
    if let Some(commands) = guess.commands.as_ref().filter(|_| guess.settings.commanded.is_some()) {
        lines.commanded(commands);
    }
    lines.head("tracker");
    lines.text += &form.uncertainty();
    lines.text
}

/// The file of the ready robot that the table is of, by its residual.
pub fn ready(guess: &Guess) -> Option<&str> {
    let found = guess.verdict.as_ref().filter(|own| !guess.arm_is_named && own.agrees())?;
    Some(&guess.arms[found.best.arm])
}

impl Lines<'_> {
    fn head(&mut self, name: &str) {
        let gap = if self.text.is_empty() || self.text.ends_with("\n\n") { "" } else { "\n" };
        self.text.extend([gap, "[", name, "]\n"]);
    }

    /// A key with its value, and what is unsure about `about`.
    fn key(&mut self, key: &str, value: &str, about: Option<Key>) {
        let doubts = self.guess.doubts.iter().filter(|doubt| Some(doubt.key) == about);
        let words: Vec<String> = doubts.map(|doubt| escaped(&doubt.words)).collect();
        let unsure = if words.is_empty() {
            String::new()
        } else {
            format!("  # unsure: {}", words.join("; "))
        };
        self.text.extend([key, " = ", value, &unsure, "\n"]);
    }

    fn robot(&mut self, selection: &Selection, form: Form) {
        self.head("robot");
        let guess = self.guess;
        let named = if guess.arm_is_named { guess.arms.first() } else { None };
        if let Some(ready) = ready(guess).filter(|_| form == Form::Shown) {
            let name = ready.trim_end_matches(".toml");
            self.text.extend(["# posegrid robot ", name, " > ", ready, "\n"]);
        }
        let file = ready(guess).or(named.map(String::as_str)).unwrap_or("robot.toml");
        self.key("file", &toml_text(file), Some(Key::Robot));
        for (key, value) in [("base", &selection.base), ("tip", &selection.tip)] {
            if let Some(value) = value {
                self.key(key, &toml_text(value), None);
            }
        }
        self.text += &form.of_arm(false);
    }

    fn input(&mut self, paths: &[&Path]) {
        self.head("input");
        let quoted = |name: Option<&OsStr>| toml_text(&name.unwrap_or_default().to_string_lossy());
        let folder = paths.first().and_then(|path| path.parent());
        let folder = folder.map(Path::as_os_str).filter(|folder| !folder.is_empty());
        self.key("folder", &quoted(folder.or(Some(OsStr::new(".")))), None);
        if !self.guess.sessions.is_empty() {
            self.key("sessions_by", "\"column\"", Some(Key::Session));
            let files: Vec<String> = paths.iter().map(|path| quoted(path.file_name())).collect();
            self.key("stations", &list_or_one(&files), None);
            return;
        }
        self.key("sessions_by", "\"file_name\"", None);
        let stems: Vec<String> = paths.iter().map(|path| quoted(path.file_stem())).collect();
        self.key("sessions", &format!("[{}]", stems.join(", ")), None);
        let mut endings: Vec<String> = Vec::new();
        for path in paths {
            let ending = path.extension().unwrap_or_default().to_string_lossy();
            let pattern = toml_text(&format!("{{session}}.{ending}"));
            if !endings.contains(&pattern) {
                endings.push(pattern);
            }
        }
        self.key("stations", &list_or_one(&endings), None);
    }

    fn stations(&mut self, settings: &StationsSettings) {
        self.head("stations");
        self.key("joints", &list(&settings.joints), Some(Key::Joints));
        let unit = format!("\"{}\"", settings.joint_unit.word());
        self.key("joint_unit", &unit, Some(Key::JointUnit));
        if let Some(unit) = settings.length_unit {
            self.key("length_unit", &format!("\"{unit}\""), Some(Key::LengthUnit));
        }
        let columns = [
            ("session", &settings.session, Key::Session),
            ("station", &settings.station, Key::Target),
            ("target", &settings.target, Key::Target),
        ];
        for (key, column, about) in columns {
            if let Some(column) = column {
                self.key(key, &toml_text(column), Some(about));
            }
        }
        if !settings.targets.is_empty() {
            self.key("targets", &list(&settings.targets), None);
        }
        if let Some(time) = &settings.time {
            let unit = toml::Value::try_from(time.unit).expect("a word");
            let value = format!("{{ column = {}, unit = {unit} }}", toml_text(&time.column));
            self.key("time", &value, Some(Key::Time));
        }
        if let Some(temperature) = &settings.temperature {
            self.key("temperature", &toml_text(temperature), None);
        }
        if let Some(commanded) = &settings.commanded {
            self.pose(commanded);
        } else {
            self.text += "# flange_from_tool = { … }  # the controller's tool, which targets are for that are poses\n";
        }
        for reading in &settings.measured {
            self.reading(reading, settings.measured.len() > 1);
        }
        for own in &settings.references {
            self.reference(own);
        }
    }

    fn pose(&mut self, commanded: &PoseColumns) {
        self.head("stations.commanded");
        self.key("position", &list(&commanded.position), None);
        self.key("unit", &format!("\"{}\"", commanded.unit), None);
        if let Some(orientation) = &commanded.orientation {
            self.key("orientation", &of_orientation(orientation), None);
        }
    }

    fn reading(&mut self, reading: &ReadingColumns, is_of_several: bool) {
        if is_of_several {
            self.head("[stations.measured]");
        } else {
            self.head("stations.measured");
        }
        if let Some(name) = &reading.name {
            self.key("name", &toml_text(name), None);
        }
        self.key("position", &list(&reading.position), Some(Key::Position));
        self.key("unit", &format!("\"{}\"", reading.unit), Some(Key::Unit));
        if let Some(sd) = &reading.sd {
            self.key("sd", &list(sd), None);
        }
        match &reading.orientation {
            Some(orientation) => {
                self.key("orientation", &of_orientation(orientation), Some(Key::Orientation));
            }
            None => self.left_out(),
        }
    }

    fn reference(&mut self, own: &ReferenceColumns) {
        self.head("[stations.references]");
        self.key("name", &toml_text(&own.name), None);
        let on = format!("\"{}\"", own.on.word());
        self.key("on", &on, Some(Key::Reference));
        if let (Some(position), Some(unit)) = (&own.position, own.unit) {
            self.key("position", &list(position), None);
            self.key("unit", &format!("\"{unit}\""), None);
        }
    }

    /// The comment about an orientation that the table has and that is left out.
    fn left_out(&mut self) {
        let doubts = self.guess.doubts.iter().filter(|doubt| doubt.key == Key::Orientation);
        for doubt in doubts {
            self.text.extend(["# orientation: ", &escaped(&doubt.words), "\n"]);
        }
    }

    fn commanded(&mut self, commands: &Commands) {
        self.head("commanded");
        let base = placement(&commands.base_from_command);
        self.key("base_from_command", &base, Some(Key::Commanded));
        self.key("flange_from_tool", &placement(&commands.flange_from_tool), Some(Key::Commanded));
        self.text +=
            "target_is_tool = false  # true where the commanded point is the measured target\n";
    }
}

fn list(texts: &[String]) -> String {
    let texts: Vec<String> = texts.iter().map(|text| toml_text(text)).collect();
    format!("[{}]", texts.join(", "))
}

fn list_or_one(values: &[String]) -> String {
    match values {
        [one] => one.clone(),
        several => format!("[{}]", several.join(", ")),
    }
}

fn of_orientation(orientation: &OrientationColumns) -> String {
    let mut keys = match &orientation.form {
        OrientationForm::Quaternion(own) => vec![format!("quaternion_xyzw = {}", list(own))],
        OrientationForm::Angles(own, order, unit) => vec![
            format!("angles = {}", list(own)),
            format!("order = \"{}\"", String::from(*order)),
            format!("unit = \"{}\"", unit.word()),
        ],
        OrientationForm::Vector(own, unit) => {
            vec![format!("rotation_vector = {}", list(own)), format!("unit = \"{}\"", unit.word())]
        }
        OrientationForm::Matrix(own) => vec![format!("matrix = {}", list(own))],
    };
    if !orientation.sd.is_empty() {
        keys.push(format!("sd = {}", list(&orientation.sd)));
    }
    format!("{{ {} }}", keys.join(", "))
}

/// A placement to tenths of a millimetre and hundredths of a degree.
fn placement(placed: &Isometry3<f64>) -> String {
    let rounded = |value: f64, step: f64| (value / step).round() * step + 0.0;
    let [x, y, z] = placed.translation.vector.map(|mm| rounded(mm, 0.1)).into();
    let [roll, pitch, yaw] = rpy(&placed.rotation).map(|rad| rounded(rad.to_degrees(), 0.01));
    format!(
        "{{ xyz_mm = [{x:.1}, {y:.1}, {z:.1}], euler_deg = [{roll:.2}, {pitch:.2}, {yaw:.2}], euler_order = \"fixed-xyz\" }}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::input::Bound;
    use crate::io::inspect::table::{Arms, inspect};

    /// Rows of joints and of a position, with names that TOML and terminals must not act on.
    const TABLE: &str = "\"J1 \"\"a\"\"\";\"J2 \"\"a\"\"\";\"J3 \"\"a\"\"\";\"J4 \"\"a\"\"\";\"J5 \"\"a\"\"\";\"J6 \"\"a\"\"\";\
T1\u{1b} x;T1\u{1b} y;T1\u{1b} z;T2 x;T2 y;T2 z;T1\u{1b} rx;T1\u{1b} ry;T1\u{1b} rz;time
";

    fn written(header: &str) -> String {
        let mut text = header.to_owned();
        for number in 0..20_u32 {
            let t = f64::from(number);
            let values = [
                t.sin(),
                t.cos(),
                t / 20.0,
                0.3 * t.sin(),
                0.5 * t.cos(),
                0.1 * t,
                100.0 * t.sin(),
                200.0 * t.cos(),
                30.0 * t,
            ];
            let more = [
                110.0 * t.sin(),
                190.0 * t.cos(),
                31.0 * t,
                0.1 * t,
                0.2,
                0.3 * t.sin(),
                1.7e9 + t,
            ];
            let texts: Vec<String> =
                values.iter().chain(&more).map(|value| format!("{value:.4}")).collect();
            text += &(texts.join(";") + "\n");
        }
        text
    }

    #[test]
    fn the_printed_section_is_the_guess() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a \"b\".csv");
        std::fs::write(&path, written(TABLE)).expect("writable");
        let found = inspect(&path, Bound::TARGETS, &Arms::ready()).expect("a table");
        let guess = found.guess.expect("joints and positions");
        assert_eq!(guess.settings.measured.len(), 2, "{:?}", guess.settings);
        let text = section(&[&path], &guess, &Selection::default(), Form::Shown);
        assert!(!text.contains('\u{1b}'), "{text}");
        let sections: toml::Table = toml::from_str(&text).expect("sound TOML");
        let stations: StationsSettings = sections["stations"].clone().try_into().expect("settings");
        assert_eq!(stations, guess.settings);
        assert_eq!(sections["input"]["sessions"][0].as_str(), Some("a \"b\""));
        assert_eq!(sections["input"]["stations"].as_str(), Some("{session}.csv"));
        assert!(text.contains("# unsure: "), "{text}");
    }

    #[test]
    fn frames_are_rounded_and_parse_as_placements() {
        let placed = Isometry3::new(
            nalgebra::Vector3::new(1.26, -0.04, 3.0),
            nalgebra::Vector3::new(0.0, 0.0, std::f64::consts::PI),
        );
        let text = placement(&placed);
        assert!(
            text.starts_with("{ xyz_mm = [1.3, 0.0, 3.0], euler_deg = [0.00, 0.00, "),
            "{text}"
        );
        let table: toml::Table = toml::from_str(&format!("a = {text}")).expect("sound TOML");
        let read: crate::geometry::Placement = table["a"].clone().try_into().expect("a placement");
        assert!(
            (read.isometry().expect("a rotation").rotation.angle() - std::f64::consts::PI).abs()
                < 1e-3
        );
    }
}
