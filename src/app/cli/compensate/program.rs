//! `posegrid compensate` of whole robot programs: the positions that motions use are corrected where they stand, each under the
//! base and tool of its motions.
//!
//! 1. The files of the program are read ([`crate::programs`]), and the cell says how its frames were found; of those that were touched
//!    with an arm it says where the arm stood, and where they really are follows from that (`taught`).
//! 2. Each position becomes a target of the identified arm, and that its command (`solve`).
//! 3. The commands go back into the files; the report names every position that motions use (`report`), and how far the arm leaves the
//!    wanted path between them (`path`).
//!
//! What was replaced is recorded beside the files, and `--undo` gives the originals back from that (`undo`).

mod densify;
mod offsets;
mod path;
mod report;
mod solve;
mod taught;
pub(super) mod undo;
mod write;

use std::collections::BTreeMap;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use thiserror::Error;

use super::CompensateArgs;
use super::error::CompensateCommandError;
use super::record::{Recorded, Recording};
use super::source::Source;
use super::used_with::option;
use crate::at::At;
use crate::cli::messages::{self, Printable};
use crate::cli::progress::Bars;
use crate::compensation::{Corrected, Exception, Target, Term};
use crate::files::input::{self, Bound};
use crate::files::whole_file;
use crate::io::calibrations_table::PublishedArm;
use crate::programs::record::{RECORD, UndoError, digest};
use crate::programs::write::{Command, edits};
use crate::programs::{Asked, Cell, Edit, File, Position, Programs};
use densify::{Densified, Known};
use report::{Outcome, Report};
use solve::Solver;
use write::{record, write, written};

/// Whole programs: .src and .dat of KRL with $config.dat and $machine.dat, .mod, .prg, .sys and .modx of RAPID with MOC.cfg, listings .ls
/// of FANUC, .script of Universal Robots
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "Whole robot programs")]
pub struct ProgramArgs {
    /// More files of the same program, or the folder of a backup
    #[arg(value_name = "PROGRAM")]
    pub more: Vec<PathBuf>,
    /// A TOML file that says how each frame and tool was found: [frames.NAME] found = "surveyed", or `taught_with`, tool and points of one that
    /// was touched with an arm, and its place where no file has it
    #[arg(long, value_name = "FILE")]
    pub cell: Option<PathBuf>,
    /// Where the positions come from: wishes of an off-line system, or taught on the robot
    #[arg(long, value_enum)]
    pub points: Option<Points>,
    /// With --points taught: the file of table calibrations of the arm that they were taught on, as it was then
    #[arg(long, value_name = "FILE")]
    pub taught_on: Option<PathBuf>,
    /// The largest correction, mm; a position that needs more is refused
    #[arg(long, value_name = "MM")]
    pub largest: Option<f64>,
    /// Write further points before straight motions and circles (LIN, `MoveL`, L, movel; CIRC, `MoveC`, C, movec) that leave the wanted path
    /// by more than this between two corrected positions, mm
    #[arg(long, value_name = "MM")]
    pub densify: Option<f64>,
    /// The form of the report on standard output
    #[arg(long, value_enum, default_value_t)]
    pub format: Format,
    /// Give the original programs back, byte for byte, from the folder that corrected ones were written into: with --out alone
    #[arg(long, value_name = "FOLDER", conflicts_with_all = CORRECTS)]
    pub undo: Option<PathBuf>,
}

/// The arguments that are for correcting.
const CORRECTS: [&str; 16] = [
    "table",
    "targets",
    "more",
    "allow",
    "lake",
    "session",
    "by",
    "no_record",
    "no_covariance",
    "UsedWithArgs",
    "cell",
    "points",
    "taught_on",
    "largest",
    "densify",
    "format",
];

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Points {
    /// Wishes of an off-line programming system
    OffLine,
    /// Taught on the robot: they hold its errors already
    Taught,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// Text
    #[default]
    Text,
    /// JSON
    Json,
}

#[derive(Debug, Error)]
pub enum ProgramError {
    #[error(
        "where the positions come from is not stated: give --points off-line for wishes of an off-line system; those that were taught \
             on the robot hold its errors already"
    )]
    NoPoints,
    #[error(
        "positions that were taught on the robot hold its errors already: give --taught-on with table calibrations of the arm that they \
         were taught on, as it was then"
    )]
    NoTaughtOn,
    #[error(
        "--taught-on says on which arm positions were taught, and is for --points taught alone"
    )]
    NotTaught,
    #[error(
        "whole programs are corrected by table calibrations: table compensation states neither the arm nor where its tool sits on the \
             flange, so a program's tools and the turns of its joints cannot be held against it; give calibrations of the same run, or with \
             --lake --by calibrations"
    )]
    Table,
    #[error("--densify is a length in mm, above 0: 0.05 for one")]
    Densify,
    #[error("programs are written into a new folder: give --out FOLDER")]
    NoOut,
    #[error("cannot read {0}")]
    Read(At<std::io::Error>),
    #[error(
        "there is no {RECORD} in {}; give the folder that corrected programs were written into as it was written: the record is in it",
        .0.display()
    )]
    NoRecord(PathBuf),
    #[error("{}: it is no record of a correction: {source}; take the originals from a backup", path.display())]
    Record { path: PathBuf, source: serde_json::Error },
    #[error(transparent)]
    Undo(#[from] UndoError),
    #[error("{}: {source}", path.display())]
    Cell { path: PathBuf, source: toml::de::Error },
    #[error("{}: {problem}", path.display())]
    Place { path: PathBuf, problem: String },
    #[error("{0} is text of sixteen bits a character, which no controller reads; save it as UTF-8")]
    Wide(String),
    #[error("two files are called {0}; give the folder that they stand in")]
    TwoFiles(String),
    #[error(
        "{0} is a data list of KUKA, and no .src is given: which motions use its positions, and in which base with which tool, stands there; \
         give the .src of its module too"
    )]
    OnlyData(String),
    #[error(
        "no file of a program is among those given: .src with its .dat, .mod, .prg, .sys or .modx, a listing .ls of FANUC (a .tp is none), or a \
         .script of Universal Robots (a .urp is none: save the program, and PolyScope writes the .script beside it)"
    )]
    NoProgram,
    #[error("not stated: {}; a program moves a real robot, so state what it is run with, or allow it with {}",
        .0.iter().map(|term| term.name()).collect::<Vec<_>>().join(", "),
        .0.iter().map(|term| option(Exception::Term(*term))).collect::<Vec<_>>().join(" "))]
    NotStated(Vec<Term>),
    #[error("{}: {}", path.display(), whole_file::told(source))]
    Write { path: PathBuf, source: std::io::Error },
}

impl ProgramError {
    pub const fn exit_code(&self) -> u8 {
        if matches!(self, Self::Write { .. }) { 1 } else { 2 }
    }
}

/// Endings of programs that are not read: those whose text stands in a file beside them.
const UNREAD: [&str; 2] = ["tp", "urp"];

impl CompensateArgs {
    /// Whether what is given is a program and not a file of targets.
    pub(super) fn is_of_program(&self) -> bool {
        let is_program = |path: &Path| {
            let file = File { name: path.to_string_lossy().into_owned(), bytes: Vec::new() };
            let ending = file.ending();
            ending == "cfg"
                || UNREAD.contains(&ending.as_str())
                || crate::programs::is_program(&file)
        };
        let folder_of_program = |path: &Path| {
            path.is_dir()
                && !crate::cli::folder_given::files_in(path, DEPTH, &is_program).is_empty()
        };
        let own = &self.targets;
        !self.program.more.is_empty() || is_program(own) || folder_of_program(own)
    }
}

/// Folders below a backup's that are looked into.
const DEPTH: usize = 12;

pub(super) fn main(args: &CompensateArgs, bars: &Bars) -> u8 {
    match run(args) {
        Ok((report, recording, source)) => {
            let mut told = Vec::new();
            match args.program.format {
                Format::Text => told.extend(report.to_string().bytes()),
                Format::Json => told.extend(report.json().bytes()),
            }
            told.push(b'\n');
            if let Err(undelivered) = messages::deliver(&told, bars) {
                return undelivered.exit_code();
            }
            let not_recorded = recording.words().map(str::to_owned);
            for line in source.frame().into_iter().chain([source.measured()]).chain(not_recorded) {
                tracing::info!("{}", Printable(&line));
            }
            report.exit_code()
        }
        Err(error) => {
            tracing::error!("{}", Printable(&error.to_string()));
            error.exit_code()
        }
    }
}

/// Corrects a program and writes it into its new folder.
fn run(args: &CompensateArgs) -> Result<(Report, Recording, Source), CompensateCommandError> {
    let (files, unread) = args.files()?;
    let taught_on = args.taught_on()?;
    if args.program.densify.is_some_and(|limit_mm| !(limit_mm.is_finite() && limit_mm > 0.0)) {
        return Err(ProgramError::Densify.into());
    }
    let out = args.out.clone().ok_or(ProgramError::NoOut)?;
    if out.exists() {
        return Err(CompensateCommandError::Exists(out));
    }
    let named = args.named()?;
    let source = Source::read(&named.path)?;
    args.admit_verdict(&named.path, &source)?;
    let held = args.hold(&source)?;
    let is_allowed = |term: &Term| args.allow.contains(&Exception::Term(*term));
    let not_stated: Vec<Term> =
        held.not_said.into_iter().filter(|term| !is_allowed(term)).collect();
    if !not_stated.is_empty() {
        return Err(ProgramError::NotStated(not_stated).into());
    }
    let Source::Arm(arm) = &source else { return Err(ProgramError::Table.into()) };
    let recorded = Recorded::around(&named.path, &source)?;
    for file in &files {
        recorded.check_digest(Path::new(&file.name), &digest(&file.bytes))?;
    }
    let mut cell = args.cell()?;
    let mut programs = crate::programs::read(files, &cell);
    for own in std::iter::once(&**arm).chain(taught_on.as_deref()) {
        programs.hold(&own.arm.arm);
    }
    let frames = args.true_places(arm, &programs, &mut cell)?;
    let solver = Solver::new(&arm.arm, &args.allow, args.program.largest);
    let asked = asked(&solver, taught_on.as_deref(), &programs, &cell);
    let stated = stated(&programs, &asked, &solver);
    // A position in a touched base may stand where another program was corrected to: touching corrects at its points.
    recorded.check_targets(&args.targets, &stated, stated.len().div_ceil(4))?;
    let Corrections { outcomes, commands, edits, corrected } =
        corrected(&programs, &asked, &solver);
    let known = Known { programs: &programs, asked: &asked, commands: &commands };
    let deviations = solver.deviations(&programs.paths, &asked, &commands);
    let further = args.program.densify;
    let further = further.map(|limit_mm| solver.further(limit_mm, &known, &deviations));
    let edits = changes(&programs, &asked, edits, further.as_deref().unwrap_or_default());
    let turns = solver.turns();
    let mut report = Report::of(&programs, outcomes, deviations, turns, unread, frames);
    report.add(further.unwrap_or_default());
    report.left_by_offsets_mm = solver.left_by_offsets(&known);
    let date = write::today();
    let written = written(&programs, &edits, arm, &date);
    let recording = record(&written, &programs, &corrected, |made| {
        recorded.add(&made, source.by(&[]), args.no_record)
    })?;
    write(written, &out, arm, date)?;
    Ok((report, recording, source))
}

/// The positions as the controller has them now, each named with its line.
fn stated(
    programs: &Programs,
    asked: &[Result<Asked, String>],
    solver: &Solver<'_>,
) -> Vec<Target> {
    let target = |asked: &Asked| {
        let Position { file, line, name, .. } = &programs.positions[asked.position];
        solver.stated(format!("{}: {name}", programs.files[*file].at(*line)), asked)
    };
    asked.iter().flatten().map(target).collect()
}

/// What each position asks of the arm, of positions that were taught what they show of it; or why it is refused.
fn asked(
    solver: &Solver<'_>,
    taught_on: Option<&PublishedArm>,
    programs: &Programs,
    cell: &Cell,
) -> Vec<Result<Asked, String>> {
    let asked = (0..programs.positions.len()).map(|index| programs.ask(index, cell));
    let mut asked: Vec<_> = asked.map(|asked| asked.map_err(|why| why.to_string())).collect();
    let taught_on = taught_on.map(|own| Solver::new(&own.arm, solver.allow, None));
    taught_on.as_ref().unwrap_or(solver).follow(programs, &mut asked);
    if let Some(own) = taught_on {
        let open: Vec<_> = asked.iter().flatten().collect();
        let attained = own.attained(&open);
        for (asked, attained) in asked.iter_mut().filter(|asked| asked.is_ok()).zip(attained) {
            *asked = attained;
        }
    }
    solver.refuse_helpers(&programs.paths, &mut asked);
    asked
}

/// What becomes of each position; of one that is not corrected there is no command.
struct Corrections {
    outcomes: Vec<Outcome>,
    commands: Vec<Option<Command>>,
    edits: Vec<Vec<Edit>>,
    /// The commands of the calibrated tool.
    corrected: Vec<Option<Corrected>>,
}

fn corrected(
    programs: &Programs,
    asked: &[Result<Asked, String>],
    solver: &Solver<'_>,
) -> Corrections {
    let open: Vec<_> = asked.iter().flatten().collect();
    let mut solved = solver.solve(&open).into_iter();
    let mut commands = vec![None; programs.positions.len()];
    let mut corrected = vec![None; programs.positions.len()];
    let mut all = vec![Vec::new(); programs.positions.len()];
    let mut outcome = |(position, asked): (&Position, &Result<Asked, String>)| {
        let asked = asked.as_ref().map_err(Clone::clone)?;
        let done = solved.next().unwrap_or_else(|| Err("it has no command".to_owned()))?;
        let own = edits(position, asked, &done.command);
        all[asked.position] = own.all;
        commands[asked.position] = Some(done.command);
        corrected[asked.position] = Some(done.corrected);
        Ok(Outcome::Corrected { correction_mm: done.correction_mm, crossed: own.crossed })
    };
    let refused = |reason| Outcome::Refused { reason };
    let outcomes = programs.positions.iter().zip(asked);
    let outcomes = outcomes.map(|own| outcome(own).unwrap_or_else(refused)).collect();
    Corrections { outcomes, commands, edits: all, corrected }
}

/// The edits of each file from those of each position; helpers of circles with further points get the commands that these have for them.
fn changes(
    programs: &Programs,
    asked: &[Result<Asked, String>],
    mut of_positions: Vec<Vec<Edit>>,
    further: &[Densified],
) -> Vec<Vec<Edit>> {
    let points = || further.iter().filter_map(|own| own.points.as_ref().ok());
    let mut all = programs.lines(points().map(|own| &own.added));
    for points in points() {
        if let Some((helper, command)) = &points.helper
            && let Ok(asked) = &asked[*helper]
        {
            of_positions[*helper] = edits(&programs.positions[*helper], asked, command).all;
        }
    }
    for (position, own) in programs.positions.iter().zip(of_positions) {
        all[position.file].extend(own);
    }
    all
}

impl CompensateArgs {
    /// The arm that the positions were taught on; `None` for wishes of an off-line system.
    fn taught_on(&self) -> Result<Option<Box<PublishedArm>>, CompensateCommandError> {
        match (self.program.points, &self.program.taught_on) {
            (None, _) => Err(ProgramError::NoPoints.into()),
            (Some(Points::OffLine), None) => Ok(None),
            (Some(Points::OffLine), Some(_)) => Err(ProgramError::NotTaught.into()),
            (Some(Points::Taught), None) => Err(ProgramError::NoTaughtOn.into()),
            (Some(Points::Taught), Some(path)) => self.arm_of(path).map(Some),
        }
    }

    /// The arm of a table besides the one that corrects, whose verdict has to be met or allowed too.
    fn arm_of(&self, path: &Path) -> Result<Box<PublishedArm>, CompensateCommandError> {
        let source = Source::read(path)?;
        self.admit_verdict(path, &source)?;
        match source {
            Source::Arm(arm) => Ok(arm),
            Source::Table(_) => Err(ProgramError::Table.into()),
        }
    }

    fn cell(&self) -> Result<Cell, ProgramError> {
        let Some(path) = &self.program.cell else { return Ok(Cell::default()) };
        let text = read(path)?;
        let text = String::from_utf8_lossy(&text);
        let cell: Cell = toml::from_str(&text)
            .map_err(|source| ProgramError::Cell { path: path.clone(), source })?;
        let problem = cell.check(crate::programs::is_motion).err();
        problem.map_or(Ok(cell), |problem| {
            Err(ProgramError::Place { path: path.clone(), problem: problem.to_string() })
        })
    }

    /// The files of the program by their names in the folder that is written, and those of programs that are not read.
    fn files(&self) -> Result<(Vec<File>, Vec<String>), ProgramError> {
        let mut files = BTreeMap::new();
        let mut unread = Vec::new();
        for path in std::iter::once(&self.targets).chain(&self.program.more) {
            let is_any = |_: &Path| true;
            let (root, found) = if path.is_dir() {
                (path.as_path(), crate::cli::folder_given::files_in(path, DEPTH, &is_any))
            } else {
                (path.parent().unwrap_or(Path::new("")), vec![path.clone()])
            };
            for path in found {
                let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().into_owned();
                let mut file = File { name: name.clone(), bytes: Vec::new() };
                if !crate::programs::is_program(&file) {
                    if UNREAD.contains(&file.ending().as_str()) {
                        unread.push(name);
                    }
                    continue;
                }
                file.bytes = read(&path)?;
                if matches!(file.bytes.as_slice(), [0xff, 0xfe, ..] | [0xfe, 0xff, ..]) {
                    return Err(ProgramError::Wide(name));
                }
                if files.insert(name.clone(), file).is_some() {
                    return Err(ProgramError::TwoFiles(name));
                }
            }
        }
        let files: Vec<File> = files.into_values().collect();
        if files.iter().all(File::is_list) {
            let list = files.iter().find(|file| !file.is_of_system());
            return Err(list.map_or(ProgramError::NoProgram, |list| {
                ProgramError::OnlyData(list.name.clone())
            }));
        }
        Ok((files, unread))
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ProgramError> {
    let wrong = |source| ProgramError::Read(At::new(path.display(), source));
    let mut bytes = Vec::new();
    input::open(path, Bound::TARGETS).map_err(wrong)?.read_to_end(&mut bytes).map_err(wrong)?;
    Ok(bytes)
}
