//! Damaged logs: what can be read is read, what is lost is counted and placed, and no damage ends in a panic.

use std::fs;
use std::path::Path;

use arrow::array::Array as _;

use super::cell::{Cell, ended, posegrid};

/// A cell with a session `mon` whose logs may lose anything before it fails.
fn tolerant() -> Cell {
    Cell::new()
        .with("# sessions", "max_lost_share = 1.0\nsettle_s = 0")
        .with("harmonics = 12", "enabled = false")
        .with_quickstart("mon")
}

#[test]
fn a_log_cut_anywhere_gives_a_result_with_its_loss_or_a_clear_error() {
    for log in ["controller.mcap", "tracker.mcap"] {
        let whole = fs::read(Path::new("tests/recordings/quickstart").join(log)).expect("a log");
        let cell = tolerant();
        for kept in cuts(whole.len()) {
            fs::write(cell.session("mon").join(log), &whole[..kept]).expect("writable");
            let _ = fs::remove_dir_all(cell.path("lake"));
            let what = format!("{log} cut to {kept} of {} bytes", whole.len());
            let run = cell.run(&[]);
            run.no_defect();
            match run.code {
                // All messages stand before the closing magic bytes.
                0 if kept + 8 > whole.len() => run.expect(0, &["637 stations, 632 measured"]),
                0 | 3 => assert!(lost(&cell, log, kept), "{what}: {}", run.results),
                1 => run.expect(1, &["mon: no result: "]),
                code => panic!("{what}: exit code {code}: {}", run.messages),
            }
        }
    }
}

/// Five places of a log of this length: in its magic, behind it, in its first and in its last chunk, in its last magic.
fn cuts(length: usize) -> [usize; 5] {
    [5, 8, length / 3, length * 9 / 10, length - 3]
}

/// Whether the rejects name the log and where it ends too early.
fn lost(cell: &Cell, log: &str, kept: usize) -> bool {
    let kept = i64::try_from(kept).expect("a file's length");
    let rejects = cell.table("rejects", "mon");
    let (file, start) = (rejects.text("file"), rejects.i64("byte_start"));
    (0..rejects.rows())
        .any(|row| file.is_valid(row) && file.value(row).ends_with(log) && start.value(row) <= kept)
}

#[test]
fn a_flipped_bit_in_a_chunk_is_placed_and_the_rest_is_read() {
    // In the middle of the first chunk of six.
    const PLACE: usize = 100_000;
    let cell = tolerant().with_log("mon", "controller.mcap", |mut bytes| {
        bytes[PLACE] ^= 0x10;
        bytes
    });
    let run = cell.run(&[]);
    assert!([0, 3].contains(&run.code), "{}", run.messages);
    run.no_defect();
    let rejects = cell.table("rejects", "mon");
    let (start, end) = (rejects.i64("byte_start"), rejects.i64("byte_end"));
    let place = i64::try_from(PLACE).expect("a small number");
    let holding: Vec<usize> = (0..rejects.rows())
        .filter(|&row| start.is_valid(row) && end.is_valid(row))
        .filter(|&row| start.value(row) <= place && place < end.value(row))
        .collect();
    assert_eq!(holding.len(), 1, "one chunk holds byte {place}");
    assert!(rejects.text("file").value(holding[0]).ends_with("controller.mcap"));
    assert_eq!(rejects.text("stage").value(holding[0]), "ingest");
}

#[test]
fn damage_beyond_the_limit_of_the_pipeline_file_fails_the_session() {
    let half = |bytes: Vec<u8>| bytes[..bytes.len() / 2].to_vec();
    let cell = tolerant().with("max_lost_share = 1.0", "max_lost_share = 0.001").with_log(
        "mon",
        "controller.mcap",
        half,
    );
    let texts = ["session mon", "bytes were lost", "max_lost_share = 0.001", "inspect"];
    cell.run(&[]).expect(1, &texts);
    assert!(cell.lake().is_empty());
}

/// The log without its third chunk and the indexes of it; its summary has moved, and is sound.
pub fn without_a_chunk(log: &[u8]) -> Vec<u8> {
    use mcap::records::op;
    let number = |at: usize| {
        let bytes = log[at..at + 8].try_into().expect("eight");
        usize::try_from(u64::from_le_bytes(bytes)).expect("a place in the log")
    };
    let (mut found, mut at, mut chunk, mut summary) = (mcap::MAGIC.to_vec(), 8, 0, 0);
    while log[at] != op::FOOTER {
        let end = at + 9 + number(at + 1);
        chunk += usize::from(log[at] == op::CHUNK);
        if chunk != 3 || !matches!(log[at], op::CHUNK | op::MESSAGE_INDEX) {
            found.extend(&log[at..end]);
        }
        if log[at] == op::DATA_END {
            summary = found.len();
        }
        at = end;
    }
    let footer = found.len();
    found.extend(&log[at..]);
    found[footer + 9..footer + 17].copy_from_slice(&(summary as u64).to_le_bytes());
    let crc = crc32fast::hash(&found[summary..footer + 25]);
    found[footer + 25..footer + 29].copy_from_slice(&crc.to_le_bytes());
    found
}

#[test]
fn a_chunk_cut_out_cleanly_is_lost_messages_that_the_limit_sees() {
    let cell = tolerant().with_log("mon", "controller.mcap", |log| without_a_chunk(&log));
    let run = cell.run(&[]);
    assert!([0, 3].contains(&run.code), "{}", run.messages);
    assert!(run.results.contains("messages were lost"), "{}", run.results);
    let rejects = cell.table("rejects", "mon");
    let (kind, topic) = (rejects.text("kind"), rejects.text("topic"));
    let (number, reason) = (rejects.i64("number"), rejects.text("reason"));
    let told = (0..rejects.rows()).find(|&row| {
        reason.value(row).contains("the summary, whose checksum")
            && !topic.is_null(row)
            && topic.value(row) == "/joint_states"
    });
    let row = told.expect("a row of its own");
    assert_eq!((kind.value(row), topic.value(row)), ("messages", "/joint_states"));
    assert!(number.value(row) > 100, "{}", number.value(row));
    let inspected =
        ended(posegrid().arg("inspect").arg(cell.session("mon").join("controller.mcap")));
    inspected.expect(3, &["messages lost"]);
    // The default limit.
    let cell = cell.with("max_lost_share = 1.0", "max_lost_share = 0.01");
    let _ = fs::remove_dir_all(cell.path("lake"));
    cell.run(&[]).expect(1, &["messages were lost", "max_lost_share = 0.01"]);
}

/// The log with one joint state in ten cut short.
fn with_short_messages(log: &[u8]) -> Vec<u8> {
    let mut writer = mcap::Writer::new(std::io::Cursor::new(Vec::new())).expect("in memory");
    let mut joints = 0;
    for message in mcap::MessageStream::new(log).expect("a log") {
        let mut message = message.expect("sound");
        if message.channel.topic == "/joint_states" {
            joints += 1;
            let whole = message.data.len();
            let kept = if joints % 10 == 0 { whole / 2 } else { whole };
            message.data = message.data[..kept].to_vec().into();
        }
        writer.write(&message).expect("in memory");
    }
    writer.finish().expect("in memory");
    writer.into_inner().into_inner()
}

#[test]
fn more_rejected_messages_than_the_pipeline_file_allows_are_reported_now_and_later() {
    let cell = Cell::new()
        .with("harmonics = 12", "enabled = false")
        .with_simulated("mon", &["--random", "12"])
        .with_log("mon", "controller.mcap", |log| with_short_messages(&log));
    let told = "joint messages were rejected (9.90";
    let texts = [told, "max_rejected_share = 0.05", "12 stations"];
    cell.run(&[]).expect(3, &texts);
    cell.run(&[]).expect(3, &["done-before", told]);
    let cell = cell.with("# sessions", "max_rejected_share = 0.2");
    let allowed = cell.run(&[]);
    assert!(!allowed.results.contains(told), "{}", allowed.results);
    let rejects = cell.path("lake/rejects/kr210-demo/mon");
    assert_eq!(fs::read_dir(rejects).expect("published").count(), 2);
}

#[test]
fn inspect_exits_with_0_on_a_sound_log_and_with_3_on_a_damaged_one() {
    let cell = Cell::new().with_quickstart("mon");
    let log = cell.session("mon").join("tracker.mcap");
    let inspect = || ended(posegrid().arg("inspect").arg(&log));
    inspect().expect(0, &["/tracker/point", "no damage"]);
    let cell = cell.with_log("mon", "tracker.mcap", |mut bytes| {
        bytes.truncate(bytes.len() * 9 / 10);
        bytes
    });
    let damaged = inspect();
    damaged.expect(3, &["tracker.mcap", "/tracker/point"]);
    assert!(!damaged.results.contains("no damage"), "{}", damaged.results);
    drop(cell);
}
