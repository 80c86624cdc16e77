//! How long plans take: `cargo bench --bench plan`. The step study of a KR 210 with the geometric model on 1000 robots (asked:
//! 60 s on two cores for 8 steps and 200 fresh poses), beside the simulation of the same stations alone; then the designs
//! with the full error model on 50 robots.

use std::path::Path;
use std::time::Instant;

use posegrid::pipeline::planning::Planning;
use posegrid::plan::{
    Designs, Placer, PlanSettings, Trial, compare, fresh_poses, robots::Robot, steps,
};
use posegrid::progress::Quiet;
use rayon::prelude::*;

const ROBOTS: usize = 1000;
const FULL_MODEL_ROBOTS: usize = 50;

fn main() {
    let path = Path::new("pipelines/plan-kr210.toml");
    let planning = Planning::load(path, None, None).expect("a good pipeline file");
    let arm = &planning.arm;
    let settings = PlanSettings {
        robots: ROBOTS,
        whole_model_robots: FULL_MODEL_ROBOTS,
        test_poses: 200,
        ..planning.settings
    };
    let placer = Placer::new(arm, &settings).expect("a box in reach");
    let pool = fresh_poses(&placer, &settings.region, &settings).expect("poses in reach");
    let trial = Trial { arm, placer: &placer, settings: &settings, progress: &Quiet };
    let seconds = |begin: Instant| begin.elapsed().as_secs_f64();

    let grids: Vec<steps::Grid> = settings
        .grid
        .steps_mm
        .iter()
        .map(|&step_mm| steps::Grid::new(&placer, &settings, step_mm).expect("a step in the box"))
        .collect();
    let begin = Instant::now();
    let stations: usize = (0..ROBOTS)
        .into_par_iter()
        .map(|number| {
            let mut robot = Robot::draw(arm, &settings, number);
            let visited = grids.iter().map(|grid| robot.session(&grid.commands).len());
            visited.sum::<usize>()
        })
        .sum();
    let simulated = seconds(begin);
    println!("simulating {stations} stations of {ROBOTS} robots: {simulated:.1} s");

    let begin = Instant::now();
    let rows = steps::judge(&trial, &pool).expect("steps in the box");
    let judged = seconds(begin);
    println!(
        "{ROBOTS} robots × {} steps × 200 fresh poses, measured, fitted and judged ({} rows): {judged:.1} s, {:.2} times the simulation alone",
        grids.len(),
        rows.len(),
        judged / simulated
    );

    let begin = Instant::now();
    let designs = Designs::new(&trial).expect("enough candidates");
    println!(
        "choosing {} of {} poses, twice: {:.1} s",
        designs.by_variance.len(),
        settings.candidates,
        seconds(begin)
    );
    let begin = Instant::now();
    let rows = compare::judge(&trial, &designs, &pool);
    println!(
        "the full error model on {FULL_MODEL_ROBOTS} robots × {} designs: {:.1} s",
        rows.len(),
        seconds(begin)
    );
}
