//! The robots of a pipeline file, and the file that each has for itself.

mod table;

use std::collections::BTreeSet;
use std::path::Path;

use toml::{Table, Value};

use super::{ConfigurationError, ConfigurationErrorKind, Result};
use crate::io::lake;
use crate::pipeline::file::{ROBOT_PLACE, ToldBy};
use crate::pipeline::robot_entry::{RobotEntry, put};

/// The keys of `[input]` that name files, in which `{robot}` stands for the robot.
const FILES: [&str; 4] = ["controller", "tracker", "stations", "corrected_targets"];

#[derive(Debug, Clone, PartialEq)]
pub struct Robots {
    /// The way in which sessions belong to them.
    pub by: ToldBy,
    /// Each robot, in the order of the file.
    pub stated: Vec<StatedRobot>,
    /// The pipeline file without its robots.
    common: Table,
}

#[derive(Debug, Clone, PartialEq)]
pub struct StatedRobot {
    pub entry: RobotEntry,
    /// Its place, in words: `[[robots]] 3`, or `row 4 of robots.csv`.
    pub place: String,
}

impl StatedRobot {
    pub(super) fn fault(&self, source: ConfigurationError) -> ConfigurationError {
        let (robot, place) = (self.entry.name.clone(), self.place.clone());
        ConfigurationError::OfRobot { robot, place, source: Box::new(source) }
    }
}

impl Robots {
    /// The robots of the pipeline file at `path` with these values; `None` where it is of one robot.
    pub fn of(path: &Path, base: &Path, values: &Table) -> Result<Option<Self>> {
        let own = values.get("robots");
        let input = values.get("input").and_then(Value::as_table);
        let of_input = |key: &str| input.and_then(|input| input.get(key));
        let (named, by) = (of_input("robots"), of_input("robots_by"));
        if own.is_none() && named.is_none() && by.is_none() {
            return Ok(None);
        }
        let by = robots_by(path, by)?;
        let stated = stated(path, base, own, named)?;
        let mut common = values.clone();
        common.remove("robots");
        if let Some(input) = common.get_mut("input").and_then(Value::as_table_mut) {
            input.remove("robots");
            input.remove("robots_by");
        }
        let robots = Self { by, stated, common };
        robots.are_sound(path)?;
        Ok(Some(robots))
    }

    pub fn named(&self, path: &Path, name: &str) -> Result<&StatedRobot> {
        let found = self.stated.iter().find(|own| own.entry.name == name);
        found.ok_or_else(|| {
            let known: Vec<String> = self.names().map(str::to_owned).collect();
            ConfigurationErrorKind::no_robot(name, &known).at(path)
        })
    }

    /// The robots' names, in the order of the file.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.stated.iter().map(|own| own.entry.name.as_str())
    }

    /// The pipeline file of one robot: the file with the robot's settings put into it, and its own folder or file names.
    pub fn file_of(&self, entry: &RobotEntry) -> Table {
        let mut file = self.common.clone();
        put("", &entry.settings, &mut file);
        let robot = file.entry("robot").or_insert_with(|| Value::Table(Table::new()));
        if let Some(robot) = robot.as_table_mut() {
            robot.insert("name".to_owned(), Value::String(entry.name.clone()));
        }
        if let Some(input) = file.get_mut("input").and_then(Value::as_table_mut) {
            self.placed(entry, input);
        }
        file
    }

    /// Sets the folder or the file names of one robot.
    fn placed(&self, entry: &RobotEntry, input: &mut Table) {
        match self.by {
            ToldBy::Folder => {
                if let Some(Value::String(folder)) = input.get_mut("folder") {
                    let own = entry.folder.as_ref().unwrap_or(&entry.name);
                    *folder = format!("{}/{own}", folder.trim_end_matches('/'));
                }
            }
            ToldBy::FileName => named_after(input, &entry.name),
            ToldBy::Metadata | ToldBy::Column => {}
        }
    }

    /// The pipeline file with the sessions of every robot: `*` stands for the robot in file names. Its other settings are those of `entry`.
    pub fn file_of_any(&self, entry: &RobotEntry) -> Table {
        let mut file = self.common.clone();
        put("", &entry.settings, &mut file);
        if let Some(robot) = file.get_mut("robot").and_then(Value::as_table_mut) {
            robot.remove("name");
        }
        if let Some(input) = file.get_mut("input").and_then(Value::as_table_mut)
            && self.by == ToldBy::FileName
        {
            named_after(input, "*");
        }
        file
    }

    /// Patterns with `{robot}` of `[input]`: those of the logs or the table of a session.
    pub fn patterns(&self) -> Vec<&str> {
        let input = self.common.get("input").and_then(Value::as_table);
        FILES[..3].iter().filter_map(|key| input?.get(*key)).flat_map(texts).collect()
    }

    /// Whether `[input]` names the files of a session: both logs, or a table.
    fn names_files(&self) -> bool {
        let input = self.common.get("input").and_then(Value::as_table);
        let has = |key: &str| input.is_some_and(|input| input.contains_key(key));
        has("stations") || (has("controller") && has("tracker"))
    }

    fn are_sound(&self, path: &Path) -> Result<()> {
        let wrong = |stated: &StatedRobot, reason: String| {
            robots_error(path, None, format!("{}: {reason}", stated.place))
        };
        if self.stated.is_empty() {
            return Err(robots_error(path, None, "there is no robot".to_owned()));
        }
        let (mut names, mut folders) = (BTreeSet::new(), BTreeSet::new());
        for stated in &self.stated {
            let entry = &stated.entry;
            lake::check_name("robot", &entry.name)
                .map_err(|error| wrong(stated, error.to_string()))?;
            if !names.insert(&entry.name) {
                return Err(wrong(stated, format!("{:?} is stated twice", entry.name)));
            }
            let folder = entry.folder.as_ref().unwrap_or(&entry.name);
            if self.by == ToldBy::Folder && !folders.insert(folder) {
                return Err(wrong(stated, format!("the folder {folder:?} is another robot's")));
            }
            is_one_below(entry, self.by).map_err(|reason| wrong(stated, reason))?;
        }
        if self.by == ToldBy::FileName {
            self.distinguished().map_err(|reason| robots_error(path, None, reason))?;
        }
        Ok(())
    }

    /// Checks that file names with `{robot}` are of one robot each.
    fn distinguished(&self) -> Result<(), String> {
        let patterns = self.patterns();
        if !self.names_files() || patterns.iter().any(|own| own.matches(ROBOT_PLACE).count() != 1) {
            return Err(format!(
                "robots_by = \"file_name\" needs one {ROBOT_PLACE} in each name of [input] controller and tracker, or of stations"
            ));
        }
        let names: Vec<&str> = self.names().collect();
        let alike = patterns.iter().find_map(|pattern| of_two(pattern, &names));
        alike.map_or(Ok(()), |(one, other)| {
            Err(format!(
                "a file of {other:?} may be one of {one:?} too: rename one, or use robots_by = \"folder\" or \"metadata\""
            ))
        })
    }
}

/// Two names of which a file of the second may be one of the first too, by a pattern with `{robot}`.
fn of_two<'n>(pattern: &str, names: &[&'n str]) -> Option<(&'n str, &'n str)> {
    let (before, after) = pattern.split_once(ROBOT_PLACE)?;
    let behind = after.find(['{', '*', '?']).map(|end| &after[..end]);
    let ahead = before.rfind(['}', '*', '?']).map(|start| &before[start + 1..]);
    let alike = |one: &str, other: &str| {
        let rest = behind.zip(other.strip_prefix(one));
        let rest_before = ahead.zip(other.strip_suffix(one));
        rest.is_some_and(|(text, rest)| format!("{rest}{text}").starts_with(text))
            || rest_before.is_some_and(|(text, rest)| format!("{text}{rest}").ends_with(text))
    };
    let of_one = |one: &&'n str| {
        let other = names.iter().filter(|other| *other != one).find(|other| alike(one, other));
        other.map(|other| (*one, *other))
    };
    names.iter().find_map(of_one)
}

/// Checks that a robot's folder is one below that of `[input]`, and its name one that stands in file names.
fn is_one_below(entry: &RobotEntry, by: ToldBy) -> Result<(), String> {
    match (by, &entry.folder) {
        (ToldBy::FileName | ToldBy::Metadata | ToldBy::Column, Some(_)) => {
            Err("`folder` is for robots_by = \"folder\"".to_owned())
        }
        (ToldBy::FileName, None) if entry.name.contains(['*', '?', '{', '}', '/']) => {
            Err(format!("{:?} has signs that have a meaning in file names; rename it", entry.name))
        }
        (ToldBy::Folder, folder) => {
            let folder = folder.as_ref().unwrap_or(&entry.name);
            let parts = || folder.split('/');
            let below = parts().all(|part| !part.is_empty() && part != "." && part != "..");
            let reason =
                || format!("{folder:?} is no folder below that of [input]; state its `folder`");
            below.then_some(()).ok_or_else(reason)
        }
        _ => Ok(()),
    }
}

/// Puts a robot into the file names of `[input]`.
fn named_after(input: &mut Table, robot: &str) {
    for key in FILES {
        if let Some(value) = input.remove(key) {
            input.insert(key.to_owned(), with_robot(value, robot));
        }
    }
}

fn with_robot(names: Value, robot: &str) -> Value {
    let each = |own| with_robot(own, robot);
    match names {
        Value::String(name) => Value::String(name.replace(ROBOT_PLACE, robot)),
        Value::Array(names) => Value::Array(names.into_iter().map(each).collect()),
        other => other,
    }
}

/// The texts of a value that is a text or a list of them.
fn texts(value: &Value) -> Vec<&str> {
    let own = value.as_str().into_iter();
    let several = value.as_array().into_iter().flatten().filter_map(Value::as_str);
    own.chain(several).collect()
}

fn of_file(own: &Value) -> Result<Vec<StatedRobot>, String> {
    let robots = own.as_array().ok_or("it is a list of tables, [[robots]]")?;
    let stated = |(number, value): (usize, &Value)| {
        let place = format!("[[robots]] {}", number + 1);
        let table = value.as_table().cloned().ok_or("it is no table".to_owned());
        let entry =
            table.and_then(RobotEntry::of).map_err(|reason| format!("{place}: {reason}"))?;
        Ok(StatedRobot { entry, place })
    };
    robots.iter().enumerate().map(stated).collect()
}

/// The robots of a table beside the file.
fn of_table(path: &Path, at: &Path, named: &str) -> Result<Vec<StatedRobot>> {
    let mut stated = table::read(at).map_err(|reason| robots_error(path, Some(at), reason))?;
    for own in &mut stated {
        own.place = format!("{} of {named}", own.place);
    }
    Ok(stated)
}

fn robots_by(path: &Path, by: Option<&Value>) -> Result<ToldBy> {
    let Some(by) = by else { return Ok(ToldBy::default()) };
    by.clone().try_into().map_err(|_| {
        let wanted = "\"folder\", \"file_name\", \"metadata\" or \"column\"";
        ConfigurationErrorKind::setting("[input] robots_by", by, wanted).at(path)
    })
}

/// The robots that the file's `own` tables state, or the table that it has `named`.
fn stated(
    path: &Path,
    base: &Path,
    own: Option<&Value>,
    named: Option<&Value>,
) -> Result<Vec<StatedRobot>> {
    let (key, found, wanted) = match (own, named) {
        (Some(own), None) => return of_file(own).map_err(|why| robots_error(path, None, why)),
        (None, Some(Value::String(named))) => return of_table(path, &base.join(named), named),
        (Some(_), Some(_)) => {
            ("robots", "a table".to_owned(), "left out where [[robots]] states them")
        }
        (None, Some(other)) => ("robots", other.to_string(), "the path of a table"),
        (None, None) => (
            "robots_by",
            "alone".to_owned(),
            "beside [input] robots, a table of the robots, or [[robots]]",
        ),
    };
    Err(ConfigurationErrorKind::setting(format!("[input] {key}"), found, wanted).at(path))
}

fn robots_error(path: &Path, table: Option<&Path>, reason: String) -> ConfigurationError {
    let fault = match table {
        None => reason,
        Some(table) => {
            let table = table.display();
            format!("{table}, the table of robots that [input] robots names: {reason}")
        }
    };
    ConfigurationErrorKind::Fault(fault).at(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robots(text: &str) -> Result<Robots, String> {
        let values: Table = text.parse().expect("TOML");
        let path = Path::new("cell.toml");
        let robots = Robots::of(path, Path::new("."), &values);
        Ok(robots.map_err(|error| error.to_string())?.expect("several"))
    }

    #[test]
    fn a_robots_file_is_the_common_one_with_its_settings() {
        let robots = robots(
            "[input]\nfolder = 's3://b/x/'\nrobots_by = 'folder'\n[tolerance]\nmm = 0.5\n\
             [[robots]]\nname = 'a'\n[[robots]]\nname = 'b'\nfolder = 'line/2'\ntolerance.mm = 0.3\n",
        )
        .expect("robots");
        let wanted: Table = "robot = { name = 'b' }\ninput = { folder = 's3://b/x/line/2' }\ntolerance = { mm = 0.3 }"
            .parse()
            .expect("TOML");
        assert_eq!(robots.file_of(&robots.stated[1].entry), wanted);
    }

    #[test]
    fn a_file_name_has_the_robot_in_its_place() {
        let text = "input = { folder = 'x', robots_by = 'file_name', controller = ['{robot}_{session}.mcap'], tracker = '{robot}.mcap' }\n\
                    robots = [{ name = 'kr1' }, { name = 'kr10' }, { name = 'kr1-b' }, { name = 'b_kr1' }]\n";
        let robots = robots(text).expect("no file is of two of them");
        let input = &robots.file_of(&robots.stated[0].entry)["input"];
        assert_eq!(input["controller"][0].as_str(), Some("kr1_{session}.mcap"));
        assert_eq!(input["tracker"].as_str(), Some("kr1.mcap"));
    }

    #[test]
    fn what_is_wrong_with_robots_is_told() {
        let by_name = "input = { folder = 'x', robots_by = 'file_name', controller = '{robot}_{session}.mcap', tracker = '{robot}_{session}.mcap' }\n";
        for (text, words) in [
            ("robots = []", "there is no robot"),
            ("robots = [{ name = 'a' }, { name = 'a' }]", "[[robots]] 2: \"a\" is stated twice"),
            (
                "robots = [{ name = 'a' }, { name = 'b', folder = 'a' }]",
                "the folder \"a\" is another robot's",
            ),
            ("robots = [{ name = 'a', folder = '../b' }]", "\"../b\" is no folder below"),
            ("robots = [{ name = 'a', mm = 1 }]", "[[robots]] 1: unknown field `mm`"),
            (
                "input = { robots_by = 'colour' }\nrobots = [{ name = 'a' }]",
                "[input] robots_by = \"colour\"",
            ),
            ("input = { robots_by = 'folder' }", "[input] robots_by = alone"),
            (
                "input = { robots = 'r.csv' }\nrobots = [{ name = 'a' }]",
                "left out where [[robots]]",
            ),
            ("input = { robots = 'nowhere.csv' }", "nowhere.csv"),
            (
                &format!("{by_name}robots = [{{ name = 'a' }}, {{ name = 'a_1' }}]"),
                "a file of \"a_1\" may be one of \"a\" too",
            ),
            (
                &format!(
                    "{}robots = [{{ name = 'a' }}, {{ name = '1_a' }}]",
                    by_name.replace("{robot}_{session}", "{session}_{robot}")
                ),
                "a file of \"1_a\" may be",
            ),
            (&format!("{by_name}robots = [{{ name = 'a*' }}]"), "have a meaning in file names"),
            ("input = { robots_by = 'file_name' }\nrobots = [{ name = 'a' }]", "needs one {robot}"),
            (
                "input = { robots_by = 'metadata' }\nrobots = [{ name = 'a', folder = 'b' }]",
                "`folder` is for robots_by",
            ),
        ] {
            let found = robots(text).expect_err(text);
            assert!(found.contains("cell.toml") && found.contains(words), "{text}: {found}");
        }
    }
}
