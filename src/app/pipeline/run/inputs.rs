//! The inputs of a piece of work, which give it its name: files by their digests, settings, the robot.

use std::path::{Path, PathBuf};

use super::{Result, RunError};
use crate::files::input::{self, Bound};
use crate::io::log::{SessionLogs, read_metadata};
use crate::io::station_table::{self, Whose};
use crate::manifest::{self, Input, ROBOT, Work};
use crate::pipeline::configuration::{
    Configuration, Reads, Recorded, SessionFiles, SessionTable, WorkPiece,
};

/// What a session's files are named after it as inputs.
const SIDES: [&str; 4] = ["controller", "tracker", "stations", "corrected"];

/// The work's identity. A log is opened here only where neither the pipeline file nor the command line names the robot.
pub(in crate::pipeline) fn work(configuration: &Configuration, piece: &WorkPiece) -> Result<Work> {
    let mut inputs = vec![input(&configuration.robot_file, ROBOT)?];
    for files in piece.training.iter().chain(&piece.test) {
        inputs.extend(session_inputs(configuration, files).map_err(|error| error.of(files))?);
    }
    let names = |files: &[SessionFiles]| files.iter().map(|files| files.name.clone()).collect();
    Ok(Work {
        robot: robot_name(configuration, piece)?,
        session: piece.session.clone(),
        pipeline: configuration.pipeline.clone(),
        sessions: names(&piece.training),
        test_sessions: names(&piece.test),
        inputs,
        settings: configuration.settings.clone(),
    })
}

fn session_inputs(configuration: &Configuration, files: &SessionFiles) -> Result<Vec<Input>> {
    let name = &files.name;
    let mut inputs = match &files.recorded {
        Recorded::Logs(logs) => both_logs(logs, name)?,
        Recorded::Joined(before) => before.inputs.clone(),
        Recorded::Table(table) => {
            vec![table_input(configuration, table, &format!("{name}/stations"))?]
        }
    };
    let corrected = files.corrected.iter();
    let corrected = corrected.map(|path| input(path, &format!("{name}/corrected")));
    inputs.extend(corrected.collect::<Result<Vec<_>, _>>()?);
    Ok(inputs)
}

fn both_logs(logs: &SessionLogs, name: &str) -> Result<Vec<Input>> {
    let mut inputs = log_inputs(&logs.controller, &format!("{name}/controller"))?;
    if logs.tracker != logs.controller {
        inputs.extend(log_inputs(&logs.tracker, &format!("{name}/tracker"))?);
    }
    Ok(inputs)
}

/// A table as an input: the file, or its rows of one robot and session where it names them.
fn table_input(configuration: &Configuration, table: &SessionTable, name: &str) -> Result<Input> {
    let settings = match &configuration.reads {
        Reads::Tables(settings) if table.whose != Whose::default() => settings,
        Reads::Tables(_) | Reads::Logs(_) => return input(&table.path, name),
    };
    let bound = Bound::of(configuration.file.limits);
    let rows = station_table::own_text(&table.path, settings, &table.whose, bound)?;
    let wrong = |source| RunError::Input { path: table.path.clone(), source };
    let (digest, bytes) = manifest::digest(rows.as_bytes()).map_err(wrong)?;
    Ok(Input { name: name.to_owned(), bytes, digest })
}

/// The files of one side; those of a split recording are numbered by their digests, so that their names do not matter.
fn log_inputs(paths: &[PathBuf], name: &str) -> Result<Vec<Input>> {
    let mut inputs = paths.iter().map(|path| input(path, name)).collect::<Result<Vec<_>, _>>()?;
    if inputs.len() < 2 {
        return Ok(inputs);
    }
    inputs.sort_by(|a, b| a.digest.cmp(&b.digest));
    if inputs.windows(2).any(|pair| pair[0].digest == pair[1].digest) {
        return Err(RunError::SameTwice {
            side: name.to_owned(),
            files: paths.iter().map(|path| path.display().to_string()).collect(),
        });
    }
    for (place, input) in inputs.iter_mut().enumerate() {
        input.name = format!("{name}/{}", place + 1);
    }
    Ok(inputs)
}

/// Whether an input is of this session: `SESSION/SIDE`, or `SESSION/SIDE/NUMBER` of a split recording. Another session's name may begin
/// with this one's and a slash.
pub(in crate::pipeline) fn is_of_session(input: &str, session: &str) -> bool {
    let side = input.strip_prefix(session);
    let Some(side) = side.and_then(|side| side.strip_prefix('/')) else { return false };
    let (side, part) = side.split_once('/').unwrap_or((side, "1"));
    SIDES.contains(&side) && part.parse::<usize>().is_ok()
}

pub(in crate::pipeline) fn input(path: &Path, name: &str) -> Result<Input> {
    let wrong = |source| RunError::Input { path: path.to_owned(), source };
    let (digest, bytes) =
        manifest::digest(input::open(path, Bound::ANY).map_err(wrong)?).map_err(wrong)?;
    Ok(Input { name: name.to_owned(), bytes, digest })
}

fn robot_name(configuration: &Configuration, piece: &WorkPiece) -> Result<String> {
    if let Some(name) = &configuration.robot {
        return Ok(name.clone());
    }
    let none = || RunError::NoRobotName { session: piece.session.clone() };
    let files = piece.training.first().ok_or_else(none)?;
    if let Recorded::Joined(before) = &files.recorded {
        return Ok(before.key.robot.clone());
    }
    let logs = files.recorded.logs().ok_or_else(none)?;
    read_metadata(logs, configuration.file.limits)?.remove("session.robot").ok_or_else(none)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_input_is_of_one_session_whatever_the_others_are_called() {
        for own in ["a/controller", "a/tracker/2", "a/stations", "a/corrected"] {
            assert!(is_of_session(own, "a"), "{own}");
        }
        for other in ["a/b/controller", "ab/controller", "a/controller/tracker", "a", "robot"] {
            assert!(!is_of_session(other, "a"), "{other}");
        }
        assert!(is_of_session("a/b/controller/1", "a/b"));
    }
}
