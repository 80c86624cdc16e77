//! Names of objects are anybody's: none of them becomes a path, and what cannot be used is told.

use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use crate::cell::{Ended, files};
use crate::server::{Remote, in_folders};

#[test]
fn hostile_names_are_names_of_sessions_and_nothing_else() {
    let names = ["..%2F..%2Fetc", "$(touch owned)", "a\\..\\b ü*[x]?", "robot=7"];
    let Some(remote) = Remote::new(&names) else {
        return;
    };
    let before: Vec<String> = files(&remote.cell.path("")).into_keys().collect();
    remote.run(&[]).expect(0, &["4 of 4 within 0.5 mm"]);
    let after: Vec<String> = files(&remote.cell.path("")).into_keys().collect();
    assert_eq!(after, before, "no file came of a name");
    // As on a folder: every byte that could mean something is encoded, `%` too.
    for session in [
        "..%252F..%252Fetc",
        "%24%28touch%20owned%29",
        "a%5C..%5Cb%20%C3%BC%2A%5Bx%5D%3F",
        "robot%3D7",
    ] {
        let encoded = session.strip_prefix("..").map(|rest| format!("%2E.{rest}"));
        let session = encoded.unwrap_or_else(|| session.to_owned());
        let own = format!("runs/kr210-demo/{session}/");
        let keys = remote.server.keys(&remote.key("lake"));
        assert!(keys.keys().any(|key| key.starts_with(&own)), "{own}: {keys:?}");
    }
}

#[test]
fn a_name_that_leads_elsewhere_is_reported() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    remote.server.put_raw(&remote.key("sessions//etc/passwd"), b"");
    remote.run(&[]).expect(2, &["cannot list", "etc/passwd", "name"]);
}

#[test]
fn a_log_that_changes_between_listing_and_fetching_is_an_error() {
    let Some(remote) = Remote::new(&["mon", "tue"]) else {
        return;
    };
    let mut child = remote
        .run_command()
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("started");
    // When the copies of the first session are there, all have been listed, and the second is not fetched yet.
    let temporaries = || std::fs::read_dir(remote.cell.path("tmp")).expect("readable");
    while temporaries().next().is_none() && child.try_wait().expect("our own child").is_none() {
        sleep(Duration::from_millis(1));
    }
    let log = remote.key("sessions/tue/tracker.mcap");
    remote.server.put(&log, b"still being written".to_vec());
    let ended = Ended::from(child.wait_with_output().expect("our own child"));
    ended.expect(1, &["tue/tracker.mcap: it changed meanwhile"]);
    remote.no_temporaries();
    let mut expected = in_folders().clone();
    expected.retain(|key, _| key.contains("/mon/"));
    assert!(remote.lake() == expected);
}

#[test]
fn errors_of_a_log_name_the_object_and_not_the_copy() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    for log in ["controller.mcap", "tracker.mcap"] {
        remote.server.put(&remote.key(&format!("sessions/mon/{log}")), b"no log".to_vec());
    }
    let ended = remote.run(&[]);
    ended.expect(1, &[&remote.address("sessions/mon/controller.mcap")]);
    assert!(!ended.messages.contains("posegrid-logs"), "{}", ended.messages);
}
