//! `posegrid compensate TABLE TARGETS`: what a run published and a file of targets → the commands that attain them.
//!
//! Exit codes: 0 every target has a command and the table meets its tolerance; 3 some target is refused, or the table
//! does not meet its tolerance or was not shown to; 1 no target has a command, or the result cannot be written; 2 the
//! table or the targets cannot be read.

mod source;

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Args, ValueEnum};
use parquet::errors::ParquetError;
use thiserror::Error;

use super::messages::Printable;
use crate::compensation::{Corrected, Exception, Refused, Validity};
use crate::ingest::AngleUnit;
use crate::io::calibrations_table::CalibrationsTableError;
use crate::io::compensation_table::{CompensationTableError, TableVerdict};
use crate::io::table::{self, FileError, Table, TableError};
use crate::io::targets::{self, Form, Targets, TargetsError};
use crate::io::whole_file::write_whole;
use source::Source;

/// Correct a file of targets by what a run published
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
TABLE is a file of either table of a run:
  compensation  knows the error at the nodes of a grid, in one tool orientation: for positions
  calibrations  knows the arm: for joint angles, and for poses in any orientation

TARGETS has the column target, then x_mm, y_mm, z_mm and, where known, qx, qy, qz, qw, configuration, tool, in the
frame of the controller's commands; or joint angles, q1_rad, q2_rad, … or q1_deg, q2_deg, …; or both
(`posegrid schema targets`). The result has the same columns with what to command, and each correction, its covariance
and the reason for each refusal (`posegrid schema corrected_targets`). Orientations are commanded as they are.

Example: the drilling program of a left wing, as positions and as joint angles
  posegrid compensate lake/compensation/kr210/monday/0a1b….parquet left-wing.csv --out left-wing-corrected.csv
  posegrid compensate lake/calibrations/kr210/monday/0a1b….parquet left-wing-joints.csv --out corrected.csv

Exit codes: 0 every target corrected, by a table that meets its tolerance; 3 some target refused, or the table does not
meet its tolerance; 1 no target corrected, or nothing could be written; 2 the table or the targets cannot be read.")]
pub struct CompensateArgs {
    /// The table: a Parquet file of table `compensation` or `calibrations`.
    pub table: PathBuf,
    /// The targets: a .csv or .parquet file.
    pub targets: PathBuf,
    /// Where to write the result, a new .csv or .parquet file; without it, CSV on standard output.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Correct what would be refused for this reason; the result says for which targets it was needed.
    #[arg(long, value_enum, value_name = "REASON")]
    pub allow: Option<Allow>,
}

/// Reasons for refusal that can be allowed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Allow {
    /// Joint angles beyond those measured, where the model falls back to its prior
    JointRange,
}

impl Allow {
    const fn exception(self) -> Exception {
        match self {
            Self::JointRange => Exception::JointRange,
        }
    }
}

/// Why no target was corrected.
#[derive(Debug, Error)]
pub enum CompensateCommandError {
    /// The file holds no table.
    #[error(transparent)]
    File(#[from] FileError),
    /// The file holds a table that corrects nothing.
    #[error(
        "{} holds {found}; targets are corrected by table \"compensation\" or \"calibrations\" of a run",
        path.display()
    )]
    OtherTable {
        /// The file.
        path: PathBuf,
        /// What it holds.
        found: String,
    },
    /// The table of nodes cannot be read.
    #[error(transparent)]
    Table(#[from] CompensationTableError),
    /// The identified arm cannot be read.
    #[error(transparent)]
    Arm(#[from] CalibrationsTableError),
    /// The targets cannot be read, or the result is to have a form that is not known.
    #[error(transparent)]
    Targets(#[from] TargetsError),
    /// Something stands where the result is to be.
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
    /// The result is no table.
    #[error(transparent)]
    Result(#[from] TableError),
    /// The result cannot be written.
    #[error("{}: {source}; check the space and the permissions of the folder", path.as_deref().map_or_else(|| "standard output".into(), Path::to_string_lossy))]
    Write {
        /// The file; `None` for standard output.
        path: Option<PathBuf>,
        /// Why.
        source: WriteCause,
    },
}

/// Why a result was not written.
#[derive(Debug, Error)]
pub enum WriteCause {
    /// The folder or the disk refused.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// As CSV.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// As Parquet.
    #[error(transparent)]
    Parquet(#[from] ParquetError),
}

/// What became of the targets, for a person to read.
#[derive(Debug)]
pub struct Compensated {
    source: Source,
    targets: Targets,
    outcomes: Vec<Result<Corrected, Refused>>,
}

/// Runs the command: the result goes to `--out` or standard output, everything else to standard error.
pub fn main(args: &CompensateArgs) -> ExitCode {
    match run(args, io::stdout().lock()) {
        Ok(compensated) => {
            for line in compensated.to_string().lines() {
                tracing::info!("{}", Printable(line));
            }
            ExitCode::from(compensated.exit_code())
        }
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            ExitCode::from(error.exit_code())
        }
    }
}

/// Corrects the targets and writes the result, to `stdout` where the arguments name no file.
pub fn run(
    args: &CompensateArgs,
    stdout: impl Write,
) -> Result<Compensated, CompensateCommandError> {
    let form = args.out_form()?;
    let source = Source::read(&args.table)?;
    let targets = targets::read(&args.targets)?;
    let outcomes = source.compensate(&targets.targets, args.allow.map(Allow::exception));
    let joint_names = source.joint_names();
    let result = targets::corrected(&targets.targets, &outcomes, source.by(&joint_names))?;
    args.write(&result, form, targets.angle_unit, stdout)
        .map_err(|source| CompensateCommandError::Write {
            path: args.out.clone(),
            source,
        })?;
    Ok(Compensated {
        source,
        targets,
        outcomes,
    })
}

impl CompensateArgs {
    /// The form of the result, known before anything is read.
    fn out_form(&self) -> Result<Form, CompensateCommandError> {
        let Some(out) = &self.out else {
            return Ok(Form::Csv);
        };
        if out.exists() {
            return Err(CompensateCommandError::Exists(out.clone()));
        }
        Ok(Form::of(out)?)
    }

    fn write(
        &self,
        result: &Table,
        form: Form,
        unit: AngleUnit,
        stdout: impl Write,
    ) -> Result<(), WriteCause> {
        let Some(out) = &self.out else {
            let written = write_form(result, form, unit, stdout);
            // A reader that has gone away wants no more of it.
            return written.or_else(|cause| {
                if cause.is_broken_pipe() {
                    Ok(())
                } else {
                    Err(cause)
                }
            });
        };
        write_whole(out, |sink| write_form(result, form, unit, sink))
    }
}

fn write_form(
    result: &Table,
    form: Form,
    unit: AngleUnit,
    mut sink: impl Write,
) -> Result<(), WriteCause> {
    match form {
        Form::Csv => Ok(targets::write_csv(result, unit, sink)?),
        Form::Parquet => {
            let bytes = table::write(result, Vec::new())?;
            Ok(sink.write_all(&bytes)?)
        }
    }
}

impl WriteCause {
    fn is_broken_pipe(&self) -> bool {
        let io = match self {
            Self::Io(error) => Some(error),
            Self::Csv(error) => match error.kind() {
                csv::ErrorKind::Io(error) => Some(error),
                _ => None,
            },
            Self::Parquet(_) => None,
        };
        io.is_some_and(|error| error.kind() == io::ErrorKind::BrokenPipe)
    }
}

impl CompensateCommandError {
    /// The exit code of the command.
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::File(_)
            | Self::OtherTable { .. }
            | Self::Table(_)
            | Self::Arm(_)
            | Self::Targets(_)
            | Self::Exists(_) => 2,
            Self::Result(_) | Self::Write { .. } => 1,
        }
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

    fn write_warnings(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for warning in self.source.warnings(&self.targets.targets) {
            writeln!(f, "{warning}")?;
        }
        let allowed = self
            .corrected()
            .filter(|done| done.allowed.is_some())
            .count();
        if allowed > 0 {
            writeln!(
                f,
                "{allowed} targets were corrected by an exception allowed, see column allowed"
            )?;
        }
        if !self.targets.unused.is_empty() {
            writeln!(
                f,
                "columns without effect on a correction: {}",
                self.targets.unused.join(", ")
            )?;
        }
        Ok(())
    }
}

/// The table, what was done, what was not, each refusal in a line of its own up to this many.
const REFUSALS_SHOWN: usize = 20;

impl fmt::Display for Compensated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let by = self.source.by(&[]);
        writeln!(
            f,
            "{} {:?} of robot {:?}, session {:?}; {}",
            self.source.what(),
            by.table_id,
            by.key.robot,
            by.key.session,
            valid_for(self.source.validity())
        )?;
        self.write_warnings(f)?;
        for refused in self.refused().take(REFUSALS_SHOWN) {
            writeln!(f, "{refused}")?;
        }
        let mut reasons = BTreeMap::<&str, usize>::new();
        self.refused()
            .for_each(|refused| *reasons.entry(refused.reason.name()).or_default() += 1);
        let counted: Vec<String> = reasons
            .iter()
            .map(|(reason, count)| format!("{count} {reason}"))
            .collect();
        let refusals = if counted.is_empty() {
            "none".to_owned()
        } else {
            counted.join(", ")
        };
        write!(
            f,
            "{} targets: {} corrected, refused: {refusals}",
            self.outcomes.len(),
            self.corrected().count()
        )?;
        let largest = self
            .corrected()
            .map(|corrected| corrected.correction.norm())
            .fold(0.0, f64::max);
        write!(f, "; largest correction {largest:.3} mm")
    }
}

fn valid_for(validity: &Validity) -> String {
    let parts = [
        validity.tool.as_ref().map(|tool| format!("tool {tool:?}")),
        validity.payload_kg.map(|kg| format!("payload {kg} kg")),
        validity
            .mounting
            .as_ref()
            .map(|mounting| format!("mounting {mounting:?}")),
        validity.base.as_ref().map(|base| format!("base {base:?}")),
        validity
            .controller_model
            .as_ref()
            .map(|model| format!("controller {model:?}")),
        validity
            .absolute_accuracy_option
            .map(|on| format!("absolute-accuracy option {}", if on { "on" } else { "off" })),
        validity
            .temperature_c
            .map(|[low, high]| format!("{low:.1} to {high:.1} °C")),
    ];
    let stated: Vec<String> = parts.into_iter().flatten().collect();
    if stated.is_empty() {
        "it does not say what it is valid for: see to it that tool, payload and base are those of the session".to_owned()
    } else {
        format!("valid for {}", stated.join(", "))
    }
}
