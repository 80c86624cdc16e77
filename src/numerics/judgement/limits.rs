//! The parts of the errors of a result that does not meet the tolerance, for [`crate::report::limit`].

use rayon::prelude::*;

use super::judged::Judges;
use crate::figures::{Figures, clustered_mean};
use crate::fit::model::{At, PoseModel as _, Query};
use crate::fit::{self, Freedom, holdout};
use crate::grid::{Grids, Verdict};
use crate::report::limit::{ByPoses, limit};
use crate::report::verdict::{Applied, RunVerdict, figure_of};
use crate::report::{Accuracy, BaseRefit, Model, Split, Subject};
use crate::similarity::{Quantity, Semivariogram, Space};

/// Multiples of it modulo 1 spread evenly, whatever the step between them.
const GOLDEN: f64 = 0.618_033_988_749_894_9;

impl Judges<'_> {
    /// What limits a result that does not meet the tolerance, and what would change it, in words; `None` of another result.
    pub(super) fn limit(
        &self,
        verdict: &RunVerdict,
        grids: &Grids,
        accuracy: &[Accuracy],
        semivariograms: &[(Model, Vec<Semivariogram>)],
        by_poses: Option<ByPoses>,
    ) -> Option<String> {
        let judge = verdict.headline().decides();
        let judge = judge.filter(|judge| judge.verdict == Verdict::DoesNotMeet)?;
        let figure = judge.figure.as_ref()?;
        let square = |figures: Figures| figures.rms.powi(2);
        let all_find_it = Subject { base_refit: BaseRefit::All, ..figure.subject.clone() };
        let base = accuracy.iter().find(|own| own.subject == all_find_it);
        let is_table = figure.subject.split == Split::Blocks && verdict.applied == Applied::Table;
        let direct = grids.deciding().filter(|_| is_table);
        let best = self.models.best().0;
        let mut near = semivariograms.iter().filter(|(of, _)| *of == best);
        let mut near = near.next()?.1.iter();
        let near = near.find(|of| (of.space, of.quantity) == (Space::Joint, Quantity::Norm))?;
        let trained = figure_of(accuracy, best, Split::None, &self.own().name);
        let points = self.observed.all.iter().filter_map(|own| own.point());
        let noise: Vec<f64> = points.map(|own| own.factor.norm_squared()).collect();
        let own = figure.figures?;
        let beside = |without: Option<Figures>| Some([square(own), square(without?)]);
        let parts = [
            figure.bound.map(|bound| [bound.powi(2), own.max.powi(2)]),
            beside(base.and_then(|own| own.figures)),
            beside(direct.and_then(|own| Figures::of(&own.held_out.direct))),
            near.models.first().map(|of| [square(own), square(own) - of.nugget]),
            beside(trained.and_then(|own| own.figures)),
        ];
        let noise_mm2 = noise.iter().sum::<f64>() / noise.len().max(1) as f64;
        Some(limit(noise_mm2, parts, by_poses))
    }

    /// Errors of the geometry at held-out blocks by the share of the other poses that train it; `None` where these are too few.
    pub(super) fn by_poses(&self) -> Option<ByPoses> {
        let (quarter, half, all) = (self.left_by(0.25)?, self.left_by(0.5)?, self.left_by(1.0)?);
        let gains: Vec<f64> = half.iter().zip(&all).map(|(half, all)| half - all).collect();
        let own = self.observed.of_session(self.last());
        let folds: Vec<usize> = own.map(|(_, fold)| fold).collect();
        let (gain, standard_error) = clustered_mean(&gains, &folds)?;
        let mean = |errors: &[f64]| errors.iter().sum::<f64>() / errors.len() as f64;
        Some(ByPoses {
            means_mm: [mean(&quarter), mean(&half), mean(&all)],
            falls: gain > (2.0 * standard_error).max(self.settings.grid.within * mean(&all)),
        })
    }

    /// The error at each held-out station of the geometry that is fitted to a share of the poses, mm.
    fn left_by(&self, share: f64) -> Option<Vec<f64>> {
        let of_fold = |fold: usize| {
            let mut train = self.observed.without(fold);
            train.retain(|own| (own.pose as f64 * GOLDEN).fract() < share);
            let (sessions, fit) = (self.frames.len(), &self.settings.fit);
            fit::identify(self.arm, &train, sessions, Freedom::Geometry, fit).ok()
        };
        let folds: Vec<_> = (0..holdout::FOLDS).into_par_iter().map(of_fold).collect();
        let left = self.observed.of_session(self.last()).map(|(own, fold)| {
            let found = folds[fold].as_ref()?.position(&At::Joints(Query::of(own)));
            Some((own.point()?.position - found.ok()?).norm())
        });
        left.collect()
    }
}
