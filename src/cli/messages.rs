//! Messages on stderr, results on stdout.

use std::fmt::{self, Display};
use std::io::{self, Write};

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::filter_fn;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use super::progress::Bars;

/// How messages are written on stderr.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For people: one line a message
    Text,
    /// For schedulers: one JSON object a message, with its time; no progress bars
    Json,
}

/// Starts the messages of this process; `RUST_LOG` chooses among our own. Those of libraries are left out: what speaks HTTP
/// may tell headers, and with them credentials.
pub fn start(format: LogFormat, bars: &Bars) {
    let filter = EnvFilter::builder()
        .with_default_directive(tracing::level_filters::LevelFilter::INFO.into())
        .from_env_lossy();
    let ours = filter_fn(|message| message.target().starts_with("posegrid"));
    let bars = bars.clone();
    let messages = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(move || Beside(bars.clone()));
    match format {
        LogFormat::Text => messages
            .without_time()
            .with_target(false)
            .with_ansi(io::IsTerminal::is_terminal(&io::stderr()))
            .finish()
            .with(ours)
            .init(),
        LogFormat::Json => messages.json().finish().with(ours).init(),
    }
}

/// Writes to stderr without tearing a progress bar.
struct Beside(Bars);

impl Write for Beside {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.aside(|| io::stderr().write(bytes))
    }
    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// Writes a result to stdout; a reader that has gone away wants no more of it.
pub fn result(text: impl Display) {
    let text = text.to_string();
    let mut out = io::stdout().lock();
    let ended = if text.ends_with('\n') { "" } else { "\n" };
    let written = write!(out, "{text}{ended}").and_then(|()| out.flush());
    if let Err(error) = written
        && error.kind() != io::ErrorKind::BrokenPipe
    {
        tracing::error!("cannot write the result to stdout: {error}");
    }
}

/// A text that may hold names from a log or a file system, with nothing in it that a terminal would act on.
pub struct Printable<'a>(pub &'a str);

impl Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.chars().try_for_each(|c| {
            if c.is_control() {
                write!(f, "{}", c.escape_default())
            } else {
                write!(f, "{c}")
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_cannot_move_the_cursor() {
        assert_eq!(
            Printable("a\u{1b}[2Jb\r°").to_string(),
            "a\\u{1b}[2Jb\\r°",
            "escape and return are written out, other letters stay"
        );
    }
}
