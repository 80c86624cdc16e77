//! Faults put into the real `posegrid run` from outside, by `strace`: killed at any system call, told by each that the disk is
//! full, asked by a signal to end, two at once, unheard as stdout or stderr refuses its words. After each of them:
//!
//! 1. no reader finds half a table: every file in the lake under its own name is whole, and every row of `runs` has all its
//!    files, with the digests that it states ([`lake::check`]);
//! 2. the exit code says what happened;
//! 3. the next run gives the lake of an undisturbed one, byte for byte, with nothing left over.
//!
//! A sample is among the tests; all of it is `cargo test --test run faults:: -- --ignored --nocapture`.

use crate::cell;
mod full_disk;
mod kills;
mod known;
mod lake;
mod signals;
mod strace;
mod two;
mod unwritable;

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use cell::{Cell, published};

/// What a run of the cell exits with when nothing is wrong: so few stations cannot show 95 %.
const UNDISTURBED: i32 = 3;

/// A cell with a small session; decoded samples are published too, as they are written in parts.
fn new() -> Cell {
    Cell::new()
        .with("lake = \"lake\"", "lake = \"lake\"\nlogs = true")
        .with_simulated("mon", &["--random", "12"])
}

/// Such a cell after an undisturbed run.
fn small() -> &'static Cell {
    static CELL: OnceLock<Cell> = OnceLock::new();
    CELL.get_or_init(|| {
        let cell = new();
        let ended = cell.run(&[]);
        ended.expect(UNDISTURBED, &["1 done, 0 done before"]);
        cell
    })
}

/// Where a fault is tried, with its own lake.
struct Trial {
    folder: tempfile::TempDir,
}

impl Trial {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { folder }
    }

    fn lake(&self) -> PathBuf {
        self.folder.path().join("lake")
    }

    /// Asserts that the lake is sound as it is, and that the next run makes of it what an undisturbed run made.
    fn recovers(&self, what: &str) {
        lake::check(&self.lake(), what);
        let again = small().run(&["--lake", text(&self.lake())]);
        assert_eq!(again.code, UNDISTURBED, "{what}: {}", again.messages);
        self.is_undisturbed(what);
    }

    /// Asserts that the lake is that of an undisturbed run.
    fn is_undisturbed(&self, what: &str) {
        lake::check(&self.lake(), what);
        let (found, expected) = (published(&self.lake()), small().lake());
        let names: Vec<_> = found.keys().collect();
        assert_eq!(names, expected.keys().collect::<Vec<_>>(), "{what}");
        let other = found.iter().find(|(path, bytes)| expected[*path] != **bytes);
        assert!(other.is_none(), "{what}: other bytes: {:?}", other.map(|(path, _)| path));
    }
}

fn text(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}
