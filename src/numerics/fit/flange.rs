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

use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Translation3, UnitQuaternion, Vector3};

use super::frames::Frames;
use super::observation::{Measured, Noise, Uncertainty};
use crate::geometry::{align, upper};
use crate::join::{
    MeanOrientation, MeanPoint, Reading, ReadingKind, SourceId, Station, TargetId, Value,
};

/// An orientation that the readings leave more uncertain than this about some axis says less than the nominal arm, rad.
const WORST_RAD: f64 = 1e-3;
/// Targets nearer to one line than this (root mean square, mm) show no orientation to correct commands by: an instrument's 20 µm would
/// be turns of 2 mrad, more than arms are off by.
const LEAST_WIDTH_MM: f64 = 10.0;
/// Steps of Gauss and Newton: the closed form is off by what weights change, a share of the noise.
const STEPS: usize = 3;
/// Variance of each coordinate below which a covariance is not inverted, mm².
const LEAST_MM2: f64 = 1e-12;

/// The one reading of a station that stands for those of several targets.
#[derive(Debug, Clone, PartialEq)]
pub enum OneReading {
    /// The main target's position and the flange's orientation, by three or more targets; with the orientation's standard
    /// uncertainty, the root mean square over the axes, rad.
    Pose(Reading, f64),
    Point(Reading),
}

impl OneReading {
    /// The reading of a paired station, by the targets' places in `frames`; `None` where the main target was not measured and the
    /// others do not show the flange.
    pub fn of(station: &Station, frames: &Frames, noise: &Noise) -> Option<Self> {
        let readings = station.measured();
        let own = || {
            let mut places = readings.iter().filter(|reading| reading.value.point().is_some());
            places.find(|reading| reading.target == TargetId::MAIN).cloned().map(Self::Point)
        };
        if noise.takes_orientations() {
            return own();
        }
        pose(readings, frames, noise).or_else(own)
    }

    pub const fn reading(&self) -> &Reading {
        match self {
            Self::Pose(reading, _) | Self::Point(reading) => reading,
        }
    }
}

/// The turn by which a model's flange has the orientation that the readings show by the places of another model: it is put behind the
/// rotation of the model's flange. `reference` and `model` are the frames of one session by both. `None` where its readings show no
/// orientation: its targets are points, fewer than three or nearly in line.
///
/// The targets sit where they sit: `R_ref F_ref = R_model F_model` for a 6-DoF target, and the places by one model are those by the other,
/// turned, for points.
pub fn turn_behind(reference: &Frames, model: &Frames) -> Option<UnitQuaternion<f64>> {
    let turn = |frames: &Frames| frames.targets()[TargetId::MAIN.0].isometry().rotation;
    let (own, other) = (turn(reference), turn(model));
    // Nothing turns the place of a point.
    if own != UnitQuaternion::identity() {
        return Some(other * own.inverse());
    }
    let (own, other) = (reference.places(), model.places());
    if own.len() != other.len() || width_mm(&own) < LEAST_WIDTH_MM {
        return None;
    }
    let between = align(&other, &own, &vec![1.0; own.len()]);
    between.map(|between| between.rotation)
}

/// The second largest root mean square extent of points about their middle, mm: zero on a line.
fn width_mm(points: &[Point3<f64>]) -> f64 {
    let n = points.len().max(1) as f64;
    let middle = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / n;
    let scatter = points.iter().map(|p| {
        let away = p.coords - middle;
        away * away.transpose()
    });
    let scatter: Matrix3<f64> = scatter.sum();
    let mut extents: [f64; 3] = (scatter / n).symmetric_eigenvalues().into();
    extents.sort_by(f64::total_cmp);
    extents[1].max(0.0).sqrt()
}

/// A measured position with its place on the flange and the inverse of its covariance, 1/mm².
struct Seen {
    measured: Point3<f64>,
    place: Point3<f64>,
    weight: Matrix3<f64>,
}

fn pose(readings: &[Reading], frames: &Frames, noise: &Noise) -> Option<OneReading> {
    let seen = readings.iter().filter_map(|reading| seen(reading, frames, noise));
    let seen: Vec<Seen> = seen.collect();
    let main = frames.places()[TargetId::MAIN.0];
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
    let point = *Measured::of(reading, source, noise.stated_size(reading.source), 0.0).point()?;
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
            rows.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
            rows.fixed_view_mut::<3, 3>(0, 3).copy_from(&-arm.cross_matrix());
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
    let point = MeanPoint {
        position,
        // The scatter of each target's readings is in the covariance.
        scatter_mm: [0.0; 3],
        stated_covariance: Some(upper(covariance)),
        motion_covariance: None,
    };
    let turn = MeanOrientation {
        orientation,
        // Of one sample: its mean over all of them is as uncertain as the rigid motion.
        scatter_rad: sd_rad * (kept.max(1) as f64).sqrt(),
        stated_covariance: None,
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
        if let Uncertainty::Tracker(tracker) = &mut source.uncertainty {
            tracker.orientation_rad = Some((squares / orientations_rad.len() as f64).sqrt());
        }
    }
    noise
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{Source, TrackerUncertainty};
    use crate::geometry::{Transform, isometry_from_rpy};
    use crate::join::Pairing;
    use crate::units::Stamp;

    const PLACES: [[f64; 3]; 3] = [[60.0, 20.0, 80.0], [-40.0, 70.0, 60.0], [-10.0, -60.0, 120.0]];
    const NOISE_MM: f64 = 0.02;

    fn frames(places: &[[f64; 3]]) -> Frames {
        let target = |place: &[f64; 3]| Transform::claim(isometry_from_rpy(*place, [0.0; 3]));
        let targets = places.iter().map(target).collect();
        Frames::new(vec![Transform::identity()], targets).expect("some of each")
    }

    fn noise() -> Noise {
        let uncertainty = TrackerUncertainty {
            range_um: 40.0,
            range_um_per_m: 0.0,
            transverse_um: 40.0,
            transverse_um_per_m: 0.0,
            divisor: 2.0,
            orientation_rad: None,
        };
        let reads = ReadingKind::Point;
        Noise::of_one(Source { reads, uncertainty: uncertainty.into() }, 0.03)
    }

    /// A station with readings of these targets, each moved by `off`.
    fn station(
        flange: &Isometry3<f64>,
        targets: &[usize],
        off: impl Fn(usize) -> Vector3<f64>,
    ) -> Station {
        let reading = |&target: &usize| Reading {
            source: SourceId::ONLY,
            target: TargetId(target),
            value: Value::Point(MeanPoint {
                position: flange * Point3::from(PLACES[target]) + off(target),
                scatter_mm: [0.0; 3],
                stated_covariance: None,
                motion_covariance: None,
            }),
            kept: 10,
            taken: 12,
            first: Stamp::from_ns(0),
            last: Stamp::from_ns(0),
            temperature_c: None,
        };
        Station {
            number: 0,
            start: Stamp::from_ns(0),
            end: Stamp::from_ns(0),
            joints: vec![0.0; 6],
            joint_samples: 1,
            command: None,
            readings: targets.iter().map(reading).collect(),
            pairing: Pairing::Paired,
        }
    }

    fn flange() -> Isometry3<f64> {
        isometry_from_rpy([2500.0, -900.0, 400.0], [0.2, -0.1, 2.0])
    }

    #[test]
    fn three_targets_show_the_flange_two_the_main_target_and_another_nothing() {
        let of = |targets: &[usize]| {
            let station = station(&flange(), targets, |_| Vector3::zeros());
            OneReading::of(&station, &frames(&PLACES), &noise())
        };
        let Some(OneReading::Pose(pose, sd_rad)) = of(&[0, 1, 2]) else {
            panic!("three targets show a pose");
        };
        let off = pose.orientation().expect("an orientation");
        assert!(off.angle_to(&flange().rotation) < 1e-9);
        let main = flange() * Point3::from(PLACES[0]);
        assert!((pose.position().expect("a position") - main).norm() < 1e-9);
        // 0.02 mm at some 70 mm from the middle, three of them.
        assert!(sd_rad > 1e-4 && sd_rad < 4e-4, "{sd_rad}");
        assert_eq!((pose.kept, pose.taken), (30, 36));
        let two = of(&[0, 2]).expect("the main target");
        assert_eq!(two.reading().position(), Some(main));
        assert!(matches!(two, OneReading::Point(_)));
        assert_eq!(of(&[1, 2]), None);
        // In line, three are as good as two.
        let line = [[0.0; 3], [50.0, 0.0, 0.0], [100.0, 1e-3, 0.0]];
        let station = station(&flange(), &[0, 1, 2], |target| {
            flange() * (Point3::from(line[target]) - Point3::from(PLACES[target]))
        });
        let one = OneReading::of(&station, &frames(&line), &noise());
        assert!(matches!(one, Some(OneReading::Point(_))), "{one:?}");
        assert_eq!(turn_behind(&frames(&line), &frames(&line)), None);
    }

    #[test]
    fn the_covariance_is_that_of_repeated_readings() {
        // Each coordinate of each reading off by one standard deviation in turn: independent parts, whose squares add up.
        let frames = frames(&PLACES);
        let at = |off: &dyn Fn(usize) -> Vector3<f64>| match OneReading::of(
            &station(&flange(), &[0, 1, 2], off),
            &frames,
            &noise(),
        ) {
            Some(OneReading::Pose(reading, sd_rad)) => (reading, sd_rad),
            other => panic!("{other:?}"),
        };
        let (exact, sd_rad) = at(&|_| Vector3::zeros());
        let stated = exact.value.point().and_then(|point| point.stated_covariance);
        let stated = stated.expect("a covariance");
        let (mut places, mut turns) = (Matrix3::zeros(), 0.0);
        for (moved, axis) in (0..3).flat_map(|target| (0..3).map(move |axis| (target, axis))) {
            let off = |target: usize| {
                let mut off = Vector3::zeros();
                off[axis] = if target == moved { NOISE_MM } else { 0.0 };
                off
            };
            let (reading, _) = at(&off);
            let away = reading.position().expect("read") - exact.position().expect("read");
            places += away * away.transpose();
            let turn = reading.orientation().expect("read");
            turns += turn.angle_to(&exact.orientation().expect("read")).powi(2);
        }
        assert!(((turns / 3.0).sqrt() / sd_rad - 1.0).abs() < 1e-2);
        let sides = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
        for (side, stated) in sides.into_iter().zip(stated) {
            assert!((places[side] - stated).abs() < 1e-2 * places[(0, 0)], "{side:?}");
        }
    }

    #[test]
    fn an_orientation_by_other_places_is_turned_as_they_are() {
        // Another model has all places turned by a milliradian about the flange's z and shifted: its flange is turned back.
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 1e-3));
        let other =
            PLACES.map(|place| (turn * Vector3::from(place) + Vector3::new(1.0, 2.0, 3.0)).into());
        let (own, other) = (frames(&PLACES), frames(&other));
        let measured = crate::fit::frames::MeasuredFlange {
            orientation: flange().rotation,
            places: own.places(),
        };
        let by_other = measured.by_places(&other);
        assert!(by_other.angle_to(&(flange().rotation * turn.inverse())) < 1e-9);
        // Behind the other model's flange stands what brings it back.
        let behind = turn_behind(&own, &other).expect("three targets");
        assert!((by_other * behind).angle_to(&flange().rotation) < 1e-9);
    }
}
