//! Reported joints that are rounded: whole numbers of one coarse step, which move the target by a large part of what the models of
//! reported angles leave.
//!
//! Inputs: the joints of a session's stations, and the residuals of its models. Output: [`Rounded`], or nothing.
//!
//! 1. The step of a joint is the usual one of which most of its values are whole numbers, of several the largest: decimals of a degree,
//!    radian, gon or minute, a turn halved many times, of joints that slide decimals of a mm. A few samples on another step put the mean
//!    of a dwell beside it; means of many lie anywhere, and have lost nothing.
//! 2. A step s is an error of s/√12; through the arm's levers it is one of the target.
//! 3. It counts where it is half or more of the rms that the best model of reported angles leaves. A model that leaves less than it
//!    shows that the angles are exact: commands in whole degrees are.

use std::f64::consts::{PI, TAU};

use nalgebra::Point3;

use super::{JoinedSession, Outcome};
use crate::figures::Figures;
use crate::join::{Pairing, Station};
use crate::report::{Angles, ResidualSet, Split};

/// Fewest stations, and fewest different values of a joint, that show a step.
const STATIONS: usize = 20;
const VALUES: usize = 10;
/// Least share of the stations whose values are whole steps, within this many, and how sure it is that they are not so by chance.
const WHOLE: f64 = 0.6;
const NEAR: f64 = 0.1;
const SURE: f64 = 6.0;
/// The largest step has this share of the whole values of any.
const AS_MANY: f64 = 0.85;
/// The smallest step that is looked for, rad or mm.
const LEAST_STEP: f64 = 1e-5;
/// The rounding counts between these shares of the rms that is left.
const LEAST_SHARE: f64 = 0.5;
const MOST_SHARE: f64 = 1.3;

/// Joints that are rounded, and what it costs.
#[derive(Debug, Clone, PartialEq)]
pub struct Rounded {
    /// Step of each joint, rad, of one that slides mm; `None` of a joint that is not rounded.
    pub steps: Vec<Option<f64>>,
    /// Root mean square of the target's error by the rounding, mm.
    pub target_mm: f64,
    /// What the best model of reported angles leaves, as root mean square, mm.
    pub left_mm: f64,
}

impl Rounded {
    /// `None` where the session's joints are not rounded, or where it does not count.
    pub fn of(outcome: &Outcome<'_>, session: &JoinedSession) -> Option<Self> {
        let measured = |station: &&Station| station.pairing == Pairing::Paired;
        let stations = session.joined.stations.iter().filter(measured);
        let joints: Vec<&[f64]> = stations.map(|station| &station.joints[..]).collect();
        let steps = steps(&joints, &outcome.error_frame.arm.chain().slides());
        let target_mm = effect(&joints, &steps, |q| outcome.error_frame.nominal_target(q))?;
        let left_mm = left(&outcome.residuals, &session.name)?;
        let counts = (LEAST_SHARE * left_mm..=MOST_SHARE * left_mm).contains(&target_mm);
        counts.then_some(Self { steps, target_mm, left_mm })
    }
}

/// The least root mean square of held-out residuals of a model of reported angles, mm; `None` without any.
fn left(sets: &[ResidualSet], session: &str) -> Option<f64> {
    let own = sets.iter().filter(|set| {
        let subject = &set.subject;
        let is_held_out = subject.split != Split::None;
        subject.of_session == session && subject.angles == Angles::Reported && is_held_out
    });
    let rms = own.filter_map(|set| {
        let norms: Vec<f64> = set.judged().map(|own| own.residual.norm()).collect();
        Some(Figures::of(&norms)?.rms)
    });
    rms.min_by(f64::total_cmp)
}

/// Root mean square of the displacement of `place` by the rounding of each joint, mm; `None` where none is rounded.
fn effect(
    joints: &[&[f64]],
    steps: &[Option<f64>],
    place: impl Fn(&[f64]) -> Point3<f64>,
) -> Option<f64> {
    let rounded: Vec<(usize, f64)> =
        steps.iter().enumerate().filter_map(|(joint, step)| Some((joint, (*step)?))).collect();
    rounded.first()?;
    let norm = |own: &&[f64]| {
        let at = place(own);
        let by = |&(joint, step): &(usize, f64)| {
            let mut off = own.to_vec();
            // A uniform error between ± step/2 has a third of the square of its end.
            off[joint] += step / 2.0;
            (place(&off) - at).norm_squared() / 3.0
        };
        rounded.iter().map(by).sum::<f64>().sqrt()
    };
    Some(Figures::of(&joints.iter().map(norm).collect::<Vec<f64>>())?.rms)
}

fn steps(joints: &[&[f64]], slides: &[bool]) -> Vec<Option<f64>> {
    let turns = usual(&[PI / 180.0, 1.0, PI / 200.0, PI / 180.0 / 60.0]);
    let halved = (6..=20).map(|times| TAU / f64::from(1 << times));
    let turns: Vec<f64> = turns.into_iter().chain(halved).collect();
    let lengths = usual(&[1.0, 25.4]);
    let step = |(joint, slides): (usize, &bool)| {
        let values: Vec<f64> = joints.iter().filter_map(|own| own.get(joint).copied()).collect();
        let usual = if *slides { &lengths } else { &turns };
        let whole = usual.iter().filter_map(|step| Some((whole_share(&values, *step)?, *step)));
        let whole: Vec<(f64, f64)> = whole.collect();
        let most = whole.iter().fold(0.0, |most: f64, (share, _)| most.max(*share));
        let as_many = whole.iter().filter(|(share, _)| *share >= AS_MANY * most);
        as_many.map(|(_, step)| *step).max_by(f64::total_cmp)
    };
    slides.iter().enumerate().map(step).collect()
}

/// One, two and five times the decimals of each unit, from five units downwards.
fn usual(units: &[f64]) -> Vec<f64> {
    let decimals = |unit: &f64| {
        let unit = *unit;
        (0..=5).flat_map(move |places| [5.0, 2.0, 1.0].map(|n| n * unit * 0.1_f64.powi(places)))
    };
    units.iter().flat_map(decimals).filter(|step| *step >= LEAST_STEP).collect()
}

/// The share of values that are whole steps; `None` where it is small, or may be so by chance.
fn whole_share(values: &[f64], step: f64) -> Option<f64> {
    let counts = values.iter().map(|value| value / step);
    let whole = counts.filter(|count| (count - count.round()).abs() <= NEAR);
    let mut whole: Vec<f64> = whole.map(f64::round).collect();
    let (found, all, by_chance) = (whole.len() as f64, values.len() as f64, 2.0 * NEAR);
    let sure = by_chance * all + SURE * (by_chance * (1.0 - by_chance) * all).sqrt();
    whole.sort_by(f64::total_cmp);
    whole.dedup();
    let are_many = values.len() >= STATIONS && whole.len() >= VALUES;
    (are_many && found >= sure.max(WHOLE * all)).then(|| found / all)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Angles that do not repeat, rad.
    fn angles(count: u32) -> Vec<f64> {
        (0..count).map(|k| 1.5 * (1.7 * f64::from(k)).sin()).collect()
    }

    fn step(values: &[f64]) -> Option<f64> {
        let rows: Vec<[f64; 1]> = values.iter().map(|value| [*value]).collect();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        steps(&rows, &[false])[0]
    }

    fn rounded(to: f64) -> Vec<f64> {
        angles(40).iter().map(|angle| (angle / to).round() * to).collect()
    }

    #[test]
    fn the_step_of_rounded_angles_is_found_in_any_unit() {
        for expected in [PI / 1800.0, PI / 180.0, 0.001, PI / 2000.0, TAU / 4096.0] {
            let found = step(&rounded(expected)).expect("rounded");
            assert!((found / expected - 1.0).abs() < 1e-9, "{expected}: {found}");
        }
        // Printed in rad to six decimals.
        let printed: Vec<f64> = rounded(PI / 1800.0);
        let printed: Vec<f64> = printed.iter().map(|angle| (angle * 1e6).round() / 1e6).collect();
        assert!(step(&printed).is_some_and(|found| (found - PI / 1800.0).abs() < 1e-9));
    }

    #[test]
    fn angles_with_their_digits_and_few_values_are_not_rounded() {
        assert_eq!(step(&angles(40)), None);
        // Four decimals of a degree: 1.7 µrad.
        assert_eq!(step(&rounded(PI / 180.0 * 1e-4)), None);
        assert_eq!(step(&rounded(PI / 1800.0)[..STATIONS - 1]), None);
        let three: Vec<f64> = (0..40).map(|k| f64::from(k % 3) * 0.5).collect();
        assert_eq!(step(&three), None);
        // A quarter of them are means of samples on both sides, then all.
        let averaged = |every: usize| {
            let mut averaged = rounded(PI / 1800.0);
            for (place, angle) in averaged.iter_mut().enumerate().step_by(every) {
                *angle += 8.7e-4 * (0.37 * place as f64).sin();
            }
            step(&averaged)
        };
        assert!(averaged(4).is_some_and(|found| (found - PI / 1800.0).abs() < 1e-9));
        assert_eq!(averaged(1), None);
    }

    #[test]
    fn the_error_of_a_lever_is_its_length_times_the_steps_standard_deviation() {
        let values = rounded(0.001);
        let rows: Vec<[f64; 2]> = values.iter().map(|value| [*value, 0.3]).collect();
        let rows: Vec<&[f64]> = rows.iter().map(|row| &row[..]).collect();
        let place = |q: &[f64]| Point3::new(1000.0 * q[0].cos(), 1000.0 * q[0].sin(), q[1]);
        let mm = effect(&rows, &[Some(0.001), None], place).expect("one is rounded");
        assert!((mm - 1.0 / 12.0_f64.sqrt()).abs() < 1e-3, "{mm}");
        assert_eq!(effect(&rows, &[None, None], place), None);
    }
}
