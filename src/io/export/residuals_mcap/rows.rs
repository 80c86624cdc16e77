use serde::Serialize;

use super::scene::Time;
use crate::report::{Model, Subject};
use crate::table::{Row as _, Table, Word as _};
use crate::tables::residuals::ResidualRow;
use crate::tables::words::Role;

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Of {
    pub(super) subject: Subject,
    pub(super) role: Role,
}

/// [`Of`] in the words of the table, in which messages state it and topics are ordered.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub(super) struct Words<'o> {
    session: &'o str,
    split: &'static str,
    pub(super) model: &'static str,
    pub(super) angles: &'static str,
    base_refit: &'static str,
    role: &'static str,
}

impl Of {
    pub(super) fn words(&self) -> Words<'_> {
        let subject = &self.subject;
        Words {
            session: &subject.of_session,
            split: subject.split.word(),
            model: subject.model.word(),
            angles: subject.angles.word(),
            base_refit: subject.base_refit.word(),
            role: self.role.word(),
        }
    }

    pub(super) const fn is_before(&self) -> bool {
        matches!(self.subject.model, Model::RawCommand | Model::BaseTarget)
    }

    pub(super) const fn moment(&self) -> &'static str {
        if self.is_before() { "before" } else { "after" }
    }
}

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

#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Numbers<'r> {
    timestamp: Time,
    station: usize,
    error_mm: f64,
    error_vector_mm: Xyz,
    attained_mm: Xyz,
    used_for_refit: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    fold: Option<usize>,
    moment: &'static str,
    #[serde(flatten)]
    of: Words<'r>,
}

impl<'r> Numbers<'r> {
    pub(super) fn new(row: &ResidualRow, of: &'r Of, ns: u64) -> Self {
        Self {
            timestamp: Time::of(ns),
            station: row.station,
            error_mm: row.residual_mm,
            error_vector_mm: row.residual.into(),
            attained_mm: row.at.into(),
            used_for_refit: row.used_for_refit,
            fold: row.fold,
            moment: of.moment(),
            of: of.words(),
        }
    }
}

/// Where the target was predicted, base frame, mm.
pub(super) fn predicted_mm(row: &ResidualRow) -> [f64; 3] {
    std::array::from_fn(|axis| row.at[axis] - row.residual[axis])
}

pub(super) fn rows(table: &Table) -> Vec<(Of, Vec<ResidualRow>)> {
    let mut sets: Vec<(Of, Vec<ResidualRow>)> = Vec::new();
    for row in ResidualRow::read(table) {
        let of = Of { subject: row.subject.clone(), role: row.role };
        match sets.iter_mut().find(|(own, _)| *own == of) {
            Some((_, rows)) => rows.push(row),
            None => sets.push((of, vec![row])),
        }
    }
    sets.sort_by(|(a, _), (b, _)| a.words().cmp(&b.words()));
    sets
}
