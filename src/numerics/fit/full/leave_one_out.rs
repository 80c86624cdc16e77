//! Leave-one-out residuals in closed form, and the weights and gear lines derived from them.
//!
//! A station is left out with all its readings: what the arm did there is common to them, so the others would predict its errors.

use std::iter::repeat_n;
use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::CHUNK;
use super::columns::FEW_HARMONICS;
use super::layout::{Block, Layout};
use super::lines::{self, FoundLine};
use super::noise::{NoiseEvidence, StationNoise};
use super::partition::Seen;
use super::regression::{Inverse, Posterior};
use super::rows::{Around, Coefficients, Row, stations};
use super::settings::FullSettings;
use super::student::Tails;
use super::summing::pairs;
use super::whitening::noise_factor;
use crate::fit::observation::Observation;
use crate::fit::problem::Problem;
use crate::linalg::{invert_small, stacked, transposed, turned};

const LINES_PER_ROUND: usize = 3;
/// Stations whose rows one product takes: of fewer it would pack its other factor more often than that repays.
const TOGETHER: usize = 4 * CHUNK;

#[derive(Debug, Clone, PartialEq)]
pub struct LeftOut {
    /// Measured minus predicted by all other stations, mm and rad; its readings one below the other.
    pub residual: DVector<f64>,
    pub information: DMatrix<f64>,
    pub distance_squared: f64,
    pub noise: NoiseEvidence,
}

impl LeftOut {
    /// The robust weight: small for a station far from the prediction of all others.
    pub(super) fn weight(&self, tails: Tails) -> f64 {
        tails.weight(self.distance_squared, self.residual.len() as f64)
    }

    /// The residual of each of its readings, mm and rad.
    pub(super) fn of_readings(&self) -> impl Iterator<Item = DVector<f64>> {
        self.noise
            .station
            .firsts()
            .map(|(first, own)| self.residual.rows(first, own.rows()).into_owned())
    }
}

/// The residual of each observation as predicted without its station.
pub(super) fn of_observations(left_out: &[LeftOut]) -> Vec<DVector<f64>> {
    left_out.iter().flat_map(LeftOut::of_readings).collect()
}

/// The weight of each observation from those of the stations.
pub(super) fn of_readings(observations: &[Observation], weights: &[f64]) -> Vec<f64> {
    let stations = stations(observations).into_iter().zip(weights);
    stations.flat_map(|(own, weight)| own.map(|_| *weight)).collect()
}

/// Leave-one-out residuals in closed form: `r₋ = K⁻¹ α`, `α = N⁻¹ r`, `K = N⁻¹ − N⁻¹ H N⁻¹`.
pub(super) fn leave_one_out(
    around: &Around<'_>,
    prior_mean: &DVector<f64>,
    posterior: &Posterior,
    inverse: Inverse,
) -> Vec<LeftOut> {
    let mean = posterior.mean() + prior_mean;
    let open = posterior.open_of_rows(&inverse);
    let covariances = open.is_none().then(|| posterior.by_session(inverse));
    let (mut left_out, mut first) = (Vec::with_capacity(around.count()), 0);
    for (session, stations) in around.batches() {
        let (seen, rows) = (around.seen(session), around.rows(&stations));
        let noise = super::rows::covariances(around.state, &rows, &stations);
        let explained = match (&open, &covariances) {
            (Some(open), _) => explained_of_few(&noise, open, &mut first),
            (None, Some(by_session)) => {
                Explaining::of(seen, &by_session.of(session, &seen.columns)).all(&rows)
            }
            (None, None) => Vec::new(),
        };
        let expected = Coefficients::of(seen, &mean);
        let rows = rows.par_iter().zip(noise.par_iter().zip(explained));
        let each = stations.par_iter().zip(rows).with_min_len(CHUNK);
        let each = each.map(|(&place, (row, (noise, explained)))| {
            let share = around.state.tails.information(row.value.len() as f64);
            let left = &row.value - row.times(&expected);
            let weight = around.state.weights[place];
            left_out_of(row.noise.clone(), left, noise, explained, weight, share)
        });
        left_out.par_extend(each);
    }
    left_out
}

pub(super) struct Explaining<'s> {
    seen: &'s Seen,
    plain: DMatrix<f64>,
    with_plain: Vec<DMatrix<f64>>,
    /// Covariance of the coefficients of two joints' shapes, by the pair.
    of_joints: Vec<((usize, usize), DMatrix<f64>)>,
}

impl<'s> Explaining<'s> {
    pub(super) fn of(seen: &'s Seen, covariance: &DMatrix<f64>) -> Self {
        let (plain, of_joints) = (&seen.plain, &seen.of_joints);
        let of_pair =
            |(j, l): (usize, usize)| ((j, l), of_joints[j].covariance(covariance, &of_joints[l]));
        let with_plain = of_joints.iter().map(|own| own.covariance_with(covariance, plain));
        Self {
            plain: DMatrix::from_fn(plain.len(), plain.len(), |row, column| {
                covariance[(plain[row], plain[column])]
            }),
            with_plain: with_plain.collect(),
            of_joints: pairs(of_joints.len()).map(of_pair).collect(),
            seen,
        }
    }

    /// Covariance of each station's rows that the model explains, mm² and rad².
    fn all(&self, rows: &[Row]) -> Vec<DMatrix<f64>> {
        let shapes = Row::shapes_of(rows, self.seen);
        let of_pair = |((j, l), block): &((usize, usize), DMatrix<f64>)| {
            let onto = block * &shapes[*l];
            let stations = onto.column_iter().zip(shapes[*j].column_iter());
            stations.map(|(onto, own)| onto.dot(&own)).collect::<Vec<f64>>()
        };
        let between: Vec<Vec<f64>> = self.of_joints.par_iter().map(of_pair).collect();
        let chunk = |(chunk, rows): (usize, &[Row])| {
            let first = chunk * TOGETHER;
            // A row of the regression in each column: what rows share are products of columns.
            let plain = rows.iter().map(|row| &row.plain);
            let plain = transposed(&stacked(plain, self.seen.plain.len()).as_view());
            let onto_plain = &self.plain * &plain;
            let onto_joints = self.onto_joints(&shapes, first..first + rows.len());
            let places = firsts(rows).into_iter().zip(rows).enumerate();
            let explained = places.map(|(own, (first_row, row))| {
                let (size, joints) = (row.value.len(), shapes.len());
                let mut of_pairs = DMatrix::zeros(joints, joints);
                for (((j, l), _), between) in self.of_joints.iter().zip(&between) {
                    of_pairs[(*j, *l)] = between[first + own];
                    of_pairs[(*l, *j)] = between[first + own];
                }
                let plain = plain.columns(first_row, size);
                let mut explained = plain.tr_mul(&onto_plain.columns(first_row, size));
                // What joints share with each other counts half here and half in the transpose.
                let motions = &row.noise.joints;
                let mut along = plain.tr_mul(&onto_joints.columns(joints * own, joints));
                along.gemm(0.5, motions, &of_pairs, 1.0);
                let across = along * motions.transpose();
                explained += across.transpose();
                explained + across
            });
            explained.collect::<Vec<_>>()
        };
        rows.par_chunks(TOGETHER).enumerate().flat_map_iter(chunk).collect()
    }

    /// Covariance of the rows of all these stations together that the model explains, one station's below the other's, mm² and rad².
    pub(super) fn together(&self, rows: &[&Row]) -> DMatrix<f64> {
        let shapes = Row::shapes_of(rows, self.seen);
        let plain = stacked(rows.iter().map(|row| &row.plain), self.seen.plain.len());
        let motions = stacked(rows.iter().map(|row| &row.noise.joints), shapes.len());
        let stations = rows.iter().enumerate();
        let stations = stations.flat_map(|(own, row)| repeat_n(own, row.value.len()));
        let stations: Vec<usize> = stations.collect();
        // What columns share with themselves counts half here and half in the transpose.
        let mut explained = &plain * &self.plain * turned(&plain) * 0.5;
        for (l, of_joint) in shapes.iter().enumerate() {
            // Covariance of the joint's error at each station with each row, by the plain columns and joints from this one on.
            let mut with_joint =
                transposed(&(&self.with_plain[l] * of_joint).as_view()) * turned(&plain);
            for ((j, _), block) in self.of_joints.iter().filter(|((_, other), _)| *other == l) {
                let between = transposed(&(block * of_joint).as_view()) * &shapes[*j];
                let share = if *j == l { 0.5 } else { 1.0 };
                for (row, &station) in stations.iter().enumerate() {
                    let by = share * motions[(row, *j)];
                    with_joint.column_mut(row).axpy(by, &between.column(station), 1.0);
                }
            }
            let with_joint = transposed(&with_joint.as_view());
            for (row, &station) in stations.iter().enumerate() {
                let (by, with) = (motions[(row, l)], with_joint.column(station));
                explained.column_mut(row).axpy(by, &with, 1.0);
            }
        }
        &explained + transposed(&explained.as_view())
    }

    /// Covariance of the plain columns with errors of joints of some stations: the columns of a station's joints beside each other.
    fn onto_joints(&self, shapes: &[DMatrix<f64>], stations: Range<usize>) -> DMatrix<f64> {
        let (joints, count) = (shapes.len(), stations.len());
        let mut onto = DMatrix::zeros(self.seen.plain.len(), joints * count);
        for (joint, (block, own)) in self.with_plain.iter().zip(shapes).enumerate() {
            let own = own.columns(stations.start, count);
            let mut into = onto.columns_with_step_mut(joint, count, joints - 1);
            into.gemm(1.0, block, &own, 0.0);
        }
        onto
    }
}

/// A square root `OᵀO` of the covariance of a station's rows that the model leaves open, mm and rad: of the columns of `open` from
/// `first` on, which is moved behind them.
fn coloured(open: &DMatrix<f64>, noise: &DMatrix<f64>, first: &mut usize) -> DMatrix<f64> {
    let own = open.columns(*first, noise.nrows());
    *first += noise.nrows();
    own * noise_factor(noise).transpose()
}

/// A square root `OᵀO` of the covariance of all rows that the model leaves open, mm and rad, a column for each row; `None` where the
/// rows were summed.
pub(super) fn left_open(
    posterior: &Posterior,
    covariances: &[DMatrix<f64>],
) -> Option<DMatrix<f64>> {
    let mut open = posterior.open_of_rows(&posterior.inverse())?;
    let mut first = 0;
    for noise in covariances {
        let (place, own) = (first, coloured(&open, noise, &mut first));
        open.columns_mut(place, own.ncols()).copy_from(&own);
    }
    Some(open)
}

/// Covariance of each station's rows that the model explains, mm² and rad²: the noise without what `open` leaves open, as shares of
/// their noise; its columns from `first` on are the stations'.
fn explained_of_few(
    covariances: &[DMatrix<f64>],
    open: &DMatrix<f64>,
    first: &mut usize,
) -> Vec<DMatrix<f64>> {
    let explained = covariances.iter().map(|noise| {
        let own = coloured(open, noise, first);
        noise - own.tr_mul(&own)
    });
    explained.collect()
}

/// The place of each station's first row, all rows one below the other.
pub(super) fn firsts<'r>(rows: impl IntoIterator<Item = &'r Row>) -> Vec<usize> {
    let places = rows.into_iter().scan(0, |next, row| {
        let first = *next;
        *next += row.value.len();
        Some(first)
    });
    places.collect()
}

/// With noise `N` and explained covariance `H` the covariance `K⁻¹` of the residual as predicted by all others is `N (N − H)⁻¹ N`, and
/// the residual `N (N − H)⁻¹ r`.
fn left_out_of(
    station: StationNoise,
    left: DVector<f64>,
    noise: &DMatrix<f64>,
    explained: DMatrix<f64>,
    weight: f64,
    share: f64,
) -> LeftOut {
    let inverse = |mut matrix: DMatrix<f64>| {
        assert!(invert_small(&mut matrix), "a positive definite covariance");
        matrix
    };
    let raised = noise * inverse(noise - explained);
    let residual = &raised * left;
    let covariance = raised * noise;
    let open = &covariance - noise;
    let at_weight_one = inverse(&open + noise * (weight * share));
    let distance_squared = residual.dot(&(at_weight_one * &residual));
    LeftOut {
        noise: NoiseEvidence {
            residual: residual.clone(),
            open,
            station,
            weight,
            information: share,
        },
        residual,
        information: inverse(covariance),
        distance_squared,
    }
}

pub(super) fn find_lines(
    problem: &Problem<'_>,
    layout: &Layout,
    left_out: &[LeftOut],
    settings: &FullSettings,
) -> Vec<FoundLine> {
    let joints = left_out.first().map_or(0, |own| own.noise.station.joints.ncols());
    let firsts = stations(problem.observations).into_iter();
    let firsts: Vec<&Observation> = firsts.map(|own| &problem.observations[own.start]).collect();
    let of_joint = |joint: usize| {
        // A gear before a repair had other lines.
        let is_now = |first: &Observation| layout.is_now(Some(first.session), joint);
        let stations = firsts.iter().zip(left_out).filter(|(first, _)| is_now(first));
        let stations = stations.map(|(first, own)| {
            let column = own.noise.station.joints.column(joint);
            lines::evidence(&column, &own.residual, &own.information, first.axes[joint])
        });
        let stations: Vec<_> = stations.collect();
        let known = layout.lines(joint);
        lines::find(joint, &stations, &known, settings.line_threshold, LINES_PER_ROUND)
    };
    // A joint that hardly moves the target has no evidence on its gears.
    let moves = |joint: &usize| {
        let curve = layout.columns(Block::Curve(*joint));
        curve.is_some_and(|own| own.len() > 2 * FEW_HARMONICS * layout.period_turns as usize)
    };
    let found = (0..joints).into_par_iter().filter(moves).map(of_joint);
    found.collect::<Vec<_>>().into_iter().flatten().collect()
}
