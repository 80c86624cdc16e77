//! `posegrid init FILE…`: a pipeline file from what `inspect` finds in logs or tables, complete but for what no file states, which has a
//! value and the words `to state`.

use std::fs::File;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use clap::Args;
use thiserror::Error;

use super::folder_given::entries;
use super::inspect::table::{self, arm, is_table, section};
use super::inspect::{Form, files, files_in, sections, toml_text};
use super::progress::Bars;
use super::robot::ArmFlags;
use crate::at::At;
use crate::files::input::Bound;
use crate::files::measured_table::MeasuredTableError;
use crate::io::inspect::table::{Guess, inspect as inspect_table};
use crate::io::inspect::{Inspection, inspect};
use crate::io::log::{FileError, Limits};
use crate::io::robot::ready::{ReadyRobot, arms as ready_arms};

/// Write a pipeline file for logs or tables of stations
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid init measured.xlsx
  posegrid init sessions/mon                  (a folder with the logs of a session, or with such folders)
  posegrid init measured.csv --robot my.urdf --tip tool0 --out cells/7.toml

posegrid inspect shows what it is guessed from; lines with `unsure` or `to state` are those to look at. A ready robot that the table or the
logs' metadata name is written beside the pipeline file. No file is replaced.")]
pub struct InitArgs {
    /// The logs or tables of sessions, or their folder
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The pipeline file to write
    #[arg(long, value_name = "FILE", default_value = "pipeline.toml")]
    pub out: PathBuf,
    /// The arm: a robot file, a URDF, or the name of a ready robot
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// The arm in the file
    #[command(flatten)]
    pub arm: ArmFlags,
}

#[derive(Debug, Error)]
pub enum InitError {
    #[error(transparent)]
    Arm(#[from] arm::NoArm),
    #[error(transparent)]
    Log(#[from] FileError),
    #[error(transparent)]
    Table(#[from] MeasuredTableError),
    #[error(
        "{0}: how to read it is not known; posegrid inspect shows its columns and what it lacks"
    )]
    NotKnown(PathBuf),
    #[error("{0} is not read as the tables before it: write a pipeline file for each kind")]
    Unlike(PathBuf),
    #[error("{0} is a log beside tables: write a pipeline file for each kind")]
    Mixed(PathBuf),
    #[error("{0}")]
    Write(At<io::Error>),
    #[error("{0} is there already, and is not replaced: write another file with --out")]
    There(PathBuf),
    #[error(
        "{0} is to be the file of the ready robot, beside the pipeline file: write another file with --out"
    )]
    OfRobot(PathBuf),
}

const HEAD: &str = "# Written by posegrid init. `posegrid schema pipeline` has every key.\n\n";
/// Values that no log or table states.
const TO_STATE: &str = "
[grid]
steps_mm = [60, 90, 120, 180, 240, 360]

[tolerance]
mm = 0.5           # to state: what the work needs, for this share of positions
share = 0.95
confidence = 0.95

[output]
lake = \"lake\"
";
/// The sections of a pipeline file that follow from what was found.
struct Sections {
    text: String,
    /// The file of the ready robot that they name, if they name one.
    ready: Option<String>,
}

/// Writes the file; gives what was written and what to do now.
pub fn run(args: &InitArgs, bars: &Bars) -> Result<String, InitError> {
    if args.out.exists() {
        return Err(InitError::There(args.out.clone()));
    }
    let files = args.files.iter().map(|path| args.seen_from_out(path));
    let files = files.collect::<Result<Vec<PathBuf>, InitError>>()?;
    let sections = if files.iter().any(|path| is_table(path)) {
        args.of_tables(&files)?
    } else {
        args.of_logs(&files, bars)?
    };
    args.write(&sections)
}

impl InitArgs {
    /// A path as the pipeline file states it: its own, or a whole one where the file stands in another folder, or the path names no
    /// folder of sessions.
    fn seen_from_out(&self, path: &Path) -> Result<PathBuf, InitError> {
        let is_bare =
            |path: &Path| path.parent().is_none_or(|folder| folder.as_os_str().is_empty());
        let is_folder = path.is_dir() && path.file_name().is_some();
        if is_bare(&self.out) && (is_table(path) || is_folder || !is_bare(path)) {
            return Ok(path.to_owned());
        }
        path.canonicalize().map_err(|error| InitError::Write(At::new(path.display(), error)))
    }

    fn of_tables(&self, files: &[PathBuf]) -> Result<Sections, InitError> {
        let selection = self.arm.selection();
        let arms = arm::arms(self.robot.as_deref(), &selection)?;
        let mut known: Option<Guess> = None;
        for path in files {
            if !is_table(path) {
                return Err(InitError::Mixed(path.clone()));
            }
            let found = inspect_table(path, Bound::of(Limits::default()), &arms)?;
            let guess = found.guess.map_err(|_| InitError::NotKnown(path.clone()))?;
            if known.as_ref().is_some_and(|first| first.settings != guess.settings) {
                return Err(InitError::Unlike(path.clone()));
            }
            known.get_or_insert(guess);
        }
        let paths: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
        let found = || known.as_ref().and_then(table::ready).map(str::to_owned);
        let ready = self.ready().or_else(found);
        let text = known.map(|guess| section(&paths, &guess, &selection, Form::File));
        Ok(Sections { text: text.unwrap_or_default(), ready })
    }

    fn of_logs(&self, given: &[PathBuf], bars: &Bars) -> Result<Sections, InitError> {
        let progress = bars.of("inspect");
        let (folder, names) = of_sessions(given);
        let first = names.first().map(|session| folder.join(session));
        let logs = first.map_or_else(|| given.to_vec(), |own| files_in(&own));
        let found = logs.iter().map(|log| inspect(log, Limits::default(), &progress));
        let found = found.collect::<Result<Vec<_>, _>>()?;
        let (robot, ready) = self.robot_of(&found);
        let names: Vec<String> = names.iter().map(|own| toml_text(own)).collect();
        let text = format!(
            "{robot}\n[input]\nfolder = {}\nsessions = [{}]\n{}{}",
            toml_text(&folder.to_string_lossy()),
            names.join(", "),
            files(&found),
            sections(&found, Form::File)
        );
        Ok(Sections { text, ready })
    }

    /// The file of the ready robot that was given by its name.
    fn ready(&self) -> Option<String> {
        let name = self.robot.as_deref().filter(|path| !path.exists())?.to_str()?;
        ReadyRobot::find(name).map(|robot| robot.file.to_owned())
    }

    /// The section of the arm that was given, or of the ready one that has the model of the logs' metadata.
    fn robot_of(&self, found: &[Inspection]) -> (String, Option<String>) {
        let metadata = found.iter().flat_map(|log| &log.read_summary.metadata);
        let mut models = metadata.filter(|(_, key, _)| key == "model").map(|(_, _, model)| model);
        let of_model = |model: &String| {
            ready_arms().into_iter().find(|own| own.arm.model() == model).map(|own| own.file)
        };
        let (given, of_model) = (self.ready(), models.find_map(of_model));
        let (file, doubt) = match (&given, &self.robot, &of_model) {
            (Some(ready), ..) => (ready.clone(), ""),
            (None, Some(path), _) => (path.to_string_lossy().into_owned(), ""),
            (None, None, Some(ready)) => {
                (ready.clone(), "  # unsure: the ready robot of the model in the logs' metadata")
            }
            (None, None, None) => (
                "robot.toml".to_owned(),
                "  # to state: the arm; posegrid robot --list names the ready ones, posegrid robot NAME > robot.toml writes one",
            ),
        };
        let ready = given.or_else(|| of_model.filter(|_| self.robot.is_none()));
        let up = Form::File.of_arm(true);
        (format!("[robot]\nfile = {}{doubt}\n{up}", toml_text(&file)), ready)
    }

    fn write(&self, sections: &Sections) -> Result<String, InitError> {
        let text = format!("{HEAD}{}\n{TO_STATE}", sections.text.trim_end());
        let mut told = Vec::new();
        if let Some(robot) = sections.ready.as_deref().and_then(ReadyRobot::find) {
            let path = self.out.with_file_name(robot.file);
            if path == self.out {
                return Err(InitError::OfRobot(path));
            }
            if path.exists() {
                told.push(format!("{} was there already, and is kept", path.display()));
            } else {
                create(&path, robot.printed())?;
                told.push(format!("{} is the ready robot", path.display()));
            }
        }
        create(&self.out, &text)?;
        let is_doubt = |line: &&str| line.contains("# unsure: ") || line.contains("# to state: ");
        let doubts: Vec<&str> = text.lines().filter(is_doubt).collect();
        let out = self.out.display();
        told.push(format!("{out} is written; {} of its lines are to be looked at:", doubts.len()));
        told.extend(doubts.iter().map(|line| format!("  {line}")));
        told.push(format!("now: posegrid check {out} && posegrid run {out}"));
        Ok(told.join("\n") + "\n")
    }
}

/// The folder of the sessions, and the name of each: folders with logs in the folder that was given, or the one of the logs.
fn of_sessions(files: &[PathBuf]) -> (PathBuf, Vec<String>) {
    let has_logs = |path: &PathBuf| path.is_dir() && files_in(path) != [path.clone()];
    let folder_of = |path: &PathBuf| {
        let parent = || path.parent().map(Path::to_owned);
        if path.is_dir() { Some(path.clone()) } else { parent() }
    };
    let (folder, mut sessions) = match files {
        [folder] if folder.is_dir() && !has_logs(folder) => {
            (folder.clone(), entries(folder).into_iter().filter(has_logs).collect())
        }
        _ => {
            let folders: Vec<PathBuf> = files.iter().filter_map(folder_of).collect();
            let parent = folders.first().and_then(|own| own.parent()).unwrap_or(Path::new(".."));
            (parent.to_owned(), folders)
        }
    };
    sessions.sort();
    sessions.dedup();
    let names = sessions.iter().filter_map(|own| own.file_name());
    let names = names.map(|own| own.to_string_lossy().into_owned()).collect();
    (if folder.as_os_str().is_empty() { PathBuf::from(".") } else { folder }, names)
}

fn create(path: &Path, text: &str) -> Result<(), InitError> {
    let written = File::create_new(path).and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|error| match error.kind() {
        io::ErrorKind::AlreadyExists => InitError::There(path.to_owned()),
        _ => InitError::Write(At::new(path.display(), error)),
    })
}
