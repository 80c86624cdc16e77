//! Readings of the target in order of time, wherever they are kept.

use std::fmt::Debug;
use std::io;
use std::ops::Range;

use thiserror::Error;

use super::TargetReadings;
use crate::units::{Stamp, Tracker};

/// Why readings that were there cannot be had again.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the tracker's readings cannot be read again: {why}")]
pub struct ReadingsError {
    /// What the operating system says, or that there is no such row.
    why: String,
}

impl ReadingsError {
    fn too_short() -> Self {
        io::Error::other("a column of them is too short").into()
    }
}

impl From<io::Error> for ReadingsError {
    fn from(error: io::Error) -> Self {
        Self {
            why: error.to_string(),
        }
    }
}

/// Readings in order of time, of which a few are looked at at a time: a log of a night need not fit into memory.
pub trait Readings: Debug + Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// Those of some rows. Rows that there are not are an error, as is a place that they cannot be read from any more.
    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, ReadingsError>;
    /// When one of them was taken.
    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, ReadingsError> {
        Ok(self.read(row..row + 1)?.stamps[0])
    }
}

/// All in memory.
impl Readings for TargetReadings {
    fn count(&self) -> usize {
        self.stamps.len()
    }

    fn read(&self, rows: Range<usize>) -> Result<TargetReadings, ReadingsError> {
        fn of<T: Copy>(column: &[T], rows: &Range<usize>) -> Result<Vec<T>, ReadingsError> {
            let part = column.get(rows.clone()).map(<[T]>::to_vec);
            part.ok_or_else(ReadingsError::too_short)
        }
        let orientations = self.orientations.as_ref();
        let covariances = self.covariances.as_ref();
        Ok(TargetReadings {
            stamps: of(&self.stamps, &rows)?,
            positions: of(&self.positions, &rows)?,
            orientations: orientations.map(|all| of(all, &rows)).transpose()?,
            covariances: covariances.map(|all| of(all, &rows)).transpose()?,
        })
    }

    fn stamp(&self, row: usize) -> Result<Stamp<Tracker>, ReadingsError> {
        let stamp = self.stamps.get(row).copied();
        stamp.ok_or_else(ReadingsError::too_short)
    }
}
