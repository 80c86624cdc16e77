//! Wrong orientations of targets, flipped views of planar ones among them: named and not fitted.
//!
//! A small planar target looks nearly alike from two orientations: the one that it has, and the one whose normal is mirrored about the
//! viewing ray. Where noise decides, the detector states the wrong one ([`crate::method::uncertainty`]). Inputs: the observations of
//! all sessions and their noise. Output: the readings whose orientation the fit contradicts. Steps:
//! 1. base and targets are fitted with Cauchy's loss, so that wrong readings do not pull them;
//! 2. an orientation is wrong where its whitened residual is far beyond the others';
//! 3. a camera's is a flipped view where its mirrored orientation leaves at most a third of it, in standard deviations and as an angle.
//!
//! A planar target seen nearly from the front has both solutions within the noise: such a reading stays as it is.

use nalgebra::{Isometry3, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::observation::{MeasuredOrientation, Mounted, Noise, Observation};
use super::suspects::{Suspect, SwappedThroughout};
use super::{FitSettings, Freedom, Loss, identify};
use crate::figures::median;
use crate::join::Unmeasured;
use crate::kinematics::Arm;

/// Beyond this many medians of all readings one is far from the fit: errors of a nominal arm are within a few.
const FAR: f64 = 8.0;
/// A median below this is the noise of exact data: whitened residuals of three rows have one of 1.5.
const LEAST_MEDIAN: f64 = 1.5;
/// The mirrored orientation explains a reading where it leaves at most this share.
const EXPLAINS: f64 = 1.0 / 3.0;

struct Compared {
    place: usize,
    /// Norm of the whitened residual, and angle, rad.
    as_measured: (f64, f64),
    /// `None` of a reading that no camera made.
    as_mirrored: Option<(f64, f64)>,
}

/// Wrong orientations among the readings.
pub fn check(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &FitSettings,
    noise: &Noise,
) -> Result<Vec<Suspect>, SwappedThroughout> {
    if !noise.takes_orientations() {
        return Ok(Vec::new());
    }
    let robust = FitSettings { loss: Loss::Cauchy { tuning: 2.0 }, ..settings.clone() };
    let fitted = identify(arm, observations, sessions, Freedom::BaseAndTarget, &robust);
    let Ok(fitted) = fitted else { return Ok(Vec::new()) };
    let compared = observations.iter().enumerate().filter_map(|(place, own)| {
        let camera = noise.sources.get(own.source.0)?.uncertainty.camera();
        let frames = &fitted.frames[own.session];
        let base = frames.tracker_from_base(own.source).isometry();
        let target = frames.flange_from_target(own.target).isometry();
        let predicted = base * arm.chain().nominal(&own.axes) * target;
        compared(place, own, &predicted, camera.map(|own| own.mounted))
    });
    let compared: Vec<Compared> = compared.collect();
    let norms: Vec<f64> = compared.iter().map(|own| own.as_measured.0).collect();
    let gate = FAR * median(&norms).unwrap_or(0.0).max(LEAST_MEDIAN);
    let wrong = compared.iter().filter(|own| own.as_measured.0 > gate).map(|own| {
        let reading = &observations[own.place];
        let (reason, otherwise) = own.wrong(reading.station);
        Suspect::of(reading, reason, otherwise)
    });
    Ok(wrong.collect())
}

fn compared(
    place: usize,
    own: &Observation,
    predicted: &Isometry3<f64>,
    camera: Option<Mounted>,
) -> Option<Compared> {
    let (point, turn) = (own.point()?, own.measured.turn()?);
    let measured = Isometry3::from_parts(point.position.into(), turn.orientation);
    let away = point.position.coords - predicted.translation.vector;
    let of = |turn: &MeasuredOrientation| {
        let residual = turn.residual(&predicted.rotation);
        (turn.whitened(&away, &residual).norm(), residual.norm())
    };
    let as_mirrored = camera.map(|mounted| {
        of(&MeasuredOrientation { orientation: mirrored(&measured, mounted), ..*turn })
    });
    Some(Compared { place, as_measured: of(turn), as_mirrored })
}

impl Compared {
    /// The reason for which the reading is left out.
    fn wrong(&self, station: usize) -> (String, Unmeasured) {
        let (away, turned) = self.as_measured;
        let far = format!(
            "the orientation of station {station} is {:.1}° ({away:.0} standard deviations) from the fit",
            turned.to_degrees()
        );
        // Perspective moves the second solution a little away from the mirrored one, by more than a large target's noise.
        let explains = |(mirrored, mirrored_rad): &(f64, f64)| {
            *mirrored <= EXPLAINS * away && *mirrored_rad <= EXPLAINS * turned
        };
        match self.as_mirrored.filter(explains) {
            Some((mirrored, mirrored_rad)) => (
                format!(
                    "flipped view of a planar target: {far}, and {:.1}° ({mirrored:.1}) with its normal mirrored about the viewing ray",
                    mirrored_rad.to_degrees()
                ),
                Unmeasured::FlippedView,
            ),
            None => (format!("wrong orientation: {far}"), Unmeasured::WrongTarget),
        }
    }
}

/// The orientation of the second solution of a planar target: the target's points with their depths along the ray mirrored.
///
/// Of a camera on the flange the pose is the camera's in the target's frame, and so is the result.
pub fn mirrored(pose: &Isometry3<f64>, mounted: Mounted) -> UnitQuaternion<f64> {
    let camera_from_target = match mounted {
        Mounted::Fixed => *pose,
        Mounted::Flange => pose.inverse(),
    };
    let ray = camera_from_target.translation.vector.try_normalize(0.0).unwrap_or_else(Vector3::z);
    let mirror = Matrix3::identity() - ray * ray.transpose() * 2.0;
    let own = camera_from_target.rotation.to_rotation_matrix();
    // The mirror turns the target's handedness around; its points have no z, so that its normal is turned back.
    let turned = mirror * own.matrix() * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let turned = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(turned));
    match mounted {
        Mounted::Fixed => turned,
        Mounted::Flange => turned.inverse(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn a_mirrored_target_has_the_same_image_from_afar() {
        let turn = UnitQuaternion::from_euler_angles(2.6, 0.3, 0.7);
        let pose = Isometry3::from_parts(Vector3::new(100.0, -50.0, 3000.0).into(), turn);
        let other = Isometry3::from_parts(pose.translation, mirrored(&pose, Mounted::Fixed));
        let ray = pose.translation.vector.normalize();
        for corner in [Point3::new(20.0, 20.0, 0.0), Point3::new(-20.0, 20.0, 0.0)] {
            let (a, b) = (pose * corner, other * corner);
            // Across the ray the same, along it mirrored.
            let across = |p: Point3<f64>| p.coords - ray * p.coords.dot(&ray);
            assert!((across(a) - across(b)).norm() < 1e-9);
            let depth = |p: Point3<f64>| (p.coords - pose.translation.vector).dot(&ray);
            assert!((depth(a) + depth(b)).abs() < 1e-9 && depth(a).abs() > 1.0);
        }
        // The normal is mirrored about the ray, and mirroring twice is nothing.
        let (n, m) = (pose.rotation * Vector3::z(), other.rotation * Vector3::z());
        assert!((m - (ray * (2.0 * n.dot(&ray)) - n)).norm() < 1e-9);
        assert!(mirrored(&other, Mounted::Fixed).angle_to(&pose.rotation) < 1e-9);
        // A camera on the flange states the inverse.
        let inverse = mirrored(&pose.inverse(), Mounted::Flange);
        assert!(inverse.angle_to(&other.rotation.inverse()) < 1e-9);
    }
}
