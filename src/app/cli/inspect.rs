//! `posegrid inspect FILE…`: what is in a log or a table of stations, and a pipeline snippet that would read it. Names
//! come from the file, so they are escaped.

mod describe;
mod snippet;
pub(super) mod table;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;

use super::folder_given::entries;
use super::progress::Bars;
use super::robot::ArmFlags;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT, NOT_MET, messages};
use crate::files::input::Bound;
use crate::io::inspect::table::{Arms, Guess, inspect as inspect_table};
use crate::io::inspect::{Inspection, inspect};
use crate::io::log::Limits;
use crate::io::robot::Selection;

pub use describe::describe;
pub use snippet::{files, sections, snippet};

/// Show what is in MCAP logs or tables of stations, and how a pipeline file would read them.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid inspect controller.mcap tracker.mcap
  posegrid inspect arm_0.mcap arm_1.mcap laser.mcap.zst   (a split recording, a log in zstd)
  posegrid inspect sessions/mon                           (every log in a folder)
  posegrid inspect measured.csv                           (a table of joints and measured points)
  posegrid inspect measured.xlsx --robot ur10e            (or --robot robot.toml, or --robot arm.urdf --tip tool0)

Of a table (CSV and other texts, Parquet, JSON, YAML, a spreadsheet) the columns are guessed by their names and values, and then tried
on the nominal arm: what remains in the median, base and target fitted, tells degrees from radians, metres from millimetres and the
order of the joints. Without --robot every ready robot with as many joints is tried.

Exit codes: 0 every file is sound; 3 some log is damaged, or was cut, or rows of a table were left out; 1 some file cannot be read;
2 bad usage, or --robot is no robot file.")]
pub struct InspectArgs {
    /// The logs or tables, or folders with logs
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// The arm of a table: a robot file, a URDF, or the name of a ready robot
    #[arg(long, value_name = "FILE")]
    pub robot: Option<PathBuf>,
    /// The arm in the file
    #[command(flatten)]
    pub arm: ArmFlags,
}

/// What the sections of a pipeline file are for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// To be looked at: what no log or table states is a comment.
    Shown,
    /// A whole file, which can be checked and run.
    File,
}

impl Form {
    /// The usual limits of a laser tracker.
    fn uncertainty(self) -> String {
        let key = "uncertainty = { range_um = 10, range_um_per_m = 0.3, transverse_um = 15, transverse_um_per_m = 6, divisor = 2 }";
        match self {
            Self::Shown => format!("# {key}  # from the instrument's data sheet\n"),
            Self::File => {
                format!(
                    "{key}  # to state: a laser tracker's usual limits; write those of the instrument's data sheet\n"
                )
            }
        }
    }

    /// What a whole file states of the arm beside its robot file; its name only of tables, since logs have it.
    pub fn of_arm(self, is_named: bool) -> String {
        let name = "name = \"arm-1\"  # to state: the arm's name in the tables\n";
        let up = "up = [0, 0, 1]  # to state: against gravity in the base frame; so for an arm on the floor\n";
        match self {
            Self::Shown => String::new(),
            Self::File if is_named => up.to_owned(),
            Self::File => [name, up].concat(),
        }
    }
}

/// Inspects each file; prints to stdout, errors to stderr. Exit code 0: all sound, 3: some damaged, 1: some unreadable, 2: no arm.
pub fn run(args: &InspectArgs, bars: &Bars) -> u8 {
    inspect_all(args, bars).unwrap_or_else(Undelivered::exit_code)
}

/// Inspects the files until all are done, or the reader of stdout has left.
fn inspect_all(args: &InspectArgs, bars: &Bars) -> Result<u8, Undelivered> {
    let paths: Vec<PathBuf> = args.files.iter().flat_map(|path| files_in(path)).collect();
    let (tables, logs): (Vec<&PathBuf>, Vec<&PathBuf>) =
        paths.iter().partition(|path| table::is_table(path));
    let selection = args.arm.selection();
    let arms = match (&args.robot, &tables[..]) {
        // Logs need no arm.
        (None, []) => Arms::default(),
        (robot, _) => match table::arm::arms(robot.as_deref(), &selection) {
            Ok(arms) => arms,
            Err(error) => {
                tracing::error!("{error}");
                return Ok(BAD_USAGE);
            }
        },
    };
    let of_logs = inspect_logs(&logs, bars)?;
    let of_tables = inspect_tables(&tables, &selection, &arms, bars)?;
    // Unreadable outranks damaged.
    let code = [NO_RESULT, NOT_MET].into_iter().find(|code| [of_logs, of_tables].contains(code));
    Ok(code.unwrap_or(DONE))
}

fn inspect_logs(paths: &[&PathBuf], bars: &Bars) -> Result<u8, Undelivered> {
    let progress = bars.of("inspect");
    let mut found: Vec<Inspection> = Vec::new();
    let mut unreadable = false;
    for path in paths {
        match inspect(path, Limits::default(), &progress) {
            Ok(log) => {
                messages::result(describe(&log), bars)?;
                found.push(log);
            }
            Err(error) => {
                tracing::error!("{error}");
                unreadable = true;
            }
        }
    }
    if let Some(snippet) = snippet(&found) {
        messages::result(snippet, bars)?;
    }
    let damaged = found.iter().any(|log| !log.read_summary.rejects.is_empty());
    Ok(outcome(unreadable, damaged))
}

fn inspect_tables(
    paths: &[&PathBuf],
    selection: &Selection,
    arms: &Arms,
    bars: &Bars,
) -> Result<u8, Undelivered> {
    let (mut unreadable, mut left_out) = (false, false);
    // Tables of one mapping share a section.
    let mut guesses: Vec<(Vec<&Path>, Guess)> = Vec::new();
    for path in paths {
        match inspect_table(path, Bound::of(Limits::default()), arms) {
            Ok(found) => {
                left_out |= !found.left_out.is_empty();
                messages::result(table::describe(path, &found), bars)?;
                add(&mut guesses, path, found.guess.ok());
            }
            Err(error) => {
                tracing::error!("{error}");
                unreadable = true;
            }
        }
    }
    for (paths, guess) in &guesses {
        let section = table::section(paths, guess, selection, Form::Shown);
        messages::result(format!("{TABLES_READ}{section}"), bars)?;
    }
    Ok(outcome(unreadable, left_out))
}

const TABLES_READ: &str =
    "# A pipeline file would read this with (guessed: check it; what is unsure says why):\n\n";

/// Adds a table to those with the same settings beside it in the folder.
fn add<'p>(guesses: &mut Vec<(Vec<&'p Path>, Guess)>, path: &'p Path, guess: Option<Guess>) {
    let Some(guess) = guess else { return };
    let same = guesses.iter_mut().find(|(paths, own)| {
        own.settings == guess.settings && paths.iter().all(|other| other.parent() == path.parent())
    });
    match same {
        Some((paths, _)) => paths.push(path),
        None => guesses.push((vec![path], guess)),
    }
}

const fn outcome(unreadable: bool, damaged: bool) -> u8 {
    match (unreadable, damaged) {
        (true, _) => NO_RESULT,
        (false, true) => NOT_MET,
        (false, false) => DONE,
    }
}

/// The logs in a folder, by name; a path that is no folder with logs is itself the file.
pub(super) fn files_in(path: &Path) -> Vec<PathBuf> {
    let is_log = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.ends_with(".mcap") || name.ends_with(".mcap.zst")
    };
    let mut logs = entries(path);
    logs.retain(is_log);
    if logs.is_empty() {
        logs.push(path.to_owned());
    }
    logs
}

/// A name from a file, with every character escaped that a terminal would act on.
fn escaped(text: &str) -> String {
    text.chars()
        .flat_map(|c| match c {
            '\'' | '"' => vec![c],
            c => c.escape_debug().collect(),
        })
        .collect()
}

/// Longest name that is shown whole, in characters.
const LONGEST_SHOWN: usize = 200;

/// A name from a file, escaped, and cut where it is very long: many channels may share one.
fn shown(text: &str) -> String {
    match text.char_indices().nth(LONGEST_SHOWN) {
        None => escaped(text),
        Some((end, _)) => format!("{}… and {} bytes more", escaped(&text[..end]), text.len() - end),
    }
}

pub(super) fn toml_text(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        let plain = c == '\'' || c.escape_debug().count() == 1;
        if plain {
            quoted.push(c);
        } else {
            write!(quoted, "\\U{:08X}", u32::from(c)).expect("writing to a string");
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn names_are_harmless_on_a_terminal_and_whole_in_toml() {
        let name = "/a\u{1b}[2J\n\"b\\ü\u{202e}";
        assert!(!escaped(name).chars().any(|c| c.is_control() || c == '\u{202e}'));
        let toml: toml::Table =
            toml::from_str(&format!("topic = {}", toml_text(name))).expect("sound TOML");
        assert_eq!(toml["topic"].as_str(), Some(name));
    }

    #[test]
    fn a_folder_stands_for_its_logs() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for name in ["b.mcap", "a.mcap.zst", "notes.txt"] {
            fs::write(folder.path().join(name), b"").expect("writable");
        }
        let expected = ["a.mcap.zst", "b.mcap"].map(|name| folder.path().join(name));
        assert_eq!(files_in(folder.path()), expected);
        let file = folder.path().join("notes.txt");
        assert_eq!(files_in(&file), std::slice::from_ref(&file));
    }
}
