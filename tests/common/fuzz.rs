//! Fuzzing without instruments of the compiler: inputs are changed at random, and one that comes out in a way not seen
//! before is kept to be changed again.
//!
//! As a test each target runs for a few hundred inputs that are the same every time. For longer set
//! `POSEGRID_FUZZ_SECONDS`, which begins somewhere else each time. An input that fails is written into the folder for
//! temporaries, and its path told.

#![allow(dead_code, reason = "each test binary uses its own part")]

use std::collections::BTreeSet;
use std::fs;
use std::panic::{self, AssertUnwindSafe};
use std::time::{Duration, Instant};

/// Inputs of one target in the tests.
pub const INPUTS: u32 = 300;
/// The longest input; longer ones only take longer.
pub const LONGEST: usize = 64 * 1024;

/// Numbers that look random (splitmix64).
pub struct Chance(u64);

impl Chance {
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub fn below(&mut self, limit: usize) -> usize {
        usize::try_from(self.next() % limit.max(1) as u64).expect("below a usize")
    }

    pub fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }
}

/// Numbers at which programs stumble.
pub const NUMBERS: [u64; 9] =
    [0, 1, 0x7f, 0xff, 0xffff, 0x7fff_ffff, 0xffff_ffff, 1 << 40, u64::MAX];

/// Changes bytes in one of the ways that files break, or that programs lie.
pub fn change(bytes: &mut Vec<u8>, others: &[Vec<u8>], chance: &mut Chance) {
    let at = chance.below(bytes.len());
    let end = (at + 1 + chance.below(64)).min(bytes.len());
    match chance.below(8) {
        _ if bytes.is_empty() => bytes.push(chance.next().to_le_bytes()[0]),
        0 => bytes[at] ^= 1 << chance.below(8),
        1 => bytes[at] = chance.next().to_le_bytes()[0],
        2 => {
            let number = chance.of(&NUMBERS).to_le_bytes();
            let width = *chance.of(&[1, 2, 4, 8]);
            let end = (at + width).min(bytes.len());
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
        3 => drop(bytes.drain(at..end)),
        4 => {
            let again = bytes[at..end].to_vec();
            let to = chance.below(bytes.len());
            drop(bytes.splice(to..to, again));
        }
        5 => {
            let other = chance.of(others);
            let from = chance.below(other.len());
            let to = (from + 1 + chance.below(512)).min(other.len());
            let end = (at + to - from).min(bytes.len());
            drop(bytes.splice(at..end, other[from..to].to_vec()));
        }
        6 => bytes[at..end].fill(0),
        _ => bytes.truncate(at),
    }
    bytes.truncate(LONGEST);
}

/// Changes a text in one of the ways that people do.
pub fn change_text(bytes: &mut Vec<u8>, others: &[Vec<u8>], chance: &mut Chance) {
    const WORDS: [&str; 14] = [
        "0",
        "-1",
        "1e308",
        "-1e-308",
        "nan",
        "inf",
        "[]",
        "\"\"",
        "{}",
        "true",
        "\"../../..\"",
        "\"/\"",
        "18446744073709551616",
        "\"\u{202e}\u{1b}[2J\"",
    ];
    let text = String::from_utf8_lossy(bytes).into_owned();
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    let at = chance.below(lines.len());
    match chance.below(6) {
        _ if lines.is_empty() => return change(bytes, others, chance),
        0 => drop(lines.remove(at)),
        1 => lines.insert(chance.below(lines.len()), lines[at].clone()),
        2 | 3 => {
            let word = *chance.of(&WORDS);
            if let Some((key, _)) = lines[at].split_once('=') {
                lines[at] = format!("{key}= {word}");
            }
        }
        4 => {
            let other = chance.below(lines.len());
            lines.swap(at, other);
        }
        _ => return change(bytes, others, chance),
    }
    *bytes = lines.join("\n").into_bytes();
    bytes.truncate(LONGEST);
}

/// What stands between the signs of a table, a list or a document, changed into what may not stand there.
pub fn change_words(bytes: &mut Vec<u8>, others: &[Vec<u8>], chance: &mut Chance) {
    const WORDS: [&str; 30] = [
        "", "0", "-1", "1575,7", "1e999", "-1e-308", "nan", "0x1F", "'B101'", "\"", "'", "{", "}",
        "[", "]", ",", ";", ":", "=", "\n", "\r", "DEFDAT L", "ENDDAT", "E6POS", "X 1", "X",
        "table_id", "Table_ID", "=1+1", "\u{feff}",
    ];
    let is_sign = |byte: &u8| b",;:={}[]\" \n\r\t".contains(byte);
    if bytes.is_empty() || chance.below(4) == 0 {
        return change(bytes, others, chance);
    }
    let at = chance.below(bytes.len());
    let start = bytes[..at].iter().rposition(is_sign).map_or(0, |place| place + 1);
    let end = bytes[at..].iter().position(is_sign).map_or(bytes.len(), |place| at + place);
    let word = chance.of(&WORDS).as_bytes().to_vec();
    if chance.below(3) == 0 {
        // The sign itself.
        drop(bytes.splice(at..=at, word));
    } else {
        drop(bytes.splice(start..end.max(start), word));
    }
    bytes.truncate(LONGEST);
}

pub type Change = fn(&mut Vec<u8>, &[Vec<u8>], &mut Chance);

/// Runs a target on changed seeds; it tells in a few words how an input came out.
pub fn fuzz(name: &str, seeds: Vec<Vec<u8>>, change: Change, target: impl Fn(&[u8]) -> String) {
    let seconds = std::env::var("POSEGRID_FUZZ_SECONDS").ok();
    let seconds = seconds.map(|text| text.parse().expect("POSEGRID_FUZZ_SECONDS is a number"));
    let begun = Instant::now();
    // Other inputs each time where time is given; the same ones in the tests.
    let start = seconds.map_or(1, |_: u64| {
        u64::from(std::process::id()) << 32 | u64::from(begun.elapsed().subsec_nanos())
    });
    let mut chance = Chance(start);
    let mut pool = seeds;
    let mut seen: BTreeSet<String> = pool.iter().map(|seed| tried(name, seed, &target)).collect();
    let mut count = 0_u64;
    let goes_on = |count| match seconds {
        None => count < u64::from(INPUTS),
        Some(seconds) => begun.elapsed() < Duration::from_secs(seconds),
    };
    while goes_on(count) {
        let mut input = chance.of(&pool).clone();
        for _ in 0..=chance.below(6) {
            change(&mut input, &pool, &mut chance);
        }
        let outcome = tried(name, &input, &target);
        if seen.len() < 5000 && seen.insert(outcome) {
            pool.push(input);
        }
        count += 1;
    }
    println!("{name}: {count} inputs, {} outcomes, clean", seen.len());
    assert!(seen.len() > 3, "{name}: the inputs hardly differ: {seen:?}");
}

/// Tries an input; if that panics, keeps it.
fn tried(name: &str, input: &[u8], target: &impl Fn(&[u8]) -> String) -> String {
    if let Ok(outcome) = panic::catch_unwind(AssertUnwindSafe(|| target(input))) {
        return without_numbers(&outcome);
    }
    let file = format!("posegrid-fuzz-{name}-{}", std::process::id());
    let path = std::env::temp_dir().join(file);
    fs::write(&path, input).expect("room for the input that fails");
    panic!("{name}: fails on {}", path.display());
}

/// Outcomes that differ in numbers or names only are one.
fn without_numbers(text: &str) -> String {
    let words = text.split(|c: char| !c.is_alphabetic());
    let words: Vec<_> = words.filter(|word| word.len() > 2).collect();
    words.join(" ").chars().take(300).collect()
}
