//! Bits of a table's file that are not what they were: refused, or without a trace in any correction.

use std::fs;
use std::ops::Range;

use parquet::file::metadata::{ColumnChunkMetaData, RowGroupMetaData};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::compensate::cell::{Cell, SAMPLE};

/// Targets in several cells of the grid.
const TARGETS: &str =
    "target,x_mm,y_mm,z_mm\na,751,20,450\nb,652.5,-20.25,555.125\nc,610,10,410\nd,790,60,590\n";
const FLIPS: usize = 500;

/// Flips so many bits of the table's file within `bytes`, one at a time; gives how many were refused. No other correction may
/// come of any.
fn refused(cell: &Cell, within: &[Range<usize>], seed: u64) -> usize {
    let (_, sound) = cell.csv(TARGETS).unwrap();
    let bytes = fs::read(&cell.table).unwrap();
    let places: Vec<usize> = within.iter().cloned().flatten().collect();
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut refused = 0;
    for _ in 0..FLIPS {
        let byte = places[random.random_range(0..places.len())];
        let bit = random.random_range(0..8);
        let mut flipped = bytes.clone();
        flipped[byte] ^= 1 << bit;
        fs::write(&cell.table, flipped).unwrap();
        match cell.csv(TARGETS) {
            Ok((_, corrected)) => assert_eq!(corrected, sound, "bit {bit} of byte {byte}"),
            Err(_) => refused += 1,
        }
    }
    fs::write(&cell.table, &bytes).unwrap();
    refused
}

/// Where the values of each column stand in the file.
fn pages(cell: &Cell) -> Vec<Range<usize>> {
    let file = fs::File::open(&cell.table).unwrap();
    let reader = SerializedFileReader::new(file).unwrap();
    let groups = reader.metadata().row_groups().iter();
    let columns = groups.flat_map(RowGroupMetaData::columns);
    let ranges = columns.map(ColumnChunkMetaData::byte_range);
    let range = |(start, length): (u64, u64)| {
        let [start, length] = [start, length].map(|own| usize::try_from(own).unwrap());
        start..start + length
    };
    ranges.map(range).collect()
}

#[test]
fn a_flipped_bit_gives_an_error_or_the_same_corrections() {
    let cell = Cell::new(&SAMPLE);
    let whole = 0..fs::read(&cell.table).unwrap().len();
    assert!(refused(&cell, &[whole], 20) > 0);
    // Where the values stand, all but what a reader passes over is refused.
    let found = refused(&cell, &pages(&cell), 21);
    assert!(found > FLIPS / 2, "only {found} of {FLIPS} were refused");
}
