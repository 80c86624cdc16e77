//! `logs`: the decoded samples of both logs, in parts of one row group each, so that only a few are in memory as rows.
//!
//! Joint samples come first in the table and are by far the most: they are written while the logs are read. All others
//! follow at the end ([`LogTable::finish`]).
//!
//! It is written by columns, not by a struct of rows: a joint sample as a row of its own would be an allocation for each of
//! millions of samples, where a part has them in one array as they come from the log. A test reads the parts as rows and holds
//! those against the schema, as the rows of every table are.

use super::Result;
use super::words::orientation_rows;
use crate::ingest::{CommandSamples, TargetReadings, TemperatureSamples};
use crate::join::JoinInput;
use crate::lake::{OpenRun, OpenTable, WholeTable};
use crate::log::JointSink;
use crate::manifest::RunKey;
use crate::rows::{Word as _, names, words};
use crate::schema;
use crate::table::{Columns, ROW_GROUP_ROWS, Table};
use crate::units::Stamp;

const POSITION: [&str; 3] = ["x_mm", "y_mm", "z_mm"];
const ORIENTATION: [&str; 4] = ["qx", "qy", "qz", "qw"];
const COVARIANCE: [&str; 6] = *names!(stated_cov, covariance);
const TURN_COVARIANCE: [&str; 2] =
    ["stated_orientation_cov_rad2", "stated_position_orientation_cov_mm_rad"];

type Rows = std::ops::Range<usize>;

#[derive(Debug, Clone)]
struct Part {
    source: Behind,
    rows: Rows,
}

#[derive(Debug, Clone, Copy)]
enum Behind {
    Command,
    Target,
    Temperature,
}

words! {
    pub enum Source {
        Joints: "joints",
        /// Commanded poses.
        Command: "command",
        Target: "target",
        Temperature: "temperature",
    }
}

/// The table of one session, being written while its logs are read. Dropped before its end, it leaves no file.
pub struct LogTable<'r> {
    run: &'r OpenRun<'r>,
    key: RunKey,
    /// Number of joint samples so far.
    joints: usize,
    /// A part of joint samples: most of its columns are also those of the next part.
    like: Option<Table>,
    table: Result<OpenTable<'r>>,
}

impl<'r> LogTable<'r> {
    pub fn new(run: &'r OpenRun<'r>, session: &str) -> Self {
        let (key, table) = (run.key.of_session(session), Ok(OpenTable::new(run)));
        Self { run, key, joints: 0, like: None, table }
    }

    /// Writes all other samples of the session after the joint samples, for [`OpenRun::keep`]; `None` where there are no
    /// samples at all.
    pub fn finish(self, input: &JoinInput) -> Result<Option<WholeTable>> {
        let mut table = self.table?;
        table.append_all(parts(input), |part| rows_of(input, part, &self.key))?;
        Ok(table.finish()?)
    }
}

impl JointSink for LogTable<'_> {
    fn restart(&mut self) {
        *self = Self::new(self.run, &self.key.session);
    }

    /// An error is reported at the end.
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

/// The parts of the table after the joint samples, in the order of its rows.
fn parts(input: &JoinInput) -> Vec<Part> {
    let samples = [
        (Behind::Command, input.commands.count()),
        (Behind::Target, input.readings.count()),
        (Behind::Temperature, input.temperatures.stamps.len()),
    ];
    let of_source = |(source, samples): (Behind, usize)| {
        let firsts = (0..samples).step_by(ROW_GROUP_ROWS);
        firsts.map(move |first| Part { source, rows: first..(first + ROW_GROUP_ROWS).min(samples) })
    };
    samples.into_iter().flat_map(of_source).collect()
}

fn rows_of(input: &JoinInput, Part { source, rows }: Part, key: &RunKey) -> Result<Table> {
    match source {
        Behind::Command => command_rows(&input.commands.read(rows.clone())?, rows, key),
        Behind::Target => target_rows(&input.readings.read(rows.clone())?, rows, key),
        Behind::Temperature => temperature_rows(&input.temperatures, rows, key),
    }
}

/// The columns of every part: run, source, number and stamp of the sample.
fn columns(
    key: &RunKey,
    source: Source,
    rows: Rows,
    stamps_ns: impl Iterator<Item = i64>,
) -> Result<Columns> {
    Ok(Columns::new(schema::find("logs")?, rows.len())
        .key(key)
        .same("source", source.word())
        .whole_numbers("sample", numbers(&rows))
        .whole_numbers("stamp_ns", stamps_ns.collect()))
}

fn numbers(rows: &Rows) -> Vec<i64> {
    let number = |sample: usize| i64::try_from(sample).expect("samples in memory");
    (number(rows.start)..number(rows.end)).collect()
}

fn in_ns<C: Copy>(stamps: &[Stamp<C>]) -> impl Iterator<Item = i64> {
    stamps.iter().map(|stamp| stamp.ns())
}

fn command_rows(commands: &CommandSamples, rows: Rows, key: &RunKey) -> Result<Table> {
    let table = columns(key, Source::Command, rows, in_ns(&commands.stamps))?;
    let orientations = commands.orientations.as_deref();
    Ok(placed(table, &commands.positions, orientations).rest_absent().finish()?)
}

/// Further joint samples, as many as the part `like` has.
fn more_joint_rows(
    rows: Rows,
    stamps_ns: impl Iterator<Item = i64>,
    angles: &[f64],
    like: &Table,
) -> Result<Table> {
    let table = Columns::like(like)
        .whole_numbers("sample", numbers(&rows))
        .whole_numbers("stamp_ns", stamps_ns.collect())
        .lists_alike("joints_rad", angles);
    Ok(table.finish()?)
}

/// Stamps and angles (rad, row after row) of these rows.
fn joint_rows(
    rows: Rows,
    stamps_ns: impl Iterator<Item = i64>,
    angles: &[f64],
    key: &RunKey,
) -> Result<Table> {
    let table = columns(key, Source::Joints, rows, stamps_ns)?.lists_alike("joints_rad", angles);
    Ok(table.rest_absent().finish()?)
}

fn target_rows(readings: &TargetReadings, rows: Rows, key: &RunKey) -> Result<Table> {
    let TargetReadings { stamps, positions, orientations, covariances } = readings;
    let mut table = columns(key, Source::Target, rows, in_ns(stamps))?;
    if let Some(covariances) = covariances {
        let [own, cross] = TURN_COVARIANCE;
        let turns = covariances.iter().map(|own| own.turn);
        table = table
            .group(COVARIANCE, covariances.iter().map(|own| own.position))
            .column(own, turns.clone().map(|own| own.map(orientation_rows)))
            .column(cross, turns.map(|own| own.map(|own| own.with_position.to_vec())));
    }
    Ok(placed(table, positions, orientations.as_deref()).rest_absent().finish()?)
}

fn temperature_rows(temperatures: &TemperatureSamples, rows: Rows, key: &RunKey) -> Result<Table> {
    let stamps_ns = in_ns(&temperatures.stamps[rows.clone()]);
    let table = columns(key, Source::Temperature, rows.clone(), stamps_ns)?
        .column("temperature_c", temperatures.celsius[rows].iter().copied());
    Ok(table.rest_absent().finish()?)
}

fn placed(table: Columns, positions: &[[f64; 3]], orientations: Option<&[[f64; 4]]>) -> Columns {
    let table = table.group(POSITION, positions.iter().copied());
    match orientations {
        None => table,
        Some(orientations) => table.group(ORIENTATION, orientations.iter().copied()),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::{PoseCovariance, TurnCovariance};
    use crate::rows::{Row as _, row};
    use crate::units::{Controller, Tracker};

    row! {
        /// A sample of any kind.
        pub struct LogRow of "logs" {
            source: Source,
            sample: usize,
            stamp_ns: i64,
            joints_rad: Option<Vec<f64>>,
            position as [x_mm, y_mm, z_mm]: Option<[f64; 3]>,
            orientation as [qx, qy, qz, qw]: Option<[f64; 4]>,
            stated_cov_mm2 as [stated_cov: covariance]: Option<[f64; 6]>,
            stated_orientation_cov_rad2: Option<Vec<f64>>,
            stated_position_orientation_cov_mm_rad: Option<Vec<f64>>,
            temperature_c: Option<f64>,
        }
    }

    const NOTHING: LogRow = LogRow {
        source: Source::Joints,
        sample: 0,
        stamp_ns: 0,
        joints_rad: None,
        position: None,
        orientation: None,
        stated_cov_mm2: None,
        stated_orientation_cov_rad2: None,
        stated_position_orientation_cov_mm_rad: None,
        temperature_c: None,
    };

    #[test]
    fn the_columns_of_every_part_are_the_rows_that_were_sampled() {
        let key = RunKey::new("kr210", "mon", "00ff");
        let read = |part: Result<Table>| LogRow::read(&part.expect("a part"));
        let stamps = [5, 9];
        let joints = joint_rows(3..5, stamps.into_iter(), &[0.1, 0.2, 0.3, 0.4], &key);
        let like = joints.expect("a part");
        let more = more_joint_rows(5..7, [11, 12].into_iter(), &[0.5, 0.6, 0.7, 0.8], &like);
        let of_joints = |sample, stamp_ns, angles: [f64; 2]| LogRow {
            sample,
            stamp_ns,
            joints_rad: Some(angles.to_vec()),
            ..NOTHING
        };
        let expected = [of_joints(3, 5, [0.1, 0.2]), of_joints(4, 9, [0.3, 0.4])];
        assert_eq!(LogRow::read(&like), expected);
        let expected = [of_joints(5, 11, [0.5, 0.6]), of_joints(6, 12, [0.7, 0.8])];
        assert_eq!(read(more), expected);
        let commands = CommandSamples {
            stamps: vec![Stamp::<Controller>::from_ns(7)],
            positions: vec![[1.0, 2.0, 3.0]],
            orientations: Some(vec![[0.0, 0.0, 0.0, 1.0]]),
            covariances: None,
        };
        let expected = LogRow {
            source: Source::Command,
            stamp_ns: 7,
            position: Some([1.0, 2.0, 3.0]),
            orientation: Some([0.0, 0.0, 0.0, 1.0]),
            ..NOTHING
        };
        assert_eq!(read(command_rows(&commands, 0..1, &key)), [expected]);
        let readings = TargetReadings {
            stamps: vec![Stamp::<Tracker>::from_ns(8)],
            positions: vec![[4.0, 5.0, 6.0]],
            orientations: Some(vec![[0.0, 0.0, 0.0, 1.0]]),
            covariances: Some(vec![PoseCovariance {
                position: Some([1e-4, 0.0, 0.0, 1e-4, 0.0, 2e-4]),
                turn: Some(TurnCovariance {
                    own: [1.0, 0.1, 0.2, 3.0, 0.3, 4.0],
                    with_position: [0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5],
                }),
            }]),
        };
        let expected = LogRow {
            source: Source::Target,
            sample: 2,
            stamp_ns: 8,
            position: Some([4.0, 5.0, 6.0]),
            orientation: Some([0.0, 0.0, 0.0, 1.0]),
            stated_cov_mm2: Some([1e-4, 0.0, 0.0, 1e-4, 0.0, 2e-4]),
            stated_orientation_cov_rad2: Some(vec![1.0, 0.1, 0.2, 0.1, 3.0, 0.3, 0.2, 0.3, 4.0]),
            stated_position_orientation_cov_mm_rad: Some(vec![
                0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5,
            ]),
            ..NOTHING
        };
        assert_eq!(read(target_rows(&readings, 2..3, &key)), [expected]);
        let temperatures =
            TemperatureSamples { stamps: vec![Stamp::<Tracker>::from_ns(9)], celsius: vec![21.5] };
        let expected = LogRow {
            source: Source::Temperature,
            stamp_ns: 9,
            temperature_c: Some(21.5),
            ..NOTHING
        };
        assert_eq!(read(temperature_rows(&temperatures, 0..1, &key)), [expected]);
    }
}
