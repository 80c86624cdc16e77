//! Requests that go wrong on the way, each in turn: refused, lost, served and not answered, answered by half, answered late.
//!
//! After each of them the run has published the same bytes as ever, once, and says so; or it says what went wrong, with exit
//! code 1, and the next one finishes the work. A lake is never half there: its row in `runs` comes last. A sample is among the
//! tests; all of it is `cargo test --features s3 --test store faults -- --ignored --nocapture`.

use std::collections::BTreeMap;
use std::process::{Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use crate::cell::{Cell, Ended, files, in_time};
use crate::server::Remote;
use crate::way::{Fault, PATIENT, Way};

/// What a run of the session exits with when nothing is wrong: so few stations cannot show 95 %.
const UNDISTURBED: i32 = 3;
/// Everything that may go wrong with a request.
const FAULTS: [Fault; 7] = [
    Fault::Refused("503 Slow Down"),
    Fault::Refused("500 Internal Server Error"),
    Fault::Denied("500 Internal Server Error"),
    Fault::Lost,
    Fault::Unanswered,
    Fault::Cut,
    Fault::Late,
];

/// More requests than any run makes.
const TO_THE_END: usize = 1_000_000;

/// A small session in folders, its logs and the lake that an undisturbed run makes of it.
struct Small {
    logs: BTreeMap<String, Vec<u8>>,
    lake: BTreeMap<String, Vec<u8>>,
}

fn small() -> &'static Small {
    static SMALL: OnceLock<Small> = OnceLock::new();
    SMALL.get_or_init(|| {
        let cell = Cell::new().with_simulated("mon", &["--random", "12"]);
        cell.run(&[]).expect(UNDISTURBED, &["1 done, 0 done before"]);
        Small { logs: files(&cell.session("mon")), lake: cell.lake() }
    })
}

/// The same session on the server; `None` where there is none.
fn remote() -> Option<Remote> {
    with_session(&small().logs)
}

/// A session of these logs on the server.
fn with_session(logs: &BTreeMap<String, Vec<u8>>) -> Option<Remote> {
    let remote = Remote::new(&[])?;
    for (log, bytes) in logs {
        let key = remote.key(&format!("sessions/mon/{log}"));
        remote.server.put(&key, bytes.clone());
    }
    Some(remote)
}

/// Runs a command to its end, with the storage at the end of a way.
fn over(way: &Way, mut command: Command) -> Ended {
    command
        .env("AWS_ENDPOINT_URL", &way.url)
        .env("AWS_TIMEOUT", PATIENT)
        // What goes wrong to the end need not be waited for.
        .env("AWS_MAX_ATTEMPTS", "4")
        .env("RAYON_NUM_THREADS", "1")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    Ended::from(in_time(command.spawn().expect("started")))
}

/// The requests of an undisturbed run.
fn requests() -> Vec<String> {
    let remote = remote().expect("a server, as the caller has one");
    let way = Way::to(&remote.server.url, Fault::Lost, 0, 0);
    over(&way, remote.run_command()).expect(UNDISTURBED, &["1 done, 0 done before"]);
    assert!(remote.lake() == small().lake);
    way.asked()
}

/// A run of which a request goes wrong, and what has to hold then; gives whether it came through.
fn survives(fault: Fault, number: usize, count: usize) -> bool {
    let remote = remote().expect("a server, as the caller has one");
    let way = Way::to(&remote.server.url, fault, number, count);
    let ended = over(&way, remote.run_command());
    let asked = way.asked();
    let what = format!(
        "{fault:?} of {:?}, {count} in a row: {}{}",
        asked.get(number),
        ended.results,
        ended.messages
    );
    ended.no_defect();
    remote.no_temporaries();
    let came_through = ended.code == UNDISTURBED;
    if came_through {
        assert!(ended.results.contains("1 done, 0 done before"), "{what}");
    } else {
        assert_eq!(ended.code, 1, "{what}");
        assert!(ended.messages.contains("s3://bucket/"), "{what}");
        assert!(ended.messages.contains("run again"), "{what}");
    }
    let again = remote.run(&[]);
    again.expect(UNDISTURBED, &[]);
    let is_there = again.results.contains("0 done, 1 done before");
    assert!(is_there || !came_through, "{what}");
    assert!(remote.lake() == small().lake, "{what}");
    // It was asked for once, whichever of both runs did.
    let asked = remote.server.keys(&remote.key("lake/asked"));
    let asked: Vec<String> = asked.into_keys().collect();
    assert_eq!(asked, ["kr210-demo/mon/00000001.parquet"], "{what}");
    came_through
}

/// Numbers of the requests that put something below the lake's folder of this name.
fn puts(requests: &[String], folder: &str) -> Vec<usize> {
    let numbered = requests.iter().enumerate();
    let is_put = |line: &str| {
        let is_of_index = line.contains("/lake/.index/");
        line.starts_with("PUT ") && line.contains(&format!("/lake/{folder}")) && !is_of_index
    };
    let found = numbered.filter(|(_, line)| is_put(line));
    found.map(|(number, _)| number).collect()
}

fn is_there() -> bool {
    Remote::new(&[]).is_some()
}

#[test]
fn a_request_that_goes_wrong_once_is_asked_again() {
    if !is_there() {
        return;
    }
    let requests = requests();
    // Each fault at another request, and each at the one that makes the run exist.
    let commit = puts(&requests, "runs/")[0];
    for (place, fault) in FAULTS.into_iter().enumerate() {
        let elsewhere = place * requests.len() / FAULTS.len();
        for number in [commit, elsewhere] {
            assert!(survives(fault, number, 1), "{fault:?} of {:?}", requests[number]);
        }
    }
}

#[test]
fn requests_that_go_wrong_to_the_end_are_reported_and_the_next_run_does_the_work() {
    if !is_there() {
        return;
    }
    let requests = requests();
    let put = puts(&requests, "");
    for (fault, number) in [
        (Fault::Refused("503 Slow Down"), put[0]),
        (Fault::Lost, put[put.len() / 2]),
        (Fault::Unanswered, put[put.len() - 1]),
    ] {
        assert!(!survives(fault, number, TO_THE_END), "{fault:?} at {number}");
    }
    // Without the index of finished work a run has its result all the same.
    let of_index = |line: &String| line.starts_with("PUT ") && line.contains("/lake/.index/");
    let index = requests.iter().position(of_index);
    let index = index.expect("it is kept");
    assert!(survives(Fault::Lost, index, TO_THE_END));
}

#[test]
fn a_request_that_is_lost_after_its_run_exists_is_repeated() {
    if !is_there() {
        return;
    }
    let requests = requests();
    let [asked] = puts(&requests, "asked/")[..] else {
        panic!("one request: {requests:#?}");
    };
    assert!(asked > puts(&requests, "runs/")[0], "after the row of the run");
    assert!(!survives(Fault::Lost, asked, TO_THE_END));
    assert!(survives(Fault::Unanswered, asked, 1));
}

#[test]
fn an_upload_in_parts_of_which_any_answer_is_lost_is_there_once() {
    if !is_there() {
        return;
    }
    // Enough samples that table `logs` is larger than a part of an upload, 8 MiB.
    let flags = ["--random", "60", "--joint-rate-hz", "2500"];
    let local = Cell::new().with_simulated("mon", &flags);
    let local = local.with("lake = \"lake\"", "logs = true\nlake = \"lake\"");
    let code = local.run(&[]).code;
    let logs = files(&local.session("mon"));
    let run = |number, count| {
        let remote = with_session(&logs).expect("a server");
        let remote = remote.with("lake = \"s3", "logs = true\nlake = \"s3");
        let way = Way::to(&remote.server.url, Fault::Unanswered, number, count);
        let ended = over(&way, remote.run_command());
        ended.expect(code, &["1 done, 0 done before"]);
        assert!(remote.lake() == local.lake(), "number {number}");
        way.asked()
    };
    let requests = run(0, 0);
    let of_upload = |line: &str| line.contains("uploads=") || line.contains("uploadId=");
    let numbers = (0..requests.len()).filter(|&number| of_upload(&requests[number]));
    let numbers: Vec<usize> = numbers.collect();
    assert!(numbers.len() >= 4, "begun, two parts, complete: {requests:#?}");
    for number in numbers {
        run(number, 1);
    }
}

/// A run of storage that has no time for anybody from one request on, for so long, with all its patience.
fn waits(number: usize, length: Duration) {
    let remote = remote().expect("a server, as the caller has one");
    let way = Way::out(&remote.server.url, number, length);
    let mut command = remote.run_command();
    command.env("AWS_ENDPOINT_URL", &way.url);
    let ended = Ended::from(command.output().expect("started"));
    ended.expect(UNDISTURBED, &["1 done, 0 done before"]);
    remote.no_temporaries();
    assert!(remote.lake() == small().lake);
    println!("out from {:?}", way.asked()[number]);
}

#[test]
fn an_outage_under_way_is_waited_for() {
    if !is_there() {
        return;
    }
    // Longer than storage that never answered is asked.
    waits(puts(&requests(), "runs/")[0], Duration::from_secs(5));
}

#[test]
fn an_outage_from_the_first_request_on_is_reported_and_nothing_is_lost() {
    let Some(remote) = remote() else {
        return;
    };
    let way = Way::out(&remote.server.url, 0, Duration::from_mins(1));
    let pipeline = remote.cell.pipeline().display().to_string();
    for (arguments, code) in [(["run", &pipeline], 1), (["tasks", &pipeline], 75)] {
        let mut command = remote.command(&arguments);
        command.env("AWS_ENDPOINT_URL", &way.url);
        let ended = Ended::from(command.output().expect("started"));
        ended.expect(code, &["503", "run again: nothing half done counts"]);
    }
    remote.run(&[]).expect(UNDISTURBED, &["1 done, 0 done before"]);
    assert!(remote.lake() == small().lake);
}

#[test]
#[ignore = "five minutes; see .github/CONTRIBUTING.md"]
fn a_minute_without_an_answer_is_waited_for() {
    if !is_there() {
        return;
    }
    let requests = requests();
    let put = puts(&requests, "");
    let read = requests.iter().position(|line| line.contains(".mcap"));
    let read = read.expect("logs are fetched");
    for number in [read, put[0], put[put.len() / 2], puts(&requests, "runs/")[0]] {
        waits(number, Duration::from_mins(1));
    }
}

#[test]
#[ignore = "half an hour: every fault at every request; see .github/CONTRIBUTING.md"]
fn any_request_may_go_wrong() {
    if !is_there() {
        return;
    }
    let requests = requests();
    for fault in FAULTS {
        let failed = (0..requests.len()).filter(|&number| !survives(fault, number, 1));
        let failed: Vec<&str> = failed.map(|number| requests[number].as_str()).collect();
        println!(
            "{fault:?} at each of {} requests; finished by the next run: {failed:#?}",
            requests.len()
        );
    }
    for fault in [Fault::Refused("503 Slow Down"), Fault::Lost] {
        let through = |&number: &usize| survives(fault, number, TO_THE_END);
        let count = (0..requests.len()).filter(through).count();
        println!("{fault:?} from each request on: {count} of {} runs came through", requests.len());
    }
}
