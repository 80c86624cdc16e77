//! Rows of a table whose readings do not name their targets → rows whose readings do, and rejects.

use nalgebra::{Point3, Vector3};

use super::{
    AssignError, PointTarget, Stated, StationAssignment, StationPoints, ambiguous_words, assign,
};
use crate::join::references::Motion;
use crate::join::tabled::carried::motions;
use crate::join::tabled::{Row, RowItem, RowReading, RowReject, Rows};
use crate::join::{JoinSettings, MeanPoint, TargetId, Value};
use crate::kinematics::Arm;

/// The rows with the target of each reading of a place by geometry; readings of no target, and those of stations where another
/// assignment is nearly as likely, become rejects. Readings of one length are left as they are. Readings are held against the arm without
/// the motion that references show, which may be a bump of any size.
pub fn assigned_rows(
    mut rows: Rows,
    arm: &Arm,
    settings: &JoinSettings,
    stated: &Stated,
) -> Result<Rows, AssignError> {
    let motions = motions(&rows);
    let stations = rows.rows.iter().enumerate();
    let stations = stations.map(|(place, row)| points(row, motions.get(&place), arm));
    let stations: Vec<StationPoints> = stations.collect();
    let assigned = assign(&stations, stated, settings.geometry_gate_mm)?;
    let mut left_out = Vec::new();
    for (row, assignment) in rows.rows.iter_mut().zip(assigned) {
        left_out.extend(take(row, assignment));
    }
    let file = &rows.file;
    let rejects = left_out.into_iter().map(|(line, reason)| RowReject {
        kind: RowItem::Reading,
        file: file.clone(),
        line,
        column: None,
        station: None,
        reason,
    });
    rows.rejects.extend(rejects);
    Ok(rows)
}

/// Rows with one reading each, at the mean of their positions: it is of the targets' middle, in whatever order they were read. Rows
/// with fewer positions than most have none.
pub fn middles(rows: &Rows) -> Rows {
    let mut middles = rows.clone();
    let count = |row: &Row| row.readings.iter().filter_map(position).count();
    let most = rows.rows.iter().map(count).max().unwrap_or(0);
    for row in &mut middles.rows {
        let is_whole = count(row) == most;
        let first = row.readings.iter().find(|own| position(own).is_some()).copied();
        let places = row.readings.iter().filter_map(position);
        let sum: Vector3<f64> = places.map(|at| at.coords).sum();
        let middle = first.filter(|_| is_whole).and_then(|first| {
            let point =
                MeanPoint { position: Point3::from(sum / most as f64), ..*first.value.point()? };
            Some(RowReading { target: TargetId::MAIN, value: Value::Point(point), ..first })
        });
        row.readings = middle.into_iter().collect();
    }
    middles
}

/// The positions of a row without a motion.
fn points(row: &Row, motion: Option<&Motion>, arm: &Arm) -> StationPoints {
    let read = row.readings.iter().filter_map(position);
    StationPoints {
        flange: *arm.flange(&row.joints).isometry(),
        points: read.map(|at| motion.map_or(at, |motion| motion.undone(&at))).collect(),
    }
}

fn position(reading: &RowReading) -> Option<Point3<f64>> {
    reading.value.point().map(|point| point.position)
}

/// Gives the readings of a row their targets; lines of those left out, and why.
fn take(row: &mut Row, assignment: StationAssignment) -> Vec<(u64, String)> {
    let (places, mut kept): (Vec<RowReading>, Vec<RowReading>) =
        row.readings.drain(..).partition(|own| position(own).is_some());
    let mut left_out = Vec::new();
    match assignment {
        StationAssignment::Ambiguous(own) => {
            let reason = ambiguous_words(&own);
            left_out.extend(places.iter().map(|reading| (reading.line, reason.clone())));
        }
        StationAssignment::Decided(targets, assigned) => {
            row.assigned = assigned;
            for (reading, target) in places.into_iter().zip(targets) {
                match target {
                    PointTarget::Of(target) => {
                        kept.push(RowReading { target: TargetId(target), ..reading });
                    }
                    PointTarget::OfNone(_) => {
                        left_out.extend(target.why_none().map(|reason| (reading.line, reason)));
                    }
                }
            }
        }
    }
    kept.sort_by_key(|own| (own.source, own.target));
    row.readings = kept;
    left_out
}
