//! Messages on stderr, results on stdout. A message that cannot be written is lost; a result that cannot be written is
//! [`Undelivered`], which the exit code reports.

use std::env;
use std::fmt::{self, Display};
use std::io::{self, IsTerminal as _, Write};

use clap::ValueEnum;
use tracing_subscriber::filter::{LevelFilter, ParseError, Targets, filter_fn};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use super::progress::Bars;
use super::streams::{Stream, Undelivered};
use crate::files::store::without_secrets;

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For people: one line a message
    Text,
    /// For people: errors alone, and no progress bars
    #[value(skip)]
    Errors,
    /// For schedulers: one JSON object a message, with its time; no progress bars
    Json,
}

/// `RUST_LOG` selects among posegrid's own messages. Those of libraries are left out: an HTTP library may print
/// credentials.
pub fn start(format: LogFormat, bars: &Bars) {
    let asked = env::var("RUST_LOG").unwrap_or_default();
    let least = if format == LogFormat::Errors { LevelFilter::ERROR } else { LevelFilter::INFO };
    let (filter, unread) = match filter(&asked, least) {
        Ok(filter) => (filter, None),
        Err(error) => (filter("", least).expect("nothing asked for"), Some(error)),
    };
    let ours = filter_fn(|message| message.target().starts_with("posegrid"));
    let bars = bars.clone();
    let messages = tracing_subscriber::fmt()
        .with_max_level(LevelFilter::TRACE)
        // Otherwise it would report the failed write to the stderr that failed, and panic.
        .log_internal_errors(false)
        .with_writer(move || Beside(bars.clone()));
    match format {
        LogFormat::Text | LogFormat::Errors => messages
            .without_time()
            .with_target(false)
            .with_ansi(io::stderr().is_terminal() && !is_plain())
            .finish()
            .with(filter)
            .with(ours)
            .init(),
        LogFormat::Json => messages.json().finish().with(filter).with(ours).init(),
    }
    if let Some(error) = unread {
        tracing::warn!("RUST_LOG={asked:?} has no effect: {error}");
    }
}

fn filter(asked: &str, least: LevelFilter) -> Result<Targets, ParseError> {
    match asked.trim().trim_matches(',') {
        "" => Ok(Targets::new().with_default(least)),
        directives => directives.parse(),
    }
}

/// Whether colours are not wanted: <https://no-color.org>.
fn is_plain() -> bool {
    env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty())
}

/// Writes to stderr without tearing a progress bar; what stderr refuses is lost.
struct Beside(Bars);

impl Write for Beside {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let shown = str::from_utf8(bytes).ok().map(|text| {
            let escaped =
                |c: char| if is_unseen(c) { c.escape_default().to_string() } else { c.into() };
            without_secrets(text).chars().map(escaped).collect::<String>()
        });
        let shown = shown.as_deref().map_or(bytes, str::as_bytes);
        // A failure has nowhere to be reported.
        let _ = self.0.write_aside(Stream::Messages, shown);
        Ok(bytes.len())
    }
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Writes a result to stdout and ends its last line.
pub fn result(text: impl Display, bars: &Bars) -> Result<(), Undelivered> {
    let mut text = without_secrets(&text.to_string()).into_owned();
    if !text.ends_with('\n') {
        text.push('\n');
    }
    deliver(text.as_bytes(), bars)
}

/// Writes a result likewise, for a command that ends with it; gives its exit code, `code` where all of it was written.
pub(super) fn last_result(text: impl Display, code: u8, bars: &Bars) -> u8 {
    result(text, bars).map_or_else(Undelivered::exit_code, |()| code)
}

pub(super) fn deliver(result: &[u8], bars: &Bars) -> Result<(), Undelivered> {
    // A program reads what is there; a terminal would act on it.
    let shown = str::from_utf8(result).ok().filter(|_| io::stdout().is_terminal());
    let shown = shown.map(|text| {
        let lines: Vec<String> = text.split('\n').map(|line| Printable(line).to_string()).collect();
        lines.join("\n").into_bytes()
    });
    let result = shown.as_deref().unwrap_or(result);
    delivered(bars.write_aside(Stream::Results, result))
}

/// The outcome of a write to stdout; a reader that has gone away gets no message.
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

/// A text that may hold names from a log, printed with every character escaped that a terminal would act on, and without
/// credentials in addresses of storage.
pub struct Printable<'a>(pub &'a str);

impl Display for Printable<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_acted_on = |c: char| c.is_control() || is_unseen(c);
        without_secrets(self.0).chars().try_for_each(|c| {
            if is_acted_on(c) { write!(f, "{}", c.escape_default()) } else { write!(f, "{c}") }
        })
    }
}

/// Whether a character turns the direction of the text, or is not seen.
const fn is_unseen(c: char) -> bool {
    matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
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
    fn what_turns_the_text_or_is_secret_is_not_printed() {
        assert_eq!(Printable("a\u{202e}b").to_string(), "a\\u{202e}b");
        let told = Printable("cannot list s3://KEY:SEC/RET@bucket/a: no; s3://other/b").to_string();
        assert_eq!(told, "cannot list s3://…@bucket/a: no; s3://other/b");
    }

    #[test]
    fn a_message_filter_that_cannot_be_read_is_an_error_and_prints_nothing() {
        let read = |asked| filter(asked, LevelFilter::INFO);
        assert!(read("").is_ok() && read("posegrid=debug").is_ok());
        assert!(read("posegrid=loudly").is_err());
    }

    #[test]
    fn a_refused_write_is_reported_and_a_reader_that_left_is_not() {
        let refused = |kind: io::ErrorKind| delivered(Err(kind.into())).unwrap_err();
        let gone = refused(io::ErrorKind::BrokenPipe);
        assert_eq!((gone, gone.exit_code()), (Undelivered::ReaderGone, 0));
        let full = refused(io::ErrorKind::StorageFull);
        assert_eq!((full, full.exit_code()), (Undelivered::Refused, 1));
    }
}
