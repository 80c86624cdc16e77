//! Instruments in the place of a laser tracker: a scanner that reads points along lines of sight, and a camera that sees a flat target.
//!
//! Each has its own noise and states the covariance of every reading. A camera finds the pose that fits the image points of the target's
//! corners best, by Gauss and Newton: from the truth or, of a flipped view, from the solution beside it. This shares no code with
//! [`crate::fit`], so that one can be held against the other.

use nalgebra::{
    Isometry3, Matrix2x3, Matrix3, Matrix6, Point3, Rotation3, UnitQuaternion, Vector2, Vector3,
    Vector6,
};

use super::poses::Commanded;
use super::random::Stream;
use super::settings::{CameraSettings, Instrument, ScannerSettings, SimulateSettings};
use super::{far_axis, short};
use crate::geometry::{PoseCovariance, rpy, upper};
use crate::units::MM_PER_M;

/// A target that is seen at a smaller cosine of the slant is not found in the image.
const LEAST_COSINE: f64 = 0.2;
/// Least depth in front of the camera, beside the target's edge, at which a target is found, mm.
const LEAST_DEPTH_MM: f64 = 100.0;
const STEPS: usize = 20;
/// Largest turn of one, rad: a larger one would leave the solution near which it began.
const LARGEST_TURN_RAD: f64 = 0.25;
/// The slant at which a flat target in the middle of the poses is seen, rad: tilts of one that is seen from the front are hard to tell.
const SLANT_RAD: f64 = 0.7;

/// The settings with the instrument in its place: at its distance from the middle of the poses, on the side that most of them turn to. A
/// flat target is seen at a slant there.
pub(super) fn placed(settings: &SimulateSettings, commanded: &[Commanded]) -> SimulateSettings {
    let mut placed = settings.clone();
    let (distance_mm, is_on_flange) = match settings.instrument {
        Instrument::Tracker => return placed,
        Instrument::Scanner(ref own) => (own.distance_mm, false),
        Instrument::Camera(ref own) => (own.distance_mm, own.on_flange),
    };
    let poses = || commanded.iter().map(|own| &own.base_from_target);
    let count = commanded.len().max(1) as f64;
    let normal: Vector3<f64> = poses().map(|own| own.rotation * Vector3::z()).sum();
    let ahead = normal.try_normalize(f64::MIN_POSITIVE).unwrap_or_else(Vector3::x);
    let upright = far_axis(&ahead);
    let across = ahead.cross(&upright).normalize();
    let slanted = UnitQuaternion::from_scaled_axis(across * SLANT_RAD) * ahead;
    // Where the instrument's readings are stated: the camera itself, or the fixed target that one on the flange looks at along its z.
    let at = |own: &Isometry3<f64>| {
        if is_on_flange {
            (own * Point3::new(0.0, 0.0, distance_mm)).coords
        } else {
            own.translation.vector + slanted * distance_mm
        }
    };
    let middle = poses().map(at).sum::<Vector3<f64>>() / count;
    let base_from_instrument =
        Isometry3::from_parts(middle.into(), UnitQuaternion::face_towards(&-slanted, &upright));
    let instrument_from_base = base_from_instrument.inverse();
    let cell = &mut placed.cell;
    cell.tracker_from_base_mm = instrument_from_base.translation.vector.into();
    cell.tracker_from_base_rpy = rpy(&instrument_from_base.rotation);
    placed
}

impl Instrument {
    /// Whether the target is found at its pose in the instrument's frame (of a camera on the flange: in the frame of the fixed target).
    pub(super) fn sees(&self, pose: &Isometry3<f64>) -> bool {
        match self {
            Self::Tracker | Self::Scanner(_) => true,
            Self::Camera(own) => own.sees(&own.camera_from_board(pose)),
        }
    }

    /// The pose that an exact instrument reads of one in its frame: a camera on the flange reads the fixed target.
    pub(super) fn exact(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        match self {
            Self::Tracker | Self::Scanner(_) => *pose,
            Self::Camera(own) => own.camera_from_board(pose),
        }
    }

    /// The covariance that a reading of this pose states; `None` of a tracker.
    pub(super) fn stated(&self, read: &Isometry3<f64>, understated: f64) -> Option<PoseCovariance> {
        let factor = understated.powi(-2);
        match self {
            Self::Tracker => None,
            Self::Scanner(own) => Some(PoseCovariance {
                position: Some(upper(&(own.covariance(&read.translation.vector) * factor))),
                turn: None,
            }),
            Self::Camera(own) => Some(PoseCovariance::of(&(own.covariance(read)? * factor))),
        }
        .map(|own| shortened(&own))
    }
}

impl ScannerSettings {
    /// Standard deviations along and across the line of sight at a distance, mm.
    pub(super) fn sds_mm(&self, distance_mm: f64) -> [f64; 2] {
        let far = distance_mm / MM_PER_M;
        [self.along_mm * far * far, self.across_mm * far]
    }

    /// Covariance of a point in the scanner's frame, mm².
    fn covariance(&self, point: &Vector3<f64>) -> Matrix3<f64> {
        let [along, across] = self.sds_mm(point.norm());
        let ray = point.try_normalize(0.0).unwrap_or_else(Vector3::z);
        let onto = ray * ray.transpose();
        onto * along.powi(2) + (Matrix3::identity() - onto) * across.powi(2)
    }
}

impl CameraSettings {
    fn camera_from_board(&self, pose: &Isometry3<f64>) -> Isometry3<f64> {
        if self.on_flange { pose.inverse() } else { *pose }
    }

    fn sees(&self, camera_from_board: &Isometry3<f64>) -> bool {
        camera_from_board.translation.vector.z > LEAST_DEPTH_MM + self.target_mm
            && cosine(camera_from_board) > LEAST_COSINE
    }

    /// Noise of a corner in the image, pixels: one that is seen at a slant is found worse.
    fn noise_px(&self, camera_from_board: &Isometry3<f64>) -> f64 {
        self.noise_px / cosine(camera_from_board).max(LEAST_COSINE)
    }

    /// Corners in the target's frame, mm.
    fn corners(&self) -> Vec<Vector3<f64>> {
        let last = f64::from(self.corners - 1);
        let place = move |corner: u32| self.target_mm * (f64::from(corner) / last - 0.5);
        let rows = 0..self.corners;
        rows.flat_map(|row| (0..self.corners).map(move |own| (row, own)))
            .map(|(row, own)| Vector3::new(place(own), place(row), 0.0))
            .collect()
    }

    /// Number of normal numbers that one view takes.
    pub(super) fn draws(&self) -> usize {
        2 * (self.corners * self.corners) as usize
    }

    /// What the camera reads of a pose, as the log has it: the target's pose in the camera's frame that fits noisy corners best. `normals`
    /// are standard normal numbers, two for each corner.
    pub(super) fn read(
        &self,
        truth: &Isometry3<f64>,
        normals: &[f64],
        is_flipped: bool,
    ) -> Isometry3<f64> {
        let truth = self.camera_from_board(truth);
        let noise_px = self.noise_px(&truth);
        let corners = self.corners();
        let noise = normals.chunks_exact(2).map(|own| Vector2::new(own[0], own[1]) * noise_px);
        let seen = corners.iter().zip(noise);
        let seen = seen.map(|(corner, noise)| self.image(&truth, corner).0 + noise);
        let seen: Vec<Vector2<f64>> = seen.collect();
        let mut found = if is_flipped { beside(&truth) } else { truth };
        for _ in 0..STEPS {
            let Some(step) = self.step(&found, &corners, &seen) else { break };
            found = moved(&found, &step);
        }
        found
    }

    /// Covariance of a target's pose as read in the camera's frame: of position and rotation about its axes, mm² and rad².
    fn covariance(&self, pose: &Isometry3<f64>) -> Option<Matrix6<f64>> {
        let unit = self.unit();
        let mut normal = Matrix6::zeros();
        for corner in self.corners() {
            for row in self.rows(pose, &corner).1 {
                normal += row * row.transpose();
            }
        }
        // Rounding can make it indefinite, which is no covariance.
        normal.cholesky()?;
        let inverse = normal.try_inverse()? * self.noise_px(pose).powi(2);
        Some(Matrix6::from_fn(|i, j| inverse[(i, j)] * unit[i] * unit[j]))
    }

    /// Rotations count at the target's edge: all columns are in mm.
    fn unit(&self) -> Vector6<f64> {
        Vector6::from_fn(|row, _| if row < 3 { 1.0 } else { 1.0 / self.target_mm })
    }

    /// Image point of a corner, pixels, and its derivative with the corner's place in the camera's frame.
    fn image(
        &self,
        pose: &Isometry3<f64>,
        corner: &Vector3<f64>,
    ) -> (Vector2<f64>, Matrix2x3<f64>) {
        let at = pose * Point3::from(*corner);
        let scale = self.focal_px / at.z;
        let point = Vector2::new(at.x, at.y) * scale;
        (point, Matrix2x3::new(scale, 0.0, -point.x / at.z, 0.0, scale, -point.y / at.z))
    }

    /// Image point of a corner, pixels, and its derivatives with the pose, in units of [`Self::unit`]: a row for each axis of the image.
    fn rows(
        &self,
        pose: &Isometry3<f64>,
        corner: &Vector3<f64>,
    ) -> (Vector2<f64>, [Vector6<f64>; 2]) {
        let unit = self.unit();
        let (point, by_place) = self.image(pose, corner);
        let lever = pose.rotation * corner;
        let by_turn = by_place * -lever.cross_matrix();
        let row = |axis: usize| {
            let entry = |column: usize| {
                if column < 3 { by_place[(axis, column)] } else { by_turn[(axis, column - 3)] }
            };
            Vector6::from_fn(|column, _| entry(column)).component_mul(&unit)
        };
        (point, [row(0), row(1)])
    }

    /// The step of Gauss and Newton from a pose, mm and rad; `None` where the corners do not show a pose.
    fn step(
        &self,
        pose: &Isometry3<f64>,
        corners: &[Vector3<f64>],
        seen: &[Vector2<f64>],
    ) -> Option<Vector6<f64>> {
        let mut normal = Matrix6::zeros();
        let mut right = Vector6::zeros();
        for (corner, seen) in corners.iter().zip(seen) {
            let (point, rows) = self.rows(pose, corner);
            for (axis, row) in rows.iter().enumerate() {
                normal += row * row.transpose();
                right += row * (seen[axis] - point[axis]);
            }
        }
        Some(normal.cholesky()?.solve(&right).component_mul(&self.unit()))
    }
}

fn cosine(camera_from_board: &Isometry3<f64>) -> f64 {
    let ray = camera_from_board.translation.vector.normalize();
    (camera_from_board.rotation * Vector3::z()).dot(&ray).abs()
}

/// A pose after a step of position and rotation vector, no further than [`LARGEST_TURN_RAD`].
fn moved(pose: &Isometry3<f64>, step: &Vector6<f64>) -> Isometry3<f64> {
    let turn = step.fixed_rows::<3>(3).norm();
    let step = step * (LARGEST_TURN_RAD / turn.max(LARGEST_TURN_RAD));
    let shift = pose.translation.vector + step.fixed_rows::<3>(0);
    let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
    Isometry3::from_parts(shift.into(), turn * pose.rotation)
}

/// The target with its normal mirrored about the line of sight, where the second solution is near.
fn beside(truth: &Isometry3<f64>) -> Isometry3<f64> {
    let ray = truth.translation.vector.normalize();
    let mirrored = |v: Vector3<f64>| v - ray * (2.0 * v.dot(&ray));
    let (x, y) = (mirrored(truth.rotation * Vector3::x()), mirrored(truth.rotation * Vector3::y()));
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, x.cross(&y)]));
    Isometry3::from_parts(truth.translation, UnitQuaternion::from_rotation_matrix(&turn))
}

/// The covariance with entries that are the same on all machines.
fn shortened(own: &PoseCovariance) -> PoseCovariance {
    let mut own = *own;
    own.position = own.position.map(|entries| entries.map(short));
    if let Some(turn) = &mut own.turn {
        turn.own = turn.own.map(short);
        turn.with_position = turn.with_position.map(short);
    }
    own
}

/// A drawn view of each stop: the part of the noise that all its readings share, and whether it is flipped.
pub(super) struct Views {
    shared: Vec<Vec<f64>>,
    flipped: Vec<bool>,
}

impl Views {
    /// Those of `stops` stops; nothing is drawn for instruments without images.
    pub(super) fn draw(instrument: &Instrument, stops: usize, stream: &mut Stream) -> Self {
        let Instrument::Camera(own) = instrument else {
            return Self { shared: Vec::new(), flipped: Vec::new() };
        };
        let drawn = (0..stops).map(|_| {
            let is_flipped = stream.uniform() < own.flipped_share;
            (stream.normals(own.draws(), 1.0), is_flipped)
        });
        let (shared, flipped) = drawn.unzip();
        Self { shared, flipped }
    }

    /// The noise of a reading at a stop, by fresh numbers for its own half, and whether it is flipped.
    pub(super) fn noise(&self, stop: usize, own: &[f64]) -> (Vec<f64>, bool) {
        let both = self.shared[stop].iter().zip(own);
        let noise = both.map(|(shared, own)| (shared + own) * std::f64::consts::FRAC_1_SQRT_2);
        (noise.collect(), self.flipped[stop])
    }
}

#[cfg(test)]
mod tests {
    use super::super::random::Ingredient;
    use super::*;
    use crate::geometry::symmetric;

    fn camera() -> CameraSettings {
        CameraSettings {
            focal_px: 1500.0,
            noise_px: 0.2,
            target_mm: 240.0,
            corners: 3,
            on_flange: false,
            distance_mm: 1500.0,
            flipped_share: 0.0,
        }
    }

    fn pose(slant_rad: f64) -> Isometry3<f64> {
        let facing = std::f64::consts::PI - slant_rad;
        Isometry3::new(Vector3::new(80.0, -40.0, 1500.0), Vector3::new(facing, 0.0, 0.0))
    }

    #[test]
    fn what_is_stated_is_the_scatter_of_what_is_read() {
        // Both mountings: the error of the target's pose in the camera's frame.
        let own = camera();
        let truth = pose(0.7);
        let mut stream = Stream::new(3, Ingredient::Image);
        let mut scatter = Matrix6::zeros();
        let count = 4000;
        for _ in 0..count {
            let read = own.read(&truth, &stream.normals(own.draws(), 1.0), false);
            let away = read.translation.vector - truth.translation.vector;
            let turn = (read.rotation * truth.rotation.inverse()).scaled_axis();
            let off = Vector6::new(away.x, away.y, away.z, turn.x, turn.y, turn.z);
            scatter += off * off.transpose() / f64::from(count);
        }
        let stated = own.covariance(&truth).expect("seen");
        for axis in 0..6 {
            let ratio = scatter[(axis, axis)] / stated[(axis, axis)];
            assert!((ratio - 1.0).abs() < 0.1, "{axis}: {ratio}");
        }
    }

    #[test]
    fn a_flipped_view_is_the_second_solution_of_a_small_target() {
        let own = CameraSettings { target_mm: 40.0, ..camera() };
        let truth = pose(0.5);
        let none = vec![0.0; own.draws()];
        let seen = own.read(&truth, &none, false);
        assert!(seen.rotation.angle_to(&truth.rotation) < 1e-9);
        let flipped = own.read(&truth, &none, true);
        let normals = [&truth, &flipped].map(|own| own.rotation * Vector3::z());
        // Mirrored about the ray: twice the slant apart.
        let apart = normals[0].angle(&normals[1]);
        assert!((apart - 1.0).abs() < 0.2, "{apart}");
    }

    #[test]
    fn a_scanner_states_a_covariance_along_the_line_of_sight() {
        let own = ScannerSettings { along_mm: 0.1, across_mm: 0.02, distance_mm: 1500.0 };
        let read = Isometry3::translation(0.0, 0.0, 2000.0);
        let stated = Instrument::Scanner(own).stated(&read, 2.0);
        let stated = stated.and_then(|own| own.position).map(symmetric);
        let stated = stated.expect("a position's");
        // Half of 0.4 and of 0.04 mm.
        assert!((stated[(2, 2)].sqrt() - 0.2).abs() < 1e-9, "{stated}");
        assert!((stated[(0, 0)].sqrt() - 0.02).abs() < 1e-9, "{stated}");
    }
}
