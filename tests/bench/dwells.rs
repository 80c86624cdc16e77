//! Where log tables are not asked for: the log into dwells and readings, beside decompression, and its peak memory.

use std::fs;
use std::path::Path;

use posegrid::io::log::{Limits, SessionLogs, read_dwells};
use posegrid::join::JoinSettings;
use posegrid::progress::Quiet;

use super::{decompress, mapping, measure, peak_memory_mb, write_log};

/// Joint states between two arrivals, and those of them at rest: a move of 0.8 s, then 1.2 s of rest.
const PERIOD: u64 = 1000;
const MOVE: u64 = 400;

/// Streams a log of so many joint states into dwells, and one ten times as long if that is asked for.
pub fn measure_all(folder: &Path, joint_states: u64) {
    stream(folder, joint_states);
    if std::env::args().any(|arg| arg == "long") {
        stream(folder, 10 * joint_states);
    }
}

fn stream(folder: &Path, joint_states: u64) {
    let path = folder.join("dwells.mcap");
    write_log(&path, joint_states, motion);
    decompress(&path);
    let floor = measure("dwells: zstd decompression alone", None, || {
        decompress(&path)
    });
    // Begins the peak anew; where that is not allowed it is the peak of all that went before.
    fs::write("/proc/self/clear_refs", "5").unwrap_or_default();
    let before = peak_memory_mb();
    let (logs, rule) = (
        SessionLogs::of_two(&path, &path),
        JoinSettings::default().arm_rule(),
    );
    measure(
        "dwells: streaming into dwells and readings",
        Some(floor),
        || {
            let (recording, rest) =
                read_dwells(&logs, &mapping(), Limits::default(), &rule, &Quiet)
                    .expect("a sound log");
            assert_eq!(recording.counts["joints.kept"], joint_states);
            assert_eq!(rest.stretches.len() as u64, joint_states / PERIOD);
            rest.samples as u64
        },
    );
    println!(
        "dwells: {} messages, peak memory {} MB ({before} MB before)",
        joint_states + joint_states / 10,
        peak_memory_mb()
    );
}

/// Minimum jerk from station to station, 0.1 rad apart.
fn motion(i: u64) -> f64 {
    let (station, within) = (i / PERIOD, i % PERIOD);
    let share = within.min(MOVE) as f64 / MOVE as f64;
    let moved = share.powi(3) * (10.0 - 15.0 * share + 6.0 * share * share);
    (station as f64 + moved) * 0.1
}
