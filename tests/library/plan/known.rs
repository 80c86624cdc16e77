//! Plans for an arm that was identified before: what is drawn from its posterior, what designs and fits make of it, and
//! what that is worth on a real arm.

use std::sync::Arc;

use nalgebra::{DVector, Matrix3, Point3, Vector3};
use posegrid::figures::Figures;
use posegrid::fit::commanded::SettlingError;
use posegrid::fit::full::next::{Mounted, Mounting, Placed};
use posegrid::fit::full::{FullModel, FullSettings, Known, Query};
use posegrid::fit::{FitSettings, Observation, SourceId, TargetId, start};
use posegrid::geometry::{Transform, isometry_from_rpy};
use posegrid::kinematics::Arm;
use posegrid::pipeline::planning::Planning;
use posegrid::plan::design::{Candidate, Design};
use posegrid::plan::robots::{Robot, stations};
use posegrid::plan::{Designs, Kind, KnownArm, Placer, PlanSettings, Trial, compare, fresh_poses};
use posegrid::progress::Quiet;
use posegrid::simulate::{Commanded, Ingredient, Stream};

use super::common::trained::{base_refitted, observed, predictions, trained};
use super::common::{self, NOISE};
use super::{chosen, drawn, settings, small};

/// A robot of the small plan, measured at `count` poses turned as far as candidates may be: its full error model.
fn past(planning: &Planning, count: usize) -> FullModel {
    let Planning { arm, settings, .. } = planning;
    let placer = Placer::new(arm, settings).expect("a box in reach");
    let mut robot = Robot::draw(arm, settings, 1000);
    let fitted = robot
        .fitted(&random(&placer, settings, count), settings, &settings.full)
        .expect("enough poses");
    fitted.models.full.expect("a full error model")
}

pub(super) fn random(placer: &Placer<'_>, settings: &PlanSettings, count: usize) -> Vec<Commanded> {
    let region =
        posegrid::plan::Region { cone_rad: settings.candidate_cone_rad, ..settings.region };
    let mut stream = Stream::new(77, Ingredient::Poses);
    let found = placer.random(&region, count, &mut stream, &|_| Ok(()));
    found.expect("poses in reach").0
}

/// The arm of `past` where it stood, its target put on again.
fn known(planning: &Planning, past: &FullModel, moved: bool) -> KnownArm {
    let settings = &planning.settings;
    let cell = &settings.population.cell;
    let base = isometry_from_rpy(cell.tracker_from_base_mm, cell.tracker_from_base_rpy);
    let mounting = Mounting {
        session: 0,
        sources: vec![if moved { Placed::Moved(Transform::claim(base)) } else { Placed::Same }],
        targets: vec![Mounted::Again { sd_mm: 0.05 }],
    };
    KnownArm::new(&planning.arm, past, mounting, 60, &settings.full, settings.up)
        .expect("a positive covariance")
}

pub(super) fn few_harmonics(lake: &std::path::Path) -> Planning {
    let mut planning = small(lake);
    planning.settings.full.harmonics = 15;
    planning
}

fn query<'q>(axes: &'q [f64], known: Known<'q>) -> Query<'q> {
    Query {
        axes,
        known,
        lever: Vector3::zeros(),
        session: 0,
        source: SourceId::ONLY,
        target: TargetId::ONLY,
        own: true,
        station: None,
    }
}

#[test]
fn what_is_drawn_varies_as_the_posterior_does() {
    const DRAWS: usize = 3000;
    let lake = tempfile::tempdir().expect("a folder");
    let planning = few_harmonics(lake.path());
    let known = known(&planning, &past(&planning, 40), false);
    let model = &known.model;
    let axes = planning.arm.axes(&planning.settings.home);
    let rows = model.predict(&query(&axes, Known::Reported)).rows;
    let expected = model.covariances(&rows)[0];
    let mean = &rows * model.drawn(DVector::zeros(rows.ncols()));
    let mut stream = Stream::new(4, Ingredient::Posterior);
    let mut found = Matrix3::zeros();
    for _ in 0..DRAWS {
        let z = DVector::from_vec(stream.normals(rows.ncols(), 1.0));
        let away = &rows * model.drawn(z) - &mean;
        found += Matrix3::from_fn(|i, j| away[i] * away[j] / DRAWS as f64);
    }
    // A variance of 3000 draws has a standard error of 2.6 %, a covariance of no more of the two deviations: five of them.
    for (i, j) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
        let sizes = (expected[(i, i)] * expected[(j, j)]).sqrt();
        let off = (found[(i, j)] - expected[(i, j)]).abs();
        assert!(off < 0.13 * sizes, "{i} {j}: {found} {expected}");
    }
    // What is left open at home after 40 poses, and a target put on again within 0.05 mm: neither nothing nor a millimetre.
    assert!((0.03..0.5).contains(&expected.trace().sqrt()), "{expected}");
}

#[test]
fn a_drawn_arm_stands_where_its_coefficients_say() {
    let lake = tempfile::tempdir().expect("a folder");
    let planning = few_harmonics(lake.path());
    let (arm, settings) = (&planning.arm, &planning.settings);
    let known = known(&planning, &past(&planning, 40), false);
    let model = &known.model;
    let placer = Placer::new(arm, settings).expect("a box in reach");
    let mut moved: f64 = 0.0;
    for seed in 0..3 {
        let mut cell = settings.population.clone();
        cell.seed = seed;
        let errors = known.draw(&mut cell);
        let size = model.trained.layout.size();
        let z = Stream::new(seed, Ingredient::Posterior).normals(size, 1.0);
        let away = model.drawn(DVector::from_vec(z)) - model.drawn(DVector::zeros(size));
        let frame = &cell.cell;
        let tracker_from_base =
            isometry_from_rpy(frame.tracker_from_base_mm, frame.tracker_from_base_rpy);
        for pose in random(&placer, settings, 8) {
            let axes = arm.axes(&pose.joints);
            // At its command, so that nothing of where joints come to stand is in it.
            let at_command = SettlingError::Sent(vec![0.0; axes.len()]);
            let predicted = model.predict(&query(&axes, Known::Both(&at_command)));
            let shift = &predicted.rows * &away;
            let expected = predicted.position + Vector3::new(shift[0], shift[1], shift[2]);
            let stands = tracker_from_base * errors.base_from_target(arm, &pose.joints, &[0.0; 6]);
            let found = Point3::from(stands.translation.vector);
            // The model is linear around its posterior: second order of a few tenths of a millimetre and milliradian.
            assert!((found - expected).norm() < 0.01, "{found} {expected}");
            moved = moved.max(shift.norm());
        }
    }
    assert!(moved > 0.05, "draws hardly differ: {moved}");
}

#[test]
fn learning_in_two_parts_is_learning_at_once() {
    let lake = tempfile::tempdir().expect("a folder");
    let planning = few_harmonics(lake.path());
    let (arm, settings) = (&planning.arm, &planning.settings);
    let mut known_planning = few_harmonics(lake.path());
    let known = Arc::new(known(&planning, &past(&planning, 40), false));
    known_planning.settings.known = Some(Arc::clone(&known));
    let placer = Placer::new(arm, settings).expect("a box in reach");
    let mut robot = Robot::draw(arm, &known_planning.settings, 3);
    let poses = random(&placer, settings, 24);
    let all = observations(arm, &stations(robot.session(&poses)), settings);
    let frames = &known.model.starts()[0];
    let learned = |model: &FullModel, part: &[Observation]| {
        model.learned(arm, part, frames.clone()).expect("positive")
    };
    let at_once = learned(&known.model, &all);
    let in_parts = learned(&learned(&known.model, &all[..10]), &all[10..]);
    for pose in &poses {
        let axes = arm.axes(&pose.joints);
        let query = query(&axes, Known::Reported);
        let position = |model: &FullModel| model.predict(&query).position;
        let covariance = |model: &FullModel| model.covariances(&model.predict(&query).rows)[0];
        // Stations are weighed by what all others say: of ten others it is not quite the same.
        let apart = (position(&at_once) - position(&in_parts)).norm();
        let (one, two) = (covariance(&at_once), covariance(&in_parts));
        assert!(apart < 0.02, "{apart}");
        assert!((one - two).norm() < 0.1 * one.norm(), "{one} {two}");
        assert!(one.trace() < 0.5 * covariance(&known.model).trace());
    }
}

/// Stations with what they fell short of their commands.
fn observations(
    arm: &Arm,
    stations: &[posegrid::join::Station],
    settings: &PlanSettings,
) -> Vec<Observation> {
    let frames = posegrid::fit::commanded::CommandFrames {
        base_from_command: nalgebra::Isometry3::identity(),
        flange_from_tool: Some(settings.flange_from_target),
    };
    let mut observations = posegrid::fit::observations(0, stations, arm, &settings.noise);
    let commanded = posegrid::fit::commanded::commanded(stations, arm, &frames);
    posegrid::fit::add_commands(&mut observations, stations, &commanded);
    observations
}

#[test]
fn of_a_known_arm_few_poses_promise_what_many_do_of_an_unknown_one() {
    let lake = tempfile::tempdir().expect("a folder");
    let mut planning = few_harmonics(lake.path());
    let past = past(&planning, 80);
    planning.settings.whole_model_robots = 12;
    planning.settings.poses = vec![6, 12, 30];
    let bounds = |planning: &Planning, sizes: &[usize]| {
        let Planning { arm, settings, .. } = planning;
        let placer = Placer::new(arm, settings).expect("a box in reach");
        let trial = Trial { arm, placer: &placer, settings, progress: &Quiet };
        let pool = fresh_poses(&placer, &settings.region, settings).expect("poses in reach");
        let designs = Designs::new(&trial).expect("enough candidates");
        let sizes: Vec<_> = sizes.iter().map(|&n| (Kind::GreedyVariance, n)).collect();
        let rows = compare::judge_sizes(&trial, &designs, &pool, &sizes);
        let figures = rows.iter().map(|row| (row.outcomes.mean.expect("judged").p95, row.expected));
        figures.collect::<Vec<_>>()
    };
    let unknown = bounds(&planning, &[12, 30]);
    let known = known(&planning, &past, true);
    planning.settings.known = Some(Arc::new(known));
    let known = bounds(&planning, &[6, 12, 30]);
    println!("unknown 12, 30: {unknown:?}\nknown 6, 12, 30: {known:?}");
    assert!(known[0].0 < unknown[0].0, "6 of a known arm, 12 of an unknown one");
    assert!(known[1].0 < 0.9 * unknown[0].0, "12 of both");
    let expected = |place: usize, all: &[(f64, Option<compare::Expected>)]| {
        all[place].1.expect("a chosen design").share_mm
    };
    assert!(expected(1, &known) < 0.5 * expected(0, &unknown));
}

/// Poses of `session` in the order in which a design takes them that starts from `known`.
fn chosen_from(known: &FullModel, session: &[Observation], count: usize) -> Vec<usize> {
    let poses: Vec<Vec<f64>> = session.iter().map(|o| o.axes.clone()).collect();
    let candidate =
        |o: &Observation| Candidate { axes: o.axes.clone(), noise: known.noise(o, o.session) };
    let candidates: Vec<Candidate> = session.iter().map(candidate).collect();
    let mut design = Design::new(known, &candidates, &poses);
    for _ in 0..count {
        design.choose().expect("more poses than are chosen");
    }
    design.chosen.clone()
}

/// What a known arm that goes on from these stations of `a` leaves on `b`, its base refitted there.
fn left_after(
    known: &FullModel,
    arm: &Arm,
    a: &[Observation],
    b: &[Observation],
    places: &[usize],
    mounting: &Mounting,
) -> Figures {
    let mut places = places.to_vec();
    places.sort_unstable();
    let training: Vec<Observation> = places.iter().map(|&place| a[place].clone()).collect();
    let found = start::frames(arm, &training, 1, &settings()).expect("stations");
    let frames = mounting.starts(&known.starts()[0], &found[0]);
    let model = known.learned(arm, &training, frames).expect("positive");
    base_refitted(&predictions(&model, b), b)
}

/// The arm as another session knows it, in the session of `a`.
fn known_before(
    arm: &Arm,
    before: &str,
    every: usize,
    a: &[Observation],
) -> Option<(FullModel, Mounting)> {
    let fit: FitSettings = settings();
    let before: Vec<Observation> =
        observed(before, arm, &NOISE)?.into_iter().step_by(every).collect();
    let past = trained(arm, &before, 1, &fit);
    let frames = start::frames(arm, a, 1, &fit).expect("a session");
    let stands = *frames[0].tracker_from_base(SourceId::ONLY);
    let mounting = Mounting {
        session: 0,
        sources: vec![Placed::Moved(stands)],
        targets: vec![Mounted::Again { sd_mm: 0.3 }],
    };
    let up = Some(Vector3::z_axis());
    let next = past.next(arm, &mounting, a.len(), &FullSettings::default(), up);
    Some((next.expect("positive"), mounting))
}

/// Every third station of the session of joint configurations, which knows the arm; then 50 poses of random-a.
#[test]
fn on_a_real_arm_what_another_session_knows_is_worth_many_poses() {
    let arm = common::arm("ur10");
    let Some((a, b)) = common::trained::random_sessions(&arm, &NOISE) else {
        return;
    };
    let Some((known, mounting)) = known_before(&arm, "ur10-joint", 3, &a) else {
        return;
    };
    let with = chosen_from(&known, &a, 50);
    let known = left_after(&known, &arm, &a, &b, &with, &mounting);
    let alone = super::judged(&arm, &a, &b, &chosen(&arm, &a, 50));
    println!("50 poses of a known arm {known:?}; of an unknown one {alone:?}");
    assert!(known.mean < 0.8 * alone.mean && known.max < alone.max);
}

#[test]
#[ignore = "figures of plans that start from a known arm: cargo test --release --test library plan::figures_of_a_known -- --ignored --nocapture"]
fn figures_of_a_known_real_arm() {
    let arm = common::arm("ur10");
    let Some((a, b)) = common::trained::random_sessions(&arm, &NOISE) else {
        return;
    };
    let without = chosen(&arm, &a, 100);
    let mut stream = Stream::new(20, Ingredient::Poses);
    let random: Vec<Vec<usize>> = (0..12).map(|_| drawn(a.len(), 100, &mut stream)).collect();
    let mean = |all: &[Figures], of: fn(&Figures) -> f64| {
        all.iter().map(of).sum::<f64>() / all.len() as f64
    };
    for count in [25, 50, 100] {
        let judged = |places: &[usize]| super::judged(&arm, &a, &b, &places[..count]);
        let (chosen, drawn) =
            (judged(&without), random.iter().map(|r| judged(r)).collect::<Vec<_>>());
        println!(
            "{count} poses, nothing known: chosen {:.4} (largest {:.3}), random {:.4} ({:.3})",
            chosen.mean,
            chosen.max,
            mean(&drawn, |f| f.mean),
            mean(&drawn, |f| f.max)
        );
    }
    for before in ["ur10-joint", "ur10-grid"] {
        let Some((known, mounting)) = known_before(&arm, before, 1, &a) else {
            return;
        };
        let with = chosen_from(&known, &a, 100);
        let left = |places: &[usize]| left_after(&known, &arm, &a, &b, places, &mounting);
        for count in [10, 25, 50, 100] {
            let of = |figures: Figures| format!("{:.4} (largest {:.3})", figures.mean, figures.max);
            let drawn: Vec<Figures> = random.iter().map(|r| left(&r[..count])).collect();
            println!(
                "{before}, {count} poses: known and chosen {}; known, chosen without it {}; known, random {:.4} ({:.3}); \
                 chosen by it, fitted alone {}",
                of(left(&with[..count])),
                of(left(&without[..count])),
                mean(&drawn, |f| f.mean),
                mean(&drawn, |f| f.max),
                of(super::judged(&arm, &a, &b, &with[..count]))
            );
        }
    }
}
