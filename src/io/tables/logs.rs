//! `logs`: the decoded samples of both logs, in parts of one row group each, so that only a few are in memory as rows.

use super::PublishError;
use crate::ingest::{CommandSamples, JointSamples, Recording, TargetReadings, TemperatureSamples};
use crate::io::schema;
use crate::io::table::{Columns, ROW_GROUP_ROWS, Table};
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
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Part {
    source: Source,
    rows: Rows,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    Command,
    Joints,
    Target,
    Temperature,
}

/// The parts of the table, in the order of its rows.
pub fn parts(recording: &Recording) -> Vec<Part> {
    let samples = [
        (Source::Joints, recording.joints.stamps.len()),
        (Source::Command, recording.commands.stamps.len()),
        (Source::Target, recording.readings.stamps.len()),
        (Source::Temperature, recording.temperatures.stamps.len()),
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

/// One part of the table.
pub fn logs(recording: &Recording, part: Part, key: &RunKey) -> Result<Table, PublishError> {
    let rows = part.rows;
    match part.source {
        Source::Joints => joint_rows(&recording.joints, rows, key),
        Source::Command => command_rows(&recording.commands, rows, key),
        Source::Target => target_rows(&recording.readings, rows, key),
        Source::Temperature => temperature_rows(&recording.temperatures, rows, key),
    }
}

/// What every part has: the run, the source, the sample's number and stamp.
fn columns<C>(
    key: &RunKey,
    source: &str,
    rows: &Rows,
    stamps: &[Stamp<C>],
) -> Result<Columns, PublishError> {
    let numbers = rows.clone().map(|row| row as u64);
    Ok(Columns::new(schema::find("logs")?, rows.len())
        .key(key)
        .same("source", source)
        .column("sample", numbers)
        .column(
            "stamp_ns",
            stamps[rows.clone()].iter().map(|stamp| stamp.ns()),
        ))
}

fn command_rows(
    commands: &CommandSamples,
    rows: Rows,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let table = columns(key, "command", &rows, &commands.stamps)?
        .absent(["joints_rad", "temperature_c"])
        .absent(COVARIANCE);
    Ok(placed(
        table,
        &commands.positions,
        commands.orientations.as_deref(),
        rows,
    )
    .finish()?)
}

fn joint_rows(joints: &JointSamples, rows: Rows, key: &RunKey) -> Result<Table, PublishError> {
    let angles = joints.angles.iter().map(|joint| &joint[rows.clone()]);
    let table = columns(key, "joints", &rows, &joints.stamps)?
        .across("joints_rad", &angles.collect::<Vec<_>>())
        .absent(POSITION)
        .absent(ORIENTATION)
        .absent(COVARIANCE)
        .absent(["temperature_c"]);
    Ok(table.finish()?)
}

fn target_rows(readings: &TargetReadings, rows: Rows, key: &RunKey) -> Result<Table, PublishError> {
    let table =
        columns(key, "target", &rows, &readings.stamps)?.absent(["joints_rad", "temperature_c"]);
    let table = match &readings.covariances {
        None => table.absent(COVARIANCE),
        Some(covariances) => table.group(COVARIANCE, covariances[rows.clone()].iter().copied()),
    };
    Ok(placed(
        table,
        &readings.positions,
        readings.orientations.as_deref(),
        rows,
    )
    .finish()?)
}

fn temperature_rows(
    temperatures: &TemperatureSamples,
    rows: Rows,
    key: &RunKey,
) -> Result<Table, PublishError> {
    let table = columns(key, "temperature", &rows, &temperatures.stamps)?
        .column("temperature_c", temperatures.celsius[rows].iter().copied())
        .absent(["joints_rad"])
        .absent(POSITION)
        .absent(ORIENTATION)
        .absent(COVARIANCE);
    Ok(table.finish()?)
}

fn placed(
    table: Columns,
    positions: &[[f64; 3]],
    orientations: Option<&[[f64; 4]]>,
    rows: Rows,
) -> Columns {
    let table = table.group(POSITION, positions[rows.clone()].iter().copied());
    match orientations {
        None => table.absent(ORIENTATION),
        Some(orientations) => table.group(ORIENTATION, orientations[rows].iter().copied()),
    }
}
