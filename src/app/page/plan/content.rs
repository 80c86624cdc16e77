//! The content of a plan's page: the rows of its published tables, and the plan's statements that no table has.

use crate::io::tables::plan_figures::{FigureRow, FigureStudy};
use crate::io::tables::sampling_plan::VisitRow;
use crate::manifest::{StageCount, Work, Written};

#[derive(Debug, Clone, PartialEq)]
pub struct Content {
    pub robot: String,
    /// The plan's id: its run.
    pub plan: String,
    /// `plan_figures`, in the table's order.
    pub figures: Vec<FigureRow>,
    /// `sampling_plan`, in the order of visits.
    pub visits: Vec<VisitRow>,
    pub counts: Vec<StageCount>,
    pub work: Work,
    pub written: Vec<Written>,
}

impl Content {
    /// The visit whose row states the promise, as every row does; `None` for a plan without a visit.
    pub(super) fn promise(&self) -> Option<&VisitRow> {
        self.visits.first()
    }

    /// The rows of one study, in the table's order.
    pub(super) fn of_study(&self, study: FigureStudy) -> Vec<&FigureRow> {
        self.figures.iter().filter(|row| row.study == study).collect()
    }
}
