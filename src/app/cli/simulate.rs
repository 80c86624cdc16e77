//! `posegrid simulate`: a synthetic session with known truth, as MCAP: `controller.mcap`, `tracker.mcap`, `truth.json`
//! and `truth_stations.csv` in a folder. The same flags give the same bytes.

use std::collections::BTreeMap;
use std::fmt;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use nalgebra::{Point3, Unit, Vector3};
use thiserror::Error;

use super::robot::ArmFlags;
use crate::at::At;
use crate::files::whole_file::{told, write_whole};
use crate::ingest::{Recording, StandsOn, TargetReadings};
use crate::io::log_writer::{LogWriteError, TrackerLog, write_controller_log};
use crate::io::robot::{self, Selection};
use crate::io::station_table::{self, LengthColumn};
use crate::io::targets::{self, TargetsError};
use crate::kinematics::Arm;
use crate::pipeline::robot_file::{self, NoRobotFile};
use crate::simulate::{
    LengthInstrument, LengthTruth, SimulateError, SimulateSettings, Simulated, simulate,
};

mod flags;
mod instrument;

use flags::{ErrorFlags, PoseFlags, five, triple};
use instrument::InstrumentFlags;

/// Make a synthetic session with known truth, as the two MCAP logs of a cell.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example: a KR 210 measured on a uniform grid of 120 mm
  posegrid simulate pipelines/robots/kr210-r2700-extra.toml --out kr210 --seed 1 \\
    --home 0,-75,100,25,55,-15 --size 720,1440,720 --grid-step 120

Example: the same arm in another session, driven by commands that a table corrected
  posegrid simulate pipelines/robots/kr210-r2700-extra.toml --out tuesday --arm 1 --seed 2 \\
    --home 0,-75,100,25,55,-15 --poses corrected.csv

Example: three reflectors, in a table of stations
  posegrid simulate pipelines/robots/kr210-r2700-extra.toml --out three --seed 3 \\
    --home 0,-75,100,25,55,-15 --random-joints 200 --table --beside 120,0,0 --beside 0,120,0")]
pub struct SimulateArgs {
    /// Nominal arm: a robot file, or a URDF
    pub robot: PathBuf,
    #[command(flatten)]
    arm_in_file: ArmFlags,
    /// Folder for the logs and the truth; made where it is missing.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Key of all random numbers: the same seed gives the same session.
    #[arg(long, default_value_t = 0)]
    pub seed: u64,
    /// Key of the arm's errors, instead of --seed: another session of the arm that --seed N made has --arm N
    #[arg(long, value_name = "SEED")]
    pub arm: Option<u64>,
    /// Name of the session in the logs.
    #[arg(long, default_value = "simulated")]
    pub session: String,
    /// Id of the sampling plan that the session follows, for its logs
    #[arg(long, value_name = "ID")]
    pub plan: Option<String>,
    /// Name of the robot in the logs; the robot file's name where it is missing.
    #[arg(long)]
    pub robot_name: Option<String>,
    /// Write a table of the stations too, stations.csv, as a perfect join would find them; its head has the section that reads it
    #[arg(long)]
    table: bool,
    #[command(flatten)]
    reflectors: ReflectorFlags,
    /// An instrument in logs and table that reads distances of the reflector from an anchor: its place in the base's frame and the reading
    /// at no distance, mm, and the standard deviation, mm; may be given several times
    #[arg(long, value_name = "X,Y,Z,OFFSET,SD", value_parser = five, allow_hyphen_values = true)]
    distance_from: Vec<[f64; 5]>,
    /// An instrument in logs and table that reads heights of the reflector above a plane: its normal in the base's frame, its distance from
    /// the base's origin and the standard deviation, mm; may be given several times
    #[arg(long, value_name = "NX,NY,NZ,HEIGHT,SD", value_parser = five, allow_hyphen_values = true)]
    height_above: Vec<[f64; 5]>,
    /// A reference reflector on the robot's base in logs and table, read at each station, at this place in the base's frame, mm: it moves
    /// with the base, as --base-drift-mm and --bump-mm have it; may be given several times
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    reference: Vec<[f64; 3]>,
    /// A reference reflector on the floor in logs and table, likewise, at this place in the base's frame at the session's start, mm: the
    /// tracker sees it move as --tracker-drift-mm and --tracker-bump-mm have it move itself; may be given several times
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    floor_reference: Vec<[f64; 3]>,
    #[command(flatten)]
    poses: PoseFlags,
    #[command(flatten)]
    instrument: InstrumentFlags,
    #[command(flatten)]
    errors: ErrorFlags,
}

/// Several reflectors at the flange, and how they are measured.
#[derive(Debug, Clone, Args)]
struct ReflectorFlags {
    /// A further reflector in logs and table, at this place in the frame of the measured one, mm; may be given several times
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    beside: Vec<[f64; 3]>,
    /// Measure the reflectors one after another in each dwell, in an order that changes from dwell to dwell, instead of all at once
    #[arg(long, requires = "beside")]
    in_turn: bool,
}

#[derive(Debug, Error)]
pub enum SimulateCommandError {
    #[error(transparent)]
    File(#[from] At<SimulateFileError>),
    #[error(transparent)]
    NoRobot(#[from] Box<At<NoRobotFile>>),
    #[error(transparent)]
    Simulate(#[from] SimulateError),
    #[error(transparent)]
    Poses(#[from] TargetsError),
    #[error("{} exists already; choose another --out, or remove it first", .0.display())]
    Exists(PathBuf),
}

#[derive(Debug, Error)]
pub enum SimulateFileError {
    #[error("{0}; give the path of a robot file, for example pipelines/robots/ur10.toml")]
    Read(io::Error),
    #[error(
        "target {target:?} has no joint angles; give q1_deg, q2_deg, …, as `posegrid plan --out` writes them"
    )]
    NoJoints { target: String },
    #[error("{told}", told = told(.0))]
    Write(#[from] io::Error),
    #[error(transparent)]
    Log(#[from] LogWriteError),
    #[error("{0}")]
    Json(#[from] serde_json::Error),
}

#[derive(Debug, Clone)]
pub struct SimulatedSession {
    pub out: PathBuf,
    pub simulated: Simulated,
    pub table: bool,
}

impl fmt::Display for SimulatedSession {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let truth = &self.simulated.truth;
        let error = truth.raw_error_mm;
        writeln!(
            f,
            "{} stations of a {} ({} {}), {} readings ({} outliers)",
            truth.stations_visited,
            truth.model,
            truth.stations_lost,
            if truth.settings.instrument.is_tracker() { "missed by the beam" } else { "not seen" },
            truth.readings.seen,
            truth.readings.outliers
        )?;
        writeln!(
            f,
            "attained minus commanded: mean {:.3} mm, rms {:.3} mm, largest {:.3} mm",
            error.mean, error.rms, error.max
        )?;
        let table = self.table.then_some(TABLE);
        let files: Vec<&str> = FILES.into_iter().chain(table).collect();
        write!(f, "written to {}: {}", self.out.display(), files.join(", "))
    }
}

const FILES: [&str; 4] = ["controller.mcap", "tracker.mcap", "truth.json", "truth_stations.csv"];

/// The table of stations, where one is asked for.
const TABLE: &str = "stations.csv";

pub fn run(args: &SimulateArgs) -> Result<SimulatedSession, SimulateCommandError> {
    let arm = read_arm(&args.robot, &args.arm_in_file.selection())?;
    let listed = args.poses.poses.as_deref().map(listed).transpose()?;
    let settings = args.settings(&arm, listed.as_deref())?;
    let table = args.table.then_some(TABLE);
    if let Some(path) =
        FILES.into_iter().chain(table).map(|file| args.out.join(file)).find(|path| path.exists())
    {
        return Err(SimulateCommandError::Exists(path));
    }
    let simulated = simulate(&arm, &settings)?;
    fs::create_dir_all(&args.out)
        .map_err(|source| At::new(args.out.display(), SimulateFileError::Write(source)))?;
    args.write(&arm, &simulated)?;
    Ok(SimulatedSession { out: args.out.clone(), simulated, table: args.table })
}

/// Joint angles of every target of a file, or of every command of a corrected one.
fn listed(path: &Path) -> Result<Vec<Vec<f64>>, SimulateCommandError> {
    let joints = targets::commands(path)?.into_iter().map(|(target, joints)| {
        let joints = joints.map(|joints| joints.angles);
        joints.ok_or_else(|| At::new(path.display(), SimulateFileError::NoJoints { target }).into())
    });
    joints.collect()
}

fn read_arm(path: &Path, selection: &Selection) -> Result<Arm, SimulateCommandError> {
    let text = robot::text(path)
        .map_err(|source| At::new(path.display(), SimulateFileError::Read(source)))?;
    Ok(robot_file::arm(path, &text, selection)?)
}

impl SimulateArgs {
    fn settings(
        &self,
        arm: &Arm,
        listed: Option<&[Vec<f64>]>,
    ) -> Result<SimulateSettings, SimulateError> {
        let home = self.poses.home(arm)?;
        let places = |cell: &_| self.poses.places(arm, cell, listed);
        let mut settings = self.errors.settings(self.seed, home, places)?;
        self.instrument.change(&mut settings);
        Ok(SimulateSettings { arm_seed: self.arm, ..settings })
    }

    fn write(&self, arm: &Arm, simulated: &Simulated) -> Result<(), SimulateCommandError> {
        let names: Vec<&str> = arm.joints().iter().map(|joint| joint.name.as_str()).collect();
        let Simulated { recording, truth } = simulated;
        let session = self.session_record(arm, truth.settings.instrument.name());
        let [controller, tracker, json, stations] = FILES.map(|file| self.out.join(file));
        written(&controller, |sink| {
            let logged = logged(arm, recording);
            Ok(write_controller_log(sink, &logged, &names, &session)?)
        })?;
        let targets =
            if self.reflectors.beside.is_empty() { Vec::new() } else { self.readings(simulated) };
        let log = TrackerLog {
            readings: &recording.readings,
            targets: &named("T", targets),
            references: &self.named_references(simulated),
            temperatures: &recording.temperatures,
            lengths: &named("L", simulated.length_samples(&self.instruments())),
        };
        written(&tracker, |sink| Ok(log.write(sink, &session)?))?;
        written(&json, |sink| Ok(sink.write_all(truth.json()?.as_bytes())?))?;
        written(&stations, |sink| Ok(sink.write_all(truth.stations_csv(&names).as_bytes())?))?;
        if self.table {
            let text = self.stations_table(arm, simulated);
            written(&self.out.join(TABLE), |sink| Ok(sink.write_all(text.as_bytes())?))?;
        }
        Ok(())
    }

    /// Readings of the reflectors: all at once, or one after another.
    fn readings(&self, simulated: &Simulated) -> Vec<TargetReadings> {
        let beside = self.places_beside();
        if self.reflectors.in_turn {
            simulated.readings_in_turn(&beside)
        } else {
            simulated.readings_with(&beside)
        }
    }

    /// The table of the stations, with a reading of each reflector.
    fn stations_table(&self, arm: &Arm, simulated: &Simulated) -> String {
        let instruments = self.instruments();
        let length = |(name, own): (String, &LengthInstrument)| LengthColumn {
            name,
            reads: own.truth.reads(),
            sd_mm: own.sd_mm,
        };
        let lengths = named("L", instruments.iter().collect()).into_iter().map(length);
        let lengths: Vec<LengthColumn> = lengths.collect();
        let mut stations = simulated.stations_with(&self.places_beside());
        simulated.add_lengths(&mut stations, &instruments);
        let targets = (1..=self.reflectors.beside.len() + 1).map(|number| format!("T{number}"));
        let (names, places): (Vec<_>, Vec<_>) = self.references().unzip();
        let read = station_table::Read {
            targets: &targets.collect::<Vec<_>>(),
            lengths: &lengths,
            references: &names,
            looks: &simulated.references(&places),
        };
        station_table::csv(&stations, arm, read)
    }

    /// The places of the further reflectors, mm.
    fn places_beside(&self) -> Vec<Vector3<f64>> {
        self.reflectors.beside.iter().copied().map(Vector3::from).collect()
    }

    /// The references, those on the base first: names (B1 and so on, F1 and so on), and places in the base's frame at the start, mm; each
    /// with what it stands on.
    fn references(&self) -> impl Iterator<Item = ((String, StandsOn), (StandsOn, Point3<f64>))> {
        let on_base = ("B", StandsOn::Base, &self.reference);
        let on_floor = ("F", StandsOn::Floor, &self.floor_reference);
        [on_base, on_floor].into_iter().flat_map(|(letter, on, places)| {
            let named = named(letter, places.clone()).into_iter();
            named.map(move |(name, at)| ((name, on), (on, Point3::from(at))))
        })
    }

    fn named_references(&self, simulated: &Simulated) -> Vec<(String, TargetReadings)> {
        let (names, places): (Vec<_>, Vec<_>) = self.references().unzip();
        let readings = simulated.reference_readings(&places);
        names.into_iter().map(|(name, _)| name).zip(readings).collect()
    }

    /// The instruments of one length: distances first.
    fn instruments(&self) -> Vec<LengthInstrument> {
        let distance = |&[x, y, z, offset_mm, sd_mm]: &[f64; 5]| LengthInstrument {
            truth: LengthTruth::Distance { anchor: Point3::new(x, y, z), offset_mm },
            sd_mm,
        };
        let height = |&[x, y, z, height_mm, sd_mm]: &[f64; 5]| LengthInstrument {
            truth: LengthTruth::Height {
                normal: Unit::try_new(Vector3::new(x, y, z), 0.0).unwrap_or_else(Vector3::z_axis),
                height_mm,
            },
            sd_mm,
        };
        let distances = self.distance_from.iter().map(distance);
        distances.chain(self.height_above.iter().map(height)).collect()
    }

    fn source(&self) -> String {
        let arm = self.arm.map(|arm| format!(" --arm {arm}"));
        format!("posegrid simulate --seed {}{}", self.seed, arm.unwrap_or_default())
    }

    /// The metadata record that names robot, model and session.
    fn session_record(&self, arm: &Arm, instrument: &str) -> BTreeMap<String, String> {
        let stem = self.robot.file_stem().unwrap_or_default().to_string_lossy();
        let robot = self.robot_name.clone().unwrap_or_else(|| stem.into_owned());
        let pairs = [
            ("robot", robot),
            ("model", arm.model().to_owned()),
            ("session", self.session.clone()),
            ("tracker", format!("simulated {instrument}")),
            ("length_unit", "m".to_owned()),
            ("source", self.source()),
        ];
        let plan = self.plan.clone().map(|plan| ("plan", plan));
        pairs.into_iter().chain(plan).map(|(key, value)| (key.to_owned(), value)).collect()
    }
}

/// Readings with names: a letter and their number from 1.
fn named<T>(letter: &str, readings: Vec<T>) -> Vec<(String, T)> {
    let numbered = (1..).zip(readings);
    numbered.map(|(number, own): (usize, _)| (format!("{letter}{number}"), own)).collect()
}

/// The recording with positions of joints that slide in m, the unit of ROS.
fn logged(arm: &Arm, recording: &Recording) -> Recording {
    let mut logged = recording.clone();
    let angles = &mut logged.joints.angles;
    for row in 0..angles.len() {
        let values = angles.row_mut(row).iter_mut().zip(arm.joints());
        values.for_each(|(value, joint)| *value /= joint.per_radian());
    }
    logged
}

fn written(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), SimulateFileError>,
) -> Result<(), SimulateCommandError> {
    write_whole(path, write).map_err(|source| At::new(path.display(), source).into())
}
