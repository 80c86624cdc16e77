//! Whether a log is still being written: it has no end, and changed lately.
//!
//! Only this file reads the clock, and it decides only whether there is work now: nothing published depends on it.

use std::fs;
use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::io::log::{Limits, has_no_end};
use crate::units::span;

/// Why to wait for the log at `path`, as text; `None` where it is whole, has not changed for `settle`, or cannot be read:
/// then its run reports the error.
pub(super) fn growing(path: &Path, settle: Duration, limits: Limits) -> Option<String> {
    let changed = fs::metadata(path).and_then(|metadata| metadata.modified());
    let age = age(changed.ok()?, SystemTime::now(), settle)?;
    if age >= settle || !has_no_end(path, limits).ok()? {
        return None;
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Some(format!(
        "{name} has no end and changed {} ago; once it has not changed for {}, it is read as it is",
        span(age),
        span(settle)
    ))
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
        assert!(
            told.starts_with("arm.mcap has no end and changed 0 s ago"),
            "{told}"
        );
        fs::write(&path, [mcap::MAGIC, mcap::MAGIC].concat()).unwrap();
        assert_eq!(growing(), None);
        fs::write(&path, mcap::MAGIC).unwrap();
        let file = fs::File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - settle).unwrap();
        assert_eq!(growing(), None, "damaged");
    }
}
