//! The clocks: matched dwells → offset and drift from the edges seen in both logs, with their standard errors.
//!
//! A log shows an arrival late and a departure early, by its sampling and its threshold; the difference of the two logs is
//! a third unknown in addition to offset and drift, `tracker − controller = offset + drift · t ± late` (+ on arrivals, − on
//! departures). It cancels where the two are equal. Iterated Tukey's weights on the residuals, their scale from the median
//! absolute deviation, leave wrong edges out.
//! A tracker that reads only while stationary gives no edges: then the middles of the dwells are used.

use nalgebra::{Matrix3, Vector3};

use super::average::{SIGMA_PER_MAD, median};
use super::pattern::{Dwells, Pair, Relation};
use crate::figures::extremes;

/// With fewer edges than this the middles of dwells are used.
const MIN_EDGES: usize = 8;
const ROUNDS: usize = 20;
/// Tukey's constant: 95 % efficient on Gaussian residuals.
const TUKEY: f64 = 4.685;
/// Priors in weights of a mark: none on the offset; a drift of 100 ppm counts like a millisecond; without sides, or with
/// one only, `late` is zero. A session of minutes is hardly affected; a few marks at one moment would fail without them.
const PRIORS: [f64; 3] = [0.0, 100.0, 1e-6];
/// Least scale of the residuals, s: time stamps are no better than this.
const LEAST_SCALE_S: f64 = 1e-4;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Refined {
    pub relation: Relation,
    pub offset_se_s: f64,
    pub drift_se: f64,
    pub matched: usize,
    pub rms_s: f64,
    /// Whether edges were used; otherwise middles.
    pub by_edges: bool,
}

#[derive(Debug, Clone, Copy)]
struct Mark {
    at_s: f64,
    ahead_s: f64,
    /// +1 on arrivals, −1 on departures, 0 on middles.
    side: f64,
}

/// Refines the clock relation on the edges of `pairs`. `sampling_s` are the two logs' usual sample intervals, s.
/// Panics without pairs.
pub(super) fn refine(dwells: Dwells, pairs: &[Pair], sampling_s: [f64; 2]) -> Refined {
    let edges = edges(dwells, pairs);
    let by_edges = edges.len() >= MIN_EDGES;
    let marks = if by_edges { edges } else { middles(dwells, pairs) };
    let centre_s = marks.iter().map(|mark| mark.at_s).sum::<f64>() / marks.len() as f64;
    let mut weights = vec![1.0; marks.len()];
    let mut line = Line::fit(&marks, &weights, centre_s);
    for _ in 0..ROUNDS {
        let next = tukey_weights(&marks, &line);
        if next == weights {
            break;
        }
        weights = next;
        line = Line::fit(&marks, &weights, centre_s);
    }
    line.summary(&marks, &weights, sampling_s, by_edges)
}

fn edges(dwells: Dwells, pairs: &[Pair]) -> Vec<Mark> {
    let mark = |arm: Option<f64>, target: Option<f64>, side: f64| {
        let at_s = arm?;
        Some(Mark { at_s, ahead_s: target? - at_s, side })
    };
    let both = |pair: &Pair| {
        let (arm, target) = (&dwells.arm[pair.arm].span, &dwells.target[pair.target].span);
        [mark(arm.arrived_s, target.arrived_s, 1.0), mark(arm.left_s, target.left_s, -1.0)]
    };
    pairs.iter().flat_map(both).flatten().collect()
}

fn middles(dwells: Dwells, pairs: &[Pair]) -> Vec<Mark> {
    let middle = |pair: &Pair| {
        let at_s = dwells.arm[pair.arm].span.middle_s();
        let ahead_s = dwells.target[pair.target].span.middle_s() - at_s;
        Mark { at_s, ahead_s, side: 0.0 }
    };
    pairs.iter().map(middle).collect()
}

/// `ahead = at_centre + drift · (t − centre) + late · side`, and the inverse of its normal matrix.
struct Line {
    unknowns: Vector3<f64>,
    inverse: Matrix3<f64>,
    centre_s: f64,
}

impl Line {
    fn fit(marks: &[Mark], weights: &[f64], centre_s: f64) -> Self {
        let mut normal = Matrix3::from_diagonal(&Vector3::from(PRIORS));
        let mut right = Vector3::zeros();
        for (mark, &weight) in marks.iter().zip(weights) {
            let row = Self::row(mark, centre_s);
            normal += row * row.transpose() * weight;
            right += row * (mark.ahead_s * weight);
        }
        let inverse =
            normal.try_inverse().expect("priors and at least one weight make it positive definite");
        Self { unknowns: inverse * right, inverse, centre_s }
    }

    fn row(mark: &Mark, centre_s: f64) -> Vector3<f64> {
        Vector3::new(1.0, mark.at_s - centre_s, mark.side)
    }

    fn residual_s(&self, mark: &Mark) -> f64 {
        mark.ahead_s - Self::row(mark, self.centre_s).dot(&self.unknowns)
    }

    /// The estimate with its standard errors. If both logs are sampled in step, every edge is shifted alike, by up to the
    /// uncertainty of their intervals, and no residual shows it. The part of it beyond the residuals' scatter is added to the
    /// offset, and to the drift as if the two ends of the session were off by it independently.
    fn summary(
        &self,
        marks: &[Mark],
        weights: &[f64],
        sampling_s: [f64; 2],
        by_edges: bool,
    ) -> Refined {
        let used = || marks.iter().zip(weights).filter(|&(_, &w)| w > 0.0);
        let matched = used().count();
        let squares: f64 = used().map(|(mark, _)| self.residual_s(mark).powi(2)).sum();
        let variance = squares / matched.saturating_sub(3).max(1) as f64;
        let sampling = (sampling_s[0].powi(2) + sampling_s[1].powi(2)) / 12.0;
        let unseen = (sampling - variance).max(0.0);
        let to_start = Vector3::new(1.0, -self.centre_s, 0.0);
        let leverage = (to_start.transpose() * self.inverse * to_start)[0];
        let drift = self.unknowns[1];
        let ends_s = extremes(marks.iter().map(|mark| mark.at_s));
        let span_s = ends_s.map_or(0.0, |(first_s, last_s)| last_s - first_s).max(1.0);
        Refined {
            relation: Relation { offset_s: self.unknowns[0] - drift * self.centre_s, drift },
            offset_se_s: (variance * leverage + unseen).sqrt(),
            drift_se: (variance * self.inverse[(1, 1)] + 2.0 * unseen / (span_s * span_s)).sqrt(),
            matched,
            rms_s: (squares / matched.max(1) as f64).sqrt(),
            by_edges,
        }
    }
}

fn tukey_weights(marks: &[Mark], line: &Line) -> Vec<f64> {
    let residuals: Vec<f64> = marks.iter().map(|mark| line.residual_s(mark)).collect();
    let mut sizes: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
    let cut_s = TUKEY * (SIGMA_PER_MAD * median(&mut sizes)).max(LEAST_SCALE_S);
    let weight = |residual: &f64| {
        let share = (residual / cut_s).powi(2);
        if share < 1.0 { (1.0 - share).powi(2) } else { 0.0 }
    };
    residuals.iter().map(weight).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Marks of a clock 5 s ahead at the start and 40 ppm fast, arrivals seen 10 ms late, every ninth edge wrong by 1 s.
    fn marks() -> Vec<Mark> {
        let mark = |k: usize| {
            let at_s = 20.0 * k as f64;
            let side = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            let wrong_s = if k % 9 == 4 { 1.0 } else { 0.0 };
            Mark { at_s, ahead_s: 5.0 + 40e-6 * at_s + 0.010 * side + wrong_s, side }
        };
        (0..100).map(mark).collect()
    }

    #[test]
    fn offset_and_drift_survive_late_edges_and_wrong_ones() {
        let marks = marks();
        let mut line = Line::fit(&marks, &[1.0; 100], 990.0);
        let mut weights = Vec::new();
        for _ in 0..ROUNDS {
            weights = tukey_weights(&marks, &line);
            line = Line::fit(&marks, &weights, 990.0);
        }
        let refined = line.summary(&marks, &weights, [0.02, 0.05], true);
        assert!((refined.relation.offset_s - 5.0).abs() < 1e-6, "{refined:?}");
        assert!((refined.relation.drift - 40e-6).abs() < 1e-9, "{refined:?}");
        assert_eq!(refined.matched, 89); // 100 without 4, 13, … 94
        // The residuals show nothing of the sampling, so all of it is in the error: √((0.02² + 0.05²)/12) = 15.5 ms.
        assert!((refined.offset_se_s - 0.01554).abs() < 1e-4, "{refined:?}");
    }
}
