//! `posegrid compensate TABLE TARGETS`: a table of a run and a file of targets → the commands that attain them.
//!
//! Exit codes: 0 every target has a command and the table meets its tolerance; 3 some target is refused, or the table
//! does not meet its tolerance or was not shown to; 1 no target has a command, or the result cannot be written; 2 the
//! table or the targets cannot be read, or the table is not valid for what the targets will be run with.

mod error;
mod record;
mod source;
mod summary;
mod used_with;
mod write;

use std::io::Write;
use std::path::PathBuf;

use clap::Args;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use crate::compensation::validity::Held;
use crate::compensation::{Corrected, Exception, Refused};
use crate::io::compensation_table::TableVerdict;
use crate::io::targets::{self, Targets};
pub use error::{CompensateCommandError, CorrectedAlready, WriteCause};
use record::{Recorded, Recording};
use source::Source;
pub use used_with::{OnOff, UsedWithArgs};
use write::Written;

/// Correct a file of targets with a table that a run published
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
TABLE is a file of either table of a run:
  compensation  knows the error at the nodes of a grid, in one tool orientation: for positions
  calibrations  knows the arm: for joint angles, and for poses in any orientation

TARGETS is one of
  .csv, .parquet  the column target, then x_mm, y_mm, z_mm and, where known, qx, qy, qz, qw, configuration, tool, in the
                  frame of the controller's commands; or joint angles, q1_rad, q2_rad, … or q1_deg, q2_deg, …; or both
                  (`posegrid schema targets`)
  .json           an array of objects with the same keys, by itself or under the key targets
  .dat            a KUKA data list: its POS, E6POS and FRAME values, in the table's frame and for its tool

The result has the commands, each correction, its covariance and the reason for each refusal
(`posegrid schema corrected_targets`). Where TABLE is in its lake, table corrections there gains a row for the file
written, and a file of commands that it knows is refused, whatever was removed from it. A data list keeps all but X, Y
and Z; a refused position becomes a comment; the other columns are in OUT.corrections.csv. Orientations are not corrected.

Example: the drilling program of a left wing, as positions, as joint angles and at a KUKA controller
  posegrid compensate lake/compensation/kr210/monday/0a1b….parquet left-wing.csv --out left-wing-corrected.csv
  posegrid compensate lake/calibrations/kr210/monday/0a1b….parquet left-wing-joints.csv --out corrected.csv
  posegrid compensate lake/calibrations/kr210/monday/0a1b….parquet left_wing.dat --out corrected/left_wing.dat \\
    --tool \"drill 6\" --payload-kg 92.5 --temperature-c 21

Exit codes: 0 every target corrected, by a table that meets its tolerance; 3 some target refused, or the table does not
meet its tolerance; 1 no target corrected, or nothing could be written; 2 the table or the targets cannot be read, or the
table is not valid for what the targets will be run with.")]
pub struct CompensateArgs {
    /// The table: a Parquet file of table `compensation` or `calibrations`.
    pub table: PathBuf,
    /// The targets: a .csv, .parquet, .json or .dat (KUKA) file.
    pub targets: PathBuf,
    /// Where to write the result, a new file of one of these forms; without it, CSV on standard output, or JSON of JSON.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Correct what would be refused for this reason; the result says for which targets it was needed.
    #[arg(long, value_enum, value_name = "REASON")]
    pub allow: Option<Exception>,
    /// Write the result even if the lake that holds TABLE cannot record it: without a record, a file is recognised as
    /// corrected by its marks alone.
    #[arg(long)]
    pub no_record: bool,
    /// Conditions that the targets will be run with: tool, payload, mounting, base, controller, temperature.
    #[command(flatten)]
    pub used_with: UsedWithArgs,
}

/// The outcome of each target, for a person to read.
#[derive(Debug)]
pub struct Compensated {
    source: Source,
    held: Held,
    targets: Targets,
    outcomes: Vec<Result<Corrected, Refused>>,
    recording: Recording,
}

/// Runs the command: the result goes to `--out` or standard output, everything else to standard error. Gives the exit code.
pub fn main(args: &CompensateArgs, bars: &Bars) -> u8 {
    // The whole result is made first: an error leaves no half of it on a pipe.
    let mut for_stdout = Vec::new();
    match run(args, &mut for_stdout) {
        Ok(compensated) => report(&compensated, &for_stdout, bars),
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            error.exit_code()
        }
    }
}

fn report(compensated: &Compensated, for_stdout: &[u8], bars: &Bars) -> u8 {
    // Refusals are reported even where the reader of the result has left.
    if let Err(refused @ Undelivered::Refused) = messages::deliver(for_stdout, bars) {
        return refused.exit_code();
    }
    for line in compensated.to_string().lines() {
        tracing::info!("{}", Printable(line));
    }
    compensated.exit_code()
}

/// Corrects the targets and writes the result, to `stdout` where the arguments name no file.
pub fn run(
    args: &CompensateArgs,
    stdout: impl Write,
) -> Result<Compensated, CompensateCommandError> {
    let form = args.out_form()?;
    let source = Source::read(&args.table)?;
    let held = args.hold(&source)?;
    let recorded = Recorded::around(&args.table, &source)?;
    recorded.check_file(&args.targets)?;
    let mut targets = targets::read(&args.targets)?;
    recorded.check_targets(&args.targets, &targets.targets)?;
    source.name_configurations(&mut targets)?;
    let outcomes = args.outcomes(&source, &held, &targets);
    let joint_names = source.joint_names();
    let by = source.by(&joint_names);
    let result = targets::corrected(&targets.targets, &outcomes, by)?;
    let written = Written {
        result: &result,
        targets: &targets,
        outcomes: &outcomes,
        table_id: by.table_id,
    };
    let bytes = written
        .bytes(form)
        .map_err(|source| args.not_written(source))?;
    let recording = recorded.add(args, form, &bytes, &outcomes, by)?;
    args.write(&written, &bytes, form, stdout)?;
    Ok(Compensated {
        source,
        held,
        targets,
        outcomes,
        recording,
    })
}

impl CompensateArgs {
    /// Compares the conditions that the targets will be run with and those that the table is valid for.
    fn hold(&self, source: &Source) -> Result<Held, CompensateCommandError> {
        let held = source.validity().hold(&self.used_with.used_with());
        let refused = held.outside.iter();
        let refused = refused.filter(|outside| Some(Exception::Term(outside.term)) != self.allow);
        let refused: Vec<_> = refused.cloned().collect();
        if refused.is_empty() {
            return Ok(held);
        }
        Err(CompensateCommandError::Outside(refused))
    }

    /// The outcome of each target; an exception that all of them need is stated at each.
    fn outcomes(
        &self,
        source: &Source,
        held: &Held,
        targets: &Targets,
    ) -> Vec<Result<Corrected, Refused>> {
        let mut outcomes = source.compensate(&targets.targets, self.allow);
        if let Some(outside) = held.outside.first() {
            let exception = Some(Exception::Term(outside.term));
            let done = outcomes.iter_mut().flatten();
            done.for_each(|done| done.allowed = exception);
        }
        outcomes
    }
}

impl Compensated {
    /// The exit code of the command.
    pub fn exit_code(&self) -> u8 {
        if self.corrected().next().is_none() {
            1
        } else if self.refused().next().is_some() || self.source.verdict() != TableVerdict::Met {
            3
        } else {
            0
        }
    }

    fn corrected(&self) -> impl Iterator<Item = &Corrected> {
        self.outcomes
            .iter()
            .filter_map(|outcome| outcome.as_ref().ok())
    }

    fn refused(&self) -> impl Iterator<Item = &Refused> {
        self.outcomes
            .iter()
            .filter_map(|outcome| outcome.as_ref().err())
    }
}
