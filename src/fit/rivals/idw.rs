//! Inverse distance weights: the error at a place is a mean of those at the nearest stations.
//!
//! The weights are those of the seed paper's family, `w_i ∝ d_i^{−2}`, and the distance is in space or in joint space (chords, as
//! [`crate::similarity`] has it). A cell of a grid has eight vertices, so eight stations are taken; the number is a choice of ours. Each axis's
//! variance is the mean square of what the other stations' weights leave of every station, without a measurement's share: it knows no place,
//! so it does not grow outside the measured ranges.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::{ErrorMap, Estimate, Place, Sample, mean_measured_variance};
use crate::units::chord;

/// Stations that a weighted mean is of.
const NEAREST: usize = 8;
/// The power of a distance.
const POWER: f64 = 2.0;
/// Distance, mm or rad, below which a place is taken to be at a station.
const EXACT_HIT: f64 = 1e-9;

/// The space of the distances.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Space {
    /// Between positions in the base frame, mm.
    Position,
    /// Between the axis variables, each a chord, rad; states whether each slides.
    Joints(Vec<bool>),
}

/// Stations and their errors.
#[derive(Debug)]
pub struct Idw {
    space: Space,
    stations: Vec<Station>,
    variance: Vector3<f64>,
}

#[derive(Debug)]
struct Station {
    coordinates: Vec<f64>,
    error: Vector3<f64>,
}

impl Idw {
    /// The weights of these stations; `None` with fewer than two, of which nothing says how far they are off.
    pub fn new(samples: &[Sample<'_>], space: Space) -> Option<Self> {
        let station = |own: &Sample<'_>| Station {
            coordinates: space.coordinates(&own.place),
            error: own.error,
        };
        let mut map = Self {
            stations: samples.iter().map(station).collect(),
            space,
            variance: Vector3::zeros(),
        };
        map.variance = map.left_out(mean_measured_variance(samples))?;
        Some(map)
    }

    /// Variance of what other stations leave of each, beyond `measured`, mm².
    fn left_out(&self, measured: f64) -> Option<Vector3<f64>> {
        let count = self.stations.len();
        let left = |own: usize| {
            let station = &self.stations[own];
            let left = station.error - self.mean(&station.coordinates, Some(own));
            left.component_mul(&left)
        };
        let squares: Vec<Vector3<f64>> = (0..count).into_par_iter().map(left).collect();
        let mean = squares.iter().sum::<Vector3<f64>>() / count as f64;
        (count > 1).then(|| mean.map(|own| (own - measured).max(0.0)))
    }

    /// The weighted mean of the nearest stations but `without`, mm.
    fn mean(&self, at: &[f64], without: Option<usize>) -> Vector3<f64> {
        let distance = |station: &Station| self.space.distance(at, &station.coordinates);
        let others = self.stations.iter().enumerate();
        let others = others.filter(|(place, _)| Some(*place) != without);
        let mut near: Vec<(f64, &Station)> = others.map(|(_, own)| (distance(own), own)).collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(NEAREST);
        let mut weights: Vec<f64> = near.iter().map(|(distance, _)| *distance).collect();
        inverse_distances(&mut weights, POWER, EXACT_HIT);
        let errors = near.iter().zip(weights);
        errors.map(|((_, own), weight)| own.error * weight).sum()
    }
}

impl ErrorMap for Idw {
    fn at(&self, place: &Place<'_>) -> Estimate {
        Estimate { error: self.mean(&self.space.coordinates(place), None), variance: self.variance }
    }
}

impl Space {
    fn coordinates(&self, place: &Place<'_>) -> Vec<f64> {
        match self {
            Self::Position => place.position.coords.as_slice().to_vec(),
            Self::Joints(_) => place.axes.to_vec(),
        }
    }

    fn distance(&self, a: &[f64], b: &[f64]) -> f64 {
        let pairs = a.iter().zip(b);
        let squares: f64 = match self {
            Self::Position => pairs.map(|(a, b)| (a - b).powi(2)).sum(),
            Self::Joints(slides) => {
                let each = pairs.zip(slides);
                each.map(|((a, b), slides)| chord(a - b, *slides).powi(2)).sum()
            }
        };
        squares.sqrt()
    }
}

/// Turns distances into weights `w_i ∝ d_i^{−p}` that sum to one; the first below `exact_hit` has all the weight.
pub fn inverse_distances(distances: &mut [f64], power: f64, exact_hit: f64) {
    if let Some(hit) = distances.iter().position(|own| *own < exact_hit) {
        distances.fill(0.0);
        distances[hit] = 1.0;
        return;
    }
    // Relative to the nearest, so that no power overflows.
    let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
    for own in distances.iter_mut() {
        *own = (nearest / *own).powf(power);
    }
    let total: f64 = distances.iter().sum();
    for own in distances.iter_mut() {
        *own /= total;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::rivals::test::{place, sample};

    #[test]
    fn two_stations_weigh_by_the_square_of_their_distance() {
        let samples = [sample(&[0.0], [0.0; 3], 0.4), sample(&[0.0], [300.0, 0.0, 0.0], 0.1)];
        let map = Idw::new(&samples, Space::Position).expect("two stations");
        // 100 mm and 200 mm away: weights 4/5 and 1/5, so 0.8 · 0.4 + 0.2 · 0.1 = 0.34 mm.
        let near = map.at(&place(&[0.0], [100.0, 0.0, 0.0]));
        assert!((near.error.x - 0.34).abs() < 1e-12, "{near:?}");
        // Each is predicted by the other alone: 0.3 mm off, less 0.01 mm² of measurement.
        assert!((near.variance.x - (0.09 - 0.01)).abs() < 1e-12, "{near:?}");
        let hit = map.at(&place(&[0.0], [300.0, 0.0, 0.0]));
        assert!((hit.error.x - 0.1).abs() < 1e-15, "{hit:?}");
    }

    #[test]
    fn joints_are_near_over_a_full_turn_and_nine_stations_are_eight() {
        let turned = [6.2, 0.0];
        let at = Space::Joints(vec![false, false]);
        // 6.2 rad is 0.0832 rad short of a turn: a chord of 2 sin(0.0416) = 0.08316.
        let chord = at.distance(&turned, &[0.0, 0.0]);
        assert!((chord - 0.083_161_3).abs() < 1e-6, "{chord}");
        // 500 mm of sliding count as half a radian.
        let slid = Space::Joints(vec![true]).distance(&[500.0], &[0.0]);
        assert!((slid - 0.5).abs() < 1e-15);
        let joints: Vec<[f64; 1]> = (0..9).map(|i| [0.1 * f64::from(i)]).collect();
        let samples: Vec<_> = joints
            .iter()
            .zip([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1e9])
            .map(|(own, error)| sample(own, [0.0; 3], error))
            .collect();
        let map = Idw::new(&samples, Space::Joints(vec![false])).expect("nine stations");
        assert!(map.at(&place(&[-0.05], [0.0; 3])).error.norm() < 1e-12);
    }
}
