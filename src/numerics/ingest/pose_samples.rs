//! Poses in order of time, in memory or on disk: commanded poses and readings of the measured target.

use std::fmt::Debug;
use std::io;
use std::ops::Range;

use thiserror::Error;

use crate::geometry::PoseCovariance;
use crate::units::{Controller, Stamp, Tracker};

/// Poses or points over the time of a clock; columns of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSamples<C> {
    pub stamps: Vec<Stamp<C>>,
    pub positions: Vec<[f64; 3]>,
    pub orientations: Option<Vec<[f64; 4]>>,
    /// Covariances that the messages state, mm and rad; absent where they have none.
    pub covariances: Option<Vec<PoseCovariance>>,
}

/// Commanded tool poses as the controller stated them: of the tool point in the command frame, without covariances.
pub type CommandSamples = PoseSamples<Controller>;
/// Readings of the measured target, in the tracker frame.
pub type TargetReadings = PoseSamples<Tracker>;

impl<C> Default for PoseSamples<C> {
    fn default() -> Self {
        Self { stamps: Vec::new(), positions: Vec::new(), orientations: None, covariances: None }
    }
}

#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("poses that were spilled to disk while the logs were read cannot be read back: {why}")]
pub struct PosesError {
    why: String,
}

impl PosesError {
    fn too_short() -> Self {
        io::Error::other("a column of them is too short").into()
    }
}

impl From<io::Error> for PosesError {
    fn from(error: io::Error) -> Self {
        Self { why: error.to_string() }
    }
}

/// Poses in order of time, read a few at a time: a log of a night need not fit into memory.
pub trait Poses<C>: Debug + Send + Sync {
    fn count(&self) -> usize;
    /// The poses of some rows. An error when a row does not exist or the storage can no longer be read.
    fn read(&self, rows: Range<usize>) -> Result<PoseSamples<C>, PosesError>;
    fn stamp(&self, row: usize) -> Result<Stamp<C>, PosesError>;
    /// The number of first poses for whose stamps `before` is true.
    fn count_while(&self, before: &dyn Fn(Stamp<C>) -> bool) -> Result<usize, PosesError> {
        let (mut from, mut to) = (0, self.count());
        while from < to {
            let middle = usize::midpoint(from, to);
            if before(self.stamp(middle)?) {
                from = middle + 1;
            } else {
                to = middle;
            }
        }
        Ok(from)
    }
}

impl<C: Copy + Debug + Send + Sync> Poses<C> for PoseSamples<C> {
    fn count(&self) -> usize {
        self.stamps.len()
    }

    fn read(&self, rows: Range<usize>) -> Result<Self, PosesError> {
        fn of<T: Copy>(column: &[T], rows: &Range<usize>) -> Result<Vec<T>, PosesError> {
            column.get(rows.clone()).map(<[T]>::to_vec).ok_or_else(PosesError::too_short)
        }
        Ok(Self {
            stamps: of(&self.stamps, &rows)?,
            positions: of(&self.positions, &rows)?,
            orientations: self.orientations.as_ref().map(|all| of(all, &rows)).transpose()?,
            covariances: self.covariances.as_ref().map(|all| of(all, &rows)).transpose()?,
        })
    }

    fn stamp(&self, row: usize) -> Result<Stamp<C>, PosesError> {
        self.stamps.get(row).copied().ok_or_else(PosesError::too_short)
    }
}
