//! Bits of a table's file that are not what they were: refused, or without a trace in any correction.

use std::fs;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::cell::{Cell, SAMPLE};

/// Targets in every cell of the grid.
const TARGETS: &str =
    "target,x_mm,y_mm,z_mm\na,751,20,450\nb,652.5,-20.25,555.125\nc,610,10,410\nd,790,60,590\n";

#[test]
fn a_flipped_bit_gives_an_error_or_the_same_corrections() {
    let cell = Cell::new(&SAMPLE);
    let (_, sound) = cell.csv(TARGETS).unwrap();
    let bytes = fs::read(&cell.table).unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(20);
    let (mut refused, mut other) = (0, Vec::new());
    for _ in 0..500 {
        let bit = random.random_range(0..8 * bytes.len());
        let mut flipped = bytes.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        fs::write(&cell.table, flipped).unwrap();
        match cell.csv(TARGETS) {
            Ok((_, corrected)) if corrected == sound => {}
            Ok(_) => other.push(bit),
            Err(_) => refused += 1,
        }
    }
    assert!(
        other.is_empty(),
        "other corrections with these bits flipped: {other:?}"
    );
    // The rest fell on names and statistics that no value follows from.
    assert!(refused > 200, "only {refused} of 500 were refused");
}
