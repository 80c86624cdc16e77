//! Where a camera is mounted, by its readings: a camera on the flange that is stated to stand in the cell, or the other way round, is
//! told by the nominal arm, which agrees with one of the two alone.

use super::{Result, RunError};
use crate::fit::Mounted;
use crate::join::Value;
use crate::join::placement::{NOMINAL_MM, Placement, ReadingAtFlange};
use crate::join::tabled::{Row, RowReading, Rows};
use crate::kinematics::Arm;

/// The other mounting explains the readings where it leaves at most this share of their distance from the nominal arm.
const EXPLAINS: f64 = 1.0 / 3.0;

pub(super) const fn other(mounted: Mounted) -> Mounted {
    match mounted {
        Mounted::Fixed => Mounted::Flange,
        Mounted::Flange => Mounted::Fixed,
    }
}

/// An error where the readings of a table agree with the nominal arm under the other mounting than is stated.
pub(super) fn check(arm: &Arm, session: &str, stated: Mounted, rows: &Rows) -> Result<()> {
    let of = |mounted| median_mm(arm, rows, mounted).unwrap_or(f64::INFINITY);
    let (as_stated, as_other) = (of(stated), of(other(stated)));
    if as_stated <= NOMINAL_MM || as_other > EXPLAINS * as_stated {
        return Ok(());
    }
    Err(RunError::Mounted {
        session: session.to_owned(),
        stated: key(stated),
        right: key(other(stated)),
        evidence: format!(
            "readings are {as_stated:.0} mm from the nominal arm so, and {as_other:.1} mm with the other"
        ),
    })
}

pub(super) const fn key(mounted: Mounted) -> &'static str {
    match mounted {
        Mounted::Fixed => "fixed",
        Mounted::Flange => "flange",
    }
}

/// Median distance of the readings from the nominal arm, mm; `None` where too few place it.
fn median_mm(arm: &Arm, rows: &Rows, mounted: Mounted) -> Option<f64> {
    let value = |reading: &RowReading| -> Option<Value> {
        match mounted {
            Mounted::Fixed => Some(reading.value),
            Mounted::Flange => reading.value.inverted(),
        }
    };
    let reading = |row: &Row| {
        let own = row.readings.first()?;
        let attained = value(own)?.point()?.position.coords;
        let flange = *arm.flange(&row.joints).isometry();
        Some(ReadingAtFlange { flange, attained })
    };
    let readings: Vec<ReadingAtFlange> = rows.rows.iter().filter_map(reading).collect();
    let placement = Placement::fit_far(&readings)?;
    Some(placement.median_mm(&readings))
}
