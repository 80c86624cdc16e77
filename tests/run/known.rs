//! A fleet whose sessions were all worked on before: known by the index, whatever there is of it.

use std::fs;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

use posegrid::files::store::Place;
use posegrid::io::lake::{Lake, request_key};
use posegrid::pipeline::configuration::Overrides;
use posegrid::pipeline::fleet::Fleet;
use posegrid::pipeline::run::Known;

use super::cell::Cell;
use super::pretended;

/// Files that one file of a file system may be linked to, at least.
const LINKS: usize = 30_000;

/// A cell of robots with sessions that are links to the quickstart's logs.
fn fleet(robots: usize, sessions: usize) -> Cell {
    let cell = Cell::new()
        .with("name = \"kr210-demo\"\n", "")
        .with("# sessions", "robots = \"robots.csv\"");
    let names: Vec<String> = (0..robots).map(|robot| format!("kr{robot:03}")).collect();
    let rows: Vec<String> = names.iter().map(|name| format!("{name},0.5")).collect();
    fs::write(cell.path("robots.csv"), format!("name,tolerance.mm\n{}\n", rows.join("\n")))
        .expect("writable");
    for (place, (robot, session)) in names
        .iter()
        .flat_map(|robot| (0..sessions).map(move |session| (robot, session)))
        .enumerate()
    {
        let folder = cell.session(&format!("{robot}/day{session:03}"));
        fs::create_dir_all(&folder).expect("writable");
        for log in ["controller.mcap", "tracker.mcap"] {
            let own = cell.path(&format!("{}-{log}", place / LINKS));
            if !own.exists() {
                fs::copy(Path::new("tests/recordings/quickstart").join(log), &own).expect("copied");
            }
            fs::hard_link(own, folder.join(log)).expect("linked");
        }
    }
    cell
}

/// Writes an index that tells of a run of each session, and rows of those runs and of their requests that nothing can be read from.
fn pretend(cell: &Cell) {
    let fleet = Fleet::load(&cell.pipeline(), &[], &Overrides::default()).expect("a good file");
    let lake = Lake::at(&Place::of(cell.path("lake"))).expect("a folder");
    let known = Known::read(lake.clone()).expect("no index yet");
    for own in fleet.pieces() {
        let done = pretended::done(own, &lake);
        let keys = [lake.file_key("runs", &done.key), request_key(&done.key, done.asked)];
        for own in keys {
            let row = cell.path("lake").join(own.expect("a name"));
            fs::create_dir_all(row.parent().expect("a folder")).expect("writable");
            fs::write(row, "no table").expect("writable");
        }
        let state = known.state(own);
        known.keep(state.as_deref(), own, &done);
    }
    known.write().expect("writable");
}

/// Runs a fleet of which every session is known; gives the seconds that it took.
fn known(robots: usize, sessions: usize) -> f64 {
    let cell = fleet(robots, sessions);
    sleep(Duration::from_millis(2200));
    pretend(&cell);
    let begun = Instant::now();
    let ended = cell.run(&[]);
    let all = robots * sessions;
    ended.expect(
        0,
        &[
            "done-before  kr001/day001: within tolerance, run 0a\n",
            &format!("{all} of {all} within 0.5 mm, 0 without a result: 0 done, {all} done before"),
        ],
    );
    begun.elapsed().as_secs_f64()
}

#[test]
fn a_fleet_that_is_known_is_told_without_a_row_or_a_log() {
    known(3, 4);
}

/// Prints how long a year of 200 robots takes: `cargo test --test run known -- --ignored --nocapture`
#[test]
#[ignore = "73,000 sessions, some minutes to make"]
fn a_year_of_a_fleet_is_known_without_reading_it() {
    println!("{:.1} s", known(200, 365));
}
