//! What shells and `man` read: the completion script of a shell, and a page for each command, made of the same arguments.

use std::fs;
use std::io;
use std::path::PathBuf;

use clap::Args;
use clap_complete::Shell;

/// Print the script by which a shell completes commands and flags
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  posegrid completions bash > ~/.local/share/bash-completion/completions/posegrid")]
pub struct CompletionsArgs {
    /// The shell
    pub shell: Shell,
}

/// Write a manual page for each command
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  posegrid man ~/.local/share/man/man1 && man posegrid-run")]
pub struct ManArgs {
    /// The folder for the pages, made where it is not there
    pub folder: PathBuf,
}

pub fn completions(args: &CompletionsArgs, mut program: clap::Command) -> String {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut program, "posegrid", &mut script);
    String::from_utf8_lossy(&script).into_owned()
}

/// The pages' paths, a line each.
pub fn man(args: &ManArgs, program: clap::Command) -> Result<String, String> {
    let at = |error: io::Error| format!("{}: {error}", args.folder.display());
    fs::create_dir_all(&args.folder).map_err(at)?;
    clap_mangen::generate_to(program.disable_help_subcommand(true), &args.folder).map_err(at)?;
    let files = fs::read_dir(&args.folder).map_err(at)?.flatten();
    let own = files.filter(|file| file.file_name().to_string_lossy().starts_with("posegrid"));
    let mut pages: Vec<String> = own.map(|page| format!("{}\n", page.path().display())).collect();
    pages.sort();
    Ok(pages.concat())
}
