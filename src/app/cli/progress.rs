//! Progress: bars on a terminal, elsewhere a message every ten seconds of a long task.

mod screen;

use std::io::{self, IsTerminal as _};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::messages::{LogFormat, Printable};
use super::streams::Stream;
use crate::progress::Progress;
use crate::units::span;
use screen::Screen;

/// All progress bars of this process; messages and results are written while no bar is drawn.
#[derive(Debug, Clone)]
pub struct Bars {
    drawn: MultiProgress,
    /// Whether they are seen; messages take their place otherwise.
    are_seen: bool,
}

/// Bars of one session: one for each task that is under way.
#[derive(Debug)]
pub struct TerminalProgress {
    bars: Bars,
    session: String,
    /// Tasks under way, the innermost last.
    tasks: Mutex<Vec<Task>>,
}

#[derive(Debug)]
struct Task {
    bar: ProgressBar,
    name: String,
    total: u64,
    done: u64,
    begun: Instant,
    told: Instant,
}

/// Time between two messages of a task where no bar is seen.
const TELL_EVERY: Duration = Duration::from_secs(10);

const DRAWN_HZ: u8 = 20;
/// The work done, its rate and the remaining time.
const TEMPLATE: &str =
    "{prefix} {msg:24} {bar:30} {human_pos}/{human_len} {per_sec} {eta} remaining";

impl Bars {
    /// Bars on stderr where it is a terminal and messages are for people.
    pub fn new(format: LogFormat) -> Self {
        let is_drawn = format == LogFormat::Text && io::stderr().is_terminal();
        let target = if is_drawn {
            ProgressDrawTarget::term_like_with_hz(Box::new(Screen::new()), DRAWN_HZ)
        } else {
            ProgressDrawTarget::hidden()
        };
        Self { drawn: MultiProgress::with_draw_target(target), are_seen: is_drawn }
    }

    /// Whether one person reads messages and results on one screen.
    pub(super) fn show_results(&self) -> bool {
        self.are_seen && io::stdout().is_terminal()
    }

    /// It takes bytes, not a function that makes them: one that logged a message meanwhile would wait for itself.
    pub(super) fn write_aside(&self, to: Stream, bytes: &[u8]) -> io::Result<()> {
        self.drawn.suspend(|| to.write(bytes))
    }

    pub fn of(&self, session: &str) -> TerminalProgress {
        TerminalProgress {
            bars: self.clone(),
            session: session.to_owned(),
            tasks: Mutex::default(),
        }
    }
}

impl TerminalProgress {
    fn with_tasks<T>(&self, change: impl FnOnce(&mut Vec<Task>) -> T) -> T {
        // A panic while drawing leaves the list as it was: it is still good.
        let mut tasks = self.tasks.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut tasks)
    }
}

impl Progress for TerminalProgress {
    fn begin(&self, task: &str, total: u64) {
        let style = ProgressStyle::with_template(TEMPLATE).expect("the template is ours");
        let bar = self.bars.drawn.add(ProgressBar::new(total).with_style(style));
        bar.set_prefix(self.session.clone());
        bar.set_message(task.to_owned());
        let now = Instant::now();
        let task = Task { bar, name: task.to_owned(), total, done: 0, begun: now, told: now };
        self.with_tasks(|tasks| tasks.push(task));
    }

    fn advance(&self, steps: u64) {
        let words = self.with_tasks(|tasks| {
            let task = tasks.last_mut()?;
            task.bar.inc(steps);
            task.done += steps;
            let is_long = task.done < task.total && task.told.elapsed() >= TELL_EVERY;
            (is_long && !self.bars.are_seen).then(|| task.told())
        });
        if let Some(words) = words {
            tracing::info!(session = Printable(&self.session).to_string(), "{words}");
        }
    }

    fn end(&self) {
        if let Some(Task { bar, name, done, begun, .. }) = self.with_tasks(Vec::pop) {
            bar.finish_and_clear();
            let took_s = begun.elapsed().as_secs_f64();
            let session = Printable(&self.session).to_string();
            tracing::debug!(session, "{name}: {done} in {took_s:.2} s");
        }
    }
}

impl Task {
    /// The work done, its rate and the remaining time, in words; notes when they were asked for.
    fn told(&mut self) -> String {
        self.told = Instant::now();
        in_words(&self.name, self.done, self.total, self.told - self.begun)
    }
}

/// `fold 3 of 12, 0.2 a second, 45 s remaining`.
fn in_words(task: &str, done: u64, total: u64, took: Duration) -> String {
    let rate = done as f64 / took.as_secs_f64().max(f64::MIN_POSITIVE);
    let left = total.saturating_sub(done) as f64 / rate.max(f64::MIN_POSITIVE);
    let left = Duration::try_from_secs_f64(left).map_or_else(|_| "long".to_owned(), span);
    format!("{task}: {done} of {total}, {rate:.3} a second, {left} remaining")
}

impl Drop for TerminalProgress {
    /// Removes the bars of tasks that failed before their end.
    fn drop(&mut self) {
        self.with_tasks(|tasks| tasks.drain(..).for_each(|task| task.bar.finish_and_clear()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_states_work_rate_and_remaining_time() {
        let words = in_words("robots", 30, 60, Duration::from_mins(1));
        assert_eq!(
            words,
            format!("robots: 30 of 60, 0.500 a second, {} remaining", span(Duration::from_mins(1)))
        );
        let nothing = in_words("robots", 0, 60, Duration::from_secs(10));
        assert!(nothing.contains("0 of 60") && nothing.ends_with("long remaining"), "{nothing}");
    }

    #[test]
    fn a_message_is_due_only_where_no_bar_is_seen_and_time_has_passed() {
        let progress = Bars::new(LogFormat::Json).of("monday");
        assert!(!progress.bars.are_seen);
        progress.begin("folds", 3);
        progress.advance(1);
        let told = progress.with_tasks(|tasks| {
            let task = tasks.last_mut().unwrap();
            (task.done, task.told == task.begun)
        });
        assert_eq!(told, (1, true), "nothing is told at once");
        progress.with_tasks(|tasks| {
            let task = tasks.last_mut().unwrap();
            task.told = task.told.checked_sub(TELL_EVERY).unwrap();
        });
        progress.advance(1);
        let told = progress.with_tasks(|tasks| tasks.last_mut().unwrap().told);
        assert!(told.elapsed() < TELL_EVERY, "it was told anew");
        progress.end();
    }
}
