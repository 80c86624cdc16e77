//! `posegrid inspect LOG…`: what is in a log, what is wrong with it, and a pipeline snippet that would read it.
//!
//! Names come from the file, so they are escaped before they are printed.

mod describe;
mod snippet;

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use clap::Args;

use super::progress::Bars;
use super::streams::Undelivered;
use super::{DONE, NO_RESULT, NOT_MET, messages};
use crate::io::inspect::inspect;
use crate::io::log::Limits;

pub use describe::describe;
pub use snippet::snippet;

/// Show what is in MCAP logs, and how a pipeline file would read them.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Examples:
  posegrid inspect controller.mcap tracker.mcap
  posegrid inspect arm_0.mcap arm_1.mcap laser.mcap.zst   (a split recording, a log in zstd)
  posegrid inspect sessions/mon                           (every log in a folder)

Exit codes: 0 every log is sound; 3 some log is damaged, or was cut; 1 some file cannot be read as a log.")]
pub struct InspectArgs {
    /// The logs, or folders with logs
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
}

/// Inspects each log; prints to stdout, errors to stderr. Exit code 0: all sound, 3: some damaged, 1: some unreadable.
pub fn run(args: &InspectArgs, bars: &Bars) -> u8 {
    inspect_all(args, bars).unwrap_or_else(Undelivered::exit_code)
}

/// Inspects the logs until all are done, or the reader of stdout has left.
fn inspect_all(args: &InspectArgs, bars: &Bars) -> Result<u8, Undelivered> {
    let progress = bars.of("inspect");
    let mut found = Vec::new();
    let mut unreadable = false;
    for path in args.logs.iter().flat_map(|path| logs_in(path)) {
        match inspect(&path, Limits::default(), &progress) {
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
    Ok(match (unreadable, damaged) {
        (true, _) => NO_RESULT,
        (false, true) => NOT_MET,
        (false, false) => DONE,
    })
}

/// The logs in a folder, by name; a path that is no folder with logs is itself the log.
fn logs_in(path: &Path) -> Vec<PathBuf> {
    let is_log = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.ends_with(".mcap") || name.ends_with(".mcap.zst")
    };
    let entries = fs::read_dir(path).into_iter().flatten().flatten();
    let mut logs: Vec<_> = entries.map(|entry| entry.path()).filter(is_log).collect();
    logs.sort();
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
        Some((end, _)) => {
            let more = text.len() - end;
            format!("{}… and {more} bytes more", escaped(&text[..end]))
        }
    }
}

/// A name from a file as a TOML string.
fn toml_text(text: &str) -> String {
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
    use super::*;

    #[test]
    fn names_are_harmless_on_a_terminal_and_whole_in_toml() {
        let name = "/a\u{1b}[2J\n\"b\\ü\u{202e}";
        assert!(
            !escaped(name)
                .chars()
                .any(|c| c.is_control() || c == '\u{202e}')
        );
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
        assert_eq!(logs_in(folder.path()), expected);
        let file = folder.path().join("notes.txt");
        assert_eq!(logs_in(&file), std::slice::from_ref(&file));
    }
}
