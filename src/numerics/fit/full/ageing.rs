//! Slow change of the joint curves over years: gears wear, bearings are run in, so that what an old session says counts less.
//!
//! The curve of each joint is that of the latest session. An older one has what changed since: a walk in time, of independent steps
//! that are longer the longer they lie behind,
//!
//! ```text
//! curve(age) = curve(0) + Σ_k share_k(age) w_k          w_k ~ N(0, a · years of the step k · profile)
//! ```
//!
//! with `share_k` rising from 0 to 1 over the step. Its variance grows with the years between, as that of a random walk does, and what
//! happened long ago needs no detail: the steps double. The size a is found by the likelihood like any other
//! ([`super::components`]), and a pool whose curves do not change drops the part by its evidence. Sessions of one month, and
//! sessions without a date, have no such columns.

/// Years of the latest step; sessions that lie closer together do not age.
const FIRST_YEARS: f64 = 0.1;
const MOST: usize = 8;
const DAYS_PER_YEAR: f64 = 365.25;

/// Age at which a step begins, years: the steps before it have doubled.
pub(super) fn begin_years(step: usize) -> f64 {
    let steps = i32::try_from(step).unwrap_or(i32::MAX);
    FIRST_YEARS * (2.0_f64.powi(steps) - 1.0)
}

/// Length of a step, years.
pub(super) fn years(step: usize) -> f64 {
    begin_years(step + 1) - begin_years(step)
}

/// The share of the change over a step that a session of this age came before.
pub(super) fn share(age_years: f64, step: usize) -> f64 {
    ((age_years - begin_years(step)) / years(step)).clamp(0.0, 1.0)
}

pub(super) fn steps(ages_years: &[f64]) -> usize {
    let oldest = ages_years.iter().copied().fold(0.0, f64::max);
    (0..MOST).take_while(|&step| share(oldest, step) > 0.0).count()
}

/// The age of sessions of these days (since 1970), years before the latest; empty where one has no date, or all lie within one step.
pub(super) fn ages_years(days: &[Option<f64>]) -> Vec<f64> {
    let Some(days) = days.iter().copied().collect::<Option<Vec<f64>>>() else { return Vec::new() };
    let latest = days.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let ages: Vec<f64> = days.iter().map(|day| (latest - day) / DAYS_PER_YEAR).collect();
    if ages.iter().any(|age| *age > FIRST_YEARS) { ages } else { Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_change_between_two_ages_has_the_variance_of_the_years_between() {
        // At the ends of steps the shares are whole, so variances are those of a random walk: the years themselves.
        for (age, wanted) in [(0.1, 0.1), (0.3, 0.3), (1.5, 1.5)] {
            let variance: f64 = (0..8).map(|step| share(age, step).powi(2) * years(step)).sum();
            assert!((variance - wanted).abs() < 1e-12, "{age}: {variance}");
        }
        assert!(share(0.0, 0).abs() < 1e-15);
        assert!((share(0.2, 1) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn three_years_have_five_steps_and_a_month_has_none() {
        assert_eq!(steps(&[0.0, 3.0]), 5);
        assert!(ages_years(&[Some(20_000.0), Some(20_030.0)]).is_empty());
        assert!(ages_years(&[Some(20_000.0), None, Some(21_000.0)]).is_empty());
        let ages = ages_years(&[Some(20_000.0), Some(20_730.5)]);
        assert!((ages[0] - 2.0).abs() < 1e-9 && ages[1].abs() < 1e-12, "{ages:?}");
    }
}
