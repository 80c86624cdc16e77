//! Poses chosen one after another: a design.
//!
//! Inputs: an error model ([`FullModel`], before the session or of one measured earlier), candidate poses with the
//! covariance of a measurement there, and poses of the region that matters. Output: candidates in the order chosen.
//!
//! With K the covariance of all positions under the model, measuring candidate c with noise N subtracts `G_c (K_cc + N)⁻¹
//! G_cᵀ` from the region's covariance, `G_c` being the region's covariance with c. Two aims:
//! - *variance*: the largest trace of that goes first, so that the summed variance over the region falls fastest;
//! - *information*: the largest `ln |K_cc + N| − ln |N|`, K of geometry and frames alone. Their sum is the log determinant
//!   of the posterior information: a D-optimal set, which at a given number of poses also has the largest O1.
//!
//! After each choice K is conditioned on it, by steps of a Cholesky factor whose rows are kept for the candidates alone.

use nalgebra::{DMatrix, Matrix3, MatrixXx3, Vector3};
use rayon::prelude::*;

use crate::fit::full::{FullModel, Known, Query};
use crate::linalg::{beside, transposed};

/// Number of candidates that a worker takes at once; fixed, so that results do not depend on the number of threads.
const AT_ONCE: usize = 64;

#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    pub axes: Vec<f64>,
    pub noise: Matrix3<f64>,
}

#[derive(Debug, Clone)]
pub struct Design<'c> {
    candidates: &'c [Candidate],
    /// Square root of the candidates' prior covariance: `KᵀK` of its columns, three for each candidate.
    half: DMatrix<f64>,
    /// Covariance of the region (down) with the candidates (across).
    cross: DMatrix<f64>,
    own: Vec<Matrix3<f64>>,
    /// Rows of the Cholesky factor, three for each choice, over the candidates.
    factor: Vec<Vec<f64>>,
    pub region: Vec<Matrix3<f64>>,
    pub chosen: Vec<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    pub candidate: usize,
    /// Mean over the region of the trace of the remaining covariance, mm².
    pub left_mm2: f64,
}

impl<'c> Design<'c> {
    /// A design without choices, for the positions of a session that `model` expects.
    pub fn new(model: &FullModel, candidates: &'c [Candidate], region: &[Vec<f64>]) -> Self {
        let axes: Vec<&[f64]> = candidates.iter().map(|c| c.axes.as_slice()).collect();
        let half = half(model, &axes);
        let region: Vec<&[f64]> = region.iter().map(Vec::as_slice).collect();
        let region_half = self::half(model, &region);
        Self {
            cross: product(&region_half, &half),
            own: own_covariances(&half),
            region: own_covariances(&region_half),
            half,
            candidates,
            factor: Vec::new(),
            chosen: Vec::new(),
        }
    }

    /// Mean over the region of the trace of the remaining covariance, mm².
    pub(super) fn left_mm2(&self) -> f64 {
        let sum: f64 = self.region.iter().map(Matrix3::trace).sum();
        sum / self.region.len().max(1) as f64
    }

    /// Chooses the candidate that lowers the region's summed variance the most; `None` when all are chosen.
    pub fn choose(&mut self) -> Option<Choice> {
        let gain = |candidate: usize| {
            let cross = self.cross.columns(3 * candidate, 3);
            let between = cross.tr_mul(&cross);
            let squared = Matrix3::from_fn(|row, column| between[(row, column)]);
            self.measured(candidate)
                .try_inverse()
                .map_or(0.0, |inverse| (inverse * squared).trace())
        };
        Some(self.take(self.best(gain)?))
    }

    /// Chooses the candidate with the most information on all columns of the model together; `None` when all are chosen.
    pub(super) fn choose_informative(&mut self) -> Option<Choice> {
        let gain = |candidate: usize| {
            let noise = self.candidates[candidate].noise.determinant();
            (self.measured(candidate).determinant() / noise).ln()
        };
        Some(self.take(self.best(gain)?))
    }

    /// Conditions on a candidate.
    /// Panics when there is no such candidate, or its noise is not positive.
    pub fn take(&mut self, candidate: usize) -> Choice {
        let factor = self.measured(candidate).cholesky().expect("noise is positive").l();
        let inverse = factor.try_inverse().expect("a factor of a positive matrix");
        let rows = self.with_candidates(candidate, &inverse);
        let region = self.cross.fixed_columns::<3>(3 * candidate) * inverse.transpose();
        for (place, own) in self.own.iter_mut().enumerate() {
            let taken = Matrix3::from_fn(|row, column| rows[row][3 * place + column]);
            *own -= taken.tr_mul(&taken);
        }
        for (place, own) in self.region.iter_mut().enumerate() {
            let taken = region.fixed_rows::<3>(3 * place);
            *own -= taken * taken.transpose();
        }
        downdate(&mut self.cross, &region, &rows);
        self.factor.extend(rows);
        self.chosen.push(candidate);
        Choice { candidate, left_mm2: self.left_mm2() }
    }

    fn measured(&self, candidate: usize) -> Matrix3<f64> {
        self.own[candidate] + self.candidates[candidate].noise
    }

    /// The candidate with the largest gain that is not chosen yet; of equal ones the first.
    fn best(&self, gain: impl Fn(usize) -> f64 + Sync) -> Option<usize> {
        let mut is_free = vec![true; self.candidates.len()];
        self.chosen.iter().for_each(|&taken| is_free[taken] = false);
        let gains: Vec<Option<f64>> = (0..self.candidates.len())
            .into_par_iter()
            .with_min_len(AT_ONCE)
            .map(|candidate| is_free[candidate].then(|| gain(candidate)))
            .collect();
        let free = gains.iter().enumerate().filter_map(|(c, gain)| Some((c, (*gain)?)));
        free.reduce(|best, next| if next.1 > best.1 { next } else { best })
            .map(|(candidate, _)| candidate)
    }

    /// `inverse` times the covariance of a candidate (three rows) with all, given the choices so far.
    fn with_candidates(&self, candidate: usize, inverse: &Matrix3<f64>) -> [Vec<f64>; 3] {
        let own = self.half.fixed_columns::<3>(3 * candidate) * inverse.transpose();
        let choices = self.factor.iter();
        let taken: Vec<Vector3<f64>> = choices
            .map(|row| inverse * Vector3::from_column_slice(&row[3 * candidate..][..3]))
            .collect();
        let mut rows = [0, 1, 2].map(|_| vec![0.0; self.half.ncols()]);
        let [x, y, z] = &mut rows;
        let width = 3 * AT_ONCE;
        let parts = x.par_chunks_mut(width).zip(y.par_chunks_mut(width));
        parts.zip(z.par_chunks_mut(width)).enumerate().for_each(|(part, ((x, y), z))| {
            let first = part * width;
            let all = self.half.columns(first, x.len());
            for (row, into) in [x, y, z].into_iter().enumerate() {
                for (entry, other) in into.iter_mut().zip(all.column_iter()) {
                    *entry = own.column(row).dot(&other);
                }
                for (factor, taken) in self.factor.iter().zip(&taken) {
                    for (entry, other) in into.iter_mut().zip(&factor[first..]) {
                        *entry -= taken[row] * other;
                    }
                }
            }
        });
        rows
    }
}

/// `L⁻¹ √v Φᵀ` of the positions at `axes`, three columns each.
fn half(model: &FullModel, axes: &[&[f64]]) -> DMatrix<f64> {
    let part = |axes: &[&[f64]]| {
        let mut rows = DMatrix::zeros(3 * axes.len(), model.trained.layout.size());
        for (place, axes) in axes.iter().enumerate() {
            rows.rows_mut(3 * place, 3)
                .copy_from(&model.predict(&Query::at(axes, 0, Known::Reported)).rows);
        }
        model.posterior.half(&rows)
    };
    let parts: Vec<DMatrix<f64>> = axes.par_chunks(AT_ONCE).map(part).collect();
    beside(model.trained.layout.size(), &parts)
}

fn own_covariances(half: &DMatrix<f64>) -> Vec<Matrix3<f64>> {
    (0..half.ncols() / 3)
        .map(|place| {
            let own = half.columns(3 * place, 3);
            own.tr_mul(&own).fixed_view::<3, 3>(0, 0).into_owned()
        })
        .collect()
}

/// `leftᵀ right`, columns in parallel.
fn product(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let left_rows = transposed(&left.as_view());
    let parts: Vec<DMatrix<f64>> = (0..right.ncols())
        .step_by(3 * AT_ONCE)
        .collect::<Vec<_>>()
        .into_par_iter()
        .map(|first| &left_rows * right.columns(first, (3 * AT_ONCE).min(right.ncols() - first)))
        .collect();
    beside(left.ncols(), &parts)
}

/// `cross −= region · rows`, columns in parallel.
fn downdate(
    cross: &mut DMatrix<f64>,
    region: &MatrixXx3<f64>,
    [x_row, y_row, z_row]: &[Vec<f64>; 3],
) {
    let height = cross.nrows();
    cross.as_mut_slice().par_chunks_mut(height.max(1)).with_min_len(AT_ONCE).enumerate().for_each(
        |(column, values)| {
            let [x, y, z] = [x_row[column], y_row[column], z_row[column]];
            for (row, value) in values.iter_mut().enumerate() {
                *value -= region[(row, 0)] * x + region[(row, 1)] * y + region[(row, 2)] * z;
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use nalgebra::{Isometry3, UnitVector3};

    use super::*;
    use crate::fit::full::FullSettings;
    use crate::fit::{FitSettings, FramePair};
    use crate::geometry::{Transform, isometry_from_rpy};
    use crate::kinematics::{Arm, RobotFile};

    fn ur10() -> Arm {
        let text = include_str!("../../../pipelines/robots/ur10.toml");
        let file: RobotFile = toml::from_str(text).expect("a robot file");
        file.arm().expect("a valid arm")
    }

    /// Poses without a pattern: an irrational rotation per joint, within ±1 rad of an ordinary pose.
    fn poses(count: usize, first: usize) -> Vec<Vec<f64>> {
        let middle = [0.3, -1.4, 1.7, -1.2, -1.1, 0.4];
        let angle = |i: usize, joint: usize| {
            let turn = (first + i) as f64 * ((joint + 2) as f64).sqrt();
            middle[joint] + 2.0 * turn.fract() - 1.0
        };
        (0..count).map(|i| (0..6).map(|joint| angle(i, joint)).collect()).collect()
    }

    /// A model with few columns, before any measurement.
    fn model(region: &[Vec<f64>]) -> FullModel {
        let settings = FullSettings { harmonics: 4, ..FullSettings::default() };
        let frames = FramePair::only(
            Transform::claim(isometry_from_rpy([2500.0, 0.0, 0.0], [0.0; 3])),
            Transform::claim(Isometry3::translation(10.0, 0.0, 90.0)),
        );
        let up = UnitVector3::new_normalize(Vector3::z());
        let prior = FitSettings::default().prior();
        FullModel::expected(&ur10(), &frames.into(), region, 50, &prior, &settings, Some(up))
    }

    fn candidates(count: usize) -> Vec<Candidate> {
        let noise = |place: usize| Matrix3::identity() * (1e-3 * (1.0 + place as f64 / 10.0));
        let poses = poses(count, 100).into_iter().enumerate();
        poses.map(|(place, axes)| Candidate { axes, noise: noise(place) }).collect()
    }

    /// Covariance of the region given measurements at `chosen`, by one dense conditioning: `K_rr − K_rc (K_cc + N)⁻¹ K_cr`.
    fn dense(
        model: &FullModel,
        candidates: &[Candidate],
        region: &[Vec<f64>],
        chosen: &[usize],
    ) -> DMatrix<f64> {
        let axes: Vec<&[f64]> = chosen.iter().map(|&c| candidates[c].axes.as_slice()).collect();
        let measured = half(model, &axes);
        let region: Vec<&[f64]> = region.iter().map(Vec::as_slice).collect();
        let region = half(model, &region);
        let mut between = measured.tr_mul(&measured);
        for (place, &candidate) in chosen.iter().enumerate() {
            let mut own = between.fixed_view_mut::<3, 3>(3 * place, 3 * place);
            own += candidates[candidate].noise;
        }
        let cross = region.tr_mul(&measured);
        let solved = between.cholesky().expect("positive").solve(&cross.transpose());
        region.tr_mul(&region) - cross * solved
    }

    #[test]
    fn what_is_left_is_what_one_dense_conditioning_leaves() {
        let region = poses(5, 0);
        let (model, candidates) = (model(&region), candidates(12));
        let mut design = Design::new(&model, &candidates, &region);
        for _ in 0..7 {
            design.choose();
        }
        let direct = dense(&model, &candidates, &region, &design.chosen);
        for (place, own) in design.region.iter().enumerate() {
            let direct = direct.fixed_view::<3, 3>(3 * place, 3 * place);
            // The base alone may be off by 300 mm before: 1e5 mm² to 1e-2 mm², so eight digits are lost.
            assert!((own - direct).abs().max() < 1e-5, "{own} {direct}");
        }
    }

    #[test]
    fn each_choice_is_the_best_of_all_that_are_left() {
        let region = poses(5, 0);
        let (model, candidates) = (model(&region), candidates(10));
        let mut design = Design::new(&model, &candidates, &region);
        for _ in 0..6 {
            let before = design.chosen.clone();
            let chosen = design.choose().expect("candidates are left").candidate;
            let left = |candidate: usize| {
                let with = [before.clone(), vec![candidate]].concat();
                dense(&model, &candidates, &region, &with).trace()
            };
            let free = (0..candidates.len()).filter(|c| !before.contains(c));
            let best = free.map(left).fold(f64::INFINITY, f64::min);
            assert!(left(chosen) <= best * (1.0 + 1e-6), "{chosen} after {before:?}");
        }
    }

    #[test]
    fn the_informative_choice_adds_most_to_the_determinant() {
        // ln |I + H Hᵀ| over the chosen measurements is the information gained; a greedy step takes the largest share.
        let region = poses(5, 0);
        let model = model(&region).geometry_alone();
        let candidates = candidates(8);
        let gain = |chosen: &[usize]| {
            let axes: Vec<&[f64]> = chosen.iter().map(|&c| candidates[c].axes.as_slice()).collect();
            let measured = half(&model, &axes);
            let mut noise = DMatrix::zeros(3 * chosen.len(), 3 * chosen.len());
            for (place, &candidate) in chosen.iter().enumerate() {
                let mut own = noise.fixed_view_mut::<3, 3>(3 * place, 3 * place);
                own.copy_from(&candidates[candidate].noise);
            }
            let whole = measured.tr_mul(&measured) + &noise;
            whole.determinant().ln() - noise.determinant().ln()
        };
        let mut design = Design::new(&model, &candidates, &[]);
        for _ in 0..3 {
            let before = design.chosen.clone();
            let chosen = design.choose_informative().expect("candidates are left").candidate;
            let with = |candidate: usize| gain(&[before.clone(), vec![candidate]].concat());
            let free = (0..candidates.len()).filter(|c| !before.contains(c));
            let best = free.map(with).fold(f64::NEG_INFINITY, f64::max);
            assert!(with(chosen) >= best - 1e-6, "{chosen} after {before:?}");
        }
        assert!(design.choose_informative().is_some() && design.left_mm2().abs() < 1e-15);
    }
}
