//! Progress bars on a terminal, nothing elsewhere.

mod screen;

use std::io::{self, IsTerminal as _};
use std::sync::Mutex;

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::messages::LogFormat;
use super::streams::Stream;
use crate::progress::Progress;
use screen::Screen;

/// All progress bars of this process; messages and results are written while no bar is drawn.
#[derive(Debug, Clone)]
pub struct Bars(MultiProgress);

/// Bars of one session: one for each task that is under way.
#[derive(Debug)]
pub struct TerminalProgress {
    bars: Bars,
    session: String,
    /// Tasks under way, the innermost last.
    tasks: Mutex<Vec<ProgressBar>>,
}

/// Most redraws of a bar in a second.
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
        Self(MultiProgress::with_draw_target(target))
    }

    /// Writes to a stream while no bar is drawn. It takes bytes, not a function that makes them: a function that logged a
    /// message meanwhile would wait for itself.
    pub(super) fn write_aside(&self, to: Stream, bytes: &[u8]) -> io::Result<()> {
        self.0.suspend(|| to.write(bytes))
    }

    /// Bars of a session.
    pub fn of(&self, session: &str) -> TerminalProgress {
        TerminalProgress {
            bars: self.clone(),
            session: session.to_owned(),
            tasks: Mutex::new(Vec::new()),
        }
    }
}

impl TerminalProgress {
    fn with_tasks<T>(&self, change: impl FnOnce(&mut Vec<ProgressBar>) -> T) -> T {
        // A panic while drawing leaves the list as it was: it is still good.
        let mut tasks = match self.tasks.lock() {
            Ok(tasks) => tasks,
            Err(poisoned) => poisoned.into_inner(),
        };
        change(&mut tasks)
    }
}

impl Progress for TerminalProgress {
    fn begin(&self, task: &str, total: u64) {
        let style = ProgressStyle::with_template(TEMPLATE).expect("the template is ours");
        let bar = self.bars.0.add(ProgressBar::new(total).with_style(style));
        bar.set_prefix(self.session.clone());
        bar.set_message(task.to_owned());
        self.with_tasks(|tasks| tasks.push(bar));
    }

    fn advance(&self, steps: u64) {
        self.with_tasks(|tasks| {
            if let Some(bar) = tasks.last() {
                bar.inc(steps);
            }
        });
    }

    fn end(&self) {
        if let Some(bar) = self.with_tasks(Vec::pop) {
            bar.finish_and_clear();
        }
    }
}

impl Drop for TerminalProgress {
    /// Removes the bars of tasks that failed before their end.
    fn drop(&mut self) {
        self.with_tasks(|tasks| tasks.drain(..).for_each(|bar| bar.finish_and_clear()));
    }
}
