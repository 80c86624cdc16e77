//! Storage that cannot be used: each time what, where and what to try, and an end.

use crate::cell::Ended;
use crate::server::Remote;
use crate::stub::Stub;

/// The end of a run whose environment differs in these variables; `None` for one that is not set.
fn run_with(remote: &Remote, changes: &[(&str, Option<&str>)]) -> Ended {
    let mut command = remote.run_command();
    for (name, value) in changes {
        match value {
            Some(value) => command.env(name, value),
            None => command.env_remove(name),
        };
    }
    let ended = Ended::from(command.output().expect("started"));
    remote.no_temporaries();
    ended
}

#[test]
fn what_the_environment_lacks_is_reported_before_anything_is_sent() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    for name in ["AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"] {
        let told = format!("{name} is not set");
        run_with(&remote, &[(name, None)]).expect(2, &["cannot use s3://bucket/", &told]);
    }
    run_with(&remote, &[("AWS_ALLOW_HTTP", None)])
        .expect(2, &["AWS_ENDPOINT_URL begins with http://"]);
    let named = [("AWS_ENDPOINT_URL", Some("http://me:hush@127.0.0.1:1"))];
    let ended = run_with(&remote, &named);
    ended.expect(2, &["AWS_ENDPOINT_URL holds a name and password"]);
    assert!(!ended.messages.contains("hush"), "{}", ended.messages);
}

#[test]
fn a_wrong_key_and_a_wrong_secret_are_reported() {
    let Some(remote) = Remote::strict(&["mon"]) else {
        return;
    };
    remote.run(&["--dry-run"]).expect(0, &["mon"]);
    let wrong = [("AWS_ACCESS_KEY_ID", Some("AKIANOBODY"))];
    run_with(&remote, &wrong).expect(2, &["InvalidAccessKeyId", "check AWS_ACCESS_KEY_ID"]);
    let wrong = [("AWS_SECRET_ACCESS_KEY", Some("another-secret"))];
    run_with(&remote, &wrong).expect(2, &["SignatureDoesNotMatch", "check AWS_ACCESS_KEY_ID"]);
}

#[test]
fn a_bucket_that_is_not_there_is_reported() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    let nowhere = remote.run(&["--lake", "s3://no-such-bucket/lake"]);
    nowhere.expect(1, &["s3://no-such-bucket/lake", "NoSuchBucket", "make the bucket"]);
    let verify = |lake: &str| {
        let mut command = remote.command(&["verify", lake]);
        Ended::from(command.output().expect("started"))
    };
    verify("s3://no-such-bucket/lake").expect(2, &["NoSuchBucket"]);
    verify(&remote.address("nothing")).expect(2, &["there is no lake in", "no row in runs"]);
    verify("s3://").expect(2, &["names no bucket", "s3://BUCKET/PREFIX"]);
    verify("s3://b/a//c").expect(2, &["two slashes"]);
}

#[test]
fn sessions_that_are_not_there_are_reported() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    let sessions = remote.address("sessions");
    remote.run(&[]).expect(2, &[&sessions]);
    remote.server.put(&remote.key("sessions/mon/controller.mcap"), Vec::new());
    remote.run(&[]).expect(0, &["waits", "mon: it has no tracker.mcap yet"]);
}

#[test]
fn a_dead_endpoint_ends_and_is_worth_another_try() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    // Nobody listens at port 1.
    let dead = [("AWS_ENDPOINT_URL", Some("http://127.0.0.1:1"))];
    run_with(&remote, &dead).expect(1, &["no answer", "Connection refused", "check the network"]);
    let silent = Stub::answering(None);
    let changes = [("AWS_ENDPOINT_URL", Some(silent.url.as_str())), ("AWS_TIMEOUT", Some("200ms"))];
    run_with(&remote, &changes).expect(1, &["no answer", "check the network"]);
    assert_eq!(silent.requests(), 4, "tried once, and three times more");
}

#[test]
fn storage_that_is_out_of_order_is_asked_four_times() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    let busy = Stub::answering(Some(
        "HTTP/1.1 503 Slow Down\r\nConnection: close\r\n\r\n\
         <Error><Code>SlowDown</Code><Message>Reduce your rate</Message></Error>",
    ));
    let changes = [("AWS_ENDPOINT_URL", Some(busy.url.as_str()))];
    run_with(&remote, &changes).expect(1, &["503", "check the network"]);
    assert_eq!(busy.requests(), 4);
}

#[test]
fn a_clock_that_is_off_is_reported_as_such() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    // The answer of S3 to a request that states a time an hour off.
    let skewed = Stub::answering(Some(
        "HTTP/1.1 403 Forbidden\r\nConnection: close\r\n\r\n\
         <Error><Code>RequestTimeTooSkewed</Code><Message>The difference between the request time and the current time is too large.\
         </Message></Error>",
    ));
    let changes = [("AWS_ENDPOINT_URL", Some(skewed.url.as_str()))];
    run_with(&remote, &changes)
        .expect(1, &["RequestTimeTooSkewed", "set this machine's clock", "run again"]);
    let mut tasks = remote.command(&["tasks", &remote.cell.pipeline().display().to_string()]);
    tasks.env("AWS_ENDPOINT_URL", &skewed.url);
    Ended::from(tasks.output().expect("started")).expect(75, &["set this machine's clock"]);
}
