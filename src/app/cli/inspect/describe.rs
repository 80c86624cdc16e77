use std::collections::BTreeMap;

use super::{escaped, shown};
use crate::ingest::LogReject;
use crate::io::inspect::{ChannelSummary, ClockSummary, Differences, Inspection, Traffic};
use crate::io::log::{Ending, ReadSummary};

const MOST_PRINTED: usize = 20;
/// A gap of this many usual steps or more is described.
const LONG_GAP: f64 = 5.0;

pub fn describe(found: &Inspection) -> String {
    let read_summary = &found.read_summary;
    let mut text = String::new();
    let mut line = |line: String| text.push_str(&(line + "\n"));
    let (file, megabytes) = (escaped(&read_summary.file), read_summary.bytes as f64 / 1e6);
    line(format!("{file}  {megabytes:.1} MB, {} messages", read_summary.messages));
    let (profile, library) = (shown(&read_summary.profile), shown(&read_summary.library));
    line(format!("  profile {profile:?}, written by {library:?}"));
    line(format!("  {}", storage(read_summary)));
    line(format!("  {}", ending(read_summary.ending)));
    remarks(read_summary).into_iter().for_each(&mut line);
    for (name, key, value) in &read_summary.metadata {
        line(format!("  metadata {}.{} = {}", escaped(name), escaped(key), escaped(value)));
    }
    let mut of_topic = BTreeMap::<&str, usize>::new();
    for channel in &found.channels {
        *of_topic.entry(&channel.topic).or_default() += 1;
    }
    for channel in &found.channels {
        line(of_channel(channel, of_topic[channel.topic.as_str()]));
    }
    line(damage(read_summary));
    text
}

fn storage(read_summary: &ReadSummary) -> String {
    let mut parts = Vec::new();
    if let Some(packed) = &read_summary.packed {
        let megabytes = packed.bytes as f64 / 1e6;
        parts.push(format!(
            "in zstd as a whole ({megabytes:.1} MB; places are those of the decompressed log)"
        ));
    }
    parts.extend(read_summary.chunks.iter().map(
        |(compression, count)| match compression.as_str() {
            "" => format!("{count} uncompressed chunks"),
            name => format!("{count} chunks in {}", escaped(name)),
        },
    ));
    if read_summary.messages_outside_chunks > 0 {
        parts.push(format!("{} messages outside chunks", read_summary.messages_outside_chunks));
    }
    if read_summary.chunks_unchecked > 0 {
        parts.push(format!(
            "{} chunks without a checksum: damage inside them can go unnoticed",
            read_summary.chunks_unchecked
        ));
    }
    if parts.is_empty() { "no readable chunk or message".to_owned() } else { parts.join(", ") }
}

/// Properties that are unusual and no damage.
fn remarks(read_summary: &ReadSummary) -> Vec<String> {
    let mut found = Vec::new();
    if read_summary.logs > 1 {
        found.push(format!("  {} logs in one file, one after another", read_summary.logs));
    }
    if !read_summary.private_records.is_empty() {
        let of = |(opcode, count): (&u8, &u64)| format!("{count} with opcode 0x{opcode:02x}");
        let opcodes: Vec<String> = read_summary.private_records.iter().map(of).collect();
        found.push(format!("  application-specific records, skipped: {}", opcodes.join(", ")));
    }
    if let Some((stated, read)) = read_summary.undercounted {
        found.push(format!(
            "  the summary counts {stated} messages where {read} are: its writer counted wrongly, none is lost"
        ));
    }
    found
}

const fn ending(ending: Ending) -> &'static str {
    match ending {
        Ending::Cut => "no closing mark at its end",
        Ending::NoSummary => "ends as it should, without a summary (which is not needed here)",
        Ending::Unchecked => "ends as it should, with a summary without a checksum",
        Ending::Sound => "ends as it should, with a sound summary",
        Ending::Damaged => "ends as it should, with a damaged summary (which is not needed here)",
    }
}

/// The lines of a channel; `of_topic` is the number of channels with its topic.
fn of_channel(channel: &ChannelSummary, of_topic: usize) -> String {
    let mut text = format!("\n  {}\n", shown(&channel.topic));
    let mut line = |line: String| text.extend(["    ", line.as_str(), "\n"]);
    let [name, encoding, schema] =
        [channel.type_name(), &channel.encoding, channel.schema_encoding()].map(or_none);
    line(format!("{name} ({encoding}, schema in {schema})"));
    if of_topic > 1 {
        line("another channel has this topic: both are read as one".to_owned());
    }
    let traffic = &channel.traffic;
    if traffic.messages == 0 {
        line("no messages".to_owned());
        return text.trim_end().to_owned();
    }
    of_traffic(traffic, &mut line);
    if let Some(unit) = channel.unit() {
        let largest = traffic.sizes.largest;
        line(format!("values up to {largest:.4}: {unit}, by their size"));
    }
    channel.fields.iter().for_each(|field| line(format!("field {}", escaped(field))));
    text.trim_end().to_owned()
}

fn of_traffic(traffic: &Traffic, line: &mut impl FnMut(String)) {
    let rate = traffic.log.rate_hz();
    let rate = rate.map_or_else(String::new, |rate| format!(", {rate:.2} Hz"));
    line(format!("{} messages over {:.3} s{rate}", traffic.messages, traffic.log.span_s()));
    let clocks =
        [("header", &traffic.header), ("publish", &traffic.publish), ("log", &traffic.log)];
    for (name, clock) in clocks.into_iter().filter(|(_, clock)| clock.count > 0) {
        line(of_clock(name, clock));
    }
    let differences =
        [("header stamp", traffic.log_less_header), ("publish time", traffic.log_less_publish)];
    let compared = differences.into_iter().filter_map(|(name, own)| compare_clocks(name, own));
    compared.for_each(&mut *line);
    if traffic.last_sequence > 0 {
        line(format!("sequence up to {}, {} jumps", traffic.last_sequence, traffic.sequence_jumps));
    }
    if traffic.unreadable > 0 {
        line(format!("{} messages do not fit their schema", traffic.unreadable));
    }
    if !traffic.joints.is_empty() {
        let names: Vec<_> = traffic.joints.iter().map(|name| escaped(name)).collect();
        line(format!("joints {}", names.join(", ")));
    }
}

fn of_clock(name: &str, clock: &ClockSummary) -> String {
    let (first, last) = (moment(clock.first), moment(clock.last));
    let gap_s = seconds(clock.largest_gap);
    let usual = clock.span_s() / (clock.count - 1).max(1) as f64;
    let after = (gap_s > LONG_GAP * usual).then(|| format!(" after {}", moment(clock.gap_start)));
    let after = after.unwrap_or_default();
    let mut parts = vec![format!("{name:<7} {first} … {last}, largest gap {gap_s:.3} s{after}")];
    if clock.backward > 0 {
        let largest = seconds(clock.largest_step_back);
        parts.push(format!("{} steps back (by {largest:.3} s at most)", clock.backward));
    }
    if clock.duplicate > 0 {
        parts.push(format!("{} duplicates", clock.duplicate));
    }
    parts.join(", ")
}

/// A time in seconds with all its digits.
fn moment(ns: i64) -> String {
    let (s, ns) = (ns.div_euclid(1_000_000_000), ns.rem_euclid(1_000_000_000));
    format!("{s}.{ns:09}")
}

fn seconds(ns: i64) -> f64 {
    ns as f64 * 1e-9
}

/// Times within a second of each other are taken for one clock; a recorder rarely lags by more.
fn compare_clocks(other: &str, differences: Differences) -> Option<String> {
    let (least_ns, most_ns) = differences.0?;
    if (least_ns, most_ns) == (0, 0) {
        return None;
    }
    let (least, most) = (seconds(least_ns), seconds(most_ns));
    let clocks = if least.abs().max(most.abs()) < 1.0 {
        "one clock"
    } else if most - least < 1.0 {
        "two clocks: name the one that the measurement was stamped with"
    } else {
        "two clocks, or stamps that are not set, or a clock that was set while it ran"
    };
    Some(format!("log time less {other}: {least:.6} to {most:.6} s ({clocks})"))
}

fn damage(read_summary: &ReadSummary) -> String {
    let rejects = &read_summary.rejects;
    if rejects.is_empty() {
        return "\n  no damage".to_owned();
    }
    let (lost, bytes) = (read_summary.bytes_lost(), read_summary.bytes.max(1));
    let mut lines = vec![format!(
        "\n  DAMAGED in {} places: {lost} of {} bytes lost ({:.2} %){}; [input] max_lost_share sets how much may be",
        rejects.len(),
        read_summary.bytes,
        100.0 * lost as f64 / bytes as f64,
        messages_lost(read_summary)
    )];
    lines.extend(rejects.iter().take(MOST_PRINTED).map(of_reject));
    if rejects.len() > MOST_PRINTED {
        lines.push(format!("and {} more", rejects.len() - MOST_PRINTED));
    }
    lines.join("\n    ")
}

/// The number of messages known to be lost, after a comma; empty where none is.
fn messages_lost(read_summary: &ReadSummary) -> String {
    let lost = read_summary.messages_lost;
    if lost == 0 {
        return String::new();
    }
    let all = read_summary.messages.saturating_add(lost);
    let percent = 100.0 * lost as f64 / all as f64;
    format!(", {lost} of {all} messages lost ({percent:.2} %)")
}

fn of_reject(reject: &LogReject) -> String {
    let mut parts = vec![format!("bytes {}..{}", reject.byte_start, reject.byte_end)];
    parts.extend(reject.messages.map(|messages| format!(", {messages} messages")));
    parts.extend(reject.topic.as_ref().map(|topic| format!(" of {}", shown(topic))));
    let span = reject.time_span_ns.map(|(first, last)| (moment(first), moment(last)));
    parts.extend(span.map(|(first, last)| format!(", log time {first} … {last}")));
    parts.push(format!(": {}", escaped(&reject.reason)));
    parts.concat()
}

fn or_none(text: &str) -> String {
    if text.is_empty() { "none".to_owned() } else { shown(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_apart_are_reported() {
        let compare =
            |least, most| compare_clocks("header stamp", Differences(Some((least, most))));
        assert!(compare(100_000, 200_000).unwrap().contains("one clock"));
        let apart = compare(-37_000_000_000, -36_900_000_000).unwrap();
        assert!(apart.contains("two clocks: name"), "{apart}");
        assert!(compare(0, 37_000_000_000).unwrap().contains("not set"));
        assert_eq!(compare(0, 0), None);
    }

    #[test]
    fn a_long_gap_is_placed_and_a_usual_one_is_not() {
        let mut clock = ClockSummary::default();
        (0..100).for_each(|i| clock.add(i * 10_000_000));
        let usual = of_clock("log", &clock);
        assert!(usual.ends_with("largest gap 0.010 s"), "{usual}");
        clock.add(5_000_000_000);
        clock.add(4_500_000_000);
        let long = of_clock("log", &clock);
        // From 0.99 s to 5 s, then half a second back.
        assert!(long.contains("gap 4.010 s after 0.990000000"), "{long}");
        assert!(long.contains("1 steps back (by 0.500 s at most)"), "{long}");
    }
}
