//! Where carried columns are in a session's model.

use nalgebra::DVector;

use super::column::Column;
use super::{Carried, Entered};
use crate::fit::full::layout::{Block, Layout};
use crate::fit::full::regression::Sums;
use crate::fit::full::rows::Around;
use crate::fit::problem::Unknown;

/// The columns of a session's model, by which those carried over are found. Behind them are the zeros that joints had before, then
/// changes ([`Entered::variances_behind`]).
pub(super) struct Places<'p> {
    pub(super) layout: &'p Layout,
    unknowns: &'p [Unknown],
    span: f64,
    /// What values of the unknowns are relative to.
    pub(super) at: DVector<f64>,
}

impl Entered {
    /// The prior variance of each change since the session before, and of each change of that session alone: columns that a session's model
    /// does not have.
    pub(super) fn variances_behind(&self) -> (Vec<f64>, Vec<f64>) {
        let changed = self.changes.iter().map(|(_, variance)| *variance);
        let last = self.then.columns.iter().zip(&self.then.variances);
        let last = last.filter(|(own, _)| own.is_of_last());
        (changed.collect(), last.map(|(_, variance)| *variance).collect())
    }
}

impl<'p> Places<'p> {
    pub(super) fn of(around: &Around<'p>, prior_mean: &DVector<f64>) -> Self {
        let (problem, state) = (around.problem, around.state);
        let unknowns = problem.unknowns();
        Self {
            at: &state.offsets + prior_mean.rows(0, unknowns.len()),
            layout: &state.layout,
            unknowns,
            span: state.span,
        }
    }

    /// The column of each joint's constant in this session.
    pub(super) fn constants(&self) -> Vec<usize> {
        let constants = self.layout.blocks().filter_map(|(block, columns)| match block {
            Block::SessionCurve { session: 0, .. } => Some(columns.start),
            _ => None,
        });
        constants.collect()
    }

    /// The place of a column among those of the model; `None` where it has no such column.
    fn place(&self, carried: &Carried, column: Column) -> Option<usize> {
        match column {
            Column::Unknown(unknown) => self.unknowns.iter().position(|own| *own == unknown),
            Column::Constant(joint) => Some(self.layout.size() + joint),
            Column::Last { .. } => None,
            Column::Of { block, place } => {
                // A number of stations.
                let is_told_over_as_many =
                    block != Block::WarmUp || (carried.span - self.span).abs() < 0.5;
                let joint = block.shapes();
                let period =
                    |of: &[Option<f64>]| joint.and_then(|joint| of.get(joint).copied().flatten());
                let is_of_one_circle =
                    period(&carried.slide_periods_mm) == period(self.layout.slide_periods_mm());
                let columns = self.layout.columns(block)?;
                let there = place < columns.len() && is_told_over_as_many && is_of_one_circle;
                there.then(|| columns.start + place)
            }
        }
    }

    /// Sums of `size` columns with those carried at their places; those without one are eliminated. Places beyond `size` are left
    /// out: of changes that were none. Each change of `behind` is a column of its own too.
    pub(super) fn laid(
        &self,
        carried: &Carried,
        behind: Option<&Entered>,
        size: usize,
    ) -> Option<Sums> {
        let all = carried.columns.len();
        let changes = behind.map_or(&[][..], |own| &own.changes);
        let mut twice: Vec<usize> = (0..all).collect();
        twice.extend(changes.iter().map(|(column, _)| *column));
        let first = self.layout.size() + self.constants().len();
        let mut next = first + changes.len();
        let place = |own: &Column| {
            if own.is_of_last() && behind.is_some() {
                next += 1;
                return Some(next - 1);
            }
            self.place(carried, *own)
        };
        let mut places: Vec<Option<usize>> = carried.columns.iter().map(place).collect();
        places.extend((first..first + changes.len()).map(Some));
        let gone = (0..all).filter(|&column| places[column].is_none());
        let gone: Vec<usize> = gone.collect();
        let variances: Vec<f64> = gone.iter().map(|&own| carried.variances[own]).collect();
        let mut away = DVector::zeros(twice.len());
        for (column, own) in carried.columns.iter().enumerate() {
            if let (Column::Unknown(_), Some(place)) = (own, places[column]) {
                away[column] = self.at[place] - carried.at[column];
            }
        }
        let sums = carried.sums.selected(&twice).moved(&away);
        let sums = sums.without(&gone, &variances)?;
        let places: Vec<usize> = places.into_iter().flatten().collect();
        Some(sums.placed(&places, size))
    }
}
