//! Base and target of an identified arm in a session of its own: the estimate from few stations, and the choice of these.
//!
//! Inputs: poses ([`Poses`]), each with the motion `X` of the measured point by base, target and scale of the session, and with the
//! errors `e` that the arm may still make there. Neighbours make the same errors: fifty stations in one cube do not fix a base. And the
//! arm stays as it is identified: what its errors have in common with a motion of the base, over the poses that matter, belongs
//! into the base that is found. So the frames that are wanted are `γ = β + ρ`: those of the session, and the motion `ρ = G⁻¹ X*ᵀe*` that
//! the arm's errors over these poses (`*`, means; `G = X*ᵀX*`) are most like. With `K` the covariance of errors and noise of the
//! stations, `P` the precision of `β` known before, and `B` the covariance of the stations' errors with `ρ`,
//!
//! 1. the estimate is generalised least squares ([`Poses::estimator`]):
//!    `V = (Xᵀ K⁻¹ X + P)⁻¹`, `β̂ = V Xᵀ K⁻¹ y`, `γ̂ = β̂ + Bᵀ K⁻¹ (y − X β̂)`;
//! 2. at any pose `e + X (β − γ̂)` remains, with a covariance ([`Poses::left`]);
//! 3. stations are chosen so that the mean of its trace over the poses that matter is least: one after another, then each
//!    exchanged for a better one until none is ([`Poses::choose`]).

use nalgebra::{DMatrix, DVector, Dyn, Matrix3};
use rayon::prelude::*;

use crate::linalg::gram;

/// Candidates that a worker takes at once; fixed, so that results do not depend on the number of threads.
const AT_ONCE: usize = 16;
/// Most rounds of exchanges; they end before where no exchange helps.
const ROUNDS: usize = 20;
/// An exchange has to lower the mean variance by this share.
const WORTH: f64 = 1e-9;
const BASE: usize = 6;

/// Poses of a session, as far as base and target concern them; everything in the base frame.
#[derive(Debug, Clone)]
pub struct Poses {
    /// The measured point's motion per unit of each unknown of the session: three rows a pose.
    pub columns: DMatrix<f64>,
    /// Precision of each unknown before a station is seen: the inverse of its variance around zero.
    pub precision: DVector<f64>,
    /// Square root of the covariance of the arm's errors, mm: `HᵀH`, three columns a pose.
    pub half: DMatrix<f64>,
    /// Covariance of each pose's error that it does not share with others, mm²: that of one measurement.
    pub alone: Vec<Matrix3<f64>>,
}

/// The dependence of a session's frames on the stations that they are found from.
#[derive(Debug, Clone)]
pub struct Estimator {
    pub used: Vec<usize>,
    /// The frames per unit of the stations' residuals.
    pub from: DMatrix<f64>,
    pub columns: DMatrix<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    pub stations: Vec<usize>,
    /// Mean over the region of the trace of the remaining covariance, without that of a measurement there, mm².
    pub left_mm2: f64,
}

impl Poses {
    pub fn count(&self) -> usize {
        self.alone.len()
    }

    /// Poses whose errors have no motion of the base in common: as nothing is known of the base before, it may be counted to it. What
    /// an arm's geometry and the base of its training trade, millimetres, is such a motion.
    #[must_use]
    pub fn relative(self) -> Self {
        let base = self.columns.columns(0, BASE).into_owned();
        let normal = base.tr_mul(&base) + DMatrix::identity(BASE, BASE) * f64::MIN_POSITIVE;
        let Some(factor) = normal.cholesky() else { return self };
        let along = factor.solve(&(&self.half * &base).transpose());
        Self { half: &self.half - along.transpose() * base.transpose(), ..self }
    }

    /// The generalised least-squares estimate from the stations at `used`, for all poses. `None` where a factorisation fails, which
    /// only rounding can cause.
    pub fn estimator(&self, used: &[usize]) -> Option<Estimator> {
        let columns = rows_of(&self.columns, used);
        let all: Vec<usize> = (0..self.count()).collect();
        let region = Region::new(self, &all)?;
        let factor = self.between(used).cholesky()?;
        let solved = factor.solve(&columns);
        let information = columns.tr_mul(&solved) + DMatrix::from_diagonal(&self.precision);
        let own = information.cholesky()?.solve(&solved.transpose());
        let size = 3 * used.len();
        let rest = DMatrix::identity(size, size) - &columns * &own;
        let with_region = columns_of(&self.half, used).tr_mul(&region.along);
        let from = own + factor.solve(&with_region).tr_mul(&rest);
        Some(Estimator { used: used.to_vec(), from, columns })
    }

    /// The unknowns `β̂` by the residuals of all poses, and their covariance `V`. `None` where rounding makes a factorisation fail.
    pub fn unknowns(&self, residuals: &DVector<f64>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let all: Vec<usize> = (0..self.count()).collect();
        let solved = self.between(&all).cholesky()?.solve(&self.columns);
        let information = self.columns.tr_mul(&solved) + DMatrix::from_diagonal(&self.precision);
        let covariance = information.cholesky()?.inverse();
        Some((&covariance * solved.tr_mul(residuals), covariance))
    }

    /// The estimate that counts all stations at `used` alike, with a `ridge` on every unknown.
    pub fn unweighted(&self, used: &[usize], ridge: f64) -> Option<Estimator> {
        let columns = rows_of(&self.columns, used);
        let size = columns.ncols();
        let normal = columns.tr_mul(&columns) + DMatrix::identity(size, size) * ridge;
        Some(Estimator {
            used: used.to_vec(),
            from: normal.cholesky()?.solve(&columns.transpose()),
            columns,
        })
    }

    /// Covariance of what remains of a measured position at each pose once the frames are found, mm². A pose that found them is
    /// measured another time.
    pub fn left(&self, by: &Estimator) -> Vec<Matrix3<f64>> {
        let moved = columns_of(&self.half, &by.used) * by.from.transpose();
        let rest = &self.half - moved * self.columns.transpose();
        let size = by.from.nrows();
        let held = DMatrix::identity(size, size) - &by.from * &by.columns;
        let before = DMatrix::from_diagonal(&self.precision.map(f64::recip));
        let mut inherited = &held * before * held.transpose();
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
        (0..self.count()).into_par_iter().map(at).collect()
    }

    /// Chooses `count` of the poses at `candidates` so that what remains over the poses at `region` is least. Fewer where there
    /// are fewer candidates; none where rounding makes a covariance indefinite.
    pub fn choose(&self, candidates: &[usize], region: &[usize], count: usize) -> Chosen {
        let none = Chosen { stations: Vec::new(), left_mm2: f64::INFINITY };
        let Some(search) = Search::new(self, candidates, region) else { return none };
        let chosen = search.exchanged(search.greedy(count.min(candidates.len())));
        let left = search.left(&chosen);
        let stations = chosen.into_iter().map(|own| candidates[own]);
        left.map_or(none, |left_mm2| Chosen { stations: stations.collect(), left_mm2 })
    }

    /// Covariance of the errors of some stations, with that of each measurement.
    fn between(&self, stations: &[usize]) -> DMatrix<f64> {
        let mut between = gram(&columns_of(&self.half, stations).as_view());
        for (place, &station) in stations.iter().enumerate() {
            let mut own = between.fixed_view_mut::<3, 3>(3 * place, 3 * place);
            own += self.alone[station];
        }
        between
    }
}

struct Region {
    /// `G`, mean over them.
    normal: DMatrix<f64>,
    /// `ρ` per unit of the causes of the arm's errors, a row each.
    along: DMatrix<f64>,
    /// Mean trace of the covariance of their errors, mm².
    own_mm2: f64,
}

impl Region {
    fn new(poses: &Poses, region: &[usize]) -> Option<Self> {
        let (columns, half) = (rows_of(&poses.columns, region), columns_of(&poses.half, region));
        let count = region.len().max(1) as f64;
        let normal = columns.tr_mul(&columns) / count;
        // Where one orientation leaves base and target alike, what is known before tells them apart.
        let ridged = &normal + DMatrix::from_diagonal(&poses.precision) * RIDGE_MM2;
        let solved = ridged.cholesky()?.solve(&(half.clone() * &columns / count).transpose());
        Some(Self { along: solved.transpose(), own_mm2: half.norm_squared() / count, normal })
    }
}

/// Weight of what is known before while the arm's errors are told as motions, mm²: a thousandth of a millimetre, squared.
const RIDGE_MM2: f64 = 1e-6;

/// What the choice of stations needs of candidates and region, so that a set of stations costs nothing but its own size: what remains
/// is `tr K** − tr(G Bᵀ K⁻¹ B) + tr(G U V Uᵀ)`, mean over the region, with `U = I − Bᵀ K⁻¹ X`.
struct Search<'p> {
    poses: &'p Poses,
    /// Covariance of the candidates with each other, three rows and columns each, with that of each measurement.
    between: DMatrix<f64>,
    /// The candidates' `X` and `B` side by side: three rows each.
    sides: DMatrix<f64>,
    region: Region,
}

/// Some candidates, and the sums that others are added to.
struct Taken<'s> {
    stations: &'s [usize],
    factor: nalgebra::Cholesky<f64, Dyn>,
    /// `L⁻¹ (X B)`.
    sides: DMatrix<f64>,
    /// `(X B)ᵀ K⁻¹ (X B)`.
    sums: DMatrix<f64>,
}

impl<'p> Search<'p> {
    fn new(poses: &'p Poses, candidates: &[usize], region: &[usize]) -> Option<Self> {
        let region = Region::new(poses, region)?;
        let size = poses.columns.ncols();
        let mut sides = DMatrix::zeros(3 * candidates.len(), 2 * size);
        let columns = rows_of(&poses.columns, candidates);
        let with_region = columns_of(&poses.half, candidates).tr_mul(&region.along);
        sides.columns_mut(0, size).copy_from(&columns);
        sides.columns_mut(size, size).copy_from(&with_region);
        Some(Self { between: poses.between(candidates), sides, region, poses })
    }

    /// The sums of some candidates; `None` where a factorisation fails.
    fn sums<'s>(&self, stations: &'s [usize]) -> Option<Taken<'s>> {
        let factor = block(&self.between, stations, stations).cholesky()?;
        let sides = factor.l().solve_lower_triangular(&rows_of(&self.sides, stations))?;
        Some(Taken { sums: sides.tr_mul(&sides), factor, sides, stations })
    }

    /// Mean over the region of the trace of what remains with these candidates, mm²; `None` where a factorisation fails.
    fn left(&self, stations: &[usize]) -> Option<f64> {
        self.left_by(&self.sums(stations)?.sums)
    }

    fn left_with(&self, some: &Taken<'_>, candidate: usize) -> Option<f64> {
        let with = block(&self.between, some.stations, &[candidate]);
        let with = some.factor.l_dirty().solve_lower_triangular(&with)?;
        let own = block(&self.between, &[candidate], &[candidate]) - with.tr_mul(&with);
        let sides = rows_of(&self.sides, &[candidate]) - with.tr_mul(&some.sides);
        let white = own.cholesky()?.l().solve_lower_triangular(&sides)?;
        self.left_by(&(&some.sums + white.tr_mul(&white)))
    }

    /// What remains, from `(X B)ᵀ K⁻¹ (X B)`.
    fn left_by(&self, sums: &DMatrix<f64>) -> Option<f64> {
        let size = self.poses.columns.ncols();
        let information =
            sums.view((0, 0), (size, size)) + DMatrix::from_diagonal(&self.poses.precision);
        let kept = DMatrix::identity(size, size) - sums.view((size, 0), (size, size));
        let passed_on = &kept * information.cholesky()?.solve(&kept.transpose());
        let known = sums.view((size, size), (size, size));
        let changed = (&self.region.normal * (passed_on - known)).trace();
        Some(self.region.own_mm2 + changed)
    }

    /// One candidate after another, each the best beside those before it.
    fn greedy(&self, count: usize) -> Vec<usize> {
        let mut chosen = Vec::with_capacity(count);
        while chosen.len() < count {
            let Some((best, _)) = self.best(&chosen, None) else { break };
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
                let mut others = chosen.clone();
                let own = others.remove(place);
                if let Some((other, less)) = self.best(&others, Some(own))
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

    /// The best candidate beside `chosen`, other than `but`, and what remains with it; of equal ones the first.
    fn best(&self, chosen: &[usize], but: Option<usize>) -> Option<(usize, f64)> {
        let some = self.sums(chosen)?;
        let left = |candidate: usize| {
            if chosen.contains(&candidate) || but == Some(candidate) {
                return None;
            }
            self.left_with(&some, candidate)
        };
        let all: Vec<Option<f64>> =
            (0..self.sides.nrows() / 3).into_par_iter().with_min_len(AT_ONCE).map(left).collect();
        let all = all.into_iter().enumerate();
        let all = all.filter_map(|(candidate, left)| Some((candidate, left?)));
        all.reduce(|best, next| if next.1 < best.1 { next } else { best })
    }
}

fn rows_of(matrix: &DMatrix<f64>, poses: &[usize]) -> DMatrix<f64> {
    matrix.select_rows(&coordinates(poses))
}

fn columns_of(matrix: &DMatrix<f64>, poses: &[usize]) -> DMatrix<f64> {
    matrix.select_columns(&coordinates(poses))
}

fn coordinates(poses: &[usize]) -> Vec<usize> {
    poses.iter().flat_map(|pose| 3 * pose..3 * pose + 3).collect()
}

/// The blocks of some poses (down) with others (across) in a matrix of all.
fn block(matrix: &DMatrix<f64>, down: &[usize], across: &[usize]) -> DMatrix<f64> {
    DMatrix::from_fn(3 * down.len(), 3 * across.len(), |row, column| {
        matrix[(3 * down[row / 3] + row % 3, 3 * across[column / 3] + column % 3)]
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
                columns.fixed_view_mut::<3, 1>(3 * place, axis).copy_from(&unit);
                columns
                    .fixed_view_mut::<3, 1>(3 * place, 3 + axis)
                    .copy_from(&unit.cross(&position));
            }
        }
        Poses {
            columns,
            precision: DVector::from_element(6, 1e-6),
            half: DMatrix::from_fn(4, 3 * count, |cause, row| {
                0.1 * at(row / 3, cause) * at(cause, row % 3)
            }),
            alone: (0..count)
                .map(|place| Matrix3::identity() * (1e-3 * (1.0 + at(place, 5).abs())))
                .collect(),
        }
    }

    /// Covariance of `e + X (β − γ̂)` at one pose from that of all errors and unknowns, written out.
    fn written_out(poses: &Poses, by: &Estimator, place: usize) -> Matrix3<f64> {
        let all = poses.half.tr_mul(&poses.half);
        let places = [&by.used[..], &[place]].concat();
        let errors = block(&all, &places, &places);
        let (used, size) = (3 * by.used.len(), poses.columns.ncols());
        let at_place = rows_of(&poses.columns, &[place]);
        // What remains is a matrix times (errors of the stations, error of the pose, unknowns).
        let mut of = DMatrix::zeros(3, used + 3 + size);
        of.columns_mut(0, used).copy_from(&(-(&at_place * &by.from)));
        of.columns_mut(used, 3).fill_with_identity();
        let kept = DMatrix::identity(size, size) - &by.from * &by.columns;
        of.columns_mut(used + 3, size).copy_from(&(&at_place * kept));
        let mut whole = DMatrix::zeros(used + 3 + size, used + 3 + size);
        whole.view_mut((0, 0), (used + 3, used + 3)).copy_from(&errors);
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

    /// Mean trace over all poses of what remains without that of a measurement there.
    fn mean(poses: &Poses, by: &Estimator) -> f64 {
        let left = poses.left(by).into_iter().zip(&poses.alone);
        left.map(|(left, alone)| (left - alone).trace()).sum::<f64>() / poses.count() as f64
    }

    #[test]
    fn what_remains_is_what_the_whole_covariance_says() {
        let poses = poses(9);
        let by = poses.estimator(&[0, 2, 3, 7]).expect("positive");
        let left = poses.left(&by);
        for place in [1, 4, 8] {
            let direct = written_out(&poses, &by, place);
            assert!((left[place] - direct).abs().max() < 1e-9, "{direct}");
        }
    }

    #[test]
    fn no_other_linear_estimate_leaves_less() {
        let poses = poses(9);
        let used = [0, 1, 2, 4, 5, 6];
        let best = poses.estimator(&used).expect("positive");
        let least = mean(&poses, &best);
        let alike = poses.unweighted(&used, 1e-9).expect("positive");
        assert!(least < mean(&poses, &alike));
        for entry in 0..best.from.len() {
            for change in [-1e-3, 1e-3] {
                let mut other = best.clone();
                other.from[entry] += change;
                assert!(mean(&poses, &other) > least * (1.0 - 1e-9), "{entry}");
            }
        }
    }

    #[test]
    fn a_motion_of_the_base_in_the_arm_s_errors_changes_nothing() {
        // Millimetres that geometry and base trade.
        let own = poses(9);
        let mut moved = own.clone();
        let size = own.half.nrows();
        moved.half = moved.half.clone().insert_rows(size, 6, 0.0);
        let along = own.columns.transpose() * 30.0;
        moved.half.rows_mut(size, 6).copy_from(&along);
        let used = [0, 1, 2, 4, 5, 6];
        let of = |poses: Poses| {
            let poses = poses.relative();
            let by = poses.estimator(&used).expect("positive");
            mean(&poses, &by)
        };
        let (own, moved) = (of(own), of(moved));
        assert!((own - moved).abs() < 1e-6 * own, "{own} {moved}");
    }

    #[test]
    fn the_sums_over_the_region_are_the_mean_of_what_remains() {
        let poses = poses(12);
        let (candidates, all): (Vec<usize>, Vec<usize>) = ((0..8).collect(), (0..12).collect());
        let chosen = poses.choose(&candidates, &all, 5);
        let by = poses.estimator(&chosen.stations).expect("positive");
        let mean = mean(&poses, &by);
        assert!((mean - chosen.left_mm2).abs() < 1e-6 * mean, "{mean} {chosen:?}");
    }

    #[test]
    fn no_exchange_of_one_station_is_better() {
        let poses = poses(14);
        let all: Vec<usize> = (0..14).collect();
        let chosen = poses.choose(&all, &all, 5);
        let search = Search::new(&poses, &all, &all).expect("positive");
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
