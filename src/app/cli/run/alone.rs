//! Takes the lake's lock for a batch: at once, after the other batch, or not at all.

use std::thread::sleep;
use std::time::Duration;

use super::stop::Stop;
use crate::cli::messages::Printable;
use crate::io::lake::{Holder, Lake, Lock, Locking};
use crate::units::span;

/// Time between two looks of a waiting batch: short compared with any batch, and no load on the machine.
const LOOK_AGAIN: Duration = Duration::from_millis(250);

#[derive(Debug)]
pub enum Turn {
    /// Ours: with the lock, where the file system gives one.
    Ours(Option<Lock>),
    /// Another batch's, or nobody's because an end was asked for; the reason was logged.
    NotOurs,
}

/// Locks the lake, after the batch that has it if `wait` says so.
pub fn turn(lake: &Lake, by: &str, wait: bool, stop: &Stop) -> Turn {
    let mut is_reported = false;
    loop {
        let holder = match lake.lock(by) {
            Locking::Done(lock) => return Turn::Ours(Some(lock)),
            Locking::Held(holder) => holder,
            Locking::NoFolder => return Turn::Ours(None),
            Locking::Refused(error) => {
                tracing::warn!(
                    "{error}; going on without a lock: the lake stays sound, but another batch at the same time would do \
                     the same work"
                );
                return Turn::Ours(None);
            }
        };
        if stop.asked() {
            tracing::warn!("ended by {} while waiting for the lake", stop.name());
            return Turn::NotOurs;
        }
        if !wait {
            tracing::error!(
                "{}; nothing was done. Run again when it has ended, or with --wait",
                held(&holder)
            );
            return Turn::NotOurs;
        }
        if !is_reported {
            tracing::info!("{}; waiting for its end", held(&holder));
            is_reported = true;
        }
        sleep(LOOK_AGAIN);
    }
}

fn held(holder: &Holder) -> String {
    let who = match holder.words.as_str() {
        "" => "a process that has not stated its name",
        words => words,
    };
    let since = holder.age.map_or_else(String::new, |age| format!("; for {}", span(age)));
    let (who, path) = (Printable(who), holder.path.display());
    format!("another batch works on this lake: {who}{since} (it locks {path})")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_holder_is_reported_whatever_it_says() {
        let holder = |words: &str| Holder {
            path: "lake/.lock".into(),
            words: words.to_owned(),
            age: Some(Duration::from_secs(125)),
        };
        assert_eq!(
            held(&holder("process 7 on host a: run b\u{1b}.toml")),
            "another batch works on this lake: process 7 on host a: run b\\u{1b}.toml; for 2 min (it locks lake/.lock)"
        );
        assert!(held(&holder("")).contains("has not stated its name"));
    }
}
