//! Grids and residuals → the chosen table judged, all figures, and the verdict.

use super::figures::FigureMaker;
use super::judged::Judges;
use super::{Driven, commands, iso_9283, sizes, unseen};
use crate::fit::scale::SessionScale;
use crate::grid::Grids;
use crate::join::SeveralSources;
use crate::report::iso_9283::Iso9283;
use crate::report::verdict::RunVerdict;
use crate::report::{Accuracy, Model, ResidualSet};
use crate::similarity::Semivariogram;

/// What correction by the table or by the identified arm leaves.
pub(super) struct Corrections {
    pub(super) grids: Grids,
    pub(super) driven: Option<Driven>,
    pub(super) scales: Vec<SessionScale>,
    pub(super) accuracy: Vec<Accuracy>,
    pub(super) at_tip: Vec<Accuracy>,
    pub(super) iso_9283: Vec<Iso9283>,
    pub(super) verdict: RunVerdict,
}

impl Judges<'_> {
    pub(super) fn corrections(
        &self,
        mut grids: Grids,
        residuals: &[ResidualSet],
        semivariograms: &[(Model, Vec<Semivariogram>)],
    ) -> Result<Corrections, SeveralSources> {
        self.judge_table(&mut grids);
        let driven = commands::driven_by(self.own(), self.error_frame, self.settings);
        let by_table = driven.as_ref();
        let iso_9283 = iso_9283::figures(*self, residuals, by_table, grids.guard_mm);
        let maker = FigureMaker { judges: *self, grids: &grids };
        let mut accuracy = maker.figures(residuals, by_table);
        accuracy.extend(unseen::table_figures(&grids, self.test, &self.settings.locate));
        let mut at_tip = maker.at_tip(residuals, by_table);
        let scales = sizes::scales(self.observed, self.models, self.training, self.settings);
        sizes::withhold(&scales, &mut grids, accuracy.iter_mut().chain(&mut at_tip));
        let verdict = self.verdict(&grids, &accuracy, residuals, semivariograms)?;
        Ok(Corrections { grids, driven, scales, accuracy, at_tip, iso_9283, verdict })
    }
}
