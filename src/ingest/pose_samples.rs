//! Poses in order of time, wherever they are kept: the commanded ones and the target's readings.

use std::fmt::Debug;
use std::io;
use std::ops::Range;

use thiserror::Error;

use crate::units::{Controller, Stamp, Tracker};

/// Poses or points over the time of a clock; columns of equal length.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseSamples<C> {
    /// Not decreasing.
    pub stamps: Vec<Stamp<C>>,
    /// mm.
    pub positions: Vec<[f64; 3]>,
    /// Unit quaternions x y z w, where the messages have orientations.
    pub orientations: Option<Vec<[f64; 4]>>,
    /// xx xy xz yy yz zz, mm², where the messages state covariances.
    pub covariances: Option<Vec<[f64; 6]>>,
}

/// Commanded tool poses, as the controller stated them: of the tool point, in the command frame. Covariances are not
/// taken of them.
pub type CommandSamples = PoseSamples<Controller>;
/// Readings of the target, in the tracker frame.
pub type TargetReadings = PoseSamples<Tracker>;

/// Without samples.
impl<C> Default for PoseSamples<C> {
    fn default() -> Self {
        Self {
            stamps: Vec::new(),
            positions: Vec::new(),
            orientations: None,
            covariances: None,
        }
    }
}

/// Why poses that were there cannot be had again.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("poses that were spilled to disk while the logs were read cannot be read back: {why}")]
pub struct PosesError {
    /// What the operating system says, or that there is no such row.
    why: String,
}

impl PosesError {
    fn too_short() -> Self {
        io::Error::other("a column of them is too short").into()
    }
}

impl From<io::Error> for PosesError {
    fn from(error: io::Error) -> Self {
        Self {
            why: error.to_string(),
        }
    }
}

/// Poses in order of time, of which a few are looked at at a time: a log of a night need not fit into memory.
pub trait Poses<C>: Debug + Send + Sync {
    /// How many there are.
    fn count(&self) -> usize;
    /// Those of some rows. Rows that there are not are an error, as is a place that they cannot be read from any more.
    fn read(&self, rows: Range<usize>) -> Result<PoseSamples<C>, PosesError>;
    /// When one of them was taken.
    fn stamp(&self, row: usize) -> Result<Stamp<C>, PosesError>;
    /// How many come first whose stamps are `before`.
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

/// All in memory.
impl<C: Debug + Send + Sync> Poses<C> for PoseSamples<C> {
    fn count(&self) -> usize {
        self.stamps.len()
    }

    fn read(&self, rows: Range<usize>) -> Result<Self, PosesError> {
        fn of<T: Copy>(column: &[T], rows: &Range<usize>) -> Result<Vec<T>, PosesError> {
            let part = column.get(rows.clone()).map(<[T]>::to_vec);
            part.ok_or_else(PosesError::too_short)
        }
        let orientations = self.orientations.as_ref();
        let covariances = self.covariances.as_ref();
        Ok(Self {
            stamps: of(&self.stamps, &rows)?,
            positions: of(&self.positions, &rows)?,
            orientations: orientations.map(|all| of(all, &rows)).transpose()?,
            covariances: covariances.map(|all| of(all, &rows)).transpose()?,
        })
    }

    fn stamp(&self, row: usize) -> Result<Stamp<C>, PosesError> {
        let stamp = self.stamps.get(row).copied();
        stamp.ok_or_else(PosesError::too_short)
    }
}
