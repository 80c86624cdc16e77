//! `posegrid history` and `posegrid compact` on object storage: what they give of a folder, and what they ask for.

use std::fs;

use crate::cell::{Ended, ended, posegrid};
use crate::server::{Remote, in_folders};
use crate::way::{Fault, Way};

/// A command on the remote lake, and the first lines of its requests.
fn asked(remote: &Remote, arguments: &[&str]) -> (Ended, Vec<String>) {
    let way = Way::to(&remote.server.url, Fault::Lost, 0, 0);
    let mut command = remote.command(arguments);
    command.env("AWS_ENDPOINT_URL", &way.url);
    let ended = Ended::from(command.output().expect("started"));
    remote.no_temporaries();
    (ended, way.asked())
}

#[test]
fn history_and_compact_form_are_those_of_a_folder_and_new_sessions_cost_small_objects() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    remote.run(&[]).expect(0, &["1 of 1 within 0.5 mm"]);
    let folder = tempfile::tempdir().expect("a folder");
    // Requests have the time of their run.
    let requests = remote.requests();
    for (name, bytes) in in_folders().iter().chain(&requests) {
        let file = folder.path().join(name);
        fs::create_dir_all(file.parent().expect("in a folder")).expect("writable");
        fs::write(file, bytes).expect("writable");
    }
    let lake = remote.address("lake");
    let here = |command: &str| ended(posegrid().arg(command).arg(folder.path()));
    let (history, requests) = asked(&remote, &["history", &lake]);
    assert_eq!(
        (history.code, &history.results),
        (0, &here("history").results),
        "{}",
        history.messages
    );
    // Nothing of some megabytes is read, and the second time no table at all.
    let large = |line: &String| {
        ["/calibrations/", "/accuracy/", "/clocks/"].iter().any(|own| line.contains(own))
    };
    assert!(!requests.iter().any(large), "{requests:#?}");
    let (again, requests) = asked(&remote, &["history", &lake]);
    assert_eq!(again.results, history.results);
    assert!(
        !requests.iter().any(|line| line.contains(".parquet")) && requests.len() <= 6,
        "{requests:#?}"
    );
    // The tables by month have the bytes of those in a folder.
    let (compacted, _) = asked(&remote, &["compact", &lake]);
    assert_eq!(
        (compacted.code, &compacted.results),
        (0, &here("compact").results),
        "{}",
        compacted.messages
    );
    let objects = remote.server.objects(&remote.key("lake/compact"));
    // Of the month of the session and of that of its request: rows, requests and their keys, and the state.
    assert_eq!(objects.len(), 6, "{:?}", objects.keys());
    for (name, bytes) in objects {
        assert!(
            fs::read(folder.path().join("compact").join(&name)).expect("there too") == bytes,
            "{name}"
        );
    }
    let (again, requests) = asked(&remote, &["compact", &lake]);
    again.expect(0, &["state 1 is up to date: 1 runs"]);
    assert!(
        !requests.iter().any(|line| line.contains(".parquet") || line.starts_with("PUT")),
        "{requests:#?}"
    );
}
