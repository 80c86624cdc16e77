//! Rows of all stations at the current geometry.
//!
//! The readings of one station (several targets, several instruments) are of one pose that the arm attained, so their noise is
//! correlated ([`super::noise`]): their rows stand one below the other, and are whitened
//! ([`super::whitening`]), weighted and left out together.

use std::borrow::{Borrow, Cow};
use std::ops::Range;
use std::sync::OnceLock;

use nalgebra::{DMatrix, DVector, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::CHUNK;
use super::components::Components;
use super::design::PoseView;
use super::layout::{Block, Layout};
use super::noise::{NoisyReading, Repeatability, StationNoise};
use super::partition::{Partition, Seen};
use super::shapes::JointShapes;
use super::student::Tails;
use crate::fit::frames::{Frames, PerChannel};
use crate::fit::observation::Observation;
use crate::fit::observation::measured::{Shown, moved};
use crate::fit::problem::Problem;
use crate::kinematics::{HeldChain, Twist};

/// Stations whose rows are held at once: they are needed for their sums alone. Fixed, so that results do not depend on threads.
const AT_ONCE: usize = 2048;

/// The model between two rounds of its training.
#[derive(Debug, Clone)]
pub struct State {
    /// Direction against gravity in the base frame; `None` where it is not known.
    pub up: Option<Vector3<f64>>,
    pub layout: Layout,
    pub components: Components,
    pub repeatability: Repeatability,
    pub tails: Tails,
    pub weights: Vec<f64>,
    /// Offsets of the problem's unknowns at which rows are evaluated.
    pub offsets: DVector<f64>,
    /// Span of the drift's basis, stations.
    pub span: f64,
    /// The middle of each session's stations, in the base frame, mm.
    pub middles: Vec<Point3<f64>>,
}

#[derive(Debug, Clone)]
pub struct Row {
    /// Unwhitened rows of the columns in [`Seen::plain`].
    pub plain: DMatrix<f64>,
    pub shapes: Vec<DVector<f64>>,
    /// Measured minus predicted, mm and rad.
    pub value: DVector<f64>,
    pub noise: StationNoise,
}

/// Coefficients of [`Seen::columns`], as [`Row`] has their columns and shapes.
pub struct Coefficients {
    plain: DVector<f64>,
    of_joints: Vec<DVector<f64>>,
}

impl Coefficients {
    /// Those that a session sees, of the columns of the model.
    pub fn of(seen: &Seen, columns: &DVector<f64>) -> Self {
        let own = columns.select_rows(&seen.columns);
        Self {
            plain: own.select_rows(&seen.plain),
            of_joints: seen.of_joints.iter().map(|shapes| shapes.gathered(&own)).collect(),
        }
    }
}

impl Row {
    pub fn times(&self, coefficients: &Coefficients) -> DVector<f64> {
        let mut product = &self.plain * &coefficients.plain;
        let joints = self.shapes.iter().zip(&coefficients.of_joints);
        for ((shapes, own), motion) in joints.zip(self.noise.joints.column_iter()) {
            product.axpy(shapes.dot(own), &motion, 1.0);
        }
        product
    }

    /// The numbers of each joint's shapes of some stations, a column for each station.
    pub fn shapes_of(rows: &[impl Borrow<Self>], seen: &Seen) -> Vec<DMatrix<f64>> {
        let of_joint = |(joint, own): (usize, &JointShapes)| {
            let mut numbers = Vec::with_capacity(own.count() * rows.len());
            for row in rows {
                numbers.extend_from_slice(row.borrow().shapes[joint].as_slice());
            }
            DMatrix::from_vec(own.count(), rows.len(), numbers)
        };
        seen.of_joints.iter().enumerate().map(of_joint).collect()
    }

    /// Its rows of all `columns` columns of the model.
    #[cfg(test)]
    pub fn whole(&self, seen: &Seen, columns: usize) -> DMatrix<f64> {
        let mut rows = DMatrix::zeros(self.value.len(), columns);
        for (own, &place) in self.plain.column_iter().zip(&seen.plain) {
            rows.column_mut(seen.columns[place]).copy_from(&own);
        }
        let joints = self.shapes.iter().zip(&seen.of_joints);
        for ((shapes, own), motion) in joints.zip(self.noise.joints.column_iter()) {
            for (place, share) in own.entries(shapes) {
                rows.column_mut(seen.columns[place]).axpy(share, &motion, 0.0);
            }
        }
        rows
    }
}

struct ReadingRow {
    shown: Shown,
    /// Unwhitened rows of the columns that are no joint's shapes.
    plain: DMatrix<f64>,
    shapes: Vec<DVector<f64>>,
    value: DVector<f64>,
    joints: Vec<Twist>,
    base: Matrix3<f64>,
}

/// The readings of each station, as ranges of observations: those beside each other of one session and station.
pub(super) fn stations(observations: &[Observation]) -> Vec<Range<usize>> {
    let one = |a: &Observation, b: &Observation| (a.session, a.station) == (b.session, b.station);
    let ranges = observations.chunk_by(one).scan(0, |next, group| {
        let first = *next;
        *next += group.len();
        Some(first..*next)
    });
    ranges.collect()
}

/// The prior mean of the columns, relative to the offsets where the rows are evaluated.
pub(super) fn prior_mean(problem: &Problem<'_>, state: &State) -> DVector<f64> {
    let mut mean = DVector::zeros(state.layout.size());
    for (place, precision) in problem.precision.iter().enumerate() {
        if *precision > 0.0 {
            mean[place] = problem.expected[place] - state.offsets[place];
        }
    }
    mean
}

/// The stations of a training and the values that the rows of all of them have in common.
///
/// Rows are made when they are asked for; kept are those of one batch that has all, as a pool's would fill the memory.
pub(super) struct Around<'p> {
    pub problem: &'p Problem<'p>,
    pub state: &'p State,
    frames: Vec<Frames>,
    chains: PerChannel<HeldChain>,
    stations: Vec<Range<usize>>,
    pub partition: Partition,
    seen: Vec<Seen>,
    all: OnceLock<Vec<Row>>,
}

impl<'p> Around<'p> {
    /// The stations of `problem` at `state`.
    pub fn new(problem: &'p Problem<'p>, state: &'p State) -> Self {
        let sessions = problem.starts.len();
        let partition = Partition::of(&state.layout, &problem.unknowns, sessions);
        let joints = state.repeatability.joints.len();
        let seen = |session| Seen::of(&state.layout, &partition, session, joints);
        Self {
            frames: problem.frames(&state.offsets),
            chains: problem.held(&state.offsets),
            stations: stations(problem.observations),
            seen: (0..sessions).map(seen).collect(),
            all: OnceLock::new(),
            partition,
            problem,
            state,
        }
    }

    pub const fn count(&self) -> usize {
        self.stations.len()
    }

    pub fn row_count(&self) -> usize {
        self.problem.observations.iter().map(|own| own.measured.kind().rows()).sum()
    }

    pub fn seen(&self, session: usize) -> &Seen {
        &self.seen[session]
    }

    pub fn session(&self, station: usize) -> usize {
        self.problem.observations[self.stations[station].start].session
    }

    /// All stations, in batches whose rows are held at once: each one's session and the places of its stations.
    pub fn batches(&self) -> Vec<(usize, Vec<usize>)> {
        self.batches_of(&(0..self.count()).collect::<Vec<usize>>())
    }

    pub fn batches_of(&self, stations: &[usize]) -> Vec<(usize, Vec<usize>)> {
        let runs = stations.chunk_by(|&a, &b| self.session(a) == self.session(b));
        let batches = runs.flat_map(|run| run.chunks(AT_ONCE));
        batches.map(|own| (self.session(own[0]), own.to_vec())).collect()
    }

    pub fn rows(&self, stations: &[usize]) -> Cow<'_, [Row]> {
        let row =
            |&place: &usize| self.station(&self.problem.observations[self.stations[place].clone()]);
        let made = || stations.par_iter().with_min_len(CHUNK).map(row).collect();
        if stations.len() == self.count() && self.count() <= AT_ONCE {
            return Cow::Borrowed(self.all.get_or_init(made));
        }
        Cow::Owned(made())
    }
}

impl Around<'_> {
    fn station(&self, readings: &[Observation]) -> Row {
        let mut rows: Vec<ReadingRow> = readings.iter().map(|own| self.reading(own)).collect();
        let noisy = readings.iter().zip(&rows).map(|(observation, row)| NoisyReading {
            observation,
            shown: &row.shown,
            joints: &row.joints,
            base: row.base,
        });
        let noise = StationNoise::of(&noisy.collect::<Vec<_>>());
        let columns = rows.first().map_or(0, |own| own.plain.ncols());
        // The readings are of one pose, so the numbers of its joints are common to them.
        let shapes = rows.first_mut().map(|own| std::mem::take(&mut own.shapes));
        let (plain, value) = match (rows.pop(), &rows[..]) {
            (Some(only), []) => (only.plain, only.value),
            (last, others) => below(others.iter().chain(&last), columns),
        };
        Row { plain, shapes: shapes.unwrap_or_default(), value, noise }
    }

    fn reading(&self, observation: &Observation) -> ReadingRow {
        let (problem, state) = (self.problem, self.state);
        let view = self.chains.of(observation.channel()).view(&observation.axes);
        let base = self.frames[observation.session].tracker_from_base(observation.source);
        let root = base.isometry().rotation;
        let base_axes = *root.to_rotation_matrix().matrix();
        let pose = PoseView {
            unknowns: &view.unknowns,
            joints: &view.joints,
            axes: &view.axes,
            end: view.end.translation.vector.into(),
            up: state.up.map(|up| root * up),
            base: base_axes,
            angles: &observation.axes,
            settling_error: observation.settling_error.as_ref(),
            session: Some(observation.session),
            time: Some(observation.station as f64 / state.span),
            middle: base.isometry() * state.middles[observation.session],
        };
        let gauge = problem.gauge(observation.channel(), &state.offsets);
        let end = Point3::from(view.end.translation.vector);
        let shown = observation.measured.shown(gauge.as_ref(), &end);
        let seen = &self.seen[observation.session];
        let mut plain = self.plain(&pose, seen, &shown);
        let angles = seen.of_joints.iter().zip(&observation.axes).enumerate();
        let shapes =
            angles.map(|(joint, (own, &angle))| own.numbers(angle, state.layout.curve_unit(joint)));
        let shapes = shapes.collect();
        // The unknowns are the first columns.
        for (unknown, by) in problem.by_parts(observation.channel(), gauge.as_ref(), &end) {
            plain[(0, seen.places[unknown])] = by;
        }
        // The session's scale is that of the source of places.
        let scale = state.layout.columns(Block::Scale(observation.session));
        if let (Some(scale), Some(_)) = (scale, &gauge) {
            plain.column_mut(seen.places[scale.start]).fill(0.0);
        }
        ReadingRow {
            shown,
            plain,
            shapes,
            value: DVector::from_vec(observation.measured.residual(&view.end, gauge.as_ref())),
            joints: view.joints,
            base: base_axes,
        }
    }

    /// The plain rows of a pose that shows `shown`.
    fn plain(&self, pose: &PoseView<'_>, seen: &Seen, shown: &Shown) -> DMatrix<f64> {
        let mut plain = DMatrix::zeros(shown.rows(), seen.plain.len());
        let mut each = |column: usize, twist: &Twist, amount: f64| {
            let mut own = plain.column_mut(seen.places[column]);
            moved(shown, twist, amount, own.as_mut_slice());
        };
        pose.walk(seen.blocks.iter().cloned(), &self.state.layout, &mut each);
        plain
    }
}

/// The rows and residuals of several readings, one below the other.
fn below<'r>(
    readings: impl Iterator<Item = &'r ReadingRow> + Clone,
    columns: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let count = readings.clone().map(|own| own.value.len()).sum();
    let (mut rows, mut value) = (DMatrix::zeros(count, columns), DVector::zeros(count));
    let mut first = 0;
    for own in readings {
        let size = own.value.len();
        rows.rows_mut(first, size).copy_from(&own.plain);
        value.rows_mut(first, size).copy_from(&own.value);
        first += size;
    }
    (rows, value)
}

pub(super) fn covariance(state: &State, row: &Row, weight: f64) -> DMatrix<f64> {
    let counted = weight * state.tails.information(row.value.len() as f64);
    state.repeatability.covariance(&row.noise, counted.recip())
}

pub(super) fn covariances(state: &State, rows: &[Row], stations: &[usize]) -> Vec<DMatrix<f64>> {
    let weighted = rows.par_iter().zip(stations).with_min_len(CHUNK);
    weighted.map(|(row, &station)| covariance(state, row, state.weights[station])).collect()
}
