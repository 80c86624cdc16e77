//! Readings of a table that may be meant: which columns are the joints and the measured positions. Names decide where
//! they can; where they say nothing, every run of neighbouring columns is a choice, and the arm decides
//! ([`super::by_arm`]).

use super::columns::{ColumnSummary, Position};
use super::long::Long;
use super::names::Sense;
use super::roles::{JointSet, Placed, Roles, TurnColumns, Whose};
use crate::station_table::Sum;

const MOST: usize = 60;
/// Numbers of joints that are looked for where neither names nor an arm tell.
const USUAL_JOINTS: [usize; 2] = [6, 7];
/// A number beyond this is no angle: a turn in degrees, with some room.
const LARGEST_DEG: f64 = 400.0;

#[derive(Debug, Clone, PartialEq)]
pub struct Target {
    /// Its name; absent where there is one only.
    pub name: Option<String>,
    pub position: Position,
    pub turn: Option<TurnColumns>,
    pub sd: Option<[usize; 3]>,
    pub turn_sd: Option<[usize; 3]>,
}

/// Part that a choice has in a sum with differences.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// It is no such sum, and there is none beside it.
    Whole,
    /// The position that the differences belong to.
    Base,
    Plus,
    Minus,
}

#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    pub joints: JointSet,
    pub targets: Vec<Target>,
    /// Whose positions the names say they are.
    pub whose: Whose,
    /// Its part in a sum with differences.
    pub part: Part,
    /// Why its positions are unsure; `None` where names say it.
    pub doubt: Option<String>,
}

impl Choice {
    /// The columns of its positions.
    pub fn placed(&self) -> impl Iterator<Item = usize> {
        self.targets.iter().flat_map(|target| &target.position).flat_map(Sum::columns)
    }
}

pub fn choices(
    columns: &[ColumnSummary],
    roles: &Roles,
    long: Option<&Long>,
    counts: &[usize],
) -> Vec<Choice> {
    let of_long = long.iter().flat_map(|long| [long.target, long.station]);
    let taken: Vec<usize> = roles.used().into_iter().chain(of_long).collect();
    let free: Vec<usize> = (0..columns.len())
        .filter(|column| !taken.contains(column) && may_be_value(&columns[*column]))
        .collect();
    let mut targets = targets(columns, roles);
    if targets.is_empty() {
        targets = windows(columns, &free, 3).map(|run| of_window(&run)).collect();
    }
    let mut all = Vec::new();
    for own in &targets {
        let used: Vec<usize> = own.placed().collect();
        let left: Vec<usize> =
            free.iter().copied().filter(|column| !used.contains(column)).collect();
        for joints in joint_sets(columns, roles, &left, counts) {
            all.push(Choice { joints, ..own.clone() });
        }
    }
    all.truncate(MOST);
    all
}

/// Whether a column may hold a joint's or a position's value: numbers that differ, and no time, temperature or running
/// number.
fn may_be_value(column: &ColumnSummary) -> bool {
    let other = [Sense::Time, Sense::Temperature, Sense::Station, Sense::Session];
    let is_other = other.iter().any(|sense| column.named.has(*sense));
    column.is_numeric() && column.varies() && !is_other
}

/// Joint sets by names; where there is none, runs of neighbouring columns of angles.
fn joint_sets(
    columns: &[ColumnSummary],
    roles: &Roles,
    free: &[usize],
    counts: &[usize],
) -> Vec<JointSet> {
    let fits = |set: &&JointSet| counts.is_empty() || counts.contains(&set.columns.len());
    let fitting: Vec<JointSet> = roles.joints.iter().filter(fits).cloned().collect();
    if !fitting.is_empty() {
        return fitting;
    }
    let named = roles.joints.iter().filter_map(|set| shorter(set, counts));
    let named: Vec<JointSet> = named.collect();
    if !named.is_empty() {
        return named;
    }
    if let [first, ..] = &roles.joints[..] {
        return vec![first.clone()];
    }
    let angles: Vec<usize> =
        free.iter().copied().filter(|&column| columns[column].largest() <= LARGEST_DEG).collect();
    let counts = if counts.is_empty() { &USUAL_JOINTS[..] } else { counts };
    let unnamed = |columns: Vec<usize>| JointSet {
        doubt: Some(
            "no name says which columns are joints; this is the run of columns that agrees best"
                .to_owned(),
        ),
        columns,
    };
    counts
        .iter()
        .flat_map(|&count| windows(columns, &angles, count).map(unnamed).collect::<Vec<_>>())
        .collect()
}

/// The first columns of a set that has more than the arm has joints: the others are external axes.
fn shorter(set: &JointSet, counts: &[usize]) -> Option<JointSet> {
    let count = counts.iter().copied().filter(|&count| count < set.columns.len()).max()?;
    Some(JointSet {
        columns: set.columns[..count].to_vec(),
        doubt: Some(format!(
            "the table has {} such columns, and the arm {count} joints: the last ones are left out",
            set.columns.len()
        )),
    })
}

/// Runs of so many neighbouring columns among `free`.
fn windows<'c>(
    columns: &'c [ColumnSummary],
    free: &'c [usize],
    count: usize,
) -> impl Iterator<Item = Vec<usize>> + 'c {
    let beside = move |run: &&[usize]| {
        run.windows(2).all(|pair| {
            (pair[0]..pair[1]).all(|between| between == pair[0] || !columns[between].is_numeric())
        })
    };
    free.windows(count.max(1)).filter(beside).map(<[usize]>::to_vec)
}

fn of_window(run: &[usize]) -> Choice {
    let position = [run[0], run[1], run[2]].map(Sum::of);
    Choice {
        doubt: Some("no name says which columns are the position; this is the run of columns that agrees best".to_owned()),
        ..of_targets(vec![Target { name: None, position, turn: None, sd: None, turn_sd: None }], Whose::Unknown)
    }
}

fn of_targets(targets: Vec<Target>, whose: Whose) -> Choice {
    let joints = JointSet { columns: Vec::new(), doubt: None };
    Choice { joints, targets, whose, part: Part::Whole, doubt: None }
}

const DOUBTS: [(Whose, &str); 2] = [
    (Whose::Controller, "its name says that it is the controller's, computed from the joints"),
    (
        Whose::Command,
        "its name says that it is commanded or nominal, and there is no other position",
    ),
];

fn targets(columns: &[ColumnSummary], roles: &Roles) -> Vec<Choice> {
    let moving = |whose: Whose| {
        let own = roles.positions.iter().filter(move |own| own.whose == whose && own.moves);
        own.collect::<Vec<_>>()
    };
    let measured = moving(Whose::Measured);
    let mut all = Vec::new();
    if !measured.is_empty() {
        all.push(of_placed(columns, &measured, Whose::Measured));
    }
    for family in families(&moving(Whose::Unknown)) {
        all.push(of_placed(columns, &family, Whose::Unknown));
    }
    for (whose, doubt) in DOUBTS {
        all.extend(moving(whose).iter().map(|own| Choice {
            doubt: Some(doubt.to_owned()),
            ..of_placed(columns, &[own], whose)
        }));
    }
    all.iter().flat_map(|choice| with_differences(roles, choice)).collect()
}

/// Positions of one manner: their words differ in a number or a letter only.
fn families<'p>(positions: &[&'p Placed]) -> Vec<Vec<&'p Placed>> {
    let manner = |own: &Placed| {
        own.words
            .iter()
            .filter(|word| word.chars().count() > 1 && word.parse::<u64>().is_err())
            .cloned()
            .collect::<Vec<_>>()
    };
    let mut families: Vec<(Vec<String>, Vec<&Placed>)> = Vec::new();
    for &own in positions {
        match families.iter_mut().find(|(words, _)| *words == manner(own)) {
            Some((_, family)) => family.push(own),
            None => families.push((manner(own), vec![own])),
        }
    }
    families.into_iter().map(|(_, family)| family).collect()
}

fn of_placed(columns: &[ColumnSummary], placed: &[&Placed], whose: Whose) -> Choice {
    let target = |own: &&Placed| Target {
        name: (placed.len() > 1).then(|| name(columns, own)),
        position: own.position(),
        turn: own.turn,
        sd: own.sd,
        turn_sd: own.turn_sd,
    };
    of_targets(placed.iter().map(target).collect(), whose)
}

/// A target's name: what its three columns begin with, otherwise the words without the axis.
pub(super) fn name(columns: &[ColumnSummary], own: &Placed) -> String {
    let names = own.columns.map(|column| columns[column].name.as_str());
    let common = names[0].char_indices().take_while(|&(at, c)| {
        names
            .iter()
            .all(|name| name[at.min(name.len())..].starts_with(c) && name.is_char_boundary(at))
    });
    let end = common.last().map_or(0, |(at, c)| at + c.len_utf8());
    let begin = names[0][..end].trim_end_matches(|c: char| !c.is_alphanumeric());
    let is_axis = ["x", "y", "z"].contains(&begin.to_lowercase().as_str());
    if begin.is_empty() || is_axis {
        format!("target {}", own.words.concat())
    } else {
        begin.to_owned()
    }
}

/// A choice of one position, with its sum and difference where the table has differences that belong to it.
fn with_differences(roles: &Roles, choice: &Choice) -> Vec<Choice> {
    let ([difference], [target]) = (&roles.differences[..], &choice.targets[..]) else {
        return vec![choice.clone()];
    };
    let made = |sign: f64, part: Part| {
        let mut target = target.clone();
        for (sum, column) in target.position.iter_mut().zip(difference) {
            *sum = sum.with(sign, *column);
        }
        Choice { targets: vec![target], part, ..choice.clone() }
    };
    vec![
        made(1.0, Part::Plus),
        made(-1.0, Part::Minus),
        Choice { part: Part::Base, ..choice.clone() },
    ]
}
