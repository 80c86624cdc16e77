//! The long form: a row is a reading of one target, and several rows are a station. Joints repeat from row to row, and
//! no two rows have the same joints and the same target.

use std::collections::{BTreeMap, BTreeSet};

use super::columns::{ColumnSummary, number};
use super::names::Sense;
use crate::measured_table::MeasuredTable;
use crate::station_table::name;

const MOST_TARGETS: usize = 12;
/// A table is long where it has fewer different joint vectors than this share of its rows.
const REPEATS: f64 = 0.75;

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Long {
    pub target: usize,
    pub station: usize,
    pub targets: Vec<String>,
}

impl Long {
    /// Keeps the targets that a row has a position of; `has_position` says whether a row has one. All stay where none
    /// has.
    pub fn keep_placed(&mut self, table: &MeasuredTable, has_position: impl Fn(usize) -> bool) {
        let placed: BTreeSet<String> = (0..table.row_count())
            .filter(|row| has_position(*row))
            .filter_map(|row| name(table.cell(row, self.target)))
            .collect();
        self.targets.retain(|own| placed.is_empty() || placed.contains(own));
    }
}

/// The long form of a table with these joints; `None` where each row is a station.
pub fn long(table: &MeasuredTable, columns: &[ColumnSummary], joints: &[usize]) -> Option<Long> {
    let poses: Vec<Vec<u64>> = (0..table.row_count()).map(|row| pose(table, joints, row)).collect();
    let different: BTreeSet<&Vec<u64>> = poses.iter().collect();
    if poses.is_empty() || different.len() as f64 > REPEATS * poses.len() as f64 {
        return None;
    }
    let target = (0..columns.len()).filter(|column| !joints.contains(column)).find_map(|column| {
        let targets = targets(table, &columns[column], column, &poses)?;
        Some((column, targets))
    });
    let (target, targets) = target?;
    let is_station = |column: &usize| {
        *column != target && !joints.contains(column) && names_poses(table, *column, &poses)
    };
    let stations: Vec<usize> = (0..columns.len()).filter(is_station).collect();
    let named = stations.iter().find(|&&column| columns[column].named.has(Sense::Station));
    let station = *named.or(stations.first())?;
    Some(Long { target, station, targets })
}

fn pose(table: &MeasuredTable, joints: &[usize], row: usize) -> Vec<u64> {
    joints.iter().map(|&column| number(table, row, column).map_or(u64::MAX, f64::to_bits)).collect()
}

/// The names of targets in a column; `None` where it names something else: too many, or two rows of one pose with one
/// name.
fn targets(
    table: &MeasuredTable,
    summary: &ColumnSummary,
    column: usize,
    poses: &[Vec<u64>],
) -> Option<Vec<String>> {
    let is_text = summary.texts > summary.numbers;
    if !is_text && !summary.named.has(Sense::Target) {
        return None;
    }
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut seen = BTreeSet::new();
    for (row, pose) in poses.iter().enumerate() {
        let Some(name) = name(table.cell(row, column)) else { continue };
        if !seen.insert((pose, name.clone())) {
            return None;
        }
        *counts.entry(name).or_default() += 1;
        if counts.len() > MOST_TARGETS {
            return None;
        }
    }
    let mut names: Vec<(usize, String)> =
        counts.into_iter().map(|(name, count)| (usize::MAX - count, name)).collect();
    names.sort();
    (names.len() >= 2).then(|| names.into_iter().map(|(_, name)| name).collect())
}

/// Whether a column has one name for each pose, and another for every other pose.
fn names_poses(table: &MeasuredTable, column: usize, poses: &[Vec<u64>]) -> bool {
    let mut of_name: BTreeMap<String, &Vec<u64>> = BTreeMap::new();
    let is_one = poses.iter().enumerate().all(|(row, pose)| {
        let name = name(table.cell(row, column));
        name.is_some_and(|name| *of_name.entry(name).or_insert(pose) == pose)
    });
    let different: BTreeSet<&Vec<u64>> = poses.iter().collect();
    is_one && of_name.len() == different.len()
}
