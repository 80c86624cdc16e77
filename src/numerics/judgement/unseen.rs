//! Sessions that only judge: the judgement of each on full error model and published table, and whether of this arm.
//!
//! The table is stated in the frame of the session that it was made from. A test session is carried there by the stations that
//! find its base for every verdict: their predictions in that frame are aligned with the positions that the tracker measured. The
//! other stations judge; further visits of the poses of the first do not.

use std::collections::BTreeSet;

use super::gridded::grid_stations;
use super::judged::{Judges, TestSession};
use crate::figures::median;
use crate::fit::same_arm::{self, LeftBy};
use crate::fit::{ErrorFrame, FramePair, ToolErrors};
use crate::geometry::Transform;
use crate::grid::{GridStation, Grids, Judged, Verdict};
use crate::join::SeveralSources;
use crate::report::locate::{Locate, Located};
use crate::report::refit::Placed;
use crate::report::verdict::{
    Judge, ProductVerdict, Remark, RunVerdict, figure_of, figure_of_model,
};
use crate::report::{
    Accuracy, Angles, BaseRefit, Model, Moment, Point, ResidualSet, Split, Subject, accuracy,
    unseen,
};
use crate::similarity::Semivariogram;

impl Judges<'_> {
    /// Judges the chosen table by every test session, as rows of `grids`.
    pub(super) fn judge_table(&self, grids: &mut Grids) {
        let errors = ToolErrors::new(self.models.best().1, self.last(), self.error_frame);
        for test in self.test {
            grids.judge_by_session(
                &test.session.name,
                &self.stations(test, &errors),
                &errors,
                &self.settings.tolerance,
            );
        }
    }

    /// The stations of a test session that judge, in the table's frame; empty where its base cannot be found.
    fn stations(&self, test: &TestSession<'_>, errors: &ToolErrors<'_>) -> Vec<GridStation> {
        let session = test.session;
        // Blocks are of training sessions: a test session is one whole.
        let whole = |_| Some(0);
        let finders = test.numbers();
        let mut finding = grid_stations(session, self.error_frame, whole);
        finding.retain(|station| finders.contains(&station.number));
        let Some(error_frame) = self.carried(test, &finding, errors) else { return Vec::new() };
        let taken: BTreeSet<usize> = finding.iter().map(|station| station.pose).collect();
        let mut stations = grid_stations(session, &error_frame, whole);
        stations.retain(|station| !taken.contains(&station.pose));
        stations
    }

    /// The table's error reference frame, found from stations of a session and its tracker's place.
    fn carried(
        &self,
        test: &TestSession<'_>,
        finding: &[GridStation],
        errors: &ToolErrors<'_>,
    ) -> Option<ErrorFrame<'_>> {
        let flange_from_tool = self.error_frame.flange_from_tool;
        let placed = |station: &GridStation| {
            let flange = station.orientation * flange_from_tool.rotation.inverse();
            let tool = station.position + errors.error(&station.joints).ok()?;
            Some(Placed { position: tool - flange * self.error_frame.lever(), flange })
        };
        // A station whose command is not known finds no frame of commands.
        let of = |&finder: &usize| {
            let number = test.observations[finder].station;
            // Placed is the target that errors are stated by.
            let is_own = test.observations[finder].target == self.error_frame.frames.target;
            let station = finding.iter().find(|own| own.number == number)?;
            is_own.then_some(())?;
            Some((finder, placed(station)?))
        };
        let (finders, placed): (Vec<usize>, Vec<Placed>) =
            test.located.finders.iter().filter_map(of).unzip();
        let own_target = test.located.target_sd_mm;
        let observations = &test.observations;
        let found = self.locator.refit(self.models, observations, &finders, own_target, &placed)?;
        let mut target = *self.error_frame.frames.flange_from_target.isometry();
        target.translation.vector += found.target_shift;
        let frames = FramePair {
            tracker_from_base: Transform::claim(found.base_from_tracker.inverse()),
            flange_from_target: Transform::claim(target),
            ..self.error_frame.frames
        };
        // The orientation of a target of its own is not known: measured orientations do not show the tool's.
        let oriented = self.settings.noise.takes_orientations() && own_target.is_none();
        Some(ErrorFrame::new(self.arm, frames, Some(flange_from_tool), oriented))
    }

    /// The verdict of the run: of the table and of every identified model, each by held-out blocks and by every test session.
    pub(super) fn verdict(
        &self,
        grids: &Grids,
        accuracy: &[Accuracy],
        residuals: &[ResidualSet],
        semivariograms: &[(Model, Vec<Semivariogram>)],
    ) -> Result<RunVerdict, SeveralSources> {
        let remarks = self.test.iter().map(|test| self.remark(test, residuals));
        let remarks: Vec<Option<Remark>> = remarks.collect::<Result<_, _>>()?;
        let identified = Model::ALL.iter().copied();
        let identified = identified.filter(|model| self.models.get(*model).is_some());
        let models = identified.map(|model| (model, self.of_model(model, accuracy, &remarks)));
        let of_table = self.of_table(grids, accuracy, &remarks);
        let mut verdict = RunVerdict::of(of_table, models.collect(), self.models.best().0);
        let by_poses = self.by_poses();
        verdict.limit = self.limit(&verdict, grids, accuracy, semivariograms, by_poses);
        verdict.means_by_poses_mm = by_poses.map(|own| own.means_mm);
        Ok(verdict)
    }

    /// The verdict of the table, by held-out blocks and by what each test session says of it and of the model.
    fn of_table(
        &self,
        grids: &Grids,
        accuracy: &[Accuracy],
        remarks: &[Option<Remark>],
    ) -> ProductVerdict {
        let tolerance = &self.settings.tolerance;
        let own = &self.own().name;
        let blocks = of_table(accuracy, Split::Blocks, own).map(|table| {
            let chosen = grids.chosen();
            let covered = chosen.and_then(|chosen| chosen.covered.as_ref());
            let mut harms = [chosen, grids.deciding()].into_iter().flatten();
            let harms = harms.any(|own| own.held_out.is_no_help());
            Judge::blocks(own, table, covered, tolerance).harmed(harms)
        });
        let sessions = self.test.iter().zip(remarks).map(|(test, remark)| {
            let name = &test.session.name;
            let model = figure_of_model(accuracy, name);
            let table = model.and_then(|_| of_table(accuracy, Split::Session, name));
            let row = grids.judged.iter().find(|row| row.of_test.as_ref() == Some(name));
            let covered = row.and_then(|row| row.covered.as_ref());
            let table = table.map(|table| (table, covered));
            let harms = row.is_some_and(|row| row.held_out.is_no_help());
            Judge::session(name, model, table, tolerance, remark.clone()).harmed(harms)
        });
        ProductVerdict::of(blocks.into_iter().chain(sessions).collect())
    }

    /// The verdict of an identified model, by held-out blocks and by each test session.
    fn of_model(
        &self,
        model: Model,
        accuracy: &[Accuracy],
        remarks: &[Option<Remark>],
    ) -> ProductVerdict {
        let tolerance = &self.settings.tolerance;
        let own = &self.own().name;
        // Base and target alone, at the same stations with a base found in the same way.
        let harms = |figure: &Accuracy| {
            let (split, session) = (figure.subject.split, &figure.subject.of_session);
            let alone = figure_of(accuracy, Model::BaseTarget, split, session);
            let means = figure.figures.zip(alone.and_then(|alone| alone.figures));
            let harms = means.is_some_and(|(own, alone)| own.mean >= alone.mean);
            harms && model != Model::BaseTarget
        };
        let blocks = figure_of(accuracy, model, Split::Blocks, own);
        let blocks =
            blocks.map(|figure| Judge::blocks(own, figure, None, tolerance).harmed(harms(figure)));
        let sessions = self.test.iter().zip(remarks).map(|(test, remark)| {
            let name = &test.session.name;
            let figure = figure_of(accuracy, model, Split::Session, name);
            Judge::session(name, figure, None, tolerance, remark.clone())
                .harmed(figure.is_some_and(harms))
        });
        ProductVerdict::of(blocks.into_iter().chain(sessions).collect())
    }

    /// What has to be known of a test session: that the identified arm does not fit it, or that its target is not the known one.
    fn remark(
        &self,
        test: &TestSession<'_>,
        residuals: &[ResidualSet],
    ) -> Result<Option<Remark>, SeveralSources> {
        let Some(away) = test.located.contradicted else {
            return Ok(self.unfit(test, residuals, residuals).map(Remark::OtherArm));
        };
        // The same session with the other target.
        let is_found = test.located.with_target();
        let other = Located {
            target_sd_mm: (!is_found).then(|| self.locator.target_sd_mm(&away)),
            ..test.located.clone()
        };
        let other = unseen::unseen_session(self.models, test.stations(), self.locator, &other)?;
        let (with_known, with_own) =
            if is_found { (&other[..], residuals) } else { (residuals, &other[..]) };
        // Errors of another arm displace the target too.
        if let Some(unfit) = self.unfit(test, with_own, residuals) {
            return Ok(Some(Remark::OtherArm(unfit)));
        }
        let name = &test.session.name;
        let left = |sets| self.left_in_words(sets, name).unwrap_or_default();
        let mut words = format!(
            "its stations say that the reflector was put on again or moved: it is {:.3} mm from where the model knows it, and one that stayed seems less than \
             {:.3} mm away in 99 of 100 sessions; with the known one the model leaves {}; with its own, found with the base, {}",
            away.mm,
            away.allowed_mm,
            left(with_known),
            left(with_own),
        );
        if !is_found {
            words +=
                "; [report] locate has target = \"known\": leave that out, and its own is taken";
        }
        Ok(Some(Remark::OtherTarget(words)))
    }

    /// What the best model leaves at the stations of a test session that judge.
    fn left_in_words(&self, sets: &[ResidualSet], session: &str) -> Option<String> {
        let best = self.models.best().0;
        // From commands alone, where there are any.
        let set = sets.iter().rfind(|set| {
            let own = &set.subject;
            own.model == best && own.base_refit.judges() && own.of_session == session
        })?;
        let of = accuracy::accuracy(set, &self.settings.tolerance, 0.0);
        let inside = of.coverage.map_or_else(String::new, |own| {
            format!(", {:.0} % inside the 95 % ellipsoids", 100.0 * own.inside)
        });
        Some(format!("{:.3} mm (mean){inside}", of.figures?.mean))
    }

    /// A test session that the identified arm does not fit, by the residuals in frames of its own; `None` where it fits.
    fn unfit(
        &self,
        test: &TestSession<'_>,
        own: &[ResidualSet],
        residuals: &[ResidualSet],
    ) -> Option<String> {
        // Without the full error model the only question is whether the model improves anything.
        let full = self.models.full.is_some();
        let best = self.models.best().0;
        let name = &test.session.name;
        let left = left_by(own, best, name, Split::Session, BaseRefit::All)?;
        let target = self.frames[self.last()].flange_from_target.isometry().translation.vector;
        let change_rad = self.settings.full.session_curve_sd_rad;
        let fit = same_arm::unseen(self.arm, &test.observations, &target, &left, change_rad)?;
        if fit.is_same_arm() || (!full && left.identified < left.nominal) {
            return None;
        }
        let blocks = left_by(residuals, best, &self.own().name, Split::Blocks, BaseRefit::None);
        let improves = blocks.is_some_and(|blocks| blocks.improves());
        let question = if improves {
            "another arm, this one before or after a repair, or poses unlike those it was learnt at?"
        } else {
            "it does not on held-out blocks either"
        };
        Some(format!(
            "the model hardly improves this session: it leaves {:.3} mm where the nominal arm leaves {:.3} mm (medians, base refitted \
             on all of it); one arm would leave {:.3} mm by noise and changes, or at most half of what the nominal one does: {question}",
            fit.shared_mm, fit.nominal_mm, fit.allowed_mm
        ))
    }
}

/// The figure of the chosen table by held-out blocks or by a test session.
fn of_table<'a>(accuracy: &'a [Accuracy], split: Split, session: &str) -> Option<&'a Accuracy> {
    accuracy.iter().find(|own| {
        let subject = &own.subject;
        (subject.model, subject.split, own.moment) == (Model::Table, split, Moment::After)
            && subject.of_session == session
    })
}

/// The figures of the chosen table at the stations of each test session.
pub(super) fn table_figures(
    grids: &Grids,
    tested: &[TestSession<'_>],
    locate: &Locate,
) -> Vec<Accuracy> {
    let figure = |row: &Judged| {
        let session = row.of_test.as_ref()?;
        let test = tested.iter().find(|test| test.session.name == *session)?;
        let of = (Split::Session, &**session);
        let subject = Subject::new(of, Model::Table, Angles::Commanded, locate.base_refit());
        Some(Accuracy {
            finders: Some(locate.finders(test.numbers().len(), test.located.with_target())),
            ..table_figure(Some(row), subject, row.verdict.clone(), grids.guard_mm)
        })
    };
    grids.judged.iter().filter_map(figure).collect()
}

/// The figures of a table by one of its rows.
pub(super) fn table_figure(
    row: Option<&Judged>,
    subject: Subject,
    verdict: Verdict,
    guard_mm: f64,
) -> Accuracy {
    Accuracy {
        subject,
        point: Point::Tool,
        moment: Moment::After,
        driven_by: None,
        figures: row.and_then(|row| row.figures),
        bound: row.and_then(|row| row.bound),
        counted: row.map(|row| row.held_out.counted()).unwrap_or_default(),
        finders: None,
        blocks: None,
        coverage: None,
        expanded_uncertainty_mm: guard_mm,
        verdict,
    }
}

/// Median distances that the model and the nominal arm leave at the stations of a session, mm.
fn left_by(
    residuals: &[ResidualSet],
    best: Model,
    session: &str,
    split: Split,
    base_refit: BaseRefit,
) -> Option<LeftBy> {
    let of = |model: Model| {
        let angles = *model.about().angles.first()?;
        let set = residuals.iter().find(|set| {
            let subject = &set.subject;
            (subject.model, subject.angles, subject.split) == (model, angles, split)
                && (subject.base_refit, &*subject.of_session) == (base_refit, session)
        })?;
        median(&set.residuals.iter().map(|r| r.residual.norm()).collect::<Vec<_>>())
    };
    Some(LeftBy { identified: of(best)?, nominal: of(Model::BaseTarget)? })
}
