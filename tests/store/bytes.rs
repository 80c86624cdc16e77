//! The same work on object storage and in folders: the same run, the same bytes, done once.

use std::process::Stdio;

use posegrid::files::{schema, table};

use crate::cell::{Ended, files};
use crate::server::{Remote, in_folders};
use crate::way::{Fault, Way};

#[test]
fn sessions_and_lake_on_object_storage_give_the_bytes_of_folders_once() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    let page = format!("page: {}/report/kr210-demo/mon/", remote.address("lake"));
    remote.run(&[]).expect(0, &["1 of 1 within 0.5 mm", &page]);
    assert!(remote.lake() == *in_folders(), "{:?}", remote.lake().keys());
    // Nothing is written again.
    let written = remote.server.keys(&remote.key("lake"));
    remote.run(&[]).expect(0, &["done before"]);
    assert_eq!(remote.server.keys(&remote.key("lake")), written);
    // It is known by listings and the index: no log is fetched, no row of `runs` read.
    let way = Way::to(&remote.server.url, Fault::Lost, 0, 0);
    let mut command = remote.run_command();
    command.env("AWS_ENDPOINT_URL", &way.url);
    Ended::from(command.output().expect("started")).expect(0, &["done before"]);
    let asked = way.asked();
    let listings = asked.iter().filter(|line| line.contains("list-type=2"));
    assert_eq!(
        listings.count(),
        5,
        "of sessions, lake, single tasks, runs and requests: {asked:#?}"
    );
    assert!(asked.len() <= 8, "{asked:#?}");
    let reads = |line: &String| line.contains(".mcap") || line.contains(".parquet");
    assert!(!asked.iter().any(reads), "{asked:#?}");
}

#[test]
fn a_lake_on_object_storage_is_verified_planned_for_and_read_by_others() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    remote.run(&[]).expect(0, &[]);
    let lake = remote.address("lake");
    let pipeline = remote.cell.pipeline().display().to_string();
    let verify = |arguments: &[&str]| {
        let mut command = remote.command(&["verify", &lake, "--pipeline", &pipeline]);
        let ended = Ended::from(command.args(arguments).output().expect("started"));
        remote.no_temporaries();
        ended
    };
    verify(&[]).expect(0, &["recomputed, byte for byte the same"]);
    verify(&["nobody"]).expect(2, &["neither a run nor a session in s3://"]);
    // A reader with nothing of ours sees as many rows as we wrote.
    let folder = tempfile::tempdir().expect("a folder");
    let mut rows = remote.server.rows_by_table(&remote.key("lake"));
    assert_eq!(rows.remove("asked"), Some(1));
    let mut tables = 0;
    for (name, bytes) in in_folders().iter().filter(|(name, _)| name.ends_with(".parquet")) {
        let name = name.split('/').next().expect("a table's folder");
        let file = folder.path().join("table");
        std::fs::write(&file, bytes).expect("writable");
        let table = table::read(&file, schema::find(name).expect("a table")).expect("read");
        assert_eq!(rows[name], table.rows(), "{name}");
        tables += 1;
    }
    assert_eq!(rows.len(), tables);
    // An object that no run wrote is told.
    let accuracy = in_folders().iter().find(|(key, _)| key.starts_with("accuracy/"));
    let forged = remote.key("lake/accuracy/r/x/zz.parquet");
    remote.server.put(&forged, accuracy.expect("it is published").1.clone());
    verify(&[]).expect(
        3,
        &["foreign: s3://", "accuracy/r/x/zz.parquet: it states that it is table accuracy of run "],
    );
    // A table that is altered is told.
    let altered = in_folders().keys().find(|key| key.starts_with("accuracy/"));
    let altered = format!("lake/{}", altered.expect("accuracy is published"));
    remote.server.put(&remote.key(&altered), b"torn".to_vec());
    verify(&[]).expect(3, &["altered"]);
}

#[test]
fn of_several_at_once_one_commits_and_the_others_say_so() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    let start = |_| {
        remote.run_command().stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("started")
    };
    let children: Vec<_> = (0..3).map(start).collect();
    let mut committed = 0;
    for child in children {
        let ended = Ended::from(child.wait_with_output().expect("our own child"));
        ended.expect(0, &["1 of 1 within 0.5 mm"]);
        let was_there =
            ended.results.contains(", done before)") || ended.results.contains("done-before");
        committed += usize::from(!was_there);
    }
    assert_eq!(committed, 1, "exactly one made the run exist");
    assert!(remote.lake() == *in_folders());
    remote.no_temporaries();
}

#[test]
fn decoded_samples_go_up_in_parts() {
    // Enough samples that table `logs` is larger than a part of an upload, 8 MiB.
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    let flags = ["--random", "60", "--joint-rate-hz", "2500"];
    let local = crate::cell::Cell::new().with_simulated("long", &flags);
    let local = local.with("lake = \"lake\"", "logs = true\nlake = \"lake\"");
    local.run(&[]).no_defect();
    let expected = local.lake();
    let logs = expected.iter().find(|(key, _)| key.starts_with("logs/"));
    let (key, bytes) = logs.expect("logs are published");
    assert!(bytes.len() > 8 << 20, "{key} takes {} bytes", bytes.len());
    for (log, bytes) in files(&local.session("long")) {
        remote.server.put(&remote.key(&format!("sessions/long/{log}")), bytes);
    }
    let remote = remote.with("lake = \"s3", "logs = true\nlake = \"s3");
    remote.run(&[]).no_defect();
    assert!(remote.lake() == expected, "{:?}", remote.lake().keys());
}
