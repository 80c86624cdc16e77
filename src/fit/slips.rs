//! Slips of instruments that read one length: a wire that slipped on its drum, a magnet that was put back elsewhere, a bar whose reading
//! was reset. From one station on, all readings are off by one number.
//!
//! Inputs: the observations of all sessions. Output: each slip with its station, size and standard deviation ([`Slip`]). Steps:
//! 1. geometry, frames, anchors and planes are fitted with Cauchy's loss to the readings without the slips found so far;
//! 2. what this leaves of the readings as they were read is a series for each instrument and session, in order of stations. Residuals
//!    beyond four robust standard deviations from the median of their neighbours are brought to there, so that wrong numbers are no steps;
//! 3. a step at each station is tested beside a parabola over the session: an arm and an instrument that get warm drift, and drift is no
//!    slip. The test is Student's t of the step's size. Residuals that are alike from station to station make it less significant, by
//!    their correlation;
//! 4. the most significant step is a slip where a sound instrument has one as significant in one session of a hundred; both sides of it
//!    are searched again;
//! 5. everything again without them, until no station and no size changes.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, StudentsT};

use super::observation::Observation;
use super::wrong_lengths::{left_mm, shrunk};
use super::{FitSettings, Freedom, Loss, Measured, SourceId, identify};
use crate::figures::{expanded, median};
use crate::join::clock::SIGMA_PER_MAD;
use crate::kinematics::Arm;

/// Chance of a slip that is named though there is none, in a session and instrument.
const CHANCE: f64 = 0.01;
/// Readings on each side of a slip at least: fewer are wrong numbers.
const LEAST: usize = 8;
/// Residuals further from their neighbours than so many robust standard deviations count as so many.
const FARTHEST: f64 = 4.0;
/// Neighbours on each side.
const BESIDE: usize = 3;
/// Columns of a parabola.
const TREND: usize = 3;
/// Rounds at most.
const ROUNDS: usize = 8;
/// Sizes that change by less than this share of their standard deviation have converged.
const CONVERGED: f64 = 0.05;
/// Residuals below this are rounding, mm.
const LEAST_MM: f64 = 1e-6;

/// A slip of an instrument in a session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slip {
    /// The session, from 0.
    pub session: usize,
    /// The instrument.
    pub source: SourceId,
    /// The last station before it at which the instrument was read.
    pub after: usize,
    /// The first station behind it at which the instrument was read.
    pub before: usize,
    /// Readings behind it minus readings before it, mm.
    pub by_mm: f64,
    /// Standard deviation of that, mm.
    pub sd_mm: f64,
}

impl Slip {
    /// What was found, as text; `instrument` is its name.
    pub fn words(&self, instrument: &str) -> String {
        format!(
            "{instrument} slipped between stations {} and {}: its readings from there on are off by {:+.3} ± {:.3} mm",
            self.after,
            self.before,
            self.by_mm,
            expanded(self.sd_mm)
        )
    }
}

/// One reading of an instrument.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Left {
    station: usize,
    /// Measured minus predicted, mm.
    mm: f64,
}

/// A step in a series.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    /// Place of the first reading behind it.
    at: usize,
    by_mm: f64,
    sd_mm: f64,
}

/// An instrument in a session.
type Own = (usize, SourceId);

/// The slips of all instruments of one length, in order of sessions, instruments and stations; none are found where geometry cannot be
/// fitted.
pub fn check(
    arm: &Arm,
    observations: &[Observation],
    sessions: usize,
    settings: &FitSettings,
) -> Vec<Slip> {
    let robust = FitSettings { loss: Loss::Cauchy { tuning: 2.0 }, ..settings.clone() };
    let mut slips: Vec<Slip> = Vec::new();
    for _ in 0..ROUNDS {
        let without = without(observations, &slips);
        let fitted = identify(arm, &without, sessions, Freedom::Geometry, &robust);
        let Ok(fitted) = fitted else { break };
        let mut series: BTreeMap<Own, Vec<Left>> = BTreeMap::new();
        for own in observations {
            if let Some(mm) = left_mm(own, &fitted) {
                let station = own.station;
                let all = series.entry((own.session, own.source)).or_default();
                all.push(Left { station, mm });
            }
        }
        let found = series.into_iter().flat_map(|(own, mut left)| {
            left.sort_by_key(|own| own.station);
            let share = shrunk(&fitted, own.1);
            share.map_or_else(Vec::new, |share| of_one(own, &left, share))
        });
        let found: Vec<Slip> = found.collect();
        let is_done = have_converged(&found, &slips);
        slips = found;
        if is_done {
            break;
        }
    }
    slips
}

/// The observations without slips: each reading less the slips before it.
fn without(observations: &[Observation], slips: &[Slip]) -> Vec<Observation> {
    let mut all = observations.to_vec();
    for own in &mut all {
        let is_before = |slip: &&Slip| {
            (slip.session, slip.source) == (own.session, own.source) && slip.before <= own.station
        };
        let by_mm: f64 = slips.iter().filter(is_before).map(|slip| slip.by_mm).sum();
        if let Measured::Distance(length) | Measured::Height(length) = &mut own.measured {
            length.mm -= by_mm;
        }
    }
    all
}

/// Whether slips are where they were, with the sizes that they had.
fn have_converged(found: &[Slip], before: &[Slip]) -> bool {
    let is_same = |(a, b): (&Slip, &Slip)| {
        (a.session, a.source, a.before) == (b.session, b.source, b.before)
            && (a.by_mm - b.by_mm).abs() <= CONVERGED * a.sd_mm
    };
    found.len() == before.len() && found.iter().zip(before).all(is_same)
}

/// The slips of one instrument in one session; `share` is the root of the share of its rows that the fit did not take.
fn of_one((session, source): Own, left: &[Left], share: f64) -> Vec<Slip> {
    let steps = steps(left, share);
    let slips = steps.iter().map(|step| Slip {
        session,
        source,
        after: left[step.at - 1].station,
        before: left[step.at].station,
        by_mm: step.by_mm,
        sd_mm: step.sd_mm,
    });
    slips.collect()
}

/// The steps of a series, in order: the most significant one, and those on either side of it.
fn steps(left: &[Left], share: f64) -> Vec<Step> {
    let mut ends = vec![0, left.len()];
    let mut at = 1;
    while at < ends.len() {
        match most_significant(&left[ends[at - 1]..ends[at]], share) {
            Some(step) => ends.insert(at, ends[at - 1] + step),
            None => at += 1,
        }
    }
    let parts = ends.windows(3);
    let sized = parts.map(|ends| {
        let (by_mm, sd_mm) = size(&left[ends[0]..ends[1]], &left[ends[1]..ends[2]], share);
        Step { at: ends[1], by_mm, sd_mm }
    });
    sized.collect()
}

/// Place of the first reading behind the most significant step; `None` where none is significant.
fn most_significant(left: &[Left], share: f64) -> Option<usize> {
    if left.len() < 2 * LEAST {
        return None;
    }
    let values = brought_in(left);
    let trend = trend(left.len());
    let rest = &values - &trend * (trend.transpose() * &values);
    let whole = rest.norm_squared();
    let freedom = left.len() as f64 * share * share - (TREND + 1) as f64;
    if freedom < 1.0 || whole <= LEAST_MM * LEAST_MM {
        return None;
    }
    let (mut best, mut tried) = (None, 0_usize);
    // Sums over all readings from a place on.
    let (mut sum, mut of_trend) = (0.0, DVector::zeros(TREND));
    for at in (1..left.len()).rev() {
        sum += rest[at];
        of_trend += trend.row(at).transpose();
        let (before, behind) = (at, left.len() - at);
        let is_one_station = left[at - 1].station == left[at].station;
        if before.min(behind) < LEAST || is_one_station {
            continue;
        }
        tried += 1;
        let spread = behind as f64 - of_trend.norm_squared();
        let explained = sum * sum / spread.max(f64::MIN_POSITIVE);
        if best.is_none_or(|(_, most)| explained > most) {
            best = Some((at, explained));
        }
    }
    let (at, explained) = best?;
    let t = (explained * freedom / (whole - explained).max(f64::MIN_POSITIVE)).sqrt();
    let t = t / alike(&stepped(&values, &trend, at));
    (chance(t, freedom) * (tried as f64) < CHANCE).then_some(at)
}

/// The residuals, mm, those far from the median of their neighbours brought to [`FARTHEST`] robust standard deviations from it: a step
/// stays as it is, and a wrong number becomes a small one.
fn brought_in(left: &[Left]) -> DVector<f64> {
    let around = |place: usize| {
        let near = place.saturating_sub(BESIDE)..(place + BESIDE + 1).min(left.len());
        let near: Vec<f64> = left[near].iter().map(|own| own.mm).collect();
        median(&near).unwrap_or(0.0)
    };
    let middles: Vec<f64> = (0..left.len()).map(around).collect();
    let pairs = || left.iter().zip(&middles);
    let away: Vec<f64> = pairs().map(|(own, middle)| (own.mm - middle).abs()).collect();
    let reach = FARTHEST * SIGMA_PER_MAD * median(&away).unwrap_or(0.0);
    let near = pairs().map(|(own, middle)| own.mm.clamp(middle - reach, middle + reach));
    DVector::from_vec(near.collect())
}

/// Orthonormal columns of a parabola over so many readings.
fn trend(count: usize) -> DMatrix<f64> {
    let at = |row: usize| 2.0 * row as f64 / (count - 1) as f64 - 1.0;
    let columns =
        DMatrix::from_fn(count, TREND, |row, power| std::iter::repeat_n(at(row), power).product());
    columns.qr().q()
}

/// What the parabola and a step leave.
fn stepped(values: &DVector<f64>, trend: &DMatrix<f64>, at: usize) -> DVector<f64> {
    let step = DVector::from_fn(values.len(), |row, _| f64::from(u8::from(row >= at)));
    let beside = &step - trend * (trend.transpose() * &step);
    let rest = values - trend * (trend.transpose() * values);
    let by = beside.dot(&rest) / beside.norm_squared().max(f64::MIN_POSITIVE);
    rest - beside * by
}

/// Factor by which a step's standard deviation is larger because neighbours are alike: `√((1 + ρ)/(1 − ρ))` with their correlation ρ, 1
/// where they are not.
fn alike(rest: &DVector<f64>) -> f64 {
    const MOST: f64 = 0.95;
    let count = rest.len();
    let pairs = rest.rows(0, count - 1).dot(&rest.rows(1, count - 1));
    let correlation = (pairs / rest.norm_squared().max(f64::MIN_POSITIVE)).clamp(0.0, MOST);
    ((1.0 + correlation) / (1.0 - correlation)).sqrt()
}

/// The size of a step between two parts and its standard deviation, mm: by the means of what is not far from each part's median.
fn size(before: &[Left], behind: &[Left], share: f64) -> (f64, f64) {
    let [(level, rest), (other, more)] = [before, behind].map(level);
    let all: Vec<f64> = rest.into_iter().chain(more).collect();
    let sizes: Vec<f64> = all.iter().map(|own| own.abs()).collect();
    let sd_mm = (SIGMA_PER_MAD * median(&sizes).unwrap_or(0.0)).max(LEAST_MM);
    let counts = [before.len(), behind.len()].map(|count| (count.max(1) as f64).recip());
    // Once for the residuals, which are smaller than the noise, and once for what the other unknowns take of a step.
    let grown = alike(&DVector::from_vec(all)) / (share * share);
    (other - level, sd_mm * (counts[0] + counts[1]).sqrt() * grown)
}

/// The level of a part, mm, and its residuals.
fn level(part: &[Left]) -> (f64, Vec<f64>) {
    let level = brought_in(part).mean();
    (level, part.iter().map(|own| own.mm - level).collect())
}

/// Chance that Student's t is as far from zero on either side.
fn chance(t: f64, freedom: f64) -> f64 {
    StudentsT::new(0.0, 1.0, freedom).map_or(1.0, |student| 2.0 * student.sf(t))
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// A series of residuals of 0.05 mm beside `level`.
    fn series(count: usize, seed: u64, level: impl Fn(usize) -> f64) -> Vec<Left> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| rng.random_range(0.0..1.0)).sum::<f64>() - 6.0;
        let left = |station: usize| Left { station, mm: level(station) + 0.05 * normal() };
        (0..count).map(left).collect()
    }

    #[test]
    fn the_test_of_a_step_is_that_of_least_squares() {
        // Student's t of the step's size by the normal equations of parabola and step at once.
        let left = series(40, 3, |station| if station >= 25 { 0.1 } else { 0.0 });
        let (values, trend) = (brought_in(&left), trend(40));
        let step = DVector::from_fn(40, |row, _| f64::from(u8::from(row >= 25)));
        let mut columns = trend.clone().insert_column(TREND, 0.0);
        columns.set_column(TREND, &step);
        let inverse = (columns.transpose() * &columns).try_inverse().expect("independent");
        let found = &inverse * (columns.transpose() * &values);
        let rest = &values - &columns * &found;
        let expected = found[TREND] / (inverse[(TREND, TREND)] * rest.norm_squared() / 36.0).sqrt();
        let of_step = stepped(&values, &trend, 25);
        assert!((of_step - &rest).amax() < 1e-12);
        let whole = (&values - &trend * (trend.transpose() * &values)).norm_squared();
        let t = ((whole - rest.norm_squared()) * 36.0 / rest.norm_squared()).sqrt();
        assert!((t - expected.abs()).abs() < 1e-9, "{t} {expected}");
    }

    #[test]
    fn a_step_is_found_at_its_station_beside_drift_and_wrong_numbers() {
        for at in [8, 20, 45, 70, 80] {
            let mut left = series(90, at as u64, |station| {
                let drift = 2e-3 * station as f64;
                drift + if station >= at { 6.0 } else { 0.0 }
            });
            left[at / 2].mm += 2000.0;
            left[85].mm -= 900.0;
            let found = steps(&left, 0.9);
            let [step] = &found[..] else {
                panic!("{at}: {found:?}");
            };
            assert_eq!(step.at, at);
            // The drift between the middles of both sides, 0.09 mm, is in the size.
            assert!((step.by_mm - 6.0).abs() < 0.15, "{step:?}");
        }
    }

    #[test]
    fn two_steps_are_both_found() {
        let left = series(120, 5, |station| match station {
            0..30 => 0.0,
            30..80 => 3.0,
            _ => -2.0,
        });
        let found: Vec<usize> = steps(&left, 0.9).iter().map(|own| own.at).collect();
        assert_eq!(found, [30, 80]);
    }

    #[test]
    fn drift_is_no_slip() {
        // Warming up by a tenth of a millimetre, to one side and back.
        let warm = |station: usize| 0.1 * (1.0 - (-(station as f64) / 30.0).exp());
        let there_and_back = |station: usize| 0.1 * (station as f64 / 30.0).sin();
        let found = (0..200).filter(|&seed| {
            !steps(&series(90, seed, warm), 0.9).is_empty()
                || !steps(&series(90, 1000 + seed, there_and_back), 0.9).is_empty()
        });
        assert!(found.count() <= 8);
    }

    #[test]
    fn a_sound_series_has_a_step_in_one_of_a_hundred() {
        let found = (0..4000).filter(|seed| !steps(&series(90, *seed, |_| 0.0), 1.0).is_empty());
        let found = found.count();
        // Bonferroni's bound over neighbouring stations is an upper one.
        assert!(found <= 40, "{found} of 4000");
    }

    #[test]
    fn the_size_of_a_step_is_known_as_well_as_it_says() {
        // One series of a hundred has a false step beside it, and is left out.
        let off = (0..300).filter_map(|seed| {
            let level = |station| if station >= 40 { 0.5 } else { 0.0 };
            let found = steps(&series(90, 9000 + seed, level), 1.0);
            let [step] = &found[..] else { return None };
            Some(((step.by_mm - 0.5) / step.sd_mm).powi(2))
        });
        let off: Vec<f64> = off.collect();
        assert!(off.len() > 285, "{}", off.len());
        let off = (off.iter().sum::<f64>() / off.len() as f64).sqrt();
        assert!((0.85..1.15).contains(&off), "{off}");
    }
}
