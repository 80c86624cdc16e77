//! Nothing secret is told: not in results, messages, tables or pages, however much is asked for.

use crate::cell::Ended;
use crate::server::Remote;
use crate::stub::Stub;

/// A token that looks like none of ours.
const TOKEN: &str = "session-token-0123456789";

fn assert_silent(remote: &Remote, ended: &Ended) {
    for secret in [&remote.server.secret, TOKEN, &remote.server.key] {
        assert!(!ended.results.contains(secret), "{}", ended.results);
        assert!(!ended.messages.contains(secret), "{}", ended.messages);
    }
}

#[test]
fn a_run_that_tells_everything_tells_no_secret() {
    let Some(remote) = Remote::new(&["mon"]) else {
        return;
    };
    let mut command = remote.run_command();
    command.env("RUST_LOG", "trace").args(["--log-format", "json"]);
    let ended = Ended::from(command.output().expect("started"));
    assert_eq!(ended.code, 0, "{}", ended.messages);
    assert_silent(&remote, &ended);
    let lake = remote.lake();
    assert!(!lake.is_empty());
    for (key, bytes) in lake {
        for secret in [&remote.server.secret, &remote.server.key, &remote.server.url] {
            let is_there = bytes.windows(secret.len()).any(|part| part == secret.as_bytes());
            assert!(!is_there, "{key} holds {secret}");
        }
    }
}

#[test]
fn an_answer_that_quotes_the_request_is_not_repeated() {
    let Some(remote) = Remote::new(&[]) else {
        return;
    };
    // As Amazon refuses a signature: with the request as it was signed, session token included.
    let quoting = Stub::answering(Some(
        "HTTP/1.1 403 Forbidden\r\nConnection: close\r\n\r\n<Error><Code>SignatureDoesNotMatch</Code>\
         <Message>Not for session-token-0123456789</Message>\
         <CanonicalRequest>x-amz-security-token:session-token-0123456789</CanonicalRequest></Error>",
    ));
    let mut command = remote.run_command();
    command
        .env("AWS_ENDPOINT_URL", &quoting.url)
        .env("AWS_SESSION_TOKEN", TOKEN)
        .env("RUST_LOG", "trace");
    let ended = Ended::from(command.output().expect("started"));
    ended.expect(2, &["SignatureDoesNotMatch, Not for …", "check AWS_ACCESS_KEY_ID"]);
    assert_silent(&remote, &ended);
    assert!(quoting.requests() > 0);
}
