//! Matrices in columns, by the numbers of row and column in their names: `m00` … `m33`, `T_1_4`, or `r11` … `r33` beside
//! a position of other names; or by one number that counts the cells: `m0` … `m15`, `r1` … `r9`. A last row 0 0 0 1 tells rows
//! from columns; without it the arm does.

use std::collections::BTreeMap;

use super::columns::{ColumnSummary, number};
use super::groups::AxisGroup;
use crate::measured_table::MeasuredTable;
use crate::station_table::rotation_of_matrix;

/// Numbers of a last row further from 0 0 0 1 than this are of something else.
const ROUNDED: f64 = 1e-9;

#[derive(Debug, Default)]
pub struct Matrices {
    pub turns: Vec<AxisGroup>,
    pub positions: Vec<AxisGroup>,
    /// Columns that are part of a matrix.
    pub columns: Vec<usize>,
    /// Remarks on columns that are named like a matrix and are not used: which, and why.
    pub notes: Vec<String>,
}

/// Columns of a matrix, row by row.
type Rows = Vec<Vec<usize>>;

impl Matrices {
    pub fn of(table: &MeasuredTable, columns: &[ColumnSummary]) -> Self {
        let mut groups: BTreeMap<Vec<String>, BTreeMap<[usize; 2], usize>> = BTreeMap::new();
        let mut counted: BTreeMap<Vec<String>, BTreeMap<usize, usize>> = BTreeMap::new();
        for (column, summary) in columns.iter().enumerate().filter(|(_, own)| own.is_numeric()) {
            for (words, place) in places(&summary.named.words) {
                groups.entry(words).or_default().entry(place).or_insert(column);
            }
            for (words, count) in counts(&summary.named.words) {
                counted.entry(words).or_default().entry(count).or_insert(column);
            }
        }
        let mut found = Self::default();
        let groups = groups.iter().filter_map(|(words, cells)| Some((words, rows(cells)?)));
        for (words, rows) in groups {
            match row_by_row(table, &rows) {
                Ok(rows) => found.add(words, &rows),
                Err(why) => found.notes.push(format!(
                    "{} to {} are named like a matrix, but {why}: they are not used",
                    columns[rows[0][0]].name,
                    columns[rows[rows.len() - 1][rows[0].len() - 1]].name
                )),
            }
        }
        // Many things are counted: what is no pose in every row is one of them.
        let counted = counted.iter().filter_map(|(words, cells)| {
            Some((words, row_by_row(table, &counted_rows(cells)?).ok()?))
        });
        counted.for_each(|(words, rows)| found.add(words, &rows));
        found
    }

    fn add(&mut self, words: &[String], rows: &Rows) {
        let turn: Vec<usize> = rows[..3].iter().flat_map(|row| &row[..3]).copied().collect();
        let group = |columns: [usize; 3], more: &[usize]| AxisGroup {
            words: words.to_vec(),
            columns,
            more: more.to_vec(),
        };
        self.turns.push(group([turn[0], turn[1], turn[2]], &turn[3..]));
        if rows[0].len() == 4 {
            self.positions.push(group([0, 1, 2].map(|row| rows[row][3]), &[]));
        }
        self.columns.extend(rows.iter().flatten());
    }
}

/// Ways of reading a name's words as the place in a matrix and the rest: `11`, `1 1` or `nx`.
fn places(words: &[String]) -> Vec<(Vec<String>, [usize; 2])> {
    let digits = |text: &str| match *text.as_bytes() {
        [row @ b'0'..=b'4', column @ b'0'..=b'4'] => {
            Some([row, column].map(|digit| usize::from(digit - b'0')))
        }
        // Normal, orientation, approach and position, as in textbooks.
        [column, axis @ b'x'..=b'z'] => {
            let column = b"noap".iter().position(|own| *own == column)?;
            Some([usize::from(axis - b'x'), column])
        }
        _ => None,
    };
    let mut found = Vec::new();
    for place in 0..words.len() {
        for end in (place + 1..=words.len()).take(2) {
            let rest = || [&words[..place], &words[end..]].concat();
            found.extend(digits(&words[place..end].concat()).map(|place| (rest(), place)));
        }
    }
    found
}

/// Ways of reading a name's words as the number of a cell and the rest.
fn counts(words: &[String]) -> Vec<(Vec<String>, usize)> {
    let counts = words.iter().enumerate().filter_map(|(place, word)| {
        let count = word.parse().ok().filter(|&count| count <= 16)?;
        Some(([&words[..place], &words[place + 1..]].concat(), count))
    });
    counts.collect()
}

/// A whole matrix of 3 × 3, 3 × 4 or 4 × 4 cells, counted row by row from 0 or 1.
fn counted_rows(cells: &BTreeMap<usize, usize>) -> Option<Rows> {
    let (first, last) = (*cells.keys().next()?, *cells.keys().next_back()?);
    let width = match cells.len() {
        9 => 3,
        12 | 16 => 4,
        _ => return None,
    };
    let columns: Vec<usize> = cells.values().copied().collect();
    let is_whole = first <= 1 && last + 1 - first == columns.len();
    is_whole.then(|| columns.chunks(width).map(<[usize]>::to_vec).collect())
}

/// A whole matrix of three or four rows and columns, counted from 0 or 1.
fn rows(cells: &BTreeMap<[usize; 2], usize>) -> Option<Rows> {
    let (&[first, _], &[last, last_column]) = (cells.keys().next()?, cells.keys().next_back()?);
    let row = |row: usize| {
        (first..=last_column).map(|column| cells.get(&[row, column]).copied()).collect()
    };
    let rows = (first..=last).map(row).collect::<Option<Rows>>()?;
    let (height, width) = (rows.len(), rows[0].len());
    let is_whole = first <= 1 && cells.len() == height * width;
    (is_whole && [height, width].iter().all(|size| (3..=4).contains(size))).then_some(rows)
}

/// The rows of a pose, or of a rotation alone, in which the matrix may be written by columns; why it is none.
fn row_by_row(table: &MeasuredTable, named: &Rows) -> Result<Rows, &'static str> {
    let transposed: Rows =
        (0..named[0].len()).map(|column| named.iter().map(|row| row[column]).collect()).collect();
    let are_poses = [named, &transposed].map(|rows| is_pose(table, rows));
    match are_poses {
        [true, true] if named.len() + named[0].len() == 8 => Err(
            "its last row and its last column are 0 0 0 1, which does not tell rows from columns",
        ),
        [true, _] => Ok(named.clone()),
        [false, true] => Ok(transposed),
        [false, false] => {
            Err("it is no rotation with 0 0 0 1 below it, neither by rows nor by columns")
        }
    }
}

/// Whether each row of the table has a rotation, with 0 0 0 1 below it where there is a fourth row; cells without numbers say nothing.
fn is_pose(table: &MeasuredTable, rows: &Rows) -> bool {
    let turn: Vec<usize> = rows[..3].iter().flat_map(|row| &row[..3]).copied().collect();
    let last = rows.get(3).map_or(&[][..], |row| row);
    let is_last = last.is_empty() || last.len() == 4;
    is_last
        && (0..table.row_count()).all(|row| {
            let numbers = |columns: &[usize]| {
                columns.iter().map(|&column| number(table, row, column)).collect::<Option<Vec<_>>>()
            };
            let is_end = |own: Vec<f64>| {
                own.iter().zip([0.0, 0.0, 0.0, 1.0]).all(|(a, b)| (a - b).abs() < ROUNDED)
            };
            numbers(&turn).is_none_or(|own| rotation_of_matrix(&own).is_some())
                && numbers(last).is_none_or(is_end)
        })
}
