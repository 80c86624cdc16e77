//! Roles of groups and columns, by their names and values: positions, orientations, standard deviations, joints.

use nalgebra::Point3;

use super::columns::{ColumnSummary, Position, largest, number, position, spread};
use super::groups::{self, AxisGroup, NumberedGroup};
use super::matrices::Matrices;
use super::names::{Sense, any_has, has_sense};
use crate::figures::median;
use crate::geometry::align;
use crate::measured_table::MeasuredTable;
use crate::station_table::Sum;

/// Angles and lengths beyond this are no angles in degrees: a turn, with some room.
const LARGEST_DEG: f64 = 400.0;
const MOST_JOINTS: usize = 16;
/// A group that moves by less than this share of what the others move does not move with the arm.
const STILL: f64 = 0.02;
/// Words that say nothing about whose position it is.
const GENERIC: &str =
    "pos position point translation trans p xyz coord coordinate coordinates pose mean avg average";

#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Whose {
    Measured,
    /// Nobody says.
    Unknown,
    Controller,
    Command,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TurnColumns {
    /// A quaternion; the order is that of the names.
    Quaternion([usize; 4]),
    Angles([usize; 3]),
    /// A rotation matrix, row by row as far as its values tell.
    Matrix([usize; 9]),
}

#[derive(Debug, Clone, PartialEq)]
pub struct Placed {
    pub words: Vec<String>,
    pub columns: [usize; 3],
    pub whose: Whose,
    pub turn: Option<TurnColumns>,
    pub sd: Option<[usize; 3]>,
    pub turn_sd: Option<[usize; 3]>,
    /// Whether it moves as the others do.
    pub moves: bool,
}

impl Placed {
    pub fn position(&self) -> Position {
        self.columns.map(Sum::of)
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JointSet {
    pub columns: Vec<usize>,
    /// Why it is unsure; `None` where names say it.
    pub doubt: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Position,
    Turn,
    Deviation,
    TurnDeviation,
    Difference,
    Other,
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct Roles {
    pub positions: Vec<Placed>,
    /// Differences from another position, with their words.
    pub differences: Vec<[usize; 3]>,
    pub joints: Vec<JointSet>,
    /// The places of a nominal and a measured position that their order alone distinguishes.
    pub by_order: Option<[usize; 2]>,
    /// Columns with another use: speeds, forces.
    pub other: Vec<usize>,
    /// Columns that are named for something and cannot be used, with the reason.
    pub notes: Vec<String>,
}

impl Roles {
    /// The roles of the columns of a table. `names` are the joints of arms that may be meant, from base to flange.
    pub fn of(table: &MeasuredTable, columns: &[ColumnSummary], names: &[Vec<String>]) -> Self {
        let matrices = Matrices::of(table, columns);
        let is_apart = |group: &AxisGroup| !matrices.columns.contains(&group.columns[0]);
        let along = groups::along_axes(columns).into_iter().filter(is_apart);
        let mut groups: Vec<(Kind, AxisGroup)> =
            along.map(|group| (kind(columns, &group), group)).collect();
        groups.extend(matrices.turns.into_iter().map(|group| (Kind::Turn, group)));
        groups.extend(matrices.positions.into_iter().map(|group| (Kind::Position, group)));
        let mut numbered = groups::numbered(columns);
        numbered.retain(|group| !matrices.columns.contains(&group.columns[0]));
        let quaternions = numbered.iter().filter_map(|group| numbered_quaternion(table, group));
        groups.extend(quaternions.map(|group| (Kind::Turn, group)));
        let used: Vec<usize> = groups.iter().flat_map(|(_, group)| group.all()).collect();
        let of_kind = |wanted: Kind| {
            groups.iter().filter(move |(kind, _)| *kind == wanted).map(|(_, group)| group)
        };
        let marked = columns.iter().filter_map(ColumnSummary::marked_digits);
        let mut roles = Self {
            positions: of_kind(Kind::Position)
                .map(|group| placed(columns, group, &groups))
                .collect(),
            differences: of_kind(Kind::Difference).map(|group| group.columns).collect(),
            joints: joint_sets(columns, &numbered, names, &used),
            by_order: None,
            other: of_kind(Kind::Other).flat_map(AxisGroup::all).chain(matrices.columns).collect(),
            notes: marked.chain(matrices.notes).collect(),
        };
        // A difference of nothing is a position of an odd name.
        if roles.positions.is_empty() {
            roles.differences.clear();
            roles.positions =
                of_kind(Kind::Difference).map(|group| placed(columns, group, &groups)).collect();
        }
        roles.mark_still(table);
        if let Some(nominal) = roles.mark_nominal(table)
            && let ([turn], true) = (
                &of_kind(Kind::Turn).collect::<Vec<_>>()[..],
                roles.positions.iter().all(|own| own.turn.is_none()),
            )
        {
            roles.positions[nominal].turn = Some(turn_of(turn));
        }
        roles
    }

    /// Marks the commands among positions that nobody is named for: of two sets of the same points in two frames one is nominal, the
    /// first where no name says which. Gives its place.
    fn mark_nominal(&mut self, table: &MeasuredTable) -> Option<usize> {
        let own = self.positions.iter().enumerate();
        let own = own.filter(|(_, own)| own.moves && own.whose == Whose::Unknown);
        let places: Vec<usize> = own.map(|(place, _)| place).collect();
        let pairs = places
            .iter()
            .enumerate()
            .flat_map(|(n, a)| places[n + 1..].iter().map(move |b| (*a, *b)));
        let (first, second) = pairs.into_iter().find(|&(a, b)| {
            are_one_in_two_frames(table, [&self.positions[a], &self.positions[b]])
        })?;
        let says_measured = self.positions[first].words.iter().any(|word| word == "m");
        let [nominal, measured] = if says_measured { [second, first] } else { [first, second] };
        self.positions[nominal].whose = Whose::Command;
        self.positions[measured].whose = Whose::Measured;
        self.by_order = (!says_measured).then_some([nominal, measured]);
        Some(nominal)
    }

    /// These roles, but the measured position commanded and the commanded one measured; `None` where names distinguish them.
    pub fn in_other_order(&self) -> Option<Self> {
        let [nominal, measured] = self.by_order?;
        let mut other = self.clone();
        other.positions[nominal].whose = Whose::Measured;
        other.positions[measured].whose = Whose::Command;
        Some(other)
    }

    /// Marks positions that do not move with the arm: reference reflectors. Commands may have another unit and are left
    /// alone.
    fn mark_still(&mut self, table: &MeasuredTable) {
        let own = self
            .positions
            .iter_mut()
            .filter(|own| matches!(own.whose, Whose::Measured | Whose::Unknown));
        let mut own: Vec<(f64, &mut Placed)> =
            own.map(|own| (spread(table, &own.position()), own)).collect();
        let most = own.iter().map(|(spread, _)| *spread).fold(0.0, f64::max);
        for (spread, own) in &mut own {
            own.moves = *spread > STILL * most;
        }
    }

    pub fn used(&self) -> Vec<usize> {
        let placed = self.positions.iter().flat_map(|own| {
            let turn: Vec<usize> =
                own.turn.iter().flat_map(|turn| turn.columns().to_vec()).collect();
            let sd = own.sd.into_iter().chain(own.turn_sd).flatten();
            own.columns.into_iter().chain(turn).chain(sd).collect::<Vec<_>>()
        });
        let differences = self.differences.iter().flatten().copied();
        let joints = self.joints.iter().flat_map(|set| set.columns.clone());
        placed.chain(differences).chain(joints).chain(self.other.iter().copied()).collect()
    }
}

impl TurnColumns {
    pub fn columns(&self) -> &[usize] {
        match self {
            Self::Quaternion(own) => own,
            Self::Angles(own) => own,
            Self::Matrix(own) => own,
        }
    }
}

fn kind(columns: &[ColumnSummary], group: &AxisGroup) -> Kind {
    let has = |sense| any_has(&group.words, sense);
    let largest = largest(columns, group.all());
    let least =
        group.columns.iter().filter_map(|&column| columns[column].range).map(|(low, _)| low);
    let is_positive = least.fold(f64::INFINITY, f64::min) >= 0.0;
    let is_turn = !group.more.is_empty() || (has(Sense::Turn) && largest <= LARGEST_DEG);
    match (is_turn, has(Sense::Deviation) && is_positive) {
        (false, true) => Kind::Deviation,
        (true, true) => Kind::TurnDeviation,
        (true, false) => Kind::Turn,
        (false, false) if has(Sense::Difference) => Kind::Difference,
        (false, false) if group.words.iter().any(|word| has_sense(word, Sense::Other)) => {
            Kind::Other
        }
        (false, false) => Kind::Position,
    }
}

/// The words of a group without those of its kind and without generic ones, which say whose it is.
fn owner(words: &[String]) -> Vec<&String> {
    let generic: Vec<&str> = GENERIC.split_whitespace().collect();
    let of_kind = |word: &str| has_sense(word, Sense::Turn) || has_sense(word, Sense::Deviation);
    words.iter().filter(|word| !generic.contains(&word.as_str()) && !of_kind(word)).collect()
}

/// A position with the groups that belong to it: those of the same owner, or the only one where there is one position
/// only.
fn placed(columns: &[ColumnSummary], group: &AxisGroup, groups: &[(Kind, AxisGroup)]) -> Placed {
    let is_only = groups.iter().filter(|(kind, _)| *kind == Kind::Position).count() == 1;
    let of_kind = |wanted: Kind| {
        let all: Vec<&AxisGroup> =
            groups.iter().filter(|(kind, _)| *kind == wanted).map(|(_, own)| own).collect();
        let own = all.iter().find(|own| owner(&own.words) == owner(&group.words));
        own.or_else(|| all.first().filter(|_| is_only && all.len() == 1)).map(|own| (*own).clone())
    };
    let turn = of_kind(Kind::Turn).map(|own| turn_of(&own));
    Placed {
        whose: whose(columns, group),
        turn,
        sd: of_kind(Kind::Deviation).map(|own| own.columns),
        turn_sd: of_kind(Kind::TurnDeviation).map(|own| own.columns),
        words: group.words.clone(),
        columns: group.columns,
        moves: true,
    }
}

fn turn_of(group: &AxisGroup) -> TurnColumns {
    let [x, y, z] = group.columns;
    match group.more[..] {
        [w] => TurnColumns::Quaternion([x, y, z, w]),
        [d, e, f, g, h, i] => TurnColumns::Matrix([x, y, z, d, e, f, g, h, i]),
        _ => TurnColumns::Angles(group.columns),
    }
}

/// Points of two sets that leave less than this share of their spread where one is laid onto the other are the same points.
const SAME: f64 = 0.01;
/// Two reflectors on one tool that hardly turns are laid onto each other as well, by a smaller rotation than this, rad, and a
/// distance between these shares of the spread.
const REFLECTORS_TURN: f64 = 0.05;
const REFLECTORS_APART: std::ops::Range<f64> = 0.02..3.0;

/// Whether two positions are the same points in two frames, rather than two points of a moving tool.
fn are_one_in_two_frames(table: &MeasuredTable, both: [&Placed; 2]) -> bool {
    let sums = both.map(Placed::position);
    let rows = (0..table.row_count()).filter_map(|row| {
        let [a, b] = sums.each_ref().map(|sum| position(sum, table, row).map(Point3::from));
        Some((a?, b?))
    });
    let (a, b): (Vec<Point3<f64>>, Vec<Point3<f64>>) = rows.unzip();
    let Some(a_from_b) = align(&a, &b, &vec![1.0; a.len()]).filter(|_| a.len() > 5) else {
        return false;
    };
    let of_pairs = |distance: &dyn Fn(&Point3<f64>, &Point3<f64>) -> f64| {
        let all: Vec<f64> = a.iter().zip(&b).map(|(a, b)| distance(a, b)).collect();
        median(&all).unwrap_or(f64::INFINITY)
    };
    let spread = spread(table, &sums[0]);
    let apart = of_pairs(&|a, b| (a - b).norm());
    let is_of_tool =
        a_from_b.rotation.angle() < REFLECTORS_TURN && REFLECTORS_APART.contains(&(apart / spread));
    of_pairs(&|a, b| (a - a_from_b * b).norm()) < SAME * spread && !is_of_tool
}

fn whose(columns: &[ColumnSummary], group: &AxisGroup) -> Whose {
    let words = &columns[group.columns[0]].named.words;
    let has = |sense| any_has(words, sense);
    match (has(Sense::Command), has(Sense::Measured), has(Sense::Controller)) {
        (true, ..) => Whose::Command,
        (_, true, _) => Whose::Measured,
        (_, _, true) => Whose::Controller,
        _ => Whose::Unknown,
    }
}

/// Four numbered columns whose squares sum up to one are a quaternion: w first, as ABB and most papers number it from
/// q1 and q0.
fn numbered_quaternion(table: &MeasuredTable, group: &NumberedGroup) -> Option<AxisGroup> {
    let &[w, x, y, z] = &group.columns[..] else { return None };
    let is_unit = |row: usize| {
        let parts = group.columns.iter().map(|&column| number(table, row, column));
        let squares: Option<f64> = parts.map(|part| part.map(|part| part * part)).sum();
        squares.is_none_or(|squares| (squares - 1.0).abs() < 1e-2)
    };
    let is_turn = any_has(&group.words, Sense::Turn);
    let own = || AxisGroup { words: group.words.clone(), columns: [x, y, z], more: vec![w] };
    (is_turn && (0..table.row_count()).all(is_unit)).then(own)
}

/// Sets of joints by names: those of a known arm, numbered ones, and columns that all say "joint".
fn joint_sets(
    columns: &[ColumnSummary],
    numbered: &[NumberedGroup],
    names: &[Vec<String>],
    used: &[usize],
) -> Vec<JointSet> {
    let may_be = |column: usize| may_be_joint(&columns[column]) && !used.contains(&column);
    let known = names.iter().filter_map(|names| of_names(columns, names));
    let of_numbers = numbered.iter().filter(|group| any_has(&group.words, Sense::Joint));
    let of_numbers = of_numbers.map(|group| group.columns.clone());
    let says_joint =
        |column: &usize| columns[*column].named.words.iter().any(|word| word.contains("joint"));
    let all: Vec<usize> =
        (0..columns.len()).filter(|&column| may_be(column)).filter(says_joint).collect();
    let mut sets: Vec<Vec<usize>> = known.collect();
    let mut others: Vec<Vec<usize>> = of_numbers.chain([all]).chain(of_letters(columns)).collect();
    // Of several, those that are no commands come first, and then the larger ones.
    others.sort_by_key(|set| (is_command(columns, set), usize::MAX - set.len()));
    sets.extend(others);
    let mut kept: Vec<Vec<usize>> = Vec::new();
    for set in sets {
        let is_whole =
            (2..=MOST_JOINTS).contains(&set.len()) && set.iter().all(|&column| may_be(column));
        let is_part = kept.iter().any(|own| set.iter().all(|column| own.contains(column)));
        if is_whole && !is_part {
            kept.push(set);
        }
    }
    let doubt = |set: &Vec<usize>| {
        is_command(columns, set).then(|| "they are named as commanded angles".to_owned())
    };
    kept.into_iter().map(|set| JointSet { doubt: doubt(&set), columns: set }).collect()
}

fn is_command(columns: &[ColumnSummary], set: &[usize]) -> bool {
    set.iter().any(|&column| columns[column].named.has(Sense::Command))
}

/// Whether a column's values and words let it be a joint's.
fn may_be_joint(column: &ColumnSummary) -> bool {
    let other = [Sense::Other, Sense::Temperature, Sense::Time];
    let is_other = column.named.words.iter().any(|word| {
        // `a` and `q` are joints here; single letters of other quantities are not meant.
        word.len() > 1 && other.iter().any(|sense| has_sense(word, *sense))
    });
    let deviates =
        column.named.words.iter().any(|word| word.len() > 1 && has_sense(word, Sense::Deviation));
    column.is_numeric() && !is_other && !deviates
}

fn of_names(columns: &[ColumnSummary], names: &[String]) -> Option<Vec<usize>> {
    let column =
        |name: &String| columns.iter().position(|own| own.name.trim().eq_ignore_ascii_case(name));
    names.iter().map(column).collect()
}

/// Joints that makers name by letters and words.
fn of_letters(columns: &[ColumnSummary]) -> Vec<Vec<usize>> {
    let series = ["s l u r b t", "base shoulder elbow wrist1 wrist2 wrist3"];
    let column = |name: &str| columns.iter().position(|own| own.named.words.concat() == *name);
    series.iter().filter_map(|names| names.split_whitespace().map(column).collect()).collect()
}
