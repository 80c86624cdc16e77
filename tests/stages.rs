//! The stages after the join on real recordings.

mod common;

use std::f64::consts::{FRAC_PI_2, PI};

use nalgebra::Vector3;
use posegrid::fit::commanded::{CommandFrames, commanded};
use posegrid::fit::full::FullSettings;
use posegrid::fit::{FitSettings, KnownTarget, Noise, TrackerUncertainty};
use posegrid::geometry::isometry_from_rpy;
use posegrid::grid::{GridSettings, Interpolation, Source, Tolerance};
use posegrid::join::{JoinSettings, join};
use posegrid::kinematics::Arm;
use posegrid::pipeline::outcome::JoinedSession;
use posegrid::pipeline::stages::{self, StageSettings};
use posegrid::progress::Quiet;
use posegrid::report::evaluate::RefitSettings;
use posegrid::similarity::SimilaritySettings;

fn joined(name: &str, arm: &Arm) -> Option<JoinedSession> {
    let recording = common::session(name, arm)?;
    let joined = join(&recording, arm, &JoinSettings::default()).expect(name);
    let frames = CommandFrames {
        base_from_command: isometry_from_rpy([0.0; 3], [0.0, 0.0, PI]),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
    };
    let commanded = commanded(&joined.stations, arm, &frames);
    println!("{name}: {:?}", commanded.trust);
    Some(JoinedSession {
        name: name.to_owned(),
        log_rejects: recording.rejects,
        counts: recording.counts,
        joined,
        commanded,
    })
}

fn settings() -> StageSettings {
    StageSettings {
        noise: Noise {
            tracker: TrackerUncertainty {
                range_um: 10.0,
                range_um_per_m: 0.3,
                transverse_um: 15.0,
                transverse_um_per_m: 6.0,
                divisor: 2.0,
                orientation_rad: Some(130e-6),
            },
            repeatability_mm: 0.03,
            orientations: true,
        },
        fit: FitSettings {
            orientations: true,
            target: Some(KnownTarget {
                xyz_mm: [-0.2, 0.2, 92.8],
                sd_mm: 1.0,
            }),
            ..FitSettings::default()
        },
        full: FullSettings::default(),
        up: Some(Vector3::z_axis()),
        flange_from_tool: Some(isometry_from_rpy([0.0, 0.0, 109.0], [0.0, 0.0, FRAC_PI_2])),
        raw_command: None,
        similarity: SimilaritySettings::default(),
        grid: GridSettings {
            steps_mm: vec![50.0, 75.0, 100.0, 150.0, 200.0, 300.0],
            bounds: None,
            orientation_xyzw: None,
            orientation_tolerance_deg: 5.0,
            interpolations: vec![Interpolation::Idw, Interpolation::Trilinear],
            sources: vec![Source::Measured, Source::Model],
            idw_power: 2.0,
        },
        tolerance: Tolerance {
            mm: 0.5,
            share: 0.95,
            confidence: 0.95,
        },
        refit: RefitSettings {
            first: 50,
            with_target: false,
        },
    }
}

fn run(train: &[&str], test: &[&str]) {
    let arm = common::arm("ur10");
    let all = |names: &[&str]| {
        names
            .iter()
            .map(|name| joined(name, &arm))
            .collect::<Option<Vec<_>>>()
    };
    let (Some(train), Some(test)) = (all(train), all(test)) else {
        return;
    };
    let start = std::time::Instant::now();
    let outcome = stages::run(&arm, train, test, &settings(), &Quiet).expect("stages");
    println!("stages {:?}", start.elapsed());
    for accuracy in &outcome.accuracy {
        let s = &accuracy.subject;
        let Some(f) = accuracy.figures else { continue };
        println!(
            "{:8} {:14} {:10} {:9} {:5} n {:4} mean {:.4} rms {:.4} p95 {:.3} max {:.3} bound {:?} cover {:?}",
            format!("{:?}", s.split),
            s.of_session,
            format!("{:?}", s.model),
            format!("{:?}", s.angles),
            format!("{:?}", s.base_refit),
            f.n,
            f.mean,
            f.rms,
            f.p95,
            f.max,
            accuracy.bound.map(|b| (b * 1e3).round()),
            accuracy.coverage.map(|c| (
                (c.inside * 1e3).round(),
                (c.mean_squared_distance * 100.0).round()
            ))
        );
    }
    for j in &outcome.grids.judged {
        println!(
            "{:5} {:9} {:9} {:?} nodes {} refused {:?} cells {} {:?} held {} of {} {:?} mean {:?} bound {:?} {:?} {}",
            j.step_mm,
            j.source.name(),
            j.interpolation.name(),
            j.judgement,
            j.nodes,
            j.refused_nodes,
            j.cells,
            j.refused_cells,
            j.held_out.norms.len(),
            j.held_out.stations,
            (j.held_out.outside, j.held_out.unlike, &j.held_out.refused),
            j.figures.map(|f| (f.mean * 1e4).round() / 1e4),
            j.bound.map(|b| (b * 1e4).round() / 1e4),
            j.verdict,
            j.chosen
        );
    }
    println!("{}", outcome.grids.choice.words);
    for (model, v) in &outcome.semivariograms {
        for s in v {
            println!(
                "{model:?} {:?} {:?} {:?} {:?}",
                s.space,
                s.quantity,
                s.alikeness,
                s.models.first()
            );
        }
    }
}

#[test]
fn grid() {
    run(&["ur10-grid"], &[]);
}

#[test]
fn random() {
    run(&["ur10-random-a"], &["ur10-random-b"]);
}
