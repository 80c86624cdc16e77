//! `posegrid compensate TABLE TARGETS`: a table of a run and a file of targets → the commands that attain them. Exit
//! codes: 0 every target has a command and the table meets its tolerance; 3 some target is refused, or the table does
//! not meet its tolerance or was not shown to, and that was allowed; 1 no target has a command, or the result cannot be
//! written; 2 table or targets cannot be read, or the table is not valid for them.

mod error;
mod named;
pub mod program;
mod record;
mod source;
mod summary;
mod used_with;
mod write;

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use clap::builder::ArgPredicate;

use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use crate::compensation::validity::{Held, Outside};
use crate::compensation::{Corrected, Covariances, Exception, Refused, Target, Term};
use crate::io::compensation_table::TableVerdict;
use crate::io::tables::words::CorrectingTable;
use crate::io::targets::{self, Targets};
use error::Result;
pub use error::{CompensateCommandError, CorrectedAlready, WriteCause};
use named::Named;
use record::{Made, Recorded, Recording};
use source::Source;
pub use used_with::{OnOff, UsedWithArgs};

/// Correct a file of targets with a table that a run published
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
TABLE is a file of either table of a run, or with --lake the name of a robot, whose newest session's current run is taken:
  compensation  knows the error at the nodes of a grid, in one tool orientation: for positions
  calibrations  knows the arm: for joint angles, and for poses in any orientation
A table whose run does not meet its tolerance, or was not shown to, is refused: --allow not-met, --allow not-shown. No target is
corrected by more than 1.5 times the largest error that the run's stations had before.

TARGETS is one of
  .csv, .parquet  the column target, then x_mm, y_mm, z_mm and, where known, qx, qy, qz, qw, configuration, tool, in the
                  frame of the controller's commands; or joint angles, q1_rad, q2_rad, … or q1_deg, q2_deg, …, of .parquet
                  the list joints_rad; or both (`posegrid schema targets`); angles a whole turn away from the measured
                  ones are corrected on their turn where the arm's errors repeat
  .json           an array of objects with the same keys, by itself or under the key targets
  .src, .mod, …   a whole robot program of KUKA or ABB: its files, a data list .dat with its .src, or the folder of a backup, with
                  --points and --cell; every byte but the numbers of positions stays; --undo gives the originals of a corrected
                  folder back

The result has the commands, each correction, its covariance and the reason for each refusal
(`posegrid schema corrected_targets`). Where TABLE is in its lake, table corrections there gains a row for the file
written, and a file of commands that it knows is refused, whatever was removed from it. Orientations are
not corrected.

Example: the drilling program of a left wing, as positions and as joint angles
  posegrid compensate lake/compensation/kr210/monday/0a1b….parquet left-wing.csv --out left-wing-corrected.csv
  posegrid compensate lake/calibrations/kr210/monday/0a1b….parquet left-wing-joints.csv --out corrected.csv
  posegrid compensate kr210 left-wing.csv --lake lake --out corrected.csv --tool \"drill 6\" --payload-kg 92.5 --temperature-c 21
Example: a whole program, and its original back
  posegrid compensate kr210 part.src part.dat '$config.dat' '$machine.dat' --lake lake --cell cell.toml --points off-line \\
    --out corrected
  posegrid compensate --undo corrected --out original

Exit codes: 0 every target corrected, by a table that meets its tolerance; 3 some target refused, or the table does not
meet its tolerance and that was allowed; 1 no target corrected, or nothing could be written; 2 the table or the targets cannot
be read, the table does not meet its tolerance, or it is not valid for what the targets will be run with.")]
pub struct CompensateArgs {
    /// The table: a Parquet file of table `compensation` or `calibrations`; with --lake, the name of a robot.
    // With --undo nothing reads it.
    #[arg(default_value_if("undo", ArgPredicate::IsPresent, "-"))]
    pub table: PathBuf,
    /// The targets: a .csv, .parquet or .json file; or a robot program: its files, or the folder of a backup.
    #[arg(default_value_if("undo", ArgPredicate::IsPresent, "-"))]
    pub targets: PathBuf,
    /// Where to write the result: of a program a new folder; of targets a new file of one of these forms; without it, CSV on standard output, or JSON of JSON.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Correct what would be refused for this reason; may be given several times. The result says which each target needed.
    #[arg(long, value_parser = used_with::exception(), value_name = "REASON")]
    pub allow: Vec<Exception>,
    /// The lake in which TABLE is the name of a robot.
    #[arg(long, value_name = "DIR")]
    pub lake: Option<PathBuf>,
    /// With --lake: another session of the robot than its newest.
    #[arg(long, value_name = "NAME", requires = "lake")]
    pub session: Option<String>,
    /// With --lake: which table of the run; without it, calibrations where every target states what that needs.
    #[arg(long, value_parser = used_with::correcting_table(), value_name = "TABLE", requires = "lake")]
    pub by: Option<CorrectingTable>,
    /// Write the result though the lake that TABLE stands in takes no record of it: a file without a record is known as
    /// corrected by its marks alone.
    #[arg(long)]
    pub no_record: bool,
    /// Leave out how uncertain each correction is: by calibrations the commands alone take less than half the time. What such
    /// a file drove is judged without it.
    #[arg(long)]
    pub no_covariance: bool,
    /// Conditions that the targets will be run with: tool, payload, mounting, base, controller, temperature.
    #[command(flatten)]
    pub used_with: UsedWithArgs,
    #[command(flatten)]
    pub program: program::ProgramArgs,
}

#[derive(Debug)]
pub struct Compensated {
    named: Named,
    source: Source,
    held: Held,
    targets: Targets,
    outcomes: Vec<Result<Corrected, Refused>>,
    recording: Recording,
}

pub fn main(args: &CompensateArgs, bars: &Bars) -> u8 {
    if let Some(folder) = &args.program.undo {
        return program::undo::main(folder, args.out.as_deref());
    }
    if args.is_of_program() {
        return program::main(args, bars);
    }
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
pub fn run(args: &CompensateArgs, stdout: impl Write) -> Result<Compensated> {
    let form = args.out_form()?;
    let named = args.named()?;
    let source = Source::read(&named.path)?;
    let mut needed = args.admit_verdict(&named.path, &source)?;
    let held = args.hold(&source)?;
    needed.extend(held.outside.iter().map(|own| Exception::Term(own.term)));
    let recorded = Recorded::around(&named.path, &source)?;
    recorded.check_file(&args.targets)?;
    let targets = targets::read(&args.targets)?;
    recorded.check_targets(&args.targets, &targets.targets, 1)?;
    needed.extend(args.admit_tool(&source, &targets)?);
    let outcomes = args.outcomes(&source, &needed, &targets);
    let joint_names = source.joint_names();
    let by = source.by(&joint_names);
    let result = targets::corrected(&targets.targets, &outcomes, by)?;
    let bytes = write::bytes(&result, form, source.units(&targets));
    let bytes = bytes.map_err(|source| args.not_written(source))?;
    let made = Made {
        form: form.into(),
        bytes: &bytes,
        targets_digest: record::digest(&args.targets)?,
        targets: outcomes.len(),
        corrected: outcomes.iter().flatten().collect(),
    };
    // Where no target has a command, none can be mistaken for a target.
    let is_none = made.corrected.is_empty();
    let recording =
        if is_none { Recording::Done } else { recorded.add(&made, by, args.no_record)? };
    args.write(&bytes, stdout)?;
    Ok(Compensated { named, source, held, targets, outcomes, recording })
}

impl CompensateArgs {
    /// Refuses a table that does not meet its tolerance, or was not shown to; gives the exception where that is allowed.
    fn admit_verdict(&self, path: &Path, source: &Source) -> Result<Vec<Exception>> {
        let needed = match source.verdict() {
            TableVerdict::Met => return Ok(Vec::new()),
            TableVerdict::NotMet => Exception::NotMet,
            TableVerdict::NotShown => Exception::NotShown,
        };
        if self.allow.contains(&needed) {
            return Ok(vec![needed]);
        }
        let (path, run) = (path.to_owned(), source.by(&[]).key.run.clone());
        Err(CompensateCommandError::Verdict { path, what: source.what(), run, needed })
    }

    /// Holds what the targets will be run with against what the table is valid for.
    fn hold(&self, source: &Source) -> Result<Held> {
        let held = source.validity().hold(&self.used_with.used_with());
        let refused = held.outside.iter();
        let refused = refused.filter(|own| !self.allow.contains(&Exception::Term(own.term)));
        let refused: Vec<_> = refused.cloned().collect();
        if refused.is_empty() { Ok(held) } else { Err(CompensateCommandError::Outside(refused)) }
    }

    /// Refuses poses where the run states no tool of the controller; gives the exception where that is allowed.
    fn admit_tool(&self, source: &Source, targets: &Targets) -> Result<Option<Exception>> {
        let is_pose = |target: &Target| target.joints.is_none();
        if !source.validity().tool_is_target || !targets.targets.iter().any(is_pose) {
            return Ok(None);
        }
        let needed = Exception::Term(Term::Tool);
        if self.allow.contains(&needed) {
            return Ok(Some(needed));
        }
        let words = format!(
            "the run knows no tool of the controller and would take their positions for those of its {}; for another point state \
             flange_from_tool in [stations] and run the session again",
            source.reflector()
        );
        Err(CompensateCommandError::Outside(vec![Outside { term: Term::Tool, words }]))
    }

    /// What becomes of each target; the exceptions that all of them need stand at each.
    fn outcomes(
        &self,
        source: &Source,
        needed: &[Exception],
        targets: &Targets,
    ) -> Vec<Result<Corrected, Refused>> {
        let covariances =
            if self.no_covariance { Covariances::Omitted } else { Covariances::Given };
        let mut outcomes = source.compensate(&targets.targets, &self.allow, covariances);
        for done in outcomes.iter_mut().flatten() {
            done.allowed.extend(needed);
            done.allowed.sort_unstable();
            done.allowed.dedup();
        }
        source.name_slips(targets, &self.allow, &mut outcomes);
        outcomes
    }
}

impl Compensated {
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
        self.outcomes.iter().filter_map(|outcome| outcome.as_ref().ok())
    }

    fn refused(&self) -> impl Iterator<Item = &Refused> {
        self.outcomes.iter().filter_map(|outcome| outcome.as_ref().err())
    }
}
