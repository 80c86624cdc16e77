//! Base and target of an identified arm in a session of its own: the estimate from few stations, and the choice of these.
//!
//! Inputs: poses ([`Poses`]), each with the motion of the measured point by base, target and scale of the session, and with
//! the errors that the arm may still make there. Neighbours make the same errors: fifty stations in one cube do not fix a base.
//! So the estimate is generalised least squares ([`crate::method::planning`]): with `X` the motions at the stations, `K` the
//! covariance of their errors between stations and noise, and `P` the precision known before,
//!
//! 1. `β̂ = M y`, `M = V Xᵀ K⁻¹`, `V = (Xᵀ K⁻¹ X + P)⁻¹` ([`Poses::estimator`]);
//! 2. at any pose `e* − X* (β̂ − β)` remains, with a covariance ([`Poses::left`]): what the stations' errors have in common with
//!    those of the pose is removed, what is theirs alone is passed on;
//! 3. stations are chosen so that the mean of that variance over the poses that matter is least: one after another, then each
//!    exchanged for a better one until none is ([`Poses::choose`]).

use nalgebra::{DMatrix, DVector, Matrix3};
use rayon::prelude::*;

/// Candidates that a worker takes at once; fixed, so that results do not depend on the number of threads.
const AT_ONCE: usize = 16;
/// Rounds of exchanges; they end before where no exchange helps.
const ROUNDS: usize = 20;
/// An exchange has to lower the mean variance by this share.
const WORTH: f64 = 1e-9;

/// Poses of a session, as far as base and target concern them; everything in the base frame.
#[derive(Debug, Clone)]
pub struct Poses {
    /// The measured point's motion per unit of each unknown of the session: three rows a pose.
    pub columns: DMatrix<f64>,
    /// What is known of these unknowns before, as the inverse of a variance around zero.
    pub precision: DVector<f64>,
    /// Square root of the covariance of the arm's errors, mm: `HᵀH`, three columns a pose.
    pub half: DMatrix<f64>,
    /// Covariance of each pose's error that it does not share with others, mm²: that of one measurement.
    pub alone: Vec<Matrix3<f64>>,
}

/// The dependence of a session's unknowns on the stations that they are found from.
#[derive(Debug, Clone)]
pub struct Estimator {
    /// The stations, by their places.
    pub used: Vec<usize>,
    /// The unknowns per unit of the stations' residuals, `M`.
    pub from: DMatrix<f64>,
    /// The pull of what is known before on the unknowns, `V P`.
    pub pull: DMatrix<f64>,
    /// Covariance of the unknowns because of that pull, `V P V`.
    pub held: DMatrix<f64>,
}

/// Stations that were chosen, and what they leave.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// The stations, by their places, in the order in which they were chosen.
    pub stations: Vec<usize>,
    /// Mean over the region of the trace of the remaining covariance, without that of a measurement there, mm².
    pub left_mm2: f64,
}

impl Poses {
    /// Number of poses.
    pub fn len(&self) -> usize {
        self.alone.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.alone.is_empty()
    }

    /// The generalised least-squares estimate from the stations at `used`. `None` where a factorisation fails, which only
    /// rounding can cause.
    pub fn estimator(&self, used: &[usize]) -> Option<Estimator> {
        let columns = rows_of(&self.columns, used);
        let between = self.between(used);
        let solved = between.cholesky()?.solve(&columns);
        let information = columns.tr_mul(&solved) + DMatrix::from_diagonal(&self.precision);
        let variance = information.cholesky()?.inverse();
        let pull = &variance * DMatrix::from_diagonal(&self.precision);
        Some(Estimator {
            used: used.to_vec(),
            from: &variance * solved.transpose(),
            held: &pull * &variance,
            pull,
        })
    }

    /// The estimate that counts all stations at `used` alike, with a `ridge` on every unknown.
    pub fn unweighted(&self, used: &[usize], ridge: f64) -> Option<Estimator> {
        let columns = rows_of(&self.columns, used);
        let size = columns.ncols();
        let normal = columns.tr_mul(&columns) + DMatrix::identity(size, size) * ridge;
        Some(Estimator {
            used: used.to_vec(),
            from: normal.cholesky()?.solve(&columns.transpose()),
            pull: DMatrix::zeros(size, size),
            held: DMatrix::zeros(size, size),
        })
    }

    /// Covariance of what remains of a measured position at each pose once the unknowns are found, mm². A pose that found them
    /// is measured another time.
    pub fn left(&self, by: &Estimator) -> Vec<Matrix3<f64>> {
        let moved = columns_of(&self.half, &by.used) * by.from.transpose();
        let rest = &self.half - moved * self.columns.transpose();
        let mut inherited = by.held.clone();
        for (place, &station) in by.used.iter().enumerate() {
            let own = by.from.columns(3 * place, 3);
            inherited += own * self.alone[station] * own.transpose();
        }
        let at = |place: usize| {
            let own = rest.columns(3 * place, 3);
            let columns = self.columns.rows(3 * place, 3);
            let shared = own.tr_mul(&own) + columns * &inherited * columns.transpose();
            Matrix3::from_fn(|row, column| shared[(row, column)]) + self.alone[place]
        };
        (0..self.len()).into_par_iter().map(at).collect()
    }

    /// Covariance of the arm's errors and of the unknowns before any station found them, with a measurement's own, mm².
    pub fn before(&self, counted: &[bool]) -> Vec<Matrix3<f64>> {
        let at = |place: usize| {
            let own = self.half.columns(3 * place, 3);
            let mut shared = own.tr_mul(&own);
            for (unknown, _) in counted.iter().enumerate().filter(|(_, counted)| **counted) {
                let column = self.columns.view((3 * place, unknown), (3, 1));
                shared += column * column.transpose() / self.precision[unknown];
            }
            Matrix3::from_fn(|row, column| shared[(row, column)]) + self.alone[place]
        };
        (0..self.len()).into_par_iter().map(at).collect()
    }

    /// Chooses `count` of the poses at `candidates` so that what remains over the poses at `region` is least. Fewer where there
    /// are fewer candidates.
    pub fn choose(&self, candidates: &[usize], region: &[usize], count: usize) -> Chosen {
        let search = Search::new(self, candidates, region);
        let chosen = search.exchanged(search.greedy(count.min(candidates.len())));
        let left = search.left(&chosen).unwrap_or(f64::INFINITY);
        Chosen {
            left_mm2: left,
            stations: chosen.into_iter().map(|own| candidates[own]).collect(),
        }
    }

    /// Covariance of the errors of some stations, with that of each measurement.
    fn between(&self, stations: &[usize]) -> DMatrix<f64> {
        let half = columns_of(&self.half, stations);
        let mut between = half.tr_mul(&half);
        for (place, &station) in stations.iter().enumerate() {
            let mut own = between.fixed_view_mut::<3, 3>(3 * place, 3 * place);
            own += self.alone[station];
        }
        between
    }
}

/// The sums over the region that the mean remaining variance follows from, so that a set of stations costs nothing but its own
/// size: with `G` the region's mean of `XᵀX` and `A` its mean of the stations' covariance with `X`,
/// `tr K** − 2 tr(M A) + tr((M K Mᵀ + V P V) G)`.
struct Search<'p> {
    poses: &'p Poses,
    candidates: &'p [usize],
    /// Covariance of the candidates with each other, three rows and columns each, with that of each measurement.
    between: DMatrix<f64>,
    /// The candidates' motions.
    columns: DMatrix<f64>,
    /// `A` of each candidate: three rows.
    with_region: DMatrix<f64>,
    /// `G`.
    region: DMatrix<f64>,
    /// `tr K**`, mean over the region, mm².
    own_mm2: f64,
}

impl<'p> Search<'p> {
    fn new(poses: &'p Poses, candidates: &'p [usize], region: &[usize]) -> Self {
        let (columns, half) = (
            rows_of(&poses.columns, region),
            columns_of(&poses.half, region),
        );
        let count = region.len().max(1) as f64;
        let with_region = poses.half_product(candidates, &(&half * &columns / count));
        Self {
            between: poses.between(candidates),
            columns: rows_of(&poses.columns, candidates),
            with_region,
            region: columns.tr_mul(&columns) / count,
            own_mm2: half.norm_squared() / count,
            candidates,
            poses,
        }
    }

    /// Mean over the region of the trace of what remains, mm²; `None` where a factorisation fails.
    fn left(&self, chosen: &[usize]) -> Option<f64> {
        let columns = rows_of(&self.columns, chosen);
        let with_region = rows_of(&self.with_region, chosen);
        let between = block(&self.between, chosen);
        let solved = between.cholesky()?.solve(&columns);
        let found = columns.tr_mul(&solved);
        let information = &found + DMatrix::from_diagonal(&self.poses.precision);
        let variance = information.cholesky()?.inverse();
        // M K Mᵀ + V P V = V (XᵀK⁻¹X + P) V = V.
        let common = (&variance * solved.tr_mul(&with_region)).trace();
        let passed_on = (&variance * &self.region).trace();
        Some(self.own_mm2 - 2.0 * common + passed_on)
    }

    /// One candidate after another, each the best beside those before it.
    fn greedy(&self, count: usize) -> Vec<usize> {
        let mut chosen = Vec::with_capacity(count);
        while chosen.len() < count {
            let Some((best, _)) = self.best(&chosen, chosen.len()) else {
                break;
            };
            chosen.push(best);
        }
        chosen
    }

    /// Exchanges one choice after another for the best other candidate, until no exchange helps.
    fn exchanged(&self, mut chosen: Vec<usize>) -> Vec<usize> {
        let mut left = self.left(&chosen).unwrap_or(f64::INFINITY);
        for _ in 0..ROUNDS {
            let before = left;
            for place in 0..chosen.len() {
                if let Some((other, less)) = self.best(&chosen, place)
                    && less < left * (1.0 - WORTH)
                {
                    chosen[place] = other;
                    left = less;
                }
            }
            if left >= before {
                break;
            }
        }
        chosen
    }

    /// The best candidate in the place `place` of `chosen`, or behind all of them, and what remains with it; of equal ones the
    /// first.
    fn best(&self, chosen: &[usize], place: usize) -> Option<(usize, f64)> {
        let left = |candidate: usize| {
            if chosen.contains(&candidate) {
                return None;
            }
            let mut with = chosen.to_vec();
            if place < with.len() {
                with[place] = candidate;
            } else {
                with.push(candidate);
            }
            self.left(&with)
        };
        let all: Vec<Option<f64>> = (0..self.candidates.len())
            .into_par_iter()
            .with_min_len(AT_ONCE)
            .map(left)
            .collect();
        let all = all.into_iter().enumerate();
        let all = all.filter_map(|(candidate, left)| Some((candidate, left?)));
        all.reduce(|best, next| if next.1 < best.1 { next } else { best })
    }
}

impl Poses {
    /// `H_cᵀ right` of some poses: three rows each.
    fn half_product(&self, poses: &[usize], right: &DMatrix<f64>) -> DMatrix<f64> {
        columns_of(&self.half, poses).tr_mul(right)
    }
}

/// The three rows of each of some poses.
fn rows_of(matrix: &DMatrix<f64>, poses: &[usize]) -> DMatrix<f64> {
    let mut rows = DMatrix::zeros(3 * poses.len(), matrix.ncols());
    for (place, &pose) in poses.iter().enumerate() {
        rows.rows_mut(3 * place, 3)
            .copy_from(&matrix.rows(3 * pose, 3));
    }
    rows
}

/// The three columns of each of some poses.
fn columns_of(matrix: &DMatrix<f64>, poses: &[usize]) -> DMatrix<f64> {
    let mut columns = DMatrix::zeros(matrix.nrows(), 3 * poses.len());
    for (place, &pose) in poses.iter().enumerate() {
        columns
            .columns_mut(3 * place, 3)
            .copy_from(&matrix.columns(3 * pose, 3));
    }
    columns
}

/// The blocks of some poses in a matrix of all.
fn block(matrix: &DMatrix<f64>, poses: &[usize]) -> DMatrix<f64> {
    let size = 3 * poses.len();
    DMatrix::from_fn(size, size, |row, column| {
        matrix[(
            3 * poses[row / 3] + row % 3,
            3 * poses[column / 3] + column % 3,
        )]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Poses without a pattern: base motions about the origin, errors of four common causes, and noise of each.
    fn poses(count: usize) -> Poses {
        let at = |place: usize, k: usize| ((3 * place + 7 * k + 1) as f64 * 2.0_f64.sqrt()).sin();
        let mut columns = DMatrix::zeros(3 * count, 6);
        for place in 0..count {
            let position = nalgebra::Vector3::from_fn(|axis, _| at(place, axis));
            for axis in 0..3 {
                let unit = nalgebra::Vector3::ith(axis, 1.0);
                columns
                    .fixed_view_mut::<3, 1>(3 * place, axis)
                    .copy_from(&unit);
                columns
                    .fixed_view_mut::<3, 1>(3 * place, 3 + axis)
                    .copy_from(&unit.cross(&position));
            }
        }
        Poses {
            columns,
            precision: DVector::from_element(6, 1e-4),
            half: DMatrix::from_fn(4, 3 * count, |cause, row| {
                0.1 * at(row / 3, cause) * at(cause, row % 3)
            }),
            alone: (0..count)
                .map(|place| Matrix3::identity() * (1e-3 * (1.0 + at(place, 5).abs())))
                .collect(),
        }
    }

    /// Covariance of `e* − X* (M e − M X β + β…)` at one pose from that of all errors and unknowns, written out.
    fn written_out(poses: &Poses, by: &Estimator, place: usize) -> Matrix3<f64> {
        let all = poses.half.tr_mul(&poses.half);
        let errors = block(&all, &[&by.used[..], &[place]].concat());
        let (used, size) = (3 * by.used.len(), poses.columns.ncols());
        let (at_used, at_place) = (
            rows_of(&poses.columns, &by.used),
            rows_of(&poses.columns, &[place]),
        );
        // What remains is a matrix times (errors of the stations, error of the pose, unknowns).
        let mut of = DMatrix::zeros(3, used + 3 + size);
        of.columns_mut(0, used)
            .copy_from(&(-(&at_place * &by.from)));
        of.columns_mut(used, 3).fill_with_identity();
        let kept = DMatrix::identity(size, size) - &by.from * at_used;
        of.columns_mut(used + 3, size)
            .copy_from(&(&at_place * kept));
        let mut whole = DMatrix::zeros(used + 3 + size, used + 3 + size);
        whole
            .view_mut((0, 0), (used + 3, used + 3))
            .copy_from(&errors);
        for (own, &station) in by.used.iter().chain([&place]).enumerate() {
            let mut own = whole.fixed_view_mut::<3, 3>(3 * own, 3 * own);
            own += poses.alone[station];
        }
        for unknown in 0..size {
            whole[(used + 3 + unknown, used + 3 + unknown)] = poses.precision[unknown].recip();
        }
        let left = &of * whole * of.transpose();
        Matrix3::from_fn(|row, column| left[(row, column)])
    }

    #[test]
    fn what_remains_is_what_the_whole_covariance_says() {
        let poses = poses(9);
        let by = poses.estimator(&[0, 2, 3, 7]).expect("positive");
        let left = poses.left(&by);
        for place in [1, 4, 8] {
            let direct = written_out(&poses, &by, place);
            assert!(
                (left[place] - direct).abs().max() < 1e-9,
                "{} {direct}",
                left[place]
            );
        }
    }

    #[test]
    fn no_other_linear_estimate_leaves_less_of_the_unknowns() {
        // Gauss and Markov: with the errors' covariance in it, the estimate has the least variance.
        let poses = poses(9);
        let used = [0, 1, 2, 4, 5, 6];
        let whole = poses.estimator(&used).expect("positive");
        let alike = poses.unweighted(&used, 1e-12).expect("positive");
        let variance = |by: &Estimator| {
            let between = poses.between(&used);
            (&by.from * between * by.from.transpose() + &by.held).trace()
        };
        assert!(variance(&whole) < variance(&alike));
    }

    #[test]
    fn the_sums_over_the_region_are_the_mean_of_what_remains() {
        let poses = poses(12);
        let (candidates, region): (Vec<usize>, Vec<usize>) = ((0..8).collect(), (8..12).collect());
        let chosen = poses.choose(&candidates, &region, 5);
        let by = poses.estimator(&chosen.stations).expect("positive");
        let left = poses.left(&by);
        let of = |&place: &usize| (left[place] - poses.alone[place]).trace();
        let mean = region.iter().map(of).sum::<f64>() / 4.0;
        assert!((mean - chosen.left_mm2).abs() < 1e-9, "{mean} {chosen:?}");
    }

    #[test]
    fn no_exchange_of_one_station_is_better() {
        let poses = poses(14);
        let all: Vec<usize> = (0..14).collect();
        let chosen = poses.choose(&all, &all, 5);
        let search = Search::new(&poses, &all, &all);
        for place in 0..5 {
            for other in all.iter().filter(|own| !chosen.stations.contains(own)) {
                let mut with = chosen.stations.clone();
                with[place] = *other;
                let left = search.left(&with).expect("positive");
                assert!(left >= chosen.left_mm2 * (1.0 - 1e-6));
            }
        }
    }
}
