//! `posegrid inspect` on sound, damaged and foreign logs.

use assert_cmd::Command;
use mcap::Compression;
use posegrid::ingest::{CommandedSettings, ControllerSettings, TimeSource, TrackerSettings};

use crate::build::{Cdr, Folder, Log, session_log, stamp};

/// Exit code, stdout and stderr.
fn inspect(files: &[&std::path::Path]) -> (i32, String, String) {
    let output = Command::cargo_bin("posegrid")
        .expect("built")
        .arg("inspect")
        .args(files)
        .output()
        .expect("runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (
        output.status.code().expect("an exit code"),
        text(output.stdout),
        text(output.stderr),
    )
}

#[test]
fn a_sound_log_is_described_with_a_snippet_that_reads_it() {
    let folder = Folder::new();
    let (code, out, _) =
        inspect(&[&folder.file("log.mcap", &session_log(Some(Compression::Zstd), 101))]);
    assert_eq!(code, 0, "{out}");
    // 101 messages, 10 ms apart, logged 1 s after their stamps.
    assert!(
        out.contains("101 messages over 1.000 s, 100.00 Hz"),
        "{out}"
    );
    assert!(
        out.contains("sensor_msgs/msg/JointState (cdr, schema in ros2msg)"),
        "{out}"
    );
    assert!(
        out.contains("log time less header stamp: 1.000000 to 1.000000 s"),
        "{out}"
    );
    assert!(
        out.contains("joints a, b") && out.contains("no damage"),
        "{out}"
    );
    let snippet = &out[out.find("[controller]").expect("a snippet")..];
    let sections: toml::Table = toml::from_str(snippet).expect("sound TOML");
    let section = |name: &str| sections[name].clone();
    let controller: ControllerSettings = section("controller").try_into().expect("complete");
    assert_eq!(
        (controller.topic.as_str(), controller.time),
        ("/joints", TimeSource::Header)
    );
    let commanded: CommandedSettings = section("commanded").try_into().expect("complete");
    assert_eq!(commanded.topic, "/command");
    let tracker: TrackerSettings = section("tracker").try_into().expect("complete");
    assert_eq!(tracker.topic, "/reading");
}

#[test]
fn damage_and_unreadable_files_have_their_exit_codes() {
    let folder = Folder::new();
    let log = session_log(Some(Compression::Zstd), 200);
    let cut = folder.file("cut.mcap", &log[..log.len() / 2]);
    let (code, out, _) = inspect(&[&cut]);
    assert_eq!(code, 3, "{out}");
    assert!(
        out.contains("DAMAGED in 1 places") && out.contains(&format!("..{}", log.len() / 2)),
        "{out}"
    );
    let sound = folder.file("sound.mcap", &log);
    let (code, out, err) = inspect(&[&folder.file("text.mcap", b"hello"), &cut, &sound]);
    assert_eq!(code, 1, "unreadable outranks damaged");
    assert!(
        err.contains("text.mcap") && out.contains("sound.mcap"),
        "{err}{out}"
    );
}

#[test]
fn names_from_the_file_do_not_reach_the_terminal_as_they_are() {
    let mut log = Log::new(None);
    let joints = log.channel("/evil\u{1b}]0;title\u{7}", "JointState");
    log.write(
        joints,
        0,
        &Cdr::stamped(stamp(0))
            .joints(&["a\u{1b}[2J"], &[0.0])
            .done(),
    );
    log.metadata("m", "k", "v\r\u{1b}[0m");
    let (code, out, _) = inspect(&[&Folder::new().file("log.mcap", &log.done())]);
    assert_eq!(code, 0);
    assert!(!out.chars().any(|c| c.is_control() && c != '\n'), "{out:?}");
}
