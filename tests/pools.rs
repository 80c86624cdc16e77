//! Pools of many sessions: old sessions count less where the arm changes, and a pool is the same whatever the number of threads.

mod common;

use common::pool::{MeasuredArm, Truth, frames, grown, of_session, pooled, trained};
use posegrid::fit::Observation;
use posegrid::fit::full::{FullModel, FullSettings, Query};

/// Coarse curves, as those of the simulated arm are: training takes a second.
fn settings() -> FullSettings {
    FullSettings {
        harmonics: 6,
        gear_lines: false,
        drift: false,
        session_scale_ppm: 0.0,
        ..FullSettings::default()
    }
}

/// Three sessions a month that wander a tenth of their curves away in a year.
const SLOW: Truth = Truth {
    curve_rad: 2e-4,
    walk_rad: 1e-5,
    own_rad: 4e-6,
    days: 11.0,
};

/// The mean error in the next session, mm: by a model of all sessions with their dates, of the last ten alone, of all without dates.
fn next_by(sessions: usize, stations: usize, seed: u64) -> [f64; 3] {
    let mut measured = MeasuredArm::new(SLOW, seed);
    let all: Vec<Observation> = (0..sessions)
        .flat_map(|_| measured.session(stations))
        .collect();
    let start = frames(&measured.arm, &all[..stations]);
    let last = sessions - 10;
    let undated = |own: &Observation| Observation {
        day: None,
        ..own.clone()
    };
    let latest: Vec<Observation> = all[last * stations..]
        .iter()
        .map(|own| undated(&of_session(own, own.session - last)))
        .collect();
    let even: Vec<Observation> = all.iter().map(undated).collect();
    let arm = measured.arm.clone();
    let poses = measured.poses(300);
    let by = [(&all, sessions - 1), (&latest, 9), (&even, sessions - 1)];
    by.map(|(seen, session)| {
        let model = trained(&arm, seen, &start, &settings());
        measured.error_mm(&model, session, &poses)
    })
}

/// A pool that does not wander.
const STEADY: Truth = Truth {
    curve_rad: 2e-4,
    walk_rad: 0.0,
    own_rad: 1e-5,
    days: 1.0,
};

#[test]
fn a_further_session_enters_by_its_own_sums_as_if_all_were_trained_together() {
    const STATIONS: usize = 80;
    let mut measured = MeasuredArm::new(STEADY, 5);
    let seen: Vec<Observation> = (0..8).flat_map(|_| measured.session(STATIONS)).collect();
    let (before, last) = seen.split_at(7 * STATIONS);
    let start = frames(&measured.arm, &seen[..STATIONS]);
    let arm = measured.arm.clone();
    let pool = pooled(&arm, before, &start, &settings()).1.expect("a pool");
    let by_sums = grown(&arm, &pool, last, &start, &settings());
    let together = trained(&arm, &seen, &start, &settings());
    let poses = measured.poses(300);
    let errors = [&by_sums, &together].map(|model| measured.error_mm(model, 7, &poses));
    assert!((errors[0] - errors[1]).abs() < 1e-3, "{errors:?}");
    // Noise and weights of the sessions before are those of their own training: points differ by a share of what either leaves.
    let predicted = |model: &FullModel, own: &Observation| {
        model.position(&Query {
            session: 7,
            own: false,
            ..Query::of(own)
        })
    };
    let away = last.iter();
    let away = away.map(|own| (predicted(&by_sums, own) - predicted(&together, own)).norm());
    let apart = away.sum::<f64>() / last.len() as f64;
    assert!(apart < 0.2 * errors[1], "{apart} {errors:?}");
    assert_eq!(by_sums.weights.len(), seen.len());
}

#[test]
fn old_sessions_count_less_where_the_arm_changes() {
    let [dated, latest, even] = next_by(40, 40, 3);
    assert!(dated < latest && dated < even, "{dated} {latest} {even}");
}

/// The measurement that the chapter on the error model states; minutes.
#[test]
#[ignore = "takes minutes: the figures of the chapter on the error model"]
fn a_hundred_sessions_predict_the_next_better_than_the_last_ten_and_than_all_alike() {
    let (mut better, mut sums) = (0, [0.0; 3]);
    for seed in 1..=20 {
        let errors = next_by(100, 60, seed);
        let [dated, latest, even] = errors;
        println!("{seed:>4} {dated:.4} {latest:.4} {even:.4}");
        better += usize::from(dated < latest && dated < even);
        (0..3).for_each(|k| sums[k] += errors[k] / 20.0);
    }
    println!("mean {sums:.4?}, better on {better} of 20");
    assert!(better >= 16, "{better} of 20");
}
