//! Poses chosen by the model's own variance on a real arm: chosen from one session's poses without a look at their
//! measurements, judged on another session.

mod common;

use common::NOISE;
use common::trained::{base_refitted, predictions, random_sessions, trained};
use nalgebra::Vector3;
use posegrid::figures::Figures;
use posegrid::fit::full::{FullModel, FullSettings};
use posegrid::fit::start;
use posegrid::fit::{FitSettings, KnownTarget, Observation};
use posegrid::kinematics::Arm;
use posegrid::plan::design::{Candidate, Design};

fn settings() -> FitSettings {
    FitSettings {
        target: Some(KnownTarget {
            xyz_mm: [-0.2, 0.2, 92.8],
            sd_mm: 1.0,
        }),
        ..FitSettings::default()
    }
}

/// The first `count` choices among the poses of `session`, without its measurements.
fn chosen(arm: &Arm, session: &[Observation], count: usize) -> Vec<usize> {
    let settings = settings();
    let frames = start::frames(arm, session, 1, &settings).expect("a session")[0];
    let poses: Vec<Vec<f64>> = session.iter().map(|o| o.axes.clone()).collect();
    let model = FullModel::expected(
        arm,
        &frames,
        &poses,
        poses.len(),
        settings.prior(),
        &FullSettings::default(),
        Some(Vector3::z_axis()),
    );
    let candidates: Vec<Candidate> = session
        .iter()
        .map(|o| Candidate {
            axes: o.axes.clone(),
            noise: model.noise(o),
        })
        .collect();
    let mut design = Design::new(&model, &candidates, &poses);
    let begin = std::time::Instant::now();
    for _ in 0..count {
        let c = design.choose().expect("enough");
        if design.chosen().len() % 10 == 0 {
            println!(
                "{} {:.4} {:?}",
                design.chosen().len(),
                c.left_mm2.sqrt(),
                begin.elapsed()
            );
        }
    }
    design.chosen().to_vec()
}

fn judged(arm: &Arm, a: &[Observation], b: &[Observation], places: &[usize]) -> Figures {
    let mut places = places.to_vec();
    places.sort_unstable();
    let training: Vec<Observation> = places.iter().map(|&p| a[p].clone()).collect();
    let model = trained(arm, &training, 1, &settings());
    base_refitted(&predictions(&model, b), b)
}

#[test]
fn chosen_poses_beat_random_ones() {
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let order = chosen(&arm, &a, 200);
    for count in [50, 100, 200] {
        let f = judged(&arm, &a, &b, &order[..count]);
        println!("chosen {count}: {f:?}");
        let mut state = 12345u64;
        let mut all = Vec::new();
        for _ in 0..6 {
            let mut places: Vec<usize> = (0..a.len()).collect();
            for i in 0..count {
                state = state
                    .wrapping_mul(6364136223846793005)
                    .wrapping_add(1442695040888963407);
                let j = i + (state >> 33) as usize % (places.len() - i);
                places.swap(i, j);
            }
            let f = judged(&arm, &a, &b, &places[..count]);
            all.push((f.mean, f.max));
        }
        println!(
            "random {count}: {all:.3?} mean {:.4}",
            all.iter().map(|a| a.0).sum::<f64>() / 6.0
        );
    }
}
