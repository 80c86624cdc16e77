//! Messages on stderr, results on stdout.
//!
//! A message that cannot be written is lost, and nothing else: whatever made it goes on. A result that cannot be written is
//! [`Undelivered`], which a command's exit code tells.

use std::env;
use std::fmt::{self, Display};
use std::io::{self, Write};

use clap::ValueEnum;
use tracing_subscriber::EnvFilter;
use tracing_subscriber::filter::{ParseError, filter_fn};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use super::progress::Bars;
use super::streams::{Stream, Undelivered};

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
    let asked = env::var(EnvFilter::DEFAULT_ENV).unwrap_or_default();
    let (filter, unread) = match filter(&asked) {
        Ok(filter) => (filter, None),
        Err(error) => (filter("").expect("nothing asked for"), Some(error)),
    };
    let ours = filter_fn(|message| message.target().starts_with("posegrid"));
    let bars = bars.clone();
    let messages = tracing_subscriber::fmt()
        .with_env_filter(filter)
        // It would tell of a message that cannot be written where none can be, and panic.
        .log_internal_errors(false)
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
    if let Some(error) = unread {
        tracing::warn!("RUST_LOG={asked:?} has no effect: {error}");
    }
}

/// Which messages a text asks for.
fn filter(asked: &str) -> Result<EnvFilter, ParseError> {
    EnvFilter::builder()
        .with_default_directive(tracing::level_filters::LevelFilter::INFO.into())
        .parse(asked)
}

/// Writes to stderr without tearing a progress bar; what stderr refuses is lost.
struct Beside(Bars);

impl Write for Beside {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // There is nowhere to tell it.
        let _ = self.0.write_aside(Stream::Messages, bytes);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Tells a result on stdout, its last line ended.
pub fn result(text: impl Display, bars: &Bars) -> Result<(), Undelivered> {
    let mut text = text.to_string();
    if !text.ends_with('\n') {
        text.push('\n');
    }
    deliver(text.as_bytes(), bars)
}

/// Writes a result to stdout as it is.
pub(super) fn deliver(result: &[u8], bars: &Bars) -> Result<(), Undelivered> {
    delivered(bars.write_aside(Stream::Results, result))
}

/// Whether what was written to stdout is there; a reader that has gone away wants to hear nothing of it.
pub(super) fn delivered(written: io::Result<()>) -> Result<(), Undelivered> {
    written.map_err(|error| {
        if error.kind() == io::ErrorKind::BrokenPipe {
            return Undelivered::ReaderGone;
        }
        tracing::error!(
            "cannot write the results to stdout: {error}; make room there, or send them elsewhere"
        );
        Undelivered::Refused
    })
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

    #[test]
    fn a_choice_of_messages_that_cannot_be_read_is_an_error_and_not_a_word_on_stderr() {
        assert!(filter("").is_ok() && filter("posegrid=debug").is_ok());
        assert!(filter("posegrid=loudly").is_err());
    }

    #[test]
    fn a_reader_that_left_is_not_told_and_a_refusal_is() {
        let refused = |kind: io::ErrorKind| delivered(Err(kind.into())).unwrap_err();
        let gone = refused(io::ErrorKind::BrokenPipe);
        assert_eq!((gone, gone.exit_code()), (Undelivered::ReaderGone, 0));
        let full = refused(io::ErrorKind::StorageFull);
        assert_eq!((full, full.exit_code()), (Undelivered::Refused, 1));
    }
}
