//! The stations that a perfect join would find in a synthetic session, for tests of the stages after the join.

use nalgebra::{Point3, Quaternion, UnitQuaternion, Vector3};

use super::Simulated;
use super::random::{Ingredient, Stream};
use super::tracker::{logged_position, off};
use super::truth::TrueStation;
use crate::geometry::{PoseCovariance, isometry_from_rpy};
use crate::ingest::{StandsOn, TargetReadings, covariances};
use crate::join::{MeanOrientation, MeanPoint, Reading, SourceId, Station, TargetId, Value};
use crate::units::{ClockModel, NS_PER_S, Stamp, Tracker, round_ns};

/// Readings before this are still settling, ns.
const SETTLING_NS: i64 = 100_000_000;

/// Share of a reflector's part of a dwell that passes at its beginning and end while the beam is on its way.
const CHANGES: f64 = 0.1;

impl Simulated {
    /// The stations that a perfect join would find: every dwell with the mean of its readings, none of them rejected but
    /// those of the first tenth of a second and outliers more than 1 mm from the truth.
    pub fn stations(&self) -> Vec<Station> {
        let clock = self.truth.clock_model();
        self.truth.stations.iter().map(|truth| self.station(truth, &clock)).collect()
    }

    /// These stations with readings of further reflectors, at these places in the frame of the measured target, mm; the noise of
    /// each reading is its own, and each is lost as often as a station is.
    pub fn stations_with(&self, beside: &[Vector3<f64>]) -> Vec<Station> {
        let settings = &self.truth.settings;
        let mut noise = Stream::new(settings.seed, Ingredient::Beside);
        let mut stations = self.stations();
        for (station, truth) in stations.iter_mut().zip(&self.truth.stations) {
            for (place, at) in beside.iter().enumerate() {
                let (normal, drawn) = (noise.normal3(), noise.uniform());
                let seen = truth.tracker_from_target * Point3::from(*at);
                let position = seen + off(&seen.coords, &normal, &settings.tracker);
                let main = station.readings.first();
                let is_lost = drawn < settings.tracker.lost_share;
                if let Some(main) = main.filter(|_| !is_lost).cloned() {
                    station.readings.push(Reading {
                        target: TargetId(place + 1),
                        value: Value::Point(MeanPoint {
                            position,
                            scatter_mm: [0.0; 3],
                            stated_covariance: None,
                            motion_covariance: None,
                        }),
                        ..main
                    });
                }
            }
        }
        stations
    }

    /// Readings of the measured target and of further reflectors at these places in its frame, mm, as a tracker logs them that measures
    /// all at once: positions, those of the further ones while the arm stands still. Their means are those of [`Self::stations_with`].
    pub fn readings_with(&self, beside: &[Vector3<f64>]) -> Vec<TargetReadings> {
        let own = &self.recording.readings;
        let clock = self.truth.clock_model();
        let mut all = vec![TargetReadings {
            stamps: own.stamps.clone(),
            positions: own.positions.clone(),
            ..TargetReadings::default()
        }];
        all.resize_with(beside.len() + 1, TargetReadings::default);
        for station in self.stations_with(beside) {
            let Some(main) = station.readings.first().and_then(Reading::position) else { continue };
            let (start, end) = (clock.to_tracker(station.start), clock.to_tracker(station.end));
            let from = own.stamps.partition_point(|stamp| *stamp < start);
            let to = own.stamps.partition_point(|stamp| *stamp <= end);
            for reading in &station.readings[1..] {
                let Some(place) = reading.position() else { continue };
                let to_all = &mut all[reading.target.0];
                for sample in (from..to).filter(|&i| own.positions[i].iter().any(|&x| x != 0.0)) {
                    let off = Point3::from(own.positions[sample]) - main;
                    to_all.stamps.push(own.stamps[sample]);
                    to_all.positions.push((place + off).coords.into());
                }
            }
        }
        all
    }

    /// The order in which `targets` reflectors are measured one after another at each station, drawn anew for each.
    fn turns(&self, targets: usize) -> Vec<Vec<usize>> {
        let mut drawn = Stream::new(self.truth.settings.seed, Ingredient::Turns);
        let order = |_: &TrueStation| {
            let mut keyed: Vec<(u64, usize)> =
                (0..targets).map(|target| (drawn.bits(), target)).collect();
            keyed.sort_unstable();
            keyed.into_iter().map(|(_, target)| target).collect()
        };
        self.truth.stations.iter().map(order).collect()
    }

    /// Readings of these reflectors ([`Self::readings_with`]) as of a tracker that measures one after another in each dwell, in order of
    /// `Self::turns`: of each those in its own part of the dwell, and none while the arm moves or the beam goes from one to the next.
    pub fn readings_in_turn(&self, beside: &[Vector3<f64>]) -> Vec<TargetReadings> {
        let clock = self.truth.clock_model();
        let all = self.readings_with(beside);
        let mut in_turn = vec![TargetReadings::default(); all.len()];
        for (truth, order) in self.truth.stations.iter().zip(self.turns(all.len())) {
            let (start, end) = (clock.to_tracker(truth.start), clock.to_tracker(truth.end));
            let part_ns = end.since_ns(start) as f64 / order.len().max(1) as f64;
            for (turn, target) in order.into_iter().enumerate() {
                let from = start.plus_ns(round_ns(part_ns * (turn as f64 + CHANGES)));
                let to = start.plus_ns(round_ns(part_ns * (turn as f64 + 1.0 - CHANGES)));
                let (own, kept) = (&all[target], &mut in_turn[target]);
                let first = own.stamps.partition_point(|stamp| *stamp < from);
                let last = own.stamps.partition_point(|stamp| *stamp <= to);
                kept.stamps.extend(&own.stamps[first..last.max(first)]);
                kept.positions.extend(&own.positions[first..last.max(first)]);
            }
        }
        in_turn
    }

    /// The positions of references at each station, in the tracker's frame, mm; empty without any. Those on the base are where it is in its
    /// drift, those on the floor where the base's frame was at the start, and each reading has noise of its own.
    pub fn references(&self, places: &[(StandsOn, Point3<f64>)]) -> Vec<Vec<Point3<f64>>> {
        let settings = &self.truth.settings;
        let cell = &settings.cell;
        let tracker_from_base =
            isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
        let mut noise = Stream::new(settings.seed, Ingredient::References);
        let mut read = |(on, at): &(StandsOn, Point3<f64>), truth: &TrueStation| {
            let at = match on {
                StandsOn::Base => at + truth.base_drift_mm,
                StandsOn::Floor => *at,
            };
            let seen = truth.tracker_moved * tracker_from_base * at;
            seen + off(&seen.coords, &noise.normal3(), &settings.tracker)
        };
        let stations = self.truth.stations.iter();
        stations.map(|truth| places.iter().map(|at| read(at, truth)).collect()).collect()
    }

    /// Readings of references at these places in the base's frame, mm, as a tracker logs them: those of [`Self::references`], read at
    /// its rate while the arm stands still, with noise of each reading beside that of the station.
    pub fn reference_readings(&self, places: &[(StandsOn, Point3<f64>)]) -> Vec<TargetReadings> {
        let settings = &self.truth.settings;
        let clock = self.truth.clock_model();
        let mut noise = Stream::new(settings.seed, Ingredient::ReferenceReadings);
        let mut all = vec![TargetReadings::default(); places.len()];
        for (truth, seen) in self.truth.stations.iter().zip(self.references(places)) {
            let (start, end) = (clock.to_tracker(truth.start), clock.to_tracker(truth.end));
            let interval_s = settings.motion.reading_rate_hz.recip();
            let interval_ns = round_ns(interval_s * NS_PER_S).max(1);
            let mut at = start;
            while at <= end {
                for (own, place) in all.iter_mut().zip(&seen) {
                    let own_noise = off(&place.coords, &noise.normal3(), &settings.tracker);
                    let scale = place.coords * settings.tracker.scale;
                    own.stamps.push(at);
                    own.positions.push(logged_position(&(place.coords + own_noise - scale)));
                }
                at = at.plus_ns(interval_ns);
            }
        }
        all
    }

    fn station(&self, truth: &TrueStation, clock: &ClockModel) -> Station {
        let stamps = &self.recording.joints.stamps;
        let first = stamps.partition_point(|stamp| *stamp < truth.start);
        let last = stamps.partition_point(|stamp| *stamp <= truth.end);
        truth.station(last - first, self.reading(truth, clock))
    }

    fn reading(&self, truth: &TrueStation, clock: &ClockModel) -> Option<Reading> {
        let readings = &self.recording.readings;
        let (start, end) = (clock.to_tracker(truth.start), clock.to_tracker(truth.end));
        let from = readings.stamps.partition_point(|stamp| *stamp < start);
        let to = readings.stamps.partition_point(|stamp| *stamp <= end);
        let scale = 1.0 + self.truth.settings.tracker.scale;
        let place = Point3::from(truth.tracker_from_target.translation.vector * scale);
        let kept: Vec<usize> = (from..to)
            .filter(|&i| readings.stamps[i].since_ns(start) >= SETTLING_NS)
            .filter(|&i| self.is_sound(&readings.positions[i], &place))
            .collect();
        let (&first, &last) = (kept.first()?, kept.last()?);
        let mean = mean(readings, &kept);
        let stated = readings.covariances.as_ref().map(|all| {
            let kept: Vec<PoseCovariance> = kept.iter().map(|&i| all[i]).collect();
            covariances::mean(&kept)
        });
        let stated = stated.unwrap_or_default();
        let exact = self.truth.settings.instrument.exact(&truth.tracker_from_target).rotation;
        let turned = turned(readings, &kept, &exact);
        let point = MeanPoint {
            position: Point3::from(mean),
            scatter_mm: scatter(readings, &kept, &mean),
            stated_covariance: stated.position,
            motion_covariance: None,
        };
        let turned = turned.map(|(orientation, scatter_rad)| MeanOrientation {
            orientation,
            scatter_rad,
            stated_covariance: stated.turn,
        });
        Some(Reading {
            source: SourceId::ONLY,
            target: TargetId::ONLY,
            value: Value::of(point, turned),
            kept: kept.len(),
            taken: to - from,
            first: readings.stamps[first],
            last: readings.stamps[last],
            temperature_c: self.temperature(readings.stamps[last]),
        })
    }

    /// Whether a reading is of the target where it is: a tracker's within 1 mm, any other that was not lost.
    fn is_sound(&self, read: &[f64; 3], place: &Point3<f64>) -> bool {
        if self.truth.settings.instrument.is_tracker() {
            (Point3::from(*read) - place).norm() < 1.0
        } else {
            read.iter().any(|own| *own != 0.0)
        }
    }

    fn temperature(&self, stamp: Stamp<Tracker>) -> Option<f64> {
        let temperatures = &self.recording.temperatures;
        let next = temperatures.stamps.partition_point(|other| *other < stamp);
        temperatures.celsius.get(next).copied()
    }
}

fn mean(readings: &TargetReadings, kept: &[usize]) -> Vector3<f64> {
    let sum: Vector3<f64> = kept.iter().map(|&i| Vector3::from(readings.positions[i])).sum();
    sum / kept.len() as f64
}

/// Standard deviation of one reading per axis (n − 1), mm; 0 for a single reading.
fn scatter(readings: &TargetReadings, kept: &[usize], mean: &Vector3<f64>) -> [f64; 3] {
    let squares: Vector3<f64> =
        kept.iter().map(|&i| (Vector3::from(readings.positions[i]) - mean).map(|d| d * d)).sum();
    let degrees = kept.len().saturating_sub(1).max(1) as f64;
    squares.map(|sum| (sum / degrees).sqrt()).into()
}

/// Mean orientation, and the root mean square over the axes of a reading's turn away from it, both in the tangent space at
/// the truth: the readings are milliradians from it.
fn turned(
    readings: &TargetReadings,
    kept: &[usize],
    truth: &UnitQuaternion<f64>,
) -> Option<(UnitQuaternion<f64>, f64)> {
    let orientations = readings.orientations.as_ref()?;
    let turns: Vec<Vector3<f64>> = kept
        .iter()
        .map(|&i| {
            let [x, y, z, w] = orientations[i];
            let read = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            (read * truth.inverse()).scaled_axis()
        })
        .collect();
    let mean = turns.iter().sum::<Vector3<f64>>() / turns.len() as f64;
    let squares: f64 = turns.iter().map(|turn| (turn - mean).norm_squared()).sum();
    let degrees = 3.0 * turns.len().saturating_sub(1).max(1) as f64;
    Some((UnitQuaternion::from_scaled_axis(mean) * truth, (squares / degrees).sqrt()))
}
