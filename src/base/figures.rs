//! Figures of error norms. Percentiles interpolate linearly between order statistics (Hyndman and Fan's type 7). The
//! tolerance bound is the k-th smallest of n, k the least with `BinomCDF(k − 1; n, P) ≥ γ` (`posegrid::method::grids`).
//! It assumes independent errors, which visits of one pose are not: [`PoseErrors`] counts poses.

use crate::units::whole;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use serde::{Deserialize, Serialize};
use statrs::distribution::{Beta, Binomial, ContinuousCDF, DiscreteCDF};

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Coverage {
    /// Share of the population, 0.95 for 95 %.
    pub share: f64,
    /// Confidence, 0.95 for 95 %.
    pub confidence: f64,
}

/// Figures of a set of error norms, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figures {
    pub n: usize,
    pub mean: f64,
    pub rms: f64,
    pub sd: f64,
    pub median: f64,
    pub p95: f64,
    pub p99: f64,
    pub max: f64,
}

impl Figures {
    /// Figures of `norms`; `None` for an empty set.
    pub fn of(norms: &[f64]) -> Option<Self> {
        let sorted = ascending(norms);
        let max = *sorted.last()?;
        let n = sorted.len() as f64;
        let mean = sorted.iter().sum::<f64>() / n;
        let squares = sorted.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
        Some(Self {
            n: sorted.len(),
            mean,
            rms: (sorted.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            sd: if sorted.len() > 1 { (squares / (n - 1.0)).sqrt() } else { 0.0 },
            median: median(&sorted)?,
            p95: percentile(&sorted, 0.95),
            p99: percentile(&sorted, 0.99),
            max,
        })
    }

    /// Mean plus three standard deviations: the literature's figure, not a verdict.
    pub fn mean_plus_3_sd(&self) -> f64 {
        3.0f64.mul_add(self.sd, self.mean)
    }
}

pub fn extremes(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    values.fold(None, |range, value| {
        let (low, high) = range.unwrap_or((value, value));
        Some((value.min(low), value.max(high)))
    })
}

/// The median of `values`: the mean of the middle two of an even number; `None` for an empty set.
pub fn median(values: &[f64]) -> Option<f64> {
    median_in_place(&mut values.to_vec())
}

/// The median of `values`, which are reordered; `None` for an empty set.
pub fn median_in_place(values: &mut [f64]) -> Option<f64> {
    if values.is_empty() {
        return None;
    }
    let middle = values.len() / 2;
    let is_odd = values.len() % 2 == 1;
    let (below, &mut upper, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if is_odd {
        return Some(upper);
    }
    let lower = below.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Some(f64::midpoint(lower, upper))
}

/// Coverage factor of every expanded uncertainty (GUM): 95 % of a normal distribution.
pub const COVERAGE_FACTOR: f64 = 2.0;

/// The number behind a ±: twice a standard error or deviation, in its unit.
pub fn expanded(standard: f64) -> f64 {
    COVERAGE_FACTOR * standard
}

/// The 95 % quantile of chi squared with three degrees of freedom.
pub const CHI_SQUARED_3_95: f64 = 7.814_727_903;
/// The 99 % quantile of chi squared with three degrees of freedom.
pub const CHI_SQUARED_3_99: f64 = 11.344_866_730;

/// The mean of `values` and its standard error, `√(G/(G − 1) Σ_g (Σ_{i∈g} (vᵢ − v̄))²)/n`: values of one of the G
/// groups are not independent, groups are (Liang and Zeger 1986, for a mean). `None` of fewer than two groups.
pub fn clustered_mean<G: Ord>(values: &[f64], groups: &[G]) -> Option<(f64, f64)> {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let mut sums: BTreeMap<&G, f64> = BTreeMap::new();
    for (value, group) in values.iter().zip(groups) {
        *sums.entry(group).or_default() += value - mean;
    }
    let groups = sums.len() as f64;
    let squares: f64 = sums.values().map(|own| own * own).sum();
    (sums.len() > 1).then(|| (mean, (squares * groups / (groups - 1.0)).sqrt() / count))
}

/// Distribution-free upper bound on the share `coverage.share` of the errors' population.
///
/// `None` where n is too small for the asked confidence: "not shown", never a smaller claim.
///
/// ```
/// use posegrid_base::figures::{Coverage, least_count, upper_tolerance_bound};
///
/// let coverage = Coverage { share: 0.95, confidence: 0.95 };
/// let errors_mm: Vec<f64> = (1..=59).map(|i| 0.01 * f64::from(i)).collect();
/// // 59 errors are the fewest that show anything, and then it is the largest of them.
/// assert_eq!(least_count(coverage).round(), 59.0);
/// assert_eq!(upper_tolerance_bound(&errors_mm, coverage), Some(0.59));
/// assert_eq!(upper_tolerance_bound(&errors_mm[..58], coverage), None);
/// ```
pub fn upper_tolerance_bound(norms: &[f64], coverage: Coverage) -> Option<f64> {
    let rank = bound_rank(norms.len(), coverage)?;
    ascending(norms).get(rank - 1).copied()
}

/// Error norms by pose, the unit that a distribution-free bound counts: a pose counts with the worst of its visits, in
/// each sample (grids of several phases, other sessions) that its visits have.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PoseErrors {
    /// The worst error by pose and sample, mm.
    worst: BTreeMap<(usize, usize), f64>,
    poses: BTreeSet<usize>,
    visits: BTreeSet<usize>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Counted {
    pub poses: usize,
    pub visits: usize,
}

impl Counted {
    pub const fn once(poses: usize) -> Self {
        Self { poses, visits: poses }
    }
}

impl fmt::Display for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} poses", self.poses)?;
        if self.visits > self.poses {
            write!(f, " in {} visits", self.visits)?;
        }
        Ok(())
    }
}

impl PoseErrors {
    /// Adds an error (mm) of `visit`, a station's number, of `pose`; `sample` numbers the errors of one visit.
    pub fn add(&mut self, pose: usize, visit: usize, sample: usize, error_mm: f64) {
        let worst = self.worst.entry((pose, sample)).or_insert(error_mm);
        if error_mm.total_cmp(worst).is_gt() {
            *worst = error_mm;
        }
        self.poses.insert(pose);
        self.visits.insert(visit);
    }

    pub fn counted(&self) -> Counted {
        Counted { poses: self.poses.len(), visits: self.visits.len() }
    }

    /// Distribution-free upper bound on the share, mm; `None` with too few poses. With several samples per pose the
    /// rank is of one error per pose, scaled to the number of all errors.
    pub fn bound(&self, coverage: Coverage) -> Option<f64> {
        let poses = self.poses.len();
        let rank = bound_rank(poses, coverage)?;
        let worst: Vec<f64> = self.worst.values().copied().collect();
        let place = (rank * worst.len()).div_ceil(poses);
        ascending(&worst).get(place.checked_sub(1)?).copied()
    }

    pub fn worst(&self) -> Vec<f64> {
        let mut worst: BTreeMap<usize, f64> = BTreeMap::new();
        for ((pose, _), error_mm) in &self.worst {
            let own = worst.entry(*pose).or_insert(*error_mm);
            *own = own.max(*error_mm);
        }
        worst.into_values().collect()
    }
}

/// The rank k (from 1) of the order statistic that is the bound; `None` where even the largest error is no bound.
pub fn bound_rank(n: usize, coverage: Coverage) -> Option<usize> {
    let binomial = Binomial::new(coverage.share, u64::try_from(n).ok()?).ok()?;
    let holds = |k: usize| binomial.cdf(k as u64 - 1) >= coverage.confidence;
    if n == 0 || !holds(n) {
        return None;
    }
    let ranks: Vec<usize> = (1..=n).collect();
    ranks.get(ranks.partition_point(|&k| !holds(k))).copied()
}

/// The least n for which the largest of n bounds the share with the confidence.
pub fn least_count(coverage: Coverage) -> f64 {
    ((1.0 - coverage.confidence).ln() / coverage.share.ln()).ceil()
}

/// One-sided lower confidence limit of a share, `k` of `n` observed (Clopper and Pearson 1934).
pub fn share_at_least(k: usize, n: usize, confidence: f64) -> f64 {
    if k == 0 {
        return 0.0;
    }
    beta(k, n - k + 1).inverse_cdf(1.0 - confidence)
}

/// Confidence interval of a share, `k` of `n` observed (Clopper and Pearson 1934); 0 to 1 when `n` is 0.
pub fn share_interval(k: usize, n: usize, confidence: f64) -> (f64, f64) {
    let tail = 0.5 * (1.0 - confidence);
    let low = share_at_least(k, n, 1.0 - tail);
    let high = if k == n { 1.0 } else { beta(k + 1, n - k).inverse_cdf(1.0 - tail) };
    (low, high)
}

fn beta(a: usize, b: usize) -> Beta {
    Beta::new(a as f64, b as f64).expect("both shapes are positive")
}

fn ascending(values: &[f64]) -> Vec<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted
}

fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let below = whole(place);
    let above = (below + 1).min(sorted.len() - 1);
    (place - below as f64).mul_add(sorted[above] - sorted[below], sorted[below])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_of_four_errors() {
        let figures = Figures::of(&[4.0, 1.0, 2.0, 3.0]).expect("four errors");
        assert!((figures.mean - 2.5).abs() < 1e-15);
        assert!((figures.rms - 7.5f64.sqrt()).abs() < 1e-15); // (1 + 4 + 9 + 16)/4
        assert!((figures.sd - (5.0f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!((figures.p95 - 3.85).abs() < 1e-12); // place 0.95·3 = 2.85
        assert!((figures.max - 4.0).abs() < 1e-15);
        assert!(Figures::of(&[]).is_none());
    }

    /// Groups of equal size have the spread of their means over the square root of their number; one value a group has
    /// the textbook's.
    #[test]
    fn values_of_one_group_count_together() {
        let values: Vec<f64> = (0..60).map(|place| f64::from(place * 37 % 19)).collect();
        let groups: Vec<i32> = (0..60).map(|place| place / 6).collect();
        let means: Vec<f64> = values.chunks(6).map(|own| own.iter().sum::<f64>() / 6.0).collect();
        for (groups, of) in [(groups, &means), ((0..60).collect(), &values)] {
            let (mean, se) = clustered_mean(&values, &groups).expect("groups");
            let figures = Figures::of(of).expect("values");
            assert!((mean - figures.mean).abs() < 1e-12);
            assert!((se - figures.sd / (of.len() as f64).sqrt()).abs() < 1e-12);
        }
        assert_eq!(clustered_mean(&values, &[1; 60]), None);
    }

    #[test]
    fn ranks_are_the_ones_of_the_method() {
        // The examples of method::grids: 59 for 95/95, 299 for 99/95; 95 of 96, 675 of 700; 99/95: 698 of 700.
        let p95 = Coverage { share: 0.95, confidence: 0.95 };
        let p99 = Coverage { share: 0.99, confidence: 0.95 };
        assert_eq!(bound_rank(58, p95), None);
        assert_eq!(bound_rank(59, p95), Some(59));
        assert_eq!(bound_rank(298, p99), None);
        assert_eq!(bound_rank(299, p99), Some(299));
        assert_eq!(bound_rank(96, p95), Some(95));
        assert_eq!(bound_rank(700, p95), Some(675));
        assert_eq!(bound_rank(700, p99), Some(698));
        assert!((least_count(p95) - 59.0).abs() < 1e-12);
    }

    const P95: Coverage = Coverage { share: 0.95, confidence: 0.95 };

    #[test]
    fn a_pose_counts_once_and_with_the_worst_of_its_visits() {
        let mut errors = PoseErrors::default();
        // 30 poses visited six times, 180 visits: n is still 30, and 59 are needed.
        for visit in 0..180 {
            errors.add(visit % 30, visit, 0, 0.001 * visit as f64);
        }
        assert_eq!(errors.counted().to_string(), "30 poses in 180 visits");
        assert_eq!(errors.bound(P95), None);
        // The last visits are the worst: 150 to 179 µm.
        assert!((errors.worst()[0] - 0.150).abs() < 1e-12 && errors.worst().len() == 30);
        // With 29 more poses of no error the bound is the largest of the 59, k = 59.
        (30..59).for_each(|pose| errors.add(pose, 150 + pose, 0, 0.0));
        let bound = errors.bound(P95).expect("59 poses");
        assert!((bound - 0.179).abs() < 1e-12, "{bound}");
    }

    #[test]
    fn several_samples_of_a_pose_make_no_more_poses() {
        let mut errors = PoseErrors::default();
        // Two visits of each of 60 poses, on 8 days each: day 7 of the second visit is the worst.
        for (pose, day) in (0..60).flat_map(|pose| (0..8).map(move |day| (pose, day))) {
            errors.add(pose, pose, day, 0.1);
            errors.add(pose, 60 + pose, day, 0.1 + 0.01 * day as f64);
        }
        assert_eq!(errors.counted(), Counted { poses: 60, visits: 120 });
        // k = 60 of 60 is the largest: 0.17 mm.
        assert!((errors.bound(P95).expect("60 poses") - 0.17).abs() < 1e-12);
    }

    #[test]
    fn a_share_s_lower_limit_is_the_closed_form_where_all_hold() {
        // All of n hold: the limit p solves p^n = 1 − γ. 59 of 59 at 95 %: 0.05^(1/59) = 0.950493.
        let found = share_at_least(59, 59, 0.95);
        assert!((found - 0.05f64.powf(1.0 / 59.0)).abs() < 1e-6, "{found}");
        assert!(share_at_least(0, 59, 0.95).abs() < 1e-15);
        // 95 of 100: 0.8977 (Clopper and Pearson's one-sided 95 % limit, from tables of the binomial distribution).
        let found = share_at_least(95, 100, 0.95);
        assert!((found - 0.8977).abs() < 5e-4, "{found}");
    }
}
