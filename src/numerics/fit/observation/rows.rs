//! Whitened residuals and Jacobian rows of a block of stations at a time, column by column.
//!
//! 1. The readings of one source on one target in a session are stored as columns: axis variables, measured positions,
//!    whitening `L⁻¹` of `L Lᵀ`.
//! 2. A block of them passes the batched chain, which gives the predicted target and its motion per unknown.
//! 3. Residual and columns are whitened, times the root of the station's weight; a block's end is filled with zero rows.
//! 4. A source of one length has one row: the motion along the direction of its reading, and the columns of its own parts.

use nalgebra::{DMatrix, DMatrixView, Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

use super::measured::widest;
use super::{Measured, MeasuredOrientation, MeasuredPoint, Observation};
use crate::fit::frames::Channel;
use crate::fit::gauge::Gauge;
use crate::join::ReadingKind;
use crate::kinematics::batch::{BLOCK, Block, Column, Variables};
use crate::kinematics::{BatchChain, BatchColumns};
use crate::linalg::{gram_of_columns, transpose};

/// The readings of one channel as columns.
#[derive(Debug)]
pub struct Stations {
    /// The index of each station among the problem's observations.
    pub places: Vec<usize>,
    variables: Variables,
    measured: [Vec<f64>; 3],
    /// The lower triangle of `L⁻¹`, row by row.
    whitening: [Vec<f64>; 6],
    /// The kind with the most rows among them.
    kind: ReadingKind,
}

/// Whitened rows of a block: one column for each unknown of its channel, and the residual as the last column.
#[derive(Debug, Clone, Default)]
pub struct BlockRows {
    /// The unknown of each column; the residual's column comes after them.
    pub unknowns: Vec<usize>,
    rows: usize,
    values: Vec<f64>,
    /// The chain's columns before whitening; the memory is reused.
    columns: Vec<Column>,
    /// The rows one after the other, as products take them; the memory is reused.
    across: DMatrix<f64>,
}

impl Stations {
    /// The stations of those `observations` that belong to `channel`.
    pub fn of(channel: Channel, observations: &[Observation], axes: usize) -> Self {
        let own = |(_, o): &(usize, &Observation)| o.channel() == channel;
        let own: Vec<_> = observations.iter().enumerate().filter(own).collect();
        let column = |pick: &dyn Fn(&Observation) -> f64| -> Vec<f64> {
            own.iter().map(|(_, observation)| pick(observation)).collect()
        };
        let seen = own.iter().map(|(_, o)| numbers(&o.measured));
        let (positions, whitening): (Vec<Vector3<f64>>, Vec<Matrix3<f64>>) = seen.unzip();
        let entry = |(row, column)| whitening.iter().map(|w| w[(row, column)]).collect();
        Self {
            places: own.iter().map(|(place, _)| *place).collect(),
            variables: Variables::of((0..axes).map(|axis| column(&|o| o.axes[axis])).collect()),
            measured: [0, 1, 2].map(|row| positions.iter().map(|own| own[row]).collect()),
            whitening: [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)].map(entry),
            kind: widest(own.iter().map(|(_, o)| &o.measured)),
        }
    }

    /// Squared norm of the whitened residual of each station, predicted by `chain`.
    pub fn squared_norms(
        &self,
        chain: &BatchChain,
        observations: &[Observation],
        gauge: Option<&Gauge>,
    ) -> Vec<f64> {
        let count = self.places.len();
        match self.kind {
            ReadingKind::Point => {
                let [x, y, z] = chain.positions(self.variables.values());
                let end = |i: usize| Vector3::new(x[i], y[i], z[i]);
                (0..count).map(|i| self.whitened(i, end(i)).norm_squared()).collect()
            }
            ReadingKind::Distance | ReadingKind::Height => {
                let [x, y, z] = chain.positions(self.variables.values());
                let end = |i: usize| Point3::new(x[i], y[i], z[i]);
                let squared =
                    |i: usize| (self.left_of(i, &end(i), gauge) * self.whitening[0][i]).powi(2);
                (0..count).map(squared).collect()
            }
            ReadingKind::Pose => {
                let poses = chain.poses(self.variables.values());
                let squared = |i: usize| {
                    let end = poses.isometry(i);
                    let position = self.whitened(i, end.translation.vector);
                    let turn = observations[self.places[i]].measured.turn();
                    let turn = turn.map_or(0.0, |turn| {
                        let away = self.away(i, end.translation.vector);
                        turn.whitened(&away, &turn.residual(&end.rotation)).norm_squared()
                    });
                    position.norm_squared() + turn
                };
                (0..count).map(squared).collect()
            }
        }
    }

    /// Measured minus predicted length of the station `i`, whose target is at `end`, mm; zero without a gauge.
    fn left_of(&self, i: usize, end: &Point3<f64>, gauge: Option<&Gauge>) -> f64 {
        gauge.map_or(0.0, |gauge| self.measured[0][i] - gauge.reading_mm(end))
    }

    /// Sum of squared distances between measured and predicted positions, or of differences of the lengths that `gauge` reads, mm²,
    /// added to `sum` in order.
    pub fn add_squares(&self, chain: &BatchChain, gauge: Option<&Gauge>, sum: &mut f64) {
        let [x, y, z] = chain.positions(self.variables.values());
        for i in 0..self.places.len() {
            let end = Point3::new(x[i], y[i], z[i]);
            *sum += match gauge {
                None => self.away(i, end.coords).norm_squared(),
                Some(_) => self.left_of(i, &end, gauge).powi(2),
            };
        }
    }

    fn away(&self, i: usize, end: Vector3<f64>) -> Vector3<f64> {
        Vector3::from_fn(|row, _| self.measured[row][i]) - end
    }

    /// [`Self::away`] times `L⁻¹` of the station `i`.
    fn whitened(&self, i: usize, end: Vector3<f64>) -> Vector3<f64> {
        let away = self.away(i, end);
        let w = |entry: usize| self.whitening[entry][i];
        Vector3::new(
            w(0) * away.x,
            w(1) * away.x + w(2) * away.y,
            w(3) * away.x + w(4) * away.y + w(5) * away.z,
        )
    }
}

/// The measured numbers and their whitening `L⁻¹`; of a length the first of each.
fn numbers(measured: &Measured) -> (Vector3<f64>, Matrix3<f64>) {
    match measured {
        Measured::Point(point) | Measured::Pose(point, _) => {
            (point.position.coords, whitening(point))
        }
        Measured::Distance(length) | Measured::Height(length) => {
            let mut precision = Matrix3::zeros();
            precision[(0, 0)] = length.sd_mm.recip();
            (Vector3::new(length.mm, 0.0, 0.0), precision)
        }
    }
}

fn whitening(point: &MeasuredPoint) -> Matrix3<f64> {
    let inverse = point.factor.solve_lower_triangular(&Matrix3::identity());
    inverse.expect("a Cholesky factor has a positive diagonal")
}

impl BlockRows {
    /// The rows of the block of `stations` that begins at `first`, predicted by `chain`.
    pub fn fill(
        &mut self,
        chain: &BatchColumns,
        observations: &[Observation],
        weights: &[f64],
        stations: &Stations,
        first: usize,
    ) {
        let (axes, end) = chain.block(&stations.variables, first, &mut self.columns);
        self.unknowns.clear();
        self.unknowns.extend_from_slice(chain.unknowns());
        self.rows = stations.kind.rows() * BLOCK;
        self.values.clear();
        self.values.resize(self.rows * (self.unknowns.len() + 1), 0.0);

        let places = &stations.places[first..stations.places.len().min(first + BLOCK)];
        let roots = filled(places.iter().map(|&place| weights[place].sqrt()));
        let scaled = |entry: &Vec<f64>| {
            filled(entry[first..].iter().zip(&roots).map(|(entry, root)| entry * root))
        };
        let whitening: [Block; 6] = std::array::from_fn(|entry| scaled(&stations.whitening[entry]));
        let away = std::array::from_fn(|row| {
            let measured = filled(stations.measured[row][first..].iter().copied());
            std::array::from_fn(|i| measured[i] - end[row][i])
        });
        let mut columns = self.values.chunks_exact_mut(self.rows);
        for (column, out) in self.columns.iter().zip(&mut columns) {
            whiten(&whitening, &column.linear, out);
        }
        let out = columns.next().expect("the residual comes after the unknowns");
        whiten(&whitening, &away, out);
        match stations.kind {
            ReadingKind::Point | ReadingKind::Distance | ReadingKind::Height => {}
            ReadingKind::Pose => {
                let stations = places.iter().map(|&place| &observations[place]);
                let stations: Vec<&Observation> = stations.collect();
                self.fill_turns(&stations, &axes, &roots);
                let is_joint = |turn: &MeasuredOrientation| turn.joint.is_some();
                if stations.iter().any(|own| own.measured.turn().is_some_and(is_joint)) {
                    self.fill_joint_turns(&stations, &axes, &roots, &away);
                }
            }
        }
    }

    /// The rows of the block of `stations` that begins at `first` and is read by `gauge`, whose parts are the unknowns at `parts`.
    pub fn fill_lengths(
        &mut self,
        chain: &BatchColumns,
        weights: &[f64],
        stations: &Stations,
        first: usize,
        (gauge, parts): (&Gauge, &[usize]),
    ) {
        let (_, end) = chain.block(&stations.variables, first, &mut self.columns);
        self.unknowns.clear();
        self.unknowns.extend_from_slice(chain.unknowns());
        self.unknowns.extend_from_slice(parts);
        self.rows = BLOCK;
        self.values.clear();
        self.values.resize(BLOCK * (self.unknowns.len() + 1), 0.0);
        let last = stations.places.len().min(first + BLOCK);
        let (moving, residual) = (chain.unknowns().len(), BLOCK * self.unknowns.len());
        let target_at = |i: usize| Point3::from(end.map(|axis| axis[i]));
        for (i, &observation) in stations.places[first..last].iter().enumerate() {
            let (station, target) = (first + i, target_at(i));
            let precision = stations.whitening[0][station] * weights[observation].sqrt();
            let along = gauge.direction(&target) * precision;
            for (column, motion) in self.columns[..moving].iter().enumerate() {
                let motion = Vector3::from_fn(|row, _| motion.linear[row][i]);
                self.values[column * BLOCK + i] = along.dot(&motion);
            }
            for (place, part) in gauge.parts().iter().enumerate().take(parts.len()) {
                let by = gauge.by_part(*part, &target) * precision;
                self.values[(moving + place) * BLOCK + i] = by;
            }
            self.values[residual + i] = stations.left_of(station, &target, Some(gauge)) * precision;
        }
    }

    /// The rows of orientations, after those of positions; zeros where none was measured.
    fn fill_turns(&mut self, observations: &[&Observation], axes: &[[Block; 3]; 3], roots: &Block) {
        let residual_column = self.rows * self.unknowns.len();
        let mut precision = [0.0; BLOCK];
        for (i, observation) in observations.iter().enumerate() {
            let Some(measured) = observation.measured.turn() else { continue };
            precision[i] = roots[i] / measured.sd_rad;
            let turn = measured.residual(&turned_only(axes, i)) * precision[i];
            self.put_turn(residual_column, i, &turn);
        }
        for (column, out) in self.columns.iter().zip(self.values.chunks_exact_mut(self.rows)) {
            let Some(angular) = column.angular() else { continue };
            for (row, angular) in angular.iter().enumerate() {
                let out = &mut out[(3 + row) * BLOCK..(4 + row) * BLOCK];
                for i in 0..BLOCK {
                    out[i] = angular[i] * precision[i];
                }
            }
        }
    }

    /// Writes the rows of those orientations again whose axes differ or that are correlated with the position.
    fn fill_joint_turns(
        &mut self,
        observations: &[&Observation],
        axes: &[[Block; 3]; 3],
        roots: &Block,
        away: &[Block; 3],
    ) {
        let residual_column = self.rows * self.unknowns.len();
        let at = |block: &[Block; 3], i: usize| Vector3::from_fn(|row, _| block[row][i]);
        for (i, observation) in observations.iter().enumerate() {
            let turn = observation.measured.turn();
            let Some(measured) = turn.filter(|own| own.joint.is_some()) else { continue };
            let own = measured.residual(&turned_only(axes, i));
            let white = measured.whitened(&at(away, i), &own) * roots[i];
            self.put_turn(residual_column, i, &white);
            for column in 0..self.unknowns.len() {
                let moved = &self.columns[column];
                let angular = moved.angular().map_or_else(Vector3::zeros, |own| at(own, i));
                let white = measured.whitened(&at(&moved.linear, i), &angular) * roots[i];
                self.put_turn(self.rows * column, i, &white);
            }
        }
    }

    /// Writes the rows of the orientation of the station `i` of a block into the column that begins at `first`.
    fn put_turn(&mut self, first: usize, i: usize, white: &Vector3<f64>) {
        for row in 0..3 {
            self.values[first + (3 + row) * BLOCK + i] = white[row];
        }
    }

    pub fn column(&self, k: usize) -> &[f64] {
        &self.values[k * self.rows..(k + 1) * self.rows]
    }

    /// `Aᵀ A` of all columns A, the residual's last.
    pub fn gram(&mut self) -> DMatrix<f64> {
        let columns = DMatrixView::from_slice(&self.values, self.rows, self.unknowns.len() + 1);
        transpose(&columns, &mut self.across);
        gram_of_columns(&self.across)
    }
}

/// Product of two columns, summed in eight partial sums that the vector units compute in parallel.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    const STRANDS: usize = 8;
    let mut sums = [0.0; STRANDS];
    let (left, right) = (a.chunks_exact(STRANDS), b.chunks_exact(STRANDS));
    let rest: f64 = left.remainder().iter().zip(right.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in left.zip(right) {
        for i in 0..STRANDS {
            sums[i] += x[i] * y[i];
        }
    }
    rest + sums.iter().sum::<f64>()
}

/// The orientation of the end at pose `i` of a block.
fn turned_only(axes: &[[Block; 3]; 3], i: usize) -> UnitQuaternion<f64> {
    let rotation = Matrix3::from_fn(|row, column| axes[column][row][i]);
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation))
}

fn whiten(w: &[Block; 6], [x, y, z]: &[Block; 3], out: &mut [f64]) {
    let (first, rest) = out.split_at_mut(BLOCK);
    let (second, rest) = rest.split_at_mut(BLOCK);
    let third = &mut rest[..BLOCK];
    for i in 0..BLOCK {
        first[i] = w[0][i] * x[i];
        second[i] = w[1][i] * x[i] + w[2][i] * y[i];
        third[i] = w[3][i] * x[i] + w[4][i] * y[i] + w[5][i] * z[i];
    }
}

/// A block of these numbers, zeros after their end.
fn filled(numbers: impl Iterator<Item = f64>) -> Block {
    let mut block = [0.0; BLOCK];
    for (place, number) in block.iter_mut().zip(numbers) {
        *place = number;
    }
    block
}
