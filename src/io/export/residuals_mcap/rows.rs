//! Rows of table `residuals` by what they are of, and their numbers as a message.

use std::collections::BTreeMap;

use arrow::array::Array as _;
use serde::Serialize;

use super::scene::Time;
use crate::io::table::Table;

/// What residuals are of, in the words of the table.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(super) struct Of {
    pub(super) session: String,
    pub(super) split: String,
    pub(super) model: String,
    pub(super) angles: String,
    pub(super) base_refit: String,
    pub(super) role: String,
}

impl Of {
    /// Before compensation, or after.
    pub(super) fn moment(&self) -> &'static str {
        match self.model.as_str() {
            "raw_command" | "base_target" => "before",
            _ => "after",
        }
    }
}

/// One residual.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Row {
    pub(super) station: i64,
    fold: Option<i64>,
    used_for_refit: bool,
    /// Attained position, base frame, mm.
    attained_mm: [f64; 3],
    /// Measured minus predicted, mm.
    pub(super) error_mm: [f64; 3],
    pub(super) norm_mm: f64,
}

/// A point or a vector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Xyz {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) z: f64,
}

impl From<[f64; 3]> for Xyz {
    fn from([x, y, z]: [f64; 3]) -> Self {
        Self { x, y, z }
    }
}

/// A row as a message.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Numbers<'r> {
    timestamp: Time,
    station: i64,
    error_mm: f64,
    error_vector_mm: Xyz,
    attained_mm: Xyz,
    used_for_refit: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    fold: Option<i64>,
    moment: &'static str,
    #[serde(flatten)]
    of: &'r Of,
}

impl Row {
    /// Where the target was predicted, mm.
    pub(super) fn predicted_mm(&self) -> [f64; 3] {
        std::array::from_fn(|axis| self.attained_mm[axis] - self.error_mm[axis])
    }

    /// Its numbers, at its station's time.
    pub(super) fn numbers<'r>(&self, of: &'r Of, ns: u64) -> Numbers<'r> {
        Numbers {
            timestamp: Time::of(ns),
            station: self.station,
            error_mm: self.norm_mm,
            error_vector_mm: self.error_mm.into(),
            attained_mm: self.attained_mm.into(),
            used_for_refit: self.used_for_refit,
            fold: self.fold,
            moment: of.moment(),
            of,
        }
    }
}

/// All rows of the table, by what they are of.
pub(super) fn rows(table: &Table) -> BTreeMap<Of, Vec<Row>> {
    let mut rows: BTreeMap<Of, Vec<Row>> = BTreeMap::new();
    for row in 0..table.rows() {
        rows.entry(of(table, row))
            .or_default()
            .push(self::row(table, row));
    }
    rows
}

fn of(table: &Table, row: usize) -> Of {
    let text = |column: &str| table.text(column).value(row).to_owned();
    Of {
        session: text("of_session"),
        split: text("split"),
        model: text("model"),
        angles: text("angles"),
        base_refit: text("base_refit"),
        role: text("role"),
    }
}

fn row(table: &Table, row: usize) -> Row {
    let numbers = |columns: [&str; 3]| columns.map(|column| table.f64(column).value(row));
    let folds = table.i64("fold");
    Row {
        station: table.i64("station").value(row),
        fold: folds.is_valid(row).then(|| folds.value(row)),
        used_for_refit: table.bool("used_for_refit").value(row),
        attained_mm: numbers(["x_mm", "y_mm", "z_mm"]),
        error_mm: numbers(["residual_x_mm", "residual_y_mm", "residual_z_mm"]),
        norm_mm: table.f64("residual_mm").value(row),
    }
}
