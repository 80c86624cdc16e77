//! What a pool costs: training on all its sessions, and the memory that it takes.
//!
//! `cargo bench --bench pools` trains the full error model on 1, 10, 30 and 100 sessions of 600 stations of one simulated UR10, and prints
//! wall time and the most memory that the process held so far. Without `--bench` (as `cargo test` calls it) small pools show that it works.

#[path = "../common/mod.rs"]
mod common;

use std::time::Instant;

use common::pool::{MeasuredArm, Truth, frames, trained};
use posegrid::fit::Observation;
use posegrid::fit::full::FullSettings;

const TRUTH: Truth = Truth { curve_rad: 2e-4, walk_rad: 0.0, own_rad: 1e-5, days: 1.0 / 24.0 };

fn main() {
    let full_size = std::env::args().any(|arg| arg == "--bench");
    let (pools, stations) = if full_size { (vec![1, 10, 30, 100], 600) } else { (vec![2, 4], 20) };
    let harmonics = if full_size { 90 } else { 4 };
    let settings = FullSettings { harmonics, ..FullSettings::default() };
    println!("sessions  stations   columns  training s  peak MB");
    for sessions in pools {
        let mut measured = MeasuredArm::new(TRUTH, 7);
        let seen: Vec<Observation> =
            (0..sessions).flat_map(|_| measured.session(stations)).collect();
        let start = frames(&measured.arm, &seen[..stations]);
        let arm = measured.arm.clone();
        let began = Instant::now();
        let model = trained(&arm, &seen, &start, &settings);
        let training_s = began.elapsed().as_secs_f64();
        let (columns, count) = (model.trained.layout.size(), seen.len());
        let peak = peak_mb();
        println!("{sessions:>8} {count:>9} {columns:>9} {training_s:>11.2} {peak:>8.0}");
    }
}

/// Most memory that this process has held, MB; 0 where the system does not tell.
fn peak_mb() -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mut lines = status.lines();
    let peak = lines.find_map(|line| line.strip_prefix("VmHWM:"));
    let kilobytes = peak.and_then(|peak| peak.trim().split(' ').next()?.parse::<f64>().ok());
    kilobytes.unwrap_or(0.0) / 1024.0
}
