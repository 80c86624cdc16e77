//! SIGINT and SIGTERM: the first one asks for an end, the second one ends the process.

use std::io;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;

use crate::progress::{Progress, Stopped};

#[derive(Debug, Clone, Default)]
pub struct Stop {
    /// 0 for none yet.
    signal: Arc<AtomicUsize>,
}

/// The exit code of a process that a signal ended is this plus the signal's number, by the shells' convention.
const BY_SIGNAL: u8 = 128;

impl Stop {
    /// Listens from now on. After the first signal the next one has its usual effect, which ends the process at once.
    pub(super) fn on_signals() -> io::Result<Self> {
        let stop = Self::default();
        let asked = Arc::new(AtomicBool::new(false));
        for signal in [SIGINT, SIGTERM] {
            // Handlers run in the order of registration: at the first signal no end was asked for yet.
            flag::register_conditional_default(signal, Arc::clone(&asked))?;
            flag::register(signal, Arc::clone(&asked))?;
            let number = usize::try_from(signal).expect("signals have small positive numbers");
            flag::register_usize(signal, Arc::clone(&stop.signal), number)?;
        }
        Ok(stop)
    }

    pub fn asked(&self) -> bool {
        self.signal.load(Ordering::Relaxed) != 0
    }

    pub fn name(&self) -> &'static str {
        const INTERRUPT: usize = SIGINT as usize;
        match self.signal.load(Ordering::Relaxed) {
            0 => "nothing",
            INTERRUPT => "SIGINT",
            _ => "SIGTERM",
        }
    }

    /// The exit code for the signal, 130 or 143; `None` without one.
    pub fn exit_code(&self) -> Option<u8> {
        let signal = u8::try_from(self.signal.load(Ordering::Relaxed)).unwrap_or(0);
        (signal != 0).then_some(BY_SIGNAL + signal)
    }
}

/// Progress that ends its task when an end is asked for: see [`Progress`].
#[derive(Debug)]
pub struct Stoppable<'a, P> {
    pub progress: &'a P,
    pub stop: &'a Stop,
}

impl<P: Progress> Stoppable<'_, P> {
    fn check(&self) {
        if self.stop.asked() {
            panic::resume_unwind(Box::new(Stopped));
        }
    }
}

impl<P: Progress> Progress for Stoppable<'_, P> {
    fn begin(&self, task: &str, total: u64) {
        self.check();
        self.progress.begin(task, total);
    }

    fn advance(&self, steps: u64) {
        self.check();
        self.progress.advance(steps);
    }

    fn end(&self) {
        self.progress.end();
        self.check();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::progress::Quiet;

    #[test]
    fn a_task_ends_at_its_next_step_once_an_end_is_asked_for() {
        let stop = Stop::default();
        let progress = Stoppable { progress: &Quiet, stop: &stop };
        progress.begin("fit", 2);
        assert_eq!((stop.asked(), stop.exit_code()), (false, None));
        stop.signal.store(usize::try_from(SIGTERM).unwrap(), Ordering::Relaxed);
        assert_eq!((stop.name(), stop.exit_code()), ("SIGTERM", Some(143)));
        let ended = panic::catch_unwind(panic::AssertUnwindSafe(|| progress.advance(1)));
        assert!(ended.unwrap_err().is::<Stopped>());
    }
}
