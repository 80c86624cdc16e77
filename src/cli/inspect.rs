//! `posegrid inspect LOG…`: what is in a log, what is wrong with it, and a pipeline snippet that would read it.
//!
//! Names come from the file, so they are escaped before they are printed.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;

use crate::ingest::LogReject;
use crate::io::inspect::{ChannelSummary, ClockSummary, Inspection, inspect};
use crate::io::log::{Layout, Limits};
use crate::progress::Progress;

/// Rejects of one log that are printed.
const MOST_PRINTED: usize = 20;

/// Show what is in MCAP logs, and how a pipeline file would read them.
#[derive(Debug, Clone, Args)]
#[command(after_help = "\
Example:
  posegrid inspect controller.mcap tracker.mcap

Exit codes: 0 every log is sound; 3 some log is damaged; 1 some file cannot be read as a log.")]
pub struct InspectArgs {
    /// The logs.
    #[arg(required = true, value_name = "LOG")]
    pub logs: Vec<PathBuf>,
}

/// Inspects each log; prints to stdout, errors to stderr. Exit code 0: all sound, 3: some damaged, 1: some unreadable.
pub fn run(args: &InspectArgs, progress: &dyn Progress) -> ExitCode {
    let mut sound = Vec::new();
    let mut unreadable = false;
    for path in &args.logs {
        match inspect(path, Limits::default(), progress) {
            Ok(found) => {
                println!("{}", describe(&found));
                sound.push(found);
            }
            Err(error) => {
                eprintln!("error: {error}");
                unreadable = true;
            }
        }
    }
    if let Some(snippet) = snippet(&sound) {
        println!(
            "A pipeline file would read this with (units are a guess from ROS custom, check them):\n\n{snippet}"
        );
    }
    if unreadable {
        ExitCode::FAILURE
    } else if sound.iter().any(|found| !found.account.rejects.is_empty()) {
        ExitCode::from(3)
    } else {
        ExitCode::SUCCESS
    }
}

/// One log in words.
pub fn describe(found: &Inspection) -> String {
    let account = &found.account;
    let mut text = String::new();
    let mut line = |line: String| text.push_str(&(line + "\n"));
    line(format!(
        "{}  {:.1} MB, {} messages",
        escaped(&account.file),
        account.bytes as f64 / 1e6,
        account.messages
    ));
    line(format!(
        "  profile {:?}, written by {:?}",
        escaped(&account.profile),
        escaped(&account.library)
    ));
    line(format!("  {}", storage(found)));
    for (name, key, value) in &account.metadata {
        line(format!(
            "  metadata {}.{} = {}",
            escaped(name),
            escaped(key),
            escaped(value)
        ));
    }
    for channel in &found.channels {
        line(describe_channel(channel));
    }
    line(describe_damage(&account.rejects));
    text
}

fn storage(found: &Inspection) -> String {
    let account = &found.account;
    let mut parts: Vec<_> = account
        .chunks
        .iter()
        .map(|(compression, count)| match compression.as_str() {
            "" => format!("{count} uncompressed chunks"),
            name => format!("{count} chunks in {}", escaped(name)),
        })
        .collect();
    if account.messages_outside_chunks > 0 {
        parts.push(format!(
            "{} messages outside chunks",
            account.messages_outside_chunks
        ));
    }
    if account.chunks_unchecked > 0 {
        parts.push(format!(
            "{} chunks without a checksum",
            account.chunks_unchecked
        ));
    }
    if parts.is_empty() {
        "no readable chunk or message".to_owned()
    } else {
        parts.join(", ")
    }
}

fn describe_channel(channel: &ChannelSummary) -> String {
    let mut text = format!("\n  {}\n", escaped(&channel.topic));
    let mut line = |line: String| text.extend(["    ", line.as_str(), "\n"]);
    line(format!(
        "{} ({}, schema in {})",
        or_none(&channel.type_name),
        or_none(&channel.encoding),
        or_none(&channel.schema_encoding)
    ));
    if channel.messages == 0 {
        line("no messages".to_owned());
        return text;
    }
    let rate = channel
        .log
        .rate_hz()
        .map_or_else(String::new, |rate| format!(", {rate:.2} Hz"));
    line(format!(
        "{} messages over {:.3} s{rate}",
        channel.messages,
        channel.log.span_s()
    ));
    for (name, clock) in [
        ("header", &channel.header),
        ("publish", &channel.publish),
        ("log", &channel.log),
    ] {
        if clock.count > 0 {
            line(describe_clock(name, clock));
        }
    }
    if let Some((least, most)) = channel.log_less_header_ns {
        line(compare_clocks(least, most));
    }
    if channel.last_sequence > 0 {
        line(format!(
            "sequence up to {}, {} jumps",
            channel.last_sequence, channel.sequence_jumps
        ));
    }
    if channel.unreadable > 0 {
        line(format!(
            "{} messages do not fit their schema",
            channel.unreadable
        ));
    }
    if !channel.joints.is_empty() {
        let names: Vec<_> = channel.joints.iter().map(|name| escaped(name)).collect();
        line(format!("joints {}", names.join(", ")));
    }
    text
}

fn describe_clock(name: &str, clock: &ClockSummary) -> String {
    let mut text = format!(
        "{name:<7} {}.{:09} … {}.{:09}, largest gap {:.3} s",
        clock.first.div_euclid(1_000_000_000),
        clock.first.rem_euclid(1_000_000_000),
        clock.last.div_euclid(1_000_000_000),
        clock.last.rem_euclid(1_000_000_000),
        clock.largest_gap as f64 * 1e-9
    );
    for (count, what) in [
        (clock.backward, "steps back"),
        (clock.duplicate, "duplicates"),
    ] {
        if count > 0 {
            write!(text, ", {count} {what}").expect("writing to a string");
        }
    }
    text
}

/// Times within a second of each other are taken for one clock; a recorder is rarely later.
fn compare_clocks(least_ns: i64, most_ns: i64) -> String {
    let (least, most) = (least_ns as f64 * 1e-9, most_ns as f64 * 1e-9);
    let clocks = if least.abs().max(most.abs()) < 1.0 {
        "one clock"
    } else {
        "two clocks, or header stamps that are not set"
    };
    format!("log time less header stamp: {least:.6} to {most:.6} s ({clocks})")
}

fn describe_damage(rejects: &[LogReject]) -> String {
    if rejects.is_empty() {
        return "\n  no damage".to_owned();
    }
    let mut text = format!("\n  DAMAGED in {} places", rejects.len());
    for reject in rejects.iter().take(MOST_PRINTED) {
        let (start, end) = (reject.byte_start, reject.byte_end);
        write!(text, "\n    bytes {start}..{end}").expect("writing to a string");
        if let Some(messages) = reject.messages {
            write!(text, ", {messages} messages").expect("writing to a string");
        }
        if let Some((first, last)) = reject.time_span_ns {
            let (first, last) = (first as f64 * 1e-9, last as f64 * 1e-9);
            write!(text, ", log time {first:.3} … {last:.3} s").expect("writing to a string");
        }
        write!(text, ": {}", escaped(&reject.reason)).expect("writing to a string");
    }
    if rejects.len() > MOST_PRINTED {
        write!(text, "\n    and {} more", rejects.len() - MOST_PRINTED)
            .expect("writing to a string");
    }
    text
}

/// The sections of a pipeline file that would read the logs, as far as types and topics tell.
pub fn snippet(found: &[Inspection]) -> Option<String> {
    let channels = || {
        found
            .iter()
            .flat_map(|log| &log.channels)
            .filter(|channel| channel.messages > 0)
    };
    let most = |suits: &dyn Fn(&ChannelSummary) -> bool| {
        channels()
            .filter(|channel| suits(channel))
            .max_by_key(|channel| channel.messages)
    };
    let is_pose = |channel: &ChannelSummary| {
        matches!(
            channel.layout,
            Some(Layout::Pose | Layout::Point | Layout::PoseWithCovariance)
        )
    };
    let joints = most(&|channel| channel.layout == Some(Layout::Joints));
    let command = most(&|channel| is_pose(channel) && sounds_like_a_command(&channel.topic));
    let reading = most(&|channel| is_pose(channel) && !sounds_like_a_command(&channel.topic));
    let temperature = most(&|channel| channel.layout == Some(Layout::Temperature));
    let mut text = String::new();
    for (name, channel, unit) in [
        ("controller", joints, "rad"),
        ("commanded", command, "m"),
        ("tracker", reading, "m"),
    ] {
        let Some(channel) = channel else { continue };
        let choices = if unit == "rad" {
            "rad or deg"
        } else {
            "m or mm"
        };
        write!(
            text,
            "[{name}]\ntopic = {}\ntime = \"{}\"\nunit = \"{unit}\"  # {choices}\n",
            toml_text(&channel.topic),
            channel.best_time()
        )
        .expect("writing to a string");
        if let (Some(temperature), "tracker") = (temperature, name) {
            writeln!(text, "temperature = {}", toml_text(&temperature.topic))
                .expect("writing to a string");
        }
        text.push('\n');
    }
    (!text.is_empty()).then_some(text)
}

fn sounds_like_a_command(topic: &str) -> bool {
    let topic = topic.to_lowercase();
    ["command", "cmd", "target", "goal", "desired", "setpoint"]
        .iter()
        .any(|word| topic.contains(word))
}

fn or_none(text: &str) -> String {
    if text.is_empty() {
        "none".to_owned()
    } else {
        escaped(text)
    }
}

/// A name from a file with nothing in it that a terminal would act on.
fn escaped(text: &str) -> String {
    text.chars()
        .flat_map(|c| match c {
            '\'' | '"' => vec![c],
            c => c.escape_debug().collect(),
        })
        .collect()
}

/// A name from a file as a TOML string.
fn toml_text(text: &str) -> String {
    let mut quoted = String::from('"');
    for c in text.chars() {
        let plain = c == '\'' || c.escape_debug().count() == 1;
        if plain {
            quoted.push(c);
        } else {
            write!(quoted, "\\U{:08X}", u32::from(c)).expect("writing to a string");
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_harmless_on_a_terminal_and_whole_in_toml() {
        let name = "/a\u{1b}[2J\n\"b\\ü\u{202e}";
        assert!(
            !escaped(name)
                .chars()
                .any(|c| c.is_control() || c == '\u{202e}')
        );
        let toml: toml::Table =
            toml::from_str(&format!("topic = {}", toml_text(name))).expect("sound TOML");
        assert_eq!(toml["topic"].as_str(), Some(name));
    }

    #[test]
    fn clocks_apart_are_told() {
        assert!(compare_clocks(100_000, 200_000).contains("one clock"));
        assert!(compare_clocks(-37_000_000_000, -36_900_000_000).contains("two clocks"));
    }
}
