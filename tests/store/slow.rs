//! A fleet whose sessions were all worked on before, on storage of which every request takes its time: known by listings and the index.
//!
//! All of a year is `cargo test --features s3 --test store slow -- --ignored --nocapture a_year`.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

use posegrid::io::lake::Lake;
use posegrid::pipeline::configuration::Overrides;
use posegrid::pipeline::fleet::Fleet;
use posegrid::pipeline::run::Known;

use crate::cell::{Cell, Ended};
use crate::memory::Memory;
use crate::pretended::{self, RUN};
use crate::server::BUCKET;

/// The time that each answer takes.
const DELAY: Duration = Duration::from_millis(5);
/// The variable by which a process of this test learns the pipeline file.
const PIPELINE: &str = "POSEGRID_TEST_PIPELINE";

struct Slow {
    cell: Cell,
    memory: Memory,
    robots: usize,
    sessions: usize,
}

impl Slow {
    /// A fleet of sessions that were all done: those of the first robot by single tasks, the others by a batch.
    fn known(robots: usize, sessions: usize) -> Self {
        let cell = Cell::new()
            .with("name = \"kr210-demo\"\n", "")
            .with("# sessions", "robots = \"robots.csv\"")
            .with("\"sessions\"", &format!("\"s3://{BUCKET}/sessions\""))
            .with("\"lake\"", &format!("\"s3://{BUCKET}/lake\""));
        let memory = Memory::answering_after(DELAY);
        let mut rows = "name,tolerance.mm\n".to_owned();
        for robot in 0..robots {
            writeln!(rows, "kr{robot:03},0.5").expect("a text");
            for session in 0..sessions {
                for log in ["controller", "tracker"] {
                    let key = format!("sessions/kr{robot:03}/day{session:03}/{log}.mcap");
                    memory.put(&key, format!("{log} {robot} {session}").into_bytes());
                }
                let row = format!("lake/runs/kr{robot:03}/day{session:03}/{RUN}.parquet");
                memory.put(&row, b"no table".to_vec());
                let request = format!("lake/asked/kr{robot:03}/day{session:03}/00000001.parquet");
                memory.put(&request, b"no table".to_vec());
            }
        }
        fs::write(cell.path("robots.csv"), rows).expect("writable");
        let slow = Self { cell, memory, robots, sessions };
        // What the lake's index holds depends on the variables of a process, which no test may set for others.
        let own = std::env::current_exe().expect("this test");
        let made = Command::new(own)
            .args(["--ignored", "--exact", "slow::of_a_process_of_its_own"])
            .env(PIPELINE, slow.cell.pipeline())
            .envs(slow.memory.environment())
            .output()
            .expect("started");
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stdout));
        slow.memory.asked();
        slow
    }

    fn command(&self, name: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_posegrid"));
        command.arg(name).arg(self.cell.pipeline()).envs(self.memory.environment());
        command
    }

    /// The requests of a command, which has to end well and tell this.
    fn asked_by(&self, command: &mut Command, told: &[&str]) -> Vec<String> {
        let ended = Ended::from(command.output().expect("started"));
        ended.expect(0, told);
        self.memory.asked()
    }

    /// Bounds the requests for all sessions: listings by the keys that there are, and reads of the index and of this many tasks.
    fn is_bounded(&self, asked: &[String], alone: usize) {
        let all = self.robots * self.sessions;
        let thousands = |keys: usize| keys.div_ceil(1000).max(1);
        // Sessions, runs, requests, single tasks; and the lake, which has to answer.
        let listings = thousands(2 * all) + 2 * thousands(all) + thousands(self.sessions) + 1;
        let (listed, others): (Vec<&String>, Vec<&String>) =
            asked.iter().partition(|line| line.contains("list-type=2"));
        let of = |what: &str| others.iter().filter(|line| line.contains(what)).count();
        assert!(listed.len() <= listings, "{} of {listings}", listed.len());
        assert_eq!(of("/.index/alone/"), alone);
        assert_eq!(of(".mcap"), 0, "no log is read");
        assert_eq!(of(".parquet"), 0, "no row is read");
        let of_index = others.len() - alone;
        // Looked for, and read and written in parts of 8 MiB, of 400 bytes a session.
        let parts = (all * 400).div_ceil(8 << 20);
        assert!(of_index <= 4 + 2 * (parts + 1), "{of_index}: {asked:#?}");
    }
}

fn told(robots: usize, sessions: usize) -> Slow {
    let slow = Slow::known(robots, sessions);
    let all = robots * sessions;
    let summary =
        format!("{all} of {all} within 0.5 mm, 0 without a result: 0 done, {all} done before");
    let begun = Instant::now();
    let first = slow.asked_by(&mut slow.command("run"), &[&summary]);
    println!("{all} sessions: {:.1} s, {} requests", begun.elapsed().as_secs_f64(), first.len());
    slow.is_bounded(&first, sessions);
    // What single tasks did is in the index now.
    let begun = Instant::now();
    let again = slow.asked_by(&mut slow.command("run"), &[&summary]);
    println!("and again: {:.1} s, {} requests", begun.elapsed().as_secs_f64(), again.len());
    slow.is_bounded(&again, 0);
    slow
}

#[test]
fn a_fleet_on_slow_storage_is_known_by_listings_and_the_index() {
    told(3, 40);
}

#[test]
fn single_tasks_are_listed_by_their_own_files_which_are_read_once() {
    let slow = Slow::known(2, 30);
    let listed = slow.asked_by(&mut slow.command("tasks"), &[]);
    slow.is_bounded(&listed, 30);
    slow.is_bounded(&slow.asked_by(&mut slow.command("tasks"), &[]), 0);
    // A task that was done asks for its own, however many there are.
    let id = fs::read_to_string(slow.cell.path("task")).expect("a state");
    let mut task = slow.command("task");
    task.args(["--id", &id, "--robot", "kr000"]);
    let asked = slow.asked_by(&mut task, &["\"ended\":\"done-before\""]);
    // Among them its request, and whether there is a later one.
    assert!(asked.len() <= 8, "{asked:#?}");
}

/// Prints how long a year of 200 robots takes, with what it asks for.
#[test]
#[ignore = "73,000 sessions; see .github/CONTRIBUTING.md"]
fn a_year_of_a_fleet_on_slow_storage_is_known_within_a_minute() {
    let begun = Instant::now();
    told(200, 365);
    println!("with its making {:.1} s", begun.elapsed().as_secs_f64());
}

#[test]
#[ignore = "part of the others, in a process of its own"]
fn of_a_process_of_its_own() {
    let Some(pipeline) = std::env::var_os(PIPELINE).map(PathBuf::from) else {
        return;
    };
    let fleet = Fleet::load(&pipeline, &[], &Overrides::default()).expect("a good file");
    let lake = Lake::at(&fleet.lake).expect("it answers");
    let known = Known::nothing(lake.clone());
    let mut first = None;
    for own in fleet.pieces() {
        let done = pretended::done(own, &lake);
        let state = known.state(own).expect("it has a tag");
        if done.key.robot == "kr000" {
            known.keep_alone(&state, own, &done).expect("writable");
            first.get_or_insert(state);
        } else {
            known.keep(Some(&state), own, &done);
        }
    }
    known.write().expect("writable");
    fs::write(pipeline.with_file_name("task"), first.expect("a robot with sessions"))
        .expect("writable");
}
