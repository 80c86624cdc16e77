//! Readings of the target in order of time, wherever they are kept.

use std::fmt::Debug;
use std::io;
use std::ops::Range;

use super::TargetReadings;
use crate::units::{Stamp, Tracker};

/// Readings in order of time, of which a few are looked at at a time: a log of a night need not fit into memory.
pub trait Readings: Debug + Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// Those of some rows. Rows that there are not are an error, as is a place that they cannot be read from any more.
    fn read(&self, rows: Range<usize>) -> io::Result<TargetReadings>;
    /// When one of them was taken.
    fn stamp(&self, row: usize) -> io::Result<Stamp<Tracker>> {
        Ok(self.read(row..row + 1)?.stamps[0])
    }
}

/// All in memory.
impl Readings for TargetReadings {
    fn count(&self) -> usize {
        self.stamps.len()
    }

    fn read(&self, rows: Range<usize>) -> io::Result<TargetReadings> {
        fn of<T: Copy>(column: &[T], rows: &Range<usize>) -> io::Result<Vec<T>> {
            let part = column.get(rows.clone()).map(<[T]>::to_vec);
            part.ok_or_else(|| io::Error::other("a column of the readings is too short"))
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

    fn stamp(&self, row: usize) -> io::Result<Stamp<Tracker>> {
        let stamp = self.stamps.get(row).copied();
        stamp.ok_or_else(|| io::Error::other("a column of the readings is too short"))
    }
}
