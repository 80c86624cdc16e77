//! Columns that belong together by their names: a group is what stays when the axis or number is taken out.
//! `measurement_std_x`, `…_y` and `…_z` are the group `measurement std`; `joint_1` to `joint_7` are `joint`.

use std::collections::BTreeMap;

use super::columns::ColumnSummary;

/// Place of an axis among x, y, z and w.
type Axis = usize;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AxisGroup {
    pub words: Vec<String>,
    pub columns: [usize; 3],
    /// The w of a quaternion, or the other six of a rotation matrix.
    pub more: Vec<usize>,
}

impl AxisGroup {
    pub fn all(&self) -> impl Iterator<Item = usize> {
        self.columns.into_iter().chain(self.more.iter().copied())
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NumberedGroup {
    pub words: Vec<String>,
    /// The first number, 0 or 1.
    pub first: usize,
    pub columns: Vec<usize>,
}

/// Words that stand for the axes of an angle triple, with the word that takes their place in the group.
const ANGLES: [([&str; 3], &str); 3] =
    [(["roll", "pitch", "yaw"], "rpy"), (["w", "p", "r"], "wpr"), (["a", "b", "c"], "abc")];

/// Ways of reading a name's words as an axis and the rest.
fn axes(words: &[String]) -> Vec<(Vec<String>, Axis)> {
    let mut found = Vec::new();
    for place in 0..words.len() {
        let word = words[place].as_str();
        let put = |with: &[&str]| {
            let own = with.iter().map(|word| (*word).to_owned());
            [words[..place].to_vec(), own.collect(), words[place + 1..].to_vec()].concat()
        };
        let axis = ["x", "y", "z", "w"].iter().position(|axis| *axis == word);
        found.extend(axis.map(|axis| (put(&[]), axis)));
        for (own, group) in ANGLES {
            let axis = own.iter().position(|axis| *axis == word);
            found.extend(axis.map(|axis| (put(&[group]), axis)));
        }
        // Of `qx` and `posx` the last letter is the axis, if the others are there too.
        for (axis, letter) in ["x", "y", "z", "w"].iter().enumerate() {
            let stem = word.strip_suffix(letter).filter(|stem| !stem.is_empty());
            found.extend(stem.map(|stem| (put(&[stem]), axis)));
        }
    }
    found
}

/// The groups of columns along x, y and z, in the order of their first columns. A column is in one group at most.
pub fn along_axes(columns: &[ColumnSummary]) -> Vec<AxisGroup> {
    let mut groups: BTreeMap<Vec<String>, [Option<usize>; 4]> = BTreeMap::new();
    for (column, summary) in columns.iter().enumerate().filter(|(_, own)| own.is_numeric()) {
        for (words, axis) in axes(&summary.named.words) {
            groups.entry(words).or_default()[axis].get_or_insert(column);
        }
    }
    let whole = groups.into_iter().filter_map(|(words, [x, y, z, w])| {
        Some(AxisGroup { words, columns: [x?, y?, z?], more: w.into_iter().collect() })
    });
    let mut whole: Vec<AxisGroup> = whole.collect();
    whole.sort_by_key(|group| (group.columns, group.words.clone()));
    let mut used = Vec::new();
    whole.retain(|group| {
        let is_free = group.columns.iter().all(|column| !used.contains(column));
        used.extend(is_free.then_some(group.columns).into_iter().flatten());
        is_free
    });
    whole
}

/// The groups of columns that are numbered from 0 or 1, at least two; the larger ones first.
pub fn numbered(columns: &[ColumnSummary]) -> Vec<NumberedGroup> {
    let mut groups: BTreeMap<Vec<String>, BTreeMap<usize, usize>> = BTreeMap::new();
    for (column, summary) in columns.iter().enumerate().filter(|(_, own)| own.is_numeric()) {
        let words = &summary.named.words;
        for (place, word) in words.iter().enumerate() {
            let Ok(number) = word.parse::<usize>() else { continue };
            let rest = [&words[..place], &["#".to_owned()], &words[place + 1..]].concat();
            groups.entry(rest).or_default().entry(number).or_insert(column);
        }
    }
    let mut found: Vec<NumberedGroup> =
        groups.into_iter().filter_map(|(words, own)| consecutive(words, &own)).collect();
    found.sort_by_key(|group| (usize::MAX - group.columns.len(), group.columns.clone()));
    found
}

/// A group whose numbers have no gap and begin with 0 or 1.
fn consecutive(words: Vec<String>, own: &BTreeMap<usize, usize>) -> Option<NumberedGroup> {
    let first = *own.keys().next()?;
    let is_whole = own.keys().copied().eq(first..first + own.len());
    (first <= 1 && is_whole && own.len() >= 2).then(|| NumberedGroup {
        words: words.into_iter().filter(|word| word != "#").collect(),
        first,
        columns: own.values().copied().collect(),
    })
}
