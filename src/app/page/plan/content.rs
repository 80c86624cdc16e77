//! The content of a plan's page: the rows of its published tables, and the plan's statements that no table has.

use crate::io::tables::plan_figures::{FigureRow, FigureStudy};
use crate::io::tables::sampling_plan::VisitRow;
use crate::manifest::{StageCount, Work, Written};
use crate::page::content::{Count, Provenance};
use crate::page::from_rows::{count, made_from};

#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    pub robot: String,
    /// The plan's id: its run.
    pub plan: String,
    /// `plan_figures`, in the table's order.
    pub figures: Vec<FigureRow>,
    /// `sampling_plan`, in the order of visits.
    pub visits: Vec<VisitRow>,
    pub counts: Vec<Count>,
    pub provenance: Provenance,
}

#[derive(Debug, Clone, Copy)]
pub struct About<'a> {
    pub work: &'a Work,
    pub counts: &'a [StageCount],
    pub written: &'a [Written],
}

impl Content {
    /// The page of a plan with these rows, each in the order of its table.
    pub fn of(visits: Vec<VisitRow>, figures: Vec<FigureRow>, about: &About<'_>) -> Self {
        let key = about.work.key();
        Self {
            robot: key.robot,
            plan: key.run,
            figures,
            visits,
            counts: about.counts.iter().map(count).collect(),
            provenance: made_from(about.work, about.written),
        }
    }

    /// The visit whose row states the promise, as every row does; `None` for a plan without a visit.
    pub(super) fn promise(&self) -> Option<&VisitRow> {
        self.visits.first()
    }

    /// The rows of one study, in the table's order.
    pub(super) fn of_study(&self, study: FigureStudy) -> Vec<&FigureRow> {
        let own = self.figures.iter().filter(|row| row.study == study);
        own.collect()
    }
}
