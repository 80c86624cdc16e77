//! Stations with positions of nobody knows which target → as many places at the flange, and the tracker's frame.

use nalgebra::{Isometry3, Point3, Vector3};

use super::station::{self, Scale};
use super::{AssignError, MIN_PAIRS, Stated, StationPoints};
use crate::figures::median;
use crate::join::placement::{Placement, ReadingAtFlange};

/// Rounds of assignments, places and frame; they rarely change after the third.
const ROUNDS: usize = 12;
/// Most readings that the frame is fitted to, spread over the session: six unknowns need no more.
const FIT_READINGS: usize = 600;
/// Sizes of offsets before they are known, mm per axis: places of the first round are off by what their frame is.
const FIRST: [f64; 2] = [5.0, 30.0];
/// Least size of what a reading has of its own, mm per axis: the instrument, and the flange's turn by the arm's errors.
const LEAST_OWN_MM: f64 = 0.1;
/// Least size of what the readings of a station share, mm per axis: a nominal arm is no better.
const LEAST_SHARED_MM: f64 = 1.0;
/// Median of the norm of three independent normal variates of size one.
const MEDIAN_OF_THREE: f64 = 1.538;

/// The places about which positions gather.
#[derive(Debug)]
pub(super) struct Clusters {
    tracker_from_base: Isometry3<f64>,
    /// The places at the flange, mm.
    pub(super) places: Vec<Point3<f64>>,
    /// Sizes of the offsets from them.
    pub(super) scale: Scale,
    /// Measured distances of each two of them, mm, with the number of stations that have both.
    pub(super) distances: Vec<([usize; 2], f64, usize)>,
    /// Number of readings of each.
    pub(super) readings: Vec<usize>,
}

/// The places of a session's readings.
pub(super) fn find(
    stations: &[StationPoints],
    stated: &Stated,
    gate_mm: f64,
) -> Result<Clusters, AssignError> {
    let (placement, complete) = by_means(stations, stated.count())?;
    let [own, shared] = FIRST;
    let mut clusters = Clusters {
        tracker_from_base: placement.tracker_from_base,
        places: Vec::new(),
        scale: Scale { own, shared, gate: gate_mm + shared },
        distances: Vec::new(),
        readings: Vec::new(),
    };
    clusters.places = first_places(&clusters, stations, stated, complete, &placement)?;
    let mut assigned = Vec::new();
    for _ in 0..ROUNDS {
        let now = clusters.assignments(stations);
        if now == assigned {
            break;
        }
        assigned = now;
        clusters.refine(stations, &assigned, gate_mm);
    }
    clusters.measure(stations, &assigned);
    Ok(clusters)
}

/// The frame by the mean of each station's positions, and a station with all targets that agrees with it best; `None` of it where no
/// station has all of them.
fn by_means(
    stations: &[StationPoints],
    targets: usize,
) -> Result<(Placement, Option<usize>), AssignError> {
    let complete = |own: &&StationPoints| own.points.len() == targets;
    let enough = stations.iter().filter(complete).count() >= 2 * MIN_PAIRS;
    let used = stations.iter().filter(|own| !own.points.is_empty() && (!enough || complete(own)));
    let means: Vec<ReadingAtFlange> = used.map(mean).collect();
    let placement = Placement::fit_far(&means).ok_or(AssignError::NoFrame)?;
    let whole = stations.iter().enumerate().filter(|(_, own)| complete(own));
    let away_mm = |own: &StationPoints| placement.distance_mm(&mean(own));
    let best = whole.min_by(|a, b| away_mm(a.1).total_cmp(&away_mm(b.1)));
    Ok((placement, best.map(|(place, _)| place)))
}

fn mean(station: &StationPoints) -> ReadingAtFlange {
    let sum: Vector3<f64> = station.points.iter().map(|point| point.coords).sum();
    ReadingAtFlange { flange: station.flange, attained: sum / station.points.len().max(1) as f64 }
}

/// The first places: the positions of the complete station, otherwise the stated ones, shifted so that their mean is in its place.
fn first_places(
    clusters: &Clusters,
    stations: &[StationPoints],
    stated: &Stated,
    complete: Option<usize>,
    placement: &Placement,
) -> Result<Vec<Point3<f64>>, AssignError> {
    if let Some(place) = complete {
        return Ok(clusters.carried(&stations[place]));
    }
    let mut places = Vec::with_capacity(stated.count());
    for (place, name) in stated.places.iter().zip(&stated.names) {
        let (at, _) = place.ok_or_else(|| AssignError::NoneComplete {
            targets: stated.count(),
            missing: name.clone(),
        })?;
        places.push(at);
    }
    let middle = places.iter().sum::<Vector3<f64>>() / places.len().max(1) as f64;
    let shifted = places.iter().map(|at| at - middle + placement.target_mm);
    Ok(shifted.map(Point3::from).collect())
}

impl Clusters {
    /// A station's positions at the flange, mm.
    fn carried(&self, station: &StationPoints) -> Vec<Point3<f64>> {
        let flange_from_tracker = (self.tracker_from_base * station.flange).inverse();
        let points = station.points.iter();
        points.map(|point| flange_from_tracker * point).collect()
    }

    /// The positions of all stations at the flange, mm.
    pub(super) fn at_flange(&self, stations: &[StationPoints]) -> Vec<Vec<Point3<f64>>> {
        stations.iter().map(|own| self.carried(own)).collect()
    }

    fn assignments(&self, stations: &[StationPoints]) -> Vec<Vec<Option<usize>>> {
        let points = self.at_flange(stations);
        let best = |own: &Vec<Point3<f64>>| station::best(own, &self.places, &self.scale);
        points.iter().map(best).collect()
    }

    /// Frame, places and sizes of offsets by these assignments.
    fn refine(
        &mut self,
        stations: &[StationPoints],
        assigned: &[Vec<Option<usize>>],
        gate_mm: f64,
    ) {
        if let Some(placement) = self.placed(stations, assigned) {
            self.tracker_from_base = placement.tracker_from_base;
        }
        let points = self.at_flange(stations);
        for (cluster, place) in self.places.iter_mut().enumerate() {
            if let Some(middle) = middle(&points, assigned, cluster) {
                *place = middle;
            }
        }
        let offsets = points
            .iter()
            .zip(assigned)
            .map(|(points, own)| station::offsets(points, &self.places, own));
        self.scale = sizes(&offsets.collect::<Vec<_>>(), gate_mm);
    }

    fn placed(
        &self,
        stations: &[StationPoints],
        assigned: &[Vec<Option<usize>>],
    ) -> Option<Placement> {
        let mut readings = Vec::new();
        for (station, own) in stations.iter().zip(assigned) {
            for (point, cluster) in station.points.iter().zip(own) {
                let Some(cluster) = cluster else { continue };
                let beside = Isometry3::from(self.places[*cluster].coords);
                readings.push(ReadingAtFlange {
                    flange: station.flange * beside,
                    attained: point.coords,
                });
            }
        }
        let stride = readings.len().div_ceil(FIT_READINGS).max(1);
        let spread: Vec<ReadingAtFlange> = readings.into_iter().step_by(stride).collect();
        Placement::fit(&spread)
    }

    /// Measured distances among the places, and the number of readings of each.
    fn measure(&mut self, stations: &[StationPoints], assigned: &[Vec<Option<usize>>]) {
        let count = self.places.len();
        let of =
            |cluster: usize| assigned.iter().flatten().filter(move |own| **own == Some(cluster));
        self.readings = (0..count).map(|cluster| of(cluster).count()).collect();
        let pairs = (0..count).flat_map(|one| (one + 1..count).map(move |other| [one, other]));
        self.distances = pairs
            .filter_map(|pair| {
                let both = stations.iter().zip(assigned);
                let both = both.filter_map(|(station, own)| {
                    let at = |cluster| own.iter().position(|own| *own == Some(cluster));
                    let [one, other] = [at(pair[0])?, at(pair[1])?].map(|at| station.points[at]);
                    Some((one - other).norm())
                });
                let both: Vec<f64> = both.collect();
                Some((pair, median(&both)?, both.len()))
            })
            .collect();
    }
}

/// The median position of a place's readings, axis by axis; `None` without any.
fn middle(
    points: &[Vec<Point3<f64>>],
    assigned: &[Vec<Option<usize>>],
    cluster: usize,
) -> Option<Point3<f64>> {
    let own = points.iter().zip(assigned).flat_map(|(points, own)| {
        let own = points.iter().zip(own);
        own.filter(move |(_, of)| **of == Some(cluster))
    });
    let own: Vec<Point3<f64>> = own.map(|(point, _)| *point).collect();
    let axis = |axis: usize| median(&own.iter().map(|at| at[axis]).collect::<Vec<f64>>());
    Some(Point3::new(axis(0)?, axis(1)?, axis(2)?))
}

/// The sizes of offsets by their medians over the stations.
fn sizes(offsets: &[Vec<Vector3<f64>>], gate_mm: f64) -> Scale {
    let mean = |off: &[Vector3<f64>]| off.iter().sum::<Vector3<f64>>() / off.len().max(1) as f64;
    let some = offsets.iter().filter(|off| !off.is_empty());
    let shared: Vec<f64> = some.map(|off| mean(off).norm()).collect();
    let several = offsets.iter().filter(|off| off.len() > 1);
    let own = several.map(|off| {
        let middle = mean(off);
        let squares: f64 = off.iter().map(|d| (d - middle).norm_squared()).sum();
        (squares / (3 * (off.len() - 1)) as f64).sqrt()
    });
    let own: Vec<f64> = own.collect();
    let shared_mm = median(&shared).unwrap_or(0.0) / MEDIAN_OF_THREE;
    Scale {
        own: median(&own).unwrap_or(0.0).max(LEAST_OWN_MM),
        shared: shared_mm.max(LEAST_SHARED_MM),
        gate: gate_mm.max(10.0 * shared_mm),
    }
}
