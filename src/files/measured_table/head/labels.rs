//! Labels above the header, which tell columns of one name from each other: a reflector's name above its x, y and z.

use std::collections::BTreeSet;

use super::SampleRow;

const MOST: usize = 5;
const LETTERS: usize = 64;

/// Names of columns; those that several columns have carry the labels above them in front, where that tells them apart.
pub(super) fn labelled(names: Vec<String>, above: &[SampleRow]) -> Vec<String> {
    let repeated = repeated(&names);
    if !repeated.contains(&true) {
        return names;
    }
    let rows = above.iter().rev().take_while(|row| !row.is_blank());
    let rows = rows.filter(|row| !row.is_comment).take(MOST);
    // From the nearest record upwards.
    let labels: Vec<Vec<String>> = rows.map(|row| across(row, names.len())).collect();
    let mut chosen: BTreeSet<usize> = BTreeSet::new();
    let mut best = (names.clone(), distinct(&names));
    loop {
        let others = (0..labels.len()).filter(|place| !chosen.contains(place));
        let tried = others.map(|place| {
            let mut with = chosen.clone();
            with.insert(place);
            let own = joined(&names, &repeated, &labels, &with);
            let count = distinct(&own);
            (count, !are_codes(&labels[place]), labels.len() - place, with, own)
        });
        let Some((count, _, _, with, own)) = tried.max() else { return best.0 };
        if count <= best.1 {
            return best.0;
        }
        chosen = with;
        best = (own, count);
    }
}

fn repeated(names: &[String]) -> Vec<bool> {
    let is = |name: &String| names.iter().filter(|other| *other == name).nth(1).is_some();
    names.iter().map(is).collect()
}

fn distinct(names: &[String]) -> usize {
    names.iter().collect::<BTreeSet<_>>().len()
}

/// The label of each column: a label stands in the first of its columns, or in all of them.
fn across(row: &SampleRow, width: usize) -> Vec<String> {
    let mut last = String::new();
    let label = |column: usize| {
        let text = row.pieces.get(column).map_or("", |piece| piece.text.trim());
        if !text.is_empty() {
            let words: Vec<&str> = text.split_whitespace().collect();
            last = words.join(" ").chars().take(LETTERS).collect();
        }
        last.clone()
    };
    (0..width).map(label).collect()
}

/// Whether all labels are numbers, also hexadecimal ones: a name is better where there is one.
fn are_codes(labels: &[String]) -> bool {
    let is_code = |label: &String| label.bytes().all(|byte| byte.is_ascii_hexdigit());
    labels.iter().all(is_code)
}

/// The names with the labels of the chosen records in front, the uppermost first.
fn joined(
    names: &[String],
    repeated: &[bool],
    labels: &[Vec<String>],
    chosen: &BTreeSet<usize>,
) -> Vec<String> {
    let name = |(column, name): (usize, &String)| {
        if !repeated[column] {
            return name.clone();
        }
        let parts = chosen.iter().rev().map(|&place| labels[place][column].as_str());
        let parts = parts.filter(|label| !label.is_empty());
        let parts: Vec<&str> = parts.chain([name.as_str()]).collect();
        parts.join(" ")
    };
    names.iter().enumerate().map(name).collect()
}
