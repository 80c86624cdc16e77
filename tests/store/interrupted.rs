//! Runs killed between uploads: the next one finishes the work with the same objects.

use std::process::Stdio;
use std::thread::sleep;
use std::time::Duration;

use crate::server::{Remote, in_folders};

#[test]
fn a_run_killed_between_uploads_is_finished_by_the_next_with_the_same_objects() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    for objects in [1, 6] {
        killed(&remote, objects);
    }
    // What a killed process leaves among the temporaries is removed by the next.
    remote.run(&[]).expect(0, &["1 of 1 within"]);
    assert!(remote.lake() == *in_folders(), "{:?}", remote.lake().keys());
}

/// Starts the run and kills it as soon as the lake holds so many objects.
fn killed(remote: &Remote, objects: usize) {
    let mut child =
        remote.run_command().stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("started");
    let lake = remote.key("lake");
    // Where the run was faster than we look, it is whole: then the next has nothing to do.
    while child.try_wait().expect("our own child").is_none()
        && remote.server.keys(&lake).len() < objects
    {
        sleep(Duration::from_millis(1));
    }
    child.kill().expect("killed, or gone");
    child.wait().expect("our own child");
    assert!(remote.server.keys(&lake).len() >= objects);
}
