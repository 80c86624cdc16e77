//! Time and memory that work took, from which what is listed learns how much it may take.

use std::fs;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::files_of;
use crate::figures::median;
use crate::pipeline::fleet::FleetPiece;

/// Seconds that a session to learn from takes beside the reading of its files, about, where a lake has no run yet.
const SECONDS_A_SESSION: f64 = 30.0;
/// Megabytes of files that are read in a second, about.
const MEGABYTES_A_SECOND: f64 = 30.0;
/// Megabytes of memory that work takes whatever its sessions are, and for each session to learn from, about, likewise.
const MEGABYTES: [f64; 2] = [400.0, 200.0];

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Size {
    /// Sessions to learn from.
    sessions: usize,
    /// Size of all files, bytes; those whose size is not known count nothing.
    pub bytes: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Took {
    of: Size,
    seconds: f64,
    /// Most memory that the process had until then; `None` where the system does not tell.
    megabytes: Option<f64>,
}

/// Time and memory that work may take.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expected {
    pub seconds: f64,
    pub megabytes: f64,
}

impl Size {
    pub fn of(FleetPiece { configuration, piece, .. }: FleetPiece<'_>) -> Self {
        let sessions = piece.training.iter().chain(&piece.test);
        let size = |path| configuration.tree.size(path).unwrap_or(0);
        let bytes = sessions.flat_map(files_of).map(|path| size(path)).sum();
        Self { sessions: piece.training.len(), bytes }
    }

    fn by_rule(self) -> Expected {
        let sessions = self.sessions as f64;
        Expected {
            seconds: SECONDS_A_SESSION * sessions + self.bytes as f64 * 1e-6 / MEGABYTES_A_SECOND,
            megabytes: MEGABYTES[0] + MEGABYTES[1] * sessions,
        }
    }

    /// What work of this size may take, where other work `took` so much: the usual share of what the rule says, and of memory the
    /// largest, as too little of it ends a task.
    pub fn expected(self, took: &[Took]) -> Expected {
        let rule = self.by_rule();
        let shares = took.iter().map(|own| own.seconds / own.of.by_rule().seconds);
        let memory =
            took.iter().filter_map(|own| Some(own.megabytes? / own.of.by_rule().megabytes));
        Expected {
            seconds: rule.seconds * median(&shares.collect::<Vec<_>>()).unwrap_or(1.0),
            megabytes: rule.megabytes * memory.reduce(f64::max).unwrap_or(1.0),
        }
    }
}

impl Took {
    pub fn since(begun: Instant, of: Size) -> Self {
        Self { of, seconds: begun.elapsed().as_secs_f64(), megabytes: peak_megabytes() }
    }
}

/// The most memory that this process had; `None` where the system does not tell.
fn peak_megabytes() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: f64 = peak.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kibibytes * 1024.0 * 1e-6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_work_may_take_follows_from_what_other_work_took() {
        let night = Size { sessions: 1, bytes: 3_000_000 };
        // 30 s of a session, and 0.1 s for 3 MB; 400 MB and 200 MB.
        assert_eq!(night.expected(&[]), Expected { seconds: 30.1, megabytes: 600.0 });
        let took = |seconds, megabytes| Took { of: night, seconds, megabytes };
        let took = [took(0.4, Some(93.0)), took(0.5, None), took(9.0, Some(90.0))];
        let found = night.expected(&took);
        assert!((found.seconds - 0.5).abs() < 1e-9, "the middle one: {found:?}");
        assert!((found.megabytes - 93.0).abs() < 1e-9, "the largest: {found:?}");
        // Of a pool of four in proportion: 120.4 s of 30.1 s, 1200 MB of 600 MB.
        let pool = Size { sessions: 4, bytes: 12_000_000 }.expected(&took);
        assert!((pool.seconds - 2.0).abs() < 1e-9 && (pool.megabytes - 186.0).abs() < 1e-9);
    }
}
