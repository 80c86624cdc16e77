//! Coverage.

#[path = "../common/mod.rs"]
mod common;
mod quantities;
mod session;
mod tally;

use rayon::prelude::*;
use session::{CELLS, Session};
use tally::Tally;

#[test]
#[ignore = "long"]
fn explore() {
    let number = |name: &str, default: u64| {
        std::env::var(name).map_or(default, |n| n.parse().expect("a number"))
    };
    let sessions = number("SESSIONS", 30);
    let stations = usize::try_from(number("STATIONS", 200)).expect("small");
    let mut total = Tally::default();
    let only = std::env::var("CELL").ok();
    for cell in &CELLS {
        if only
            .as_ref()
            .is_some_and(|only| !cell.name.starts_with(only.as_str()))
        {
            continue;
        }
        let tallies: Vec<Tally> = (0..sessions)
            .into_par_iter()
            .map(|seed| {
                let session = Session::new(cell, 1000 + seed, stations);
                if seed == 0 {
                    let m = &session.model;
                    println!("{:?}", m.repeatability);
                    println!("{:?}", m.parts);
                    println!(
                        "weights mean {}",
                        m.weights.iter().sum::<f64>() / m.weights.len() as f64
                    );
                }
                quantities::of(&session)
            })
            .collect();
        let mut own = Tally::default();
        for tally in &tallies {
            own.merge(tally);
        }
        println!("== {}", cell.name);
        show(&own);
        total.merge(&own);
    }
    println!("== all");
    show(&total);
}

fn show(tally: &Tally) {
    for quantity in tally.quantities() {
        if let Some(share) = tally.share(quantity) {
            println!(
                "{quantity:<40} {:6.2} % ± {:4.2}  mean square {:5.2}  n {}",
                100.0 * share.share,
                100.0 * share.error,
                share.mean_square,
                share.intervals
            );
        }
    }
}
