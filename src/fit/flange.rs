//! The flange's pose at a station from the readings of several targets.
//!
//! Errors against commands, grids and the tool tip are of one point with one orientation. Inputs: the readings of one source on
//! several targets at a station, and the targets' places on the flange as a fit found them ([`Frames`]). Output: one reading that
//! stands for all of them ([`OneReading`]).
//!
//! 1. Three or more targets that are not in line give a pose: the rigid motion of their places onto their readings, by least squares
//!    weighted with each reading's covariance (Gauss–Newton from Kabsch's closed form). It is stated as the main target's position and
//!    the flange's orientation, with their covariance.
//! 2. Otherwise the main target's own reading is taken.
//!    So it is, too, where the main target is a 6-DoF target, whose orientation is read.
//! 3. A station without either has no such reading; its readings still count in the fit.
//!
//! The places are as uncertain as the fit leaves them. That part is the same at every station, like the mounting of a 6-DoF target,
//! and is not counted here.

use std::sync::Arc;

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};

use super::frames::Frames;
use super::observation::{Measured, Noise};
use crate::geometry::align;
use crate::join::{
    MeanOrientation, MeanPoint, Reading, ReadingKind, SourceId, Station, TargetId, Value,
};

/// An orientation that the readings leave more uncertain than this about some axis says less than the nominal arm, rad.
const WORST_RAD: f64 = 1e-3;
/// Steps of Gauss and Newton: the closed form is off by what weights change, a share of the noise.
const STEPS: usize = 3;
/// Variance of each coordinate below which a covariance is not inverted, mm².
const LEAST_MM2: f64 = 1e-12;

/// The flange's orientation as several targets show it.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredFlange {
    /// The rotation from the flange's axes to the source's.
    pub orientation: UnitQuaternion<f64>,
    /// The places of all targets on the flange by which it holds, mm.
    pub places: Arc<[Point3<f64>]>,
}

impl MeasuredFlange {
    /// The orientation by other places of the targets, those of another model: what turns these places onto its own comes first.
    pub fn by_places(&self, frames: &Frames) -> UnitQuaternion<f64> {
        let others = places(frames);
        let own = align(&self.places, &others, &vec![1.0; others.len()]);
        own.map_or(self.orientation, |own| self.orientation * own.rotation)
    }
}

/// The one reading of a station that stands for those of several targets.
#[derive(Debug, Clone, PartialEq)]
pub enum OneReading {
    /// The main target's position and the flange's orientation, by three or more targets; with the orientation's standard
    /// uncertainty, the root mean square over the axes, rad.
    Pose(Reading, f64),
    /// The main target's own reading.
    Point(Reading),
}

impl OneReading {
    /// The reading of a paired station, by the targets' places in `frames`; `None` where the main target was not measured and the
    /// others do not show the flange.
    pub fn of(station: &Station, frames: &Frames, noise: &Noise) -> Option<Self> {
        let readings = station.measured();
        let own = || {
            let mut readings = readings.iter();
            let main = readings.find(|reading| reading.target == TargetId::MAIN);
            main.cloned().map(Self::Point)
        };
        if noise.takes_orientations() {
            return own();
        }
        pose(readings, frames, noise).or_else(own)
    }

    /// The reading.
    pub const fn reading(&self) -> &Reading {
        match self {
            Self::Pose(reading, _) | Self::Point(reading) => reading,
        }
    }
}

/// Places of the targets on the flange, mm.
pub fn places(frames: &Frames) -> Arc<[Point3<f64>]> {
    let targets = frames.targets().iter();
    let place = |target: &crate::geometry::Transform<_, _>| {
        Point3::from(target.isometry().translation.vector)
    };
    targets.map(place).collect()
}

/// A measured position with its place on the flange and the inverse of its covariance, 1/mm².
struct Seen {
    measured: Point3<f64>,
    place: Point3<f64>,
    weight: Matrix3<f64>,
}

fn pose(readings: &[Reading], frames: &Frames, noise: &Noise) -> Option<OneReading> {
    let seen = readings
        .iter()
        .filter_map(|reading| seen(reading, frames, noise));
    let seen: Vec<Seen> = seen.collect();
    let main = places(frames)[TargetId::MAIN.0];
    let (flange, covariance) = rigid(&seen, &main)?;
    let turns = covariance.fixed_view::<3, 3>(3, 3).into_owned();
    if turns.symmetric_eigenvalues().max() > WORST_RAD.powi(2) {
        return None;
    }
    let sd_rad = (turns.trace() / 3.0).sqrt();
    let own = covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let reading = of_all(readings, flange * main, &own, flange.rotation, sd_rad)?;
    Some(OneReading::Pose(reading, sd_rad))
}

fn seen(reading: &Reading, frames: &Frames, noise: &Noise) -> Option<Seen> {
    let source = noise.sources.get(reading.source.0)?;
    let place = frames.targets().get(reading.target.0)?;
    let point = *Measured::of(reading, source, 0.0).point()?;
    let covariance = point.instrument + Matrix3::identity() * LEAST_MM2;
    Some(Seen {
        measured: point.position,
        place: Point3::from(place.isometry().translation.vector),
        weight: covariance.try_inverse()?,
    })
}

/// The flange in the source's frame, and the covariance of the position of `main` on it (mm²) and of its turn about the source's axes
/// (rad²); `None` with fewer than three points, or on a line.
fn rigid(seen: &[Seen], main: &Point3<f64>) -> Option<(Isometry3<f64>, Matrix6<f64>)> {
    let measured: Vec<Point3<f64>> = seen.iter().map(|own| own.measured).collect();
    let places: Vec<Point3<f64>> = seen.iter().map(|own| own.place).collect();
    let mut flange = align(&measured, &places, &vec![1.0; seen.len()])?;
    let mut covariance = Matrix6::zeros();
    for _ in 0..STEPS {
        let mut information = Matrix6::zeros();
        let mut gradient = nalgebra::Vector6::zeros();
        for own in seen {
            let arm = flange.rotation * (own.place - main);
            let mut rows = nalgebra::Matrix3x6::zeros();
            rows.fixed_view_mut::<3, 3>(0, 0)
                .copy_from(&Matrix3::identity());
            rows.fixed_view_mut::<3, 3>(0, 3)
                .copy_from(&-arm.cross_matrix());
            let away = own.measured - flange * own.place;
            information += rows.transpose() * own.weight * rows;
            gradient += rows.transpose() * own.weight * away;
        }
        covariance = information.try_inverse()?;
        let step = covariance * gradient;
        let position = flange * main + step.fixed_rows::<3>(0);
        let turn = Vector3::from(step.fixed_rows::<3>(3));
        let rotation = UnitQuaternion::from_scaled_axis(turn) * flange.rotation;
        let origin = position.coords - rotation * main.coords;
        flange = Isometry3::from_parts(Translation3::from(origin), rotation);
    }
    Some((flange, covariance))
}

/// A pose that stands for all readings of a station: their samples, from the first to the last.
fn of_all(
    readings: &[Reading],
    position: Point3<f64>,
    covariance: &Matrix3<f64>,
    orientation: UnitQuaternion<f64>,
    sd_rad: f64,
) -> Option<Reading> {
    let kept = readings.iter().map(|reading| reading.kept).sum::<usize>();
    let c = |row, column| covariance[(row, column)];
    let point = MeanPoint {
        position,
        // The scatter of each target's readings is in the covariance.
        scatter_mm: [0.0; 3],
        stated_covariance: Some([c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)]),
    };
    let turn = MeanOrientation {
        orientation,
        // Of one sample: its mean over all of them is as uncertain as the rigid motion.
        scatter_rad: sd_rad * (kept.max(1) as f64).sqrt(),
    };
    Some(Reading {
        source: SourceId::ONLY,
        target: TargetId::MAIN,
        value: Value::Pose(point, turn),
        kept,
        taken: readings.iter().map(|reading| reading.taken).sum(),
        first: readings.iter().map(|reading| reading.first).min()?,
        last: readings.iter().map(|reading| reading.last).max()?,
        temperature_c: readings.iter().find_map(|reading| reading.temperature_c),
    })
}

/// The uncertainties of stations whose one reading is derived from several targets: a source of poses, with the root mean square of
/// these orientations' standard uncertainties (rad). `noise` itself where no station shows the flange.
pub fn noise_of_poses(noise: &Noise, orientations_rad: &[f64]) -> Noise {
    let mut noise = noise.clone();
    let squares: f64 = orientations_rad.iter().map(|sd| sd * sd).sum();
    if let (Some(source), false) = (noise.sources.first_mut(), orientations_rad.is_empty()) {
        source.reads = ReadingKind::Pose;
        source.uncertainty.orientation_rad = Some((squares / orientations_rad.len() as f64).sqrt());
    }
    noise
}
