//! The measured values of a reading by kind: rows of its residual, the residual, its motion with the target, covariance.
//!
//! A kind of reading (a distance, say) is a variant of [`crate::join::ReadingKind`] and [`ByKind`], with its rows one at a time in this file and in blocks in [`super::rows`]: the compiler names each of
//! these places, and nothing else in the fit asks for the kind.

use nalgebra::{DMatrix, Isometry3, Matrix3, Matrix6, Point3, UnitQuaternion, Vector3};

use super::{Source, StatedSize};
use crate::fit::gauge::Gauge;
use crate::geometry::{TurnCovariance, pose_covariance, symmetric};
use crate::join::{ByKind, MeanLength, MeanOrientation, MeanPoint, Reading, ReadingKind, Value};
use crate::kinematics::Twist;

/// The measured values of a station with their uncertainty, in the source's frame.
pub type Measured = ByKind<MeasuredPoint, MeasuredOrientation, MeasuredLength>;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredLength {
    pub mm: f64,
    /// Its standard uncertainty without the arm's share, mm.
    pub instrument_mm: f64,
    /// Its whole standard uncertainty, repeatability included, mm.
    pub sd_mm: f64,
}

/// The part of a target's motion that a reading shows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shown {
    /// Its motion: three rows.
    Point,
    /// Its motion and its turn: six rows.
    Pose,
    /// Its motion along a direction: one row.
    Along(Vector3<f64>),
}

impl Shown {
    pub const fn rows(&self) -> usize {
        match self {
            Self::Point => 3,
            Self::Pose => 6,
            Self::Along(_) => 1,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredPoint {
    pub position: Point3<f64>,
    /// Covariance of the position without the arm's share: instrument and scatter of the mean, mm².
    pub instrument: Matrix3<f64>,
    /// Lower triangle L of the position's whole covariance `L Lᵀ`, repeatability included, mm.
    pub factor: Matrix3<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeasuredOrientation {
    pub orientation: UnitQuaternion<f64>,
    /// Standard uncertainty per axis, rad; root mean square of the three axes where they differ.
    pub sd_rad: f64,
    /// The rows' covariance with the position's; `None` where axes are alike and independent of the position.
    pub joint: Option<JointCovariance>,
}

/// Covariance of an orientation whose axes differ, and that is correlated with the position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointCovariance {
    /// Covariance of position and rotation vector without the arm's share, mm² and rad².
    pub instrument: Matrix6<f64>,
    /// Share of the position's residual in the whitened rows of the orientation, per mm.
    pub from_position: Matrix3<f64>,
    /// Share of the orientation's own residual in them, per rad.
    pub own: Matrix3<f64>,
}

impl Measured {
    /// The values of a reading of `source` that a fit uses: no orientation from a source of points, or from one without a
    /// stated uncertainty of orientations.
    pub(in crate::fit) fn of(
        reading: &Reading,
        source: &Source,
        size: StatedSize,
        repeatability_mm: f64,
    ) -> Self {
        let place = |point: &MeanPoint, turn: Option<&MeanOrientation>| {
            let instrument = Instrument::of(point, turn, reading, source, size);
            (MeasuredPoint::of(point, &instrument, repeatability_mm), instrument)
        };
        match (&reading.value, source.reads) {
            (Value::Pose(of, turn), ReadingKind::Pose) => {
                let (point, instrument) = place(of, Some(turn));
                match MeasuredOrientation::of(turn, &point, &instrument, reading, source) {
                    None => Self::Point(point),
                    Some(turn) => Self::Pose(point, turn),
                }
            }
            (Value::Pose(of, turn), _) => Self::Point(place(of, Some(turn)).0),
            (Value::Point(of), _) => Self::Point(place(of, None).0),
            (Value::Distance(of), _) => Self::Distance(MeasuredLength::of(of, repeatability_mm)),
            (Value::Height(of), _) => Self::Height(MeasuredLength::of(of, repeatability_mm)),
        }
    }

    /// The part of the target's motion shown at `target`, its place in the source's frame; `gauge`: the source's, where it reads a length.
    pub fn shown(&self, gauge: Option<&Gauge>, target: &Point3<f64>) -> Shown {
        match self {
            Self::Point(_) => Shown::Point,
            Self::Pose(..) => Shown::Pose,
            Self::Distance(_) | Self::Height(_) => {
                Shown::Along(gauge.map_or_else(Vector3::zeros, |gauge| gauge.direction(target)))
            }
        }
    }

    #[must_use]
    pub const fn without_turn(self) -> Self {
        match self {
            Self::Point(point) | Self::Pose(point, _) => Self::Point(point),
            Self::Distance(_) | Self::Height(_) => self,
        }
    }

    /// Variance of a coordinate of its position, or of its length, repeatability included, mm².
    pub fn variance_mm2(&self) -> f64 {
        match self {
            Self::Point(point) | Self::Pose(point, _) => point.factor.norm_squared() / 3.0,
            Self::Distance(length) | Self::Height(length) => length.sd_mm.powi(2),
        }
    }

    /// This measurement with all standard deviations multiplied by `by`.
    #[must_use]
    pub fn widened(self, by: f64) -> Self {
        let point = |point: MeasuredPoint| MeasuredPoint {
            instrument: point.instrument * (by * by),
            factor: point.factor * by,
            ..point
        };
        let length = |length: MeasuredLength| MeasuredLength {
            instrument_mm: length.instrument_mm * by,
            sd_mm: length.sd_mm * by,
            ..length
        };
        match self {
            Self::Point(own) => Self::Point(point(own)),
            Self::Pose(own, turn) => Self::Pose(point(own), turn.widened(by)),
            Self::Distance(own) => Self::Distance(length(own)),
            Self::Height(own) => Self::Height(length(own)),
        }
    }

    /// Measured minus `predicted`, the target's pose in the source's frame: one number per row, mm and rad. `gauge` is the source's,
    /// where it reads a length.
    pub fn residual(&self, predicted: &Isometry3<f64>, gauge: Option<&Gauge>) -> Vec<f64> {
        let away = |point: &MeasuredPoint| point.position.coords - predicted.translation.vector;
        let mut rows = Vec::with_capacity(self.kind().rows());
        match self {
            Self::Point(point) => rows.extend(away(point).iter()),
            Self::Pose(point, turn) => {
                rows.extend(away(point).iter());
                rows.extend(turn.residual(&predicted.rotation).iter());
            }
            Self::Distance(length) | Self::Height(length) => {
                let target = Point3::from(predicted.translation.vector);
                rows.push(gauge.map_or(0.0, |gauge| length.mm - gauge.reading_mm(&target)));
            }
        }
        rows
    }

    /// The instrument's covariance of the rows, mm² and rad².
    pub fn instrument(&self) -> DMatrix<f64> {
        let rows = self.kind().rows();
        let mut covariance = DMatrix::zeros(rows, rows);
        let mut put = |point: &MeasuredPoint| {
            covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&point.instrument);
        };
        match self {
            Self::Point(point) => put(point),
            Self::Pose(point, turn) => {
                put(point);
                (3..6).for_each(|axis| covariance[(axis, axis)] = turn.sd_rad * turn.sd_rad);
                if let Some(joint) = turn.joint {
                    covariance.copy_from(&joint.instrument);
                }
            }
            Self::Distance(length) | Self::Height(length) => {
                covariance[(0, 0)] = length.instrument_mm.powi(2);
            }
        }
        covariance
    }
}

/// Writes the change of a reading's rows by `amount` of a motion of the target into `rows`, one number per row.
pub fn moved(shown: &Shown, twist: &Twist, amount: f64, rows: &mut [f64]) {
    match shown {
        Shown::Point => put(&(twist.linear * amount), rows),
        Shown::Along(direction) => rows[0] = direction.dot(&twist.linear) * amount,
        Shown::Pose => {
            let (position, turn) = rows.split_at_mut(3);
            put(&(twist.linear * amount), position);
            put(&(twist.angular * amount), turn);
        }
    }
}

fn put(vector: &Vector3<f64>, rows: &mut [f64]) {
    rows.copy_from_slice(vector.as_slice());
}

/// The kind with the most rows among all: a pose where any orientation is measured.
pub(in crate::fit) fn widest<'m>(all: impl IntoIterator<Item = &'m Measured>) -> ReadingKind {
    all.into_iter().map(Measured::kind).max_by_key(|kind| kind.rows()).unwrap_or(ReadingKind::Point)
}

impl MeasuredLength {
    /// The least standard uncertainty of a length, mm: a weight has to be finite.
    const LEAST_MM: f64 = 1e-6;

    fn of(length: &MeanLength, repeatability_mm: f64) -> Self {
        Self {
            mm: length.mm,
            instrument_mm: length.sd_mm,
            // Across its direction the arm's repeatability changes a length by nothing.
            sd_mm: length.sd_mm.hypot(repeatability_mm).max(Self::LEAST_MM),
        }
    }
}

/// The covariance that a reading states of its own rows, mm² and rad²: as it is used in a fit, with factors of 1. `None` where it states
/// none, and of a camera, whose own size covers what its readings state.
pub fn stated_of(reading: &Reading, source: &Source) -> Option<DMatrix<f64>> {
    let point = reading.value.point()?;
    if source.uncertainty.camera().is_some() {
        return None;
    }
    let turn = reading.value.turn().filter(|_| source.reads == ReadingKind::Pose);
    let stated_turn = turn.and_then(|turn| turn.stated_covariance);
    if point.stated_covariance.is_none() && stated_turn.is_none() {
        return None;
    }
    // What is not stated is known beside it.
    let position = point.stated_covariance.map_or_else(Matrix3::zeros, symmetric);
    let whole = of_parts(&position, &stated_turn.unwrap_or_default());
    let has_turn = turn.is_some() && (stated_turn.is_some() || source.states_orientations());
    let rows = if has_turn { 6 } else { 3 };
    Some(DMatrix::from_fn(rows, rows, |row, column| whole[(row, column)]))
}

/// Covariance of an instrument and of the mean of its samples at a reading.
#[expect(
    clippy::large_enum_variant,
    reason = "one at a time, while a reading becomes an observation"
)]
enum Instrument {
    Point(Matrix3<f64>),
    /// Covariance of position and rotation vector, mm² and rad².
    Pose(Matrix6<f64>),
}

impl Instrument {
    fn of(
        point: &MeanPoint,
        turn: Option<&MeanOrientation>,
        reading: &Reading,
        source: &Source,
        size: StatedSize,
    ) -> Self {
        let kept = reading.kept.max(1) as f64;
        let scatter = point.scatter_mm.map(|scatter| scatter.powi(2) / kept);
        let moving = point.motion_covariance.map_or_else(Matrix3::zeros, symmetric);
        let modelled = || source.uncertainty.covariance(&point.position);
        let mut whole = match (turn, source.uncertainty.camera()) {
            (Some(turn), Some(camera)) => {
                let pose = Isometry3::from_parts(point.position.into(), turn.orientation);
                camera.of_reading(&pose, &point.stated_with(turn))
            }
            (Some(turn), None) if turn.stated_covariance.is_some() => {
                let stated = point.stated_with(turn).scaled(size.position, size.orientation);
                let position = stated.position.map_or_else(modelled, symmetric);
                of_parts(&position, &stated.turn.unwrap_or_default())
            }
            (_, camera) => {
                let size = camera.map_or(size.position, |camera| camera.size);
                let position = match point.stated_covariance.map(symmetric) {
                    Some(own) => scattered(&(own * size.powi(2)), scatter),
                    None => modelled() + Matrix3::from_diagonal(&scatter.into()),
                };
                return Self::Point(position + moving);
            }
        };
        let scatter_rad = turn.map_or(0.0, |turn| turn.scatter_rad);
        for (from, scatter) in [(0, scatter), (3, [scatter_rad.powi(2) / kept; 3])] {
            scatter_block(&mut whole, from, scatter);
        }
        let mut position = whole.fixed_view_mut::<3, 3>(0, 0);
        position += moving;
        Self::Pose(whole)
    }

    fn of_position(&self) -> Matrix3<f64> {
        match self {
            Self::Point(covariance) => *covariance,
            Self::Pose(covariance) => covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        }
    }
}

/// Factor on the variances of a covariance block that adds the variances of a scatter, summed over the axes, in the block's own shape;
/// `None` where the block is zero.
fn by_scatter(block: &Matrix3<f64>, scatter: [f64; 3]) -> Option<f64> {
    let all = block.trace();
    (all > 0.0).then(|| 1.0 + scatter.iter().sum::<f64>() / all)
}

/// A stated covariance with the scatter of the mean of its samples. Readings that state a covariance scatter along its axes: a variance
/// along the axes of the frame would be far too large where the noise is small.
fn scattered(stated: &Matrix3<f64>, scatter: [f64; 3]) -> Matrix3<f64> {
    by_scatter(stated, scatter)
        .map_or_else(|| Matrix3::from_diagonal(&scatter.into()), |factor| stated * factor)
}

/// Adds the scatter of the mean to a block of a pose's covariance, which stays as it is correlated with the other.
fn scatter_block(whole: &mut Matrix6<f64>, from: usize, scatter: [f64; 3]) {
    let block: Matrix3<f64> = whole.fixed_view::<3, 3>(from, from).into_owned();
    let Some(factor) = by_scatter(&block, scatter) else {
        for (axis, variance) in scatter.into_iter().enumerate() {
            whole[(from + axis, from + axis)] += variance;
        }
        return;
    };
    let root = factor.sqrt();
    for own in from..from + 3 {
        whole.row_mut(own).scale_mut(root);
        whole.column_mut(own).scale_mut(root);
    }
}

/// The covariance of a pose from its parts; where these do not belong together, as means over different readings need not, without
/// that of one with the other.
fn of_parts(position: &Matrix3<f64>, turn: &TurnCovariance) -> Matrix6<f64> {
    if pose_covariance::is_joint(position, turn) {
        return pose_covariance::joint(position, turn);
    }
    let alone = TurnCovariance { with_position: [0.0; 9], ..*turn };
    pose_covariance::joint(position, &alone)
}

impl MeasuredPoint {
    fn of(point: &MeanPoint, instrument: &Instrument, repeatability_mm: f64) -> Self {
        let instrument = instrument.of_position();
        let covariance = instrument + Matrix3::identity() * repeatability_mm.powi(2);
        let isotropic = || Matrix3::identity() * repeatability_mm.max(1e-3);
        Self {
            position: point.position,
            instrument,
            factor: covariance.cholesky().map_or_else(isotropic, |factor| factor.l()),
        }
    }

    /// The position's whole covariance, repeatability included, mm².
    fn whole(&self) -> Matrix3<f64> {
        self.factor * self.factor.transpose()
    }
}

impl JointCovariance {
    /// The rows of an orientation beside a position with this whole covariance; `None` where they are not positive definite.
    fn of(instrument: &Matrix6<f64>, position: &MeasuredPoint) -> Option<Self> {
        let across = instrument.fixed_view::<3, 3>(3, 0) * position.whole().try_inverse()?;
        let own =
            instrument.fixed_view::<3, 3>(3, 3) - across * instrument.fixed_view::<3, 3>(0, 3);
        let own = own.cholesky()?.l().try_inverse()?;
        Some(Self { instrument: *instrument, from_position: -own * across, own })
    }
}

impl MeasuredOrientation {
    fn of(
        turn: &MeanOrientation,
        point: &MeasuredPoint,
        instrument: &Instrument,
        reading: &Reading,
        source: &Source,
    ) -> Option<Self> {
        if let Instrument::Pose(covariance) = instrument {
            let sd_rad = (covariance.fixed_view::<3, 3>(3, 3).trace() / 3.0).sqrt();
            return (sd_rad > 0.0).then(|| Self {
                orientation: turn.orientation,
                sd_rad,
                joint: JointCovariance::of(covariance, point),
            });
        }
        let instrument = source.uncertainty.orientation_rad(&point.position)?;
        let of_mean = turn.scatter_rad.powi(2) / reading.kept.max(1) as f64;
        Some(Self {
            orientation: turn.orientation,
            sd_rad: instrument.mul_add(instrument, of_mean).sqrt(),
            joint: None,
        })
    }

    /// This orientation beside a position, all standard deviations multiplied by `by`.
    fn widened(self, by: f64) -> Self {
        let joint = self.joint.map(|own| JointCovariance {
            instrument: own.instrument * (by * by),
            from_position: own.from_position / by,
            own: own.own / by,
        });
        Self { sd_rad: self.sd_rad * by, joint, ..self }
    }

    /// Whitened rows of the orientation from the position's residual (mm) and its own (rad).
    pub(in crate::fit) fn whitened(
        &self,
        away: &Vector3<f64>,
        turn: &Vector3<f64>,
    ) -> Vector3<f64> {
        match &self.joint {
            None => turn / self.sd_rad,
            Some(joint) => joint.from_position * away + joint.own * turn,
        }
    }

    /// Measured minus predicted as a rotation vector, rad.
    pub(in crate::fit) fn residual(&self, predicted: &UnitQuaternion<f64>) -> Vector3<f64> {
        (self.orientation * predicted.inverse()).scaled_axis()
    }
}
