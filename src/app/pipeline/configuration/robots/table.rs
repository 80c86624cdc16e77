//! The table of robots beside a pipeline file: CSV with a row for each, whose columns are keys like `tolerance.mm`.
//!
//! Columns `name` and `folder` are the robot's own; every other one is a section, a dot and a key, or a key inside a value, such as
//! `tracker.tracker_from_base.surveyed.xyz_mm`. A cell is written as in the pipeline file, texts without quotes; an empty cell leaves
//! the file's value.

use std::path::Path;

use toml::{Table, Value};

use super::StatedRobot;
use crate::files::input::{self, Bound};
use crate::pipeline::keys::KeyReference;
use crate::pipeline::robot_entry::RobotEntry;

const SEPARATORS: [u8; 3] = [b',', b';', b'\t'];

/// The robots of the table at `path`.
///
/// # Errors
/// Why there are none: the reason, with row and column where there is one.
pub fn read(path: &Path) -> Result<Vec<StatedRobot>, String> {
    let text = input::text(path, Bound::ROBOTS).map_err(|error| error.to_string())?;
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator(&text))
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(text.trim_start_matches('\u{feff}').as_bytes());
    let columns = reader.headers().map_err(|error| error.to_string())?.clone();
    let columns: Vec<&str> = columns.iter().collect();
    columns_are_sound(&columns)?;
    let mut robots = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| error.to_string())?;
        let place = format!("row {}", robots.len() + 2);
        let cells = columns.iter().copied().zip(record.iter());
        let entry = entry(cells).map_err(|reason| format!("{place}: {reason}"))?;
        robots.push(StatedRobot { entry, place });
    }
    Ok(robots)
}

/// The separator that stands most often in the first line.
fn separator(text: &str) -> u8 {
    let first = text.lines().next().unwrap_or_default();
    let count = |own: u8| first.bytes().filter(|byte| *byte == own).count();
    SEPARATORS.into_iter().rev().max_by_key(|own| count(*own)).unwrap_or(b',')
}

fn columns_are_sound(columns: &[&str]) -> Result<(), String> {
    if !columns.contains(&"name") {
        return Err("it has no column `name`, the robots' names".to_owned());
    }
    for (place, column) in columns.iter().enumerate() {
        if columns[..place].contains(column) {
            return Err(format!("two columns are called {column:?}"));
        }
        let is_key = column.contains('.') && column.split('.').all(|step| !step.is_empty());
        if !is_key && !["name", "folder"].contains(column) {
            return Err(format!(
                "column {column:?} is neither `name` nor `folder` nor a key with its section, such as `tolerance.mm`"
            ));
        }
    }
    Ok(())
}

fn entry<'c>(cells: impl Iterator<Item = (&'c str, &'c str)>) -> Result<RobotEntry, String> {
    let mut robot = Table::new();
    for (column, cell) in cells.filter(|(_, cell)| !cell.is_empty()) {
        let value = if is_text(column) { Value::String(cell.to_owned()) } else { value(cell) };
        insert(&mut robot, column, value).map_err(|reason| format!("column {column}: {reason}"))?;
    }
    RobotEntry::of(robot)
}

/// Whether the key of a column is a text, which is written without quotes whatever it looks like.
fn is_text(column: &str) -> bool {
    let Some((section, name)) = column.rsplit_once('.') else { return true };
    let sections = KeyReference::pipeline().sections.iter();
    let own = sections.filter(|own| own.name == section || own.at.iter().any(|at| at == section));
    let mut keys = own.flat_map(|own| &own.keys);
    keys.any(|key| key.key == name && ["text", "path", "word"].contains(&key.kind.as_str()))
}

/// A cell as a value of a pipeline file; a text where it is no other value.
fn value(cell: &str) -> Value {
    let line: Result<Table, _> = format!("value = {cell}").parse();
    let value = line.ok().filter(|line| line.len() == 1).and_then(|mut line| line.remove("value"));
    value.unwrap_or_else(|| Value::String(cell.to_owned()))
}

/// Puts a value to the path that a column names.
fn insert(table: &mut Table, column: &str, value: Value) -> Result<(), String> {
    let Some((first, rest)) = column.split_once('.') else {
        return match table.insert(column.to_owned(), value) {
            None => Ok(()),
            Some(_) => Err("another column states it as a whole".to_owned()),
        };
    };
    let inner = table.entry(first).or_insert_with(|| Value::Table(Table::new())).as_table_mut();
    let inner = inner.ok_or_else(|| "another column states it as a whole".to_owned())?;
    insert(inner, rest, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robots(text: &str) -> Result<Vec<RobotEntry>, String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("robots.csv");
        std::fs::write(&path, text).expect("written");
        let stated = read(&path)?;
        Ok(stated.into_iter().map(|own| own.entry).collect())
    }

    #[test]
    fn a_row_is_a_robot_and_a_column_a_key() {
        let found = robots(
            "\u{feff}name;robot.file;robot.valid_for.tool;tolerance.mm;tracker.tracker_from_base.surveyed.xyz_mm\n\
             # the first line\n7;a.toml;6;0.3;[1, 2, 3]\nr8;;drill;;\n",
        )
        .expect("two robots");
        assert_eq!(found[0].name, "7");
        let wanted: Table = "robot = { file = 'a.toml', valid_for = { tool = '6' } }\ntolerance = { mm = 0.3 }\n\
                             tracker = { tracker_from_base = { surveyed = { xyz_mm = [1, 2, 3] } } }"
            .parse()
            .expect("TOML");
        assert_eq!(found[0].settings, wanted);
        let wanted: Table = "robot = { valid_for = { tool = 'drill' } }".parse().expect("TOML");
        assert_eq!((found[1].name.as_str(), &found[1].settings), ("r8", &wanted));
    }

    #[test]
    fn what_is_wrong_in_a_table_is_told_with_its_place() {
        for (text, words) in [
            ("robot.file\na.toml\n", "it has no column `name`"),
            ("name,name\na,b\n", "two columns are called \"name\""),
            ("name,mm\na,1\n", "column \"mm\" is neither"),
            ("name,tolerance.\na,1\n", "column \"tolerance.\" is neither"),
            ("name,tolerance.mm\na,0.5\n,0.3\n", "row 3: missing field `name`"),
            ("name,input.folder\na,x\n", "row 2: unknown field `input`"),
            ("name,tolerance.mm\na\n", "CSV error: record 1"),
            (
                "name,fit.target,fit.target.sd_mm\na,5,3\n",
                "row 2: column fit.target.sd_mm: another column states it as a whole",
            ),
        ] {
            let found = robots(text).expect_err(text);
            assert!(found.starts_with(words), "{text}: {found}");
        }
        assert_eq!(value("1\nb = 2"), Value::String("1\nb = 2".to_owned()), "a cell is one value");
    }
}
