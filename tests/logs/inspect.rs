//! `posegrid inspect` on sound, damaged and foreign logs.

use std::process::Command;

use mcap::Compression;
use posegrid::ingest::{CommandedSettings, ControllerSettings, TimeSource, TrackerSettings};

use crate::build::{Cdr, Folder, Log, session_log, stamp};

/// Exit code, stdout and stderr.
fn inspect(files: &[&std::path::Path]) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .arg("inspect")
        .args(files)
        .output()
        .expect("runs");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("text");
    (output.status.code().expect("an exit code"), text(output.stdout), text(output.stderr))
}

#[test]
fn a_sound_log_is_described_with_a_snippet_that_reads_it() {
    let folder = Folder::new();
    let (code, out, _) =
        inspect(&[&folder.file("log.mcap", &session_log(Some(Compression::Zstd), 101))]);
    assert_eq!(code, 0, "{out}");
    // 101 messages, 10 ms apart, logged 1 s after their stamps.
    assert!(out.contains("101 messages over 1.000 s, 100.00 Hz"), "{out}");
    assert!(out.contains("sensor_msgs/msg/JointState (cdr, schema in ros2msg)"), "{out}");
    assert!(out.contains("log time less header stamp: 1.000000 to 1.000000 s"), "{out}");
    assert!(out.contains("joints a, b") && out.contains("no damage"), "{out}");
    let snippet = &out[out.find("[controller]").expect("a snippet")..];
    let sections: toml::Table = toml::from_str(snippet).expect("sound TOML");
    let section = |name: &str| sections[name].clone();
    let controller: ControllerSettings = section("controller").try_into().expect("complete");
    assert_eq!((controller.topic.as_str(), controller.time), ("/joints", TimeSource::Header));
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
    assert!(err.contains("text.mcap") && out.contains("sound.mcap"), "{err}{out}");
}

#[test]
fn names_from_the_file_do_not_reach_the_terminal_as_they_are() {
    let mut log = Log::new(None);
    let joints = log.channel("/evil\u{1b}]0;title\u{7}", "JointState");
    log.write(joints, 0, &Cdr::stamped(stamp(0)).joints(&["a\u{1b}[2J"], &[0.0]).done());
    log.metadata("m", "k", "v\r\u{1b}[0m");
    let (code, out, _) = inspect(&[&Folder::new().file("log.mcap", &log.done())]);
    assert_eq!(code, 0);
    assert!(!out.chars().any(|c| c.is_control() && c != '\n'), "{out:?}");
}

#[test]
fn a_split_recording_is_put_together_by_its_times() {
    let folder = Folder::new();
    let part = |first: u32| {
        let mut log = Log::new(Some(Compression::Zstd));
        let joints = log.channel("/joints", "JointState");
        for i in first..first + 50 {
            let at = u64::try_from(stamp(i)).expect("positive");
            let message = Cdr::stamped(stamp(i)).joints(&["a", "b"], &[0.0, 0.0]);
            log.write(joints, at, &message.done());
        }
        log.done()
    };
    // 10 ms between messages: 0 to 490 ms, 500 to 990 ms, and one that begins before the second ends.
    let late = folder.file("a.mcap", &part(50));
    let early = folder.file("b.mcap", &part(0));
    let packed = zstd::stream::encode_all(&part(90)[..], 1).expect("memory");
    let over = folder.file("c.mcap.zst", &packed);
    let (code, out, _) = inspect(&[&late, &early, &over]);
    assert_eq!(code, 0, "{out}");
    for text in [
        "controller = [\"b.mcap\", \"a.mcap\", \"c.mcap.zst\"]",
        "# a.mcap follows b.mcap after 0.010 s",
        "# c.mcap.zst begins 0.090 s before a.mcap ends",
        "in zstd as a whole",
        "# no [tracker]: no topic here has poses or points",
    ] {
        assert!(out.contains(text), "{text:?} is not in {out}");
    }
    // A folder stands for the logs in it.
    let (code, of_folder, _) = inspect(&[folder.path()]);
    assert_eq!(code, 0);
    assert!(of_folder.contains("controller = [\"b.mcap\", \"a.mcap\", \"c.mcap.zst\"]"));
}

#[test]
fn a_log_cut_behind_its_data_is_damaged_and_a_log_without_summary_is_not() {
    let folder = Folder::new();
    let log = session_log(Some(Compression::Zstd), 50);
    let (code, out, _) = inspect(&[&folder.file("cut.mcap", &log[..log.len() - 3])]);
    assert_eq!(code, 3, "{out}");
    assert!(
        out.contains("no closing mark at its end") && out.contains("no message is lost"),
        "{out}"
    );
    assert!(out.contains("0 of") && out.contains("bytes lost (0.00 %)"), "{out}");
    let mut plain = Log::with(
        mcap::WriteOptions::new().emit_summary_records(false).emit_summary_offsets(false),
    );
    crate::build::session(&mut plain, 50);
    let (code, out, _) = inspect(&[&folder.file("plain.mcap", &plain.done())]);
    assert_eq!(code, 0, "{out}");
    assert!(out.contains("without a summary"), "{out}");
}

#[test]
fn files_of_other_formats_are_reported_with_what_to_do() {
    let folder = Folder::new();
    let cases: [(&str, &[u8], &str); 6] = [
        ("a.bag", b"#ROSBAG V2.0\n", "mcap convert"),
        ("a.db3", b"SQLite format 3\0", "ros2 bag convert"),
        ("a.mcap.gz", b"\x1f\x8b\x08\0\0\0\0\0", "gunzip"),
        ("a.h5", b"\x89HDF\r\n\x1a\n", "HDF5"),
        ("a.log", b"time,x,y,z\n1,2,3,4\n", "CSV"),
        ("a.mcap.zst", b"\x28\xb5\x2f\xfdxxxx", "zstd"),
    ];
    for (name, bytes, advice) in cases {
        let (code, out, err) = inspect(&[&folder.file(name, bytes)]);
        assert_eq!((code, out.as_str()), (1, ""), "{name}");
        assert!(err.contains(name) && err.contains(advice), "{err}");
    }
}

#[test]
fn clocks_are_compared_and_gaps_placed() {
    let mut log = Log::new(None);
    let joints = log.channel("/joints", "JointState");
    // Stamped 10 ms apart with a break of 2 s and one step back; logged 37 s later.
    let stamps: Vec<i64> = (0..50).chain(250..300).chain([240]).map(stamp).collect();
    for at in &stamps {
        let message = Cdr::stamped(*at).joints(&["a", "b"], &[0.0, 0.0]);
        let logged = u64::try_from(*at).expect("positive") + 37_000_000_000;
        log.write(joints, logged, &message.done());
    }
    let (_, out, _) = inspect(&[&Folder::new().file("log.mcap", &log.done())]);
    for text in [
        "largest gap 2.010 s after 100.490000000",
        "1 steps back (by 0.590 s at most)",
        "log time less header stamp: 37.000000 to 37.000000 s (two clocks",
        "# the robot file has to name these joints: a, b",
    ] {
        assert!(out.contains(text), "{text:?} is not in {out}");
    }
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let folder = Folder::new();
    let log = folder.file("log.mcap", &session_log(None, 20));
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .arg("inspect")
        .args(vec![&log; 300])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("started");
    drop(child.stdout.take());
    let ended = child.wait_with_output().expect("ends");
    let told = String::from_utf8_lossy(&ended.stderr).into_owned();
    assert_eq!((ended.status.code(), told.as_str()), (Some(0), ""));
}

#[test]
fn a_log_in_zstd_without_room_to_decompress_it_is_reported() {
    let folder = Folder::new();
    let packed = zstd::stream::encode_all(&session_log(None, 20)[..], 1).expect("memory");
    let log = folder.file("log.mcap.zst", &packed);
    let output = Command::new(env!("CARGO_BIN_EXE_posegrid"))
        .arg("inspect")
        .arg(&log)
        .env("TMPDIR", folder.path().join("missing"))
        .output()
        .expect("runs");
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{told}");
    assert!(told.contains("log.mcap.zst") && told.contains("TMPDIR"), "{told}");
}
