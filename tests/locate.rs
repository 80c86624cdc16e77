//! Base and target of a known arm from few stations: on the real recordings, and on a simulated remount.

mod common;

use std::fmt::Write as _;

use nalgebra::Vector3;
use posegrid::fit::full::{FullModel, FullSettings};
use posegrid::fit::{
    FitSettings, KnownTarget, Models, Noise, Observation, Source, TrackerUncertainty,
    TrainingSettings,
};
use posegrid::join::ReadingKind;
use posegrid::kinematics::Arm;
use posegrid::report::evaluate::Stations;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget, Locator};
use posegrid::report::unseen::unseen_session;
use posegrid::report::{Angles, BaseRefit, Model, ResidualSet};

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
    Noise::of_one(Source { reads, uncertainty }, 0.03)
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

/// The models of an arm learned from these sessions together.
fn learned(arm: &Arm, sessions: &[&[Observation]], name: &str) -> Models {
    let (fit, full) = (fit(), FullSettings::default());
    let own = |(session, own): (usize, &&[Observation])| {
        let own = own.iter().map(move |o| Observation {
            session,
            ..o.clone()
        });
        own.collect::<Vec<_>>()
    };
    let all: Vec<Observation> = sessions.iter().enumerate().flat_map(own).collect();
    let cached = std::path::PathBuf::from(format!("/tmp/locate_cache/{name}.json"));
    let has = cached.exists();
    let full = FullSettings {
        enabled: !has,
        ..full
    };
    let settings = TrainingSettings {
        fit: &fit,
        full: &full,
        up: Some(Vector3::z_axis()),
    };
    let mut models =
        posegrid::fit::models::train(arm, &all, sessions.len(), &settings).expect("a fit");
    if has {
        let text = std::fs::read_to_string(&cached).expect("cache");
        let saved = posegrid::fit::full::saved::SavedFull::read(&text).expect("saved");
        models.full = Some(FullModel::from_saved(&saved).expect("model"));
    } else {
        let names: Vec<&str> = (0..sessions.len()).map(|_| "s").collect();
        let text = serde_json::to_string(&models.full.as_ref().expect("full").saved(arm, &names))
            .expect("json");
        std::fs::create_dir_all("/tmp/locate_cache").expect("folder");
        std::fs::write(&cached, text).expect("cache");
    }
    models
}

fn figures(set: &ResidualSet) -> String {
    let judged: Vec<_> = set.judged().collect();
    let norms: Vec<f64> = judged.iter().map(|r| r.residual.norm()).collect();
    let mean = norms.iter().sum::<f64>() / norms.len() as f64;
    let squares: Vec<f64> = judged
        .iter()
        .filter_map(|r| r.mahalanobis_squared())
        .collect();
    let inside = squares.iter().filter(|&&d| d <= 7.814_727_903).count() as f64;
    let m2 = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let sd: f64 = judged
        .iter()
        .filter_map(|r| Some(r.covariance?.trace()))
        .sum::<f64>()
        / judged.len() as f64;
    let bias = judged.iter().map(|r| r.residual).sum::<Vector3<f64>>() / judged.len() as f64;
    format!(
        "n {:4} mean {mean:.4} inside {:.3} m2/3 {:.2} stated rms {:.3} rms {:.3} bias {:.3} {:.3} {:.3}",
        norms.len(),
        inside / squares.len().max(1) as f64,
        m2 / 3.0,
        sd.sqrt(),
        (norms.iter().map(|n| n * n).sum::<f64>() / norms.len() as f64).sqrt(),
        bias.x,
        bias.y,
        bias.z
    )
}

#[test]
#[ignore = "trains on thousands of stations: minutes"]
fn the_recordings_from_few_stations() {
    let arm = common::arm("ur10");
    let noise = noise();
    let of = |name: &str| common::trained::observed(name, &arm, &noise);
    let (Some(grid), Some(joint), Some(a), Some(b)) = (
        of("ur10-grid"),
        of("ur10-joint"),
        of("ur10-random-a"),
        of("ur10-random-b"),
    ) else {
        return;
    };
    let known = LocateTarget::Known;
    let own = LocateTarget::Own;
    let cases: [(&str, Vec<&[Observation]>, &[Observation], LocateTarget); 6] = [
        ("a-b", vec![&a], &b, known),
        ("joint_a-grid", vec![&joint, &a], &grid, own),
        ("joint_a_b-grid", vec![&joint, &a, &b], &grid, own),
        ("grid_a_b-joint", vec![&grid, &a, &b], &joint, own),
        ("grid_joint_b-a", vec![&grid, &joint, &b], &a, own),
        ("grid_joint_a-b", vec![&grid, &joint, &a], &b, own),
    ];
    let wanted = std::env::var("CASES").unwrap_or_default();
    for (name, training, test, target) in cases {
        if !wanted.is_empty() && !wanted.split(',').any(|w| w == name) {
            continue;
        }
        let models = learned(&arm, &training, name);
        let mut text = String::new();
        if let Some(full) = models.full.as_ref() {
            let (s0, joints) = full.visit_deviations();
            let size = |v: f64| v.sqrt();
            writeln!(
                text,
                "{name}: drift {:.4} any-time {:.4} repeat {s0:.4} {joints:?}",
                size(full.drift_variance()),
                size(full.any_time_variance())
            )
            .expect("text");
        }
        for (by, stations) in [
            (LocateBy::First, 50),
            (LocateBy::First, 12),
            (LocateBy::Chosen, 12),
            // (LocateBy::Chosen, 50),
        ] {
            let locate = Locate {
                by,
                stations,
                target,
            };
            let (fit, full) = (fit(), FullSettings::default());
            let settings = TrainingSettings {
                fit: &fit,
                full: &full,
                up: Some(Vector3::z_axis()),
            };
            let locator = Locator::new(&models, &arm, locate, &settings);
            let begun = std::time::Instant::now();
            let finders = locator.finders(&models, test);
            let chose = begun.elapsed();
            let stations = Stations {
                session: "test",
                observations: test,
            };
            let sets = unseen_session(&models, stations, &locator, &finders).expect("one each");
            writeln!(
                text,
                "{name} {by:?} {} ({chose:.1?}) {:?}",
                finders.len(),
                &finders[..finders.len().min(12)]
            )
            .expect("text");
            for set in sets.iter().filter(|set| set.subject.model == Model::Full) {
                if set.subject.base_refit == BaseRefit::All && stations_first(by, locate.stations) {
                    continue;
                }
                writeln!(
                    text,
                    "    {:?} {:?}: {}",
                    set.subject.angles,
                    set.subject.base_refit,
                    figures(set)
                )
                .expect("text");
            }
        }
        println!("{text}");
    }
    let _ = Angles::Weighted;
}

fn stations_first(by: LocateBy, n: usize) -> bool {
    !(by == LocateBy::First && n == 50)
}
