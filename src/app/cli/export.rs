//! `posegrid export TABLE --format …`: a table of a run → a file for controllers and off-line programming. Exit codes:
//! 0 written; 1 nothing could be written; 2 the table cannot be read or is not one of those for the format.

use std::io::Write;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};

use super::folder_given::FolderGiven;
use super::messages::{self, Printable};
use super::progress::Bars;
use super::streams::Undelivered;
use super::{BAD_USAGE, DONE, NO_RESULT};
use crate::at::At;
use crate::files::table;
use crate::files::whole_file::write_whole;
use crate::io::export::corrected_urdf::GivenUrdf;
use crate::io::export::urdf_chain::Ends;
use crate::io::export::{
    ExportError, ExportErrorKind, acceptance, corrected_urdf, nodes_csv, parameters_csv,
    ur_calibration, urdf,
};
use crate::kinematics::Convention;
use crate::page;

/// Write a table of a run in a form that controllers and off-line programming read
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Each format is made from a table of a run:
  csv   from compensation: one row per node, joint angles in degrees; values of the whole table come before them
        in lines that begin with #
  urdf  from calibrations: the identified geometry, in the controller's base, with its flange and tool; or, with --urdf,
        --base and --tip, your own URDF with other origins of the arm's joints and nothing else changed: joint offsets
        are in the origins
  parameters
        from calibrations: the identified parameters as CSV with standard errors, in the robot file's convention or in
        another one (--convention modified-dh)
  ur-calibration
        from calibrations of a Universal Robots arm: the YAML that ur_description takes as kinematics_params, in place of
        the factory calibration that ur_calibration reads from the controller; its hash is not the controller's

  acceptance
        from runs, accuracy, calibrations or compensation of a run in its lake: a report in PDF in the order of ISO 9283, with
        what the standard asks and the session does not have in its first table

A geometry leaves joint curves, gear lines, gravity, drift and the difference of command and reported angle out; each file
says what that costs, and which of base, flange and lengths the stations did not identify. For controllers of KUKA, ABB and Fanuc no form for identified link parameters is published, so that there
is none here: take parameters --convention standard-dh, or corrected commands (posegrid compensate).

Example:
  posegrid export lake/compensation/kr210/monday/0a1b….parquet --format csv --out nodes.csv
  posegrid export lake/calibrations/kr210/monday/0a1b….parquet --format urdf --out kr210-identified.urdf
  posegrid export lake/calibrations/kr210/monday/0a1b….parquet --format urdf --urdf kr210.urdf --base base_link --tip tool0 --out corrected.urdf
  posegrid export lake/runs/kr210/monday/0a1b….parquet --format acceptance --out acceptance.pdf

Exit codes: 0 written; 1 nothing could be written; 2 the table cannot be read, or the format is not made from it.")]
pub struct ExportArgs {
    /// The table: a Parquet file of a run.
    pub table: PathBuf,
    /// Format to write
    #[arg(long, value_enum)]
    pub format: ExportFormat,
    /// Where to write it, a new file; without it, standard output.
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// For parameters: convention to state them in; that of the robot file without it.
    #[arg(long, value_name = "WORD", value_parser = convention)]
    pub convention: Option<Convention>,
    /// For urdf: a URDF of the nominal arm. It comes out again with other origins of the arm's joints, joint offsets
    /// included, and nothing else changed.
    #[arg(long, value_name = "FILE", requires_all = ["base", "tip"])]
    pub urdf: Option<PathBuf>,
    /// The link of --urdf that is the controller's base.
    #[arg(long, value_name = "LINK", requires = "urdf")]
    pub base: Option<String>,
    /// The link of --urdf that is the controller's flange.
    #[arg(long, value_name = "LINK", requires = "urdf")]
    pub tip: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ExportFormat {
    /// The nodes of a compensation table
    Csv,
    /// The identified geometry
    Urdf,
    /// The identified parameters in any convention, with standard errors
    Parameters,
    /// The calibration file of a UR's ROS description
    UrCalibration,
    /// A report for acceptance, as PDF
    Acceptance,
}

fn convention(word: &str) -> Result<Convention, String> {
    let words = Convention::ALL.map(Convention::word).join(", ");
    Convention::of_word(word).ok_or_else(|| format!("no convention of links; one of {words}"))
}

/// A folder in the place of the table, or of the new file.
fn folder(args: &ExportArgs) -> Option<FolderGiven> {
    if let Some(out) = args.out.as_ref().filter(|out| out.is_dir()) {
        return Some(FolderGiven::for_new_file(out, "a new file in it as --out"));
    }
    let path = Some(&args.table).filter(|path| path.is_dir())?;
    Some(FolderGiven::for_table(path, "a file of a table of a run"))
}

/// Runs the command: the result goes to `--out` or standard output, errors to standard error. Gives the exit code.
pub fn main(args: &ExportArgs, bars: &Bars) -> u8 {
    if let Some(folder) = folder(args) {
        tracing::error!("{}", Printable(&folder.to_string()));
        return BAD_USAGE;
    }
    match run(args) {
        Ok(for_stdout) => {
            messages::deliver(&for_stdout, bars).map_or_else(Undelivered::exit_code, |()| DONE)
        }
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            exit_code(&error)
        }
    }
}

/// Writes what the arguments ask for; gives the bytes for standard output, which is all of them where they name no file.
pub fn run(args: &ExportArgs) -> Result<Vec<u8>, ExportError> {
    let taken = args.out.iter().find(|out| out.exists());
    if let Some(out) = taken {
        return Err(ExportErrorKind::Exists.at(out));
    }
    // The whole result is made first: a table that turns out wrong leaves no half of it on a pipe.
    let mut made = Vec::new();
    args.make(&mut made)?;
    let Some(out) = &args.out else { return Ok(made) };
    let written = write_whole(out, |sink| sink.write_all(&made));
    written.map_err(|source| ExportErrorKind::NotWritten(source).at(out))?;
    Ok(Vec::new())
}

impl ExportArgs {
    fn given_urdf(&self) -> Option<GivenUrdf<'_>> {
        let ends = Ends { base: self.base.as_deref()?, tip: self.tip.as_deref()? };
        let path = self.urdf.as_deref()?;
        Some(GivenUrdf { path, ends })
    }

    fn make(&self, sink: &mut Vec<u8>) -> Result<(), ExportError> {
        let path: &Path = &self.table;
        if self.convention.is_some() && self.format != ExportFormat::Parameters {
            return Err(ExportError::NoUseForConvention(self.format.name()));
        }
        if self.urdf.is_some() && self.format != ExportFormat::Urdf {
            return Err(ExportError::NoUseForUrdf(self.format.name()));
        }
        let held = table::head(path)?.table;
        match (self.format, held.as_deref()) {
            (ExportFormat::Csv, Some("compensation")) => nodes_csv::write(path, sink),
            (ExportFormat::Urdf, Some("calibrations")) => match self.given_urdf() {
                None => urdf::write(path, sink).map(told),
                Some(given) => corrected_urdf::write(path, &given, sink).map(told),
            },
            (ExportFormat::Parameters, Some("calibrations")) => {
                parameters_csv::write(path, self.convention, sink).map(told)
            }
            (ExportFormat::UrCalibration, Some("calibrations")) => {
                ur_calibration::write(path, sink).map(told)
            }
            (ExportFormat::Acceptance, Some(table)) if acceptance::TABLES.contains(&table) => {
                let pdf = page::acceptance::pdf(&acceptance::rows(path, table)?);
                let pdf = pdf.map_err(|error| ExportError::Pdf(error.to_string()))?;
                Ok(sink.write_all(&pdf)?)
            }
            (format, other) => Err(ExportErrorKind::OtherTable {
                found: table::in_words(other),
                format: format.name(),
                needs: format.tables(),
            }
            .at(path)),
        }
    }
}

fn told(remarks: Vec<String>) {
    for remark in remarks {
        tracing::info!("{}", Printable(&remark));
    }
}

impl ExportFormat {
    const fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Urdf => "urdf",
            Self::Parameters => "parameters",
            Self::UrCalibration => "ur-calibration",
            Self::Acceptance => "acceptance",
        }
    }

    const fn tables(self) -> &'static str {
        match self {
            Self::Csv => "\"compensation\"",
            Self::Urdf | Self::Parameters | Self::UrCalibration => "\"calibrations\"",
            Self::Acceptance => "\"runs\", \"accuracy\", \"calibrations\" or \"compensation\"",
        }
    }
}

const fn exit_code(error: &ExportError) -> u8 {
    match error {
        ExportError::Write(_)
        | ExportError::At(At { kind: ExportErrorKind::NotWritten(_), .. }) => NO_RESULT,
        _ => BAD_USAGE,
    }
}
