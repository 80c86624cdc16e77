//! Whether joint curves hold up on blocks of the work space that are left out.
//!
//! A curve of 180 coefficients a joint can always be laid through the stations; where an arm's errors are not functions of its
//! joints, as with cables, it predicts worse than geometry and gravity do. The evidence of a model that is wrong in this way does
//! not say so, so the model is trained a second time without curves and gear lines, and the two are held against each other on
//! blocks: each block's residuals as predicted from all others, in closed form at the sizes found.
//!
//! What a block's stations said is taken out of their residuals in closed form; the rest is predicted by a posterior that never saw it.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, Point3};

use super::leave_one_out::{Explaining, firsts, left_open};
use super::regression::Evidence;
use super::regression::sessions::SessionSums;
use super::rows::{Around, Coefficients, Row, covariances, stations};
use super::settings::FullSettings;
use super::train::{Settled, train};
use super::whitening::add;
use crate::fit::holdout::{Blocks, FOLDS};
use crate::fit::model::PartEvidence;
use crate::fit::problem::Problem;
use crate::linalg::{Cholesky, gram};

/// Number of blocks that suffice where they all say the same clearly.
const CLEAR: usize = 3;
const CLEARLY: f64 = 0.25;
/// Stations of a block whose mean distance is known to some 5 %.
const MANY: usize = 100;

impl Settled {
    /// This model, or the one without curves and gear lines where that predicts left-out blocks better on the mean; with the
    /// evidence of the curves.
    pub(super) fn without_curves_that_fail(
        self,
        problem: &Problem<'_>,
        start: DVector<f64>,
        settings: &FullSettings,
    ) -> (Self, Option<PartEvidence>) {
        let plain = FullSettings { harmonics: 0, gear_lines: false, ..settings.clone() };
        // Of few stations a shorter training says something else, and a whole one takes no time.
        let is_few = matches!(self.evidence, Evidence::Rows(_));
        let without = if is_few {
            train(problem, start.clone(), &plain, self.state.up)
        } else {
            self.with_fewer_parts(problem, &plain)
        };
        let Some(without) = without else { return (self, None) };
        let Some(apart) = self.ln_smaller_than(&without, problem) else { return (self, None) };
        let kept = apart >= 0.0;
        let rows = 3 * problem.observations.len();
        let evidence = PartEvidence {
            name: "joint_curves",
            // The log likelihood of left-out residuals, each model with residuals of its own size.
            gain: rows as f64 * apart,
            kept,
        };
        if kept {
            return (self, Some(evidence));
        }
        let whole = if is_few { None } else { train(problem, start, &plain, self.state.up) };
        (whole.unwrap_or(without), Some(evidence))
    }

    /// The logarithm of how much smaller the mean distance of measured and predicted positions is than by `other`, each predicted
    /// without its block; `None` where a block cannot be left out. Blocks are asked until [`CLEAR`] large ones have all said the same.
    fn ln_smaller_than(&self, other: &Self, problem: &Problem<'_>) -> Option<f64> {
        let folds = folds(problem, &self.state.offsets);
        let around = [self, other].map(|own| Around::new(problem, &own.state));
        let known = [self.known(&around[0])?, other.known(&around[1])?];
        let (mut sums, mut said) = ([0.0, 0.0], Vec::new());
        for fold in 0..FOLDS {
            let block: Vec<usize> =
                (0..folds.len()).filter(|&place| folds[place] == fold).collect();
            if block.is_empty() {
                continue;
            }
            let own = self.left_out(&around[0], &known[0], &block)?;
            let others = other.left_out(&around[1], &known[1], &block)?;
            sums = [sums[0] + own, sums[1] + others];
            let apart = (others / own).ln();
            said.push(if block.len() < MANY { 0.0 } else { apart });
            let clear = |sign: f64| said.iter().all(|apart| sign * apart > CLEARLY);
            if said.len() >= CLEAR && (clear(1.0) || clear(-1.0)) {
                break;
            }
        }
        Some((sums[1] / sums[0]).ln())
    }

    /// What leaving out any block needs of all rows; `None` where they are few and their covariance cannot be found.
    fn known<'a>(&'a self, around: &'a Around<'_>) -> Option<Known<'a>> {
        if let Evidence::Sessions(sums) = &self.evidence {
            return Some(Known::Pool(sums));
        }
        let all: Vec<usize> = (0..around.count()).collect();
        let rows = around.rows(&all);
        let noise = covariances(around.state, &rows, &all);
        let open = if matches!(self.evidence, Evidence::Rows(_)) {
            Open::Root(left_open(&self.posterior, &noise)?)
        } else {
            let covariance = self.posterior.by_session(self.posterior.inverse());
            let seen = around.seen(0);
            Open::BesideExplained(Explaining::of(seen, &covariance.of(0, &seen.columns)))
        };
        Some(Known::Rows { rows, noise, open })
    }

    /// Sum of the distances of the observations of one block's stations, each predicted without the block, mm.
    ///
    /// With `N` the block's noise, `H` the covariance that the model explains there and `r` its residuals, those left out are
    /// `N (N − H)⁻¹ r`, as [`leave_one_out`](super::leave_one_out) has it for one station. A block of a pool has more rows than its
    /// sessions share columns, and is left out by the sums of all others.
    fn left_out(&self, around: &Around<'_>, known: &Known<'_>, block: &[usize]) -> Option<f64> {
        let (rows, covariances, open) = match known {
            Known::Pool(all) => return self.left_out_of_pool(around, all, block),
            Known::Rows { rows, noise, open } => (rows, noise, open),
        };
        let mean = self.posterior.mean() + &self.prior_mean;
        let count = block.iter().map(|&place| rows[place].value.len()).sum();
        let mut left = DVector::zeros(count);
        let mut noise = DMatrix::zeros(count, count);
        let mut first = 0;
        for (session, stations) in around.batches_of(block) {
            let own = Coefficients::of(around.seen(session), &mean);
            for place in stations {
                let (row, size) = (&rows[place], rows[place].value.len());
                let mut residual = left.rows_mut(first, size);
                residual.copy_from(&(&row.value - row.times(&own)));
                noise.view_mut((first, first), (size, size)).copy_from(&covariances[place]);
                first += size;
            }
        }
        let open = match open {
            Open::Root(open) => gram(&open.select_columns(&rows_of(rows, block)).as_view()),
            Open::BesideExplained(explaining) => {
                let rows: Vec<&Row> = block.iter().map(|&place| &rows[place]).collect();
                &noise - explaining.together(&rows)
            }
        };
        let residual = noise * Cholesky::new(open)?.solve(&left);
        first = 0;
        let away = block.iter().map(|&place| {
            let size = rows[place].value.len();
            let own = residual.rows(first, size).into_owned();
            first += size;
            distance(&rows[place], &own)
        });
        Some(away.sum())
    }

    /// [`Self::left_out`] of a pool with the sums of `all` its rows.
    fn left_out_of_pool(
        &self,
        around: &Around<'_>,
        all: &SessionSums,
        block: &[usize],
    ) -> Option<f64> {
        let mut sums = SessionSums::zero(&around.partition);
        let mut batches = Vec::new();
        for (session, stations) in around.batches_of(block) {
            let rows = around.rows(&stations);
            add(around, session, &stations, &rows, &self.prior_mean, sums.adding(session));
            batches.push((session, rows));
        }
        let others = Evidence::Sessions(all.without(&sums));
        let mean = others.posterior_at(self.posterior.scale.clone())?.mean() + &self.prior_mean;
        let away = batches.iter().map(|(session, rows)| {
            let own = Coefficients::of(around.seen(*session), &mean);
            rows.iter().map(|row| distance(row, &(&row.value - row.times(&own)))).sum::<f64>()
        });
        Some(away.sum())
    }
}

/// What leaving out any block needs.
enum Known<'a> {
    /// The sums over all rows of a pool.
    Pool(&'a SessionSums),
    /// Rows of each station, the covariance of their noise (mm² and rad²), and what the model leaves open of it.
    Rows { rows: Cow<'a, [Row]>, noise: Vec<DMatrix<f64>>, open: Open<'a> },
}

/// The covariance of rows that a model leaves open, mm² and rad².
enum Open<'a> {
    /// Its square root for all rows, a column for each; where they are few.
    Root(DMatrix<f64>),
    /// The noise less what the columns of one session explain.
    BesideExplained(Explaining<'a>),
}

/// Sum over a station's readings of the distance of measured and predicted position, mm, whatever else was read.
fn distance(row: &Row, residual: &DVector<f64>) -> f64 {
    let readings = row.noise.firsts();
    readings.map(|(first, own)| residual.rows(first, own.rows().min(3)).norm()).sum()
}

/// The places of the rows of some stations, all stations' rows one below the other.
fn rows_of(rows: &[Row], own: &[usize]) -> Vec<usize> {
    let firsts = firsts(rows);
    own.iter().flat_map(|&place| firsts[place]..firsts[place] + rows[place].value.len()).collect()
}

/// The block of each station by the position of its first reading in the base frame, the predicted one where none was measured.
fn folds(problem: &Problem<'_>, offsets: &DVector<f64>) -> Vec<usize> {
    let frames = problem.frames(offsets);
    let chains = problem.held(offsets);
    let position = |observation: &crate::fit::observation::Observation| {
        let base = frames[observation.session].tracker_from_base(observation.source);
        let predicted = || {
            let end = chains.of(observation.channel()).end(&observation.axes);
            Point3::from(end.translation.vector)
        };
        let point = observation.point();
        let measured = point.map_or_else(predicted, |point| point.position);
        base.isometry().inverse_transform_point(&measured)
    };
    let stations = stations(problem.observations).into_iter();
    let positions = stations.map(|own| position(&problem.observations[own.start]));
    let positions: Vec<Point3<f64>> = positions.collect();
    Blocks::default().folds(&positions)
}

#[cfg(test)]
mod tests;
