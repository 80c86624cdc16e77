//! Accuracy figures of residuals, for the measured point and, where the pipeline file states it, for the tool tip.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::commands::{commanded_turns, why_no_turns};
use super::judged::Judges;
use super::unseen::table_figure;
use super::{Driven, JoinedSession};
use crate::figures::{self, PoseErrors};
use crate::grid::Grids;
use crate::report::tip::{Turn, at_tip, expanded_uncertainty_mm, without_constant};
use crate::report::{
    Accuracy, Angles, BaseRefit, Finders, Model, Point, ResidualSet, Split, Subject, accuracy,
};

pub(super) struct FigureMaker<'f> {
    pub(super) judges: Judges<'f>,
    pub(super) grids: &'f Grids,
}

impl FigureMaker<'_> {
    /// Figures of every set of residuals, of the chosen table and of the session that a table drove.
    pub(super) fn figures(
        &self,
        residuals: &[ResidualSet],
        driven: Option<&Driven>,
    ) -> Vec<Accuracy> {
        let own = residuals.iter().map(|set| self.of(set, self.grids.guard_mm));
        let mut figures: Vec<Accuracy> = own.collect();
        figures.push(self.of_table());
        for (driven, set) in sets(driven) {
            figures.push(Accuracy {
                point: Point::Tool,
                driven_by: Some(driven.key.run.clone()),
                ..self.of(set, self.grids.guard_mm)
            });
        }
        figures
    }

    /// Figures of all these sets for the tool tip; empty where the pipeline file does not state its position.
    pub(super) fn at_tip(
        &self,
        residuals: &[ResidualSet],
        driven: Option<&Driven>,
    ) -> Vec<Accuracy> {
        let Some(tip) = self.judges.settings.tool_tip else { return Vec::new() };
        let of_target = |set| self.carried(set, tip - self.target(set));
        let mut figures: Vec<Accuracy> = residuals.iter().map(of_target).collect();
        let lever = tip - self.judges.error_frame.flange_from_tool.translation.vector;
        figures.push(self.of_table_at_tip(lever));
        for (driven, set) in sets(driven) {
            figures.push(Accuracy {
                driven_by: Some(driven.key.run.clone()),
                ..self.carried(set, lever)
            });
        }
        figures
    }

    /// Position of the measured target of a set's session at the flange, mm.
    fn target(&self, set: &ResidualSet) -> Vector3<f64> {
        let of_session = |session: &JoinedSession| session.name == set.subject.of_session;
        // An unseen session is predicted with the frames of the first session.
        let place = self.judges.training.iter().position(of_session).unwrap_or(0);
        self.judges.frames[place].flange_from_target.isometry().translation.vector
    }

    fn of(&self, set: &ResidualSet, guard_mm: f64) -> Accuracy {
        let tolerance = &self.judges.settings.tolerance;
        let own =
            Accuracy { finders: self.finders(set), ..accuracy::accuracy(set, tolerance, guard_mm) };
        let subject = &set.subject;
        let foretells = (subject.model, subject.angles, subject.split)
            == (Model::Full, Angles::Commanded, Split::Blocks);
        if foretells && subject.of_session == self.judges.own().name {
            let moved = self.moved();
            let moved = |station| moved.get(&station).copied().unwrap_or_default();
            accuracy::with_between_session_variation(own, set, moved, tolerance)
        } else {
            own
        }
    }

    /// The stations that the base of a set's session was found from; `None` where they are not others than those that judge.
    fn finders(&self, set: &ResidualSet) -> Option<Finders> {
        let subject = &set.subject;
        let is_driven = subject.model.is_against_commands();
        let is_found = subject.split == Split::Session && subject.base_refit.judges() && !is_driven;
        let own = &subject.of_session;
        // A session of a pool is left out with a mounting of its own.
        let is_left_out = self.judges.training.iter().any(|session| session.name == *own);
        let mut tested = self.judges.test.iter().filter(|test| test.session.name == *own);
        let with_target = is_left_out || tested.any(|test| test.located.with_target());
        let locate = &self.judges.settings.locate;
        is_found.then(|| locate.finders(set.finders(), with_target))
    }

    /// The figures of a set at the tip, which is `lever` away along the flange's axes.
    fn carried(&self, set: &ResidualSet, lever: Vector3<f64>) -> Accuracy {
        let tip = at_tip(set, &lever);
        let figures = Accuracy { point: Point::Tip, ..self.of(&tip, self.guard_mm(&lever)) };
        if tip.residuals.is_empty() {
            Accuracy {
                verdict: why_no_turns(self.judges.settings, self.judges.own(), set.subject.model),
                ..figures
            }
        } else {
            figures
        }
    }

    fn guard_mm(&self, lever: &Vector3<f64>) -> f64 {
        let frames = &self.judges.error_frame.frames;
        let source = self.judges.settings.noise.source(frames.source);
        let middle = frames.tracker_from_base.isometry() * self.judges.middle();
        let orientation_rad = source.uncertainty.orientation_rad(&middle);
        expanded_uncertainty_mm(self.grids.guard_mm, orientation_rad.unwrap_or_default(), lever)
    }

    /// The figures of the chosen table, of its nodes or local cells, whichever has the larger bound; none where no step gives a table.
    fn of_table(&self) -> Accuracy {
        let chosen = self.grids.deciding();
        let of = (Split::Blocks, &*self.judges.own().name);
        let subject = Subject::new(of, Model::Table, Angles::Commanded, BaseRefit::None);
        let verdict = self.grids.choice.verdict.clone();
        Accuracy {
            bound: self.grids.chosen().and_then(|chosen| chosen.bound),
            blocks: chosen.map(|chosen| chosen.held_out.blocks.len()),
            ..table_figure(chosen, subject, verdict, self.grids.guard_mm)
        }
    }

    /// A table corrects the tool point and leaves orientations as commanded: the tip has all of their error.
    fn of_table_at_tip(&self, lever: Vector3<f64>) -> Accuracy {
        let turns = self.turns_by_station();
        let (moved, tolerance) = (self.moved(), &self.judges.settings.tolerance);
        let mut norms = Vec::new();
        let (mut by_pose, mut between_sessions) = (PoseErrors::default(), PoseErrors::default());
        let left = self.grids.deciding().map(|chosen| &chosen.held_out.left);
        for left in left.into_iter().flatten() {
            let Some(turn) = turns.get(&left.station) else { continue };
            let error = left.error + turn.at_end_of(&lever);
            norms.push(error.norm());
            by_pose.add(left.pose, left.station, left.sample, error.norm());
            let days = moved.get(&left.station).copied().unwrap_or_default();
            for (day, moved) in days.iter().enumerate() {
                let sample = left.sample * days.len() + day;
                between_sessions.add(left.pose, left.station, sample, (error + moved).norm());
            }
        }
        let of = |errors: &PoseErrors| errors.bound(tolerance.coverage());
        // The bound is never less than the session's own.
        let bound =
            of(&by_pose).map(|own| of(&between_sessions).map_or(own, |other| own.max(other)));
        let counted = by_pose.counted();
        let guard_mm = self.guard_mm(&lever);
        Accuracy {
            point: Point::Tip,
            figures: figures::Figures::of(&norms),
            bound,
            counted,
            expanded_uncertainty_mm: guard_mm,
            verdict: if turns.is_empty() {
                why_no_turns(self.judges.settings, self.judges.own(), Model::Table)
            } else {
                tolerance.verdict(bound, counted, guard_mm)
            },
            ..self.of_table()
        }
    }

    /// The attained and the commanded orientation of the flange at each station of the last session, by station number.
    fn turns_by_station(&self) -> BTreeMap<usize, Turn> {
        let session = self.judges.own();
        let turns = without_constant(&commanded_turns(session, self.judges.error_frame), |_| true);
        let stations = session.joined.stations.iter().zip(turns);
        stations.filter_map(|(station, turn)| Some((station.number, turn?))).collect()
    }

    /// Changes of each station's error that another session may bring.
    fn moved(&self) -> BTreeMap<usize, &[Vector3<f64>]> {
        let stations = self.judges.stations.iter();
        stations.map(|station| (station.number, &*station.between_sessions)).collect()
    }
}

/// The sets of a session that a table drove.
fn sets(driven: Option<&Driven>) -> impl Iterator<Item = (&Driven, &ResidualSet)> {
    driven.into_iter().flat_map(|driven| driven.sets().map(move |set| (driven, set)))
}
