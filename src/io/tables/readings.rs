//! `readings`: dwells and readings as the session was joined, to the last bit, so that later stages start from them.

use nalgebra::{Point3, Quaternion, UnitQuaternion};
use thiserror::Error;

use super::stations::{DwellColumns, ReadColumns, Unpaired};
use crate::geometry::TurnCovariance;
use crate::join::{
    Command, MeanLength, MeanOrientation, MeanPoint, Pairing, Reading, ReadingKind, SourceId,
    Station, TargetId, Value,
};
use crate::rows::row;
use crate::units::Stamp;

row! {
    #[derive(Default)]
    pub struct ReadingRow of "readings" {
        dwell: DwellColumns,
        reading: usize,
        source_index: Option<usize>,
        target_index: Option<usize>,
        reads: Option<ReadingKind>,
        read: ReadColumns,
        length_mm: Option<f64>,
        length_sd_mm: Option<f64>,
        samples: Option<usize>,
        samples_kept: Option<usize>,
        first_ns: Option<i64>,
        last_ns: Option<i64>,
    }
}

/// Rows that are no dwells.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum NoStations {
    #[error("reading {reading} of station {station} has no {column}")]
    Absent {
        station: usize,
        reading: usize,
        /// The column, or the first of several that belong together.
        column: &'static str,
    },
    #[error(
        "row {row} is reading {reading} of station {station}, which does not follow the row before it"
    )]
    Order {
        /// Number of the row, from 0.
        row: usize,
        station: usize,
        reading: usize,
    },
}

pub fn rows(stations: &[Station]) -> Vec<ReadingRow> {
    stations.iter().flat_map(of_dwell).collect()
}

fn of_dwell(station: &Station) -> Vec<ReadingRow> {
    let dwell = DwellColumns::from(station);
    if station.readings.is_empty() {
        return vec![ReadingRow { dwell, ..ReadingRow::default() }];
    }
    let readings = station.readings.iter().enumerate();
    readings.map(|(number, reading)| of_reading(dwell.clone(), number, reading)).collect()
}

fn of_reading(dwell: DwellColumns, number: usize, reading: &Reading) -> ReadingRow {
    let length = reading.value.length();
    ReadingRow {
        dwell,
        reading: number,
        source_index: Some(reading.source.0),
        target_index: Some(reading.target.0),
        reads: Some(reading.value.kind()),
        read: reading.into(),
        length_mm: length.map(|own| own.mm),
        length_sd_mm: length.map(|own| own.sd_mm),
        samples: Some(reading.taken),
        samples_kept: Some(reading.kept),
        first_ns: Some(reading.first.ns()),
        last_ns: Some(reading.last.ns()),
    }
}

/// The dwells of the rows of a table, the same to the last bit as those that made them.
pub fn stations(rows: &[ReadingRow]) -> Result<Vec<Station>, NoStations> {
    let mut stations: Vec<Station> = Vec::new();
    for (place, row) in rows.iter().enumerate() {
        let station = row.dwell.station;
        let follows = match stations.last() {
            Some(last) if row.reading > 0 => {
                station == last.number && row.reading == last.readings.len()
            }
            last => row.reading == 0 && last.is_none_or(|last| station > last.number),
        };
        if !follows {
            return Err(NoStations::Order { row: place, station, reading: row.reading });
        }
        if row.reading == 0 {
            stations.push(dwell(&row.dwell));
        }
        if let (Some(last), Some(reads)) = (stations.last_mut(), row.reads) {
            last.readings.push(reading(row, reads)?);
        }
    }
    Ok(stations)
}

fn dwell(row: &DwellColumns) -> Station {
    let command = row.command.map(|position| Command {
        position: Point3::from(position),
        orientation: row.command_turn.map(turn_of),
    });
    Station {
        number: row.station,
        start: Stamp::from_ns(row.start_ns),
        end: Stamp::from_ns(row.end_ns),
        joints: row.joints_rad.clone(),
        joint_samples: row.joint_samples,
        command,
        readings: Vec::new(),
        pairing: match row.reason {
            None => Pairing::Paired,
            Some(Unpaired::SeveralCandidates) => Pairing::Ambiguous,
            Some(Unpaired::Unmeasured(why)) => Pairing::Unmeasured(why),
        },
    }
}

fn reading(row: &ReadingRow, reads: ReadingKind) -> Result<Reading, NoStations> {
    let of =
        |column| NoStations::Absent { station: row.dwell.station, reading: row.reading, column };
    let point = || {
        Ok(MeanPoint {
            position: row.read.at.ok_or_else(|| of("x_mm"))?.into(),
            scatter_mm: row.read.scatter_mm.ok_or_else(|| of("scatter_x_mm"))?,
            stated_covariance: row.read.stated_cov_mm2,
            motion_covariance: row.read.motion_cov_mm2,
        })
    };
    let turn = || {
        let scatter = row.read.scatter_orientation_rad;
        Ok(MeanOrientation {
            orientation: turn_of(row.read.turn.ok_or_else(|| of("qx"))?),
            scatter_rad: scatter.ok_or_else(|| of("scatter_orientation_rad"))?,
            stated_covariance: stated_turn(row).map_err(of)?,
        })
    };
    let length = || {
        Ok(MeanLength {
            mm: row.length_mm.ok_or_else(|| of("length_mm"))?,
            sd_mm: row.length_sd_mm.ok_or_else(|| of("length_sd_mm"))?,
        })
    };
    Ok(Reading {
        source: SourceId(row.source_index.ok_or_else(|| of("source_index"))?),
        target: TargetId(row.target_index.ok_or_else(|| of("target_index"))?),
        value: match reads {
            ReadingKind::Point => Value::Point(point()?),
            ReadingKind::Pose => Value::Pose(point()?, turn()?),
            ReadingKind::Distance => Value::Distance(length()?),
            ReadingKind::Height => Value::Height(length()?),
        },
        kept: row.samples_kept.ok_or_else(|| of("samples_kept"))?,
        taken: row.samples.ok_or_else(|| of("samples"))?,
        first: Stamp::from_ns(row.first_ns.ok_or_else(|| of("first_ns"))?),
        last: Stamp::from_ns(row.last_ns.ok_or_else(|| of("last_ns"))?),
        temperature_c: row.read.temperature_c,
    })
}

/// The orientation's part of a stated covariance; an error with the column that has a wrong number of entries.
fn stated_turn(row: &ReadingRow) -> Result<Option<TurnCovariance>, &'static str> {
    let (own, cross) =
        (&row.read.stated_orientation_cov_rad2, &row.read.stated_position_orientation_cov_mm_rad);
    let Some(own) = own else { return Ok(None) };
    let own: [f64; 9] = own[..].try_into().map_err(|_| "stated_orientation_cov_rad2")?;
    let cross = cross.as_deref().unwrap_or_default();
    let cross: [f64; 9] = cross.try_into().map_err(|_| "stated_position_orientation_cov_mm_rad")?;
    let [xx, xy, xz, _, yy, yz, _, _, zz] = own;
    Ok(Some(TurnCovariance { own: [xx, xy, xz, yy, yz, zz], with_position: cross }))
}

/// The quaternion as it was written: normalised anew it would differ in its last bits.
fn turn_of([x, y, z, w]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
}
