//! Whether 95 % intervals hold the truth in 95 of 100 cases: the whole model on simulated sessions of several arms.
//!
//! The proof is of 500 sessions and runs by a command of its own, in about a quarter of an hour on two cores:
//! `cargo test --release --test coverage -- --ignored --nocapture`. It prints, per arm and for all, the share of intervals
//! that hold the truth, its standard error over sessions, and the mean squared normalised error. Six sessions of it are
//! among the normal tests.

#[path = "../common/mod.rs"]
mod common;
mod quantities;
mod session;
mod tally;

use quantities::{Angles, Quantity};
use rayon::prelude::*;
use session::{CELLS, Cell, Session};
use tally::Tally;

/// Stations of a session, a quarter of which are fresh poses.
const STATIONS: usize = 200;
/// Sessions of the proof.
const PROOF: usize = 500;

/// The tally of each arm, `sessions` in all.
fn tallies(sessions: usize) -> Vec<(&'static Cell, Tally)> {
    let of_arm = |(place, cell): (usize, &'static Cell)| {
        let own: Vec<usize> = (place..sessions).step_by(CELLS.len()).collect();
        let tally = |seed: &usize| quantities::of(&Session::new(cell, *seed as u64, STATIONS));
        let tallies: Vec<Tally> = own.par_iter().map(tally).collect();
        (cell, Tally::of(&tallies))
    };
    CELLS.iter().enumerate().map(of_arm).collect()
}

fn show(name: &str, tally: &Tally) {
    println!(
        "\n{name:<58} {:>9} {:>7} {:>12}",
        "inside", "± se", "mean square"
    );
    for quantity in Quantity::all() {
        let share = tally.share(quantity);
        println!(
            "{quantity:<58} {:>7.2} % {:>7.2} {:>12.2}   of {}",
            100.0 * share.inside,
            100.0 * share.error,
            share.mean_square,
            share.intervals
        );
    }
}

#[test]
#[ignore = "a long proof: cargo test --release --test coverage -- --ignored --nocapture"]
fn intervals_hold_the_truth_in_95_of_100_cases() {
    let tallies = tallies(PROOF);
    for (cell, tally) in &tallies {
        show(cell.name, tally);
    }
    let all = Tally::of(tallies.iter().map(|(_, tally)| tally));
    show("all arms", &all);
}
