//! Base and target of a known arm from few stations of the real recordings: what remains at the others, and how often it is inside its
//! ellipsoids.

mod common;

use nalgebra::Vector3;
use posegrid::fit::full::FullSettings;
use posegrid::fit::{
    self, FitSettings, KnownTarget, Models, Noise, Observation, Purpose, Source,
    TrackerUncertainty, TrainingSettings,
};
use posegrid::grid::Tolerance;
use posegrid::join::ReadingKind;
use posegrid::kinematics::Arm;
use posegrid::report::accuracy::accuracy;
use posegrid::report::evaluate::Stations;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget, Locator};
use posegrid::report::unseen::unseen_session;
use posegrid::report::{BaseRefit, Model, ResidualSet};

const TOLERANCE: Tolerance = Tolerance {
    mm: 0.5,
    share: 0.95,
    confidence: 0.95,
};

/// The instrument of the recordings, with its orientations.
fn noise() -> Noise {
    let uncertainty = TrackerUncertainty {
        range_um: 10.0,
        range_um_per_m: 0.3,
        transverse_um: 15.0,
        transverse_um_per_m: 6.0,
        divisor: 2.0,
        orientation_rad: Some(130e-6),
    };
    let reads = ReadingKind::Pose;
    Noise::of_one(
        Source {
            reads,
            uncertainty: uncertainty.into(),
        },
        0.03,
    )
}

fn fit() -> FitSettings {
    FitSettings {
        orientations: true,
        target: Some(KnownTarget {
            xyz_mm: [-0.2, 0.2, 92.8],
            sd_mm: 1.0,
        }),
        ..FitSettings::default()
    }
}

/// Calls `of` with the settings of all trainings here.
fn with_settings<T>(of: impl Fn(&TrainingSettings<'_>) -> T) -> T {
    let (fit, full) = (fit(), FullSettings::default());
    of(&TrainingSettings {
        fit: &fit,
        full: &full,
        up: Some(Vector3::z_axis()),
        carrying: None,
        purpose: Purpose::Published,
        rivals: false,
    })
}

/// The models of an arm learned from these sessions together.
fn learned(arm: &Arm, sessions: &[&[Observation]]) -> Models {
    let own = |(session, own): (usize, &&[Observation])| {
        let own = own.iter().map(move |o| Observation {
            session,
            ..o.clone()
        });
        own.collect::<Vec<_>>()
    };
    let all: Vec<Observation> = sessions.iter().enumerate().flat_map(own).collect();
    with_settings(|settings| fit::models::train(arm, &all, sessions.len(), settings))
        .expect("enough stations")
}

/// Residuals of the full error model on a session that it never saw, at each kind of angles and by each base.
fn judged(arm: &Arm, models: &Models, test: &[Observation], locate: Locate) -> Vec<ResidualSet> {
    let locator = with_settings(|settings| Locator::new(models, arm, locate, settings));
    let finders = locator.finders(models, test);
    let stations = Stations {
        session: "test",
        observations: test,
    };
    let mut sets = unseen_session(models, stations, &locator, &finders).expect("one of each");
    sets.retain(|set| set.subject.model == Model::Full);
    sets
}

/// Mean (mm) and share in the ellipsoids.
fn figures(set: &ResidualSet) -> (f64, f64) {
    let of = accuracy(set, &TOLERANCE, 0.0);
    let mean = of.figures.expect("stations judge").mean;
    (
        mean,
        of.coverage.map_or(f64::NAN, |coverage| coverage.inside),
    )
}

/// Prints the figures of each way to find base and target; those by twelve chosen stations, for all kinds of angles.
fn told(
    arm: &Arm,
    name: &str,
    training: &[&[Observation]],
    test: &[Observation],
    target: LocateTarget,
) -> Vec<(f64, f64)> {
    let models = learned(arm, training);
    let mut chosen = Vec::new();
    for (by, stations) in [(LocateBy::First, 50), (LocateBy::Chosen, 12)] {
        let locate = Locate {
            by,
            stations,
            target,
        };
        for set in judged(arm, &models, test, locate) {
            let (subject, (mean, inside)) = (&set.subject, figures(&set));
            let is_new = subject.base_refit.judges() || by == LocateBy::First;
            if is_new && subject.base_refit != BaseRefit::None {
                println!(
                    "{name}, {:?}, base from {:?}: mean {mean:.4} mm, {:.1} % inside ({} stations)",
                    subject.angles,
                    subject.base_refit,
                    100.0 * inside,
                    set.judged().count()
                );
            }
            if subject.base_refit == BaseRefit::Chosen {
                chosen.push((mean, inside));
            }
        }
    }
    chosen
}

/// All recordings, in the order grid, joint, a, b.
fn recordings(arm: &Arm) -> Option<[Vec<Observation>; 4]> {
    let noise = noise();
    let of = |name: &str| common::trained::observed(name, arm, &noise);
    Some([
        of("ur10-grid")?,
        of("ur10-joint")?,
        of("ur10-random-a")?,
        of("ur10-random-b")?,
    ])
}

/// The session after, the target in its place.
#[test]
fn twelve_chosen_stations_of_random_b_are_as_good_as_fifty() {
    let arm = common::arm("ur10");
    let Some([_, _, a, b]) = recordings(&arm) else {
        return;
    };
    let known = LocateTarget::Known;
    let chosen = told(&arm, "random-a → random-b", &[&a], &b, known);
    let (mean, inside) = chosen[0];
    assert!(mean <= 0.052 && inside >= 0.9, "{mean} {inside}");
}

/// A remount 2 m away, months later; and each session by the others.
#[test]
#[ignore = "trains on thousands of stations, minutes: cargo test --release --test locate -- --ignored --nocapture"]
fn twelve_chosen_stations_of_every_session() {
    let arm = common::arm("ur10");
    let Some([grid, joint, a, b]) = recordings(&arm) else {
        return;
    };
    let own = LocateTarget::Own;
    let remounted = told(&arm, "joint, random-a → grid", &[&joint, &a], &grid, own);
    assert!(remounted[0].0 <= 0.15, "{remounted:?}");
    let sessions: [&[Observation]; 4] = [&grid, &joint, &a, &b];
    for (left_out, name) in ["grid", "joint", "random-a", "random-b"].iter().enumerate() {
        let others = sessions.iter().enumerate();
        let others = others.filter(|(place, _)| *place != left_out);
        let others: Vec<&[Observation]> = others.map(|(_, own)| *own).collect();
        let name = format!("all others → {name}");
        for (_, inside) in told(&arm, &name, &others, sessions[left_out], own) {
            assert!(inside >= 0.9, "{name}: {inside}");
        }
    }
}
