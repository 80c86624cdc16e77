//! Fixed lists of station numbers as a suite states them: `0-98/2, 120` are 0, 2, … 98 and 120.

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

/// Largest station number that a list may have: no table of stations is larger, and a slip of the pen fills no memory.
const MOST: usize = 1_000_000;

/// Station numbers, from 0, as table `stations` counts them: of a table in the order of its rows.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct Numbers {
    text: String,
    numbers: BTreeSet<usize>,
}

impl Numbers {
    /// The numbers in order.
    pub const fn all(&self) -> &BTreeSet<usize> {
        &self.numbers
    }
}

impl From<Numbers> for String {
    fn from(numbers: Numbers) -> Self {
        numbers.text
    }
}

impl TryFrom<String> for Numbers {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let mut numbers = BTreeSet::new();
        for part in text.split(',').map(str::trim) {
            let (first, last, step) = range(part)?;
            for number in (first..=last).step_by(step) {
                if !numbers.insert(number) {
                    return Err(format!("station {number} is in {text:?} twice"));
                }
            }
        }
        Ok(Self { text, numbers })
    }
}

/// First, last and step of `7`, `0-9` or `0-98/2`.
fn range(part: &str) -> Result<(usize, usize, usize), String> {
    let wrong = || {
        format!(
            "{part:?} is no list of stations: write 7, 0-9 or 0-98/2 (every second), separated by commas, numbers up to {MOST}"
        )
    };
    let number = |text: &str| {
        let number = text.trim().parse().ok();
        number.filter(|own| *own <= MOST).ok_or_else(wrong)
    };
    let (ends, step) = match part.split_once('/') {
        Some((ends, step)) => (ends, number(step)?),
        None => (part, 1),
    };
    let (first, last) = match ends.split_once('-') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (number(ends)?, number(ends)?),
    };
    if first > last || step == 0 {
        return Err(wrong());
    }
    Ok((first, last, step))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_with_steps_become_numbers_and_slips_are_named() {
        let of = |text: &str| Numbers::try_from(text.to_owned());
        let numbers = of("0-9/3, 20, 22-23").unwrap();
        let numbers: Vec<usize> = numbers.all().iter().copied().collect();
        assert_eq!(numbers, [0, 3, 6, 9, 20, 22, 23]);
        for wrong in ["", "a", "5-2", "0-9/0", "-1", "0-99999999999", "1,,2"] {
            assert!(of(wrong).unwrap_err().contains("no list"), "{wrong}");
        }
        assert!(of("0-9, 4").unwrap_err().contains("station 4"));
    }
}
