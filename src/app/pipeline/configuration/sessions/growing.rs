//! Whether a log or a table is still being written: it has no end, and changed lately.
//!
//! Only this file reads the clock, and it decides only whether there is work now: nothing published depends on it.

use std::fs::{self, File};
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::io::log::{Limits, has_no_end};
use crate::units::span;

/// Bytes at the end of a table that its last two lines are looked for in.
const TAIL: u64 = 1 << 16;
/// Extensions of tables that are lines of cells; the others have an end without which they cannot be read.
const LINES: [&str; 4] = ["csv", "tsv", "tab", "txt"];

/// Why to wait for the log at `path`, as text; `None` where it is whole, has not changed for `settle`, or cannot be read:
/// then its run reports the error.
pub(super) fn growing(path: &Path, settle: Duration, limits: Limits) -> Option<String> {
    let age = lately(path, settle)?;
    has_no_end(path, limits).ok()?.then(|| wait(path, "has no end", age, settle))
}

/// Why to wait for the table at `path`, as text; `None` as of a log. A table of lines has an end where its last line is terminated, or
/// has as many cells as the one before.
pub(super) fn growing_table(path: &Path, settle: Duration) -> Option<String> {
    let age = lately(path, settle)?;
    let extension = path.extension()?.to_string_lossy().to_lowercase();
    let is_cut = LINES.contains(&extension.as_str()) && is_cut(&tail(path)?);
    is_cut.then(|| wait(path, "ends within a row", age, settle))
}

/// The time since a file changed; `None` where that is `settle` ago or more, or not known.
fn lately(path: &Path, settle: Duration) -> Option<Duration> {
    let changed = fs::metadata(path).and_then(|metadata| metadata.modified());
    age(changed.ok()?, SystemTime::now(), settle).filter(|age| *age < settle)
}

fn wait(path: &Path, found: &str, age: Duration, settle: Duration) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    format!(
        "{name} {found} and changed {} ago; once it has not changed for {}, it is read as it is",
        span(age),
        span(settle)
    )
}

/// The last bytes of a file; `None` where it cannot be read.
fn tail(path: &Path) -> Option<Vec<u8>> {
    let mut file = File::open(path).ok()?;
    let size = file.metadata().ok()?.len();
    file.seek(SeekFrom::Start(size.saturating_sub(TAIL))).ok()?;
    let mut bytes = Vec::new();
    file.take(TAIL).read_to_end(&mut bytes).ok()?;
    Some(bytes)
}

/// Whether the last line is not terminated and has fewer cells than the line before.
fn is_cut(bytes: &[u8]) -> bool {
    // A character of UTF-16 ends with the other half of its two bytes.
    let mut lines = bytes.strip_suffix(b"\0").unwrap_or(bytes).rsplit(|byte| *byte == b'\n');
    let (Some(last), Some(before)) = (lines.next(), lines.next()) else { return false };
    let cells = |line: &[u8], sign: u8| line.split(|byte| *byte == sign).count();
    let separator = [b'\t', b';', b','].into_iter().find(|sign| before.contains(sign));
    separator.is_some_and(|sign| !last.is_empty() && cells(last, sign) < cells(before, sign))
}

/// The time since a change. Clocks of two machines differ a little; a time far in the future is not used.
fn age(changed: SystemTime, now: SystemTime, settle: Duration) -> Option<Duration> {
    match now.duration_since(changed) {
        Ok(age) => Some(age),
        Err(ahead) => (ahead.duration() <= settle).then_some(Duration::ZERO),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_from_the_near_future_is_new_and_one_from_far_away_has_no_age() {
        let (now, settle) = (SystemTime::now(), Duration::from_mins(10));
        let second = Duration::from_secs(1);
        assert_eq!(age(now - second, now, settle), Some(second));
        assert_eq!(age(now + settle, now, settle), Some(Duration::ZERO));
        assert_eq!(age(now + settle + second, now, settle), None);
    }

    #[test]
    fn a_log_waits_until_it_has_an_end_or_was_still_for_long() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("arm.mcap");
        let settle = Duration::from_mins(10);
        let growing = || growing(&path, settle, Limits::default());
        fs::write(&path, mcap::MAGIC).unwrap();
        let told = growing().unwrap();
        assert!(told.starts_with("arm.mcap has no end and changed 0 s ago"), "{told}");
        fs::write(&path, [mcap::MAGIC, mcap::MAGIC].concat()).unwrap();
        assert_eq!(growing(), None);
        fs::write(&path, mcap::MAGIC).unwrap();
        let file = fs::File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - settle).unwrap();
        assert_eq!(growing(), None, "damaged");
    }

    #[test]
    fn a_table_that_ends_within_a_row_waits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("measured.csv");
        let settle = Duration::from_mins(10);
        let growing = |text: &str| {
            fs::write(&path, text).unwrap();
            growing_table(&path, settle)
        };
        let told = growing("q1;x;y\n1,5;2,5;3,5\n1,5;2").unwrap();
        assert!(told.starts_with("measured.csv ends within a row and changed 0 s ago"), "{told}");
        // Terminated, however few its cells are, or whole without an end of the line.
        for text in ["q1;x\n1;2\n1\n", "q1;x\n1;2\n1;2", "q1;x\n1,5;2,5\n1;2", "q1", ""] {
            assert_eq!(growing(text), None, "{text:?}");
        }
        fs::write(&path, "q1,x\n1,2\n1").unwrap();
        let file = File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - settle).unwrap();
        assert_eq!(growing_table(&path, settle), None, "a short row");
    }
}
