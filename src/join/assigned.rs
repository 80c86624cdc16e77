//! Assignment by geometry: readings of several reflectors that do not name them → the target of each reading.
//!
//! Inputs are the nominal flange and the positions read at each station, in any order and some of them missing, and what is stated of
//! the targets ([`Stated`]): places at the flange, or distances among them. The arm is known to millimetres and reflectors sit further
//! apart than that, so one rigid frame of the tracker decides nearly everything:
//!
//! 1. the frame is found by the mean of the positions of each station with all targets, which no order changes
//!    ([`Placement`](super::placement::Placement));
//! 2. carried to the flange, positions gather about as many places as there are targets. The best assignment of each station,
//!    the places and the frame are found in turn until no assignment changes (`clusters`);
//! 3. the places get the names of targets under the permutation that agrees with what is stated. Where another one agrees as well, the
//!    targets cannot be distinguished and the session is refused (`names`);
//! 4. at each station the runner-up is the best other assignment of the readings kept. Where it is not significantly worse, the
//!    station's readings are ambiguous (`station`).
//!
//! [`rows`] does it for a table of stations, `stream` for a log, whose readings of several targets at once `lanes` parts.

mod clusters;
pub(super) mod lanes;
mod names;
pub mod rows;
mod station;
pub(super) mod stream;
#[cfg(test)]
mod tests;

use nalgebra::{Isometry3, Point3, Vector3};
use thiserror::Error;

use super::pattern::MIN_PAIRS;
use super::reading::Assigned;

pub use rows::assigned_rows;

/// The most targets whose readings are assigned: the permutations of more are too many.
pub const MOST: usize = 6;
/// By how much `−2 log` of the runner-up's likelihood has to be larger: a likelihood a thousand times smaller.
const DECIDED: f64 = 13.8;

/// Stated places and distances of the targets, in their order.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stated {
    /// Their names.
    pub names: Vec<String>,
    /// Place of each at the flange, mm, and its standard uncertainty per axis, mm; `None` where it is not stated.
    pub places: Vec<Option<(Vector3<f64>, f64)>>,
    /// Distances among them.
    pub distances: Vec<StatedDistance>,
}

/// A stated distance between two targets.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StatedDistance {
    /// The two targets.
    pub between: [usize; 2],
    /// Their distance, mm.
    pub mm: f64,
    /// Its standard uncertainty, mm.
    pub sd_mm: f64,
}

impl Stated {
    /// The distance between two targets and its standard uncertainty, mm: as stated, otherwise by their places. `None` where neither
    /// is stated.
    pub fn distance(&self, one: usize, other: usize) -> Option<(f64, f64)> {
        let stated = self
            .distances
            .iter()
            .find(|own| own.between == [one, other] || own.between == [other, one]);
        if let Some(own) = stated {
            return Some((own.mm, own.sd_mm));
        }
        let ((a, a_sd), (b, b_sd)) = ((*self.places.get(one)?)?, (*self.places.get(other)?)?);
        Some(((a - b).norm(), a_sd.hypot(b_sd)))
    }

    /// The first two targets whose distance is not stated; `None` where all are.
    pub fn unknown_distance(&self) -> Option<[&str; 2]> {
        let count = self.names.len();
        let mut pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| (one, other)));
        let (one, other) = pairs.find(|&(one, other)| self.distance(one, other).is_none())?;
        Some([&self.names[one], &self.names[other]])
    }

    fn count(&self) -> usize {
        self.names.len()
    }
}

/// The positions read at a station.
#[derive(Debug, Clone, PartialEq)]
pub struct StationPoints {
    /// The nominal flange in the base frame, mm.
    pub flange: Isometry3<f64>,
    /// Positions in the tracker's frame, mm, in any order.
    pub points: Vec<Point3<f64>>,
}

/// The assignment of a station's readings.
#[derive(Debug, Clone, PartialEq)]
pub enum StationAssignment {
    /// Each reading with its target.
    Decided(Vec<PointTarget>, Option<Assigned>),
    /// Another assignment is nearly as likely: the distances of both, mm.
    Ambiguous(Assigned),
}

/// The target of one reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointTarget {
    /// It is of this target.
    Of(usize),
    /// It is of none: its distance from the nearest target, mm.
    OfNone(f64),
}

impl PointTarget {
    /// Why a reading is of none; `None` of one that has a target.
    pub(super) fn why_none(self) -> Option<String> {
        match self {
            Self::Of(_) => None,
            Self::OfNone(away_mm) => Some(format!(
                "of no target: {away_mm:.1} mm from the nearest, or that one has a nearer reading"
            )),
        }
    }
}

/// Why the readings of an ambiguous station are left out.
pub(super) fn ambiguous_words(own: &Assigned) -> String {
    format!(
        "another assignment to targets is nearly as likely: {:.2} mm from the nominal arm, next best {:.2} mm",
        own.misfit_mm, own.runner_up_mm
    )
}

/// The reason why no readings of a session can be assigned.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum AssignError {
    /// Too few stations.
    #[error(
        "{found} stations with readings, but {MIN_PAIRS} or more are needed to find which reading is of which target: name the target of \
         each reading"
    )]
    TooFew {
        /// Number of stations with readings.
        found: usize,
    },
    /// No station has a reading of every target, and places are not stated.
    #[error(
        "no station has readings of all {targets} targets, and the place of {missing:?} at the flange is not stated: state \
         [fit.targets.{missing}], or name the target of each reading"
    )]
    NoneComplete {
        /// Number of targets.
        targets: usize,
        /// Name of the first target without a place.
        missing: String,
    },
    /// The stations do not place the base in the tracker's frame.
    #[error(
        "the stations do not place the arm's base in the tracker's frame: measure stations that are not in line"
    )]
    NoFrame,
    /// Two assignments of names agree with what is stated.
    #[error(
        "{targets} cannot be distinguished by what is stated of them: as named {best_mm:.2} mm off, exchanged {second_mm:.2} mm; state their \
         places at the flange ([fit.targets.NAME]) or distances ([[fit.target_distances]]) that differ, or name the target of each reading"
    )]
    Alike {
        /// The targets in words.
        targets: String,
        /// Root mean square deviation from what is stated, mm.
        best_mm: f64,
        /// That of the next best naming, mm.
        second_mm: f64,
    },
    /// No permutation agrees with what is stated.
    #[error(
        "the places that the readings show agree with what is stated of the targets under no assignment: the best leaves {best_mm:.1} mm \
         (next best {second_mm:.1} mm); check [fit.targets], [[fit.target_distances]] and the robot file's flange"
    )]
    NotAsStated {
        /// Root mean square deviation from what is stated, mm.
        best_mm: f64,
        /// That of the next best naming, mm.
        second_mm: f64,
    },
}

/// The target of each reading, station by station in the given order; readings further than `gate_mm` from every target are of none.
pub fn assign(
    stations: &[StationPoints],
    stated: &Stated,
    gate_mm: f64,
) -> Result<Vec<StationAssignment>, AssignError> {
    let found = stations.iter().filter(|own| !own.points.is_empty()).count();
    if found < MIN_PAIRS {
        return Err(AssignError::TooFew { found });
    }
    let clusters = clusters::find(stations, stated, gate_mm)?;
    let names = names::of_clusters(&clusters, stated)?;
    let decide = |off: &Vec<Point3<f64>>| {
        station::decided(off, &clusters.places, &clusters.scale).renamed(&names)
    };
    Ok(clusters.at_flange(stations).iter().map(decide).collect())
}

impl StationAssignment {
    /// The assignment with targets in place of clusters.
    fn renamed(self, names: &[usize]) -> Self {
        let Self::Decided(mut points, assigned) = self else {
            return self;
        };
        for point in &mut points {
            if let PointTarget::Of(cluster) = point {
                *cluster = names[*cluster];
            }
        }
        Self::Decided(points, assigned)
    }
}
