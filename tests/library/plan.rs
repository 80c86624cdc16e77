//! Planning: poses chosen by the model's own variance on a real arm, a plan from file to tables, and whether what a plan
//! promises holds on robots it has not seen.
//!
//! The proof of the promise is of 200 robots and runs by a command of its own:
//! `cargo test --release --test library plan::the_promise -- --ignored --nocapture`. A sample of it is among the normal tests.

use crate::common;
mod enough;
mod known;
mod locate;

use std::path::{Path, PathBuf};

use common::NOISE;
use common::trained::{base_refitted, predictions, random_sessions, trained};
use nalgebra::Vector3;
use posegrid::figures::{Coverage, Figures, share_interval};
use posegrid::fit::full::{FullModel, FullSettings};
use posegrid::fit::{FitSettings, KnownTarget, Observation, start};
use posegrid::grid::judge::by_nodes;
use posegrid::grid::node::NodeError;
use posegrid::grid::{GridStation, TableNode, Verdict};
use posegrid::ingest::Recording;
use posegrid::judgement::{JoinedSession, StageSettings};
use posegrid::kinematics::Arm;
use posegrid::pipeline::planning::Planning;
use posegrid::plan::design::{Candidate, Design};
use posegrid::plan::outcomes::RobotOutcome;
use posegrid::plan::{
    Kind, Placer, PlanSettings, Purpose, Trial, fresh_poses, plan, session, steps,
};
use posegrid::progress::Quiet;
use posegrid::report::locate::{Locate, LocateBy, LocateTarget};
use posegrid::simulate::{Ingredient, Poses, SimulateSettings, Stream, simulate, visits};

fn settings() -> FitSettings {
    FitSettings {
        target: Some(KnownTarget { xyz_mm: [-0.2, 0.2, 92.8], sd_mm: 1.0 }),
        ..FitSettings::default()
    }
}

/// The first `count` choices among the poses of a session, without its measurements: sizes are those that every arm is
/// expected to have, the base is where the nominal arm sees it.
fn chosen(arm: &Arm, session: &[Observation], count: usize) -> Vec<usize> {
    let settings = settings();
    let frames = start::frames(arm, session, 1, &settings).expect("a session");
    let poses: Vec<Vec<f64>> = session.iter().map(|o| o.axes.clone()).collect();
    let full = FullSettings::default();
    let up = Some(Vector3::z_axis());
    let prior = settings.prior();
    let model = FullModel::expected(arm, &frames[0], &poses, poses.len(), &prior, &full, up);
    let candidate =
        |o: &Observation| Candidate { axes: o.axes.clone(), noise: model.noise(o, o.session) };
    let candidates: Vec<Candidate> = session.iter().map(candidate).collect();
    let mut design = Design::new(&model, &candidates, &poses);
    for _ in 0..count {
        design.choose().expect("more poses than are chosen");
    }
    design.chosen.clone()
}

/// `count` places of `of`, drawn without replacement.
fn drawn(of: usize, count: usize, stream: &mut Stream) -> Vec<usize> {
    let mut places: Vec<usize> = (0..of).collect();
    for place in 0..count {
        let left = of - place;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place")]
        let other = place + (stream.uniform() * left as f64) as usize;
        places.swap(place, other);
    }
    places.truncate(count);
    places
}

/// What a model of these stations of `a` leaves on `b`, its base refitted there.
fn judged(arm: &Arm, a: &[Observation], b: &[Observation], places: &[usize]) -> Figures {
    let mut places = places.to_vec();
    places.sort_unstable();
    let training: Vec<Observation> = places.iter().map(|&place| a[place].clone()).collect();
    let model = trained(arm, &training, 1, &settings());
    base_refitted(&predictions(&model, b), b)
}

#[test]
fn on_a_real_arm_chosen_poses_leave_less_than_random_ones_and_far_smaller_largest_errors() {
    const DRAWS: usize = 5;
    let arm = common::arm("ur10");
    let Some((a, b)) = random_sessions(&arm, &NOISE) else {
        return;
    };
    let order = chosen(&arm, &a, 100);
    let mut stream = Stream::new(20, Ingredient::Poses);
    for count in [50, 100] {
        let chosen = judged(&arm, &a, &b, &order[..count]);
        let random: Vec<Figures> =
            (0..DRAWS).map(|_| judged(&arm, &a, &b, &drawn(a.len(), count, &mut stream))).collect();
        let mean = |of: fn(&Figures) -> f64| random.iter().map(of).sum::<f64>() / DRAWS as f64;
        let (random_mean, random_max) = (mean(|f| f.mean), mean(|f| f.max));
        println!(
            "{count} poses: chosen {:.4} mean, {:.3} largest; random {random_mean:.4}, {random_max:.3}",
            chosen.mean, chosen.max
        );
        // Over 24 draws and both directions the mean is 15 to 28 % lower at 50 poses, 16 to 19 % at 100.
        assert!(chosen.mean <= 0.87 * random_mean, "{count}: {chosen:?}");
        assert!(chosen.max <= 0.6 * random_max, "{count}: {chosen:?}");
    }
}

/// The plan of a KR 210 with few robots, for a test of minutes; an easy share of them is asked for.
fn small(lake: &Path) -> Planning {
    small_of("pipelines/plan-kr210.toml", lake)
}

/// The same of another pipeline file.
fn small_of(path: &str, lake: &Path) -> Planning {
    let mut planning =
        Planning::load(Path::new(path), None, Some(lake)).expect("a good pipeline file");
    planning.settings = PlanSettings {
        robots: 8,
        whole_model_robots: 10,
        test_poses: 80,
        candidates: 150,
        poses: vec![20, 30],
        verify_poses: 12,
        drift_check_every: 15,
        robots_meet: Coverage { share: 0.7, confidence: 0.9 },
        ..planning.settings
    };
    planning.settings.grid.steps_mm = vec![250.0, 500.0, 1000.0];
    planning.settings.full.harmonics = 30;
    planning
}

#[test]
fn a_plan_says_what_to_measure_and_what_it_promises() {
    let lake = tempfile::tempdir().expect("a folder");
    let planned = small(lake.path()).make(&Quiet).expect("a plan");
    let plan = planned.plan.as_ref().expect("an empty lake");
    // Three steps, two sources, two interpolations.
    assert_eq!(plan.steps.len(), 12);
    // One cell of a metre has its corners more than 1.5 rad of a joint apart: it may not serve, and says so.
    let largest = plan.steps.iter().filter(|row| row.step_mm > 900.0);
    assert!(largest.clone().all(|row| row.outcomes.mean.is_none() && !row.outcomes.holds()));
    let refused: usize = largest.map(|row| row.outcomes.refused.values().sum::<usize>()).sum();
    assert_eq!(refused, 4 * 8 * 80);
    let kinds: Vec<Kind> = plan.designs.iter().map(|row| row.kind).collect();
    assert!(Kind::ALL.iter().all(|kind| kinds.contains(kind)), "{kinds:?}");
    let count = |purpose| plan.session.count(|own| own == purpose);
    assert_eq!(count(Purpose::Verify), 12);
    assert!(count(Purpose::Identify) <= 30 && count(Purpose::Identify) >= 10);
    assert!(plan.session.visits.iter().any(|v| matches!(v.purpose, Purpose::DriftCheck { .. })));
    assert!(plan.promise.bound_mm.is_some_and(|bound| bound < 0.5), "{:?}", plan.promise);
    let page = planned.page.as_ref().expect("a page beside the tables");
    let page = std::fs::read_to_string(page.named()).expect("the page");
    let promised = plan.promise.mean_bound_mm.expect("a promise");
    assert!(page.contains(&format!("<data value=\"{promised}\">")));
    let means = plan.steps.iter().map(|row| &row.outcomes);
    let means = means.chain(plan.designs.iter().map(|row| &row.outcomes));
    for mean in means.filter_map(|outcomes| Some(outcomes.mean?.mean)) {
        assert!(page.contains(&format!("<data value=\"{mean}\">")), "{mean}");
    }
    assert!(page.contains(&planned.key.run) && page.len() < 500_000);
    let again = small(lake.path()).make(&Quiet).expect("the same plan");
    assert!(again.plan.is_none() && again.is_met == planned.is_met && again.key == planned.key);
    let other = tempfile::tempdir().expect("a folder");
    let elsewhere = small(other.path()).make(&Quiet).expect("the same plan");
    let bytes = |lake: &Path| {
        let mut files = files(&lake.join("sampling_plan"));
        files.extend(self::files(&lake.join("plan_figures")));
        files.extend(self::files(&lake.join("report")));
        files.iter().map(|path| std::fs::read(path).expect("a table")).collect::<Vec<_>>()
    };
    assert_eq!(bytes(lake.path()), bytes(other.path()), "{:?}", elsewhere.key);
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("a folder of the lake");
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    let inside = |path: &PathBuf| {
        if path.is_dir() { files(path) } else { vec![path.clone()] }
    };
    paths.iter().flat_map(inside).collect()
}

/// Of robots that a plan has not seen, how many keep its promised bound.
fn keep(planning: &Planning, robots: usize) -> (usize, f64) {
    let Planning { arm, settings, .. } = planning;
    let made = plan(arm, settings, &Quiet).expect("a plan");
    let promised = made.promise.bound_mm.expect("enough robots for a promise");
    let fresh = PlanSettings { seed: settings.seed + 1, ..settings.clone() };
    let placer = Placer::new(arm, &fresh).expect("the same cell");
    let pool = fresh_poses(&placer, &fresh.region, &fresh).expect("poses in reach");
    let trial = Trial { arm, placer: &placer, settings: &fresh, progress: &Quiet };
    let found = session::tried(&trial, &made.session, &pool, 0..robots);
    let keeps = |outcome: &RobotOutcome| match outcome {
        RobotOutcome::Judged(left) => left.bound.is_some_and(|bound| bound <= promised),
        RobotOutcome::NoFit(_) => false,
    };
    (found.iter().filter(|outcome| keeps(outcome)).count(), promised)
}

fn check(planning: &Planning, robots: usize) {
    let (kept, promised) = keep(planning, robots);
    let share = planning.settings.robots_meet.share;
    let (low, high) = share_interval(kept, robots, 0.95);
    println!(
        "{kept} of {robots} fresh robots keep the promised {promised:.3} mm: {low:.3} to {high:.3} with 95 %; promised {share}"
    );
    assert!(high >= share, "{kept} of {robots}");
}

#[test]
fn a_sample_of_fresh_robots_keeps_the_promise() {
    for path in PLANS {
        let lake = tempfile::tempdir().expect("a folder");
        let mut planning = small_of(path, lake.path());
        planning.settings.grid.steps_mm = vec![400.0];
        planning.settings.robots = 1;
        planning.settings.poses = vec![20];
        check(&planning, 12);
    }
}

#[test]
#[ignore = "a long proof: cargo test --release --test library plan::the_promise -- --ignored --nocapture"]
fn the_promise_holds_on_two_hundred_fresh_robots() {
    proof(PLANS[0]);
}

#[test]
#[ignore = "a long proof: cargo test --release --test library plan::the_promise -- --ignored --nocapture"]
fn the_promise_of_a_ur10_holds_on_two_hundred_fresh_robots() {
    proof(PLANS[1]);
}

/// The arms that the promise is proved of.
const PLANS: [&str; 2] = ["pipelines/plan-kr210.toml", "pipelines/plan-ur10.toml"];

fn proof(path: &str) {
    for tolerance_mm in [0.5, 0.2] {
        let lake = tempfile::tempdir().expect("a folder");
        let path = Path::new(path);
        let mut planning =
            Planning::load(path, None, Some(lake.path())).expect("a good pipeline file");
        planning.settings.tolerance.mm = tolerance_mm;
        // Steps are not what is promised.
        planning.settings.robots = 1;
        check(&planning, 200);
    }
}

/// In which order a session visits the nodes of its grid.
#[derive(Debug, Clone, Copy)]
enum Order {
    /// Each line back the way the last one came: joints come to neighbouring nodes from the same sides.
    Serpentine,
    /// Each joint comes from anywhere.
    Random,
}

/// Fresh poses of one session.
struct Fresh {
    /// Within the bound that `run` gives.
    within: usize,
    /// Within the bound of the session's own stations as they were measured.
    within_of_session: usize,
    /// All of them.
    of: usize,
}

/// One simulated session on a grid of 200 mm, from its logs' samples through all the stages of `run`: how many of its fresh
/// poses of another session lie within the bound of the step that was chosen, and how many there are.
fn within_the_chosen_bound(planning: &Planning, number: u64, order: Order) -> Fresh {
    let Planning { arm, settings, .. } = planning;
    let placer = Placer::new(arm, settings).expect("a box in reach");
    let grid = steps::Grid::new(&placer, settings, 200.0).expect("a step in the box");
    let nodes = grid.commands.len();
    let order = match order {
        Order::Serpentine => (0..nodes).collect(),
        Order::Random => drawn(nodes, nodes, &mut Stream::new(number, Ingredient::Poses)),
    };
    let joints = order.iter().map(|&node| grid.commands[node].joints.clone());
    let cell = SimulateSettings {
        seed: 40_000 + number,
        home: settings.home.clone(),
        poses: Poses::Listed { joints: joints.collect() },
        ..settings.population.clone()
    };
    let simulated = simulate(arm, &cell).expect("poses in reach");
    let session = joined(arm, settings, &simulated.recording);
    let found = crate::judged(arm, vec![session], vec![], &stage_settings(settings))
        .expect("a sound session");
    let chosen = found.grids.chosen().expect("a table");
    let bound = chosen.bound.expect("216 stations are enough");
    let of_session = chosen.bound_of_session.expect("the same stations");
    println!(
        "{} mm, {}: bound {bound:.3}, of the session itself {of_session:.3} mm",
        chosen.step_mm,
        chosen.source.name()
    );
    let table = found.grids.table.as_ref().expect("a table");
    let placed = placer.grid(table.lattice, table.orientation);
    let error = |node: &TableNode| {
        let error = node.error.map(|(error, _)| error);
        Ok(error.unwrap_or_else(|_| Vector3::zeros()))
    };
    let errors: Vec<NodeError> = table.nodes.iter().map(error).collect();
    let between_sessions = SimulateSettings { seed: 80_000 + number, ..cell };
    let mut stream = Stream::new(between_sessions.seed, Ingredient::TestPoses);
    let (fresh, _) = placer
        .random(&settings.region, settings.test_poses, &mut stream, &|_| Ok(()))
        .expect("poses in reach");
    let left = visits(arm, &between_sessions, &simulated.truth.arm, &fresh);
    let left = left.iter().filter_map(|visit| {
        let perfect = visit.perfect(&between_sessions);
        let command = perfect.command.as_ref()?.position;
        let station =
            GridStation::of(&perfect, Some(command), &found.error_frame, &placer.reach, 0)?;
        let power = table.idw_power;
        let there =
            by_nodes(&placed, |node| errors[node], &command, table.interpolation, power)?.ok()?;
        Some((station.error - there).norm())
    });
    let left: Vec<f64> = left.collect();
    let within = |bound: f64| left.iter().filter(|&&norm| norm <= bound).count();
    Fresh { within: within(bound), within_of_session: within(of_session), of: left.len() }
}

fn joined(arm: &Arm, settings: &PlanSettings, recording: &Recording) -> JoinedSession {
    common::joined("simulated", arm, recording, settings.flange_from_target)
}

fn stage_settings(settings: &PlanSettings) -> StageSettings {
    StageSettings {
        fit: settings.fit.clone(),
        full: settings.full.clone(),
        up: settings.up,
        flange_from_tool: Some(settings.flange_from_target),
        grid: settings.grid.clone(),
        tolerance: settings.tolerance,
        locate: Locate { by: LocateBy::First, stations: Some(50), target: LocateTarget::Known },
        ..common::stage_settings(settings.noise.clone())
    }
}

/// Sessions whose fresh poses contradict that 95 % lie within the bound, told one by one; chance alone contradicts one in
/// forty, and the bound itself may be too small for one session in twenty.
fn contradicted(planning: &Planning, sessions: u64, order: Order) -> usize {
    let (mut contradicted, mut within, mut of_session, mut all) = (0, 0, 0, 0);
    for number in 0..sessions {
        let fresh = within_the_chosen_bound(planning, number, order);
        let possible = share_interval(fresh.within, fresh.of, 0.95).1;
        contradicted += usize::from(possible < planning.settings.tolerance.share);
        within += fresh.within;
        of_session += fresh.within_of_session;
        all += fresh.of;
        println!(
            "{order:?} {number}: {} of {} fresh poses of another session within the bound, {} within that of the session itself; so \
             far {:.4} and {:.4}, {contradicted} contradicted",
            fresh.within,
            fresh.of,
            fresh.within_of_session,
            within as f64 / all as f64,
            of_session as f64 / all as f64
        );
    }
    contradicted
}

#[test]
#[ignore = "a long proof: cargo test --release --test library plan::steps_that_run_chooses -- --ignored --nocapture"]
fn steps_that_run_chooses_hold_on_fresh_poses() {
    const SESSIONS: u64 = 30;
    let lake = tempfile::tempdir().expect("a folder");
    let path = Path::new("pipelines/plan-kr210.toml");
    let planning = Planning::load(path, None, Some(lake.path())).expect("a good pipeline file");
    for order in [Order::Serpentine, Order::Random] {
        let contradicted = contradicted(&planning, SESSIONS, order);
        println!("{order:?}: {contradicted} of {SESSIONS} sessions contradict their bound");
        // 30 sessions at one in twenty each: more than 4 are rarer than one proof in sixty.
        assert!(contradicted <= 4, "{contradicted} of {SESSIONS}");
    }
}

#[test]
fn robots_that_cannot_be_judged_are_reported() {
    // With 12 fresh poses no bound of 95 % of errors with 95 % confidence exists: 59 are needed.
    let tolerance = posegrid::grid::Tolerance { mm: 0.5, share: 0.95, confidence: 0.95 };
    let outcome = RobotOutcome::of((0..12).map(|_| Some(Ok(0.1))), &tolerance);
    let RobotOutcome::Judged(left) = outcome else {
        panic!("it was judged");
    };
    assert!(
        matches!(left.verdict, Verdict::NotShown(reason) if reason.contains("59 poses are needed"))
    );
}
