//! Forward kinematics of many poses: the batch beside a plain product of nalgebra's `Isometry3`.
//!
//! `cargo bench --bench kinematics` prints poses a second on one core and how much faster each way is than the plain product,
//! from one run; each figure is the best of many short rounds, since a shared machine only ever slows one down. Without
//! `--bench` (as `cargo test` calls it) one short round shows that all ways end in the same place.

use std::hint::black_box;
use std::time::Instant;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use posegrid::kinematics::JointFile;
use posegrid::kinematics::batch::{BLOCK, Variables};
use posegrid::kinematics::{Arm, BatchChain, BatchColumns, HeldChain, Poses, RobotFile};

/// Poses of a round: their columns stay in a core's second cache.
const POSES: usize = 1024;

fn main() {
    let full_size = std::env::args().any(|arg| arg == "--bench");
    let rounds = if full_size { 2000 } else { 1 };
    println!("{:<58} {:>14} {:>8}", "6-joint poses, one core", "poses/s", "ratio");
    for robot in ["kr210-r2700-extra", "ur10"] {
        compare(robot, &arm(robot), rounds);
    }
}

fn compare(robot: &str, arm: &Arm, rounds: usize) {
    let axes = columns();
    let rows: Vec<Vec<f64>> =
        (0..POSES).map(|i| axes.iter().map(|column| column[i]).collect()).collect();
    let chain = arm.chain();
    let nominal = vec![0.0; chain.parameters().len()];
    let links = links(robot);

    let mut plain = vec![Isometry3::identity(); POSES];
    let base = best(rounds, || {
        for (end, q) in plain.iter_mut().zip(black_box(&rows)) {
            *end = product(&links, q);
        }
    });
    row(&format!("{robot}: plain product of Isometry3"), base, base);

    let held = HeldChain::new(chain, &nominal, &vec![None; nominal.len()]);
    let mut one_by_one = vec![Isometry3::identity(); POSES];
    let time = best(rounds, || {
        for (end, q) in one_by_one.iter_mut().zip(black_box(&rows)) {
            *end = held.end(q);
        }
    });
    row(&format!("{robot}: HeldChain, pose by pose"), time, base);

    let batch = BatchChain::new(chain, &nominal);
    let mut poses = Poses::default();
    let time = best(rounds, || poses = batch.poses(black_box(&axes)));
    row(&format!("{robot}: batch, whole poses"), time, base);

    let time = best(rounds, || drop(black_box(batch.positions(black_box(&axes)))));
    row(&format!("{robot}: batch, positions"), time, base);

    let unknowns: Vec<_> = (0..nominal.len()).map(Some).collect();
    let with_columns = BatchColumns::new(chain, &nominal, &unknowns);
    let mut found = Vec::new();
    let variables = Variables::of(axes.clone());
    let time = best(rounds, || {
        for first in (0..POSES).step_by(BLOCK) {
            black_box(with_columns.block(black_box(&variables), first, &mut found));
        }
    });
    let what = format!("{robot}: batch, with {} parameters' columns", nominal.len());
    row(&what, time, base);

    for i in 0..POSES {
        let apart = |other: &Isometry3<f64>| {
            (other.translation.vector - plain[i].translation.vector).norm()
        };
        let worst = apart(&poses.isometry(i)).max(apart(&one_by_one[i]));
        assert!(worst < 1e-9, "{robot}, pose {i}: {worst} mm apart");
    }
}

/// A link of a robot file: what its joint turns by, and the constant `Trans(a, 0, d) Rot(x,α)` behind it.
struct Dh {
    offset: f64,
    sign: f64,
    behind: Isometry3<f64>,
}

/// A number of a standard DH link, all of which a table has.
fn number(stated: Option<f64>) -> f64 {
    stated.expect("a link in standard DH")
}

fn links(robot: &str) -> Vec<Dh> {
    let link = |joint: &JointFile| {
        let twist = UnitQuaternion::from_axis_angle(
            &Vector3::x_axis(),
            number(joint.alpha_deg).to_radians(),
        );
        Dh {
            offset: number(joint.offset_deg).to_radians(),
            sign: f64::from(joint.sign.expect("a sign")),
            behind: Isometry3::from_parts(
                Translation3::new(number(joint.a_mm), 0.0, number(joint.d_mm)),
                twist,
            ),
        }
    };
    file(robot).joint.iter().map(link).collect()
}

/// `Rot(z,θ) Trans(a, 0, d) Rot(x,α)` link by link, as one writes it with nalgebra.
fn product(links: &[Dh], q: &[f64]) -> Isometry3<f64> {
    let mut end = Isometry3::identity();
    for (link, q) in links.iter().zip(q) {
        let theta = link.sign * q + link.offset;
        end = end * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), theta) * link.behind;
    }
    end
}

fn file(robot: &str) -> RobotFile {
    let path = format!("{}/pipelines/robots/{robot}.toml", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(path).expect("part of the project");
    toml::from_str(&text).expect("a robot file")
}

fn arm(robot: &str) -> Arm {
    file(robot).arm().expect("an arm")
}

/// Angles within ±3 rad, without randomness.
fn columns() -> Vec<Vec<f64>> {
    let angle = |axis: usize, i: usize| 3.0 * ((i * 37 + axis * 101) as f64 * 0.618).sin();
    (0..6).map(|axis| (0..POSES).map(|i| angle(axis, i)).collect()).collect()
}

/// Seconds of the fastest round.
fn best(rounds: usize, mut round: impl FnMut()) -> f64 {
    (0..rounds)
        .map(|_| {
            let start = Instant::now();
            round();
            start.elapsed().as_secs_f64()
        })
        .fold(f64::INFINITY, f64::min)
}

fn row(way: &str, time: f64, base: f64) {
    let rate = POSES as f64 / time;
    println!("{way:<58} {rate:>14.0} {:>8.2}", base / time);
}
