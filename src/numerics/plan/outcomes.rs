//! The outcomes of many robots: figures over robots, and whether enough of them meet the tolerance.

use std::collections::BTreeMap;

use crate::figures::{Counted, Coverage, Figures, share_at_least, upper_tolerance_bound};
use crate::fit::FitError;
use crate::grid::{Refusal, Tolerance, Verdict};

#[derive(Debug, Clone)]
pub enum RobotOutcome {
    Judged(Left),
    NoFit(FitError),
}

/// Remaining errors on fresh poses of one robot.
#[derive(Debug, Clone)]
pub struct Left {
    /// Figures of the norms, mm; `None` where no pose could be judged.
    pub figures: Option<Figures>,
    /// Upper tolerance bound, mm; `None` with too few poses.
    pub bound: Option<f64>,
    pub verdict: Verdict,
    pub refused: BTreeMap<Refusal, usize>,
    pub outside: usize,
}

impl RobotOutcome {
    /// The outcome of the remaining error at each fresh pose, mm: `None` outside a grid, or why its cell cannot serve.
    pub fn of(
        left: impl Iterator<Item = Option<Result<f64, Refusal>>>,
        tolerance: &Tolerance,
    ) -> Self {
        let mut norms = Vec::new();
        let mut refused = BTreeMap::new();
        let mut outside = 0;
        for found in left {
            match found {
                Some(Ok(norm)) => norms.push(norm),
                Some(Err(refusal)) => *refused.entry(refusal).or_default() += 1,
                None => outside += 1,
            }
        }
        let bound = upper_tolerance_bound(&norms, tolerance.coverage());
        // The true errors are known here: no measurement uncertainty is added.
        let verdict = tolerance.verdict(bound, Counted::once(norms.len()), 0.0);
        Self::Judged(Left { figures: Figures::of(&norms), bound, verdict, refused, outside })
    }
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outcomes {
    pub robots: usize,
    pub no_fit: usize,
    pub judged: usize,
    pub meet: usize,
    /// Least share of the population that meets it, with the confidence asked for.
    pub share_at_least: f64,
    pub share_asked: f64,
    /// Mean over robots of each robot's figures, mm; `None` without a robot that was judged.
    pub mean: Option<RobotFigures>,
    /// Bound of the mean errors: the share of robots asked for stays below it, with the confidence asked for, mm; `None`
    /// with too few robots.
    pub mean_bound_mm: Option<f64>,
    /// Bound of the bounds, mm: the asked share of robots stays below it with the asked confidence; `None` of too few.
    pub bound_mm: Option<f64>,
    /// Number of fresh poses that could not be judged because of their cell, all robots together.
    pub refused: BTreeMap<Refusal, usize>,
    /// Number of fresh poses outside the grid, all robots together.
    pub outside: usize,
}

/// Figures of one robot, or their means over robots, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RobotFigures {
    pub mean: f64,
    pub p95: f64,
    pub p99: f64,
    pub max: f64,
}

impl Outcomes {
    /// Sums up robots; `asked` is the share that has to meet the tolerance, and the confidence of that.
    pub fn of<'r>(robots: impl Iterator<Item = &'r RobotOutcome>, asked: Coverage) -> Self {
        let mut all = Self { share_asked: asked.share, ..Self::default() };
        let (mut figures, mut bounds) = (Vec::new(), Vec::new());
        for robot in robots {
            all.robots += 1;
            match robot {
                RobotOutcome::NoFit(_) => all.no_fit += 1,
                RobotOutcome::Judged(left) => {
                    figures.extend(left.figures);
                    bounds.extend(left.bound);
                    all.meet += usize::from(left.verdict == Verdict::Meets);
                    all.outside += left.outside;
                    for (refusal, count) in &left.refused {
                        *all.refused.entry(*refusal).or_default() += count;
                    }
                }
            }
        }
        all.judged = bounds.len();
        all.share_at_least = share_at_least(all.meet, all.robots, asked.confidence);
        all.mean = RobotFigures::mean(&figures);
        // A robot without a bound is worse than any that has one.
        bounds.extend(std::iter::repeat_n(f64::INFINITY, all.robots - bounds.len()));
        let means: Vec<f64> = figures
            .iter()
            .map(|f| f.mean)
            .chain(std::iter::repeat_n(f64::INFINITY, all.robots - figures.len()))
            .collect();
        let finite = |bound: &f64| bound.is_finite();
        all.bound_mm = upper_tolerance_bound(&bounds, asked).filter(finite);
        all.mean_bound_mm = upper_tolerance_bound(&means, asked).filter(finite);
        all
    }

    /// Whether the asked share of robots is shown to meet the tolerance.
    pub fn holds(&self) -> bool {
        self.share_at_least >= self.share_asked
    }
}

impl RobotFigures {
    fn mean(figures: &[Figures]) -> Option<Self> {
        let n = figures.len() as f64;
        let mean = |pick: fn(&Figures) -> f64| figures.iter().map(pick).sum::<f64>() / n;
        (!figures.is_empty()).then(|| Self {
            mean: mean(|f| f.mean),
            p95: mean(|f| f.p95),
            p99: mean(|f| f.p99),
            max: mean(|f| f.max),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn robots_without_a_fit_count_against_a_step() {
        let tolerance = Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };
        let good = RobotOutcome::of((0..60).map(|_| Some(Ok(0.1))), &tolerance);
        let bad =
            RobotOutcome::NoFit(FitError::TooFewStations { session: 0, stations: 1, needed: 4 });
        let asked = Coverage { share: 0.9, confidence: 0.95 };
        let robots: Vec<RobotOutcome> = (0..60).map(|_| good.clone()).collect();
        let all = Outcomes::of(robots.iter(), asked);
        assert!(all.holds() && all.bound_mm == Some(0.1), "{all:?}");
        let half = Outcomes::of(robots.iter().take(30).chain([&bad; 30]), asked);
        assert!(!half.holds() && half.bound_mm.is_none(), "{half:?}");
        assert_eq!((half.robots, half.no_fit, half.meet), (60, 30, 30));
    }
}
