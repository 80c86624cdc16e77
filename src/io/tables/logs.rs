//! `logs`: the decoded samples of both logs, in parts of one row group each, so that only a few are in memory as rows.
//!
//! Joint samples come first in the table and are by far the most: they are written while the logs are read. All others
//! follow at the end ([`LogTable::finish`]).

use super::PublishError;
use crate::ingest::{CommandSamples, TargetReadings, TemperatureSamples};
use crate::io::lake::{OpenRun, OpenTable, WholeTable};
use crate::io::log::JointSink;
use crate::io::schema;
use crate::io::table::{Columns, ROW_GROUP_ROWS, Table};
use crate::join::JoinInput;
use crate::manifest::RunKey;
use crate::units::Stamp;

/// Columns of positions, orientations and stated covariances.
const POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
const ORIENTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const COVARIANCE: [&str; 6] = [
    "stated_cov_xx_mm2",
    "stated_cov_xy_mm2",
    "stated_cov_xz_mm2",
    "stated_cov_yy_mm2",
    "stated_cov_yz_mm2",
    "stated_cov_zz_mm2",
];

type Rows = std::ops::Range<usize>;

/// A part of the table: some samples of one source.
#[derive(Debug, Clone)]
struct Part {
    source: Source,
    rows: Rows,
}

#[derive(Debug, Clone, Copy)]
enum Source {
    Command,
    Target,
    Temperature,
}

/// The table of one session, being written while its logs are read. Dropped, it leaves nothing.
pub struct LogTable<'r> {
    run: &'r OpenRun<'r>,
    key: RunKey,
    /// Joint samples so far.
    joints: usize,
    /// A part of joint samples: most of its columns are those of the next one too.
    like: Option<Table>,
    table: Result<OpenTable<'r>, PublishError>,
}

impl<'r> LogTable<'r> {
    /// Nothing written yet.
    pub fn new(run: &'r OpenRun<'r>, session: &str) -> Self {
        Self {
            run,
            key: run.key().of_session(session),
            joints: 0,
            like: None,
            table: Ok(OpenTable::new(run)),
        }
    }

    /// Writes all other samples of the session behind the joint samples given before, for [`OpenRun::keep`]; `None` where
    /// there are none at all.
    pub fn finish(self, input: &JoinInput) -> Result<Option<WholeTable>, PublishError> {
        let mut table = self.table?;
        table.append_all(parts(input), |part| rows_of(input, part, &self.key))?;
        Ok(table.finish()?)
    }
}

impl JointSink for LogTable<'_> {
    fn restart(&mut self) {
        *self = Self::new(self.run, &self.key.session);
    }

    /// What is wrong is told at the end.
    fn take(&mut self, stamps_ns: &[i64], angles: &[f64]) {
        let rows = self.joints..self.joints + stamps_ns.len();
        self.joints = rows.end;
        if let Ok(table) = &mut self.table {
            let like = self.like.as_ref().filter(|like| like.rows() == rows.len());
            let stamps_ns = stamps_ns.iter().copied();
            let part = match like {
                Some(like) => more_joint_rows(rows, stamps_ns, angles, like),
                None => joint_rows(rows, stamps_ns, angles, &self.key),
            };
            let appended = part.and_then(|part| {
                table.append(&part)?;
                Ok(part)
            });
            match appended {
                Ok(part) => self.like = Some(part),
                Err(error) => self.table = Err(error),
            }
        }
    }
}

/// The parts of the table behind the joint samples, in the order of its rows.
fn parts(input: &JoinInput) -> Vec<Part> {
    let samples = [
        (Source::Command, input.commands.count()),
        (Source::Target, input.readings.count()),
        (Source::Temperature, input.temperatures.stamps.len()),
    ];
    let of_source = |(source, samples): (Source, usize)| {
        let firsts = (0..samples).step_by(ROW_GROUP_ROWS);
        firsts.map(move |first| Part {
            source,
            rows: first..(first + ROW_GROUP_ROWS).min(samples),
        })
    };
    samples.into_iter().flat_map(of_source).collect()
}

/// One of them.
fn rows_of(
    input: &JoinInput,
    Part { source, rows }: Part,
    key: &RunKey,
) -> Result<Table, PublishError> {
    match source {
        Source::Command => command_rows(&input.commands.read(rows.clone())?, rows, key),
        Source::Target => target_rows(&input.readings.read(rows.clone())?, rows, key),
        Source::Temperature => temperature_rows(&input.temperatures, rows, key),
    }
}

/// What every part has: the run, the source, the sample's number and stamp.
fn columns(
    key: &RunKey,
    source: &str,
    rows: Rows,
    stamps_ns: impl Iterator<Item = i64>,
) -> Result<Columns, PublishError> {
    Ok(Columns::new(schema::find("logs")?, rows.len())
        .key(key)
        .same("source", source)
        .whole_numbers("sample", numbers(&rows))
        .whole_numbers("stamp_ns", stamps_ns.collect()))
}

/// Numbers of samples.
fn numbers(rows: &Rows) -> Vec<i64> {
    let number = |sample: usize| i64::try_from(sample).expect("samples in memory");
    (number(rows.start)..number(rows.end)).collect()
}

fn in_ns<C>(stamps: &[Stamp<C>]) -> impl Iterator<Item = i64> {
    stamps.iter().map(|stamp| stamp.ns())
}

fn command_rows(
    commands: &CommandSamples,
    rows: Rows,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let table = columns(key, "command", rows, in_ns(&commands.stamps))?
        .absent(["joints_rad", "temperature_c"])
        .absent(COVARIANCE);
    let orientations = commands.orientations.as_deref();
    Ok(placed(table, &commands.positions, orientations).finish()?)
}

/// Further joint samples, as many as a part `like` this one has.
fn more_joint_rows(
    rows: Rows,
    stamps_ns: impl Iterator<Item = i64>,
    angles: &[f64],
    like: &Table,
) -> Result<Table, PublishError> {
    let table = Columns::like(like)
        .whole_numbers("sample", numbers(&rows))
        .whole_numbers("stamp_ns", stamps_ns.collect())
        .lists_alike("joints_rad", angles);
    Ok(table.finish()?)
}

/// Stamps and angles (rad, row behind row) of these rows only.
fn joint_rows(
    rows: Rows,
    stamps_ns: impl Iterator<Item = i64>,
    angles: &[f64],
    key: &RunKey,
) -> Result<Table, PublishError> {
    let table = columns(key, "joints", rows, stamps_ns)?
        .lists_alike("joints_rad", angles)
        .absent(POSITION)
        .absent(ORIENTATION)
        .absent(COVARIANCE)
        .absent(["temperature_c"]);
    Ok(table.finish()?)
}

fn target_rows(readings: &TargetReadings, rows: Rows, key: &RunKey) -> Result<Table, PublishError> {
    let TargetReadings {
        stamps,
        positions,
        orientations,
        covariances,
    } = readings;
    let table =
        columns(key, "target", rows, in_ns(stamps))?.absent(["joints_rad", "temperature_c"]);
    let table = match covariances {
        None => table.absent(COVARIANCE),
        Some(covariances) => table.group(COVARIANCE, covariances.iter().copied()),
    };
    Ok(placed(table, positions, orientations.as_deref()).finish()?)
}

fn temperature_rows(
    temperatures: &TemperatureSamples,
    rows: Rows,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let stamps_ns = in_ns(&temperatures.stamps[rows.clone()]);
    let table = columns(key, "temperature", rows.clone(), stamps_ns)?
        .column("temperature_c", temperatures.celsius[rows].iter().copied())
        .absent(["joints_rad"])
        .absent(POSITION)
        .absent(ORIENTATION)
        .absent(COVARIANCE);
    Ok(table.finish()?)
}

fn placed(table: Columns, positions: &[[f64; 3]], orientations: Option<&[[f64; 4]]>) -> Columns {
    let table = table.group(POSITION, positions.iter().copied());
    match orientations {
        None => table.absent(ORIENTATION),
        Some(orientations) => table.group(ORIENTATION, orientations.iter().copied()),
    }
}
