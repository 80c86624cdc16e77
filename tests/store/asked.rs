//! The current run of a session on object storage: asked for again, and by two at once.

use std::fs;
use std::path::Path;
use std::process::Stdio;

use crate::cell::{Cell, Ended, files, in_time};
use crate::server::Remote;

/// A small session on the server, and what its runs exit with: so few stations cannot show 95 %.
fn small() -> Option<Remote> {
    let remote = Remote::new(&[])?;
    let local = Cell::new().with_simulated("mon", &["--random", "12"]);
    for (log, bytes) in files(&local.session("mon")) {
        remote.server.put(&remote.key(&format!("sessions/mon/{log}")), bytes);
    }
    Some(remote)
}

/// Keys of the requests of the lake's only session.
fn requests(remote: &Remote) -> Vec<String> {
    let keys = remote.server.keys(&remote.key("lake/asked/kr210-demo/mon"));
    keys.into_keys().collect()
}

const NOT_SHOWN: i32 = 3;
const FIRST: &str = "00000001.parquet";
const SECOND: &str = "00000002.parquet";
const THIRD: &str = "00000003.parquet";

#[test]
fn a_setting_that_comes_back_on_object_storage_is_current_again() {
    let Some(remote) = small() else {
        return;
    };
    remote.run(&[]).expect(NOT_SHOWN, &["1 done, 0 done before"]);
    let remote = remote.with("mm = 0.5", "mm = 0.4");
    let told = "tolerance.mm 0.5 → 0.4";
    remote.run(&[]).expect(NOT_SHOWN, &["takes the place of run ", told]);
    let remote = remote.with("mm = 0.4", "mm = 0.5");
    let told = "tolerance.mm 0.4 → 0.5";
    remote.run(&[]).expect(NOT_SHOWN, &["0 done, 1 done before", "is current again", told]);
    assert_eq!(requests(&remote), [FIRST, SECOND, THIRD]);
    let lake = remote.address("lake");
    let history = remote.command(&["history", &lake]).output().expect("started");
    Ended::from(history).expect(0, &["1 replaced by another run"]);
    let verified = remote.command(&["verify", &lake]).output().expect("started");
    assert!(!String::from_utf8_lossy(&verified.stdout).contains("asked: "));
}

#[test]
fn two_at_once_on_object_storage_have_a_request_each() {
    let Some(remote) = small() else {
        return;
    };
    let text = fs::read_to_string(remote.cell.pipeline()).expect("readable");
    let other = remote.cell.path("other.toml");
    fs::write(&other, text.replace("mm = 0.5", "mm = 0.4")).expect("writable");
    let start = |pipeline: &Path| {
        let mut command = remote.command(&["run", &pipeline.display().to_string()]);
        let command = command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("started")
    };
    let both = [&remote.cell.pipeline(), &other].map(|own| start(own));
    let ended = both.map(|child| Ended::from(in_time(child)));
    for own in &ended {
        own.expect(NOT_SHOWN, &["1 done, 0 done before"]);
    }
    assert_eq!(requests(&remote), [FIRST, SECOND]);
    let later = ended.iter().filter(|own| own.results.contains("takes the place of run "));
    // Where both have their rows before either asks, each takes the place of the other.
    assert!(later.count() >= 1);
}
