//! Between-session variation of a station's error: the approach direction of its joints, and the drift of the base.
//!
//! Held-out stations of one session were measured along that session's path: along a line of a grid two joints may always
//! approach from opposite sides, and the base drifts as it did in that session. In another session a target is approached
//! from elsewhere. The full error model states the effect of both on each station (its command–feedback weight, its drift),
//! so that:
//! 1. the effects of the station's own settling errors, sides of approach and drift are removed;
//! 2. settling errors are added that each joint had at some station of its own, joint by joint, any side of its backlash, and a
//!    drift of the size that the model finds, at a random time.
//!
//! No random numbers are drawn: places and sizes are those of a sequence that fills the unit cube evenly (Richtmyer 1951),
//! so that the same stations give the same bytes.

use nalgebra::Vector3;
use statrs::distribution::{ContinuousCDF, Normal};

use super::JoinedSession;
use crate::fit::commanded::SettlingError;
use crate::fit::full::sides::{Sides, sides};
use crate::fit::full::{FullModel, Known, Query};
use crate::fit::{ErrorFrame, Models};
use crate::grid::GridStation;
use crate::units::whole;

/// Number of simulated other sessions for each station.
const DAYS: usize = 8;

/// Gives the stations of `session` (`place` in the models) the changes of their errors that other sessions may bring; none
/// where there is no full error model.
pub(super) fn add_between_session_variation(
    stations: &mut [GridStation],
    session: &JoinedSession,
    place: usize,
    models: &Models,
    error_frame: &ErrorFrame<'_>,
) {
    let Some(model) = &models.full else { return };
    let backlash = model.trained.sides.as_ref();
    let other = OtherDays {
        model,
        place,
        error_frame,
        settling_errors: sent(session),
        beside: backlash.map_or_else(Vec::new, |own| beside(session, error_frame, own)),
        day_mm: model.any_time_variance().sqrt(),
    };
    if other.day_mm <= 0.0 && other.settling_errors.is_empty() && other.beside.is_empty() {
        return;
    }
    for (number, station) in stations.iter_mut().enumerate() {
        station.between_sessions = other.of(number, station);
    }
}

/// The settling errors of the session's stations (command minus feedback), by station number.
fn sent(session: &JoinedSession) -> Vec<(usize, &[f64])> {
    let stations = session.joined.stations.iter().zip(&session.commanded.settling_errors);
    stations.filter_map(|(own, error)| Some((own.number, error.as_ref()?.sent()?))).collect()
}

/// True minus reported axis variables by the sides of approach, by station number.
fn beside(
    session: &JoinedSession,
    error_frame: &ErrorFrame<'_>,
    backlash: &Sides,
) -> Vec<(usize, Vec<f64>)> {
    let stations = &session.joined.stations;
    let axes: Vec<_> = stations.iter().map(|own| error_frame.arm.axes(&own.joints)).collect();
    let beside = sides(axes.iter().map(|own| (0, &own[..]))).map(|own| backlash.on(&own));
    stations.iter().map(|own| own.number).zip(beside).collect()
}

struct OtherDays<'o> {
    model: &'o FullModel,
    place: usize,
    error_frame: &'o ErrorFrame<'o>,
    settling_errors: Vec<(usize, &'o [f64])>,
    /// True minus reported axis variables of each station; empty where no backlash is known.
    beside: Vec<(usize, Vec<f64>)>,
    /// Standard deviation per axis of the base's position in another session.
    day_mm: f64,
}

impl OtherDays<'_> {
    fn of(&self, place: usize, station: &GridStation) -> Vec<Vector3<f64>> {
        let reported = self.error_frame.arm.axes(&station.joints);
        let own = self.settling_errors.iter().find(|(number, _)| *number == station.number);
        let own = own.map(|(_, settling_error)| *settling_error);
        let beside = self.beside.iter().find(|(number, _)| *number == station.number);
        let was = beside.map_or_else(|| reported.clone(), |(_, by)| sum(&reported, by));
        let measured = self.stands(&was, own, Some(station.number));
        let left = |day: usize| {
            let mut even = Even::at(place * DAYS + day);
            let drift = Vector3::from_fn(|_, _| self.day_mm * even.normal());
            let other: Option<Vec<f64>> =
                own.map(|own| (0..own.len()).map(|joint| self.some(joint, even.next())).collect());
            // The command is the same: the reported angles differ.
            let moved = own.zip(other.as_ref()).map(|(own, other)| {
                let commanded = sum(&reported, own);
                commanded.iter().zip(other).map(|(axis, short)| axis - short).collect()
            });
            let is = self.on_some_sides(moved.unwrap_or_else(|| reported.clone()), &mut even);
            self.stands(&is, other.as_deref(), None) - measured + drift
        };
        (0..DAYS).map(left).collect()
    }

    /// Axis variables with each joint on some side of its backlash; those reported where none is known.
    fn on_some_sides(&self, reported: Vec<f64>, even: &mut Even) -> Vec<f64> {
        let Some(backlash) = &self.model.trained.sides else { return reported };
        let some = reported.iter().map(|_| if even.next() < 0.5 { -1.0 } else { 1.0 });
        sum(&reported, &backlash.on(&some.collect::<Vec<f64>>()))
    }

    /// The settling error of a joint at the station whose place among all is `share`.
    fn some(&self, joint: usize, share: f64) -> f64 {
        let place = whole(share * self.settling_errors.len() as f64);
        self.settling_errors[place.min(self.settling_errors.len() - 1)].1[joint]
    }

    /// The position of the tool point by the model, in the base frame, mm.
    fn stands(
        &self,
        reported: &[f64],
        settling_error: Option<&[f64]>,
        station: Option<usize>,
    ) -> Vector3<f64> {
        let settling_error = settling_error.map(|axes| SettlingError::Sent(axes.to_vec()));
        let known = settling_error.as_ref().map_or(Known::Reported, Known::Both);
        let point = self.model.position(&Query {
            axes: reported,
            known,
            lever: self.error_frame.lever(),
            session: self.place,
            source: self.error_frame.frames.source,
            target: self.error_frame.frames.target,
            own: true,
            station,
        });
        let base = self.error_frame.frames.tracker_from_base.isometry();
        base.inverse_transform_point(&point).coords
    }
}

fn sum(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + b).collect()
}

/// One point of a sequence that fills the unit cube evenly, coordinate by coordinate: multiples of the roots of primes,
/// which no fraction approximates well (Richtmyer 1951).
struct Even {
    number: f64,
    coordinate: usize,
}

/// For three axes of drift, and settling errors and sides of eight joints; an arm with more would use the first coordinates again.
const PRIMES: [f64; 19] = [
    2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0, 41.0, 43.0, 47.0, 53.0,
    59.0, 61.0, 67.0,
];

impl Even {
    const fn at(number: usize) -> Self {
        Self { number: (number + 1) as f64, coordinate: 0 }
    }

    /// The next coordinate, in 0 ≤ u < 1.
    fn next(&mut self) -> f64 {
        let prime = PRIMES[self.coordinate % PRIMES.len()];
        self.coordinate += 1;
        (0.5 + self.number * prime.sqrt()).fract()
    }

    /// The next coordinate as a normal number.
    fn normal(&mut self) -> f64 {
        Normal::standard().inverse_cdf(self.next().clamp(1e-9, 1.0 - 1e-9))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sequence_is_even_and_its_normal_numbers_have_variance_one() {
        let coordinate = |skip: usize| -> Vec<f64> {
            let at = |number| {
                let mut even = Even::at(number);
                (0..skip).for_each(|_| {
                    even.next();
                });
                even.normal()
            };
            (0..2000).map(at).collect()
        };
        for skip in 0..PRIMES.len() {
            let drawn = coordinate(skip);
            let mean = drawn.iter().sum::<f64>() / 2000.0;
            let variance = drawn.iter().map(|x| x * x).sum::<f64>() / 2000.0;
            // Random numbers would be within 0.07 and 0.1 (three standard errors); those of the even sequence are closer.
            assert!(
                mean.abs() < 0.01 && (variance - 1.0).abs() < 0.02,
                "{skip}: {mean} {variance}"
            );
        }
    }
}
