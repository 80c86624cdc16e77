//! `logs`: the decoded samples of both logs, in parts of one row group each, so that no more than one part is in memory.

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

/// The parts of the table, in the order of its rows.
pub fn logs<'r>(
    recording: &'r Recording,
    key: &'r RunKey,
) -> impl Iterator<Item = Result<Table, PublishError>> + 'r {
    let parts = |samples: usize| {
        let first = (0..samples).step_by(ROW_GROUP_ROWS);
        first.map(move |first| first..(first + ROW_GROUP_ROWS).min(samples))
    };
    let commands = &recording.commands;
    let (joints, readings) = (&recording.joints, &recording.readings);
    let temperatures = &recording.temperatures;
    parts(commands.stamps.len())
        .map(move |rows| command_rows(commands, rows, key))
        .chain(parts(joints.stamps.len()).map(move |rows| joint_rows(joints, rows, key)))
        .chain(parts(readings.stamps.len()).map(move |rows| target_rows(readings, rows, key)))
        .chain(
            parts(temperatures.stamps.len())
                .map(move |rows| temperature_rows(temperatures, rows, key)),
        )
}

type Rows = std::ops::Range<usize>;

/// What every part has: the run, the source, the sample's number and stamp.
fn part<C>(
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
    let table = part(key, "command", &rows, &commands.stamps)?
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
    let columns = joints.angles.iter().map(|joint| &joint[rows.clone()]);
    let table = part(key, "joints", &rows, &joints.stamps)?
        .across("joints_rad", &columns.collect::<Vec<_>>())
        .absent(POSITION)
        .absent(ORIENTATION)
        .absent(COVARIANCE)
        .absent(["temperature_c"]);
    Ok(table.finish()?)
}

fn target_rows(readings: &TargetReadings, rows: Rows, key: &RunKey) -> Result<Table, PublishError> {
    let table =
        part(key, "target", &rows, &readings.stamps)?.absent(["joints_rad", "temperature_c"]);
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
    let table = part(key, "temperature", &rows, &temperatures.stamps)?
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
